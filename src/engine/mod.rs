//! The physics of one run: SI in, dimensionless inside, SI out.

pub mod contact;
pub mod exact;
pub mod fault;
pub mod indenter;
pub mod instants;
pub mod limit;
pub mod mesh;
pub mod numeric;
pub mod outcome;
pub mod profile;
pub mod quantity;
pub mod request;
pub mod rkc;
pub mod scenario;
pub mod simplified;
pub mod simulation;
mod smoothing;
mod table_shape;
pub mod transform;
mod truncated;
