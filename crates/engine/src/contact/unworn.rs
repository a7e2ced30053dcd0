//! The unworn contact and its limiting state, in dimensionless form.

use std::sync::Arc;

use super::course::Moment;
use super::layers::Layers;
use super::{Course, Geometry, Limit, Series, Shape};

/// The regime of the unworn contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Regime {
    /// Nothing slips.
    FullStick,
    /// A ring slips around a core that sticks.
    PartialSlip,
    /// The whole contact slips.
    GrossSlip,
}

/// The unworn contact and its limiting state in dimensionless form.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// The unworn shape.
    pub shape: Shape,
    /// Dimensionless amplitude: Δ = G*U/(μE*d₀), or Q/(μF₀) in a line contact. A spring with a smaller compression slips.
    pub threshold: f64,
    /// Stick ratio c/a₀; 0 in gross slip.
    pub stick: f64,
    /// The slip regime: partial or gross slip.
    pub regime: Regime,
    /// The limiting state. A line contact in gross slip has none; there it is that of a narrow core, which gives the run
    /// a time scale and a first size.
    pub limit: Limit,
    /// What the displacements of a line contact are measured against. Without it they are not defined.
    pub reference: Option<Series>,
    /// How its coefficients change; `None` if they are constant.
    pub course: Option<Arc<Course>>,
    /// The layers of its bodies; `None` if all wear has the same coefficient.
    pub layers: Option<Arc<Layers>>,
}

/// The stick radius of the limiting state that gives a line contact in gross slip its scales.
const NARROW_CORE: f64 = 0.05;

impl Contact {
    /// The contact of `shape` at amplitude Δ > 0. `None` if its scar would become larger than the
    /// shape.
    pub fn new(shape: Shape, threshold: f64) -> Option<Self> {
        let stick = shape.stick_radius(threshold);
        let regime = if stick > 0.0 { Regime::PartialSlip } else { Regime::GrossSlip };
        let limit = match shape.geometry() {
            Geometry::Line if stick == 0.0 => Limit::solve(&shape, NARROW_CORE)?,
            _ => Limit::solve(&shape, stick)?,
        };
        let (reference, course, layers) = (None, None, None);
        Some(Self { shape, threshold, stick, regime, limit, reference, course, layers })
    }

    /// Whether the coefficient of friction changes.
    pub(crate) fn changes_friction(&self) -> bool {
        self.course.as_ref().is_some_and(|course| course.friction.is_some())
    }

    /// The largest coefficients of friction and wear of the whole run, relative to those at cycle 0.
    pub(crate) fn largest_coefficients(&self) -> Moment {
        let none = Moment { friction: 1.0, wear: 1.0 };
        let Moment { friction, wear } = self.course.as_ref().map_or(none, |it| it.largest());
        let of_layers = self.layers.as_ref().map_or(1.0, |layers| layers.steepest());
        Moment { friction, wear: wear * of_layers }
    }

    /// The contact of `shape` whose springs stick inside the radius 0 ≤ c < 1.
    pub fn sticking(shape: Shape, c: f64) -> Option<Self> {
        let threshold = 1.0 - shape.image(c);
        Self::new(shape, threshold)
    }

    /// The Δ to which N₀ belongs: dw/dÑ = p·s·Δ/Δ₀. N₀ of a line contact does not depend on the motion.
    pub(crate) fn reference_threshold(&self) -> f64 {
        match self.shape.geometry() {
            Geometry::Round => self.threshold,
            Geometry::Line => 1.0,
        }
    }

    /// Δ − y₀ of a spring at x = c + δ: the compression that is missing for stick. The value is
    /// never 0, so that 0/0 cannot occur after e has underflowed.
    pub(crate) fn rest(&self, delta: f64) -> f64 {
        let excess = (self.threshold - 1.0).max(0.0);
        (excess + self.shape.image_rise(self.stick, delta)).max(1e-300)
    }

    /// The compression η of a spring at x = c + δ, c < x < ã, by the closed form of (14).
    pub fn compression(&self, delta: f64, decay: Decay) -> f64 {
        let rest = self.rest(delta);
        let unworn = self.threshold - rest;
        if unworn <= 0.0 {
            return unworn * decay.left;
        }
        self.threshold * unworn * decay.left / (unworn * decay.left + rest)
    }

    /// g − g₀ of a spring at x = c + δ: y₀ minus the compression, without cancellation.
    pub fn worn(&self, delta: f64, decay: Decay) -> f64 {
        let rest = self.rest(delta);
        let unworn = self.threshold - rest;
        if unworn <= 0.0 {
            return unworn * decay.gone;
        }
        unworn * rest * decay.gone / (unworn * decay.left + rest)
    }
}

/// The decay factor of the simplified rule, e = exp(−ξÑ/ã), and 1 − e without cancellation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decay {
    /// The decay factor e.
    pub left: f64,
    /// 1 − e, computed without cancellation.
    pub gone: f64,
}

impl Decay {
    /// The unworn state.
    pub const UNWORN: Self = Self { left: 1.0, gone: 0.0 };
    /// The limiting state.
    pub const COMPLETE: Self = Self { left: 0.0, gone: 1.0 };

    /// The decay after an exponent ξÑ/ã ≥ 0.
    pub fn after(exponent: f64) -> Self {
        Self { left: libm::exp(-exponent), gone: -libm::expm1(-exponent) }
    }
}
