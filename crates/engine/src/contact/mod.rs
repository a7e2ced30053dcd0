//! Profiles and contact mechanics, in dimensionless form: lengths in contact radii a₀, heights in
//! indentation depths d₀ of the unworn contact.

pub mod control;
pub mod course;
pub(crate) mod doubts;
pub mod geometry;
pub mod hysteresis;
pub mod layers;
pub mod limit;
mod pieces;
pub mod profile;
mod punch;
pub mod record;
pub mod reference;
mod rising;
pub mod row;
mod smoothing;
pub(crate) mod splits;
pub(crate) mod table_shape;
pub mod transform;
mod truncated;
pub mod unworn;
pub mod yielding;
