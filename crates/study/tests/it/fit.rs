//! Fits of synthetic and published measurements.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::{iter, thread};

use fretwork_engine::input::fault::Faults;
use fretwork_random::{Random, Stream};
use serde_json::{Value, json};

use fretwork_study::{Claimed, Kind, Likelihood, Model, Points, Rows, Study};

use crate::normal;

/// A steel ball on a flat.
fn ball() -> Value {
    json!({
        "profile": {"shape": "paraboloid", "radius": "10 mm"},
        "bodies": [{"youngs_modulus": "205 GPa", "poisson_ratio": 0.3}, {"youngs_modulus": "205 GPa", "poisson_ratio": 0.3}],
        "friction": 0.7, "wear": {"coefficient": 3e-14}, "load": {"normal_force": "100 N"},
        "motion": {"amplitude": "5 um"}, "cycles": [10_000],
    })
}

fn kind() -> &'static Kind {
    Kind::named("fit").unwrap()
}

/// Computes a study in this number of chunks.
fn rows(study: &Arc<Study>, chunks: usize) -> Rows {
    let mut all = Rows::default();
    for number in 0..chunks {
        let mut points = Points::chunk(Arc::clone(study), number, chunks, all.clone());
        all.append(iter::repeat_with(|| points.step()).find_map(|rows| rows).unwrap());
    }
    all
}

fn fitted(fit: Value) -> Result<Value, Faults> {
    let study = Arc::new(Study::read(kind(), fit)?);
    let text = study.document(&"key", &"engine", rows(&study, 1));
    assert!(text.len() <= study.bytes(), "{} {}", text.len(), study.bytes());
    Claimed::read(&study, &"key", &"engine", &text).unwrap();
    Ok(serde_json::from_str(&text).unwrap())
}

/// An output of a scenario.
fn output(scenario: &Value, name: &str) -> f64 {
    let mut scenario = scenario.clone();
    if let Some((_, cycle)) = name.split_once('@') {
        scenario["cycles"] = json!([cycle.parse::<f64>().unwrap()]);
    }
    let model =
        Model::new(scenario, &["/friction".to_owned()], vec![name.parse().unwrap()]).unwrap();
    let mut run = model.run(&model.origin()).unwrap();
    loop {
        if let Some(ended) = run.step() {
            return *model.values(&ended).values[0].as_ref().unwrap();
        }
    }
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

/// A fit of wear and friction.
fn of_wear_and_friction(tests: &[Value]) -> Value {
    json!({"scenario": ball(), "tests": tests, "parameters": [
        {"pointer": "/wear/coefficient", "from": 1e-16, "to": 1e-12, "spacing": "log", "start": 1e-14},
        {"pointer": "/friction", "from": 0.1, "to": 1.5, "start": 0.4}]})
}

#[test]
fn wear_and_friction_are_found_from_five_volumes() {
    let amplitudes = [2e-6, 2.5e-6, 3e-6, 5e-6, 10e-6];
    let fit = of_wear_and_friction(&tests(&ball(), &amplitudes, Stream::new(1)));
    let found = fitted(fit.clone()).unwrap();
    for (parameter, truth) in found["parameters"].as_array().unwrap().iter().zip([3e-14, 0.7]) {
        let number = |value: &Value| value.as_f64().unwrap();
        let [low, high] = [0, 1].map(|end| number(&parameter["interval"][end]));
        assert!(low < truth && truth < high, "{parameter}");
        // The interval has about ± 2 standard errors.
        let width = (high - low) / number(&parameter["standard_error"]);
        assert!((3.6..4.4).contains(&width), "{width}");
    }
    assert!(found["quality"]["runs"].as_f64().unwrap() <= 2500.0, "{}", found["quality"]["runs"]);
    assert_eq!(found["notes"], json!([]));
    // Chunks of one point give the same bytes.
    let study = Arc::new(Study::read(kind(), fit).unwrap());
    assert_eq!(study.chunks(), study.points());
    let rows = |chunks| rows(&study, chunks).to_bytes();
    assert_eq!(rows(study.points()), rows(1));
}

/// The texts of the notes of this kind.
fn notes<'a>(found: &'a Value, kind: &str) -> Vec<&'a str> {
    let notes = found["notes"].as_array().unwrap().iter();
    notes.filter(|note| note["kind"] == kind).map(|note| note["detail"].as_str().unwrap()).collect()
}

#[test]
fn the_energy_coefficient_of_van_peteghem_is_a_line_through_the_origin() {
    // C. van Peteghem et al., Wear 271 (2011) 1535, from a digest of the paper: five tests at 5 Hz, two at 0.11 Hz.
    let energies = [17_200.0, 7_010.0, 10_400.0, 1_130.0, 24_500.0, 3_390.0, 6_670.0];
    let volumes = [
        "1.81 mm^3",
        "0.888 mm^3",
        "1.14 mm^3",
        "0.117 mm^3",
        "2.18 mm^3",
        "1.98 mm^3",
        "3.61 mm^3",
    ];
    let fit = |count: usize, noise: Value| {
        let mut data = json!({"output": "wear_volume", "over": "dissipated_energy",
            "x": energies[..count], "y": volumes[..count], "sigma": "0.1 mm^3"});
        data.as_object_mut().unwrap().extend(noise.as_object().unwrap().clone());
        fitted(json!({
            "scenario": {
                "profile": {"shape": "cylinder", "radius": "80 mm", "length": "8 mm"},
                "bodies": [{"youngs_modulus": "119 GPa", "poisson_ratio": 0.29}, {"youngs_modulus": "119 GPa", "poisson_ratio": 0.29}],
                "friction": 0.6, "wear": {"energy_coefficient": "1e-4 mm^3/J"}, "load": {"normal_force": "8523 N"},
                "motion": {"amplitude": "75 um", "reference_distance": "100 mm"}, "cycles": [1000]
            },
            "parameters": [{"pointer": "/wear/energy_coefficient", "from": 1e-15, "to": 1e-11, "spacing": "log"}],
            "tests": [{"name": "5 Hz", "data": [data]}], "starts": 2,
        })).unwrap()
    };
    let found = fit(5, json!({"noise": "estimate"}));
    let line = &found["lines"][0];
    let close = |value: &Value, known: f64, error: f64| {
        let value = value.as_f64().unwrap();
        assert!((value / known - 1.0).abs() < error, "{value} {known}");
    };
    close(&line["energy_coefficient"], 97_429e-18, 1e-4);
    close(&line["r_squared"], 0.9543, 1e-3);
    // The runs give the same slope and the same interval.
    close(&found["parameters"][0]["estimate"], 97_429e-18, 2e-3);
    close(&found["parameters"][0]["standard_error"], 5_311e-18, 2e-2);
    close(&found["parameters"][0]["interval"][0], (97_429.0 - 14_747.0) * 1e-18, 1e-2);
    close(&found["parameters"][0]["interval"][1], (97_429.0 + 14_747.0) * 1e-18, 1e-2);
    assert_eq!(found["quality"]["degrees_of_freedom"], 4);
    assert_eq!(
        (notes(&found, "misfit").len(), found["table"]["test"][0].as_str()),
        (0, Some("5 Hz"))
    );
    let both = fit(7, json!({"relative": 0.1}));
    assert!(
        notes(&both, "misfit")[0]
            .starts_with("One set of parameters does not describe these tests"),
        "{both}"
    );
}

#[test]
fn what_the_data_cannot_tell_is_said_in_words() {
    let mut hardness = ball();
    hardness["wear"] = json!({"coefficient": 1e-4, "hardness": "3 GPa"});
    let mut fit = of_wear_and_friction(&tests(&hardness, &[3e-6, 5e-6, 10e-6], Stream::new(2)));
    fit["scenario"] = hardness;
    fit["starts"] = json!(2);
    fit["parameters"] = json!([
        {"pointer": "/wear/coefficient", "from": 1e-6, "to": 1e-2, "spacing": "log"},
        {"pointer": "/wear/hardness", "from": "0.1 GPa", "to": "20 GPa", "spacing": "log"}]);
    let found = fitted(fit.clone()).unwrap();
    assert_eq!(
        notes(&found, "undetermined"),
        ["These data determine only `wear.coefficient/wear.hardness`."]
    );
    assert_eq!(
        (&found["parameters"][0]["estimate"], &found["parameters"][1]["interval"][0]),
        (&Value::Null, &Value::Null)
    );
    // A prior gives the rest.
    fit["parameters"][1]["prior"] = json!({"lognormal": {"median": "3 GPa", "factor": 1.1}});
    let found = fitted(fit.clone()).unwrap();
    assert_eq!(notes(&found, "prior").len(), 1, "{}", found["notes"]);
    let [low, high] = [0, 1].map(|end| found["parameters"][1]["interval"][end].as_f64().unwrap());
    let expected = 3e9 * libm::pow(1.1, 1.96);
    assert!((high / expected - 1.0).abs() < 0.02 && low < 3e9, "{low} {high}");
    // Two tests with own parameters have two such directions.
    let own = ["A0", "A1"].map(|test| {
        json!([{"pointer": "/wear/coefficient", "from": 1e-6, "to": 1e-2, "spacing": "log", "for": [test]},
            {"pointer": "/wear/hardness", "from": "0.1 GPa", "to": "20 GPa", "spacing": "log", "for": [test]}])
    });
    fit["tests"] = json!(tests(&fit["scenario"], &[3e-6, 5e-6, 7e-6, 10e-6], Stream::new(2)));
    fit["parameters"] = own.iter().flat_map(|own| own.as_array().unwrap()).cloned().collect();
    let found = fitted(fit).unwrap();
    assert_eq!(
        notes(&found, "undetermined"),
        ["A0", "A1"].map(|test| format!(
            "Changes of `wear.coefficient ({test})` and `wear.hardness ({test})` that keep `wear.coefficient \
             ({test})/wear.hardness ({test})` have almost no effect."
        ))
    );

    // With the depth held, wear ends. Long after that, the coefficient has no effect.
    let mut held = ball();
    held["load"]["held"] = json!("depth");
    held["motion"]["amplitude"] = json!(2e-6);
    let data = |output: &str| {
        let y = [1e9, 2e9].map(|x| output_at(&held, output, x));
        json!({"output": output, "x": [1e9, 2e9], "y": y, "relative": 0.03})
    };
    let found = fitted(json!({"scenario": held, "starts": 2,
        "tests": [{"data": [data("wear_volume"), data("wear_depth")]}], "parameters": [
            {"pointer": "/wear/coefficient", "from": 1e-15, "to": 1e-13, "spacing": "log"},
            {"pointer": "/friction", "from": 0.4, "to": 1.2}]}))
    .unwrap();
    let told = notes(&found, "undetermined");
    assert!(
        told[0]
            .starts_with("`wear.coefficient` has almost no effect on these data: wear has stopped"),
        "{told:?}"
    );
    assert!(
        found["parameters"][0]["estimate"].is_null()
            && found["parameters"][1]["estimate"].is_number()
    );
}

fn output_at(scenario: &Value, name: &str, x: f64) -> f64 {
    output(scenario, &format!("{name}@{x}"))
}

#[test]
fn energies_near_the_last_one_that_the_contact_reaches_are_predicted() {
    let mut scenario = ball();
    scenario["load"]["held"] = json!("force");
    scenario["motion"] = json!({"amplitude": "2.256 um"});
    let cycles = [1e3, 1e4, 1e5];
    let [x, y] = ["dissipated_energy", "wear_volume"]
        .map(|name| cycles.map(|at| output_at(&scenario, name, at)));
    let data = json!({"output": "wear_volume", "over": "dissipated_energy", "x": x, "y": y, "relative": 0.03});
    let found = fitted(json!({"scenario": scenario, "starts": 2,
        "parameters": [{"pointer": "/wear/coefficient", "from": 2e-14, "to": 5e-14}],
        "tests": [{"data": [data]}]}));
    let estimate = found.unwrap()["parameters"][0]["estimate"].as_f64().unwrap();
    assert!((estimate / 3e-14 - 1.0).abs() < 1e-3, "{estimate}");
}

#[test]
fn volumes_and_profiles_that_need_different_coefficients_are_told_first() {
    let found = |factor: f64| {
        let mut deeper = ball();
        deeper["wear"]["coefficient"] = json!(3e-14 * factor);
        let volume = output_at(&ball(), "wear_volume", 1e4);
        let depth = output_at(&deeper, "wear_depth", 1e4);
        fitted(json!({"scenario": ball(), "starts": 2,
            "parameters": [{"pointer": "/wear/coefficient", "from": 1e-15, "to": 1e-12, "spacing": "log"}],
            "tests": [
                {"name": "1", "specimen": "7", "data": [{"output": "mass_loss", "density": 7800, "x": [1e4], "y": [7800.0 * volume], "relative": 0.05}]},
                {"name": "2", "specimen": "8", "data": [{"profile": "wear", "at": 1e4, "radius": ["0 um", "20 um", "1 mm"], "depth": [depth, null, 0], "sigma": depth * 0.05}]},
                {"name": "3", "specimen": "9", "data": [{"output": "wear_depth", "x": [1e4], "y": [depth], "relative": 0.05}]}]})).unwrap()
    };
    let same = found(1.0);
    assert_eq!(notes(&same, "discrepancy").len(), 0, "{}", same["notes"]);
    let [estimate, high] =
        [&same["parameters"][0]["estimate"], &same["parameters"][0]["interval"][1]];
    assert!(
        (estimate.as_f64().unwrap() / 3e-14 - 1.0).abs() < 0.02 && high.is_number(),
        "{}",
        same["parameters"]
    );
    // Two points of one profile count as one.
    assert_eq!(
        (&same["quality"]["effective_points"], notes(&same, "clusters").len()),
        (&json!(3.0), 1)
    );
    let other = found(2.0);
    // Residuals of many standard deviations come first.
    assert_eq!(
        (&other["notes"][0]["kind"], &other["notes"][1]["kind"]),
        (&json!("misfit"), &json!("discrepancy"))
    );
}

#[test]
fn repeated_tests_show_whether_the_model_fits() {
    let found = |friction: f64| {
        let mut truth = ball();
        truth["friction"] = json!(friction);
        let mut both = tests(&truth, &[2.5e-6, 3e-6, 5e-6, 10e-6], Stream::new(4));
        for test in &mut both.clone() {
            test["name"] = json!(format!("{} again", test["name"]));
            let volume = test["data"][0]["y"][0].as_f64().unwrap();
            test["data"][0]["y"][0] = json!(volume * 1.03);
            both.push(test.clone());
        }
        let mut fit = of_wear_and_friction(&both);
        fit["parameters"].as_array_mut().unwrap().pop();
        fit["starts"] = json!(1);
        fitted(fit).unwrap()
    };
    let (same, other) = (found(0.7), found(0.9));
    let probability =
        |found: &Value| found["quality"]["lack_of_fit"]["probability"].as_f64().unwrap();
    assert!(probability(&other) < 0.01 && probability(&other) < 0.1 * probability(&same));
    assert_eq!(
        (notes(&other, "lack_of_fit").len(), notes(&other, "misfit").len()),
        (1, 1),
        "{}",
        other["notes"]
    );
    // Points with different weights: the numbers are from an independent calculation.
    let mut scenario = ball();
    scenario["moduli"] = json!({"normal": 113e9, "tangential": 93e9});
    scenario.as_object_mut().unwrap().remove("bodies");
    scenario["motion"]["amplitude"] = json!(3e-6);
    let found = fitted(json!({"scenario": scenario,
        "parameters": [{"pointer": "/wear/coefficient", "from": 1e-16, "to": 1e-12, "spacing": "log"}],
        "tests": [{"data": [{"output": "wear_volume", "x": [1e4, 1e4, 2e4, 2e4], "y": [4e-14, 1.2e-13, 1.6e-13, 1.8e-13],
            "sigma": [2e-15, 6e-15, 8e-15, 9e-15]}]}]}))
    .unwrap();
    let lack = &found["quality"]["lack_of_fit"];
    for (name, known) in [("statistic", 0.997), ("probability", 0.423)] {
        let own = lack[name].as_f64().unwrap();
        assert!((own / known - 1.0).abs() < 5e-3, "{lack}");
    }
}

#[test]
fn the_profile_of_one_body_is_its_part_of_the_wear() {
    let mut shared = ball();
    shared["wear"]["share"] = json!(0.25);
    let depth = output_at(&ball(), "wear_depth", 1e4);
    let trace = |body: u8, share: f64| json!({"profile": "wear", "at": 1e4, "body": body, "radius": [0, 1e-3], "depth": [depth * share, 0], "sigma": depth * 0.01});
    let fit = |body: u8| {
        json!({"scenario": shared, "starts": 1,
            "parameters": [{"pointer": "/wear/coefficient", "from": 1e-15, "to": 1e-12, "spacing": "log"}],
            "tests": [{"data": [trace(body, 0.25)]}]})
    };
    let coefficient = |found: Value| found["parameters"][0]["estimate"].as_f64().unwrap();
    let [one, other] = [1, 2].map(|body| coefficient(fitted(fit(body)).unwrap()));
    // In gross slip, the depth at the centre is nearly proportional to the volume to the power of 1/2.
    assert!((one / 3e-14 - 1.0).abs() < 0.02, "{one}");
    assert!(other < 0.5 * one, "{other}");
    let mut unshared = fit(1);
    unshared["scenario"] = ball();
    assert_eq!(fitted(unshared).unwrap()["notes"][0]["kind"], "no_minimum");
}

#[test]
fn the_fault_of_wrong_data_says_what_to_enter() {
    let told = |change: &dyn Fn(&mut Value)| {
        let point =
            json!({"output": "wear_volume", "x": [1e4, 2e4], "y": [1e-13, 2e-13], "relative": 0.1});
        let mut fit = of_wear_and_friction(&[json!({"name": "A", "data": [point]})]);
        change(&mut fit);
        let fault = Study::read(kind(), fit).unwrap_err().0.swap_remove(0);
        format!("{}: {}", fault.pointer, fault.detail)
    };
    let in_data =
        |change: &dyn Fn(&mut Value)| told(&|fit| change(&mut fit["tests"][0]["data"][0]));
    let starts = |told: String, expected: &str| assert!(told.starts_with(expected), "{told}");
    starts(in_data(&|data| data["y"][0] = json!("NaN mm^3")), "/tests/0/data/0/y/0: ");
    starts(
        in_data(&|data| data["y"] = json!([1e-13])),
        "/tests/0/data/0/y: has 1 numbers for 2 places",
    );
    starts(
        in_data(&|data| data["y"][1] = json!(null)),
        "/tests: have 1 measured number(s), too few for 2 parameter(s)",
    );
    starts(
        in_data(&|data| data["noise"] = json!("estimate")),
        "/tests: have 2 measured number(s), too few for 2 parameter(s) and the noise",
    );
    starts(in_data(&|data| data["x"][1] = json!(1e16)), "/tests/0/data/0/x/1: must be greater");
    starts(in_data(&|data| data["x"][1] = json!(null)), "/tests/0/data/0/x/1: must be a number");
    starts(in_data(&|data| data["x"][1] = json!(0)), "/tests/0/data/0/x/1: must be greater than 0");
    starts(in_data(&|data| data["output"] = json!("wear_volum")), "/tests/0/data/0/output: ");
    starts(in_data(&|data| data["y"][0] = json!("1 mm")), "/tests/0/data/0/y/0: ");
    starts(in_data(&|data| data["radius"] = json!([1])), "/tests/0/data/0/radius: ");
    starts(in_data(&|data| data["density"] = json!(-1)), "/tests/0/data/0/density: belongs to");
    starts(
        in_data(&|data| data["output"] = json!("mass_loss")),
        "/tests/0/data/0/density: belongs to",
    );
    starts(
        in_data(&|data| _ = data.as_object_mut().unwrap().remove("relative")),
        "/tests/0/data/0/sigma: is missing",
    );
    let equal = |data: &mut Value| {
        (data["x"], data["y"]) = (json!([1e4, 1e4, 1e4]), json!([1e-13, 1e-13, 1e-13]));
    };
    starts(in_data(&equal), "/tests/0/data/0/y: has the same point 3 times");
    let many = |data: &mut Value| {
        (data["x"], data["y"]) =
            (json!((1..=100_000).collect::<Vec<_>>()), json!(vec![1e-13; 100_000]));
    };
    starts(in_data(&many), "/tests: have 100000 numbers, but a fit can have fewer than 2000");
    starts(
        told(&|fit| fit["parameters"][1]["pointer"] = json!("/frction")),
        "/parameters/1/pointer: ",
    );
    starts(told(&|fit| fit["parameters"][1]["for"] = json!(["B"])), "/parameters/1/for/0: ");
    starts(
        told(&|fit| fit["parameters"][1]["start"] = json!(2)),
        "/parameters/1/start: must be from `from` to `to`",
    );
    starts(told(&|fit| fit["parameters"][0]["from"] = json!(0)), "/parameters/0/");
    starts(
        told(&|fit| fit["parameters"][0]["prior"] = json!({"uniform": {"low": 1, "high": 2}})),
        "/parameters/0/prior: must be `normal`",
    );
    starts(
        told(&|fit| fit["tests"][0]["changes"] = json!({"/motion": {"amplitude": "1 N"}})),
        "/scenario/motion/amplitude: ",
    );
    starts(
        told(&|fit| fit["tests"][0]["changes"] = json!({"amplitude": 1})),
        "/tests/0/changes: has `amplitude`",
    );
    starts(told(&|fit| fit["tests"] = json!([])), "/tests: must list 1 to 200");
    starts(told(&|fit| fit["scenario"]["friction"] = json!(-1)), "/");
}

#[test]
fn what_would_have_no_effect_is_refused() {
    let told = |change: &dyn Fn(&mut Value)| {
        let mut fit = of_wear_and_friction(&[json!({"name": "A", "data": [
            {"output": "wear_volume", "x": [1e4, 2e4], "y": [1e-13, 2e-13], "relative": 0.1}]})]);
        change(&mut fit["tests"][0]);
        let fault = Study::read(kind(), fit).unwrap_err().0.swap_remove(0);
        format!("{}: {}", fault.pointer, fault.detail)
    };
    let cycles = told(&|test| test["changes"] = json!({"/cycles": [1]}));
    assert!(cycles.starts_with("/tests/0/changes: has `/cycles`"), "{cycles}");
    let fitted = told(&|test| test["changes"] = json!({"/friction": 0.6}));
    assert!(fitted.starts_with("/parameters/1/pointer: is changed by the test \"A\""), "{fitted}");
    let sigma = told(&|test| test["data"][0]["sigma"] = json!([1e-15]));
    assert!(sigma.starts_with("/tests/0/data/0/sigma: has 1 numbers for 2 places"), "{sigma}");
}

/// The end of an interval.
fn end(found: &Value, parameter: usize, end: usize) -> f64 {
    found["parameters"][parameter]["interval"][end].as_f64().unwrap()
}

#[test]
fn intervals_beside_kinks_and_far_from_parabolas_are_found() {
    let rule = json!({"profile": {"shape": "paraboloid", "radius": 0.01}, "moduli": {"normal": 113e9, "tangential": 93e9},
        "friction": 0.7, "wear": {"coefficient": 3e-14}, "load": {"normal_force": 100, "held": "depth"},
        "motion": {"amplitude": 2.256e-6}, "cycles": [10_000], "model": {"method": "simplified", "xi": 0.8}});
    let test = |amplitude: f64, x: f64, y: f64| json!({"changes": {"/motion/amplitude": amplitude}, "data": [{"output": "wear_volume", "x": [x], "y": [y], "sigma": 3e-15}]});
    // The minimum is beside the onset of gross slip of the second test. The ends are from an independent search on a grid.
    let found = fitted(json!({"scenario": rule, "parameters": [
            {"pointer": "/wear/coefficient", "from": 1e-15, "to": 1e-13},
            {"pointer": "/friction", "from": 0.3, "to": 1.2}],
        "tests": [test(2e-6, 5e3, 8.845_963_080_94e-15), test(2.5e-6, 1e4, 5.295_199_775_586e-14),
            test(3e-6, 1e4, 1.151_748_771_795e-13), test(2.2e-6, 2e4, 5.899_226_675_019e-14)]}))
    .unwrap();
    assert_eq!(found["notes"], json!([]));
    for (parameter, ends) in [[2.12e-14, 6.18e-14], [0.564, 0.782]].into_iter().enumerate() {
        for (place, known) in ends.into_iter().enumerate() {
            let own = end(&found, parameter, place);
            assert!((own / known - 1.0).abs() < 5e-3, "{own} {known}");
        }
    }
    // S rises slowly, then fast.
    let mut scenario = rule.clone();
    scenario["load"] = json!({"normal_force": 100});
    scenario["motion"] = json!({"amplitude": 3e-6});
    scenario["model"] = json!({});
    let found = fitted(json!({"scenario": scenario, "parameters": [
            {"pointer": "/wear/coefficient", "from": 1e-16, "to": 1e-12, "spacing": "log"},
            {"pointer": "/moduli/normal", "from": 5e10, "to": 3e11}],
        "tests": [{"data": [{"output": "wear_volume", "x": [5e3, 1e4, 2e4], "y": [4e-14, 8e-14, 1.7e-13], "relative": 0.05}]}]}))
    .unwrap();
    assert!(end(&found, 0, 0) > 1.3e-14 && end(&found, 0, 1) < 1e-13, "{}", found["parameters"]);
    assert!(
        notes(&found, "open_interval")[0].starts_with("The interval of `moduli.normal` reaches")
    );
}

#[test]
fn another_minimum_is_told() {
    let mut scenario = ball();
    scenario["motion"]["amplitude"] = json!(2.256e-6);
    let found = fitted(json!({"scenario": scenario, "parameters": [
            {"pointer": "/wear/coefficient", "from": 1e-16, "to": 1e-12, "spacing": "log"},
            {"pointer": "/friction", "from": 0.1, "to": 1.5}],
        "tests": [{"data": [{"output": "wear_volume", "x": [1e3, 2e3, 5e3, 1e4, 2e4, 5e4], "sigma": 3e-15,
            "y": [4.6299e-15, 9.612e-15, 2.38802e-14, 5.56799e-14, 1.041_812e-13, 2.67823e-13]}]}]}))
    .unwrap();
    let told = notes(&found, "other_minimum")[0];
    assert!(told.starts_with("Two minima describe the data about as well: `wear."), "{told}");
}

/// The numerical errors of the runs move the best coefficient away from the starts, which all found the same minimum.
#[test]
fn one_minimum_is_not_called_two() {
    let mut scenario = ball();
    scenario["load"]["held"] = json!("depth");
    scenario["model"] = json!({"method": "simplified", "points": 16});
    let test = |(amplitude, y): (f64, [f64; 3])| {
        json!({"specimen": amplitude.to_string(), "changes": {"/motion/amplitude": amplitude}, "data": [
            {"output": "wear_volume", "x": [100, 1000, 1e4], "y": y, "relative": 0.1}]})
    };
    let tests = [
        (1.5e-6, [2.59e-16, 1.88e-15, 2.51e-14]),
        (3e-6, [1.76e-16, 1.91e-15, 1.68e-14]),
        (5e-6, [2.49e-16, 2.35e-15, 1.66e-14]),
    ];
    let found = fitted(json!({"scenario": scenario, "tests": tests.map(test), "parameters": [
        {"pointer": "/wear/coefficient", "from": 1e-16, "to": 1e-12, "spacing": "log"}]}))
    .unwrap();
    assert_eq!(notes(&found, "other_minimum").len(), 0, "{}", found["notes"]);
    assert!(end(&found, 0, 0) < end(&found, 0, 1), "{}", found["parameters"]);
}

/// The weights before the noise is estimated call the second minimum too far from the first one.
#[test]
fn an_interval_contains_both_of_two_minima() {
    let scenario = json!({"profile": {"shape": "paraboloid", "radius": 0.01},
        "moduli": {"normal": 112.64e9, "tangential": 92.76e9}, "friction": 0.7, "wear": {"coefficient": 3e-14},
        "load": {"indentation_depth": 3.54e-6, "held": "depth"}, "motion": {"amplitude": 2.256e-6}, "cycles": [10_000]});
    // Volumes with k_w = 3e-14 1/Pa, a friction of 0.7 and noise of 10 %.
    let tests = [
        (1.6e-6, 15846.0, 1.3469e-14),
        (2.256e-6, 728.0, 1.7380e-15),
        (1.6e-6, 22320.0, 1.9136e-14),
        (2.256e-6, 3120.0, 8.0963e-15),
        (2.256e-6, 1684.0, 3.6181e-15),
        (2.256e-6, 4194.0, 8.2348e-15),
        (1.6e-6, 3916.0, 3.1384e-15),
        (1.6e-6, 1914.0, 1.5773e-15),
        (1.6e-6, 742.0, 5.6161e-16),
        (1.6e-6, 3257.0, 2.5039e-15),
        (1.6e-6, 768.0, 6.8909e-16),
        (1.6e-6, 4630.0, 3.4027e-15),
    ];
    let tests = tests.map(|(amplitude, x, y)| {
        json!({"changes": {"/motion/amplitude": amplitude}, "data": [
            {"output": "wear_volume", "x": [x], "y": [y], "noise": {"kind": "normal"}}]})
    });
    let found = fitted(json!({"scenario": scenario, "tests": tests, "parameters": [
            {"pointer": "/wear/coefficient", "from": 1e-16, "to": 1e-11, "spacing": "log"},
            {"pointer": "/friction", "from": 0.2, "to": 1.5}]}))
    .unwrap();
    let told = notes(&found, "other_minimum")[0];
    assert!(told.contains("`friction` = 3.61") && told.contains("`friction` = 7.1"), "{told}");
    for (place, [one, other]) in [[5.6e-15, 3e-14], [0.361, 0.714]].into_iter().enumerate() {
        assert!(end(&found, place, 0) < one && end(&found, place, 1) > other, "{told}");
    }
}

/// The pointers of all values in a document.
fn pointers(value: &Value, at: &str, found: &mut Vec<String>) {
    found.push(at.to_owned());
    let members = value.as_object().into_iter().flatten();
    let members = members.map(|(name, value)| (name.replace('~', "~0").replace('/', "~1"), value));
    let items = value.as_array().into_iter().flatten().enumerate();
    for (name, value) in items.map(|(place, value)| (place.to_string(), value)).chain(members) {
        pointers(value, &format!("{at}/{name}"), found);
    }
}

#[test]
fn no_other_value_of_a_member_is_a_panic() {
    let scalars = json!({"output": "wear_volume", "over": "cycles", "x": [1e4, 2e4], "y": [1e-13, null], "sigma": [1e-14, 1e-14], "relative": 0.001});
    let mass = json!({"output": "mass_loss", "density": 7800, "x": [1e4], "y": [1e-9], "noise": "estimate"});
    let trace = json!({"profile": "wear", "at": 1e4, "radius": [0, 1e-5], "depth": [1e-6, 0], "sigma": "1 um"});
    let mut fit = of_wear_and_friction(&[
        json!({"name": "A", "specimen": "7", "changes": {"/motion": {"amplitude": "3 um"}}, "data": [scalars, mass, trace]}),
    ]);
    fit["parameters"][1]["for"] = json!(["A"]);
    fit["parameters"][1]["prior"] = json!({"normal": {"mean": 0.7, "standard_deviation": 0.1}});
    fit["confidence"] = json!(0.9);
    fit["scenario"]["model"] = json!({"method": "exact"});
    Study::read(kind(), fit.clone()).unwrap();
    let mut all = Vec::new();
    pointers(&fit, "", &mut all);
    let (mut accepted, mut refused) = (0, 0);
    for pointer in &all {
        for value in
            [json!(null), json!("x"), json!(-3), json!(1e300), json!([]), json!({}), json!(["A"])]
        {
            let mut changed = fit.clone();
            *changed.pointer_mut(pointer).unwrap() = value;
            match Study::read(kind(), changed) {
                Ok(study) => accepted += usize::from(study.points() > 0),
                Err(faults) => refused += usize::from(!faults.0.is_empty()),
            }
        }
    }
    assert_eq!(accepted + refused, 7 * all.len());
    assert!(refused > 5 * all.len() && accepted > 10, "{refused} {accepted}");
}

#[test]
fn names_stay_and_quantities_become_numbers() {
    let read = |change: &dyn Fn(&mut Value)| {
        let cylinder = json!({
            "profile": {"shape": "cylinder", "radius": "6 mm", "length": "10 mm"}, "moduli": {"normal": "110 GPa"},
            "friction": 0.9, "wear": {"coefficient": 4.8e-14}, "load": {"normal_force": "185 N"},
            "motion": {"amplitude": "25 um", "reference_distance": "36 mm"}, "cycles": [100]});
        let data = json!({"output": "wear_volume", "x": [1e4], "y": ["0.1 mm^3"], "relative": 0.1});
        let mut fit = json!({"scenario": cylinder,
            "parameters": [{"pointer": "/wear/coefficient", "from": 1e-15, "to": "1e-11 1/Pa", "spacing": "log", "for": ["5 um"]}],
            "tests": [
                {"name": "5 um", "specimen": "7 N", "data": [data], "changes": {"/load": {"normal_force": "37 N/mm"}}},
                {"name": "7", "data": [data]}]});
        change(&mut fit);
        Study::read(kind(), fit).unwrap().canonical.clone()
    };
    let canonical = read(&|_| {});
    let test = &canonical["tests"][0];
    assert_eq!((&test["name"], &test["specimen"]), (&json!("5 um"), &json!("7 N")));
    assert_eq!(test["changes"], json!({"/load": {"normal_force": 370}}));
    assert_eq!(test["data"][0]["y"], json!([1e-10]));
    assert_eq!(canonical["parameters"][0]["to"], json!(1e-11));
    // The same fit in other words, and the canonical form itself.
    assert_eq!(
        read(&|fit| fit["tests"][0]["changes"]["/load"] = json!({"normal_force": "0.37 kN"})),
        canonical
    );
    assert_eq!(read(&|fit| *fit = canonical.clone()), canonical);
}

#[test]
fn noise_is_estimated_and_specimens_count_once() {
    let amplitudes = [2e-6, 2.5e-6, 3e-6, 5e-6, 10e-6];
    let mut fit = of_wear_and_friction(&tests(&ball(), &amplitudes, Stream::new(3)));
    fit["starts"] = json!(1);
    let stated = fitted(fit.clone()).unwrap();
    for test in fit["tests"].as_array_mut().unwrap() {
        test["data"][0]["noise"] = json!("estimate");
    }
    let estimated = fitted(fit.clone()).unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    // Nearly the same estimates. They differ in the share of the numerical error in the noise.
    let factor = number(&estimated["quality"]["noise"][0]["factor"]);
    let sum = number(&stated["quality"]["sum_of_squares"]);
    assert!((factor / (sum / 3.0).sqrt() - 1.0).abs() < 0.01, "{factor} {sum}");
    assert_eq!(estimated["quality"]["degrees_of_freedom"], 3);
    for place in 0..2 {
        let [one, other] = [&stated, &estimated].map(|found| &found["parameters"][place]);
        let ratio = number(&other["standard_error"]) / number(&one["standard_error"]);
        assert!((ratio / factor - 1.0).abs() < 0.05, "{ratio} {factor}");
        let width = |parameter: &Value| {
            let ends = [0, 1].map(|end| number(&parameter["interval"][end]));
            libm::log(ends[1] / ends[0])
        };
        // Student's t for 3 degrees of freedom, instead of 1.96.
        let ratio = width(other) / width(one);
        assert!((ratio / (factor * 3.182 / 1.960) - 1.0).abs() < 0.1, "{ratio}");
    }
    // The same specimens, measured twice: nothing else is known.
    let mut twice = fit["tests"].as_array().unwrap().clone();
    for test in fit["tests"].as_array_mut().unwrap() {
        test["specimen"] = test["name"].clone();
        let mut other = test.clone();
        other["name"] = json!(format!("{} again", test["name"]));
        twice.push(other);
    }
    for test in &mut twice[..5] {
        test["specimen"] = test["name"].clone();
    }
    fit["tests"] = json!(twice);
    let again = fitted(fit).unwrap();
    assert_eq!(
        (&again["quality"]["effective_points"], &again["quality"]["degrees_of_freedom"]),
        (&json!(5.0), &json!(3))
    );
    for place in 0..2 {
        let [one, other] =
            [&estimated, &again].map(|found| number(&found["parameters"][place]["standard_error"]));
        assert!((one / other - 1.0).abs() < 0.02, "{one} {other}");
    }
}

/// Volumes of a truth at these amplitudes with a noise of 5 %, which is stated, or estimated for odd seeds.
fn campaign(seed: u64, truth: &Value, conditions: &[(f64, f64)]) -> Vec<Value> {
    let test = |(place, (amplitude, cycles)): (usize, &(f64, f64))| {
        let mut scenario = truth.clone();
        scenario["motion"]["amplitude"] = json!(amplitude);
        let noise = 0.05 * normal(Stream::new(seed).child(7), place as u64);
        let volume = output(&scenario, &format!("wear_volume@{cycles}")) * (1.0 + noise);
        let mut data =
            json!({"output": "wear_volume", "x": [cycles], "y": [volume], "relative": 0.05});
        if seed % 2 == 1 {
            data["noise"] = json!("estimate");
        }
        json!({"changes": {"/motion/amplitude": amplitude}, "data": [data]})
    };
    conditions.iter().enumerate().map(test).collect()
}

/// A random ball with its wear coefficient and friction, computed with a small tolerance, and random conditions for 3 to
/// 8 tests: amplitudes and numbers of cycles.
fn random_truth(seed: u64) -> (Value, Vec<(f64, f64)>, Random) {
    let mut random = Random::new(seed);
    let mut truth = ball();
    truth["wear"]["coefficient"] = json!(random.log_between(3e-15, 3e-13));
    truth["friction"] = json!(random.between(0.3, 1.0));
    truth["profile"]["radius"] = json!(random.between(5e-3, 20e-3));
    truth["load"]["normal_force"] = json!(random.log_between(20.0, 200.0));
    truth["model"] = json!({"tolerance": 1e-4});
    let threshold = output(&truth, "unworn.gross_slip_amplitude");
    let mut condition =
        |_| (threshold * random.log_between(0.5, 4.0), random.log_between(1e3, 1e5).round());
    let conditions = (0..3 + seed % 6).map(&mut condition).collect();
    (truth, conditions, random)
}

/// The fit of a campaign: whether the intervals of the wear coefficient and of the friction contain the truth, and the
/// document. `hides` is a member of `motion` that the fit does not know.
fn fit_of(truth: &Value, tests: &[Value], hides: &str) -> ([bool; 2], Value) {
    let truths = [&truth["wear"]["coefficient"], &truth["friction"]].map(|x| x.as_f64().unwrap());
    let mut fit = of_wear_and_friction(tests);
    fit["scenario"] = truth.clone();
    fit["scenario"].as_object_mut().unwrap().remove("model");
    fit["scenario"]["motion"].as_object_mut().unwrap().remove(hides);
    let found = fitted(fit).unwrap();
    let covers = [0, 1].map(|place| {
        let end = |end: usize| found["parameters"][place]["interval"][end].as_f64();
        end(0).is_none_or(|low| low <= truths[place])
            && end(1).is_none_or(|high| truths[place] <= high)
    });
    (covers, found)
}

/// Computes something for the seeds from 0 on, on all cores: for `most` of them in tests/long, and otherwise for `few`.
fn of_seeds<T: Send>(most: u64, few: u64, of: impl Fn(u64) -> T + Sync) -> (u64, Vec<T>) {
    let is_long = std::env::var_os("FRETWORK_TEST_LONG").is_some();
    let (count, next) = (if is_long { most } else { few }, AtomicU64::new(0));
    let work = || {
        let seeds = iter::repeat_with(|| next.fetch_add(1, Ordering::Relaxed));
        seeds.take_while(|seed| *seed < count).map(&of).collect::<Vec<_>>()
    };
    let cores = thread::available_parallelism().unwrap().get();
    let found = thread::scope(|scope| {
        let workers: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect()
    });
    (count, found)
}

/// Checks in tests/long that VERIFICATION.md has this line, and prints it.
fn is_in_the_table(count: u64, most: u64, line: &str) {
    println!("{line}");
    let table = include_str!("../../../verify/src/fits.md");
    assert!(count < most || table.contains(line), "crates/verify/src/fits.md lacks {line}");
}

#[test]
fn intervals_of_95_percent_contain_the_truth_in_90_to_99_percent_of_campaigns() {
    let (count, found) = of_seeds(200, 5, |seed| {
        let (truth, conditions, _) = random_truth(seed);
        let tests = campaign(seed, &truth, &conditions);
        let (covers, found) = fit_of(&truth, &tests, "");
        let runs = found["quality"]["runs"].as_f64().unwrap();
        assert!(conditions.len() != 5 || runs <= 2500.0, "{seed}: {runs}");
        covers
    });
    let covered = [0, 1].map(|place| found.iter().filter(|it| it[place]).count() as u64);
    is_in_the_table(
        count,
        200,
        &format!(
            "| The model of the fit is true | {count} | the intervals contain k_w in {} and μ in {} |",
            covered[0], covered[1]
        ),
    );
    for covered in covered {
        assert!(10 * covered >= 8 * count && (count < 200 || (180..=198).contains(&covered)));
    }
}

#[test]
fn campaigns_with_an_unknown_compliance_are_often_flagged() {
    let (count, found) = of_seeds(50, 2, |seed| {
        let (mut truth, conditions, mut random) = random_truth(seed);
        truth["motion"]["rig_stiffness"] = json!(random.log_between(1e7, 1e8));
        let tests = campaign(seed, &truth, &conditions);
        let (covers, found) = fit_of(&truth, &tests, "rig_stiffness");
        let is_flagged =
            ["misfit", "lack_of_fit"].iter().any(|kind| !notes(&found, kind).is_empty());
        let is_at_bound =
            ["at_bound", "open_interval"].iter().any(|kind| !notes(&found, kind).is_empty());
        [covers[0], covers[1], is_flagged, is_at_bound]
    });
    let of = |place: usize| found.iter().filter(|it| it[place]).count();
    let both = found.iter().filter(|it| it[2] || it[3]).count();
    let (k, mu, misfit, bound) = (of(0), of(1), of(2), of(3));
    let line = format!(
        "| The truth has a compliance that the fit does not know | {count} | flagged {both}: {misfit} as a misfit, {bound} \
         because an estimate or an interval reaches a bound; the intervals contain k_w in {k} and μ in {mu} |"
    );
    is_in_the_table(count, 50, &line);
    assert!(both > 0);
}

/// A fit whose data do not determine parameters, and the names of these parameters.
fn undetermined(seed: u64) -> (Value, Vec<&'static str>) {
    let mut random = Random::new(1000 + seed);
    let mut truth = ball();
    truth["profile"]["radius"] = json!(random.between(5e-3, 20e-3));
    truth["load"]["normal_force"] = json!(random.log_between(20.0, 200.0));
    truth["moduli"] = json!({"normal": 113e9, "tangential": 93e9});
    truth.as_object_mut().unwrap().remove("bodies");
    let threshold = output(&truth, "unworn.gross_slip_amplitude");
    let range = |pointer: &str, low: f64, high: f64| json!({"pointer": pointer, "from": low, "to": high, "spacing": "log"});
    let (coefficient, friction) =
        (range("/wear/coefficient", 1e-15, 1e-12), range("/friction", 0.2, 1.5));
    let (few, far, mut cycles) = ((0.5, 3.0), (200.0, 400.0), 1e4);
    let (ratios, parameters, expected) = match seed % 6 {
        0 => {
            truth["wear"] = json!({"coefficient": 1e-4, "hardness": 3e9});
            let own = [range("/wear/coefficient", 1e-6, 1e-2), range("/wear/hardness", 1e8, 1e11)];
            (few, [&own[..], &[friction]].concat(), vec!["wear.coefficient", "wear.hardness"])
        }
        1 => {
            truth["load"]["held"] = json!("depth");
            cycles = 1e11;
            ((0.4, 0.8), vec![coefficient, friction], vec!["wear.coefficient"])
        }
        2 => {
            let own = vec![friction, range("/moduli/tangential", 2e10, 4e11)];
            (few, own, vec!["friction", "moduli.tangential"])
        }
        3 => (far, vec![coefficient, friction], vec!["friction"]),
        4 => {
            let own = vec![coefficient, range("/load/normal_force", 5.0, 1000.0)];
            (far, own, vec!["wear.coefficient", "load.normal_force"])
        }
        _ => {
            truth["wear"] = json!({"energy_coefficient": 4e-14});
            let own = vec![range("/wear/energy_coefficient", 1e-15, 1e-12), friction];
            (far, own, vec!["wear.energy_coefficient", "friction"])
        }
    };
    let count = 3 + seed % 3;
    let mut conditions = (0..count).map(|_| {
        (
            threshold * random.log_between(ratios.0, ratios.1),
            cycles * random.log_between(0.5, 2.0).round(),
        )
    });
    let conditions: Vec<_> = conditions.by_ref().collect();
    // Even seeds state the noise.
    let tests = campaign(2 * seed, &truth, &conditions);
    (json!({"scenario": truth, "parameters": parameters, "tests": tests, "starts": 3}), expected)
}

#[test]
fn undetermined_parameters_are_named_and_have_no_numbers() {
    let (count, found) = of_seeds(50, 4, |seed| {
        let (fit, expected) = undetermined(seed);
        let parameters = fit["parameters"].as_array().unwrap().clone();
        let found = fitted(fit).unwrap();
        let told = notes(&found, "undetermined");
        let is_named = told.iter().any(|note| expected.iter().all(|name| note.contains(name)));
        let pretends =
            parameters.iter().zip(found["parameters"].as_array().unwrap()).any(|(it, own)| {
                let name = it["pointer"].as_str().unwrap()[1..].replace('/', ".");
                expected.contains(&name.as_str()) != own["estimate"].is_null()
            });
        if !is_named || pretends {
            println!("{seed}: {expected:?} {told:?} {}", found["parameters"]);
        }
        [is_named, !pretends]
    });
    let of = |place: usize| found.iter().filter(|it| it[place]).count() as u64;
    let line = format!(
        "| The data do not determine one or two parameters | {count} | named in {}; in {} exactly these have no number |",
        of(0),
        of(1)
    );
    is_in_the_table(count, 50, &line);
    assert!(100 * of(0) >= 96 * count && 100 * of(1) >= 96 * count, "{line}");
}

/// The log likelihood of these values, or its gradient.
fn likelihood(of: &Arc<Likelihood>, theta: &[f64], is_gradient: bool) -> Vec<f64> {
    let mut call = of.at(theta.to_vec(), is_gradient);
    assert!(call.seconds() < 30.0);
    iter::repeat_with(|| call.step()).find_map(|found| found).unwrap()
}

#[test]
fn the_log_likelihood_is_largest_at_the_estimate() {
    // Volumes with a stated noise and a prior, and volumes whose noise is estimated.
    let stated = tests(&ball(), &[2e-6, 2.5e-6, 3e-6, 5e-6, 10e-6], Stream::new(1));
    let mut estimated = stated.clone();
    for test in &mut estimated {
        test["data"][0]["noise"] = json!("estimate");
    }
    for (tests, prior) in [(stated, true), (estimated, false)] {
        let mut fit = of_wear_and_friction(&tests);
        fit["starts"] = json!(2);
        if prior {
            fit["parameters"][1]["prior"] =
                json!({"normal": {"mean": 0.65, "standard_deviation": 0.05}});
        }
        let found = fitted(fit).unwrap();
        let of = Arc::new(Likelihood::read(found.to_string().as_bytes()).unwrap());
        let number = |value: &Value| value.as_f64().unwrap();
        let [best, errors] = ["estimate", "standard_error"]
            .map(|name| [0, 1].map(|it| number(&found["parameters"][it][name])));
        // All numbers count once, and their deviations are in the table.
        let sum = number(&found["quality"]["sum_of_squares"]);
        let deviations = found["table"]["deviation"].as_array().unwrap().iter().map(number);
        let constant: f64 = deviations.map(|s| libm::log(std::f64::consts::TAU * s * s)).sum();
        let largest = likelihood(&of, &best, false)[0];
        let known = -0.5 * (sum + constant);
        assert!((largest - known).abs() < 1e-6 * known.abs(), "{largest} {known}");
        // In units of standard errors, the gradient is near 0, and elsewhere that of differences.
        let scaled = |theta: &[f64; 2]| {
            let slopes = likelihood(&of, theta, true);
            [slopes[0] * errors[0], slopes[1] * errors[1]]
        };
        assert!(scaled(&best).iter().all(|slope| slope.abs() < 0.02), "{:?}", scaled(&best));
        for (place, sign) in [(0, 2.0), (0, -2.0), (1, 2.0), (1, -2.0)] {
            let mut theta = best;
            theta[place] += sign * errors[place];
            for (it, slope) in scaled(&theta).into_iter().enumerate() {
                let [high, low] = [0.4, -0.4].map(|step| {
                    let mut beside = theta;
                    beside[it] += step * errors[it];
                    likelihood(&of, &beside, false)[0]
                });
                let difference = (high - low) / 0.8;
                assert!(
                    (slope - difference).abs() < 0.02 * difference.abs().max(1.0),
                    "{slope} {difference}"
                );
            }
            assert!(likelihood(&of, &theta, false)[0] < largest - 0.5);
        }
        // Outside of the bounds.
        let value = |friction: f64| likelihood(&of, &[best[0], friction], false)[0];
        let slope = |friction: f64| likelihood(&of, &[best[0], friction], true);
        assert!(value(1.7) < value(1.6) && value(1.6) < -1e200 && value(0.0) < value(0.05));
        let difference = (value(1.7) - value(1.6)) / 0.1;
        assert!((slope(1.6)[1] / difference - 1.0).abs() < 1e-9 && slope(0.05)[1] > 0.0);
        assert_eq!(slope(1.6)[0].to_bits(), 0.0_f64.to_bits());
    }
    let other = Likelihood::read(b"{\"fit\": {}, \"searches\": {}}").unwrap_err();
    assert!(other.contains("cannot read its fit"), "{other}");
}
