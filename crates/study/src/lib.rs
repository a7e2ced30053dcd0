//! Studies: results that are computed from many runs, and the scalars that are taken from each run. This crate has no
//! input or output, no clock and no threads.

mod claimed;
mod evaluation;
mod jacobian;
mod kinds;
mod member;
mod model;
mod output;
mod plan;
mod points;
mod problem;
mod profile;
mod rows;
mod run;
mod study;
mod totals;
mod vary;

pub mod stats;

pub use claimed::Claimed;
pub use evaluation::{Evaluated, Evaluation, LONGEST_EVALUATION};
pub use jacobian::{Entry, Jacobian};
pub use kinds::{Likelihood, LikelihoodCall};
pub use member::Member;
pub use model::Model;
pub use output::{NoValue, Output, OutputName};
pub use plan::{Bars, Column, Hints, Kind, Offer, Regions, StudyFigure};
use plan::{Findings, GoesOn, OrRun, Plan, Read, Tried};
pub use points::Points;
use problem::small_members;
pub use problem::{Found, Lack, Problem};
use profile::CommonProfiles;
use rows::NUMBER;
pub use rows::Rows;
use run::Ended;
pub use run::Run;
use study::PointRun;
pub use study::{RUN_MEMORY, Study};
use vary::{Values, Varied};
