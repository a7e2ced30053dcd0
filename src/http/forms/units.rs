//! Units and digits in which numbers are told.

/// A unit in which a quantity is told to people, and how it is come by from SI: a factor and a
/// divisor, both of which are exact, so that a number is rounded only once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// As it is written in an answer; the units of a scenario are written so too.
    pub name: &'static str,
    factor: f64,
    divisor: f64,
}

const fn unit(name: &'static str, factor: f64, divisor: f64) -> Unit {
    Unit { name, factor, divisor }
}

impl Unit {
    /// The engineering unit for an SI unit; none if that is the one in use.
    pub fn engineering(si: &str) -> Option<Self> {
        Some(match si {
            "m" => unit("um", 1e6, 1.0),
            "m^3" => unit("mm^3", 1e9, 1.0),
            "Pa" => unit("MPa", 1.0, 1e6),
            // N·mm, as belongs to MPa and mm.
            "J" => unit("mJ", 1e3, 1.0),
            "1/Pa" => unit("mm^3/(N m)", 1e9, 1.0),
            _ => return None,
        })
    }

    /// A number in SI in this unit.
    pub fn tell(self, si: f64) -> f64 {
        si * self.factor / self.divisor
    }
}

/// The number of so many significant decimal digits next to `number`; the number itself if that is
/// beyond the range of float64.
pub fn round(number: f64, digits: u8) -> f64 {
    let places = usize::from(digits.saturating_sub(1));
    let rounded = format!("{number:.places$e}").parse().ok();
    rounded.filter(|rounded: &f64| rounded.is_finite()).unwrap_or(number)
}

/// Whether arrays of numbers of so many digits are float32: up to 7, where it holds them all.
pub fn fits_single(digits: Option<u8>, numbers: &[f64]) -> bool {
    let range = f64::from(f32::MIN_POSITIVE)..=f64::from(f32::MAX);
    let fits = |number: &f64| *number == 0.0 || number.is_nan() || range.contains(&number.abs());
    digits.is_some_and(|digits| digits <= 7) && numbers.iter().all(fits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fretwork_engine::outcome::UNITS;
    use fretwork_engine::request::quantity::{Dimension, parse};

    #[test]
    fn a_told_unit_is_understood_in_a_scenario_and_means_the_same() {
        for &(name, si) in UNITS {
            let Some(unit) = Unit::engineering(si) else {
                assert!(matches!(si, "1" | "N"), "{name} is told in {si}");
                continue;
            };
            let dimension = match si {
                "m" => Dimension::Length,
                "m^3" => Dimension::Volume,
                "Pa" => Dimension::Stress,
                "1/Pa" => Dimension::WearCoefficient,
                // No scenario has an energy.
                _ => continue,
            };
            let back = parse(&format!("{:e} {}", unit.tell(1.25), unit.name), dimension);
            assert!((back.unwrap() / 1.25 - 1.0).abs() < 1e-15, "{name}");
        }
    }

    #[test]
    fn what_is_too_small_for_float32_stays_float64() {
        assert!(fits_single(Some(7), &[0.0, -1e30, f64::NAN, 2e-38]));
        assert!(!fits_single(Some(7), &[1.0, 1e-48]) && !fits_single(Some(7), &[1e39]));
        assert!(!fits_single(Some(8), &[1.0]) && !fits_single(None, &[1.0]));
    }

    #[test]
    fn rounding_leaves_so_many_digits_and_no_more() {
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
