//! The log likelihood of the parameters of a stored fit, for tools that sample them.
//!
//! # Equations
//! ```text
//! ln L = −½ Σ [rᵢ² + wᵢ ln(2π sᵢ²)],   ∂ln L/∂x = −Σ rᵢ ∂rᵢ/∂x
//! ```
//! The residuals r, weights w and deviations s are those of the fit, so its estimate is the maximum. Priors count as
//! measured numbers, those of `lognormal` in ln x; else the parameters have none. Estimated noise stays at the scale that the
//! fit has found: a marginal likelihood would need a prior of the noise, and has another maximum where runs have errors.
//! With few points, intervals of the fit are wider, because they use Student's t.

use std::f64::consts::TAU;
use std::sync::Arc;

use fretwork_engine::numeric::dot;
use serde::Deserialize;
use serde_json::Value;

use super::model::Parameter;
use super::search::{Fit, Known, Search};
use crate::claimed::{Columns, column_of};
use crate::{Column, OrRun, Plan as _, PointRun, Problem, Tried};

/// The answer where a prediction is missing. JSON has no infinity, and differences of two such numbers must be finite.
/// Outside of the bounds, the answer falls with the distance from them, so that a search finds back.
const IMPOSSIBLE: f64 = -1e200;
/// The largest distance from the bounds, in units of their own distance, that counts.
const FAR: f64 = 1e6;

/// The log likelihood of a fit.
#[derive(Debug)]
pub struct Likelihood {
    problem: Problem,
    fit: Fit,
    known: Known,
}

/// The members of the document of a fit that it needs.
#[derive(Deserialize)]
struct FitDocument<'a> {
    fit: Value,
    #[serde(borrow)]
    searches: Columns<'a>,
}

/// The computation of the log likelihood or of its gradient.
#[derive(Debug)]
pub struct LikelihoodCall {
    of: Arc<Likelihood>,
    theta: Vec<f64>,
    is_gradient: bool,
    point: PointRun,
}

impl Likelihood {
    /// Reads the document of a fit.
    ///
    /// # Errors
    /// A clause for the client: the document is not one of a fit that has found a minimum.
    pub fn read(document: &[u8]) -> Result<Self, String> {
        let read: FitDocument =
            serde_json::from_slice(document).map_err(|error| error.to_string())?;
        let faults = |_| "this version of the server cannot read its fit".to_owned();
        let (problem, fit) = super::parsed(read.fit).map_err(faults)?;
        let cells = |column: Column| column_of(&read.searches, &column.name, fit.points()).ok();
        let columns: Option<Vec<_>> = fit.columns().into_iter().map(cells).collect();
        let known = columns.and_then(|columns| fit.known_from(&columns));
        let known = known.filter(|known| known.rows[known.minimum].sum.is_finite());
        let known = known.ok_or("it has found no minimum. See `reason` in its `searches`")?;
        if known.measured.is_robust {
            return Err("its loss `huber` is no likelihood. Fit with the loss `squares`".to_owned());
        }
        Ok(Self { problem, fit, known })
    }

    /// The number of parameters.
    pub fn parameters(&self) -> usize {
        self.fit.parameters.len()
    }

    /// Approximate memory, in bytes.
    pub fn bytes(&self) -> usize {
        self.fit.memory() + 8 * self.known.rows.len() * self.fit.columns().len()
    }

    /// Prepares the log likelihood of these values in SI, or its gradient.
    pub fn at(self: &Arc<Self>, theta: Vec<f64>, is_gradient: bool) -> LikelihoodCall {
        LikelihoodCall { of: Arc::clone(self), theta, is_gradient, point: PointRun::default() }
    }

    /// The answer outside of the bounds: the value, or its gradient. `None` inside of them.
    fn beyond(&self, theta: &[f64], is_gradient: bool) -> Option<Vec<f64>> {
        // In units of the range: negative below it, and 0 inside.
        let distance = |(it, x): (&Parameter, &f64)| {
            ((x - x.clamp(it.low, it.high)) / (it.high - it.low)).clamp(-FAR, FAR)
        };
        let outside: Vec<f64> = self.fit.parameters.iter().zip(theta).map(distance).collect();
        if outside.iter().all(|distance| *distance == 0.0) {
            return None;
        }
        if !is_gradient {
            let size = outside.iter().map(|distance| distance.abs()).sum::<f64>();
            return Some(vec![IMPOSSIBLE * (1.0 + size)]);
        }
        let slope = |(it, distance): (&Parameter, &f64)| match *distance {
            0.0 => 0.0,
            distance => IMPOSSIBLE / (it.high - it.low) * distance.signum(),
        };
        Some(self.fit.parameters.iter().zip(&outside).map(slope).collect())
    }

    fn value(&self, theta: &[f64], tried: &[Tried]) -> OrRun<f64> {
        let residuals = self.search(tried).residuals(theta)?;
        let terms = self.known.measured.taking_part().map(|(place, point)| {
            let deviation = self.known.noise.deviations[place];
            let constant = point.weight * libm::log(TAU * deviation * deviation);
            residuals[place] * residuals[place] + constant
        });
        let value = -0.5 * terms.sum::<f64>();
        Ok(if value.is_finite() { value } else { IMPOSSIBLE })
    }

    fn gradient(&self, theta: &[f64], tried: &[Tried]) -> OrRun<Vec<f64>> {
        let parameters = &self.fit.parameters;
        let u: Vec<f64> = parameters.iter().zip(theta).map(|(it, x)| it.coordinate(*x)).collect();
        let at = |u: &[f64]| -> Vec<f64> {
            parameters.iter().zip(u).map(|(it, u)| it.value(*u)).collect()
        };
        let residuals = self.search(tried).residuals(&at(&u))?;
        if residuals.iter().any(|residual| !residual.is_finite()) {
            return Ok(vec![0.0; u.len()]);
        }
        let all: Vec<usize> = (0..u.len()).collect();
        let slopes = self.search(tried).slopes(&at, &u, &all, true)?;
        let entry = |(place, slopes): (usize, &Vec<f64>)| {
            let (it, x) = (&parameters[place], theta[place]);
            -dot(&residuals, slopes) * it.step(x) / it.scale(x)
        };
        Ok(slopes.iter().enumerate().map(entry).collect())
    }

    fn search<'a>(&'a self, tried: &'a [Tried]) -> Search<'a> {
        let Known { measured, noise, .. } = &self.known;
        Search { fit: &self.fit, tried, measured, noise }
    }
}

impl LikelihoodCall {
    /// Estimated processor time, in seconds.
    pub fn seconds(&self) -> f64 {
        let Self { of, theta, is_gradient, .. } = self;
        let seconds = of.fit.runs().map(|runs| runs.seconds(theta)).sum::<f64>();
        let count = if *is_gradient { 1 + 2 * theta.len() } else { 1 };
        if of.beyond(theta, false).is_none() { count as f64 * seconds } else { 0.0 }
    }

    /// Continues for at most about 30 ms. Returns the log likelihood alone, or its gradient.
    pub fn step(&mut self) -> Option<Vec<f64>> {
        let Self { of, theta, is_gradient, point } = self;
        if let Some(answer) = of.beyond(theta, *is_gradient) {
            return Some(answer);
        }
        point.step(&of.fit, &of.problem, |tried| {
            if *is_gradient {
                of.gradient(theta, tried)
            } else {
                of.value(theta, tried).map(|value| vec![value])
            }
        })
    }
}
