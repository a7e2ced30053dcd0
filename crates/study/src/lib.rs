//! Studies: what is computed from many runs, and the scalars that are taken from each of them. This room has no input or
//! output, no clock and no threads.

mod bootstrap;
mod claimed;
mod evaluation;
mod findings;
mod jacobian;
mod kind;
mod map;
mod member;
mod model;
mod output;
mod points;
mod problem;
mod profile;
mod rows;
mod sensitivity;
mod sweep;
mod vary;

pub mod derivative;
pub mod design;
pub mod distribution;
pub mod indices;
pub mod morris;

pub use bootstrap::{Bootstrap, Estimate};
pub use claimed::Claimed;
pub use evaluation::{Evaluated, Evaluation};
pub use jacobian::{Entry, Jacobian};
pub use kind::{Column, Kind, Study};
pub use member::Member;
pub use model::{Model, Run};
pub use output::{NoValue, Output, OutputName};
pub use points::Points;
pub use problem::{Found, Lack, Problem};
pub use rows::Rows;
