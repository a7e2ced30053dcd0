//! The request: a scenario in the form in which a client sends it.
//!
//! Each type corresponds to one object of the JSON Schema (`scenario.schema.json`). `deserr` parses
//! all members and collects all faults. The module `scenario` does the checks that need contact
//! mechanics.

pub mod fault;
pub mod fields;
pub mod held;
pub mod indenter;
pub mod instants;
pub mod quantity;

use deserr::{Deserr, IntoValue, Sequence, Value, ValuePointerRef};
use serde::Serialize;

use fault::Faults;
use fields::{
    DissipatedEnergy, EnergyWear, Friction, Given, GivenXi, Length, NumberOrText, PointCount,
    PoissonRatio, Rounded, Share, Stress, Tolerance, Volume, WEAR_RANGE, within,
};
use held::{Load, Motion};
use indenter::Profile;
use instants::{Cycles, ProfilesAt};
use quantity::Dimension;

/// A scenario as the client sends it.
#[derive(Debug, Clone, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields, validate = Request::validate -> Faults)]
pub struct Request {
    /// The indenter.
    pub profile: Profile,
    /// The two bodies. The first one carries the profile. The alternative is `moduli`.
    #[deserr(default)]
    pub bodies: Given<Bodies>,
    /// The effective moduli E* and G*. The alternative is `bodies`.
    #[deserr(default)]
    pub moduli: Given<Moduli>,
    /// Coefficient of friction μ.
    pub friction: Rounded<Friction>,
    /// The wear coefficient and the share of each body.
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
    fn validate(self, location: ValuePointerRef<'_>) -> Result<Self, Faults> {
        const WAYS: &str = "`wear_depth`, `wear_volume` or `dissipated_energy`";
        let fault = |member, detail| Err(Faults::at(location.push_key(member), detail));
        let given = [
            ("wear_depth", self.wear_depth.0.is_some()),
            ("wear_volume", self.wear_volume.0.is_some()),
            ("dissipated_energy", self.dissipated_energy.0.is_some()),
        ];
        let mut names = given.into_iter().filter(|(_, given)| *given).map(|(name, _)| name);
        match (names.next(), names.next()) {
            (None, _) => fault("wear_depth", format!("is missing. Enter {WAYS}")),
            (_, Some(second)) => fault(second, format!("give only one of {WAYS}")),
            _ => Ok(self),
        }
    }
}

impl Request {
    fn validate(self, location: ValuePointerRef<'_>) -> Result<Self, Faults> {
        let fault = |member, detail| Err(Faults::at(location.push_key(member), detail));
        match (self.bodies.0.is_some(), self.moduli.0.is_some()) {
            (true, true) => fault("moduli", "give either `bodies` or `moduli`, not both"),
            (false, false) => {
                fault("bodies", "is missing. Enter the two `bodies`, or their effective `moduli`")
            }
            _ => Ok(self),
        }
    }
}

/// The two bodies of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bodies(pub [ElasticBody; 2]);

impl Deserr<Faults> for Bodies {
    fn deserialize_from_value<V: IntoValue>(
        value: Value<V>,
        location: ValuePointerRef<'_>,
    ) -> Result<Self, Faults> {
        if let Value::Sequence(list) = &value
            && list.len() != 2
        {
            let detail = format!("must list exactly two bodies, not {}", list.len());
            return Err(Faults::at(location, detail));
        }
        let bodies = Vec::<ElasticBody>::deserialize_from_value(value, location)?;
        <[ElasticBody; 2]>::try_from(bodies)
            .map(Self)
            .map_err(|_| Faults::at(location, "must list exactly two bodies"))
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
    /// Tangential modulus G*.
    pub tangential: Stress,
}

/// The wear coefficient: k_w, or k with the hardness, or the energy wear coefficient α.
#[derive(Debug, Clone, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields, validate = Wear::validate -> Faults)]
pub struct Wear {
    /// The wear coefficient k_w, or the dimensionless k together with `hardness`.
    #[deserr(default)]
    coefficient: Given<NumberOrText>,
    /// Hardness σ₀.
    #[deserr(default)]
    hardness: Given<Stress>,
    /// Energy wear coefficient α.
    #[deserr(default)]
    energy_coefficient: Given<EnergyWear>,
    /// The share of the wear depth on the first body, which carries the profile.
    #[deserr(default)]
    pub share: Given<Rounded<Share>>,
    #[deserr(skip)]
    per_load: f64,
}

impl Wear {
    fn validate(mut self, location: ValuePointerRef<'_>) -> Result<Self, Faults> {
        let here = location.push_key("coefficient");
        let at = |detail: String| Faults::at(here, detail);
        let dimension = match self.hardness.0 {
            Some(_) => Dimension::Number,
            None => Dimension::WearCoefficient,
        };
        match (&self.coefficient.0, self.hardness.0, self.energy_coefficient.0) {
            (None, None, Some(_)) => return Ok(self),
            (Some(_), _, Some(_)) => {
                return Err(at(
                    "give either `coefficient` or `energy_coefficient`, not both".to_owned()
                ));
            }
            (None, _, _) => {
                return Err(at(
                    "is missing. Enter `coefficient` or `energy_coefficient`. With `hardness`, \
                     `coefficient` is the dimensionless wear coefficient k. Without `hardness`, it is the \
                     wear coefficient k_w, such as \"2e-5 mm^3/(N m)\""
                        .to_owned(),
                ));
            }
            (Some(NumberOrText::Number(x)), _, None) => self.per_load = *x,
            (Some(NumberOrText::Text(text)), _, None) => {
                self.per_load = quantity::parse(text, dimension).map_err(at)?;
            }
        }
        let hardness = self.hardness.0.map_or(1.0, |hardness| hardness.0);
        self.per_load = within(self.per_load / hardness, WEAR_RANGE, "1/Pa", here)?;
        Ok(self)
    }

    /// The wear coefficient k_w in 1/Pa.
    pub(crate) fn coefficient(&self, friction: f64) -> f64 {
        self.energy_coefficient.0.map_or(self.per_load, |alpha| alpha.0 * friction)
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
