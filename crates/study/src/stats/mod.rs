//! Statistics: designs, distributions, indices, intervals, derivatives. These modules do not use JSON.

mod bootstrap;

pub mod derivative;
pub mod design;
pub mod distribution;
pub mod fisher;
pub mod indices;
pub mod least_squares;
pub mod measured;
pub mod morris;
pub mod origin;
pub mod outliers;
pub mod summary;
pub mod trend;

pub use bootstrap::{Bootstrap, Estimate, MAX_BLOCKS};
