//! The database as a file of SQLite in a data directory, for one server.
//!
//! One writer task makes all changes. It takes all waiting messages, applies them in one immediate
//! transaction, and answers after the commit. So an acknowledged change survives a crash of the process.
//! A pool of read-only connections serves reads.

pub(super) mod audit;
mod cancel;
mod chunks;
mod files;
pub(super) mod imports;
mod keep;
pub(super) mod keys;
pub(super) mod ledger;
pub(super) mod library;
mod log;
pub(super) mod open;
mod outline;
mod queue;
pub(super) mod read;
mod readers;
mod runs;
pub(super) mod schema;
pub(super) mod search;
mod submit;
mod transaction;
mod upkeep;
mod writer;

use std::path::Path;
use std::sync::Arc;

use sqlx::SqliteConnection;
use tokio::sync::{Semaphore, mpsc};

use super::error::Error;
use super::pins::PinQuota;
use super::signals::Signals;

use readers::Readers;
use transaction::Verb;
use writer::Message;

/// The open database, as a handle that is cheap to clone.
#[derive(Debug, Clone)]
pub(super) struct Database {
    writer: mpsc::Sender<Message>,
    readers: Arc<Readers>,
    /// One connection for large results: a connection keeps the memory that it has allocated.
    large: Arc<Readers>,
    /// One connection for access keys: every request needs them, and must not wait for long lists.
    keys: Arc<Readers>,
    /// Permits for scans of all results. They limit the number of concurrent scans.
    scans: Arc<Semaphore>,
    signals: Arc<Signals>,
    queue_limit: usize,
    pin_quota: PinQuota,
    /// The data directory.
    dir: Arc<Path>,
}

impl Database {
    pub(super) fn free_bytes(&self) -> Option<u64> {
        fs4::available_space(&self.dir).ok()
    }

    pub(super) async fn close(&self) {
        self.readers.close().await;
        self.large.close().await;
        self.keys.close().await;
        writer::close(&self.writer).await;
    }

    /// Lets the writer task call a function. Returns its answer after the commit.
    async fn write<Input, V, Answer>(&self, verb: V, input: Input) -> Result<Answer, Error>
    where
        Input: Send + Sync + 'static,
        V: for<'a> Verb<'a, Input, Answer = Answer>,
        Answer: Send + 'static,
    {
        let (order, answer) = writer::order(verb, input);
        let done = async {
            self.writer.send(Message::Apply(order)).await.map_err(|_| Error::Closed)?;
            answer.await.map_err(|_| Error::Closed)?
        };
        self.signals.counted(done.await)
    }

    async fn reading<T>(
        &self,
        read: impl AsyncFnOnce(&mut SqliteConnection) -> Result<T, Error>,
    ) -> Result<T, Error> {
        self.reading_by(&self.readers, read).await
    }

    async fn reading_by<T>(
        &self,
        readers: &Readers,
        read: impl AsyncFnOnce(&mut SqliteConnection) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let done = async { read(readers.get().await?.connection()).await };
        self.signals.counted(done.await)
    }
}
