//! The simplified rule in closed form, while depth and amplitude are held.

pub mod simplified;
