//! The OpenAPI document is complete.

use std::collections::HashSet;

use fretwork::http;
use serde_json::Value;

fn document() -> Value {
    serde_json::from_slice(http::DOCUMENT).unwrap()
}

fn operations(document: &Value) -> impl Iterator<Item = (String, &Value)> {
    document["paths"].as_object().unwrap().iter().flat_map(|(path, item)| {
        item.as_object()
            .unwrap()
            .iter()
            .map(move |(method, operation)| (format!("{method} {path}"), operation))
    })
}

#[test]
fn every_operation_is_described_and_every_error_uses_the_problem_schema() {
    let document = document();
    let mut ids = HashSet::new();
    for (name, operation) in operations(&document) {
        let id = operation["operationId"].as_str().unwrap();
        assert!(ids.insert(id), "{id} names two operations");
        assert!(operation["summary"].is_string(), "{name} has no summary");
        assert!(operation["tags"][0].is_string(), "{name} has no tag");
        for parameter in operation["parameters"].as_array().into_iter().flatten() {
            assert!(parameter["description"].is_string(), "{name}: {parameter}");
        }
        for (status, response) in operation["responses"].as_object().unwrap() {
            let described = response["description"].as_str();
            assert!(described.is_some_and(|text| !text.is_empty()), "{name} {status}");
            if status.starts_with(['4', '5']) {
                let schema = &response["content"]["application/problem+json"]["schema"]["$ref"];
                assert_eq!(schema, "#/components/schemas/Problem", "{name} {status}");
            }
        }
        if operation["requestBody"].is_object() {
            let all = &operation["requestBody"]["content"];
            let content = &all["application/json"];
            if content.is_null() {
                assert!(all["text/csv"]["example"].is_string(), "{name}");
            } else if content["schema"]["$ref"] == "#/components/schemas/JobBody" {
                let ball = &content["examples"]["steel-ball"]["value"];
                assert!(ball["scenario"].is_object(), "{name}");
            } else {
                let both = content.pointer("/examples/coated-cylinder/value");
                assert!(both.unwrap_or(&content["example"]).is_object(), "{name}");
            }
        }
    }
    assert!(ids.len() >= 17, "{ids:?}");
}

/// Generators of clients invent names for the objects in an alternative without a name, which then clash.
#[test]
fn every_alternative_with_objects_has_a_name() {
    let document = document();
    let mut checked = 0;
    for (name, schema) in document["components"]["schemas"].as_object().unwrap() {
        for alternative in schema["oneOf"].as_array().into_iter().flatten() {
            assert!(alternative["properties"].is_null(), "{name}: {alternative}");
            checked += 1;
        }
    }
    assert!(checked > 20, "{checked}");
}

#[test]
fn every_schema_reference_has_a_target() {
    fn check(document: &Value, value: &Value) {
        match value {
            Value::Object(members) => {
                if let Some(Value::String(target)) = members.get("$ref") {
                    let found = target.strip_prefix('#').and_then(|path| document.pointer(path));
                    assert!(found.is_some(), "{target}");
                }
                members.values().for_each(|value| check(document, value));
            }
            Value::Array(items) => items.iter().for_each(|value| check(document, value)),
            _ => {}
        }
    }
    let document = document();
    check(&document, &document);
}
