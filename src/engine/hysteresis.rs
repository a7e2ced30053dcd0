//! Force–displacement loops of one cycle, and the criteria of the sliding transition.
//!
//! # Equations
//! In units of a₀, d₀ and E*a₀d₀; the backbone is what a first loading follows, the branches of a loop
//! follow by Masing's rule:
//! ```text
//! Q̃(u)/2 = ∫ min(u, y) dx                                     backbone, 0 ≤ u ≤ Δ
//! Q̃ = Q̃(Δ) − 2 Q̃((Δ − u)/2)                                  unloading; loading is its mirror image
//! A = W/(4QU),  D = δ₀/U,  B = W/(4Qδ₀),  δ₀ where the unloading branch meets Q = 0
//! ```
//!
//! # Sources
//! G. Masing (1926); the criteria: S. Fouvry, P. Kapsa, L. Vincent, *Wear* 185 (1995) 35.

use std::sync::OnceLock;

use super::contact::ROW_POINTS;
use super::numeric::{Gauss, dot, root};

/// Points of a loop: a cycle of harmonic motion at 128 even phases, its first point again at the end.
pub const LOOP_POINTS: usize = 129;
const BRANCH: usize = LOOP_POINTS / 2;

/// A loop, beginning and ending where the motion turns back at +Δ.
#[derive(Debug, Clone, PartialEq)]
pub struct Loop {
    /// u at even phases of the motion, in units of d₀ as Δ is.
    pub displacement: Vec<f64>,
    /// Q̃/2.
    pub force: Vec<f64>,
    /// A, the energy ratio.
    pub energy_ratio: f64,
    /// D, the slip ratio.
    pub slip_ratio: f64,
    /// B, the system-free ratio; 0 once the loop has closed.
    pub free_ratio: f64,
}

/// The force that a first loading builds up: Q̃(u)/2 at ascending u, with its slope.
#[derive(Debug, Clone, PartialEq)]
pub struct Backbone {
    knots: Vec<[f64; 3]>,
    loss: f64,
}

impl Backbone {
    /// Of springs that stick inside `stick` and slip at the Gauss points of a
    /// [`Row`](super::contact::Row), with the weights of ∫ dx there.
    #[must_use]
    pub fn of_row(
        (stick, threshold): (f64, f64),
        positions: &[f64; ROW_POINTS],
        weights: &[f64; ROW_POINTS],
        compressions: &[f64; ROW_POINTS],
        loss: f64,
    ) -> Self {
        let rests = rests();
        let loads: [f64; ROW_POINTS] = std::array::from_fn(|k| weights[k] * compressions[k]);
        let mut knots = Vec::with_capacity(ROW_POINTS + 2);
        knots.push([0.0, 0.0, 1.0]);
        for k in (0..ROW_POINTS).rev() {
            let (x, y) = (positions[k], compressions[k]);
            // ∫ min(y, u) dx for u = y(x): all within x carry u, the others what they have.
            knots.push([y, y * x + dot(&rests[k], &loads), x]);
        }
        knots.push([threshold, threshold * stick + loads.iter().sum::<f64>(), stick]);
        Self { knots, loss }
    }

    /// Of cells of constant y, and a core of radius `start` that sticks; `loss` is ∫ y ω dx if it is known
    /// better than by these.
    #[must_use]
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
        let mut cells: Vec<(f64, f64)> =
            compressions.iter().zip(widths).map(|(y, width)| (*y, *width)).collect();
        cells.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut slope = start + widths[..compressions.len()].iter().sum::<f64>();
        let (mut at, mut force) = (0.0, 0.0);
        let mut knots = vec![[0.0, 0.0, slope]];
        let all = cells.len();
        for (i, (y, width)) in cells.into_iter().enumerate() {
            if y >= threshold {
                break;
            }
            force += slope * (y - at);
            at = y;
            // The spring in the middle of the cell gives way at its mean.
            knots.push([at, force, slope - 0.5 * width]);
            // Exactly the core's in the end: times a very large Δ what rounding leaves would be a force.
            slope = if i + 1 == all { start } else { slope - width };
        }
        force += slope * (threshold - at);
        knots.push([threshold, force, slope]);
        Self { knots, loss }
    }

    /// Q̃(u)/2 by cubic interpolation, between a knot and the one before it.
    fn between(&self, u: f64, above: usize) -> f64 {
        let ([low, from, slope_from], [high, to, slope_to]) =
            (self.knots[above - 1], self.knots[above]);
        let width = high - low;
        if width <= 0.0 {
            return to;
        }
        let (t, s) = ((u - low) / width, (high - u) / width);
        s * s * (1.0 + 2.0 * t) * from
            + t * t * (1.0 + 2.0 * s) * to
            + width * t * s * (s * slope_from - t * slope_to)
    }

    /// The first knot at or beyond u, from a knot before it on.
    fn above(&self, u: f64, from: usize) -> usize {
        let last = self.knots.len() - 1;
        let ahead = self.knots[from..last].iter().take_while(|[knot, ..]| *knot <= u).count();
        (from + ahead).max(1)
    }

    /// The loop between −Δ and Δ.
    #[must_use]
    pub fn wind(&self) -> Loop {
        let [threshold, most, _] = self.knots[self.knots.len() - 1];
        if threshold == 0.0 {
            // At rest.
            let still = vec![0.0; LOOP_POINTS];
            let (energy_ratio, slip_ratio, free_ratio) = (0.0, 0.0, 0.0);
            let displacement = still.clone();
            return Loop { displacement, force: still, energy_ratio, slip_ratio, free_ratio };
        }
        let displacement: Vec<f64> = phases().iter().map(|phase| threshold * phase).collect();
        let mut force = Vec::with_capacity(LOOP_POINTS);
        let (mut above, mut crossing) = (1, 1);
        for u in &displacement[..=BRANCH] {
            let v = 0.5 * (threshold - u);
            above = self.above(v, above);
            force.push(most - 2.0 * self.between(v, above));
            crossing = if force[force.len() - 1] > 0.0 { above } else { crossing };
        }
        force.extend_from_within(1..=BRANCH);
        for force in &mut force[BRANCH + 1..] {
            *force = -*force;
        }
        // The unloading branch meets zero where the backbone has half of the force.
        let positive = force.iter().take_while(|force| **force > 0.0).count().clamp(1, BRANCH);
        let at = |k: usize| 0.5 * (threshold - displacement[k]);
        let half = root(at(positive - 1), at(positive), |v| {
            self.between(v, self.above(v, crossing)) - 0.5 * most
        });
        let aperture = (threshold - 2.0 * half).max(0.0);
        // W = 4·2 ∫ y ω dx·Δ in the units of 2·(Q̃/2)·u.
        let lost = 4.0 * self.loss * threshold;
        let slip_ratio = aperture / threshold;
        let energy_ratio = lost / (4.0 * most * threshold);
        let free_ratio = if slip_ratio > 1e-9 { energy_ratio / slip_ratio } else { 0.0 };
        Loop { displacement, force, energy_ratio, slip_ratio, free_ratio }
    }
}

/// The cosines of the phases of a cycle.
fn phases() -> &'static [f64; LOOP_POINTS] {
    static PHASES: OnceLock<[f64; LOOP_POINTS]> = OnceLock::new();
    PHASES.get_or_init(|| {
        std::array::from_fn(|k| libm::cos(std::f64::consts::PI * k as f64 / BRANCH as f64))
    })
}

/// Row k gives ∫ f ds from the k-th Gauss point to 1 for products of f with the Gauss weights: the
/// Legendre series of f, integrated term by term.
fn rests() -> &'static [[f64; ROW_POINTS]] {
    static RESTS: OnceLock<Vec<[f64; ROW_POINTS]>> = OnceLock::new();
    RESTS.get_or_init(|| {
        let rule = Gauss::<ROW_POINTS>::new();
        // P₀ … P_N at each point.
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
    use std::f64::consts::PI;

    use crate::engine::contact::{Contact, Decay, Row, UnwornSums};
    use crate::engine::profile::Shape;

    /// ∮ Q̃/2 du over even phases of the motion.
    fn sampled(found: &Loop) -> f64 {
        let step = 2.0 * PI / (LOOP_POINTS - 1) as f64;
        let rates = (0..LOOP_POINTS - 1).map(|k| found.force[k] * libm::sin(step * k as f64));
        step * found.displacement[0] * rates.sum::<f64>().abs()
    }

    #[test]
    fn the_area_of_a_loop_is_the_energy_lost() {
        for (shape, threshold, most) in [
            (Shape::power(2.0), 0.75, 1e-6),
            (Shape::power(1.0), 0.3, 1e-6),
            (Shape::power(4.0), 0.9, 1e-6),
            (Shape::sphere(2.0), 0.5, 1e-6),
            // At gross slip the loop has corners, which samples miss.
            (Shape::power(2.0), 1.0, 1e-4),
            (Shape::power(2.0), 3.0, 1e-4),
        ] {
            let row = Row::new(&Contact::new(shape, threshold).expect("a limit"));
            for exponent in [0.0, 0.3, 2.0, 8.0] {
                let (sums, compressions) = row.sums_and_compressions(Decay::after(exponent));
                let lost = 4.0 * sums.energy;
                // The area is a difference: of a narrow loop it knows fewer digits.
                let whole = 4.0 * sums.tangential * threshold;
                let scale = if exponent <= 0.3 { lost } else { whole };
                let found = row.backbone(&sums, &compressions).wind();
                let error = (sampled(&found) - lost) / scale;
                assert!(error.abs() < most, "{threshold} {exponent}: {error}");
            }
        }
    }

    #[test]
    fn the_sliding_transition_of_hertz_and_mindlin_has_its_three_ratios() {
        let sums = UnwornSums::of(&Contact::new(Shape::power(2.0), 1.0).expect("a limit"), None);
        let found = sums.backbone.wind();
        let slip = 2.0 * libm::pow(2.0, -2.0 / 3.0) - 1.0;
        assert!((found.energy_ratio - 0.2).abs() < 1e-9, "{}", found.energy_ratio);
        assert!((found.slip_ratio - slip).abs() < 1e-6, "{}", found.slip_ratio);
        assert!((found.free_ratio - 0.2 / slip).abs() < 1e-5, "{}", found.free_ratio);
    }
}
