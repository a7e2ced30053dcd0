//! Reads the parameters and the tests of a fit, and makes the scenarios that predict the measured numbers.

use std::collections::BTreeMap;

use deserr::{Deserr, IntoValue as _, ValuePointerRef};
use fretwork_engine::numeric::twelve_digits;
use fretwork_engine::outcome::{self, History};
use fretwork_engine::request::fault::{Faults, unknown};
use fretwork_engine::request::fields::Given;
use fretwork_engine::request::quantity::Dimension;
use serde_json::{Value, json};

use super::model::{
    Over, Parameter, Place, Position, Prior, Quantity, Set, Source, only_rescales, shared_nodes,
};
use super::search::Fit;
use crate::member::Member;
use crate::output::OutputName;
use crate::problem::Problem;
use crate::profile::{CommonProfiles, Field};
use crate::stats::design::Spacing;
use crate::stats::measured::{Measured, Point};
use crate::vary::{self, Values, Varied};
use fretwork_json::Whole;

/// Maximum number of parameters, of tests, and of measured numbers.
const MAX_PARAMETERS: usize = 20;
const MAX_TESTS: usize = 200;
const MAX_NUMBERS: usize = 2000;
/// Maximum bytes of the name of a test.
const MAX_NAME: usize = 80;
/// The output that is the wear volume times `density`.
const MASS_LOSS: &str = "mass_loss";
/// The columns that a run states about itself, which cannot be measured.
const STATED: [&str; 3] = ["normalized_cycles", "wear_volume_error", "wear_depth_error"];
/// Relative numerical error of the simplified rule, and the error of the exact method in units of its tolerance.
const RULE: f64 = 1e-3;
const IN_TOLERANCE: f64 = 0.5;
/// The default tolerance, and the smallest one that a fit chooses because the noise is small.
const TOLERANCES: (f64, f64) = (3e-3, 1e-4);
/// The numerical error should be at most this share of the noise.
const OF_NOISE: f64 = 0.25;
/// Noise of a set whose noise is estimated before its first estimate, relative to its largest number.
const FIRST_NOISE: f64 = 0.1;
/// Estimated number of runs of a source in a search, and more for each parameter.
const RUNS: (f64, f64) = (4.0, 6.0);
/// The share of a normal distribution below one standard deviation above the mean.
const ONE_DEVIATION: f64 = 0.841_344_746_068_542_9;

#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct Test {
    #[deserr(default)]
    name: Given<Value>,
    #[deserr(default)]
    specimen: Given<Value>,
    #[deserr(default)]
    changes: Given<BTreeMap<String, Value>>,
    data: Vec<Value>,
}

/// Measured columns of the history.
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
    #[deserr(default)]
    sigma: Given<Value>,
    #[deserr(default)]
    relative: Given<f64>,
    #[deserr(default)]
    noise: Given<Noise>,
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
    #[deserr(default)]
    sigma: Given<Value>,
    #[deserr(default)]
    relative: Given<f64>,
    #[deserr(default)]
    noise: Given<Noise>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserr)]
#[deserr(error = Faults, rename_all = lowercase)]
enum Noise {
    Estimate,
}

fn deserialized<T: Deserr<Faults>>(value: &Value) -> Result<T, Faults> {
    T::deserialize_from_value::<Value>(value.clone().into_value(), ValuePointerRef::Origin)
}

/// Reads a name. A number is accepted, too.
fn named(place: &str, value: Option<Value>) -> Result<Option<String>, Faults> {
    let text = match value {
        None => return Ok(None),
        Some(Value::Number(number)) => number.to_string(),
        Some(other) => other.as_str().unwrap_or_default().to_owned(),
    };
    if (1..=MAX_NAME).contains(&text.len()) {
        return Ok(Some(text));
    }
    Err(Faults::one(place, format!("must be a text of 1 to {MAX_NAME} bytes")))
}

/// Makes a fit from its members.
///
/// # Errors
/// All faults, with pointers relative to the fit.
pub fn fit(
    scenario: &Value,
    parameters: &[Value],
    tests: &[Value],
    confidence: f64,
    starts: u32,
) -> Result<Fit, Faults> {
    for (name, length, most) in
        [("parameters", parameters.len(), MAX_PARAMETERS), ("tests", tests.len(), MAX_TESTS)]
    {
        if length == 0 || length > most {
            let detail = format!("must have 1 to {most} entries, not {length}");
            return Err(Faults::one(&format!("/{name}"), detail));
        }
    }
    if !scenario.is_object() {
        return Err(Faults::one("/scenario", "must be an object"));
    }
    let mut building = Building::default();
    let read = tests.iter().enumerate().map(|(place, test)| building.read(place, test, scenario));
    Faults::list(read).map_err(|faults| faults.below("/tests"))?;
    let parameters = parameters.iter().map(|given| parameter(given, &building));
    let parameters = Faults::list(parameters).map_err(|faults| faults.below("/parameters"))?;
    building.must_suffice(&parameters)?;
    building.fit(parameters, confidence, starts)
}

/// Reads a list of numbers, and checks each of them.
fn numbers<T>(
    name: &str,
    list: &[Value],
    dimension: Dimension,
    check: impl Fn(Option<f64>) -> Result<T, &'static str>,
) -> Result<Vec<T>, Faults> {
    let member = Member { pointer: String::new(), dimension, value: 0.0 };
    let read = |value: &Value| {
        let number = if value.is_null() { None } else { Some(twelve_digits(member.read(value)?)) };
        check(number).map_err(str::to_owned)
    };
    Faults::list(list.iter().map(read)).map_err(|faults| faults.below(&format!("/{name}")))
}

/// Reads a set of measured numbers.
fn set(test: usize, given: &Value) -> Result<Set, Faults> {
    if given.get("profile").is_some() {
        let Trace { field, at, body, radius, depth, sigma, relative, noise } = deserialized(given)?;
        let is_known = field == Field::Wear || field == Field::Worn && body.0.is_none();
        if !is_known || at.is_nan() || at <= 0.0 {
            let detail = "must be `wear` (the depth) or, without `body`, `worn` (the worn profile), with `at` more than 0";
            return Err(Faults::one("/profile", detail));
        }
        let body = body.0.map(|body| body.0 as usize - 1);
        let quantity = Quantity::Profile { field, at: twelve_digits(at), body };
        let output = format!("profile.{}", field.name());
        let not_negative = |x: Option<f64>| x.filter(|x| *x >= 0.0).ok_or("must be at least 0");
        let x = numbers("radius", &radius, Dimension::Length, not_negative)?;
        let y = numbers("depth", &depth, Dimension::Length, Ok)?;
        let set =
            Set { test, output, unit: "m", quantity, x, y, noise: Vec::new(), is_estimated: false };
        return with_noise(set, "depth", sigma.0, relative.0, noise.0);
    }
    let Scalars { output, over, x, y, density, sigma, relative, noise } = deserialized(given)?;
    let over = over.0.unwrap_or(Over::Cycles);
    let column = column_of(&output)?;
    let is_mass = output == MASS_LOSS;
    if is_mass != density.0.is_some() || density.0.is_some_and(|density| density <= 0.0) {
        let detail = "belongs to `mass_loss`, which needs it: a number in kg/m³ greater than 0";
        return Err(Faults::one("/density", detail));
    }
    let unit = outcome::Quantity::named(column).map_or("1", |quantity| quantity.unit);
    let unit = if is_mass { "kg" } else { unit };
    let of_x = if over == Over::Cycles { Dimension::Number } else { Dimension::Energy };
    let positive = |x: Option<f64>| x.filter(|x| *x > 0.0).ok_or("must be greater than 0");
    let x = numbers("x", &x, of_x, positive)?;
    let negative =
        "is negative, but this quantity cannot be. Enter null if the number is not known";
    let possible = |y: Option<f64>| if y.is_some_and(|y| y < 0.0) { Err(negative) } else { Ok(y) };
    let y = numbers("y", &y, dimension_of(unit), possible)?;
    let quantity = Quantity::Column { column, factor: density.0.unwrap_or(1.0), over };
    let set = Set { test, output, unit, quantity, x, y, noise: Vec::new(), is_estimated: false };
    with_noise(set, "y", sigma.0, relative.0, noise.0)
}

/// The dimension of numbers with this SI unit.
fn dimension_of(unit: &str) -> Dimension {
    Dimension::ALL.into_iter().find(|it| it.si() == unit).unwrap_or(Dimension::Number)
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

/// Checks a set and adds the noise of its numbers, which are the member `name`.
fn with_noise(
    mut set: Set,
    name: &str,
    sigma: Option<Value>,
    relative: Option<f64>,
    noise: Option<Noise>,
) -> Result<Set, Faults> {
    let (place, count) = (format!("/{name}"), set.y.len());
    if set.x.len() != count || count == 0 {
        let places = set.x.len();
        let detail =
            format!("has {count} numbers for {places} places. Enter as many, and at least one");
        return Err(Faults::one(&place, detail));
    }
    let is_first = |(x, y): (&f64, &Option<f64>)| (*x, *y) == (set.x[0], set.y[0]) && y.is_some();
    if count > 1 && set.x.iter().zip(&set.y).all(is_first) {
        let detail = format!("has the same point {count} times. Enter it once");
        return Err(Faults::one(&place, detail));
    }
    set.is_estimated = noise.is_some();
    let is_stated = sigma.is_some() || relative.is_some();
    if !is_stated && !set.is_estimated {
        let detail = "is missing. Enter `sigma`, `relative`, or \"noise\": \"estimate\"";
        return Err(Faults::one("/sigma", detail));
    }
    let list = match sigma {
        Some(Value::Array(list)) => list,
        one => {
            let first = if is_stated { 0.0 } else { FIRST_NOISE * set.largest() };
            vec![one.unwrap_or(json!(first)); count]
        }
    };
    let given = |sigma: Option<f64>| sigma.ok_or("must be a number");
    let sigma = numbers("sigma", &list, dimension_of(set.unit), given)?;
    if sigma.len() != count {
        let detail =
            format!("has {} numbers for {count} points. Enter one, or as many", sigma.len());
        return Err(Faults::one("/sigma", detail));
    }
    let noise = set.y.iter().zip(sigma).map(|(y, sigma)| {
        let noise = libm::hypot(sigma, relative.unwrap_or(0.0) * y.unwrap_or(1.0));
        if noise > 0.0 && sigma >= 0.0 && relative.is_none_or(|relative| relative > 0.0) {
            return Ok(noise);
        }
        Err("has no noise. Enter a `sigma` or a `relative` greater than 0; `relative` gives none to 0".to_owned())
    });
    set.noise = Faults::list(noise).map_err(|faults| faults.below(&place))?;
    Ok(set)
}

fn parameter(given: &Value, building: &Building) -> Result<Parameter, Faults> {
    let mut given = given.clone();
    let mut take =
        |name: &str| given.as_object_mut().and_then(|members| members.shift_remove(name));
    let (start, prior, only) = (take("start"), take("prior"), take("for"));
    let only = only.map_or(Ok(Vec::new()), |only| deserialized::<Vec<Value>>(&only));
    let only = only.and_then(|only| Faults::list(only.into_iter().map(|it| named("", Some(it)))));
    let only: Vec<String> =
        only.map_err(|faults| faults.below("/for"))?.into_iter().flatten().collect();
    let names: Vec<&str> = building.names.iter().map(String::as_str).collect();
    if let Some(place) = only.iter().position(|name| !names.contains(&name.as_str())) {
        return Err(Faults::one(&format!("/for/{place}"), unknown("test", &only[place], &names)));
    }
    let own = names.iter().position(|name| only.first().is_none_or(|first| first == name));
    let scenario = &building.scenarios[own.unwrap_or(0)];
    let pointer = given["pointer"].as_str().unwrap_or_default().to_owned();
    let found = Member::find(scenario, &pointer);
    let Varied { member, values } = Varied::read(given, found)?;
    let Values::Range(low, high, spacing) = values else {
        return Err(Faults::one("", "must have `from` and `to`, without `count`"));
    };
    let is_log = spacing == Spacing::Logarithmic;
    if !(low < high && high.is_finite() && (!is_log || low > 0.0)) {
        let detail = "must be greater than `from`, and `from` must be greater than 0 if the spacing is logarithmic";
        return Err(Faults::one("/to", detail));
    }
    let start = start.map_or(Ok(member.value.clamp(low, high)), |start| member.read(&start));
    let start = start.map_err(|detail| Faults::one("/start", detail))?;
    if !(low..=high).contains(&start) {
        return Err(Faults::one("/start", "must be from `from` to `to`"));
    }
    let prior = prior.map(|prior| prior_of(&prior, &member)).transpose()?;
    let unit = Some(member.dimension.si()).filter(|unit| !unit.is_empty()).unwrap_or("1");
    Ok(Parameter { pointer, only, unit, low, high, is_log, start, prior })
}

fn prior_of(given: &Value, member: &Member) -> Result<Prior, Faults> {
    let is_log = given.get("lognormal").is_some();
    if !is_log && given.get("normal").is_none() {
        return Err(Faults::one("/prior", "must be a distribution `normal` or `lognormal`"));
    }
    let distribution = vary::distribution_of(given, member).map_err(|mut faults| {
        for fault in &mut faults.0 {
            fault.pointer = fault.pointer.replacen("distribution", "prior", 1);
        }
        faults
    })?;
    let of = |u: f64| {
        let x = distribution.quantile(u);
        if is_log { libm::log(x) } else { x }
    };
    Ok(Prior { middle: of(0.5), deviation: of(ONE_DEVIATION) - of(0.5), is_log })
}

/// The relative numerical error of a scenario. Its tolerance becomes smaller if the noise is small.
fn refine(scenario: &mut Value, noise: f64) -> f64 {
    if scenario.pointer("/model/method") == Some(&json!("simplified")) {
        return RULE;
    }
    if let Some(given) = scenario.pointer("/model/tolerance").and_then(Value::as_f64) {
        return IN_TOLERANCE * given;
    }
    let wanted = twelve_digits((OF_NOISE / IN_TOLERANCE * noise).clamp(TOLERANCES.1, TOLERANCES.0));
    if wanted < TOLERANCES.0 && scenario.get("model").is_none_or(Value::is_object) {
        // Indexing adds the member `model` if the scenario does not have it.
        scenario["model"]["tolerance"] = json!(wanted);
    }
    IN_TOLERANCE * wanted
}

/// The tests that were read, and what is made from them.
#[derive(Default)]
struct Building {
    names: Vec<String>,
    specimens: Vec<Option<String>>,
    scenarios: Vec<Value>,
    sets: Vec<Set>,
}

impl Building {
    /// Reads a test.
    fn read(&mut self, place: usize, given: &Value, base: &Value) -> Result<(), Faults> {
        let Test { name, specimen, changes, data } = deserialized(given)?;
        let name = named("/name", name.0)?.unwrap_or_else(|| (place + 1).to_string());
        if self.names.contains(&name) {
            return Err(Faults::one("/name", "is the name of two tests"));
        }
        self.names.push(name);
        self.specimens.push(named("/specimen", specimen.0)?);
        let mut scenario = base.clone();
        for (pointer, value) in changes.0.iter().flatten() {
            let Some((parent, name)) = pointer.rsplit_once('/') else {
                let detail =
                    format!("has `{pointer}`, which is no pointer such as `/motion/amplitude`");
                return Err(Faults::one("/changes", detail));
            };
            let Some(members) = scenario.pointer_mut(parent).and_then(Value::as_object_mut) else {
                let detail = format!("has `{pointer}`, but the scenario has no member `{parent}`");
                return Err(Faults::one("/changes", detail));
            };
            members.insert(name.to_owned(), value.clone());
        }
        self.scenarios.push(scenario);
        if data.is_empty() {
            return Err(Faults::one("/data", "must have at least one set of measured numbers"));
        }
        let sets = Faults::list(data.iter().map(|data| set(place, data)));
        self.sets.extend(sets.map_err(|faults| faults.below("/data"))?);
        Ok(())
    }

    /// Checks that there are enough measured numbers.
    fn must_suffice(&self, parameters: &[Parameter]) -> Result<(), Faults> {
        let all: usize = self.sets.iter().map(|set| set.y.len()).sum();
        if all > MAX_NUMBERS {
            let detail = format!(
                "have {all} numbers, but a fit can have at most {MAX_NUMBERS}. Thin out long profiles: neighbouring \
                 points say the same"
            );
            return Err(Faults::one("/tests", detail));
        }
        let measured = self.sets.iter().flat_map(|set| &set.y).flatten().count();
        let unknown = parameters.iter().filter(|parameter| parameter.prior.is_none()).count();
        let is_estimated = self.sets.iter().any(|set| set.is_estimated);
        if measured < unknown + usize::from(is_estimated) {
            let more = if is_estimated { " and the noise" } else { "" };
            let detail = format!(
                "have {measured} measured number(s), too few for {unknown} parameter(s){more}. Enter more numbers, or \
                 fewer parameters"
            );
            return Err(Faults::one("/tests", detail));
        }
        Ok(())
    }

    /// Makes the runs of all tests, and the positions of all numbers.
    fn fit(
        mut self,
        parameters: Vec<Parameter>,
        confidence: f64,
        starts: u32,
    ) -> Result<Fit, Faults> {
        let stated = self.sets.iter().filter(|set| !set.is_estimated);
        let numbers = stated.flat_map(|set| set.y.iter().zip(&set.noise));
        let shares = numbers.filter_map(|(y, noise)| Some(noise / y.filter(|y| *y != 0.0)?.abs()));
        let noise = shares.fold(f64::INFINITY, f64::min);
        let accuracies = self.scenarios.iter_mut().map(|scenario| refine(scenario, noise));
        let accuracy = accuracies.fold(0.0, f64::max);
        let (mut sources, mut needed) = (Vec::new(), Vec::new());
        for set in &self.sets {
            if !needed.contains(&set.needs()) {
                sources.push(self.source(set, &parameters)?);
                needed.push(set.needs());
            }
        }
        // All sets of an output have the same noise, if it is estimated.
        let noise_of = |set: &Set| set.is_estimated.then(|| set.output.clone());
        let mut noises: Vec<Option<String>> = self.sets.iter().map(noise_of).collect();
        noises.sort();
        noises.dedup();
        let (mut positions, mut points, mut clusters) = (Vec::new(), Vec::new(), Vec::new());
        for (place, set) in self.sets.iter().enumerate() {
            let is_profile = matches!(set.quantity, Quantity::Profile { .. });
            for (entry, y) in set.y.iter().enumerate() {
                // A specimen is a cluster, and so is a profile. Other points stand for themselves.
                let own = if is_profile { (place, 0) } else { (place, entry) };
                let cluster = match &self.specimens[set.test] {
                    Some(specimen) => (Some(specimen), (0, 0)),
                    None => (None, own),
                };
                let known = clusters.iter().position(|known| *known == cluster);
                let cluster = known.unwrap_or_else(|| {
                    clusters.push(cluster);
                    clusters.len() - 1
                });
                let size = if is_profile { set.largest() } else { y.unwrap_or(0.0).abs() };
                points.push(Point {
                    value: y.unwrap_or(f64::NAN),
                    noise: set.noise[entry],
                    numerical: accuracy * size,
                    set: noises.iter().take_while(|noise| **noise != noise_of(set)).count(),
                    cluster,
                });
                let source = needed.iter().take_while(|needs| **needs != set.needs()).count();
                let at = place_of(&sources[source], set, set.x[entry]);
                positions.push(Position { set: place, entry, source, place: at });
            }
        }
        let unknown = parameters.iter().filter(|parameter| parameter.prior.is_none()).count();
        let is_estimated = noises.iter().map(Option::is_some).collect();
        let are_both = [true, false].iter().all(|kind| {
            let own = self.sets.iter().filter(|set| set.are_depths() == Some(*kind));
            own.flat_map(|set| &set.y).any(Option::is_some)
        });
        let is_coefficient =
            |it: &Parameter| it.pointer.starts_with("/wear/") && it.only.is_empty();
        let seconds = |source: &Source| {
            let start: Vec<f64> =
                source.parameters.iter().map(|it| parameters[*it].start).collect();
            let runs = RUNS.0 + RUNS.1 * start.len() as f64;
            runs * source.problem.seconds(&start)
        };
        Ok(Fit {
            seconds: sources.iter().map(seconds).sum(),
            measured: Measured::new(points, is_estimated, unknown),
            starts: (0..starts).map(|start| start_at(start, &parameters)).collect(),
            coefficient: parameters.iter().position(is_coefficient).filter(|_| are_both),
            parameters,
            sources,
            positions,
            tests: self.names,
            confidence,
            accuracy,
            sets: self.sets,
            noises,
        })
    }

    /// Makes the runs that predict a set, and all sets with the same needs.
    fn source(&self, first: &Set, parameters: &[Parameter]) -> Result<Source, Faults> {
        let (test, name) = (first.test, &self.names[first.test]);
        let own = parameters.iter().enumerate();
        let own: Vec<_> =
            own.filter(|(_, it)| it.only.is_empty() || it.only.contains(name)).collect();
        let mut scenario = self.scenarios[test].clone();
        let (mut nodes, mut columns) = (Vec::new(), Vec::new());
        let (mut radii, mut fields, mut of) = (Vec::new(), Vec::new(), None);
        for set in self.sets.iter().filter(|set| set.needs() == first.needs()) {
            match set.quantity {
                Quantity::Column { column, .. } => {
                    nodes.extend_from_slice(&set.x);
                    columns.push(column);
                }
                Quantity::Profile { field, at, body } => {
                    of = body;
                    nodes.push(at);
                    radii.extend_from_slice(&set.x);
                    fields.push(field);
                }
            }
        }
        for list in [&mut nodes, &mut radii] {
            list.sort_by(f64::total_cmp);
            list.dedup();
        }
        columns.dedup();
        let rescaled = own.iter().position(|(_, it)| only_rescales(&it.pointer, &scenario));
        let rescaled = rescaled.filter(|_| fields.is_empty());
        if rescaled.is_some() {
            nodes = shared_nodes(nodes[0], nodes[nodes.len() - 1]);
        }
        scenario["cycles"] = match first.over() {
            "dissipated_energy" => json!({"dissipated_energy": nodes}),
            _ => json!(nodes),
        };
        let told = |mut faults: Faults| {
            for fault in &mut faults.0 {
                fault.pointer.insert_str(0, "/scenario");
                fault.detail = format!("{} (in the test {name})", fault.detail);
            }
            faults
        };
        fretwork_engine::scenario::prepare(scenario.clone(), "").map_err(told)?;
        let mut members = Vec::<Member>::new();
        let found = Member::find_all(&scenario, own.iter().map(|(_, it)| it.pointer.as_str()));
        for ((place, _), member) in own.iter().zip(found) {
            let fault =
                |detail: String| Faults::one(&format!("/parameters/{place}/pointer"), detail);
            let member = member.map_err(fault)?;
            if members.contains(&member) {
                return Err(fault(format!("is listed twice for the test {name}")));
            }
            members.push(member);
        }
        let outputs = columns.iter().flat_map(|column| {
            nodes.iter().map(move |node| format!("{column}@{node}").parse::<OutputName>())
        });
        let outputs =
            outputs.collect::<Result<_, _>>().map_err(|detail| Faults::one("/tests", detail))?;
        let outputs = OutputName::all_among(outputs, &scenario).map_err(told)?;
        let mut problem = Problem::new(scenario, members, outputs);
        let has_profiles = !fields.is_empty();
        problem.profiles = has_profiles.then_some(CommonProfiles { radii, fields, body: of });
        let start: Vec<f64> = own.iter().map(|(_, parameter)| parameter.start).collect();
        problem.prepare(&start).map_err(told)?;
        let parameters = own.iter().map(|(place, _)| *place).collect();
        Ok(Source { problem, parameters, rescaled, nodes, columns })
    }
}

/// The place of a number in the runs of its source.
fn place_of(source: &Source, set: &Set, x: f64) -> Place {
    match set.quantity {
        Quantity::Column { column, factor, .. } => {
            let column = source.columns.iter().take_while(|known| **known != column).count();
            Place::History { column, x, factor }
        }
        Quantity::Profile { field, .. } => {
            let profiles = source.problem.profiles.iter();
            let fields = profiles.clone().flat_map(|profiles| &profiles.fields);
            let radii = profiles.flat_map(|profiles| &profiles.radii);
            let curve = fields.take_while(|known| **known != field).count();
            Place::Profile { curve, radius: radii.take_while(|known| **known < x).count() }
        }
    }
}

/// The first start is the given one. The others are spread over the ranges by the additive sequence of M. Roberts, whose
/// steps are powers of the root of x^(d+1) = x + 1.
fn start_at(start: u32, parameters: &[Parameter]) -> Vec<f64> {
    if start == 0 {
        return parameters.iter().map(|parameter| parameter.start).collect();
    }
    let power = 1.0 / (parameters.len() as f64 + 1.0);
    let root = (0..40).fold(2.0_f64, |root, _| libm::pow(1.0 + root, power));
    let mut step = 1.0;
    let place = |parameter: &Parameter| {
        step /= root;
        parameter.value((0.5 + f64::from(start) * step).fract())
    };
    parameters.iter().map(place).collect()
}
