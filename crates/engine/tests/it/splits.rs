//! Contacts that split into a core and a ring, and measured tables with noise.
//!
//! With the environment variable `FRETWORK_TEST_LONG` the tests draw ten times as many profiles.

use std::f64::consts::FRAC_PI_2;

use fretwork_engine::input::fault::Fault;
use fretwork_engine::outcome::Outcome;
use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use fretwork_engine::solver::events::EventKind;
use serde_json::{Value, json};

use crate::shapes::Chance;

const NORMAL_MODULUS: f64 = 113e9;
/// Contact radius of the ball of 10 mm under 100 N.
const BALL_CONTACT: f64 = 0.188e-3;

/// Number of draws: ten times as many in a long test.
fn draws(count: u32) -> u32 {
    if std::env::var_os("FRETWORK_TEST_LONG").is_some() { 10 * count } else { count }
}

fn checked_run(request: &Value) -> Result<Outcome, Fault> {
    let checked = scenario::check(request, "");
    let (scenario, _) = checked.map_err(|faults| faults.0[0].clone())?;
    Ok(Simulation::of(&scenario).expect("a contact").run())
}

fn has_split(outcome: &Outcome) -> bool {
    outcome.events.iter().any(|event| event.kind == EventKind::ContactSplits)
}

/// The image (3) at `x` of a profile that consists of straight lines through the points.
fn image(radius: &[f64], height: &[f64], x: f64) -> f64 {
    let cells = radius.windows(2).zip(height.windows(2)).take_while(|(r, _)| r[0] < x);
    let sum: f64 = cells
        .map(|(r, z)| {
            let angle = if r[1] < x { (r[1] / x).asin() } else { FRAC_PI_2 };
            (z[1] - z[0]) / (r[1] - r[0]) * (angle - (r[0] / x).asin())
        })
        .sum();
    x * sum
}

/// The force, in N, of the springs outside the contact and the scar in each row of the history.
///
/// The image is that of straight lines through the points of the table and of the wear. The simplified
/// rule cuts its scar off abruptly, so that the image falls there. Outside the scar this fall is
/// not counted: only a fall of the unworn image can make a ring.
fn ring_forces(table: &Value, outcome: &Outcome) -> Vec<f64> {
    const CELLS: u32 = 2000;
    let numbers = |name: &str| -> Vec<f64> {
        serde_json::from_value(table[name].clone()).expect("a list of numbers")
    };
    let (radius, height) = (numbers("radius"), numbers("height"));
    let width = radius[radius.len() - 1] / f64::from(CELLS);
    let places: Vec<f64> = (0..CELLS).map(|i| width * (f64::from(i) + 0.5)).collect();
    let unworn: Vec<f64> = places.iter().map(|x| image(&radius, &height, *x)).collect();
    let profiles = outcome.profiles.as_ref().expect("profiles");
    let history = &outcome.history;
    (0..history.cycles.len())
        .map(|row| {
            let (wear, depth) = (&profiles.wear[row], history.indentation_depth[row]);
            let mut edge = history.contact_radius[row].max(history.scar_radius[row]);
            if row == 0 {
                // The unworn contact ends at the first spring without load.
                let first = places.iter().zip(&unworn).find(|(_, unworn)| **unworn >= depth);
                edge = first.map_or(edge, |(x, _)| x.min(edge));
            }
            let (mut most, mut sum) = (f64::NEG_INFINITY, 0.0);
            for (x, unworn) in places.iter().zip(&unworn) {
                most = most.max(*unworn);
                if *x > edge {
                    let worn = wear[0] + image(&profiles.radius, wear, *x);
                    sum += (depth - unworn - worn).min(most - unworn).max(0.0);
                }
            }
            2.0 * NORMAL_MODULUS * width * sum
        })
        .collect()
}

/// A request with a random method and random held quantities.
fn request(chance: &mut Chance, profile: &Value) -> Value {
    let pick = |draw: f64| usize::from(draw < 0.5);
    let held = ["depth", "force"][pick(chance.draw())];
    let method = ["exact", "simplified"][pick(chance.draw())];
    let u = 0.5e-6 + 4e-6 * chance.draw();
    let motion = match (5.0 * chance.draw()) as u32 {
        0 => json!({"amplitude": u}),
        1 => json!({"amplitude": u.min(2.5e-6), "held": "tangential_force"}),
        2 => json!({"amplitude": u, "rig_stiffness": 2e7}),
        3 => json!({"blocks": [{"amplitude": u, "cycles": 3000},
            {"amplitude": 0.5 * u, "cycles": 27_000}, {"amplitude": u, "cycles": 70_000}]}),
        _ => json!({"reversals": [u, -u, 0.5 * u, -0.2 * u]}),
    };
    let plain = motion.get("blocks").or(motion.get("reversals")).is_none();
    let cycles = if plain {
        json!({"normalized": [0.1, 1, 4, 16]})
    } else {
        json!([300, 3000, 10_000, 30_000, 1e5])
    };
    json!({"profile": profile, "moduli": {"normal": NORMAL_MODULUS, "tangential": 93e9},
        "friction": 0.7, "wear": {"coefficient": 3e-14},
        "load": {"normal_force": 100.0, "held": held}, "motion": motion, "cycles": cycles,
        "model": {"method": method}})
}

#[test]
fn a_groove_that_splits_the_contact_is_refused() {
    let text = include_str!("../data/contact-splits.json");
    let mut request: Value = serde_json::from_str(text).expect("a document");
    let request = request["scenario"].take();
    for method in ["exact", "simplified"] {
        let mut request = request.clone();
        request["model"] = json!({"method": method});
        let fault = checked_run(&request).expect_err("a fault");
        assert!(fault.pointer.starts_with("/profile/radius/"), "{fault:?}");
        for words in ["splits into a core up to", "% of the force", "Smooth the table"] {
            assert!(fault.detail.contains(words), "{fault:?}");
        }
        let row: usize = fault.pointer[16..].parse().expect("a row");
        let radius = request["profile"]["radius"][row].as_f64().expect("a radius");
        // The groove lies at 0.1 mm. Next to it the contact would begin again.
        assert!((0.9e-4..1.4e-4).contains(&radius), "{fault:?}");
    }
}

/// A ball with a groove, a step, a pit or a spike at a radius.
fn scratched(chance: &mut Chance, at: f64) -> Value {
    let rows = 60 + (300.0 * chance.draw()) as u32;
    let radius: Vec<f64> = (0..=rows).map(|i| 0.6e-3 * f64::from(i) / f64::from(rows)).collect();
    let size = 5e-8 * (4.6 * chance.draw()).exp();
    let width = 5e-6 * (2.5 * chance.draw()).exp();
    let row = radius.partition_point(|r| *r < at);
    let kind = (4.0 * chance.draw()) as u32;
    let flaw = |i: usize, r: f64| match kind {
        0 => size * (-((r - at) / width).powi(2)).exp(),
        1 if r > at => size,
        2 if i == row => size,
        3 if i == row => -size,
        _ => 0.0,
    };
    let height: Vec<f64> =
        radius.iter().enumerate().map(|(i, r)| r * r / 0.02 + flaw(i, *r)).collect();
    json!({"shape": "table", "radius": radius, "height": height})
}

/// Half of the flaws lie inside the unworn contact, and half outside, where wear reaches them.
#[test]
fn no_run_of_a_scratched_profile_neglects_a_ring_that_carries_load() {
    let (mut refused, mut ended, mut sound) = (0, 0, 0);
    let count = draws(100);
    for seed in 0..count {
        let mut chance = Chance(u64::from(seed));
        let (from, to) = if seed % 2 == 0 { (0.2, 1.0) } else { (1.0, 1.8) };
        let at = BALL_CONTACT * (from + (to - from) * chance.draw());
        let table = scratched(&mut chance, at);
        let request = request(&mut chance, &table);
        let outcome = match checked_run(&request) {
            Ok(outcome) => outcome,
            Err(fault) => {
                refused += u32::from(fault.detail.contains("splits"));
                continue;
            }
        };
        let rings = ring_forces(&table, &outcome);
        let forces = &outcome.history.normal_force;
        let last = if has_split(&outcome) { rings.len() - 1 } else { rings.len() };
        for (ring, force) in rings.iter().zip(forces).take(last) {
            // A ring counts from 0.1 % on. Next to a single raised point the images of straight
            // lines and of the smooth curve of the engine differ by several times.
            let least = force.max(3e-3 * forces[0]);
            assert!(*ring < 1e-2 * least, "{seed}: a ring carries {ring} N beside {force} N");
        }
        if has_split(&outcome) {
            ended += 1;
        } else {
            sound += 1;
        }
    }
    println!("{count} profiles: {refused} refused as split, {ended} ended, {sound} without a ring");
    assert!(refused > count / 10 && ended > 0 && sound > count / 20);
}

type Height = Box<dyn Fn(f64) -> f64>;

/// A random smooth profile and its height at a radius.
fn smooth(chance: &mut Chance) -> (Value, Height) {
    let (ball, flat, angle) =
        (0.002 + 0.02 * chance.draw(), 1.5e-4 * chance.draw(), 0.005 + 0.02 * chance.draw());
    let exponent = 1.0 + 7.0 * chance.draw();
    let kind = (6.0 * chance.draw()) as u32;
    let profile = match kind {
        0 => json!({"shape": "paraboloid", "radius": ball}),
        1 => json!({"shape": "sphere", "radius": ball}),
        2 => json!({"shape": "cone", "slope_angle": angle}),
        3 => json!({"shape": "truncated_paraboloid", "radius": ball, "flat_radius": flat}),
        4 => json!({"shape": "truncated_cone", "slope_angle": angle, "flat_radius": flat}),
        _ => {
            json!({"shape": "power", "exponent": exponent, "height": 1.5e-6, "at_radius": 0.18e-3})
        }
    };
    let height: Height = match kind {
        0 => Box::new(move |r| r * r / (2.0 * ball)),
        1 => Box::new(move |r| r * r / (ball + (ball * ball - r * r).sqrt())),
        2 => Box::new(move |r| r * angle.tan()),
        3 => Box::new(move |r| (r * r - flat * flat).max(0.0) / (2.0 * ball)),
        4 => Box::new(move |r| (r - flat).max(0.0) * angle.tan()),
        _ => Box::new(move |r| 1.5e-6 * (r / 0.18e-3).powf(exponent)),
    };
    (profile, height)
}

/// Half of the runs have the profile as a formula, and half as an exact table.
#[test]
fn smooth_profiles_do_not_split() {
    let count = draws(50);
    let (mut runs, mut refused) = (0, 0);
    for seed in 0..count {
        let mut chance = Chance(1_000_000 + u64::from(seed));
        let (profile, height) = smooth(&mut chance);
        let mut request = request(&mut chance, &profile);
        let Ok(plain) = checked_run(&request) else { continue };
        let rows = 60 + (400.0 * chance.draw()) as u32;
        let radius: Vec<f64> =
            (0..=rows).map(|i| 1.2e-3 * f64::from(i) / f64::from(rows)).collect();
        let height: Vec<f64> = radius.iter().map(|r| height(*r)).collect();
        request["profile"] = json!({"shape": "table", "radius": radius, "height": height});
        runs += 2;
        assert!(!has_split(&plain), "{request}");
        match checked_run(&request) {
            Ok(outcome) => assert!(!has_split(&outcome), "{request}"),
            Err(fault) => {
                assert!(fault.detail.contains("end of the table"), "{fault:?} {request}");
                refused += 1;
            }
        }
    }
    println!("{runs} runs, {refused} tables too short");
    assert!(runs > count && refused < count / 5, "{runs} {refused}");
}

/// The largest relative difference of the volumes of two runs.
fn distance(found: &Outcome, exact: &Outcome) -> f64 {
    let volumes = found.history.wear_volume.iter().zip(&exact.history.wear_volume).skip(1);
    volumes.map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max)
}

/// Every row has the same noise, including the row on the axis. The noise is given as a share of d₀.
#[test]
fn tables_with_noise_are_smoothed_before_they_are_checked() {
    let shapes: [(Value, f64, Height); 3] = [
        (json!({"shape": "paraboloid", "radius": 0.01}), 0.01, Box::new(|r| r * r / 0.02)),
        (json!({"shape": "cone", "slope_angle": 0.0175}), 0.01, Box::new(|r| r * 0.0175_f64.tan())),
        (
            json!({"shape": "power", "exponent": 6, "height": 1.5e-6, "at_radius": 0.18e-3}),
            0.08,
            Box::new(|r| 1.5e-6 * (r / 0.18e-3).powi(6)),
        ),
    ];
    let count = draws(20);
    let (mut refused, mut drawn) = (0, 0);
    for (profile, bound, height) in &shapes {
        let mut request = json!({"profile": profile, "friction": 0.7,
            "moduli": {"normal": NORMAL_MODULUS, "tangential": 93e9},
            "wear": {"coefficient": 3e-14}, "load": {"normal_force": 100.0, "held": "depth"},
            "motion": {"amplitude": 2.2e-6}, "cycles": [1000, 3000, 10_000],
            "model": {"method": "exact"}});
        let exact = checked_run(&request).expect("a contact");
        let scales = exact.scales;
        for noise in [1e-3, 1e-2] {
            let mut worst: f64 = 0.0;
            for seed in 0..count {
                let mut chance = Chance(1000 + u64::from(seed));
                let last = 2.5 * scales.contact_radius;
                let radius: Vec<f64> = (0..200).map(|i| last * f64::from(i) / 199.0).collect();
                let noisy = |r: &f64, chance: &mut Chance| {
                    height(*r) + noise * scales.indentation_depth * chance.normal()
                };
                let height: Vec<f64> = radius.iter().map(|r| noisy(r, &mut chance)).collect();
                request["profile"] = json!({"shape": "table", "radius": radius, "height": height});
                drawn += 1;
                match checked_run(&request) {
                    Ok(outcome) => {
                        assert!(!has_split(&outcome), "{request}");
                        worst = worst.max(distance(&outcome, &exact));
                    }
                    Err(_) => refused += 1,
                }
            }
            println!("{} with noise {noise}: {worst:.1e}", profile["shape"]);
            assert!(worst < *bound, "{} with noise {noise}: {worst}", profile["shape"]);
        }
    }
    println!("{refused} of {drawn} refused");
    assert!(60 * refused <= drawn, "{refused} of {drawn} refused");
}

/// A hollow on the axis is not noise, even if the points have noise.
#[test]
fn a_hollow_on_the_axis_is_refused() {
    for noise in [0.0, 1e-8] {
        let mut chance = Chance(5);
        let radius: Vec<f64> = (0..200).map(|i| 2e-6 * f64::from(i)).collect();
        let hollow = |r: f64| r * r / 0.02 + 4e-7 * (-(r / 3e-5).powi(2)).exp();
        let height: Vec<f64> =
            radius.iter().map(|r| hollow(*r) + noise * chance.normal()).collect();
        let table = json!({"shape": "table", "radius": radius, "height": height});
        let fault = checked_run(&request(&mut chance, &table)).expect_err("a hollow");
        assert!(fault.pointer.starts_with("/profile/height/"), "{fault:?}");
        assert!(fault.detail.contains("below the height on the axis"), "{fault:?}");
    }
}

/// The grooves lie outside the unworn contact until wear reaches them. Each case lists the indices of the motions with
/// which the contact splits.
#[test]
fn a_run_ends_when_wear_splits_its_contact() {
    let motions = [
        json!({"amplitude": 4e-6}),
        json!({"amplitude": 2e-6}),
        json!({"amplitude": 2e-6, "held": "tangential_force"}),
        json!({"amplitude": 4e-6, "rig_stiffness": 2e7}),
        json!({"reversals": [4e-6, -4e-6, 1e-6, 0.0]}),
        json!({"blocks": [{"amplitude": 2e-6, "cycles": 5000}, {"amplitude": 4e-6, "cycles": 1e6}]}),
    ];
    let near = (0.215e-3, 0.2e-6, 5e-6);
    let far = (0.25e-3, 0.3e-6, 1e-5);
    let cases: [(_, &str, &str, &[usize]); 5] = [
        (near, "depth", "exact", &[0, 1, 4, 5]),
        (near, "force", "exact", &[0, 1, 2, 3, 4, 5]),
        (near, "force", "simplified", &[1, 2]),
        (far, "depth", "exact", &[0, 4, 5]),
        // The run with the first of these motions is computed in closed form.
        (far, "depth", "simplified", &[0, 4, 5]),
    ];
    for ((at, size, width), held, method, ending) in cases {
        let radius: Vec<f64> = (0..=480).map(|i| 1.25e-6 * f64::from(i)).collect();
        let groove = |r: f64| size * (-((r - at) / width).powi(2)).exp();
        let height: Vec<f64> = radius.iter().map(|r| r * r / 0.02 + groove(*r)).collect();
        let table = json!({"shape": "table", "radius": radius, "height": height});
        for motion in ending.iter().map(|i| &motions[*i]) {
            let outcome = checked_run(&json!({"profile": table, "friction": 0.7,
                "moduli": {"normal": NORMAL_MODULUS, "tangential": 93e9},
                "wear": {"coefficient": 3e-14}, "load": {"normal_force": 100.0, "held": held},
                "motion": motion, "cycles": [1000, 10_000, 60_000],
                "model": {"method": method}}))
            .expect("a contact");
            let event = outcome.events.last().expect("an event");
            assert_eq!(event.kind, EventKind::ContactSplits, "{held} {method} {motion}");
            let cycles = &outcome.history.cycles;
            assert_eq!(cycles.last(), Some(&event.cycles), "{held} {method} {motion}");
            let rings = ring_forces(&table, &outcome);
            let last = rings.len() - 1;
            let forces = &outcome.history.normal_force;
            let share = rings[last] / forces[last].max(3e-3 * forces[0]);
            // The far groove carries load next to the edge of the scar, which lies within a cell.
            let least = if at < far.0 { 7e-4..1.3e-3 } else { 7e-4..5e-2 };
            assert!(least.contains(&share), "{held} {method} {motion}: {share}");
            assert!(rings[..last].iter().all(|ring| *ring < rings[last]), "{rings:?}");
        }
    }
}
