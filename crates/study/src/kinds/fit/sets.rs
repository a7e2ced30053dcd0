//! Reads a set of measured numbers, and their noise.

use deserr::Deserr;
use fretwork_engine::{Dimension, Faults, Given, History, Valid, outcome, twelve_digits, unknown};
use serde_json::{Map, Value, json};

use super::model::{MeasuredQuantity, Set};
use crate::member::read;
use fretwork_json::{Whole, typed};

/// Maximum number of cycles, a tenth of that of a run.
const MAX_X: f64 = 1e14;
/// The output that is the wear volume times `density`.
const MASS_LOSS: &str = "mass_loss";
/// The least density of a worn body, in kg/m³. Those of solids in g/cm³ are smaller.
const LEAST_DENSITY: f64 = 30.0;
/// The columns that a run states about itself, which cannot be measured.
const STATED: [&str; 3] = ["normalized_cycles", "wear_volume_error", "wear_depth_error"];
/// The members that say how large the noise of a set is.
const NOISE: [&str; 3] = ["sigma", "relative", "noise"];
/// Noise of a set whose noise is estimated before its first estimate, relative to its largest number.
const FIRST_NOISE: f64 = 0.1;
/// The smallest noise in SI. Squares of residuals with less noise could exceed the largest number.
const TINY: f64 = 1e-100;

/// Measured numbers of a column of the history.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct Scalars {
    output: String,
    #[deserr(default)]
    over: Given<SetOver>,
    x: Vec<Value>,
    y: Vec<Value>,
    #[deserr(default)]
    density: Given<f64>,
}

#[derive(Deserr)]
#[deserr(error = Faults, rename_all = lowercase)]
enum SetOver {
    Cycles,
    #[deserr(rename = "dissipated_energy")]
    Energy,
}

/// A measured profile.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct Trace {
    profile: SetField,
    at: f64,
    #[deserr(default)]
    body: Given<Whole<1, 2>>,
    radius: Vec<Value>,
    depth: Vec<Value>,
}

#[derive(Deserr)]
#[deserr(error = Faults, rename_all = lowercase)]
enum SetField {
    Wear,
}

/// The noise of a set.
#[derive(Deserr)]
#[deserr(error = Faults)]
struct Noise {
    #[deserr(default)]
    sigma: Given<Value>,
    #[deserr(default)]
    relative: Given<f64>,
    #[deserr(default, rename = "noise")]
    kind: Given<Value>,
}

/// The member `noise`: `"estimate"`, or an object. Without `relative`, its size is estimated.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct Scatter {
    #[deserr(default)]
    relative: Given<f64>,
    #[deserr(default)]
    kind: Given<Scale>,
}

#[derive(Deserr, PartialEq)]
#[deserr(error = Faults, rename_all = lowercase)]
enum Scale {
    Normal,
    Lognormal,
}

impl Noise {
    /// Reads the kind of the noise and its share of the numbers into a set. Returns the standard deviations that do not depend
    /// on the numbers.
    fn read_into(self, set: &mut Set, count: usize) -> Valid<Vec<Value>> {
        let wrong = |name: &str, detail: &str| Err(Faults::one(name, detail));
        let Self { sigma: Given(sigma), relative: Given(mut relative), kind } = self;
        let mut pointer = "/relative";
        match kind.0 {
            None => {}
            Some(word) if word == "estimate" => set.is_estimated = true,
            Some(Value::Object(own)) => {
                let read = typed::<Scatter>(own.into()).map_err(|faults| faults.below("/noise"))?;
                if relative.is_some() || sigma.is_some() {
                    let detail = "has the noise, so `sigma` and `relative` have no meaning beside it. Remove them";
                    return wrong("/noise", detail);
                }
                set.is_log = read.kind.0 == Some(Scale::Lognormal);
                set.is_estimated = read.relative.0.is_none();
                (relative, pointer) = (read.relative.0.or(Some(FIRST_NOISE)), "/noise/relative");
            }
            Some(_) => {
                let detail = "must be \"estimate\", or an object such as {\"relative\": 0.2, \"kind\": \"lognormal\"}";
                return wrong("/noise", detail);
            }
        }
        let share = relative.unwrap_or(0.0);
        if !(0.0..=1.0).contains(&share) {
            let detail = format!(
                "is {share}, but it is a share of each number, from 0 to 1. Enter {} for {share} %",
                0.01 * share
            );
            return wrong(pointer, &detail);
        }
        set.share = share;
        Ok(match sigma {
            Some(Value::Array(list)) => list,
            Some(one) => vec![one; count],
            // Without any size, all numbers of a set have the same noise. Its first estimate follows from them.
            None if relative.is_some() || set.is_estimated => vec![json!(0); count],
            None => {
                let detail = "is missing. Enter `sigma`, `relative`, or \"noise\": \"estimate\"";
                return wrong("/sigma", detail);
            }
        })
    }
}

/// Reads a quantity with this SI unit. Null is not measured.
fn number(value: &Value, unit: &str) -> Result<Option<f64>, String> {
    let dimension = Dimension::all().find(|it| it.si() == unit);
    let dimension = dimension.unwrap_or(Dimension::Number);
    if value.is_null() { Ok(None) } else { read(value, dimension).map(|x| Some(twelve_digits(x))) }
}

/// Reads a set of measured numbers.
pub fn set(test: usize, given: &Value) -> Valid<Set> {
    let members = given.as_object().cloned().unwrap_or_default().into_iter();
    let (noise, own): (Map<_, _>, Map<_, _>) =
        members.partition(|(name, _)| NOISE.contains(&name.as_str()));
    let (output, unit, over, quantity, x, y) = if own.contains_key("profile") {
        let Trace { profile: SetField::Wear, at, body, radius, depth } = typed(own.into())?;
        let body = body.0.map(|body| body.0 as usize - 1);
        let quantity = MeasuredQuantity::Profile { at: twelve_digits(at), body };
        ("profile.wear".to_owned(), "m", "radius", quantity, radius, depth)
    } else {
        let Scalars { output, over, x, y, density } = typed(own.into())?;
        let (column, is_mass) = (column_of(&output)?, output == MASS_LOSS);
        if is_mass != density.0.is_some() || density.0.is_some_and(|density| density <= 0.0) {
            let detail = "belongs to `mass_loss`, which needs it: a number in kg/m³ greater than 0";
            return Err(Faults::one("/density", detail));
        }
        if let Some(low) = density.0.filter(|density| *density < LEAST_DENSITY) {
            let detail = format!("is {low} kg/m³. If it is in g/cm³, enter {}", 1000.0 * low);
            return Err(Faults::one("/density", detail));
        }
        let unit = outcome::Quantity::named(column).map_or("1", |quantity| quantity.unit);
        let quantity = MeasuredQuantity::Column { column, factor: density.0.unwrap_or(1.0) };
        let over = match over.0 {
            Some(SetOver::Energy) => "dissipated_energy",
            Some(SetOver::Cycles) | None => "cycles",
        };
        (output, if is_mass { "kg" } else { unit }, over, quantity, x, y)
    };
    let set = Set { test, output, unit, over, quantity, ..Set::default() };
    with_numbers(set, &x, &y, typed(noise.into())?)
}

/// Reads and checks the numbers of a set.
fn with_numbers(mut set: Set, x: &[Value], y: &[Value], noise: Noise) -> Valid<Set> {
    let (of_x, of_y, x_unit) = match set.over {
        "radius" => ("radius", "depth", "m"),
        "dissipated_energy" => ("x", "y", "J"),
        _ => ("x", "y", "1"),
    };
    let wrong = |name: &str, detail: &str| Err(Faults::one(&format!("/{name}"), detail));
    let (count, places, is_profile) = (y.len(), x.len(), set.over == "radius");
    let sigma = noise.read_into(&mut set, count)?;
    for (name, numbers) in [(of_y, count), ("sigma", sigma.len())] {
        if numbers != places || numbers == 0 {
            let detail = format!(
                "has {numbers} numbers for {places} places. Enter as many, and at least one; `sigma` is one number, or as many"
            );
            return wrong(name, &detail);
        }
    }
    let are_equal = |list: &[Value]| list.iter().all(|it| *it == list[0] && !it.is_null());
    if count > 1 && are_equal(x) && are_equal(y) {
        return wrong(of_y, &format!("has the same point {count} times. Enter it once"));
    }
    let mut faults = Faults::default();
    for place in 0..count {
        let mut read = |name: &str, value: &Value, unit: &str| {
            faults.keep(&format!("/{name}/{place}"), number(value, unit))
        };
        let (x, y) = (read(of_x, &x[place], x_unit), read(of_y, &y[place], set.unit));
        let (Some(x), Some(y), Some(sigma)) = (x, y, read("sigma", &sigma[place], set.unit)) else {
            continue;
        };
        let fault = match (x, y) {
            (None, _) => Some((of_x, "must be a number")),
            // The start of a test.
            (Some(0.0), None | Some(0.0)) if !is_profile => continue,
            (Some(x), _) if x < 0.0 || x == 0.0 && !is_profile || x > MAX_X => Some((
                of_x,
                "must be greater than 0 and at most 1e14. A radius can be 0, and so can the start with the number 0",
            )),
            (_, Some(y)) if y <= 0.0 && set.is_log => Some((
                of_y,
                "must be greater than 0 if the noise is lognormal. Enter null if it is not known",
            )),
            _ if sigma.is_none_or(|it| it < 0.0) => Some(("sigma", "must be a number from 0 on")),
            _ => None,
        };
        if let Some((name, detail)) = fault {
            faults.add(format!("/{name}/{place}"), detail);
        }
        set.x.extend(x);
        set.y.push(y);
        set.pointers.push(format!("/{of_y}/{place}"));
        set.noise.push(sigma.unwrap_or(0.0));
    }
    let share = set.share * set.least();
    if set.is_estimated && share == 0.0 && set.noise.iter().all(|sigma| *sigma == 0.0) {
        let first = (FIRST_NOISE * set.largest()).max(TINY);
        set.noise.fill(first);
    } else if let Some(place) = set.noise.iter().position(|it| libm::hypot(*it, share) < TINY) {
        let detail = "has no noise, or less than 1e-100. Enter a larger `sigma` or `relative`";
        faults.add(format!("/{of_y}/{place}"), detail);
    }
    if set.x.is_empty() && faults.0.is_empty() {
        faults.add(format!("/{of_y}"), "has no number after the start. Enter at least one");
    }
    faults.or(set)
}

/// The column of the history from which an output follows.
fn column_of(output: &str) -> Valid<&'static str> {
    let name = if output == MASS_LOSS { "wear_volume" } else { output };
    let columns = History::MEMBERS.iter().map(|member| member.name);
    let columns: Vec<_> = columns.filter(|name| !STATED.contains(name)).collect();
    columns.iter().copied().find(|known| *known == name).ok_or_else(|| {
        Faults::one("/output", unknown("output", name, &[&columns[..], &[MASS_LOSS]].concat()))
    })
}
