//! The JSON Schema of a scenario agrees with the parser.

use fretwork_engine::request::changing::MAX_CHANGES;
use fretwork_engine::request::fields::{Length, MAX_CYCLES, POINTS_RANGE, Position, QUANTITIES};
use fretwork_engine::request::forms::FORMS;
use fretwork_engine::request::held::{MAX_BLOCKS, MAX_REVERSALS};
use fretwork_engine::request::indenter::MAX_ROWS;
use fretwork_engine::request::quantity::{Dimension, parse};
use fretwork_engine::request::wear::MAX_LAYERS;
use fretwork_engine::scenario::{self, DEFAULT_POINTS, DEFAULT_TOLERANCE, SCHEMA};
use serde_json::{Value, json};

fn schema() -> Value {
    serde_json::from_str(&SCHEMA).expect("the schema is JSON")
}

#[test]
fn the_schema_has_the_ranges_and_defaults_of_the_parser() {
    let schema = schema();
    let at = |pointer: &str| schema.pointer(pointer).unwrap_or_else(|| panic!("{pointer}"));
    let number = |pointer: &str| at(pointer).as_f64().unwrap_or_else(|| panic!("{pointer}"));
    for (pointer, range) in [
        ("/$defs/Length", Length::RANGE),
        ("/$defs/Radius", (0.0, Position::RANGE.1)),
        ("/$defs/Range/properties/count", (2.0, MAX_CYCLES as f64)),
        ("/$defs/EnergyRange/properties/count", (2.0, MAX_CYCLES as f64)),
        ("/$defs/Model/properties/points", (f64::from(POINTS_RANGE.0), f64::from(POINTS_RANGE.1))),
    ] {
        let found = (number(&format!("{pointer}/minimum")), number(&format!("{pointer}/maximum")));
        assert_eq!(found, range, "{pointer}");
    }
    for (list, most) in [
        ("Instants", MAX_CYCLES),
        ("Energies", MAX_CYCLES),
        ("Blocks/properties/blocks", MAX_BLOCKS),
        ("Reversals/properties/reversals", MAX_REVERSALS),
        ("Table/properties/radius", MAX_ROWS),
        ("Table/properties/height", MAX_ROWS),
        ("ChangeTable/properties/at", MAX_CHANGES),
        ("ChangeTable/properties/values", MAX_CHANGES),
        ("WornBody/properties/layers", MAX_LAYERS),
    ] {
        assert_eq!(number(&format!("/$defs/{list}/maxItems")), most as f64, "{list}");
    }
    let words =
        |member: &str| at(&format!("/$defs/Model/properties/{member}/description")).to_string();
    assert!(words("tolerance").contains(&format!("By default {DEFAULT_TOLERANCE}.")));
    assert!(words("points").contains(&format!("By default {DEFAULT_POINTS}.")));
}

#[test]
fn each_quantity_has_its_units_and_an_example_that_the_parser_reads() {
    let schema = schema();
    for quantity in QUANTITIES {
        let definition = &schema["$defs"][quantity.name];
        let example = definition["examples"][0].clone();
        let text = example.as_str().map_or_else(|| example.to_string(), str::to_owned);
        let total = quantity.dimension.per_length().map(|per_length| parse(&text, per_length));
        let read = parse(&text, quantity.dimension).or_else(|fault| total.unwrap_or(Err(fault)));
        let (least, most) = quantity.range;
        assert!(read.is_ok_and(|read| (least..=most).contains(&read)), "{definition}");
        let description = definition["description"].to_string();
        let units = quantity.dimension.accepted();
        let is_said = description.contains(&format!("Units: {units}."));
        assert_eq!(is_said, quantity.dimension != Dimension::Number, "{description}");
    }
}

#[test]
fn all_examples_are_accepted() {
    let schema = schema();
    let examples = schema["examples"].as_array().expect("examples");
    for example in examples {
        scenario::check(example, "").unwrap_or_else(|faults| panic!("{faults:?}"));
    }
    let profile = FORMS.iter().find(|form| form.name == "Cylinder").expect("a form").example();
    for form in FORMS.iter().filter(|form| ["/profile", "/motion"].contains(&form.pointer)) {
        let mut scenario = examples[0].clone();
        if form.geometry == "line" {
            scenario["profile"] = json!(profile);
            scenario["motion"] = json!({"tangential_force": "5 N/mm"});
        }
        scenario[&form.pointer[1..]] = form.example().expect("an example");
        scenario::check(&scenario, "").unwrap_or_else(|faults| panic!("{}: {faults:?}", form.name));
    }
    let directory = concat!(env!("CARGO_MANIFEST_DIR"), "/examples");
    let mut seen = 0;
    for entry in std::fs::read_dir(directory).expect(directory) {
        let path = entry.expect("an entry").path();
        if path.extension().is_some_and(|extension| extension == "json") {
            let text = std::fs::read_to_string(&path).expect("a file");
            let body: Value = serde_json::from_str(&text).expect("JSON");
            scenario::check(&body["scenario"], "")
                .unwrap_or_else(|faults| panic!("{}: {faults:?}", path.display()));
            seen += 1;
        }
    }
    assert!(seen >= 3);
}
