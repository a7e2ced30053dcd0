//! Cells of a table: numbers, with errors and units.

use super::units::{exponent, unit};
use crate::notes::Notes;

/// Texts that stand for an unknown number.
const UNKNOWN: [&str; 8] = ["", "-", "–", "—", "nan", "na", "n/a", "null"];
/// Words of instruments and spreadsheets for a number that could not be measured or computed. They also write `1.#QNAN`, and
/// words that begin with `#`.
const BAD: &str =
    "bad blank err error fail failed invalid missing n.a. n.d. k.a. none overflow -nan";
/// Numbers that instruments write where they measured nothing.
pub const NOTHING: [f64; 4] = [-9999.0, -99999.0, 9.9e37, 9.91e37];
/// The longest number with its error and unit, in bytes.
const LONGEST: usize = 100;
/// Spaces and apostrophes between thousands.
const GROUPS: [char; 6] = [' ', '\u{a0}', '\u{2009}', '\u{202f}', '\'', '’'];
const SIGNS: [char; 3] = ['+', '-', '−'];

/// A number with what people write behind it.
pub struct Written<'a> {
    pub value: f64,
    /// The number behind `±`.
    pub sigma: Option<f64>,
    /// The unit in the cell, or an empty text.
    pub unit: &'a str,
}

/// A number without the marks between its groups of thousands, as in `12 345,6`. `None` if it has no such groups.
pub fn ungrouped(text: &str, marks: &[char]) -> Option<String> {
    let (first, last) = text.trim_start_matches(SIGNS).rsplit_once(marks)?;
    let is_plain = first.chars().all(|it| it.is_ascii_digit() || marks.contains(&it));
    let mut sizes = first.split(marks).map(str::len);
    let is_first = sizes.next().is_some_and(|size| (1..=3).contains(&size));
    let rest = last.trim_start_matches(|it: char| it.is_ascii_digit());
    let is_last =
        last.len() - rest.len() == 3 && (rest.is_empty() || rest.starts_with(['.', ',', ' ']));
    let is_grouped = is_plain && is_first && is_last && !first.starts_with('0');
    (is_grouped && sizes.all(|size| size == 3)).then(|| text.replace(marks, ""))
}

/// Whether a text has only digits and marks of numbers, as `1.234,5` and `1'000`. A date is no such text.
pub fn is_numeral(text: &str) -> bool {
    let is_mark = |it: char| it.is_ascii_digit() || "+-−.,'’".contains(it);
    let is_whole = text.rsplit('.').next().is_some_and(|group| group.len() == 3);
    let has_digit = text.contains(|it: char| it.is_ascii_digit());
    has_digit && text.chars().all(is_mark) && (is_whole || text.contains([',', '\'', '’']))
}

/// Whether a text is a word for a number that could not be measured, as `#N/A`, `Bad`, `1.#QNAN` and `---`.
pub fn is_bad(text: &str) -> bool {
    let is_line = text.len() > 1 && text.chars().all(|it| "-–—_*?.".contains(it));
    // A number below the limit of detection, such as `<0.01`.
    let is_below = text.strip_prefix('<').is_some_and(|limit| written(limit.trim()).is_some());
    let is_error = text.starts_with('#') && text[1..].starts_with(char::is_alphabetic);
    is_line
        || is_error
        || is_below
        || text.contains(".#")
        || BAD.split(' ').any(|own| own == text.to_lowercase())
}

/// A number with a decimal point or comma. NaN stands for an unknown number, and `None` for any other text.
pub fn number(text: &str) -> Option<f64> {
    let plain = ungrouped(text, &GROUPS).unwrap_or_else(|| text.to_owned());
    // Fortran writes `1.2D-01`.
    let plain = plain.replace('−', "-").replace(',', ".").replace("D-", "e-").replace("D+", "e+");
    let is_digit = |byte: u8| byte.is_ascii_digit() || b"+-.eE".contains(&byte);
    let is_number = plain.bytes().all(is_digit) && !text.ends_with(',');
    let number = plain.parse().ok().filter(|number| is_number && f64::is_finite(*number));
    let is_unknown = || UNKNOWN.contains(&&*plain.to_lowercase()) || is_bad(text);
    number.or_else(|| is_unknown().then_some(f64::NAN))
}

/// A number such as `10 x 10^-6` or `1.2·10⁻⁵`.
fn power(text: &str) -> Option<f64> {
    let (digits, power) = text.split_once(['x', '×', '*', '·'])?;
    let power = power.trim().strip_prefix("10")?;
    let is_raised = !power.starts_with(|first: char| first.is_ascii_digit());
    let (digits, power) = (number(digits.trim())?, exponent(power).filter(|_| is_raised)?);
    format!("{digits}e{power}").parse().ok().filter(|number: &f64| number.is_finite())
}

/// A known number, and the unit behind it.
fn quantity(text: &str) -> Option<(f64, &str)> {
    let known = |text: &str| number(text).filter(|it| it.is_finite()).or_else(|| power(text));
    let is_start = |(_, letter): &(usize, char)| letter.is_alphabetic() || "[%°".contains(*letter);
    let mut starts = text.char_indices().filter(is_start).map(|(at, _)| text.split_at(at));
    known(text).or_else(|| power(&format!("1x{text}"))).map(|value| (value, "")).or_else(|| {
        starts.find_map(|(digits, rest)| {
            let value = known(digits.trim_end())?;
            unit(rest).map(|_| (value, rest.trim_matches(['[', ']'])))
        })
    })
}

/// A number of a cell, with its error and its unit, as `0.0011 ± 0.0002 mm^3`.
pub fn written(text: &str) -> Option<Written<'_>> {
    if let Some(value) = number(text) {
        return Some(Written { value, sigma: None, unit: "" });
    }
    let is_start = |first: char| first.is_ascii_digit() || "+-−.,(".contains(first);
    if !text.starts_with(is_start) || text.len() > LONGEST {
        return None;
    }
    let Some((value, rest)) = ["±", "+/-", "+-"].iter().find_map(|mark| text.split_once(mark))
    else {
        return quantity(text).map(|(value, unit)| Written { value, sigma: None, unit });
    };
    let (error, after) = rest.split_once(')').unwrap_or((rest, ""));
    // In `0.12 ± 0.01 x 10^-3`, the power can belong to both numbers or to one.
    let is_power = |text: &str| {
        let factor = text.split_once(['x', '×', '*', '·']);
        factor.is_some_and(|(_, power)| power.trim_start().starts_with("10"))
    };
    if is_power(error) && !is_power(value) && !value.contains(['e', 'E']) {
        return None;
    }
    let (value, mut sigma) = (quantity(value.trim_matches(['(', ' ']))?, quantity(error.trim())?);
    if sigma.1 == "%" && value.1 != "%" {
        sigma = (0.01 * sigma.0 * value.0.abs(), "");
    }
    let mut units = [value.1, sigma.1, after.trim()].into_iter().filter(|unit| !unit.is_empty());
    let own = units.next().unwrap_or("");
    let is_one = units.all(|other| unit(other) == unit(own));
    is_one.then_some(Written { value: value.0, sigma: Some(sigma.0), unit: own })
}

/// Examples of numbers with points, with commas, and with spaces or apostrophes: one whose mark can separate nothing but decimals, and one
/// whose mark can separate thousands.
#[derive(Default)]
pub struct Spelling([[String; 2]; 3]);

impl Spelling {
    pub fn see(&mut self, cell: &str) {
        for (own, marks) in self.0.iter_mut().zip([&['.'][..], &[','], &GROUPS]) {
            if cell.contains(marks) {
                cell.clone_into(&mut own[usize::from(ungrouped(cell, marks).is_some())]);
            }
        }
    }

    /// Says how the numbers were read. Between commas, points are decimal marks.
    ///
    /// # Errors
    /// The numbers have points and commas, or marks that could separate thousands.
    pub fn tell(
        &self,
        decimal: Option<char>,
        is_between_commas: bool,
        notes: &mut Notes,
    ) -> Result<(), String> {
        let Self([points, commas, [_, space]]) = self;
        let [point, comma] =
            [points, commas].map(|[sure, own]| if own.is_empty() { sure } else { own });
        let set = |mark| format!("decimal=\"{mark}\" (--decimal {mark})");
        for (example, mark, other, is_sure) in [
            (point, '.', ',', is_between_commas || !points[0].is_empty()),
            (comma, ',', '.', !commas[0].is_empty()),
        ] {
            if example.is_empty() || decimal == Some(mark) {
                continue;
            }
            let [own, other] = [mark, other].map(set);
            if decimal.is_some() {
                return Err(format!(
                    "“{example}” is no number with {other}. Write {own}, or leave it out"
                ));
            }
            if !is_sure {
                let (whole, part) = (example.replace(mark, ""), example.replace(mark, "."));
                return Err(format!(
                    "“{example}” can be {whole} or {part}. Write {other} if its mark separates thousands, or {own} if it is \
                     the decimal mark. In the file, write it as {whole} or with another digit at its end"
                ));
            }
        }
        if !comma.is_empty() && !point.is_empty() {
            return Err(format!(
                "The numbers have points and commas, such as “{point}” and “{comma}”. Write all of them with the same \
                 decimal mark, without separators of thousands"
            ));
        }
        for (told, example) in [
            ("Points are decimal marks", &points[1]),
            ("Commas are decimal marks", comma),
            ("Spaces and apostrophes separate thousands", space),
        ] {
            if let Some(read) = written(example).filter(|_| !example.is_empty()) {
                notes.push(format!("{told}: “{example}” was read as {}.", read.value));
            }
        }
        Ok(())
    }
}
