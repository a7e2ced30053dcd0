//! The models of UM-Bridge in memory.

use std::sync::Arc;

use quick_cache::Weighter;
use quick_cache::sync::Cache;

use fretwork_study::Model;

/// Memory for models, in bytes.
const MEMORY: u64 = 16 << 20;
/// Expected number of models.
const EXPECTED: usize = 256;

/// Models by the texts of their configs. Reading a config takes about as long as a run in closed form, so its model is
/// kept. The cache evicts the least used models.
pub type Models = Cache<String, Arc<Model>, Size>;

#[derive(Debug, Clone)]
pub struct Size;

impl Weighter<String, Arc<Model>> for Size {
    fn weight(&self, config: &String, model: &Arc<Model>) -> u64 {
        (config.len() + model.bytes()) as u64
    }
}

/// An empty cache of models.
pub fn empty() -> Models {
    Cache::with_weighter(EXPECTED, MEMORY, Size)
}
