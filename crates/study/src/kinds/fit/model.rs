//! Parameters, sets of measured numbers, and the runs that predict these numbers.

use fretwork_engine::{Faults, Valid, twelve_digits};
use serde_json::{Value, json};

use crate::profile::Field;
use crate::{CommonProfiles, Found, Member, OutputName, Problem};

/// Values of a linear parameter that are smaller than this share of its bounds are near 0.
const NEAR_0: f64 = 0.01;
/// Noise that is a share of the number is at least that of this share of the largest number. Depths beside a scar are 0.
const LEAST: f64 = 1e-3;
const LEAST_DEPTH: f64 = 0.1;
/// The wear coefficients. They only rescale the cycles if nothing else depends on them.
const COEFFICIENTS: [&str; 2] = ["/wear/coefficient", "/wear/energy_coefficient"];
/// Members of a scenario that depend on the cycles in another way.
const CYCLIC: [&str; 4] = ["/until", "/motion/blocks", "/motion/reversals", "/wear/bodies"];
/// The columns that are counted over the cycles. All others follow from the wear so far.
const COUNTED: [&str; 2] = ["dissipated_energy", "cycles"];
/// A run is shared by coefficients up to this factor above and below its own.
const SHARED: f64 = std::f64::consts::SQRT_2;
/// The ratio of consecutive output cycles of a run that several coefficients share. Cubic interpolation between them
/// has an error of about 1e-6.
const RATIO: f64 = 1.19;
/// Maximum number of these output cycles.
const MAX_NODES: f64 = 240.0;

/// A number of the scenario that is estimated.
#[derive(Debug, Clone)]
pub struct Parameter {
    /// The pointer in the scenario.
    pub pointer: String,
    /// The tests to which it belongs; empty for all.
    pub only: Vec<String>,
    /// The SI unit.
    pub unit: &'static str,
    /// The bounds.
    pub low: f64,
    pub high: f64,
    /// Whether it is spaced logarithmically between them.
    pub is_log: bool,
    pub start: f64,
}

impl Parameter {
    /// The value at a coordinate from 0 to 1.
    pub fn value(&self, u: f64) -> f64 {
        let distance = u.clamp(0.0, 1.0) * self.width();
        let x = if self.is_log { self.low * libm::exp(distance) } else { self.low + distance };
        x.clamp(self.low, self.high)
    }

    /// The coordinate of a value.
    pub fn coordinate(&self, x: f64) -> f64 {
        (if self.is_log { libm::log(x / self.low) } else { x - self.low }) / self.width()
    }

    fn width(&self) -> f64 {
        if self.is_log { libm::log(self.high / self.low) } else { self.high - self.low }
    }

    /// The change that counts as large: the value itself, or a part of the range for values near 0.
    pub fn scale(&self, x: f64) -> f64 {
        if self.is_log { x } else { x.abs().max(NEAR_0 * self.high.abs().max(self.low.abs())) }
    }

    /// A large change of this value, in coordinates.
    pub fn step(&self, x: f64) -> f64 {
        (if self.is_log { 1.0 } else { self.scale(x) }) / self.width()
    }

    /// The name of its column, such as `/friction`, or `/friction (A1, A2)`.
    pub fn column(&self) -> String {
        let Self { pointer, only, .. } = self;
        if only.is_empty() { pointer.clone() } else { format!("{pointer} ({})", only.join(", ")) }
    }

    /// The name in texts, such as `wear.coefficient`.
    pub fn name(&self) -> String {
        self.column().trim_start_matches('/').replace('/', ".")
    }
}

/// A measured quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MeasuredQuantity {
    /// A column of the history, times a factor.
    Column { column: &'static str, factor: f64 },
    /// The depth of the scar after a number of cycles, perhaps of one body.
    Profile { at: f64, body: Option<usize> },
    /// A parameter, or its logarithm, that is known before the measurement.
    Prior { parameter: usize, is_log: bool },
}

impl Default for MeasuredQuantity {
    fn default() -> Self {
        Self::Prior { parameter: 0, is_log: false }
    }
}

/// A set of measured numbers.
#[derive(Debug, Default)]
pub struct Set {
    /// The index of its test. Priors have one more.
    pub test: usize,
    pub output: String,
    pub unit: &'static str,
    /// What x is.
    pub over: &'static str,
    pub quantity: MeasuredQuantity,
    /// The points. After the measured ones, points of a grid follow, for bands. `y` is `None` for a number that was not
    /// measured.
    pub x: Vec<f64>,
    pub y: Vec<Option<f64>>,
    /// The pointers of the measured numbers in the fit.
    pub pointers: Vec<String>,
    /// The parts of the noise of all measured points that do not depend on the number.
    pub noise: Vec<f64>,
    /// The part that is a share of the number.
    pub share: f64,
    /// Whether the noise is that of the logarithm.
    pub is_log: bool,
    pub is_estimated: bool,
    /// The runs that predict the numbers. A prior needs none.
    pub runs: Option<Runs>,
}

/// The runs of a set: the scenario of its test at some output cycles, with parameters as members.
#[derive(Debug)]
pub struct Runs {
    pub problem: Problem,
    /// The parameter of each member of the problem.
    pub parameters: Vec<usize>,
    /// The index among the members of the parameter that only rescales the cycles.
    pub rescaled: Option<usize>,
    /// The output cycles, or the energies, ascending.
    nodes: Vec<f64>,
    /// The wear volume per energy if it is constant: a parameter, or a value. Then no run is necessary.
    line: Option<(Option<usize>, f64)>,
}

/// Whether a coefficient with this pointer only rescales the cycles of a scenario.
fn only_rescales(pointer: &str, scenario: &Value) -> bool {
    let is_number = |value: &Value| value.is_number() || value.is_string();
    COEFFICIENTS.contains(&pointer)
        && scenario.pointer(pointer).is_some_and(is_number)
        && scenario.get("friction").is_some_and(is_number)
        && CYCLIC.iter().all(|pointer| scenario.pointer(pointer).is_none())
}

/// The output cycles of a run that several coefficients share.
fn shared_nodes(low: f64, high: f64) -> Vec<f64> {
    let (from, to) = (low / (SHARED * RATIO * RATIO), high * SHARED * RATIO * RATIO);
    let count = (libm::log(to / from) / libm::log(RATIO)).ceil().min(MAX_NODES);
    let node = |place: u32| twelve_digits(from * libm::pow(to / from, f64::from(place) / count));
    (0..=count as u32).map(node).collect()
}

impl Set {
    /// Whether these are depths; `None` if they are neither depths nor volumes.
    pub fn are_depths(&self) -> Option<bool> {
        match self.quantity {
            MeasuredQuantity::Profile { .. }
            | MeasuredQuantity::Column { column: "wear_depth", .. } => Some(true),
            MeasuredQuantity::Column { column: "wear_volume", .. } => Some(false),
            _ => None,
        }
    }

    /// Whether these are wear volumes over the dissipated energy.
    pub fn is_over_energy(&self) -> bool {
        self.are_depths() == Some(false) && self.over == "dissipated_energy"
    }

    /// The size of a measured number. Those of a profile have that of the largest one.
    pub fn size(&self, entry: usize) -> f64 {
        if self.over == "radius" { self.largest() } else { self.y[entry].map_or(0.0, f64::abs) }
    }

    pub fn largest(&self) -> f64 {
        self.y.iter().flatten().fold(0.0_f64, |largest, y| largest.max(y.abs()))
    }

    /// The least number whose share counts as noise.
    pub fn least(&self) -> f64 {
        self.largest() * if self.over == "radius" { LEAST_DEPTH } else { LEAST }
    }

    /// Makes the runs. `own` are the parameters of the test, with their indices.
    ///
    /// # Errors
    /// The scenario or a parameter is not valid.
    pub fn add_runs(&mut self, mut scenario: Value, own: &[(usize, &Parameter)]) -> Valid<()> {
        let (mut nodes, mut profiles, mut rescaled) = (self.x.clone(), None, None);
        nodes.sort_by(f64::total_cmp);
        nodes.dedup();
        let mut column = "wear_depth";
        match self.quantity {
            MeasuredQuantity::Profile { at, body } => {
                let radii = std::mem::replace(&mut nodes, vec![at]);
                profiles = Some(CommonProfiles { radii, fields: vec![Field::Wear], body });
            }
            MeasuredQuantity::Column { column: own_column, .. } => {
                column = own_column;
                // Wear may stop just beyond an energy. So nodes beside it do not help, and each coefficient has its own run.
                if self.over != "dissipated_energy" {
                    rescaled = own.iter().position(|(_, it)| only_rescales(&it.pointer, &scenario));
                }
            }
            MeasuredQuantity::Prior { .. } => return Ok(()),
        }
        if rescaled.is_some() {
            nodes = shared_nodes(nodes[0], nodes[nodes.len() - 1]);
        }
        scenario["cycles"] = json!(nodes);
        if self.over == "dissipated_energy" {
            scenario["cycles"] = json!({"dissipated_energy": nodes});
        }
        let below = |faults: Faults| faults.below("/scenario");
        fretwork_engine::scenario::prepare(scenario.clone(), "").map_err(below)?;
        let mut members = Vec::<Member>::new();
        for (place, parameter) in own {
            let twice = Err("is listed twice for this test".to_owned());
            let member = Member::find(&scenario, &parameter.pointer);
            let member = member.and_then(|it| if members.contains(&it) { twice } else { Ok(it) });
            let pointer = format!("/parameters/{place}/pointer");
            members.push(member.map_err(|detail| Faults::one(&pointer, detail))?);
        }
        let names = nodes.iter().map(|node| format!("{column}@{node}").parse::<OutputName>());
        let names = names.collect::<Result<_, _>>().map_err(|it| Faults::one("/tests", it))?;
        let outputs = OutputName::all_among(names, &scenario).map_err(below)?;
        let wear = scenario["wear"].as_object().filter(|wear| wear.len() == 1);
        let coefficient = wear.and_then(|_| Member::find(&scenario, COEFFICIENTS[1]).ok());
        let line = coefficient.filter(|_| self.is_over_energy()).map(|it| {
            let parameter = own.iter().find(|(_, own)| own.pointer == it.pointer);
            (parameter.map(|(place, _)| *place), it.value)
        });
        let new = Problem::new(scenario, members, outputs);
        let problem = Problem { profiles, has_errors: true, ..new };
        problem.prepare(&own.iter().map(|own| own.1.start).collect::<Vec<_>>()).map_err(below)?;
        let parameters = own.iter().map(|own| own.0).collect();
        self.runs = Some(Runs { problem, parameters, rescaled, nodes, line });
        Ok(())
    }

    /// The prediction of an entry for these parameters, from the run with these values, and its relative numerical
    /// error.
    pub fn predicted(
        &self,
        entry: usize,
        theta: &[f64],
        run: Option<(&[f64], &Found)>,
    ) -> Option<(f64, f64)> {
        let x = self.x[entry];
        if let MeasuredQuantity::Prior { parameter, is_log } = self.quantity {
            let value = theta[parameter];
            return Some((if is_log { libm::log(value) } else { value }, 0.0));
        }
        let Runs { rescaled, nodes, parameters, line, .. } = self.runs.as_ref()?;
        let MeasuredQuantity::Column { column, factor } = self.quantity else {
            let (_, found) = run?;
            let radii = &self.runs.as_ref()?.problem.profiles.as_ref()?.radii;
            let radius = radii.partition_point(|radius| *radius < x);
            return Some((found.profiles[0][radius]?, (*found.outputs.get(1)?)?));
        };
        if let Some((parameter, value)) = line {
            return Some((factor * x * parameter.map_or(*value, |it| theta[it]), 0.0));
        }
        let (values, found) = run?;
        let ratio = rescaled.map_or(1.0, |it| theta[parameters[it]] / values[it]);
        let node = nodes.partition_point(|node| *node < x * ratio).min(nodes.len() - 1);
        let value = match rescaled {
            None => found.outputs[node]?,
            Some(_) => interpolated(nodes, &found.outputs, x * ratio)?,
        };
        let counted = if COUNTED.contains(&column) { ratio } else { 1.0 };
        Some((factor * value / counted, (*found.outputs.get(nodes.len() + node)?)?))
    }
}

impl Runs {
    /// The values of the members for these parameters.
    fn own(&self, theta: &[f64]) -> Vec<f64> {
        self.parameters.iter().map(|it| theta[*it]).collect()
    }

    /// Estimated processor time of the run for these parameters, in seconds.
    pub fn seconds(&self, theta: &[f64]) -> f64 {
        self.problem.seconds(&self.own(theta))
    }

    /// The values of the members in the run for these parameters; `None` if no run is necessary.
    pub fn values(&self, theta: &[f64]) -> Option<Vec<f64>> {
        let mut values = self.own(theta);
        if let Some(member) = self.rescaled {
            // The coefficients of runs are powers of 2, so that near coefficients share runs.
            let power = (libm::log2(values[member]) / libm::log2(SHARED * SHARED)).round();
            values[member] = twelve_digits(libm::exp2(power));
        }
        self.line.is_none().then_some(values)
    }
}

/// The number at x of a curve through numbers over the logarithm of the nodes: a cubic through the next four.
fn interpolated(nodes: &[f64], outputs: &[Option<f64>], x: f64) -> Option<f64> {
    let next = nodes.partition_point(|node| *node < x);
    let first = next.saturating_sub(2).min(nodes.len() - 4);
    let near = first..first + 4;
    let y: Vec<f64> = outputs[near.clone()].iter().copied().collect::<Option<_>>()?;
    let s: Vec<f64> = nodes[near].iter().map(|node| libm::log(*node)).collect();
    let is_positive = y.iter().all(|y| *y > 0.0);
    let at = libm::log(x);
    let term = |(i, y): (usize, &f64)| {
        let others = (0..4).filter(|j| *j != i);
        let weight: f64 = others.map(|j| (at - s[j]) / (s[i] - s[j])).product();
        weight * if is_positive { libm::log(*y) } else { *y }
    };
    let value: f64 = y.iter().enumerate().map(term).sum();
    Some(if is_positive { libm::exp(value) } else { value })
}
