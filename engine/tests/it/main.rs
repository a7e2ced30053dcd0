//! Tests of the engine as a whole, in one binary.

#![expect(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::float_cmp,
    clippy::panic,
    reason = "tests check the program by other means, and may stop at the first failure"
)]

mod anything;
mod collocated;
mod engine;
mod exact;
mod golden;
mod limiting_state;
mod literal;
mod loops;
mod reference_solutions;
mod shapes;
