//! Tests of the whole, in one binary.

#![expect(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::float_cmp,
    clippy::panic,
    reason = "tests judge the program by other means, and may stop where they stand"
)]

mod engine;
mod literal;
