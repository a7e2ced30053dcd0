//! What keeps the database small and fast over years, done in small pieces between other work.
//!
//! The moments at which results were read are written down, old jobs are deleted, and results that
//! nobody has read for longest are dropped when they take too much room. Each piece is a transaction
//! of its own: one that fails, on a damaged page for instance, does not keep the others back.

use std::time::{Duration, Instant};

use sqlx::Row;

use super::signals::Effect;
use super::writer::{Transaction, Verb};
use super::{Error, Options};
use crate::job::Key;

/// Without a message for so long, the writer has time.
const IDLE: Duration = Duration::from_secs(1);
/// It takes the time at least this often.
const OFTEN: Duration = Duration::from_mins(1);
/// Jobs deleted in one piece: some milliseconds of work.
const JOBS: u32 = 100;
/// How long the scenario of a dropped result is remembered: a year.
const REMEMBERED: i64 = 365 * 24 * 3600 * 1000;

/// When to do what.
#[derive(Debug)]
pub(super) struct Upkeep {
    pub(super) keep_jobs: Option<Duration>,
    pub(super) budget: Option<u64>,
    last: Instant,
    /// There is something to tidy up.
    dirty: bool,
    /// The last piece did not finish it.
    more: bool,
    /// Bytes stored since the last time.
    stored: u64,
}

impl Upkeep {
    pub(super) fn new(options: &Options) -> Self {
        let Options { keep_jobs, budget, .. } = *options;
        // At the start the limits may be other ones than before.
        Self { keep_jobs, budget, last: Instant::now(), dirty: true, more: false, stored: 0 }
    }

    /// How long to wait for other work before there is time for this.
    pub(super) fn pause(&self) -> Duration {
        match (self.more, self.dirty) {
            (true, _) => Duration::ZERO,
            (_, true) => IDLE,
            _ => OFTEN,
        }
    }

    /// Takes notice of a commit.
    pub(super) fn note(&mut self, effects: &[Effect]) {
        self.dirty = true;
        for effect in effects {
            if let Effect::Stored(bytes) = effect {
                self.stored += bytes;
            }
        }
    }

    /// Whether it cannot wait for a quiet moment.
    pub(super) fn is_due(&self) -> bool {
        // So results take at most a few hundredths more room than they may.
        let grown = self.budget.is_some_and(|budget| self.stored > budget / 64);
        self.more || grown || self.last.elapsed() > OFTEN
    }

    /// Takes notice of a round that is done.
    pub(super) fn did(&mut self, more: bool) {
        self.more = more;
        self.dirty = false;
        self.stored = 0;
        self.last = Instant::now();
    }
}

/// Finds out whether anything can be changed.
pub(super) struct Ping;

impl Verb for Ping {
    type Answer = ();

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<(), Error> {
        sqlx::query("UPDATE room SET tried = ?1").bind(tx.now).execute(&mut *tx.db).await?;
        Ok(())
    }
}

/// Writes down when results were last read.
pub(super) struct WriteReads(pub(super) Vec<(Key, i64)>);

impl Verb for WriteReads {
    type Answer = ();

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<(), Error> {
        for (key, at) in &self.0 {
            sqlx::query("UPDATE result SET last_access = ?2 WHERE key = ?1 AND last_access < ?2")
                .bind(key.bytes().as_slice())
                .bind(at)
                .execute(&mut *tx.db)
                .await?;
        }
        Ok(())
    }
}

/// Deletes jobs that ended before so long, the oldest first, and the runs that nobody names any more.
pub(super) struct DeleteOld(pub(super) Duration);

impl Verb for DeleteOld {
    /// Whether there may be more.
    type Answer = bool;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<bool, Error> {
        let cutoff = tx.now - i64::try_from(self.0.as_millis()).unwrap_or(i64::MAX);
        // Ids begin with the time in milliseconds, so the oldest jobs are found by the primary key.
        let mut oldest = [0; 16];
        oldest[..6].copy_from_slice(&cutoff.max(0).to_be_bytes()[2..]);
        let rows = sqlx::query(
            "DELETE FROM job WHERE id IN (
                 SELECT id FROM job WHERE id < ?1 AND finished < ?2 ORDER BY id LIMIT ?3
             ) RETURNING run",
        )
        .bind(oldest.as_slice())
        .bind(cutoff)
        .bind(JOBS)
        .fetch_all(&mut *tx.db)
        .await?;
        for row in &rows {
            if let Some(run) = row.try_get("run")? {
                delete_unnamed(tx, run).await?;
            }
        }
        Ok(rows.len() as u64 == u64::from(JOBS))
    }
}

/// Deletes a run that has ended and that no job names.
pub(super) async fn delete_unnamed(tx: &mut Transaction<'_>, run: i64) -> Result<(), Error> {
    sqlx::query(
        "DELETE FROM run WHERE id = ?1 AND finished IS NOT NULL
             AND NOT EXISTS (SELECT 1 FROM job WHERE run = ?1)",
    )
    .bind(run)
    .execute(&mut *tx.db)
    .await?;
    Ok(())
}

/// Drops the result that was read longest ago, if all take more room than so many bytes; what it
/// was computed from stays, for a year.
pub(super) struct Evict {
    pub(super) budget: Option<u64>,
    /// The body cannot be deleted: the pages that hold it are damaged.
    pub(super) leave_body: bool,
}

/// How results and the room they may take stand to each other.
pub(super) struct Room {
    pub(super) used: u64,
    /// One was dropped, so more may have to go.
    pub(super) dropped: bool,
}

impl Verb for Evict {
    type Answer = Room;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Room, Error> {
        let used: i64 = sqlx::query_scalar("SELECT used FROM room").fetch_one(&mut *tx.db).await?;
        let used = u64::try_from(used).unwrap_or(0);
        if self.budget.is_none_or(|budget| used <= budget) {
            sqlx::query(
                "DELETE FROM result WHERE key IN (
                     SELECT key FROM result WHERE evicted < ?1 LIMIT 100
                 )",
            )
            .bind(tx.now - REMEMBERED)
            .execute(&mut *tx.db)
            .await?;
            return Ok(Room { used, dropped: false });
        }
        let oldest: Option<(Vec<u8>, i64)> = sqlx::query_as(
            "UPDATE result SET evicted = ?1 WHERE key = (
                 SELECT key FROM result INDEXED BY result_unread
                 WHERE NOT pinned AND evicted IS NULL ORDER BY last_access LIMIT 1
             ) RETURNING key, size",
        )
        .bind(tx.now)
        .fetch_optional(&mut *tx.db)
        .await?;
        let Some((key, size)) = oldest else { return Ok(Room { used, dropped: false }) };
        if !self.leave_body {
            let delete = sqlx::query("DELETE FROM result_blob WHERE key = ?1");
            delete.bind(&key).execute(&mut *tx.db).await?;
        }
        tx.effects.push(Effect::Evicted(u64::try_from(size).unwrap_or(0)));
        Ok(Room { used, dropped: true })
    }
}
