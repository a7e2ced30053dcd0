//! Cells of a table: numbers, units, and names with units.

use fretwork_engine::request::quantity::{Dimension, parse};

/// Texts that stand for an unknown number.
const UNKNOWN: [&str; 8] = ["", "-", "–", "—", "nan", "na", "n/a", "null"];
/// Texts that stand for the unit of a plain number.
const PLAIN: [&str; 5] = ["", "-", "1", "cycle", "cycles"];
/// Units that a table may have, although no quantity of a scenario has them.
const FOREIGN: [&str; 10] = ["s", "ms", "min", "h", "Hz", "kg", "g", "mg", "%", "°C"];

/// A number with a decimal point or comma. NaN stands for an unknown number, and `None` for any other text.
pub fn number(text: &str) -> Option<f64> {
    let plain = text.replace('−', "-").replace(',', ".");
    let is_digit = |byte: u8| byte.is_ascii_digit() || b"+-.eE".contains(&byte);
    let is_number = plain.bytes().all(is_digit) && !text.ends_with(',');
    let number = plain.parse().ok().filter(|number| is_number && f64::is_finite(*number));
    number.or_else(|| UNKNOWN.contains(&&*plain.to_lowercase()).then_some(f64::NAN))
}

/// A unit: its dimension, `None` if no quantity of a scenario has it, and its factor to SI.
pub fn unit(text: &str) -> Option<(Option<Dimension>, f64)> {
    let text = text.trim_matches(['[', ']', '(', ')', ' ']);
    let one = format!("1 {text}");
    let of = |it: Dimension| Some((Some(it), parse(&one, it).ok()?));
    match text {
        _ if PLAIN.contains(&text) => Some((Some(Dimension::Number), 1.0)),
        _ if FOREIGN.contains(&text) => Some((None, 1.0)),
        _ => Dimension::ALL.into_iter().find_map(of),
    }
}

/// Splits a header such as `Depth [µm]`, `Force/N` or `wear_volume mm^3` into name and unit.
pub fn header(text: &str) -> (&str, Option<&str>) {
    let is_split = |(at, mark): &(usize, char)| {
        let rest = text[at + mark.len_utf8()..].trim();
        let is_bracketed = *mark == '(' || rest.starts_with('(');
        " /(,".contains(*mark) && (is_bracketed || !PLAIN.contains(&rest)) && unit(rest).is_some()
    };
    let at = text.find('[').or_else(|| Some(text.char_indices().skip(1).find(is_split)?.0));
    let (name, unit) = text.split_at(at.unwrap_or(text.len()));
    let marks = [' ', '/', ',', '(', ':'];
    (name.trim_matches(marks), at.map(|_| unit.trim_matches(['[', ']', ' ', '/', ','])))
}
