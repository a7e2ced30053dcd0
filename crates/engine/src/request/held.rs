//! The load and the motion of a request.

use deserr::{Deserr, ValuePointerRef};
use serde::Serialize;

use super::fault::Faults;
use super::fields::{
    BlockCycles, Force, Given, Length, List, Position, Rounded, StickRatio, Stiffness, Stroke,
    TangentialForce,
};

/// Maximum number of blocks.
pub const MAX_BLOCKS: usize = 1000;
/// Maximum number of positions in a displacement record.
pub const MAX_REVERSALS: usize = 100_000;
/// The quantity that is held constant in the normal direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserr, Serialize)]
#[deserr(error = Faults, rename_all = lowercase)]
#[serde(rename_all = "lowercase")]
pub enum Normal {
    /// The indentation depth.
    Depth,
    /// The normal force.
    Force,
}

/// The load: force or depth in the normal direction.
#[derive(Debug, Clone, Copy, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields, validate = Load::validate -> Faults)]
pub struct Load {
    /// Normal force F of the unworn contact.
    #[deserr(default)]
    pub normal_force: Given<Rounded<Force>>,
    /// Indentation depth d of the unworn contact.
    #[deserr(default)]
    pub indentation_depth: Given<Rounded<Length>>,
    /// The quantity that is held constant during wear.
    #[deserr(default)]
    pub held: Given<Normal>,
}

impl Load {
    fn validate(self, location: ValuePointerRef<'_>) -> Result<Self, Faults> {
        let here = location.push_key("normal_force");
        match (self.normal_force.0, self.indentation_depth.0) {
            (Some(_), Some(_)) => {
                Err(Faults::at(here, "give either `normal_force` or `indentation_depth`, not both"))
            }
            (None, None) => {
                Err(Faults::at(here, "is missing. Enter `normal_force` or `indentation_depth`"))
            }
            _ => Ok(self),
        }
    }

    /// The held quantity. By default it is the quantity that the request contains.
    pub(crate) fn held(&self) -> Normal {
        let given = if self.normal_force.0.is_some() { Normal::Force } else { Normal::Depth };
        self.held.0.unwrap_or(given)
    }
}

/// The quantity that is held constant in the tangential direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserr, Serialize)]
#[deserr(error = Faults)]
#[serde(rename_all = "snake_case")]
pub enum MotionHeld {
    /// The amplitude.
    #[deserr(rename = "amplitude")]
    Amplitude,
    /// The tangential force.
    #[deserr(rename = "tangential_force")]
    TangentialForce,
}

/// A number of cycles at one amplitude.
#[derive(Debug, Clone, Copy, PartialEq, Deserr, Serialize)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct Block {
    /// Amplitude U. It is 0 for a contact at rest.
    pub amplitude: Rounded<Stroke>,
    /// The number of cycles.
    pub cycles: Rounded<BlockCycles>,
}

/// The motion in the tangential direction.
#[derive(Debug, Clone, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields, validate = Motion::validate -> Faults)]
pub struct Motion {
    /// Amplitude U, half of the peak-to-peak stroke.
    #[deserr(default)]
    pub amplitude: Given<Length>,
    /// Amplitude Q of the tangential force.
    #[deserr(default)]
    pub tangential_force: Given<Rounded<TangentialForce>>,
    /// Stick ratio c/a₀, from which the amplitude U is computed.
    #[deserr(default)]
    pub stick_ratio: Given<StickRatio>,
    /// The quantity that is held constant during wear.
    #[deserr(default)]
    pub held: Given<MotionHeld>,
    /// Stiffness k_rig. With this member, `amplitude` is the amplitude of the actuator.
    #[deserr(default)]
    pub rig_stiffness: Given<Rounded<Stiffness>>,
    /// Blocks of different amplitudes, one after the other.
    #[deserr(default)]
    pub blocks: Given<List<Block, 1, MAX_BLOCKS>>,
    /// The positions at which the contact reverses.
    #[deserr(default)]
    pub reversals: Given<List<Rounded<Position>, 2, MAX_REVERSALS>>,
}

impl Motion {
    fn validate(self, location: ValuePointerRef<'_>) -> Result<Self, Faults> {
        const WAYS: &str =
            "one of `amplitude`, `stick_ratio`, `tangential_force`, `blocks` and `reversals`";
        let given = [
            ("amplitude", self.amplitude.0.is_some()),
            ("stick_ratio", self.stick_ratio.0.is_some()),
            ("tangential_force", self.tangential_force.0.is_some()),
            ("blocks", self.blocks.0.is_some()),
            ("reversals", self.reversals.0.is_some()),
        ];
        let mut names = given.into_iter().filter(|(_, given)| *given).map(|(name, _)| name);
        let fault = |member, detail| Err(Faults::at(location.push_key(member), detail));
        let Some(first) = names.next() else {
            return fault("amplitude", format!("is missing. Enter {WAYS}"));
        };
        if let Some(second) = names.next() {
            return fault(second, format!("cannot be combined with `{first}`. Enter only {WAYS}"));
        }
        let varies = first == "blocks" || first == "reversals";
        if varies && self.held.0 == Some(MotionHeld::TangentialForce) {
            let detail = format!(
                "must be \"amplitude\", because the motion has `{first}`. Enter \"amplitude\", or remove `held`"
            );
            return fault("held", detail);
        }
        let has_rig = self.rig_stiffness.0.is_some();
        if has_rig && varies {
            let detail = format!(
                "cannot be combined with `{first}`. Remove `rig_stiffness`, and enter in `{first}` the motion at the \
                 contact, not at the actuator"
            );
            return fault("rig_stiffness", detail);
        }
        if has_rig && self.tangential() == MotionHeld::TangentialForce {
            let detail = "has no effect if the tangential force is held constant. Remove \
                          `rig_stiffness`, or enter \"held\": \"amplitude\"";
            return fault("rig_stiffness", detail.to_owned());
        }
        if let Some(List(blocks)) = &self.blocks.0
            && blocks[0].amplitude.0 == 0.0
        {
            let here = location.push_key("blocks");
            let here = here.push_index(0);
            let detail =
                "must be greater than 0 in the first block, because this amplitude defines N₀";
            return Err(Faults::at(here.push_key("amplitude"), detail));
        }
        Ok(self)
    }

    /// The held quantity: `held` if it is given, otherwise the tangential force if that is given, otherwise the
    /// amplitude.
    pub(crate) fn tangential(&self) -> MotionHeld {
        self.held.0.unwrap_or(if self.tangential_force.0.is_some() {
            MotionHeld::TangentialForce
        } else {
            MotionHeld::Amplitude
        })
    }
}
