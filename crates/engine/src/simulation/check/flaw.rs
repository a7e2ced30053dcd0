//! Why a result is refused, and how its numbers are compared.

/// Relative difference of two numbers that are equal but for the 12 digits of their JSON.
pub(super) const SAME: f64 = 1e-10;
/// Relative difference of two numbers that are computed in different ways.
pub(super) const NEAR: f64 = 1e-6;

/// Why a result cannot be that of its scenario.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Flaw(String);

/// Returns a flaw, unless the condition holds.
pub(super) fn require(holds: bool, flaw: impl FnOnce() -> String) -> Result<(), Flaw> {
    if holds { Ok(()) } else { Err(Flaw(flaw())) }
}

pub(super) fn within(a: f64, b: f64, error: f64) -> bool {
    (a - b).abs() <= error * a.abs().max(b.abs())
}

pub(super) fn same(a: f64, b: f64) -> bool {
    within(a, b, SAME)
}

/// Compares a missing or present number. `error` is absolute.
pub(super) fn both(a: Option<f64>, b: Option<f64>, error: f64) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => (a - b).abs() <= error,
        (a, b) => a.is_none() && b.is_none(),
    }
}
