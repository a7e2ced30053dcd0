//! Stored results: how they are kept, what is known about them, and how users find them.

pub(crate) mod library;
pub(crate) mod notes;
pub(crate) mod page;
mod range;
pub(crate) mod search;
pub(crate) mod storing;
