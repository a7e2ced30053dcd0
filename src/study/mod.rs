//! Studies: what is computed from many runs, and the scalars that are taken from each of them.

mod evaluation;
mod output;

pub use evaluation::{Evaluated, Evaluation};
pub use output::{NoValue, Output, OutputName};
