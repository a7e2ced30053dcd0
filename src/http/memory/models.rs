//! The models of UM-Bridge in memory.

use std::sync::Arc;

use quick_cache::Weighter;
use quick_cache::sync::Cache;

use fretwork_study::Model;

/// Memory for models, in bytes.
const MEMORY: u64 = 16 << 20;
/// Expected number of models.
const EXPECTED: usize = 256;

/// Models by the texts of their configs. To read a config takes about as long as a run in closed form.
#[derive(Debug)]
pub struct Models(Cache<String, Arc<Model>, Size>);

#[derive(Debug, Clone)]
struct Size;

impl Weighter<String, Arc<Model>> for Size {
    fn weight(&self, config: &String, model: &Arc<Model>) -> u64 {
        (config.len() + model.bytes()) as u64
    }
}

impl Default for Models {
    fn default() -> Self {
        Self(Cache::with_weighter(EXPECTED, MEMORY, Size))
    }
}

impl Models {
    /// The model of a config, if it is in memory.
    pub fn get(&self, config: &str) -> Option<Arc<Model>> {
        self.0.get(config)
    }

    /// Keeps a model. The least used ones are forgotten.
    pub fn keep(&self, config: String, model: Arc<Model>) {
        self.0.insert(config, model);
    }
}
