//! The two wear laws, and the wear problem that a run integrates.

use crate::contact::{Contact, Control};
use crate::input::Xi;

/// The parameter ξ that the paper uses in its examples.
pub const PAPER_XI: f64 = 0.8;

/// The ξ with which the simplified rule fits the exact method, for the stick ratio c/a₀ < 1 of the
/// unworn contact: ξ = √(0.33 + 0.20/(1 − c/a₀)), but at most 1000.
///
/// # Accuracy
/// The two numbers were fitted to runs of the exact method. VERIFICATION.md shows the errors that
/// remain.
pub fn fitted_xi(stick_ratio: f64) -> f64 {
    (0.33 + 0.20 / (1.0 - stick_ratio)).sqrt().min(Xi::RANGE.1)
}

/// A wear law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    /// The wear rate is local pressure times local slip.
    Exact,
    /// The simplified rule (14) with the parameter ξ.
    Simplified(f64),
}

/// The wear problem that a run integrates: a contact, the quantities that are held constant while it wears, and the
/// wear law.
#[derive(Debug, Clone, Copy)]
pub struct WearProblem<'a> {
    /// The unworn contact.
    pub contact: &'a Contact,
    /// The held quantities.
    pub control: &'a Control,
    /// The law of wear.
    pub law: Law,
}
