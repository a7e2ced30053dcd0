//! The mesh of the exact method and its one matrix.
//!
//! The nodes are r₀ < … < rₙ. The wear is linear in t = r² between nodes. Each cell is one spring
//! with mean values. Row q of the matrix A is the exact mean over cell q of the image of unit wear
//! at each node.
//!
//! # Equations
//! ```text
//! image of w at x: x ∫ w′(r)/√(x²−r²) dr;   its mean over a cell of x² contains only powers 3/2
//! ```
//! Nothing wears inside r₀ > 0. If r₀ = 0, the wear is constant over the first cell.
//!
//! # Accuracy
//! Exact for wear that is linear in r² between nodes.

use std::cell::OnceCell;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

use crate::contact::profile::Shape;
use crate::numeric::{dot, integrate_beyond};

const TWO_THIRDS: f64 = 2.0 / 3.0;

/// Nodes, cells and the matrix A of a shape.
#[derive(Debug, Clone)]
pub struct Mesh {
    /// The nodes.
    pub(crate) radii: Vec<f64>,
    /// The squares of the nodes.
    pub(crate) squares: Vec<f64>,
    /// Width of each cell, r_{q+1} − r_q.
    pub(crate) widths: Vec<f64>,
    /// The area of each node in t: V = π Σ areas·w.
    areas: Vec<f64>,
    /// The matrix A row by row: row q contains A_q1 … A_q,q+1.
    matrix: Vec<f64>,
    /// Mean of g₀ over each cell.
    pub(crate) unworn: Vec<f64>,
    /// ∫₀^r₀ (1 − g₀) dx.
    pub(crate) core: f64,
    /// The rows of (4), computed when they are first needed.
    inverse: OnceCell<Vec<f64>>,
}

impl Mesh {
    /// Creates the mesh of ascending nodes from r₀ ≥ 0. The node next to a kink of the shape moves
    /// onto the kink.
    pub(crate) fn new(shape: &Shape, mut radii: Vec<f64>) -> Self {
        place_nodes(&mut radii, shape.kinks());
        let squares: Vec<f64> = radii.iter().map(|r| r * r).collect();
        let widths: Vec<f64> = radii.windows(2).map(|ends| ends[1] - ends[0]).collect();
        let last = radii.len() - 1;
        let mut areas: Vec<f64> = (0..=last)
            .map(|j| 0.5 * (squares[(j + 1).min(last)] - squares[j.saturating_sub(1)]))
            .collect();
        areas[0] = 0.0;
        let axis = radii[0] == 0.0;
        if axis {
            areas[1] += 0.5 * squares[1];
        }
        let mut matrix = Vec::with_capacity(last * (last + 1) / 2);
        for q in 0..last {
            push_row(&squares, radii[q] + radii[q + 1], q, axis, &mut matrix);
        }
        let unworn = radii
            .windows(2)
            .map(|ends| {
                let image = |x: f64| shape.image(x);
                integrate_beyond(ends[0], ends[1], shape.kinks(), image) / (ends[1] - ends[0])
            })
            .collect();
        // The whole force minus the force of the cells. A quadrature over the core would be less
        // accurate: with many pieces its error could exceed the force of a thin ring.
        let carried: f64 = radii
            .windows(2)
            .take_while(|ends| ends[0] < 1.0)
            .map(|ends| {
                let load = |x: f64| 1.0 - shape.image(x);
                integrate_beyond(ends[0], ends[1].min(1.0), shape.kinks(), load)
            })
            .sum();
        let core = if axis { 0.0 } else { shape.half_force() - carried };
        Self { radii, squares, widths, areas, matrix, unworn, core, inverse: OnceCell::new() }
    }

    /// Row q of the matrix: A_q1 … A_q,q+1.
    fn row(&self, q: usize) -> &[f64] {
        &self.matrix[q * (q + 1) / 2..(q + 1) * (q + 2) / 2]
    }

    /// The mean over cell q of the image of the given wear at the nodes.
    pub(crate) fn image(&self, q: usize, wear: &[f64]) -> f64 {
        dot(self.row(q), &wear[1..])
    }

    /// The pressure at the nodes. `compressions` belong to the springs of the first cells; the
    /// other springs carry no load. The pressure at the first node is set to 0.
    pub fn pressure(&self, compressions: &[f64], pressure: &mut [f64]) {
        pressure.fill(0.0);
        for (q, compression) in compressions.iter().enumerate() {
            let load = self.widths[q] * compression;
            for (sum, entry) in pressure[1..].iter_mut().zip(self.row(q)) {
                *sum += load * entry;
            }
        }
        let reached = (compressions.len() + 1).min(pressure.len());
        for (sum, area) in pressure[..reached].iter_mut().zip(&self.areas).skip(1) {
            *sum *= FRAC_2_PI / area;
        }
    }

    /// Solves A·s = `slips` by forward substitution. The first value s₀ is 0, or s₁ if the mesh
    /// starts on the axis.
    pub(crate) fn solve(&self, slips: &[f64]) -> Vec<f64> {
        let mut solution = vec![0.0; slips.len() + 1];
        self.solve_into(slips, &mut solution);
        solution
    }

    /// [`solve`](Self::solve) without allocation. Leading zeros are skipped.
    pub(crate) fn solve_into(&self, slips: &[f64], solution: &mut [f64]) {
        let first = slips.iter().position(|slip| *slip != 0.0).unwrap_or(slips.len());
        solution[..=first].fill(0.0);
        for (q, slip) in slips.iter().enumerate().skip(first) {
            let row = self.row(q);
            solution[q + 1] = (slip - dot(&row[..q], &solution[1..=q])) / row[q];
        }
        if self.radii[0] == 0.0 {
            solution[0] = solution[1];
        }
    }

    /// The wear at the nodes by (4) from the wear `worn` of the image in each cell.
    pub(crate) fn inverse(&self, worn: &[f64]) -> Vec<f64> {
        let rows = self.inverse.get_or_init(|| self.inverse_rows());
        let row = |j: usize| &rows[(j - 1) * j / 2..j * (j + 1) / 2];
        let mut wear = Vec::with_capacity(self.radii.len());
        wear.push(if self.radii[0] == 0.0 { worn[0] } else { 0.0 });
        wear.extend((1..self.radii.len()).map(|j| dot(row(j), worn)));
        wear
    }

    /// (2/π)·(arcsin(r_{q+1}/r_j) − arcsin(r_q/r_j)) for each q, row by row from j = 1.
    fn inverse_rows(&self) -> Vec<f64> {
        let mut rows = Vec::with_capacity(self.matrix.len());
        for (j, r) in self.radii.iter().enumerate().skip(1) {
            let mut before = libm::asin(self.radii[0] / r);
            for q in 1..=j {
                let after = if q == j { FRAC_PI_2 } else { libm::asin(self.radii[q] / r) };
                rows.push(FRAC_2_PI * (after - before));
                before = after;
            }
        }
        rows
    }

    /// The wear volume, π Σ areas·w.
    pub(crate) fn volume(&self, wear: &[f64]) -> f64 {
        std::f64::consts::PI * dot(&self.areas, wear)
    }
}

/// Moves the inner node next to each kink onto the kink. A kink that would make the first cell much
/// narrower than the others is ignored, because a narrow cell needs small time steps.
fn place_nodes(radii: &mut [f64], kinks: &[f64]) {
    const NARROWEST: f64 = 0.25;
    for kink in kinks {
        let right = radii.partition_point(|r| r < kink);
        if right == 0 || right + 1 >= radii.len() {
            continue;
        }
        let (before, after) = (kink - radii[right - 1], radii[right] - kink);
        if right > 1 && before < after {
            radii[right - 1] = *kink;
        } else if before > NARROWEST * (before + after) {
            radii[right] = *kink;
        }
    }
}

/// Appends row q of the matrix. Each cell contributes the mean of the image of a unit slope dw/dt.
fn push_row(squares: &[f64], sum_of_ends: f64, q: usize, axis: bool, matrix: &mut Vec<f64>) {
    let (low, high) = (squares[q], squares[q + 1]);
    let scale = TWO_THIRDS * sum_of_ends;
    let cell = |j: usize| {
        let a1 = (high - squares[j]).sqrt();
        if j == q {
            return scale / a1;
        }
        let a0 = (low - squares[j]).sqrt();
        let b1 = (high - squares[j + 1]).sqrt();
        let b0 = (low - squares[j + 1]).sqrt();
        let (outer, inner) = (1.0 / (a1 + b1), 1.0 / (a0 + b0));
        let cross = (a1 * b1 * inner + a0 * b0 * outer) / ((a1 + a0) * (b1 + b0));
        scale * (outer + inner - cross)
    };
    let mut before = if axis { 0.0 } else { cell(0) };
    for j in 1..=q {
        let here = cell(j);
        matrix.push(before - here);
        before = here;
    }
    matrix.push(before);
    if axis {
        let first = matrix.len() - 1 - q;
        matrix[first] += 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graded(from: f64, to: f64, cells: usize) -> Vec<f64> {
        (0..=cells)
            .map(|i| {
                let u = i as f64 / cells as f64;
                from + (to - from) * u * u
            })
            .collect()
    }

    #[test]
    fn a_wear_linear_in_r_squared_has_the_exact_cell_means() {
        // w = t − t₀ outside r₀ has the image 2x√(x² − r₀²), with the mean ⅔·Δ(t − t₀)^{3/2}/Δr.
        let mesh = Mesh::new(&Shape::power(2.0), graded(0.4, 1.3, 30));
        let start = mesh.squares[0];
        let wear: Vec<f64> = mesh.squares.iter().map(|t| t - start).collect();
        for q in 0..30 {
            let power = |t: f64| (t - start) * (t - start).sqrt();
            let exact =
                TWO_THIRDS * (power(mesh.squares[q + 1]) - power(mesh.squares[q])) / mesh.widths[q];
            assert!((mesh.image(q, &wear) - exact).abs() < 1e-13, "{q}");
        }
        let volume = 0.5 * std::f64::consts::PI * (1.69 - start) * (1.69 - start);
        assert!((mesh.volume(&wear) - volume).abs() < 1e-12);
    }

    #[test]
    fn a_constant_wear_on_the_axis_is_its_own_image() {
        let mesh = Mesh::new(&Shape::power(1.0), graded(0.0, 1.0, 20));
        for q in 0..20 {
            assert!((mesh.image(q, &[0.3; 21]) - 0.3).abs() < 1e-14);
        }
        assert!((mesh.volume(&[0.3; 21]) - 0.3 * std::f64::consts::PI).abs() < 1e-14);
    }

    #[test]
    fn a_node_moves_onto_a_kink_unless_the_kink_is_too_close_to_the_axis() {
        let radii: Vec<f64> = (0..=10).map(|i| f64::from(i) * 0.13).collect();
        for (flat, node) in [(0.5, Some(4)), (0.45, Some(3)), (0.1, Some(1)), (0.01, None)] {
            let mesh = Mesh::new(&Shape::truncated_cone(flat), radii.clone());
            let moved = mesh.radii.iter().position(|r| (r - flat).abs() < 1e-15);
            assert_eq!(moved, node, "{flat}");
            assert!(mesh.widths.iter().all(|width| *width > 0.03));
        }
    }

    #[test]
    fn solve_inverts_the_image_matrix() {
        for from in [0.0, 0.5] {
            let mesh = Mesh::new(&Shape::power(2.0), graded(from, 1.2, 40));
            let mut wear: Vec<f64> = (0..=40).map(|j| libm::sin(0.3 * f64::from(j))).collect();
            wear[0] = if from == 0.0 { wear[1] } else { 0.0 };
            let image: Vec<f64> = (0..40).map(|q| mesh.image(q, &wear)).collect();
            for (solved, given) in mesh.solve(&image).iter().zip(&wear) {
                assert!((solved - given).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn the_unworn_pressure_agrees_with_hertz() {
        let radii = (0..=200).map(|i| f64::from(i) * 0.005).collect();
        let mesh = Mesh::new(&Shape::power(2.0), radii);
        let loads: Vec<f64> = mesh.unworn.iter().map(|g| 1.0 - g).collect();
        let mut pressure = vec![0.0; 201];
        mesh.pressure(&loads, &mut pressure);
        for (r, p) in mesh.radii.iter().zip(&pressure).skip(2).take(190) {
            let hertz = std::f64::consts::FRAC_2_PI * (1.0 - r * r).sqrt();
            assert!((p - hertz).abs() < 2e-3, "{r}: {p} {hertz}");
        }
        let force: f64 = 2.0 * loads.iter().zip(&mesh.widths).map(|(y, d)| y * d).sum::<f64>();
        assert!((force - 4.0 / 3.0).abs() < 1e-12);
    }
}
