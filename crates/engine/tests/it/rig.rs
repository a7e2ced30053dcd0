//! The quantities that an experiment with a rig measures: the length of both scars, output cycles at given dissipated
//! energies, and the criteria of the sliding transition for the stroke at the actuator.

use std::f64::consts::{FRAC_2_PI, SQRT_2};

use fretwork_engine::contact::unworn::Regime;
use fretwork_engine::outcome::{History, Outcome};
use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use fretwork_engine::solver::events::EventKind;
use serde_json::{Value, json};

use crate::engine::steel_ball;

fn run(request: &Value) -> Outcome {
    let (scenario, _) =
        scenario::check(request, "").unwrap_or_else(|faults| panic!("{request}: {faults:?}"));
    Simulation::of(&scenario).expect("a contact").run()
}

fn ball(method: &str, held: &str, motion: &Value, cycles: Value) -> Value {
    let mut request = steel_ball();
    request["load"] = json!({"normal_force": "100 N", "held": held});
    request["motion"] = motion.clone();
    request["cycles"] = cycles;
    request["profiles_at"] = json!("last");
    request["model"] = json!({"method": method});
    request
}

/// All held quantities, in partial and in gross slip.
fn modes() -> Vec<(&'static str, Value)> {
    let blocks = json!({"blocks": [
        {"amplitude": "4 um", "cycles": 2000}, {"amplitude": "1 um", "cycles": 100_000}]});
    let mut modes = vec![];
    for held in ["depth", "force"] {
        modes.extend([
            (held, json!({"amplitude": "2.256 um"})),
            (held, json!({"amplitude": "5 um"})),
            (held, json!({"tangential_force": "30 N"})),
            (held, json!({"amplitude": "2.5 um", "rig_stiffness": "50 N/um"})),
            (held, json!({"reversals": ["2 um", "-2 um", "1 um", "-1.5 um"]})),
            (held, blocks.clone()),
        ]);
    }
    modes
}

/// Half of the length of the scar on each body, in the last row.
fn half_lengths(outcome: &Outcome) -> [f64; 2] {
    [0, 1].map(|body| *outcome.bodies[body].scar_half_length.last().expect("a row"))
}

/// Amplitude of the local slip around an unworn paraboloid at r ≥ a₀, in units of U_gs:
/// Δ − (2/π) ∫ min(Δ, 1 − x²)/√(r²−x²) dx, with x = r sin θ.
fn slip_outside(threshold: f64, r: f64) -> f64 {
    let edge = (1.0 - threshold).max(0.0).sqrt();
    let (inner, outer) = ((edge / r).asin(), (1.0 / r).asin());
    let square = |angle: f64| 0.5 * r * r * (angle - 0.5 * (2.0 * angle).sin());
    let ring = outer - inner - (square(outer) - square(inner));
    threshold - FRAC_2_PI * (threshold * inner + ring)
}

#[test]
fn the_first_scar_of_the_counterbody_is_longer_by_the_slip_at_the_edge() {
    for method in ["simplified", "exact"] {
        for held in ["depth", "force"] {
            for um in [0.5, 2.256, 4.0, 50.0] {
                let motion = json!({"amplitude": um * 1e-6});
                let outcome = run(&ball(method, held, &motion, json!({"normalized": [1e-4]})));
                let (a, unit) =
                    (outcome.scales.contact_radius, outcome.unworn.gross_slip_amplitude);
                let [indenter, counterbody] = half_lengths(&outcome);
                // The mesh resolves the first scar to 2 %. By the rule, wear begins on a larger area than the contact.
                let close = (indenter / a - 1.0).abs() < 0.02;
                assert!(close || method == "simplified", "{held} {um}: {indenter} {a}");
                let expected = unit * slip_outside(um * 1e-6 / unit, (indenter / a).max(1.0));
                let error = (counterbody - indenter - expected) / expected;
                assert!(error.abs() < 2e-3, "{method} {held} {um}: {error}");
                assert_eq!(outcome.warnings.iter().any(|w| w.kind == "long_scar"), um > 20.0);
            }
        }
    }
}

/// In gross slip at constant depth, the contact finally carries no load. The whole motion is then slip. The half-length
/// of the scar of the counterbody is a + U, with a = √2·a₀ for a paraboloid.
#[test]
fn without_pressure_the_scar_of_the_counterbody_is_longer_by_the_amplitude() {
    for method in ["simplified", "exact"] {
        let request =
            ball(method, "depth", &json!({"amplitude": "5 um"}), json!({"normalized": [1e4]}));
        let outcome = run(&request);
        let a = outcome.scales.contact_radius;
        let [indenter, counterbody] = half_lengths(&outcome);
        assert!((indenter / (SQRT_2 * a) - 1.0).abs() < 0.01, "{method}: {indenter} {a}");
        assert!((counterbody - indenter - 5e-6).abs() < 1e-10, "{method}: {counterbody}");
    }
}

/// The slip curve and the half-length are computed independently. The curve comes from the linear system of the mesh or
/// from the closed form, the half-length from a sum over the springs.
#[test]
fn the_scar_of_the_counterbody_agrees_with_the_slip_curve() {
    for (held, motion) in modes() {
        if !motion["reversals"].is_null() || !motion["blocks"].is_null() {
            // The slip of a record is a path, and the scar of earlier blocks can be longer.
            continue;
        }
        for method in ["simplified", "exact"] {
            let outcome = run(&ball(method, held, &motion, json!({"normalized": [0.5, 4]})));
            let [indenter, counterbody] = half_lengths(&outcome);
            let profiles = outcome.profiles.expect("profiles");
            let (radius, slip) = (&profiles.radius, profiles.slip.last().expect("a row"));
            let next = radius.partition_point(|r| *r < indenter).clamp(1, radius.len() - 1);
            let share = (indenter - radius[next - 1]) / (radius[next] - radius[next - 1]);
            let expected = slip[next - 1] + share * (slip[next] - slip[next - 1]);
            let error = (counterbody - indenter) / expected - 1.0;
            assert!(error.abs() < 2e-3, "{method} {held} {motion}: {error}");
        }
    }
}

/// The scars grow at a constant amplitude, and the run records the scar at the end of each block. So the largest
/// half-length does not depend on the output cycles.
#[test]
fn the_scar_of_the_counterbody_does_not_depend_on_the_output_cycles() {
    for (held, motion) in modes() {
        for method in ["simplified", "exact"] {
            let of = |cycles: Value| half_lengths(&run(&ball(method, held, &motion, cycles)));
            let (few, many) =
                (of(json!([30_000])), of(json!({"from": 10, "to": 30_000, "count": 60})));
            for (few, many) in few.iter().zip(many) {
                assert!((few / many - 1.0).abs() < 1e-6, "{method} {held} {motion}: {few} {many}");
            }
        }
    }
}

/// Only the largest loop of a record decides how far the contact slides.
#[test]
fn small_loops_of_a_record_do_not_lengthen_the_scar() {
    let of = |motion: Value| half_lengths(&run(&ball("exact", "depth", &motion, json!([1e-3]))));
    let [plain, record] = [
        of(json!({"amplitude": "4 um"})),
        of(json!({"reversals": ["4 um", "-4 um", "1 um", "-1.5 um"]})),
    ];
    // The two runs have different time steps.
    assert!((record[1] / plain[1] - 1.0).abs() < 1e-6, "{record:?} {plain:?}");
}

/// A run for dissipated energies finds output cycles. A second run for these output cycles must have the same rows.
#[test]
fn a_run_for_energies_equals_a_run_for_the_cycles_that_it_finds() {
    for (held, motion) in modes() {
        for method in ["simplified", "exact"] {
            let whole = run(&ball(method, held, &motion, json!([20_000])));
            let most = whole.history.dissipated_energy.last().expect("a row");
            let energies: Vec<f64> = [0.003, 0.1, 0.4, 0.41, 0.9].map(|part| part * most).to_vec();
            let request = ball(method, held, &motion, json!({"dissipated_energy": energies}));
            let outcome = run(&request);
            let history = &outcome.history;
            assert_eq!(history.cycles.len(), 6, "{method} {held} {motion}: {:?}", outcome.events);
            for (found, energy) in history.dissipated_energy[1..].iter().zip(&energies) {
                assert!((found / energy - 1.0).abs() < 1e-9, "{method} {held} {motion}: {found}");
            }
            let again = run(&ball(method, held, &motion, json!(history.cycles[1..])));
            // Under a constant force the stick edge moves into worn material, and the mesh then depends on the last
            // output cycle, which a run for energies does not know at its start.
            let scouts = held == "force"
                && motion["tangential_force"].is_null()
                && motion["amplitude"] != "5 um";
            if scouts {
                for (one, other) in history.wear_volume.iter().zip(&again.history.wear_volume) {
                    assert!(
                        (one - other).abs() <= 2e-3 * other,
                        "{method} {motion}: {one} {other}"
                    );
                }
            } else {
                let (one, other) = (json!(outcome), json!(again));
                assert_eq!(one, other, "{method} {held} {motion}");
            }
        }
    }
}

/// The run searches for the energy of a stop condition and for the energy of an output cycle in different ways. Both
/// must find the same cycle.
#[test]
fn a_run_ends_at_the_energy_of_its_stop_condition() {
    for (held, motion) in modes() {
        for method in ["simplified", "exact"] {
            let whole = run(&ball(method, held, &motion, json!([20_000])));
            let energy = 0.7 * whole.history.dissipated_energy.last().expect("a row");
            let output = run(&ball(method, held, &motion, json!({"dissipated_energy": [energy]})));
            let mut request = ball(method, held, &motion, json!([20_000]));
            request["until"] = json!({"dissipated_energy": energy});
            let stopped = run(&request);
            let end = stopped.events.last().expect("an end");
            assert_eq!(end.kind, EventKind::UntilReached, "{method} {held} {motion}");
            let [one, other] = [&stopped, &output].map(|run| run.history.dissipated_energy[1]);
            assert!((one / energy - 1.0).abs() < 1e-8, "{method} {held} {motion}: {one}");
            assert!((other / energy - 1.0).abs() < 1e-9, "{method} {held} {motion}: {other}");
            let [one, other] = [&stopped, &output].map(|run| run.history.cycles[1]);
            assert!((one / other - 1.0).abs() < 1e-3, "{method} {held} {motion}: {one} {other}");
        }
    }
}

/// The run ends when wear practically stops, when the last block ends, or when it cannot continue.
#[test]
fn a_run_ends_even_if_it_cannot_dissipate_the_energies() {
    use EventKind::{EnergyNotReached, GrossSlip};
    for method in ["simplified", "exact"] {
        for (held, motion, kind) in [
            ("depth", json!({"amplitude": "2.256 um"}), EnergyNotReached),
            ("force", json!({"tangential_force": "30 N"}), EnergyNotReached),
            ("force", json!({"amplitude": "2.256 um"}), EnergyNotReached),
            ("depth", json!({"amplitude": "5 um"}), EnergyNotReached),
            ("depth", json!({"tangential_force": "50 N"}), GrossSlip),
            (
                "force",
                json!({"blocks": [{"amplitude": "5 um", "cycles": 70}, {"amplitude": "6 um", "cycles": 30}]}),
                EnergyNotReached,
            ),
        ] {
            let energies = json!({"dissipated_energy": ["1 mJ", "10 mJ", "1 kJ"]});
            let outcome = run(&ball(method, held, &motion, energies));
            let end = outcome.events.last().expect("an end");
            assert_eq!(end.kind, kind, "{method} {held} {motion}");
            let history = &outcome.history;
            assert_eq!(history.cycles.last(), Some(&end.cycles), "{method} {held} {motion}");
            assert_eq!(history.cycles.len(), 4, "{method} {held} {motion}: {history:?}");
            assert_eq!(outcome.profiles.expect("profiles").cycles, [0.0, end.cycles]);
            if !motion["blocks"].is_null() {
                assert!((end.cycles / 100.0 - 1.0).abs() < 1e-12, "{}", end.cycles);
            }
            if kind == EnergyNotReached && motion["blocks"].is_null() {
                let [first, last] = [0, 3].map(|row| history.energy_per_cycle[row]);
                assert!(last < 1e-4 * first, "{method} {held} {motion}: wear goes on, {last}");
            }
        }
        // The wear is so slow that the contact is still practically unworn after the maximum number of cycles.
        let mut request = ball(
            method,
            "depth",
            &json!({"amplitude": "2.256 um"}),
            json!({"dissipated_energy": ["1e15 J"]}),
        );
        request["wear"] = json!({"coefficient": 1e-30});
        let outcome = run(&request);
        let end = outcome.events.last().expect("an end");
        assert_eq!(end.kind, EnergyNotReached);
        assert!((end.cycles / 1e15 - 1.0).abs() < 1e-9, "{method}: {}", end.cycles);
    }
}

/// Coefficients over an energy that is never dissipated do not change any more. Wear that begins again by a coefficient over the
/// energy is not overlooked.
#[test]
fn a_run_with_coefficients_over_the_energy_ends_when_no_energy_is_left() {
    let track = |values: Value| json!({"over": "dissipated_energy", "at": ["0 J", "5 mJ", "5 mJ", "1 kJ"], "values": values});
    for (held, amplitude) in [("depth", "2.256 um"), ("depth", "5 um"), ("force", "2.256 um")] {
        let motion = json!({"amplitude": amplitude});
        let energies = json!({"dissipated_energy": ["1 mJ", "10 mJ", "1 kJ"]});
        let mut request = ball("exact", held, &motion, energies);
        request["friction"] = track(json!([0.7, 0.71, 0.69, 0.72]));
        let outcome = run(&request);
        let end = outcome.events.last().expect("an end");
        assert_eq!(end.kind, EventKind::EnergyNotReached, "{held} {amplitude}");
        let history = &outcome.history;
        assert!(history.energy_per_cycle[3] < 1e-4 * history.energy_per_cycle[0], "{history:?}");
        // A run for a number of cycles stops changing, too.
        request["cycles"] = json!([end.cycles, 10.0 * end.cycles]);
        let History { wear_volume, .. } = run(&request).history;
        assert!((wear_volume[1] / wear_volume[2] - 1.0).abs() < 1e-4, "{wear_volume:?}");
        assert!((wear_volume[1] / history.wear_volume[3] - 1.0).abs() < 1e-3, "{wear_volume:?}");
    }
    // Hardly anything wears until 5 mJ are dissipated.
    let mut request = ball("exact", "depth", &json!({"amplitude": "2.256 um"}), json!([1e15]));
    request["wear"] = json!({"coefficient": track(json!([1e-18, 1e-18, 3e-14, 3e-14]))});
    let last = |request: &Value| *run(request).history.wear_volume.last().expect("a row");
    let delayed = last(&request);
    request["wear"] = json!({"coefficient": 3e-14});
    let usual = last(&request);
    assert!((delayed / usual - 1.0).abs() < 2e-3, "{delayed:e} {usual:e}");
}

/// The canonical scenario keeps the energies, and energies accept the same forms and words as cycles.
#[test]
fn the_canonical_scenario_contains_energies_and_not_their_cycles() {
    let motion = json!({"amplitude": "2.256 um"});
    let check = |cycles: Value, profiles: Value| {
        let mut request = ball("exact", "depth", &motion, cycles);
        request["profiles_at"] = profiles;
        request["until"] = json!({"dissipated_energy": "0.3 J"});
        scenario::check(&request, "").map(|(scenario, _)| json!(scenario))
    };
    let list = check(json!({"dissipated_energy": [0.01, "100 mJ"]}), json!("last")).expect("valid");
    assert_eq!(list["cycles"], json!({"dissipated_energy": [0.01, 0.1]}));
    assert_eq!(list["until"], json!({"dissipated_energy": 0.3}));
    let range = json!({"dissipated_energy": {"from": "10 mJ", "to": 0.1, "count": 2}});
    assert_eq!(check(range, json!("last")).expect("valid"), list);
    let faults = check(json!({"dissipated_energy": [1.0]}), json!([1.0])).expect_err("a list");
    assert_eq!(faults.0[0].pointer, "/profiles_at");
}

/// Adds the displacement of the rig, Q/k, to each point of a loop. The criteria follow from the area, the width and
/// the ends of the new loop.
#[test]
fn the_criteria_at_the_actuator_agree_with_a_loop_that_includes_the_rig() {
    let (stroke, stiffness) = (2.5e-6, 50e6);
    for method in ["simplified", "exact"] {
        for held in ["depth", "force"] {
            let motion = json!({"amplitude": stroke, "rig_stiffness": stiffness});
            let outcome = run(&ball(method, held, &motion, json!({"normalized": [0.5, 4]})));
            let loops = outcome.loops.expect("loops");
            let [energy_ratio, slip_ratio] =
                [loops.actuator_energy_ratio, loops.actuator_slip_ratio]
                    .map(|column| column.expect("a rig"));
            for row in 0..loops.cycles.len() {
                let force = &loops.tangential_force[row];
                let at_actuator = loops.displacement[row].iter().zip(force);
                let at_actuator: Vec<f64> = at_actuator.map(|(u, q)| u + q / stiffness).collect();
                let (most, reached) = (force[0], at_actuator[0]);
                assert!((reached / stroke - 1.0).abs() < 1e-12, "{method} {held}: {reached}");
                let sides = at_actuator.windows(2).zip(force.windows(2));
                let area: f64 = sides.map(|(u, q)| 0.5 * (u[0] - u[1]) * (q[0] + q[1])).sum();
                let expected = area.abs() / (4.0 * most * reached);
                let error = energy_ratio[row] / expected - 1.0;
                assert!(error.abs() < 1e-8, "{method} {held}: A {error}");
                // The unloading branch crosses Q = 0 between two corners.
                let next = force.iter().position(|q| *q < 0.0).expect("a negative force");
                let share = force[next - 1] / (force[next - 1] - force[next]);
                let crossing =
                    at_actuator[next - 1] + share * (at_actuator[next] - at_actuator[next - 1]);
                let error = slip_ratio[row] - crossing.abs() / reached;
                assert!(error.abs() < 2e-4, "{method} {held}: D {error}");
                let free = area.abs() / (4.0 * most * crossing.abs());
                assert!(
                    (loops.free_ratio[row] / free - 1.0).abs() < 0.02,
                    "{method} {held}: B {free}"
                );
            }
            let unworn = &outcome.unworn;
            let close = |value: Option<f64>, expected: f64| {
                let value = value.expect("a rig");
                assert!((value / expected - 1.0).abs() < 1e-12, "{value} {expected}");
            };
            close(unworn.actuator_amplitude, stroke);
            close(
                unworn.actuator_amplitude,
                unworn.amplitude + unworn.tangential_force / stiffness,
            );
            close(unworn.actuator_energy_ratio, energy_ratio[0]);
            close(unworn.actuator_slip_ratio, slip_ratio[0]);
        }
    }
    let stiff = json!({"amplitude": stroke});
    let outcome = run(&ball("exact", "depth", &stiff, json!([100])));
    assert_eq!(outcome.unworn.actuator_amplitude, None);
    assert_eq!(outcome.loops.expect("loops").actuator_slip_ratio, None);
}

/// A contact behind a rig, with sizes drawn from a seed.
fn random_contact(number: u64) -> Value {
    let mut state = number.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(7);
    let mut between = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        low * (high / low).powf((state >> 11) as f64 / (1_u64 << 53) as f64)
    };
    let radius = between(2e-3, 0.1);
    let (profile, is_line) = match number % 5 {
        0 => (json!({"shape": "paraboloid", "radius": radius}), false),
        1 => (json!({"shape": "cone", "slope_angle": between(0.005, 0.05)}), false),
        2 => {
            let flat = 0.3e-3 * between(0.3, 1.0);
            (json!({"shape": "truncated_paraboloid", "radius": radius, "flat_radius": flat}), false)
        }
        3 => (json!({"shape": "cylinder", "radius": radius, "length": "10 mm"}), true),
        _ => (
            json!({"shape": "wedge", "slope_angle": between(0.005, 0.05), "length": "10 mm"}),
            true,
        ),
    };
    let held = if is_line || number.is_multiple_of(2) { "force" } else { "depth" };
    let mut motion = json!({"amplitude": "1 um", "rig_stiffness": between(1e6, 1e9)});
    if is_line {
        motion["reference_distance"] = json!("60 mm");
    }
    let moduli = if is_line {
        json!({"normal": "113 GPa"})
    } else {
        json!({"normal": "113 GPa", "tangential": "93 GPa"})
    };
    let method = if is_line || number.is_multiple_of(3) { "exact" } else { "simplified" };
    json!({
        "profile": profile, "moduli": moduli, "friction": between(0.2, 1.0),
        "wear": {"coefficient": "3e-5 mm^3/(N m)"},
        "load": {"normal_force": between(20.0, 2000.0), "held": held},
        "motion": motion, "cycles": {"normalized": [0.3, between(0.5, 3.0)]},
        "model": {"method": method, "points": 16},
    })
}

fn at_amplitude(request: &Value, amplitude: f64) -> Outcome {
    let mut request = request.clone();
    request["motion"]["amplitude"] = json!(amplitude);
    run(&request)
}

/// The amplitude of the actuator minus the threshold after the last cycle.
fn excess(outcome: &Outcome) -> f64 {
    let unworn = &outcome.unworn;
    let last = outcome.history.actuator_gross_slip_amplitude.last().expect("a rig");
    unworn.actuator_amplitude.expect("a rig") - last
}

#[test]
fn the_threshold_at_the_actuator_separates_partial_and_gross_slip() {
    for number in 0..40 {
        let request = random_contact(number);
        let unworn = at_amplitude(&request, 1e-6).unworn;
        let limit = unworn.actuator_gross_slip_amplitude.expect("a rig");
        let [friction, force, stiffness] =
            ["/friction", "/load/normal_force", "/motion/rig_stiffness"]
                .map(|pointer| request.pointer(pointer).and_then(Value::as_f64).expect("a number"));
        let known = unworn.gross_slip_amplitude + friction * force / stiffness;
        assert!((limit / known - 1.0).abs() < 1e-6, "{request}: {limit} {known}");
        for (share, regime) in [(0.999, Regime::PartialSlip), (1.001, Regime::GrossSlip)] {
            let outcome = at_amplitude(&request, share * limit);
            assert_eq!(outcome.regime, regime, "{request}: {share}");
            let first = outcome.history.actuator_gross_slip_amplitude[0];
            assert!((first / limit - 1.0).abs() < 1e-9, "{request}: {first} {limit}");
        }
        // The amplitude at which the contact just slips as a whole after the last cycle.
        let [mut low, mut high] = [limit, limit];
        while excess(&at_amplitude(&request, low)) >= 0.0 {
            low *= 0.97;
        }
        while excess(&at_amplitude(&request, high)) < 0.0 {
            high *= 1.03;
        }
        while high / low > 1.0001 {
            let middle = 0.5 * (low + high);
            let slips = excess(&at_amplitude(&request, middle)) >= 0.0;
            *(if slips { &mut high } else { &mut low }) = middle;
        }
        let stick = |amplitude| {
            *at_amplitude(&request, amplitude).history.stick_radius.last().expect("a row")
        };
        let [below, above] = [stick(0.999 * low), stick(1.001 * high)];
        assert!(below > 0.0 && above == 0.0, "{request}: {low} {limit}, {below} {above}");
    }
}

/// A stick zone that is smaller than a cell of the mesh still carries the contact.
#[test]
fn a_tiny_core_that_sticks_keeps_the_threshold() {
    let mut request = steel_ball();
    request["profile"] = json!({"shape": "cone", "slope_angle": "1 deg"});
    request["load"] = json!({"normal_force": "100 N", "held": "depth"});
    request["motion"] = json!({"stick_ratio": 3e-4});
    request["cycles"] = json!([1, 10_000, 50_000]);
    request["model"] = json!({"method": "exact"});
    let outcome = run(&request);
    let limit = outcome.unworn.gross_slip_amplitude;
    for at in &outcome.history.gross_slip_amplitude {
        assert!((at / limit - 1.0).abs() < 1e-9, "{at} {limit}");
    }
    request["load"]["held"] = json!("force");
    request["motion"] = json!({"amplitude": limit * (1.0 - 3e-4)});
    request["cycles"] = json!([1, 1000, 10_000]);
    let history = run(&request).history;
    assert!(history.stick_radius.iter().all(|c| *c > 0.0), "{:?}", history.stick_radius);
    // The depth rises.
    let thresholds = &history.gross_slip_amplitude;
    assert!(thresholds.windows(2).all(|pair| pair[0] <= pair[1] * (1.0 + 1e-6)), "{thresholds:?}");
}
