//! The shape of a measured table, and its image.
//!
//! The module first removes the noise from the points ([`smoothing`](super::smoothing)). A cubic
//! through the points is monotone where the points are monotone. Its slopes are those of parabolas
//! through three neighbours, limited to three times the smaller secant. The image (3) of this cubic
//! and the slope of the image are integrated exactly at the nodes: the points and some positions
//! between them. The final image is a cubic through these values, forced to increase. Profile,
//! pressure and force are the exact transforms of the final image. What this changes outside the
//! contact is judged by [`splits`](super::splits). Inside the contact it is of the size of noise.
//!
//! No points are measured between the axis and the first node. There the image is an even function
//! of x, because a measured table has no sharp apex.
//!
//! # Units
//! Lengths are in units of the last radius, heights in units of the greatest height.
//!
//! # Accuracy
//! Transforms of the image: 1e-11. The image of 200 exact points is accurate to 1e-8 for a
//! paraboloid. For a cone it is accurate to 1e-4, and to 1e-2 in the first hundredth of the radius.

use std::f64::consts::{FRAC_1_PI, FRAC_2_PI};
use std::sync::Arc;

use super::geometry::Geometry;
use super::pieces::{
    Powers, area, cubic, image_of, inverse_kernel, line_image_of, line_kernel, monotone_slopes,
    pressure_kernel, shifted, slope, value,
};
use super::rising::{FALL, increasing};
use super::smoothing::{Smoothed, grouped, smoothed};
use super::splits::{Falls, NEGLECTED, TrueImage};
use crate::numeric::{maximum, root};

/// Minimum number of nodes of the image.
const NODES: usize = 160;

/// The shape of a measured table. All lists run from the axis outwards.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TableShape {
    /// The last radius, in m.
    length: f64,
    /// The greatest height, in m.
    height: f64,
    geometry: Geometry,
    /// Nodes of the image, starting with 0.
    nodes: Vec<f64>,
    /// The polynomial of the image in the cell after each node. After the last node the image is
    /// linear.
    cells: Vec<Powers>,
    /// The changes of the coefficients at each node.
    changes: Vec<Powers>,
    /// The integral of the image, ∫ g dx, from the axis to each node.
    areas: Vec<f64>,
    /// The image before it is forced to increase, up to the last radius.
    true_image: TrueImage,
    /// The radii of the points, and the noise that remains in their smoothed heights.
    points: Vec<[f64; 2]>,
    /// The change of the slope at each point, if straight lines connect the points.
    bends: Vec<[f64; 3]>,
}

/// The image (3) at a radius and its slope, for the changes of a piecewise polynomial f′ at its knots.
type ImageOf = fn(&[f64], &[[f64; 3]], f64) -> (f64, f64);

fn image_at(geometry: Geometry) -> ImageOf {
    match geometry {
        Geometry::Round => image_of,
        Geometry::Line => line_image_of,
    }
}

/// A point whose smoothed height is below the height on the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LowPoint {
    /// The radius of the lowest point.
    pub(crate) radius: f64,
    /// The distance below the height on the axis, in m.
    pub(crate) below: f64,
    /// Whether the heights of other points are too low as well.
    pub(crate) others: bool,
}

impl TableShape {
    /// The shape through `height` at `radius`. The radii increase strictly from 0; there are at
    /// least two.
    ///
    /// # Errors
    /// The lowest point, if the noise does not explain that it is below the height on the axis.
    pub(crate) fn through(
        radius: &[f64],
        height: &[f64],
        geometry: Geometry,
    ) -> Result<Self, LowPoint> {
        let length = radius[radius.len() - 1];
        let (lowest, greatest) =
            (height[0], height.iter().copied().fold(f64::NEG_INFINITY, f64::max));
        let scale = greatest - lowest;
        let x: Vec<f64> = radius.iter().map(|r| r / length).collect();
        let z: Vec<f64> = height.iter().map(|z| (z - lowest) / scale).collect();
        let (x, z) = grouped(&x, &z);
        let smooth = smoothed(&x, z.clone());
        if let [(row, below), rest @ ..] = smooth.low_points(&z).as_slice() {
            let (radius, below) = (x[*row] * length, below * scale);
            return Err(LowPoint { radius, below, others: !rest.is_empty() });
        }
        let Smoothed { heights: z, noise, remaining } = smooth;
        let points = x.iter().zip(remaining).map(|(x, noise)| [*x, noise]).collect();
        let secant = |i: usize| (z[i + 1] - z[i]) / (x[i + 1] - x[i]);
        let before = |i: usize| if i > 0 { secant(i - 1) } else { 0.0 };
        let bends = (0..x.len() - 1).map(|i| [secant(i) - before(i), 0.0, 0.0]).collect();
        let slopes = monotone_slopes(&x, &z);
        // The polynomial f′ in each cell, and its change at each point.
        let mut before = [0.0; 3];
        let changes: Vec<[f64; 3]> = (0..x.len() - 1)
            .map(|i| {
                let width = x[i + 1] - x[i];
                let cell = cubic(width, [z[i], z[i + 1]], [slopes[i], slopes[i + 1]]);
                let here = [cell[1], 2.0 * cell[2], 3.0 * cell[3]];
                let change =
                    [if i == 0 { here[0] } else { 0.0 }, here[1] - before[1], here[2] - before[2]];
                before = [0.0, here[1] + 2.0 * here[2] * width, here[2]];
                change
            })
            .collect();
        let parts = NODES.div_ceil(x.len() - 1);
        let mut nodes = vec![0.0];
        for ends in x.windows(2) {
            nodes.extend(
                (1..parts).map(|k| ends[0] + (ends[1] - ends[0]) * k as f64 / parts as f64),
            );
            nodes.push(ends[1]);
        }
        let image_at = image_at(geometry);
        let images: Vec<(f64, f64)> =
            nodes.iter().map(|node| image_at(&x, &changes, *node)).collect();
        let noise: Vec<f64> = (0..nodes.len()).map(|node| noise[node / parts]).collect();
        let shape = Self::rising((length, scale, geometry), nodes, &images, &noise);
        Ok(Self { points, bends, ..shape })
    }

    /// The increasing image through values and slopes at nodes. The table is cut off where the
    /// image decreases.
    fn rising(
        (length, height, geometry): (f64, f64, Geometry),
        mut nodes: Vec<f64>,
        images: &[(f64, f64)],
        noise: &[f64],
    ) -> Self {
        let true_image = TrueImage::new(&nodes, images.iter().map(|(image, _)| *image));
        let values = increasing(&nodes, images, noise);
        nodes.truncate(values.len());
        let last = nodes.len() - 1;
        let secant = |i: usize| (values[i + 1] - values[i]) / (nodes[i + 1] - nodes[i]);
        let slopes: Vec<f64> = (0..=last)
            .map(|i| {
                let left = match i {
                    0 => return 0.0,
                    // Slope of the steepest possible even quartic at the first node.
                    1 => 4.0 / 3.0 * secant(0),
                    _ => secant(i - 1),
                };
                let right = if i < last { secant(i) } else { left };
                images[i].1.clamp(0.0, 3.0 * left.min(right))
            })
            .collect();
        let mut cells: Vec<Powers> = (0..last)
            .map(|i| {
                let width = nodes[i + 1] - nodes[i];
                if i == 0 {
                    // The even quartic a u² + b u⁴ of the first cell, with u = x/width.
                    let steepness = slopes[1] * width;
                    let (a, b) =
                        (0.5 * (4.0 * values[1] - steepness), 0.5 * (steepness - 2.0 * values[1]));
                    let square = width * width;
                    return [0.0, 0.0, a / square, 0.0, b / (square * square)];
                }
                cubic(width, [values[i], values[i + 1]], [slopes[i], slopes[i + 1]])
            })
            .collect();
        // The linear part beyond the table only serves to estimate how far the table should extend.
        let straight = slopes[last].max(secant(last - 1)).max(FALL);
        cells.push([values[last], straight, 0.0, 0.0, 0.0]);
        let changes = (0..=last)
            .map(|i| {
                let mut change = cells[i];
                if i > 0 {
                    let before = shifted(&cells[i - 1], nodes[i] - nodes[i - 1]);
                    for (change, before) in change.iter_mut().zip(before) {
                        *change -= before;
                    }
                    // Value and slope are continuous, so the computed changes are rounding errors. Remove them.
                    change[0] = 0.0;
                    if i < last {
                        change[1] = 0.0;
                    }
                }
                change
            })
            .collect();
        let mut areas = vec![0.0];
        for (cell, ends) in cells.iter().zip(nodes.windows(2)) {
            areas.push(areas[areas.len() - 1] + area(cell, ends[1] - ends[0]));
        }
        let (points, bends) = Default::default();
        Self { length, height, geometry, nodes, cells, changes, areas, true_image, points, bends }
    }

    /// The radius, in m, up to which the image increases: the last radius of the table, or less if
    /// the image decreases earlier.
    pub(crate) fn reach(&self) -> f64 {
        self.end() * self.length
    }

    fn end(&self) -> f64 {
        self.nodes[self.nodes.len() - 1]
    }

    /// The cell that contains `x`, and the distance of `x` from the start of the cell.
    fn locate(&self, x: f64) -> (usize, f64) {
        let cell = self.nodes.partition_point(|node| *node <= x).saturating_sub(1);
        (cell, x - self.nodes[cell])
    }

    fn image(&self, x: f64) -> f64 {
        let (cell, u) = self.locate(x);
        value(&self.cells[cell], u)
    }

    fn image_slope(&self, x: f64) -> f64 {
        let (cell, u) = self.locate(x);
        slope(&self.cells[cell], u)
    }

    fn image_rise(&self, c: f64, delta: f64) -> f64 {
        /// The rise of a polynomial, P(u + δ) − P(u), without cancellation.
        fn within(powers: &Powers, u: f64, delta: f64) -> f64 {
            let [_, rest @ ..] = shifted(powers, u);
            delta * value(&[rest[0], rest[1], rest[2], rest[3], 0.0], delta)
        }
        let ((from, before), (to, after)) = (self.locate(c), self.locate(c + delta));
        if from == to {
            return within(&self.cells[from], before, delta);
        }
        let left = self.nodes[from + 1] - c;
        let between = self.cells[to][0] - self.cells[from + 1][0];
        within(&self.cells[from], before, left) + between + within(&self.cells[to], 0.0, after)
    }

    fn image_inverse(&self, height: f64) -> f64 {
        let cell = self.cells.partition_point(|powers| powers[0] <= height).saturating_sub(1);
        let (node, powers) = (self.nodes[cell], &self.cells[cell]);
        match self.nodes.get(cell + 1) {
            Some(next) => node + root(0.0, next - node, |u| value(powers, u) - height),
            None => node + (height - powers[0]) / powers[1],
        }
    }

    /// The integral of the image, ∫ g dx, from the axis to `x`.
    fn area(&self, x: f64) -> f64 {
        let (cell, u) = self.locate(x);
        self.areas[cell] + area(&self.cells[cell], u)
    }

    /// The sum over the polynomial terms that start between `from` and `to`. The first term is the polynomial of the
    /// cell that contains `from`.
    fn sum_of_terms(&self, from: f64, to: f64, of: impl Fn(f64, &Powers) -> f64) -> f64 {
        let (cell, u) = self.locate(from);
        let later = self.nodes[cell + 1..].iter().zip(&self.changes[cell + 1..]);
        let later =
            later.take_while(|(node, _)| **node < to).map(|(node, powers)| of(*node, powers));
        std::iter::once(of(from, &shifted(&self.cells[cell], u))).chain(later).sum()
    }

    /// The inverse transform outside c: (2/π) ∫ g/√(r²−x²) dx over c…r. In a line contact it is r ∫ F/(x √(r²−x²)) dx.
    fn inverse_outside(&self, c: f64, r: f64) -> f64 {
        if r <= c {
            return 0.0;
        }
        let (kernel, unit): (fn(f64, f64) -> Powers, f64) = match self.geometry {
            Geometry::Round => (inverse_kernel, FRAC_2_PI),
            Geometry::Line => (line_kernel, r),
        };
        let sum = self.sum_of_terms(c, r, |node, powers| {
            let t = kernel(node, r);
            t.iter().zip(powers).map(|(t, power)| t * power).sum()
        });
        unit * sum
    }

    /// The slope of the profile: f′ = (2/πr) ∫ x g′/√(r²−x²) dx. In a line contact it is ∫ F′/√(r²−x²) dx.
    fn slope(&self, r: f64) -> f64 {
        if r <= 0.0 {
            return 0.0;
        }
        let is_round = self.geometry == Geometry::Round;
        let sum = self.sum_of_terms(0.0, r, |node, powers| {
            let t = inverse_kernel(node, r);
            let of = |k: usize| if is_round { t[k] + node * t[k - 1] } else { t[k - 1] };
            (1..5).map(|k| k as f64 * powers[k] * of(k)).sum()
        });
        if is_round { FRAC_2_PI * sum / r } else { sum }
    }

    /// The pressure inside the contact: (1/π) ∫ g′/√(x²−r²) dx over r…end.
    fn pressure_inside(&self, r: f64, end: f64) -> f64 {
        if r >= end {
            return 0.0;
        }
        let last = ((end - r) * (end + r)).sqrt();
        let sum = self.sum_of_terms(r, end, |node, powers| {
            let s = pressure_kernel(node, r, end, last);
            (1..5).map(|k| k as f64 * powers[k] * s[k - 1]).sum()
        });
        FRAC_1_PI * sum
    }

    /// The indentation depth d, in m, under a force given as F/E* in m²: F/E* = 2∫ (d − g) dx.
    /// Beyond the table the image is linear.
    pub(crate) fn depth_under(&self, force: f64) -> f64 {
        let half = force / (2.0 * self.length * self.height);
        let carried = |x: f64| x * self.image(x) - self.area(x);
        let end = self.end();
        let missing = half - carried(end);
        let radius = if missing > 0.0 {
            // At a distance e beyond the table, the force is larger by s·e·(x + e/2).
            let slope = self.cells[self.cells.len() - 1][1];
            end + 2.0 * missing / slope / (end + (end * end + 2.0 * missing / slope).sqrt())
        } else {
            root(0.0, end, |x| carried(x) - half)
        };
        self.image(radius) * self.height
    }
}

/// The description of a contact that is split into a core and rings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Split {
    /// The radius of the core, in m.
    pub(crate) core: f64,
    /// The radius at which the first ring begins, in m.
    pub(crate) begin: f64,
    /// The load of the rings as a share of the normal force that the springs of the run carry.
    pub(crate) share: f64,
}

/// A table at the indentation depth d.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PressedTable {
    table: Arc<TableShape>,
    /// The contact radius a₀, in units of the last radius of the table.
    radius: f64,
    /// The indentation depth d₀, in units of the greatest height of the table.
    depth: f64,
    /// The last radius of the table, in a₀.
    pub(crate) extent: f64,
}

impl PressedTable {
    /// The table at the indentation depth `depth` (in m), and a₀ in m. `None` if the table ends
    /// inside the contact. If `endless` is true, the image is linear beyond the table.
    pub(crate) fn new(table: &Arc<TableShape>, depth: f64, endless: bool) -> Option<(f64, Self)> {
        let depth = depth / table.height;
        let radius = table.image_inverse(depth);
        let extent = if endless { f64::INFINITY } else { table.end() / radius };
        let pressed = Self { table: Arc::clone(table), radius, depth, extent };
        (extent > 1.0).then_some((radius * table.length, pressed))
    }

    pub(crate) fn geometry(&self) -> Geometry {
        self.table.geometry
    }

    pub(crate) fn pieces(&self) -> usize {
        self.table.cells.len()
    }

    /// The rings around the unworn contact, if they carry a noticeable load.
    pub(crate) fn split(&self) -> Option<Split> {
        if self.table.geometry == Geometry::Line {
            return None;
        }
        let (core, begin, load) = self.table.true_image.rings(self.depth)?;
        let share = load / (self.radius * self.depth * self.half_force());
        let length = self.table.length;
        let split = Split { core: core * length, begin: begin * length, share };
        (share > NEGLECTED).then_some(split)
    }

    /// The image outside the unworn contact, without the changes that make it increase.
    pub(crate) fn falls(&self) -> Falls {
        self.table.true_image.falls(self.radius, self.depth)
    }

    pub(crate) fn profile(&self, r: f64) -> f64 {
        self.inverse_outside(0.0, r)
    }

    pub(crate) fn slope(&self, r: f64) -> f64 {
        self.table.slope(r * self.radius) * self.radius / self.depth
    }

    pub(crate) fn image(&self, x: f64) -> f64 {
        self.table.image(x * self.radius) / self.depth
    }

    pub(crate) fn image_slope(&self, x: f64) -> f64 {
        self.table.image_slope(x * self.radius) * self.radius / self.depth
    }

    pub(crate) fn image_rise(&self, c: f64, delta: f64) -> f64 {
        self.table.image_rise(c * self.radius, delta * self.radius) / self.depth
    }

    pub(crate) fn image_inverse(&self, value: f64) -> f64 {
        self.table.image_inverse(value * self.depth) / self.radius
    }

    pub(crate) fn area(&self, x: f64) -> f64 {
        self.table.area(x * self.radius) / (self.radius * self.depth)
    }

    pub(crate) fn half_force(&self) -> f64 {
        1.0 - self.area(1.0)
    }

    pub(crate) fn inverse_outside(&self, c: f64, r: f64) -> f64 {
        self.table.inverse_outside(c * self.radius, r * self.radius) / self.depth
    }

    pub(crate) fn pressure_inside(&self, r: f64, end: f64) -> f64 {
        let pressure = self.table.pressure_inside(r * self.radius, end * self.radius);
        pressure * self.radius / self.depth
    }

    /// The image of straight lines between the smoothed points.
    pub(crate) fn straight_image(&self, x: f64) -> f64 {
        let knots: Vec<f64> = self.table.points.iter().map(|point| point[0]).collect();
        let image = image_at(self.geometry());
        image(&knots, &self.table.bends, x * self.radius).0 / self.depth
    }

    /// The number of points between two radii, the radii of the points on either side, and the noise that remains
    /// there.
    pub(crate) fn points_about(&self, from: f64, to: f64) -> (usize, [f64; 2], f64) {
        let points = &self.table.points;
        let beyond = |r: f64| points.partition_point(|point| point[0] <= r * self.radius);
        let (first, last) = (beyond(from), beyond(to).min(points.len() - 1));
        let about = &points[first.saturating_sub(1)..=last];
        let noise = about.iter().map(|point| point[1]).sum::<f64>() / about.len() as f64;
        let between = [about[0], about[about.len() - 1]].map(|point| point[0] / self.radius);
        (last - first, between, noise / self.depth)
    }

    /// The largest pressure. It is found by a search in steps.
    pub(crate) fn peak_pressure(&self) -> f64 {
        const STEP: f64 = 1.0 / 64.0;
        let at = |r: f64| self.pressure_inside(r, 1.0);
        let (highest, radius) = (0..64)
            .map(|k| (at(f64::from(k) * STEP), f64::from(k) * STEP))
            .fold((0.0, 0.0), |best, here| if here.0 > best.0 { here } else { best });
        let about = maximum((radius - STEP).max(0.0), radius + STEP, at);
        at(about).max(highest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    /// Unevenly spaced points of a profile between 0 and 2.
    fn table(count: u32, f: impl Fn(f64) -> f64) -> TableShape {
        let radius: Vec<f64> = (0..=count)
            .map(|i| {
                let u = f64::from(i) / f64::from(count);
                2.0 * (u + 0.3 / f64::from(count) * libm::sin(40.0 * u) * (1.0 - u))
            })
            .collect();
        let height: Vec<f64> = radius.iter().map(|r| f(*r)).collect();
        TableShape::through(&radius, &height, Geometry::Round).expect("no point below the axis")
    }

    /// The midpoint rule on 400 000 cells, graded towards the end.
    fn fine(f: impl Fn(f64) -> f64) -> f64 {
        let cells = 400_000;
        let sum: f64 = (0..cells)
            .map(|i| {
                let s = (f64::from(i) + 0.5) / f64::from(cells);
                f(1.0 - s * s) * 2.0 * s
            })
            .sum();
        sum / f64::from(cells)
    }

    #[test]
    fn images_of_sampled_shapes_agree_with_the_closed_forms() {
        // x, g and f are in units of the table: the length 2 and the height at that radius.
        for x in [0.01, 0.1, 0.33, 0.8, 0.999] {
            let ball = table(200, |r| 0.5 * r * r);
            assert!((ball.image(x) - 2.0 * x * x).abs() < 1e-8, "{}", ball.image(x));
            assert!((ball.inverse_outside(0.0, x) - x * x).abs() < 1e-8);
            assert!((ball.slope(x) - 2.0 * x).abs() < 1e-6);
            let cone = table(200, |r| r);
            let tolerance = if x < 0.02 { 1e-2 } else { 1e-4 };
            assert!((cone.image(x) - FRAC_PI_2 * x).abs() < tolerance);
            assert!((cone.inverse_outside(0.0, x) - x).abs() < tolerance);
        }
    }

    #[test]
    fn line_images_of_sampled_shapes_agree_with_the_closed_forms() {
        let line = |count: u32, f: &dyn Fn(f64) -> f64| {
            let radius: Vec<f64> =
                (0..=count).map(|i| 2.0 * f64::from(i) / f64::from(count)).collect();
            let height: Vec<f64> = radius.iter().map(|r| f(*r)).collect();
            let shape = TableShape::through(&radius, &height, Geometry::Line);
            Arc::new(shape.expect("no point below the middle"))
        };
        // x²/2 with the image πs²/4, pressed to the half-width 1.2; a wedge with the image s.
        let cylinder = line(200, &|x| 0.5 * x * x);
        let (half_width, pressed) =
            PressedTable::new(&cylinder, 0.36 * PI, false).expect("a table");
        assert!((half_width - 1.2).abs() < 1e-7, "{half_width}");
        let closed = crate::contact::profile::Shape::line_power(2.0);
        for x in [0.05, 0.3, 0.9, 1.3] {
            for (found, known) in [
                (pressed.image(x), closed.image(x)),
                (pressed.profile(x), closed.profile(x)),
                (pressed.slope(x), closed.slope(x)),
                (pressed.pressure_inside(x, 1.5), closed.pressure_inside(x, 1.5)),
            ] {
                assert!((found - known).abs() < 2e-6, "{x}: {found} {known}");
            }
            let (c, r) = (0.4, 0.41 + 0.9 * x);
            let chord = ((r - c) * (r + c)).sqrt();
            let known = closed.inverse_outside(c, r, chord, libm::acos(c / r));
            let found = pressed.inverse_outside(c, r);
            assert!((found - known).abs() < 1e-6, "{r}: {found} {known}");
        }
        let wedge = line(200, &|x| x);
        assert!((wedge.image(0.5) - 0.5).abs() < 1e-4, "{}", wedge.image(0.5));
    }

    #[test]
    fn transforms_of_a_table_agree_with_a_midpoint_sum_of_its_image() {
        let flat = |r: f64| (r - 0.7).max(0.0) * (r + 0.1);
        for shape in [table(7, flat), table(300, flat), table(60, |r| r * r * r)] {
            for (c, r) in [(0.0_f64, 0.8_f64), (0.001, 0.3), (0.2, 0.95), (0.5, 0.501)] {
                let angle = libm::acos(c / r);
                let sum =
                    FRAC_2_PI * angle * fine(|t| shape.image(r * libm::cos(angle * (1.0 - t))));
                let value = shape.inverse_outside(c, r);
                assert!((value - sum).abs() < 1e-9, "{c} {r}: {value} {sum}");
                if c > 0.0 {
                    let limit = libm::acosh(r / c);
                    let sum = limit / PI * fine(|t| shape.image_slope(c * libm::cosh(limit * t)));
                    let value = shape.pressure_inside(c, r);
                    assert!((value - sum).abs() < 1e-7, "p {c} {r}: {value} {sum}");
                }
                let rise = shape.image(r) - shape.image(c);
                assert!((shape.image_rise(c, r - c) - rise).abs() < 1e-13);
                let sum = r * fine(|t| shape.image(r * t));
                assert!((shape.area(r) - sum).abs() < 1e-9, "{} {sum}", shape.area(r));
                let step = 1e-6;
                let change =
                    shape.inverse_outside(0.0, r + step) - shape.inverse_outside(0.0, r - step);
                assert!(
                    (shape.slope(r) - 0.5 * change / step).abs() < 1e-5 * (1.0 + shape.slope(r))
                );
            }
            for value in [0.01, 0.3, 0.9] {
                assert!((shape.image(shape.image_inverse(value)) - value).abs() < 1e-13);
            }
            // The pressure on the axis and next to the axis must be equal.
            let (axis, beside) =
                (shape.pressure_inside(0.0, 0.9), shape.pressure_inside(1e-7, 0.9));
            assert!((axis - beside).abs() < 1e-6 * (1.0 + axis), "{axis} {beside}");
        }
    }

    #[test]
    fn the_depth_of_a_force_gives_the_same_force_inside_and_beyond_the_table() {
        let shape = Arc::new(table(100, |r| 0.5 * r * r));
        for force in [1e-6, 0.1, 3.0, 8.0] {
            let depth = shape.depth_under(force);
            // The depth by the formula of Hertz, with R = 1.
            let hertz = libm::pow(0.75 * force, 2.0 / 3.0);
            assert!((depth / hertz - 1.0).abs() < 1e-4, "{depth} {hertz}");
            let (radius, pressed) = PressedTable::new(&shape, depth, true).expect("endless");
            let again = 2.0 * radius * depth * pressed.half_force();
            assert!((again / force - 1.0).abs() < 1e-9, "{again} {force}");
            assert_eq!(PressedTable::new(&shape, depth, false).is_some(), depth < 4.0);
        }
        assert!(shape.depth_under(20.0) > 4.0);
    }

    #[test]
    fn a_decrease_far_out_does_not_change_the_increasing_part() {
        // A parabola up to row 10, then a decrease to the initial height.
        let r: Vec<f64> = (0..=40).map(f64::from).collect();
        let top = 100.0;
        let z = |r: f64| if r <= 10.0 { r * r } else { (top - 0.1 * top * (r - 10.0)).max(0.0) };
        let z: Vec<f64> = r.iter().map(|r| z(*r)).collect();
        let table = TableShape::through(&r, &z, Geometry::Round).expect("no point below the axis");
        assert!(table.reach() > 8.0, "{}", table.reach());
    }
}
