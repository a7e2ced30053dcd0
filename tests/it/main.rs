//! Tests of the whole, in one binary.

#![expect(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::float_cmp,
    clippy::panic,
    reason = "tests judge the program by other means, and may stop where they stand"
)]
#![cfg_attr(feature = "serve", expect(clippy::unwrap_used, reason = "as above"))]

#[cfg(feature = "serve")]
mod access;
mod anything;
#[cfg(feature = "serve")]
mod api;
mod collocated;
mod engine;
mod exact;
#[cfg(feature = "serve")]
mod faults;
mod figures;
#[cfg(feature = "serve")]
mod forms;
#[cfg(feature = "serve")]
mod keeping;
#[cfg(feature = "serve")]
mod kill;
#[cfg(feature = "serve")]
mod library;
mod literal;
mod loops;
#[cfg(feature = "serve")]
mod moving;
#[cfg(feature = "serve")]
mod openapi;
#[cfg(feature = "serve")]
mod plots;
#[cfg(feature = "serve")]
mod program;
#[cfg(feature = "serve")]
mod reference;
mod reference_solutions;
#[cfg(feature = "serve")]
mod refusals;
#[cfg(feature = "serve")]
mod rooms;
mod schema;
#[cfg(feature = "serve")]
mod server;
mod shapes;
#[cfg(feature = "serve")]
mod store;
#[cfg(feature = "serve")]
mod team;
mod verification;
#[cfg(feature = "serve")]
mod worker;
