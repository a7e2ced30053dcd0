//! What is kept: jobs, the runs they share, and the results that runs leave behind.
//!
//! Every change is a message to one writer task, which takes whatever is waiting, applies it in one
//! immediate transaction and answers after the commit; an answered change survives the death of the
//! process. Reads go through a pool of read-only connections beside it. The tables are the truth;
//! what this room signals ([`Changes`], [`Stop`]) is a hint to look again.
//!
//! ```text
//! job ──▶ run ──▶ result ── result_blob
//! ```
//!
//! A run is live while it is queued or running, and a key has at most one live run: a submission
//! joins it. A run whose last job is canceled while it runs is `canceling` until its worker lets
//! go; it is no longer live, so that a later submission never joins a dying run.

#![expect(
    clippy::missing_errors_doc,
    reason = "they all fail alike: the database refuses or is closed, as `Error` says"
)]

mod administration;
mod cancel;
mod error;
mod keep;
mod keys;
mod library;
mod moving;
mod open;
mod outline;
mod queue;
mod read;
mod readers;
mod runs;
mod search;
mod signals;
mod submit;
mod tally;
mod upkeep;
mod writer;

use std::path::Path;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use sqlx::SqliteConnection;
use tokio::sync::{Semaphore, mpsc};

use crate::job::clock::now;
use crate::job::{Answer, Cost, FailureKind, Job, JobId, Key};

pub use administration::Administration;
pub use cancel::{Canceled, Deleted};
pub use error::Error;
pub use keep::Removed;
pub use keys::{AccessKey, NewKey, Role, digest};
pub use library::{Known, Note, Program, Provenance};
pub use moving::{Exported, Imported, Moving, Saved, backup, export, import, restore};
pub use open::Options;
pub use read::{Asked, Filter, Page, StoredResult};
pub use runs::{Claimed, Finish, Recovered, RunId};
pub use search::{Cursor, Found, Listed, Search};
pub use signals::{Changes, Stop};
pub use submit::{Admission, NewJob, Repeatable, Submitted};
pub use tally::Tally;

use read::Kept;
use readers::Readers;
use signals::Signals;
use writer::Message;

/// The database as this process sees it: a handle, cheap to clone.
#[derive(Debug, Clone)]
pub struct Store {
    writer: mpsc::Sender<Message>,
    readers: Arc<Readers>,
    /// For large results: a connection keeps the memory it once took.
    large: Arc<Readers>,
    /// Who has a permit may look through many results.
    scans: Arc<Semaphore>,
    signals: Arc<Signals>,
    queue_limit: usize,
    /// Where the database lies.
    dir: Arc<Path>,
}

/// Readers that may look through many results at one time; the others are for who wants one.
const SCANS: usize = 2;
/// Jobs canceled in one transaction.
const CANCELED_AT_ONCE: u32 = 100;
/// A result of more bytes is large: read by one connection, and judged apart from the threads that answer
/// requests.
pub const LARGE: usize = 1 << 18;

impl Store {
    /// Accepts a job. A known result ends it at once, a live run is joined, else a run is queued, if
    /// the queue has a place for it.
    pub async fn submit(&self, job: NewJob) -> Result<Submitted, Error> {
        self.write(submit::Submit::new(job, self.queue_limit)).await
    }

    /// Accepts jobs of one key along with their answer and its cost, and finishes them in the same commit.
    /// If the result has become known meanwhile, or a run is live, they follow that instead.
    pub async fn record(
        &self,
        jobs: Vec<NewJob>,
        answer: &Answer,
        cost: Cost,
    ) -> Result<Vec<Submitted>, Error> {
        let jobs = jobs.into_iter().map(|job| submit::Submit::new(job, self.queue_limit)).collect();
        self.write(submit::Record::new(jobs, answer, cost)).await
    }

    /// Cancels a job, and its run if nobody else waits for it.
    pub async fn cancel(&self, id: JobId) -> Result<Canceled, Error> {
        self.write(cancel::Cancel(id)).await
    }

    /// Cancels every unfinished job that matches and was submitted before this call; returns how
    /// many.
    pub async fn cancel_all(&self, filter: &Filter) -> Result<u64, Error> {
        let mut before = JobId::generate();
        let mut canceled = 0;
        loop {
            let filter = filter.clone();
            let some = cancel::CancelSome { filter, before, at_most: CANCELED_AT_ONCE };
            let (count, next) = self.write(some).await?;
            canceled += count;
            match next {
                Some(next) => before = next,
                None => return Ok(canceled),
            }
        }
    }

    /// Deletes a job that has ended.
    pub async fn delete(&self, id: JobId) -> Result<Deleted, Error> {
        self.write(cancel::Delete(id)).await
    }

    /// Keeps a result whatever room it takes, or no longer; false if there is no such result.
    pub async fn pin(&self, key: &Key, pinned: bool) -> Result<bool, Error> {
        self.write(keep::Pin { key: *key, pinned }).await
    }

    /// Takes the next queued run.
    ///
    /// The caller must end it by [`finish`](Self::finish), [`fail`](Self::fail),
    /// [`stopped`](Self::stopped) or [`release`](Self::release): nobody else will before the
    /// next start of the server.
    pub async fn claim(&self) -> Result<Option<Claimed>, Error> {
        self.write(runs::Claim).await
    }

    /// Notes how far a run has come, 0…1; false if it is no longer this worker's.
    pub async fn progress(&self, run: RunId, attempt: u32, share: f64) -> Result<bool, Error> {
        self.write(runs::Progress { run, attempt, share }).await
    }

    /// Stores the result of a run, and what this attempt cost.
    pub async fn finish(
        &self,
        run: RunId,
        attempt: u32,
        answer: &Answer,
        cost: Cost,
    ) -> Result<Finish, Error> {
        let answer = keep::Answered::new(answer, Some(cost));
        self.write(runs::FinishRun { run, attempt, answer }).await
    }

    /// Ends a run by a failure; false if it is no longer this worker's.
    pub async fn fail(
        &self,
        run: RunId,
        attempt: u32,
        kind: FailureKind,
        message: &str,
    ) -> Result<bool, Error> {
        self.write(runs::Fail { run, attempt, kind, message: message.to_owned() }).await
    }

    /// Confirms that a run being canceled is no longer worked on; false if it was not.
    pub async fn stopped(&self, run: RunId, attempt: u32) -> Result<bool, Error> {
        self.write(runs::Stopped { run, attempt }).await
    }

    /// Puts a running run back in the queue, unharmed: it does not count as lost. False if it is
    /// no longer this worker's.
    pub async fn release(&self, run: RunId, attempt: u32) -> Result<bool, Error> {
        self.write(runs::Release { run, attempt }).await
    }

    /// Deals with every run that the last process left unfinished. Call it before any worker
    /// claims: it takes every running run for lost.
    pub async fn recover(&self) -> Result<Recovered, Error> {
        self.write(runs::Recover).await
    }

    /// A job as it stands.
    pub async fn job(&self, id: JobId) -> Result<Option<Job>, Error> {
        self.reading(async |db| read::job(db, id).await).await
    }

    /// What a job computes: its task in the stored form, and the scenario as the client wrote it. Each is
    /// none where it is not kept (any more).
    pub async fn asked(&self, id: JobId) -> Result<Asked, Error> {
        self.reading(async |db| read::asked(db, id).await).await
    }

    /// Up to `limit` jobs that match, newest first, older than `cursor`.
    pub async fn jobs(
        &self,
        filter: &Filter,
        cursor: Option<JobId>,
        limit: u32,
    ) -> Result<Page, Error> {
        self.reading(async |db| read::jobs(db, filter, cursor, limit).await).await
    }

    /// The result of a key, held against its sum: damage to the disk does not change a number.
    pub async fn result(&self, key: &Key) -> Result<Option<StoredResult>, Error> {
        match self.small_result(key).await? {
            Some(StoredResult::Large) => self.result_by(&self.large, key, usize::MAX).await,
            found => Ok(found),
        }
    }

    /// The same, unless it is [`LARGE`]: to find out costs no more than to read.
    pub async fn small_result(&self, key: &Key) -> Result<Option<StoredResult>, Error> {
        self.result_by(&self.readers, key, LARGE).await
    }

    async fn result_by(
        &self,
        readers: &Readers,
        key: &Key,
        most: usize,
    ) -> Result<Option<StoredResult>, Error> {
        let most = i64::try_from(most).unwrap_or(i64::MAX);
        let read = async { read::result(readers.get().await?.connection(), key, most).await };
        let Some(kept) = self.noted(read.await)? else { return Ok(None) };
        let (body, sum) = match kept {
            Kept::Evicted { at, deleted_by, scenario } => {
                return Ok(Some(StoredResult::Evicted { at, deleted_by, scenario }));
            }
            Kept::Larger => return Ok(Some(StoredResult::Large)),
            Kept::Whole { body, sum } => (Bytes::from(body), sum),
        };
        let is_sound = {
            let body = body.clone();
            move || sum.is_of(&body)
        };
        let sound = if body.len() <= LARGE {
            is_sound()
        } else {
            // A panic in a sum cannot be; if it were, the body would not be trusted.
            tokio::task::spawn_blocking(is_sound).await.unwrap_or(false)
        };
        if !sound {
            return self.noted(Err(Error::DamagedResult(*key)));
        }
        self.was_read(key);
        Ok(Some(StoredResult::Whole(body)))
    }

    /// Remembers that a result was read, for when room must be made.
    pub fn was_read(&self, key: &Key) {
        self.signals.read(*key, now());
    }

    /// Whether the result of a key is known.
    pub async fn has_result(&self, key: &Key) -> Result<bool, Error> {
        self.reading(async |db| read::has_result(db, key).await).await
    }

    /// The oldest unfinished job of the live run of a key, if one is under way; with an owner, of
    /// theirs.
    pub async fn live_job(&self, key: &Key, owner: Option<&str>) -> Result<Option<JobId>, Error> {
        self.reading(async |db| read::live_job(db, key, owner).await).await
    }

    /// How long the oldest queued run has waited.
    pub async fn longest_wait(&self) -> Result<Duration, Error> {
        let oldest = self.reading(async |db| read::oldest_queued(db).await).await?;
        let waited = oldest.map_or(0, |oldest| now() - oldest);
        Ok(Duration::from_millis(u64::try_from(waited).unwrap_or(0)))
    }

    /// Whether the database takes changes, or why not.
    pub async fn ping(&self) -> Result<(), Error> {
        self.write(upkeep::Ping).await
    }

    /// Bytes that are free on the disk of the database; none where the system does not say.
    #[must_use]
    pub fn free_bytes(&self) -> Option<u64> {
        fs4::available_space(&self.dir).ok()
    }

    /// What has happened since the start.
    #[must_use]
    pub fn tally(&self) -> &Tally {
        &self.signals.tally
    }

    /// Hints that a job or run of this key has changed, from now on: watch first, then query.
    #[must_use]
    pub fn watch(&self, key: &Key) -> Changes {
        self.signals.watch(*key)
    }

    /// Hints that something was queued, from now on.
    #[must_use]
    pub fn watch_queue(&self) -> Changes {
        self.signals.watch_queue()
    }

    /// The job once it has finished, or as it stands when `until` is over.
    pub async fn wait(&self, job: Job, until: impl Future<Output = ()>) -> Result<Job, Error> {
        if job.state.is_finished() {
            return Ok(job);
        }
        let mut changes = self.watch(&job.key);
        let mut until = pin!(until);
        let mut over = false;
        loop {
            match self.job(job.id).await? {
                Some(now) if over || now.state.is_finished() => return Ok(now),
                Some(_) => {}
                None => return Ok(job),
            }
            tokio::select! {
                () = changes.ended() => {}
                () = &mut until => over = true,
            }
        }
    }

    /// Finishes what was asked before, then closes the database and frees the directory.
    pub async fn close(&self) {
        self.readers.close().await;
        self.large.close().await;
        writer::close(&self.writer).await;
    }

    async fn write<V: writer::Verb>(&self, verb: V) -> Result<V::Answer, Error> {
        self.noted(writer::ask(&self.writer, verb).await)
    }

    async fn reading<T>(
        &self,
        read: impl AsyncFnOnce(&mut SqliteConnection) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let done = async { read(self.readers.get().await?.connection()).await };
        self.noted(done.await)
    }

    /// Counts what went wrong.
    fn noted<T>(&self, result: Result<T, Error>) -> Result<T, Error> {
        result.inspect_err(|error| self.signals.tally.failed(error))
    }
}
