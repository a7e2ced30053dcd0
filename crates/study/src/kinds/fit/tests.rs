//! Fits of synthetic and published measurements.

use std::iter;
use std::sync::Arc;

use fretwork_engine::request::fault::Faults;
use fretwork_random::Stream;
use serde_json::{Value, json};

use super::KIND;
use crate::problem::outputs_of;
use crate::stats::distribution::Distribution;
use crate::{Claimed, Model, Points, Rows, Study};

/// A steel ball on a flat.
fn ball() -> Value {
    json!({
        "profile": {"shape": "paraboloid", "radius": "10 mm"},
        "bodies": [{"youngs_modulus": "205 GPa", "poisson_ratio": 0.3}, {"youngs_modulus": "205 GPa", "poisson_ratio": 0.3}],
        "friction": 0.7, "wear": {"coefficient": 3e-14}, "load": {"normal_force": "100 N"},
        "motion": {"amplitude": "5 um"}, "cycles": [10_000],
    })
}

/// Computes a study in this number of chunks.
fn rows(study: &Arc<Study>, chunks: usize) -> Rows {
    let mut all = Rows::default();
    for number in 0..chunks {
        let mut points = Points::chunk(Arc::clone(study), number, chunks, all.clone());
        all.append(&iter::repeat_with(|| points.step()).find_map(|rows| rows).unwrap());
    }
    all
}

fn fitted(fit: Value) -> Result<Value, Faults> {
    let study = Arc::new(Study::read(&KIND, fit)?);
    let text = study.document(&"key", &"engine", &rows(&study, 1));
    assert!(text.len() <= study.bytes(), "{} {}", text.len(), study.bytes());
    Claimed::read(&study, &"key", &"engine", &text).unwrap();
    Ok(serde_json::from_str(&text).unwrap())
}

/// An output of a scenario.
fn output(scenario: &Value, name: &str) -> f64 {
    let mut scenario = scenario.clone();
    let cycle: f64 = name.split_once('@').unwrap().1.parse().unwrap();
    scenario["cycles"] = json!([cycle]);
    outputs_of(json!([name]), &scenario).unwrap();
    let model =
        Model::new(scenario, &["/friction".to_owned()], vec![name.parse().unwrap()]).unwrap();
    let mut run = model.run(&model.origin()).unwrap();
    loop {
        if let Some(ended) = run.step() {
            return *model.values(&ended).values[0].as_ref().unwrap();
        }
    }
}

/// A number of the standard normal distribution.
fn normal(stream: Stream, index: u64) -> f64 {
    Distribution::normal(0.0, 1.0).unwrap().quantile((stream.at(index) >> 11) as f64 / (1_u64 << 53) as f64 + 1e-17)
}

/// Tests at these amplitudes with measured volumes, whose noise is 5 %.
fn tests(truth: &Value, amplitudes: &[f64], stream: Stream) -> Vec<Value> {
    let test = |(place, amplitude): (usize, &f64)| {
        let mut scenario = truth.clone();
        scenario["motion"]["amplitude"] = json!(amplitude);
        let volume =
            output(&scenario, "wear_volume@10000") * (1.0 + 0.05 * normal(stream, place as u64));
        json!({"name": format!("A{place}"), "changes": {"/motion/amplitude": amplitude},
            "data": [{"output": "wear_volume", "x": [1e4], "y": [volume], "relative": 0.05}]})
    };
    amplitudes.iter().enumerate().map(test).collect()
}

#[test]
fn wear_and_friction_are_found_from_five_volumes() {
    let amplitudes = [2e-6, 2.5e-6, 3e-6, 5e-6, 10e-6];
    let fit = json!({"scenario": ball(),
        "parameters": [
            {"pointer": "/wear/coefficient", "from": 1e-16, "to": 1e-12, "spacing": "log", "start": 1e-14},
            {"pointer": "/friction", "from": 0.1, "to": 1.5, "start": 0.4}],
        "tests": tests(&ball(), &amplitudes, Stream::new(1))});
    let found = fitted(fit).unwrap();
    let mut short = found.clone();
    short.as_object_mut().unwrap().remove("fit");
    println!("{short:#}");
}
