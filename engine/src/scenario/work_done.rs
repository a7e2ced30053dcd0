//! How often this process has parsed a scenario and built a case. Tests use it to show that nothing is derived
//! twice.

use std::sync::atomic::{AtomicU64, Ordering};

/// Scenarios parsed.
pub static PARSES: AtomicU64 = AtomicU64::new(0);
/// Cases built.
pub static CASES: AtomicU64 = AtomicU64::new(0);

pub(super) fn note(counter: &AtomicU64) {
    counter.fetch_add(1, Ordering::Relaxed);
}
