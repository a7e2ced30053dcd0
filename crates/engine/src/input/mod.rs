//! The request: a scenario in the form in which a client sends it.
//!
//! Each type corresponds to one object of the JSON Schema, whose members are in `inputs`. `deserr` parses all members and collects
//! all faults. The module `scenario` does the checks that need contact
//! mechanics.

pub mod changing;
pub mod fault;
pub mod fields;
pub mod forms;
pub mod held;
pub mod indenter;
pub mod inputs;
pub mod instants;
pub mod quantity;
pub mod wear;

use deserr::{Deserr, IntoValue as _, ValuePointerRef};
use serde::Serialize;

use changing::{Changing, Course};
use fault::{Faults, Pointer, Valid};
use fields::{
    Bodies, DissipatedEnergy, Friction, Given, GivenXi, Length, PointCount, PoissonRatio, Rounded,
    Stress, Tolerance, Volume,
};
use held::{Load, Motion};
use indenter::Profile;
use instants::{Cycles, ProfilesAt};
use wear::{Wear, WearLaw};

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
#[derive(Debug, Clone, Copy, PartialEq, Deserr, Serialize)]
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

/// One elastic body.
#[derive(Debug, Clone, Copy, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct ElasticBody {
    /// Young's modulus E.
    pub youngs_modulus: Stress,
    /// Poisson's ratio ν.
    pub poisson_ratio: PoissonRatio,
    /// Yield strength. It is used for a warning only.
    #[deserr(default)]
    pub yield_strength: Given<Stress>,
}

/// The effective moduli.
#[derive(Debug, Clone, Copy, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct Moduli {
    /// Normal modulus E*.
    pub normal: Stress,
    /// Tangential modulus G*. It has no meaning for a line contact.
    #[deserr(default)]
    pub tangential: Given<Stress>,
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
