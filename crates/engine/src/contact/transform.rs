//! The two integral transforms of the method of dimensionality reduction (MDR).
//!
//! [`Kernels`] evaluates (4) and the pressure for sampled wear. Abel integrals are convolutions in
//! x². On the mesh τ = (x² − c²)/(ã² − c²) = (i/n)³ their matrices therefore depend on n only.
//!
//! # Equations
//! ```text
//! forward   g(x) = f(0) + x ∫₀ˣ f′(r)/√(x²−r²) dr                    (3)
//! inverse   f(r) = (2/π) ∫₀ʳ g(x)/√(r²−x²) dx                        (4)
//! pressure  p(r) = (1/π) ∫ᵣᵃ g′(x)/√(x²−r²) dx                       in units of E*d₀/a₀
//! ```
//!
//! # Accuracy
//! For smooth wear, [`Kernels`] converges with order 2 in 1/n (3e-5 of d₀ at n = 200). The pressure
//! converges with order 3/2, because its integrand is a piecewise constant slope. The cubic grading
//! resolves the jump of the image at the stick edge. With quadratic grading the wear next to the stick
//! edge is ten times less accurate late in a run. With quartic grading the mesh is coarse at the edge
//! of the scar.
//!
//! # Sources
//! V. L. Popov, M. Heß, *Method of Dimensionality Reduction in Contact Mechanics and Friction*
//! (2015), chapter 3. Product integration of Abel kernels: P. Linz, *Analytical and Numerical Methods
//! for Volterra Equations* (1985), §8.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use crate::numeric::dot;

const TWO_THIRDS: f64 = 2.0 / 3.0;
/// Number of mesh sizes in the cache. The matrices of 512 cells take 2 MB.
const KEPT_SIZES: usize = 4;

/// The nodes τᵢ = (i/n)³ of `cells` cells.
pub(crate) fn graded(cells: usize) -> impl Iterator<Item = f64> {
    (0..=cells).map(move |i| {
        let u = i as f64 / cells as f64;
        u * u * u
    })
}

/// The matrices of the inverse transform and of the pressure on the mesh τᵢ = (i/n)³.
#[derive(Debug)]
pub struct Kernels {
    tau: Vec<f64>,
    /// The reciprocal width of each cell, 1/(τⱼ₊₁ − τⱼ).
    per_cell: Vec<f64>,
    /// Simpson's weights of ∫ dτ = ∫ 3u² du over the nodes, for an even n.
    areas: Vec<f64>,
    /// Rows of the inverse transform; row i has i + 1 entries.
    inverse: Vec<f64>,
    /// Rows of the pressure; row i has n − i entries.
    pressure: Vec<f64>,
}

impl Kernels {
    /// The kernels of `cells` cells, from the cache if it contains them.
    pub fn with_cells(cells: usize) -> Arc<Self> {
        static RECENT: Mutex<VecDeque<Arc<Kernels>>> = Mutex::new(VecDeque::new());
        let mut recent = RECENT.lock().unwrap_or_else(PoisonError::into_inner);
        let known = recent.iter().position(|known| known.cells() == cells);
        let kernels = known.and_then(|position| recent.remove(position));
        let kernels = kernels.unwrap_or_else(|| Arc::new(Self::new(cells)));
        recent.push_front(Arc::clone(&kernels));
        recent.truncate(KEPT_SIZES);
        kernels
    }

    fn new(cells: usize) -> Self {
        let tau: Vec<f64> = graded(cells).collect();
        let per_cell: Vec<f64> = tau.windows(2).map(|ends| 1.0 / (ends[1] - ends[0])).collect();
        let areas = (0..=cells)
            .map(|i| {
                let u = i as f64 / cells as f64;
                let weight = if i == cells { 1.0 } else { 2.0 + 2.0 * (i % 2) as f64 };
                weight * u * u / cells as f64
            })
            .collect();
        let mut inverse = Vec::with_capacity((cells + 1) * (cells + 2) / 2);
        let mut pressure = Vec::with_capacity(cells * (cells + 1) / 2);
        for (i, here) in tau.iter().enumerate() {
            push_inverse_row(&tau[..=i], &per_cell, &mut inverse);
            // The factors √(τⱼ − τᵢ) of the changes of the slope dR/dτ at each node j > i.
            pressure.extend(tau[i + 1..].iter().map(|tau| (tau - here).sqrt()));
        }
        Self { tau, per_cell, areas, inverse, pressure }
    }

    /// Number of cells n; there are n + 1 nodes.
    pub(crate) fn cells(&self) -> usize {
        self.tau.len() - 1
    }

    /// The nodes τᵢ = (i/n)³.
    pub fn tau(&self) -> &[f64] {
        &self.tau
    }

    /// ∫ of sampled values over τ by Simpson's rule. The number of cells n must be even.
    pub(crate) fn area(&self, values: &[f64]) -> f64 {
        dot(&self.areas, values)
    }

    /// ∫₀^τᵢ φ(τ)/√(τᵢ−τ) dτ at every node, for several φ at once. The result of `phi[k]` is
    /// written to `curves[k]`. An empty `phi[k]` means φ = 0: its curve is not changed.
    pub fn inverse(&self, phi: &[Vec<f64>], curves: &mut [Vec<f64>]) {
        let mut pairs = not_empty(phi, curves);
        let mut start = 0;
        for i in 0..self.tau.len() {
            let row = &self.inverse[start..=start + i];
            start += i + 1;
            for (phi, curve) in &mut pairs {
                curve[i] = dot(row, phi);
            }
        }
    }

    /// −½ ∫ R′(τ)/√(τ−τᵢ) dτ over τ > τᵢ at the first `rows` nodes, for several R at once. Each R
    /// is given by its `slope_changes`. The result is written to `curves[k]`. An empty list means
    /// R = 0: its curve is not changed.
    pub fn pressure(&self, changes: &[Vec<f64>], rows: usize, curves: &mut [Vec<f64>]) {
        let cells = self.cells();
        let mut pairs = not_empty(changes, curves);
        let mut start = 0;
        for i in 0..rows {
            let row = &self.pressure[start..start + cells - i];
            start += cells - i;
            for (changes, curve) in &mut pairs {
                curve[i] = dot(row, changes.get(i + 1..).unwrap_or_default());
            }
        }
    }

    /// Converts a sampled R to the change of its slope dR/dτ at each node. R is given at the first
    /// nodes and is constant outside them.
    pub(crate) fn slope_changes(&self, values: &mut [f64]) {
        for (j, per_cell) in (1..values.len()).zip(&self.per_cell) {
            values[j - 1] = (values[j] - values[j - 1]) * per_cell;
        }
        if let Some(last) = values.last_mut() {
            *last = 0.0;
        }
        for j in (1..values.len()).rev() {
            values[j] -= values[j - 1];
        }
    }
}

/// Appends the weights of ∫₀^τᵢ φ(τ)/√(τᵢ−τ) dτ for φ linear between the nodes up to τᵢ. With α =
/// √(τᵢ−τⱼ) and β = √(τᵢ−τⱼ₊₁), cell j adds e(α+2β) to its left node and e(2α+β) to its right node.
/// Here e = ⅔(α−β)²/(τⱼ₊₁−τⱼ).
fn push_inverse_row(nodes: &[f64], per_cell: &[f64], rows: &mut Vec<f64>) {
    let last = nodes[nodes.len() - 1];
    let (mut alpha, mut from_left) = ((last - nodes[0]).sqrt(), 0.0);
    for (node, per_cell) in nodes[1..].iter().zip(per_cell) {
        let beta = (last - node).sqrt();
        let e = TWO_THIRDS * (alpha - beta) * (alpha - beta) * per_cell;
        rows.push(from_left + e * (alpha + 2.0 * beta));
        (alpha, from_left) = (beta, e * (2.0 * alpha + beta));
    }
    rows.push(from_left);
}

/// Pairs each non-empty input with the curve that receives its result.
fn not_empty<'a>(
    given: &'a [Vec<f64>],
    curves: &'a mut [Vec<f64>],
) -> Vec<(&'a [f64], &'a mut [f64])> {
    let pairs = given.iter().zip(curves).filter(|(given, _)| !given.is_empty());
    pairs.map(|(given, curve)| (&given[..], &mut curve[..])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_2_PI, PI};

    /// Error of the sampled inverse of h = x² − c² (closed form: (r²/2 − c²)·(2/π)ψ + c√(r²−c²)/π).
    fn inverse_error(cells: usize) -> f64 {
        let (c, outer) = (0.5_f64, 1.25_f64);
        let theta = outer * outer - c * c;
        let kernels = Kernels::with_cells(cells);
        let x: Vec<f64> = kernels.tau().iter().map(|tau| (c * c + theta * tau).sqrt()).collect();
        let phi = x.iter().map(|x| (x * x - c * c) / x).collect();
        let mut sums = [vec![0.0; x.len()]];
        kernels.inverse(&[phi], &mut sums);
        x.iter()
            .zip(&sums[0])
            .map(|(r, sum)| {
                let chord = (r * r - c * c).max(0.0).sqrt();
                let psi = libm::atan2(chord, c);
                let exact = FRAC_2_PI * ((0.5 * r * r - c * c) * psi + 0.5 * c * chord);
                (theta.sqrt() / PI * sum - exact).abs()
            })
            .fold(0.0, f64::max)
    }

    /// Error of the sampled pressure of R = (1 − t)², t = (x² − c²)/Θ, outside c.
    fn pressure_error(cells: usize) -> f64 {
        let kernels = Kernels::with_cells(cells);
        let mut values: Vec<f64> = kernels.tau().iter().map(|t| (1.0 - t) * (1.0 - t)).collect();
        kernels.slope_changes(&mut values);
        let mut sums = [vec![0.0; cells + 1]];
        kernels.pressure(&[values], cells, &mut sums);
        kernels
            .tau()
            .iter()
            .zip(&sums[0])
            .map(|(t, sum)| {
                // ½ ∫ 2(1 − s)/√(s − t) ds from t to 1 is a multiple of (1 − t)^{3/2}, by
                // integration by parts.
                let rest = 1.0 - t;
                let exact = 4.0 / 3.0 * rest * rest.sqrt();
                (sum - exact).abs()
            })
            .fold(0.0, f64::max)
    }

    #[test]
    fn the_sampled_inverse_is_of_order_two_and_the_pressure_of_order_three_halves() {
        for (error, expected) in [(inverse_error as fn(usize) -> f64, 2.0), (pressure_error, 1.5)] {
            let (coarse, middle, fine) = (error(64), error(128), error(256));
            for order in [libm::log2(coarse / middle), libm::log2(middle / fine)] {
                assert!((order - expected).abs() < 0.1, "{order}: {coarse} {middle} {fine}");
            }
            assert!(fine < 5e-4, "{fine}");
        }
    }
}
