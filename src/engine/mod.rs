//! The physics of one run: SI in, dimensionless inside, SI out.

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
pub mod profile;
pub mod quantity;
pub mod record;
pub mod reference;
pub mod request;
pub mod rkc;
pub mod scenario;
pub mod simplified;
pub mod simulation;
pub mod springs;
pub mod transform;
pub mod wearing;
