//! Points that disagree with all others. They are sought together, because two outliers can hide each other.
//!
//! # Equations
//! Near the minimum of a fit with p parameters, the residuals of n points are e = Jδ + ε, with ε of deviation σ: 1 if the noise is
//! stated, otherwise estimated. For a set O of k points, the fit to the others has the covariance C = (JᵀJ)⁻¹ in units of σ². The
//! set without which the sum of squares is least is found by exchanging points. The studentised residual of a point i in it,
//! ```text
//! tᵢ = (eᵢ − Jᵢδ) / (σ √(1 + Jᵢ C Jᵢᵀ)),
//! ```
//! is its distance from the fit to the others. The outliers are the largest set in which each |tᵢ| exceeds the quantile that the
//! largest of n − k + 1 such numbers exceeds with a probability of α.
//!
//! # Sources
//! B. Rosner, Technometrics 25 (1983) 165: the test of several sizes, beginning with the largest one.
//! R. D. Cook, S. Weisberg, Residuals and Influence in Regression (1982), chapter 2: studentised residuals.

use fretwork_engine::numeric::dot;

use super::fisher;
use super::measured::Information;

/// The probability with which the test of one size calls points outliers although there are none: for stated noise, and, for
/// estimated noise, where the sizes are less alike, that of one outlier and of more. Together, all sizes call some in 5 of 100 sets.
const ALPHA: (f64, [f64; 2]) = (0.05, [0.043, 0.012]);
/// Maximum number of outliers, and the share of the points if the noise is estimated.
const MOST: usize = 10;
const SHARE: usize = 4;
/// Maximum number of rounds of exchanges.
const ROUNDS: usize = 10;

/// The studentised residuals of all points, and the indices of the outliers.
#[derive(Debug, Clone, PartialEq)]
pub struct Outliers {
    /// Those of the outliers are distances from the fit without all of them, those of the others from the fit without them and
    /// itself.
    pub studentized: Vec<f64>,
    /// The indices of the outliers, ascending.
    pub places: Vec<usize>,
    /// The residuals of the fit without the outliers.
    pub residuals: Vec<f64>,
}

/// Residuals with their derivatives with respect to each parameter.
struct Residuals<'a> {
    values: &'a [f64],
    slopes: &'a [Vec<f64>],
    is_estimated: bool,
}

/// The fit to all points but some.
struct Rest {
    /// The residuals of all points, and the variances of their predictions in units of σ².
    residuals: Vec<f64>,
    variances: Vec<f64>,
    sum: f64,
    freedom: f64,
}

impl Residuals<'_> {
    fn without(&self, left_out: &[usize]) -> Rest {
        let kept = |place: usize| f64::from(!left_out.contains(&place));
        let weighted = |column: &Vec<f64>| -> Vec<f64> {
            column.iter().enumerate().map(|(place, slope)| kept(place) * slope).collect()
        };
        let columns: Vec<Vec<f64>> = self.slopes.iter().map(weighted).collect();
        let information = Information::of(&columns, &vec![0.0; columns.len()]);
        let along: Vec<f64> = columns.iter().map(|column| dot(column, self.values)).collect();
        let shift: Vec<f64> =
            (0..along.len()).map(|it| information.covariance(it, &along)).collect();
        let row =
            |place: usize| -> Vec<f64> { self.slopes.iter().map(|column| column[place]).collect() };
        let rows: Vec<_> = (0..self.values.len()).map(row).collect();
        let residuals = self.values.iter().zip(&rows).map(|(value, row)| value - dot(row, &shift));
        let residuals: Vec<f64> = residuals.collect();
        let errors = rows.iter().map(|row| information.standard_error(row));
        let variances = errors.map(|error| error * error).collect();
        let squares = residuals.iter().enumerate().map(|(place, e)| kept(place) * e * e);
        let sum = squares.sum();
        let freedom = (self.values.len() - left_out.len()) as f64 - self.slopes.len() as f64;
        Rest { residuals, variances, sum, freedom }
    }

    /// The point whose removal reduces the sum of squares most.
    fn next(&self, left_out: &[usize]) -> usize {
        let rest = self.without(left_out);
        let gain = |place: &usize| {
            rest.residuals[*place] * rest.residuals[*place]
                / (1.0 - rest.variances[*place]).max(1e-9)
        };
        let others = (0..self.values.len()).filter(|place| !left_out.contains(place));
        others.max_by(|a, b| gain(a).total_cmp(&gain(b))).unwrap_or(0)
    }

    /// The studentised residual of a point, which is left out or not. A fit without a point that takes part has the residual
    /// e/(1 − h) there, where h is its variance.
    fn studentized(&self, rest: &Rest, place: usize, is_left_out: bool) -> f64 {
        let (e, h) = (rest.residuals[place], rest.variances[place]);
        let left = if is_left_out { 1.0 + h } else { (1.0 - h).max(1e-9) };
        let own = if is_left_out { (0.0, 0.0) } else { (e * e / left, 1.0) };
        let scale = (rest.sum - own.0) / (rest.freedom - own.1);
        e / (left * if self.is_estimated { scale } else { 1.0 }).sqrt()
    }
}

/// Finds the outliers. `slopes` are the derivatives of all residuals with respect to each parameter.
pub fn outliers(values: &[f64], slopes: &[Vec<f64>], is_estimated: bool) -> Outliers {
    let (all, count) = (Residuals { values, slopes, is_estimated }, values.len());
    let spare = count.saturating_sub(slopes.len() + 1);
    let most =
        if is_estimated { count / SHARE } else { spare / 2 }.min(spare.saturating_sub(2)).min(MOST);
    let (mut set, mut places) = (Vec::new(), Vec::new());
    for size in 1..=most {
        set.push(all.next(&set));
        for _ in 0..if size > 1 { ROUNDS } else { 0 } {
            let before = set.clone();
            for _ in 0..size {
                set.remove(0);
                set.push(all.next(&set));
            }
            if before.iter().all(|place| set.contains(place)) {
                break;
            }
        }
        let rest = all.without(&set);
        let freedom = is_estimated.then_some(rest.freedom as usize);
        let alpha = if is_estimated { ALPHA.1[usize::from(size > 1)] } else { ALPHA.0 };
        let limit = fisher::factor(1.0 - alpha / (count - size + 1) as f64, freedom);
        if set.iter().all(|place| all.studentized(&rest, *place, true).abs() > limit) {
            places.clone_from(&set);
        }
    }
    places.sort_unstable();
    let rest = all.without(&places);
    let of = |place: usize| all.studentized(&rest, place, places.contains(&place));
    let studentized = (0..count).map(of).collect();
    Outliers { studentized, places, residuals: rest.residuals }
}
