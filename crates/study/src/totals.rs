//! Texts per length, such as `"18.5 N/mm"`, in the scenario of a line contact and in the values that a study gives to
//! its numbers.
//!
//! A study puts numbers in SI into its scenario, and there they are totals: N, or N/m for a stiffness. So each text per
//! length becomes its total before a study or a model is read.

use fretwork_engine::input::quantity;
use fretwork_engine::{Dimension, Faults, Valid, twelve_digits};
use serde_json::Value;

const LENGTH: &str = "/profile/length";

/// Replaces the texts per length of a study. `axes` are the members that give the values of the numbers of the kind.
///
/// # Errors
/// The study varies the length, too.
pub fn of_study(study: &mut Value, axes: &[(&str, &str)]) -> Valid<()> {
    let Some((length, mut changed)) = study.get_mut("scenario").and_then(of_scenario) else {
        return Ok(());
    };
    for (name, pointer) in axes {
        if let Some(values) = study.get_mut(*name) {
            replace(values, pointer, length, &mut changed);
        }
    }
    let mut varies = None;
    for list in ["vary", "parameters"] {
        let entries = study.get_mut(list).and_then(Value::as_array_mut);
        for (place, entry) in entries.into_iter().flatten().enumerate() {
            let Some(pointer) = entry["pointer"].as_str().map(str::to_owned) else { continue };
            if pointer == LENGTH {
                varies = Some(format!("/{list}/{place}/pointer"));
            }
            for values in ["values", "from", "to", "distribution", "start", "prior"] {
                if let Some(values) = entry.get_mut(values) {
                    replace(values, &pointer, length, &mut changed);
                }
            }
        }
    }
    let tests = study.get_mut("tests").and_then(Value::as_array_mut).into_iter().flatten();
    let changes = tests.filter_map(|test| test.get_mut("changes")?.as_object_mut()).flatten();
    for (pointer, value) in changes {
        replace(value, pointer, length, &mut changed);
    }
    may_vary(varies, changed)
}

/// Replaces the texts per length in the scenario of a model that varies these numbers.
///
/// # Errors
/// The model varies the length, too.
pub fn of_model(scenario: &mut Value, parameters: &[String]) -> Valid<()> {
    let changed = of_scenario(scenario).and_then(|(_, changed)| changed);
    let varies = parameters.iter().position(|pointer| pointer == LENGTH);
    may_vary(varies.map(|place| format!("/parameters/{place}")), changed)
}

/// Checks that the length does not vary, at this place, beside a number that is given per length.
fn may_vary(place: Option<String>, changed: Option<String>) -> Valid<()> {
    let (Some(place), Some(changed)) = (place, changed) else { return Ok(()) };
    let detail = format!(
        "cannot vary, because `{changed}` is given per length, and its total would stay the same. Enter the total of \
         `{changed}`, such as \"185 N\" for \"18.5 N/mm\" and a length of 10 mm"
    );
    Err(Faults::one(&place, detail))
}

/// Replaces the texts per length in a scenario. Returns the length of the contact, and the pointer of a number that has
/// changed. `None` if the contact has no length.
fn of_scenario(scenario: &mut Value) -> Option<(f64, Option<String>)> {
    let length = match scenario.pointer(LENGTH)? {
        Value::String(text) => quantity::parse(text, Dimension::Length).ok()?,
        number => number.as_f64()?,
    };
    let length = twelve_digits(length);
    let blocks = scenario.pointer("/motion/blocks").and_then(Value::as_array).map_or(0, Vec::len);
    let load = ["/load/normal_force".to_owned()];
    let members = ["tangential_force", "rig_stiffness", "loop_stiffness"];
    let members = members.map(|name| format!("/motion/{name}"));
    let blocks = (0..blocks).map(|place| format!("/motion/blocks/{place}/tangential_force"));
    let mut changed = None;
    for pointer in load.into_iter().chain(members).chain(blocks) {
        if let Some(value) = scenario.pointer_mut(&pointer) {
            replace(value, &pointer, length, &mut changed);
        }
    }
    Some((length, changed))
}

/// The dimensions of a number, as a total and per length, if it has both.
fn dimensions(pointer: &str) -> Option<(Dimension, Dimension)> {
    let total = match pointer.rsplit('/').next()? {
        "normal_force" | "tangential_force" => Dimension::Force,
        "rig_stiffness" | "loop_stiffness" => Dimension::Stiffness,
        _ => return None,
    };
    Some((total, total.per_length()?))
}

/// Replaces the texts per length among the values of the number at `pointer`, or in the part of the scenario there.
fn replace(values: &mut Value, pointer: &str, length: f64, changed: &mut Option<String>) {
    match values {
        Value::Array(items) => {
            for item in items {
                replace(item, pointer, length, changed);
            }
        }
        Value::Object(members) => {
            for (name, member) in members {
                // The members of a distribution have the dimension of its number.
                let own = if dimensions(pointer).is_some() { pointer } else { name.as_str() };
                replace(member, own, length, changed);
            }
        }
        Value::String(text) => {
            let Some((total, per_length)) = dimensions(pointer) else { return };
            let total = quantity::parse(text, total).err();
            if let Some(x) = total.and_then(|_| quantity::parse(text, per_length).ok()) {
                *values = twelve_digits(x * length).into();
                changed.get_or_insert_with(|| pointer.to_owned());
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::{Kind, Model, Study};

    /// A cylinder under 18.5 N/mm = 185 N.
    fn cylinder(load: &Value, motion: &Value) -> Value {
        json!({
            "profile": {"shape": "cylinder", "radius": "6 mm", "length": "10 mm"},
            "moduli": {"normal": "110 GPa"}, "friction": 0.9, "wear": {"coefficient": 4.8e-14},
            "load": {"normal_force": load}, "motion": motion, "cycles": [100],
        })
    }

    fn study(kind: &str, members: &Value, scenario: Value) -> Valid<Study> {
        let mut study = members.clone();
        study["scenario"] = scenario;
        Study::read(Kind::named(kind).unwrap(), study)
    }

    #[test]
    fn a_study_with_texts_per_length_equals_that_with_totals() {
        let given = json!({"amplitude": "25 um", "reference_distance": "35 mm", "rig_stiffness": "2 kN/mm/mm"});
        let total =
            json!({"amplitude": 25e-6, "reference_distance": 0.035, "rig_stiffness": "20 N/um"});
        let forces = |block: Value| json!({"blocks": [{"tangential_force": block, "cycles": 500}]});
        for (kind, per_length, totals, motions) in [
            (
                "sweep",
                json!({"vary": [{"pointer": "/load/normal_force", "values": ["10 N/mm", 200, "300 N"]}]}),
                json!({"vary": [{"pointer": "/load/normal_force", "values": [100, 200, 300]}]}),
                [&given, &total],
            ),
            (
                "sweep",
                json!({"vary": [{"pointer": "/motion/rig_stiffness", "from": "1 kN/mm/mm", "to": "30 N/um",
                    "count": 3}]}),
                json!({"vary": [{"pointer": "/motion/rig_stiffness", "from": 1e7, "to": 3e7, "count": 3}]}),
                [&given, &total],
            ),
            (
                "sensitivity",
                json!({"vary": [{"pointer": "/load/normal_force",
                    "distribution": {"uniform": {"low": "10 N/mm", "high": "20 N/mm"}}}], "samples": 4}),
                json!({"vary": [{"pointer": "/load/normal_force",
                    "distribution": {"uniform": {"low": 100, "high": 200}}}], "samples": 4}),
                [&forces(json!("4 N/mm")), &forces(json!(40))],
            ),
        ] {
            let with = |members: &Value, load: Value, motion: &Value| {
                let mut members = members.clone();
                members["outputs"] = json!(["wear_volume"]);
                study(kind, &members, cylinder(&load, motion)).unwrap()
            };
            let (one, other) = (
                with(&per_length, json!("18.5 N/mm"), motions[0]),
                with(&totals, json!(185), motions[1]),
            );
            assert_eq!(one.canonical, other.canonical);
            let base = &one.problem.base;
            assert_eq!(base["load"]["normal_force"], 185);
        }
        let axes = |force: Value| json!({"normal_force": {"values": force}, "amplitude": {"values": ["5 um", "25 um"]}});
        let one = study(
            "map",
            &axes(json!(["10 N/mm", "185 N"])),
            cylinder(&json!("18.5 N/mm"), &{
                let mut motion = given.clone();
                motion.as_object_mut().unwrap().remove("rig_stiffness");
                motion
            }),
        );
        assert_eq!(one.unwrap().point(0), [100.0, 5e-6]);
    }

    #[test]
    fn a_model_has_totals_and_does_not_vary_the_length_beside_a_text_per_length() {
        let motion = json!({"tangential_force": "4 N/mm"});
        let read = |load: Value, motion: &Value, parameters: &[&str]| {
            Model::read(json!({"scenario": cylinder(&load, motion), "parameters": parameters}))
        };
        let parameters = ["/load/normal_force", "/motion/tangential_force"];
        let model = read(json!("18.5 N/mm"), &motion, &parameters).unwrap();
        assert_eq!(model.origin(), [185.0, 40.0]);
        let force = Dimension::Force;
        assert!(model.members().iter().all(|member| member.dimension == force));
        let fault = read(json!("185 N"), &motion, &["/friction", LENGTH]).unwrap_err().0.remove(0);
        assert_eq!(fault.pointer, "/parameters/1");
        assert!(fault.detail.contains("Enter the total of `/motion/tangential_force`"));
        assert!(read(json!("185 N"), &json!({"stick_ratio": 0.5}), &[LENGTH]).is_ok());
        let vary = json!({"vary": [{"pointer": LENGTH, "values": [0.01, 0.02]}], "outputs": ["wear_volume"]});
        let fault = study("sweep", &vary, cylinder(&json!("18.5 N/mm"), &motion));
        assert_eq!(fault.unwrap_err().0[0].pointer, "/vary/0/pointer");
    }
}
