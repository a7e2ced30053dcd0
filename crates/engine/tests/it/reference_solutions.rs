//! Compares the reference solutions with the engine, and both with a table that other programs
//! computed.

use fretwork_engine::contact::limit::Limit;
use fretwork_engine::contact::profile::Shape;
use fretwork_engine::contact::row::SpringRow;
use fretwork_engine::contact::unworn::{Contact, Decay};
use fretwork_engine::reference::{CattaneoMindlin, Hertz, initial_wear_rate, shakedown_limit};
use fretwork_engine::scenario;
use serde_json::{Value, json};

use crate::engine::steel_ball;
use crate::limiting_state::LimitingState;

/// Computes a limiting state from an exponent and a row of the table.
type Solve = fn(f64, &Value) -> Option<LimitingState>;

fn table() -> Value {
    serde_json::from_str(fretwork_engine::reference::TABLE).expect("a JSON table")
}

/// The table is reference.json, which contains closed forms with five digits.
#[test]
fn reference_limiting_states_agree_with_the_table() {
    let table = table();
    let mut rows = 0;
    let number = |row: &Value, name: &str| row[name].as_f64().expect("a number");
    let held: [(&str, Solve); 3] = [
        ("limit_depth_and_amplitude_held", |n, row| {
            Some(LimitingState::depth_and_amplitude_held(n, row["stick_radius"].as_f64()?))
        }),
        ("limit_force_and_tangential_force_held", |n, row| {
            Some(LimitingState::forces_held(n, row["q"].as_f64()?))
        }),
        ("limit_depth_and_tangential_force_held", |n, row| {
            LimitingState::depth_and_tangential_force_held(n, row["q"].as_f64()?)
        }),
    ];
    for (name, solve) in held {
        for row in table[name].as_array().expect(name) {
            let state = solve(number(row, "exponent"), row).expect("a limit");
            for (name, value, tolerance) in [
                ("stick_radius", state.stick_radius, 6e-6),
                ("indentation_depth", state.indentation_depth, 6e-6),
                ("limiting_radius", state.radius, 6e-6),
                ("wear_volume", state.volume, 6e-6),
                ("wear_depth", state.depth, 6e-6),
                ("depth_radius", state.depth_radius, 6e-5),
                ("normal_force_ratio", state.force_ratio, 6e-6),
            ] {
                if let Some(expected) = row[name].as_f64() {
                    assert!((value - expected).abs() < tolerance, "{name} {value} in {row}");
                }
            }
            rows += 1;
        }
    }
    assert_eq!(rows, 21);
}

/// Two independent calculations of the limiting state. The reference solution solves for an angle
/// and uses closed forms. The engine solves for a radius and uses quadrature.
#[test]
fn limiting_states_of_the_engine_agree_with_the_reference_solutions() {
    for n in [1.0, 1.5, 2.0, 2.5, 3.0, 6.0, 11.3] {
        for c in [0.001, 0.01, 0.1, 0.35, 0.7, 0.95, 0.999] {
            let solved = Limit::solve(&Shape::power(n), c).expect("a root");
            let state = LimitingState::depth_and_amplitude_held(n, c);
            let close = |a: f64, b: f64, tolerance: f64, what: &str| {
                assert!((a / b - 1.0).abs() < tolerance, "{what} {a} {b} for n = {n}, c = {c}");
            };
            close(solved.radius, state.radius, 1e-9, "radius");
            close(solved.volume, state.volume, 1e-7, "volume");
            close(solved.depth, state.depth, 1e-9, "depth");
            let off = (solved.depth_radius - state.depth_radius).abs();
            assert!(off < if c < 0.02 { 1e-6 } else { 1e-7 }, "{off} for n = {n}, c = {c}");
            // A contact computes its stick radius from Δ = 1 − cⁿ. For very small cⁿ, rounding
            // makes Δ equal to 1.
            if c.powf(n) > 1e-6 {
                let row = SpringRow::new(&Contact::sticking(Shape::power(n), c).expect("a limit"));
                let force = |decay| row.sums(decay).normal;
                let off = force(Decay::COMPLETE) / force(Decay::UNWORN) - state.force_ratio;
                assert!(off.abs() < 1e-9, "force {off} for n = {n}, c = {c}");
            }
        }
        let solved = Limit::solve(&Shape::power(n), 0.0).expect("a root");
        let state = LimitingState::gross_slip(n);
        assert!((solved.radius / state.radius - 1.0).abs() < 1e-9, "{n}");
        assert!((solved.volume / state.volume - 1.0).abs() < 1e-6, "{n}");
    }
}

#[test]
fn the_reference_wear_rate_agrees_with_the_spring_row() {
    for n in [1.0, 2.0, 2.5, 7.0] {
        for c in [0.01, 0.3, 0.6, 0.9] {
            let contact = Contact::sticking(Shape::power(n), c).expect("a limit");
            let rate =
                2.0 * SpringRow::new(&contact).sums(Decay::UNWORN).energy / contact.threshold;
            assert!((rate / initial_wear_rate(n, c) - 1.0).abs() < 1e-7, "{n} {c}: {rate}");
        }
    }
}

/// VERIFICATION.md compares the other numbers of the unworn contact with the literature.
#[test]
fn the_unworn_contact_in_gross_slip_agrees_with_cattaneo_and_mindlin() {
    let (modulus, tangential, amplitude) = (112.64e9, 92.76e9, 4.5e-6);
    let mut request = steel_ball();
    request.as_object_mut().expect("a request").remove("bodies");
    request["moduli"] = json!({"normal": modulus, "tangential": tangential});
    request["motion"] = json!({"amplitude": amplitude});
    let (scenario, _) = scenario::check(&request, "").expect("valid");
    let found = scenario.preview().expect("a contact").unworn;
    let hertz = Hertz::under(100.0, modulus, 0.01);
    let contact = CattaneoMindlin { hertz, tangential_modulus: tangential, friction: 0.7 };
    let threshold = contact.sliding_displacement();
    for (value, expected) in [
        (found.gross_slip_amplitude, threshold),
        (found.tangential_force, contact.force(amplitude)),
        (found.energy_per_cycle, 4.0 * 70.0 * (amplitude - 0.8 * threshold)),
    ] {
        assert!((value / expected - 1.0).abs() < 1e-9, "{value}, not {expected}");
    }
}

#[test]
fn gross_slip_in_the_table_occurs_only_above_the_shakedown_limit() {
    for row in table()["exact_depth_and_tangential_force_held"].as_array().expect("rows") {
        let limit = shakedown_limit(row["exponent"].as_f64().expect("n"));
        let slips = row.get("gross_slip_at").is_some();
        assert_eq!(row["q"].as_f64().expect("q") > limit, slips, "{row}");
    }
}
