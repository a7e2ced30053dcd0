//! The simplified rule in closed form, while depth and amplitude are held.

pub mod events;
pub mod simplified;
