//! Cells of a table: numbers, units, and names with units.

use fretwork_engine::request::quantity::{Dimension, parse};

/// Texts that stand for an unknown number.
const UNKNOWN: [&str; 8] = ["", "-", "–", "—", "nan", "na", "n/a", "null"];
/// Texts that stand for the unit of a plain number.
const PLAIN: [&str; 5] = ["", "-", "1", "cycle", "cycles"];
/// Units of masses, with their factors to kg.
pub const MASSES: [(&str, f64); 4] = [("kg", 1.0), ("g", 1e-3), ("mg", 1e-6), ("ug", 1e-9)];
/// Units that a table may have, although neither a scenario nor a measured output has them.
const FOREIGN: [&str; 7] = ["s", "ms", "min", "h", "Hz", "%", "°C"];
/// Spaces between thousands.
const SPACES: [char; 4] = [' ', '\u{a0}', '\u{2009}', '\u{202f}'];

/// Whether spaces separate thousands in a text, as in `12 345,6`.
pub fn has_thousands(text: &str) -> bool {
    let digits = |group: &str| group.bytes().take_while(u8::is_ascii_digit).count();
    let mut groups = text.trim_start_matches(['+', '-', '−']).split(SPACES);
    let first = groups.next().unwrap_or("");
    let is_first = (1..=3).contains(&first.len()) && digits(first) == first.len();
    is_first && text.contains(SPACES) && groups.all(|group| digits(group) == 3)
}

/// Whether points, commas or apostrophes separate thousands in a text, as in `1.234,5`. A date is no such number.
pub fn is_grouped(text: &str) -> bool {
    let is_number = text.chars().all(|it| it.is_ascii_digit() || "+-−.,'’".contains(it));
    let is_whole = text.contains(',') || text.rsplit('.').next().is_some_and(|it| it.len() == 3);
    is_number && (text.contains(['\'', '’']) || text.matches(['.', ',']).count() > 1 && is_whole)
}

/// A number with a decimal point or comma. NaN stands for an unknown number, and `None` for any other text.
pub fn number(text: &str) -> Option<f64> {
    let plain = text.replace('−', "-").replace(',', ".");
    let plain = if has_thousands(text) { plain.replace(SPACES, "") } else { plain };
    let is_digit = |byte: u8| byte.is_ascii_digit() || b"+-.eE".contains(&byte);
    let is_number = plain.bytes().all(is_digit) && !text.ends_with(',');
    let number = plain.parse().ok().filter(|number| is_number && f64::is_finite(*number));
    number.or_else(|| UNKNOWN.contains(&&*plain.to_lowercase()).then_some(f64::NAN))
}

/// A known unit: its dimension, `None` if no quantity of a scenario has it, the unit in SI, and the factor to that.
pub fn unit(text: &str) -> Option<(Option<Dimension>, String, f64)> {
    let text = text.trim_matches(['[', ']', '(', ')', ' ']);
    let plain = text.replace(['µ', 'μ'], "u");
    let mass = MASSES.iter().find(|it| it.0 == plain).map(|it| (None, "kg", it.1));
    let of = |it: Dimension| Some((Some(it), it.si(), parse(&format!("1 {text}"), it).ok()?));
    let known = match text {
        _ if PLAIN.contains(&text) => Some((Some(Dimension::Number), "1", 1.0)),
        _ if FOREIGN.contains(&text) => Some((None, text, 1.0)),
        _ => mass.or_else(|| Dimension::ALL.into_iter().find_map(of)),
    };
    known.map(|(dimension, si, factor)| (dimension, si.to_owned(), factor))
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

/// Splits a header such as `Depth [µm]`, `Force/N` or `wear_volume mm^3` into name and unit. A factor belongs to the
/// unit, which is then unknown.
pub fn header(text: &str) -> (&str, Option<&str>) {
    let is_split = |(at, mark): &(usize, char)| {
        let rest = text[at + mark.len_utf8()..].trim();
        let is_bracketed = *mark == '(' || rest.starts_with('(');
        " /(,".contains(*mark) && (is_bracketed || !PLAIN.contains(&rest)) && unit(rest).is_some()
    };
    let at = text.find('[').or_else(|| Some(text.char_indices().skip(1).find(is_split)?.0));
    let is_bracketed = at.is_none_or(|at| text[at..].trim_start().starts_with(['[', '(']));
    let at = factor(&text[..at.unwrap_or(text.len())], is_bracketed).or(at);
    let (name, unit) = text.split_at(at.unwrap_or(text.len()));
    let marks = [' ', '/', ',', '(', ':', '×', '*'];
    (name.trim_matches(marks), at.map(|_| unit.trim_matches(['[', ']', ' ', '/', ','])))
}
