//! The load in canonical form, and the unworn contact under this load.

use serde::Serialize;

use super::indenter::{CanonicalProfile, depth_under, indent};
use crate::contact::control::Normal;
use crate::contact::profile::Shape;
use crate::numeric::twelve_digits;
use crate::request::Request;
use crate::request::fault::Faults;
use crate::request::fields::{Force, Length, derived};
use crate::request::held::LoadHeld;

/// The effective moduli, in Pa.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct CanonicalModuli {
    pub(super) normal: f64,
    pub(super) tangential: f64,
}

/// The load in canonical form.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
pub(super) enum CanonicalLoad {
    Depth { indentation_depth: f64, held: LoadHeld },
    Force { normal_force: f64, held: LoadHeld },
}

impl CanonicalLoad {
    pub(super) fn normal(&self) -> Normal {
        match self {
            Self::Depth { .. } => Normal::Depth,
            Self::Force { .. } => Normal::Force,
        }
    }
}

/// Converts the load of a request to canonical form.
#[expect(clippy::expect_used, reason = "the request was validated")]
pub(super) fn canonical_load(
    request: &Request,
    profile: &CanonicalProfile,
    normal_modulus: f64,
) -> Result<CanonicalLoad, Faults> {
    let given = &request.load;
    let by_depth = |depth: f64| CanonicalLoad::Depth {
        indentation_depth: twelve_digits(depth),
        held: LoadHeld::Depth,
    };
    let by_force = |force: f64| CanonicalLoad::Force {
        normal_force: twelve_digits(force),
        held: LoadHeld::Force,
    };
    let load = match (given.held(), given.normal_force.0, given.indentation_depth.0) {
        (LoadHeld::Force, Some(force), _) => by_force(force.0),
        (LoadHeld::Depth, _, Some(depth)) => by_depth(depth.0),
        (LoadHeld::Depth, Some(force), None) => {
            let load = by_force(force.0);
            let (depth, _, _) = press(profile, &load, normal_modulus)?;
            by_depth(depth)
        }
        (LoadHeld::Force, None, depth) => {
            let load = by_depth(depth.expect("a request without one of the two is refused").0);
            let (depth, contact_radius, shape) = press(profile, &load, normal_modulus)?;
            let force = 2.0 * normal_modulus * contact_radius * depth * shape.half_force();
            derived(force, Force::RANGE, "a normal force of", "N", "/load/indentation_depth")?;
            by_force(force)
        }
        (LoadHeld::Depth, None, None) => unreachable!("a request without either is refused"),
    };
    Ok(load)
}

/// The unworn contact: d, a₀ and the normalised shape.
pub(super) fn press(
    profile: &CanonicalProfile,
    load: &CanonicalLoad,
    normal_modulus: f64,
) -> Result<(f64, f64, Shape), Faults> {
    let (depth, pointer) = match *load {
        CanonicalLoad::Force { normal_force, .. } => {
            (depth_under(profile, normal_force / normal_modulus), "/load/normal_force")
        }
        CanonicalLoad::Depth { indentation_depth, .. } => {
            (indentation_depth, "/load/indentation_depth")
        }
    };
    let (contact_radius, shape) =
        indent(profile, depth).ok_or_else(|| Faults(vec![profile.refusal(depth, pointer)]))?;
    derived(depth, Length::RANGE, "an indentation depth of", "m", pointer)?;
    if let Some(fault) = profile.split(&shape) {
        return Err(Faults(vec![fault]));
    }
    Ok((depth, contact_radius, shape))
}
