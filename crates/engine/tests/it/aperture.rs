//! The aperture of a loop is held. Masing's rule gives its energy; boundary elements and a second solver of round contacts
//! find it in `line.rs` and `collocated.rs`.

use fretwork_engine::outcome::Outcome;
use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use fretwork_engine::solver::events::EventKind;
use serde_json::{Value, json};

use crate::balances::judge;

/// E*, G*, μ and F of the tests.
const MODULI: (f64, f64) = (115e9, 93.4e9);
const FRICTION: f64 = 0.6;
const FORCE: f64 = 100.0;

/// A contact, the unit of its displacements, and its backbone: the displacement at a share of μF, without what is linear in
/// it, and the integral of this from 0 to the share.
struct Known {
    profile: Value,
    unit: f64,
    at: fn(f64) -> f64,
    until: fn(f64) -> f64,
}

/// ∫ (1 − t) ln(1 − t) dt from 0 to q.
fn logarithmic(q: f64) -> f64 {
    let left = 1.0 - q;
    let log = if left > 0.0 { libm::log(left) } else { 0.0 };
    0.25 * (left * left - 1.0) - 0.5 * left * left * log
}

/// (1 − q) ln(1 − q).
fn of_share(q: f64) -> f64 {
    if q < 1.0 { (1.0 - q) * libm::log(1.0 - q) } else { 0.0 }
}

/// A ball by Mindlin and a cylinder by Cattaneo; a cone and a wedge have springs with y = 1 − x.
fn contacts() -> [Known; 4] {
    let (radius, slope, length) = (0.01, 0.05_f64, 0.01);
    let (normal, tangential) = MODULI;
    let ratio = FRICTION * normal / tangential;
    let reach = libm::cbrt(0.75 * FORCE / normal * radius);
    let depth = (std::f64::consts::FRAC_PI_2 * libm::tan(slope) * FORCE / normal).sqrt();
    let line = FRICTION * std::f64::consts::FRAC_2_PI * FORCE / (normal * length);
    [
        Known {
            profile: json!({"shape": "paraboloid", "radius": radius}),
            unit: ratio * reach * reach / radius,
            at: |q| 1.0 - libm::cbrt((1.0 - q) * (1.0 - q)),
            until: |q| q - 0.6 * (1.0 - libm::pow(1.0 - q, 5.0 / 3.0)),
        },
        Known {
            profile: json!({"shape": "cone", "slope_angle": slope}),
            unit: ratio * depth,
            at: |q| 1.0 - (1.0 - q).sqrt(),
            until: |q| q - 2.0 / 3.0 * (1.0 - (1.0 - q) * (1.0 - q).sqrt()),
        },
        Known {
            profile: json!({"shape": "cylinder", "radius": radius, "length": length}),
            unit: line,
            at: |q| 0.5 * of_share(q),
            until: |q| 0.5 * logarithmic(q),
        },
        Known {
            profile: json!({"shape": "wedge", "slope_angle": slope, "length": length}),
            unit: line,
            at: of_share,
            until: logarithmic,
        },
    ]
}

fn request(profile: &Value, motion: &Value, cycles: &[f64]) -> Value {
    json!({
        "profile": profile, "moduli": {"normal": MODULI.0, "tangential": MODULI.1},
        "friction": FRICTION, "wear": {"coefficient": 2e-14}, "load": {"normal_force": FORCE},
        "motion": motion, "cycles": cycles, "profiles_at": "all",
    })
}

/// Runs a contact, and checks that a reader of the loops and the profiles finds their energy and their load.
fn run(profile: &Value, motion: &Value, cycles: &[f64]) -> Outcome {
    let (scenario, _) = scenario::check(&request(profile, motion, cycles), "").expect("valid");
    let outcome = Simulation::of(&scenario).expect("a contact").run();
    judge(&scenario, &outcome, 0.02);
    outcome
}

/// The displacements at which a loop has no force, on its way back. A line contact needs a reference.
fn half_width(outcome: &Outcome, row: usize) -> f64 {
    let loops = outcome.loops.as_ref().expect("loops");
    let (u, q) = (&loops.displacement[row], &loops.tangential_force[row]);
    u[q.iter().position(|force| force.abs() < 1e-9 * q[0]).expect("the point without force")]
}

/// The share at which a function that is positive at 0 and negative at 1 is zero.
fn bisected(of: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        *(if of(middle) > 0.0 { &mut low } else { &mut high }) = middle;
    }
    low
}

#[test]
fn an_unworn_loop_has_the_energy_and_the_force_of_masings_rule() {
    for Known { profile, unit, at, until } in contacts() {
        for ratio in [0.01, 0.1, 0.25, 0.5, 1.0, 3.0, 10.0] {
            let outcome = run(&profile, &json!({"loop_aperture": ratio * unit}), &[1.0]);
            let missing = |q: f64| ratio + 2.0 * at(0.5 * q) - at(q);
            let whole = missing(1.0) > 0.0;
            let share = if whole { 1.0 } else { bisected(missing) };
            let stroke = ratio + 2.0 * at(0.5 * share);
            // W = 4QU − 8 ∫ g dQ
            let lost = 4.0 * FRICTION * FORCE * unit * (share * stroke - 2.0 * until(share));
            let unworn = &outcome.unworn;
            let name = format!("{profile} {ratio}");
            let near = |found: f64, known: f64| (found / known - 1.0).abs() < 1e-9;
            assert!(near(unworn.tangential_force, FRICTION * FORCE * share), "{name}");
            assert!(near(unworn.energy_per_cycle, lost), "{name}: {}", unworn.energy_per_cycle);
            assert_eq!(unworn.stick_radius == 0.0, whole, "{name}");
        }
    }
}

#[test]
fn worn_loops_keep_their_aperture() {
    for Known { profile, unit, .. } in contacts() {
        for ratio in [0.1, 2.0] {
            let mut motion = json!({"loop_aperture": ratio * unit});
            if profile.get("length").is_some() {
                motion["reference_distance"] = json!("5 mm");
            }
            let outcome = run(&profile, &motion, &[1e3, 1e4, 1e5]);
            for row in 0..4 {
                let width = half_width(&outcome, row);
                let name = format!("{profile} {ratio} {row}: {:e}", width / (ratio * unit) - 1.0);

                assert!((width / (ratio * unit) - 1.0).abs() < 1e-6, "{name}");
            }
        }
    }
}

/// What is linear in the force changes no aperture. So the reference of a line contact changes its wear by about (a/L)².
#[test]
fn the_reference_hardly_changes_the_wear_at_an_aperture() {
    let [.., cylinder, _] = contacts();
    for ratio in [0.1, 2.0] {
        let aperture = ratio * cylinder.unit;
        let volume =
            |motion: Value| run(&cylinder.profile, &motion, &[1e3, 1e4]).history.wear_volume[2];
        let without = volume(json!({"loop_aperture": aperture}));
        let with = volume(json!({"loop_aperture": aperture, "reference_distance": "5 mm"}));
        let (beside, rig) = (json!("5 mm"), json!("20 N/um"));
        let rigged = volume(
            json!({"loop_aperture": aperture, "reference_distance": beside, "rig_stiffness": rig}),
        );
        assert!((with / without - 1.0).abs() < 1e-3, "{with} {without}");
        assert_eq!(rigged, with);
    }
}

#[test]
fn blocks_hold_apertures_one_after_the_other() {
    for Known { profile, unit, .. } in contacts() {
        let block =
            |ratio: f64, cycles: f64| json!({"loop_aperture": ratio * unit, "cycles": cycles});
        let one = run(&profile, &json!({"loop_aperture": 2.0 * unit}), &[2e4]);
        let blocks = json!({"blocks": [block(2.0, 1e4), block(2.0, 1e4)]});
        let two = run(&profile, &blocks, &[2e4]);
        assert_eq!(one.history.wear_volume, two.history.wear_volume, "{profile}");
        let blocks = json!({"blocks": [block(2.0, 1e4), block(0.0, 1e4), block(1.0, 1e4)]});
        let history = run(&profile, &blocks, &[1e4, 2e4, 3e4]).history;
        let volume = &history.wear_volume;
        assert_eq!(volume[1], volume[2], "{profile}: a contact at rest does not wear");
        // The energy of a sliding contact is 4μF(δ − const).
        let first = volume[1] / (volume[3] - volume[2]);
        assert!((1.8..2.6).contains(&first), "{profile}: {first}");
    }
}

/// What follows depends on the mesh: the core slips by one cell after the other.
#[test]
fn a_run_ends_when_its_core_begins_to_slip() {
    for Known { profile, unit, .. } in contacts() {
        let aperture = if profile["shape"] == "wedge" { 0.03 } else { 0.1 } * unit;
        let outcome = run(&profile, &json!({"loop_aperture": aperture}), &[1e3, 1e7]);
        let [event] = &outcome.events[..] else { panic!("{profile}: {:?}", outcome.events) };
        assert_eq!(event.kind, EventKind::CoreSlips, "{profile}");
        assert!(outcome.history.stick_radius.iter().all(|stick| *stick > 0.0), "{profile}");
    }
}

#[test]
fn what_an_aperture_cannot_be_combined_with_is_refused() {
    let ball = json!({"shape": "paraboloid", "radius": "10 mm"});
    for (motion, pointer, word) in [
        (json!({"loop_aperture": "2 um", "held": "amplitude"}), "/motion/held", "Remove `held`"),
        (
            json!({"loop_aperture": "2 um", "rig_stiffness": "20 N/um"}),
            "/motion/rig_stiffness",
            "Remove",
        ),
        (
            json!({"loop_aperture": "2 um", "amplitude": "3 um"}),
            "/motion/loop_aperture",
            "amplitude",
        ),
        (
            json!({"blocks": [{"loop_aperture": 0, "cycles": 10}]}),
            "/motion/blocks/0/loop_aperture",
            "greater than 0",
        ),
        (
            json!({"blocks": [{"loop_aperture": "1 um", "cycles": 10}, {"amplitude": "1 um", "cycles": 10}]}),
            "/motion/blocks/1/amplitude",
            "Enter `loop_aperture` in all blocks",
        ),
    ] {
        let faults = scenario::check(&request(&ball, &motion, &[100.0]), "").expect_err("a fault");
        let fault = &faults.0[0];
        assert_eq!(fault.pointer, pointer, "{faults:?}");
        assert!(fault.detail.contains(word), "{faults:?}");
    }
}
