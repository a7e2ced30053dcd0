//! Truncated shapes and measured tables: comparison with closed forms, with the limiting state and
//! with each other.

use std::f64::consts::PI;

use fretwork_engine::outcome::Outcome;
use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use serde_json::{Value, json};

use crate::engine::steel_ball;

fn run(request: &Value) -> Outcome {
    let checked = scenario::check(request, "");
    let (scenario, _) =
        checked.unwrap_or_else(|faults| panic!("{faults:?} in {}", request["profile"]["shape"]));
    Simulation::of(&scenario).expect("a contact").run()
}

/// Pseudo-random numbers, evenly distributed in 0…1.
pub struct Chance(pub u64);

impl Chance {
    pub fn draw(&mut self) -> f64 {
        // SplitMix64.
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A normally distributed number with standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.draw()).ln()).sqrt() * (2.0 * PI * self.draw()).cos()
    }
}

/// A profile sampled at unevenly spaced radii from 0 to `last`, with noise.
fn sampled(count: usize, last: f64, seed: u64, noise: f64, f: impl Fn(f64) -> f64) -> Value {
    let mut chance = Chance(seed);
    let mut radius: Vec<f64> = (2..count).map(|_| last * chance.draw()).collect();
    radius.extend([0.0, last]);
    radius.sort_by(f64::total_cmp);
    let height: Vec<f64> = radius.iter().map(|r| f(*r) * (1.0 + noise * chance.normal())).collect();
    json!({"shape": "table", "radius": radius, "height": height})
}

/// The largest relative difference between the main quantities of two runs and of their limits.
/// Forces and energies are divided by those of the unworn contact.
fn distance(found: &Outcome, exact: &Outcome) -> f64 {
    let columns = |outcome: &Outcome| {
        let history = outcome.history.clone();
        let limit = outcome.limit.expect("a limit");
        [
            history.wear_volume,
            history.wear_depth,
            history.contact_radius,
            history.scar_radius,
            vec![limit.contact_radius, limit.wear_volume, limit.wear_depth],
            history.normal_force,
            history.energy_per_cycle,
        ]
    };
    let mut worst: f64 = 0.0;
    for (k, (found, exact)) in columns(found).iter().zip(columns(exact)).enumerate() {
        for (a, b) in found.iter().zip(&exact).filter(|(_, b)| **b > 0.0) {
            let scale = if k < 5 { *b } else { exact[0] };
            worst = worst.max((a - b).abs() / scale);
        }
    }
    worst
}

/// A contact at an indentation depth of 3.5 µm. A paraboloid of 10 mm is in gross slip from 3 µm
/// on.
fn pressed(profile: Value, method: &str, amplitude: &str) -> Value {
    let mut request = steel_ball();
    request["profile"] = profile;
    request["load"] = json!({"indentation_depth": "3.5 um"});
    request["motion"] = json!({"amplitude": amplitude});
    request["model"] = json!({"method": method});
    request
}

const WAYS: [(&str, &str); 4] =
    [("simplified", "2.2 um"), ("simplified", "4 um"), ("exact", "2.2 um"), ("exact", "4 um")];

#[test]
fn a_sampled_paraboloid_gives_the_results_of_a_paraboloid() {
    for (method, amplitude) in WAYS {
        let ball = json!({"shape": "paraboloid", "radius": 0.01});
        let analytic = run(&pressed(ball, method, amplitude));
        for (noise, tolerance) in [(0.0, 1e-3), (0.01, 0.02)] {
            let mut worst: f64 = 0.0;
            for seed in 0..12 {
                let table = sampled(200, 0.35e-3, seed, noise, |r| r * r / 0.02);
                worst = worst.max(distance(&run(&pressed(table, method, amplitude)), &analytic));
            }
            println!("{method}, {amplitude}, noise {noise}: {worst:.1e}");
            assert!(worst < tolerance, "{method}, {amplitude}, noise {noise}: {worst}");
        }
    }
}

type Height<'a> = &'a dyn Fn(f64) -> f64;

#[test]
fn sampled_cones_and_power_laws_give_the_results_of_the_exact_shape() {
    let one_degree = 1_f64.to_radians();
    let flat_cone = json!({"shape": "truncated_cone", "slope_angle": one_degree,
        "flat_radius": 0.05e-3});
    let blunt = json!({"shape": "power", "exponent": 4, "height": 1.75e-6, "at_radius": 0.187e-3});
    let quartic = |r: f64| 1.75e-6 * (r / 0.187e-3).powi(4);
    let kinked = |r: f64| (r - 0.05e-3).max(0.0) * one_degree.tan();
    let cone = json!({"shape": "cone", "slope_angle": one_degree});
    let straight = |r: f64| r * one_degree.tan();
    let shapes: [(Value, Height, f64, f64); 3] = [
        (cone, &straight, 2e-3, 0.02),
        (blunt, &quartic, 0.01, 0.1),
        (flat_cone, &kinked, 0.012, f64::INFINITY),
    ];
    for (profile, height, tolerance, noisy) in shapes {
        for (method, amplitude) in [WAYS[0], WAYS[2]] {
            let analytic = run(&pressed(profile.clone(), method, amplitude));
            for seed in 0..6 {
                for (noise, tolerance) in [(0.0, tolerance), (0.01, noisy)] {
                    let table = sampled(200, 0.4e-3, seed, noise, height);
                    let request = pressed(table, method, amplitude);
                    // With noise the edge of the flat can move, so these runs are not compared.
                    if tolerance.is_finite() {
                        let found = distance(&run(&request), &analytic);
                        assert!(found < tolerance, "{profile} {method} {noise} {seed}: {found}");
                    }
                }
            }
        }
    }
}

/// The kinds of the warnings about a table, or that it is refused.
fn doubts(profile: &Value, motion: &Value) -> Vec<String> {
    let mut request = steel_ball();
    request["profile"] = profile.clone();
    request["load"] = json!({"normal_force": 100.0, "held": "force"});
    request["motion"] = motion.clone();
    let Ok((_, warnings)) = scenario::check(&request, "") else { return vec!["refused".into()] };
    let kinds = warnings.into_iter().map(|warning| warning.kind.to_string());
    kinds.filter(|kind| kind.ends_with("_profile")).collect()
}

#[test]
fn a_table_whose_wear_hangs_on_one_interval_has_a_warning() {
    let motion = json!({"amplitude": 2e-6});
    // Between the rows at 120 µm and 125 µm the height has a step, and there the contact ends.
    for (step, expected) in [(0.0, vec![]), (1.5e-6, vec!["sparse_profile"])] {
        let radius: Vec<f64> = (0..=120).map(|i| 5e-6 * f64::from(i)).collect();
        let height = radius.iter().map(|r| r * r / 0.02 + if *r > 1.22e-4 { step } else { 0.0 });
        let height: Vec<f64> = height.collect();
        let table = json!({"shape": "table", "radius": radius, "height": height});
        assert_eq!(doubts(&table, &motion), expected, "{step}");
    }
}

#[test]
fn a_table_with_noise_that_changes_the_wear_has_a_warning() {
    let motion = json!({"amplitude": 1.2e-6});
    let quartic = |r: f64| 1.75e-6 * (r / 0.187e-3).powi(4);
    let mut warned = 0;
    for seed in 0..12 {
        let even = sampled(200, 0.4e-3, seed, 0.01, quartic);
        assert!(doubts(&even, &motion).is_empty(), "noise of 1 % of each height, {seed}");
        let mut chance = Chance(seed);
        let mut noisy = sampled(200, 0.4e-3, seed, 0.0, quartic);
        for height in noisy["height"].as_array_mut().expect("heights") {
            let noise = 0.01 * quartic(0.4e-3) * chance.normal();
            *height = json!(height.as_f64().expect("a height") + noise);
        }
        warned += doubts(&noisy, &motion).len();
    }
    assert!(
        warned >= 8,
        "noise of 1 % of the greatest height: {warned} of 12 have a warning or are refused"
    );
}

#[test]
fn a_table_of_10_000_rows_has_the_wear_of_its_shape() {
    let table = sampled(10_000, 0.4e-3, 1, 0.01, |r| r * r / 0.02);
    let request = pressed(table, "simplified", "2.2 um");
    let outcome = run(&request);
    let ball = json!({"shape": "paraboloid", "radius": 0.01});
    assert!(distance(&outcome, &run(&pressed(ball, "simplified", "2.2 um"))) < 0.02);
}

/// Truncated shapes. The contact radius is about twice the radius of the flat.
fn truncated() -> [Value; 2] {
    [
        json!({"shape": "truncated_paraboloid", "radius": "10 mm", "flat_radius": "0.1 mm"}),
        json!({"shape": "truncated_cone", "slope_angle": "1.5 deg", "flat_radius": "50 um"}),
    ]
}

#[test]
fn truncated_shapes_reach_their_limit_and_conserve_energy_and_volume() {
    for profile in truncated() {
        for (method, amplitude) in WAYS {
            let mut request = pressed(profile.clone(), method, amplitude);
            request["cycles"] = json!({"normalized": [0.2, 1, 4, 1e6]});
            request["model"]["points"] = json!(512);
            let outcome = run(&request);
            let unworn = &outcome.unworn;
            let flat = scenario::check(&request, "").expect("valid").0;
            let flat = serde_json::to_value(&flat).expect("a document");
            let flat = flat["profile"]["flat_radius"].as_f64().expect("a radius");
            let gross = amplitude == "4 um";
            assert!(if gross { unworn.stick_radius == 0.0 } else { unworn.stick_radius > flat });
            assert!(unworn.peak_pressure.is_infinite());
            let limit = outcome.limit.expect("a limit");
            let history = &outcome.history;
            let (volume, force) = (&history.wear_volume, &history.normal_force);
            let reached = volume[4] / limit.wear_volume - 1.0;
            assert!(reached.abs() < 1e-2, "{method} {amplitude}: {reached} from the limit");
            let left = (force[4] - limit.normal_force).abs() / force[0];
            assert!(left < 5e-3, "{method} {amplitude}: {left} of the force left");
            if method == "exact" {
                let mismatch = outcome.accuracy.energy_mismatch.expect("wear");
                assert!(mismatch.abs() < 2e-3, "energy mismatch {mismatch}");
            }
            // 2π ∫ w r dr over the reported curve must equal the reported volume.
            let profiles = outcome.profiles.expect("profiles");
            let radius = &profiles.radius;
            for (wear, volume) in profiles.wear.iter().zip(volume).take(4).skip(1) {
                let sum: f64 = (1..radius.len())
                    .map(|k| {
                        let both = wear[k - 1] * radius[k - 1] + wear[k] * radius[k];
                        PI * both * (radius[k] - radius[k - 1])
                    })
                    .sum();
                let off = sum / volume - 1.0;
                assert!(off.abs() < 5e-3, "{method} {amplitude}: {off} in {profile}");
            }
        }
    }
}

#[test]
fn a_stick_radius_inside_the_flat_is_refused() {
    for profile in truncated() {
        let mut request = pressed(profile, "exact", "2.2 um");
        // At the gross-slip threshold only the flat sticks.
        request["motion"] = json!({"stick_ratio": 0});
        let outcome = run(&request);
        let flat = outcome.unworn.stick_radius / outcome.scales.contact_radius;
        assert!((0.2..0.9).contains(&flat), "{flat}");
        request["motion"] = json!({"stick_ratio": 0.5 * flat});
        let faults = scenario::check(&request, "").expect_err("a fault");
        assert_eq!(faults.0[0].pointer, "/motion/stick_ratio");
        request["motion"] = json!({"stick_ratio": 0.5 * (1.0 + flat)});
        let stick = run(&request).unworn.stick_radius;
        let expected = 0.5 * (1.0 + flat) * outcome.scales.contact_radius;
        assert!((stick / expected - 1.0).abs() < 1e-9);
    }
}

/// The flat is almost the whole contact. Just below the gross-slip threshold only a very thin ring
/// around the flat slips. The engine refuses this scenario if the stick edge can move, also with a
/// rig.
#[test]
fn a_slip_ring_around_a_flat_that_is_too_thin_is_refused() {
    let mut request = json!({
        "profile": {"shape": "truncated_cone", "slope_angle": 1.127_406_806_38,
            "flat_radius": 3.932_386_237_64e-7},
        "moduli": {"normal": 1_004_305.071_05, "tangential": 803_444.056_843},
        "friction": 1.124_722_181_76,
        "wear": {"coefficient": 7.384_411_890_47e-13},
        "load": {"indentation_depth": 1.914_527_373_64e-9},
        "motion": {"amplitude": 2.691_639_256e-9, "rig_stiffness": 15_511_627_267.4_f64},
        "cycles": [1, 1e9],
        "model": {"method": "exact"},
    });
    let faults = scenario::check(&request, "").expect_err("a ring of 2.7e-6");
    assert_eq!(faults.0.len(), 1, "{faults:?}");
    assert_eq!(faults.0[0].pointer, "/motion/amplitude");
    for words in ["2.7e-6 contact radii around the flat", "larger motion", "larger load"] {
        assert!(faults.0[0].detail.contains(words), "{faults:?}");
    }
    // Both proposed changes make the request valid.
    request["motion"]["amplitude"] = json!(2.8e-9);
    run(&request);
    request["load"]["indentation_depth"] = json!(3e-8);
    request["motion"]["amplitude"] = json!(4.2e-8);
    run(&request);
}

/// The largest stick ratio gives the narrowest ring. It is accepted for each pair of held quantities,
/// although its amplitude is rounded.
#[test]
fn the_largest_stick_ratio_is_accepted() {
    for load in ["force", "depth"] {
        for motion in ["amplitude", "tangential_force"] {
            for exponent in [1.0, 1.7, 2.0, 6.0] {
                let profile = json!({"shape": "power", "exponent": exponent, "height": 1e-6, "at_radius": 1e-4});
                let mut request = pressed(profile, "exact", "1 um");
                request["load"] = json!({"normal_force": 37.0, "held": load});
                request["motion"] = json!({"stick_ratio": 0.9999, "held": motion});
                request["cycles"] = json!([1, 10]);
                let outcome = run(&request);
                let stick = outcome.unworn.stick_radius / outcome.scales.contact_radius;
                assert!((stick - 0.9999).abs() < 1e-9, "{stick}");
            }
        }
    }
}

/// F and d by the formulas of the sources in `engine::truncated`, in SI.
#[test]
fn force_and_depth_of_truncated_shapes_agree_with_published_formulas() {
    let modulus = 205e9 / (1.0 - 0.09) / 2.0;
    for [force, b] in [[1.0, 1e-5], [100.0, 1e-4], [100.0, 5e-5], [500.0, 0.2e-3]] {
        for (conical, profile) in [
            (false, json!({"shape": "truncated_paraboloid", "radius": 0.01, "flat_radius": b})),
            (true, json!({"shape": "truncated_cone", "slope_angle": 0.02, "flat_radius": b})),
        ] {
            let mut request = pressed(profile, "simplified", "2.2 um");
            request["load"] = json!({"normal_force": force, "held": "depth"});
            request["motion"] = json!({"stick_ratio": 0.999});
            let scales = run(&request).scales;
            let a = scales.contact_radius;
            let rim = (a * a - b * b).sqrt();
            let angle = (b / a).acos();
            let (depth, load) = if conical {
                (a * angle * 0.02_f64.tan(), (a * a * angle + b * rim) * 0.02_f64.tan())
            } else {
                (a * rim / 0.01, 2.0 * (2.0 * a * a + b * b) * rim / (3.0 * 0.01))
            };
            assert!((scales.indentation_depth / depth - 1.0).abs() < 1e-9);
            assert!((modulus * load / force - 1.0).abs() < 1e-9);
            assert!((scales.normal_force / force - 1.0).abs() < 1e-9);
        }
    }
}

#[test]
fn canonical_truncated_shapes_and_tables_are_their_own_canonical_form() {
    let table = sampled(50, 0.4e-3, 3, 0.01, |r| r * r / 0.02);
    for profile in truncated().into_iter().chain([table]) {
        let request = pressed(profile.clone(), "exact", "2.2 um");
        let (first, _) = scenario::check(&request, "").expect("valid");
        let echo = serde_json::to_value(&first).expect("a document");
        let (again, _) = scenario::check(&echo, "").expect("the echo is accepted");
        assert_eq!(first, again);
        assert_eq!(echo, serde_json::to_value(&again).expect("a document"));
        assert_eq!(echo["profile"]["shape"], profile["shape"]);
        if profile["shape"] == "table" {
            let given = profile["height"][7].as_f64().expect("a height");
            let kept = echo["profile"]["height"][7].as_f64().expect("a height");
            assert!((kept / given - 1.0).abs() < 1e-11, "the canonical form must keep the points");
        }
    }
}

#[test]
fn units_and_the_origin_of_heights_do_not_change_the_result() {
    let plain = json!({"shape": "table", "radius": [0, 1e-4, 2e-4, 3e-4, 4e-4],
        "height": [0, 0.5e-6, 2e-6, 4.5e-6, 8e-6]});
    let written = json!({"shape": "table", "radius": [0, "0.1 mm", "200 um", 3e-4, "0.4 mm"],
        "height": ["-1 um", "-500 nm", "1 um", "3.5 um", 7e-6]});
    let runs = [plain, written].map(|profile| run(&pressed(profile, "simplified", "2.2 um")));
    assert!(distance(&runs[0], &runs[1]) < 1e-9);
}

#[test]
fn faults_in_tables_point_to_the_faulty_row() {
    let r = |n: u32| (0..n).map(|i| f64::from(i) * 1e-5).collect::<Vec<f64>>();
    let good = r(40);
    let heights: Vec<f64> = good.iter().map(|r| r * r / 0.02).collect();
    let with = |list: &[f64], row: usize, entry: Value| {
        let mut list = json!(list);
        list[row] = entry;
        list
    };
    let long = json!(r(10_001));
    for (radius, height, places) in [
        (with(&good, 5, json!(3e-5)), json!(heights), vec!["/profile/radius/5"]),
        (with(&good, 5, json!(4e-5)), json!(heights), vec!["/profile/radius/5"]),
        (with(&good, 0, json!(1e-6)), json!(heights), vec!["/profile/radius/0"]),
        (with(&good, 3, json!(-1e-6)), json!(heights), vec!["/profile/radius/3"]),
        (json!(good), with(&heights, 17, json!(null)), vec!["/profile/height/17"]),
        (json!(good), with(&heights, 17, json!("NaN")), vec!["/profile/height/17"]),
        (json!(good), with(&heights, 17, json!("3 N")), vec!["/profile/height/17"]),
        (json!(good), with(&heights, 2, json!(-1e-7)), vec!["/profile/height/2"]),
        (json!(good), json!(vec![1e-6; 40]), vec!["/profile/height/39"]),
        (json!(good), json!(heights[..39]), vec!["/profile/height"]),
        (json!([0]), json!([0]), vec!["/profile/height", "/profile/radius"]),
        (json!("0, 1"), json!(heights), vec!["/profile/radius"]),
        (long.clone(), long, vec!["/profile/height", "/profile/radius"]),
        // The table ends inside the contact (radius 0.187 mm), or inside the scar (radius 0.22 mm).
        (json!(good[..18]), json!(heights[..18]), vec!["/profile/radius/17"]),
        (json!(good[..21]), json!(heights[..21]), vec!["/profile/radius/20"]),
        (
            with(&good, 5, json!("5 kg")),
            with(&heights, 17, json!([])),
            vec!["/profile/height/17", "/profile/radius/5"],
        ),
        (
            with(&good, 5, json!(0)),
            with(&heights, 17, json!(-1)),
            vec!["/profile/height/17", "/profile/radius/5"],
        ),
    ] {
        let table = json!({"shape": "table", "radius": radius, "height": height});
        let faults = scenario::check(&pressed(table, "exact", "2.2 um"), "").expect_err("a fault");
        let mut found: Vec<&str> = faults.0.iter().map(|fault| fault.pointer.as_str()).collect();
        found.sort_unstable();
        assert_eq!(found, places, "{faults:?}");
    }
    let many = json!({"shape": "table", "radius": vec![0; 9000], "height": vec![0; 9000]});
    let faults = scenario::check(&pressed(many, "exact", "2.2 um"), "").expect_err("faults");
    assert_eq!(faults.0.len(), 101, "a long list of faults must be cut off");
}

#[test]
fn the_fault_for_a_short_table_states_the_required_radius() {
    let radius: Vec<f64> = (0..21).map(|i| f64::from(i) * 1e-5).collect();
    let height: Vec<f64> = radius.iter().map(|r| r * r / 0.02).collect();
    let table = json!({"shape": "table", "radius": radius, "height": height});
    let faults = scenario::check(&pressed(table, "exact", "2.2 um"), "").expect_err("a fault");
    let needed = run(&pressed(json!({"shape": "paraboloid", "radius": 0.01}), "exact", "2.2 um"))
        .limit
        .expect("a limit")
        .contact_radius;
    let said = faults.0[0].detail.split("about ").nth(1).expect("a length");
    let said: f64 = said.split(' ').next().expect("a number").parse().expect("a number");
    assert!((said / needed - 1.0).abs() < 0.03, "{said} for {needed}: {faults:?}");
}

#[test]
fn a_profile_whose_image_decreases_is_refused() {
    // A bump of 2 µm on a shallow bowl.
    let radius: Vec<f64> = (0..200).map(|i| f64::from(i) * 3e-6).collect();
    let hollow = |r: f64| 2e-6 * (-((r - 1e-4) / 4e-5).powi(2)).exp() + r * r / 0.2;
    let height: Vec<f64> = radius.iter().map(|r| hollow(*r) - hollow(0.0)).collect();
    let table = json!({"shape": "table", "radius": radius, "height": height});
    let faults = scenario::check(&pressed(table, "exact", "2.2 um"), "").expect_err("a fault");
    assert!(faults.0[0].pointer.starts_with("/profile/radius/"), "{faults:?}");
    assert!(faults.0[0].detail.contains("fall"), "{faults:?}");
}

/// The contact ends at a steep wall, so the ring is thin. The table ends just outside it. The output
/// radii must still increase.
#[test]
fn output_radii_increase_for_a_thin_ring_at_the_end_of_a_table() {
    for wall in [1e-7, 1e-9, 1e-11] {
        for amplitude in [2.2e-6, 2.6e-6] {
            let mut radius: Vec<f64> = (0..=60).map(|i| 1e-4 * f64::from(i) / 60.0).collect();
            let mut height: Vec<f64> = radius.iter().map(|r| r * r / 0.02).collect();
            radius.push(1e-4 + wall);
            height.push(1e-4);
            let table = json!({"shape": "table", "radius": radius, "height": height});
            let mut request = pressed(table, "exact", "1 um");
            request["motion"] = json!({"reversals": [-2.0 * amplitude, 0.0]});
            request["cycles"] = json!([1, 1000, 1e6]);
            request["model"]["points"] = json!(16);
            let radius = run(&request).profiles.expect("profiles").radius;
            assert!(radius.windows(2).all(|pair| pair[0] < pair[1]), "{radius:?}");
        }
    }
}
