//! Answers made from results.

pub mod pieces;
pub mod representation;
pub mod stored;
