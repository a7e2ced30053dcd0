//! What the program can do with jobs: submit, wait, evaluate, cancel, import. HTTP and the command line call this
//! module. They call the store directly for operations to which this module adds nothing, such as finding a result.

mod evaluate;
mod import;
mod limits;
mod places;
mod short;
mod so_far;
mod stopwatch;
mod submit;
mod turns;
mod waiting;
pub mod workers;

use std::sync::Arc;
use std::thread;

use tokio::sync::watch;

use fretwork_engine::outcome::History;
use fretwork_job::{Begin, Key};
use fretwork_store::Store;

pub use evaluate::{LARGEST_EVALUATION, LONGEST_EVALUATION, NotEvaluated};
pub use import::import;
pub use limits::{Excess, RUN_BYTES, WorkLimits};
pub use submit::{Accepted, Refusal, Terms};
pub use turns::{LONGEST_CALL, Unable};

use places::Places;
use short::ShortRuns;
use so_far::Watched;
use waiting::Waiting;
use workers::Compute;

/// A handle of the service. Clones share it.
#[derive(Clone)]
pub struct Service(Arc<Parts>);

struct Parts {
    store: Store,
    begin: Begin,
    waiting: Arc<Waiting>,
    watched: Watched,
    short: ShortRuns,
    /// Places for evaluations and derivatives.
    places: Places,
    /// The number of worker threads.
    workers: usize,
    limits: WorkLimits,
    /// True after the service has stopped accepting jobs.
    draining: watch::Sender<bool>,
}

/// The number of processors.
pub fn processors() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

impl Service {
    /// The service of a store, with a number of worker threads.
    pub fn new(store: Store, begin: Begin, workers: usize, limits: WorkLimits) -> Self {
        // A server without workers still computes evaluations and short runs, because their clients wait for them.
        let places = if workers == 0 { processors() } else { workers };
        // Short submissions have places of their own, so a burst of them does not delay evaluations.
        let short = ShortRuns::new(store.clone(), Arc::clone(&begin), Places::new(places));
        let places = Places::new(places);
        let (waiting, watched, draining) =
            (Arc::default(), Watched::default(), watch::Sender::new(false));
        let parts =
            Parts { store, begin, waiting, watched, short, places, workers, limits, draining };
        Self(Arc::new(parts))
    }

    /// The store behind the service.
    pub fn store(&self) -> &Store {
        &self.0.store
    }

    /// The limits of new runs and studies.
    pub fn limits(&self) -> WorkLimits {
        self.0.limits
    }

    /// The number of worker threads.
    pub fn workers(&self) -> usize {
        self.0.workers
    }

    /// The number of short computations that can run at the same time while their clients wait.
    pub fn places(&self) -> usize {
        self.0.places.number
    }

    /// The function with which a worker begins a claimed run. It uses the prepared task if that is still in memory.
    pub fn compute(&self) -> Compute {
        let Parts { begin, waiting, watched, .. } = &*self.0;
        let (begin, waiting, watched) = (begin.clone(), waiting.clone(), watched.clone());
        Arc::new(move |key, stored| Ok(watched.begin(begin(key, stored, waiting.take(key))?, *key)))
    }

    /// The rows that a run has found so far. `None` if this process computes no such run.
    pub async fn so_far(&self, key: &Key) -> Option<Arc<History>> {
        self.0.watched.rows(key).await
    }

    /// Stops accepting jobs, and ends waits and event streams.
    pub fn drain(&self) {
        self.0.draining.send_replace(true);
    }

    /// Whether the service has stopped accepting jobs.
    pub fn is_draining(&self) -> bool {
        *self.0.draining.borrow()
    }

    /// Returns once the service is draining.
    pub async fn drained(&self) {
        // This cannot fail, because the sender lives as long as `self`.
        let _ = self.0.draining.subscribe().wait_for(|draining| *draining).await;
    }
}
