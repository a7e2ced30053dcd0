//! The two laws of wear.

/// How a contact wears.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    /// Local pressure times local slip.
    Exact,
    /// The rule (14) with its ξ.
    Simplified(f64),
}
