//! What a running computation has found so far, for the clients that ask.
//!
//! After each step, the worker checks whether a client waits, and copies the rows only then. So nothing is kept, and a run
//! without such a client is not slower.

use std::collections::HashMap;
use std::sync::Arc;

use parking_lot::Mutex;
use tokio::sync::oneshot;

use fretwork_engine::outcome::History;
use fretwork_job::{Key, Step, Work};

/// A client that waits for rows.
type Client = oneshot::Sender<Arc<History>>;

/// For the key of each run that this process computes, the clients that wait for its rows.
#[derive(Clone, Default)]
pub struct Watched(Arc<Mutex<HashMap<Key, Vec<Client>>>>);

impl Watched {
    /// A computation whose rows clients can ask for. When it is dropped, the clients that still wait get nothing.
    pub fn begin(&self, work: Box<dyn Work>, key: Key) -> Box<dyn Work> {
        self.0.lock().insert(key, Vec::new());
        Box::new(WatchedWork { work, key, watched: self.clone() })
    }

    /// The rows of a run, after its present step. `None` if this process computes no such run.
    pub async fn rows(&self, key: &Key) -> Option<Arc<History>> {
        let (client, rows) = oneshot::channel();
        self.0.lock().get_mut(key)?.push(client);
        rows.await.ok()
    }
}

struct WatchedWork {
    work: Box<dyn Work>,
    key: Key,
    watched: Watched,
}

impl Work for WatchedWork {
    fn bytes(&self) -> usize {
        self.work.bytes()
    }

    fn step(&mut self) -> Step {
        let step = self.work.step();
        let waiting = self.watched.0.lock().get_mut(&self.key).map(std::mem::take);
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
        self.watched.0.lock().remove(&self.key);
    }
}
