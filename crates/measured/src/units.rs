//! Units of a table, and names with units.

use fretwork_engine::request::quantity::{Dimension, parse};

/// Texts that stand for the unit of a plain number.
const PLAIN: [&str; 5] = ["", "-", "1", "cycle", "cycles"];
/// Units of masses, with their factors to kg.
pub const MASSES: [(&str, f64); 4] = [("kg", 1.0), ("g", 1e-3), ("mg", 1e-6), ("ug", 1e-9)];
/// The weight of 1 kg in N.
pub const GRAVITY: f64 = 9.806_65;
/// Units that a table may have, although neither a scenario nor a measured output has them.
const FOREIGN: [&str; 7] = ["s", "ms", "min", "h", "Hz", "%", "°C"];
/// Units that only tables have, with their dimensions and their factors to SI.
const OTHERS: [(&str, Dimension, f64); 5] = [
    ("Å", Dimension::Length, 1e-10),
    ("pm", Dimension::Length, 1e-12),
    ("gf", Dimension::Force, 1e-3 * GRAVITY),
    ("kgf", Dimension::Force, GRAVITY),
    ("kp", Dimension::Force, GRAVITY),
];
/// Words for units, without the s of a plural, and for their prefixes. Behind each is its symbol.
const WORDS: &str = "micron um angstrom Å meter m metre m newton N pascal Pa joule J gram g gramforce gf \
                     kilogramforce kgf inch in degree deg radian rad sec s second s minute min hour h percent %";
const PREFIXES: &str = "nano n micro u milli m centi c kilo k mega M giga G";
/// The shortest word for a unit, in letters.
const SHORTEST: usize = 3;
/// Powers of length and force of the dimensions that a product of units can have.
const PRODUCTS: [(Dimension, [i32; 2]); 7] = [
    (Dimension::Length, [1, 0]),
    (Dimension::Force, [0, 1]),
    (Dimension::Stress, [-2, 1]),
    (Dimension::Energy, [1, 1]),
    (Dimension::Volume, [3, 0]),
    (Dimension::Stiffness, [-1, 1]),
    (Dimension::WearCoefficient, [2, -1]),
];

/// A known unit: its dimension, `None` if no quantity of a scenario has it, the unit in SI, and the factor to that.
pub type Unit = (Option<Dimension>, String, f64);

/// The symbol of a unit that is written as a word, such as `um` for `Microns` or `micrometer`.
pub fn symbol(text: &str) -> String {
    let text = text.trim();
    let inner = |marks: [char; 2]| text.strip_prefix(marks[0])?.strip_suffix(marks[1]);
    let word =
        inner(['(', ')']).or(inner(['[', ']'])).unwrap_or(text).trim_matches([' ', ']', '.']);
    let cubed = ["cubic ", "cu. ", "cu "].iter().find_map(|own| word.strip_prefix(own));
    if let Some(length) = cubed {
        return format!("{}^3", symbol(length));
    }
    let lower = word.to_lowercase().replace(['-', ' '], "");
    let pairs = |list: &'static str| {
        let words: Vec<&str> = list.split_whitespace().collect();
        words.chunks(2).map(|pair| (pair[0], pair[1])).collect::<Vec<_>>()
    };
    let word_of = |word: &str| {
        let singular = word.strip_suffix("es").into_iter().chain(word.strip_suffix('s'));
        let find = |own: &str| pairs(WORDS).iter().find(|it| it.0 == own).map(|it| it.1);
        singular.chain([word]).find_map(find)
    };
    let prefixed = || {
        let (long, short) = *pairs(PREFIXES).iter().find(|it| lower.starts_with(it.0))?;
        Some(format!("{short}{}", word_of(&lower[long.len()..])?))
    };
    if lower.len() < SHORTEST || !lower.is_ascii() {
        return word.to_owned();
    }
    word_of(&lower).map(str::to_owned).or_else(prefixed).unwrap_or_else(|| word.to_owned())
}

/// How many cycles a unit such as `kcycles`, `10^3 cycles` or `thousands` is.
fn counts(text: &str) -> Option<f64> {
    let lower = text.to_lowercase();
    let plain = lower.strip_suffix('s').unwrap_or(&lower);
    let (before, is_cycles) = plain.strip_suffix("cycle").map_or((plain, false), |it| (it, true));
    match before.trim().trim_end_matches(" of").trim_end_matches('s') {
        "thousand" => Some(1e3),
        "million" => Some(1e6),
        "k" | "kilo" | "10^3" | "10³" | "1e3" | "1000" if is_cycles => Some(1e3),
        "mega" | "10^6" | "10⁶" | "1e6" | "1000000" if is_cycles => Some(1e6),
        "m" if is_cycles && text.starts_with('M') => Some(1e6),
        _ => None,
    }
}

/// Reads the unit of a header or of a cell.
pub fn unit(text: &str) -> Option<Unit> {
    let text = &*symbol(text);
    let plain = text.replace(['µ', 'μ'], "u");
    let mass = MASSES.iter().find(|it| it.0 == plain).map(|it| (None, "kg", it.1));
    let other = OTHERS.iter().find(|it| it.0 == plain).map(|it| (Some(it.1), it.1.si(), it.2));
    let of = |it: Dimension| Some((Some(it), it.si(), parse(&format!("1 {text}"), it).ok()?));
    let known = match text {
        _ if PLAIN.contains(&text) => Some((Some(Dimension::Number), "1", 1.0)),
        _ if FOREIGN.contains(&text) => Some((None, text, 1.0)),
        _ => mass.or(other).or_else(|| Dimension::ALL.into_iter().find_map(of)),
    };
    known
        .or_else(|| Some((Some(Dimension::Number), "1", counts(text)?)))
        .or_else(|| product(text))
        .map(|(dimension, si, factor)| (dimension, si.to_owned(), factor))
}

/// An exponent such as `^-6` or `⁻⁶`.
pub fn exponent(text: &str) -> Option<i32> {
    let plain =
        text.chars().map(|it| match "⁰¹²³⁴⁵⁶⁷⁸⁹⁻".chars().position(|own| own == it)
        {
            Some(place) => char::from(b"0123456789-"[place]),
            None if it == '−' => '-',
            None => it,
        });
    let plain: String = plain.filter(|it| !"^{}".contains(*it)).collect();
    plain.parse().ok().filter(|exponent: &i32| exponent.abs() < 400)
}

/// A product of units, such as `mm3/N/m` or `mm^3 N^-1 m^-1`.
fn product(text: &str) -> Option<(Option<Dimension>, &'static str, f64)> {
    let (mut powers, mut factor) = ([0, 0], 1.0);
    for (place, part) in text.split('/').enumerate() {
        for term in part.split([' ', '·', '⋅', '*', '(', ')']).filter(|term| !term.is_empty()) {
            let end = term.find(|it: char| !it.is_alphabetic() && it != '°').unwrap_or(term.len());
            let (name, power) = term.split_at(end);
            if term == "1" {
                continue;
            }
            // A number alone, as in `V 3`, is no unit.
            if name.is_empty() {
                return None;
            }
            let power = if power.is_empty() { 1 } else { exponent(power)? };
            let exponent = if place > 0 { -power } else { power };
            let known = PRODUCTS[..5].iter().find_map(|(dimension, own)| {
                Some((own, parse(&format!("1 {}", symbol(name)), *dimension).ok()?))
            });
            let (own, of_one) = known?;
            let power = (0..exponent.abs().min(9)).fold(1.0, |power, _| power * of_one);
            factor *= if exponent < 0 { 1.0 / power } else { power };
            (0..2).for_each(|at| powers[at] += exponent * own[at]);
        }
    }
    let (dimension, _) = PRODUCTS.iter().find(|(_, own)| *own == powers)?;
    let is_energy = *dimension == Dimension::WearCoefficient && text.contains('J');
    let dimension = if is_energy { Dimension::EnergyWear } else { *dimension };
    Some((Some(dimension), dimension.si(), factor))
}

/// Where a factor at the end of a name begins, such as `1e-3` in `V in 1e-3 mm^3`. The 2 in `Sensor 2 (um)` is none.
fn factor(name: &str, is_bracketed: bool) -> Option<usize> {
    let name = name.trim_end();
    let word = name.rsplit([' ', '/', '(', ',', '*', '×']).next().unwrap_or("");
    let at = name.len() - word.len();
    let plain = word.trim_start_matches(if at > 0 { 'x' } else { ' ' }).trim_end_matches(')');
    let is_power = plain.starts_with("10") && !plain.contains(char::is_alphabetic);
    let is_number = is_power || plain.parse::<f64>().is_ok_and(f64::is_finite);
    let is_label = is_bracketed
        && plain.bytes().all(|byte| byte.is_ascii_digit())
        && (word == plain || plain.len() == 1)
        && !name[..at].trim_end().ends_with(['×', '*', '/']);
    (is_number && !is_label).then_some(at)
}

/// Splits a header such as `Depth [µm]`, `Force/N`, `dx_um` or `wear_volume mm^3` into name and unit. A factor belongs to the
/// unit, which is then unknown, as other words in brackets at the end are.
pub fn header(text: &str) -> (&str, Option<&str>) {
    if counts(text).is_some() {
        return ("cycles", Some(text));
    }
    let is_split = |(at, mark): &(usize, char)| {
        let rest = text[at + mark.len_utf8()..].trim();
        let rest = rest.strip_suffix(')').filter(|_| *mark == '(').unwrap_or(rest);
        let is_bracketed = *mark == '(' || rest.starts_with('(');
        let is_inside = text[..*at].matches('(').count() > text[..*at].matches(')').count();
        let is_unit = is_bracketed || !PLAIN.contains(&rest);
        " /(,_".contains(*mark) && !is_inside && is_unit && unit(rest).is_some()
    };
    let known = || Some(text.char_indices().skip(1).find(is_split)?.0);
    let bracket = || text.ends_with(')').then(|| text.rfind('('))?.filter(|at| *at > 0);
    let at = text.find('[').or_else(known).or_else(bracket);
    let is_bracketed =
        at.is_none_or(|at| text[at..].trim_start_matches('_').trim_start().starts_with(['[', '(']));
    let at = factor(&text[..at.unwrap_or(text.len())], is_bracketed).or(at);
    let (name, unit) = text.split_at(at.unwrap_or(text.len()));
    let marks = [' ', '/', ',', '(', ':', '×', '*', '_'];
    let unit = unit.trim_matches(['[', ']', ' ', '/', ',', '_']);
    let inner = unit.strip_prefix('(').and_then(|own| own.strip_suffix(')')).unwrap_or(unit);
    (name.trim_matches(marks), at.map(|_| inner))
}
