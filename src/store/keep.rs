//! Changes to results: storing, pinning, notes, deletion.

use std::sync::{Arc, LazyLock};

use sha2::{Digest, Sha256};
use sqlx::{AssertSqlSafe, Row as _, SqliteConnection};

use super::body::Body;
use super::error::Error;
use super::outline;
use super::row::RunId;
use super::transaction::Transaction;
use crate::job::{Answer, Cost, Key, Outline};

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

/// A result to be stored: compressed and hashed, outside of the writer task.
#[derive(Debug)]
pub struct Answered {
    pub(super) body: Body,
    /// Number of bytes of the JSON.
    pub(super) size: usize,
    pub(super) summary: String,
    pub(super) digest: [u8; 32],
    outline: Box<Outline>,
    /// `None` if unknown.
    cost: Option<Cost>,
}

/// The provenance of a result to be stored.
pub(super) struct Source<'a> {
    /// The run that it ends, and the attempt; `None` for an imported result.
    pub(super) run: Option<(RunId, u32)>,
    pub(super) task: &'a str,
    /// The owner; `None` for the owner of the run.
    pub(super) owner: Option<&'a str>,
    pub(super) trace: Option<&'a str>,
    /// The row in the table `program`.
    pub(super) program: Option<i64>,
}

/// What [`Answered::keep`] did.
pub(super) struct Kept {
    /// When the run began that is now ended; `None` without a run, or if the worker has lost it.
    pub(super) started: Option<i64>,
    pub(super) finish: Finish,
    /// If the key had a result before, stored or evicted: whether it was the same.
    pub(super) same: Option<bool>,
}

/// All statements that end a run with its result. One call of the database takes less time than its statements.
///
/// `changes()` is the number of rows that the statement before has changed. So everything is stored or nothing: the run
/// must be ended by this call, and a result that is stored already stays.
static KEEP: LazyLock<Arc<str>> = LazyLock::new(|| {
    let outline = outline::insert("WHERE changes() = 1 AND result.key = $4", 16);
    let statements = format!(
        "SELECT digest = $5 AS same, evicted IS NULL AS held FROM result WHERE key = $4;
         UPDATE run SET state = 'succeeded', progress = 1, finished = $3, changed = $3
         WHERE id = $1 AND attempt = $2 AND state = 'running' RETURNING started;
         INSERT INTO result (key, size, stored, summary, digest, created, last_access, computed, checksum,
             owner, job, trace, wall, cpu, program)
         SELECT $4, $7, length($6), $8, $5, $3, $3, $3, $9, coalesce($11, (SELECT owner FROM run WHERE id = $1)),
             (SELECT min(id) FROM job WHERE run = $1), $12, $13, $14, $15
         WHERE $1 IS NULL OR changes() = 1
         ON CONFLICT (key) DO UPDATE SET size = excluded.size, stored = excluded.stored,
             summary = excluded.summary, digest = excluded.digest, last_access = excluded.last_access,
             computed = excluded.computed, checksum = excluded.checksum, owner = excluded.owner,
             job = excluded.job, trace = excluded.trace, wall = excluded.wall, cpu = excluded.cpu,
             program = excluded.program, imported = NULL, imported_from = NULL, deleted_by = NULL,
             evicted = NULL
         WHERE evicted IS NOT NULL;
         INSERT OR REPLACE INTO result_blob (key, body) SELECT $4, $6 WHERE changes() = 1;
         INSERT INTO result_task (key, task) SELECT $4, $10 WHERE changes() = 1
         ON CONFLICT (key) DO UPDATE SET task = excluded.task;
         {outline}"
    );
    statements.into()
});

impl Answered {
    /// Compresses and hashes an answer. Large answers take long, so do not call this in the writer task.
    ///
    /// # Panics
    /// There is no memory for the compressor.
    #[must_use]
    #[expect(clippy::expect_used, reason = "a result must not be lost silently")]
    pub fn new(answer: &Answer, cost: Option<Cost>) -> Self {
        Self {
            body: Body::pack(&answer.body).expect("any bytes can be compressed"),
            size: answer.body.len(),
            summary: answer.summary.to_string(),
            digest: Sha256::digest(&answer.body).into(),
            outline: answer.outline.clone(),
            cost,
        }
    }

    /// Stores the result, unless one with the same key is stored, and ends its run. The digest is compared with that of
    /// a stored or evicted result of the key.
    pub(super) async fn keep(
        &self,
        db: &mut SqliteConnection,
        key: Key,
        source: &Source<'_>,
        now: i64,
    ) -> Result<Kept, Error> {
        let (run, attempt) = source.run.unzip();
        let query = sqlx::query(AssertSqlSafe(Arc::clone(&KEEP)))
            .bind(run.map(|run| run.0))
            .bind(attempt)
            .bind(now)
            .bind(key.bytes().as_slice())
            .bind(self.digest.as_slice())
            .bind(&**self.body.bytes())
            .bind((self.size as u64).cast_signed())
            .bind(&self.summary)
            .bind(self.body.checksum())
            .bind(source.task)
            .bind(source.owner)
            .bind(source.trace)
            .bind(self.cost.map(|cost| cost.wall.as_secs_f64()))
            .bind(self.cost.and_then(|cost| cost.cpu).map(|cpu| cpu.as_secs_f64()))
            .bind(source.program);
        let rows = outline::bind(query, &self.outline).fetch_all(&mut *db).await?;
        let (mut before, mut started) = (None, None);
        for row in &rows {
            match row.try_get("started") {
                Ok(at) => started = at,
                Err(_) => before = Some((row.try_get("same")?, row.try_get("held")?)),
            }
        }
        let finish = match before {
            _ if run.is_some() && started.is_none() => Finish::Refused,
            Some((true, true)) => {
                self.repair(db, key).await?;
                Finish::Same
            }
            Some((false, true)) => Finish::Differs,
            Some((_, false)) | None => Finish::Stored,
        };
        Ok(Kept { started, finish, same: before.map(|(same, _)| same) })
    }

    /// Writes the body again. If the stored body was damaged on the disk, this repairs it.
    async fn repair(&self, db: &mut SqliteConnection, key: Key) -> Result<(), Error> {
        sqlx::query(
            "UPDATE result_blob SET body = $2 WHERE key = $1;
             UPDATE result SET checksum = $3, stored = length($2) WHERE key = $1",
        )
        .bind(key.bytes().as_slice())
        .bind(&**self.body.bytes())
        .bind(self.body.checksum())
        .execute(db)
        .await?;
        Ok(())
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
