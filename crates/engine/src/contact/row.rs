//! Normal contact and friction of a worn profile, on the row of springs: (5)–(10), (15), (16).
//!
//! A spring at x is compressed by y = max(0, d − g). The spring sticks while its tangential force
//! is below μ times its normal force, that is where y ≥ Δ = G*U/(μE*). Otherwise it slips over a
//! path of 4U·ω per cycle, with ω = 1 − y/Δ. This is (15), (16) summed over one steady cycle.
//!
//! # Equations
//! ```text
//! F = 2E* ∫₀ᵃ y dx                                                    (9)
//! y(c) = Δ                                                            (10)
//! Q = 2 ∫₀ᵃ min(G*U, μE*y) dx                     amplitude of the tangential force
//! W = 8μE* ∫₀ᵃ y·(U − (μE*/G*) y)₊ dx             energy lost per cycle
//! ```
//! All integrals in this module are in units of a₀ and d₀ and cover half of the row.
//!
//! # Accuracy
//! [`SpringRow`] integrates over the worn part with 48 Gauss points. They are graded with the
//! fourth power towards the stick edge, where the image forms a step. In partial slip and in clear
//! gross slip the error is 1e-9 of the unworn values (tests compare). Just above the gross-slip
//! threshold it is larger for blunt profiles: 1e-6 for exponent 8, 1e-4 for 20.

use std::sync::OnceLock;

use super::hysteresis::{Backbone, ROW_POINTS};
use super::{Contact, Decay, Geometry, Shape};
use crate::numeric::{Gauss, integrate};

/// Sums over the springs of an unworn contact, for half of the row.
#[derive(Debug, Clone)]
pub struct UnwornSums {
    /// Half of the normal force, ∫₀ᵃ y dx.
    pub normal: f64,
    /// Half of the amplitude of the tangential force, ∫₀ᵃ min(Δ, y) dx.
    pub tangential: f64,
    /// The energy integral ∫₀ᵃ y ω dx.
    pub loss: f64,
    /// The backbone of the force–displacement loop.
    pub backbone: Backbone,
}

impl UnwornSums {
    /// Sums over the unworn springs. `slip` gives ω as a function of y/Δ if the motion is not
    /// harmonic.
    pub fn of(contact: &Contact, slip: Option<&dyn Fn(f64) -> f64>) -> Self {
        if contact.shape.geometry() == Geometry::Line {
            return Self::in_series(contact, 0.0);
        }
        let row = SpringRow::new(contact);
        let (sums, compressions) = row.sums_and_compressions(Decay::UNWORN);
        let harmonic = sums.energy / contact.threshold;
        // With a record, ω has many corners: use many short intervals instead of one long interval.
        let loss = slip.map_or(harmonic, |slip| {
            let width = (1.0 - contact.stick) / RECORD_INTERVALS as f64;
            (0..RECORD_INTERVALS)
                .map(|i| {
                    let from = contact.stick + width * i as f64;
                    integrate(from, from + width, |x| {
                        let y = 1.0 - contact.shape.image(x);
                        y * slip(y / contact.threshold)
                    })
                })
                .sum()
        });
        let backbone = row.backbone(&sums, &compressions);
        Self { normal: contact.shape.half_force(), tangential: sums.tangential, loss, backbone }
    }
}

impl UnwornSums {
    /// Sums over the springs of an unworn line contact whose middle slips by `middle`.
    pub(crate) fn in_series(contact: &Contact, middle: f64) -> Self {
        let Contact { shape, stick, threshold, reference, .. } = contact;
        let (threshold, stick) = (*threshold, *stick);
        let springs = layout(shape, stick).map(|(delta, width)| {
            let x = stick + delta;
            (x, Geometry::Line.weight(x, width), (1.0 - shape.image(x)).clamp(0.0, threshold))
        });
        let energy: f64 = springs.iter().map(|(_, v, y)| v * y * (threshold - y)).sum();
        let loss = (energy + middle) / threshold;
        let reach = reference.map_or(f64::INFINITY, |reference| reference.reach);
        let yields = springs.iter().map(|(x, v, y)| {
            // L/√(L²−x²)
            let ratio = x / reach;
            (v / ((1.0 - ratio) * (1.0 + ratio)).sqrt(), *y)
        });
        let outside = reference.map(|reference| reference.outside(1.0) - reference.rig());
        let backbone = Backbone::in_series(yields, outside, (threshold, middle), loss);
        Self { normal: 0.5, tangential: 0.5 * threshold, loss, backbone }
    }
}

/// The integrals of one state: half of the normal force, half of the tangential force amplitude,
/// the energy integral and the volume. All are dimensionless.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sums {
    /// Half of the normal force, ∫₀ᵃ y dx.
    pub normal: f64,
    /// The decrease of `normal` since the unworn state.
    pub unloaded: f64,
    /// Half of the amplitude of the tangential force, ∫₀ᵃ min(Δ, y) dx.
    pub tangential: f64,
    /// The energy integral ∫₀ᵃ y (Δ − y)₊ dx.
    pub energy: f64,
    /// 4 ∫ (g − g₀) √(ã²−x²) dx: the volume of the inverse transform of the image, (4).
    pub volume: f64,
}

/// Number of intervals in the sum over the slip of a record.
const RECORD_INTERVALS: usize = 64;
/// Number of Gauss points under a flat that slips.
const FLAT_POINTS: usize = 8;
static WHOLE: OnceLock<Gauss<ROW_POINTS>> = OnceLock::new();

/// ∫ min(Δ, y₀) dx and ∫ y₀ (Δ − y₀)₊ dx over the springs of an unworn contact with stick radius c, for half of the
/// row.
pub(crate) fn unworn_integrals(shape: &Shape, c: f64, threshold: f64) -> (f64, f64) {
    integrals_of(shape, |x| shape.image(x), c, threshold)
}

/// The same integrals if the springs have another image.
pub(super) fn integrals_of(
    shape: &Shape,
    image: impl Fn(f64) -> f64,
    c: f64,
    threshold: f64,
) -> (f64, f64) {
    let (mut normal, mut energy) = (0.0, 0.0);
    let geometry = shape.geometry();
    for (delta, width) in layout(shape, c) {
        let weight = geometry.weight(c + delta, width);
        let y = (1.0 - image(c + delta)).clamp(0.0, threshold);
        normal += weight * y;
        energy += weight * y * (threshold - y);
    }
    match geometry {
        Geometry::Round => (threshold * c + normal, energy),
        Geometry::Line => (0.5 * threshold, energy),
    }
}

/// The slipping springs: their distances from c and the lengths that they represent.
fn layout(shape: &Shape, c: f64) -> [(f64, f64); ROW_POINTS] {
    static UNDER: OnceLock<Gauss<FLAT_POINTS>> = OnceLock::new();
    static BEYOND: OnceLock<Gauss<{ ROW_POINTS - FLAT_POINTS }>> = OnceLock::new();
    let graded = |from: f64, s: f64, weight: f64| {
        let cube = s * s * s;
        ((1.0 - from) * cube * s, 4.0 * (1.0 - from) * cube * weight)
    };
    let Some(edge) = shape.kinks().iter().copied().find(|kink| *kink > c) else {
        let rule = WHOLE.get_or_init(Gauss::new);
        return std::array::from_fn(|k| graded(c, rule.nodes[k], rule.weights[k]));
    };
    // All springs under a flat are equal, so few points are enough. The grading starts at the edge
    // of the flat.
    let (under, beyond) = (UNDER.get_or_init(Gauss::new), BEYOND.get_or_init(Gauss::new));
    std::array::from_fn(|k| {
        if k < FLAT_POINTS {
            let s = under.nodes[k];
            return ((edge - c) * (1.0 - s * s), 2.0 * (edge - c) * s * under.weights[k]);
        }
        let (s, weight) = (beyond.nodes[k - FLAT_POINTS], beyond.weights[k - FLAT_POINTS]);
        let (delta, length) = graded(edge, s, weight);
        (edge - c + delta, length)
    })
}

/// The slipping springs, c < x < a₀, with the data for the sums over them.
#[derive(Debug, Clone)]
pub struct SpringRow {
    contact: Contact,
    weights: [f64; ROW_POINTS],
    positions: [f64; ROW_POINTS],
    unworn: [f64; ROW_POINTS],
    /// The compression that is missing for stick, Δ − y₀. It is never 0.
    rest: [f64; ROW_POINTS],
    chords: [f64; ROW_POINTS],
    core_normal: f64,
    outside_volume: f64,
}

impl SpringRow {
    /// Lays out the springs of a contact.
    pub fn new(contact: &Contact) -> Self {
        let Contact { ref shape, stick: c, limit, .. } = *contact;
        let chord = |x: f64| ((limit.radius - x) * (limit.radius + x)).max(0.0).sqrt();
        let springs = layout(shape, c);
        let positions = springs.map(|(delta, _)| c + delta);
        let weights = springs.map(|(_, weight)| weight);
        let unworn = positions.map(|x| (1.0 - shape.image(x)).clamp(0.0, contact.threshold));
        let unworn_normal: f64 = weights.iter().zip(&unworn).map(|(weight, y)| weight * y).sum();
        // For a rough table the difference may be slightly negative because of quadrature errors.
        let core = (shape.half_force() - unworn_normal).max(0.0);
        // The springs between a₀ and ã are not in contact. The substitution is x = ã − (ã − 1)s², as in the limit.
        let rule = WHOLE.get_or_init(Gauss::new);
        let width = limit.radius - 1.0;
        let outside = rule.nodes.iter().zip(&rule.weights).map(|(s, weight)| {
            let x = limit.radius - width * s * s;
            8.0 * width * weight * s * (1.0 - shape.image(x)) * chord(x)
        });
        Self {
            contact: contact.clone(),
            weights,
            positions,
            unworn,
            rest: springs.map(|(delta, _)| contact.rest(delta)),
            chords: positions.map(chord),
            core_normal: if c == 0.0 { 0.0 } else { core },
            outside_volume: outside.sum(),
        }
    }

    /// Sums over the springs.
    pub fn sums(&self, decay: Decay) -> Sums {
        self.sums_and_compressions(decay).0
    }

    /// Sums over the springs, and the compressions of the slipping springs.
    pub(crate) fn sums_and_compressions(&self, decay: Decay) -> (Sums, [f64; ROW_POINTS]) {
        let threshold = self.contact.threshold;
        let Decay { left, gone } = decay;
        // The formulas of `Contact::compression` and `Contact::worn`, with a single division for
        // both.
        let share: [f64; ROW_POINTS] =
            std::array::from_fn(|k| self.unworn[k] / (self.unworn[k] * left + self.rest[k]));
        let compressions = share.map(|share| threshold * left * share);
        let (mut normal, mut unloaded, mut energy, mut volume) = (0.0, 0.0, 0.0, 0.0);
        for k in 0..ROW_POINTS {
            let worn = self.weights[k] * gone * self.rest[k] * share[k];
            let load = self.weights[k] * compressions[k];
            normal += load;
            unloaded += worn;
            energy += load * (threshold - compressions[k]).max(0.0);
            volume += worn * self.chords[k];
        }
        let sums = Sums {
            normal: self.core_normal + normal,
            unloaded,
            tangential: threshold * self.contact.stick + normal,
            energy,
            volume: 4.0 * volume + decay.gone * self.outside_volume,
        };
        (sums, compressions)
    }

    /// The backbone of a state, from its sums and compressions.
    pub(crate) fn backbone(&self, sums: &Sums, compressions: &[f64; ROW_POINTS]) -> Backbone {
        let Contact { stick, threshold, .. } = self.contact;
        let loss = sums.energy / threshold;
        if self.contact.shape.kinks().iter().any(|kink| *kink > stick) {
            // The points do not form a single Gauss rule: treat each point as a cell.
            return Backbone::of_cells(stick, threshold, compressions, &self.weights, Some(loss));
        }
        Backbone::of_row((stick, threshold), &self.positions, &self.weights, compressions, loss)
    }

    /// (2/π) w·x/√(x²−r²) of each slipping spring for a radius r ≤ c. Multiplied by the compressions and summed, these
    /// weights give the load ∫ p dr² that the slipping springs carry outside r.
    pub(crate) fn weights_inside(&self, r: f64) -> [f64; ROW_POINTS] {
        std::array::from_fn(|k| {
            let x = self.positions[k];
            std::f64::consts::FRAC_2_PI * self.weights[k] * x / ((x - r) * (x + r)).sqrt()
        })
    }

    /// (2/π) w/√(r²−x²) of each slipping spring for a radius r outside the contact. Multiplied by
    /// the compressions and summed, these weights give (2/π) ∫ y/√(r²−x²) dx: the part of the
    /// motion that the surface at r follows.
    pub(crate) fn weights_outside(&self, r: f64) -> [f64; ROW_POINTS] {
        std::array::from_fn(|k| {
            let x = self.positions[k];
            std::f64::consts::FRAC_2_PI * self.weights[k] / ((r - x) * (r + x)).sqrt()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Flank;

    use super::super::hysteresis::Loop;

    /// ∮ Q̃/2 du along the straight lines between the points.
    fn area(found: &Loop) -> f64 {
        let sides = found.displacement.windows(2).zip(found.force.windows(2));
        sides.map(|(u, force)| 0.5 * (u[1] - u[0]) * (force[0] + force[1])).sum()
    }

    #[test]
    fn the_area_of_a_loop_is_the_energy_lost() {
        for (shape, threshold) in [
            (Shape::power(2.0), 0.75),
            (Shape::power(1.0), 0.3),
            (Shape::power(4.0), 0.9),
            (Shape::sphere(2.0), 0.5),
            (Shape::truncated(Flank::Paraboloid, 0.4), 0.9),
            (Shape::truncated(Flank::Paraboloid, 0.4), 1.2),
            (Shape::power(2.0), 1.0),
            (Shape::power(2.0), 3.0),
        ] {
            let row = SpringRow::new(&Contact::new(shape, threshold).expect("a limit"));
            for exponent in [0.0, 0.3, 2.0, 8.0, 20.0, 40.0] {
                let (sums, compressions) = row.sums_and_compressions(Decay::after(exponent));
                let lost = 4.0 * sums.energy;
                // The area is a difference. For a narrow loop, rounding leaves fewer digits.
                let whole = 4.0 * sums.tangential * threshold;
                let found = row.backbone(&sums, &compressions).wind();
                let error = area(&found).abs() - lost;
                assert!(
                    error.abs() < 1e-12 * lost + 1e-15 * whole,
                    "{threshold} {exponent}: {error}"
                );
            }
        }
    }

    #[test]
    fn the_corners_of_an_unworn_loop_lie_on_the_curve_of_cattaneo_and_mindlin() {
        // Cattaneo and Mindlin: Q/μF = 1 − (1 − δ/δ*)^{3/2} on first loading, with δ* at gross
        // slip.
        for threshold in [0.1, 0.5, 0.75, 0.99] {
            let contact = Contact::new(Shape::power(2.0), threshold).expect("a limit");
            let found = UnwornSums::of(&contact, None).backbone.wind();
            let loading = |u: f64| 2.0 / 3.0 * (1.0 - libm::pow(1.0 - u, 1.5));
            let most = loading(threshold);
            for (u, force) in
                found.displacement.iter().zip(&found.force).take(found.force.len() / 2)
            {
                let known = most - 2.0 * loading(0.5 * (threshold - u));
                assert!((force - known).abs() < 1e-3 * most, "{threshold} {u}: {force} {known}");
            }
        }
    }

    #[test]
    fn the_three_transition_ratios_of_a_hertz_mindlin_contact_are_reproduced() {
        let sums = UnwornSums::of(&Contact::new(Shape::power(2.0), 1.0).expect("a limit"), None);
        let found = sums.backbone.wind();
        let slip = 2.0 * libm::pow(2.0, -2.0 / 3.0) - 1.0;
        assert!((found.energy_ratio - 0.2).abs() < 1e-9, "{}", found.energy_ratio);
        assert!((found.slip_ratio - slip).abs() < 1e-6, "{}", found.slip_ratio);
        assert!((found.free_ratio - 0.2 / slip).abs() < 1e-5, "{}", found.free_ratio);
    }
}
