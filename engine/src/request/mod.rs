//! A scenario as people write it: types that parse themselves and report every fault at once.
//!
//! Each type here mirrors one object of the JSON Schema (`scenario.schema.json`); `deserr` walks
//! them and collects the faults of all members instead of stopping at the first. What only the
//! physics can judge is left to the module `scenario`.

pub mod fault;
pub mod fields;
pub mod held;
pub mod indenter;
pub mod instants;
pub mod quantity;

use deserr::{Deserr, IntoValue, Sequence, Value, ValuePointerRef};

use fault::Faults;
use fields::{
    EnergyWear, Friction, Given, Length, NumberOrText, PointCount, PoissonRatio, Share, Stress,
    Tolerance, Volume, WEAR_RANGE, Xi, within,
};
use held::{Load, Motion};
use indenter::Profile;
use instants::{Cycles, ProfilesAt};
use quantity::Dimension;

/// The body of a scenario.
#[derive(Debug, Clone, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields, validate = Request::validate -> Faults)]
pub struct Request {
    /// The indenter.
    pub profile: Profile,
    /// The two bodies, or `moduli`.
    #[deserr(default)]
    pub bodies: Given<Bodies>,
    /// E* and G*, or `bodies`.
    #[deserr(default)]
    pub moduli: Given<Moduli>,
    /// μ.
    pub friction: Friction,
    /// The wear coefficient.
    pub wear: Wear,
    /// The normal direction.
    pub load: Load,
    /// The tangential direction.
    pub motion: Motion,
    /// The instants of the history.
    pub cycles: Cycles,
    /// Which instants carry profiles.
    #[deserr(default)]
    pub profiles_at: Given<ProfilesAt>,
    /// Where the run ends early.
    #[deserr(default)]
    pub until: Given<Until>,
    /// Method and resolution.
    #[deserr(default)]
    pub model: Model,
}

/// Wear at which a run ends early.
#[derive(Debug, Clone, Copy, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields, validate = Until::validate -> Faults)]
pub struct Until {
    /// The largest wear.
    #[deserr(default)]
    pub wear_depth: Given<Length>,
    /// V.
    #[deserr(default)]
    pub wear_volume: Given<Volume>,
}

impl Until {
    fn validate(self, location: ValuePointerRef<'_>) -> Result<Self, Faults> {
        match (self.wear_depth.0, self.wear_volume.0) {
            (None, None) => Err(Faults::at(
                location.push_key("wear_depth"),
                "is missing: give `wear_depth` or `wear_volume`",
            )),
            (Some(_), Some(_)) => Err(Faults::at(
                location.push_key("wear_volume"),
                "give either `wear_depth` or `wear_volume`, not both",
            )),
            _ => Ok(self),
        }
    }
}

impl Request {
    fn validate(self, location: ValuePointerRef<'_>) -> Result<Self, Faults> {
        match (self.bodies.0.is_some(), self.moduli.0.is_some()) {
            (true, true) => Err(Faults::at(
                location.push_key("moduli"),
                "give either `bodies` or `moduli`, not both",
            )),
            (false, false) => Err(Faults::at(
                location.push_key("bodies"),
                "is missing: give the two `bodies`, or their effective `moduli`",
            )),
            _ => Ok(self),
        }
    }
}

/// Exactly two bodies.
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
    /// E.
    pub youngs_modulus: Stress,
    /// ν.
    pub poisson_ratio: PoissonRatio,
    /// Yield strength, to be warned by.
    #[deserr(default)]
    pub yield_strength: Given<Stress>,
}

/// The effective moduli.
#[derive(Debug, Clone, Copy, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct Moduli {
    /// E*.
    pub normal: Stress,
    /// G*.
    pub tangential: Stress,
}

/// The wear coefficient, in one of three ways.
#[derive(Debug, Clone, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields, validate = Wear::validate -> Faults)]
pub struct Wear {
    /// k_w, or the dimensionless k where `hardness` is given.
    #[deserr(default)]
    coefficient: Given<NumberOrText>,
    /// σ₀.
    #[deserr(default)]
    hardness: Given<Stress>,
    /// α.
    #[deserr(default)]
    energy_coefficient: Given<EnergyWear>,
    /// How the depth is split between the bodies.
    #[deserr(default)]
    pub share: Given<Share>,
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
                return Err(at("give either `coefficient` or `energy_coefficient`".to_owned()));
            }
            (None, _, _) => {
                return Err(at(
                    "is missing: give `coefficient` (k_w, or k beside `hardness`), or \
                               `energy_coefficient` alone"
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

    /// k_w in 1/Pa.
    pub(crate) fn coefficient(&self, friction: f64) -> f64 {
        self.energy_coefficient.0.map_or(self.per_load, |alpha| alpha.0 * friction)
    }
}

/// How wear is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserr)]
#[deserr(error = Faults, rename_all = lowercase)]
pub enum MethodName {
    /// The rule (14).
    #[default]
    Simplified,
    /// Local pressure times local slip.
    Exact,
}

/// Method and resolution.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct Model {
    /// The method.
    #[deserr(default)]
    pub method: MethodName,
    /// ξ, of the simplified rule.
    #[deserr(default)]
    pub xi: Given<Xi>,
    /// Relative error aimed at, of the exact method.
    #[deserr(default)]
    pub tolerance: Given<Tolerance>,
    /// Whether an exact run is compared with the simplified rule.
    #[deserr(default)]
    pub compare: Given<bool>,
    /// Output radii.
    #[deserr(default)]
    pub points: Given<PointCount>,
}
