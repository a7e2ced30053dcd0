//! Numbers as the page and reports write them: with units that keep them short, and few digits.

use crate::units::round;
use fretwork_plot::text::power_of_ten;

/// A unit for people: its name, its factor, and the size in SI from which it is used.
type Step = (&'static str, f64, f64);

/// The units for people of each SI unit, and which of them zero has.
pub const LADDERS: &[(&str, usize, &[Step])] = &[
    ("m", 1, &[("nm", 1e9, 0.0), ("µm", 1e6, 1e-7), ("mm", 1e3, 1e-3), ("m", 1.0, 1.0)]),
    ("m^3", 1, &[("µm³", 1e18, 0.0), ("mm³", 1e9, 1e-12)]),
    ("Pa", 2, &[("Pa", 1.0, 0.0), ("kPa", 1e-3, 1e3), ("MPa", 1e-6, 1e6), ("GPa", 1e-9, 1e9)]),
    (
        "J",
        2,
        &[
            ("nJ", 1e9, 0.0),
            ("µJ", 1e6, 1e-7),
            ("mJ", 1e3, 1e-3),
            ("J", 1.0, 1.0),
            ("kJ", 1e-3, 1e3),
            ("MJ", 1e-6, 1e6),
        ],
    ),
    ("N", 1, &[("mN", 1e3, 0.0), ("N", 1.0, 0.1), ("kN", 1e-3, 1e3)]),
    ("1/Pa", 0, &[("mm³/(N m)", 1e9, 0.0)]),
    ("m^3/J", 0, &[("mm³/J", 1e9, 0.0)]),
    ("N/m", 2, &[("N/m", 1.0, 0.0), ("N/mm", 1e-3, 1e3), ("N/µm", 1e-6, 1e5)]),
    ("N per m", 1, &[("N/m", 1.0, 0.0), ("N/mm", 1e-3, 1e3)]),
    ("rad", 0, &[("deg", 180.0 / std::f64::consts::PI, 0.0)]),
];

/// How a text writes its numbers.
#[derive(Debug, Clone, Copy, Default)]
pub struct Notation {
    /// Whether units are those of the SI.
    pub is_si: bool,
}

impl Notation {
    /// The name and the factor of the unit for values of an SI unit. `size` is the largest of them.
    pub fn scale(self, si: &str, size: f64) -> (String, f64) {
        match LADDERS.iter().find(|(unit, ..)| *unit == si && !self.is_si) {
            Some((_, usual, steps)) => {
                // A value that is rounded up to the next prefix has that prefix: 999.99 µm is 1 mm.
                let own = size.abs() * (1.0 + 1e-4);
                let found = steps.iter().rfind(|(.., from)| own >= *from && own > 0.0);
                let (name, factor, _) = found.unwrap_or(&steps[*usual]);
                ((*name).to_owned(), *factor)
            }
            None if si == "1" => (String::new(), 1.0),
            None => (typeset(si.replace(" per ", "/").as_str()), 1.0),
        }
    }

    /// A value in SI with its unit.
    pub fn quantity(self, value: f64, si: &str, count: u8) -> String {
        let (unit, factor) = self.scale(si, value);
        with_unit(&digits(value * factor, count), &unit)
    }

    /// Numbers in one unit, such as both ends of an interval: `0.997 to 1.08 mm³`.
    pub fn range(self, values: &[f64], si: &str, count: u8) -> String {
        let (unit, factor) =
            self.scale(si, values.iter().fold(0.0, |most, value| value.abs().max(most)));
        let texts: Vec<_> = values.iter().map(|value| digits(value * factor, count)).collect();
        let text = if texts.iter().all(|text| text == "–") { "–" } else { &texts.join(" to ") };
        with_unit(text, &unit)
    }
}

/// A unit in print, such as `µm` for `um`.
pub fn typeset(unit: &str) -> String {
    let unit = if unit == "um" { "µm" } else { unit };
    unit.replace("^3", "³")
}

/// A text with a unit behind it, if there is one.
pub fn with_unit(value: &str, unit: &str) -> String {
    if unit.is_empty() || value == "–" {
        return value.to_owned();
    }
    format!("{value}\u{a0}{}", unit.replace(' ', "\u{a0}"))
}

/// A number with at most this many significant digits: 0.123, 12 300, −1.23×10⁻⁵. A missing number is a dash.
pub fn digits(number: f64, count: u8) -> String {
    if !number.is_finite() {
        return "–".to_owned();
    }
    let number = round(number, count);
    let text = format!("{number:e}");
    let text = match text.split_once('e') {
        Some((mantissa, power)) if !(1e-3..1e6).contains(&number.abs()) && number != 0.0 => {
            format!("{mantissa}×{}", power_of_ten(power.parse().unwrap_or(0)))
        }
        _ => spaced(&number.to_string()),
    };
    text.replace('-', "−")
}

/// Narrow spaces between thousands, from five digits on.
fn spaced(text: &str) -> String {
    let whole = text.split('.').next().map_or(0, |whole| whole.trim_start_matches('-').len());
    let start = text.len() - text.trim_start_matches('-').len();
    if whole < 5 {
        return text.to_owned();
    }
    let place = |(i, sign): (usize, char)| {
        let left = (start + whole).saturating_sub(i);
        let gap = i > start && left > 0 && left.is_multiple_of(3);
        gap.then_some('\u{202f}').into_iter().chain([sign])
    };
    text.char_indices().flat_map(place).collect()
}

/// A fraction in percent.
pub fn percent(fraction: f64, count: u8) -> String {
    with_unit(&digits(100.0 * fraction, count), "%")
}

/// A number of cycles, whole from 100 on.
pub fn cycles(number: f64) -> String {
    let number = if number >= 100.0 { number.round() } else { number };
    if number.fract() == 0.0 { spaced(&number.to_string()) } else { digits(number, 3) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_notation_of_the_page() {
        for (number, text) in [
            (0.123_45, "0.1235"),
            (12_345.0, "12\u{202f}340"),
            (-123_456.0, "−123\u{202f}500"),
            (1234.5, "1234"),
            (1e6, "1×10⁶"),
            (-2.5e-5, "−2.5×10⁻⁵"),
            (0.0, "0"),
            (f64::NAN, "–"),
        ] {
            assert_eq!(digits(number, 4), text);
        }
        assert_eq!(cycles(100_000.4), "100\u{202f}000");
        assert_eq!(percent(-0.479_43, 3), "−47.9\u{a0}%");
    }

    #[test]
    fn units_keep_numbers_short() {
        let notation = Notation { is_si: false };
        let shown = |value, unit| notation.quantity(value, unit, 4).replace('\u{a0}', " ");
        assert_eq!(shown(1.1e-13, "m^3"), "110\u{202f}000 µm³");
        assert_eq!(shown(4.209, "J"), "4.209 J");
        assert_eq!(shown(3.03e-14, "1/Pa"), "3.03×10⁻⁵ mm³/(N m)");
        assert_eq!(shown(9.9999e-4, "m"), "1 mm");
        assert_eq!(shown(0.0, "Pa"), "0 MPa");
        assert_eq!(shown(0.7, "1"), "0.7");
        let si = Notation { is_si: true };
        assert_eq!(si.quantity(1.1e-13, "m^3", 3), "1.1×10⁻¹³\u{a0}m³");
    }
}
