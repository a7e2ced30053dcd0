//! The reference of the displacements of a line contact. The rigid displacement of a half-plane has no bound, so a stroke
//! is measured against points of its surface, or by the slope of a loop.
//!
//! # Equations
//! In units of a₀ and μh₀, with the threshold θ of the springs and their compression y:
//! ```text
//! U = θ·C + ∫ (θ − y)₊ L ds/(s √(L²−s²)) over c…L          points at the distance L; C is the rig
//! U = θ·C + ∫ (θ − y)₊ ds/s over c…a − θ ln(a/a₀)           C is 1/S, the compliance of the unworn contact
//! ```
//!
//! The aperture δ of a loop is half of its width without force. By Masing's rule it follows from the displacement g(Q) at
//! which the force grows to Q for the first time. What is linear in Q, such as a rig, does not change it:
//! ```text
//! δ = g(Q) − 2g(Q/2),  or with Q = μF and the slip σ₀ of the middle  δ = σ₀ + g(μF) − 2g(μF/2)
//! ```
//!

use super::profile::Shape;
use crate::numeric::{integrate, root};

/// The force at which a contact has a loop of this aperture, and the slip of its middle. `most` is the force that friction
/// carries, and `backbone` the displacement at which the force grows to a value for the first time, which is convex.
pub(crate) fn at_aperture(aperture: f64, most: f64, backbone: impl Fn(f64) -> f64) -> (f64, f64) {
    let missing = |force: f64| aperture + 2.0 * backbone(0.5 * force) - backbone(force);
    let middle = missing(most);
    if middle >= 0.0 {
        (most, middle)
    } else if aperture == 0.0 {
        (0.0, 0.0)
    } else {
        (root(0.0, most, missing), 0.0)
    }
}

/// What the displacements of a line contact are measured against.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Series {
    /// The distance L of the points of the surface that define the displacement. Infinite if the loop defines it.
    pub reach: f64,
    /// What yields beside the surface inside `reach`: μF/k_rig, or with an infinite reach μF/S of the unworn contact.
    pub compliance: f64,
}

impl Series {
    /// Points that are far away. The displacement is that of the surface without what is linear in the force.
    pub(crate) const FAR: Self = Self { reach: f64::INFINITY, compliance: 0.0 };

    /// ∫ L ds/(s √(L²−s²)) from `from` to `to`, or ∫ ds/s if the reach is infinite.
    pub(crate) fn between(&self, from: f64, to: f64) -> f64 {
        if self.reach.is_infinite() {
            return libm::log(to / from);
        }
        let part = |s: f64| libm::acosh((self.reach / s).max(1.0));
        part(from) - part(to)
    }

    /// What a unit of θ moves beside the surface: the rig.
    pub(crate) fn rig(&self) -> f64 {
        if self.reach.is_infinite() { 0.0 } else { self.compliance }
    }

    /// The stroke of the unworn contact of `shape` at θ, in μh₀.
    pub(crate) fn stroke(&self, shape: &Shape, threshold: f64) -> f64 {
        threshold * self.outside(1.0) + self.slipping(shape, threshold, 1.0)
    }

    /// What the unworn springs of `shape` inside the half-width `end` yield at θ, where they slip.
    pub(crate) fn slipping(&self, shape: &Shape, threshold: f64, end: f64) -> f64 {
        let stick = shape.stick_radius(threshold);
        let rise = |s: f64| threshold - 1.0 + shape.image(s);
        let of_spring = |s: f64| {
            if self.reach.is_infinite() {
                return rise(s) / s;
            }
            rise(s) * self.reach / (s * ((self.reach - s) * (self.reach + s)).sqrt())
        };
        // The cube makes the image smooth at the stick edge and at the middle. Beyond a flat, the image rises like a
        // power 3/2.
        let from = shape.kinks().iter().copied().fold(stick, f64::max);
        let width = (end - from).max(0.0);
        integrate(0.0, 1.0, |v| 3.0 * width * v * v * of_spring(from + width * v * v * v))
    }

    /// The same reference at the contact, without the rig.
    pub(crate) fn without_rig(self) -> Self {
        Self { compliance: self.compliance - self.rig(), ..self }
    }

    /// θ of the unworn contact of `shape` at a stroke in μh₀, and the slip of the middle. θ is 1 in gross slip.
    pub(crate) fn threshold(&self, shape: &Shape, stroke: f64) -> (f64, f64) {
        let missing = |threshold: f64| self.stroke(shape, threshold) - stroke;
        let middle = -missing(1.0);
        if middle >= 0.0 { (1.0, middle) } else { (root(0.0, 1.0, missing), 0.0) }
    }

    /// θ of the unworn contact of `shape` at the aperture of a loop in μh₀, and the slip of the middle.
    pub fn at_aperture(&self, shape: &Shape, aperture: f64) -> (f64, f64) {
        at_aperture(aperture, 1.0, |threshold| self.slipping(shape, threshold, 1.0))
    }

    /// C: what a unit of θ moves outside the half-width `end`.
    pub(crate) fn outside(&self, end: f64) -> f64 {
        if self.reach.is_infinite() {
            return self.compliance - libm::log(end);
        }
        self.compliance + libm::acosh((self.reach / end).max(1.0))
    }
}
