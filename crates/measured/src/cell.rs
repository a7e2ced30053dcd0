//! Cells of a table: numbers, with errors and units.

use std::borrow::Cow;

use super::units::{exponent, unit};

/// Texts that stand for an unknown number.
const UNKNOWN: [&str; 8] = ["", "-", "–", "—", "nan", "na", "n/a", "null"];
/// Words of instruments and spreadsheets for a number that could not be measured or computed. They also write `1.#QNAN`, and
/// words that begin with `#`.
const BAD: [&str; 12] = [
    "bad", "blank", "err", "error", "fail", "failed", "invalid", "missing", "n.a.", "none",
    "overflow", "-nan",
];
/// The longest number with its error and unit, in bytes.
const LONGEST: usize = 100;
/// Spaces between thousands.
const SPACES: [char; 4] = [' ', '\u{a0}', '\u{2009}', '\u{202f}'];

/// A number with what people write behind it.
#[derive(Debug, PartialEq)]
pub struct Written<'a> {
    pub value: f64,
    /// The number behind `±`.
    pub sigma: Option<f64>,
    /// The unit in the cell, or an empty text.
    pub unit: &'a str,
}

/// Whether spaces separate thousands in a text, as in `12 345,6`.
fn has_thousands(text: &str) -> bool {
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

/// Whether a text is a word for a number that could not be measured, as `#N/A`, `Bad`, `1.#QNAN` and `---`.
pub fn is_bad(text: &str) -> bool {
    let is_line = text.len() > 1 && text.chars().all(|it| "-–—_*?.".contains(it));
    let is_error = text.starts_with('#') && text[1..].starts_with(char::is_alphabetic);
    is_line || is_error || text.contains(".#") || BAD.contains(&&*text.to_lowercase())
}

/// A number with a decimal point or comma. NaN stands for an unknown number, and `None` for any other text.
pub fn number(text: &str) -> Option<f64> {
    let plain = text.replace('−', "-").replace(',', ".");
    let plain = if has_thousands(text) { plain.replace(SPACES, "") } else { plain };
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
    let power = exponent(power)?;
    let digits = digits.trim().replace('−', "-").replace(',', ".");
    let number = format!("{digits}e{power}").parse().ok();
    number.filter(|number: &f64| is_raised && number.is_finite())
}

/// A known number without an error.
fn bare(text: &str) -> Option<Written<'_>> {
    written(text).filter(|it| it.value.is_finite() && it.sigma.is_none())
}

/// A number of a cell, with its error and its unit, as `0.0011 ± 0.0002 mm^3`.
pub fn written(text: &str) -> Option<Written<'_>> {
    let plain = |value| Some(Written { value, sigma: None, unit: "" });
    if let Some(value) = number(text) {
        return plain(value);
    }
    let is_start = |first: char| first.is_ascii_digit() || "+-−.,(".contains(first);
    if !text.starts_with(is_start) || text.len() > LONGEST {
        return None;
    }
    if let Some((value, rest)) = ["±", "+/-", "+-"].iter().find_map(|mark| text.split_once(mark)) {
        let value = bare(value.trim_matches(['(', ' ']))?;
        let (rest, unit) = rest.split_once(')').unwrap_or((rest, ""));
        let sigma = bare(rest.trim())?;
        let unit = [value.unit, sigma.unit, unit.trim()].into_iter().find(|unit| !unit.is_empty());
        return Some(Written {
            value: value.value,
            sigma: Some(sigma.value),
            unit: unit.unwrap_or(""),
        });
    }
    if let Some(value) = power(text).or_else(|| power(&format!("1x{text}"))) {
        return plain(value);
    }
    let is_start = |(_, letter): &(usize, char)| letter.is_alphabetic() || "[%°".contains(*letter);
    let mut starts = text.char_indices().filter(is_start).map(|(at, _)| text.split_at(at));
    starts.find_map(|(digits, rest)| {
        let digits = digits.trim_end();
        let value = number(digits).filter(|it| it.is_finite()).or_else(|| power(digits))?;
        unit(rest).map(|_| Written { value, sigma: None, unit: rest.trim_matches(['[', ']']) })
    })
}

/// Whether a mark in a number can separate thousands, as in `1,000`, but not in `0,500` or `1,5`.
fn is_ambiguous(cell: &str, mark: char) -> bool {
    let (before, after) =
        cell.trim_start_matches(['+', '-', '−']).split_once(mark).unwrap_or(("", ""));
    let is_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    (1..=3).contains(&before.len())
        && !before.starts_with('0')
        && after.len() == 3
        && is_digits(before)
        && is_digits(after)
}

/// A cell without separators of thousands, if the decimal mark is known.
pub fn ungrouped(cell: &str, decimal: char) -> Cow<'_, str> {
    let other = if decimal == '.' { ',' } else { '.' };
    let whole = cell.split(decimal).next().unwrap_or(cell);
    let (first, rest) = whole.split_once(other).unwrap_or((whole, ""));
    let first = first.trim_start_matches(['+', '-', '−']);
    let is_grouped = (1..=3).contains(&first.len())
        && !first.starts_with('0')
        && rest.split(other).all(|group| group.len() == 3);
    if is_grouped { cell.replace(other, "").into() } else { cell.into() }
}

/// Examples of numbers with a decimal point, with a decimal comma, and with spaces between thousands.
#[derive(Default)]
pub struct Spelling {
    examples: [String; 3],
    /// Whether a point or a comma surely is a decimal mark.
    is_sure: [bool; 2],
}

impl Spelling {
    pub fn with_sure_point(is_sure: bool) -> Self {
        Self { is_sure: [is_sure, false], ..Self::default() }
    }

    pub fn see(&mut self, cell: &str) {
        for (is_sure, mark) in self.is_sure.iter_mut().zip(['.', ',']) {
            *is_sure |= cell.contains(mark) && !is_ambiguous(cell, mark);
        }
        for (best, mark) in self.examples.iter_mut().zip(['.', ',', ' ']) {
            // A number that could have a separator of thousands is the best example of a decimal comma.
            let at = cell.find(mark).filter(|at| best.is_empty() || cell.len() - at == 4);
            if if mark == ' ' { has_thousands(cell) } else { at.is_some() } {
                cell.clone_into(best);
            }
        }
    }

    /// Says how the numbers were read.
    ///
    /// # Errors
    /// The numbers have points and commas, or marks that could separate thousands.
    pub fn tell(&self, decimal: Option<char>, notes: &mut Vec<String>) -> Result<(), String> {
        let [point, comma, space] = &self.examples;
        for (example, mark, other, is_sure) in
            [(point, '.', ',', self.is_sure[0]), (comma, ',', '.', self.is_sure[1])]
        {
            if decimal == Some(other) && !example.is_empty() {
                return Err(format!(
                    "“{example}” is no number with decimal={other}. Write decimal={mark}, or leave it out"
                ));
            }
            if decimal.is_none() && !example.is_empty() && !is_sure {
                let whole = example.replace(mark, "");
                return Err(format!(
                    "“{example}” can be {whole} or {}. Write decimal={other} if its mark separates thousands, or \
                     decimal={mark} if it is the decimal mark. In the file, write it as {whole} or with another digit at its end",
                    example.replace(',', ".")
                ));
            }
        }
        if !comma.is_empty() && !point.is_empty() {
            return Err(format!(
                "The numbers have points and commas, such as “{point}” and “{comma}”. Write all of them with the same \
                 decimal mark, without separators of thousands"
            ));
        }
        let is_clear = point.find('.') != point.len().checked_sub(4) || point.starts_with('0');
        for (told, example) in [
            ("Points are decimal marks", if is_clear { "" } else { point }),
            ("Commas are decimal marks", comma),
            ("Spaces separate thousands", space),
        ] {
            if let Some(read) = written(example).filter(|_| !example.is_empty()) {
                notes.push(format!("{told}: “{example}” was read as {}.", read.value));
            }
        }
        Ok(())
    }
}
