//! The JSON Schema of a scenario agrees with the parser.

use fretwork_engine::input::fault::Faults;
use fretwork_engine::input::fields::{Length, MAX_CYCLES, POINTS_RANGE, Position, QUANTITIES};
use fretwork_engine::input::inputs::forms;
use fretwork_engine::input::quantity::{Dimension, parse};
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
    for (list, most) in [("Instants", MAX_CYCLES), ("Energies", MAX_CYCLES)] {
        assert_eq!(number(&format!("/$defs/{list}/maxItems")), most as f64, "{list}");
    }
    let words =
        |member: &str| at(&format!("/$defs/Model/properties/{member}/description")).to_string();
    assert!(words("tolerance").contains(&format!("By default {DEFAULT_TOLERANCE}.")));
    assert!(words("points").contains(&format!("By default {DEFAULT_POINTS}.")));
}

/// Every definition that a part of the schema names.
fn references<'a>(part: &'a Value, found: &mut Vec<&'a str>) {
    match part {
        Value::Object(members) => {
            found.extend(part["$ref"].as_str());
            members.values().for_each(|member| references(member, found));
        }
        Value::Array(items) => items.iter().for_each(|item| references(item, found)),
        _ => {}
    }
}

#[test]
fn each_member_of_a_form_is_an_input_and_each_reference_is_defined() {
    for form in forms() {
        for (name, value) in form.members() {
            let is_known = value.is_some() || form.input(name).is_some();
            assert!(is_known, "{}: `{name}` has no row in `rows!`", form.name);
        }
    }
    let schema = schema();
    let mut found = Vec::new();
    references(&schema, &mut found);
    assert!(found.len() > 100, "{}", found.len());
    for reference in found {
        let pointer = reference.strip_prefix('#').unwrap();
        assert!(schema.pointer(pointer).is_some_and(Value::is_object), "{reference}");
    }
}

#[test]
fn the_parser_refuses_a_list_that_is_longer_than_the_schema_says() {
    let schema = schema();
    let layer = json!({"thickness": 1e-6, "coefficient": 1e-13});
    for (list, pointer, item) in [
        ("Blocks/properties/blocks", "/motion/blocks", json!({"amplitude": 1e-6, "cycles": 1})),
        ("Reversals/properties/reversals", "/motion/reversals", json!(1e-6)),
        ("Table/properties/radius", "/profile/radius", json!(1e-3)),
        ("WornBody/properties/layers", "/wear/bodies/0/layers", layer),
    ] {
        let most = schema.pointer(&format!("/$defs/{list}/maxItems")).and_then(Value::as_u64);
        let most = most.expect(list) as usize;
        let is_too_long = |count: usize| {
            let items = vec![item.clone(); count];
            let mut scenario = schema["examples"][0].clone();
            match pointer {
                "/wear/bodies/0/layers" => {
                    let body = json!({"coefficient": 1e-13, "layers": items});
                    scenario["wear"] = json!({"bodies": [body, {"coefficient": 0}]});
                }
                "/profile/radius" => {
                    scenario["profile"] =
                        json!({"shape": "table", "radius": items, "height": items});
                }
                _ => scenario["motion"] = json!({pointer.trim_start_matches("/motion/"): items}),
            }
            let Err(Faults(faults)) = scenario::check(&scenario, "") else { return false };
            faults.iter().any(|it| it.pointer == pointer && it.detail.contains(&count.to_string()))
        };
        assert!(!is_too_long(most) && is_too_long(most + 1), "{list}");
    }
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
    let profile = forms().find(|form| form.name == "Cylinder").expect("a form").example();
    for form in forms().filter(|form| ["/profile", "/motion"].contains(&form.pointer)) {
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
