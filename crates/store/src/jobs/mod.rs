//! Jobs and their runs: submission, claims, cancellation, and what is read about them.

pub(crate) mod ages;
pub(crate) mod cancel;
pub(crate) mod claimed;
pub(crate) mod naming;
pub(crate) mod read;
pub(crate) mod submit;
pub(crate) mod upkeep;
