//! Compares the exact method with converged reference runs and with the limiting state, and checks
//! its consistency.

use std::f64::consts::PI;

use fretwork_engine::contact::control::{Block, Control, Held, Normal};
use fretwork_engine::contact::profile::Shape;
use fretwork_engine::contact::row::UnwornSums;
use fretwork_engine::contact::unworn::Contact;
use fretwork_engine::outcome::Outcome;
use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use fretwork_engine::solver::events::EventKind;
use fretwork_engine::solver::stepped::march::{March, MarchState};
use serde_json::{Value, json};

use crate::engine::steel_ball;
use crate::{depth_and_amplitude, exact_problem};

fn contact(exponent: f64, c: f64) -> Contact {
    let shape = Shape::power(exponent);
    Contact::sticking(shape, c).expect("a limit")
}

/// A run at constant depth and amplitude.
fn exact(contact: &Contact, tolerance: f64, last: f64) -> March {
    March::new(exact_problem(contact, &depth_and_amplitude(contact.threshold)), tolerance, last)
        .expect("a scar that fits")
}

fn with_cells(contact: &Contact, cells: usize, tolerance: f64, last: f64) -> March {
    March::with_cells(
        exact_problem(contact, &depth_and_amplitude(contact.threshold)),
        cells,
        tolerance,
        last,
    )
    .expect("a scar that fits")
}

fn at(run: &mut March, time: f64) -> MarchState {
    while run.advance(time) {}
    run.at(time)
}

#[test]
fn the_volume_converges_with_second_order_in_the_number_of_cells() {
    for (exponent, c) in [(2.0, 0.5), (1.0, 0.21), (4.0, 0.7)] {
        let volume = |cells: usize| {
            // The time steps are so small that only the error of the mesh remains.
            at(&mut with_cells(&contact(exponent, c), cells, 1e-5, 2.0), 2.0).worn.volume
        };
        let finest = volume(320);
        let (coarse, middle) = ((volume(64) - finest).abs(), (volume(128) - finest).abs());
        let order = (coarse / middle).log2();
        assert!(order > 1.7, "order {order} at n = {exponent}: {coarse} {middle}");
    }
}

#[test]
fn the_exact_method_reaches_the_limiting_state_after_many_cycles() {
    for c in [1e-5, 1e-4, 1e-3, 0.05, 0.5, 0.9, 0.999] {
        let contact = contact(2.0, c);
        let state = at(&mut exact(&contact, 3e-3, 1e9), 1e9).worn;
        assert!((state.volume / contact.limit.volume - 1.0).abs() < 2e-3, "{c}");
        assert!((state.deepest / contact.limit.depth - 1.0).abs() < 1e-2, "{c}");
        assert!((state.contact_radius / contact.limit.radius - 1.0).abs() < 5e-3, "{c}");
    }
}

/// Compares the curves of a result with the numbers in its history.
#[test]
fn the_profiles_of_a_result_agree_with_its_history() {
    for (shape, motion) in [
        (json!({"shape": "paraboloid", "radius": "10 mm"}), json!({"stick_ratio": 0.5})),
        (json!({"shape": "cone", "slope_angle": "1 deg"}), json!({"stick_ratio": 0.3})),
        (json!({"shape": "sphere", "radius": "10 mm"}), json!({"stick_ratio": 0.8})),
        (json!({"shape": "paraboloid", "radius": "10 mm"}), json!({"amplitude": "4 um"})),
        (json!({"shape": "cone", "slope_angle": "1 deg"}), json!({"amplitude": "9 um"})),
    ] {
        let mut request = steel_ball();
        request["profile"] = shape;
        request["motion"] = motion;
        request["cycles"] = json!({"normalized": [0.25, 0.5, 2]});
        request["model"] = json!({"method": "exact", "points": 1024, "tolerance": 1e-3});
        let (scenario, _) = scenario::check(&request, "").expect("valid");
        let outcome = Simulation::of(&scenario).expect("a contact").run();
        let profiles = outcome.profiles.expect("profiles");
        let radius = &profiles.radius;
        let over = |values: &[f64]| -> f64 {
            (1..radius.len())
                .map(|i| {
                    let finite = |x: f64| if x.is_finite() { x } else { 0.0 };
                    let low = finite(values[i - 1]) * radius[i - 1];
                    PI * (low + finite(values[i]) * radius[i]) * (radius[i] - radius[i - 1])
                })
                .sum()
        };
        for i in 1..4 {
            let volume = over(&profiles.wear[i]) / outcome.history.wear_volume[i];
            assert!((volume - 1.0).abs() < 3e-3, "volume {volume} in {request}");
            let force = over(&profiles.pressure[i]) / outcome.history.normal_force[i];
            assert!((force - 1.0).abs() < 1.5e-2, "force {force} in {request}");
            // Slip starts at the stick edge. The image equals d at the contact radius.
            let slip = &profiles.slip[i];
            let edge = outcome.history.stick_radius[i];
            for (r, s) in radius.iter().zip(slip) {
                let inside = *r <= edge && edge > 0.0;
                assert!(if inside { *s == 0.0 } else { *s >= 0.0 }, "slip {s} at {r}");
            }
            assert!(
                slip.iter().all(|s| *s <= outcome.unworn.amplitude),
                "the slip exceeds the amplitude U"
            );
            assert!(edge > 0.0 || slip[0] > 0.0, "in gross slip the axis slips too");
            let edge = radius.partition_point(|r| *r < outcome.history.contact_radius[i]);
            let depth = outcome.history.indentation_depth[i];
            let (inside, outside) = profiles.image[i].split_at(edge);
            assert!(inside.iter().all(|g| *g <= depth) && inside[edge - 8] > 0.95 * depth);
            assert!(
                outside.iter().all(|g| *g >= depth),
                "no spring outside the contact is compressed"
            );
        }
        let mismatch = outcome.accuracy.energy_mismatch.expect("wear");
        assert!(mismatch.abs() < 1e-3, "energy mismatch {mismatch} in {request}");
        assert!(outcome.accuracy.numerical_error.expect("an error") < 5e-3);
    }
}

/// A pseudo-random scenario: held quantities, shape, stick ratio and duration vary with `i`.
/// Multiples of irrational numbers fill the parameter space evenly.
fn any_problem(i: u32) -> (Contact, Control, f64) {
    let part = |factor: f64| (f64::from(i) * factor.sqrt()).fract();
    let shape = match i % 4 {
        0 => Shape::power(2.0),
        1 => Shape::power(1.0),
        2 => Shape::power(1.0 + 11.0 * part(2.0)),
        _ => Shape::sphere(2.0 + 100.0 * part(2.0)),
    };
    let stick = 0.02 + 0.96 * part(3.0);
    let mode = i / 4 % 7;
    // At a constant tangential force the contact must not start in gross slip.
    let gross = part(5.0) < 0.2 && mode != 1 && mode != 3;
    let threshold = if gross { 1.0 + 3.0 * stick } else { 1.0 - shape.image(stick) };
    let contact = Contact::new(shape, threshold).expect("a limit");
    let force = UnwornSums::of(&contact, None).tangential;
    let compliance = 0.1 + 2.0 * part(11.0);
    let amplitude = threshold + 2.0 * compliance * force;
    let rig = Held::Rig { amplitude, compliance };
    let (normal, held) = match mode {
        0 => (Normal::Depth, Held::Threshold),
        1 => (Normal::Force, Held::Force(force)),
        2 => (Normal::Force, Held::Threshold),
        3 => (Normal::Depth, Held::Force(force)),
        4 => (Normal::Depth, rig),
        5 => (Normal::Force, rig),
        _ if i.is_multiple_of(2) => (Normal::Depth, Held::Threshold),
        _ => (Normal::Force, Held::Threshold),
    };
    let mut control = Control::constant(normal, held, threshold);
    if mode == 6 {
        let block = |share: f64, end: f64| Block::new(share * threshold, end);
        control.blocks = [block(1.0, 0.7), block(0.6, 2.0), block(1.2, 1e9)].into();
    }
    (contact, control, 10_f64.powf(-2.0 + 3.5 * part(7.0)))
}

/// Checks the statements of the module and of docs/accuracy.md about the error and its estimate, over all
/// held quantities.
#[test]
fn the_error_estimate_covers_95_percent_of_true_errors_and_rarely_exceeds_them_tenfold() {
    const SCENARIOS: u32 = 420;
    let (mut covered, mut tenfold, mut errors) = (0, 0, Vec::new());
    for i in 1..=SCENARIOS {
        let (contact, control, last) = any_problem(i);
        let history = |tolerance: f64| -> Vec<(f64, f64)> {
            let mut run = March::new(exact_problem(&contact, &control), tolerance, last)
                .expect("a scar that fits");
            let mut found = Vec::new();
            for share in [0.05, 0.15, 0.3, 0.5, 0.75, 1.0] {
                while run.advance(share * last) {}
                let end = run.ended().unwrap_or(last).min(share * last);
                let state = run.at(end);
                found.push((state.worn.volume, state.errors.volume));
            }
            found
        };
        let (found, reference) = (history(3e-3), history(5e-4));
        // A result states the largest estimate over its history. It states no estimate if there is
        // no wear before gross slip.
        let pairs = found.iter().zip(&reference).filter(|((volume, _), _)| *volume > 0.0);
        let (mut error, mut stated) = (0.0_f64, 0.0_f64);
        for ((volume, volume_error), (true_volume, _)) in pairs {
            error = error.max((volume / true_volume - 1.0).abs());
            stated = stated.max(*volume_error);
        }
        covered += u32::from(error <= stated);
        tenfold += u32::from(stated > 10.0 * error && error > 0.0);
        errors.push(error);
    }
    errors.sort_by(f64::total_cmp);
    let (median, most) = (errors[errors.len() / 2], errors[errors.len() * 95 / 100]);
    println!("covered {covered}, tenfold {tenfold}, median {median:.1e}, 95 of 100 {most:.1e}");
    assert!(covered >= SCENARIOS * 95 / 100, "covers {covered} of {SCENARIOS}");
    assert!(tenfold <= SCENARIOS / 10, "exceeds tenfold in {tenfold} of {SCENARIOS}");
    assert!(median < 6e-4 && most < 6e-3, "median {median}, 95 of 100 within {most}");
}

#[test]
fn splitting_an_exact_run_into_steps_changes_no_digit() {
    let mut request = steel_ball();
    request["model"] = json!({"method": "exact", "tolerance": 1e-4});
    let (scenario, _) = scenario::check(&request, "").expect("valid");
    let whole = Simulation::of(&scenario).expect("a contact").run();
    let mut pieces = Simulation::of(&scenario).expect("a contact");
    let mut shares = vec![0.0];
    let outcome = loop {
        match pieces.step() {
            fretwork_engine::simulation::Advance::Working(share) => shares.push(share),
            fretwork_engine::simulation::Advance::Done(outcome) => break *outcome,
        }
    };
    assert_eq!(outcome, whole);
    assert!(shares.len() > 2, "the run must take several steps");
    assert!(shares.windows(2).all(|pair| pair[0] <= pair[1] && pair[1] < 1.0), "{shares:?}");
}

/// The history contains the end of the run and all earlier output cycles, for any sequence of time
/// steps.
#[test]
fn a_run_that_ends_early_keeps_all_output_cycles_before_its_end() {
    let mut ends = 0;
    for tolerance in [3e-3, 1e-3, 3e-4] {
        for force in [49.4, 49.8, 53.0, 57.0, 61.0, 64.6] {
            let mut request = steel_ball();
            request["motion"] = json!({"tangential_force": force});
            request["cycles"] = json!([1000, 2000, 4000, 1e6]);
            request["model"] = json!({"method": "exact", "tolerance": tolerance});
            let (scenario, _) = scenario::check(&request, "").expect("valid");
            let outcome = Simulation::of(&scenario).expect("a contact").run();
            let cycles = &outcome.history.cycles;
            let Some(end) = outcome.events.iter().find(|event| event.kind == EventKind::GrossSlip)
            else {
                continue;
            };
            ends += 1;
            assert_eq!(cycles.last(), Some(&end.cycles), "{force} {tolerance}");
            let before = [1000.0, 2000.0, 4000.0].iter().filter(|n| **n < end.cycles).count();
            assert_eq!(cycles.len(), before + 2, "{cycles:?}");
        }
    }
    assert!(ends >= 12, "{ends} of 18 end in gross slip");
}

/// The blocks alternate between gross slip, rest and partial slip. Each transition into gross slip
/// is an event, and so is each shakedown.
#[test]
fn each_return_to_gross_slip_is_reported_as_an_event() {
    let mut request = steel_ball();
    let block = |um: f64, cycles: f64| json!({"amplitude": um * 1e-6, "cycles": cycles});
    request["motion"] = json!({"blocks": [
        block(1.0, 1e8), block(4.0, 300.0), block(1.0, 300.0), block(4.0, 300.0), block(0.0, 1e9),
        block(4.0, 300.0), block(4.5, 300.0), block(1.2, 1e8),
    ]});
    request["cycles"] = json!([1e8, 1.2e9]);
    for method in ["exact", "simplified"] {
        request["model"] = json!({"method": method});
        let (scenario, _) = scenario::check(&request, "").expect("valid");
        let outcome = Simulation::of(&scenario).expect("a contact").run();
        let of = |kind: EventKind| -> Vec<f64> {
            outcome.events.iter().filter(|e| e.kind == kind).map(|e| e.cycles).collect()
        };
        // The contact enters gross slip in the second, fourth and sixth block. The seventh block is
        // already in gross slip at its start, so it causes no event.
        let entries = [1e8, 1e8 + 600.0, 1.1e9 + 900.0];
        let found = of(EventKind::GrossSlip);
        assert_eq!(found.len(), entries.len(), "{method}: {:?}", outcome.events);
        for (found, entry) in found.iter().zip(entries) {
            assert!((found / entry - 1.0).abs() < 1e-9, "{method}: {found} {entry}");
        }
        let shaken = of(EventKind::Shakedown);
        assert!(shaken.first().is_some_and(|first| *first < 1e8), "{:?}", outcome.events);
        assert!(shaken.last().is_some_and(|last| *last > 1.1e9), "{:?}", outcome.events);
    }
}

/// The slip ring of the first block is so narrow that it lies between two nodes. This is not
/// shakedown, and the next block must wear as if it were the first.
#[test]
fn a_first_block_with_almost_no_slip_does_not_change_the_next_block() {
    for method in ["exact", "simplified"] {
        let run = |blocks: Value, cycles: Value| {
            let mut request = steel_ball();
            request["load"]["held"] = json!("force");
            request["motion"] = json!({"blocks": blocks});
            request["cycles"] = cycles;
            request["model"] = json!({"method": method});
            let (scenario, _) = scenario::check(&request, "").expect("valid");
            Simulation::of(&scenario).expect("a contact").run()
        };
        let slips = json!({"amplitude": 6e-6, "cycles": 20_000});
        let weak = json!({"amplitude": 1e-9, "cycles": 1});
        let alone = run(json!([slips]), json!([20_000]));
        let after = run(json!([weak, slips]), json!([1, 20_001]));
        assert!(
            after.events.iter().all(|event| event.kind != EventKind::Shakedown),
            "{:?}",
            after.events
        );
        for column in [
            |outcome: &Outcome| *outcome.history.wear_volume.last().expect("one"),
            |outcome: &Outcome| *outcome.history.indentation_depth.last().expect("one"),
        ] {
            let (alone, after) = (column(&alone), column(&after));
            assert!((after / alone - 1.0).abs() < 0.01, "{method}: {after} {alone}");
        }
    }
}

/// A blunt tip on a rig just above the gross-slip threshold. Rounding errors decide whether the springs stick. The
/// reported stick radius must be finite and small.
#[test]
fn a_blunt_tip_near_the_gross_slip_threshold_has_a_valid_stick_radius() {
    let request = json!({
        "profile": {"shape": "power", "exponent": 6.615_970_556_05, "height": 0.779_669_496_24,
            "at_radius": 0.308_350_253_423},
        "moduli": {"normal": 183_728.031_357, "tangential": 146_982.425_085},
        "friction": 1.515_955_534_44,
        "wear": {"coefficient": 1.750_799_289_7e-16},
        "load": {"indentation_depth": 6.812_769_402_92e-9},
        "motion": {"amplitude": 1.290_981_955_22e-8, "rig_stiffness": 255_512_946_024.0_f64},
        "cycles": [1, 1e5, 1e9],
        "model": {"points": 75},
    });
    let (scenario, _) = scenario::check(&request, "").expect("valid");
    let outcome = Simulation::of(&scenario).expect("a contact").run();
    let stick = &outcome.history.stick_radius;
    // Up to about a₀/100, 1 − y = x⁶·⁶ is of the order of rounding.
    let most = 0.1 * outcome.scales.contact_radius;
    assert!(stick.iter().all(|c| (0.0..most).contains(c)), "{stick:?}");
}

/// Late in a run a core carries almost the whole load, so interpolation of the other springs is
/// inaccurate. The engine recomputes these states, and the requested output cycles must not change
/// later results.
#[test]
fn the_energy_per_cycle_decreases_within_late_time_steps() {
    let run = |cycles: Value| {
        let request = json!({
            "profile": {"shape": "cone", "slope_angle": 0.868_075_200_133},
            "moduli": {"normal": 2_060_717.611_27, "tangential": 1_648_574.089_02},
            "friction": 1.434_211_870_04,
            "wear": {"coefficient": 2.043_408_053_47e-15},
            "load": {"normal_force": 321_303.128_391},
            "motion": {"amplitude": 1.282_349_976_97, "rig_stiffness": 1_434_496.836_61},
            "cycles": cycles,
            "profiles_at": "none",
            "model": {"method": "exact"},
        });
        let (scenario, _) = scenario::check(&request, "").expect("valid");
        Simulation::of(&scenario).expect("a contact").run()
    };
    let often = run(json!({"from": 2e10, "to": 1e12, "count": 60}));
    // Only output cycles before shakedown are compared.
    let energy = &often.history.energy_per_cycle;
    let alive =
        energy.iter().filter(|energy| **energy > 1e-3 * often.history.energy_per_cycle[0]).count();
    let energy = &energy[1..alive];
    assert!(
        energy.len() > 40 && energy.windows(2).all(|pair| pair[1] <= 1.02 * pair[0]),
        "{energy:?}"
    );
    let mismatch = often.accuracy.energy_mismatch.expect("wear");
    assert!(mismatch.abs() < 3e-3, "{mismatch}");
    let once = run(json!([1e12]));
    let last =
        |outcome: &Outcome| outcome.history.wear_volume.last().map(|volume| volume.to_bits());
    assert_eq!(last(&often), last(&once));
}

/// The shape is unknown outside the indenter, so a run ends when the scar reaches its outer edge.
#[test]
fn a_run_ends_when_the_scar_reaches_the_edge_of_the_indenter() {
    let contact = Contact::new(Shape::sphere(2.5), 1.8).expect("a limit");
    let control = Control::constant(Normal::Force, Held::Threshold, contact.threshold);
    let mut run =
        March::new(exact_problem(&contact, &control), 3e-3, 1e3).expect("a scar that fits");
    while run.advance(1e3) {}
    let end = run.ended().expect("an end");
    assert_eq!(run.events().last().map(|event| event.kind), Some(EventKind::RimReached));
    let worn = run.at(end).worn;
    assert!(worn.contact_radius > 2.2 && worn.contact_radius <= 2.5, "{}", worn.contact_radius);
}

/// Late in gross slip the wear is a thousand times the compression of the springs, and rounding
/// must not destroy the pressure. The wear must still balance the dissipated energy.
#[test]
fn the_pressure_stays_accurate_after_long_gross_slip() {
    let contact = Contact::new(Shape::power(2.0), 1.6).expect("a limit");
    let control = Control::constant(Normal::Force, Held::Threshold, contact.threshold);
    for tolerance in [0.02, 3e-3] {
        let mut run = March::new(exact_problem(&contact, &control), tolerance, 1e5)
            .expect("a scar that fits");
        for time in [1e3, 1e4, 1e5] {
            let instant = at(&mut run, time);
            let worn = &instant.worn;
            let mismatch = instant.worn_by_energy / worn.volume - 1.0;
            assert!(mismatch.abs() < 0.1 * tolerance, "{time}: {mismatch}");
            assert_eq!(worn.stick.to_bits(), 0.0_f64.to_bits());
            // A uniform pressure corresponds to springs with y ∝ √(a² − x²).
            let a = worn.contact_radius;
            let most = worn.compressions.iter().copied().fold(0.0, f64::max);
            let even = 4.0 / PI * worn.normal / a;
            assert!((most / even - 1.0).abs() < 0.2, "{time}: {most} {even}");
        }
    }
    assert!(contact.stick == 0.0);
}

/// At constant forces, a small core finally carries the whole load, at a much greater depth than at
/// the start.
#[test]
fn a_contact_with_a_small_core_reaches_its_limiting_state() {
    for (exponent, c) in [(2.0, 0.006), (1.0, 0.03)] {
        let contact = contact(exponent, c);
        let force = UnwornSums::of(&contact, None).tangential;
        let control = Control::constant(Normal::Force, Held::Force(force), contact.threshold);
        let end = control.tends_to(&contact).expect("an end");
        let mut run =
            March::new(exact_problem(&contact, &control), 0.01, 1e6).expect("a scar that fits");
        let worn = at(&mut run, 1e6).worn;
        assert!((worn.volume / end.limit.volume - 1.0).abs() < 0.01, "{exponent} {}", worn.volume);
        assert!((worn.depth / end.depth - 1.0).abs() < 1e-3, "{exponent} {}", worn.depth);
        assert!(end.limit.radius > 10.0);
    }
}

/// A result never reports a decrease of wear. This test measures how much the wear decreases before
/// that correction. A decrease occurs at nodes whose wear rate drops to 0 within a step, mostly
/// where the stick edge passes. It is of the order of the step error.
#[test]
fn wear_decreases_by_less_than_2e_4_before_the_correction() {
    let (mut largest, mut falling) = (0.0_f64, 0);
    for i in 1..=140 {
        let (contact, control, last) = any_problem(i);
        let mut run =
            March::new(exact_problem(&contact, &control), 3e-3, last).expect("a scar that fits");
        let (mut before, mut mesh, mut fall) = (Vec::new(), Vec::new(), 0.0_f64);
        for step in 1..=20 {
            let time = last * f64::from(step) / 20.0;
            while run.advance(time) {}
            let now = run.at(time.min(run.ended().unwrap_or(time))).worn;
            // Another mesh has other nodes and cannot be compared.
            if mesh == now.places {
                let falls = before.iter().zip(&now.wear).map(|(was, is): (&f64, &f64)| was - is);
                fall = falls.fold(fall, f64::max);
            }
            (before, mesh) = (now.wear, now.places);
        }
        largest = largest.max(fall);
        falling += u32::from(fall > 1e-6);
    }
    println!("largest fall {largest:.1e} d₀; more than 1e-6 d₀ in {falling} of 140");
    assert!(largest < 2e-4, "{largest}");
}
