//! The verbs of a job's life, each a few statements inside the writer's transaction.
//!
//! A worker's verbs name the run *and* the attempt: a worker that was given up changes nothing.

use serde_json::Value;
use sha2::{Digest, Sha256};
use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::read::{self, json, key, word};
use super::signals::{Effect, Stop};
use super::writer::{Transaction, Verb};
use super::{Canceled, Claimed, Error, Finish, NewJob, Recovered, RunId};
use crate::job::{Answer, FailureKind, Job, JobId, Key, Origin};

/// A run that took the process down with it this often is given up.
const LOST_AT_MOST: u32 = 3;

pub(super) struct Submit {
    job: NewJob,
    tags: String,
    warnings: Value,
}

impl Submit {
    pub(super) fn new(job: NewJob) -> Self {
        let tags = Value::from(job.tags.clone()).to_string();
        let warnings = serde_json::to_value(&job.warnings).unwrap_or_else(|_| Value::Array(vec![]));
        Self { job, tags, warnings }
    }
}

/// A run if there is neither a result nor a live run; then the job, by what there is now. The
/// second statement tells by `changes()` whether the first inserted a run.
const SUBMIT: &str = "
    INSERT INTO run (key, owner, created, task, state)
    SELECT ?1, ?2, ?3, ?4, 'queued' WHERE NOT EXISTS (SELECT 1 FROM result WHERE key = ?1)
    ON CONFLICT (key) WHERE state IN ('queued', 'running') DO NOTHING;

    INSERT INTO job (key, owner, created, id, label, tags, warnings, run, state, attempt, origin,
        started, finished)
    SELECT ?1, ?2, ?3, ?5, ?6, ?7, ?8, run.id, coalesce(run.state, 'succeeded'),
        coalesce(run.attempt, 0),
        CASE WHEN run.id IS NULL THEN 'cached' WHEN changes() THEN 'computed' ELSE 'coalesced' END,
        iif(run.state = 'queued', NULL, ?3), iif(run.id IS NULL, ?3, NULL)
    FROM (SELECT 1) LEFT JOIN run ON run.key = ?1 AND run.state IN ('queued', 'running')
        AND NOT EXISTS (SELECT 1 FROM result WHERE key = ?1)
    RETURNING state, attempt, origin, started, finished,
        (SELECT progress FROM run WHERE run.id = job.run) AS progress,
        (SELECT summary FROM result WHERE result.key = job.key) AS summary";

impl Verb for Submit {
    type Answer = Job;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Job, Error> {
        let new = &self.job;
        let row = sqlx::query(SUBMIT)
            .bind(new.key.bytes().as_slice())
            .bind(&new.owner)
            .bind(tx.now)
            .bind(&new.task)
            .bind(new.id.0.as_bytes().as_slice())
            .bind(&new.label)
            .bind(&self.tags)
            .bind(self.warnings.to_string())
            .fetch_one(&mut *tx.db)
            .await
            .map_err(|error| match error.as_database_error() {
                Some(refusal) if refusal.is_unique_violation() => Error::JobExists(new.id),
                _ => error.into(),
            })?;
        let origin = word(&row, "origin")?;
        if origin == Origin::Computed {
            tx.effects.push(Effect::Queued);
        }
        Ok(Job {
            id: new.id,
            state: word(&row, "state")?,
            key: new.key,
            owner: new.owner.clone(),
            origin,
            attempt: row.try_get("attempt")?,
            progress: row.try_get::<Option<f64>, _>("progress")?.unwrap_or(1.0),
            label: new.label.clone(),
            tags: new.tags.clone(),
            warnings: self.warnings.clone(),
            created: tx.now,
            started: row.try_get("started")?,
            finished: row.try_get("finished")?,
            failure: None,
            summary: row.try_get::<Option<&str>, _>("summary")?.map(json).transpose()?,
        })
    }
}

pub(super) struct Claim;

impl Verb for Claim {
    type Answer = Option<Claimed>;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Self::Answer, Error> {
        // Without the index named, the planner walks the table in the order of ids, past every
        // run that ever finished.
        let row = sqlx::query(
            "UPDATE run SET state = 'running', attempt = attempt + 1, progress = 0, started = ?1
             WHERE id = (
                 SELECT id FROM run INDEXED BY run_unfinished
                 WHERE state = 'queued' AND finished IS NULL ORDER BY id LIMIT 1
             )
             RETURNING id, attempt, key, task",
        )
        .bind(tx.now)
        .fetch_optional(&mut *tx.db)
        .await?;
        let Some(row) = row else { return Ok(None) };
        let claimed = Claimed {
            run: RunId(row.try_get("id")?),
            attempt: row.try_get("attempt")?,
            key: key(&row, "key")?,
            task: row.try_get("task")?,
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

pub(super) struct Finished {
    run: RunId,
    attempt: u32,
    body: Vec<u8>,
    summary: String,
    digest: [u8; 32],
}

impl Finished {
    pub(super) fn new(run: RunId, attempt: u32, answer: &Answer) -> Self {
        let Answer { body, summary } = answer;
        let digest = Sha256::digest(body).into();
        Self { run, attempt, body: body.clone(), summary: summary.to_string(), digest }
    }

    async fn keep(&self, tx: &mut Transaction<'_>, key: Key) -> Result<Finish, Error> {
        let inserted = sqlx::query(
            "INSERT INTO result (key, summary, digest, size, created) VALUES (?1, ?2, ?3, ?4, ?5)
             ON CONFLICT DO NOTHING",
        )
        .bind(key.bytes().as_slice())
        .bind(&self.summary)
        .bind(self.digest.as_slice())
        .bind(i64::try_from(self.body.len()).unwrap_or(i64::MAX))
        .bind(tx.now)
        .execute(&mut *tx.db)
        .await?;
        if inserted.rows_affected() == 0 {
            return self.compare(tx, key).await;
        }
        sqlx::query("INSERT INTO result_blob (key, body) VALUES (?1, ?2)")
            .bind(key.bytes().as_slice())
            .bind(&self.body)
            .execute(&mut *tx.db)
            .await?;
        Ok(Finish::Stored)
    }

    async fn compare(&self, tx: &mut Transaction<'_>, key: Key) -> Result<Finish, Error> {
        let same = sqlx::query_scalar("SELECT digest = ?2 FROM result WHERE key = ?1")
            .bind(key.bytes().as_slice())
            .bind(self.digest.as_slice())
            .fetch_one(&mut *tx.db)
            .await?;
        if same {
            return Ok(Finish::Same);
        }
        tracing::error!(%key, "computed again, a result differs; the stored one stays");
        Ok(Finish::Differs)
    }
}

impl Verb for Finished {
    type Answer = Finish;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Finish, Error> {
        let row = sqlx::query(
            "UPDATE run SET state = 'succeeded', progress = 1, finished = ?3
             WHERE id = ?1 AND attempt = ?2 AND state = 'running' RETURNING id, key",
        )
        .bind(self.run.0)
        .bind(self.attempt)
        .bind(tx.now)
        .fetch_optional(&mut *tx.db)
        .await?;
        let Some(key) = ended(tx, row.as_ref())? else {
            return Ok(Finish::Refused);
        };
        self.keep(tx, key).await
    }
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
            "UPDATE run SET state = 'failed', finished = ?3, error_kind = ?4, error = ?5
             WHERE id = ?1 AND attempt = ?2 AND state = 'running' RETURNING id, key",
        )
        .bind(self.run.0)
        .bind(self.attempt)
        .bind(tx.now)
        .bind(self.kind.as_str())
        .bind(&self.message)
        .fetch_optional(&mut *tx.db)
        .await?;
        Ok(ended(tx, row.as_ref())?.is_some())
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
            "UPDATE run SET state = 'canceled', finished = ?3
             WHERE id = ?1 AND attempt = ?2 AND state = 'canceling' RETURNING id, key",
        )
        .bind(self.run.0)
        .bind(self.attempt)
        .bind(tx.now)
        .fetch_optional(&mut *tx.db)
        .await?;
        Ok(ended(tx, row.as_ref())?.is_some())
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
            "UPDATE run SET state = 'queued', progress = 0, started = NULL
             WHERE id = ?1 AND attempt = ?2 AND state = 'running' RETURNING id, key",
        )
        .bind(self.run.0)
        .bind(self.attempt)
        .fetch_optional(&mut *tx.db)
        .await?;
        let released = ended(tx, row.as_ref())?.is_some();
        if released {
            tx.effects.push(Effect::Queued);
        }
        Ok(released)
    }
}

pub(super) struct Cancel(pub(super) JobId);

impl Verb for Cancel {
    type Answer = Canceled;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Canceled, Error> {
        let Some(job) = read::job(&mut *tx.db, self.0).await? else {
            return Ok(Canceled::NotFound);
        };
        if job.state.is_finished() {
            return Ok(Canceled::AlreadyFinished(job));
        }
        let (run, others): (i64, bool) = sqlx::query_as(
            "SELECT run, EXISTS (
                 SELECT 1 FROM job AS other
                 WHERE other.run = job.run AND other.finished IS NULL AND other.id <> job.id
             ) FROM job WHERE id = ?1",
        )
        .bind(self.0.0.as_bytes().as_slice())
        .fetch_one(&mut *tx.db)
        .await?;
        let run = RunId(run);
        if others {
            sqlx::query("UPDATE job SET state = 'canceled', finished = ?2 WHERE id = ?1")
                .bind(self.0.0.as_bytes().as_slice())
                .bind(tx.now)
                .execute(&mut *tx.db)
                .await?;
        } else {
            // A run that is already canceling stays as it is, until its worker lets go.
            sqlx::query(
                "UPDATE run SET finished = iif(state = 'queued', ?2, NULL),
                     state = iif(state = 'queued', 'canceled', 'canceling')
                 WHERE id = ?1",
            )
            .bind(run.0)
            .bind(tx.now)
            .execute(&mut *tx.db)
            .await?;
            tx.effects.push(Effect::Unwanted(run));
        }
        tx.effects.push(Effect::Ended(job.key));
        let after = read::job(&mut *tx.db, self.0).await?;
        Ok(after.map_or(Canceled::NotFound, Canceled::Done))
    }
}

pub(super) struct Recover;

impl Verb for Recover {
    type Answer = Recovered;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Recovered, Error> {
        let canceled = sqlx::query(
            "UPDATE run SET state = 'canceled', finished = ?1
             WHERE state = 'canceling' AND finished IS NULL RETURNING id, key",
        )
        .bind(tx.now)
        .fetch_all(&mut *tx.db)
        .await?;
        let failed = sqlx::query(
            "UPDATE run SET state = 'failed', lost = lost + 1, finished = ?1, error_kind = ?2,
                 error = ?3
             WHERE state = 'running' AND finished IS NULL AND lost + 1 >= ?4 RETURNING id, key",
        )
        .bind(tx.now)
        .bind(FailureKind::WorkerLost.as_str())
        .bind(format!("the server died {LOST_AT_MOST} times while computing this"))
        .bind(LOST_AT_MOST)
        .fetch_all(&mut *tx.db)
        .await?;
        let requeued = sqlx::query(
            "UPDATE run SET state = 'queued', lost = lost + 1, progress = 0, started = NULL
             WHERE state = 'running' AND finished IS NULL RETURNING id, key",
        )
        .fetch_all(&mut *tx.db)
        .await?;
        let counts = Recovered {
            requeued: requeued.len() as u64,
            failed: failed.len() as u64,
            canceled: canceled.len() as u64,
        };
        for row in canceled.into_iter().chain(failed).chain(requeued) {
            ended(tx, Some(&row))?;
        }
        tx.effects.push(Effect::Queued);
        Ok(counts)
    }
}

/// After a statement that took a run from its worker: its stop flag is forgotten, and those who
/// wait are told. Returns the key if there was such a run.
fn ended(tx: &mut Transaction<'_>, row: Option<&SqliteRow>) -> Result<Option<Key>, Error> {
    let Some(row) = row else { return Ok(None) };
    let key = key(row, "key")?;
    tx.effects.push(Effect::LetGo(RunId(row.try_get("id")?)));
    tx.effects.push(Effect::Ended(key));
    Ok(Some(key))
}
