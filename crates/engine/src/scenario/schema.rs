//! The JSON Schema of a scenario. A file has its objects; the numbers in them follow from the quantities of the parser.

use std::sync::LazyLock;

use serde_json::{Value, json};

use crate::request::fields::{Described, QUANTITIES};
use crate::request::quantity::Dimension;

/// The JSON Schema of a scenario, version 2020-12.
pub static SCHEMA: LazyLock<String> = LazyLock::new(|| format!("{:#}\n", schema()));

#[expect(clippy::expect_used, reason = "the file is part of the program, and tests read it")]
fn schema() -> Value {
    let mut schema: Value =
        serde_json::from_str(include_str!("scenario.schema.json")).expect("valid JSON");
    for quantity in QUANTITIES {
        schema["$defs"][quantity.name] = definition(quantity);
    }
    close(&mut schema);
    schema
}

/// Says of each object that it has no other members.
fn close(schema: &mut Value) {
    match schema {
        Value::Array(items) => items.iter_mut().for_each(close),
        Value::Object(members) => {
            members.values_mut().for_each(close);
            if members.get("properties").is_some_and(Value::is_object) {
                members.insert("type".to_owned(), json!("object"));
                members.insert("additionalProperties".to_owned(), json!(false));
            }
        }
        _ => {}
    }
}

/// A number in SI, or a text with a unit.
fn definition(quantity: &Described) -> Value {
    let Described { about, dimension, range: (least, most), example, .. } = quantity;
    let about = about.trim();
    if *dimension == Dimension::Number {
        let example = example.parse::<f64>().unwrap_or(f64::NAN);
        return json!({
            "description": about, "type": "number", "minimum": least, "maximum": most, "examples": [example],
        });
    }
    let units = dimension.accepted();
    let per_length = dimension.per_length().map(Dimension::accepted);
    let more =
        per_length.as_ref().map(|units| format!(" For a line contact also per length: {units}."));
    let sign = if *least < 0.0 { "[+-]?" } else { "\\+?" };
    let all = units.split(", ").chain(per_length.iter().flat_map(|units| units.split(", ")));
    let spelled = all.map(spellings).collect::<Vec<_>>().join("|");
    let pattern = format!("^{sign}[0-9]+(\\.[0-9]+)?([eE][+-]?[0-9]+)? ?({spelled})?$");
    json!({
        "description": format!(
            "{about} A number, or a text with a unit, such as \"{example}\". Units: {units}.{}",
            more.unwrap_or_default()
        ),
        "type": ["number", "string"],
        "minimum": least,
        "maximum": most,
        "pattern": pattern,
        "examples": [example],
    })
}

/// A pattern of the ways in which people write a unit, such as `µm`, `mm³` or `m2/N`.
fn spellings(unit: &str) -> String {
    let ways = [
        ("um", "[uµμ]m"),
        ("uN", "[uµμ]N"),
        ("uJ", "[uµμ]J"),
        ("ul", "[uµμ]l"),
        ("(", "\\(?"),
        (")", "\\)?"),
        ("^2", "(\\^?2|²)"),
        ("^3", "(\\^?3|³)"),
        ("N m", "N[ ·*]?m"),
        ("deg", "(deg|°)"),
    ];
    ways.into_iter().fold(unit.to_owned(), |unit, (plain, pattern)| unit.replace(plain, pattern))
}
