//! Fits of synthetic tests whose noise is known: how often intervals contain the truth, and how often a true law is said to fail.

use std::iter;
use std::sync::Arc;

use fretwork_engine::input::fault::Faults;
use fretwork_random::Stream;
use fretwork_study::{Kind, Likelihood, Points, Rows, Study};
use serde_json::{Value, json};

use crate::normal;

/// The wear volume per dissipated energy. A run of the simplified rule gives it as exactly as one of the exact method, but sooner.
const TRUTH: f64 = 1e-13;

/// The volume at an energy with a scatter of this share.
fn scattered(energy: f64, scatter: f64, is_log: bool) -> f64 {
    let factor = if is_log { libm::exp(scatter) } else { 1.0 + scatter };
    TRUTH * energy * factor
}

/// A fit of the energy coefficient to these tests.
fn of_energy(tests: &Value) -> Value {
    json!({
        "scenario": {
            "profile": {"shape": "paraboloid", "radius": "10 mm"}, "moduli": {"normal": 113e9, "tangential": 93e9},
            "friction": 0.7, "wear": {"energy_coefficient": TRUTH}, "load": {"normal_force": "100 N"},
            "motion": {"amplitude": "5 um"}, "cycles": [10_000], "model": {"method": "simplified"},
        },
        "parameters": [{"pointer": "/wear/energy_coefficient", "from": 1e-16, "to": 1e-10, "spacing": "log"}],
        "tests": tests, "starts": 2,
    })
}

/// The document of a fit.
fn document(fit: Value) -> Result<Value, Faults> {
    let study = Arc::new(Study::read(Kind::named("fit").unwrap(), fit)?);
    let mut points = Points::chunk(Arc::clone(&study), 0, 1, Rows::default());
    let rows = iter::repeat_with(|| points.step()).find_map(|rows| rows).unwrap();
    let text = study.document(&"key", &"engine", rows);
    assert!(text.len() <= study.bytes(), "{} {}", text.len(), study.bytes());
    Ok(serde_json::from_str(&text).unwrap())
}

fn fitted(tests: &Value) -> Value {
    document(of_energy(tests)).unwrap()
}

/// Whether the interval contains the truth, whether the law is said to fail, and the estimate in units of the truth.
fn told(found: &Value) -> (bool, bool, f64) {
    let parameter = &found["parameters"][0];
    let [low, high] = [0, 1].map(|end| parameter["interval"][end].as_f64());
    let covers = low.is_none_or(|low| low <= TRUTH) && high.is_none_or(|high| TRUTH <= high);
    let kinds =
        found["notes"].as_array().unwrap().iter().map(|note| note["kind"].as_str().unwrap());
    let fails = kinds.filter(|kind| ["misfit", "lack_of_fit"].contains(kind)).count() > 0;
    (covers, fails, parameter["estimate"].as_f64().map_or(f64::NAN, |it| it / TRUTH))
}

/// Number of fits in each cell of a table.
fn count() -> u64 {
    if std::env::var_os("FRETWORK_TEST_LONG").is_some() { 300 } else { 25 }
}

/// Checks a cell: the share of intervals that contain the truth, of laws that fail, and the mean estimate.
fn check(name: &str, tests: impl Fn(Stream) -> Value) {
    let count = count();
    let all: Vec<_> = (0..count).map(|seed| told(&fitted(&tests(Stream::new(seed))))).collect();
    let share = |of: &dyn Fn(&(bool, bool, f64)) -> bool| {
        100.0 * all.iter().filter(|it| of(it)).count() as f64 / count as f64
    };
    let (covers, fails) = (share(&|it| it.0), share(&|it| it.1));
    let mean = all.iter().map(|it| it.2).sum::<f64>() / count as f64;
    let spread = all.iter().map(|it| (it.2 - mean) * (it.2 - mean)).sum::<f64>();
    let error = (spread / (count - 1) as f64).sqrt();
    println!("| {name} | {covers:.1} | {fails:.1} | {:.2} |", (mean - 1.0) / error);
    // Four standard errors of a share of 95 %, or of 5 %.
    let chance = 400.0 * (0.05 * 0.95 / count as f64).sqrt();
    assert!((90.0 - chance..=99.0 + chance).contains(&covers), "{name}: {covers} %");
    assert!(fails <= 5.0 + chance, "{name}: {fails} %");
    assert!(
        (mean - 1.0).abs() < error * (0.2 + 4.0 / (count as f64).sqrt()),
        "{name}: {mean} {error}"
    );
}

#[test]
fn intervals_contain_the_truth_for_noise_that_is_a_share_of_the_number() {
    let is_long = count() > 100;
    for (kind, scatter, tests) in cells().filter(|it| is_long || *it == ("normal", 0.25, 24)) {
        for is_stated in [true, false] {
            let mut noise = json!({"kind": kind});
            if is_stated {
                noise["relative"] = json!(scatter);
            }
            let stated = if is_stated { "stated" } else { "estimated" };
            check(&format!("{tests} tests, {kind} noise of {scatter}, {stated}"), |stream| {
                let energies: Vec<f64> =
                    (0..tests).map(|it| 10.0 * libm::pow(1.2, f64::from(it))).collect();
                let volume = |(place, energy): (usize, &f64)| {
                    scattered(*energy, scatter * normal(stream, place as u64), kind == "lognormal")
                };
                let volumes: Vec<f64> = energies.iter().enumerate().map(volume).collect();
                json!([{"data": [{"output": "wear_volume", "over": "dissipated_energy", "x": energies,
                    "y": volumes, "noise": noise}]}])
            });
        }
    }
}

/// Two specimens whose wear differs by chance, and which have as many points each.
#[test]
fn intervals_contain_the_truth_for_two_specimens_and_for_repeated_tests() {
    let is_long = count() > 100;
    let relative = json!({"relative": 0.1});
    for points in (3..=23).filter(|points| is_long || [5, 12].contains(points)) {
        check(&format!("two specimens of {points} points, stated"), |stream| {
            let energies: Vec<f64> = (1..=points).map(f64::from).collect();
            let test = |place: u64| {
                let factor = 1.0 + 0.1 * normal(stream, place);
                let data = volumes(&energies, &vec![factor; energies.len()], &relative);
                json!({"specimen": place.to_string(), "data": [data]})
            };
            json!([test(0), test(1)])
        });
    }
    for (levels, repeats) in [(3, 3), (2, 3), (8, 3)].into_iter().take(if is_long { 3 } else { 1 })
    {
        for noise in [json!({"relative": 0.1}), json!({"relative": 0.25}), json!({"noise": {}})] {
            check(&format!("{levels} energies, {repeats} tests each, {noise}"), |stream| {
                let scatter = noise["relative"].as_f64().unwrap_or(0.1);
                let energies: Vec<f64> = (0..levels * repeats)
                    .map(|it| 10.0 * libm::pow(1.5, f64::from(it / repeats)))
                    .collect();
                let factors: Vec<f64> = (0..energies.len())
                    .map(|it| 1.0 + scatter * normal(stream, it as u64))
                    .collect();
                json!([{"data": [volumes(&energies, &factors, &noise)]}])
            });
        }
    }
}

/// The kind of the noise, its size, and the number of tests.
fn cells() -> impl Iterator<Item = (&'static str, f64, u32)> {
    let of_kind =
        |kind| [0.1, 0.25, 0.4].into_iter().flat_map(move |it| [(kind, it, 6), (kind, it, 24)]);
    ["normal", "lognormal"].into_iter().flat_map(of_kind)
}

/// Volumes over energies, with the members `more` in the data.
fn volumes(energies: &[f64], factors: &[f64], more: &Value) -> Value {
    let y: Vec<f64> =
        energies.iter().zip(factors).map(|(energy, factor)| TRUTH * energy * factor).collect();
    let mut data =
        json!({"output": "wear_volume", "over": "dissipated_energy", "x": energies, "y": y});
    data.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    data
}

/// The kinds of all notes.
fn kinds(found: &Value) -> Vec<&str> {
    found["notes"].as_array().unwrap().iter().map(|note| note["kind"].as_str().unwrap()).collect()
}

#[test]
fn two_specimens_that_differ_by_four_disprove_one_coefficient_for_any_number_of_points() {
    for count in 1..=24 {
        let energies: Vec<f64> = (1..=count).map(f64::from).collect();
        let test = |factor: f64| {
            let data =
                volumes(&energies, &vec![factor; energies.len()], &json!({"relative": 0.05}));
            json!({"specimen": factor.to_string(), "data": [data]})
        };
        let found = fitted(&json!([test(1.0), test(4.0)]));
        assert_eq!(kinds(&found)[0], "misfit", "{count}: {}", found["notes"]);
        assert_eq!(found["quality"]["effective_points"], json!(2.0));
        let agrees = fitted(&json!([test(1.0), test(1.02)]));
        assert!(!kinds(&agrees).contains(&"misfit"), "{count}: {}", agrees["notes"]);
    }
}

#[test]
fn scatter_that_repeated_tests_show_is_not_held_against_the_law() {
    let energies = [10.0, 10.0, 10.0, 20.0, 20.0, 20.0, 40.0, 40.0, 40.0];
    let factors = [0.6, 1.0, 1.4, 1.5, 0.5, 1.0, 1.0, 1.45, 0.55];
    let fails = |more: Value, factors: &[f64]| {
        let found = fitted(&json!([{"data": [volumes(&energies, factors, &more)]}]));
        (kinds(&found).contains(&"misfit") || kinds(&found).contains(&"lack_of_fit"), found)
    };
    let (fails_stated, stated) = fails(json!({"relative": 0.05}), &factors);
    assert!(!fails_stated && kinds(&stated).contains(&"scatter"), "{}", stated["notes"]);
    let (fails_estimated, estimated) = fails(json!({"noise": {}}), &factors);
    assert!(!fails_estimated, "{}", estimated["notes"]);
    // Means that leave the line by more than the repeated tests allow.
    let curved = [0.3, 0.31, 0.29, 1.0, 1.02, 0.98, 2.0, 2.04, 1.96];
    assert!(fails(json!({"relative": 0.05}), &curved).0 && fails(json!({"noise": {}}), &curved).0);
}

#[test]
fn the_start_of_a_test_and_numbers_below_0_are_no_faults() {
    let data = |x: &[f64], y: &[f64]| json!([{"data": [{"output": "wear_volume", "over": "dissipated_energy", "x": x, "y": y, "sigma": 1e-13}]}]);
    let coefficient = |tests: &Value| fitted(tests)["parameters"][0]["estimate"].as_f64().unwrap();
    let known = coefficient(&data(&[1.0, 10.0, 20.0], &[-2e-14, 1.1e-12, 1.9e-12]));
    // Σxy/Σx².
    assert!((known / ((-2e-14 + 1.1e-11 + 3.8e-11) / 501.0) - 1.0).abs() < 1e-4, "{known}");
    let with_start = coefficient(&data(&[0.0, 1.0, 10.0, 20.0], &[0.0, -2e-14, 1.1e-12, 1.9e-12]));
    assert_eq!(with_start.to_bits(), known.to_bits());
}

#[test]
fn a_best_value_at_an_end_and_another_unit_are_told_before_anything_is_undetermined() {
    let found = |unit: f64| {
        let data = volumes(
            &[10.0, 20.0, 40.0],
            &[unit, 1.02 * unit, 0.97 * unit],
            &json!({"relative": 0.05}),
        );
        fitted(&json!([{"data": [data]}]))
    };
    let far = found(1e9);
    let note = far["notes"][0].clone();
    assert!(
        note["kind"] == "magnitude"
            && note["detail"].to_string().contains("Are they in mm^3 instead of m^3?"),
        "{note}"
    );
    assert!(
        kinds(&far).iter().filter(|kind| **kind == "at_bound").count() == 1
            && !kinds(&far).contains(&"undetermined"),
        "{:?}",
        kinds(&far)
    );
    assert!(!kinds(&found(100.0)).contains(&"magnitude"));
}

/// A fit of volumes over energies with these members beside the tests.
fn fitted_with(tests: &Value, more: &Value) -> Result<Value, Faults> {
    let mut fit = of_energy(tests);
    fit.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    document(fit)
}

/// Twelve volumes with scatter, of which two are wrong.
fn with_two_outliers(noise: &Value) -> Value {
    let energies: Vec<f64> = (0..12).map(|it| 10.0 * libm::pow(1.2, f64::from(it))).collect();
    let mut factors: Vec<f64> = (0..12).map(|it| 1.0 + 0.05 * normal(Stream::new(3), it)).collect();
    (factors[4], factors[9]) = (1.45, 1.5);
    json!([{"name": "A", "data": [volumes(&energies, &factors, noise)]}])
}

#[test]
fn outliers_are_named_and_can_be_left_out_or_count_less() {
    for noise in [json!({"relative": 0.05}), json!({"noise": {}})] {
        let tests = with_two_outliers(&noise);
        let found = fitted(&tests);
        let pointers = |found: &Value| -> Vec<String> {
            found["outliers"]
                .as_array()
                .unwrap()
                .iter()
                .map(|it| it["pointer"].as_str().unwrap().to_owned())
                .collect()
        };
        let wrong = ["/tests/0/data/0/y/4", "/tests/0/data/0/y/9"];
        assert_eq!(pointers(&found), wrong, "{}", found["notes"]);
        assert_eq!(kinds(&found), ["outliers"]);
        assert!(found["table"]["studentized"][4].as_f64().unwrap() > 4.0);
        let bias = |found: &Value| {
            (found["parameters"][0]["estimate"].as_f64().unwrap() / TRUTH - 1.0).abs()
        };
        let without = fitted_with(&tests, &json!({"without": wrong})).unwrap();
        assert_eq!(without["quality"]["effective_points"], json!(10.0));
        assert_eq!((&without["fit"]["without"], pointers(&without).len()), (&json!(wrong), 0));
        assert_eq!(without["table"]["measured"].as_array().unwrap().len(), 12);
        let robust = fitted_with(&tests, &json!({"loss": "huber"})).unwrap();
        assert!(
            bias(&found) > 0.06 && bias(&without) < 0.03 && bias(&robust) < 0.05,
            "{}",
            bias(&robust)
        );
        assert_eq!(robust["fit"]["loss"], "huber");
        let refused = Likelihood::read(robust.to_string().as_bytes()).unwrap_err();
        assert!(refused.contains("no likelihood"), "{refused}");
    }
    let tests = with_two_outliers(&json!({"relative": 0.05}));
    let fault = |more| {
        let fault = fitted_with(&tests, &more).unwrap_err().0.swap_remove(0);
        format!("{}: {}", fault.pointer, fault.detail)
    };
    assert!(
        fault(json!({"without": ["/tests/0/data/0/y/12"]}))
            .starts_with("/without/0: must be the pointer")
    );
    let all: Vec<String> = (0..12).map(|it| format!("/tests/0/data/0/y/{it}")).collect();
    assert!(fault(json!({"without": all})).starts_with("/without: leaves fewer than 1 numbers"));
    assert!(fault(json!({"loss": "cauchy"})).starts_with("/loss: "));
}

/// One to three of 8 to 20 points with stated errors are five standard deviations off, or one of 12 to 24 with estimated ones.
#[test]
fn intervals_with_the_loss_of_huber_contain_the_truth_beside_outliers() {
    let count = if count() > 100 { 4 * count() } else { count() };
    for (noise, points, most) in
        [(json!({"relative": 0.05}), 8..=20, 3), (json!({"noise": {}}), 12..=24, 1)]
    {
        let mut shares = vec![(0_u32, 0_u32); most + 1];
        for seed in 0..count {
            let stream = Stream::new(seed);
            let draw = |index: u64, below: usize| (stream.at(index) >> 33) as usize % below;
            let (wrong, points) =
                (draw(100, most + 1), points.start() + draw(101, points.clone().count()));
            let energies: Vec<f64> =
                (0..points).map(|it| 10.0 * libm::pow(1.2, it as f64)).collect();
            let mut factors: Vec<f64> =
                (0..points).map(|it| 1.0 + 0.05 * normal(stream, it as u64)).collect();
            // Different places: every third one from a random start.
            (0..wrong).for_each(|it| {
                let sign = if draw(110 + it as u64, 2) == 0 { 1.0 } else { -1.0 };
                factors[(draw(102, points) + 3 * it) % points] += 0.25 * sign;
            });
            let tests = json!([{"data": [volumes(&energies, &factors, &noise)]}]);
            let covers = told(&fitted_with(&tests, &json!({"loss": "huber"})).unwrap()).0;
            shares[wrong].0 += u32::from(covers);
            shares[wrong].1 += 1;
        }
        for (wrong, (covers, fits)) in shares.into_iter().enumerate() {
            let share = f64::from(covers) / f64::from(fits);
            println!("| huber, {wrong} wrong, {noise} | {share:.3} | of {fits} |");
            assert!(
                share >= 0.88 - 4.0 * (0.1 * 0.9 / f64::from(fits)).sqrt(),
                "{wrong} {noise}: {share}"
            );
        }
    }
}

#[test]
fn the_fault_of_wrong_noise_says_what_to_enter() {
    let told = |more: &Value| {
        let mut data = json!({"output": "wear_volume", "over": "dissipated_energy", "x": [10, 20], "y": [1e-12, 2e-12]});
        data.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        let fault = document(of_energy(&json!([{"data": [data]}]))).unwrap_err().0.swap_remove(0);
        format!("{}: {}", fault.pointer.replacen("/tests/0/data/0", "", 1), fault.detail)
    };
    let lognormal = json!({"kind": "lognormal", "relative": 0.2});
    for (more, expected) in [
        (json!({}), "/sigma: is missing"),
        (json!({"relative": 0}), "/y/0: has no noise, or"),
        (
            json!({"relative": 5}),
            "/relative: is 5, but it is a share of each number, from 0 to 1. Enter 0.05 for 5 %",
        ),
        (json!({"noise": {"relative": -1}}), "/noise/relative: is -1"),
        (json!({"noise": "guess"}), "/noise: must be"),
        (json!({"noise": lognormal, "sigma": 1e-14}), "/noise: has the noise, so"),
        (
            json!({"noise": lognormal, "y": [1e-12, -1e-13]}),
            "/y/1: must be greater than 0 if the noise is lognormal",
        ),
        (
            json!({"relative": 0.1, "x": [0, 0], "y": [0, null]}),
            "/y: has no number after the start",
        ),
        (
            json!({"output": "mass_loss", "density": 7.8, "relative": 0.1}),
            "/density: is 7.8 kg/m³. If it is in g/cm³, enter 7800",
        ),
    ] {
        assert!(told(&more).starts_with(expected), "{more}: {}", told(&more));
    }
}

/// A fit of volumes over energies from these multiples of the truth; an energy that stands twice is a repeated test.
fn of_volumes(pairs: &[(f64, f64)], relative: f64) -> Value {
    let data: Vec<Value> = pairs
        .iter()
        .map(|(energy, times)| {
            let y = TRUTH * energy * times;
            json!({"data": [{"output": "wear_volume", "over": "dissipated_energy", "x": [energy], "y": [y],
                "relative": relative}]})
        })
        .collect();
    fitted(&json!(data))
}

/// The repeated tests decide only if they scatter more than stated, and where nothing is stated, if there are enough of them.
#[test]
fn a_repeated_test_does_not_excuse_a_law_that_is_wrong() {
    let wrong = [(1.0, 0.6), (2.0, 1.4), (4.0, 0.7), (8.0, 1.5), (16.0, 0.65), (32.0, 1.35)];
    for second in [1.5, 1.51, 1.55] {
        let found = of_volumes(&[&wrong[..], &[(8.0, second)]].concat(), 0.05);
        assert!(kinds(&found).contains(&"misfit"), "{second}: {}", found["notes"]);
    }
    // If repeated tests scatter as much as different ones, the stated errors are too small.
    let apart = wrong.map(|(energy, times)| (energy, 2.0 - times));
    let found = of_volumes(&[wrong, apart].concat(), 0.05);
    assert!(!kinds(&found).contains(&"misfit"), "{}", found["notes"]);
    assert!(kinds(&found).contains(&"scatter"), "{}", found["notes"]);
    // Numbers that were read twice are no repeated tests. Stated errors that explain the residuals are enough.
    let close = [(1.0, 0.95), (2.0, 1.04), (4.0, 0.97), (8.0, 1.05)];
    let found = of_volumes(&[close, close].concat(), 0.1);
    assert!(!told(&found).1, "{}", found["notes"]);
}
