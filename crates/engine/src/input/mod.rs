//! The request: a scenario in the form in which a client sends it.
//!
//! Each type corresponds to one object of the JSON Schema. The rows of its members follow the type. `deserr` parses all members and
//! collects all faults. The module `scenario` does the checks that need contact mechanics.

pub mod bodies;
pub mod changing;
pub mod fault;
pub mod fields;
pub mod held;
pub mod indenter;
pub mod inputs;
pub mod instants;
pub mod quantity;
pub mod rows;
pub mod wear;

use deserr::{Deserr, IntoValue as _, ValuePointerRef};
use serde::Serialize;

pub use bodies::ElasticBody;
use bodies::Moduli;
use changing::Course;
pub use changing::{ChangeTable, Changing};
pub use fault::{Fault, Faults, Pointer, Valid, unknown};
use fields::{
    Bodies, DissipatedEnergy, Friction, POINTS_RANGE, PointCount, Rounded, Tolerance, Volume,
};
pub use fields::{Force, Given, GivenXi, LAST_CYCLE, Length, List, Stress, WearCoefficient, Xi};
use held::Load;
pub use held::{Blocks, Motion, MotionHeld, Reference};
pub use indenter::{Profile, TableProfile};
pub use instants::{Cycles, Measure, ProfilesAt, ProfilesWord};
pub use quantity::Dimension;
pub use wear::{Wear, WearLaw, WornBody};

/// A scenario as the client sends it.
#[derive(Debug, Clone, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields, validate = Request::validate -> Faults)]
pub struct Request {
    /// The indenter.
    pub profile: Profile,
    /// The two bodies. The first one carries the profile. The alternative is `moduli`.
    #[deserr(default)]
    pub bodies: Given<Bodies<ElasticBody>>,
    /// The effective moduli E* and G*. The alternative is `bodies`.
    #[deserr(default)]
    pub moduli: Given<Moduli>,
    /// Coefficient of friction μ.
    pub friction: Course<Friction>,
    /// The wear coefficients and the share of each body.
    pub wear: Wear,
    /// The load in the normal direction.
    pub load: Load,
    /// The motion in the tangential direction.
    pub motion: Motion,
    /// The output cycles.
    pub cycles: Cycles,
    /// The output cycles with profiles.
    #[deserr(default)]
    pub profiles_at: Given<ProfilesAt>,
    /// The condition that ends the run early.
    #[deserr(default)]
    pub until: Given<Until>,
    /// The method and its parameters.
    #[deserr(default)]
    pub model: Model,
}

/// The wear or the energy at which a run ends early.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserr, Serialize)]
#[deserr(error = Faults, deny_unknown_fields, validate = Until::validate -> Faults)]
pub struct Until {
    /// The maximum wear depth.
    #[deserr(default)]
    #[serde(skip_serializing_if = "Given::is_absent")]
    pub wear_depth: Given<Rounded<Length>>,
    /// The wear volume V.
    #[deserr(default)]
    #[serde(skip_serializing_if = "Given::is_absent")]
    pub wear_volume: Given<Rounded<Volume>>,
    /// The dissipated energy ΣW.
    #[deserr(default)]
    #[serde(skip_serializing_if = "Given::is_absent")]
    pub dissipated_energy: Given<Rounded<DissipatedEnergy>>,
}

impl Until {
    fn validate(self, location: Pointer<'_>) -> Valid<Self> {
        const WAYS: &str = "`wear_depth`, `wear_volume` or `dissipated_energy`";
        let fault = |member, detail| Err(Faults::at(location.push_key(member), detail));
        let given = [
            self.wear_depth.named("wear_depth"),
            self.wear_volume.named("wear_volume"),
            self.dissipated_energy.named("dissipated_energy"),
        ];
        let mut names = given.into_iter().flatten();
        match (names.next(), names.next()) {
            (None, _) => fault("wear_depth", format!("is missing. Enter {WAYS}")),
            (_, Some(second)) => fault(second, format!("give only one of {WAYS}")),
            _ => Ok(self),
        }
    }
}

impl Request {
    /// Reads a scenario as the client sends it. This function is not generic, so the code of all members is compiled only
    /// in this crate.
    ///
    /// # Errors
    /// All faults that show without contact mechanics.
    pub fn read(document: serde_json::Value) -> Valid<Self> {
        Self::deserialize_from_value(document.into_value(), ValuePointerRef::Origin)
    }

    /// Checks members that depend on each other.
    fn validate(mut self, _: Pointer<'_>) -> Valid<Self> {
        let mut faults = Faults::default();
        match (self.bodies.0.is_some(), self.moduli.0.is_some()) {
            (true, true) => faults.add("/moduli", "give either `bodies` or `moduli`, not both"),
            (false, false) => faults
                .add("/bodies", "is missing. Enter the two `bodies`, or their effective `moduli`"),
            _ => {}
        }
        let length = self.profile.length();
        let has_tangential = self.moduli.0.is_none_or(|it| it.tangential.0.is_some());
        if length.is_none() && !has_tangential {
            faults.add("/moduli/tangential", "is missing. Enter `tangential`");
        }
        if matches!(self.wear.law, WearLaw::Layered(_)) && self.motion.blocks.0.is_some() {
            let detail = "cannot be combined with layers of the bodies. Enter one motion, or remove `layers`";
            faults.add("/motion/blocks", detail);
        }
        faults.keep("/load", self.load.fit(length));
        faults.keep("/motion", self.motion.fit(length));
        let obstacle = match (&self.friction.0, &self.wear.law) {
            _ if length.is_some() => Some("this is a line contact"),
            (Changing::Table(_), _) => Some("this friction changes"),
            (_, WearLaw::PerLoad(Changing::Table(_))) => Some("this wear coefficient changes"),
            (_, WearLaw::Layered(_)) => Some("these bodies have layers"),
            _ if self.motion.holds_aperture() => Some("the aperture of the loop is held"),
            _ => None,
        };
        if let Some(obstacle) = obstacle {
            faults.keep("/model", self.model.check_exact(obstacle));
        }
        faults.or(self)
    }
}

/// The method by which wear is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserr)]
#[deserr(error = Faults, rename_all = lowercase)]
pub enum MethodName {
    /// The exact method: the wear rate is local pressure times local slip.
    #[default]
    Exact,
    /// The simplified rule (14).
    Simplified,
}

/// The method and its parameters.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct Model {
    /// The method by which wear is computed.
    #[deserr(default)]
    pub method: MethodName,
    /// The parameter ξ of the simplified rule.
    #[deserr(default)]
    pub xi: GivenXi,
    /// The target relative error of the exact method.
    #[deserr(default)]
    pub tolerance: Given<Tolerance>,
    /// Whether an exact run is compared with the simplified rule.
    #[deserr(default)]
    pub compare: Given<bool>,
    /// The number of output radii.
    #[deserr(default)]
    pub points: Given<PointCount>,
}

impl Model {
    /// Refuses the simplified rule and what belongs to it. `obstacle` says why.
    fn check_exact(&self, obstacle: &str) -> Valid<()> {
        let mut faults = Faults::default();
        for (member, is_given, remedy) in [
            (
                "/method",
                self.method == MethodName::Simplified,
                "Enter \"exact\", or remove `method`",
            ),
            ("/xi", matches!(self.xi, GivenXi::Number(_)), "Remove `xi`"),
            ("/compare", self.compare.0 == Some(true), "Enter false, or remove `compare`"),
        ] {
            if is_given {
                let detail = format!(
                    "needs the simplified rule, which holds for a round contact with constant friction and without \
                     layers, but {obstacle}. {remedy}"
                );
                faults.add(member, detail);
            }
        }
        faults.or(())
    }
}

rows::rows! {
    /// The tangential force over the normal force where the surfaces slip.
    "/friction": Part, "Friction coefficient", "$μ$", FRICTION;
    "/friction/run_in/cycles": Part, "Run-in cycles of μ", "", PLAIN;
    "/friction/run_in/from": Part, "μ at the start", "", FRICTION;
    "/friction/run_in/to": Part, "μ after the run-in", "", FRICTION;
    "/friction/over": Part, "μ changes over", "", PLAIN;
    "/friction/at?over=dissipated_energy": Part, "Points of the table of μ", "", ENERGY;
    "/friction/at": Part, "Points of the table of μ", "", PLAIN;
    "/friction/values": Part, "Values of μ", "", FRICTION;
    /// The numbers of cycles after which the result has numbers and curves. The last one ends the run.
    "/cycles": Part, "Output cycles", "", PLAIN;
    /// The output cycles as multiples of N₀, the characteristic cycles of the contact.
    "/cycles/normalized": Part, "Output cycles in N₀", "", PLAIN;
    "/cycles/dissipated_energy": Part, "Dissipated energies of the outputs", "", ENERGY;
    /// The output cycles at which the result has profiles; by default all.
    "/profiles_at": Part, "Cycles with profiles", "", PLAIN;
    /// Largest wear depth.
    "/until/wear_depth": Of("Length"), "Stop at wear depth", "", MICRO;
    /// Wear volume of both bodies.
    "/until/wear_volume": Of("Volume"), "Stop at wear volume", "", VOLUME;
    /// Energy dissipated since the start.
    "/until/dissipated_energy": Of("DissipatedEnergy"), "Stop at dissipated energy", "", ENERGY;
    /// `exact` wears by local pressure times local slip. `simplified` is the rule (14) of the paper, an approximation for comparison with
    /// the paper. It is fast only with depth and amplitude held, and it needs a round contact, constant coefficients and no layers. By
    /// default `exact`.
    "/model/method": Word(&["exact", "simplified"]), "Method", "", PLAIN;
    /// The parameter ξ of the rule (14). `auto`, the default, computes ξ = √(0.33 + 0.20/(1 − c/a₀)) from the stick ratio c/a₀ of the
    /// unworn contact at the largest amplitude (0 in gross slip); the canonical scenario holds the number. The paper uses 0.8. The exact
    /// method uses ξ only for `compare`.
    "/model/xi": Either(&["Auto", "Xi"]), "Fitting parameter", "$ξ$", PLAIN;
    /// The relative error of wear volume and depth at which the exact method aims, no bound: the result states its errors. The simplified
    /// rule ignores it. By default 0.003.
    "/model/tolerance": Of("Tolerance"), "Tolerance", "", PLAIN;
    /// Run the simplified rule beside an exact run, where that rule applies: `comparison` then holds its history, its errors and the ξ that
    /// fits best. The simplified rule ignores it. By default false.
    "/model/compare": Flag, "Compare with simplified rule", "", PLAIN;
    /// Radii of a profile; the volume is right to about 1e-4 at 256, with second order up to 512. More radii only make the curves denser. By
    /// default 256.
    "/model/points": Whole(POINTS_RANGE.0, POINTS_RANGE.1), "Points of a profile", "", PLAIN;

    forms:
    /// A largest depth.
    UntilDepth "/until" ["wear_depth"] [];
    /// A wear volume.
    UntilVolume "/until" ["wear_volume"] [];
    /// A dissipated energy.
    UntilEnergy "/until" ["dissipated_energy"] [];
    /// How wear is computed.
    Model "/model" [] ["method", "xi", "tolerance", "compare", "points"];
}
