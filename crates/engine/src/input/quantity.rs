//! Physical quantities in a request: a number in SI units, or a string with a unit.
//!
//! Each dimension has a table of units, such as `mm^3/(N m)` or `GPa`. The error for an unknown unit lists them.
//!
//! # Examples
//! ```
//! use fretwork_engine::input::quantity::{Dimension, parse};
//! assert_eq!(parse("10 mm", Dimension::Length), Ok(0.01));
//! assert_eq!(parse("20 mm³/(N·m)", Dimension::WearCoefficient), Ok(20e-9));
//! assert!(parse("10 GPa", Dimension::Length).unwrap_err().contains("stress"));
//! ```

use serde::Serialize;

/// A physical dimension with its table of units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Dimension {
    /// Metres.
    Length,
    /// Newtons.
    Force,
    /// Pascals.
    Stress,
    /// Newtons per metre.
    Stiffness,
    /// Newtons per metre of the length of a line contact.
    ForcePerLength,
    /// Newtons per metre, per metre of the length of a line contact.
    StiffnessPerLength,
    /// Cubic metres.
    Volume,
    /// Joules.
    Energy,
    /// Radians.
    Angle,
    /// Wear coefficient k_w in 1/Pa = m³/(N·m): volume per load and sliding distance.
    WearCoefficient,
    /// Energy wear coefficient α = k_w/μ in m³/J: volume per dissipated energy.
    EnergyWear,
    /// A number without a unit.
    Number,
}

use Dimension::{
    Angle, Energy, EnergyWear, Force, ForcePerLength, Length, Number, Stiffness,
    StiffnessPerLength, Stress, Volume, WearCoefficient,
};

/// All dimensions with their names in error texts and their accepted units, that of SI first. If a unit belongs to
/// several, the one that is meant more often comes first.
const DIMENSIONS: [(Dimension, &str, &str); 12] = [
    (Length, "a length", "m, cm, mm, um, nm, in, mil"),
    (Force, "a force", "N, uN, mN, kN, MN, lbf"),
    (Stress, "a stress", "Pa, kPa, MPa, GPa, N/m^2, N/mm^2, psi, ksi"),
    (Stiffness, "a stiffness", "N/m, kN/m, MN/m, N/mm, kN/mm, N/um, lbf/in"),
    (Volume, "a volume", "m^3, cm^3, mm^3, um^3, l, ml, ul"),
    (Energy, "an energy", "J, kJ, mJ, uJ, nJ, N m, N mm"),
    (Angle, "an angle", "rad, mrad, deg"),
    (
        WearCoefficient,
        "a wear coefficient",
        "1/Pa, 1/kPa, 1/MPa, 1/GPa, m^3/(N m), mm^3/(N m), um^3/(N m), mm^3/(N mm), m^2/N, mm^2/N",
    ),
    (EnergyWear, "an energy wear coefficient", "m^3/J, mm^3/J, um^3/J, mm^3/kJ, m^3/kJ"),
    (ForcePerLength, "a force per length", "N/m, kN/m, MN/m, N/mm, kN/mm, lbf/in"),
    (
        StiffnessPerLength,
        "a stiffness per length",
        "N/m/m, N/m^2, N/mm/mm, N/mm^2, N/um/mm, kN/mm/mm",
    ),
    (Number, "a plain number", ""),
];

/// The units that are no powers of ten of that of SI, with their factors.
const OTHER_UNITS: [(&str, f64); 7] = [
    ("in", 0.0254),
    ("mil", 2.54e-5),
    ("lbf", 4.448_221_615_260_5),
    ("psi", 6_894.757_293_168_361),
    ("ksi", 6_894_757.293_168_361),
    ("lbf/in", 175.126_835_246_476_37),
    ("deg", std::f64::consts::PI / 180.0),
];

/// The factor of a unit of the table to that of SI.
pub fn factor_to_si(unit: &str) -> f64 {
    let mut exponent = 0;
    for (place, product) in unit.split('/').enumerate() {
        let sign = if place == 0 { 1 } else { -1 };
        for part in product.trim_matches(['(', ')']).split(' ') {
            let (symbol, power) = part.split_once('^').unwrap_or((part, "1"));
            exponent += sign * power_of_ten(symbol) * power.parse().unwrap_or(1);
        }
    }
    let other = OTHER_UNITS.iter().find(|other| other.0 == unit);
    // A parsed power of ten is exact to the last digit, a computed one is not.
    other.map_or_else(|| format!("1e{exponent}").parse().unwrap_or(f64::NAN), |other| other.1)
}

/// The power of ten of a unit that has one symbol, such as `mm`, from its prefix. That of a litre is in cubic metres.
fn power_of_ten(symbol: &str) -> i32 {
    let prefix =
        ["m", "N", "Pa", "J", "rad", "l"].into_iter().find_map(|it| symbol.strip_suffix(it));
    let litre = if symbol.ends_with('l') { -3 } else { 0 };
    litre
        + match prefix {
            Some("n") => -9,
            Some("u") => -6,
            Some("m") => -3,
            Some("c") => -2,
            Some("k") => 3,
            Some("M") => 6,
            Some("G") => 9,
            _ => 0,
        }
}

impl Dimension {
    /// All dimensions, in the order of the table.
    pub fn all() -> impl Iterator<Item = Self> {
        DIMENSIONS.into_iter().map(|(dimension, ..)| dimension)
    }

    /// The dimension of the quantity per length, in which a line contact can state it.
    pub fn per_length(self) -> Option<Self> {
        match self {
            Force => Some(ForcePerLength),
            Stiffness => Some(StiffnessPerLength),
            _ => None,
        }
    }

    fn row(self) -> (&'static str, &'static str) {
        let own = DIMENSIONS.iter().find(|(dimension, ..)| *dimension == self);
        own.map_or(("", ""), |(_, name, units)| (*name, *units))
    }

    /// The name in error texts.
    pub fn name(self) -> &'static str {
        self.row().0
    }

    /// The SI unit of numbers without a unit.
    pub fn si(self) -> &'static str {
        self.units().next().unwrap_or("")
    }

    fn units(self) -> impl Iterator<Item = &'static str> {
        self.row().1.split(", ").filter(|unit| !unit.is_empty())
    }

    /// A list of all accepted units, for error texts and for the schema.
    pub fn accepted(self) -> String {
        self.row().1.to_owned()
    }
}

/// Reads `text` as a quantity of `dimension`. Returns the value in SI units.
///
/// # Errors
/// A sentence that states the fault. For an unknown unit it lists the accepted units.
pub fn parse(text: &str, dimension: Dimension) -> Result<f64, String> {
    let text = text.trim();
    let split = number_length(text);
    let (digits, unit) = (&text[..split], text[split..].trim());
    let number: f64 = digits.parse().map_err(|_| {
        let example = match dimension {
            Number => "such as 0.7".to_owned(),
            _ => format!("with a unit, such as \"1 {}\"", dimension.si()),
        };
        format!("{text:?} does not begin with a number. Enter {} {example}", dimension.name())
    })?;
    if !number.is_finite() {
        return Err(format!("{digits} is too large. Enter a smaller number"));
    }
    if unit.is_empty() {
        return Ok(number);
    }
    let factor = factor(unit, dimension).map_err(|detail| {
        corrected(text).map_or(detail, |better| {
            format!("{text:?} contains a comma or a space in the number. Enter {better}")
        })
    })?;
    let value = number * factor;
    if value.is_finite() {
        Ok(value)
    } else {
        Err(format!("{text} is too large. Enter a smaller number"))
    }
}

/// What to write instead of the text of a plain number, for an error text. `None` if the text is no number.
pub(super) fn plain(text: &str) -> Option<String> {
    if parse(text, Number).is_ok() {
        return Some(text.trim().to_owned());
    }
    let better = corrected(text)?;
    let is_number = better.split(" or ").all(|it| parse(it.trim_matches('"'), Number).is_ok());
    is_number.then(|| better.replace('"', ""))
}

/// The quoted text with a decimal point and without thousands separators. A comma before three digits can be either, so
/// there are then two texts. But nobody writes `.000`, and no group of thousands follows a 0. `None` if the text has no such
/// fault.
fn corrected(text: &str) -> Option<String> {
    let letters: Vec<char> = text.chars().collect();
    let (mut plain, mut point) = (String::new(), None);
    for (at, letter) in letters.iter().enumerate() {
        let separates = at > 0 && letters[at - 1].is_ascii_digit();
        if !separates || !(matches!(letter, ',' | '\'' | '’') || letter.is_whitespace()) {
            plain.push(*letter);
            continue;
        }
        match letters[at + 1..].iter().take_while(|it| it.is_ascii_digit()).count() {
            3 if *letter != ',' => {}
            0 => plain.push(*letter),
            _ if *letter == ',' && point.is_some() => return None,
            digits if *letter == ',' => {
                // Points before a comma separate thousands, or the text is no number.
                if plain.split_once('.').is_some_and(|(_, groups)| groups.len() % 4 != 3) {
                    return None;
                }
                plain.retain(|letter| letter != '.');
                point = Some((plain.len(), digits));
                plain.push('.');
            }
            _ => plain.push(*letter),
        }
    }
    let (changed, mut whole) = (plain != text, plain.clone());
    if let Some((at, 3)) = point.filter(|_| !plain.starts_with("0.")) {
        whole.remove(at);
        if whole[at..].starts_with("000") {
            plain.clone_from(&whole);
        }
    }
    let both =
        if whole == plain { format!("{plain:?}") } else { format!("{plain:?} or {whole:?}") };
    changed.then_some(both)
}

fn factor(unit: &str, dimension: Dimension) -> Result<f64, String> {
    let wanted = normalise(unit);
    let find = |dimension: Dimension| dimension.units().find(|known| normalise(known) == wanted);
    if let Some(known) = find(dimension) {
        return Ok(factor_to_si(known));
    }
    if dimension == Number {
        return Err(format!("a plain number is needed, without a unit. Remove {unit:?}"));
    }
    let accepted = dimension.accepted();
    match Dimension::all().find(|other| find(*other).is_some()) {
        Some(other) => Err(format!(
            "{unit:?} is the unit of {}, but {} is needed. Accepted units: {accepted}",
            other.name(),
            dimension.name()
        )),
        None => Err(format!("unknown unit {unit:?}. Accepted units: {accepted}")),
    }
}

/// The number of bytes of the decimal number at the start of `text`.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits_from = |start: usize| {
        bytes[start.min(bytes.len())..].iter().take_while(|byte| byte.is_ascii_digit()).count()
    };
    let mut end = usize::from(matches!(bytes.first(), Some(b'+' | b'-')));
    end += digits_from(end);
    if bytes.get(end) == Some(&b'.') {
        end += 1 + digits_from(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent = digits_from(end + 1 + sign);
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    end
}

/// Converts all spellings of a unit to the same text: `µm³/(N·m)`, `um3/(N*m)` and `um^3/Nm` are
/// equal.
fn normalise(unit: &str) -> String {
    let mut plain = String::with_capacity(unit.len());
    for character in unit.chars() {
        match character {
            'µ' | 'μ' => plain.push('u'),
            '²' => plain.push('2'),
            '³' => plain.push('3'),
            '°' => plain.push_str("deg"),
            '^' | '·' | '⋅' | '*' | '×' | '(' | ')' => {}
            space if space.is_whitespace() => {}
            other => plain.push(other),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_spellings_of_a_unit_give_the_same_value() {
        for text in [
            "3.03e-5 mm^3/(N m)",
            "3.03e-5mm³/(N·m)",
            "3.03e-5 mm3/(N*m)",
            "0.0303e-3 mm^3/Nm",
            "+3.03E-14 1/Pa",
            "3.03e-8 1/MPa",
            "3.03e-14",
        ] {
            let value = parse(text, WearCoefficient).expect(text);
            assert!((value / 3.03e-14 - 1.0).abs() < 1e-14, "{text}: {value}");
        }
        for text in ["2.256 um", "2.256 µm", "2.256 μm", "2256 nm", "0.002256mm"] {
            let value = parse(text, Length).expect(text);
            assert!((value / 2.256e-6 - 1.0).abs() < 1e-14, "{text}: {value}");
        }
        assert_eq!(parse("2 µl", Volume), parse("2 mm³", Volume));
        assert!((parse("45°", Angle).expect("deg") - std::f64::consts::FRAC_PI_4).abs() < 1e-15);
    }

    #[test]
    fn a_fault_in_a_quantity_states_the_accepted_units_or_the_remedy() {
        let of = |text, dimension| parse(text, dimension).expect_err(text);
        assert!(of("1 parsec", Length).contains("Accepted units: m, cm, mm, um, nm"));
        assert!(of("1 GPa", Length).contains("unit of a stress, but a length is needed"));
        assert!(of("1 mm^3/J", WearCoefficient).contains("energy wear coefficient"));
        assert!(of("NaN mm", Length).contains("does not begin with a number"));
        assert!(of("inf", Length).contains("does not begin with a number"));
        assert!(of("1e999 mm", Length).contains("too large"));
        assert!(of("1e308 kN", Force).contains("too large"));
        assert!(of("0,5 mm", Length).ends_with("Enter \"0.5 mm\""));
        assert!(of("10 000 N", Force).ends_with("Enter \"10000 N\""));
        assert!(of("1'500 000,5 N", Force).ends_with("Enter \"1500000.5 N\""));
        assert!(of("10.000,5 N", Force).ends_with("Enter \"10000.5 N\""));
        assert!(of("1.5,5 N", Force).contains("unit"));
        assert!(of("1,250 N", Force).ends_with("Enter \"1.250 N\" or \"1250 N\""));
        assert!(of("10,000 N", Force).ends_with("Enter \"10000 N\""));
        assert!(of("0,700 N", Force).ends_with("Enter \"0.700 N\""));
        assert!(of("0.7 mm", Number).contains("plain number"));
        assert!(of("", Length).contains("does not begin with a number"));
    }

    #[test]
    fn the_factor_of_a_unit_is_exact() {
        for (unit, factor) in [
            ("m", 1.0),
            ("cm", 1e-2),
            ("mm", 1e-3),
            ("um", 1e-6),
            ("nm", 1e-9),
            ("in", 0.0254),
            ("mil", 2.54e-5),
            ("N", 1.0),
            ("uN", 1e-6),
            ("mN", 1e-3),
            ("kN", 1e3),
            ("MN", 1e6),
            ("lbf", 4.448_221_615_260_5),
            ("Pa", 1.0),
            ("kPa", 1e3),
            ("MPa", 1e6),
            ("GPa", 1e9),
            ("N/m^2", 1.0),
            ("N/mm^2", 1e6),
            ("psi", 6_894.757_293_168_361),
            ("ksi", 6_894_757.293_168_361),
            ("N/m", 1.0),
            ("kN/m", 1e3),
            ("MN/m", 1e6),
            ("N/mm", 1e3),
            ("kN/mm", 1e6),
            ("N/um", 1e6),
            ("lbf/in", 175.126_835_246_476_37),
            ("m^3", 1.0),
            ("cm^3", 1e-6),
            ("mm^3", 1e-9),
            ("um^3", 1e-18),
            ("l", 1e-3),
            ("ml", 1e-6),
            ("ul", 1e-9),
            ("J", 1.0),
            ("kJ", 1e3),
            ("mJ", 1e-3),
            ("uJ", 1e-6),
            ("nJ", 1e-9),
            ("N m", 1.0),
            ("N mm", 1e-3),
            ("rad", 1.0),
            ("mrad", 1e-3),
            ("deg", std::f64::consts::PI / 180.0),
            ("1/Pa", 1.0),
            ("1/kPa", 1e-3),
            ("1/MPa", 1e-6),
            ("1/GPa", 1e-9),
            ("m^3/(N m)", 1.0),
            ("mm^3/(N m)", 1e-9),
            ("um^3/(N m)", 1e-18),
            ("mm^3/(N mm)", 1e-6),
            ("m^2/N", 1.0),
            ("mm^2/N", 1e-6),
            ("m^3/J", 1.0),
            ("mm^3/J", 1e-9),
            ("um^3/J", 1e-18),
            ("mm^3/kJ", 1e-12),
            ("m^3/kJ", 1e-3),
            ("N/m/m", 1.0),
            ("N/mm/mm", 1e6),
            ("N/um/mm", 1e9),
            ("kN/mm/mm", 1e9),
        ] {
            assert_eq!(factor_to_si(unit).to_bits(), f64::to_bits(factor), "{unit}");
        }
    }

    #[test]
    fn every_unit_belongs_to_one_dimension_beside_those_per_length() {
        let per_length = |dimension| matches!(dimension, ForcePerLength | StiffnessPerLength);
        for dimension in Dimension::all() {
            for unit in dimension.units() {
                let text = format!("1 {unit}");
                let owners = Dimension::all().filter(|it| parse(&text, *it).is_ok());
                let owners: Vec<_> = owners.collect();
                // A study reads texts without knowing their dimension.
                for owner in &owners {
                    assert_eq!(parse(&text, *owner), Ok(factor_to_si(unit)), "{unit}");
                }
                assert!(owners.contains(&dimension), "{unit}");
                let plain = owners.iter().filter(|it| !per_length(**it)).count();
                assert_eq!(plain, usize::from(unit.matches('/').count() < 2), "{unit}");
            }
        }
    }
}
