//! Answers made from results.

pub mod listed;
pub mod pieces;
pub mod representation;
pub mod stored;
