//! Scenarios that earlier versions computed wrongly without a warning.

use fretwork_engine::outcome::{History, Outcome};
use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use fretwork_engine::solver::events::EventKind;
use serde_json::{Value, json};

fn run(request: &Value) -> Outcome {
    let checked = scenario::check(request, "");
    let (scenario, _) = checked.unwrap_or_else(|faults| panic!("{request}: {faults:?}"));
    Simulation::of(&scenario).expect("a contact").run()
}

fn contact(changes: &Value) -> Value {
    let mut request = json!({
        "profile": {"shape": "paraboloid", "radius": 0.01},
        "moduli": {"normal": 113e9, "tangential": 93e9},
        "friction": 0.7,
        "wear": {"coefficient": 3e-14},
        "load": {"normal_force": 100.0, "held": "depth"},
        "profiles_at": "none",
    });
    for (member, value) in changes.as_object().expect("members") {
        request[member] = value.clone();
    }
    request
}

fn blocks(amplitudes: &[f64], cycles: f64) -> Value {
    let block = |amplitude: &f64| json!({"amplitude": amplitude, "cycles": cycles});
    json!({"blocks": amplitudes.iter().map(block).collect::<Vec<_>>()})
}

/// Four blocks on a truncated paraboloid. The volume of the first output was 6 % too small, beside a stated 0.2 %.
fn four_blocks() -> Value {
    let amplitudes = [8.1276e-7, 7.9265e-7, 2.0441e-6, 2.2149e-6];
    contact(&json!({
        "profile": {"shape": "truncated_paraboloid", "radius": 0.01, "flat_radius": 1.4647e-5},
        "load": {"normal_force": 137.212, "held": "depth"},
        "cycles": [97_294, 291_884, 486_473, 778_358, 971_974],
        "motion": blocks(&amplitudes, 243_237.0),
    }))
}

/// The volume after a small block was 36 % too large.
fn small_block_first() -> Value {
    contact(&json!({"cycles": [115_000, 230_000], "motion": blocks(&[6e-8, 2.7e-6], 115_000.0)}))
}

type Column = fn(&History) -> &Vec<f64>;

/// Asserts that the stated errors of each output contain the difference to a run with a finer mesh.
fn assert_stated(request: &Value, most: f64) {
    let mut fine = request.clone();
    fine["model"]["tolerance"] = json!(1e-4);
    let (found, exact) = (run(request).history, run(&fine).history);
    let columns: [(Column, Column); 2] = [
        (|history| &history.wear_volume, |history| &history.wear_volume_error),
        (|history| &history.wear_depth, |history| &history.wear_depth_error),
    ];
    for (column, stated) in columns {
        for (row, stated) in stated(&found).iter().enumerate().skip(1) {
            let error = (column(&found)[row] / column(&exact)[row] - 1.0).abs();
            assert!(error <= *stated && *stated <= most, "row {row}: {error}, stated {stated}");
        }
    }
}

#[test]
fn the_first_block_wears_like_its_amplitude_alone() {
    for request in [four_blocks(), small_block_first()] {
        let mut alone = request.clone();
        alone["motion"] = json!({"amplitude": request["motion"]["blocks"][0]["amplitude"]});
        alone["cycles"] = json!([request["cycles"][0]]);
        let [first, alone] = [&request, &alone].map(|request| run(request).history.wear_volume[1]);
        assert!((first / alone - 1.0).abs() < 1e-3, "{first} {alone}");
        assert_stated(&request, 2e-3);
    }
}

/// A finer mesh than the default showed it: waves of the surface became larger from block to block, until the contact
/// stuck.
#[test]
fn fifty_blocks_with_much_wear_stay_in_gross_slip() {
    let amplitudes: Vec<f64> =
        (0..50).map(|i| f64::from(i % 7) * 1e-8 + [2.5e-6, 8e-6][i as usize % 2]).collect();
    let mut request = contact(&json!({
        "load": {"normal_force": 100.0, "held": "force"},
        "cycles": {"from": 2e6, "to": 1e7, "count": 5, "spacing": "linear"},
        "motion": blocks(&amplitudes, 2e5),
    }));
    let coarse = run(&request).history;
    request["model"] = json!({"tolerance": 1e-3});
    let fine = run(&request).history;
    for (row, volume) in fine.wear_volume.iter().enumerate().skip(1) {
        assert!((coarse.wear_volume[row] / volume - 1.0).abs() < 1e-3, "row {row}: {volume}");
        assert!(fine.stick_radius[row] == 0.0, "row {row}");
    }
}

/// Two other solvers find 66.6 cycles. It was 49.
#[test]
fn a_cone_in_gross_slip_reaches_a_depth_after_67_cycles() {
    let outcome = run(&contact(&json!({
        "profile": {"shape": "cone", "slope_angle": 0.02},
        "load": {"normal_force": 20.0, "held": "force"},
        "motion": {"amplitude": 4e-6},
        "cycles": [50.0, 1000.0],
        "until": {"wear_depth": 1e-7},
    })));
    let end = outcome.events.iter().find(|event| event.kind == EventKind::UntilReached);
    let cycles = end.expect("the depth is reached").cycles;
    assert!((cycles / 66.6 - 1.0).abs() < 5e-3, "{cycles}");
}

/// The contact radius is 1.005 times that of the flat. The volume was 1 % too small, beside a stated 0.3 %.
#[test]
fn errors_are_stated_if_almost_the_whole_contact_is_flat() {
    let request = contact(&json!({
        "profile": {"shape": "truncated_paraboloid", "radius": 0.01, "flat_radius": 1.148_562e-4},
        "load": {"normal_force": 3.461_596, "held": "depth"},
        "motion": {"amplitude": 1.473_074e-7},
        "cycles": {"normalized": [0.0285, 0.095, 0.285, 0.95]},
    }));
    assert_stated(&request, 0.08);
    let volume_errors = run(&request).history.wear_volume_error;
    assert!(volume_errors.iter().all(|error| *error < 3e-3), "{volume_errors:?}");
}

/// The mesh neglects the core. It still sticks for ever, and wear stops.
#[test]
fn a_core_that_the_mesh_neglects_sticks_until_shakedown() {
    let outcome = run(&contact(&json!({
        "load": {"normal_force": 42.8, "held": "depth"},
        "motion": {"stick_ratio": 0.0003},
        "cycles": {"normalized": [1, 30]},
    })));
    let kinds: Vec<EventKind> = outcome.events.iter().map(|event| event.kind).collect();
    assert!(kinds.contains(&EventKind::Shakedown), "{kinds:?}");
    assert!(!kinds.contains(&EventKind::GrossSlip), "{kinds:?}");
}
