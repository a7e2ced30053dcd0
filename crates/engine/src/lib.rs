//! The physics of one run. Scenarios and results are in SI; the solvers work without dimensions.

pub mod case;
pub mod contact;
pub mod input;
pub mod numeric;
pub mod outcome;
pub mod reference;
pub mod scenario;
pub mod simulation;
pub mod solver;

/// The code in the README, run as a documentation test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
