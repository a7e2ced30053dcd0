//! The units and digits in which numbers are written.

use std::borrow::Cow;

use fretwork_engine::twelve_digits;
use serde::{Serialize, Serializer};
use serde_json::{Number, Value};

use super::view::View;
use fretwork_json::Members;

/// An engineering unit and its conversion from SI: a factor and a divisor. Both are exact, so a number
/// is rounded only once.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Unit {
    /// The name, which a scenario also accepts.
    name: &'static str,
    factor: f64,
    divisor: f64,
}

impl Unit {
    /// The engineering unit for an SI unit, or `None` if the SI unit is used.
    fn engineering(si: &str) -> Option<Self> {
        Some(match si {
            "m" => Self { name: "um", factor: 1e6, divisor: 1.0 },
            "m^3" => Self { name: "mm^3", factor: 1e9, divisor: 1.0 },
            "Pa" => Self { name: "MPa", factor: 1.0, divisor: 1e6 },
            // N·mm, consistent with MPa and mm.
            "J" => Self { name: "mJ", factor: 1e3, divisor: 1.0 },
            "1/Pa" => Self { name: "mm^3/(N m)", factor: 1e9, divisor: 1.0 },
            _ => return None,
        })
    }

    fn convert(self, si: f64) -> f64 {
        si * self.factor / self.divisor
    }
}

/// A number in SI in its engineering unit, with the name of this unit.
pub fn in_engineering(number: f64, si: &str) -> (f64, &str) {
    Unit::engineering(si).map_or((number, si), |unit| (unit.convert(number), unit.name))
}

/// Rounds `number` to this many significant decimal digits. A number that would overflow float64
/// stays as it is.
pub fn round(number: f64, digits: u8) -> f64 {
    let places = usize::from(digits.saturating_sub(1));
    let rounded = format!("{number:.places$e}").parse().ok();
    rounded.filter(|rounded: &f64| rounded.is_finite()).unwrap_or(number)
}

/// Whether an array is written as float32: at most 7 digits, and all numbers in the range of float32.
pub fn fits_single(digits: Option<u8>, numbers: impl IntoIterator<Item = f64>) -> bool {
    let range = f64::from(f32::MIN_POSITIVE)..=f64::from(f32::MAX);
    let fits = |number: f64| number == 0.0 || number.is_nan() || range.contains(&number.abs());
    digits.is_some_and(|digits| digits <= 7) && numbers.into_iter().all(fits)
}

/// The unit of a quantity.
#[derive(Clone)]
struct UnitOf {
    quantity: String,
    name: String,
    /// The conversion from SI, if the unit is an engineering unit.
    engineering: Option<Unit>,
}

/// The units of all quantities of a document, and the conversion of their numbers.
#[derive(Clone, Default)]
pub struct Units {
    entries: Vec<UnitOf>,
    digits: Option<u8>,
    /// Whether a change of units or rounding changes some numbers.
    pub convert: bool,
}

impl Units {
    /// The units of a document, converted as a view requests.
    pub fn new(si: Members<'_>, view: &View) -> Result<Self, serde_json::Error> {
        let entry = |(quantity, text): (Cow<'_, str>, &serde_json::value::RawValue)| {
            let si: String = serde_json::from_str(text.get())?;
            let engineering = view.engineering.then(|| Unit::engineering(&si)).flatten();
            let name = engineering.map_or(si, |unit| unit.name.to_owned());
            Ok(UnitOf { quantity: quantity.into_owned(), name, engineering })
        };
        let entries = si.0.into_iter().map(entry).collect::<Result<_, serde_json::Error>>()?;
        let convert = view.engineering || view.digits.is_some();
        Ok(Self { entries, digits: view.digits, convert })
    }

    fn find(&self, quantity: &str) -> Option<&UnitOf> {
        self.entries.iter().find(|entry| entry.quantity == quantity)
    }

    /// Whether the document states a unit of a quantity, possibly `1`.
    pub fn have(&self, quantity: &str) -> bool {
        self.find(quantity).is_some()
    }

    /// The unit of a quantity, or `None` for plain numbers.
    pub fn of(&self, quantity: &str) -> Option<&str> {
        self.find(quantity).map(|entry| &*entry.name).filter(|unit| *unit != "1")
    }

    /// The name of a column with its unit, for tables without metadata.
    pub fn header<'n>(&self, quantity: &'n str) -> Cow<'n, str> {
        match self.of(quantity) {
            Some(unit) => format!("{quantity}[{unit}]").into(),
            None => quantity.into(),
        }
    }

    /// Conversion of the numbers of a quantity, or `None` if they do not change.
    pub fn conversion(&self, quantity: &str) -> Option<impl Fn(f64) -> f64 + use<>> {
        // `point` is the index of a point in a study, so it is not rounded.
        let digits = self.digits.filter(|_| quantity != "point");
        let unit = self.find(quantity).and_then(|entry| entry.engineering);
        (unit.is_some() || digits.is_some()).then_some(move |number| {
            let converted = unit.map_or(number, |unit| unit.convert(number));
            digits.map_or_else(|| twelve_digits(converted), |digits| round(converted, digits))
        })
    }

    /// Converts all numbers in the value of the member `name`, except integers, which are counts.
    pub fn convert(&self, name: &str, value: &mut Value) {
        match value {
            Value::Number(number) if number.is_f64() => {
                if let (Some(convert), Some(si)) = (self.conversion(name), number.as_f64())
                    && let Some(converted) = Number::from_f64(convert(si))
                {
                    *number = converted;
                }
            }
            Value::Array(items) => items.iter_mut().for_each(|item| self.convert(name, item)),
            // Relative errors have no unit, although they have the name of a quantity.
            Value::Object(members) if name == "errors" => {
                members.values_mut().for_each(|value| self.convert("", value));
            }
            Value::Object(members) => {
                members.iter_mut().for_each(|(name, value)| self.convert(name, value));
            }
            _ => {}
        }
    }
}

impl Serialize for Units {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        json.collect_map(self.entries.iter().map(|entry| (&entry.quantity, &entry.name)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fretwork_engine::input::quantity::{Dimension, parse};
    use fretwork_engine::outcome::{QUANTITIES, Quantity};

    #[test]
    fn a_scenario_parses_every_engineering_unit_to_the_same_value() {
        for &Quantity { name, unit: si, .. } in QUANTITIES {
            let Some(unit) = Unit::engineering(si) else {
                assert!(matches!(si, "1" | "N"), "{name} stays in {si}");
                continue;
            };
            let dimension = match si {
                "m" => Dimension::Length,
                "m^3" => Dimension::Volume,
                "Pa" => Dimension::Stress,
                "J" => Dimension::Energy,
                "1/Pa" => Dimension::WearCoefficient,
                _ => panic!("{name} has an unknown unit, {si}"),
            };
            let back = parse(&format!("{:e} {}", unit.convert(1.25), unit.name), dimension);
            assert!((back.unwrap() / 1.25 - 1.0).abs() < 1e-15, "{name}");
        }
    }

    #[test]
    fn numbers_outside_the_range_of_float32_stay_float64() {
        assert!(fits_single(Some(7), [0.0, -1e30, f64::NAN, 2e-38]));
        assert!(!fits_single(Some(7), [1.0, 1e-48]) && !fits_single(Some(7), [1e39]));
        assert!(!fits_single(Some(8), [1.0]) && !fits_single(None, [1.0]));
    }

    #[test]
    fn rounding_keeps_the_requested_number_of_digits() {
        for (number, digits, rounded) in [
            (1.234_567_89e-13, 3, 1.23e-13),
            (-9.996, 3, -10.0),
            (0.0, 5, 0.0),
            (2.5, 1, 2.0),
            (1e300, 17, 1e300),
            (0.1 + 0.2, 17, 0.1 + 0.2),
            (f64::MAX, 1, f64::MAX),
        ] {
            assert!(round(number, digits).to_bits() == f64::to_bits(rounded), "{number}");
        }
        assert!(round(f64::NAN, 3).is_nan());
    }
}
