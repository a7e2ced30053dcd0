//! The load in canonical form, and the unworn contact under this load.

use std::f64::consts::FRAC_2_PI;

use serde::Serialize;

use super::indenter::{Indenter, depth_under, indent};
use crate::contact::Shape;
use crate::input::fields::derived;
use crate::input::held::Normal;
use crate::input::{Force, Length, Request, Valid};
use crate::numeric::twelve_digits;

/// The effective moduli, in Pa.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct CanonicalModuli {
    pub(super) normal: f64,
    /// A line contact has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) tangential: Option<f64>,
}

/// The load in canonical form.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
pub(super) enum CanonicalLoad {
    Depth { indentation_depth: f64, held: Normal },
    Force { normal_force: f64, held: Normal },
}

impl CanonicalLoad {
    pub(super) fn normal(&self) -> Normal {
        let (Self::Depth { held, .. } | Self::Force { held, .. }) = *self;
        held
    }
}

/// Converts the load of a request to canonical form.
#[expect(clippy::expect_used, reason = "the request was validated")]
pub(super) fn canonical_load(
    request: &Request,
    indenter: &Indenter,
    normal_modulus: f64,
) -> Valid<CanonicalLoad> {
    let given = &request.load;
    let by_depth =
        |indentation_depth| CanonicalLoad::Depth { indentation_depth, held: Normal::Depth };
    let by_force = |normal_force| CanonicalLoad::Force { normal_force, held: Normal::Force };
    let load = match (given.held(), given.normal_force.0, given.indentation_depth.0) {
        (Normal::Force, Some(force), _) => by_force(force.0),
        (Normal::Depth, _, Some(depth)) => by_depth(depth.0),
        (Normal::Depth, Some(force), None) => {
            let load = by_force(force.0);
            let (depth, _, _) = press(indenter, &load, normal_modulus)?;
            by_depth(twelve_digits(depth))
        }
        (Normal::Force, None, depth) => {
            let load = by_depth(depth.expect("a request without one of the two is refused").0);
            let (depth, contact_radius, shape) = press(indenter, &load, normal_modulus)?;
            let force = 2.0 * normal_modulus * contact_radius * depth * shape.half_force();
            derived(force, Force::RANGE, "a normal force of", "N", "/load/indentation_depth")?;
            by_force(twelve_digits(force))
        }
        (Normal::Depth, None, None) => unreachable!("a request without either is refused"),
    };
    Ok(load)
}

/// The unworn contact: d, a₀ and the normalised shape. Of a line contact: 2F/(πE*), a₀ and the shape.
pub(super) fn press(
    indenter: &Indenter,
    load: &CanonicalLoad,
    normal_modulus: f64,
) -> Valid<(f64, f64, Shape)> {
    if let (Some(length), CanonicalLoad::Force { normal_force, .. }) = (indenter.length(), load) {
        let per_length = normal_force / (normal_modulus * length);
        let depth = FRAC_2_PI * per_length;
        let refused = || indenter.refusal(depth, "/load/normal_force");
        let (half_width, shape) = indenter.under_line_load(per_length).ok_or_else(refused)?;
        return Ok((depth, half_width, shape));
    }
    let (depth, pointer) = match *load {
        CanonicalLoad::Force { normal_force, .. } => {
            (depth_under(indenter, normal_force / normal_modulus), "/load/normal_force")
        }
        CanonicalLoad::Depth { indentation_depth, .. } => {
            (indentation_depth, "/load/indentation_depth")
        }
    };
    let (contact_radius, shape) =
        indent(indenter, depth).ok_or_else(|| indenter.refusal(depth, pointer))?;
    derived(depth, Length::RANGE, "an indentation depth of", "m", pointer)?;
    match indenter.split(&shape) {
        Some(faults) => Err(faults),
        None => Ok((depth, contact_radius, shape)),
    }
}
