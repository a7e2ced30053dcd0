//! The two laws of wear.

/// A wear law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    /// The wear rate is local pressure times local slip.
    Exact,
    /// The simplified rule (14) with the parameter ξ.
    Simplified(f64),
}
