//! The load and the motion of a request.

use deserr::Deserr;
use serde::Serialize;

use super::fault::{Faults, Pointer, Valid, pointer};
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
    fn validate(self, location: Pointer<'_>) -> Valid<Self> {
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
    pub(super) fn fit(&mut self, length: Option<f64>) -> Valid<()> {
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

/// A number of cycles with one held motion, which is 0 for a contact at rest.
#[derive(Debug, Clone, Copy, PartialEq, Deserr, Serialize)]
#[deserr(error = Faults, deny_unknown_fields, validate = BlockInput::validate -> Faults)]
pub struct BlockInput {
    /// Amplitude U.
    #[deserr(default)]
    #[serde(skip_serializing_if = "Given::is_absent")]
    pub amplitude: Given<Rounded<Stroke>>,
    /// Amplitude Q of the tangential force, in place of U.
    #[deserr(default)]
    #[serde(skip_serializing_if = "Given::is_absent")]
    pub tangential_force: Given<Total<BlockForce>>,
    /// Aperture δ₀ of the loop, in place of U.
    #[deserr(default)]
    #[serde(skip_serializing_if = "Given::is_absent")]
    pub loop_aperture: Given<Rounded<Stroke>>,
    /// The number of cycles.
    pub cycles: Rounded<BlockCycles>,
}

impl BlockInput {
    fn validate(self, location: Pointer<'_>) -> Valid<Self> {
        let mut names = self.given().into_iter().flatten().map(|(name, _)| name);
        let (member, detail) = match (names.next(), names.next()) {
            (None, _) => (
                "amplitude",
                "is missing. Enter `amplitude` or `loop_aperture`, or, for a line contact, `tangential_force`".to_owned(),
            ),
            (Some(first), Some(second)) => {
                let detail = format!("cannot be combined with `{first}`. Enter only one of both in all blocks");
                (second, detail)
            }
            _ => return Ok(self),
        };
        Err(Faults::at(location.push_key(member), detail))
    }

    /// The names of the given motions, of which a valid block has one, and their sizes.
    fn given(&self) -> [Option<(&'static str, f64)>; 3] {
        [
            self.amplitude.0.map(|amplitude| ("amplitude", amplitude.0)),
            self.tangential_force.0.map(|force| ("tangential_force", force.0)),
            self.loop_aperture.0.map(|aperture| ("loop_aperture", aperture.0)),
        ]
    }

    /// Whether the block holds a tangential force.
    pub fn is_force(&self) -> bool {
        self.tangential_force.0.is_some()
    }

    /// The name of the held motion.
    pub(crate) fn member(&self) -> &'static str {
        self.given().into_iter().flatten().next().map_or("amplitude", |(name, _)| name)
    }

    /// The size of the held motion.
    pub(crate) fn held(&self) -> f64 {
        self.given().into_iter().flatten().next().map_or(0.0, |(_, size)| size)
    }
}

/// The blocks of a motion, all of the same kind.
#[derive(Debug, Clone, PartialEq, Deserr)]
#[deserr(error = Faults, from(List<BlockInput, 1, MAX_BLOCKS>) = Blocks::from, validate = Blocks::validate -> Faults)]
pub struct Blocks(pub Vec<BlockInput>);

impl Blocks {
    fn from(given: List<BlockInput, 1, MAX_BLOCKS>) -> Self {
        Self(given.0)
    }

    fn validate(self, location: Pointer<'_>) -> Valid<Self> {
        let first = self.0[0];
        let mut faults = Faults::default();
        let others = self.0.iter().enumerate().filter(|(_, it)| it.member() != first.member());
        for (index, block) in others {
            let detail = format!(
                "differs from the first block. Enter `{}` in all blocks, as in the first one",
                first.member()
            );
            let here = location.push_index(index);
            faults.add(pointer(here.push_key(block.member())), detail);
        }
        if first.held() == 0.0 {
            let here = location.push_index(0);
            let detail = "must be greater than 0 in the first block, because this block defines N₀";
            faults.add(pointer(here.push_key(first.member())), detail);
        }
        faults.or(self)
    }
}

/// What lies between the contact and the place of its amplitude. The displacement of a half-plane has no bound, so the
/// stroke of a line contact needs a distance or a loop.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Reference {
    /// Points of the surface at this distance from the middle of the contact, in m. `rig_stiffness` in N/m lies in
    /// series.
    Distance {
        /// The distance L in m.
        reference_distance: f64,
        /// The stiffness of the rig in N/m.
        #[serde(skip_serializing_if = "Option::is_none")]
        rig_stiffness: Option<f64>,
    },
    /// The slope dQ/dU of a measured loop just after a reversal, in N/m. It contains the rig.
    Loop {
        /// The slope in N/m.
        loop_stiffness: f64,
    },
    /// The rig between a round contact and the actuator.
    Rig {
        /// The stiffness of the rig in N/m.
        rig_stiffness: f64,
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
    /// Aperture δ₀ of the loop: half of its width without force.
    #[deserr(default)]
    pub loop_aperture: Given<Rounded<Length>>,
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
    fn validate(self, location: Pointer<'_>) -> Valid<Self> {
        const WAYS: &str = "one of `amplitude`, `loop_aperture`, `stick_ratio`, `tangential_force`, `blocks`, `reversals` \
                            and, for a line contact, `sliding_amplitude`";
        let given = [
            self.amplitude.named("amplitude"),
            self.sliding_amplitude.named("sliding_amplitude"),
            self.loop_aperture.named("loop_aperture"),
            self.stick_ratio.named("stick_ratio"),
            self.tangential_force.named("tangential_force"),
            self.blocks.named("blocks"),
            self.reversals.named("reversals"),
        ];
        let mut names = given.into_iter().flatten();
        let fault = |member, detail| Err(Faults::at(location.push_key(member), detail));
        let Some(first) = names.next() else {
            return fault("amplitude", format!("is missing. Enter {WAYS}"));
        };
        if let Some(second) = names.next() {
            return fault(second, format!("cannot be combined with `{first}`. Enter only {WAYS}"));
        }
        if self.holds_aperture() && self.held.0.is_some() {
            return fault(
                "held",
                "has no effect, because the aperture of the loop is held. Remove `held`".to_owned(),
            );
        }
        if let Err(detail) = self.check_held(false) {
            return fault("held", detail);
        }
        let distance = self.reference_distance.named("reference_distance");
        let other = distance.or(self.rig_stiffness.named("rig_stiffness"));
        if let (Some(member), Some(_)) = (other, self.loop_stiffness.0) {
            let detail = format!(
                "cannot be combined with `loop_stiffness`, which contains all that yields. Remove `{member}`"
            );
            return fault(member, detail);
        }
        Ok(self)
    }

    /// Whether the apertures of the loops are held.
    pub(super) fn holds_aperture(&self) -> bool {
        let blocks = self.blocks.0.as_ref().map(|blocks| blocks.0[0].member());
        self.loop_aperture.0.is_some() || blocks == Some("loop_aperture")
    }

    /// Checks `held` for the motions that can hold only one quantity. Several motions of a round contact can hold
    /// either.
    fn check_held(&self, is_line: bool) -> Result<(), String> {
        use MotionHeld::{Amplitude, TangentialForce};
        let (motion, only) = match &self.blocks.0 {
            Some(blocks) if blocks.0[0].is_force() => ("blocks", TangentialForce),
            Some(_) => ("blocks", Amplitude),
            None if self.reversals.0.is_some() => ("reversals", Amplitude),
            None if self.sliding_amplitude.0.is_some() => ("sliding_amplitude", Amplitude),
            None if self.loop_aperture.0.is_some() => return Ok(()),
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
    pub(super) fn fit(&mut self, length: Option<f64>) -> Valid<()> {
        let mut faults = Faults::default();
        self.tangential_force.multiply(length, "/tangential_force", &mut faults);
        self.rig_stiffness.multiply(length, "/rig_stiffness", &mut faults);
        self.loop_stiffness.multiply(length, "/loop_stiffness", &mut faults);
        if length.is_some() {
            let blocks = self.blocks.0.iter_mut().flat_map(|blocks| &mut blocks.0);
            for (index, block) in blocks.enumerate() {
                let place = format!("/blocks/{index}/tangential_force");
                block.tangential_force.multiply(length, &place, &mut faults);
            }
            self.check_line(&mut faults);
        } else {
            self.check_round(&mut faults);
        }
        faults.or(())
    }

    /// Refuses what only a line contact has, and a rig beside motions that are measured at the contact.
    fn check_round(&self, faults: &mut Faults) {
        let varies = self.blocks.named("blocks").or(self.reversals.named("reversals"));
        if self.rig_stiffness.0.is_some() {
            if self.holds_aperture() {
                faults.add(
                    "/rig_stiffness",
                    "does not change the aperture of a loop. Remove `rig_stiffness`",
                );
            } else if let Some(varies) = varies {
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
        let forces = self.blocks.0.as_ref().filter(|blocks| blocks.0[0].is_force());
        for (member, instead) in [
            (
                self.sliding_amplitude.named("/sliding_amplitude"),
                "Enter `amplitude` instead, such as \"25 um\"",
            ),
            (
                self.reference_distance.named("/reference_distance"),
                "The amplitude of a round contact needs no reference. Remove `reference_distance`",
            ),
            (
                self.loop_stiffness.named("/loop_stiffness"),
                "Remove it. If something yields between the actuator and the contact, enter its stiffness as \
                 `rig_stiffness`, such as \"10 N/um\"",
            ),
            (
                forces.map(|_| "/blocks/0/tangential_force"),
                "Enter `amplitude` or `loop_aperture` in all blocks, such as \"2 um\"",
            ),
        ] {
            let Some(member) = member else { continue };
            faults.add(member, format!("applies to a line contact only. {instead}"));
        }
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
        let strokes = self.blocks.0.as_ref().filter(|blocks| blocks.0[0].member() == "amplitude");
        let strokes = strokes.map(|_| "/blocks/0/amplitude");
        let given = [
            self.reference_distance.named("/reference_distance"),
            self.loop_stiffness.named("/loop_stiffness"),
            self.rig_stiffness.named("/rig_stiffness"),
        ];
        match self.amplitude.named("/amplitude").or(strokes) {
            Some(place) if self.reference().is_none() => faults.add(
                place,
                "needs a reference, because the displacement of a half-plane has no bound. Add \
                 `reference_distance` to the motion, the distance from the middle of the contact to the points \
                 whose relative motion is the stroke, such as \"10 mm\". Or add `loop_stiffness`, the slope of a \
                 measured loop after a reversal. If the whole contact slides, enter `sliding_amplitude` instead",
            ),
            None if self.sliding_amplitude.0.is_some() => {
                for member in given.into_iter().flatten() {
                    let detail = format!(
                        "has no effect, because the sliding of a line contact needs no reference. Remove `{}`, or enter \
                         an `amplitude`",
                        &member[1..]
                    );
                    faults.add(member, detail);
                }
            }
            // A reference defines the displacements of loops.
            None if self.rig_stiffness.0.is_some() && self.reference_distance.0.is_none() => faults.add(
                "/rig_stiffness",
                "has no effect without a reference. Remove `rig_stiffness`, or add `reference_distance`, such as \
                 \"10 mm\"",
            ),
            _ => {}
        }
    }

    /// What the stroke of a line contact is measured against.
    pub fn reference(&self) -> Option<Reference> {
        let rig_stiffness = self.rig_stiffness.0.map(|stiffness| stiffness.0);
        let distance = self.reference_distance.0.map(|it| it.0);
        let distance = distance
            .map(|reference_distance| Reference::Distance { reference_distance, rig_stiffness });
        distance.or(self.loop_stiffness.0.map(|it| Reference::Loop { loop_stiffness: it.0 }))
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

super::rows::rows! {
    /// Normal force F of the unworn contact; for a line contact also per length, such as "18.5 N/mm".
    "/load/normal_force": Of("Force"), "Normal force", "$F$", FORCE;
    /// Approach d of the bodies in the unworn contact; only for a round contact.
    "/load/indentation_depth": Of("Length"), "Indentation depth", "$d$", MICRO;
    /// What stays as it is while the contact wears. By default what is given. A line contact holds the force.
    "/load/held": Word(&["force", "depth"]), "Load: kept constant", "", PLAIN;
    /// Amplitude U: HALF of the peak-to-peak stroke, at the contact, of a line contact at its reference, or with `rig_stiffness` at
    /// the actuator. At least 1e-6 of the gross-slip amplitude.
    "/motion/amplitude": Of("Length"), "Amplitude@", "$U$", MICRO;
    /// Only for a line contact that slides as a whole: amplitude of the sliding at the contact, HALF of the peak-to-peak stroke, less
    /// what the bodies and the rig yield.
    "/motion/sliding_amplitude": Of("Length"), "Sliding amplitude", "", MICRO;
    /// Aperture δ₀ of the friction loop: HALF of its width where the tangential force is zero. What is linear in the force, such as a
    /// rig, does not change it. Below gross slip, a run ends when the core that carries the load begins to slip.
    "/motion/loop_aperture": Of("Length"), "Aperture of the loop", "$δ$₀", MICRO;
    /// c/a₀ of the unworn contact, which sets the amplitude at the contact, or for a line contact the tangential force; 0 is the onset
    /// of gross slip.
    "/motion/stick_ratio": Of("StickRatio"), "Stick ratio", "$c$/$a$₀", RATIO;
    /// Amplitude Q of the tangential force in the unworn contact, below μF.
    "/motion/tangential_force": Of("TangentialForce"), "Tangential force", "$Q$", FORCE;
    /// Only for a line contact: the distance from its middle to the points on the surfaces of both bodies whose relative motion is the
    /// stroke. With it, the result has displacements.
    "/motion/reference_distance": Of("Length"), "Reference distance", "", RADIUS;
    /// Stiffness of what lies between actuator and contact; only with the amplitude held, and for a line contact only beside
    /// `reference_distance`.
    "/motion/rig_stiffness": Of("Stiffness"), "Rig stiffness", "", STIFFNESS;
    /// Only for a line contact, instead of `reference_distance`: the slope dQ/dU of a measured loop just after a reversal. It contains
    /// the rig.
    "/motion/loop_stiffness": Of("Stiffness"), "Loop stiffness", "", STIFFNESS;
    /// What stays as it is while the contact wears. By default the amplitude, unless a tangential force is given. A line contact, blocks
    /// and reversals hold what is given.
    "/motion/held": Word(&["amplitude", "tangential_force"]), "Motion: kept constant", "", PLAIN;
    /// Amplitudes one after the other, each for some cycles; cycles count through. N₀ is that of the first. All hold amplitudes, which
    /// for a line contact need a reference, or apertures, or for a line contact tangential forces.
    "/motion/blocks": List("Block", 1, MAX_BLOCKS), "Amplitude blocks", "", PLAIN;
    /// Amplitude U of the block; 0 lets the contact rest (not in the first block).
    "/motion/blocks/#/amplitude": Of("Stroke"), "Block #: amplitude@", "", MICRO;
    /// Amplitude Q of the tangential force of the block, as text also per length; 0 lets the contact rest (not in the first block).
    "/motion/blocks/#/tangential_force": Of("BlockForce"), "Block #: tangential force", "", FORCE;
    /// Aperture δ₀ of the loops of the block; 0 lets the contact rest (not in the first block).
    "/motion/blocks/#/loop_aperture": Of("Stroke"), "Block #: aperture of the loop", "", MICRO;
    /// How many cycles it lasts.
    "/motion/blocks/#/cycles": Of("BlockCycles"), "Block #: cycles", "", PLAIN;
    /// Only for a round contact: positions between which it moves, again and again. One cycle is one pass of the record, from its first
    /// position to its last and back to the first. Their mean does not matter.
    "/motion/reversals": List("Position", 2, MAX_REVERSALS), "Displacement record", "", MICRO;
    "/motion/reversals/#": Part, "Position #", "", MICRO;

    forms:
    /// The force of the unworn contact.
    ByForce "/load" ["normal_force"] ["held"];
    /// The depth of the unworn contact.
    ByDepth "/load" round ["indentation_depth"] ["held"];
    /// A given amplitude.
    ByAmplitude "/motion" ["amplitude"] ["held", "rig_stiffness", "reference_distance", "loop_stiffness"]
        r#"{"amplitude": "2.256 um"}"#;
    /// A given amplitude of the sliding.
    Sliding "/motion" line ["sliding_amplitude"] ["held=amplitude"]
        r#"{"sliding_amplitude": "10 um"}"#;
    /// A given aperture of the friction loop.
    ByAperture "/motion" ["loop_aperture"] ["rig_stiffness", "reference_distance", "loop_stiffness"]
        r#"{"loop_aperture": "10 um"}"#;
    /// A given stick ratio.
    ByStickRatio "/motion" ["stick_ratio"] ["held", "rig_stiffness", "reference_distance", "loop_stiffness"]
        r#"{"stick_ratio": 0.5}"#;
    /// A given tangential force.
    ByTangentialForce "/motion" ["tangential_force"] ["held", "rig_stiffness", "reference_distance", "loop_stiffness"]
        r#"{"tangential_force": "15 N"}"#;
    /// Amplitudes one after the other.
    Blocks "/motion" ["blocks"] ["held", "rig_stiffness", "reference_distance", "loop_stiffness"]
        r#"{"blocks": [{"amplitude": "2 um", "cycles": 50000}, {"amplitude": "1 um", "cycles": 50000}]}"#;
    /// A displacement record.
    Reversals "/motion" round ["reversals"] ["held=amplitude"]
        r#"{"reversals": ["2.2 um", "-1.4 um", "0.6 um", "-2.2 um"]}"#;
    /// A stretch of cycles of one amplitude.
    AmplitudeBlock "/motion/blocks/#" ["amplitude", "cycles"] [];
    /// A stretch of cycles of one amplitude of the tangential force.
    ForceBlock "/motion/blocks/#" ["tangential_force", "cycles"] [];
    /// A stretch of cycles of one aperture of the loop.
    ApertureBlock "/motion/blocks/#" ["loop_aperture", "cycles"] [];
}
