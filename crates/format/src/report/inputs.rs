//! The inputs of a result in words: each number with its unit, long lists shortened.

use serde_json::Value;

use super::html::in_unit;
use crate::figure::words::{capital, member, shortened, typeset};
use crate::units::in_engineering;
use crate::view::View;
use fretwork_study::Member;

/// Maximum number of inputs, of items of a list that is written out, and of digits of a number that the engine computed.
const MOST: usize = 60;
const ITEMS: usize = 6;
const DIGITS: u8 = 6;
/// Digits of other numbers.
const ALL_DIGITS: u8 = 12;
/// Longest text, in characters.
const TEXT: usize = 200;

/// The inputs of a scenario or study, for people. With a view, the numbers are converted to its units and rounded.
/// Without one, they are as typed.
pub fn in_words(asked: &Value, view: Option<&View>) -> Vec<(String, String)> {
    let mut all = listed(asked, view);
    let more = all.len().saturating_sub(MOST);
    all.truncate(MOST);
    let named = |(pointer, value): (String, String)| {
        let own = pointer.strip_prefix("/scenario").unwrap_or(&pointer);
        (capital(&member(own)), value)
    };
    let mut all: Vec<_> = all.into_iter().map(named).collect();
    if more > 0 {
        all.push(("More inputs".to_owned(), more.to_string()));
    }
    all
}

/// The pointers of the inputs and their values.
pub fn listed(asked: &Value, view: Option<&View>) -> Vec<(String, String)> {
    let mut found = Vec::new();
    collect(asked, String::new(), &mut found);
    let root = if asked.get("scenario").is_some() { "/scenario" } else { "" };
    let scenario = asked.pointer(root).unwrap_or(asked);
    // Numbers without a unit are in SI.
    let plain = found.iter().filter(|(_, value)| value.is_number());
    let plain: Vec<&str> =
        plain.filter_map(|(pointer, _)| pointer.strip_prefix(root)).take(MOST).collect();
    let units = Member::find_all(scenario, plain);
    let units: Vec<Member> = units.into_iter().filter_map(Result::ok).collect();
    let written = |(pointer, value): (String, &Value)| {
        let own = units.iter().find(|unit| Some(&*unit.pointer) == pointer.strip_prefix(root));
        let (si, number) = (own.map_or("1", |unit| unit.dimension.si()), value.as_f64());
        let text = match (number, view) {
            (Some(number), Some(view)) => {
                let converted = view.engineering.then(|| in_engineering(number, si));
                let (number, unit) = converted.unwrap_or((number, si));
                in_unit(&shortened(number, DIGITS), &typeset(unit))
            }
            (Some(_), None) => in_unit(&plainly(value), &typeset(si)),
            (None, _) => plainly(value),
        };
        (pointer, text)
    };
    found.into_iter().map(written).collect()
}

/// Collects the members of objects. A short list of objects has a line for each of them.
fn collect<'a>(value: &'a Value, pointer: String, out: &mut Vec<(String, &'a Value)>) {
    match value {
        Value::Object(members) => {
            for (name, value) in members.iter().filter(|(_, value)| !value.is_null()) {
                collect(value, format!("{pointer}/{name}"), out);
            }
        }
        Value::Array(items) if items.len() <= ITEMS && items.iter().any(Value::is_object) => {
            for (place, item) in items.iter().enumerate() {
                out.push((format!("{pointer}/{}", place + 1), item));
            }
        }
        _ => out.push((pointer, value)),
    }
}

/// A value on one line. Of a long list, only the ends are written.
fn plainly(value: &Value) -> String {
    let text = match value {
        Value::String(text) => text.clone(),
        Value::Number(number) => shortened(number.as_f64().unwrap_or(f64::NAN), ALL_DIGITS),
        Value::Array(items) if items.len() > ITEMS => {
            let ends = [&items[0], &items[1], &items[items.len() - 1]].map(plainly);
            let [first, second, last] = ends;
            format!("{first}, {second}, … {last} ({} items)", items.len())
        }
        Value::Array(items) => items.iter().map(plainly).collect::<Vec<_>>().join(", "),
        Value::Object(members) => {
            let each = members.iter().take(2 * ITEMS);
            let each = each.map(|(name, value)| format!("{} {}", member(name), plainly(value)));
            each.collect::<Vec<_>>().join("; ")
        }
        other => other.to_string(),
    };
    match text.char_indices().nth(TEXT) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}
