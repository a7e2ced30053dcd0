//! Fretting wear of axisymmetric contacts: the method of dimensionality reduction as a library
//! and as a service.

#[cfg(feature = "serve")]
pub mod api;
pub mod engine;
#[cfg(feature = "serve")]
pub mod job;
#[cfg(feature = "serve")]
pub mod store;
#[cfg(feature = "serve")]
pub mod worker;
