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

pub use control::{Block, Control, Final, Held, Normal};
pub use course::{Course, Over, Track};
pub use geometry::Geometry;
pub use limit::{DEEPEST, Limit, WIDEST};
pub use profile::Shape;
pub use reference::Series;
pub use row::{SpringRow, Sums, UnwornSums};
pub use truncated::Flank;
pub use unworn::{Contact, Decay, Regime};
