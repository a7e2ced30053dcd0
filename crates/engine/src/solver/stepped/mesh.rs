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
//! In a line contact the wear is linear in x between nodes, and each cell is one spring with its mean over ds/s:
//! ```text
//! R(s,x) = ∫ √(s²−x²) ds/s = √(s²−x²) − x·arccos(x/s),   L_q = ln(r_{q+1}/r_q)
//! S_qj   = (2/π) [R(s,x_j) − R(s,x_{j+1})]/(L_q (x_{j+1} − x_j)) from s = r_q to r_{q+1}
//! A_qj   = S_{q,j−1} − S_{q,j}
//! ```
//! ds/s needs r₀ > 0. If everything wears, the wear is constant inside a small r₀. Uniform wear changes no image, so
//! the wear of the first node is a number of its own, and its pressure is what is left of the load.
//!
//! # Accuracy
//! Exact for wear that is linear in r² (round) or in x (line) between nodes.

use std::cell::OnceCell;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

use super::prior::PriorWear;
use crate::contact::{Geometry, Shape};
use crate::numeric::dot;
use crate::solver::pressures::Rings;

const TWO_THIRDS: f64 = 2.0 / 3.0;
/// If everything wears, r₀ of a line contact is this share of the next node.
const INNERMOST: f64 = 0.02;
/// Number of matrix rows that are multiplied together. Their sums fit into the registers of a
/// processor. An addition needs several clock cycles. The processor works on other sums meanwhile.
const GROUP: usize = 12;

/// The entries of one column in a group of rows.
type GroupColumn = [f64; GROUP];

/// Nodes, cells and the matrix A of a shape.
#[derive(Debug, Clone)]
pub struct Mesh {
    /// The nodes.
    pub(crate) radii: Vec<f64>,
    /// The geometry of the contact.
    pub(crate) geometry: Geometry,
    /// The nodes in the coordinate in which the wear is linear: r², or x in a line contact.
    pub(crate) places: Vec<f64>,
    /// Width of each cell, r_{q+1} − r_q.
    pub(crate) widths: Vec<f64>,
    /// The weight of each spring: its width, or ln(r_{q+1}/r_q) in a line contact.
    pub(crate) weights: Vec<f64>,
    /// Whether everything wears, also inside the first node.
    pub(crate) is_whole: bool,
    /// The area of each node in its coordinate: V = π Σ areas·w, or 2 Σ areas·w in a line contact.
    areas: Vec<f64>,
    /// The matrix A in groups of rows, each column by column. Row q of A is A_q1 … A_q,q+1.
    image: Vec<Vec<GroupColumn>>,
    /// The column A_q0 of the first node. Empty unless the wear of the first node is a number of its own.
    first: Vec<f64>,
    /// The matrix of the pressure in groups of rows, each column by column from the diagonal on.
    pressure: Vec<Vec<GroupColumn>>,
    /// Mean over each cell of the image before any wear on this mesh.
    pub(crate) initial: Vec<f64>,
    /// ∫₀^r₀ (1 − g) dx. Nothing wears there on this mesh.
    pub(crate) core: f64,
    /// The rows of (4), computed when they are first needed.
    inverse: OnceCell<Vec<f64>>,
    /// The loads of rings inside r₀ that follow from the image of the core, computed when they are first needed.
    core_loads: OnceCell<(Rings, Vec<f64>)>,
}

impl Mesh {
    /// Creates the mesh of ascending nodes from r₀ ≥ 0, for a shape with prior wear. The node next to a
    /// kink of the shape moves onto the kink.
    pub(crate) fn new(shape: &Shape, prior: &PriorWear, mut radii: Vec<f64>) -> Self {
        place_nodes(&mut radii, shape.kinks());
        let (geometry, is_whole) = (shape.geometry(), radii[0] == 0.0);
        let is_line = geometry == Geometry::Line;
        if is_line && is_whole {
            radii[0] = INNERMOST * radii[1];
        }
        let places: Vec<f64> = radii.iter().map(|r| geometry.place(*r)).collect();
        let widths: Vec<f64> = radii.windows(2).map(|ends| ends[1] - ends[0]).collect();
        let last = radii.len() - 1;
        let mut areas: Vec<f64> = (0..=last)
            .map(|j| 0.5 * (places[(j + 1).min(last)] - places[j.saturating_sub(1)]))
            .collect();
        let axis = is_whole && !is_line;
        match (is_whole, geometry) {
            (false, _) => areas[0] = 0.0,
            (true, Geometry::Line) => areas[0] += radii[0],
            (true, Geometry::Round) => (areas[0], areas[1]) = (0.0, areas[1] + 0.5 * places[1]),
        }
        let (weights, image, first) = match geometry {
            Geometry::Round => (widths.clone(), image(&radii, &places), Vec::new()),
            Geometry::Line => {
                let weights: Vec<f64> =
                    radii.windows(2).map(|ends| libm::log(ends[1] / ends[0])).collect();
                let (image, first) = line_image(&radii, &weights);
                (weights, image, if is_whole { first } else { Vec::new() })
            }
        };
        let per_load = if is_line { 0.5 } else { FRAC_2_PI };
        let pressure = pressure(&image, &weights, &areas[1..], per_load);
        let mut initial: Vec<f64> =
            radii.windows(2).map(|ends| shape.image_mean(ends[0], ends[1])).collect();
        let core = if axis || is_line { 0.0 } else { core(shape, prior, &radii, &initial) };
        if !prior.is_empty() {
            let areas: Vec<f64> = radii.iter().map(|r| prior.image_area(*r)).collect();
            let worn =
                areas.windows(2).zip(&weights).map(|(ends, weight)| (ends[1] - ends[0]) / weight);
            initial.iter_mut().zip(worn).for_each(|(image, worn)| *image += worn);
        }
        let (inverse, core_loads) = (OnceCell::new(), OnceCell::new());
        Self {
            radii,
            geometry,
            places,
            widths,
            weights,
            is_whole,
            areas,
            image,
            first,
            pressure,
            initial,
            core,
            inverse,
            core_loads,
        }
    }

    /// The loads of rings inside r₀ that follow from the image of the core. They are the same throughout a mesh.
    pub(crate) fn core_loads(&self, rings: &Rings, load: impl Fn() -> Vec<f64>) -> Vec<f64> {
        let known = self.core_loads.get_or_init(|| (rings.clone(), load()));
        if known.0 == *rings { known.1.clone() } else { load() }
    }

    /// The load ∫ p dt of pressures at the nodes.
    pub(crate) fn load(&self, pressure: &[f64]) -> f64 {
        dot(&self.areas, pressure)
    }

    /// The width of the cell at a radius.
    pub(crate) fn width_at(&self, radius: f64) -> f64 {
        let next = self.radii.partition_point(|r| *r <= radius);
        self.widths[next.clamp(1, self.widths.len()) - 1]
    }

    /// The mean over cell q of the image of the given wear at the nodes.
    pub(crate) fn image(&self, q: usize, wear: &[f64]) -> f64 {
        let beyond = products(&self.image[q / GROUP], &wear[1..])[q % GROUP];
        self.first.get(q).map_or(beyond, |first| beyond + first * wear[0])
    }

    /// Appends the images of the next group of cells, for the given wear at the nodes. `images`
    /// contains all groups before.
    pub(crate) fn push_images(&self, wear: &[f64], images: &mut Vec<f64>) {
        let known = images.len();
        let worn = products(&self.image[known / GROUP], &wear[1..]);
        images.extend(self.initial[known..].iter().zip(worn).map(|(initial, worn)| initial + worn));
        let first = self.first[known.min(self.first.len())..].iter();
        images[known..].iter_mut().zip(first).for_each(|(image, first)| *image += first * wear[0]);
    }

    /// The pressure at the nodes. `compressions` belong to the springs of the first cells; the
    /// other springs carry no load. The pressure at the first node is set to 0, unless its wear is a number of its own.
    pub fn pressure(&self, compressions: &[f64], pressure: &mut [f64]) {
        pressure[0] = 0.0;
        if !self.first.is_empty() {
            // What the other nodes leave of the load 1.
            let others = compressions.iter().zip(&self.weights).zip(&self.first);
            let others: f64 = others.map(|((y, weight), first)| y * weight * first).sum();
            pressure[0] = 0.5 * (1.0 + others) / self.areas[0];
        }
        let loaded = |group: usize| compressions.get(group * GROUP..).unwrap_or_default();
        let (groups, rest) = pressure[1..].as_chunks_mut();
        let last = groups.len();
        for ((group, pressure), columns) in groups.iter_mut().enumerate().zip(&self.pressure) {
            *pressure = products(columns, loaded(group));
        }
        if let Some(columns) = self.pressure.get(last) {
            rest.copy_from_slice(&products(columns, loaded(last))[..rest.len()]);
        }
    }

    /// Solves A·s = `slips` by forward substitution. The first value s₀ is 0, or s₁ if the mesh
    /// starts on the axis. In a line contact, a slip of the middle adds to all values.
    pub(crate) fn solve(&self, slips: &[f64]) -> Vec<f64> {
        let mut solution = vec![0.0; slips.len() + 1];
        self.solve_into(slips, &mut solution);
        solution
    }

    /// [`solve`](Self::solve) without allocation. Leading zeros are skipped.
    pub(crate) fn solve_into(&self, slips: &[f64], solution: &mut [f64]) {
        let first = slips.iter().position(|slip| *slip != 0.0).unwrap_or(slips.len());
        solution[..=first].fill(0.0);
        let groups = slips.chunks(GROUP).zip(&self.image).enumerate();
        for (group, (slips, columns)) in groups.skip(first / GROUP) {
            let (before, here) = solution[1..].split_at_mut(group * GROUP);
            let mut sums = products(columns, before);
            let diagonal = columns[before.len()..].iter().enumerate();
            for ((i, column), (slip, solution)) in diagonal.zip(slips.iter().zip(here)) {
                *solution = (slip - sums[i]) / column[i];
                for (sum, entry) in sums.iter_mut().zip(column) {
                    *sum += entry * *solution;
                }
            }
        }
        if self.starts_on_axis() {
            solution[0] = solution[1];
        }
    }

    /// Whether the wear is constant over the first cell, because a round contact wears as a whole.
    pub(crate) fn starts_on_axis(&self) -> bool {
        self.is_whole && self.first.is_empty()
    }

    /// The wear at the nodes by (4) from the wear `worn` of the image in each cell.
    pub(crate) fn inverse(&self, worn: &[f64]) -> Vec<f64> {
        let rows = self.inverse.get_or_init(|| self.inverse_rows());
        let row = |j: usize| &rows[(j - 1) * j / 2..j * (j + 1) / 2];
        let mut wear = Vec::with_capacity(self.radii.len());
        wear.push(if self.is_whole { worn[0] } else { 0.0 });
        wear.extend((1..self.radii.len()).map(|j| dot(row(j), worn)));
        wear
    }

    /// (2/π)·(arcsin(r_{q+1}/r_j) − arcsin(r_q/r_j)) for each q, row by row from j = 1.
    fn inverse_rows(&self) -> Vec<f64> {
        let mut rows = Vec::with_capacity(self.radii.len() * self.widths.len() / 2);
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

    /// The wear volume, π Σ areas·w, or 2 Σ areas·w in a line contact.
    pub(crate) fn volume(&self, wear: &[f64]) -> f64 {
        let unit = match self.geometry {
            Geometry::Round => std::f64::consts::PI,
            Geometry::Line => 2.0,
        };
        unit * dot(&self.areas, wear)
    }

    /// The tangential motion, as far as the surface at `radius` does not follow it: Δ·s there. `loads` are min(Δ, y) of
    /// the cells in contact. In a line contact it is the slip relative to the middle.
    pub(crate) fn slip_at(&self, radius: f64, threshold: f64, loads: &[f64]) -> f64 {
        let angle = |x: f64| match self.geometry {
            Geometry::Round => libm::asin((x / radius).min(1.0)),
            Geometry::Line => libm::acosh((radius / x).max(1.0)),
        };
        let mut inner = angle(self.radii[0]);
        let mut sum = threshold * inner;
        for (load, outer) in loads.iter().zip(&self.radii[1..]) {
            let outer = angle(*outer);
            sum += load * (outer - inner);
            inner = outer;
        }
        match self.geometry {
            Geometry::Round => threshold - FRAC_2_PI * sum,
            Geometry::Line => sum,
        }
        .max(0.0)
    }
}

/// ∫₀^r₀ (1 − g) dx before any wear on the mesh, for a round contact.
fn core(shape: &Shape, prior: &PriorWear, radii: &[f64], initial: &[f64]) -> f64 {
    // The whole force minus the force of the cells. A quadrature over the core would be less
    // accurate: with many pieces its error could exceed the force of a thin ring.
    let loads = radii.windows(2).zip(initial).map(|(ends, unworn)| {
        if ends[1] <= 1.0 {
            (ends[1] - ends[0]) * (1.0 - unworn)
        } else if ends[0] < 1.0 {
            (1.0 - ends[0]) * (1.0 - shape.image_mean(ends[0], 1.0))
        } else {
            0.0
        }
    });
    let mut unworn_core = shape.half_force() - loads.sum::<f64>();
    if radii[0] > 1.0 {
        // The core of a later block can reach beyond the unworn contact.
        unworn_core -= (radii[0] - 1.0) * (shape.image_mean(1.0, radii[0]) - 1.0);
    }
    unworn_core - prior.image_area(radii[0])
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

/// The products of a group of rows with a vector, which can be shorter than the rows.
fn products(columns: &[GroupColumn], vector: &[f64]) -> GroupColumn {
    let mut sums = [0.0; GROUP];
    for (column, value) in columns.iter().zip(vector) {
        for (sum, entry) in sums.iter_mut().zip(column) {
            *sum += entry * value;
        }
    }
    sums
}

/// The matrix A. Each cell contributes the mean of the image of a unit slope dw/dt.
fn image(radii: &[f64], squares: &[f64]) -> Vec<Vec<GroupColumn>> {
    let (cells, axis) = (radii.len() - 1, radii[0] == 0.0);
    let mut groups: Vec<Vec<GroupColumn>> = (0..cells)
        .step_by(GROUP)
        .map(|first| vec![[0.0; GROUP]; (first + GROUP).min(cells)])
        .collect();
    // √(t_q − t_j) for j ≤ q.
    let (mut roots, mut next) = (vec![0.0], Vec::with_capacity(cells));
    let mut row = Vec::with_capacity(cells);
    for q in 0..cells {
        let scale = TWO_THIRDS * (radii[q] + radii[q + 1]);
        next.clear();
        next.extend(squares[..=q].iter().map(|t| (squares[q + 1] - t).sqrt()));
        let slopes = roots.windows(2).zip(next.windows(2)).map(|(a0, a1)| {
            let (outer, inner) = (1.0 / (a1[0] + a1[1]), 1.0 / (a0[0] + a0[1]));
            let cross = (a1[0] * a1[1] * inner + a0[0] * a0[1] * outer)
                / ((a1[0] + a0[0]) * (a1[1] + a0[1]));
            scale * (outer + inner - cross)
        });
        row.clear();
        row.extend(slopes.chain([scale / next[q]]));
        if axis {
            row[0] = 0.0;
        }
        // Unit wear at a node has a slope on both sides of the node.
        let entries = row.windows(2).map(|slopes| slopes[0] - slopes[1]).chain(row.last().copied());
        let columns = &mut groups[q / GROUP];
        for (column, entry) in columns.iter_mut().zip(entries) {
            column[q % GROUP] = entry;
        }
        if axis {
            columns[0][q % GROUP] += 1.0;
        }
        next.push(0.0);
        std::mem::swap(&mut roots, &mut next);
    }
    groups
}

/// The matrix A of a line contact, and its column of the first node.
fn line_image(radii: &[f64], weights: &[f64]) -> (Vec<Vec<GroupColumn>>, Vec<f64>) {
    let cells = weights.len();
    let mut groups: Vec<Vec<GroupColumn>> = (0..cells)
        .step_by(GROUP)
        .map(|first| vec![[0.0; GROUP]; (first + GROUP).min(cells)])
        .collect();
    let mut first = Vec::with_capacity(cells);
    // R(r_q, x_j) for j ≤ q.
    let (mut roots, mut next) = (vec![0.0], Vec::with_capacity(cells));
    for q in 0..cells {
        let (s, scale) = (radii[q + 1], FRAC_2_PI / weights[q]);
        next.clear();
        next.extend(radii[..=q].iter().map(|x| {
            let chord = ((s - x) * (s + x)).sqrt();
            chord - x * libm::atan2(chord, *x)
        }));
        next.push(0.0);
        roots.push(0.0);
        // The mean over the cell of the image of a unit slope in each cell up to this one.
        let slope = |j: usize| {
            let rise = (next[j] - roots[j]) - (next[j + 1] - roots[j + 1]);
            scale * rise / (radii[j + 1] - radii[j])
        };
        let mut before = slope(0);
        first.push(-before);
        for j in 1..=q {
            let here = slope(j);
            groups[q / GROUP][j - 1][q % GROUP] = before - here;
            before = here;
        }
        groups[q / GROUP][q][q % GROUP] = before;
        std::mem::swap(&mut roots, &mut next);
    }
    (groups, first)
}

/// The matrix of the pressure: the transpose of A with the weights of springs and the areas of nodes.
fn pressure(
    image: &[Vec<GroupColumn>],
    weights: &[f64],
    areas: &[f64],
    per_load: f64,
) -> Vec<Vec<GroupColumn>> {
    let per_area: Vec<f64> = areas.iter().map(|area| per_load / area).collect();
    let group = |(group, per_area): (usize, &[f64])| {
        let first = group * GROUP;
        let columns = weights.iter().enumerate().skip(first).map(|(q, weight)| {
            let mut column = [0.0; GROUP];
            let entries = image[q / GROUP][first..].iter().map(|column| column[q % GROUP]);
            for ((sum, entry), per_area) in column.iter_mut().zip(entries).zip(per_area) {
                *sum = per_area * weight * entry;
            }
            column
        });
        columns.collect()
    };
    per_area.chunks(GROUP).enumerate().map(group).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Flank;

    fn none() -> PriorWear {
        PriorWear::default()
    }

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
        // With t = r², w = t − t₀ outside r₀ has the image 2x√(x² − r₀²), with the mean ⅔·Δ(t − t₀)^{3/2}/Δr.
        let mesh = Mesh::new(&Shape::power(2.0), &none(), graded(0.4, 1.3, 30));
        let start = mesh.places[0];
        let wear: Vec<f64> = mesh.places.iter().map(|t| t - start).collect();
        for q in 0..30 {
            let power = |t: f64| (t - start) * (t - start).sqrt();
            let exact =
                TWO_THIRDS * (power(mesh.places[q + 1]) - power(mesh.places[q])) / mesh.widths[q];
            assert!((mesh.image(q, &wear) - exact).abs() < 1e-13, "{q}");
        }
        let volume = 0.5 * std::f64::consts::PI * (1.69 - start) * (1.69 - start);
        assert!((mesh.volume(&wear) - volume).abs() < 1e-12);
    }

    #[test]
    fn a_constant_wear_on_the_axis_is_its_own_image() {
        let mesh = Mesh::new(&Shape::power(1.0), &none(), graded(0.0, 1.0, 20));
        for q in 0..20 {
            assert!((mesh.image(q, &[0.3; 21]) - 0.3).abs() < 1e-14);
        }
        assert!((mesh.volume(&[0.3; 21]) - 0.3 * std::f64::consts::PI).abs() < 1e-14);
    }

    #[test]
    fn a_node_moves_onto_a_kink_unless_the_kink_is_too_close_to_the_axis() {
        let radii: Vec<f64> = (0..=10).map(|i| f64::from(i) * 0.13).collect();
        for (flat, node) in [(0.5, Some(4)), (0.45, Some(3)), (0.1, Some(1)), (0.01, None)] {
            let mesh = Mesh::new(&Shape::truncated(Flank::Cone, flat), &none(), radii.clone());
            let moved = mesh.radii.iter().position(|r| (r - flat).abs() < 1e-15);
            assert_eq!(moved, node, "{flat}");
            assert!(mesh.widths.iter().all(|width| *width > 0.03));
        }
    }

    #[test]
    fn solve_inverts_the_image_matrix() {
        for (from, cells) in [(0.0, 40), (0.5, 40), (0.0, 41), (0.5, 42), (0.5, 43)] {
            let mesh = Mesh::new(&Shape::power(2.0), &none(), graded(from, 1.2, cells));
            let mut wear: Vec<f64> = (0..=cells).map(|j| libm::sin(0.3 * j as f64)).collect();
            wear[0] = if from == 0.0 { wear[1] } else { 0.0 };
            let image: Vec<f64> = (0..cells).map(|q| mesh.image(q, &wear)).collect();
            for (solved, given) in mesh.solve(&image).iter().zip(&wear) {
                assert!((solved - given).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn the_unworn_pressure_agrees_with_hertz() {
        let radii = (0..=200).map(|i| f64::from(i) * 0.005).collect();
        let mesh = Mesh::new(&Shape::power(2.0), &none(), radii);
        let loads: Vec<f64> = mesh.initial.iter().map(|g| 1.0 - g).collect();
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
