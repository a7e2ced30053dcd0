//! Predictions: what runs say about measured numbers, as a function of the parameters.

use deserr::Deserr;
use fretwork_engine::numeric::twelve_digits;
use fretwork_engine::request::fault::Faults;
use serde_json::Value;

use crate::plan::Tried;
use crate::problem::{Found, Problem};
use crate::profile::Field;

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

/// Values of a linear parameter that are smaller than this share of its bounds are near 0.
const NEAR_0: f64 = 0.01;

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
    pub prior: Option<Prior>,
}

/// What is known about a parameter before the measurement.
#[derive(Debug, Clone, Copy)]
pub struct Prior {
    /// The most probable number, and its standard deviation; of the logarithm if `is_log`.
    pub middle: f64,
    pub deviation: f64,
    pub is_log: bool,
}

impl Parameter {
    /// The value at a coordinate from 0 to 1.
    pub fn value(&self, u: f64) -> f64 {
        let value = if self.is_log {
            self.low * libm::exp(u * libm::log(self.high / self.low))
        } else {
            self.low + u * (self.high - self.low)
        };
        value.clamp(self.low, self.high)
    }

    /// The coordinate of a value.
    pub fn coordinate(&self, x: f64) -> f64 {
        if self.is_log {
            libm::log(x / self.low) / libm::log(self.high / self.low)
        } else {
            (x - self.low) / (self.high - self.low)
        }
    }

    /// The change that counts as large: the value itself, or a part of the range for values near 0.
    pub fn scale(&self, x: f64) -> f64 {
        if self.is_log { x } else { x.abs().max(NEAR_0 * self.high.abs().max(self.low.abs())) }
    }

    /// The value at a distance from another one: the logarithm of their ratio, or a part of the scale.
    pub fn moved(&self, from: f64, distance: f64) -> f64 {
        let moved = if self.is_log {
            from * libm::exp(distance)
        } else {
            from + distance * self.scale(from)
        };
        moved.clamp(self.low, self.high)
    }

    /// The residual of the prior, and its derivative.
    pub fn prior_residual(&self, x: f64) -> Option<(f64, f64)> {
        let Prior { middle, deviation, is_log } = self.prior?;
        Some(if is_log {
            ((libm::log(x) - middle) / deviation, 1.0 / (x * deviation))
        } else {
            ((x - middle) / deviation, 1.0 / deviation)
        })
    }

    /// The name of its column.
    pub fn column(&self) -> String {
        let Self { pointer, only, .. } = self;
        if only.is_empty() { pointer.clone() } else { format!("{pointer} ({})", only.join(", ")) }
    }

    /// The name in texts, such as `wear.coefficient`, or `friction (A1, A2)`.
    pub fn name(&self) -> String {
        self.column().trim_start_matches('/').replace('/', ".")
    }
}

/// What a column of the history is measured over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserr)]
#[deserr(error = Faults, rename_all = lowercase)]
pub enum Over {
    Cycles,
    #[deserr(rename = "dissipated_energy")]
    Energy,
}

/// A measured quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Quantity {
    /// A column of the history, times a factor.
    Column { column: &'static str, factor: f64, over: Over },
    /// A profile after a number of cycles, perhaps of one body.
    Profile { field: Field, at: f64, body: Option<usize> },
}

/// A set of measured numbers of one test. A number that was not measured is `None`.
#[derive(Debug)]
pub struct Set {
    /// The index of its test.
    pub test: usize,
    pub output: String,
    pub unit: &'static str,
    pub quantity: Quantity,
    pub x: Vec<f64>,
    pub y: Vec<Option<f64>>,
    pub noise: Vec<f64>,
    pub is_estimated: bool,
}

impl Set {
    /// Whether these are depths; `None` if they are neither depths nor volumes.
    pub fn are_depths(&self) -> Option<bool> {
        match self.quantity {
            Quantity::Profile { .. } | Quantity::Column { column: "wear_depth", .. } => Some(true),
            Quantity::Column { column, .. } => (column == "wear_volume").then_some(false),
        }
    }

    /// The size of the largest measured number.
    pub fn largest(&self) -> f64 {
        self.y.iter().flatten().fold(0.0, |largest, y| largest.max(y.abs()))
    }

    /// The runs that it needs: those of its test over cycles, over energies, or up to a profile.
    pub fn needs(&self) -> (usize, &'static str, Option<(f64, Option<usize>)>) {
        let profile = match self.quantity {
            Quantity::Profile { at, body, .. } => Some((at, body)),
            Quantity::Column { .. } => None,
        };
        (self.test, self.over(), profile)
    }

    /// What x is.
    pub fn over(&self) -> &'static str {
        match self.quantity {
            Quantity::Profile { .. } => "radius",
            Quantity::Column { over: Over::Cycles, .. } => "cycles",
            Quantity::Column { over: Over::Energy, .. } => "dissipated_energy",
        }
    }
}

/// The runs of a test: its scenario at some output cycles, with parameters as members.
#[derive(Debug)]
pub struct Source {
    pub problem: Problem,
    /// The parameter of each member of the problem.
    pub parameters: Vec<usize>,
    /// The index among the members of the parameter that only rescales the cycles.
    pub rescaled: Option<usize>,
    /// The output cycles, or the energies, ascending.
    pub nodes: Vec<f64>,
    /// The names of the columns of the history. The outputs of the problem are all nodes of the first column, then of
    /// the second one, and so on.
    pub columns: Vec<&'static str>,
}

/// A predicted number: an entry of a set.
#[derive(Debug, Clone, Copy)]
pub struct Position {
    pub set: usize,
    pub entry: usize,
    /// The index of its source, and where it is in a run.
    pub source: usize,
    pub place: Place,
}

/// Where a number is in a run.
#[derive(Debug, Clone, Copy)]
pub enum Place {
    /// A column of the history at a number of cycles, or at a dissipated energy, times a factor.
    History { column: usize, x: f64, factor: f64 },
    /// A curve, and the index of a radius.
    Profile { curve: usize, radius: usize },
}

/// Whether a coefficient with this pointer only rescales the cycles of a scenario.
pub fn only_rescales(pointer: &str, scenario: &Value) -> bool {
    let is_number = |value: &Value| value.is_number() || value.is_string();
    COEFFICIENTS.contains(&pointer)
        && scenario.pointer(pointer).is_some_and(is_number)
        && scenario.get("friction").is_some_and(is_number)
        && CYCLIC.iter().all(|pointer| scenario.pointer(pointer).is_none())
}

/// The output cycles of a run that several coefficients share.
pub fn shared_nodes(low: f64, high: f64) -> Vec<f64> {
    let (from, to) = (low / (SHARED * RATIO * RATIO), high * SHARED * RATIO * RATIO);
    let count = (libm::log(to / from) / libm::log(RATIO)).ceil().min(MAX_NODES);
    let node = |place: u32| twelve_digits(from * libm::pow(to / from, f64::from(place) / count));
    (0..=count as u32).map(node).collect()
}

impl Source {
    /// The values of the members in the run for these parameters.
    fn values(&self, theta: &[f64]) -> Vec<f64> {
        let mut values: Vec<f64> = self.parameters.iter().map(|it| theta[*it]).collect();
        if let Some(member) = self.rescaled {
            // The coefficients of runs are powers of 2, so that near coefficients share runs.
            let power = (libm::log2(values[member]) / libm::log2(SHARED * SHARED)).round();
            values[member] = twelve_digits(libm::exp2(power));
        }
        values
    }

    /// The number of a run with these values, for these parameters.
    fn number(&self, place: Place, theta: &[f64], values: &[f64], found: &Found) -> Option<f64> {
        let (column, x, factor) = match place {
            Place::Profile { curve, radius } => return found.profiles.get(curve)?[radius],
            Place::History { column, x, factor } => (column, x, factor),
        };
        let count = self.nodes.len();
        let outputs = &found.outputs[column * count..(column + 1) * count];
        let Some(member) = self.rescaled else {
            let node = self.nodes.partition_point(|node| *node < x);
            return outputs.get(node)?.map(|value| factor * value);
        };
        let ratio = theta[self.parameters[member]] / values[member];
        let value = factor * interpolated(&self.nodes, outputs, x * ratio)?;
        Some(if COUNTED.contains(&self.columns[column]) { value / ratio } else { value })
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

/// The values of a run that is not known: the index of its source, and the values of its members.
pub type Wanted = Vec<f64>;

/// Predictions at these positions for these parameters, from known runs. A missing one is not a number.
///
/// # Errors
/// A run is not known.
pub fn predicted(
    sources: &[Source],
    positions: &[Position],
    theta: &[f64],
    tried: &[Tried],
) -> Result<Vec<f64>, Wanted> {
    let run = |(place, source): (usize, &Source)| {
        let mut values = source.values(theta);
        values.insert(0, place as f64);
        tried.iter().find(|tried| tried.values == values).ok_or(values)
    };
    let runs: Vec<&Tried> = sources.iter().enumerate().map(run).collect::<Result<_, _>>()?;
    let number = |position: &Position| {
        let Tried { values, found } = runs[position.source];
        let source = &sources[position.source];
        source.number(position.place, theta, &values[1..], found).unwrap_or(f64::NAN)
    };
    Ok(positions.iter().map(number).collect())
}
