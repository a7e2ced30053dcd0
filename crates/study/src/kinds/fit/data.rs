//! Reads the parameters and the tests of a fit, and makes the scenarios that predict the measured numbers.

use std::collections::BTreeMap;

use deserr::{Deserr, IntoValue as _, ValuePointerRef};
use fretwork_engine::case::Case;
use fretwork_engine::numeric::twelve_digits;
use fretwork_engine::outcome::{self, History};
use fretwork_engine::request::fault::{Faults, unknown};
use fretwork_engine::request::fields::Given;
use fretwork_engine::request::quantity::Dimension;
use serde_json::{Map, Value, json};

use super::findings::Set;
use super::model::{
    Parameter, Place, Position, Prior, Source, members, only_rescales, shared_nodes,
};
use super::search::Fit;
use crate::member::Member;
use crate::output::OutputName;
use crate::problem::Problem;
use crate::profile::{CommonProfiles, Field};
use crate::stats::design::Spacing;
use crate::stats::distribution::Distribution;
use crate::stats::measured::{Measured, Point};
use crate::vary::{Values, Varied, distribution_of};

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

#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct ParameterRequest {
    pointer: String,
    from: Value,
    to: Value,
    #[deserr(default)]
    spacing: Given<String>,
    #[deserr(default)]
    start: Given<Value>,
    #[deserr(default, rename = "for")]
    only: Given<Vec<Value>>,
    #[deserr(default)]
    prior: Given<Value>,
}

#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct TestRequest {
    #[deserr(default)]
    name: Given<Value>,
    #[deserr(default)]
    specimen: Given<Value>,
    #[deserr(default)]
    changes: Given<Value>,
    data: Vec<Value>,
}

#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct DataRequest {
    #[deserr(default)]
    output: Given<String>,
    #[deserr(default)]
    over: Given<Over>,
    #[deserr(default)]
    x: Given<Vec<Value>>,
    #[deserr(default)]
    y: Given<Vec<Value>>,
    #[deserr(default)]
    density: Given<f64>,
    #[deserr(default)]
    profile: Given<Field>,
    #[deserr(default)]
    at: Given<f64>,
    #[deserr(default)]
    radius: Given<Vec<Value>>,
    #[deserr(default)]
    depth: Given<Vec<Value>>,
    #[deserr(default)]
    sigma: Given<Value>,
    #[deserr(default)]
    relative: Given<f64>,
    #[deserr(default)]
    noise: Given<Noise>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserr)]
#[deserr(error = Faults, rename_all = lowercase)]
enum Over {
    Cycles,
    #[deserr(rename = "dissipated_energy")]
    DissipatedEnergy,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserr)]
#[deserr(error = Faults, rename_all = lowercase)]
enum Noise {
    Estimate,
}

/// A set of measured numbers of one test.
#[derive(Debug)]
struct Data {
    quantity: Quantity,
    x: Vec<f64>,
    y: Vec<Option<f64>>,
    noise: Vec<f64>,
    is_estimated: bool,
}

#[derive(Debug, Clone, PartialEq)]
enum Quantity {
    History { output: String, column: &'static str, over: Over, factor: f64 },
    Profile { field: Field, at: f64 },
}

/// A test with its scenario.
#[derive(Debug)]
struct Test {
    name: String,
    specimen: Option<String>,
    scenario: Value,
    data: Vec<Data>,
}

/// A name that the canonical form may have turned into a number.
fn text(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
        _ => None,
    }
    .filter(|text| !text.is_empty() && text.len() <= MAX_NAME)
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
    let tests = Faults::list(tests.iter().enumerate().map(|(place, it)| test(place, it, scenario)));
    let tests = tests.map_err(|faults| faults.below("/tests"))?;
    let is_new = |(place, test): (usize, &Test)| {
        let is_twice = tests[..place].iter().any(|other| other.name == test.name);
        if is_twice { Err(Faults::one("/name", "is the name of two tests")) } else { Ok(()) }
    };
    Faults::list(tests.iter().enumerate().map(is_new)).map_err(|faults| faults.below("/tests"))?;
    let parameters = Faults::list(parameters.iter().map(|it| parameter(it, &tests)));
    let parameters = parameters.map_err(|faults| faults.below("/parameters"))?;
    must_suffice(&tests, &parameters)?;
    assembled(tests, parameters, confidence, starts)
}

/// Checks that there are enough measured numbers.
fn must_suffice(tests: &[Test], parameters: &[Parameter]) -> Result<(), Faults> {
    let sets = || tests.iter().flat_map(|test| &test.data);
    let all: usize = sets().map(|set| set.y.len()).sum();
    if all > MAX_NUMBERS {
        let detail = format!(
            "have {all} numbers, but a fit can have at most {MAX_NUMBERS}. Thin out long profiles: neighbouring points \
             say the same"
        );
        return Err(Faults::one("/tests", detail));
    }
    let measured = sets().flat_map(|set| &set.y).filter(|y| y.is_some()).count();
    let unknown = parameters.iter().filter(|parameter| parameter.prior.is_none()).count();
    let is_estimated = sets().any(|set| set.is_estimated);
    if measured < unknown + usize::from(is_estimated) {
        let more = if is_estimated { " and the noise" } else { "" };
        let detail = format!(
            "have {measured} measured number(s), too few for {unknown} parameter(s){more}. Enter more numbers, or fewer \
             parameters"
        );
        return Err(Faults::one("/tests", detail));
    }
    Ok(())
}

fn test(place: usize, given: &Value, base: &Value) -> Result<Test, Faults> {
    let TestRequest { name, specimen, changes, data } = TestRequest::deserialize_from_value::<Value>(
        given.clone().into_value(),
        ValuePointerRef::Origin,
    )?;
    let mut faults = Faults::default();
    let mut named = |member: &str, value: Option<Value>| {
        let value = value?;
        let text = text(&value);
        if text.is_none() {
            faults.add(format!("/{member}"), format!("must be a text of 1 to {MAX_NAME} bytes"));
        }
        text
    };
    let name = named("name", name.0);
    let specimen = named("specimen", specimen.0);
    let mut scenario = base.clone();
    let changes = changes.0.unwrap_or_else(|| json!({}));
    match changes.as_object() {
        None => {
            faults.add("/changes", "must be an object, such as {\"/motion/amplitude\": \"50 um\"}")
        }
        Some(changes) => {
            for (pointer, value) in changes {
                if let Err(detail) = change(&mut scenario, pointer, value) {
                    faults.add(format!("/changes/{}", fretwork_json::escaped(pointer)), detail);
                }
            }
        }
    }
    let data = Faults::list(data.into_iter().map(self::data));
    let data = faults.keep("/data", data).unwrap_or_default();
    if data.is_empty() {
        faults.add("/data", "must have at least one set of measured numbers");
    }
    let name = name.unwrap_or_else(|| (place + 1).to_string());
    faults.or(Test { name, specimen, scenario, data })
}

/// Changes a member of a scenario, or adds it.
fn change(scenario: &mut Value, pointer: &str, value: &Value) -> Result<(), String> {
    if let Some(known) = scenario.pointer_mut(pointer) {
        *known = value.clone();
        return Ok(());
    }
    let parent = pointer
        .rsplit_once('/')
        .and_then(|(parent, name)| Some((scenario.pointer_mut(parent)?.as_object_mut()?, name)));
    let Some((parent, name)) = parent else {
        return Err("is not the pointer of a member of the scenario, such as `/motion/amplitude`"
            .to_owned());
    };
    parent.insert(name.replace("~1", "/").replace("~0", "~"), value.clone());
    Ok(())
}

/// Reads a list of numbers. An entry of `y` can be null.
fn numbers(name: &str, list: &[Value], dimension: Dimension) -> Result<Vec<Option<f64>>, Faults> {
    let member = Member { pointer: String::new(), dimension, value: 0.0 };
    let read = |value: &Value| match value {
        Value::Null => Ok(None),
        value => {
            let number = member.read(value)?;
            if number.is_finite() {
                Ok(Some(twelve_digits(number)))
            } else {
                Err("must be a finite number".to_owned())
            }
        }
    };
    Faults::list(list.iter().map(read)).map_err(|faults| faults.below(&format!("/{name}")))
}

/// As [`numbers`], without null.
fn complete(name: &str, list: &[Value], dimension: Dimension) -> Result<Vec<f64>, Faults> {
    let list = numbers(name, list, dimension)?;
    let given = |x: Option<f64>| x.ok_or_else(|| "must be a number".to_owned());
    Faults::list(list.into_iter().map(given)).map_err(|faults| faults.below(&format!("/{name}")))
}

fn data(given: Value) -> Result<Data, Faults> {
    let request: DataRequest =
        DataRequest::deserialize_from_value::<Value>(given.into_value(), ValuePointerRef::Origin)?;
    let missing =
        |name: &str| Faults::one(&format!("/{name}"), format!("is missing. Enter `{name}`"));
    let is_profile = request.profile.0.is_some();
    let [x_name, y_name] = if is_profile { ["radius", "depth"] } else { ["x", "y"] };
    let foreign = if is_profile {
        [
            ("output", request.output.0.is_some()),
            ("x", request.x.0.is_some()),
            ("y", request.y.0.is_some()),
            ("over", request.over.0.is_some()),
        ]
    } else {
        [
            ("at", request.at.0.is_some()),
            ("radius", request.radius.0.is_some()),
            ("depth", request.depth.0.is_some()),
            ("", false),
        ]
    };
    if let Some((name, _)) = foreign.into_iter().find(|(_, given)| *given) {
        return Err(Faults::one(
            &format!("/{name}"),
            "does not belong here. Enter either `output`, `x` and `y`, or `profile`, `at`, `radius` and `depth`",
        ));
    }
    let (quantity, x_dimension, y_dimension) = quantity_of(&request)?;
    let DataRequest { x, y, radius, depth, sigma, relative, noise, .. } = request;
    let x = if is_profile { radius.0 } else { x.0 }.ok_or_else(|| missing(x_name))?;
    let y = if is_profile { depth.0 } else { y.0 }.ok_or_else(|| missing(y_name))?;
    if x.len() != y.len() || x.is_empty() {
        let detail = format!(
            "has {} numbers, but `{x_name}` has {}. Enter as many of both, and at least one",
            y.len(),
            x.len()
        );
        return Err(Faults::one(&format!("/{y_name}"), detail));
    }
    let x = complete(x_name, &x, x_dimension)?;
    let y = numbers(y_name, &y, y_dimension)?;
    for (place, x) in x.iter().enumerate() {
        if *x < 0.0 || (!is_profile && *x == 0.0) {
            return Err(Faults::one(&format!("/{x_name}/{place}"), "must be greater than 0"));
        }
    }
    if let Some(place) = y.iter().position(|y| !is_profile && y.is_some_and(|y| y < 0.0)) {
        let detail =
            "is negative, but this quantity cannot be. Enter null if the number is not known";
        return Err(Faults::one(&format!("/{y_name}/{place}"), detail));
    }
    let is_repeated =
        y.len() > 1 && y.iter().all(|other| *other == y[0]) && x.iter().all(|other| *other == x[0]);
    if is_repeated && y[0].is_some() {
        let detail = format!("has the same point {} times. Enter it once", y.len());
        return Err(Faults::one(&format!("/{y_name}"), detail));
    }
    let is_estimated = noise.0.is_some();
    let sigma = sigma.0.map(|sigma| match sigma {
        Value::Array(list) => complete("sigma", &list, y_dimension),
        one => Ok(vec![complete("sigma", &[one], y_dimension)?[0]; y.len()]),
    });
    let noise = noise_of(&y, sigma.transpose()?, relative.0, is_estimated)?;
    Ok(Data { quantity, x, y, noise, is_estimated })
}

/// The measured quantity, and the dimensions of x and y.
fn quantity_of(request: &DataRequest) -> Result<(Quantity, Dimension, Dimension), Faults> {
    if let Some(field) = request.profile.0 {
        if !matches!(field, Field::Wear | Field::Worn) {
            return Err(Faults::one(
                "/profile",
                "must be `wear` (the depth of the scar) or `worn` (the profile after wear)",
            ));
        }
        let at = request.at.0.ok_or_else(|| {
            Faults::one("/at", "is missing. Enter the number of cycles of the profile")
        })?;
        if !(at > 0.0) {
            return Err(Faults::one("/at", "must be a number of cycles greater than 0"));
        }
        return Ok((
            Quantity::Profile { field, at: twelve_digits(at) },
            Dimension::Length,
            Dimension::Length,
        ));
    }
    let output = request.output.0.clone().ok_or_else(|| {
        Faults::one("/output", "is missing. Enter `output`, such as \"wear_volume\", or `profile`")
    })?;
    let is_mass = output == MASS_LOSS;
    let (name, factor) = match (is_mass, request.density.0) {
        (true, Some(density)) if density > 0.0 => ("wear_volume", density),
        (true, _) => {
            return Err(Faults::one(
                "/density",
                "must be a number in kg/m³ greater than 0, because `mass_loss` needs it",
            ));
        }
        (false, Some(_)) => {
            return Err(Faults::one("/density", "belongs to `mass_loss`. Remove it"));
        }
        (false, None) => (output.as_str(), 1.0),
    };
    let columns = History::MEMBERS.iter().map(|member| member.name);
    let mut columns = columns.filter(|name| !STATED.contains(name));
    let Some(column) = columns.clone().find(|known| *known == name) else {
        let known: Vec<&str> = columns.by_ref().chain([MASS_LOSS]).collect();
        return Err(Faults::one("/output", unknown("output", name, &known)));
    };
    let over = request.over.0.unwrap_or(Over::Cycles);
    let x = if over == Over::Cycles { Dimension::Number } else { Dimension::Energy };
    let unit = outcome::Quantity::named(column).map_or("1", |quantity| quantity.unit);
    let y = Dimension::ALL.into_iter().find(|it| it.si() == unit).unwrap_or(Dimension::Number);
    let y = if is_mass { Dimension::Number } else { y };
    Ok((Quantity::History { output, column, over, factor }, x, y))
}

/// The noise of each number.
fn noise_of(
    y: &[Option<f64>],
    sigma: Option<Vec<f64>>,
    relative: Option<f64>,
    is_estimated: bool,
) -> Result<Vec<f64>, Faults> {
    if sigma.is_none() && relative.is_none() && !is_estimated {
        let detail = "is missing. Enter `sigma`, `relative`, or \"noise\": \"estimate\"";
        return Err(Faults::one("/sigma", detail));
    }
    if relative.is_some_and(|relative| !(relative > 0.0 && relative <= 10.0)) {
        return Err(Faults::one("/relative", "must be greater than 0, such as 0.1 for 10 %"));
    }
    if let Some(sigma) = sigma.as_ref().filter(|sigma| sigma.len() != y.len()) {
        let detail = format!(
            "has {} numbers for {} points. Enter one number, or one for each point",
            sigma.len(),
            y.len()
        );
        return Err(Faults::one("/sigma", detail));
    }
    let largest = y.iter().flatten().fold(0.0, |largest: f64, y| largest.max(y.abs()));
    let first = if sigma.is_none() && relative.is_none() { FIRST_NOISE * largest } else { 0.0 };
    let noise = |(place, y): (usize, &Option<f64>)| {
        let Some(y) = y else { return Ok(1.0) };
        let sigma = sigma.as_ref().map_or(0.0, |sigma| sigma[place]);
        let noise = libm::hypot(libm::hypot(sigma, relative.unwrap_or(0.0) * y.abs()), first);
        if noise > 0.0 && sigma >= 0.0 {
            return Ok(noise);
        }
        Err("has no noise. Enter a `sigma` greater than 0: `relative` gives no noise to the number 0".to_owned())
    };
    Faults::list(y.iter().enumerate().map(noise)).map_err(|faults| faults.below("/y"))
}

fn parameter(given: &Value, tests: &[Test]) -> Result<Parameter, Faults> {
    let request: ParameterRequest = ParameterRequest::deserialize_from_value::<Value>(
        given.clone().into_value(),
        ValuePointerRef::Origin,
    )?;
    let only: Vec<String> = request.only.0.iter().flatten().filter_map(text).collect();
    if let Some(place) = only.iter().position(|name| tests.iter().all(|test| test.name != *name)) {
        let names: Vec<&str> = tests.iter().map(|test| test.name.as_str()).collect();
        return Err(Faults::one(&format!("/for/{place}"), unknown("test", &only[place], &names)));
    }
    let is_own = |test: &&Test| only.is_empty() || only.contains(&test.name);
    let Some(scenario) = tests.iter().find(is_own).map(|test| &test.scenario) else {
        return Err(Faults::one("/for", "must name at least one test"));
    };
    let member = Member::find(scenario, &request.pointer);
    let member = member.map_err(|detail| Faults::one("/pointer", detail))?;
    let read = |name: &str, value: &Value| {
        member.read(value).map_err(|detail| Faults::one(&format!("/{name}"), detail))
    };
    let mut range = Map::new();
    range.insert("pointer".to_owned(), json!(request.pointer));
    range.insert("from".to_owned(), request.from);
    range.insert("to".to_owned(), request.to);
    if let Some(spacing) = request.spacing.0 {
        range.insert("spacing".to_owned(), json!(spacing));
    }
    let Values::Range(low, high, spacing) = Varied::read(range.into(), Ok(member.clone()))?.values
    else {
        return Err(Faults::one("", "must have `from` and `to`"));
    };
    let is_log = spacing == Spacing::Logarithmic;
    if !(low < high && high.is_finite() && (!is_log || low > 0.0)) {
        let detail = "must be greater than `from`, and `from` must be greater than 0 if the spacing is logarithmic";
        return Err(Faults::one("/to", detail));
    }
    let start = request.start.0.as_ref().map(|start| read("start", start)).transpose()?;
    if start.is_some_and(|start| !(low..=high).contains(&start)) {
        return Err(Faults::one("/start", "must be from `from` to `to`"));
    }
    let prior = request.prior.0.as_ref().map(|prior| prior_of(prior, &member)).transpose()?;
    let unit = member.dimension.si();
    Ok(Parameter {
        pointer: request.pointer,
        only,
        unit: if unit.is_empty() { "1" } else { unit },
        low,
        high,
        is_log,
        start: start.unwrap_or(member.value.clamp(low, high)),
        prior,
    })
}

fn prior_of(given: &Value, member: &Member) -> Result<Prior, Faults> {
    let is_log = given.get("lognormal").is_some();
    if !is_log && given.get("normal").is_none() {
        return Err(Faults::one(
            "/prior",
            "must be `normal` or `lognormal`, such as {\"normal\": {\"mean\": 0.7, \"standard_deviation\": 0.1}}",
        ));
    }
    let distribution: Distribution = distribution_of(given, member).map_err(|faults| {
        Faults(
            faults
                .0
                .into_iter()
                .map(|mut fault| {
                    fault.pointer = fault.pointer.replacen("/distribution", "/prior", 1);
                    fault
                })
                .collect(),
        )
    })?;
    // The quantiles of a normal distribution at the mean, and one standard deviation above it.
    let of = |u: f64| {
        let x = distribution.quantile(u);
        if is_log { libm::log(x) } else { x }
    };
    let middle = of(0.5);
    Ok(Prior { middle, deviation: of(0.841_344_746_068_542_9) - middle, is_log })
}

/// The relative numerical error of a scenario. Its tolerance becomes smaller if the noise is small.
fn refine(scenario: &mut Value, noise: f64) -> f64 {
    if scenario.pointer("/model/method") == Some(&json!("simplified")) {
        return RULE;
    }
    if let Some(given) = scenario.pointer("/model/tolerance").and_then(Value::as_f64) {
        return IN_TOLERANCE * given;
    }
    let wanted = OF_NOISE / IN_TOLERANCE * noise;
    if wanted >= TOLERANCES.0 {
        return IN_TOLERANCE * TOLERANCES.0;
    }
    let tolerance = twelve_digits(wanted.max(TOLERANCES.1));
    let mut model = scenario.get("model").cloned().unwrap_or_else(|| json!({}));
    model["tolerance"] = json!(tolerance);
    scenario["model"] = model;
    IN_TOLERANCE * tolerance
}

/// Builds the fit: the sources of all tests, and the positions of all numbers.
fn assembled(
    tests: Vec<Test>,
    parameters: Vec<Parameter>,
    confidence: f64,
    starts: u32,
) -> Result<Fit, Faults> {
    let stated = tests.iter().flat_map(|test| &test.data).filter(|set| !set.is_estimated);
    let ratios = stated.flat_map(|set| {
        let own = set.y.iter().zip(&set.noise);
        own.filter_map(|(y, noise)| Some(noise / y.filter(|y| *y != 0.0)?.abs()))
    });
    let noise = ratios.fold(f64::INFINITY, f64::min);
    let mut building = Building::default();
    for (place, mut test) in tests.into_iter().enumerate() {
        let accuracy = refine(&mut test.scenario, noise);
        building.accuracy = building.accuracy.max(accuracy);
        building.add(place, test, &parameters)?;
    }
    let unknown = parameters.iter().filter(|parameter| parameter.prior.is_none()).count();
    let has_depths = |place: &usize| building.is_depth[*place];
    let measured: Vec<usize> = (0..building.points.len())
        .filter(|place| building.points[*place].value.is_finite())
        .collect();
    let depths = measured.iter().filter(|place| has_depths(place)).count();
    let volumes = measured.iter().filter(|place| building.is_volume[**place]).count();
    let coefficient =
        parameters.iter().position(|it| it.pointer.starts_with("/wear/") && it.only.is_empty());
    let subsets = if depths > 0 && volumes > 0 && coefficient.is_some() {
        vec![building.is_volume, building.is_depth]
    } else {
        Vec::new()
    };
    let points = (0..starts).map(|start| start_at(start, &parameters)).collect();
    Ok(Fit {
        measured: Measured::new(building.points, building.is_estimated, unknown),
        starts: points,
        parameters,
        sources: building.sources,
        positions: building.positions,
        test_of: building.test_of,
        subsets,
        coefficient,
        tests: building.names,
        confidence,
        accuracy: building.accuracy,
        sets: building.sets,
        first: building.first,
    })
}

/// The first start is the given one. The others are spread over the ranges.
fn start_at(start: u32, parameters: &[Parameter]) -> Vec<f64> {
    let place = |(dimension, parameter): (usize, &Parameter)| {
        if start == 0 {
            return parameter.start;
        }
        // The additive sequence of M. Roberts, with the root of x^(d+1) = x + 1.
        let count = parameters.len() as f64;
        let root = (0..40).fold(2.0_f64, |root, _| libm::pow(1.0 + root, 1.0 / (count + 1.0)));
        let step = libm::pow(root, -(dimension as f64 + 1.0));
        parameter.value((0.5 + f64::from(start) * step).fract())
    };
    parameters.iter().enumerate().map(place).collect()
}

#[derive(Default)]
struct Building {
    names: Vec<String>,
    sources: Vec<Source>,
    positions: Vec<Position>,
    points: Vec<Point>,
    test_of: Vec<usize>,
    sets: Vec<Set>,
    first: Vec<usize>,
    is_estimated: Vec<bool>,
    is_depth: Vec<bool>,
    is_volume: Vec<bool>,
    /// The cluster of each specimen, and the number of clusters.
    specimens: BTreeMap<String, usize>,
    clusters: usize,
    accuracy: f64,
}

/// The runs that a test needs: one over cycles, one over energies, and one for each profile before the last one.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Needs {
    History(Over),
    Profile(f64),
}

impl Building {
    fn add(&mut self, place: usize, test: Test, parameters: &[Parameter]) -> Result<(), Faults> {
        let last = test.data.iter().filter_map(|set| match set.quantity {
            Quantity::Profile { at, .. } => Some(at),
            Quantity::History { .. } => None,
        });
        let last = last.fold(0.0, f64::max);
        let cycles = test
            .data
            .iter()
            .filter(|set| matches!(set.quantity, Quantity::History { over: Over::Cycles, .. }));
        // One run gives the history and the last profile, unless the history is longer.
        let is_shared = cycles.flat_map(|set| &set.x).all(|x| *x <= last);
        let needs = |set: &Data| match set.quantity {
            Quantity::History { over: Over::Cycles, .. } if is_shared => Needs::Profile(last),
            Quantity::History { over, .. } => Needs::History(over),
            Quantity::Profile { at, .. } => Needs::Profile(at),
        };
        let mut known: Vec<(Needs, usize)> = Vec::new();
        for set in &test.data {
            let need = needs(set);
            let source = known.iter().find(|(other, _)| *other == need).map(|(_, source)| *source);
            let source = match source {
                Some(source) => source,
                None => {
                    let own: Vec<&Data> =
                        test.data.iter().filter(|set| needs(set) == need).collect();
                    let source = source_of(&test, need, &own, parameters)?;
                    self.sources.push(source);
                    known.push((need, self.sources.len() - 1));
                    self.sources.len() - 1
                }
            };
            self.add_set(place, &test, set, source);
        }
        self.names.push(test.name);
        Ok(())
    }

    fn add_set(&mut self, test: usize, of: &Test, data: &Data, source: usize) {
        self.first.push(self.points.len());
        self.is_estimated.push(data.is_estimated);
        let largest = data.y.iter().flatten().fold(0.0, |largest: f64, y| largest.max(y.abs()));
        let is_profile = matches!(data.quantity, Quantity::Profile { .. });
        let specimen = of.specimen.as_ref().map(|specimen| {
            let next = self.clusters;
            let known = *self.specimens.entry(specimen.clone()).or_insert(next);
            self.clusters = self.clusters.max(known + 1);
            known
        });
        // The points of a profile come from one trace.
        let trace = self.clusters;
        let set = set_of(&of.name, data);
        let is_volume = matches!(data.quantity, Quantity::History { column: "wear_volume", .. });
        let is_depth =
            is_profile || matches!(data.quantity, Quantity::History { column: "wear_depth", .. });
        for (place, (x, y)) in data.x.iter().zip(&data.y).enumerate() {
            let cluster = match specimen {
                Some(cluster) => cluster,
                None if is_profile => trace,
                None => self.clusters,
            };
            self.clusters = self.clusters.max(cluster + 1);
            let size = if is_profile { largest } else { y.unwrap_or(0.0).abs() };
            self.points.push(Point {
                value: y.unwrap_or(f64::NAN),
                noise: data.noise[place],
                numerical: self.accuracy * size,
                set: self.sets.len(),
                cluster,
            });
            self.positions.push(position(source, &self.sources[source], data, *x));
            self.test_of.push(test);
            self.is_volume.push(is_volume);
            self.is_depth.push(is_depth);
        }
        self.sets.push(set);
    }
}

/// Describes a set for the findings.
fn set_of(name: &str, data: &Data) -> Set {
    let (output, over, unit) = match &data.quantity {
        Quantity::Profile { field, .. } => (format!("profile.{}", field.name()), "radius", "m"),
        Quantity::History { output, column, over, .. } => {
            let unit = outcome::Quantity::named(column).map_or("1", |quantity| quantity.unit);
            let over = if *over == Over::Cycles { "cycles" } else { "dissipated_energy" };
            (output.clone(), over, if output == MASS_LOSS { "kg" } else { unit })
        }
    };
    Set {
        name: name.to_owned(),
        output,
        over,
        unit,
        x: data.x.clone(),
        is_estimated: data.is_estimated,
    }
}

/// The place of a number in the runs of its source.
fn position(index: usize, source: &Source, data: &Data, x: f64) -> Position {
    let (place, factor) = match &data.quantity {
        Quantity::History { column, factor, .. } => {
            let column = source.columns.iter().position(|known| known == column).unwrap_or(0);
            (Place::History { column, x }, *factor)
        }
        Quantity::Profile { field, .. } => {
            let profiles = source.problem.profiles.iter();
            let fields = profiles.clone().flat_map(|profiles| &profiles.fields);
            let radii = profiles.flat_map(|profiles| &profiles.radii);
            let curve = fields.take_while(|known| *known != field).count();
            (Place::Profile { curve, radius: radii.take_while(|known| **known < x).count() }, 1.0)
        }
    };
    Position { source: index, place, factor }
}

/// Makes the runs that predict these sets of a test.
fn source_of(
    test: &Test,
    need: Needs,
    sets: &[&Data],
    parameters: &[Parameter],
) -> Result<Source, Faults> {
    let own = parameters.iter().enumerate();
    let own: Vec<_> =
        own.filter(|(_, it)| it.only.is_empty() || it.only.contains(&test.name)).collect();
    let mut scenario = test.scenario.clone();
    let (mut nodes, mut columns) = (Vec::new(), Vec::<String>::new());
    let (mut radii, mut fields) = (Vec::new(), Vec::new());
    for set in sets {
        match &set.quantity {
            Quantity::History { column, .. } => {
                nodes.extend_from_slice(&set.x);
                if columns.iter().all(|known| known != column) {
                    columns.push((*column).to_owned());
                }
            }
            Quantity::Profile { field, .. } => {
                radii.extend_from_slice(&set.x);
                if !fields.contains(field) {
                    fields.push(*field);
                }
            }
        }
    }
    let rescales =
        |(_, parameter): &(usize, &Parameter)| only_rescales(&parameter.pointer, &scenario);
    let rescaled = own.iter().position(rescales).filter(|_| matches!(need, Needs::History(_)));
    if let Needs::Profile(at) = need {
        nodes.push(at);
    }
    for list in [&mut nodes, &mut radii] {
        list.sort_by(f64::total_cmp);
        list.dedup();
    }
    if rescaled.is_some() {
        nodes = shared_nodes(nodes[0], nodes[nodes.len() - 1]);
    }
    scenario["cycles"] = match need {
        Needs::History(Over::DissipatedEnergy) => json!({"dissipated_energy": nodes}),
        _ => json!(nodes),
    };
    let told = |mut faults: Faults| {
        for fault in &mut faults.0 {
            fault.pointer.insert_str(0, "/scenario");
            fault.detail = format!("{} (in the test {})", fault.detail, test.name);
        }
        faults
    };
    fretwork_engine::scenario::prepare(scenario.clone(), "").map_err(told)?;
    let found = members(&scenario, &own)
        .map_err(|(place, detail)| Faults::one(&format!("/parameters/{place}/pointer"), detail))?;
    let pointers: Vec<&str> = own.iter().map(|(_, it)| it.pointer.as_str()).collect();
    if let Some(twice) = (1..pointers.len()).find(|it| pointers[..*it].contains(&pointers[*it])) {
        let detail = format!("is listed twice for the test {}", test.name);
        return Err(Faults::one(&format!("/parameters/{}/pointer", own[twice].0), detail));
    }
    let names =
        columns.iter().flat_map(|column| nodes.iter().map(move |node| format!("{column}@{node}")));
    let names: Result<Vec<OutputName>, String> = names.map(|name| name.parse()).collect();
    let outputs =
        OutputName::all_among(names.map_err(|detail| Faults::one("/tests", detail))?, &scenario)?;
    let mut problem = Problem::new(scenario, found, outputs);
    problem.profiles = (!fields.is_empty()).then_some(CommonProfiles { radii, fields });
    let start: Vec<f64> = own.iter().map(|(_, parameter)| parameter.start).collect();
    let _: Case = problem.prepare(&start).map_err(told)?;
    let parameters = own.iter().map(|(place, _)| *place).collect();
    Ok(Source { problem, parameters, rescaled, nodes, columns })
}
