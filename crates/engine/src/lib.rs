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

pub use case::{Case, Method};
pub use input::{Dimension, Fault, Faults, Given, List, Pointer, Valid, unknown};
pub use numeric::twelve_digits;
pub use outcome::{
    Accuracy, BodyWear, Comparison, Condition, ContactScales, EVENTS, History, LimitState, Loops,
    Outcome, OutcomeEvent, Preview, Profiles, QUANTITIES, ResultUnits, SectionMember, Unworn,
};
pub use scenario::{DEFAULT_TOLERANCE, NUMERICS, SCHEMA, Scenario, Warning};
pub use simulation::{Advance, Simulation};
pub use solver::events::EventKind;

/// The code in the README, run as a documentation test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
