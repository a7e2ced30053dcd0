//! The wear depth when gross slip begins, compared with a fine run. Wear then concentrates at the tip of a cone and at
//! the edge of a flat.

use fretwork_engine::outcome::Outcome;
use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use serde_json::{Value, json};

/// Only true errors above this number are compared with the stated error.
const SMALL: f64 = 0.02;
/// Largest ratio of the stated error to a true error above [`SMALL`].
const MOST_CAUTION: f64 = 4.0;

fn shapes() -> [Value; 7] {
    let paraboloid = |flat: f64| json!({"shape": "truncated_paraboloid", "radius": "10 mm", "flat_radius": flat});
    let cone =
        |flat: f64| json!({"shape": "truncated_cone", "slope_angle": 0.02, "flat_radius": flat});
    [
        json!({"shape": "cone", "slope_angle": 0.02}),
        json!({"shape": "power", "exponent": 1.3, "height": "5 um", "at_radius": "0.2 mm"}),
        json!({"shape": "paraboloid", "radius": "10 mm"}),
        // Without a flat, the contact radius is 0.15 mm for the paraboloid and 0.12 mm for the cone.
        paraboloid(1e-5),
        paraboloid(1.2e-4),
        cone(1e-5),
        cone(1e-4),
    ]
}

fn request(profile: &Value, held: &str) -> Value {
    json!({
        "profile": profile,
        "moduli": {"normal": "110 GPa", "tangential": "90 GPa"},
        "friction": 0.6,
        "wear": {"coefficient": 1e-14},
        "load": {"normal_force": "50 N", "held": held},
        "motion": {"amplitude": "1 um"},
        "cycles": {"normalized": [0.01, 0.03, 0.1, 0.3]},
        "profiles_at": "none",
    })
}

fn gross_slip_amplitude(request: &Value) -> f64 {
    let (scenario, _) = scenario::check(request, "").expect("a scenario");
    scenario.preview().expect("a contact").unworn.gross_slip_amplitude
}

fn run(request: &Value, tolerance: f64) -> Outcome {
    let mut request = request.clone();
    request["model"] = json!({"tolerance": tolerance});
    let (scenario, _) = scenario::check(&request, "").expect("a scenario");
    Simulation::of(&scenario).expect("a contact").run()
}

/// The outputs with a true error of the depth above [`SMALL`] and a stated error that is below the true error or above
/// [`MOST_CAUTION`] times the true error.
fn misstated(request: &Value) -> Vec<String> {
    let (found, fine) = (run(request, scenario::DEFAULT_TOLERANCE), run(request, 1e-4));
    let (found, fine) = (found.history, fine.history);
    assert_eq!((found.cycles.len(), &found.cycles), (5, &fine.cycles), "{request}");
    let outputs = (1..5).map(|row| {
        let error = (found.wear_depth[row] / fine.wear_depth[row] - 1.0).abs();
        (found.normalized_cycles[row], error, found.wear_depth_error[row])
    });
    let wrong = outputs.filter(|(_, error, stated)| {
        *error > SMALL && !(*error..=MOST_CAUTION * error).contains(stated)
    });
    wrong
        .map(|(cycles, error, stated)| {
            format!("{request}: Ñ = {cycles}: {error:.4}, stated {stated:.4}")
        })
        .collect()
}

#[test]
fn early_depths_in_gross_slip_are_correct_or_their_errors_are_stated() {
    let mut wrong = Vec::new();
    for profile in shapes() {
        for held in ["depth", "force"] {
            let mut request = request(&profile, held);
            let threshold = gross_slip_amplitude(&request);
            for ratio in [1.05, 1.2, 2.0, 5.0] {
                request["motion"] = json!({"amplitude": ratio * threshold});
                wrong.extend(misstated(&request));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
