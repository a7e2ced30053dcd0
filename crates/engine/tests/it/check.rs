//! The check of results that others computed finds each column that is wrong by a factor of 7.

use fretwork_engine::outcome::Outcome;
use fretwork_engine::scenario::{self, Scenario};
use fretwork_engine::simulation::{Simulation, check};
use serde_json::{Value, json};

fn scenario(load: &Value, motion: &Value, model: &Value) -> Scenario {
    let request = json!({
        "profile": {"shape": "paraboloid", "radius": "10 mm"},
        "moduli": {"normal": "112.64 GPa", "tangential": "92.76 GPa"},
        "friction": 0.7,
        "wear": {"coefficient": "3.03e-5 mm^3/(N m)", "share": 0.4},
        "load": load, "motion": motion, "cycles": [1000, 3000, 10000, 30000], "model": model,
    });
    scenario::check(&request, "").unwrap_or_else(|faults| panic!("{request}: {faults:?}")).0
}

/// Scenarios of each kind of load and motion, by both methods.
fn scenarios() -> Vec<Scenario> {
    let mut all = Vec::new();
    for load in [
        json!({"normal_force": 100, "held": "depth"}),
        json!({"normal_force": 100, "held": "force"}),
    ] {
        for motion in [
            json!({"amplitude": "2 um"}),
            json!({"tangential_force": 20}),
            json!({"amplitude": "3 um", "rig_stiffness": "50 N/um"}),
            json!({"blocks": [{"amplitude": "2 um", "cycles": 5000}, {"amplitude": "1 um", "cycles": 25000}]}),
            json!({"reversals": ["2 um", "-2 um", "1 um"]}),
        ] {
            for model in [
                json!({"method": "simplified"}),
                json!({"method": "exact", "compare": true, "tolerance": 0.01}),
            ] {
                all.push(scenario(&load, &motion, &model));
            }
        }
    }
    all
}

/// Multiplies all numbers of a value.
fn scale(value: &mut Value, factor: f64) {
    match value {
        Value::Number(number) if number.is_f64() => {
            *value = json!(factor * number.as_f64().expect("a number"));
        }
        Value::Array(items) => items.iter_mut().for_each(|item| scale(item, factor)),
        Value::Object(members) => members.values_mut().for_each(|item| scale(item, factor)),
        _ => {}
    }
}

fn judged(scenario: &Scenario, outcome: &Value) -> Result<(), String> {
    let outcome: Outcome = serde_json::from_value(outcome.clone()).expect("an outcome");
    let case = scenario.case().expect("a case");
    check(scenario, &case, &outcome).map_err(|flaw| flaw.to_string())
}

#[test]
fn a_result_that_was_read_from_its_json_passes() {
    for scenario in scenarios() {
        let outcome = Simulation::of(&scenario).expect("a contact").run();
        let json = serde_json::to_value(&outcome).expect("a document");
        assert_eq!(serde_json::from_value::<Outcome>(json.clone()).expect("an outcome"), outcome);
        let echo = serde_json::to_string(&scenario).expect("a document");
        assert_eq!(judged(&scenario, &json), Ok(()), "{echo}");
    }
}

/// Columns in which only a new run finds an error of this size.
const FREE: [&str; 5] = [
    "/history/contact_radius",
    "/history/stick_radius",
    "/profiles/image",
    "/profiles/pressure",
    "/profiles/slip",
];

#[test]
fn a_column_that_is_wrong_by_a_factor_of_seven_is_found() {
    let mut missed = Vec::new();
    for scenario in scenarios() {
        let outcome = Simulation::of(&scenario).expect("a contact").run();
        let whole = serde_json::to_value(&outcome).expect("a document");
        let mut pointers = vec![vec![
            // Volume and energy together keep the balance.
            "/history/wear_volume".to_owned(),
            "/history/dissipated_energy".to_owned(),
        ]];
        for table in ["history", "profiles", "scales", "unworn", "limit"] {
            pointers.push(vec![format!("/{table}")]);
            let columns = whole[table].as_object().into_iter().flatten();
            pointers.extend(columns.map(|(name, _)| vec![format!("/{table}/{name}")]));
        }
        for pointers in pointers {
            let mut changed = whole.clone();
            for pointer in &pointers {
                scale(changed.pointer_mut(pointer).expect("a member"), 7.0);
            }
            let is_free = FREE.contains(&pointers[0].as_str());
            if changed != whole && !is_free && judged(&scenario, &changed).is_ok() {
                missed.push((pointers, serde_json::to_string(&scenario).expect("a document")));
            }
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
}
