//! The models of UM-Bridge in memory.

use std::sync::Arc;

use quick_cache::Weighter;
use quick_cache::sync::Cache;

use fretwork_study::{Likelihood, Model};

/// Memory for models, in bytes.
const MEMORY: u64 = 16 << 20;
/// Expected number of models.
const EXPECTED: usize = 256;

/// A model.
#[derive(Debug, Clone)]
pub enum AnyModel {
    /// Outputs of a scenario.
    Wear(Arc<Model>),
    /// The log likelihood of a fit.
    Likelihood(Arc<Likelihood>),
}

/// Models by the texts of their configs. Reading a config takes about as long as a run in closed form, so its model is
/// kept. The cache evicts the least used models.
pub type Models = Cache<String, AnyModel, Size>;

#[derive(Debug, Clone)]
pub struct Size;

impl Weighter<String, AnyModel> for Size {
    fn weight(&self, config: &String, model: &AnyModel) -> u64 {
        let bytes = match model {
            AnyModel::Wear(model) => model.bytes(),
            AnyModel::Likelihood(model) => model.bytes(),
        };
        (config.len() + bytes) as u64
    }
}

/// An empty cache of models.
pub fn empty() -> Models {
    Cache::with_weighter(EXPECTED, MEMORY, Size)
}
