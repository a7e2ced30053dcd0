//! Truncated shapes and measured tables: against closed forms, the limit, and each other.

use std::f64::consts::PI;

use fretwork::engine::outcome::Outcome;
use fretwork::engine::scenario;
use fretwork::engine::simulation::Simulation;
use serde_json::{Value, json};

use crate::engine::steel_ball;

fn run(request: &Value) -> Outcome {
    let checked = scenario::check(request, "");
    let (scenario, _) =
        checked.unwrap_or_else(|faults| panic!("{faults:?} in {}", request["profile"]["shape"]));
    Simulation::of(&scenario).expect("a contact").run()
}

/// A sequence of evenly spread numbers in 0…1 that looks like chance.
struct Chance(u64);

impl Chance {
    fn draw(&mut self) -> f64 {
        // SplitMix64.
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Normally distributed with the standard deviation 1.
    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.draw()).ln()).sqrt() * (2.0 * PI * self.draw()).cos()
    }
}

/// A profile sampled at uneven radii from 0 to `last`.
fn sampled(count: usize, last: f64, seed: u64, noise: f64, f: impl Fn(f64) -> f64) -> Value {
    let mut chance = Chance(seed);
    let mut radius: Vec<f64> = (2..count).map(|_| last * chance.draw()).collect();
    radius.extend([0.0, last]);
    radius.sort_by(f64::total_cmp);
    let height: Vec<f64> = radius.iter().map(|r| f(*r) * (1.0 + noise * chance.normal())).collect();
    json!({"shape": "table", "radius": radius, "height": height})
}

/// The largest relative distance of two runs: volume, force, depth, radius and limit.
fn distance(a: &Outcome, b: &Outcome) -> f64 {
    let mut worst: f64 = 0.0;
    let columns = |o: &Outcome| {
        let h = &o.history;
        [
            &h.wear_volume,
            &h.normal_force,
            &h.wear_depth,
            &h.contact_radius,
            &h.scar_radius,
            &h.energy_per_cycle,
        ]
        .map(Clone::clone)
    };
    for (k, (a, b)) in columns(a).iter().zip(columns(b)).enumerate() {
        let scale = b.iter().copied().fold(0.0, f64::max);
        for (a, b) in a.iter().zip(b).filter(|(_, b)| *b > 0.0) {
            let relative = (a - b).abs() / if k == 1 || k == 5 { scale } else { b };
            if std::env::var("SHOW").is_ok() {
                println!("{k} {relative:+.2e}");
            }
            worst = worst.max(relative);
        }
    }
    let (a, b) = (a.limit.as_ref().expect("a limit"), b.limit.as_ref().expect("a limit"));
    for (a, b) in [
        (a.contact_radius, b.contact_radius),
        (a.wear_volume, b.wear_volume),
        (a.wear_depth, b.wear_depth),
        (a.normal_force, b.normal_force),
    ] {
        worst = worst.max((a / b - 1.0).abs());
    }
    worst
}

fn request(profile: Value, method: &str, amplitude: &str) -> Value {
    let mut request = steel_ball();
    request["profile"] = profile;
    request["load"] = json!({"indentation_depth": "3.5 um"});
    request["motion"] = json!({"amplitude": amplitude});
    request["model"] = json!({"method": method});
    request
}

#[test]
fn a_sampled_paraboloid_is_a_paraboloid() {
    let ball = json!({"shape": "paraboloid", "radius": 0.01});
    for method in ["simplified", "exact"] {
        for amplitude in ["2.2 um", "4 um"] {
            let analytic = run(&request(ball.clone(), method, amplitude));
            for (noise, tolerance) in [(0.0, 1e-3), (0.01, 0.02)] {
                for seed in 0..8 {
                    let table = sampled(200, 0.35e-3, seed, noise, |r| r * r / 0.02);
                    let found = distance(&run(&request(table, method, amplitude)), &analytic);
                    println!("{method} {amplitude} {noise} {seed}: {found:.1e}");
                    if std::env::var("SHOW").is_err() {
                        assert!(found < tolerance, "{method} {amplitude} {noise} {seed}: {found}");
                    }
                }
            }
        }
    }
}

#[test]
fn measure() {
    let d = 3.5e-6;
    let a = 0.187e-3;
    type F = Box<dyn Fn(f64) -> f64>;
    let list: Vec<(&str, Value, f64, F)> = vec![
        (
            "paraboloid",
            json!({"shape": "paraboloid", "radius": 0.01}),
            0.35e-3,
            Box::new(|r| r * r / 0.02),
        ),
        (
            "paraboloid wide",
            json!({"shape": "paraboloid", "radius": 0.01}),
            2e-3,
            Box::new(|r| r * r / 0.02),
        ),
        (
            "cone",
            json!({"shape": "cone", "slope_angle": "1 deg"}),
            0.3e-3,
            Box::new(|r| r * 1_f64.to_radians().tan()),
        ),
        (
            "power 4",
            json!({"shape": "power", "exponent": 4, "height": d/2., "at_radius": a}),
            0.4e-3,
            Box::new(move |r| d / 2. * (r / a).powi(4)),
        ),
        (
            "sphere",
            json!({"shape": "sphere", "radius": 1e-3}),
            0.12e-3,
            Box::new(|r: f64| 1e-3 - (1e-6 - r * r).sqrt()),
        ),
        (
            "truncated cone",
            json!({"shape": "truncated_cone", "slope_angle": "1 deg", "flat_radius": 0.05e-3}),
            0.4e-3,
            Box::new(|r| (r - 0.05e-3).max(0.0) * 1_f64.to_radians().tan()),
        ),
        (
            "truncated paraboloid",
            json!({"shape": "truncated_paraboloid", "radius": 0.01, "flat_radius": 0.1e-3}),
            0.5e-3,
            Box::new(|r| (r * r - 1e-8).max(0.0) / 0.02),
        ),
    ];
    for (name, profile, last, f) in &list {
        for method in ["simplified", "exact"] {
            for amplitude in ["2.2 um", "4 um"] {
                let analytic = run(&request(profile.clone(), method, amplitude));
                for noise in [0.0, 1e-4, 0.01] {
                    let mut all: Vec<f64> = (0..40)
                        .filter_map(|seed| {
                            let table = sampled(200, *last, seed, noise, f);
                            let r = request(table, method, amplitude);
                            match scenario::check(&r, "") {
                                Ok(_) => Some(distance(&run(&r), &analytic)),
                                Err(_) => None,
                            }
                        })
                        .collect();
                    all.sort_by(f64::total_cmp);
                    println!(
                        "{name} {method} {amplitude} {noise}: median {:.1e} worst {:.1e} n {}",
                        all.get(all.len() / 2).unwrap_or(&9.),
                        all.last().unwrap_or(&9.),
                        all.len()
                    );
                }
            }
        }
    }
}
