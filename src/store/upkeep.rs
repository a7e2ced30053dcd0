//! Maintenance that keeps the database small and fast over years.
//!
//! The writer task stores when results were last read, deletes old jobs, and evicts the least recently
//! read results when all results exceed their budget. It works in small transactions between other
//! writes. If one of them fails, for example on a damaged page, the others still run.

use std::time::{Duration, Instant};

use sqlx::Row;

use super::error::Error;
use super::signals::Effect;
use super::transaction::Transaction;
use crate::job::Key;

/// The writer task is idle after this time without a message.
const IDLE: Duration = Duration::from_secs(1);
/// Longest time between two rounds of maintenance.
const OFTEN: Duration = Duration::from_mins(1);
/// Jobs deleted in one transaction, which takes a few milliseconds.
const JOBS: u32 = 100;
/// How long the scenario of an evicted result is kept at least: one year in milliseconds.
const KEEP_EVICTED: i64 = 365 * 24 * 3600 * 1000;

/// Decides when to run maintenance.
#[derive(Debug)]
pub(super) struct Upkeep {
    pub(super) keep_jobs: Option<Duration>,
    pub(super) budget: Option<u64>,
    last: Instant,
    /// Something was committed since the last round.
    dirty: bool,
    /// The last round left work over.
    more: bool,
    /// Bytes of results stored since the last round.
    stored: u64,
}

impl Upkeep {
    pub(super) fn new(keep_jobs: Option<Duration>, budget: Option<u64>) -> Self {
        // The limits may differ from those of the last start, so the first round is needed.
        Self { keep_jobs, budget, last: Instant::now(), dirty: true, more: false, stored: 0 }
    }

    /// How long the writer task waits for messages before the next round.
    pub(super) fn pause(&self) -> Duration {
        match (self.more, self.dirty) {
            (true, _) => Duration::ZERO,
            (_, true) => IDLE,
            _ => OFTEN,
        }
    }

    /// Records a commit.
    pub(super) fn note(&mut self, effects: &[Effect]) {
        self.dirty = true;
        for effect in effects {
            if let Effect::Stored(bytes) = effect {
                self.stored += bytes;
            }
        }
    }

    /// Whether a round must run although the writer task is busy.
    pub(super) fn is_due(&self) -> bool {
        // This limits the overrun of the budget to a few per cent.
        let grown = self.budget.is_some_and(|budget| self.stored > budget / 64);
        self.more || grown || self.last.elapsed() > OFTEN
    }

    /// Records the end of a round.
    pub(super) fn did(&mut self, more: bool) {
        self.more = more;
        self.dirty = false;
        self.stored = 0;
        self.last = Instant::now();
    }
}

/// Checks that the database is writable.
pub(super) async fn ping((): &(), tx: &mut Transaction) -> Result<(), Error> {
    sqlx::query("UPDATE room SET tried = ?1").bind(tx.now).execute(&mut tx.db).await?;
    Ok(())
}

/// Stores when results were last read.
pub(super) async fn write_reads(
    reads: &Vec<(Key, i64)>,
    tx: &mut Transaction,
) -> Result<(), Error> {
    for (key, at) in reads {
        sqlx::query("UPDATE result SET last_access = ?2 WHERE key = ?1 AND last_access < ?2")
            .bind(key.bytes().as_slice())
            .bind(at)
            .execute(&mut tx.db)
            .await?;
    }
    Ok(())
}

/// Deletes jobs that ended longer ago than this, the oldest first, and runs without jobs. Returns whether
/// there may be more to delete.
pub(super) async fn delete_old(age: &Duration, tx: &mut Transaction) -> Result<bool, Error> {
    let cutoff = tx.now - i64::try_from(age.as_millis()).unwrap_or(i64::MAX);
    // A job id begins with the time in milliseconds, so the primary key finds the oldest jobs.
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
    .fetch_all(&mut tx.db)
    .await?;
    for row in &rows {
        if let Some(run) = row.try_get("run")? {
            delete_unnamed(tx, run).await?;
        }
    }
    Ok(rows.len() as u64 == u64::from(JOBS))
}

/// Deletes a finished run without jobs.
pub(super) async fn delete_unnamed(tx: &mut Transaction, run: i64) -> Result<(), Error> {
    sqlx::query(
        "DELETE FROM run WHERE id = ?1 AND finished IS NOT NULL
             AND NOT EXISTS (SELECT 1 FROM job WHERE run = ?1)",
    )
    .bind(run)
    .execute(&mut tx.db)
    .await?;
    Ok(())
}

/// What an eviction did.
pub(super) struct Room {
    /// Bytes of all results before the eviction.
    pub(super) used: u64,
    /// Whether a result was evicted: then the next one may have to be evicted too.
    pub(super) evicted: bool,
}

/// Evicts the least recently read result if all results together exceed the budget. The scenario of an evicted
/// result stays known for a year, and for as long as it has jobs. If the results are within the budget, deletes older
/// rows without jobs.
///
/// With `leave_body` it does not delete the body, because its pages are damaged and cannot be freed.
pub(super) async fn evict(
    (budget, leave_body): &(Option<u64>, bool),
    tx: &mut Transaction,
) -> Result<Room, Error> {
    let used: u64 = sqlx::query_scalar("SELECT used FROM room").fetch_one(&mut tx.db).await?;
    if budget.is_none_or(|budget| used <= budget) {
        // Among the oldest 1000 only, so that many results with jobs do not slow every round. Younger results without
        // jobs wait until the jobs of older ones are deleted.
        sqlx::query(
            "DELETE FROM result WHERE key IN (
                 SELECT key FROM (
                     SELECT key FROM result WHERE evicted < ?1 ORDER BY evicted LIMIT 1000
                 ) AS old
                 WHERE NOT EXISTS (SELECT 1 FROM job WHERE job.key = old.key) LIMIT 100
             )",
        )
        .bind(tx.now - KEEP_EVICTED)
        .execute(&mut tx.db)
        .await?;
        return Ok(Room { used, evicted: false });
    }
    let oldest: Option<(Vec<u8>, u64)> = sqlx::query_as(
        "UPDATE result SET evicted = ?1 WHERE key = (
             SELECT key FROM result INDEXED BY result_unread
             WHERE NOT pinned AND evicted IS NULL ORDER BY last_access LIMIT 1
         ) RETURNING key, stored",
    )
    .bind(tx.now)
    .fetch_optional(&mut tx.db)
    .await?;
    let Some((key, bytes)) = oldest else { return Ok(Room { used, evicted: false }) };
    if !leave_body {
        let delete = sqlx::query("DELETE FROM result_blob WHERE key = ?1");
        delete.bind(&key).execute(&mut tx.db).await?;
    }
    tx.effects.push(Effect::Evicted(bytes));
    Ok(Room { used, evicted: true })
}
