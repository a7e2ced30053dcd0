//! Answers made from results.

pub mod listed;
pub mod representation;
pub mod stored;
pub mod text;
