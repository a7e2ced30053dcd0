//! What a running computation has found so far, for the clients that ask.
//!
//! A worker looks after each step whether a client waits. Only then it copies the rows. So nothing is kept, and runs that
//! nobody watches are not delayed.

use std::collections::HashMap;
use std::sync::Arc;

use parking_lot::Mutex;
use tokio::sync::oneshot;

use super::Service;
use fretwork_engine::outcome::History;
use fretwork_job::{Key, Step, Work};

/// For the key of each run that this process computes, the clients that wait for its rows.
pub type Watched = Arc<Mutex<HashMap<Key, Vec<oneshot::Sender<Arc<History>>>>>>;

/// A computation whose rows clients can ask for. When it is dropped, the clients that still wait get nothing.
pub struct WatchedWork {
    work: Box<dyn Work>,
    key: Key,
    watched: Watched,
}

impl WatchedWork {
    pub fn new(work: Box<dyn Work>, key: Key, watched: Watched) -> Self {
        watched.lock().insert(key, Vec::new());
        Self { work, key, watched }
    }
}

impl Work for WatchedWork {
    fn step(&mut self) -> Step {
        let step = self.work.step();
        let waiting = self.watched.lock().get_mut(&self.key).map(std::mem::take);
        if let Some(waiting) = waiting.filter(|waiting| !waiting.is_empty())
            && let Some(rows) = self.work.so_far().map(Arc::new)
        {
            for client in waiting {
                // The client may have disconnected.
                let _ = client.send(Arc::clone(&rows));
            }
        }
        step
    }
}

impl Drop for WatchedWork {
    fn drop(&mut self) {
        self.watched.lock().remove(&self.key);
    }
}

impl Service {
    /// The rows of a run that this process computes, after its present step. `None` if this process computes no such run.
    pub async fn so_far(&self, key: &Key) -> Option<Arc<History>> {
        let (client, rows) = oneshot::channel();
        self.0.watched.lock().get_mut(key)?.push(client);
        rows.await.ok()
    }
}
