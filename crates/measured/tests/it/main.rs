//! Tests of the readers of measurements, in one program.

#![expect(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a failed test may panic"
)]

mod files;
mod loops;
mod trace_kinds;
mod traces;

use fretwork_random::Stream;

/// A uniform random number from 0 to 1.
fn uniform(stream: Stream, place: u64) -> f64 {
    stream.at(place) as f64 / 2f64.powi(64)
}

/// A normal random number, from twelve uniform ones.
fn normal(stream: Stream, place: u64) -> f64 {
    (0..12).map(|at| uniform(stream, 12 * place + at)).sum::<f64>() - 6.0
}
