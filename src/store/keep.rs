//! Changes to results: storing, pinning, notes, deletion.

use bytes::Bytes;
use sha2::{Digest, Sha256};
use sqlx::SqliteConnection;

use super::error::Error;
use super::outline;
use super::row::checksum;
use super::signals::Effect;
use super::transaction::Transaction;
use crate::job::{Answer, Cost, JobId, Key, Outline};

/// What happened to the result of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finish {
    /// It is stored.
    Stored,
    /// The same result was stored before.
    Same,
    /// A different result was stored before, and stays. This is a defect, and it is logged.
    Differs,
    /// The worker has lost the run. The result is not stored.
    Refused,
}

/// What a request to delete a result did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Removed {
    /// There is no such result, or it was evicted or deleted before.
    NotFound,
    /// It is pinned.
    Pinned,
    /// Its body is deleted. Its scenario stays known.
    Done,
}

/// A result to be stored.
pub(super) struct Answered {
    pub(super) body: Bytes,
    pub(super) summary: String,
    pub(super) digest: [u8; 32],
    pub(super) outline: Box<Outline>,
    /// `None` if unknown.
    pub(super) cost: Option<Cost>,
}

/// The provenance of a result to be stored.
pub(super) struct Source<'a> {
    pub(super) task: &'a str,
    pub(super) owner: Option<&'a str>,
    pub(super) job: Option<JobId>,
    pub(super) trace: Option<&'a str>,
    /// The row in the table `program`.
    pub(super) program: Option<i64>,
}

/// Stores a result. If a result with the same key was evicted, its row is replaced, except `created`.
///
/// sqlx counts the arguments of each statement by its largest parameter number. So the parameters that
/// several statements share have the smallest numbers.
const INSERT: &str = "
    INSERT INTO result (key, size, summary, digest, created, last_access, computed, checksum, owner,
        job, trace, wall, cpu, program)
    VALUES (?1, length(?2), ?4, ?5, ?6, ?6, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13)
    ON CONFLICT DO UPDATE SET size = excluded.size, summary = excluded.summary,
        digest = excluded.digest, last_access = excluded.last_access, computed = excluded.computed,
        checksum = excluded.checksum, owner = excluded.owner, job = excluded.job,
        trace = excluded.trace, wall = excluded.wall, cpu = excluded.cpu,
        program = excluded.program, imported = NULL, imported_from = NULL, deleted_by = NULL,
        evicted = NULL;
    INSERT OR REPLACE INTO result_blob (key, body) VALUES (?1, ?2);
    INSERT INTO result_task (key, task) VALUES (?1, ?3)
    ON CONFLICT (key) DO UPDATE SET task = excluded.task";

impl Answered {
    pub(super) fn new(answer: &Answer, cost: Option<Cost>) -> Self {
        let Answer { body, summary, outline } = answer.clone();
        let digest = Sha256::digest(&body).into();
        Self { body, summary: summary.to_string(), digest, outline, cost }
    }

    /// Stores the result, unless one with the same key is stored. The digest is compared with that of a stored or
    /// evicted result of the key.
    pub(super) async fn keep(
        &self,
        tx: &mut Transaction,
        key: Key,
        source: &Source<'_>,
    ) -> Result<Finish, Error> {
        let before: Option<(bool, bool)> =
            sqlx::query_as("SELECT digest = ?2, evicted IS NULL FROM result WHERE key = ?1")
                .bind(key.bytes().as_slice())
                .bind(self.digest.as_slice())
                .fetch_optional(&mut tx.db)
                .await?;
        if let Some((same, _)) = before {
            tx.effects.push(Effect::Recomputed { key, same });
        }
        match before {
            Some((true, true)) => {
                // If the stored body was damaged on the disk, this repairs it.
                sqlx::query(
                    "UPDATE result_blob SET body = ?2 WHERE key = ?1;
                     UPDATE result SET checksum = ?3 WHERE key = ?1",
                )
                .bind(key.bytes().as_slice())
                .bind(&*self.body)
                .bind(checksum(&self.body))
                .execute(&mut tx.db)
                .await?;
                Ok(Finish::Same)
            }
            Some((false, true)) => Ok(Finish::Differs),
            Some((_, false)) | None => {
                self.insert(&mut tx.db, key, source, tx.now).await?;
                tx.effects.push(Effect::Stored(self.body.len() as u64));
                Ok(Finish::Stored)
            }
        }
    }

    /// Stores the result and its outline. The key must have no body.
    pub(super) async fn insert(
        &self,
        db: &mut SqliteConnection,
        key: Key,
        source: &Source<'_>,
        now: i64,
    ) -> Result<(), Error> {
        sqlx::query(INSERT)
            .bind(key.bytes().as_slice())
            .bind(&*self.body)
            .bind(source.task)
            .bind(&self.summary)
            .bind(self.digest.as_slice())
            .bind(now)
            .bind(checksum(&self.body))
            .bind(source.owner)
            .bind(source.job.map(|job| job.0.as_bytes().to_vec()))
            .bind(source.trace)
            .bind(self.cost.map(|cost| cost.wall.as_secs_f64()))
            .bind(self.cost.and_then(|cost| cost.cpu).map(|cpu| cpu.as_secs_f64()))
            .bind(source.program)
            .execute(&mut *db)
            .await?;
        outline::write(db, key, &self.outline).await
    }
}

/// Pins or unpins a result. Returns whether there is such a result.
pub(super) async fn pin((key, pinned): &(Key, bool), tx: &mut Transaction) -> Result<bool, Error> {
    let done = sqlx::query("UPDATE result SET pinned = ?2 WHERE key = ?1 AND evicted IS NULL")
        .bind(key.bytes().as_slice())
        .bind(pinned)
        .execute(&mut tx.db)
        .await?;
    Ok(done.rows_affected() > 0)
}

/// Writes the note of a result, or removes it. Returns whether there is such a result; it may be evicted.
pub(super) async fn annotate(
    (key, text, owner): &(Key, Option<String>, String),
    tx: &mut Transaction,
) -> Result<bool, Error> {
    let key = key.bytes().as_slice();
    let known: bool = sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM result WHERE key = ?1)")
        .bind(key)
        .fetch_one(&mut tx.db)
        .await?;
    if !known {
        return Ok(false);
    }
    let change = match text {
        Some(text) => sqlx::query(
            "INSERT OR REPLACE INTO note (key, text, owner, at) VALUES (?1, ?2, ?3, ?4)",
        )
        .bind(key)
        .bind(text)
        .bind(owner)
        .bind(tx.now),
        None => sqlx::query("DELETE FROM note WHERE key = ?1").bind(key),
    };
    change.execute(&mut tx.db).await?;
    Ok(true)
}

/// Deletes the body of a result. Its scenario and its jobs stay.
pub(super) async fn remove(
    (key, owner): &(Key, String),
    tx: &mut Transaction,
) -> Result<Removed, Error> {
    let key = key.bytes().as_slice();
    let found: Option<(bool, bool)> =
        sqlx::query_as("SELECT evicted IS NULL, pinned FROM result WHERE key = ?1")
            .bind(key)
            .fetch_optional(&mut tx.db)
            .await?;
    match found {
        None | Some((false, _)) => return Ok(Removed::NotFound),
        Some((true, true)) => return Ok(Removed::Pinned),
        Some((true, false)) => {}
    }
    sqlx::query(
        "UPDATE result SET evicted = ?2, deleted_by = ?3 WHERE key = ?1;
         DELETE FROM result_blob WHERE key = ?1",
    )
    .bind(key)
    .bind(tx.now)
    .bind(owner)
    .execute(&mut tx.db)
    .await?;
    Ok(Removed::Done)
}
