//! Cells of a table: numbers, units, and names with units.

use fretwork_engine::request::quantity::{Dimension, parse};

/// Texts that stand for an unknown number.
const UNKNOWN: [&str; 8] = ["", "-", "–", "—", "nan", "na", "n/a", "null"];
/// Texts that stand for the unit of a plain number.
const PLAIN: [&str; 5] = ["", "-", "1", "cycle", "cycles"];
/// Units that a table may have, although no quantity of a scenario has them.
const FOREIGN: [&str; 12] = ["s", "ms", "min", "h", "Hz", "kg", "g", "mg", "ug", "%", "°C", "K"];

/// What a cell contains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cell {
    /// A number.
    Number(f64),
    /// No number, because it is not known.
    Unknown,
    /// Anything else.
    Text,
}

impl Cell {
    /// Reads a cell. The decimal mark is a point or a comma.
    pub fn read(text: &str) -> Self {
        let plain = text.replace('−', "-").replace(',', ".");
        let is_digits = plain.bytes().all(|byte| byte.is_ascii_digit() || b"+-.eE".contains(&byte));
        match plain.parse() {
            Ok(number) if is_digits && f64::is_finite(number) && !text.ends_with(',') => {
                Self::Number(number)
            }
            _ if UNKNOWN.contains(&plain.to_lowercase().as_str()) => Self::Unknown,
            _ => Self::Text,
        }
    }
}

/// What to do with a text in a column of numbers.
pub fn remedy(text: &str, name: &str) -> String {
    let marks = |c: char| " '’.,\u{a0}\u{202f}".contains(c);
    let digits = |text: &str| text.chars().filter(char::is_ascii_digit).collect::<String>();
    if text.starts_with(|c: char| c.is_ascii_digit())
        && text.chars().all(|c| c.is_ascii_digit() || marks(c))
    {
        // The last mark is the decimal mark if it is the only one of its kind, and a point or a comma.
        let is_decimal = |at: &usize| {
            [".", ","]
                .iter()
                .any(|mark| text[*at..].starts_with(mark) && text.matches(mark).count() == 1)
        };
        let others = text.chars().filter(|c| marks(*c)).count() > 1;
        let last = text.rfind(marks).filter(|at| others && is_decimal(at));
        let plain = match last {
            Some(at) => format!("{}.{}", digits(&text[..at]), digits(&text[at..])),
            None => digits(text),
        };
        return format!("has separators of thousands. Write {plain}");
    }
    match text.split_once(' ') {
        Some((number, rest)) if Cell::read(number) != Cell::Text && unit(rest).is_some() => {
            format!("has a unit. Write the unit once, in the header: {name} [{rest}]")
        }
        _ => "is not a number. Leave the cell empty if the number is not known".to_owned(),
    }
}

/// A unit: its dimension, `None` if no quantity of a scenario has it, and its factor to SI.
pub fn unit(text: &str) -> Option<(Option<Dimension>, f64)> {
    let text = text.trim().trim_matches(['[', ']', '(', ')']).trim();
    if PLAIN.contains(&text) {
        return Some((Some(Dimension::Number), 1.0));
    }
    let one = format!("1 {text}");
    let of = |it: Dimension| Some((Some(it), parse(&one, it).ok()?));
    Dimension::ALL.into_iter().find_map(of).or(FOREIGN.contains(&text).then_some((None, 1.0)))
}

/// Splits a header such as `Depth [µm]`, `Force/N` or `wear_volume mm^3` into name and unit.
pub fn header(text: &str) -> (&str, Option<&str>) {
    let split = |(at, mark): (usize, char)| {
        if at == 0 || !" /(,".contains(mark) {
            return None;
        }
        let rest = text[at + 1..].trim();
        let is_bracketed = mark == '(' || rest.starts_with('(');
        let is_unit = is_bracketed || !PLAIN.contains(&rest);
        (is_unit && unit(rest).is_some()).then_some((at, rest))
    };
    let (at, unit) = match text.find('[') {
        Some(at) => (at, Some(&text[at + 1..])),
        None => text
            .char_indices()
            .find_map(split)
            .map_or((text.len(), None), |(at, rest)| (at, Some(rest))),
    };
    let unit = unit.map(|unit| unit.trim_matches(['[', ']', ' ']));
    (text[..at].trim_end_matches([' ', '/', ',', '(', ':']).trim_start(), unit)
}
