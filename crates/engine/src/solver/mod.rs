//! How a contact wears: the simplified rule in closed form, and both laws step by step in time.

pub mod closed;
pub mod curves;
pub mod errors;
pub mod events;
mod splits;
pub mod stepped;
