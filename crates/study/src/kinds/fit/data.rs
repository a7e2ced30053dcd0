//! Reads the parameters and the tests of a fit.

use std::collections::{BTreeMap, BTreeSet};

use deserr::Deserr;
use fretwork_engine::{Faults, Given, List, Valid, twelve_digits, unknown};
use serde_json::{Value, json};

use super::model::{MeasuredQuantity, Parameter, Set};
use super::search::{Fit, tasks};
use super::sets::set;
use crate::member::Member;
use crate::stats::measured::{MeasuredNumbers, Point};
use crate::vary::{Spacing, Values, Varied, distribution_of};
use fretwork_json::typed;

/// Maximum number of measured numbers.
const MAX_NUMBERS: usize = 2000;
/// Maximum bytes of the name of a test.
const MAX_NAME: usize = 80;
/// A set has a grid for bands if it has at most this many numbers; the numbers of points of a grid, and of all grids.
const DENSE: usize = 100;
const GRID: usize = 25;
const GRIDS: usize = 1000;
/// The default tolerance of runs, and the smallest one that a fit chooses because the noise is small. The error of a run
/// is about half of its tolerance, and should be at most a quarter of the noise.
const TOLERANCES: (f64, f64) = (3e-3, 1e-4);
const OF_NOISE: f64 = 0.5;

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

/// A test: its scenario, and its specimen.
struct Test {
    name: String,
    specimen: Option<String>,
    /// The pointers of its changes.
    changed: Vec<String>,
    scenario: Value,
}

/// Reads a test.
fn test(
    place: usize,
    GivenTest { name, specimen, changes, data }: GivenTest,
    mut scenario: Value,
) -> Valid<(Test, Vec<Set>)> {
    let name = name.0.unwrap_or_else(|| (place + 1).to_string());
    if name.is_empty() || name.len() > MAX_NAME {
        return Err(Faults::one("/name", format!("must be a text of 1 to {MAX_NAME} bytes")));
    }
    let changes = changes.0.unwrap_or_default();
    if let Some(pointer) = changes.keys().find(|it| it.starts_with("/cycles")) {
        let detail =
            format!("has `{pointer}`, but the cycles of a test are those of its data. Remove it");
        return Err(Faults::one("/changes", detail));
    }
    let changed = changes.keys().cloned().collect();
    for (pointer, value) in changes {
        let (parent, member) = pointer.rsplit_once('/').unwrap_or(("?", ""));
        let Some(members) = scenario.pointer_mut(parent).and_then(Value::as_object_mut) else {
            let detail = format!(
                "has `{pointer}`, but the scenario has no object for it. Enter a pointer such as `/motion/amplitude`"
            );
            return Err(Faults::one("/changes", detail));
        };
        members.insert(member.to_owned(), value);
    }
    let sets = Faults::list(data.0.iter().map(|data| set(place, data)));
    let mut sets = sets.map_err(|faults| faults.below("/data"))?;
    for (entry, set) in sets.iter_mut().enumerate() {
        let place = format!("/tests/{place}/data/{entry}");
        set.pointers.iter_mut().for_each(|pointer| pointer.insert_str(0, &place));
    }
    Ok((Test { name, specimen: specimen.0, changed, scenario }, sets))
}

/// Reads a parameter of these tests, and its prior as a measured number.
fn parameter(place: usize, mut given: Value, tests: &[Test]) -> Valid<(Parameter, Option<Set>)> {
    let [only, start, prior] = ["for", "start", "prior"]
        .map(|name| given.as_object_mut().and_then(|members| members.shift_remove(name)));
    let only: Vec<String> = only.map_or(Ok(Vec::new()), typed).map_err(|it| it.below("/for"))?;
    let names: Vec<&str> = tests.iter().map(|test| test.name.as_str()).collect();
    if let Some(place) = only.iter().position(|name| !names.contains(&name.as_str())) {
        return Err(Faults::one(&format!("/for/{place}"), unknown("test", &only[place], &names)));
    }
    let own = names.iter().position(|name| only.first().is_none_or(|first| first == name));
    let pointer = given["pointer"].as_str().unwrap_or_default().to_owned();
    let mut own_tests = tests.iter().filter(|it| only.is_empty() || only.contains(&it.name));
    if let Some(test) = own_tests.find(|test| test.changed.contains(&pointer)) {
        let detail = format!(
            "is changed by the test \"{}\". Remove it there, or name the other tests in `for`",
            test.name
        );
        return Err(Faults::one("/pointer", detail));
    }
    let found = Member::find(&tests[own.unwrap_or(0)].scenario, &pointer);
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
    let prior = prior.map(|given| {
        let distribution = distribution_of(&given, &member)?.normal_parts();
        let (middle, deviation, is_log) =
            distribution.ok_or_else(|| "must be `normal` or `lognormal`".to_owned())?;
        let quantity = MeasuredQuantity::Prior { parameter: place, is_log };
        let (test, output, unit) = (tests.len(), pointer.clone(), "1");
        let (x, y, noise) = (vec![0.0], vec![Some(middle)], vec![deviation]);
        Ok::<_, Faults>(Set { test, output, unit, quantity, x, y, noise, ..Set::default() })
    });
    let prior = prior.transpose().map_err(|faults| faults.below("/prior"))?;
    let unit = Some(member.dimension.si()).filter(|unit| !unit.is_empty()).unwrap_or("1");
    Ok((Parameter { pointer, only, unit, low, high, is_log, start }, prior))
}

/// Checks that there are enough measured numbers, and not too many.
fn must_suffice(sets: &[Set], parameters: usize) -> Valid<()> {
    let all: usize = sets.iter().map(|set| set.y.len()).sum();
    let measured = sets.iter().flat_map(|set| &set.y).flatten().count();
    let noise = has_unknown_noise(sets);
    let unknown = if noise > 0 { " parameter(s) and the noise" } else { " parameter(s)" };
    let detail = match (all, measured) {
        (MAX_NUMBERS.., _) => format!(
            "have {all} numbers, but a fit can have fewer than {MAX_NUMBERS}. Thin out long profiles: neighbouring \
             points say the same"
        ),
        (_, few) if few < parameters + noise => format!(
            "have {few} measured number(s), too few for {parameters}{unknown}. Enter more numbers, or fewer parameters"
        ),
        _ => return Ok(()),
    };
    Err(Faults::one("/tests", detail))
}

/// Chooses a smaller tolerance for the runs of a scenario without one if the relative noise of the data is small.
fn refine(scenario: &mut Value, sets: &[Set]) {
    let stated = sets.iter().filter(|set| !set.is_estimated);
    let numbers =
        stated.flat_map(|set| set.y.iter().zip(&set.noise).map(|(y, noise)| (y, noise, set.share)));
    let shares = numbers
        .filter_map(|(y, noise, share)| Some(libm::hypot(noise / y.filter(|y| *y != 0.0)?, share)));
    let wanted = twelve_digits((OF_NOISE * shares.fold(f64::INFINITY, f64::min)).max(TOLERANCES.1));
    let model = scenario.get("model").cloned().unwrap_or(json!({}));
    let is_exact = model.is_object() && model.get("method") != Some(&json!("simplified"));
    if wanted < TOLERANCES.0 && is_exact && model.get("tolerance").is_none() {
        // Indexing adds the member `model` if the scenario does not have it.
        scenario["model"]["tolerance"] = json!(wanted);
    }
}

/// The measured numbers of all sets. Those at the pointers `without` do not take part.
fn points(
    sets: &[Set],
    tests: &[Test],
    noises: &[Option<String>],
    without: &[String],
) -> Vec<Point> {
    let (mut clusters, mut points) = (BTreeMap::new(), Vec::new());
    for (place, set) in sets.iter().enumerate() {
        for (entry, y) in set.y.iter().enumerate() {
            // A specimen is a cluster, and so is a profile. Other points stand for themselves.
            let specimen = tests.get(set.test).and_then(|test| test.specimen.as_deref());
            let own = if set.over == "radius" { (place, 0) } else { (place, entry) };
            let key = (specimen, if specimen.is_some() { (0, 0) } else { own });
            let new = clusters.len();
            let is_left_out = set.pointers.get(entry).is_some_and(|it| without.contains(it));
            points.push(Point {
                value: y.filter(|_| !is_left_out).unwrap_or(f64::NAN),
                noise: set.noise.get(entry).copied().unwrap_or(f64::NAN),
                share: set.share,
                least: set.least(),
                is_log: set.is_log,
                set: noises.partition_point(|noise| *noise < set.estimated()),
                cluster: *clusters.entry(key).or_insert(new),
                ..Point::default()
            });
        }
    }
    points
}

/// 1 if the noise of a set is estimated, which needs a number more.
fn has_unknown_noise(sets: &[Set]) -> usize {
    usize::from(sets.iter().any(|set| set.is_estimated))
}

impl Set {
    /// The output whose noise is estimated. All sets of an output have the same noise.
    fn estimated(&self) -> Option<String> {
        self.is_estimated.then(|| self.output.clone())
    }

    /// Appends the points of a grid over the range of x.
    fn add_grid(&mut self, count: usize) {
        let low = self.x.iter().copied().fold(f64::INFINITY, f64::min);
        let high = self.x.iter().copied().fold(0.0, f64::max);
        if low < high && self.x.len() <= DENSE {
            let step = (high - low) / (count - 1) as f64;
            self.x.extend((0..count).map(|place| twelve_digits(low + step * place as f64)));
            self.y.resize(self.x.len(), None);
        }
    }
}

/// Reads a fit of this scenario.
///
/// # Errors
/// All faults, with pointers relative to the fit.
pub fn fit(
    scenario: &Value,
    parameters: Vec<Value>,
    tests: Vec<GivenTest>,
    (confidence, starts): (f64, u32),
    without: &[String],
) -> Valid<Fit> {
    if !scenario.is_object() {
        return Err(Faults::one("/scenario", "must be an object"));
    }
    let read = tests.into_iter().enumerate().map(|(place, it)| test(place, it, scenario.clone()));
    let read = Faults::list(read).map_err(|faults| faults.below("/tests"))?;
    let (mut tests, sets): (Vec<_>, Vec<_>) = read.into_iter().unzip();
    let is_twice = |place: &usize| tests[..*place].iter().any(|it| it.name == tests[*place].name);
    if let Some(place) = (1..tests.len()).find(is_twice) {
        return Err(Faults::one(&format!("/tests/{place}/name"), "is the name of two tests"));
    }
    let read = parameters.into_iter().enumerate();
    let read = Faults::list(read.map(|(place, given)| parameter(place, given, &tests)));
    let read = read.map_err(|faults| faults.below("/parameters"))?;
    let (parameters, priors): (Vec<Parameter>, Vec<_>) = read.into_iter().unzip();
    let mut sets: Vec<Set> =
        sets.into_iter().flatten().chain(priors.into_iter().flatten()).collect();
    must_suffice(&sets, parameters.len())?;
    for test in &mut tests {
        refine(&mut test.scenario, &sets);
    }
    let grid = (GRIDS / sets.len()).clamp(2, GRID);
    for set in &mut sets {
        set.add_grid(grid);
        let Some(Test { name, scenario, .. }) = tests.get(set.test) else { continue };
        let is_own = |it: &Parameter| it.only.is_empty() || it.only.contains(name);
        let own: Vec<_> = parameters.iter().enumerate().filter(|it| is_own(it.1)).collect();
        set.add_runs(scenario.clone(), &own).map_err(|mut faults| {
            for fault in &mut faults.0 {
                fault.detail = format!("{} (in the test {name})", fault.detail);
            }
            faults
        })?;
    }
    let noises: BTreeSet<_> = sets.iter().map(Set::estimated).collect();
    let noises: Vec<Option<String>> = noises.into_iter().collect();
    let is_estimated = noises.iter().map(Option::is_some).collect();
    let is_unknown = |it: &String| !sets.iter().any(|set| set.pointers.contains(it));
    if let Some(number) = without.iter().position(is_unknown) {
        let detail = "must be the pointer of a measured number, such as /tests/0/data/0/y/2";
        return Err(Faults::one(&format!("/without/{number}"), detail));
    }
    let points = points(&sets, &tests, &noises, without);
    let unknown = parameters.len() + has_unknown_noise(&sets);
    if points.iter().filter(|point| point.value.is_finite()).count() < unknown {
        let detail = format!("leaves fewer than {unknown} numbers. Leave fewer out");
        return Err(Faults::one("/without", detail));
    }
    let has = |depths| sets.iter().any(|set| set.are_depths() == Some(depths));
    let is_coefficient = |it: &Parameter| it.pointer.starts_with("/wear/") && it.only.is_empty();
    let coefficient =
        parameters.iter().position(is_coefficient).filter(|_| has(true) && has(false));
    let positions = sets.iter().enumerate();
    let positions = positions.flat_map(|(place, set)| (0..set.x.len()).map(move |it| (place, it)));
    Ok(Fit {
        positions: positions.collect(),
        measured: MeasuredNumbers::new(points, is_estimated, parameters.len()),
        starts: (0..starts).map(|start| start_at(start, &parameters)).collect(),
        tasks: tasks(starts, parameters.len(), tests.len(), coefficient.is_some()),
        tests: tests.into_iter().map(|test| test.name).chain(["prior".to_owned()]).collect(),
        coefficient,
        parameters,
        sets,
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
