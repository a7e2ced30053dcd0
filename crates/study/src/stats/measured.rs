//! Measured numbers beside predicted ones: their weights, their noise, and what both say about parameters.
//!
//! The points of one cluster, such as all numbers from one specimen, have a common error. So a cluster of m points
//! counts as one point: each of its points has the weight 1/m. If there are not more clusters than parameters, each
//! point counts, and [`Measured::is_clustered`] is false.
//!
//! The noise of a set of points is stated, or it is estimated from the scatter of the set.
//!
//! # Equations
//! ```text
//! rᵢ = √wᵢ (fᵢ − yᵢ)/sᵢ,   sᵢ² = (q σᵢ)² + nᵢ²,   S = Σ rᵢ²
//! q² = Σ wᵢ (fᵢ − yᵢ)²/σᵢ² / (W (1 − p/ΣW)),   W = Σ wᵢ of a set with estimated noise, otherwise q = 1
//! S ≤ S_min + t²(ν)
//! ```
//! σ is the noise, n the numerical error, p the number of parameters, and ν the number of degrees of freedom. With
//! stated noise t is the factor of the normal distribution.
//!
//! # Sources
//! D. M. Bates, D. G. Watts, Nonlinear Regression Analysis and Its Applications (1988), chapters 1, 2 and 6.

use basin::{DenseMatrix, SymmetricEigen as _};

use super::fisher;

/// Estimated noise is at least this many times the stated one, so that no weight is infinite.
const LEAST_FACTOR: f64 = 1e-9;
/// A part of a direction that is smaller than this share of the largest part counts as none.
const PART: f64 = 0.15;

/// A measured number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// The number y. If it is not a number, the point does not take part.
    pub value: f64,
    /// Its noise σ as a standard deviation. If the noise of its set is estimated, only the ratios of these numbers
    /// matter.
    pub noise: f64,
    /// The numerical error of a prediction.
    pub numerical: f64,
    /// The index of its set.
    pub set: usize,
    /// The index of its cluster.
    pub cluster: usize,
}

/// Measured numbers with weights.
#[derive(Debug, Clone)]
pub struct Measured {
    /// The numbers.
    pub points: Vec<Point>,
    /// For each set, whether its noise is estimated.
    is_estimated: Vec<bool>,
    weights: Vec<f64>,
    /// Whether the points of a cluster count as one.
    pub is_clustered: bool,
    /// The number of parameters, less the number of those with a prior.
    parameters: f64,
}

impl Measured {
    /// Numbers from which this number of parameters is estimated. Parameters with a prior are not counted.
    pub fn new(points: Vec<Point>, is_estimated: Vec<bool>, parameters: usize) -> Self {
        let clusters = points.iter().map(|point| point.cluster + 1).max().unwrap_or(0);
        let mut sizes = vec![0.0; clusters];
        for point in points.iter().filter(|point| point.value.is_finite()) {
            sizes[point.cluster] += 1.0;
        }
        let is_clustered = sizes.iter().filter(|size| **size > 0.0).count() > parameters;
        let weight = |point: &Point| match point.value.is_finite() {
            true if is_clustered => 1.0 / sizes[point.cluster],
            takes_part => f64::from(takes_part),
        };
        let weights = points.iter().map(weight).collect();
        Self { points, is_estimated, weights, is_clustered, parameters: parameters as f64 }
    }

    /// The same numbers without those for which `is_left_out` holds.
    pub fn without(&self, is_left_out: impl Fn(usize) -> bool) -> Self {
        let mut rest = self.clone();
        for (place, weight) in rest.weights.iter_mut().enumerate() {
            if is_left_out(place) {
                *weight = 0.0;
            }
        }
        rest
    }

    /// Whether the number takes part.
    pub fn has(&self, place: usize) -> bool {
        self.weights[place] > 0.0
    }

    /// The effective number of points of all sets, or of one of them.
    pub fn count(&self, set: Option<usize>) -> f64 {
        let own = self.points.iter().zip(&self.weights);
        own.filter(|(point, _)| set.is_none_or(|set| point.set == set)).map(|(_, w)| w).sum()
    }

    /// The share of the points of a set that is left after the parameters were estimated.
    fn left(&self) -> f64 {
        let all = self.count(None);
        ((all - self.parameters) / all).max(1.0 / all)
    }

    /// The factor q of the noise of each set, from predictions.
    pub fn factors(&self, predicted: &[f64]) -> Vec<f64> {
        let mut squares = vec![0.0; self.is_estimated.len()];
        let own = self.points.iter().zip(&self.weights).zip(predicted);
        for ((point, weight), found) in own.filter(|((_, weight), _)| **weight > 0.0) {
            let distance = (found - point.value) / point.noise;
            squares[point.set] += weight * distance * distance;
        }
        let factor = |(set, square): (usize, f64)| {
            let count = self.count(Some(set));
            let is_known = !self.is_estimated[set] || count == 0.0;
            if is_known { 1.0 } else { (square / (count * self.left())).sqrt().max(LEAST_FACTOR) }
        };
        squares.into_iter().enumerate().map(factor).collect()
    }

    /// The standard deviation s of the difference between a number and its prediction.
    pub fn deviation(&self, place: usize, factors: &[f64]) -> f64 {
        let Point { noise, numerical, set, .. } = self.points[place];
        libm::hypot(factors[set] * noise, numerical)
    }

    /// What a change of each prediction by 1 changes in its residual: √w/s.
    pub fn slopes(&self, factors: &[f64]) -> Vec<f64> {
        let weights = self.weights.iter().enumerate();
        weights.map(|(place, weight)| weight.sqrt() / self.deviation(place, factors)).collect()
    }

    /// The residuals.
    pub fn residuals(&self, predicted: &[f64], factors: &[f64]) -> Vec<f64> {
        let slopes = self.slopes(factors).into_iter().zip(&self.points).zip(predicted);
        let residual = |((slope, point), found): ((f64, &Point), &f64)| {
            // A number that does not take part has no residual, even if it has no prediction.
            if slope > 0.0 { slope * (found - point.value) } else { 0.0 }
        };
        slopes.map(residual).collect()
    }

    /// The degrees of freedom from which noise is estimated, at least 1; `None` if all noise is stated.
    pub fn freedom(&self) -> Option<usize> {
        let estimated = self.is_estimated.iter().enumerate().filter(|(_, estimated)| **estimated);
        let sets: Vec<f64> = estimated.map(|(set, _)| self.count(Some(set))).collect();
        let freedom = (self.left() * sets.iter().sum::<f64>() + 1e-9).floor().max(1.0);
        (!sets.is_empty()).then_some(freedom as usize)
    }

    /// The size of an interval, in standard errors.
    pub fn factor(&self, confidence: f64) -> f64 {
        fisher::factor(confidence, self.freedom())
    }

    /// The corrected information criterion of Akaike, without the constant that all models of the same numbers have in
    /// common. `None` if there are at most p + 2 points.
    pub fn aicc(&self, predicted: &[f64], parameters: usize) -> Option<f64> {
        let factors = self.factors(predicted);
        let count = self.count(None);
        let sets = self.is_estimated.iter().filter(|is_estimated| **is_estimated).count();
        let all = (parameters + sets) as f64;
        let rest = count - all - 1.0;
        // The most probable noise is smaller than the unbiased one.
        let most_probable: Vec<f64> = factors
            .iter()
            .zip(&self.is_estimated)
            .map(|(factor, estimated)| if *estimated { factor * self.left().sqrt() } else { 1.0 })
            .collect();
        let own = |(place, (weight, found)): (usize, (&f64, &f64))| {
            let deviation = self.deviation(place, &most_probable);
            let distance = (found - self.points[place].value) / deviation;
            weight * (distance * distance + 2.0 * libm::log(deviation))
        };
        let all_points = self.weights.iter().zip(predicted).enumerate();
        let fit: f64 = all_points.filter(|(_, (weight, _))| **weight > 0.0).map(own).sum();
        (rest > 0.0 && count > parameters as f64 + 2.0)
            .then(|| fit + 2.0 * all + 2.0 * all * (all + 1.0) / rest)
    }
}

/// What residuals say about parameters near the minimum, from the derivatives of the residuals.
#[derive(Debug, Clone)]
pub struct Information {
    /// The directions, of length 1, with the standard error of the parameters along each.
    directions: Vec<(Vec<f64>, f64)>,
    /// For each direction, whether the residuals determine it.
    is_determined: Vec<bool>,
}

/// A direction of all parameters without effect on the residuals. It has a part for each parameter. The largest one is
/// 1, and small ones are 0.
pub type Direction = Vec<f64>;

impl Information {
    /// `columns` are the derivatives of all residuals with respect to each parameter. A parameter should be a logarithm,
    /// so that 1 is a large change. `errors` are the errors of the columns, as root sums of squares.
    ///
    /// A direction is undetermined if its standard error exceeds 1, or if its effect is smaller than the errors.
    pub fn of(columns: &[Vec<f64>], errors: &[f64]) -> Self {
        let count = columns.len();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let gram = DenseMatrix::from_fn(count, count, |i, j| dot(&columns[i], &columns[j]));
        let Ok((vectors, values)) = gram.try_eigh() else {
            return Self { directions: Vec::new(), is_determined: Vec::new() };
        };
        let values: Vec<f64> = values;
        let (mut directions, mut is_determined) = (Vec::new(), Vec::new());
        for (place, value) in values.into_iter().enumerate() {
            let direction: Vec<f64> = (0..count).map(|row| vectors.get(row, place)).collect();
            let effect = value.max(0.0).sqrt();
            let parts = direction.iter().zip(errors).map(|(part, error)| part * error);
            let error = parts.map(|error| error * error).sum::<f64>().sqrt();
            is_determined.push(effect > error.max(1.0));
            directions.push((direction, 1.0 / effect));
        }
        Self { directions, is_determined }
    }

    /// The covariance of two linear functions of the parameters, which are given by their slopes. Directions that the
    /// residuals do not determine are left out.
    pub fn covariance(&self, one: &[f64], other: &[f64]) -> f64 {
        let along = |direction: &[f64], slopes: &[f64]| -> f64 {
            direction.iter().zip(slopes).map(|(part, slope)| part * slope).sum()
        };
        let directions = self.directions.iter().zip(&self.is_determined);
        directions
            .filter(|(_, is_determined)| **is_determined)
            .map(|((direction, error), _)| {
                along(direction, one) * along(direction, other) * error * error
            })
            .sum()
    }

    /// The standard error of a linear function of the parameters.
    pub fn standard_error(&self, slopes: &[f64]) -> f64 {
        self.covariance(slopes, slopes).sqrt()
    }

    /// The correlation of two parameters.
    pub fn correlation(&self, one: usize, other: usize) -> f64 {
        let only = |place: usize| {
            (0..self.directions.len()).map(|it| f64::from(it == place)).collect::<Vec<_>>()
        };
        let (one, other) = (only(one), only(other));
        self.covariance(&one, &other) / (self.standard_error(&one) * self.standard_error(&other))
    }

    /// The directions that the residuals do not determine. Each has the fewest parameters that are possible.
    pub fn undetermined(&self) -> Vec<Direction> {
        let directions = self.directions.iter().zip(&self.is_determined);
        let own = directions.filter(|(_, is_determined)| !**is_determined);
        let mut rows: Vec<Vec<f64>> = own.map(|((direction, _), _)| direction.clone()).collect();
        // Gauss–Jordan elimination with the largest number as pivot.
        for step in 0..rows.len() {
            let sizes = (step..rows.len()).flat_map(|row| {
                rows[row].iter().enumerate().map(move |(at, x)| (row, at, x.abs()))
            });
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
            let largest =
                row.iter().copied().fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
            for part in row.iter_mut() {
                *part = if part.abs() < PART * largest.abs() { 0.0 } else { *part / largest };
            }
        }
        rows
    }
}

#[cfg(test)]
mod tests {
    use super::super::least_squares::tests::MISRA;
    use super::*;

    fn point(value: f64, noise: f64, set: usize, cluster: usize) -> Point {
        Point { value, noise, numerical: 0.0, set, cluster }
    }

    fn close(found: f64, known: f64) {
        assert!((found / known - 1.0).abs() < 1e-9, "{found} {known}");
    }

    #[test]
    fn the_standard_errors_of_misra1a_have_the_certified_digits() {
        let b = [238.942_129_18, 5.501_564_318_1e-4];
        let points = MISRA.iter().enumerate().map(|(place, (_, y))| point(*y, 1.0, 0, place));
        let measured = Measured::new(points.collect(), vec![true], 2);
        let predicted: Vec<f64> =
            MISRA.iter().map(|(x, _)| b[0] * (1.0 - libm::exp(-b[1] * x))).collect();
        let factors = measured.factors(&predicted);
        assert!((factors[0] - 0.101_878_763_30).abs() < 1e-9, "{factors:?}");
        assert_eq!(measured.freedom(), Some(12));
        let sum: f64 = measured.residuals(&predicted, &factors).iter().map(|r| r * r).sum();
        close(sum, 12.0);
        // The parameters are the logarithms of b.
        let slopes = measured.slopes(&factors);
        let of_exponent = |x: f64| b[0] * b[1] * x * libm::exp(-b[1] * x);
        let columns = [
            predicted.iter().zip(&slopes).map(|(y, slope)| y * slope).collect(),
            MISRA.iter().zip(&slopes).map(|((x, _), slope)| of_exponent(*x) * slope).collect(),
        ];
        let information = Information::of(&columns, &[0.0; 2]);
        let errors = [[1.0, 0.0], [0.0, 1.0]].map(|only| information.standard_error(&only));
        assert!((b[0] * errors[0] / 2.707_007_524_1 - 1.0).abs() < 1e-6, "{errors:?}");
        assert!((b[1] * errors[1] / 7.266_868_843_6e-6 - 1.0).abs() < 1e-6, "{errors:?}");
        assert_eq!(information.undetermined(), Vec::<Direction>::new());
        // NumPy 2.4.6, from the inverse of JᵀJ.
        assert!((information.correlation(0, 1) + 0.998_776_192).abs() < 1e-8);
    }

    #[test]
    fn a_cluster_of_equal_points_counts_as_one_point() {
        let single: Vec<_> =
            [1.0, 2.0, 4.0].iter().enumerate().map(|(i, y)| point(*y, 0.5, 0, i)).collect();
        let repeated: Vec<_> = single.iter().flat_map(|point| [*point; 4]).collect();
        for is_estimated in [true, false] {
            let of = |points: &[Point]| {
                let measured = Measured::new(points.to_vec(), vec![is_estimated], 1);
                let predicted = vec![2.0; points.len()];
                let factors = measured.factors(&predicted);
                let residuals = measured.residuals(&predicted, &factors);
                let sum = residuals.iter().map(|r| r * r).sum::<f64>();
                (factors[0], sum, measured.freedom(), measured.aicc(&predicted, 1))
            };
            let (one, four) = (of(&single), of(&repeated));
            close(four.0, one.0);
            close(four.1, one.1);
            assert_eq!((four.2, four.3), (one.2, one.3));
        }
        let both = Measured::new(repeated[..8].to_vec(), vec![false], 2);
        assert!(!both.is_clustered && (both.count(None) - 8.0).abs() < 1e-12);
    }

    #[test]
    fn the_noise_of_each_set_is_estimated_or_stated() {
        // Means of two sets: q² = Σ(y − 2)²/σ²/(n (1 − p/Σn)), with p = 1 and Σn = 6.
        let values = [1.0, 3.0, 2.0, 4.0, 1.0, 1.0];
        let points: Vec<_> =
            values.iter().enumerate().map(|(i, y)| point(*y, 0.5, i / 3, i)).collect();
        let measured = Measured::new(points.clone(), vec![true, false], 1);
        let factors = measured.factors(&[2.0; 6]);
        close(factors[0], (8.0_f64 / (3.0 * 5.0 / 6.0)).sqrt());
        assert!((factors[1] - 1.0).abs() < 1e-15);
        assert_eq!(measured.freedom(), Some(2));
        close(measured.factor(0.95), 4.302_652_729_749_462);
        let stated = Measured::new(points, vec![false, false], 1);
        assert_eq!(stated.freedom(), None);
        close(stated.factor(0.95), 1.959_963_984_540_054);
        // A numerical error of 0.3 beside a noise of 0.4.
        let numerical = Point { numerical: 0.3, ..point(1.0, 0.4, 0, 0) };
        let measured = Measured::new(vec![numerical], vec![false], 0);
        close(measured.residuals(&[2.0], &[1.0])[0], 2.0);
        assert!((measured.without(|_| true).count(None)).abs() < 1e-15);
    }

    #[test]
    fn the_information_criterion_agrees_with_its_definition() {
        let values = [1.0, 2.5, 2.0, 4.0, 5.5];
        let points: Vec<_> = values.iter().enumerate().map(|(i, y)| point(*y, 1.0, 0, i)).collect();
        let predicted = [1.0, 2.0, 3.0, 4.0, 5.0];
        // n ln(RSS/n) + n + 2K + 2K(K + 1)/(n − K − 1) with RSS = 1.5, n = 5, K = 2.
        let known = 5.0 * libm::log(0.3) + 5.0 + 4.0 + 6.0;
        let found = Measured::new(points.clone(), vec![true], 1).aicc(&predicted, 1).unwrap();
        close(found, known);
        // RSS + 2K + 2K(K + 1)/(n − K − 1) with K = 1.
        let stated = Measured::new(points, vec![false], 1);
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
            Information::of(columns, &vec![1e-3; columns.len()]).undetermined()
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
        assert_eq!(Information::of(&[column(1.0)], &[100.0]).undetermined(), [[1.0]]);
        assert!(directions(&[column(1.0), other]).is_empty());
    }
}
