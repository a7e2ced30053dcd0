//! The physics of one run: SI in, dimensionless inside, SI out.

pub mod case;
pub mod comparison;
pub mod contact;
pub mod control;
pub mod curves;
pub mod fault;
pub mod held;
pub mod hysteresis;
pub mod indenter;
pub mod instants;
pub mod limit;
pub mod march;
pub mod mesh;
pub mod numeric;
pub mod outcome;
pub mod plan;
pub mod profile;
pub mod quantity;
pub mod record;
pub mod reference;
pub mod request;
pub mod rkc;
mod run;
pub mod scenario;
pub mod simplified;
pub mod simulation;
mod smoothing;
pub mod springs;
mod table_shape;
pub mod transform;
mod truncated;
pub mod wearing;

/// The code in the README, run as a documentation test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
