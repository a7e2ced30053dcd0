//! Studies: what is computed from many runs, and the scalars that are taken from each of them.

mod output;

pub use output::{NoValue, Output, OutputName};
