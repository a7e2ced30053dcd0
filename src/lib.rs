//! Fretting wear of axisymmetric contacts: the method of dimensionality reduction as a library
//! and as a service.

pub mod cli;
mod config;
pub mod http;
pub mod service;
mod telemetry;

/// The code in the README, run as a documentation test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
