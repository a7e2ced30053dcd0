//! Numbers and quantities with units. Each type has a range of accepted values.

use std::marker::PhantomData;
use std::ops::RangeInclusive;

use deserr::{Deserr, IntoValue, Sequence, Value, ValueKind};
use serde::Serialize;

use super::fault::{Faults, Pointer, Valid, wrong_kind};
use super::quantity::{self, Dimension};
use crate::numeric::twelve_digits;

/// Smallest and largest exponent of a power-law profile.
pub const EXPONENT_RANGE: (f64, f64) = (1.0, 20.0);
/// Maximum number of output cycles of a run.
pub const MAX_CYCLES: usize = 1000;
/// Minimum and maximum number of output radii of a profile.
pub const POINTS_RANGE: (u16, u16) = (16, 4096);
/// Maximum number of cycles.
pub const LAST_CYCLE: f64 = 1e15;
/// An optional member. Unlike an `Option`, it does not accept null.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Given<T>(pub Option<T>);

impl<T> Given<T> {
    pub(crate) fn is_absent(&self) -> bool {
        self.0.is_none()
    }

    /// The name of this member if it is given.
    pub(crate) fn named(&self, name: &'static str) -> Option<&'static str> {
        self.0.as_ref().map(|_| name)
    }
}

impl<T> Default for Given<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T: Deserr<Faults>> Deserr<Faults> for Given<T> {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        T::deserialize_from_value(value, location).map(|value| Self(Some(value)))
    }
}

/// Reads a JSON number.
pub(super) fn number<V: IntoValue>(
    value: Value<V>,
    location: Pointer<'_>,
    accepted: &[ValueKind],
) -> Valid<f64> {
    match value {
        Value::Integer(n) => Ok(n as f64),
        Value::NegativeInteger(n) => Ok(n as f64),
        Value::Float(x) => Ok(x),
        Value::String(text) if !accepted.contains(&ValueKind::String) => {
            let better = quantity::plain(&text);
            let better = better.unwrap_or_else(|| "a number such as 0.7".to_owned());
            let detail =
                format!("must be a number, not a string. Enter {better}, without quotation marks");
            Err(Faults::at(location, detail))
        }
        other => Err(wrong_kind(other, accepted, location)),
    }
}

pub(super) fn within(
    x: f64,
    (low, high): (f64, f64),
    unit: &str,
    location: Pointer<'_>,
) -> Valid<f64> {
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

/// What the schema of a scenario says of a quantity.
#[derive(Debug, Clone, Copy)]
pub struct Described {
    /// Its name in the schema.
    pub name: &'static str,
    /// What it is.
    pub about: &'static str,
    /// The dimension of its units.
    pub dimension: Dimension,
    /// Smallest and largest accepted value in SI.
    pub range: (f64, f64),
    /// A value: a number, or a text with a unit.
    pub example: &'static str,
}

/// Defines quantities: numbers in SI units within a range, parsed with their units, and with an example.
macro_rules! quantities {
    ($(#[doc = $about:literal] $name:ident: $dimension:ident $(or $per_length:ident)? in $range:expr, $example:literal;)*) => {
        /// All quantities.
        pub const QUANTITIES: &[Described] = &[$(Described {
            name: stringify!($name),
            about: $about,
            dimension: Dimension::$dimension,
            range: $range,
            example: $example,
        }),*];

        $(
        #[doc = $about]
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $name(pub f64);

        impl $name {
            /// Smallest and largest accepted value in SI.
            pub const RANGE: (f64, f64) = $range;
        }

        $(impl PerLength for $name {
            const DIMENSION: Dimension = Dimension::$dimension;
            const PER_LENGTH: Dimension = Dimension::$per_length;
            const RANGE: (f64, f64) = $range;
        })?

        impl From<$name> for f64 {
            fn from(quantity: $name) -> Self {
                quantity.0
            }
        }

        impl Deserr<Faults> for $name {
            fn deserialize_from_value<V: IntoValue>(
                value: Value<V>,
                location: Pointer<'_>,
            ) -> Valid<Self> {
                let dimension = Dimension::$dimension;
                let x = if dimension == Dimension::Number {
                    number(value, location, &[ValueKind::Float])?
                } else {
                    NumberOrText::deserialize_from_value(value, location)?.read(dimension, location)?
                };
                within(x, Self::RANGE, dimension.si(), location).map(Self)
            }
        })*
    };
}

quantities! {
    /// A length in metres.
    Length: Length in (1e-12, 1e6), "10 mm";
    /// A height above or below an origin in metres.
    Height: Length in (-1e6, 1e6), "-0.2 um";
    /// A normal force in newtons.
    Force: Force or ForcePerLength in (1e-12, 1e15), "100 N";
    /// The amplitude of a tangential force in newtons.
    TangentialForce: Force or ForcePerLength in (1e-18, 1e15), "20 N";
    /// The amplitude of the tangential force of a block, in newtons; 0 is allowed.
    BlockForce: Force or ForcePerLength in (0.0, 1e15), "4 N/mm";
    /// A stiffness in newtons per metre.
    Stiffness: Stiffness or StiffnessPerLength in (1e-6, 1e18), "10 N/um";
    /// An amplitude in metres; 0 is allowed.
    Stroke: Length in (0.0, 1e6), "2 um";
    /// A position along the motion in metres, which may be negative.
    Position: Length in (-1e6, 1e6), "-2 um";
    /// A wear volume in cubic metres.
    Volume: Volume in (1e-40, 1e18), "1e-4 mm^3";
    /// A dissipated energy in joules.
    DissipatedEnergy: Energy in (1e-30, 1e18), "50 mJ";
    /// The share of the first body in the wear volume.
    Share: Number in (0.0, 1.0), "0.5";
    /// The number of cycles of a block.
    BlockCycles: Number in (1e-6, LAST_CYCLE), "10000";
    /// A stress or modulus in pascals.
    Stress: Stress in (1.0, 1e15), "205 GPa";
    /// The slope of a cone or wedge in radians, measured from the plane (not half of the apex angle).
    SlopeAngle: Angle in (1e-6, 1.57), "2 deg";
    /// The energy wear coefficient α in m³/J: worn volume per dissipated energy.
    EnergyWear: EnergyWear in (1e-30, 1.0), "4.3e-5 mm^3/J";
    /// The coefficient of friction μ.
    Friction: Number in (1e-6, 100.0), "0.7";
    /// Poisson's ratio ν.
    PoissonRatio: Number in (-0.999, 0.5), "0.3";
    /// The exponent of a power-law profile: 1 is a cone, 2 a paraboloid, more is blunter.
    Exponent: Number in EXPONENT_RANGE, "4";
    /// The stick ratio c/a₀.
    StickRatio: Number in (0.0, 0.9999), "0.5";
    /// The fitting parameter ξ of the simplified rule (14).
    Xi: Number in (1e-3, 1e3), "0.8";
    /// The target relative error of the exact method.
    Tolerance: Number in (1e-4, 3e-2), "0.003";
    /// A number of cycles.
    Instant: Number in (0.0, LAST_CYCLE), "1000";
    /// The wear coefficient k_w in 1/Pa: worn volume per load and sliding path. Also the range of the dimensionless k = k_w·hardness.
    WearCoefficient: WearCoefficient in (1e-30, 1.0), "3.03e-5 mm^3/(N m)";
}

/// A quantity rounded to 12 digits, as it stands in the canonical scenario.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Rounded<T>(pub f64, PhantomData<T>);

impl<T: Deserr<Faults> + Into<f64>> Deserr<Faults> for Rounded<T> {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        let quantity = T::deserialize_from_value(value, location)?;
        Ok(Self(twelve_digits(quantity.into()), PhantomData))
    }
}

/// A quantity of a contact that a line contact can also state per length.
pub trait PerLength {
    /// The dimension of the quantity.
    const DIMENSION: Dimension;
    /// The dimension of the quantity per length.
    const PER_LENGTH: Dimension;
    /// Smallest and largest accepted value in SI.
    const RANGE: (f64, f64);
}

/// The total of a force or stiffness over the length of the contact, rounded to 12 digits. The text of a request can
/// state it per length; `multiply` makes the total from it, before a request is valid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Total<T>(pub f64, #[serde(skip)] bool, #[serde(skip)] PhantomData<T>);

impl<T: PerLength> Deserr<Faults> for Total<T> {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        let x = match NumberOrText::deserialize_from_value(value, location)? {
            NumberOrText::Number(x) => x,
            NumberOrText::Text(text) => match quantity::parse(&text, T::DIMENSION) {
                Ok(x) => x,
                Err(mut detail) => {
                    if let Ok(x) = quantity::parse(&text, T::PER_LENGTH) {
                        return Ok(Self(x, true, PhantomData));
                    }
                    if detail.ends_with(&T::DIMENSION.accepted()) {
                        detail += "; for a line contact also ";
                        detail += &T::PER_LENGTH.accepted();
                    }
                    return Err(Faults::at(location, detail));
                }
            },
        };
        let x = within(x, T::RANGE, T::DIMENSION.si(), location)?;
        Ok(Self(twelve_digits(x), false, PhantomData))
    }
}

impl<T: PerLength> Given<Total<T>> {
    /// Multiplies the quantity of the member `place`, if it is given per length, by the length of the contact. A round
    /// contact has no length.
    pub(super) fn multiply(&mut self, length: Option<f64>, place: &str, faults: &mut Faults) {
        let Some(Total(x, per_length @ true, _)) = &mut self.0 else { return };
        let what = T::DIMENSION.name();
        let Some(length) = length else {
            let detail = format!(
                "is {}, but the contact is round. Enter {what}, such as \"1 {}\"",
                T::PER_LENGTH.name(),
                T::DIMENSION.si()
            );
            faults.add(place, detail);
            return;
        };
        *x = twelve_digits(*x * length);
        *per_length = false;
        faults.keep("", derived(*x, T::RANGE, &format!("{what} of"), T::DIMENSION.si(), place));
    }
}

/// A quantity whose dimension depends on another member.
#[derive(Debug, Clone, PartialEq)]
pub enum NumberOrText {
    /// A number.
    Number(f64),
    /// A string with a number and a unit.
    Text(String),
}

impl Deserr<Faults> for NumberOrText {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        match value {
            Value::String(text) => Ok(Self::Text(text)),
            other => {
                number(other, location, &[ValueKind::Float, ValueKind::String]).map(Self::Number)
            }
        }
    }
}

impl NumberOrText {
    /// The quantity in SI.
    pub(super) fn read(&self, dimension: Dimension, location: Pointer<'_>) -> Valid<f64> {
        match self {
            Self::Number(x) => Ok(*x),
            Self::Text(text) => {
                quantity::parse(text, dimension).map_err(|detail| Faults::at(location, detail))
            }
        }
    }
}

/// The parameter ξ as the client gives it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum GivenXi {
    /// The engine chooses ξ from the stick ratio.
    #[default]
    Auto,
    /// A number.
    Number(Xi),
}

impl Deserr<Faults> for GivenXi {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        match NumberOrText::deserialize_from_value(value, location)? {
            NumberOrText::Text(text) if text == "auto" => Ok(Self::Auto),
            NumberOrText::Text(text) => {
                let detail = format!("must be a number or \"auto\", not \"{text}\"");
                Err(Faults::at(location, detail))
            }
            NumberOrText::Number(x) => {
                within(x, Xi::RANGE, "", location).map(|x| Self::Number(Xi(x)))
            }
        }
    }
}

/// A whole number from `LOW` to `HIGH`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Count<const LOW: u16, const HIGH: u16>(pub u16);

impl<const LOW: u16, const HIGH: u16> Deserr<Faults> for Count<LOW, HIGH> {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        let x = number(value, location, &[ValueKind::Integer])?;
        if x.fract() == 0.0 && (f64::from(LOW)..=f64::from(HIGH)).contains(&x) {
            Ok(Self(x as u16))
        } else {
            let detail = format!("must be a whole number between {LOW} and {HIGH}, not {x}");
            Err(Faults::at(location, detail))
        }
    }
}

/// The number of output radii.
pub type PointCount = Count<{ POINTS_RANGE.0 }, { POINTS_RANGE.1 }>;

/// Reads a list with a number of items in this range.
pub(super) fn list<T: Deserr<Faults>, V: IntoValue>(
    value: Value<V>,
    location: Pointer<'_>,
    lengths: RangeInclusive<usize>,
    items: &str,
) -> Valid<Vec<T>> {
    if let Value::Sequence(list) = &value
        && !lengths.contains(&list.len())
    {
        let (least, most) = lengths.into_inner();
        let detail = format!("must list {least} to {most} {items}, not {}", list.len());
        return Err(Faults::at(location, detail));
    }
    Vec::deserialize_from_value(value, location)
}

/// Reads a list with exactly two items.
pub(super) fn pair<T: Deserr<Faults>, V: IntoValue>(
    value: Value<V>,
    location: Pointer<'_>,
    items: &str,
) -> Result<[T; 2], Faults> {
    if let Value::Sequence(list) = &value
        && list.len() != 2
    {
        let detail = format!("must list exactly two {items}, not {}", list.len());
        return Err(Faults::at(location, detail));
    }
    let list = Vec::<T>::deserialize_from_value(value, location)?;
    list.try_into().map_err(|_| Faults::at(location, format!("must list exactly two {items}")))
}

/// The two bodies of a contact. The first one carries the profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bodies<T>(pub [T; 2]);

impl<T: Deserr<Faults>> Deserr<Faults> for Bodies<T> {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        pair(value, location, "bodies").map(Self)
    }
}

/// A list of `LEAST` to `MOST` items.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub struct List<T, const LEAST: usize, const MOST: usize>(pub Vec<T>);

impl<T, const LEAST: usize, const MOST: usize> List<T, LEAST, MOST> {
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl<T: Deserr<Faults>, const LEAST: usize, const MOST: usize> Deserr<Faults>
    for List<T, LEAST, MOST>
{
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        list(value, location, LEAST..=MOST, "items").map(Self)
    }
}

/// Checks the range of a quantity that is computed from the request. The canonical scenario
/// contains this quantity and must be a valid request too.
pub(crate) fn derived(
    x: f64,
    (low, high): (f64, f64),
    what: &str,
    unit: &str,
    pointer: &str,
) -> Valid<()> {
    if (low..=high).contains(&x) {
        return Ok(());
    }
    let detail = format!(
        "gives {what} {x:e} {unit}. This value must be between {low:e} and {high:e} {unit}"
    );
    Err(Faults::one(pointer, detail))
}
