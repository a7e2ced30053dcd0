//! Force–displacement loops: straight lines between the points enclose the energy of one cycle. The
//! tests cover all held quantities and both methods, until the loop closes.

use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use serde_json::{Value, json};

use crate::engine::steel_ball;

/// The area ∮ Q du of a loop of straight lines.
fn area(displacement: &[f64], force: &[f64]) -> f64 {
    let sides = displacement.windows(2).zip(force.windows(2));
    sides.map(|(u, force)| 0.5 * (u[1] - u[0]) * (force[0] + force[1])).sum::<f64>().abs()
}

fn request(method: &str, load: &Value, motion: &Value) -> Value {
    let mut request = steel_ball();
    request["load"] = load.clone();
    request["motion"] = motion.clone();
    request["cycles"] = json!({"normalized": [0.01, 0.1, 1.0, 10.0, 100.0, 1000.0]});
    if !motion["blocks"].is_null() {
        request["cycles"] = json!([50, 500, 5000, 6000, 50_000, 5_000_000]);
    }
    request["profiles_at"] = json!("all");
    request["model"] = json!({"method": method});
    request
}

#[test]
fn the_area_of_each_loop_is_the_energy_per_cycle() {
    let depth = json!({"normal_force": "100 N", "held": "depth"});
    let force = json!({"normal_force": "100 N", "held": "force"});
    for (load, motion) in [
        (&depth, json!({"stick_ratio": 0.5})),
        (&depth, json!({"amplitude": "0.3 um"})),
        (&depth, json!({"amplitude": "4 um"})),
        (&force, json!({"stick_ratio": 0.5})),
        (&force, json!({"amplitude": "4 um"})),
        (&force, json!({"tangential_force": "50 N"})),
        (&depth, json!({"tangential_force": "30 N"})),
        (&depth, json!({"tangential_force": "50 N"})),
        (&depth, json!({"amplitude": "2.5 um", "rig_stiffness": "50 N/um"})),
        (&force, json!({"amplitude": "2.5 um", "rig_stiffness": "50 N/um"})),
        (
            &depth,
            json!({"blocks": [
                {"amplitude": "1 um", "cycles": 5e3}, {"amplitude": "2 um", "cycles": 1e9},
            ]}),
        ),
        (
            &force,
            json!({"blocks": [
                {"amplitude": "2 um", "cycles": 5e3}, {"amplitude": "1 um", "cycles": 1e9},
            ]}),
        ),
    ] {
        for method in ["simplified", "exact"] {
            let request = request(method, load, &motion);
            let (scenario, _) = scenario::check(&request, "").expect("a valid scenario");
            let outcome = Simulation::of(&scenario).expect("a contact").run();
            let (loops, history) = (outcome.loops.expect("loops"), outcome.history);
            for (row, n) in loops.cycles.iter().enumerate() {
                let entry = history.cycles.iter().position(|at| at == n).expect("an entry");
                let lost = history.energy_per_cycle[entry];
                let (stroke, most) = (history.amplitude[entry], history.tangential_force[entry]);
                let (u, q) = (&loops.displacement[row], &loops.tangential_force[row]);
                let found = area(u, q);
                let whole = 4.0 * stroke * most;
                let error = (found - lost).abs();
                // For an almost closed loop, rounding limits the accuracy.
                assert!(
                    error <= 1e-6 * lost + 1e-15 * whole,
                    "{method} {motion} {load} at {n}: {found} against {lost}"
                );
                assert!((q[0] / most - 1.0).abs() < 1e-12, "{} {most}", q[0]);
                assert!((u[0] / stroke - 1.0).abs() < 1e-12, "{} {stroke}", u[0]);
                assert_eq!((u[0], q[0]), (u[u.len() - 1], q[q.len() - 1]));
            }
        }
    }
}
