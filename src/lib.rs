//! Fretting wear of round and line contacts: the method of dimensionality reduction as a library
//! and as a service.

pub mod cli;
mod config;
pub mod http;
pub mod service;
mod telemetry;
