//! The best parameters of a fit, and what the data say about them in numbers.

use std::collections::BTreeMap;

use super::interval::Side;
use super::model::MeasuredQuantity;
use super::search::{Fit, FitRow, Known};
use crate::stats::fisher;
use crate::stats::measured::{Information, Point};
use crate::stats::outliers::outliers;

/// Differences up to this share of the numbers can be numerical errors.
const NUMERICAL: f64 = 1e-3;
/// A parameter whose change by its own value changes predictions by less than this share has almost no effect.
const LITTLE: f64 = 0.05;
/// A parameter whose coordinate is nearer to 0 or 1 than this is at a bound.
const AT_BOUND: f64 = 2e-3;
/// Denominator degrees of freedom that stand for known noise.
pub const MANY: f64 = 1e7;
/// Repeated points that differ by less than this share of all residuals were read twice.
const ROUNDING: f64 = 1e-12;
/// Repeated points scatter more than stated if chance makes so large a scatter with a smaller probability.
const UNLIKELY: f64 = 0.05;
/// Fewer degrees of freedom of repeated points do not test a law whose noise is estimated.
const FEWEST: f64 = 4.0;
/// With at least [`ENOUGH`] points, outliers do not judge the law if they are at most one in [`AMONG`]. If they are more, all
/// points judge it.
const ENOUGH: usize = 8;
const AMONG: usize = 6;

/// What is told about the best parameters.
pub struct Told<'a> {
    pub fit: &'a Fit,
    pub known: &'a Known,
    pub best: &'a FitRow,
    /// What the data say without the priors, and with them.
    pub alone: Information,
    pub information: Information,
    /// The lower and the upper side of the interval of each parameter.
    pub sides: Vec<[Side<'a>; 2]>,
    /// The studentised residuals by position, and the positions of the outliers.
    pub studentized: BTreeMap<usize, f64>,
    pub outliers: Vec<usize>,
    /// The residuals by position that judge the law: those of the fit without outliers, if these are few. Their sum of squares.
    pub judges: BTreeMap<usize, f64>,
    pub sum: f64,
}

impl<'a> Told<'a> {
    pub fn new(fit: &'a Fit, known: &'a Known) -> Self {
        let [alone, information] = [false, true].map(|priors| fit.information(known, priors));
        let best = &known.rows[known.minimum];
        let of = |place| [false, true].map(|is_high| fit.side(known, place, is_high));
        let sides = (0..fit.parameters.len()).map(of).collect();
        let own = known.measured.taking_part();
        let judges = own.map(|(place, _)| (place, -known.distances[place])).collect();
        let (studentized, outliers, sum) = (BTreeMap::new(), Vec::new(), best.sum);
        let mut told = Self {
            fit,
            known,
            best,
            alone,
            information,
            sides,
            studentized,
            outliers,
            judges,
            sum,
        };
        told.seek_outliers();
        told
    }

    /// Seeks outliers among the points that take part. Neighbours in a profile are not independent, and a prior is no measurement.
    fn seek_outliers(&mut self) {
        let is_single =
            |it: &usize| matches!(self.fit.set(*it).quantity, MeasuredQuantity::Column { .. });
        let places: Vec<usize> = self.points().map(|it| it.0).filter(is_single).collect();
        let distances: Vec<f64> = places.iter().map(|it| self.residual(*it)).collect();
        let column =
            |row: &FitRow| places.iter().map(|it| row.numbers[*it] / self.deviation(*it)).collect();
        let slopes: Vec<Vec<f64>> = self.fit.derivatives(self.known).iter().map(column).collect();
        let differs = |it: &usize| {
            let (measured, predicted) =
                (self.known.measured.points[*it].value, self.best.numbers[*it]);
            (measured - predicted).abs() > NUMERICAL * predicted.abs()
        };
        let is_known = slopes.iter().flatten().chain(&distances).all(|it| it.is_finite());
        if !is_known || !places.iter().any(differs) {
            return;
        }
        let found = outliers(&distances, &slopes, self.known.measured.freedom().is_some());
        self.outliers = found.places.iter().map(|it| places[*it]).collect();
        let most = if places.len() < ENOUGH { 0 } else { places.len().div_ceil(AMONG) };
        if (1..=most).contains(&found.places.len()) && places.len() == self.judges.len() {
            let slopes = self.known.measured.slopes(&self.known.noise);
            self.judges = places.iter().copied().zip(found.residuals).collect();
            self.judges.retain(|place, _| !self.outliers.contains(place));
            let residual = |(it, e): (&usize, &f64)| e * slopes[*it] * self.deviation(*it);
            self.sum = self.judges.iter().map(residual).map(|residual| residual * residual).sum();
        }
        self.studentized = places.into_iter().zip(found.studentized).collect();
    }

    /// The degrees of freedom of the residuals that judge the law.
    pub fn freedom(&self) -> f64 {
        let judges = self.known.measured.without(|place| !self.judges.contains_key(&place));
        judges.count(None) - self.fit.parameters.len() as f64
    }

    /// The points that take part, and their indices.
    pub fn points(&self) -> impl Iterator<Item = (usize, &Point)> {
        self.known.measured.taking_part()
    }

    pub fn deviation(&self, place: usize) -> f64 {
        self.known.noise.deviations[place]
    }

    /// The residual of a point without its weight.
    pub fn residual(&self, place: usize) -> f64 {
        -self.known.distances[place]
    }

    /// The root mean square deviation of the numbers of a set, relative to that of their predictions.
    pub fn share(&self, set: usize) -> f64 {
        let own = self.points().filter(|(place, _)| self.fit.positions[*place].0 == set);
        let own = own.map(|(place, _)| (self.deviation(place), self.best.numbers[place]));
        let (noise, size) = own.fold((0.0, 0.0), |sum, (s, y)| (sum.0 + s * s, sum.1 + y * y));
        (noise / size).sqrt()
    }

    /// For each position: the prediction, its deviation, the residual, and the bands. A number that was not measured has
    /// the mean relative deviation of its set.
    pub fn bands(&self) -> Vec<[f64; 8]> {
        let (fit, measured) = (self.fit, &self.known.measured);
        let shares: Vec<f64> = (0..fit.sets.len()).map(|set| self.share(set)).collect();
        let factor = measured.factor(fit.confidence);
        let derivatives = fit.derivatives(self.known);
        let band = |(place, y): (usize, &f64)| {
            let slopes: Vec<f64> = derivatives.iter().map(|row| row.numbers[place]).collect();
            let point = &measured.points[place];
            let relative = shares[fit.positions[place].0] * y.abs();
            let deviation = if point.weight > 0.0 { self.deviation(place) } else { relative };
            let confidence = fit.rise(self.known) * self.information.standard_error(&slopes);
            let prediction = libm::hypot(confidence, factor * deviation);
            let is_log = fit.set(place).is_log;
            let end = |by: f64| if is_log { y * libm::exp(by / y) } else { y + by };
            let [low, high] = [-confidence, confidence].map(end);
            let [least, most] = [-prediction, prediction].map(end);
            let studentized = self.studentized.get(&place).copied().unwrap_or(f64::NAN);
            [*y, deviation, self.residual(place), studentized, low, high, least, most]
        };
        self.best.numbers.iter().enumerate().map(band).collect()
    }

    pub fn is_at_bound(&self, place: usize) -> bool {
        let parameter = &self.fit.parameters[place];
        let u = parameter.coordinate(self.best.theta[place]);
        !(AT_BOUND..=1.0 - AT_BOUND).contains(&u)
    }

    /// Whether a large change of a parameter changes a prediction by more than a little.
    pub fn has_effect(&self, place: usize) -> bool {
        let changes = &self.fit.derivatives(self.known)[place].numbers;
        self.points().any(|(it, _)| changes[it].abs() > LITTLE * self.best.numbers[it].abs())
    }

    /// What points that were measured more than once tell. Such points have the same x and equal predictions. In profiles they
    /// have not: all points beside the scar have the prediction 0.
    pub fn repeats(&self) -> Option<Repeats> {
        let mut groups = BTreeMap::<(Option<usize>, &str, [u64; 2]), Vec<(f64, f64)>>::new();
        for (&place, &residual) in &self.judges {
            let (set, (_, entry)) = (self.fit.set(place), self.fit.positions[place]);
            let own = [set.x[entry], self.best.numbers[place]].map(f64::to_bits);
            let key = ((set.over == "radius").then_some(place), set.output.as_str(), own);
            groups.entry(key).or_default().push((residual, self.deviation(place)));
        }
        let spread = |group: &Vec<(f64, f64)>| {
            let weights: f64 = group.iter().map(|(_, s)| 1.0 / (s * s)).sum();
            let mean = group.iter().map(|(residual, s)| residual / s).sum::<f64>() / weights;
            let rest = group.iter().map(|(residual, s)| residual - mean / s);
            rest.map(|rest| rest * rest).sum::<f64>()
        };
        let pure: f64 = groups.values().map(spread).sum();
        let (points, count) = (self.judges.len(), groups.len());
        let repeats = (points - count) as f64;
        let parameters = self.fit.parameters.len() as f64;
        let freedom = count as f64 - parameters;
        let is_stated = self.known.measured.freedom().is_none();
        let is_clustered = (self.freedom() + parameters - points as f64).abs() > 0.5;
        let are_few = repeats < if is_stated { 1.0 } else { FEWEST };
        let ratio = pure / repeats;
        let are_equal = pure < ROUNDING * self.sum;
        if is_clustered || freedom < 1.0 || are_few || are_equal && !is_stated {
            return None;
        }
        // Numbers that were rounded, or read twice from one scar, scatter less than their stated errors.
        let (scale, of_scale) =
            if is_stated && ratio < 1.0 { (1.0, MANY) } else { (ratio, repeats) };
        let statistic = (self.sum - pure).max(0.0) / freedom / scale;
        let is_excess = is_stated && fisher::above(ratio, (repeats, MANY)) < UNLIKELY;
        Some(Repeats {
            statistic,
            probability: fisher::above(statistic, (freedom, of_scale)),
            excess: is_excess.then(|| ratio.sqrt()),
        })
    }
}

/// The test of lack of fit against points that were measured more than once.
#[derive(Debug, Clone, Copy)]
pub struct Repeats {
    /// F.
    pub statistic: f64,
    /// The probability of this F or a larger one if the law holds.
    pub probability: f64,
    /// How many times as large as stated the errors of the repeated points are, if chance does not explain it.
    pub excess: Option<f64>,
}
