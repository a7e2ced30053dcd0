//! The members of a result that search, lists and exports need.

use fretwork_engine::numeric::twelve_digits;
use fretwork_engine::outcome::Outcome;
use fretwork_engine::scenario::Scenario;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Number, Value, to_value};

use super::Outline;

/// A result without its profiles and loops.
#[derive(Debug)]
pub struct Document {
    /// The key of the result.
    pub key: String,
    /// The name of the engine that computed it.
    pub engine: String,
    /// The `numerics` version of this engine.
    pub numerics: u32,
    /// The columns of its history.
    pub history: Map<String, Value>,
    /// The members `scenario`, `scales`, `unworn` and `summary`.
    members: Value,
}

/// Why a text is not a result.
#[derive(Debug, thiserror::Error)]
pub enum BadDocument {
    /// It is not JSON with the members of a result.
    #[error("its body cannot be read as a result")]
    Unreadable(#[from] serde_json::Error),
    /// A column of its history is empty, contains something other than numbers, or has another length than the others.
    #[error("its history is not a set of columns of equal length")]
    History,
}

/// The members that are read from a result.
#[derive(Deserialize)]
struct Members {
    key: String,
    engine: Producer,
    scenario: Value,
    scales: Value,
    unworn: Value,
    regime: Value,
    history: Map<String, Value>,
}

#[derive(Deserialize)]
struct Producer {
    name: String,
    numerics: u32,
}

impl Document {
    /// Reads a result.
    ///
    /// # Errors
    /// The text is not the JSON of a result.
    pub fn read(text: &[u8]) -> Result<Self, BadDocument> {
        let Members { key, engine, scenario, scales, unworn, regime, history } =
            serde_json::from_slice(text)?;
        let summary = summary(regime, &history).ok_or(BadDocument::History)?;
        let members = members(scenario, scales, unworn, summary);
        let Producer { name: engine, numerics } = engine;
        Ok(Self { key, engine, numerics, history, members })
    }

    /// The canonical scenario.
    #[must_use]
    pub fn scenario(&self) -> &Value {
        &self.members["scenario"]
    }

    /// The short form that a job shows: the regime, and the last entry of each column of the history.
    #[must_use]
    pub fn summary(&self) -> &Value {
        &self.members["summary"]
    }

    /// The words and numbers by which users search for the result.
    #[must_use]
    pub fn outline(&self) -> Outline {
        Outline::of(&self.members)
    }
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

/// Rounds all numbers as [`write`](super::json::write) does.
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

/// The document of [`Outline::of`].
fn members(scenario: Value, scales: Value, unworn: Value, summary: Value) -> Value {
    let names = ["scenario", "scales", "unworn", "summary"].map(str::to_owned);
    names.into_iter().zip([scenario, scales, unworn, summary]).collect()
}

/// The summary of a result; `None` if its history is not valid.
fn summary(regime: Value, history: &Map<String, Value>) -> Option<Value> {
    let length = history.get("cycles")?.as_array()?.len();
    let mut summary = Map::from_iter([("regime".to_owned(), regime)]);
    for (name, column) in history {
        let column = column.as_array().filter(|column| column.len() == length)?;
        let last = column.last().filter(|_| column.iter().all(Value::is_number))?;
        summary.insert(name.clone(), last.clone());
    }
    Some(Value::Object(summary))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_history_must_have_columns_of_numbers_of_equal_length() {
        let read = |history: Value| {
            let document = json!({
                "key": "", "engine": {"name": "fretwork", "numerics": 2}, "scenario": {}, "scales": {},
                "unworn": {}, "regime": "gross_slip", "history": history,
            });
            Document::read(document.to_string().as_bytes())
                .map(|document| document.summary().clone())
        };
        let sound = read(json!({"cycles": [0.0, 5.0], "wear_volume": [0.0, 1e-13]}));
        let expected = json!({"regime": "gross_slip", "cycles": 5.0, "wear_volume": 1e-13});
        assert_eq!(sound.unwrap(), expected);
        for bad in [
            json!({}),
            json!({"cycles": []}),
            json!({"cycles": [0.0], "wear_volume": [0.0, 1.0]}),
            json!({"cycles": [0.0], "wear_volume": [null]}),
            json!({"cycles": [0.0], "wear_volume": 1.0}),
        ] {
            assert!(matches!(read(bad.clone()), Err(BadDocument::History)), "{bad}");
        }
    }
}
