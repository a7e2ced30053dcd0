//! Tests of the engine as a whole, in one binary.

#![expect(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::float_cmp,
    clippy::panic,
    reason = "tests use other numerical tools than the engine, and a failed test may panic"
)]

use fretwork_engine::contact::{Contact, Control, Held, Normal};
use fretwork_engine::solver::stepped::law::{Law, WearProblem};

mod anything;
mod aperture;
mod balances;
mod changes;
mod collocated;
mod doubtful;
mod early_depth;
mod engine;
mod exact;
mod golden;
mod limiting_state;
mod line;
mod literal;
mod loops;
mod plane_elements;
mod reference_solutions;
mod requests;
mod rig;
mod shapes;
mod sharp;
mod slopes;
mod splits;
mod yielding;

/// The held quantities of the paper: indentation depth and amplitude are constant.
fn depth_and_amplitude(threshold: f64) -> Control {
    Control::constant(Normal::Depth, Held::Threshold, threshold)
}

/// The wear problem with the exact law.
fn exact_problem<'a>(contact: &'a Contact, control: &'a Control) -> WearProblem<'a> {
    WearProblem { contact, control, law: Law::Exact }
}
