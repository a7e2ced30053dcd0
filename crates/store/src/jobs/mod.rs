//! Jobs and their runs: how they are submitted, claimed, canceled and read.

pub(crate) mod ages;
pub(crate) mod cancel;
pub(crate) mod claimed;
pub(crate) mod maintenance;
pub(crate) mod naming;
pub(crate) mod read;
pub(crate) mod submit;
