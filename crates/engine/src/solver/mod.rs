//! How a contact wears: the simplified rule in closed form, and both laws step by step in time.

pub mod closed;
pub mod curves;
pub mod errors;
pub mod events;
pub(crate) mod pressures;
mod splits;
pub mod stepped;
