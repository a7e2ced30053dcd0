//! The members of a result that search, lists and exports need.

use fretwork_engine::{Outcome, Scenario, twelve_digits};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Number, Value, json, to_value};

use super::{Canonical, Outline, TaskKind};
use fretwork_json::Members;

/// A result without its large tables.
#[derive(Debug)]
pub struct ResultDocument {
    /// The key of the result.
    pub key: String,
    /// The name of the engine that computed it.
    pub engine: String,
    /// The `numerics` version of this engine.
    pub numerics: u32,
    /// The canonical scenario or study that was computed.
    pub asked: Canonical,
    /// The columns of the history of a run; empty for a study.
    pub history: Map<String, Value>,
    /// The short form that a job shows: the last entry of each column of the history and the regime, or the number of
    /// points of a study.
    pub summary: Value,
    /// The words and numbers by which users search for the result.
    pub outline: Outline,
}

/// Why a text is not a result.
#[derive(Debug, thiserror::Error)]
pub enum BadDocument {
    /// It is not JSON with the members of a result.
    #[error("the JSON of the result cannot be read")]
    Unreadable(#[from] serde_json::Error),
    /// A member is missing.
    #[error("`{0}` is missing in the JSON of the result")]
    Member(&'static str),
    /// A member is larger than any that the engine writes.
    #[error("a part of the JSON of the result is larger than any that fretwork writes")]
    Large,
    /// A column of its history is empty, contains something other than numbers, or has another length than the others.
    #[error("the columns of `history` in the result are not lists of numbers of equal length")]
    History,
}

#[derive(Deserialize)]
struct Producer {
    name: String,
    numerics: u32,
}

/// Maximum number of JSON values in a member. The member with the largest number is a record of 100 000 reversals. A
/// value takes about 100 bytes of memory.
const MAX_VALUES: usize = 500_000;
/// Largest member, in bytes. It exceeds the 4 MiB of the largest request, because canonical numbers can be longer.
const MAX_MEMBER: usize = 16_000_000;

impl ResultDocument {
    /// Reads a result.
    ///
    /// # Errors
    /// The text is not the JSON of a result.
    pub fn read(text: &[u8]) -> Result<Self, BadDocument> {
        let members: Members<'_> = serde_json::from_slice(text)?;
        let mut kinds = TaskKind::all().filter(|kind| members.get(kind.member()).is_some());
        let (Some(kind), None) = (kinds.next(), kinds.next()) else {
            return Err(BadDocument::Member("scenario"));
        };
        let value = required(&members, kind.member())?;
        let (history, summary, outline) = match kind {
            TaskKind::Run => of_run(&members, &value)?,
            TaskKind::Study(_) => {
                let counts = required(&members, "counts")?;
                let outline = outline_of(kind, &counts);
                (Map::new(), counts, outline)
            }
        };
        let asked = Canonical { kind, value };
        let Producer { name: engine, numerics } = required(&members, "engine")?;
        let key = required(&members, "key")?;
        Ok(Self { key, engine, numerics, asked, history, summary, outline })
    }
}

/// History, summary and outline of a run.
fn of_run(
    document: &Members<'_>,
    scenario: &Value,
) -> Result<(Map<String, Value>, Value, Outline), BadDocument> {
    let history = required(document, "history")?;
    let summary = summary(required(document, "regime")?, &history).ok_or(BadDocument::History)?;
    let mut members = members(
        scenario.clone(),
        required(document, "scales")?,
        required(document, "unworn")?,
        summary,
    );
    let outline = Outline::of(&members);
    Ok((history, members["summary"].take(), outline))
}

/// Parses a member. Refuses a member that is too large, because an imported result can contain anything.
fn required<T: DeserializeOwned>(
    members: &Members<'_>,
    name: &'static str,
) -> Result<T, BadDocument> {
    let text = members.get(name).ok_or(BadDocument::Member(name))?.get();
    let begins = text.bytes().filter(|byte| matches!(byte, b',' | b'[' | b'{'));
    if text.len() > MAX_MEMBER || begins.count() > MAX_VALUES {
        return Err(BadDocument::Large);
    }
    Ok(serde_json::from_str(text)?)
}

/// The outline of a study.
pub(super) fn outline_of(kind: TaskKind, counts: &Value) -> Outline {
    Outline::of(&json!({"kind": kind.word(), "summary": counts}))
}

/// Summary and outline of a new result, with the digits of its JSON.
#[expect(clippy::expect_used, reason = "search must find what is stored")]
pub(super) fn summarize(scenario: &Scenario, outcome: &Outcome) -> (Value, Outline) {
    fn value(part: impl Serialize) -> Value {
        to_value(part).expect("scenarios and outcomes are plain numbers and texts")
    }
    let Outcome { scales, unworn, regime, history, .. } = outcome;
    let history = value(history);
    let columns = history.as_object().expect("a history has columns");
    let summary =
        summary(value(regime), columns).expect("each column has an entry per output cycle");
    let mut members = members(value(scenario), value(scales), value(unworn), summary);
    round(&mut members);
    let outline = Outline::of(&members);
    (members["summary"].take(), outline)
}

/// Rounds all numbers as [`write`](fretwork_json::write) does.
fn round(value: &mut Value) {
    match value {
        Value::Number(number) if number.is_f64() => {
            let rounded = number.as_f64().map(twelve_digits).and_then(Number::from_f64);
            *number = rounded.unwrap_or_else(|| number.clone());
        }
        Value::Array(items) => items.iter_mut().for_each(round),
        Value::Object(members) => members.values_mut().for_each(round),
        _ => {}
    }
}

/// The document from which [`Outline::of`] reads.
fn members(scenario: Value, scales: Value, unworn: Value, summary: Value) -> Value {
    let names = ["kind", "scenario", "scales", "unworn", "summary"].map(str::to_owned);
    let kind = TaskKind::Run.word().into();
    names.into_iter().zip([kind, scenario, scales, unworn, summary]).collect()
}

/// The summary of a result; `None` if its history is not valid.
fn summary(regime: Value, history: &Map<String, Value>) -> Option<Value> {
    let length = history.get("cycles")?.as_array()?.len();
    let mut summary = Map::from_iter([("regime".to_owned(), regime)]);
    for (name, column) in history {
        let column = column.as_array().filter(|column| column.len() == length)?;
        // A column that a line contact does not have is null in all rows.
        let is_whole = column.iter().all(Value::is_number) || column.iter().all(Value::is_null);
        let last = column.last().filter(|_| is_whole)?;
        summary.insert(name.clone(), last.clone());
    }
    Some(Value::Object(summary))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_history_must_have_columns_of_numbers_of_equal_length() {
        let read = |history: Value| {
            let document = json!({
                "key": "", "engine": {"name": "fretwork", "numerics": 2}, "scenario": {}, "scales": {},
                "unworn": {}, "regime": "gross_slip", "history": history,
            });
            ResultDocument::read(document.to_string().as_bytes()).map(|document| document.summary)
        };
        let sound = read(json!({"cycles": [0.0, 5.0], "wear_volume": [0.0, 1e-13]}));
        let expected = json!({"regime": "gross_slip", "cycles": 5.0, "wear_volume": 1e-13});
        assert_eq!(sound.unwrap(), expected);
        for bad in [
            json!({}),
            json!({"cycles": []}),
            json!({"cycles": [0.0], "wear_volume": [0.0, 1.0]}),
            json!({"cycles": [0.0, 1.0], "wear_volume": [null, 1.0]}),
            json!({"cycles": [0.0], "wear_volume": 1.0}),
        ] {
            assert!(matches!(read(bad.clone()), Err(BadDocument::History)), "{bad}");
        }
    }
}
