//! What keeps the database small and fast over years, done in small pieces between other work.
//!
//! Old jobs are deleted, results that nobody has read for longest are dropped when the database has
//! grown too large, and the moments at which results were read are written down.

use std::time::{Duration, Instant};

use sqlx::Row;

use super::read;
use super::signals::Effect;
use super::writer::{Transaction, Verb};
use super::{Error, Options};
use crate::job::Key;

/// Without a message for so long, the writer has time.
const IDLE: Duration = Duration::from_secs(1);
/// It takes the time at least this often.
const OFTEN: Duration = Duration::from_mins(1);
/// Jobs deleted, and results dropped, in one piece: some milliseconds of work.
const PIECE: u32 = 100;

/// When to do what.
#[derive(Debug)]
pub(super) struct Upkeep {
    keep_jobs: Option<Duration>,
    budget: Option<u64>,
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
        // So the database is at most a few hundredths larger than it may be.
        let grown = self.budget.is_some_and(|budget| self.stored > budget / 64);
        self.more || grown || self.last.elapsed() > OFTEN
    }

    /// The next piece of work.
    pub(super) fn piece(&self, read: Vec<(Key, i64)>) -> Piece {
        Piece { read, keep_jobs: self.keep_jobs, budget: self.budget }
    }

    /// Takes notice of a piece that is done.
    pub(super) fn did(&mut self, more: bool) {
        self.more = more;
        self.dirty = false;
        self.stored = 0;
        self.last = Instant::now();
    }
}

/// A piece of upkeep.
pub(super) struct Piece {
    /// When results were last read.
    read: Vec<(Key, i64)>,
    keep_jobs: Option<Duration>,
    budget: Option<u64>,
}

impl Verb for Piece {
    /// Whether there is more to do, and how large the database is.
    type Answer = (bool, u64);

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Self::Answer, Error> {
        for (key, at) in &self.read {
            sqlx::query("UPDATE result SET last_access = ?2 WHERE key = ?1 AND last_access < ?2")
                .bind(key.bytes().as_slice())
                .bind(at)
                .execute(&mut *tx.db)
                .await?;
        }
        let deleted = match self.keep_jobs {
            Some(age) => delete_old(tx, age).await?,
            None => 0,
        };
        let used = read::bytes_used(tx.db).await?;
        let excess = self.budget.map_or(0, |budget| used.saturating_sub(budget));
        let dropped = if excess > 0 { evict(tx, excess).await? } else { 0 };
        Ok((deleted == u64::from(PIECE) || dropped > 0, used))
    }
}

/// Deletes jobs that ended before so long, the oldest first, and the runs that nobody names any more.
async fn delete_old(tx: &mut Transaction<'_>, age: Duration) -> Result<u64, Error> {
    let cutoff = tx.now - i64::try_from(age.as_millis()).unwrap_or(i64::MAX);
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
    .bind(PIECE)
    .fetch_all(&mut *tx.db)
    .await?;
    for row in &rows {
        let Some(run) = row.try_get::<Option<i64>, _>("run")? else { continue };
        delete_unnamed(tx, run).await?;
    }
    Ok(rows.len() as u64)
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

/// Drops results until so many bytes are free, or as many as are dropped in one piece; what they
/// were computed from stays.
async fn evict(tx: &mut Transaction<'_>, excess: u64) -> Result<u64, Error> {
    let rows: Vec<(Vec<u8>, i64)> = sqlx::query_as(
        "SELECT key, size FROM result INDEXED BY result_unread
         WHERE NOT pinned AND evicted IS NULL ORDER BY last_access LIMIT ?1",
    )
    .bind(PIECE)
    .fetch_all(&mut *tx.db)
    .await?;
    let (mut freed, mut count) = (0, 0);
    for (key, size) in rows {
        if freed >= excess {
            break;
        }
        sqlx::query(
            "UPDATE result SET evicted = ?2, scenario = (
                 SELECT iif(json_valid(CAST(body AS TEXT)),
                     json_extract(CAST(body AS TEXT), '$.scenario'), NULL)
                 FROM result_blob WHERE result_blob.key = result.key
             ) WHERE key = ?1",
        )
        .bind(&key)
        .bind(tx.now)
        .execute(&mut *tx.db)
        .await?;
        sqlx::query("DELETE FROM result_blob WHERE key = ?1")
            .bind(&key)
            .execute(&mut *tx.db)
            .await?;
        freed += u64::try_from(size).unwrap_or(0);
        count += 1;
    }
    if count > 0 {
        tracing::info!(results = count, bytes = freed, "dropped the results unread for longest");
        tx.effects.push(Effect::Evicted(count));
    }
    Ok(count)
}
