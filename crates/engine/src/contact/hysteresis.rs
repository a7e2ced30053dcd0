//! Force–displacement loops of one cycle, and the three criteria of the sliding transition.
//!
//! # Equations
//! Units: a₀, d₀ and E*a₀d₀. The backbone is the curve of the first loading. Masing's rule gives
//! the branches of the loop:
//! ```text
//! Q̃(u)/2 = ∫ min(u, y) dx                                     backbone, 0 ≤ u ≤ Δ
//! Q̃ = Q̃(Δ) − 2 Q̃((Δ − u)/2)                                  unloading; loading is its mirror image
//! A = W/(4QU),  D = δ₀/U,  B = W/(4Qδ₀); the unloading branch crosses Q = 0 at δ₀
//! ```
//!
//! In a line contact all springs carry the same force, in series, so the backbone is U(Q):
//! ```text
//! u(θ) = θ·C + Σ K (θ − y)₊,  Q/(μF) = θ;  beyond θ = 1 the middle slips
//! ```
//!
//! The loop uses the same springs as the energy sum. Its points are its corners: the displacements
//! at which a spring starts to slip. Straight lines between the points therefore enclose the area
//! W of this loop. For a displacement record, it is the largest loop. In a line contact whose stroke is measured at the
//! distance L, the area exceeds W: seen from there, the slip of a spring at x counts 1/√(1 − x²/L²) times.
//!
//! # Accuracy
//! The area is accurate to 1e-6 of W. When the loop has almost closed, rounding limits the accuracy
//! to 1e-15 of 4QU. The corners lie within 1e-3 of Q of the smooth curve of an unworn contact,
//! because there are only 48 springs. D is computed from the smooth curve.
//!
//! # Sources
//! G. Masing (1926); the criteria: S. Fouvry, P. Kapsa, L. Vincent, *Wear* 185 (1995) 35.

use std::sync::OnceLock;

use crate::numeric::{Gauss, dot, root};

/// Number of Gauss points in a row of springs.
pub const ROW_POINTS: usize = 48;
/// A smaller relative difference of energies is rounding.
const ROUNDED: f64 = 1e-6;

/// A closed loop that starts and ends at the reversal at +Δ. There is one point for each spring
/// that starts to slip, and one without force on each branch; the lines between the points are straight.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Loop {
    /// Displacement u, in the same unit as Δ (d₀). NaN, as A and D, in a line contact without a reference.
    pub displacement: Vec<f64>,
    /// Half of the tangential force, Q̃/2.
    pub force: Vec<f64>,
    /// A, the energy ratio.
    pub energy_ratio: f64,
    /// D, the slip ratio.
    pub slip_ratio: f64,
    /// B, the system-free ratio. It is 0 after the loop has closed.
    pub free_ratio: f64,
}

/// The tangential force during the first loading, as a function of the displacement.
#[derive(Debug, Clone, PartialEq)]
pub struct Backbone {
    /// u and Q̃/2 at each displacement where a spring starts to slip, in ascending order from 0 to
    /// Δ.
    corners: Vec<[f64; 2]>,
    /// The displacement u at which the force reaches half of its maximum.
    half: f64,
    /// The area of the loop, ∮ Q̃/2 du: 4 ∫ y (Δ − y)₊ dx, or half of it in a line contact.
    lost: f64,
    /// Whether the displacement is defined. In a line contact without a reference only the width of the loop is.
    is_placed: bool,
}

impl Backbone {
    /// Maximum number of points of a loop of `springs` springs.
    pub(crate) fn points(springs: usize) -> usize {
        2 * (springs + 2) + 1
    }

    /// The backbone of springs that stick inside `stick` and slip at the Gauss points of a row.
    /// `weights` are the weights of ∫ dx at these points.
    pub(crate) fn of_row(
        (stick, threshold): (f64, f64),
        positions: &[f64; ROW_POINTS],
        weights: &[f64; ROW_POINTS],
        compressions: &[f64; ROW_POINTS],
        loss: f64,
    ) -> Self {
        let mut backbone = Self::of_cells(stick, threshold, compressions, weights, Some(loss));
        let [_, most] = backbone.last();
        let loads: [f64; ROW_POINTS] = std::array::from_fn(|k| weights[k] * compressions[k]);
        // Knots of [u, ∫ min(y, u) dx, slope], from the last one (Δ) to the first one (u = 0). If u
        // = y(x), all springs inside x carry u and the others carry their own y. The knots are as
        // accurate as the sums over the row. The corners are less accurate, because there are only
        // 48 springs.
        let knot = |k: usize| match k {
            0 => [threshold, most, stick],
            1..=ROW_POINTS => {
                let (x, y) = (positions[k - 1], compressions[k - 1]);
                [y, y * x + dot(&rests()[k - 1], &loads), x]
            }
            _ => [0.0, 0.0, 1.0],
        };
        // Find the interval of knots with half of the force, starting from the interval that the
        // corners suggest.
        let middle = 0.5 * most;
        let mut below = 1 + compressions.iter().filter(|y| **y > backbone.half).count();
        let (mut low, mut high) = (knot(below), knot(below - 1));
        while low[1] > middle && below <= ROW_POINTS {
            below += 1;
            (low, high) = (knot(below), low);
        }
        while high[1] < middle && below > 1 {
            below -= 1;
            (low, high) = (high, knot(below - 1));
        }
        if high[0] > low[0] {
            backbone.half = root(low[0], high[0], |u| between(low, high, u) - middle);
        }
        backbone
    }

    /// The backbone of cells of constant y around a core of radius `start` that sticks. `loss` is ∫
    /// y ω dx if a more accurate value is known.
    pub fn of_cells(
        start: f64,
        threshold: f64,
        compressions: &[f64],
        widths: &[f64],
        loss: Option<f64>,
    ) -> Self {
        let loss = loss.unwrap_or_else(|| {
            let springs = compressions.iter().zip(widths);
            springs.map(|(y, width)| width * y * (1.0 - y / threshold).max(0.0)).sum()
        });
        // At first, each corner holds y and width of a spring. Usually y decreases outwards, so the reversed order is
        // nearly sorted.
        let mut corners = Vec::with_capacity(compressions.len() + 2);
        corners.push([0.0, 0.0]);
        corners.extend(compressions.iter().zip(widths).rev().map(|(y, width)| [*y, *width]));
        corners.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let slipping = corners.partition_point(|[y, _]| *y < threshold).max(1);
        let mut slope = start + corners[slipping..].iter().map(|[_, width]| width).sum::<f64>();
        corners.truncate(slipping);
        // Replace the width of each spring by the total width of the springs with a larger y. The sum starts with the
        // largest y. There the width can be 0, and a difference would leave a rounding error.
        for [_, width] in corners[1..].iter_mut().rev() {
            let all = slope + *width;
            *width = std::mem::replace(&mut slope, all);
        }
        let (mut at, mut force) = (0.0, 0.0);
        for [y, stuck] in &mut corners[1..] {
            force += slope * (*y - at);
            at = *y;
            slope = std::mem::replace(stuck, force);
        }
        force += slope * (threshold - at);
        corners.push([threshold, force]);
        let lost = 4.0 * loss * threshold;
        // Where the stick edge lies inside a cell, the energy of this cell differs from that of its corner.
        let missing = lost - area(&corners);
        if missing.abs() > ROUNDED * lost
            && let [.., before, corner, end] = &mut corners[..]
        {
            corner[1] += 0.25 * missing / (end[0] - before[0]);
        }
        let half = Self::at_half(&corners);
        Self { corners, half, lost, is_placed: true }
    }

    /// The backbone of a line contact: K and y of each spring, C with the springs outside the contact, θ, and the slip of
    /// the middle. `outside` is `None` without a reference. `loss` is ∫ y ω dx/x.
    pub(crate) fn in_series(
        springs: impl Iterator<Item = (f64, f64)>,
        outside: Option<f64>,
        (threshold, middle): (f64, f64),
        loss: f64,
    ) -> Self {
        let mut slipping: Vec<(f64, f64)> = springs.filter(|(_, y)| *y < threshold).collect();
        slipping.sort_by(|a, b| a.1.total_cmp(&b.1));
        let (mut at, mut u, mut slope) = (0.0, 0.0, outside.unwrap_or(0.0));
        let mut corners = Vec::with_capacity(slipping.len() + 3);
        corners.push([0.0, 0.0]);
        for (yields, y) in slipping {
            u += slope * (y - at);
            at = y;
            slope += yields;
            corners.push([u, 0.5 * at]);
        }
        u += slope * (threshold - at);
        corners.push([u, 0.5 * threshold]);
        if middle > 0.0 {
            corners.push([u + middle, 0.5 * threshold]);
        }
        let half = Self::at_half(&corners);
        Self { corners, half, lost: 2.0 * loss * threshold, is_placed: outside.is_some() }
    }

    /// The displacement at which the force reaches half of its maximum.
    fn at_half(corners: &[[f64; 2]]) -> f64 {
        let force = corners[corners.len() - 1][1];
        let above = corners.iter().take_while(|[_, reached]| *reached < 0.5 * force).count();
        match corners[above.saturating_sub(1)..].first_chunk() {
            Some([[low, from], [high, to]]) if to > from => {
                low + (high - low) * (0.5 * force - from) / (to - from)
            }
            _ => 0.0,
        }
    }

    /// Δ and the force at Δ.
    fn last(&self) -> [f64; 2] {
        self.corners[self.corners.len() - 1]
    }

    /// The loop between −Δ and Δ.
    pub fn wind(&self) -> Loop {
        self.wind_along(&self.with_half(Self::at_half(&self.corners)))
    }

    /// The same loop with this aperture to all digits. Another corner is moved so that its area remains W.
    pub(crate) fn wind_to(&self, aperture: f64) -> Loop {
        let [displacement, most] = self.last();
        let mut corners = self.with_half(0.5 * (displacement - aperture));
        let missing = self.lost - area(&corners);
        // The last corner before gross slip, but not the point without force.
        let is_free = |corner: &[f64; 2]| ![0.0, 0.5 * most, most].contains(&corner[1]);
        if let Some(place) = corners.iter().rposition(is_free)
            && let Some([before, corner, after]) = corners[place - 1..].first_chunk_mut()
        {
            corner[1] += 0.25 * missing / (after[0] - before[0]);
        }
        self.wind_along(&corners)
    }

    /// The corners, and the point at the displacement `half`, where the force is half of its maximum.
    fn with_half(&self, half: f64) -> Vec<[f64; 2]> {
        let most = self.last()[1];
        let mut corners = self.corners.clone();
        let middle = corners.partition_point(|corner| corner[1] < 0.5 * most);
        corners.insert(middle, [half, 0.5 * most]);
        corners
    }

    fn wind_along(&self, corners: &[[f64; 2]]) -> Loop {
        let [threshold, most] = self.last();
        let cycle = |of: usize| -> Vec<f64> {
            let most = self.last()[of];
            let mut points = Vec::with_capacity(2 * corners.len() - 1);
            points.extend(corners.iter().map(|corner| most - 2.0 * corner[of]));
            points.extend(corners[1..].iter().map(|corner| 2.0 * corner[of] - most));
            points
        };
        let found = Loop { displacement: cycle(0), force: cycle(1), ..Loop::default() };
        if threshold == 0.0 {
            // The contact is at rest, so the loop is a point.
            return found;
        }
        // The unloading branch crosses zero where the backbone has half of the maximum force.
        let aperture = (threshold - 2.0 * self.half).max(0.0);
        let slip_ratio = aperture / threshold;
        // Without force the ratio is set to its limit for small forces: then all springs slip over the whole motion.
        let energy_ratio = if most == 0.0 { 1.0 } else { self.lost / (4.0 * most * threshold) };
        let free_ratio = if slip_ratio > 1e-9 { energy_ratio / slip_ratio } else { 0.0 };
        if self.is_placed {
            return Loop { energy_ratio, slip_ratio, free_ratio, ..found };
        }
        let displacement = vec![f64::NAN; found.displacement.len()];
        let (energy_ratio, slip_ratio) = (f64::NAN, f64::NAN);
        Loop { displacement, energy_ratio, slip_ratio, free_ratio, ..found }
    }
}

/// The area of the loop of a backbone.
fn area(corners: &[[f64; 2]]) -> f64 {
    let below =
        corners.windows(2).map(|ends| (ends[1][0] - ends[0][0]) * (ends[0][1] + ends[1][1]));
    4.0 * (below.sum::<f64>() - corners.last().map_or(0.0, |[u, force]| u * force))
}

/// Cubic Hermite interpolation between two knots [u, Q̃/2, slope].
fn between(low: [f64; 3], high: [f64; 3], u: f64) -> f64 {
    let ([low, from, slope_from], [high, to, slope_to]) = (low, high);
    let width = high - low;
    let (t, s) = ((u - low) / width, (high - u) / width);
    s * s * (1.0 + 2.0 * t) * from
        + t * t * (1.0 + 2.0 * s) * to
        + width * t * s * (s * slope_from - t * slope_to)
}

/// Row k contains factors for ∫ f ds from the k-th Gauss point to 1. They multiply the products of
/// f and the Gauss weights. The Legendre series of f is integrated term by term.
fn rests() -> &'static [[f64; ROW_POINTS]] {
    static RESTS: OnceLock<Vec<[f64; ROW_POINTS]>> = OnceLock::new();
    RESTS.get_or_init(|| {
        let rule = Gauss::<ROW_POINTS>::new();
        // P₀ … P_N at each Gauss point.
        let series = rule.nodes.map(|s| {
            let z = 2.0 * s - 1.0;
            let mut p = [1.0; ROW_POINTS + 1];
            p[1] = z;
            for n in 2..=ROW_POINTS {
                let k = n as f64;
                p[n] = ((2.0 * k - 1.0) * z * p[n - 1] - (k - 1.0) * p[n - 2]) / k;
            }
            p
        });
        series
            .iter()
            .map(|here| {
                series.each_ref().map(|there| {
                    let sum: f64 =
                        (1..ROW_POINTS).map(|n| there[n] * (here[n - 1] - here[n + 1])).sum();
                    0.5 * (1.0 - here[1] + sum)
                })
            })
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loop_with_a_given_aperture_has_points_without_force_also_if_few_springs_slip() {
        // The second spring takes the force from less than half of the maximum to the maximum.
        let backbone = Backbone::of_cells(0.0, 1e4, &[1.0, 10.0], &[0.2, 0.8], Some(8.1));
        let wound = backbone.wind_to(9990.0);
        let points = wound.displacement.iter().zip(&wound.force);
        let without: Vec<_> = points.filter(|(_, force)| **force == 0.0).collect();
        assert_eq!(without, [(&9990.0, &0.0), (&-9990.0, &0.0)]);
        let lines = wound.displacement.windows(2).zip(wound.force.windows(2));
        let area: f64 = lines.map(|(u, q)| 0.5 * (u[1] - u[0]) * (q[0] + q[1])).sum();
        assert!((area / (4.0 * 8.1 * 1e4) - 1.0).abs() < 1e-12, "{area}");
    }
}
