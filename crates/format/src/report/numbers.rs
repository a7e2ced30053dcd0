//! The inputs and the main numbers of a result in words, in the notation of the page.

use serde_json::Value;

use super::entry::Pairs;
use crate::figure::words::{capital, output, whole};
use crate::statistics;
use crate::{Document, Notation, Part, Result, Verdict, View};
use fretwork_engine::Dimension;
use fretwork_engine::input::inputs::{VALUES, measure_at};
use fretwork_engine::input::quantity::parse;
use fretwork_job::TaskKind;
use fretwork_study::Kind;

/// Significant digits of an input, and of a result.
const TYPED: u8 = 12;
const COMPUTED: u8 = 4;
/// Longest text, in characters.
const TEXT: usize = 200;
/// The sections of a run beside its history.
const SECTIONS: [&str; 3] = ["scales", "unworn", "limit"];

/// The inputs of a scenario or a study, as they are written there. Plain numbers are in SI. A number that the study varies or
/// estimates is not an input of its scenario.
pub fn inputs(asked: &Value, notation: Notation) -> Pairs {
    let scenario = asked.get("scenario").unwrap_or(asked);
    let of_study = asked.as_object().filter(|_| asked.get("scenario").is_some());
    let of_study = || of_study.into_iter().flatten().filter(|(name, _)| *name != "scenario");
    let varied: Vec<&str> = of_study().flat_map(|(name, value)| pointers(name, value)).collect();
    let mut found = Vec::new();
    collect(scenario, String::new(), &mut |pointer, value| {
        if varied.contains(&&*pointer) {
            return;
        }
        let unit = measure_at(&pointer, scenario).dimension.si();
        let text = match value {
            Value::Number(number) => {
                notation.quantity(number.as_f64().unwrap_or(f64::NAN), unit, TYPED)
            }
            Value::String(text) => typed(text, notation),
            other => other.to_string(),
        };
        found.push((whole(&pointer, scenario), cut(text)));
    });
    found.extend(of_study().map(|(name, value)| (capital(name), cut(value.to_string()))));
    found
}

/// The pointers of the numbers that a member of a study varies or estimates.
fn pointers<'a>(name: &str, value: &'a Value) -> Vec<&'a str> {
    let mut axes = Kind::ALL.iter().flat_map(|kind| kind.axes);
    let own = axes.find(|(axis, _)| *axis == name).map(|(_, pointer)| *pointer);
    let items = value.as_array().into_iter().flatten();
    own.into_iter().chain(items.filter_map(|item| item["pointer"].as_str())).collect()
}

/// A text of a scenario: a number with a unit, or a word.
fn typed(text: &str, notation: Notation) -> String {
    let dimensions = Dimension::all().filter(|it| *it != Dimension::Number);
    let mut numbers = dimensions.filter_map(|it| Some((parse(text, it).ok()?, it.si())));
    let word = VALUES.iter().find(|(value, _)| *value == text).map(|(_, words)| *words);
    match numbers.next() {
        Some((number, si)) => notation.quantity(number, si, TYPED),
        None => word.map_or_else(|| capital(&text.replace('_', " ")), str::to_owned),
    }
}

/// Calls `add` with the pointer of each member that is no object. A list of objects counts as an object.
fn collect(value: &Value, pointer: String, add: &mut impl FnMut(String, &Value)) {
    match value {
        Value::Null => {}
        Value::Object(members) => {
            for (name, value) in members {
                collect(value, format!("{pointer}/{name}"), add);
            }
        }
        Value::Array(items) if items.iter().any(Value::is_object) => {
            for (place, item) in items.iter().enumerate() {
                collect(item, format!("{pointer}/{place}"), add);
            }
        }
        value => add(pointer, value),
    }
}

/// A text with at most [`TEXT`] characters.
fn cut(mut text: String) -> String {
    if let Some((end, _)) = text.char_indices().nth(TEXT) {
        text.truncate(end);
        text.push('…');
    }
    text
}

/// The numbers of a run at its last output cycle, the estimates of a fit, or the range of each output of a study.
pub fn results(si: &Document<'_>, asked: &Value, notation: Notation) -> Result<Pairs> {
    let scenario = asked.get("scenario").unwrap_or(asked);
    let mut found = Vec::new();
    let mut add = |name: &str, values: &[f64]| {
        let (quantity, rest) = output(name, scenario);
        let column = name.rsplit('.').next().unwrap_or(name);
        let unit = si.head.units.of(column).unwrap_or("1");
        found.push((quantity + &rest, notation.range(values, unit, COMPUTED)));
    };
    if si.kind() == TaskKind::Run {
        let history = si.table(Part::History, &View::default())?;
        let last = history.cycles().saturating_sub(1);
        for (name, column) in &history.columns {
            add(name, &[column.at(last, 0)]);
        }
        for section in SECTIONS {
            let values = si.value(section)?;
            for (name, value) in values.as_object().into_iter().flatten() {
                add(&format!("{section}.{name}"), &[value.as_f64().unwrap_or(f64::NAN)]);
            }
        }
    } else if let Some(law) = Verdict::of(si)? {
        let said = [&*law.verdict, &*law.reason, law.intervals.unwrap_or_default()];
        found.push(("Verdict".to_owned(), said.join(" ")));
        for parameter in si.value("parameters")?.as_array().into_iter().flatten() {
            let text = |value: &Value| {
                let unit = parameter["unit"].as_str().unwrap_or("1");
                notation.quantity(value.as_f64().unwrap_or(f64::NAN), unit, COMPUTED)
            };
            let name = whole(parameter["pointer"].as_str().unwrap_or_default(), scenario);
            let [estimate, low, high] =
                ["/estimate", "/interval/0", "/interval/1"].map(|own| parameter.pointer(own));
            let [estimate, low, high] =
                [estimate, low, high].map(|own| own.map_or("–".to_owned(), text));
            found.push((name, format!("{estimate} ({low} to {high})")));
        }
    } else {
        let table = statistics::table(si, Part::Statistics)?;
        for row in 0..table.cycles() {
            let ends = ["minimum", "maximum"].map(|name| table.axis(name)[row]);
            add(table.text("output", row), &ends);
        }
    }
    Ok(found)
}
