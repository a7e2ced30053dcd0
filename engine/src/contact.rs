//! Normal contact and friction of a worn profile, on the row of springs: (5)–(10), (15), (16).
//!
//! A spring at x is compressed by y = max(0, d − g). It sticks while its tangential force stays
//! below μ times its normal force, that is where y ≥ Δ = G*U/(μE*), and otherwise slips a path
//! 4U·ω per cycle, ω = 1 − y/Δ. This is (15), (16) summed over one steady cycle.
//!
//! # Equations
//! ```text
//! F = 2E* ∫₀ᵃ y dx                                                    (9)
//! y(c) = Δ                                                            (10)
//! Q = 2 ∫₀ᵃ min(G*U, μE*y) dx                     amplitude of the tangential force
//! W = 8μE* ∫₀ᵃ y·(U − (μE*/G*) y)₊ dx             energy lost per cycle
//! ```
//! All integrals here are in units of a₀ and d₀ and over half of the row.
//!
//! # Accuracy
//! [`Row`] integrates over the worn part with 48 Gauss points graded to the fourth power towards the
//! stick edge, where the image forms a step: 1e-9 of the unworn values in partial slip and well into
//! gross slip (tests compare). At the very onset of gross slip blunt profiles are worse: 1e-6 for
//! exponent 8, 1e-4 for 20.

use std::sync::OnceLock;

use super::hysteresis::Backbone;
use super::limit::Limit;
use super::numeric::{Gauss, integrate};
use super::profile::Shape;

/// How far the contact slips at the unworn state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Regime {
    /// Nothing slips.
    FullStick,
    /// A ring slips around a sticking core.
    PartialSlip,
    /// The whole contact slips.
    GrossSlip,
}

/// The unworn contact and its limiting state in dimensionless form.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// The unworn shape.
    pub shape: Shape,
    /// Δ = G*U/(μE*d₀): the compression below which a spring slips.
    pub threshold: f64,
    /// c/a₀; 0 in gross slip.
    pub stick: f64,
    /// Partial or gross slip.
    pub regime: Regime,
    /// The state that wear tends to.
    pub limit: Limit,
}

impl Contact {
    /// The contact of `shape` at amplitude Δ > 0; `None` where its scar would outgrow the shape.
    #[must_use]
    pub fn new(shape: Shape, threshold: f64) -> Option<Self> {
        // At Δ = 1 the springs under a flat, if there is one, still stick.
        let stick = if threshold > 1.0 { 0.0 } else { shape.image_inverse(1.0 - threshold) };
        let regime = if stick > 0.0 { Regime::PartialSlip } else { Regime::GrossSlip };
        let limit = Limit::solve(&shape, stick)?;
        Some(Self { shape, threshold, stick, regime, limit })
    }

    /// The contact of `shape` whose springs stick inside 0 ≤ c < 1.
    #[must_use]
    pub fn sticking(shape: Shape, c: f64) -> Option<Self> {
        let threshold = 1.0 - shape.image(c);
        Self::new(shape, threshold)
    }

    /// Δ − y₀ of a spring at x = c + δ: how far it is from sticking. Never quite 0, so that no spring
    /// divides 0 by 0 once e has underflowed.
    #[must_use]
    pub fn rest(&self, delta: f64) -> f64 {
        let excess = (self.threshold - 1.0).max(0.0);
        (excess + self.shape.image_rise(self.stick, delta)).max(1e-300)
    }

    /// η of a spring at x = c + δ, c < x < ã, by the closed form of (14).
    #[must_use]
    pub fn compression(&self, delta: f64, decay: Decay) -> f64 {
        let rest = self.rest(delta);
        let unworn = self.threshold - rest;
        if unworn <= 0.0 {
            return unworn * decay.left;
        }
        self.threshold * unworn * decay.left / (unworn * decay.left + rest)
    }

    /// g − g₀ of such a spring, which is y₀ less its compression, without their cancellation.
    #[must_use]
    pub fn worn(&self, delta: f64, decay: Decay) -> f64 {
        let rest = self.rest(delta);
        let unworn = self.threshold - rest;
        if unworn <= 0.0 {
            return unworn * decay.gone;
        }
        unworn * rest * decay.gone / (unworn * decay.left + rest)
    }
}

/// Half of the sums over the springs of an unworn contact.
#[derive(Debug, Clone)]
pub struct UnwornSums {
    /// ∫₀ᵃ y dx.
    pub normal: f64,
    /// ∫₀ᵃ min(Δ, y) dx.
    pub tangential: f64,
    /// ∫₀ᵃ y ω dx.
    pub loss: f64,
    /// How the tangential force builds up.
    pub backbone: Backbone,
}

impl UnwornSums {
    /// Sums over the unworn springs; `slip` gives ω of y/Δ where it is not that of one harmonic cycle.
    #[must_use]
    pub fn of(contact: &Contact, slip: Option<&dyn Fn(f64) -> f64>) -> Self {
        let row = Row::new(contact);
        let (sums, compressions) = row.sums_and_compressions(Decay::UNWORN);
        let harmonic = sums.energy / contact.threshold;
        // A record bends ω at many places: many short intervals instead of one long one.
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

/// e = exp(−ξÑ/ã), by which the simplified rule has come down, and 1 − e with all its digits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decay {
    /// e.
    pub left: f64,
    /// 1 − e.
    pub gone: f64,
}

impl Decay {
    /// Nothing is worn.
    pub const UNWORN: Self = Self { left: 1.0, gone: 0.0 };
    /// The limiting state.
    pub const COMPLETE: Self = Self { left: 0.0, gone: 1.0 };

    /// The decay after an exponent ξÑ/ã ≥ 0.
    #[must_use]
    pub fn after(exponent: f64) -> Self {
        Self { left: libm::exp(-exponent), gone: -libm::expm1(-exponent) }
    }
}

/// The integrals of one state: half of the normal force, half of the tangential force amplitude, the
/// energy integral and the volume, each in its dimensionless unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sums {
    /// ∫₀ᵃ y dx.
    pub normal: f64,
    /// By how much `normal` has fallen.
    pub unloaded: f64,
    /// ∫₀ᵃ min(Δ, y) dx.
    pub tangential: f64,
    /// ∫₀ᵃ y (Δ − y)₊ dx.
    pub energy: f64,
    /// 4 ∫ (g − g₀) √(ã²−x²) dx: the volume of the inverse transform of the image, (4).
    pub volume: f64,
}

/// Intervals of the sum over a record's slip.
const RECORD_INTERVALS: usize = 64;
/// Gauss points of a [`Row`].
pub const ROW_POINTS: usize = 48;
/// How many of them are under a flat, where there is one that slips.
const FLAT_POINTS: usize = 8;
static WHOLE: OnceLock<Gauss<ROW_POINTS>> = OnceLock::new();

/// Where the slipping springs are, as distances from c, and the lengths that they stand for.
fn layout(contact: &Contact) -> [(f64, f64); ROW_POINTS] {
    static UNDER: OnceLock<Gauss<FLAT_POINTS>> = OnceLock::new();
    static BEYOND: OnceLock<Gauss<{ ROW_POINTS - FLAT_POINTS }>> = OnceLock::new();
    let c = contact.stick;
    let graded = |from: f64, s: f64, weight: f64| {
        let cube = s * s * s;
        ((1.0 - from) * cube * s, 4.0 * (1.0 - from) * cube * weight)
    };
    let Some(edge) = contact.shape.kinks().iter().copied().find(|kink| *kink > c) else {
        let rule = WHOLE.get_or_init(Gauss::new);
        return std::array::from_fn(|k| graded(c, rule.nodes[k], rule.weights[k]));
    };
    // The springs under a flat are all alike, and few stand for them; the grading begins at its edge.
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

/// The slipping springs, c < x < a₀, with what is needed to sum over them.
#[derive(Debug, Clone)]
pub struct Row {
    contact: Contact,
    weights: [f64; ROW_POINTS],
    positions: [f64; ROW_POINTS],
    unworn: [f64; ROW_POINTS],
    /// Δ − y₀, never 0.
    rest: [f64; ROW_POINTS],
    chords: [f64; ROW_POINTS],
    core_normal: f64,
    outside_volume: f64,
}

impl Row {
    /// Lays out the springs of a contact.
    #[must_use]
    pub fn new(contact: &Contact) -> Self {
        let Contact { ref shape, stick: c, limit, .. } = *contact;
        let chord = |x: f64| ((limit.radius - x) * (limit.radius + x)).max(0.0).sqrt();
        let mut row = Self {
            contact: contact.clone(),
            weights: [0.0; ROW_POINTS],
            positions: [0.0; ROW_POINTS],
            unworn: [0.0; ROW_POINTS],
            rest: [0.0; ROW_POINTS],
            chords: [0.0; ROW_POINTS],
            core_normal: 0.0,
            outside_volume: 0.0,
        };
        let rule = WHOLE.get_or_init(Gauss::new);
        let mut unworn_normal = 0.0;
        for (k, (delta, weight)) in layout(contact).into_iter().enumerate() {
            let x = c + delta;
            row.positions[k] = x;
            row.weights[k] = weight;
            row.unworn[k] = (1.0 - shape.image(x)).clamp(0.0, contact.threshold);
            row.rest[k] = contact.rest(delta);
            row.chords[k] = chord(x);
            unworn_normal += row.weights[k] * row.unworn[k];
            // Between a₀ and ã the springs hang free; x = ã − (ã − 1)s² as in the limit.
            let (s, weight) = (rule.nodes[k], rule.weights[k]);
            let width = limit.radius - 1.0;
            let x = limit.radius - width * s * s;
            row.outside_volume += 8.0 * width * weight * s * (1.0 - shape.image(x)) * chord(x);
        }
        // Not below 0, whatever a rough table makes of the rule.
        let core = (shape.half_force() - unworn_normal).max(0.0);
        row.core_normal = if c == 0.0 { 0.0 } else { core };
        row
    }

    /// Sums over the springs.
    #[must_use]
    pub fn sums(&self, decay: Decay) -> Sums {
        self.sums_and_compressions(decay).0
    }

    /// Sums over the springs, and the compression of each of the slipping ones.
    #[must_use]
    pub fn sums_and_compressions(&self, decay: Decay) -> (Sums, [f64; ROW_POINTS]) {
        let threshold = self.contact.threshold;
        let Decay { left, gone } = decay;
        // As in `Contact::compression` and `Contact::worn`, with one division for both.
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

    /// How the tangential force builds up, given the sums and compressions of a state.
    #[must_use]
    pub fn backbone(&self, sums: &Sums, compressions: &[f64; ROW_POINTS]) -> Backbone {
        let Contact { stick, threshold, .. } = self.contact;
        let loss = sums.energy / threshold;
        if self.contact.shape.kinks().iter().any(|kink| *kink > stick) {
            // The points do not stand as one rule has them: each carries what it stands for.
            return Backbone::of_cells(stick, threshold, compressions, &self.weights, Some(loss));
        }
        Backbone::of_row((stick, threshold), &self.positions, &self.weights, compressions, loss)
    }

    /// What each slipping spring takes from the pressure (Δ/π)/√(c²−r²) that the ring would put on a
    /// radius r < c if it ended in a step: (1/π) ∫ −y′/√(x²−r²) dx by parts, so that however steep y
    /// is at the stick edge, only y itself is summed.
    #[must_use]
    pub fn weights_inside(&self, r: f64) -> [f64; ROW_POINTS] {
        std::array::from_fn(|k| {
            let x = self.positions[k];
            let square = (x - r) * (x + r);
            std::f64::consts::FRAC_1_PI * self.weights[k] * x / (square * square.sqrt())
        })
    }

    /// (2/π) w/√(r²−x²) of each slipping spring for a radius outside the contact: multiplied with
    /// the compressions they add up to (2/π) ∫ y/√(r²−x²) dx, by which the surface follows the motion.
    #[must_use]
    pub fn weights_outside(&self, r: f64) -> [f64; ROW_POINTS] {
        std::array::from_fn(|k| {
            let x = self.positions[k];
            std::f64::consts::FRAC_2_PI * self.weights[k] / ((r - x) * (r + x)).sqrt()
        })
    }
}
