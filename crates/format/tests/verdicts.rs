//! How often the verdict of a fit finds that its law is wrong, or holds chance against a law that is right.

#![expect(clippy::unwrap_used, reason = "a failed test may panic")]

use std::iter;
use std::sync::Arc;

use fretwork_format::Verdict;
use fretwork_random::Stream;
use fretwork_study::stats::distribution::Distribution;
use fretwork_study::{Kind, Points, Rows, Study};
use serde_json::{Value, json};

/// The wear volume per dissipated energy. A run of the simplified rule gives it as exactly as one of the exact method, but sooner.
const TRUTH: f64 = 1e-13;

/// The volume of a law, in units of the line, at an energy in units of the smallest.
type Law = fn(f64) -> f64;

/// The laws of the volumes V(E), in units of the line through the origin, over u = E/E₁ with the smallest energy E₁. The
/// parameters are such that ln V over 24 energies leaves its best line of slope 1 by 0.2 in the root mean square: by two standard
/// deviations of noise of 10 %.
const LAWS: [(&str, Law); 4] = [
    ("line", |_| 1.0),
    ("power 1.159", |u| libm::pow(u, 0.1586)),
    ("threshold of 0.538 E1", |u| 1.0 - 0.5376 / u),
    ("run-in of 1.417 E1", |u| 1.0 + 1.4166 * (1.0 - libm::exp(-u)) / u),
];

/// A number of the standard normal distribution.
fn normal(stream: Stream, index: usize) -> f64 {
    let uniform = (stream.at(index as u64) >> 11) as f64 / (1_u64 << 53) as f64;
    Distribution::normal(0.0, 1.0).unwrap().quantile(uniform + 1e-17)
}

/// The energies of a number of tests, in units of the smallest: a geometric sequence up to 66.
fn energies(count: usize) -> impl Iterator<Item = f64> {
    (0..count).map(move |it| libm::pow(66.0, it as f64 / (count - 1) as f64))
}

/// The root mean square distance of ln(V/E) from its mean over 24 energies.
fn size(law: Law) -> f64 {
    let logs: Vec<f64> = energies(24).map(|u| libm::log(law(u))).collect();
    let mean = logs.iter().sum::<f64>() / 24.0;
    (logs.iter().map(|it| (it - mean) * (it - mean)).sum::<f64>() / 24.0).sqrt()
}

/// The verdict of a fit of the energy coefficient to these data.
fn verdict(data: &Value) -> Verdict {
    let fit = json!({
        "scenario": {
            "profile": {"shape": "paraboloid", "radius": "10 mm"}, "moduli": {"normal": 113e9, "tangential": 93e9},
            "friction": 0.7, "wear": {"energy_coefficient": TRUTH}, "load": {"normal_force": "100 N"},
            "motion": {"amplitude": "5 um"}, "cycles": [10_000], "model": {"method": "simplified"},
        },
        "parameters": [{"pointer": "/wear/energy_coefficient", "from": 1e-16, "to": 1e-10, "spacing": "log"}],
        "tests": [{"data": [data]}], "starts": 1,
    });
    let study = Arc::new(Study::read(Kind::named("fit").unwrap(), fit).unwrap());
    let mut points = Points::chunk(Arc::clone(&study), 0, 1, Rows::default());
    let rows = iter::repeat_with(|| points.step()).find_map(|rows| rows).unwrap();
    let document = study.document(&"key", &fretwork_job::ENGINE, &rows);
    Verdict::read(document.as_bytes()).unwrap().unwrap()
}

/// The share of verdicts, in %, that doubt the law: `fails` and `trend`.
fn doubted(law: Law, tests: usize, noise: f64, is_stated: bool, fits: u64) -> [f64; 2] {
    let outcomes = (0..fits).map(|seed| {
        let stream = Stream::new(seed);
        let scattered =
            |(place, u): (usize, f64)| TRUTH * 10.0 * u * law(u) * (1.0 + noise * normal(stream, place));
        let x: Vec<f64> = energies(tests).map(|u| 10.0 * u).collect();
        let y: Vec<f64> = energies(tests).enumerate().map(scattered).collect();
        let noise = if is_stated { json!({"relative": noise}) } else { json!({}) };
        verdict(&json!({"output": "wear_volume", "over": "dissipated_energy", "x": x, "y": y, "noise": noise})).outcome
    });
    let outcomes: Vec<_> = outcomes.collect();
    ["fails", "trend"]
        .map(|kind| 100.0 * outcomes.iter().filter(|it| **it == kind).count() as f64 / fits as f64)
}

#[test]
fn a_wrong_law_is_found_and_a_right_one_is_left_alone() {
    let is_long = std::env::var_os("FRETWORK_TEST_LONG").is_some();
    let fits: u64 = if is_long { 200 } else { 12 };
    for (name, law) in LAWS {
        let is_right = name == "line";
        assert!(is_right || (size(law) - 0.2).abs() < 0.002, "{name}: {}", size(law));
        for tests in [24, 12, 6, 5] {
            for noise in [0.05, 0.1, 0.25] {
                for is_stated in [true, false] {
                    if !is_long && (tests, noise) != (24, 0.1) && !(is_right && tests == 5) {
                        continue;
                    }
                    let [fails, trend] = doubted(law, tests, noise, is_stated, fits);
                    println!(
                        "| {name} | {tests} | {noise} | {is_stated} | {fails:.1} | {trend:.1} |"
                    );
                    // Four standard errors.
                    let chance = |share: f64| {
                        share + 400.0 * (0.01 * share * (1.0 - 0.01 * share) / fits as f64).sqrt()
                    };
                    if is_right {
                        assert!(
                            fails <= chance(5.0) && trend <= chance(5.0),
                            "{name} {tests} {noise}: {fails} {trend}"
                        );
                    } else if tests == 24 && noise <= 0.1 {
                        let missed = 100.0 - fails - trend;
                        assert!(
                            missed <= chance(10.0),
                            "{name} {noise} {is_stated}: {missed} % are not found"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn a_few_outliers_do_not_disprove_a_law_and_the_verdict_names_them() {
    let holds = |seed: u64, wrong: &[usize]| {
        let factor = |place| {
            let noise = if wrong.contains(&place) { 5.0 } else { normal(Stream::new(seed), place) };
            1.0 + 0.05 * noise
        };
        let x: Vec<f64> = energies(12).map(|u| (10.0 * u).round()).collect();
        let y: Vec<f64> = x.iter().enumerate().map(|(at, x)| TRUTH * x * factor(at)).collect();
        let data = json!({"output": "wear_volume", "over": "dissipated_energy", "x": x, "y": y, "relative": 0.05});
        let Verdict { outcome, verdict, intervals, .. } = verdict(&data);
        let is_named =
            wrong.iter().all(|at| verdict.contains(&format!("wear_volume of 1 at {}", x[*at])));
        outcome == "holds" && is_named && intervals.is_some()
    };
    let count = |wrong: &[usize]| (0..20).filter(|seed| holds(*seed, wrong)).count();
    assert!(count(&[7]) >= 16 && count(&[2, 9]) >= 16, "{} {}", count(&[7]), count(&[2, 9]));
    assert_eq!(count(&[1, 5, 7, 9, 11]), 0);
}
