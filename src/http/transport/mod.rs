//! Connections: which the server accepts, how their requests and bodies are read, and when it closes them.

pub mod admission;
pub mod body;
pub mod connection;
pub mod drain_body;
pub mod server;
