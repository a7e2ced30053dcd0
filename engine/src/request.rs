//! A scenario as people write it: types that parse themselves and report every fault at once.
//!
//! Each type here mirrors one object of the JSON Schema (`scenario.schema.json`); `deserr` walks
//! them and collects the faults of all members instead of stopping at the first. What only the
//! physics can judge is left to [`scenario`](super::scenario).

use deserr::{Deserr, ErrorKind, IntoValue, Sequence, Value, ValueKind, ValuePointerRef};

use super::fault::{Faults, refuse};
use super::held::{Load, Motion};
use super::indenter::Profile;
use super::instants::{Cycles, ProfilesAt};
use super::profile::EXPONENT_RANGE;
use super::quantity::{self, Dimension};

/// Most instants in a history.
pub const MAX_CYCLES: usize = 1000;
/// Fewest and most radii of a profile.
pub const POINTS_RANGE: (u16, u16) = (16, 4096);
/// Largest number of cycles.
pub const LAST_CYCLE: f64 = 1e15;
/// A member that may be left out. Unlike an `Option` it does not take null for absent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Given<T>(pub Option<T>);

impl<T> Default for Given<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T: Deserr<Faults>> Deserr<Faults> for Given<T> {
    fn deserialize_from_value<V: IntoValue>(
        value: Value<V>,
        location: ValuePointerRef<'_>,
    ) -> Result<Self, Faults> {
        T::deserialize_from_value(value, location).map(|value| Self(Some(value)))
    }
}

/// A number as it stands in JSON.
fn number<V: IntoValue>(
    value: Value<V>,
    location: ValuePointerRef<'_>,
    accepted: &[ValueKind],
) -> Result<f64, Faults> {
    match value {
        Value::Integer(n) => Ok(n as f64),
        Value::NegativeInteger(n) => Ok(n as f64),
        Value::Float(x) => Ok(x),
        other => Err(refuse(ErrorKind::IncorrectValueKind { actual: other, accepted }, location)),
    }
}

/// A number, or a string with a unit, in SI.
fn quantity<V: IntoValue>(
    value: Value<V>,
    location: ValuePointerRef<'_>,
    dimension: Dimension,
) -> Result<f64, Faults> {
    match value {
        Value::String(text) => {
            quantity::parse(&text, dimension).map_err(|detail| Faults::at(location, detail))
        }
        other => number(other, location, &[ValueKind::Float, ValueKind::String]),
    }
}

fn within(
    x: f64,
    (low, high): (f64, f64),
    unit: &str,
    location: ValuePointerRef<'_>,
) -> Result<f64, Faults> {
    if (low..=high).contains(&x) {
        return Ok(x);
    }
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let detail = if x <= 0.0 && low > 0.0 {
        format!("must be greater than 0, not {x}{unit}")
    } else {
        format!("must lie between {low:?} and {high:?}{unit}, not {x}")
    };
    Err(Faults::at(location, detail))
}

/// Defines a quantity: a positive number of SI units within a range, parsed with its unit.
macro_rules! quantities {
    ($($(#[$doc:meta])* $name:ident: $dimension:ident in $range:expr;)*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $name(pub f64);

        impl $name {
            /// Smallest and largest accepted value in SI.
            pub const RANGE: (f64, f64) = $range;
        }

        impl From<$name> for f64 {
            fn from(quantity: $name) -> Self {
                quantity.0
            }
        }

        impl Deserr<Faults> for $name {
            fn deserialize_from_value<V: IntoValue>(
                value: Value<V>,
                location: ValuePointerRef<'_>,
            ) -> Result<Self, Faults> {
                let dimension = Dimension::$dimension;
                let x = if dimension == Dimension::Number {
                    number(value, location, &[ValueKind::Float])?
                } else {
                    quantity(value, location, dimension)?
                };
                within(x, Self::RANGE, dimension.si(), location).map(Self)
            }
        }
    )*};
}

quantities! {
    /// A length in metres.
    Length: Length in (1e-12, 1e6);
    /// A radius in metres, which may be 0.
    Radius: Length in (0.0, 1e6);
    /// A height in metres, above or below an origin.
    Height: Length in (-1e6, 1e6);
    /// A normal force in newtons.
    Force: Force in (1e-12, 1e15);
    /// The amplitude of a tangential force in newtons.
    TangentialForce: Force in (1e-18, 1e15);
    /// The stiffness of a rig in newtons per metre.
    Stiffness: Stiffness in (1e-6, 1e18);
    /// An amplitude in metres that may be 0.
    Stroke: Length in (0.0, 1e6);
    /// A position in metres.
    Position: Length in (-1e6, 1e6);
    /// A wear volume in cubic metres.
    Volume: Volume in (1e-40, 1e18);
    /// The part of the wear depth that the first body bears.
    Share: Number in (0.0, 1.0);
    /// How many cycles a block has.
    BlockCycles: Number in (1e-6, LAST_CYCLE);
    /// A stress or modulus in pascals.
    Stress: Stress in (1.0, 1e15);
    /// A slope angle in radians, measured from the plane.
    SlopeAngle: Angle in (1e-6, 1.57);
    /// An energy wear coefficient in m³/J.
    EnergyWear: EnergyWear in (1e-30, 1.0);
    /// A coefficient of friction.
    Friction: Number in (1e-6, 100.0);
    /// Poisson's ratio.
    PoissonRatio: Number in (-0.999, 0.5);
    /// The exponent of a power-law profile.
    Exponent: Number in EXPONENT_RANGE;
    /// The ratio c/a₀.
    StickRatio: Number in (0.0, 0.9999);
    /// The fitting parameter of (14).
    Xi: Number in (1e-3, 1e3);
    /// The relative error that an exact run aims at.
    Tolerance: Number in (1e-4, 3e-2);
    /// A number of cycles.
    Instant: Number in (0.0, LAST_CYCLE);
}

/// Range of a wear coefficient k_w in 1/Pa, and of the dimensionless k = k_w·hardness.
pub const WEAR_RANGE: (f64, f64) = (1e-30, 1.0);

/// A quantity whose dimension depends on its neighbours.
#[derive(Debug, Clone, PartialEq)]
pub enum Scalar {
    /// A number.
    Number(f64),
    /// A string that should hold a number and a unit.
    Text(String),
}

impl Deserr<Faults> for Scalar {
    fn deserialize_from_value<V: IntoValue>(
        value: Value<V>,
        location: ValuePointerRef<'_>,
    ) -> Result<Self, Faults> {
        match value {
            Value::String(text) => Ok(Self::Text(text)),
            other => {
                number(other, location, &[ValueKind::Float, ValueKind::String]).map(Self::Number)
            }
        }
    }
}

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
pub struct Bodies(pub [Body; 2]);

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
        let bodies = Vec::<Body>::deserialize_from_value(value, location)?;
        <[Body; 2]>::try_from(bodies)
            .map(Self)
            .map_err(|_| Faults::at(location, "must list exactly two bodies"))
    }
}

/// One elastic body.
#[derive(Debug, Clone, Copy, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct Body {
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
    coefficient: Given<Scalar>,
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
            (Some(Scalar::Number(x)), _, None) => self.per_load = *x,
            (Some(Scalar::Text(text)), _, None) => {
                self.per_load = quantity::parse(text, dimension).map_err(at)?;
            }
        }
        let hardness = self.hardness.0.map_or(1.0, |hardness| hardness.0);
        self.per_load = within(self.per_load / hardness, WEAR_RANGE, "1/Pa", here)?;
        Ok(self)
    }

    /// k_w in 1/Pa.
    #[must_use]
    pub fn coefficient(&self, friction: f64) -> f64 {
        self.energy_coefficient.0.map_or(self.per_load, |alpha| alpha.0 * friction)
    }
}

/// How many radii a profile has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Points(pub u16);

pub(super) fn whole<V: IntoValue>(
    value: Value<V>,
    location: ValuePointerRef<'_>,
    (low, high): (u16, u16),
) -> Result<u16, Faults> {
    let x = number(value, location, &[ValueKind::Integer])?;
    if x.fract() == 0.0 && (f64::from(low)..=f64::from(high)).contains(&x) {
        Ok(x as u16)
    } else {
        let detail = format!("must be a whole number between {low} and {high}, not {x}");
        Err(Faults::at(location, detail))
    }
}

impl Deserr<Faults> for Points {
    fn deserialize_from_value<V: IntoValue>(
        value: Value<V>,
        location: ValuePointerRef<'_>,
    ) -> Result<Self, Faults> {
        whole(value, location, POINTS_RANGE).map(Self)
    }
}

/// How wear is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserr)]
#[deserr(error = Faults, rename_all = lowercase)]
pub enum Method {
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
    pub method: Method,
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
    pub points: Given<Points>,
}
