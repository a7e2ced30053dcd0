//! Integration of wear in time, for all held quantities.

mod curves;
mod edge;
pub mod law;
pub mod march;
pub mod mesh;
pub mod plan;
pub mod prior;
pub mod rkc;
mod run;
pub(crate) mod shares;
pub mod springs;
pub mod wearing;

pub use law::{Law, WearProblem};
pub use march::March;
use mesh::Mesh;
pub use plan::MeshPlan;
use prior::PriorWear;
use run::MeshRun;
use springs::Springs;
use wearing::{Wearing, WornContact};
