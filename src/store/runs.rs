//! What workers do with runs.
//!
//! A worker's verbs name the run *and* the attempt: a worker that was given up changes nothing.

use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::Error;
use super::keep::{Answered, Source};
use super::queue::Queue;
use super::read::{self, key};
use super::signals::{Effect, Stop};
use super::tally::Ending;
use super::writer::{Transaction, Verb};
use crate::job::{FailureKind, Key};

/// Names one run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct RunId(pub(super) i64);

/// A run that a worker has taken.
#[derive(Debug, Clone)]
pub struct Claimed {
    /// Its name.
    pub run: RunId,
    /// Which attempt this is, from 1: what the worker reports is fenced by it.
    pub attempt: u32,
    /// The address of the result.
    pub key: Key,
    /// What to compute, in its stored form.
    pub task: String,
    /// The request that submitted it, for the log.
    pub trace: Option<String>,
    /// Raised once nobody wants the result any more.
    pub stop: Stop,
}

/// What became of a finished run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finish {
    /// The result is stored.
    Stored,
    /// The same result was there already.
    Same,
    /// A different result was there already, and stays: a fault, logged.
    Differs,
    /// The run is no longer this worker's to finish; nothing was stored.
    Refused,
}

/// What was found unfinished at the start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Recovered {
    /// Runs that were interrupted and wait again.
    pub requeued: u64,
    /// Runs that were interrupted too often and have failed.
    pub failed: u64,
    /// Runs that were being canceled and now are.
    pub canceled: u64,
}

/// A run that took the process down with it this often is given up.
const LOST_AT_MOST: u32 = 3;

pub(super) struct Claim;

impl Verb for Claim {
    type Answer = Option<Claimed>;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Self::Answer, Error> {
        let Some(run) = tx.queue.take() else { return Ok(None) };
        let row = sqlx::query(
            "UPDATE run SET state = 'running', attempt = attempt + 1, progress = 0, started = ?2,
                 changed = ?2
             WHERE id = ?1 AND state = 'queued' RETURNING attempt, key, task, trace",
        )
        .bind(run.0)
        .bind(tx.now)
        .fetch_one(&mut *tx.db)
        .await?;
        let claimed = Claimed {
            run,
            attempt: row.try_get("attempt")?,
            key: key(&row, "key")?,
            task: row.try_get("task")?,
            trace: row.try_get("trace")?,
            stop: Stop::default(),
        };
        tx.effects.push(Effect::Started(claimed.run, claimed.stop.clone()));
        tx.effects.push(Effect::Changed(claimed.key));
        Ok(Some(claimed))
    }
}

pub(super) struct Progress {
    pub(super) run: RunId,
    pub(super) attempt: u32,
    pub(super) share: f64,
}

impl Verb for Progress {
    type Answer = bool;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<bool, Error> {
        let row = sqlx::query(
            "UPDATE run SET progress = ?3 WHERE id = ?1 AND attempt = ?2 AND state = 'running'
             RETURNING key",
        )
        .bind(self.run.0)
        .bind(self.attempt)
        // NaN would be null: no share at all.
        .bind(if self.share.is_nan() { 0.0 } else { self.share.clamp(0.0, 1.0) })
        .fetch_optional(&mut *tx.db)
        .await?;
        let Some(row) = row else { return Ok(false) };
        tx.effects.push(Effect::Changed(key(&row, "key")?));
        Ok(true)
    }
}

pub(super) struct FinishRun {
    pub(super) run: RunId,
    pub(super) attempt: u32,
    pub(super) answer: Answered,
}

impl Verb for FinishRun {
    type Answer = Finish;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Finish, Error> {
        finish(tx, self.run, self.attempt, &self.answer).await
    }
}

/// Ends a run by its answer: the one way to finish a job.
pub(super) async fn finish(
    tx: &mut Transaction<'_>,
    run: RunId,
    attempt: u32,
    answer: &Answered,
) -> Result<Finish, Error> {
    let row = sqlx::query(
        "UPDATE run SET state = 'succeeded', progress = 1, finished = ?3, changed = ?3
         WHERE id = ?1 AND attempt = ?2 AND state = 'running'
         RETURNING id, key, started, task, owner, trace,
             (SELECT min(id) FROM job WHERE job.run = run.id) AS job",
    )
    .bind(run.0)
    .bind(attempt)
    .bind(tx.now)
    .fetch_optional(&mut *tx.db)
    .await?;
    let (Some(row), Some(key)) = (&row, ended(tx, row.as_ref(), Ending::Succeeded)?) else {
        return Ok(Finish::Refused);
    };
    let job: Option<&[u8]> = row.try_get("job")?;
    let source = Source {
        task: row.try_get("task")?,
        owner: Some(row.try_get("owner")?),
        job: job.map(read::job_id).transpose()?,
        trace: row.try_get("trace")?,
        program: Some(tx.program),
    };
    answer.keep(tx, key, &source).await
}

pub(super) struct Fail {
    pub(super) run: RunId,
    pub(super) attempt: u32,
    pub(super) kind: FailureKind,
    pub(super) message: String,
}

impl Verb for Fail {
    type Answer = bool;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<bool, Error> {
        let row = sqlx::query(
            "UPDATE run SET state = 'failed', finished = ?3, changed = ?3, error_kind = ?4,
                 error = ?5
             WHERE id = ?1 AND attempt = ?2 AND state = 'running' RETURNING id, key, started",
        )
        .bind(self.run.0)
        .bind(self.attempt)
        .bind(tx.now)
        .bind(self.kind.as_str())
        .bind(&self.message)
        .fetch_optional(&mut *tx.db)
        .await?;
        Ok(ended(tx, row.as_ref(), Ending::Failed)?.is_some())
    }
}

pub(super) struct Stopped {
    pub(super) run: RunId,
    pub(super) attempt: u32,
}

impl Verb for Stopped {
    type Answer = bool;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<bool, Error> {
        let row = sqlx::query(
            "UPDATE run SET state = 'canceled', finished = ?3, changed = ?3
             WHERE id = ?1 AND attempt = ?2 AND state = 'canceling' RETURNING id, key, started",
        )
        .bind(self.run.0)
        .bind(self.attempt)
        .bind(tx.now)
        .fetch_optional(&mut *tx.db)
        .await?;
        Ok(ended(tx, row.as_ref(), Ending::Canceled)?.is_some())
    }
}

pub(super) struct Release {
    pub(super) run: RunId,
    pub(super) attempt: u32,
}

impl Verb for Release {
    type Answer = bool;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<bool, Error> {
        let row = sqlx::query(
            "UPDATE run SET state = 'queued', progress = 0, started = NULL, changed = ?3
             WHERE id = ?1 AND attempt = ?2 AND state = 'running' RETURNING id, key, started",
        )
        .bind(self.run.0)
        .bind(self.attempt)
        .bind(tx.now)
        .fetch_optional(&mut *tx.db)
        .await?;
        let released = ended(tx, row.as_ref(), Ending::Released)?.is_some();
        if released {
            let jobs: Vec<(String, u8, Vec<u8>)> = sqlx::query_as(
                "SELECT owner, priority, id FROM job WHERE run = ?1 AND finished IS NULL",
            )
            .bind(self.run.0)
            .fetch_all(&mut *tx.db)
            .await?;
            for (owner, priority, id) in jobs {
                tx.queue.add(self.run, &owner, priority, read::job_id(&id)?);
            }
            tx.effects.push(Effect::Queued);
        }
        Ok(released)
    }
}

pub(super) struct Recover;

impl Verb for Recover {
    type Answer = Recovered;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Recovered, Error> {
        let canceled = sqlx::query(
            "UPDATE run SET state = 'canceled', finished = ?1, changed = ?1
             WHERE state = 'canceling' AND finished IS NULL RETURNING key",
        )
        .bind(tx.now)
        .fetch_all(&mut *tx.db)
        .await?;
        let failed = sqlx::query(
            "UPDATE run SET state = 'failed', lost = lost + 1, finished = ?1, changed = ?1,
                 error_kind = ?2, error = ?3
             WHERE state = 'running' AND finished IS NULL AND lost + 1 >= ?4 RETURNING key",
        )
        .bind(tx.now)
        .bind(FailureKind::WorkerLost.as_str())
        .bind(format!("the server died {LOST_AT_MOST} times while computing this"))
        .bind(LOST_AT_MOST)
        .fetch_all(&mut *tx.db)
        .await?;
        let requeued = sqlx::query(
            "UPDATE run SET state = 'queued', lost = lost + 1, progress = 0, started = NULL,
                 changed = ?1
             WHERE state = 'running' AND finished IS NULL RETURNING key",
        )
        .bind(tx.now)
        .fetch_all(&mut *tx.db)
        .await?;
        let counts = Recovered {
            requeued: requeued.len() as u64,
            failed: failed.len() as u64,
            canceled: canceled.len() as u64,
        };
        for (rows, ending) in
            [(canceled, Ending::Canceled), (failed, Ending::Failed), (requeued, Ending::Released)]
        {
            for row in rows {
                // How long the server was down is not how long they took.
                let key = key(&row, "key")?;
                tx.effects.extend([Effect::Ended(key), Effect::Settled(ending, None)]);
            }
        }
        *tx.queue = Queue::load(tx.db).await?;
        tx.effects.push(Effect::Queued);
        Ok(counts)
    }
}

/// After a statement that took a run from its worker: its stop flag is forgotten, and those who
/// wait are told. Returns the key if there was such a run.
fn ended(
    tx: &mut Transaction<'_>,
    row: Option<&SqliteRow>,
    how: Ending,
) -> Result<Option<Key>, Error> {
    let Some(row) = row else { return Ok(None) };
    let (run, key) = (RunId(row.try_get("id")?), key(row, "key")?);
    let started: Option<i64> = row.try_get("started")?;
    tx.queue.end(run);
    tx.effects.push(Effect::LetGo(run));
    tx.effects.push(Effect::Ended(key));
    tx.effects.push(Effect::Settled(how, started.map(|started| tx.now - started)));
    Ok(Some(key))
}
