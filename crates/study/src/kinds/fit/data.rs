//! Reads the parameters and the tests of a fit.

use std::collections::BTreeMap;

use deserr::Deserr;
use fretwork_engine::numeric::twelve_digits;
use fretwork_engine::outcome::{self, History};
use fretwork_engine::request::fault::{Faults, unknown};
use fretwork_engine::request::fields::{Given, List};
use fretwork_engine::request::quantity::Dimension;
use serde_json::{Map, Value, json};

use super::model::{Over, Parameter, Position, Prior, Quantity, Set};
use super::search::{Fit, Task, tasks};
use super::source::{Need, Source, need};
use crate::member::Member;
use crate::profile::Field;
use crate::stats::design::Spacing;
use crate::stats::measured::{Measured, Point};
use crate::vary::{SpacingName, distribution_of, end_of, spacing_of};
use fretwork_json::{Whole, both, typed};

/// Maximum number of measured numbers.
const MAX_NUMBERS: usize = 2000;
/// Maximum bytes of the name of a test.
const MAX_NAME: usize = 80;
/// A set has a grid for bands if it has at most this many numbers; the numbers of points of a grid, and of all grids.
const DENSE: usize = 100;
const GRID: usize = 25;
const GRIDS: usize = 1000;
/// The output that is the wear volume times `density`.
const MASS_LOSS: &str = "mass_loss";
/// The columns that a run states about itself, which cannot be measured.
const STATED: [&str; 3] = ["normalized_cycles", "wear_volume_error", "wear_depth_error"];
/// The members that say how large the noise of a set is.
const NOISE: [&str; 3] = ["sigma", "relative", "noise"];
/// The default tolerance of runs, and the smallest one that a fit chooses because the noise is small. The error of a run
/// is about half of its tolerance, and should be at most a quarter of the noise.
const TOLERANCES: (f64, f64) = (3e-3, 1e-4);
const OF_NOISE: f64 = 0.5;
/// Noise of a set whose noise is estimated before its first estimate, relative to its largest number.
const FIRST_NOISE: f64 = 0.1;
/// Estimated number of runs of a source in a search, and more for each parameter.
const RUNS: (f64, f64) = (4.0, 6.0);

/// A parameter as a client writes it.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct GivenParameter {
    pointer: String,
    #[deserr(default, rename = "for")]
    only: Given<Vec<String>>,
    from: Value,
    to: Value,
    #[deserr(default)]
    spacing: Given<SpacingName>,
    #[deserr(default)]
    start: Given<Value>,
    #[deserr(default)]
    prior: Given<Value>,
}

/// A test as a client writes it.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct GivenTest {
    #[deserr(default)]
    name: Given<String>,
    #[deserr(default)]
    specimen: Given<String>,
    #[deserr(default)]
    changes: Given<BTreeMap<String, Value>>,
    data: List<Value, 1, MAX_NUMBERS>,
}

/// Measured numbers of a column of the history.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct Scalars {
    output: String,
    #[deserr(default)]
    over: Given<Over>,
    x: Vec<Value>,
    y: Vec<Value>,
    #[deserr(default)]
    density: Given<f64>,
}

/// A measured profile.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct Trace {
    #[deserr(rename = "profile")]
    field: Field,
    at: f64,
    #[deserr(default)]
    body: Given<Whole<1, 2>>,
    radius: Vec<Value>,
    depth: Vec<Value>,
}

/// The noise of a set.
#[derive(Deserr)]
#[deserr(error = Faults)]
struct Noise {
    #[deserr(default)]
    sigma: Given<Value>,
    #[deserr(default)]
    relative: Given<f64>,
    #[deserr(default)]
    noise: Given<Estimate>,
}

#[derive(Deserr)]
#[deserr(error = Faults, rename_all = lowercase)]
enum Estimate {
    Estimate,
}

/// A test: its scenario, and its specimen.
struct Test {
    name: String,
    specimen: Option<String>,
    scenario: Value,
}

/// Reads quantities. Null is not measured.
fn numbers(name: &str, list: &[Value], dimension: Dimension) -> Result<Vec<Option<f64>>, Faults> {
    let member = Member { pointer: String::new(), dimension, value: 0.0 };
    let read = |value: &Value| match value {
        Value::Null => Ok(None),
        value => member.read(value).map(|x| Some(twelve_digits(x))),
    };
    Faults::list(list.iter().map(read)).map_err(|faults| faults.below(&format!("/{name}")))
}

/// The dimension of numbers with this SI unit.
fn dimension_of(unit: &str) -> Dimension {
    Dimension::ALL.into_iter().find(|it| it.si() == unit).unwrap_or(Dimension::Number)
}

/// Reads a set of measured numbers.
fn set(test: usize, given: &Value) -> Result<Set, Faults> {
    let members = given.as_object().cloned().unwrap_or_default().into_iter();
    let (noise, own): (Map<_, _>, Map<_, _>) =
        members.partition(|(name, _)| NOISE.contains(&name.as_str()));
    let (quantity, output, unit, [(of_x, x), (of_y, y)]) = if own.contains_key("profile") {
        let Trace { field, at, body, radius, depth } = typed(own.into())?;
        let is_depth = field == Field::Wear || field == Field::Worn && body.0.is_none();
        if !is_depth || at.is_nan() || at <= 0.0 {
            let detail = "must be `wear` (the depth) or, without `body`, `worn` (the worn profile), with `at` more than 0";
            return Err(Faults::one("/profile", detail));
        }
        let body = body.0.map(|body| body.0 as usize - 1);
        let quantity = Quantity::Profile { field, at: twelve_digits(at), body };
        let lists = [("radius", radius), ("depth", depth)];
        (quantity, format!("profile.{}", field.name()), "m", lists)
    } else {
        let Scalars { output, over, x, y, density } = typed(own.into())?;
        let column = column_of(&output)?;
        let is_mass = output == MASS_LOSS;
        if is_mass != density.0.is_some() || density.0.is_some_and(|density| density <= 0.0) {
            let detail = "belongs to `mass_loss`, which needs it: a number in kg/m³ greater than 0";
            return Err(Faults::one("/density", detail));
        }
        let unit = outcome::Quantity::named(column).map_or("1", |quantity| quantity.unit);
        let (factor, over) = (density.0.unwrap_or(1.0), over.0.unwrap_or(Over::Cycles));
        let quantity = Quantity::Column { column, factor, over };
        (quantity, output, if is_mass { "kg" } else { unit }, [("x", x), ("y", y)])
    };
    let set = Set {
        test,
        output,
        unit,
        quantity,
        x: Vec::new(),
        y: Vec::new(),
        noise: Vec::new(),
        is_estimated: false,
    };
    let dimension = match set.over() {
        "radius" => Dimension::Length,
        "dissipated_energy" => Dimension::Energy,
        _ => Dimension::Number,
    };
    let x = numbers(of_x, &x, dimension);
    let (x, y) = both(x, numbers(of_y, &y, dimension_of(unit)))?;
    checked(Set { y, ..set }, (of_x, of_y), &x, typed(noise.into())?)
}

/// The column of the history from which an output follows.
fn column_of(output: &str) -> Result<&'static str, Faults> {
    let name = if output == MASS_LOSS { "wear_volume" } else { output };
    let columns = History::MEMBERS.iter().map(|member| member.name);
    let columns: Vec<_> = columns.filter(|name| !STATED.contains(name)).collect();
    columns.iter().copied().find(|known| *known == name).ok_or_else(|| {
        Faults::one("/output", unknown("output", name, &[&columns[..], &[MASS_LOSS]].concat()))
    })
}

/// Checks the numbers of a set, whose members have these names, and adds its noise and the points of a grid.
fn checked(
    mut set: Set,
    (of_x, of_y): (&str, &str),
    x: &[Option<f64>],
    Noise { sigma, relative, noise }: Noise,
) -> Result<Set, Faults> {
    let wrong = |place: &str, detail: String| Err(Faults::one(&format!("/{place}"), detail));
    let (count, is_profile) = (set.y.len(), of_x == "radius");
    let is_first = |it: (&Option<f64>, &Option<f64>)| it.1.is_some() && it == (&x[0], &set.y[0]);
    if x.len() != count || count == 0 {
        let detail = "numbers for {} places. Enter as many, and at least one";
        return wrong(of_y, format!("has {count} {}", detail.replace("{}", &x.len().to_string())));
    }
    if count > 1 && x.iter().zip(&set.y).all(is_first) {
        return wrong(of_y, format!("has the same point {count} times. Enter it once"));
    }
    set.is_estimated = noise.0.is_some();
    let is_stated = sigma.0.is_some() || relative.0.is_some();
    if !is_stated && !set.is_estimated {
        let detail = "is missing. Enter `sigma`, `relative`, or \"noise\": \"estimate\"";
        return wrong("sigma", detail.to_owned());
    }
    let first = if is_stated { 0.0 } else { FIRST_NOISE * set.largest() };
    let sigma = match sigma.0 {
        Some(Value::Array(list)) => list,
        one => vec![one.unwrap_or(json!(first)); count],
    };
    let sigma = numbers("sigma", &sigma, dimension_of(set.unit))?;
    if sigma.len() != count {
        let detail =
            format!("has {} numbers for {count} points. Enter one, or as many", sigma.len());
        return wrong("sigma", detail);
    }
    let mut faults = Faults::default();
    for place in 0..count {
        let (x, y) = (x[place].unwrap_or(f64::NAN), set.y[place]);
        let (sigma, share) = (sigma[place].unwrap_or(f64::NAN), relative.0.unwrap_or(0.0));
        let noise = libm::hypot(sigma, share * y.unwrap_or(1.0));
        let fault = match y {
            _ if !(x > 0.0 || is_profile && x == 0.0) => {
                Some((of_x, "must be a number greater than 0; a radius can be 0"))
            }
            Some(y) if y < 0.0 && !is_profile => Some((
                of_y,
                "is negative, but this quantity cannot be. Enter null if the number is not known",
            )),
            _ if !(noise > 0.0 && sigma >= 0.0 && share >= 0.0) => Some((
                of_y,
                "has no noise. Enter a `sigma` or a `relative` greater than 0; `relative` gives none to 0",
            )),
            _ => None,
        };
        if let Some((name, detail)) = fault {
            faults.add(format!("/{name}/{place}"), detail);
        }
        set.x.push(x);
        set.noise.push(noise);
    }
    faults.or(set)
}

/// Appends the points of a grid over the range of x.
fn add_grid(set: &mut Set, count: usize) {
    let mut ends = (f64::INFINITY, 0.0_f64);
    set.x.iter().for_each(|x| ends = (ends.0.min(*x), ends.1.max(*x)));
    let (low, high) = ends;
    if low < high && set.x.len() <= DENSE {
        let x =
            |place: usize| twelve_digits(low + (high - low) * place as f64 / (count - 1) as f64);
        set.x.extend((0..count).map(x));
        set.y.resize(set.x.len(), None);
    }
}

/// Reads a test.
fn test(
    place: usize,
    GivenTest { name, specimen, changes, data }: GivenTest,
    mut scenario: Value,
) -> Result<(Test, Vec<Set>), Faults> {
    let name = name.0.unwrap_or_else(|| (place + 1).to_string());
    if name.is_empty() || name.len() > MAX_NAME {
        return Err(Faults::one("/name", format!("must be a text of 1 to {MAX_NAME} bytes")));
    }
    for (pointer, value) in changes.0.into_iter().flatten() {
        let (parent, member) = pointer.rsplit_once('/').unwrap_or(("?", ""));
        let Some(members) = scenario.pointer_mut(parent).and_then(Value::as_object_mut) else {
            let detail = format!(
                "has `{pointer}`, which is no pointer such as `/motion/amplitude` to a member of an object in the scenario"
            );
            return Err(Faults::one("/changes", detail));
        };
        members.insert(member.to_owned(), value);
    }
    let sets = Faults::list(data.0.iter().map(|data| set(place, data)));
    let sets = sets.map_err(|faults| faults.below("/data"))?;
    Ok((Test { name, specimen: specimen.0, scenario }, sets))
}

/// Reads a parameter of these tests.
fn parameter(given: GivenParameter, tests: &[Test]) -> Result<Parameter, Faults> {
    let GivenParameter { pointer, only, from, to, spacing, start, prior } = given;
    let names: Vec<&str> = tests.iter().map(|test| test.name.as_str()).collect();
    let only = only.0.unwrap_or_default();
    if let Some(place) = only.iter().position(|name| !names.contains(&name.as_str())) {
        return Err(Faults::one(&format!("/for/{place}"), unknown("test", &only[place], &names)));
    }
    let own = names.iter().position(|name| only.first().is_none_or(|first| first == name));
    let member = Member::find(&tests[own.unwrap_or(0)].scenario, &pointer);
    let member = member.map_err(|detail| Faults::one("/pointer", detail))?;
    let (low, high) = both(end_of("from", &from, &member), end_of("to", &to, &member))?;
    let is_log = spacing_of(spacing) == Spacing::Logarithmic;
    if !(low < high && high.is_finite() && (!is_log || low > 0.0)) {
        let detail = "must be greater than `from`, and `from` must be greater than 0 if the spacing is logarithmic";
        return Err(Faults::one("/to", detail));
    }
    let start = start.0.map(|start| end_of("start", &start, &member)).transpose()?;
    let start = start.unwrap_or(member.value.clamp(low, high));
    if !(low..=high).contains(&start) {
        return Err(Faults::one("/start", "must be from `from` to `to`"));
    }
    let prior = prior.0.map(|given| {
        let distribution = distribution_of(&given, &member)?.normal_parts();
        let (middle, deviation, is_log) =
            distribution.ok_or_else(|| "must be `normal` or `lognormal`".to_owned())?;
        Ok::<_, Faults>(Prior { middle, deviation, is_log })
    });
    let prior = prior.transpose().map_err(|faults| faults.below("/prior"))?;
    let unit = Some(member.dimension.si()).filter(|unit| !unit.is_empty()).unwrap_or("1");
    Ok(Parameter { pointer, only, unit, low, high, is_log, start, prior })
}

/// Checks that there are enough measured numbers, and not too many.
fn must_suffice(sets: &[Set], unknown: usize) -> Result<(), Faults> {
    let all: usize = sets.iter().map(|set| set.y.len()).sum();
    let measured = sets.iter().flat_map(|set| &set.y).flatten().count();
    let is_estimated = sets.iter().any(|set| set.is_estimated);
    let detail = if all > MAX_NUMBERS {
        format!(
            "have {all} numbers, but a fit can have at most {MAX_NUMBERS}. Thin out long profiles: neighbouring points \
             say the same"
        )
    } else if measured < unknown + usize::from(is_estimated) {
        let more = if is_estimated { " and the noise" } else { "" };
        format!(
            "have {measured} measured number(s), too few for {unknown} parameter(s){more}. Enter more numbers, or fewer \
             parameters"
        )
    } else {
        return Ok(());
    };
    Err(Faults::one("/tests", detail))
}

/// Chooses a smaller tolerance for the runs of a scenario without one if the relative noise of the data is small.
fn refine(scenario: &mut Value, sets: &[Set]) {
    let stated = sets.iter().filter(|set| !set.is_estimated);
    let numbers = stated.flat_map(|set| set.y.iter().zip(&set.noise));
    let shares = numbers.filter_map(|(y, noise)| Some(noise / y.filter(|y| *y != 0.0)?.abs()));
    let wanted = twelve_digits((OF_NOISE * shares.fold(f64::INFINITY, f64::min)).max(TOLERANCES.1));
    let model = scenario.get("model").cloned().unwrap_or(json!({}));
    let is_open =
        model.get("tolerance").is_none() && model.get("method") != Some(&json!("simplified"));
    if wanted < TOLERANCES.0 && is_open && model.is_object() {
        // Indexing adds the member `model` if the scenario does not have it.
        scenario["model"]["tolerance"] = json!(wanted);
    }
}

/// The runs of all tests, and their needs.
fn sources(
    sets: &[Set],
    tests: &[Test],
    parameters: &[Parameter],
) -> Result<(Vec<Source>, Vec<Need>), Faults> {
    let (mut sources, mut needs) = (Vec::new(), Vec::new());
    for set in sets {
        let Test { name, scenario, .. } = &tests[set.test];
        if needs.contains(&need(set)) {
            continue;
        }
        let alike: Vec<&Set> = sets.iter().filter(|other| need(other) == need(set)).collect();
        let own: Vec<_> = parameters.iter().enumerate().filter(|it| it.1.is_of(name)).collect();
        let source = Source::new(scenario.clone(), &alike, &own).map_err(|mut faults| {
            faults.0.iter_mut().for_each(|it| it.detail += &format!(" (in the test {name})"));
            faults
        });
        sources.push(source?);
        needs.push(need(set));
    }
    Ok((sources, needs))
}

/// The measured numbers of all sets. All sets of an output have the same noise, if it is estimated.
fn points(sets: &[Set], tests: &[Test], noises: &[Option<String>]) -> Vec<Point> {
    let mut clusters = BTreeMap::new();
    let mut points = Vec::new();
    for (place, set) in sets.iter().enumerate() {
        let is_profile = set.over() == "radius";
        for (entry, y) in set.y.iter().enumerate() {
            // A specimen is a cluster, and so is a profile. Other points stand for themselves.
            let specimen = tests[set.test].specimen.as_deref();
            let own = if is_profile { (place, 0) } else { (place, entry) };
            let new = clusters.len();
            let key = (specimen, if specimen.is_some() { (0, 0) } else { own });
            points.push(Point {
                value: y.unwrap_or(f64::NAN),
                noise: set.noise.get(entry).copied().unwrap_or(f64::NAN),
                numerical: 0.0,
                set: noises.partition_point(|noise| *noise < noise_of(set)),
                cluster: *clusters.entry(key).or_insert(new),
                weight: 0.0,
            });
        }
    }
    points
}

/// The output of a set whose noise is estimated.
fn noise_of(set: &Set) -> Option<String> {
    set.is_estimated.then(|| set.output.clone())
}

/// Reads a fit of this scenario.
///
/// # Errors
/// All faults, with pointers relative to the fit.
pub fn fit(
    scenario: &Value,
    parameters: Vec<GivenParameter>,
    tests: Vec<GivenTest>,
    (confidence, starts): (f64, u32),
) -> Result<Fit, Faults> {
    if !scenario.is_object() {
        return Err(Faults::one("/scenario", "must be an object"));
    }
    let below = |name: &'static str| move |faults: Faults| faults.below(name);
    let read = tests.into_iter().enumerate().map(|(place, it)| test(place, it, scenario.clone()));
    let (mut tests, sets): (Vec<_>, Vec<_>) =
        Faults::list(read).map_err(below("/tests"))?.into_iter().unzip();
    let mut sets: Vec<Set> = sets.into_iter().flatten().collect();
    let is_twice = |place: &usize| tests[..*place].iter().any(|it| it.name == tests[*place].name);
    if let Some(place) = (1..tests.len()).find(is_twice) {
        return Err(Faults::one(&format!("/tests/{place}/name"), "is the name of two tests"));
    }
    let parameters = parameters.into_iter().map(|given| parameter(given, &tests));
    let parameters = Faults::list(parameters).map_err(below("/parameters"))?;
    let unknown = parameters.iter().filter(|parameter| parameter.prior.is_none()).count();
    must_suffice(&sets, unknown)?;
    tests.iter_mut().for_each(|test| refine(&mut test.scenario, &sets));
    let grid = (GRIDS / sets.len()).clamp(2, GRID);
    sets.iter_mut().for_each(|set| add_grid(set, grid));
    let (sources, needs) = sources(&sets, &tests, &parameters)?;
    let mut noises: Vec<Option<String>> = sets.iter().map(noise_of).collect();
    noises.sort();
    noises.dedup();
    let positions = sets.iter().enumerate().flat_map(|(place, set)| {
        let source = needs.iter().take_while(|known| **known != need(set)).count();
        (0..set.x.len()).map(move |entry| Position { set: place, entry, source })
    });
    let positions: Vec<Position> = positions.collect();
    let has = |depths: bool| {
        let own = sets.iter().filter(|set| set.are_depths() == Some(depths));
        own.flat_map(|set| &set.y).any(Option::is_some)
    };
    let is_coefficient = |it: &Parameter| it.pointer.starts_with("/wear/") && it.only.is_empty();
    let coefficient =
        parameters.iter().position(is_coefficient).filter(|_| has(true) && has(false));
    let seconds = |source: &Source| {
        let start: Vec<f64> = source.parameters.iter().map(|it| parameters[*it].start).collect();
        (RUNS.0 + RUNS.1 * start.len() as f64) * source.problem.seconds(&start)
    };
    let is_estimated = noises.iter().map(Option::is_some).collect();
    let stages = tasks(starts, parameters.len(), tests.len(), coefficient.is_some());
    Ok(Fit {
        seconds: sources.iter().map(seconds).sum(),
        measured: Measured::new(points(&sets, &tests, &noises), is_estimated, unknown),
        starts: (0..starts).map(|start| start_at(start, &parameters)).collect(),
        tests: tests.into_iter().map(|test| test.name).collect(),
        first: stages
            .iter()
            .scan(0, |sum, it: &Vec<Task>| Some(std::mem::replace(sum, *sum + it.len())))
            .collect(),
        tasks: stages.concat(),
        coefficient,
        parameters,
        sources,
        sets,
        positions,
        noises,
        confidence,
    })
}

/// The first start is the given one. The others are spread over the ranges by the additive sequence of M. Roberts, whose
/// steps are powers of the root of x^(d+1) = x + 1.
fn start_at(start: u32, parameters: &[Parameter]) -> Vec<f64> {
    let power = 1.0 / (parameters.len() as f64 + 1.0);
    let root = (0..40).fold(2.0_f64, |root, _| libm::pow(1.0 + root, power));
    let mut step = 1.0;
    let place = |parameter: &Parameter| {
        step /= root;
        let spread = parameter.value((0.5 + f64::from(start) * step).fract());
        if start == 0 { parameter.start } else { spread }
    };
    parameters.iter().map(place).collect()
}
