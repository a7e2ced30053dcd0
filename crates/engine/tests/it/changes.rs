//! Coefficients that change during a run, and bodies with layers.

use std::sync::Arc;

use fretwork_engine::contact::control::{Block, Control, Normal};
use fretwork_engine::contact::course::{Course, Over, Track};
use fretwork_engine::contact::profile::Shape;
use fretwork_engine::contact::unworn::Contact;
use fretwork_engine::outcome::Outcome;
use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use fretwork_engine::solver::events::EventKind;
use fretwork_engine::solver::stepped::march::March;
use serde_json::{Value, json};

use crate::engine::steel_ball;
use crate::{depth_and_amplitude, exact_problem};

fn outcome(request: &Value) -> Outcome {
    let (scenario, _) = scenario::check(request, "").expect("a valid scenario");
    // The canonical form of a canonical scenario is the same scenario.
    let canonical = json!(scenario);
    let (again, _) = scenario::check(&canonical, "").expect("a canonical scenario");
    assert_eq!(json!(again), canonical);
    Simulation::of(&scenario).expect("a contact").run()
}

/// A cylinder on a flat in gross slip. μh₀ is 0.06 µm.
fn sliding_cylinder() -> Value {
    json!({
        "profile": {"shape": "cylinder", "radius": "6 mm", "length": "10 mm"},
        "moduli": {"normal": "110 GPa"}, "friction": 0.6, "wear": {"coefficient": 2e-14},
        "load": {"normal_force": "18.5 N/mm"}, "motion": {"sliding_amplitude": "100 um"},
        "cycles": [100, 1000, 2000], "profiles_at": "none",
    })
}

fn with(mut request: Value, member: &str, value: Value) -> Value {
    request[member] = value;
    request
}

fn last(column: &[f64]) -> f64 {
    column[column.len() - 1]
}

/// Where the wear coefficient has a step, the run goes on as if time ran faster.
#[test]
fn a_step_of_the_wear_coefficient_is_a_change_of_the_time_scale() {
    for base in [sliding_cylinder(), steel_ball()] {
        let k = 1.5e-14;
        let step =
            json!({"coefficient": {"over": "cycles", "at": [500, 500], "values": [k, 3.0 * k]}});
        let stepped = with(with(base.clone(), "wear", step), "cycles", json!([500, 2000]));
        let stepped = with(stepped, "model", json!({"method": "exact"}));
        let joined =
            with(with(base, "wear", json!({"coefficient": k})), "cycles", json!([500, 5000]));
        let joined = with(joined, "model", json!({"method": "exact"}));
        let (stepped, joined) = (outcome(&stepped), outcome(&joined));
        for row in [1, 2] {
            for (a, b, digits) in [
                (&stepped.history.wear_volume, &joined.history.wear_volume, 1e-3),
                (&stepped.history.wear_depth, &joined.history.wear_depth, 1e-3),
                (&stepped.history.contact_radius, &joined.history.contact_radius, 5e-3),
            ] {
                assert!((a[row] / b[row] - 1.0).abs() < digits, "{row}: {} {}", a[row], b[row]);
            }
        }
    }
}

/// With the coefficient of friction m times as large, the same amplitude is one of Δ/m, whose wear is m times as fast.
#[test]
fn a_step_of_the_friction_is_a_block_of_another_amplitude() {
    let (delta, m, step) = (0.9, 1.5, 1.0);
    let contact = Contact::new(Shape::power(2.0), delta).expect("a limit");
    let track = Track::through(Over::Time, vec![step, step], vec![1.0, m]);
    let course = Course { friction: Some(track), wear: None };
    let changing = Contact { course: Some(Arc::new(course)), ..contact.clone() };
    let held = depth_and_amplitude(delta);
    let blocks = [Block::new(delta, step), Block::new(delta / m, 1e9)];
    let block = Control { normal: Normal::Depth, blocks: blocks.into() };
    let mut changing = March::new(exact_problem(&changing, &held), 3e-4, 9.0).expect("fits");
    let mut blocks = March::new(exact_problem(&contact, &block), 3e-4, 9.0).expect("fits");
    for time in [0.5, 1.0, 2.0, 5.0] {
        let later = step + m * (time - step);
        while changing.advance(time) {}
        while blocks.advance(if time > step { later } else { time }) {}
        let found = changing.at(time).worn;
        let known = blocks.at(if time > step { later } else { time }).worn;
        let error = (found.volume / known.volume - 1.0).abs();
        assert!(error < 1e-3, "{time}: {error}");
        assert!((found.threshold - known.threshold).abs() < 1e-12, "{time}");
    }
}

#[test]
fn in_gross_slip_the_energy_of_a_linear_friction_has_a_closed_form() {
    for over in ["cycles", "dissipated_energy"] {
        let friction = |end: f64| json!({"over": over, "at": [0, end], "values": [0.4, 0.8]});
        let (force, stroke) = (185.0, 1e-4);
        // W = 4μFU but for the slip of the springs, which is 0.02 % of the stroke.
        let end = if over == "cycles" { 2000.0 } else { 100.0 };
        let found = outcome(&with(sliding_cylinder(), "friction", friction(end)));
        let per_friction = 4.0 * force * stroke;
        for (row, n) in [100.0_f64, 1000.0, 2000.0].into_iter().enumerate() {
            let slope = 0.4 / end;
            let known = if over == "cycles" {
                per_friction * n * (0.4 + 0.5 * slope * n)
            } else {
                // dE/dN = 4FU (μ₀ + slope E)
                let before = libm::log(2.0) / (per_friction * slope);
                let grown = 0.4 / slope * libm::expm1(per_friction * slope * n.min(before));
                grown + per_friction * 0.8 * (n - before).max(0.0)
            };
            let energy = found.history.dissipated_energy[row + 1];
            assert!((energy / known - 1.0).abs() < 5e-4, "{over} {n}: {energy} {known}");
        }
        let mismatch = found.accuracy.energy_mismatch.expect("wear");
        assert!(mismatch.abs() < 1e-3, "{over}: {mismatch}");
    }
}

#[test]
fn a_run_ends_when_the_friction_falls_below_the_held_force() {
    let run_in = json!({"run_in": {"cycles": 1000, "from": 0.9, "to": 0.3}});
    let held = json!({"tangential_force": "9 N/mm"});
    let found = outcome(&with(with(sliding_cylinder(), "friction", run_in), "motion", held));
    let event = found.events.last().expect("an event");
    assert_eq!(event.kind, EventKind::GrossSlip);
    // μ = 9/18.5 is reached at this cycle.
    let known = 1000.0 * (0.9 - 9.0 / 18.5) / 0.6;
    assert!((event.cycles / known - 1.0).abs() < 1e-3, "{}", event.cycles);
    assert!((last(&found.history.cycles) / known - 1.0).abs() < 1e-3);
}

/// With both forces held the wear stops. If friction falls much later, the stick edge moves in, and wear begins again.
#[test]
fn wear_that_has_stopped_begins_again_when_the_friction_falls() {
    let friction = json!({"over": "cycles", "at": [1e9, 1.1e9], "values": [0.8, 0.5]});
    let request = with(sliding_cylinder(), "motion", json!({"tangential_force": "7 N/mm"}));
    let request = with(request, "cycles", json!([1e8, 9e8, 1e9, 3e9]));
    let plain = outcome(&with(request.clone(), "friction", json!(0.8)));
    let limit = plain.limit.expect("a limiting state").wear_volume;
    assert!((last(&plain.history.wear_volume) / limit - 1.0).abs() < 1e-3);
    let volumes = outcome(&with(request, "friction", friction)).history.wear_volume;
    assert!((volumes[2] / limit - 1.0).abs() < 1e-2, "{volumes:?} {limit}");
    assert!(volumes[4] > 1.5 * limit, "{volumes:?} {limit}");
}

/// While the wear is small, the volume is the sum over the moments of a changing friction. A step must not be so long that
/// it misses how the slip in the ring changes.
#[test]
fn a_friction_that_rises_before_the_contact_wears_gives_the_sum_over_its_moments() {
    let request = with(sliding_cylinder(), "wear", json!({"coefficient": 1e-16}));
    let request = with(request, "motion", json!({"tangential_force": "3 N/mm"}));
    let run_in = json!({"run_in": {"cycles": 1000, "from": 0.2, "to": 0.8}});
    let rising = with(with(request.clone(), "friction", run_in), "cycles", json!([1000]));
    let moments = (0..40).map(|moment| {
        let friction = json!(0.2 + 0.6 * (f64::from(moment) + 0.5) / 40.0);
        let constant = with(with(request.clone(), "friction", friction), "cycles", json!([25]));
        last(&outcome(&constant).history.wear_volume)
    });
    let (found, sum) = (last(&outcome(&rising).history.wear_volume), moments.sum::<f64>());
    assert!((found / sum - 1.0).abs() < 3e-3, "{found:e} {sum:e}");
}

/// N = h/(4 k max(p·s)), where max(p·s) is p₀ (2/3) (s₀ + b)^{3/2}/√(3b) for a slip s₀ + b x²/a² with s₀ < 2b, and
/// p₀ s₀ otherwise.
#[test]
fn a_thin_layer_is_worn_through_where_pressure_times_slip_is_largest() {
    let ball = with(steel_ball(), "model", json!({"method": "exact"}));
    for (base, is_line) in [(sliding_cylinder(), true), (ball, false)] {
        for times in [1.3_f64, 12.0, 60.0] {
            let (_, probe, _) = scenario::prepare(base.clone(), "").expect("a scenario");
            let h = 0.004 * probe.scales.indentation_depth;
            let k = 1e-14;
            let layer = json!({"thickness": h, "coefficient": k});
            let bodies = json!([{"coefficient": 0}, {"layers": [layer], "coefficient": 2.0 * k}]);
            let request = with(base.clone(), "wear", json!({"bodies": bodies}));
            let (amplitude, s0, b) = if is_line {
                let unit = probe.scales.friction * probe.scales.indentation_depth;
                let stroke = times.max(20.0) * unit;
                (json!({"sliding_amplitude": stroke}), stroke, unit)
            } else {
                let gross = probe.gross_slip_amplitude();
                (json!({"amplitude": times * gross}), (times - 1.0) * gross, 0.5 * gross)
            };
            let request = with(request, "motion", amplitude);
            let unworn = outcome(&with(request.clone(), "cycles", json!([1e-3]))).unworn;
            let most = if s0 < 2.0 * b {
                2.0 / 3.0 * ((s0 + b) * (s0 + b) * (s0 + b) / (3.0 * b)).sqrt()
            } else {
                s0
            };
            let known = h / (4.0 * k * unworn.peak_pressure * most);
            let found = outcome(&with(request, "cycles", json!([0.5 * known, 3.0 * known])));
            let event = found.events.first().expect("an event");
            assert_eq!(event.kind, EventKind::LayerWornThrough);
            let layer = event.layer.expect("a layer");
            assert_eq!((layer.body, layer.layer), (1, 0));
            let error = (event.cycles / known - 1.0).abs();
            assert!(error < 0.01, "{is_line} {times}: {} {known}", event.cycles);
            let radius = if s0 < 2.0 * b { ((2.0 * b - s0) / (3.0 * b)).sqrt() } else { 0.0 };
            let apart = layer.radius / probe.scales.contact_radius - radius;
            assert!(apart.abs() < 0.05, "{is_line} {times}: {apart}");
            // The first body does not wear, so the second one loses everything.
            let [first, second] = &found.bodies;
            let of = |column: &Option<Vec<f64>>| last(column.as_ref().expect("layers"));
            assert_eq!((of(&first.wear_depth), of(&first.wear_volume)), (0.0, 0.0));
            assert_eq!(of(&second.wear_depth), last(&found.history.wear_depth));
        }
    }
}

#[test]
fn layers_of_equal_coefficients_are_one() {
    let layer = |thickness: &str, coefficient: f64| json!({"thickness": thickness, "coefficient": coefficient});
    let canonical = |bodies: Value| {
        let request = with(sliding_cylinder(), "wear", json!({"bodies": bodies}));
        json!(scenario::check(&request, "").expect("a scenario").0)
    };
    let bodies =
        |layers: Value| json!([{"coefficient": 1e-14}, {"layers": layers, "coefficient": 3e-14}]);
    let one = canonical(bodies(json!([layer("0.3 um", 2e-14)])));
    let two = canonical(bodies(json!([layer("0.1 um", 2e-14), layer("0.2 um", 2e-14)])));
    let below = canonical(bodies(json!([layer("0.3 um", 2e-14), layer("9 um", 3e-14)])));
    assert_eq!((&one, &one), (&two, &below));
    let plain = canonical(bodies(json!([layer("0.3 um", 3e-14)])));
    assert_eq!(plain["wear"], json!({"coefficient": 4e-14, "share": 0.25}));
}

#[test]
fn the_energy_determines_the_volume_of_the_dose() {
    let bodies = json!([{"coefficient": 5e-15},
        {"layers": [{"thickness": "0.02 um", "coefficient": 1e-14},
                    {"thickness": "0.2 um", "coefficient": 8e-14}], "coefficient": 2e-14}]);
    for base in [sliding_cylinder(), with(steel_ball(), "model", json!({"method": "exact"}))] {
        let request = with(base, "wear", json!({"bodies": bodies}));
        let found = outcome(&with(request, "cycles", json!([1e3, 1e4, 1e5])));
        let mismatch = found.accuracy.energy_mismatch.expect("wear");
        assert!(mismatch.abs() < 3e-3, "{mismatch}");
        let worn: Vec<_> =
            found.events.iter().filter_map(|event| event.layer.map(|it| it.layer)).collect();
        assert!(worn.is_sorted() && !worn.is_empty(), "{worn:?}");
    }
}

fn kinds(request: &Value) -> Vec<String> {
    let (scenario, _) = scenario::check(request, "").expect("a valid scenario");
    let case = scenario.case().expect("a contact");
    let before = scenario.warnings(&case);
    let after = Simulation::of(&scenario).expect("a contact").run().warnings;
    before.into_iter().chain(after).map(|warning| warning.kind.to_string()).collect()
}

#[test]
fn limits_of_validity_hold_for_the_largest_coefficients_of_a_run() {
    let fast = "fast_wear".to_owned();
    let wear = |most: f64| {
        let table = json!({"over": "cycles", "at": [0, 10], "values": [2e-14, most]});
        let slow = with(sliding_cylinder(), "motion", json!({"sliding_amplitude": "10 um"}));
        with(slow, "wear", json!({"coefficient": table}))
    };
    assert!(!kinds(&wear(3e-14)).contains(&fast));
    assert!(kinds(&with(wear(2e-11), "cycles", json!([1]))).contains(&fast));
    let layer = json!([{"thickness": "1 um", "coefficient": 2e-11}]);
    let bodies = json!([{"coefficient": 1e-14}, {"layers": layer, "coefficient": 1e-14}]);
    let coated = with(sliding_cylinder(), "wear", json!({"bodies": bodies}));
    assert!(kinds(&with(coated, "cycles", json!([1]))).contains(&fast));

    // 1.5 µm is more than 20 times μh₀ at cycle 0, but not later.
    let short = with(sliding_cylinder(), "motion", json!({"sliding_amplitude": "1.5 um"}));
    assert!(scenario::check(&short, "").is_ok());
    let rising = json!({"run_in": {"cycles": 100, "from": 0.6, "to": 0.9}});
    let faults = scenario::check(&with(short, "friction", rising), "").expect_err("too short");
    assert_eq!(faults.0[0].pointer, "/motion/sliding_amplitude");
}

#[test]
fn a_contact_that_reaches_the_points_of_its_reference_has_a_warning() {
    let motion = |distance: f64| json!({"amplitude": "20 um", "reference_distance": distance});
    let request = |distance: f64| with(sliding_cylinder(), "motion", motion(distance));
    let reached = "reference_reached".to_owned();
    let half_width = outcome(&request(1e-3)).scales.contact_radius;
    assert!(kinds(&request(1.2 * half_width)).contains(&reached));
    assert!(!kinds(&request(1e-3)).contains(&reached));
    let faults = scenario::check(&request(half_width), "").expect_err("too near");
    assert_eq!(faults.0[0].pointer, "/motion/reference_distance");
}

#[test]
fn a_stick_ratio_that_a_line_contact_cannot_have_is_refused_with_the_possible_ones() {
    let punch = json!({"shape": "punch", "flat_half_width": "0.1 mm", "edge_radius": "3 mm", "length": "10 mm"});
    let cylinder = sliding_cylinder()["profile"].clone();
    for (profile, ratio) in [(&punch, 0.4), (&cylinder, 1e-9)] {
        let request = with(sliding_cylinder(), "profile", profile.clone());
        let request = with(request, "motion", json!({"stick_ratio": ratio}));
        let faults = scenario::check(&request, "").expect_err("no such contact").0;
        assert_eq!(faults[0].pointer, "/motion/stick_ratio");
        assert!(faults[0].detail.contains("is not above"), "{}", faults[0].detail);
    }
}

/// With both forces held, the core that sticks at the smallest friction never wears, so the scar has a limit.
#[test]
fn a_core_that_always_sticks_limits_the_scar() {
    let radii: Vec<f64> = (0..200).map(|i| 3.914e-4 * f64::from(i) / 199.0).collect();
    let heights: Vec<f64> = radii.iter().map(|r| r * r / 0.02).collect();
    let falling = json!({"over": "cycles", "at": [1e4, 2e4], "values": [0.8, 0.4]});
    let ball = json!({
        "profile": {"shape": "paraboloid", "radius": 0.01}, "moduli": {"normal": 1e11, "tangential": 8.2e10},
        "friction": falling, "wear": {"coefficient": 3e-14}, "load": {"normal_force": 100},
        "motion": {"tangential_force": 30}, "cycles": [1e5, 1e12], "profiles_at": "none",
    });
    let found = outcome(&ball);
    let table = json!({"shape": "table", "radius": radii, "height": heights});
    let measured = outcome(&with(ball, "profile", table));
    let [volume, same] = [&found, &measured].map(|run| last(&run.history.wear_volume));
    assert!((same / volume - 1.0).abs() < 1e-6, "{volume} {same}");
    // F − Q/μ = (4/3)·E*·c³/R at the smallest friction.
    let core = libm::cbrt(0.75 * (100.0 - 30.0 / 0.4) * 0.01 / 1e11);
    let stick = last(&found.history.stick_radius);
    assert!((stick / core - 1.0).abs() < 1e-3, "{stick} {core}");
}

/// What a body has worn over the length of an earlier amplitude stays as it is.
#[test]
fn each_body_wears_over_the_length_that_is_swept_on_it_at_the_time() {
    let share = 0.4;
    let run = |amplitudes: [&str; 2], cycles: Vec<u32>| {
        let [first, second] = amplitudes;
        outcome(&json!({
            "profile": {"shape": "paraboloid", "radius": "10 mm"},
            "moduli": {"normal": "100 GPa", "tangential": "82 GPa"}, "friction": 0.6,
            "wear": {"coefficient": 3e-14, "share": share}, "load": {"normal_force": "100 N"},
            "motion": {"blocks": [{"amplitude": first, "cycles": 5000}, {"amplitude": second, "cycles": 20_000}]},
            "cycles": cycles, "profiles_at": "none",
        }))
    };
    let depths = |outcome: &Outcome| {
        [0, 1].map(|body| outcome.bodies[body].wear_depth.clone().expect("a share"))
    };
    let dense = || (1..=250).map(|step| 100 * step).collect();
    for amplitudes in [["30 um", "5 um"], ["5 um", "30 um"]] {
        let (many, one) =
            (depths(&run(amplitudes, dense())), depths(&run(amplitudes, vec![25_000])));
        for body in [0, 1] {
            assert!(many[body].windows(2).all(|pair| pair[0] <= pair[1]), "{many:?}");
            let (end, known) = (last(&many[body]), last(&one[body]));
            assert!((end / known - 1.0).abs() < 1e-12, "the output cycles change {known} to {end}");
        }
    }
    // An amplitude that grows: the present half-lengths are the largest ones. Sum the depths row by row.
    let found = run(["5 um", "30 um"], dense());
    let half_length = |body: usize, row: usize| found.bodies[body].scar_half_length[row];
    let mut sums = [0.0; 2];
    for row in 1..=250 {
        let weights = [share / half_length(0, row), (1.0 - share) / half_length(1, row)];
        let added = found.history.wear_depth[row] - found.history.wear_depth[row - 1];
        for body in [0, 1] {
            sums[body] += added * weights[body] / (weights[0] + weights[1]);
        }
    }
    for (sum, depth) in sums.iter().zip(depths(&found)) {
        assert!((sum / last(&depth) - 1.0).abs() < 2e-3, "{sum} {}", last(&depth));
    }
}
