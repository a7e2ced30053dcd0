//! Fretting wear of axisymmetric contacts: the method of dimensionality reduction as a library
//! and as a service.

pub mod cli;
mod config;
pub mod format;
pub mod http;
pub mod job;
pub mod json;
pub mod plot;
pub mod random;
pub mod service;
pub mod store;
pub mod study;
mod telemetry;
pub mod verification;

/// The code in the README, run as a documentation test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
