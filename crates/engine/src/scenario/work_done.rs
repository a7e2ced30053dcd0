//! Counts how often this process has parsed a scenario and built a case. With these numbers, tests
//! check that no work is done twice.

use std::sync::atomic::{AtomicU64, Ordering};

/// Number of parsed scenarios.
pub static PARSES: AtomicU64 = AtomicU64::new(0);
/// Number of cases built.
pub static CASES: AtomicU64 = AtomicU64::new(0);

pub(super) fn note(counter: &AtomicU64) {
    counter.fetch_add(1, Ordering::Relaxed);
}
