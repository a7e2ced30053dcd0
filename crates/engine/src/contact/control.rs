//! The quantities that are held constant during wear, and the limiting states.
//!
//! In the normal direction the indentation depth or the force is constant. In the tangential
//! direction the constant quantity is the amplitude of the motion, the tangential force, or the
//! amplitude of an actuator behind a compliant rig. The amplitude may also follow blocks (a load
//! spectrum) or a record of reversals.
//!
//! # Equations
//! With Q̃(Δ) = 2 ∫ min(Δ, y) dx, all in units of a₀, d₀ and E*a₀d₀ ("const" = held constant):
//! ```text
//! d const         c stays: g₀(c) = 1 − Δ, or decreases if Q is constant
//! F const         2 ∫ (d − g)₊ dx = F̃₀ gives d;  c grows, or stays if Q is constant
//! Q const         Q̃(Δ) = Q/(μE*a₀d₀) gives Δ;  no root: gross slip
//! rig             Δ + κ·Q̃(Δ) = Δ_rig,  κ = G*a₀/k_rig
//! ```
//! In every limiting state, the unworn core inside c carries the whole load:
//! ```text
//! F, Q   g₀(c) = 1 − Δ₀ at all times;  d∞ = (F̃₀/2 + ∫₀ᶜ g₀ dx)/c
//! d, Q   2c(1 − g₀(c)) = Q̃, the larger root; above the maximum no root: gross slip
//! d, rig (1 + 2κc)(1 − g₀(c)) = Δ_rig, the largest root
//! ```
//!
//! In a line contact only the force is held in the normal direction, so the level of its springs is constant, as that of
//! a round contact with its depth held. A constant tangential force is a constant θ there. A stroke U is measured
//! against a point of the surface at the distance L, or by the slope of the loop:
//! ```text
//! F, Q     F(c) = F₀ − Q/μ at all times: c stays
//! F, U     θ·C + Σ K (θ − y)₊ = U/(μh₀) gives θ;  c grows;  no root up to 1: the middle slips by the rest σ₀
//! sliding  θ = 1, and σ₀ = U/(μh₀)
//! K is ∫ L ds/(s √(L²−s²)) or ∫ ds/s over the spring; C is what yields outside the mesh
//! ```
//!
//! # Sources
//! The principle of Cattaneo and Mindlin, (10). The limiting states follow from (11) with the
//! constant load.

use std::sync::Arc;

use super::limit::{chord_and_angle, limiting_wear};
use super::record::DisplacementRecord;
use super::{Contact, Geometry, Limit, Shape};
pub use crate::input::held::Normal;
use crate::numeric::{maximum, root};

/// The quantity that is held constant in the tangential direction, in units of the unworn contact.
#[derive(Debug, Clone, PartialEq)]
pub enum Held {
    /// The threshold of the springs: the amplitude of a round contact, Δ, or the tangential force of a line contact, θ.
    Threshold,
    /// The tangential force of a round contact, given as Q̃/2 = ∫ min(Δ, y) dx.
    Force(f64),
    /// The amplitude of an actuator behind a compliant rig.
    Rig {
        /// The amplitude of the actuator, Δ_rig.
        amplitude: f64,
        /// The compliance of the rig, κ.
        compliance: f64,
    },
    /// A record of reversals that repeats every cycle.
    Record(Arc<DisplacementRecord>),
    /// The stroke of a line contact, U/(μh₀), measured against the reference of the contact.
    Stroke(f64),
    /// The stroke U/(μh₀) at the middle of a line contact that slides.
    Sliding(f64),
    /// The aperture of the loop, in the unit of Δ, or in μh₀ of a line contact.
    Aperture(f64),
}

/// A number of cycles with one held motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// The quantity that is held constant.
    pub held: Held,
    /// The threshold of the springs of the unworn contact: Δ, or θ of a line contact. It is 0 at rest.
    pub threshold: f64,
    /// The cycle Ñ at which the block ends, counted from the start of the run.
    pub end: f64,
}

impl Block {
    /// A block of a constant threshold.
    pub fn new(threshold: f64, end: f64) -> Self {
        Self { held: Held::Threshold, threshold, end }
    }

    /// The stroke of a line contact in μh₀, if it is held.
    pub(crate) fn stroke(&self) -> Option<f64> {
        match self.held {
            Held::Stroke(stroke) | Held::Sliding(stroke) => Some(stroke),
            _ => None,
        }
    }

    /// The held amplitude: of the actuator if there is a rig, the aperture, otherwise Δ, θ or the stroke of a line contact.
    pub(crate) fn amplitude(&self) -> f64 {
        match self.held {
            Held::Rig { amplitude, .. } | Held::Aperture(amplitude) => amplitude,
            _ => self.stroke().unwrap_or(self.threshold),
        }
    }
}

/// The quantities that are held constant in both directions.
#[derive(Debug, Clone, PartialEq)]
pub struct Control {
    /// The constant quantity in the normal direction.
    pub normal: Normal,
    /// The motion: at least one block. All hold the same kind of quantity. A single one lasts until the end of the run.
    pub blocks: Arc<[Block]>,
}

/// A limiting state that can be computed without a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Final {
    /// d∞, the limiting indentation depth.
    pub depth: f64,
    /// c∞, the limiting stick radius.
    pub stick: f64,
    /// Δ∞, the limiting amplitude.
    pub threshold: f64,
    /// Radius, volume and depth of the limiting scar.
    pub limit: Limit,
}

impl Final {
    /// f∞(r), the limiting profile.
    pub(crate) fn profile(&self, shape: &Shape, r: f64) -> f64 {
        let unworn = shape.profile(r);
        if r <= self.stick && r > 0.0 || r >= self.limit.radius {
            return unworn;
        }
        if self.stick == 0.0 {
            return self.depth;
        }
        let wear = limiting_wear(shape, self.stick, self.depth, r, chord_and_angle(self.stick, r));
        unworn + wear.max(0.0)
    }
}

impl Control {
    /// A motion of one block, with the threshold of the unworn contact.
    pub fn constant(normal: Normal, held: Held, threshold: f64) -> Self {
        let block = Block { held, threshold, end: f64::INFINITY };
        Self { normal, blocks: Arc::new([block]) }
    }

    /// What the first block holds, and all others hold in another size.
    pub fn held(&self) -> &Held {
        &self.blocks[0].held
    }

    /// Whether the motion has several blocks.
    pub(crate) fn varies(&self) -> bool {
        self.blocks.len() > 1
    }

    /// Whether the closed form of the simplified rule applies.
    pub(crate) fn is_closed(&self) -> bool {
        self.normal == Normal::Depth && !self.varies() && *self.held() == Held::Threshold
    }

    /// Whether the stick radius is constant during wear.
    pub(crate) fn keeps_stick(&self, contact: &Contact) -> bool {
        let keeps = matches!(
            (self.normal, self.held()),
            (Normal::Depth, Held::Threshold | Held::Record(_) | Held::Sliding(_))
                | (Normal::Force, Held::Force(_))
        );
        keeps && !self.varies() && !contact.changes_friction()
    }

    /// Whether the tangential force is held, so that the run ends when friction cannot carry it.
    pub(crate) fn holds_force(&self, contact: &Contact) -> bool {
        match self.held() {
            Held::Force(_) => true,
            Held::Threshold => contact.shape.geometry() == Geometry::Line,
            _ => false,
        }
    }

    /// Whether a stick edge that moves comes to rest in worn material, at a place that only the run can find.
    pub(crate) fn drifts(&self, contact: &Contact) -> bool {
        self.normal == Normal::Force
            || contact.changes_friction()
            || matches!(self.held(), Held::Stroke(_) | Held::Sliding(_) | Held::Aperture(_))
    }

    /// Whether the apertures of the loops are held.
    pub(crate) fn holds_aperture(&self) -> bool {
        matches!(self.held(), Held::Aperture(_))
    }

    /// Whether the motion follows a displacement record.
    pub(crate) fn has_record(&self) -> bool {
        matches!(self.held(), Held::Record(_))
    }

    /// The limiting state. `None` if it cannot be computed without a run, or if it does not exist.
    pub fn tends_to(&self, contact: &Contact) -> Option<Final> {
        let Contact { shape, stick, threshold, .. } = contact;
        let stick = match (self.normal, self.held()) {
            _ if contact.changes_friction() || self.varies() => return None,
            _ if self.keeps_stick(contact) => *stick,
            (Normal::Depth, Held::Force(_)) => self.last_stick(shape)?,
            // If the whole contact slips, the actuator still determines the amplitude, so the limit exists.
            (Normal::Depth, Held::Rig { .. }) => self.last_stick(shape).unwrap_or(0.0),
            _ => return None,
        };
        let depth = self.depth_on_core(shape, stick);
        let threshold = match *self.held() {
            Held::Rig { amplitude, .. } if stick == 0.0 => amplitude,
            _ if stick == 0.0 => *threshold,
            _ => depth - shape.image(stick),
        };
        let limit = Limit::at_depth(shape, stick, depth)?;
        Some(Final { depth, stick, threshold, limit })
    }

    /// The indentation depth d after a core of radius c > 0 carries the whole load.
    pub(crate) fn depth_on_core(&self, shape: &Shape, stick: f64) -> f64 {
        match self.normal {
            Normal::Depth => 1.0,
            Normal::Force => (shape.half_force() + shape.area(stick)) / stick,
        }
    }

    /// The limiting scar radius of the largest of several blocks at constant force, under which a core of radius c > 0
    /// carries the whole load.
    pub(crate) fn scar_of_blocks(&self, shape: &Shape, stick: f64) -> Option<f64> {
        let core = self.varies() && self.normal == Normal::Force && stick > 0.0;
        let limit = core.then(|| Limit::at_depth(shape, stick, self.depth_on_core(shape, stick)));
        limit.flatten().map(|limit| limit.radius)
    }

    /// The stick radius at which a shrinking core stops shrinking. It is the largest radius at
    /// which the springs inside still stick although they alone carry the tangential force.
    fn last_stick(&self, shape: &Shape) -> Option<f64> {
        let surplus = |c: f64| {
            let threshold = 1.0 - shape.image(c);
            match *self.held() {
                Held::Force(half) => c * threshold - half,
                Held::Rig { amplitude, compliance } => {
                    (1.0 + 2.0 * compliance * c) * threshold - amplitude
                }
                _ => -1.0,
            }
        };
        let best = maximum(0.0, 1.0, surplus);
        // Between the radius `best` and a₀ `surplus` changes its sign.
        (surplus(best) > 0.0 && surplus(1.0) < 0.0).then(|| root(best, 1.0, surplus))
    }

    /// The largest threshold of all blocks.
    pub(crate) fn largest_threshold(&self) -> f64 {
        self.blocks.iter().map(|block| block.threshold).fold(0.0, f64::max)
    }

    /// The largest stroke or aperture of a line contact in μh₀. 0 if none is held.
    pub(crate) fn largest_stroke(&self) -> f64 {
        let stroke = |block: &Block| match block.held {
            Held::Aperture(aperture) => aperture,
            _ => block.stroke().unwrap_or(0.0),
        };
        self.blocks.iter().map(stroke).fold(0.0, f64::max)
    }

    /// The smallest stick radius of the whole run. Inside it no spring ever slips.
    pub(crate) fn least_stick(&self, contact: &Contact) -> f64 {
        let least_friction = contact.course.as_ref().map_or(1.0, |course| course.least_friction());
        match (self.normal, self.held()) {
            // As the slip ring loses its load, the core has to slip.
            (_, Held::Aperture(_)) => 0.0,
            _ if self.varies() => {
                let most = self.largest_threshold() / least_friction;
                if most >= 1.0 { 0.0 } else { contact.shape.image_inverse(1.0 - most) }
            }
            // The unworn core alone determines F − Q/μ = 2 ∫ (g(c) − g) dx over the core.
            (Normal::Force, Held::Force(half)) if contact.changes_friction() => {
                let shape = &contact.shape;
                let rest = shape.half_force() - half / least_friction;
                let surplus = |c: f64| c * shape.image(c) - shape.area(c) - rest;
                if rest <= 0.0 { 0.0 } else { root(0.0, 1.0, surplus) }
            }
            // Δ falls less than friction does.
            (_, Held::Force(_) | Held::Rig { .. }) if contact.changes_friction() => 0.0,
            _ if least_friction < 1.0 => {
                contact.shape.stick_radius(contact.threshold / least_friction)
            }
            (Normal::Depth, Held::Force(_) | Held::Rig { .. }) => {
                self.last_stick(&contact.shape).unwrap_or(0.0)
            }
            _ => contact.stick,
        }
    }
}

/// The stick radius below which a core cannot carry a constant tangential force at a constant
/// depth.
pub(crate) fn critical_stick(shape: &Shape) -> f64 {
    maximum(0.0, 1.0, |c| c * (1.0 - shape.image(c)))
}
