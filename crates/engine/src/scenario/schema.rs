//! The JSON Schema of a scenario. Its objects follow from the inputs and their forms, and the numbers in them from the quantities of
//! the parser. A file has the rest.

use std::sync::LazyLock;

use serde_json::{Map, Value, json};

use crate::input::Dimension;
use crate::input::fields::{Described, QUANTITIES};
use crate::input::inputs::forms;
use crate::input::rows::{Form, Input, ObjectForm};

/// The JSON Schema of a scenario, version 2020-12.
pub static SCHEMA: LazyLock<String> = LazyLock::new(|| format!("{:#}\n", schema()));

#[expect(clippy::expect_used, reason = "the file is part of the program, and tests read it")]
fn schema() -> Value {
    let mut schema: Value =
        serde_json::from_str(include_str!("scenario.schema.json")).expect("valid JSON");
    for choice in schema["$defs"].as_object_mut().into_iter().flat_map(Map::values_mut) {
        choose(choice);
    }
    for quantity in QUANTITIES {
        schema["$defs"][quantity.name] = definition(quantity);
    }
    for form in forms() {
        schema["$defs"][form.name] = object(form);
    }
    close(&mut schema);
    schema
}

fn reference(name: &str) -> Value {
    json!({"$ref": format!("#/$defs/{name}")})
}

/// Puts the forms of an object in the place of its pointer.
fn choose(choice: &mut Value) {
    let Some(pointer) = choice["oneOf"].as_str() else { return };
    let forms: Vec<_> = forms().filter(|form| form.pointer == pointer).collect();
    let shape = |form: &&ObjectForm| {
        let (_, shape) = form.members().next()?;
        Some((shape?.to_owned(), reference(form.name)["$ref"].take()))
    };
    let shapes: Map<String, Value> = forms.iter().filter_map(shape).collect();
    choice["oneOf"] = forms.iter().map(|form| reference(form.name)).collect();
    if !shapes.is_empty() {
        choice["discriminator"] = json!({"propertyName": "shape", "mapping": shapes});
    }
}

/// The schema of an object.
fn object(form: &ObjectForm) -> Value {
    let property = |(name, value): (&str, Option<&str>)| {
        let input = form.input(name);
        let fixed = value.map(|value| json!({"enum": [value]}));
        (name.to_owned(), fixed.or(input.map(member)).unwrap_or_default())
    };
    let properties: Map<String, Value> = form.members().map(property).collect();
    let required: Vec<_> = form.members().take(form.required.len()).map(|(name, _)| name).collect();
    let mut schema = json!({"description": form.about.trim(), "properties": properties});
    if !required.is_empty() {
        schema["required"] = json!(required);
    }
    if let Some(example) = form.example() {
        schema["examples"] = json!([example]);
    }
    schema
}

/// The schema of an input in its object.
fn member(input: &Input) -> Value {
    let mut schema = match input.form {
        Form::Of(name) => reference(name),
        Form::Either(names) => {
            json!({"oneOf": names.iter().map(|name| reference(name)).collect::<Vec<_>>()})
        }
        Form::List(name, least, most) => {
            json!({"type": "array", "minItems": least, "maxItems": most, "items": reference(name)})
        }
        Form::Word(words) => json!({"enum": words}),
        Form::Whole(least, most) => json!({"type": "integer", "minimum": least, "maximum": most}),
        Form::Flag => json!({"type": "boolean"}),
        Form::Part => Value::Null,
    };
    if !input.about.is_empty() {
        schema["description"] = input.about.trim().into();
    }
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
