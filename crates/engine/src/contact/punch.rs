//! The punch of fretting fatigue: a flat of half-width β between rounded edges, in units of a₀ and h₀. It is a line
//! contact.
//!
//! # Equations
//! Outside the flat (inside it, the profile and its image are 0):
//! ```text
//! f = (π/2) A (x − β)²    F(s)/F₀ = A (s² arccos(β/s) − β √(s²−β²))    F′ = 2A s arccos(β/s)
//! ```
//! The factor A makes the image 1 at the edge of the contact.
//!
//! # Sources
//! M. Ciavarella, D. A. Hills, G. Monno, *J. Mech. Eng. Sci.* 212 (1998) 319.

use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, PI};

use crate::numeric::{integrate, root};

/// A punch whose image is 1 at the edge of the contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Punch {
    /// β, the half-width of the flat.
    flat: f64,
    /// The factor A.
    scale: f64,
}

/// s² arccos(β/s) − β √(s²−β²), and arccos(β/s), for s ≥ β.
fn load(s: f64, flat: f64) -> (f64, f64) {
    let chord = ((s - flat) * (s + flat)).max(0.0).sqrt();
    let angle = libm::atan2(chord, flat);
    (s * s * angle - flat * chord, angle)
}

impl Punch {
    /// A punch with a flat of half-width 0 < β < 1.
    pub(super) fn new(flat: f64) -> Self {
        Self { flat, scale: 1.0 / load(1.0, flat).0 }
    }

    /// The kinks of the image: only β.
    pub(super) fn kinks(&self) -> &[f64] {
        std::slice::from_ref(&self.flat)
    }

    pub(super) fn profile(&self, x: f64) -> f64 {
        let beyond = (x - self.flat).max(0.0);
        FRAC_PI_2 * self.scale * beyond * beyond
    }

    pub(super) fn slope(&self, x: f64) -> f64 {
        PI * self.scale * (x - self.flat).max(0.0)
    }

    pub(super) fn image(&self, s: f64) -> f64 {
        if s <= self.flat { 0.0 } else { self.scale * load(s, self.flat).0 }
    }

    pub(super) fn image_slope(&self, s: f64) -> f64 {
        if s <= self.flat { 0.0 } else { 2.0 * self.scale * s * load(s, self.flat).1 }
    }

    pub(super) fn image_inverse(&self, value: f64) -> f64 {
        if value <= 0.0 { self.flat } else { root(self.flat, 1.0, |s| self.image(s) - value) }
    }

    /// (1/π) ∫ F′/√(s²−x²) ds over x…b.
    pub(super) fn pressure_inside(&self, x: f64, b: f64) -> f64 {
        let from = x.max(self.flat);
        if from >= b {
            return 0.0;
        }
        // With s = from·cosh u the square root at s = x vanishes, and u = U v² removes that of the angle at the flat.
        let most = libm::acosh(b / from);
        FRAC_1_PI
            * integrate(0.0, 1.0, |v| {
                let u = most * v * v;
                let s = from * libm::cosh(u);
                let chord =
                    if x < from { ((s - x) * (s + x)).sqrt() } else { from * libm::sinh(u) };
                let step = 2.0 * most * v * from * libm::sinh(u);
                if chord == 0.0 { 0.0 } else { self.image_slope(s) * step / chord }
            })
    }
}
