//! A test whether the residuals of a fit follow a smooth curve along their axis, as they do if the law has another shape.
//!
//! # Equations
//! A parabola over the order of the n points is fitted to the residuals. If these are independent and normal with equal standard
//! deviations, it explains at least the share R/T of their squares with the probability
//! ```text
//! P = (1 − R/T)^((n − 3)/2)
//! ```
//! T is the sum of squares of the residuals around their mean, and R the part in the parabola. This is the F test of a
//! regression with two terms, F = (R/2) / ((T − R)/(n − 3)), whose distribution is elementary.
//!
//! Residuals of a fit of one factor with relative errors are independent up to their mean, so P is exact for any n. A fit of
//! more numbers takes smooth parts out of its residuals, so the test then finds fewer trends, not more.
//!
//! # Sources
//! N. R. Draper, H. Smith, *Applied Regression Analysis* (1998), chapters 2 and 22: orthogonal polynomials.

use fretwork_engine::numeric::dot;

/// The least number of points. Fewer leave no scatter to compare the parabola with.
pub const LEAST: usize = 5;

/// A smooth curve in residuals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trend {
    /// The probability that independent residuals follow a parabola as well.
    pub probability: f64,
    /// Whether the curve is more bent than inclined.
    pub is_arc: bool,
    /// Whether the arc is higher in the middle, or the line rises.
    pub is_up: bool,
}

/// The trend of residuals in the order of their axis; `None` for too few points, or equal ones.
pub fn trend(residuals: &[f64]) -> Option<Trend> {
    let count = residuals.len();
    if count < LEAST {
        return None;
    }
    let mean = residuals.iter().sum::<f64>() / count as f64;
    let total: f64 = residuals.iter().map(|residual| (residual - mean) * (residual - mean)).sum();
    let line: Vec<f64> = (0..count).map(|place| place as f64 - 0.5 * (count - 1) as f64).collect();
    let square = dot(&line, &line);
    let arc: Vec<f64> = line.iter().map(|u| square / count as f64 - u * u).collect();
    // The part of the residuals along a polynomial.
    let part = |it: &[f64]| dot(it, residuals) / dot(it, it).sqrt();
    let [inclined, bent] = [part(&line), part(&arc)];
    let rest = 1.0 - (inclined * inclined + bent * bent) / total;
    let probability = libm::pow(rest.max(0.0), 0.5 * (count - 3) as f64);
    let is_arc = bent.abs() > inclined.abs();
    let is_up = if is_arc { bent > 0.0 } else { inclined > 0.0 };
    Some(Trend { probability, is_arc, is_up }).filter(|_| total > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::distribution::normal_quantile;
    use crate::stats::fisher;
    use fretwork_random::Stream;

    #[test]
    fn a_parabola_of_six_residuals_has_the_probability_of_a_regression() {
        // The regression of these residuals on 1, i and i² has F = 164.407 with 2 and 3 degrees of freedom.
        let found = trend(&[-1.19, -0.23, 0.58, 0.76, 0.50, -0.38]).unwrap();
        assert!(found.is_arc && found.is_up, "{found:?}");
        let known = fisher::above(164.407_487_482_932, (2.0, 3.0));
        assert!((found.probability / known - 1.0).abs() < 1e-9, "{found:?}");
        let rising = trend(&[-2.0, -1.1, 0.1, 0.9, 2.1]).unwrap();
        assert!(!rising.is_arc && rising.is_up && rising.probability < 0.05, "{rising:?}");
        assert_eq!(trend(&[-1.0, 0.0, 1.0, 0.0]), None);
        assert_eq!(trend(&[1.0; 6]), None);
    }

    #[test]
    fn independent_residuals_are_called_a_trend_as_often_as_promised() {
        let numbers = Stream::new(40);
        for count in [5, 6, 12] {
            let tries = 4000;
            let found = (0..tries).filter(|tried| {
                let uniform = |place| (numbers.child(*tried).at(place) >> 11) as f64 + 0.5;
                let normal = |place| normal_quantile(uniform(place) / (1_u64 << 53) as f64);
                let residuals: Vec<f64> = (0..count).map(normal).collect();
                trend(&residuals).unwrap().probability < 0.05
            });
            // Three standard errors of a share of 5 %.
            let share = found.count() as f64 / tries as f64;
            assert!((share - 0.05).abs() < 0.0104, "{count} points: {share}");
        }
    }
}
