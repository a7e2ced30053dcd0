//! Random scenarios of every kind, and the properties that every result must have.
//!
//! With the environment variable `FRETWORK_TEST_LONG` the tests run 100 000 scenarios by the
//! simplified rule and 2 000 by the exact method.

use fretwork_engine::case::{Case, Method};
use fretwork_engine::contact::control::{Held, Normal};
use fretwork_engine::outcome::{History, Outcome, Profiles};
use fretwork_engine::scenario::{self, Scenario};
use fretwork_engine::simulation::Simulation;
use fretwork_engine::solver::events::EventKind;
use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use serde_json::{Value, json};

use crate::balances;

/// Tables with an increasing trend: steps of any length and height, with occasional decreases.
fn any_table() -> impl Strategy<Value = Value> {
    let rows = prop::collection::vec((1e-3..1.0_f64, -0.1..1.0_f64), 1..40);
    (rows, -6.0..-2.0_f64, -8.0..-3.0_f64, 1.0..4.0_f64).prop_map(|(rows, length, height, power)| {
        let (mut radius, mut rise) = (vec![0.0_f64], vec![0.0_f64]);
        for (step, up) in rows {
            radius.push(radius[radius.len() - 1] + step);
            rise.push((rise[rise.len() - 1] + step * up).max(0.0));
        }
        let scaled = |list: &[f64], scale: f64| -> Vec<f64> {
            list.iter().map(|x| x * 10_f64.powf(scale)).collect()
        };
        let rise: Vec<f64> = rise.iter().map(|z| z.powf(power)).collect();
        json!({"shape": "table", "radius": scaled(&radius, length), "height": scaled(&rise, height)})
    })
}

/// Random motions, each with suitable output cycles.
fn any_motion() -> impl Strategy<Value = (Value, Value)> {
    let amplitude = || (-9.0..-3.0_f64).prop_map(|u| 10_f64.powf(u));
    let stick = prop_oneof![
        3 => 0.0..0.9999_f64,
        1 => Just(0.0),
        1 => (-4.0..-0.3_f64).prop_map(|c| 10_f64.powf(c)),
    ];
    let held = prop_oneof![Just("amplitude"), Just("tangential_force")];
    let energies = || {
        (-20.0..6.0_f64).prop_map(|power| {
            let list = [0.0, 1.0, 6.0].map(|more| 10_f64.powf(power + more));
            json!({ "dissipated_energy": list })
        })
    };
    let cycles = prop_oneof![
        energies(),
        Just(json!({"normalized": [0.01, 1, 16, 1000, 1e9]})),
        Just(json!({"normalized": [0.1, 0.5, 2, 8]})),
        Just(json!([0, 1, 1e5, 1e9])),
        Just(json!({"from": 1, "to": 1e12, "count": 8})),
    ];
    let plain = prop_oneof![
        (stick.clone(), held).prop_map(|(c, held)| json!({"stick_ratio": c, "held": held})),
        stick.clone().prop_map(|c| json!({"stick_ratio": c})),
        amplitude().prop_map(|u| json!({"amplitude": u})),
        amplitude().prop_map(|u| json!({"loop_aperture": u})),
        (-9.0..9.0_f64).prop_map(|q| json!({"tangential_force": 10_f64.powf(q)})),
        (stick, 3.0..12.0_f64)
            .prop_map(|(c, k)| json!({"stick_ratio": c, "rig_stiffness": 10_f64.powf(k)})),
        (amplitude(), 3.0..12.0_f64)
            .prop_map(|(u, k)| json!({"amplitude": u, "rig_stiffness": 10_f64.powf(k)})),
    ];
    let member = prop_oneof![3 => Just("amplitude"), 1 => Just("loop_aperture")];
    let list = prop::collection::vec((0.0..2.0_f64, 0.0..7.0_f64), 1..5);
    let blocks = (amplitude(), member, list).prop_map(|(u, member, list)| {
        let mut end = 0.0;
        let mut instants = Vec::new();
        let blocks: Vec<Value> = list
            .iter()
            .enumerate()
            .map(|(i, (share, n))| {
                let cycles = 10_f64.powf(*n).round();
                instants.extend([end + 0.3 * cycles, end + cycles]);
                end += cycles;
                // Sometimes the contact is at rest in a block.
                let share = if i > 0 && *share < 0.3 { 0.0 } else { share.max(0.1) };
                json!({member: share * u, "cycles": cycles})
            })
            .collect();
        (json!({"blocks": blocks}), json!(instants))
    });
    let blocks = (blocks, prop::option::weighted(0.3, energies()))
        .prop_map(|((motion, cycles), energies)| (motion, energies.unwrap_or(cycles)));
    let reversals =
        (amplitude(), prop::collection::vec(-1.0..1.0_f64, 2..20)).prop_map(|(u, list)| {
            let list: Vec<f64> = list.iter().map(|x| x * u).collect();
            (json!({"reversals": list}), json!([1, 1e3, 1e6]))
        });
    prop_oneof![4 => (plain, cycles), 1 => blocks, 1 => reversals]
}

/// Random requests of every kind. Some of them are not valid.
pub fn any_scenario() -> impl Strategy<Value = Value> {
    let profile = prop_oneof![
        (1e-6..1e3_f64).prop_map(|r| json!({"shape": "paraboloid", "radius": r})),
        (1e-4..1e3_f64).prop_map(|r| json!({"shape": "sphere", "radius": r})),
        (1e-3..1.5_f64).prop_map(|angle| json!({"shape": "cone", "slope_angle": angle})),
        (1.0..20.0_f64, 1e-9..1.0_f64, 1e-6..1.0_f64).prop_map(
            |(n, h, b)| json!({"shape": "power", "exponent": n, "height": h, "at_radius": b})
        ),
        (1e-6..1e3_f64, -8.0..-2.0_f64).prop_map(|(r, b)| json!({
            "shape": "truncated_paraboloid", "radius": r, "flat_radius": 10_f64.powf(b)
        })),
        (1e-3..1.5_f64, -8.0..-2.0_f64).prop_map(|(angle, b)| json!({
            "shape": "truncated_cone", "slope_angle": angle, "flat_radius": 10_f64.powf(b)
        })),
        any_table(),
    ];
    let held = prop_oneof![Just("depth"), Just("force")];
    let load = prop_oneof![
        (-9.0..9.0_f64, held.clone())
            .prop_map(|(f, held)| json!({"normal_force": 10_f64.powf(f), "held": held})),
        (-9.0..-3.0_f64, held)
            .prop_map(|(d, held)| json!({"indentation_depth": 10_f64.powf(d), "held": held})),
    ];
    let until = prop_oneof![
        8 => Just(None),
        1 => (-12.0..-4.0_f64).prop_map(|w| Some(json!({"wear_depth": 10_f64.powf(w)}))),
        1 => (-25.0..-9.0_f64).prop_map(|v| Some(json!({"wear_volume": 10_f64.powf(v)}))),
        1 => (-20.0..6.0_f64).prop_map(|e| Some(json!({"dissipated_energy": 10_f64.powf(e)}))),
    ];
    let material = (5.0..13.0_f64, 0.01..2.0_f64, -18.0..-9.0_f64);
    (profile, any_motion(), load, until, material, 16..80_u32).prop_map(
        |(profile, (motion, cycles), load, until, (modulus, friction, wear), points)| {
            let modulus = 10_f64.powf(modulus);
            let mut request = json!({
                "profile": profile, "motion": motion, "load": load, "cycles": cycles,
                "moduli": {"normal": modulus, "tangential": 0.8 * modulus},
                "friction": friction, "wear": {"coefficient": 10_f64.powf(wear), "share": 0.3},
                "model": {"points": points},
            });
            if let Some(until) = until {
                request["until"] = until;
            }
            request
        },
    )
}

/// Runs `count` valid scenarios. `vary` changes each request before the check, and `judge` checks
/// the result.
fn over(count: u32, vary: impl Fn(&mut Value), judge: impl Fn(&Scenario, &Outcome)) {
    let config = ProptestConfig {
        cases: count,
        max_global_rejects: 100 * count,
        max_local_rejects: 100 * count,
        failure_persistence: None,
        ..ProptestConfig::default()
    };
    let accepted = any_scenario().prop_filter_map("refused", |mut request| {
        vary(&mut request);
        scenario::check(&request, "").ok().map(|(scenario, _)| (request, scenario))
    });
    let mut runner = TestRunner::new(config);
    let result = runner.run(&accepted, |(_, scenario)| {
        let echo = serde_json::to_value(&scenario).expect("a document");
        let (again, _) = scenario::check(&echo, "").expect("the echo is accepted");
        prop_assert_eq!(&again, &scenario);
        // A failure prints the scenario, so that it can be reproduced.
        let judged = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            judge(&scenario, &Simulation::of(&scenario).expect("a contact").run());
        }));
        prop_assert!(judged.is_ok(), "{echo}");
        Ok(())
    });
    if let Err(failure) = result {
        panic!("{failure}");
    }
}

fn tolerance(case: &Case) -> f64 {
    match case.method {
        Method::Exact { tolerance, .. } => tolerance,
        Method::Simplified { .. } => 1e-3,
    }
}

fn is_long() -> bool {
    std::env::var_os("FRETWORK_TEST_LONG").is_some()
}

/// Checks that the held quantities are constant.
fn judge_held(case: &Case, outcome: &Outcome) {
    let History { normal_force, indentation_depth, tangential_force, .. } = &outcome.history;
    let same = |column: &[f64], digits: f64| {
        for value in column {
            assert!((value / column[0] - 1.0).abs() < digits, "{column:?}");
        }
    };
    match case.control.normal {
        Normal::Depth => same(indentation_depth, 1e-14),
        Normal::Force => {
            same(normal_force, 1e-9);
            // Removed material does not return, so the depth must not decrease.
            let error = outcome.accuracy.numerical_error.unwrap_or(0.0);
            let slack = 1.0 - 3.0 * tolerance(case) - error;
            let sinks = indentation_depth.windows(2).all(|pair| pair[1] >= slack * pair[0]);
            assert!(sinks, "{indentation_depth:?}");
        }
    }
    if let Held::Force(_) = case.control.held() {
        // In gross slip the tangential force differs from its bound by the error of the mesh.
        let end = tangential_force.len()
            - usize::from(outcome.events.iter().any(|event| event.kind == EventKind::GrossSlip));
        same(&tangential_force[..end], 1e-9);
    }
}

/// Checks the properties that the results of both methods must have.
fn judge(scenario: &Scenario, outcome: &Outcome) {
    let case = scenario.case().expect("a case");
    let history = &outcome.history;
    let History { cycles, wear_volume, wear_depth, scar_radius, indentation_depth, .. } = history;
    for (name, column) in history.columns() {
        // Only a rig has an actuator.
        if name.starts_with("actuator") && outcome.unworn.actuator_amplitude.is_none() {
            assert!(column.is_empty());
            continue;
        }
        assert_eq!(column.len(), cycles.len());
        assert!(column.iter().all(|x| x.is_finite() && *x >= 0.0), "{column:?}");
    }
    for rising in [cycles, wear_volume, wear_depth, scar_radius] {
        assert!(rising.windows(2).all(|pair| pair[0] <= pair[1]), "{rising:?}");
    }
    assert_eq!(wear_volume[0], 0.0);
    judge_held(&case, outcome);
    // The wear depth must not exceed the indentation depth.
    let most = 1.02 + outcome.accuracy.numerical_error.unwrap_or(0.0);
    for (wear, depth) in wear_depth.iter().zip(indentation_depth) {
        let deepest = depth.max(indentation_depth[0]);
        assert!(*wear <= most * deepest, "{wear_depth:?} {indentation_depth:?}");
    }
    judge_bodies(&case, outcome);
    for event in &outcome.events {
        assert!(event.cycles >= 0.0 && event.cycles.is_finite(), "{:?}", outcome.events);
    }
    let unworn = &outcome.unworn;
    assert!(unworn.peak_pressure >= unworn.mean_pressure);
    judge_profiles(outcome);
    balances::judge(scenario, outcome, 0.01);
}

/// Checks that the wear of the two bodies adds up, that both scars grow, and that the scar of the counterbody is
/// longer, by at most the largest amplitude.
fn judge_bodies(case: &Case, outcome: &Outcome) {
    let History { wear_volume, scar_radius, amplitude, .. } = &outcome.history;
    let [first, second] = &outcome.bodies;
    let volumes = [first, second].map(|body| body.wear_volume.as_ref().expect("a share"));
    for (i, volume) in wear_volume.iter().enumerate() {
        let sum = volumes[0][i] + volumes[1][i];
        assert!((sum - volume).abs() <= 1e-15 * volume);
    }
    let depths = [first, second].map(|body| body.wear_depth.as_ref().expect("a share"));
    for (i, depth) in outcome.history.wear_depth.iter().enumerate() {
        let sum = depths[0][i] + depths[1][i];
        assert!((sum - depth).abs() <= 1e-14 * depth, "{sum} {depth}");
    }
    for depth in depths {
        // What is worn stays worn, even if a later block has another amplitude.
        assert!(depth.windows(2).all(|pair| pair[0] <= pair[1]), "{depth:?}");
    }
    let blocks = case.largest_amplitude() * case.scales.amplitude;
    let stroke = amplitude.iter().copied().fold(blocks, f64::max);
    let lengths = first.scar_half_length.iter().zip(&second.scar_half_length);
    for ((first, second), scar) in lengths.zip(scar_radius) {
        assert!(scar <= first && first <= second, "{scar} {first} {second}");
        // An amplitude that is as close as this to the gross-slip threshold is set to it. Under a held aperture, it can be
        // larger between the output cycles.
        let is_known = !matches!(case.control.held(), Held::Aperture(_));
        assert!(
            !is_known || *second <= (first + stroke) * (1.0 + 1e-11),
            "{first} {second} {stroke}"
        );
    }
    assert!(second.scar_half_length.windows(2).all(|pair| pair[0] <= pair[1]));
}

/// Checks the properties of the profiles and of the loops.
fn judge_profiles(outcome: &Outcome) {
    let Profiles { radius, initial, worn, wear, image, pressure, slip, .. } =
        outcome.profiles.as_ref().expect("profiles");
    assert!(radius.windows(2).all(|pair| pair[0] < pair[1]), "{radius:?}");
    for matrix in [worn, wear, image, slip] {
        for row in matrix {
            assert_eq!(row.len(), radius.len());
            assert!(row.iter().all(|x| x.is_finite()), "{row:?}");
        }
    }
    assert!(initial.iter().all(|x| x.is_finite()));
    for rows in wear.windows(2) {
        for (before, after) in rows[0].iter().zip(&rows[1]) {
            assert!(before <= after && *before >= 0.0, "wear decreases: {before} {after}");
        }
    }
    for row in pressure {
        for p in row {
            assert!(*p >= 0.0, "{row:?}");
        }
        assert!(row.iter().all(|p| p.is_finite()), "{row:?}");
    }
    for row in slip {
        assert!(row.iter().all(|s| *s >= 0.0), "{row:?}");
    }
    let loops = outcome.loops.as_ref().expect("loops");
    for rows in [&loops.displacement, &loops.tangential_force] {
        assert_eq!(rows.len(), wear.len());
        assert!(rows.iter().flatten().all(|x| x.is_finite()));
    }
    for ratios in [&loops.energy_ratio, &loops.slip_ratio, &loops.free_ratio] {
        assert!(ratios.iter().all(|x| (0.0..2.0).contains(x)), "{ratios:?}");
    }
}

#[test]
fn the_simplified_rule_gives_valid_results_for_random_scenarios() {
    let count = if is_long() { 100_000 } else { 800 };
    let simplified = |request: &mut Value| request["model"]["method"] = json!("simplified");
    over(count, simplified, judge);
}

#[test]
fn the_exact_method_gives_valid_results_for_random_scenarios() {
    let count = if is_long() { 2000 } else { 300 };
    let exact = |request: &mut Value| {
        request["model"]["method"] = json!("exact");
        // Coarse runs must be valid too.
        let coarse = request["model"]["points"].as_u64().is_some_and(|points| points % 2 == 0);
        request["model"]["tolerance"] = json!(if coarse { 0.02 } else { 3e-3 });
    };
    over(count, exact, |scenario, outcome| {
        judge(scenario, outcome);
        judge_energy(scenario, outcome);
        if let Some(limit) = &outcome.limit {
            let worn = outcome.history.wear_volume.last().expect("one") / limit.wear_volume;
            let error = outcome.accuracy.numerical_error.unwrap_or(0.0);
            assert!(worn < 1.02 + error, "{worn} times the limit, error {error}");
        }
    });
}

/// The wear rate satisfies the energy balance to rounding, so the mismatch is the error of the time
/// steps. The tolerance limits this error, relative to the present wear plus 1 % of the limiting
/// wear. With a rig, a contact that hardly slips can wear until all of it slips, so its limiting wear is
/// far larger than that of its first amplitude.
fn judge_energy(scenario: &Scenario, outcome: &Outcome) {
    let case = scenario.case().expect("a case");
    let Some(mismatch) = outcome.accuracy.energy_mismatch else { return };
    let volume = outcome.history.wear_volume.last().expect("one") / case.scales.volume();
    let last = outcome.limit.as_ref().map_or(0.0, |limit| limit.wear_volume);
    let limit = case.contact.limit.volume.max(last / case.scales.volume());
    let most = 3.0 * tolerance(&case) * (1.0 + 0.01 * limit / volume);
    assert!(mismatch.abs() < most, "energy mismatch {mismatch}, at most {most}");
}

/// A scenario with one of nine combinations of held quantities and one of four shapes, in scaled
/// units.
fn scaled_request(
    mode: usize,
    shape: usize,
    method: &str,
    (length, stress, wear): (f64, f64, f64),
) -> Value {
    let force = stress * length * length;
    let cycle = 1.0 / (wear * stress);
    let profile = [
        json!({"shape": "paraboloid", "radius": 0.01 * length}),
        json!({"shape": "cone", "slope_angle": 0.02}),
        json!({"shape": "sphere", "radius": 0.01 * length}),
        json!({"shape": "truncated_paraboloid", "radius": 0.01 * length,
               "flat_radius": 5e-5 * length}),
    ][shape]
        .clone();
    let (held, motion) = match mode {
        0 => ("depth", json!({"amplitude": 2e-6 * length})),
        1 => ("force", json!({"amplitude": 2e-6 * length})),
        2 => ("force", json!({"tangential_force": 20.0 * force})),
        3 => ("depth", json!({"tangential_force": 20.0 * force})),
        4 => ("depth", json!({"amplitude": 3e-6 * length, "rig_stiffness": 2e7 * stress * length})),
        5 => ("force", json!({"amplitude": 3e-6 * length, "rig_stiffness": 2e7 * stress * length})),
        6 => (
            "force",
            json!({"blocks": [
            {"amplitude": 2e-6 * length, "cycles": 2000.0 * cycle},
            {"amplitude": 1e-6 * length, "cycles": 1e6 * cycle}]}),
        ),
        7 => ("depth", json!({"reversals": [2e-6 * length, -2e-6 * length, 1e-6 * length]})),
        _ => ("force", json!({"amplitude": 9e-6 * length})),
    };
    // The request contains the held quantities themselves, so that no rounding depends on the
    // scale.
    let load = match held {
        "force" => json!({"normal_force": 64.0 * force}),
        _ => json!({"indentation_depth": 4e-6 * length}),
    };
    json!({
        "profile": profile,
        "moduli": {"normal": 1e11 * stress, "tangential": 0.8e11 * stress},
        "friction": 0.6,
        "wear": {"coefficient": 1e-14 * wear},
        "load": load,
        "motion": motion,
        "cycles": [1000.0 * cycle, 30_000.0 * cycle],
        "model": {"points": 64, "method": method},
    })
}

/// Results depend on the ratios of lengths, moduli and wear coefficients only.
#[test]
fn scaling_the_units_of_a_scenario_scales_the_result_for_all_held_quantities() {
    let run = |request: &Value| {
        let (scenario, _) =
            scenario::check(request, "").unwrap_or_else(|faults| panic!("{request}: {faults:?}"));
        Simulation::of(&scenario).expect("a contact").run()
    };
    for mode in 0..9 {
        for shape in 0..4 {
            for method in ["simplified", "exact"] {
                let plain = run(&scaled_request(mode, shape, method, (1.0, 1.0, 1.0)));
                let (length, stress, wear) = [(8.0, 0.5, 4.0), (0.25, 32.0, 0.125)][shape % 2];
                let scaled = run(&scaled_request(mode, shape, method, (length, stress, wear)));
                let cube = length * length * length;
                for (name, column, scale) in [
                    ("volume", (|h| &h.wear_volume) as fn(&History) -> &Vec<f64>, cube),
                    ("depth", |h| &h.wear_depth, length),
                    ("force", |h| &h.normal_force, stress * length * length),
                    ("indentation", |h| &h.indentation_depth, length),
                    ("contact", |h| &h.contact_radius, length),
                    ("cycles", |h| &h.cycles, 1.0 / (wear * stress)),
                    ("energy", |h| &h.dissipated_energy, cube / wear),
                ] {
                    let (plain, scaled) = (column(&plain.history), column(&scaled.history));
                    assert_eq!(plain.len(), scaled.len());
                    for (plain, scaled) in plain.iter().zip(scaled) {
                        let off = (scaled - scale * plain).abs() / (scale * plain).max(1e-300);
                        assert!(
                            off < 1e-9 || *plain == 0.0,
                            "{name} {off} {mode} {shape} {method}"
                        );
                    }
                }
            }
        }
    }
}
