//! Derivatives of the wear by the independent solver. A test of the service compares its derivatives with this table.

use fretwork_engine::contact::profile::Shape;
use serde_json::Value;

use crate::collocated::{Normal, Pair, Problem, State, Tangential};

/// Derivatives d ln(quantity)/d ln Δ and their errors, for a paraboloid with c = 0.5 at constant depth and amplitude,
/// at Ñ = 1.
const TABLE: &str = include_str!("slopes.json");

/// A quantity of a state.
type Quantity = fn(&State) -> f64;

#[test]
fn the_table_of_slopes_agrees_with_the_independent_solver() {
    const STEP: f64 = 0.04;
    let table: Value = serde_json::from_str(TABLE).expect("a JSON table");
    let run = |factor: f64| {
        let tangential = Tangential::Amplitude(0.75 * factor);
        let problem = Problem { shape: Shape::power(2.0), normal: Normal::Depth, tangential };
        Pair::run(&problem, 240, &[1.0])
    };
    let [below, above] = [run(1.0 - STEP), run(1.0 + STEP)];
    let columns: [(&str, Quantity); 3] = [
        ("wear_volume", |state| state.volume),
        ("normal_force", |state| state.normal_force),
        ("tangential_force", |state| state.tangential_force),
    ];
    let mut wrong = Vec::new();
    for (name, of) in columns {
        let width = libm::log(1.0 + STEP) - libm::log(1.0 - STEP);
        let slope =
            |above: &[State], below: &[State]| libm::log(of(&above[0]) / of(&below[0])) / width;
        let fine = slope(&above.fine.states, &below.fine.states);
        let coarse = slope(&above.coarse.states, &below.coarse.states);
        let [expected, error] =
            ["slope", "error"].map(|part| table[name][part].as_f64().expect(part));
        let apart = 2.0 * (fine - coarse).abs();
        if apart > error || (fine - expected).abs() > 1e-4 {
            wrong.push(format!("{name}: {fine} ± {apart}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}
