//! Tests of the engine as a whole, in one binary.

#![expect(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::float_cmp,
    clippy::panic,
    reason = "tests use other numerical tools than the engine, and a failed test may panic"
)]

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
