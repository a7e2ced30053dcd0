//! Fretting wear of axisymmetric contacts: the method of dimensionality reduction as a library
//! and as a service.

#[cfg(feature = "serve")]
pub mod api;
pub mod engine;
#[cfg(feature = "serve")]
pub mod job;
pub mod plot;
#[cfg(feature = "serve")]
pub mod store;
pub mod verification;
#[cfg(feature = "serve")]
pub mod worker;

/// The code in the README, run as a documentation test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
