//! Nonlinear least squares between bounds, whose residuals are computed elsewhere.
//!
//! The search does not wait for residuals. A caller gives those that it knows, and the search returns the error of the
//! first request that the caller cannot answer. The caller then obtains the missing numbers and searches again from the
//! start. The search is deterministic, so it takes the same steps again and stops one request later. In this way the
//! runs of a search can be computed one by one, on any machine, and a search that was interrupted continues.
//!
//! # Equations
//! ```text
//! S(u) = Σ rᵢ(u)²,  0 ≤ uⱼ ≤ 1
//! ```
//! Levenberg–Marquardt steps with the scaling of Coleman and Li keep u between the bounds.
//!
//! # Sources
//! - M. A. Branch, T. F. Coleman, Y. Li, SIAM J. Sci. Comput. 21 (1999) 1: bounds.
//! - H. B. Nielsen, report IMM-REP-1999-05, Technical University of Denmark: the damping.

use basin::{
    BoundedLevenbergMarquardt, BoxBounds, Constrained, ConstraintSet, ConstraintSolveError,
    DenseMatrix, Executor, Jacobian, PointState, Residual, State as _,
};

/// A search begins at least this far from a bound, because the steps become small near a bound.
const INSIDE: f64 = 1e-3;

/// When a search ends.
#[derive(Debug, Clone, Copy)]
pub struct StopCriteria {
    /// If a step reduces S by less than this share of it.
    pub decrease: f64,
    /// If a step is shorter than this, relative to the distances between the bounds.
    pub step: f64,
    /// After this number of steps.
    pub steps: u64,
}

/// The residuals at the coordinates u, between 0 and 1. If one is not finite, the search does not go there.
pub type Residuals<'a, E> = dyn Fn(&[f64]) -> Result<Vec<f64>, E> + 'a;

/// The derivatives of the residuals at u: a column for each coordinate.
pub type Derivatives<'a, E> = dyn Fn(&[f64]) -> Result<Vec<Vec<f64>>, E> + 'a;

struct Minimization<'a, E> {
    residuals: &'a Residuals<'a, E>,
    derivatives: &'a Derivatives<'a, E>,
}

impl<E> Residual for Minimization<'_, E> {
    type Param = Vec<f64>;
    type Output = Vec<f64>;
    type Error = E;

    fn residual(&self, u: &Vec<f64>) -> Result<Vec<f64>, E> {
        (self.residuals)(u)
    }
}

impl<E> Jacobian for Minimization<'_, E> {
    type Jacobian = DenseMatrix;

    fn jacobian(&self, u: &Vec<f64>) -> Result<DenseMatrix, E> {
        let columns = (self.derivatives)(u)?;
        let rows = columns.first().map_or(0, Vec::len);
        Ok(DenseMatrix::from_fn(rows, columns.len(), |row, column| columns[column][row]))
    }
}

/// Searches the least sum of squares from this point on. Returns the best point that was found.
///
/// # Errors
/// The caller does not know residuals that the search needs.
///
/// # Panics
/// The point has no coordinates.
pub fn minimum<E>(
    residuals: &Residuals<'_, E>,
    derivatives: &Derivatives<'_, E>,
    start: &[f64],
    stop: StopCriteria,
) -> Result<Vec<f64>, E> {
    let bounds = BoxBounds::new(Some(vec![0.0; start.len()]), Some(vec![1.0; start.len()]));
    let start = start.iter().map(|u| u.clamp(INSIDE, 1.0 - INSIDE)).collect();
    let solver = BoundedLevenbergMarquardt::<Vec<f64>, DenseMatrix>::new()
        .with_absolute_scaled_gradient_tolerance(0.0)
        .with_relative_cost_change_tolerance(stop.decrease)
        .with_absolute_step_tolerance(stop.step);
    let problem = Minimization { residuals, derivatives };
    let bounded = Constrained::new(problem, ConstraintSet::new().with_bounds(bounds));
    let found = Executor::new(bounded, solver, PointState::new(start)).max_iter(stop.steps).run();
    match found {
        Ok(found) => Ok(found.state.param().clone()),
        Err(ConstraintSolveError::Evaluation(unknown)) => Err(unknown),
        Err(_other) => unreachable!("the bounds 0 and 1 are valid"),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::cell::RefCell;
    use std::convert::Infallible;

    use super::*;

    const STOP: StopCriteria = StopCriteria { decrease: 1e-14, step: 1e-10, steps: 200 };

    /// The minimum of a function of SI numbers between these bounds, with derivatives by central differences.
    fn found(
        bounds: &[(f64, f64)],
        residuals: impl Fn(&[f64]) -> Vec<f64>,
        start: &[f64],
    ) -> Vec<f64> {
        let values = |u: &[f64]| -> Vec<f64> {
            u.iter().zip(bounds).map(|(u, (low, high))| low + u * (high - low)).collect()
        };
        let of = |u: &[f64]| Ok::<_, Infallible>(residuals(&values(u)));
        let derivatives = |u: &[f64]| {
            let column = |place: usize| {
                let at = |step: f64| {
                    let mut u = u.to_vec();
                    u[place] += step;
                    residuals(&values(&u))
                };
                let (above, below) = (at(1e-6), at(-1e-6));
                above.iter().zip(&below).map(|(a, b)| (a - b) / 2e-6).collect()
            };
            Ok((0..u.len()).map(column).collect())
        };
        let Ok(u) = minimum(&of, &derivatives, start, STOP);
        values(&u)
    }

    /// Data and certified values of Misra1a: <https://www.itl.nist.gov/div898/strd/nls/data/misra1a.shtml>.
    pub const MISRA: [(f64, f64); 14] = [
        (77.6, 10.07),
        (114.9, 14.73),
        (141.1, 17.94),
        (190.8, 23.93),
        (239.9, 29.61),
        (289.0, 35.18),
        (332.8, 40.02),
        (378.4, 44.82),
        (434.8, 50.76),
        (477.3, 55.05),
        (536.8, 61.01),
        (593.1, 66.40),
        (689.1, 75.47),
        (760.0, 81.78),
    ];

    fn misra(b: &[f64]) -> Vec<f64> {
        MISRA.iter().map(|(x, y)| b[0] * (1.0 - libm::exp(-b[1] * x)) - y).collect()
    }

    #[test]
    fn the_minimum_of_misra1a_has_the_certified_digits() {
        for start in [[0.5, 0.01], [0.1, 0.5], [0.9, 0.9]] {
            let b = found(&[(10.0, 1000.0), (1e-5, 1e-2)], misra, &start);
            assert!((b[0] - 238.942_129_18).abs() < 1e-4, "{b:?}");
            assert!((b[1] - 5.501_564_318_1e-4).abs() < 1e-9, "{b:?}");
            let sum: f64 = misra(&b).iter().map(|r| r * r).sum();
            assert!((sum - 0.124_551_388_94).abs() < 1e-9, "{sum}");
        }
    }

    #[test]
    fn a_minimum_outside_of_the_bounds_is_found_at_the_bound() {
        // The unbounded minimum is (3, 2). With x ≤ 1, the minimum is x = 1 and y = 2 + (3 − 1)·0.5.
        let residuals = |b: &[f64]| vec![b[0] - 3.0, (b[1] - 2.0) + 0.5 * (b[0] - 3.0)];
        let b = found(&[(0.0, 1.0), (0.0, 10.0)], residuals, &[0.5, 0.5]);
        assert!((b[0] - 1.0).abs() < 1e-4 && (b[1] - 3.0).abs() < 1e-3, "{b:?}");
    }

    #[test]
    fn a_search_does_not_go_where_residuals_are_not_finite() {
        let residuals = |b: &[f64]| vec![if b[0] > 0.8 { f64::NAN } else { b[0] - 0.7 }];
        let b = found(&[(0.0, 1.0)], residuals, &[0.1]);
        assert!((b[0] - 0.7).abs() < 1e-5, "{b:?}");
    }

    #[test]
    fn a_search_that_begins_again_asks_for_one_more_point_each_time() {
        let (known, asked) = (RefCell::new(Vec::<Vec<f64>>::new()), RefCell::new(0));
        let residuals = |u: &[f64]| {
            *asked.borrow_mut() += 1;
            let is_known = known.borrow().iter().any(|known| known == u);
            let residuals = vec![10.0 * (u[1] - u[0] * u[0]), 0.5 - u[0]];
            is_known.then_some(residuals).ok_or(u.to_vec())
        };
        let derivatives = |u: &[f64]| Ok(vec![vec![-20.0 * u[0], -1.0], vec![10.0, 0.0]]);
        let found = loop {
            match minimum(&residuals, &derivatives, &[0.1, 0.9], STOP) {
                Ok(found) => break found,
                Err(unknown) => {
                    assert_eq!(asked.replace(0), known.borrow().len() + 1);
                    known.borrow_mut().push(unknown);
                }
            }
        };
        assert!((found[0] - 0.5).abs() < 1e-6 && (found[1] - 0.25).abs() < 1e-6, "{found:?}");
        assert!(known.borrow().len() < 40, "{}", known.borrow().len());
    }
}
