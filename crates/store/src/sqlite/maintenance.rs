//! Maintenance that keeps the database small and fast over years.
//!
//! The writer task stores when results were last read, and deletes old jobs and the chunks of ended studies. When the
//! database exceeds its budget, [eviction](super::eviction) makes room. It works in small transactions between other
//! writes. If one transaction fails, for example on a damaged page, the others still run.

use std::time::{Duration, Instant};

use super::transaction::Transaction;
use crate::database::{Connected, Result, RunId, Tables, sql};
use crate::jobs::ages::AgeClock;
use crate::jobs::cancel::delete_unnamed;
use fretwork_job::Key;

/// The writer task counts as idle after this time without a message.
const IDLE: Duration = Duration::from_secs(1);
/// Maximum time between two rounds of maintenance.
const OFTEN: Duration = Duration::from_mins(1);
/// Maximum number of jobs that one transaction deletes. This takes a few milliseconds.
const JOBS: u32 = 100;
/// Maximum number of chunks that one transaction deletes. Each has tens of kilobytes.
pub(super) const CHUNKS: i64 = 32;

/// Decides when to run maintenance.
pub(super) struct Maintenance {
    pub(super) keep_jobs: Option<Duration>,
    pub(super) budget: Option<u64>,
    pub(super) clock: AgeClock,
    last: Instant,
    /// Whether something was committed since the last round.
    dirty: bool,
    /// Whether the last round has left work for the next one.
    more: bool,
    /// Bytes that the database uses.
    used: u64,
    /// The bytes that the database used when nothing was left to delete; 0 if there is something to delete.
    immovable: u64,
}

impl Maintenance {
    pub(super) fn new(keep_jobs: Option<Duration>, budget: Option<u64>, clock: AgeClock) -> Self {
        // The limits may differ from those of the last start, so the first round is needed.
        let (last, dirty) = (Instant::now(), true);
        Self { keep_jobs, budget, clock, last, dirty, more: false, used: 0, immovable: 0 }
    }

    /// The time that the writer task waits for messages before the next round.
    pub(super) fn pause(&self) -> Duration {
        match (self.more, self.dirty) {
            (true, _) => Duration::ZERO,
            (_, true) => IDLE,
            _ => OFTEN,
        }
    }

    /// Records a commit, after which the database uses this number of bytes.
    pub(super) fn note(&mut self, used: u64) {
        self.dirty = true;
        self.used = used;
    }

    /// Whether a round must run although the writer task is busy.
    pub(super) fn is_due(&self) -> bool {
        // If nothing could be deleted, the next round waits until the database has grown.
        let exceeds = |budget| self.used > budget && self.used > self.immovable + budget / 64;
        self.more || self.budget.is_some_and(exceeds) || self.last.elapsed() > OFTEN
    }

    /// Records the bytes that the database uses if nothing is left that can be deleted. `None` means that something was
    /// deleted. Returns whether this is the first time that nothing is left, so that it is logged once.
    pub(super) fn cannot_delete(&mut self, used: Option<u64>) -> bool {
        let is_news = used.is_some() && self.immovable == 0;
        self.immovable = used.unwrap_or(0);
        is_news
    }

    /// Records that deleting failed: the next attempt waits until the database uses more.
    pub(super) fn could_not_delete(&mut self) {
        self.immovable = self.used;
    }

    /// Records the end of a round.
    pub(super) fn did(&mut self, more: bool) {
        self.more = more;
        self.dirty = false;
        self.last = Instant::now();
    }
}

/// Stores the [`AgeClock`].
pub(super) async fn write_clock(time: &i64, tx: &mut Transaction) -> Result<()> {
    tx.db.execute(sql!("UPDATE room SET clock = $1"; *time)).await
}

/// Checks that the disk has space for a submission: writes about as many bytes as a default result with its job takes.
pub(crate) async fn probe((): &(), tx: &mut Transaction) -> Result<()> {
    // Random bytes, because SQLite does not write bytes that have not changed.
    let query = sql!("INSERT OR REPLACE INTO probe (id, bytes) VALUES (1, randomblob(262144))");
    tx.db.execute(query).await
}

/// Stores when results were last read.
pub(super) async fn write_reads(reads: &Vec<(Key, i64)>, tx: &mut Transaction) -> Result<()> {
    for (key, at) in reads {
        let query = sql!(
            "UPDATE result SET last_access = $2 WHERE key = $1 AND last_access < $2";
            key, *at
        );
        tx.db.execute(query).await?;
    }
    Ok(())
}

/// Deletes jobs that ended before this time, the oldest first, and runs without jobs. Returns whether there may be more
/// to delete.
pub(super) async fn delete_old(before: &i64, tx: &mut Transaction) -> Result<bool> {
    // A job id begins with the time in milliseconds, so the primary key finds the oldest jobs.
    let mut oldest = [0; 16];
    oldest[..6].copy_from_slice(&(*before).max(0).to_be_bytes()[2..]);
    let query = sql!(
        "DELETE FROM job WHERE id IN (
             SELECT id FROM job WHERE id < $1 AND finished < $2 ORDER BY id LIMIT $3
         ) RETURNING run";
        &oldest[..], *before, JOBS
    );
    let rows = tx.db.rows(query).await?;
    for row in &rows {
        if let Some(run) = row.get("run")? {
            delete_unnamed(RunId(run), &mut tx.db).await?;
        }
    }
    Ok(rows.len() as u64 == u64::from(JOBS))
}
