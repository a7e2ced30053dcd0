//! The indenter: as people describe it, in canonical form, and pressed into the ground.
//!
//! # Equations
//! ```text
//! g₀(a₀) = d₀,   F₀ = 2E* ∫ (d₀ − g₀) dx over 0…a₀                     (7)–(9)
//! ```
//!
//! # Units
//! SI; [`Shape`] is normalised by a₀ and d₀.

use deserr::{Deserr, ErrorKind, IntoValue, Map, Value, ValueKind, ValuePointerRef};
use serde::Serialize;

use super::fault::{Faults, refuse};
use super::numeric::{root, twelve_digits};
use super::profile::{Shape, kappa};
use super::request::{Exponent, Length, SlopeAngle};

/// The shape of the indenter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Profile {
    /// f = r²/(2R).
    Paraboloid(Ball),
    /// f = R − √(R² − r²).
    Sphere(Ball),
    /// f = r·tan θ.
    Cone(Cone),
    /// f = height·(r/at_radius)ⁿ.
    Power(Power),
}

/// The radius of a paraboloid or a sphere.
#[derive(Debug, Clone, Copy, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct Ball {
    /// R.
    pub radius: Length,
}

/// The slope of a cone.
#[derive(Debug, Clone, Copy, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct Cone {
    /// θ, from the plane.
    pub slope_angle: SlopeAngle,
}

/// The parameters of a power law.
#[derive(Debug, Clone, Copy, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct Power {
    /// n.
    pub exponent: Exponent,
    /// f at `at_radius`.
    pub height: Length,
    /// Where f is `height`.
    pub at_radius: Length,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserr)]
#[deserr(error = Faults, rename_all = lowercase)]
enum ShapeName {
    Paraboloid,
    Sphere,
    Cone,
    Power,
}

// By hand, because `deserr` does not say which tags of an enum it accepts.
impl Deserr<Faults> for Profile {
    fn deserialize_from_value<V: IntoValue>(
        value: Value<V>,
        location: ValuePointerRef<'_>,
    ) -> Result<Self, Faults> {
        let Value::Map(mut map) = value else {
            let accepted = &[ValueKind::Map];
            return Err(refuse(
                ErrorKind::IncorrectValueKind { actual: value, accepted },
                location,
            ));
        };
        let Some(shape) = map.remove("shape") else {
            return Err(refuse::<V>(ErrorKind::MissingField { field: "shape" }, location));
        };
        let here = location.push_key("shape");
        let shape = ShapeName::deserialize_from_value(shape.into_value(), here)?;
        let rest = Value::<V>::Map(map);
        Ok(match shape {
            ShapeName::Paraboloid => {
                Self::Paraboloid(Ball::deserialize_from_value(rest, location)?)
            }
            ShapeName::Sphere => Self::Sphere(Ball::deserialize_from_value(rest, location)?),
            ShapeName::Cone => Self::Cone(Cone::deserialize_from_value(rest, location)?),
            ShapeName::Power => Self::Power(Power::deserialize_from_value(rest, location)?),
        })
    }
}

/// Largest a₀/R of a sphere: beyond, half-space theory has no meaning.
pub(super) const MAX_SPHERE: f64 = 0.6;
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "shape", rename_all = "snake_case")]
pub(super) enum CanonicalProfile {
    Paraboloid { radius: f64 },
    Sphere { radius: f64 },
    Cone { slope_angle: f64 },
    Power { exponent: f64, height: f64, at_radius: f64 },
}

pub(super) fn canonical_profile(profile: &Profile) -> CanonicalProfile {
    match profile {
        Profile::Paraboloid(ball) => {
            CanonicalProfile::Paraboloid { radius: twelve_digits(ball.radius.0) }
        }
        Profile::Sphere(ball) => CanonicalProfile::Sphere { radius: twelve_digits(ball.radius.0) },
        Profile::Cone(cone) => {
            CanonicalProfile::Cone { slope_angle: twelve_digits(cone.slope_angle.0) }
        }
        Profile::Power(power) => CanonicalProfile::Power {
            exponent: twelve_digits(power.exponent.0),
            height: twelve_digits(power.height.0),
            at_radius: twelve_digits(power.at_radius.0),
        },
    }
}

/// (n, h, b) of a power law, written as g = h·(x/b)ⁿ.
fn power_image(profile: &CanonicalProfile) -> Option<(f64, f64, f64)> {
    match *profile {
        CanonicalProfile::Paraboloid { radius } => Some((2.0, radius, radius)),
        CanonicalProfile::Cone { slope_angle } => {
            Some((1.0, std::f64::consts::FRAC_PI_2 * libm::tan(slope_angle), 1.0))
        }
        CanonicalProfile::Power { exponent, height, at_radius } => {
            Some((exponent, kappa(exponent) * height, at_radius))
        }
        CanonicalProfile::Sphere { .. } => None,
    }
}

/// a₀ and the normalised shape at indentation depth d; `None` beyond what half-space theory allows.
pub(super) fn indent(profile: &CanonicalProfile, depth: f64) -> Option<(f64, Shape)> {
    if let Some((n, height, at_radius)) = power_image(profile) {
        let ratio = depth / height;
        let radius = at_radius
            * match n {
                1.0 => ratio,
                2.0 => ratio.sqrt(),
                _ => libm::pow(ratio, 1.0 / n),
            };
        return Some((radius, Shape::power(n)));
    }
    let CanonicalProfile::Sphere { radius } = *profile else {
        return None;
    };
    let depth_at = |share: f64| share * libm::atanh(share);
    if depth_at(MAX_SPHERE) < depth / radius {
        return None;
    }
    // A shallow contact has d/R = (a/R)², a deeper one more.
    let guess = (depth / radius).sqrt();
    let share = root(0.5 * guess, guess.min(MAX_SPHERE), |s| depth_at(s) - depth / radius);
    Some((share * radius, Shape::sphere(1.0 / share)))
}

/// d under a force F, given as F/E* in m².
pub(super) fn depth_under(profile: &CanonicalProfile, force: f64) -> f64 {
    if let Some((n, height, at_radius)) = power_image(profile) {
        // F/E* = (2n/(n+1))·a·d with a = b·(d/h)^(1/n).
        let radius_times_depth = force * (n + 1.0) / (2.0 * n);
        let relative = radius_times_depth / (at_radius * height);
        return height * libm::pow(relative, n / (n + 1.0));
    }
    let CanonicalProfile::Sphere { radius } = *profile else {
        return f64::INFINITY;
    };
    let depth_at = |share: f64| radius * share * libm::atanh(share);
    let force_at = |share: f64| {
        2.0 * share * radius * depth_at(share) * Shape::sphere(1.0 / share).half_force()
    };
    if force_at(MAX_SPHERE) < force {
        return f64::INFINITY;
    }
    let guess = libm::cbrt(0.75 * force / (radius * radius));
    let share = root(0.5 * guess, guess.min(MAX_SPHERE), |s| force_at(s) - force);
    depth_at(share)
}
