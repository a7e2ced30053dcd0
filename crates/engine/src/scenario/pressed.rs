//! The unworn contact in SI units, from which load and motion are resolved.

use super::indenter::Indenter;
use super::load::{CanonicalLoad, CanonicalModuli, press};
use crate::case::{self, Scales};
use crate::contact::reference::at_aperture;
use crate::contact::{Held, Normal, Series, Shape};
use crate::input::{Changing, Faults, Valid};
use crate::numeric::{integrate, root};

/// Minimum width of the slip ring, in a₀, if the stick edge can move.
pub(super) const MIN_RING: f64 = 1e-4;
/// A ring may be narrower than the minimum by this factor. The largest stick ratio gives exactly the minimum, but only
/// before its amplitude is rounded.
pub(super) const ROUNDED: f64 = 1.0 - 1e-6;

/// The unworn contact in SI units, with the normalised shape.
pub(super) struct UnwornContact {
    pub(super) shape: Shape,
    /// The scales. Those that depend on motion and wear are NaN, because they are not known yet.
    pub(super) scales: Scales,
    /// The largest coefficient of friction.
    pub(super) most_friction: f64,
    /// The quantity that is held constant in the normal direction. In a line contact it is the level of the springs, which is
    /// the force.
    pub(super) normal: Normal,
}

/// Half of the tangential force of the unworn contact: ∫₀¹ min(Δ, 1 − g₀) dx.
pub(super) fn half_tangential(shape: &Shape, threshold: f64) -> f64 {
    if threshold >= 1.0 {
        return shape.half_force();
    }
    let stick = shape.image_inverse(1.0 - threshold);
    let ring = 1.0 - stick;
    // The points are dense next to the stick edge, where the image of a power law with n < 2 has its largest
    // curvature.
    let slipping = integrate(0.0, 1.0, |s| {
        let cube = s * s * s;
        4.0 * ring * cube * (1.0 - shape.image(stick + ring * cube * s))
    });
    threshold * stick + slipping
}

impl UnwornContact {
    /// Computes the unworn contact.
    pub(super) fn new(
        indenter: &Indenter,
        load: &CanonicalLoad,
        moduli: CanonicalModuli,
        friction: &Changing,
    ) -> Valid<Self> {
        let values = friction.values();
        let (friction, most_friction) = (values[0], values.iter().copied().fold(0.0, f64::max));
        let (depth, contact_radius, shape) = press(indenter, load, moduli.normal)?;
        let scales = Scales {
            contact_radius,
            indentation_depth: depth,
            cycles: f64::NAN,
            amplitude: f64::NAN,
            normal_modulus: moduli.normal,
            tangential_modulus: moduli.tangential.unwrap_or(f64::NAN),
            friction,
            wear_coefficient: f64::NAN,
            length: indenter.length(),
        };
        Ok(Self {
            shape,
            scales,
            most_friction,
            normal: if indenter.length().is_some() { Normal::Depth } else { load.normal() },
        })
    }

    /// The tangential force Q of the unworn contact at amplitude Δ.
    pub(super) fn tangential_force(&self, threshold: f64) -> f64 {
        2.0 * self.scales.friction * self.scales.force() * half_tangential(&self.shape, threshold)
    }

    /// The amplitude Δ at a tangential force Q < μF.
    pub(super) fn threshold_under(&self, tangential_force: f64) -> f64 {
        let half = tangential_force / (2.0 * self.scales.friction * self.scales.force());
        root(0.0, 1.0, |threshold| half_tangential(&self.shape, threshold) - half)
    }

    pub(super) fn threshold(&self, amplitude: f64) -> f64 {
        case::threshold(amplitude, self.scales.slip())
    }

    /// The held tangential force, and Δ or θ there.
    pub(super) fn under_force(&self, tangential_force: f64) -> Valid<(Held, f64)> {
        let scales = &self.scales;
        if scales.length.is_some() {
            return Ok((Held::Threshold, tangential_force / (scales.friction * scales.force())));
        }
        let force = self.carried(tangential_force)?;
        let half = force / (2.0 * scales.friction * scales.force());
        Ok((Held::Force(half), self.threshold_under(force)))
    }

    /// The held amplitude of an actuator behind a rig, and Δ there.
    pub(super) fn behind_rig(&self, amplitude: f64, rig_stiffness: f64) -> (Held, f64) {
        let Scales { contact_radius, tangential_modulus, .. } = self.scales;
        let compliance = tangential_modulus * contact_radius / rig_stiffness;
        let amplitude = amplitude / self.scales.slip();
        let missing = |threshold: f64| {
            threshold + 2.0 * compliance * half_tangential(&self.shape, threshold) - amplitude
        };
        let threshold = self.threshold(self.scales.slip() * root(0.0, amplitude, missing));
        (Held::Rig { amplitude, compliance }, threshold)
    }

    /// The held aperture of a loop, and Δ or θ there. A reference of a line contact determines what yields between its
    /// points.
    pub(super) fn at_aperture(&self, aperture: f64, reference: Option<Series>) -> (Held, f64) {
        let (aperture, most) = (aperture / self.scales.slip(), self.shape.half_force());
        let threshold = if self.scales.length.is_some() {
            reference.unwrap_or(Series::FAR).at_aperture(&self.shape, aperture).0
        } else {
            let backbone = |half: f64| {
                let force = 2.0 * self.scales.friction * self.scales.force() * half;
                if half < most { self.threshold_under(force) } else { 1.0 }
            };
            let (half, slip) = at_aperture(aperture, most, backbone);
            backbone(half) + slip
        };
        (Held::Aperture(aperture), threshold)
    }

    /// N₀ = a₀/(4 U k_w E*), (18), or a₀/(4 k_w μ F) of a line contact.
    pub(super) fn cycles(&self, amplitude: f64, wear_coefficient: f64) -> f64 {
        let Scales { contact_radius, normal_modulus, friction, length, .. } = self.scales;
        match length {
            None => contact_radius / (4.0 * amplitude * wear_coefficient * normal_modulus),
            Some(length) => {
                let carried = friction * self.scales.force() / length;
                contact_radius / (4.0 * wear_coefficient * carried)
            }
        }
    }

    /// Returns the given tangential force, or a fault if friction cannot carry it.
    pub(super) fn carried(&self, tangential_force: f64) -> Valid<f64> {
        let most = 2.0 * self.scales.friction * self.scales.force() * self.shape.half_force();
        if tangential_force < most * (1.0 - 1e-9) {
            return Ok(tangential_force);
        }
        let detail = format!(
            "is {tangential_force:.6e} N, but friction carries at most μF = {most:.6e} N. Enter a \
             smaller tangential force"
        );
        Err(Faults::one("/motion/tangential_force", detail))
    }
}
