//! Stores jobs, the runs that they share, and the results of the runs.
//!
//! One writer task makes all changes. It takes all waiting messages, applies them in one immediate
//! transaction, and answers after the commit. So an acknowledged change survives a crash of the process.
//! A pool of read-only connections serves reads. The tables are authoritative; a signal ([`Changes`],
//! [`Stop`]) is a hint to read them again.
//!
//! ```text
//! job ──▶ run ──▶ result ── result_blob
//!          └─ study ── chunk
//! ```
//!
//! A job without a run found its result, or was stored together with it.
//!
//! A run is live while it is queued or running. A key has at most one live run, and a submission of the
//! key joins it. If the last job of a running run is canceled, the run is `canceling` until its worker
//! stops. It is no longer live, so a later submission does not join it.
//!
//! A study is a run whose work is divided into chunks. Workers claim and finish its chunks one by one; the last piece
//! assembles the result from them.

#![expect(
    clippy::missing_errors_doc,
    reason = "all fail for the same reasons: the database fails or is closed, as `Error` says"
)]

mod administration;
mod audit;
mod body;
mod cancel;
mod chunks;
mod claimed;
mod error;
mod keep;
mod keys;
mod ledger;
mod library;
mod log;
mod moving;
mod open;
mod outline;
mod pins;
mod queue;
mod read;
mod readers;
mod row;
mod runs;
mod search;
mod signals;
mod submit;
mod tally;
mod transaction;
mod upkeep;
mod writer;

use std::path::Path;
use std::sync::Arc;

use sqlx::SqliteConnection;
use tokio::sync::{Semaphore, mpsc};

use crate::job::Key;

pub use administration::Administration;
pub use audit::{Act, Actor, AuditEntry};
pub use body::Body;
pub use cancel::{Canceled, Deleted};
pub use claimed::{Claimed, Piece};
pub use error::Error;
pub use keep::{Answered, Changed, Editor, Finish, Removed};
pub use keys::{AccessKey, NewKey, Role, digest};
pub use library::{Known, Note, Program, Provenance};
pub use moving::{Exported, Imported, Moving, Saved, backup, export, import, note_backup, restore};
pub use open::{FileSizes, Options};
pub use read::{Asked, Filter, LARGE, Page, StoredResult};
pub use row::RunId;
pub use runs::Recovered;
pub use search::{Cursor, Found, Listed, Search};
pub use signals::{Changes, Stop};
pub use submit::{Admission, NewJob, Repeatable, Submitted};
pub use tally::Tally;

use pins::PinQuota;
use readers::Readers;
use signals::Signals;
use transaction::Verb;
use writer::Message;

/// The open database, as a handle that is cheap to clone.
#[derive(Debug, Clone)]
pub struct Store {
    writer: mpsc::Sender<Message>,
    readers: Arc<Readers>,
    /// One connection for [`LARGE`] results: a connection keeps the memory that it has allocated.
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

impl Store {
    /// Free bytes on the disk of the database; `None` if the system does not report them.
    #[must_use]
    pub fn free_bytes(&self) -> Option<u64> {
        fs4::available_space(&self.dir).ok()
    }

    /// Metrics since the start.
    #[must_use]
    pub fn tally(&self) -> &Tally {
        &self.signals.tally
    }

    /// Signals changes of the jobs and the run of a key from now on. Read the tables after this call.
    #[must_use]
    pub fn watch(&self, key: &Key) -> Changes {
        self.signals.watch(*key)
    }

    /// Signals that a run was queued, from now on.
    #[must_use]
    pub fn watch_queue(&self) -> Changes {
        self.signals.watch_queue()
    }

    /// Completes all earlier changes, closes the database and unlocks the directory.
    pub async fn close(&self) {
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
        self.counted(done.await)
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
        self.counted(done.await)
    }

    /// Counts the error of a failed operation in the metrics, and returns the result unchanged.
    fn counted<T>(&self, result: Result<T, Error>) -> Result<T, Error> {
        result.inspect_err(|error| self.signals.tally.failed(error))
    }
}
