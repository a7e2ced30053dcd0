//! The geometry of a contact: round or line.

pub use crate::request::indenter::Geometry;
