//! Answers made from results, and texts of the program.

pub mod fixed;
pub mod listed;
pub mod representation;
pub mod stored;
pub mod text;
