//! The load and the motion of a request.

use deserr::{Deserr, IntoValue, Value, ValuePointerRef};
use serde::Serialize;

use super::fault::{Faults, pointer};
use super::fields::{
    BlockCycles, BlockForce, Force, Given, Length, List, Position, Rounded, StickRatio, Stiffness,
    Stroke, TangentialForce, Total,
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
    pub normal_force: Given<Total<Force>>,
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

    /// Checks the load of a contact with this length, and makes totals of forces per length. A round contact has no
    /// length.
    pub(super) fn fit(&mut self, length: Option<f64>) -> Result<(), Faults> {
        const INSTEAD: &str = "The depth of a line contact depends on the size of the bodies. Enter \
                               `normal_force`, such as \"18.5 N/mm\"";
        let mut faults = Faults::default();
        self.normal_force.multiply(length, "/normal_force", &mut faults);
        if length.is_some() {
            if self.indentation_depth.0.is_some() {
                faults.add("/indentation_depth", format!("applies to a round contact. {INSTEAD}"));
            } else if self.held.0 == Some(Normal::Depth) {
                let detail = format!("must be \"force\" for a line contact. {INSTEAD}");
                faults.add("/held", detail);
            }
        }
        faults.or(())
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Block {
    /// Amplitude U. It is 0 for a contact at rest.
    pub amplitude: Rounded<Stroke>,
    /// The number of cycles.
    pub cycles: Rounded<BlockCycles>,
}

/// A number of cycles at one amplitude of the tangential force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ForceBlock {
    /// Amplitude Q of the tangential force. It is 0 for a contact at rest.
    pub tangential_force: Total<BlockForce>,
    /// The number of cycles.
    pub cycles: Rounded<BlockCycles>,
}

/// The blocks of a motion, 1 to [`MAX_BLOCKS`], all of the same kind.
#[derive(Debug, Clone, PartialEq)]
pub enum Blocks {
    /// Blocks of amplitudes.
    Strokes(Vec<Block>),
    /// Blocks of tangential forces.
    Forces(Vec<ForceBlock>),
}

/// A block as the client gives it.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields, validate = GivenBlock::validate -> Faults)]
struct GivenBlock {
    #[deserr(default)]
    amplitude: Given<Rounded<Stroke>>,
    #[deserr(default)]
    tangential_force: Given<Total<BlockForce>>,
    cycles: Rounded<BlockCycles>,
}

impl GivenBlock {
    fn validate(self, location: ValuePointerRef<'_>) -> Result<Self, Faults> {
        let (member, detail) = match (self.amplitude.0, self.tangential_force.0) {
            (None, None) => (
                "amplitude",
                "is missing. Enter `amplitude`, or, for a line contact, `tangential_force`",
            ),
            (Some(_), Some(_)) => (
                "tangential_force",
                "cannot be combined with `amplitude`. Enter only one of both in all blocks",
            ),
            _ => return Ok(self),
        };
        Err(Faults::at(location.push_key(member), detail))
    }
}

impl Deserr<Faults> for Blocks {
    fn deserialize_from_value<V: IntoValue>(
        value: Value<V>,
        location: ValuePointerRef<'_>,
    ) -> Result<Self, Faults> {
        let List(given) =
            List::<GivenBlock, 1, MAX_BLOCKS>::deserialize_from_value(value, location)?;
        let (mut strokes, mut forces) = (Vec::new(), Vec::new());
        for block in &given {
            let cycles = block.cycles;
            strokes.extend(block.amplitude.0.map(|amplitude| Block { amplitude, cycles }));
            let force = block.tangential_force.0;
            forces.extend(force.map(|tangential_force| ForceBlock { tangential_force, cycles }));
        }
        let has_force = |block: &GivenBlock| block.tangential_force.0.is_some();
        let kind = |force| if force { "tangential_force" } else { "amplitude" };
        let first = has_force(&given[0]);
        let mut faults = Faults::default();
        for (index, _) in given.iter().enumerate().filter(|(_, it)| has_force(it) != first) {
            let here = location.push_index(index);
            let detail = format!(
                "differs from the first block. Enter `{0}` in all blocks, as in the first one",
                kind(first)
            );
            faults.add(pointer(here.push_key(kind(!first))), detail);
        }
        let rests = if first {
            forces.first().is_some_and(|block| block.tangential_force.0 == 0.0)
        } else {
            strokes.first().is_some_and(|block| block.amplitude.0 == 0.0)
        };
        if rests {
            let here = location.push_index(0);
            let detail =
                "must be greater than 0 in the first block, because this amplitude defines N₀";
            faults.add(pointer(here.push_key(kind(first))), detail);
        }
        faults.or(if first { Self::Forces(forces) } else { Self::Strokes(strokes) })
    }
}

/// What the stroke of a line contact is measured against. The displacement of a half-plane has no bound, so a stroke
/// needs one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reference {
    /// Points of the surface at this distance from the middle of the contact, in m. `rig_stiffness` in N/m lies in
    /// series.
    Distance {
        /// The distance L in m.
        distance: f64,
        /// The stiffness of the rig in N/m.
        rig_stiffness: Option<f64>,
    },
    /// The slope dQ/dU of a measured loop just after a reversal, in N/m. It contains the rig.
    Loop {
        /// The slope in N/m.
        stiffness: f64,
    },
}

/// The motion in the tangential direction.
#[derive(Debug, Clone, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields, validate = Motion::validate -> Faults)]
pub struct Motion {
    /// Amplitude U, half of the peak-to-peak stroke. In a line contact it needs a [`Reference`].
    #[deserr(default)]
    pub amplitude: Given<Length>,
    /// Amplitude of the sliding at a line contact, half of the peak-to-peak stroke.
    #[deserr(default)]
    pub sliding_amplitude: Given<Rounded<Length>>,
    /// Amplitude Q of the tangential force.
    #[deserr(default)]
    pub tangential_force: Given<Total<TangentialForce>>,
    /// Stick ratio c/a₀. In a round contact the amplitude U is computed from it, in a line contact the tangential
    /// force Q.
    #[deserr(default)]
    pub stick_ratio: Given<StickRatio>,
    /// The quantity that is held constant during wear.
    #[deserr(default)]
    pub held: Given<MotionHeld>,
    /// Stiffness k_rig. With this member, `amplitude` is the amplitude of the actuator.
    #[deserr(default)]
    pub rig_stiffness: Given<Total<Stiffness>>,
    /// The distance from the middle of a line contact to the points whose relative motion is the stroke.
    #[deserr(default)]
    pub reference_distance: Given<Rounded<Length>>,
    /// The slope of a measured loop of a line contact just after a reversal.
    #[deserr(default)]
    pub loop_stiffness: Given<Total<Stiffness>>,
    /// Blocks of different amplitudes, one after the other.
    #[deserr(default)]
    pub blocks: Given<Blocks>,
    /// The positions at which the contact reverses.
    #[deserr(default)]
    pub reversals: Given<List<Rounded<Position>, 2, MAX_REVERSALS>>,
}

impl Motion {
    /// Checks what does not depend on the geometry of the contact.
    fn validate(self, location: ValuePointerRef<'_>) -> Result<Self, Faults> {
        const WAYS: &str = "one of `amplitude`, `stick_ratio`, `tangential_force`, `blocks`, `reversals` and, for \
                            a line contact, `sliding_amplitude`";
        let given = [
            ("amplitude", self.amplitude.0.is_some()),
            ("sliding_amplitude", self.sliding_amplitude.0.is_some()),
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
        if let Err(detail) = self.check_held(false) {
            return fault("held", detail);
        }
        if self.loop_stiffness.0.is_some() {
            for (member, given) in [
                ("reference_distance", self.reference_distance.0.is_some()),
                ("rig_stiffness", self.rig_stiffness.0.is_some()),
            ] {
                if given {
                    let detail = format!(
                        "cannot be combined with `loop_stiffness`, which contains all that yields. Remove `{member}`"
                    );
                    return fault(member, detail);
                }
            }
        }
        Ok(self)
    }

    /// Checks `held` for the motions that can hold only one quantity. Several motions of a round contact can hold
    /// either.
    fn check_held(&self, is_line: bool) -> Result<(), String> {
        use MotionHeld::{Amplitude, TangentialForce};
        let (motion, only) = match &self.blocks.0 {
            Some(Blocks::Forces(_)) => ("blocks", TangentialForce),
            Some(Blocks::Strokes(_)) => ("blocks", Amplitude),
            None if self.reversals.0.is_some() => ("reversals", Amplitude),
            None if self.sliding_amplitude.0.is_some() => ("sliding_amplitude", Amplitude),
            None if !is_line => return Ok(()),
            None if self.amplitude.0.is_some() => ("amplitude", Amplitude),
            None if self.stick_ratio.0.is_some() => ("stick_ratio", TangentialForce),
            None => ("tangential_force", TangentialForce),
        };
        if self.held.0.is_none_or(|held| held == only) {
            return Ok(());
        }
        let word = if only == Amplitude { "amplitude" } else { "tangential_force" };
        let place = if is_line { " of a line contact" } else { "" };
        Err(format!(
            "must be \"{word}\", because the motion{place} has `{motion}`. Enter \"{word}\", or remove `held`"
        ))
    }

    /// Checks the motion of a contact with this length, and makes totals of quantities per length. A round contact has
    /// no length.
    pub(super) fn fit(&mut self, length: Option<f64>) -> Result<(), Faults> {
        let mut faults = Faults::default();
        self.tangential_force.multiply(length, "/tangential_force", &mut faults);
        self.rig_stiffness.multiply(length, "/rig_stiffness", &mut faults);
        self.loop_stiffness.multiply(length, "/loop_stiffness", &mut faults);
        if let Some(Blocks::Forces(blocks)) = &mut self.blocks.0
            && length.is_some()
        {
            for (index, block) in blocks.iter_mut().enumerate() {
                let place = format!("/blocks/{index}/tangential_force");
                faults.keep(&place, block.tangential_force.multiply(length));
            }
        }
        if length.is_some() {
            self.check_line(&mut faults);
        } else {
            self.check_round(&mut faults);
        }
        faults.or(())
    }

    /// Refuses what only a line contact has, and a rig beside motions that are measured at the contact.
    fn check_round(&self, faults: &mut Faults) {
        let varies = if self.blocks.0.is_some() {
            Some("blocks")
        } else {
            self.reversals.0.is_some().then_some("reversals")
        };
        if self.rig_stiffness.0.is_some() {
            if let Some(varies) = varies {
                let detail = format!(
                    "cannot be combined with `{varies}`. Remove `rig_stiffness`, and enter in `{varies}` the motion \
                     at the contact, not at the actuator"
                );
                faults.add("/rig_stiffness", detail);
            } else if self.tangential() == MotionHeld::TangentialForce {
                let detail = "has no effect if the tangential force is held constant. Remove \
                              `rig_stiffness`, or enter \"held\": \"amplitude\"";
                faults.add("/rig_stiffness", detail);
            }
        }
        let mut refuse = |member: &str, is_given: bool, instead: &str| {
            if is_given {
                faults.add(member, format!("applies to a line contact only. {instead}"));
            }
        };
        refuse(
            "/sliding_amplitude",
            self.sliding_amplitude.0.is_some(),
            "Enter `amplitude` instead, such as \"25 um\"",
        );
        refuse(
            "/reference_distance",
            self.reference_distance.0.is_some(),
            "The amplitude of a round contact needs no reference. Remove `reference_distance`",
        );
        refuse(
            "/loop_stiffness",
            self.loop_stiffness.0.is_some(),
            "Remove it. If something yields between the actuator and the contact, enter its stiffness as \
             `rig_stiffness`, such as \"10 N/um\"",
        );
        refuse(
            "/blocks/0/tangential_force",
            matches!(self.blocks.0, Some(Blocks::Forces(_))),
            "Enter `amplitude` in all blocks, such as \"2 um\"",
        );
    }

    /// Refuses what a line contact does not have, and strokes without a reference.
    fn check_line(&self, faults: &mut Faults) {
        if self.reversals.0.is_some() {
            let detail = "applies to a round contact only. For a line contact, enter `blocks` of tangential forces, \
                          such as [{\"tangential_force\": \"4 N/mm\", \"cycles\": 1000}]";
            faults.add("/reversals", detail);
            return;
        }
        if let Err(detail) = self.check_held(true) {
            faults.add("/held", detail);
        }
        let stroke = if self.amplitude.0.is_some() {
            Some("/amplitude")
        } else {
            matches!(self.blocks.0, Some(Blocks::Strokes(_))).then_some("/blocks/0/amplitude")
        };
        let given = [
            ("/reference_distance", self.reference_distance.0.is_some()),
            ("/loop_stiffness", self.loop_stiffness.0.is_some()),
            ("/rig_stiffness", self.rig_stiffness.0.is_some()),
        ];
        match stroke {
            Some(place) if self.reference().is_none() => faults.add(
                place,
                "needs a reference, because the displacement of a half-plane has no bound. Add \
                 `reference_distance` to the motion, the distance from the middle of the contact to the points \
                 whose relative motion is the stroke, such as \"10 mm\". Or add `loop_stiffness`, the slope of a \
                 measured loop after a reversal. If the whole contact slides, enter `sliding_amplitude` instead",
            ),
            Some(_) => {}
            // A reference defines the displacements of loops.
            None if self.sliding_amplitude.0.is_none()
                && (self.rig_stiffness.0.is_none() || self.reference_distance.0.is_some()) => {}
            None => {
                for (member, _) in given.into_iter().filter(|(_, given)| *given) {
                    let detail = format!(
                        "has no effect, because this motion of a line contact needs no reference. Remove `{}`, or \
                         enter an `amplitude`",
                        &member[1..]
                    );
                    faults.add(member, detail);
                }
            }
        }
    }

    /// What the stroke of a line contact is measured against.
    #[must_use]
    pub fn reference(&self) -> Option<Reference> {
        let rig_stiffness = self.rig_stiffness.0.map(|stiffness| stiffness.0);
        let distance = self.reference_distance.0;
        distance
            .map(|distance| Reference::Distance { distance: distance.0, rig_stiffness })
            .or(self.loop_stiffness.0.map(|stiffness| Reference::Loop { stiffness: stiffness.0 }))
    }

    /// The quantity that a round contact holds: `held` if it is given, otherwise the tangential force if that is given,
    /// otherwise the amplitude.
    pub(crate) fn tangential(&self) -> MotionHeld {
        self.held.0.unwrap_or(if self.tangential_force.0.is_some() {
            MotionHeld::TangentialForce
        } else {
            MotionHeld::Amplitude
        })
    }
}
