//! Tests of studies as a whole, in one program.

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a failed test may panic, and lines of VERIFICATION.md are printed"
)]

mod fit;
mod noise;
mod outliers;

use fretwork_random::Stream;
use fretwork_study::stats::distribution::Distribution;

/// A number of the standard normal distribution.
fn normal(stream: Stream, index: u64) -> f64 {
    let uniform = (stream.at(index) >> 11) as f64 / (1_u64 << 53) as f64;
    Distribution::normal(0.0, 1.0).unwrap().quantile(uniform + 1e-17)
}
