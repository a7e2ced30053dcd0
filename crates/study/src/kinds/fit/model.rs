//! Parameters, and sets of measured numbers.

use deserr::Deserr;
use fretwork_engine::request::fault::Faults;

use crate::profile::Field;

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
        let distance = u * self.width();
        let x = if self.is_log { self.low * libm::exp(distance) } else { self.low + distance };
        x.clamp(self.low, self.high)
    }

    /// The coordinate of a value.
    pub fn coordinate(&self, x: f64) -> f64 {
        let distance = if self.is_log { libm::log(x / self.low) } else { x - self.low };
        distance / self.width()
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
        if self.is_log { 1.0 / self.width() } else { self.scale(x) / self.width() }
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

    /// Whether it belongs to a test with this name.
    pub fn is_of(&self, test: &str) -> bool {
        self.only.is_empty() || self.only.iter().any(|own| own == test)
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

/// A set of measured numbers of one test.
#[derive(Debug)]
pub struct Set {
    /// The index of its test.
    pub test: usize,
    pub output: String,
    pub unit: &'static str,
    pub quantity: Quantity,
    /// The points. After the measured ones, points of a grid follow, for bands. `y` is `None` for a number that was not
    /// measured.
    pub x: Vec<f64>,
    pub y: Vec<Option<f64>>,
    /// The standard deviations of all measured points.
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

    /// Whether these are wear volumes over the dissipated energy.
    pub fn is_over_energy(&self) -> bool {
        let Quantity::Column { column, over, .. } = self.quantity else { return false };
        column == "wear_volume" && over == Over::Energy
    }

    /// The size of the largest measured number.
    pub fn largest(&self) -> f64 {
        self.y.iter().flatten().fold(0.0, |largest, y| largest.max(y.abs()))
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

/// A predicted number: an entry of a set.
#[derive(Debug, Clone, Copy)]
pub struct Position {
    pub set: usize,
    pub entry: usize,
    /// The index of the source of its set.
    pub source: usize,
}
