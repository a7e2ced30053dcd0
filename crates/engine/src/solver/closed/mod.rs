//! The simplified rule in closed form, while depth and amplitude are held.

pub(crate) mod energy;
pub mod events;
pub mod simplified;
