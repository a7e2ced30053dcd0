//! Measured numbers beside predicted ones: their weights, their noise, and what both say about parameters.
//!
//! The points of one cluster, such as all numbers from one specimen, have a common error. So a cluster of m points
//! counts as one point: each of its points has the weight 1/m. If there are not more clusters than parameters, each
//! point counts, and [`MeasuredNumbers::is_clustered`] is false.
//!
//! The noise of a set of points is stated, or it is estimated from the scatter of the set. It can have a part that is a
//! share of the true number. The prediction stands for that number, because a measured number that is too small by chance
//! would get too much weight. These parts are held while S is minimised: else S would fall where predictions are large.
//!
//! # Equations
//! ```text
//! rᵢ = √wᵢ (fᵢ − yᵢ)/sᵢ,   sᵢ² = (q σᵢ)² + nᵢ²,   σᵢ² = aᵢ² + (ρᵢ gᵢ)²,   S = Σ rᵢ²
//! rᵢ = √wᵢ ln(fᵢ/yᵢ) gᵢ/sᵢ   if the noise is lognormal
//! q² = Σ wᵢ (fᵢ − yᵢ)²/σᵢ² / (W (1 − p/ΣW)),   W = Σ wᵢ of a set with estimated noise, otherwise q = 1
//! S ≤ S_min + t²(ν)
//! ```
//! With the loss of Huber, a weight has the factor hᵢ = min(1, c/|zᵢ|) of its distance zᵢ = (gᵢ − yᵢ)/sᵢ, and in q², zᵢ² is at
//! most c²; the sum is divided by the mean of such squares. A number beyond c pulls as much as one at c, although its weight is
//! small, so that intervals are at least √(Σ wᵢ ψᵢ² N/(N − p) Σ wᵢ hᵢ)/Σ wᵢ ψᵢ′ times as wide, with ψᵢ = hᵢ zᵢ, its slope ψᵢ′ = 1 for |zᵢ| < c
//! and 0 beyond, and N = Σ wᵢ.
//!
//! σ is the noise, ρ its share of the number, g the prediction that is held, n the numerical error, p the number of
//! parameters, and ν the number of degrees of freedom. With stated noise t is the factor of the normal distribution.
//!
//! # Sources
//! D. M. Bates, D. G. Watts, Nonlinear Regression Analysis and Its Applications (1988), chapters 1, 2 and 6.
//! P. J. Huber, Robust Statistics (1981), chapters 6 and 7: the loss, and the estimate of the noise beside it.
//! R. J. Carroll, D. Ruppert, Transformation and Weighting in Regression (1988), chapter 2: weights that are held.

use std::collections::BTreeMap;

use basin::{DenseMatrix, SymmetricEigen as _};
use fretwork_engine::numeric::dot;

use super::fisher;

/// Estimated noise is at least this many times the stated one, so that no weight is infinite.
const LEAST_FACTOR: f64 = 1e-9;
/// A part of a direction that is smaller than this share of the largest part counts as none.
const PART: f64 = 0.15;

/// The distance c beyond which the loss of Huber is linear, and the mean of min(z², c²) for normal z.
const HUBER: f64 = 1.345;
const HUBER_MEAN: f64 = 0.710_164;
/// Number of rounds in which the noise beside the loss of Huber is found.
const HUBER_ROUNDS: usize = 30;
/// The least positive number whose logarithm is taken.
const TINY: f64 = 1e-300;

/// A measured number.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Point {
    /// The number y. If it is not a number, the point does not take part.
    pub value: f64,
    /// The part a of its noise that does not depend on the number, as a standard deviation. If the noise of its set is
    /// estimated, only the ratios of the noise matter.
    pub noise: f64,
    /// The part ρ of its noise that is a share of the prediction.
    pub share: f64,
    /// The least prediction whose share counts.
    pub least: f64,
    /// Whether the noise is that of the logarithm.
    pub is_log: bool,
    /// The numerical error n of a prediction.
    pub numerical: f64,
    /// The index of its set.
    pub set: usize,
    /// The number of its cluster.
    pub cluster: usize,
    /// Its weight w, which [`MeasuredNumbers::new`] computes. It is 0 if the point does not take part.
    pub weight: f64,
}

impl Point {
    /// The noise σ if this is the prediction.
    fn noise_at(&self, predicted: f64) -> f64 {
        libm::hypot(self.noise, self.share * predicted.abs().max(self.least))
    }

    /// The difference between a prediction and the number, for noise at the prediction `held`.
    fn difference(&self, predicted: f64, held: f64) -> f64 {
        if !self.is_log {
            return predicted - self.value;
        }
        libm::log(predicted.max(TINY) / self.value) * held.abs().max(self.least)
    }
}

/// The noise of all points at predictions that are held.
#[derive(Debug, Clone, Default)]
pub struct Noise {
    /// The factor q of each set.
    pub factors: Vec<f64>,
    /// The standard deviation s of the difference between each number and its prediction.
    pub deviations: Vec<f64>,
    held: Vec<f64>,
    /// The factors h of the weights: 1, or less for large residuals if the loss is that of Huber.
    trusts: Vec<f64>,
}

/// Measured numbers with weights.
#[derive(Debug, Clone)]
pub struct MeasuredNumbers {
    /// The numbers.
    pub points: Vec<Point>,
    /// For each set, whether its noise is estimated.
    is_estimated: Vec<bool>,
    /// Whether the points of a cluster count as one.
    pub is_clustered: bool,
    /// Whether the loss is that of Huber.
    pub is_robust: bool,
    /// The number of parameters, less the number of those with a prior.
    parameters: f64,
}

impl MeasuredNumbers {
    /// Numbers from which this number of parameters is estimated. Parameters with a prior are not counted.
    pub fn new(mut points: Vec<Point>, is_estimated: Vec<bool>, parameters: usize) -> Self {
        let mut sizes = BTreeMap::new();
        for point in points.iter().filter(|point| point.value.is_finite()) {
            *sizes.entry(point.cluster).or_insert(0.0) += 1.0;
        }
        let is_clustered = sizes.len() > parameters;
        for point in &mut points {
            let size = sizes.get(&point.cluster).filter(|_| is_clustered).unwrap_or(&1.0);
            point.weight = if point.value.is_finite() { 1.0 / size } else { 0.0 };
        }
        let (parameters, is_robust) = (parameters as f64, false);
        Self { points, is_estimated, is_clustered, is_robust, parameters }
    }

    /// The same numbers without those for which `is_left_out` holds.
    pub fn without(&self, is_left_out: impl Fn(usize) -> bool) -> Self {
        let mut rest = self.clone();
        let points = rest.points.iter_mut().enumerate();
        points.filter(|(place, _)| is_left_out(*place)).for_each(|(_, point)| point.weight = 0.0);
        rest
    }

    /// The points that take part, and their indices.
    pub fn taking_part(&self) -> impl Iterator<Item = (usize, &Point)> {
        self.points.iter().enumerate().filter(|(_, point)| point.weight > 0.0)
    }

    /// The effective number of points of all sets, or of one of them. The number of whole clusters is exact.
    pub fn count(&self, set: Option<usize>) -> f64 {
        let mut clusters = BTreeMap::<usize, (f64, f64)>::new();
        for (_, point) in self.taking_part().filter(|it| set.is_none_or(|set| it.1.set == set)) {
            let (points, weight) = clusters.entry(point.cluster).or_default();
            (*points, *weight) = (*points + 1.0, point.weight);
        }
        // A weight is the inverse of a small whole number, so this quotient is exact if the cluster is whole.
        clusters.values().map(|(points, weight)| points / (1.0 / weight).round()).sum()
    }

    /// The share of the points of a set that is left after the parameters were estimated.
    fn left(&self) -> f64 {
        let all = self.count(None);
        ((all - self.parameters) / all).max(1.0 / all)
    }

    /// The noise at predictions, with the factors that follow from them.
    pub fn noise(&self, predicted: &[f64]) -> Noise {
        let factor = |(set, is_estimated): (usize, &bool)| {
            let count = self.count(Some(set));
            if !is_estimated || count == 0.0 {
                return 1.0;
            }
            let own = self.taking_part().filter(|(_, point)| point.set == set);
            let distance = |(place, it): (usize, &Point)| {
                it.difference(predicted[place], predicted[place]) / it.noise_at(predicted[place])
            };
            let distances: Vec<(f64, f64)> = own.map(|it| (it.1.weight, distance(it))).collect();
            let mean = |limit: f64| {
                let squares = distances.iter().map(|(w, z)| w * (z * z).min(limit));
                (squares.sum::<f64>() / (count * self.left())).sqrt().max(LEAST_FACTOR)
            };
            let once = |q: f64, _| mean(HUBER * HUBER * q * q) / HUBER_MEAN.sqrt();
            let rounds = if self.is_robust { HUBER_ROUNDS } else { 0 };
            (0..rounds).fold(mean(f64::INFINITY), once).max(LEAST_FACTOR)
        };
        self.noise_with(self.is_estimated.iter().enumerate().map(factor).collect(), predicted)
    }

    /// The noise before there are predictions: that at the measured numbers.
    pub fn first_noise(&self) -> Noise {
        let values: Vec<f64> = self.points.iter().map(|point| point.value).collect();
        self.noise_at(&values)
    }

    /// The noise at predictions before its factors are estimated.
    pub fn noise_at(&self, predicted: &[f64]) -> Noise {
        self.noise_with(vec![1.0; self.is_estimated.len()], predicted)
    }

    /// The factor of a sum of squares that makes it comparable with sums in the weights of other predictions: the likelihood of
    /// numbers with larger noise is smaller, so the deviations count with their geometric mean.
    pub fn likeness(&self, noise: &Noise) -> f64 {
        let first = self.first_noise();
        let logarithm = |(at, it): (usize, &Point)| {
            it.weight * libm::log(noise.deviations[at] / first.deviations[at])
        };
        // The noise of a logarithm does not depend on the prediction.
        let sum: f64 = self.taking_part().filter(|it| !it.1.is_log).map(logarithm).sum();
        libm::exp(2.0 * sum / self.count(None))
    }

    fn noise_with(&self, factors: Vec<f64>, held: &[f64]) -> Noise {
        let of = |(it, held): (&Point, &f64)| {
            libm::hypot(factors[it.set] * it.noise_at(*held), it.numerical)
        };
        let deviations: Vec<f64> = self.points.iter().zip(held).map(of).collect();
        let mut noise =
            Noise { factors, deviations, held: held.to_vec(), trusts: vec![1.0; held.len()] };
        if self.is_robust {
            let distances = self.distances(held, &noise).into_iter();
            // A number that was not measured has no distance.
            noise.trusts = distances.map(|z| (HUBER / z.abs()).min(1.0)).collect();
        }
        noise
    }

    /// The differences between predictions and numbers, in standard deviations.
    pub fn distances(&self, predicted: &[f64], noise: &Noise) -> Vec<f64> {
        let of = |(place, it): (usize, &Point)| {
            it.difference(predicted[place], noise.held[place]) / noise.deviations[place]
        };
        self.points.iter().enumerate().map(of).collect()
    }

    /// The roots of the weights of all residuals; 0 for a number that does not take part.
    fn roots(&self, noise: &Noise) -> impl Iterator<Item = f64> {
        let weights = self.points.iter().zip(&noise.trusts).map(|(it, trust)| it.weight * trust);
        weights.map(f64::sqrt)
    }

    /// What a change of each prediction by 1 changes in its residual: √w/s.
    pub fn slopes(&self, noise: &Noise) -> Vec<f64> {
        let each = self.roots(noise).zip(&noise.deviations);
        each.map(|(root, s)| if root > 0.0 { root / s } else { 0.0 }).collect()
    }

    /// The residuals. A number that does not take part has none, even if it has no prediction.
    pub fn residuals(&self, predicted: &[f64], noise: &Noise) -> Vec<f64> {
        let each = self.roots(noise).zip(self.distances(predicted, noise));
        each.map(|(root, distance)| if root > 0.0 { root * distance } else { 0.0 }).collect()
    }

    /// The degrees of freedom from which noise is estimated, at least 1; `None` if all noise is stated.
    pub fn freedom(&self) -> Option<usize> {
        let estimated = self.is_estimated.iter().enumerate().filter(|(_, estimated)| **estimated);
        let counts: Vec<f64> = estimated.map(|(set, _)| self.count(Some(set))).collect();
        let freedom = (self.left() * counts.iter().sum::<f64>() + 1e-9).floor().max(1.0);
        (!counts.is_empty()).then_some(freedom as usize)
    }

    /// The size of an interval, in standard errors.
    pub fn factor(&self, confidence: f64) -> f64 {
        fisher::factor(confidence, self.freedom())
    }

    /// How many times as wide an interval is because some numbers lie beyond the distance c of the loss of Huber.
    pub fn spread(&self, noise: &Noise, distances: &[f64]) -> f64 {
        let sum = |of: &dyn Fn(f64, f64) -> f64| {
            let each =
                self.taking_part().map(|(at, it)| it.weight * of(noise.trusts[at], distances[at]));
            each.sum::<f64>()
        };
        let pulls = sum(&|h, z| h * z * h * z) / self.left();
        let slopes = sum(&|h, _| if h < 1.0 { 0.0 } else { 1.0 });
        let spread = (pulls * sum(&|h, _| h)).sqrt() / slopes;
        if self.is_robust { spread.max(1.0) } else { 1.0 }
    }

    /// The corrected information criterion of Akaike, without the constant that all models of the same numbers have in
    /// common. `None` if there are at most p + 2 points.
    pub fn aicc(&self, predicted: &[f64], parameters: usize) -> Option<f64> {
        let sets = self.is_estimated.iter().filter(|is_estimated| **is_estimated).count();
        let (count, all) = (self.count(None), (parameters + sets) as f64);
        if count <= parameters as f64 + 2.0 || count <= all + 1.0 {
            return None;
        }
        // The most probable noise is smaller than the unbiased one.
        let mut factors = self.noise(predicted).factors;
        let estimated = factors.iter_mut().zip(&self.is_estimated).filter(|(_, it)| **it);
        estimated.for_each(|(factor, _)| *factor *= self.left().sqrt());
        let noise = self.noise_with(factors, predicted);
        let residuals = self.residuals(predicted, &noise);
        let own = |(place, point): (usize, &Point)| {
            // The density of a lognormal number falls as the number grows.
            let jacobian = if point.is_log { point.value / predicted[place] } else { 1.0 };
            let logarithm = libm::log(noise.deviations[place] * jacobian);
            residuals[place] * residuals[place] + point.weight * 2.0 * logarithm
        };
        let fit: f64 = self.taking_part().map(own).sum();
        Some(fit + 2.0 * all + 2.0 * all * (all + 1.0) / (count - all - 1.0))
    }
}

/// A direction of all parameters without effect on the residuals, with a part for each parameter.
pub type Direction = Vec<f64>;

/// What residuals say about parameters near the minimum.
#[derive(Debug, Clone)]
pub struct Information {
    /// The covariance of the parameters. Directions that the residuals do not determine are left out.
    pub covariance: Vec<Vec<f64>>,
    /// The directions that the residuals do not determine. Each has the fewest parameters that are possible.
    pub undetermined: Vec<Direction>,
}

impl Information {
    /// `columns` are the derivatives of all residuals with respect to each parameter. A parameter should be a logarithm,
    /// so that 1 is a large change. `errors` are the errors of the columns, as root sums of squares.
    ///
    /// A direction is undetermined if its standard error exceeds 1, or if its effect is smaller than the errors.
    pub fn of(columns: &[Vec<f64>], errors: &[f64]) -> Self {
        let count = columns.len();
        let gram = DenseMatrix::from_fn(count, count, |i, j| dot(&columns[i], &columns[j]));
        let (mut covariance, mut open) = (vec![vec![0.0; count]; count], Vec::new());
        let decomposed: Option<(DenseMatrix, Vec<f64>)> = gram.try_eigh().ok();
        if let Some((vectors, values)) = decomposed {
            for (place, value) in values.into_iter().enumerate() {
                let direction: Vec<f64> = (0..count).map(|row| vectors.get(row, place)).collect();
                let error = direction.iter().zip(errors).map(|(part, error)| part * error);
                let error: f64 = error.map(|error| error * error).sum();
                if value <= error.max(1.0) {
                    open.push(direction);
                    continue;
                }
                for (row, one) in covariance.iter_mut().zip(&direction) {
                    let cells = row.iter_mut().zip(&direction);
                    cells.for_each(|(it, other)| *it += one * other / value);
                }
            }
        }
        Self { covariance, undetermined: with_fewest_parts(open) }
    }

    /// The covariance of a parameter and a linear function of all parameters, which is given by its slopes.
    pub fn covariance(&self, place: usize, slopes: &[f64]) -> f64 {
        dot(&self.covariance[place], slopes)
    }

    /// The standard error of a linear function of the parameters.
    pub fn standard_error(&self, slopes: &[f64]) -> f64 {
        let each = slopes.iter().enumerate();
        each.map(|(place, slope)| slope * self.covariance(place, slopes)).sum::<f64>().sqrt()
    }

    /// Whether the residuals do not determine a parameter.
    pub fn is_open(&self, place: usize) -> bool {
        self.undetermined.iter().any(|direction| direction[place] != 0.0)
    }
}

/// Directions that span the same space and have as few parts as possible: Gauss–Jordan elimination with the largest
/// number as pivot. Small parts count as none.
fn with_fewest_parts(mut rows: Vec<Direction>) -> Vec<Direction> {
    for step in 0..rows.len() {
        let sizes = (step..rows.len())
            .flat_map(|row| rows[row].iter().enumerate().map(move |(at, x)| (row, at, x.abs())));
        let Some((row, at, _)) = sizes.max_by(|(.., a), (.., b)| a.total_cmp(b)) else { break };
        rows.swap(step, row);
        let pivot = rows[step][at];
        rows[step].iter_mut().for_each(|part| *part /= pivot);
        let own = rows[step].clone();
        for (_, other) in rows.iter_mut().enumerate().filter(|(place, _)| *place != step) {
            let factor = other[at];
            other.iter_mut().zip(&own).for_each(|(part, own)| *part -= factor * own);
        }
    }
    for row in &mut rows {
        let largest = row.iter().fold(0.0_f64, |largest, part| largest.max(part.abs()));
        row.iter_mut().filter(|part| part.abs() < PART * largest).for_each(|part| *part = 0.0);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::super::least_squares::tests::MISRA;
    use super::*;

    fn point(value: f64, noise: f64, set: usize, cluster: usize) -> Point {
        let (share, least, is_log) = (0.0, 0.0, false);
        Point { value, noise, share, least, is_log, numerical: 0.0, set, cluster, weight: 0.0 }
    }

    fn close(found: f64, known: f64) {
        assert!((found / known - 1.0).abs() < 1e-9, "{found} {known}");
    }

    #[test]
    fn the_standard_errors_of_misra1a_have_the_certified_digits() {
        let b = [238.942_129_18, 5.501_564_318_1e-4];
        let points = MISRA.iter().enumerate().map(|(place, (_, y))| point(*y, 1.0, 0, place));
        let measured = MeasuredNumbers::new(points.collect(), vec![true], 2);
        let predicted: Vec<f64> =
            MISRA.iter().map(|(x, _)| b[0] * (1.0 - libm::exp(-b[1] * x))).collect();
        let noise = measured.noise(&predicted);
        assert!((noise.factors[0] - 0.101_878_763_30).abs() < 1e-9, "{noise:?}");
        assert_eq!(measured.freedom(), Some(12));
        let sum: f64 = measured.residuals(&predicted, &noise).iter().map(|r| r * r).sum();
        close(sum, 12.0);
        // The parameters are the logarithms of b.
        let slopes = measured.slopes(&noise);
        let of_exponent = |x: f64| b[0] * b[1] * x * libm::exp(-b[1] * x);
        let columns = [
            predicted.iter().zip(&slopes).map(|(y, slope)| y * slope).collect(),
            MISRA.iter().zip(&slopes).map(|((x, _), slope)| of_exponent(*x) * slope).collect(),
        ];
        let information = Information::of(&columns, &[0.0; 2]);
        let errors = [[1.0, 0.0], [0.0, 1.0]].map(|only| information.standard_error(&only));
        assert!((b[0] * errors[0] / 2.707_007_524_1 - 1.0).abs() < 1e-6, "{errors:?}");
        assert!((b[1] * errors[1] / 7.266_868_843_6e-6 - 1.0).abs() < 1e-6, "{errors:?}");
        assert_eq!(information.undetermined, Vec::<Direction>::new());
        // NumPy 2.4.6, from the inverse of JᵀJ.
        let correlation = information.covariance[0][1] / (errors[0] * errors[1]);
        assert!((correlation + 0.998_776_192).abs() < 1e-8);
    }

    #[test]
    fn numbers_beyond_the_distance_of_huber_widen_intervals() {
        let values = [0.0, 0.0, 0.0, 0.0, 0.0, 5.0, 5.0, -5.0];
        let points = values.iter().enumerate().map(|(place, y)| point(*y, 1.0, 0, place));
        let mut measured = MeasuredNumbers::new(points.collect(), vec![false], 1);
        let spread = |measured: &MeasuredNumbers| {
            let noise = measured.noise(&[0.0; 8]);
            measured.spread(&noise, &measured.distances(&[0.0; 8], &noise))
        };
        close(spread(&measured), 1.0);
        measured.is_robust = true;
        // Three numbers have the weight c/5 and the pull c, and five have the weight 1 and no pull.
        close(
            spread(&measured),
            (3.0 * HUBER * HUBER * (8.0 / 7.0) * (5.0 + 0.6 * HUBER)).sqrt() / 5.0,
        );
    }

    #[test]
    fn a_cluster_of_equal_points_counts_as_one_point() {
        let single: Vec<_> =
            [1.0, 2.0, 4.0].iter().enumerate().map(|(i, y)| point(*y, 0.5, 0, i)).collect();
        let repeated: Vec<_> = single.iter().flat_map(|point| [*point; 4]).collect();
        for is_estimated in [true, false] {
            let of = |points: &[Point]| {
                let measured = MeasuredNumbers::new(points.to_vec(), vec![is_estimated], 1);
                let predicted = vec![2.0; points.len()];
                let noise = measured.noise(&predicted);
                let residuals = measured.residuals(&predicted, &noise);
                let sum = residuals.iter().map(|r| r * r).sum::<f64>();
                (noise.factors[0], sum, measured.freedom(), measured.aicc(&predicted, 1))
            };
            let (one, four) = (of(&single), of(&repeated));
            close(four.0, one.0);
            close(four.1, one.1);
            assert_eq!((four.2, four.3), (one.2, one.3));
        }
        let both = MeasuredNumbers::new(repeated[..8].to_vec(), vec![false], 2);
        assert!(!both.is_clustered && (both.count(None) - 8.0).abs() < 1e-12);
    }

    #[test]
    fn the_noise_of_each_set_is_estimated_or_stated() {
        // Means of two sets: q² = Σ(y − 2)²/σ²/(n (1 − p/Σn)), with p = 1 and Σn = 6.
        let values = [1.0, 3.0, 2.0, 4.0, 1.0, 1.0];
        let points: Vec<_> =
            values.iter().enumerate().map(|(i, y)| point(*y, 0.5, i / 3, i)).collect();
        let measured = MeasuredNumbers::new(points.clone(), vec![true, false], 1);
        let factors = measured.noise(&[2.0; 6]).factors;
        close(factors[0], (8.0_f64 / (3.0 * 5.0 / 6.0)).sqrt());
        assert!((factors[1] - 1.0).abs() < 1e-15);
        assert_eq!(measured.freedom(), Some(2));
        close(measured.factor(0.95), 4.302_652_729_749_462);
        let stated = MeasuredNumbers::new(points, vec![false, false], 1);
        assert_eq!(stated.freedom(), None);
        close(stated.factor(0.95), 1.959_963_984_540_054);
        // A numerical error of 0.3 beside a noise of 0.4.
        let numerical = Point { numerical: 0.3, ..point(1.0, 0.4, 0, 0) };
        let measured = MeasuredNumbers::new(vec![numerical], vec![false], 0);
        close(measured.residuals(&[2.0], &measured.noise(&[2.0]))[0], 2.0);
        assert!((measured.without(|_| true).count(None)).abs() < 1e-15);
    }

    #[test]
    fn the_information_criterion_agrees_with_its_definition() {
        let values = [1.0, 2.5, 2.0, 4.0, 5.5];
        let points: Vec<_> = values.iter().enumerate().map(|(i, y)| point(*y, 1.0, 0, i)).collect();
        let predicted = [1.0, 2.0, 3.0, 4.0, 5.0];
        // n ln(RSS/n) + n + 2K + 2K(K + 1)/(n − K − 1) with RSS = 1.5, n = 5, K = 2.
        let known = 5.0 * libm::log(0.3) + 5.0 + 4.0 + 6.0;
        let found =
            MeasuredNumbers::new(points.clone(), vec![true], 1).aicc(&predicted, 1).unwrap();
        close(found, known);
        // RSS + 2K + 2K(K + 1)/(n − K − 1) with K = 1.
        let stated = MeasuredNumbers::new(points, vec![false], 1);
        close(stated.aicc(&predicted, 1).unwrap(), 1.5 + 2.0 + 4.0 / 3.0);
        assert_eq!(stated.aicc(&predicted, 3), None);
    }

    #[test]
    fn directions_without_effect_are_found() {
        let slope = |x: f64| 10.0 / (1.0 + x);
        let x: Vec<f64> = (0..8).map(f64::from).collect();
        let column = |factor: f64| x.iter().map(|x| factor * slope(*x)).collect::<Vec<_>>();
        let other: Vec<f64> = x.iter().map(|x| 20.0 - x).collect();
        let directions = |columns: &[Vec<f64>]| {
            Information::of(columns, &vec![1e-3; columns.len()]).undetermined
        };
        let rounded = |found: Vec<Direction>| -> Vec<Vec<f64>> {
            found
                .iter()
                .map(|row| row.iter().map(|part| (1e4 * part).round() / 1e4).collect())
                .collect()
        };
        // Only the ratio of the first two: both can grow together.
        let found = rounded(directions(&[column(1.0), column(-1.0), other.clone()]));
        assert_eq!(found, [[1.0, 1.0, 0.0]]);
        // Only the product of the first one and the square of the second one.
        let found = rounded(directions(&[column(1.0), column(2.0), other.clone()]));
        assert_eq!(found, [[1.0, -0.5, 0.0]]);
        // One parameter without effect, and a pair.
        let none = vec![1e-4; 8];
        let mut found = rounded(directions(&[none, column(1.0), other.clone(), column(1.0)]));
        found.sort_by(|a, b| b[0].total_cmp(&a[0]));
        assert_eq!(found[0], [1.0, 0.0, 0.0, 0.0]);
        assert_eq!(
            found[1].iter().map(|part| part.abs()).collect::<Vec<_>>(),
            [0.0, 1.0, 0.0, 1.0]
        );
        assert!(found[1][1] * found[1][3] < 0.0);
        // An effect that is smaller than the error of the derivatives.
        assert_eq!(Information::of(&[column(1.0)], &[100.0]).undetermined, [[1.0]]);
        assert!(directions(&[column(1.0), other]).is_empty());
    }
}
