//! The verbs of a job's life, each a few statements inside the writer's transaction.
//!
//! A worker's verbs name the run *and* the attempt: a worker that was given up changes nothing.

use std::time::Duration;

use bytes::Bytes;
use serde_json::Value;
use sha2::{Digest, Sha256};
use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::queue::Queue;
use super::read::{self, json, key, word};
use super::signals::{Effect, Stop};
use super::tally::Ending;
use super::upkeep::delete_unnamed;
use super::writer::{Transaction, Verb};
use super::{
    Admission, Canceled, Claimed, Deleted, Error, Filter, Finish, NewJob, Recovered, RunId,
    Submitted,
};
use crate::job::{Answer, Change, FailureKind, Job, JobId, JobState, Key, Origin};

/// A run that took the process down with it this often is given up.
const LOST_AT_MOST: u32 = 3;

pub(super) struct Submit {
    job: NewJob,
    tags: String,
    warnings: Value,
    /// How many jobs may wait.
    limit: usize,
}

impl Submit {
    pub(super) fn new(job: NewJob, limit: usize) -> Self {
        let tags = Value::from(job.tags.clone()).to_string();
        let warnings = serde_json::to_value(&job.warnings).unwrap_or_else(|_| Value::Array(vec![]));
        Self { job, tags, warnings, limit }
    }

    /// The job that this submission made when it was first sent.
    async fn before(&self, tx: &mut Transaction<'_>) -> Result<Option<Submitted>, Error> {
        let Some(repeatable) = &self.job.repeatable else { return Ok(None) };
        let found: Option<(Vec<u8>, Vec<u8>)> = sqlx::query_as(
            "SELECT id, fingerprint FROM job WHERE owner = ?1 AND idempotency_key = ?2",
        )
        .bind(&self.job.owner)
        .bind(&repeatable.key)
        .fetch_optional(&mut *tx.db)
        .await?;
        let Some((id, fingerprint)) = found else { return Ok(None) };
        if fingerprint != repeatable.fingerprint {
            return Ok(Some(Submitted::Mistaken));
        }
        let job = read::job(&mut *tx.db, read::job_id(&id)?).await?;
        Ok(job.map(Submitted::Repeated))
    }

    /// Why this is not accepted, if it is not.
    async fn refusal(&self, tx: &mut Transaction<'_>) -> Result<Option<Submitted>, Error> {
        let Admission { only_known, too_expensive, unless_needed } = self.job.admission;
        // The last tenth of the queue is for those who have little in it, so that nobody can fill it
        // for all.
        let (queued, tenth) = (tx.queue.jobs(), self.limit / 10);
        let full = queued >= self.limit
            || (queued >= self.limit - tenth && tx.queue.waiting_of(&self.job.owner) >= tenth);
        if !only_known && !too_expensive && !unless_needed && !full {
            return Ok(None);
        }
        let Known { result, live, .. } = known(tx, self.job.key).await?;
        // What needs neither a worker nor a place in the queue is welcome all the same.
        Ok(match live.as_deref() {
            _ if result && !self.job.afresh => None,
            _ if only_known => Some(Submitted::Unknown),
            _ if too_expensive => Some(Submitted::TooExpensive),
            Some("running") => None,
            None if unless_needed => Some(Submitted::Needed),
            _ if full => Some(Submitted::Refused { queued }),
            _ => None,
        })
    }
}

/// What there is of a key.
#[derive(sqlx::FromRow)]
struct Known {
    /// Whether its result is there.
    result: bool,
    /// The state of its live run.
    live: Option<String>,
    /// The digest of its result, or of what it was before it was dropped.
    digest: Option<Vec<u8>>,
}

async fn known(tx: &mut Transaction<'_>, key: Key) -> Result<Known, Error> {
    let known = sqlx::query_as(
        "SELECT result.key IS NOT NULL AND result.evicted IS NULL AS result, run.state AS live,
             result.digest AS digest
         FROM (SELECT ?1 AS key) AS asked
         LEFT JOIN result ON result.key = asked.key
         LEFT JOIN run ON run.key = asked.key AND run.state IN ('queued', 'running')",
    )
    .bind(key.bytes().as_slice())
    .fetch_one(&mut *tx.db)
    .await?;
    Ok(known)
}

/// A run if there is neither a result (or it is not wanted) nor a live run; then the job, by what
/// there is now. The second statement tells by `changes()` whether the first inserted a run.
const SUBMIT: &str = "
    INSERT INTO run (id, key, owner, created, task, state, changed, trace)
    SELECT (SELECT runs + 1 FROM room), ?1, ?2, ?3, ?4, 'queued', ?3, ?6
    WHERE ?5 OR NOT EXISTS (SELECT 1 FROM result WHERE key = ?1 AND evicted IS NULL)
    ON CONFLICT (key) WHERE state IN ('queued', 'running') DO NOTHING;

    INSERT INTO job (key, owner, created, id, label, tags, warnings, priority, idempotency_key,
        fingerprint, run, state, attempt, origin, started, finished, changes)
    SELECT ?1, ?2, ?3, ?7, ?8, ?9, ?10, ?11, ?12, ?13, run.id, coalesce(run.state, 'succeeded'),
        coalesce(run.attempt, 0),
        CASE WHEN run.id IS NULL THEN 'cached' WHEN changes() THEN 'computed' ELSE 'coalesced' END,
        iif(run.state = 'queued', NULL, ?3), iif(run.id IS NULL, ?3, NULL),
        coalesce(run.state, 'succeeded') || ' ' || coalesce(run.attempt, 0) || ' ' || ?3
    FROM (SELECT 1) LEFT JOIN run ON run.key = ?1 AND run.state IN ('queued', 'running')
        AND (?5 OR NOT EXISTS (SELECT 1 FROM result WHERE key = ?1 AND evicted IS NULL))
    RETURNING run, state, attempt, origin, started, finished, changes,
        (SELECT progress FROM run WHERE run.id = job.run) AS progress,
        iif(state = 'succeeded', (SELECT summary FROM result WHERE result.key = job.key), NULL)
            AS summary";

impl Verb for Submit {
    type Answer = Submitted;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Submitted, Error> {
        let new = &self.job;
        if let Some(before) = self.before(tx).await? {
            return Ok(before);
        }
        if let Some(refusal) = self.refusal(tx).await? {
            return Ok(refusal);
        }
        let repeatable = new.repeatable.as_ref();
        let row = sqlx::query(SUBMIT)
            .bind(new.key.bytes().as_slice())
            .bind(&new.owner)
            .bind(tx.now)
            .bind(&new.task)
            .bind(new.afresh)
            .bind(&new.trace)
            .bind(new.id.0.as_bytes().as_slice())
            .bind(&new.label)
            .bind(&self.tags)
            .bind(self.warnings.to_string())
            .bind(new.priority)
            .bind(repeatable.map(|repeatable| &repeatable.key))
            .bind(repeatable.map(|repeatable| repeatable.fingerprint.as_slice()))
            .fetch_one(&mut *tx.db)
            .await
            .map_err(|error| match error.as_database_error() {
                Some(refusal) if refusal.is_unique_violation() => Error::JobExists(new.id),
                _ => error.into(),
            })?;
        let (origin, state) = (word(&row, "origin")?, word(&row, "state")?);
        if state == JobState::Queued {
            tx.queue.add(RunId(row.try_get("run")?), &new.owner, new.priority, new.id);
        }
        match origin {
            Origin::Computed => tx.effects.push(Effect::Queued),
            Origin::Cached => tx.effects.push(Effect::Read(new.key)),
            Origin::Coalesced => {}
        }
        tx.effects.push(Effect::Submitted(origin));
        Ok(Submitted::Accepted(Job {
            id: new.id,
            state,
            key: new.key,
            owner: new.owner.clone(),
            origin,
            attempt: row.try_get("attempt")?,
            progress: row.try_get::<Option<f64>, _>("progress")?.unwrap_or(1.0),
            priority: new.priority,
            label: new.label.clone(),
            tags: new.tags.clone(),
            warnings: self.warnings.clone(),
            created: tx.now,
            started: row.try_get("started")?,
            finished: row.try_get("finished")?,
            changes: read::changes(row.try_get("changes")?)?,
            failure: None,
            summary: row.try_get::<Option<&str>, _>("summary")?.map(json).transpose()?,
        }))
    }
}

/// Jobs whose answer has been computed before they were submitted.
pub(super) struct Record {
    jobs: Vec<Submit>,
    took: i64,
    answer: Kept,
}

impl Record {
    pub(super) fn new(jobs: Vec<Submit>, took: Duration, answer: &Answer) -> Self {
        let took = i64::try_from(took.as_millis()).unwrap_or(i64::MAX);
        Self { jobs, took, answer: Kept::new(answer) }
    }

    /// The run, its first job, and the result as [`Kept::keep`] stores it, in one go. Where a statement passes over numbers the library
    /// takes each for one more argument, up to as many as there are: so they stand in this order.
    const BEGIN: &str = "
        INSERT INTO run (id, key, owner, created, task, trace, started, finished, changed, state,
            attempt, progress)
        VALUES ((SELECT runs + 1 FROM room), ?1, ?8, ?9, ?7, ?10, ?9, ?3, ?3, 'succeeded', 1, 1);
        INSERT INTO job (key, owner, created, id, label, tags, warnings, priority, run, state,
            attempt, origin, started, finished, changes)
        VALUES (?1, ?8, ?9, ?11, ?12, ?13, ?14, ?15, last_insert_rowid(), 'succeeded', 1,
            'computed', ?9, ?3, ?16);
        INSERT INTO result (key, size, summary, digest, created, last_access, checksum)
        VALUES (?1, length(?2), ?4, ?5, ?3, ?3, ?6)
        ON CONFLICT DO UPDATE SET size = length(?2), summary = ?4, digest = ?5, last_access = ?3,
            checksum = ?6, evicted = NULL;
        INSERT OR REPLACE INTO result_blob (key, body) VALUES (?1, ?2);
        INSERT OR IGNORE INTO result_task (key, task) VALUES (?1, ?7)";
    /// Another job of that run.
    const JOIN: &str = "
        INSERT INTO job (key, owner, created, id, label, tags, warnings, priority, run, state,
            attempt, origin, started, finished, changes)
        SELECT ?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, run, 'succeeded', 1, 'coalesced', ?3, finished, changes
        FROM job WHERE id = ?9";

    async fn insert(
        &self,
        tx: &mut Transaction<'_>,
        first: &Submit,
        began: i64,
        changes: &str,
    ) -> Result<(), Error> {
        let (new, answer) = (&first.job, &self.answer);
        sqlx::query(Self::BEGIN)
            .bind(new.key.bytes().as_slice())
            .bind(&*answer.body)
            .bind(tx.now)
            .bind(&answer.summary)
            .bind(answer.digest.as_slice())
            .bind(read::checksum(&answer.body))
            .bind(&new.task)
            .bind(&new.owner)
            .bind(began)
            .bind(&new.trace)
            .bind(new.id.0.as_bytes().as_slice())
            .bind(&new.label)
            .bind(&first.tags)
            .bind(first.warnings.to_string())
            .bind(new.priority)
            .bind(changes)
            .execute(&mut *tx.db)
            .await?;
        tx.effects.push(Effect::Stored(answer.body.len() as u64));
        Ok(())
    }
}

impl Verb for Record {
    type Answer = Vec<Submitted>;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Self::Answer, Error> {
        let mut became = Vec::with_capacity(self.jobs.len());
        let Some(first) = self.jobs.first() else { return Ok(became) };
        let key = first.job.key;
        let Known { result, live, digest } = known(tx, key).await?;
        if result || live.is_some() {
            for job in &self.jobs {
                became.push(job.apply(tx).await?);
            }
            return Ok(became);
        }
        if let Some(before) = digest {
            let same = *before == self.answer.digest;
            tx.effects.push(Effect::Recomputed { key, same });
        }
        let began = tx.now - self.took;
        let changes = [
            (JobState::Queued, 0, began),
            (JobState::Running, 1, began),
            (JobState::Succeeded, 1, tx.now),
        ]
        .map(|(state, attempt, at)| Change { state, attempt, at });
        let lines = changes.map(|Change { state, attempt, at }| format!("{state} {attempt} {at}"));
        self.insert(tx, first, began, &lines.join("\n")).await?;
        let summary: Value = json(&self.answer.summary)?;
        for Submit { job: new, tags, warnings, .. } in &self.jobs {
            let origin = if became.is_empty() { Origin::Computed } else { Origin::Coalesced };
            if origin == Origin::Coalesced {
                sqlx::query(Self::JOIN)
                    .bind(new.key.bytes().as_slice())
                    .bind(&new.owner)
                    .bind(began)
                    .bind(new.id.0.as_bytes().as_slice())
                    .bind(&new.label)
                    .bind(tags)
                    .bind(warnings.to_string())
                    .bind(new.priority)
                    .bind(first.job.id.0.as_bytes().as_slice())
                    .execute(&mut *tx.db)
                    .await?;
            }
            tx.effects.push(Effect::Submitted(origin));
            became.push(Submitted::Accepted(Job {
                id: new.id,
                state: JobState::Succeeded,
                key,
                owner: new.owner.clone(),
                origin,
                attempt: 1,
                progress: 1.0,
                priority: new.priority,
                label: new.label.clone(),
                tags: new.tags.clone(),
                warnings: warnings.clone(),
                created: began,
                started: Some(began),
                finished: Some(tx.now),
                changes: changes.to_vec(),
                failure: None,
                summary: Some(summary.clone()),
            }));
        }
        tx.effects.push(Effect::Ended(key));
        tx.effects.push(Effect::Settled(Ending::Succeeded, Some(self.took)));
        Ok(became)
    }
}

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

/// An answer on its way into the tables.
struct Kept {
    body: Bytes,
    summary: String,
    digest: [u8; 32],
}

impl Kept {
    fn new(answer: &Answer) -> Self {
        let Answer { body, summary } = answer;
        let digest = Sha256::digest(body).into();
        Self { body: body.clone(), summary: summary.to_string(), digest }
    }

    /// Keeps the body, unless there is one. What an evicted result came to is remembered, so that
    /// a recompute is compared with it too.
    async fn keep(&self, tx: &mut Transaction<'_>, key: Key, task: &str) -> Result<Finish, Error> {
        let before: Option<(bool, bool)> =
            sqlx::query_as("SELECT digest = ?2, evicted IS NULL FROM result WHERE key = ?1")
                .bind(key.bytes().as_slice())
                .bind(self.digest.as_slice())
                .fetch_optional(&mut *tx.db)
                .await?;
        if let Some((same, _)) = before {
            tx.effects.push(Effect::Recomputed { key, same });
        }
        match before {
            Some((true, true)) => {
                // The same bytes, unless the disk has changed them since: then this repairs them.
                sqlx::query(
                    "UPDATE result_blob SET body = ?2 WHERE key = ?1;
                     UPDATE result SET checksum = ?3 WHERE key = ?1",
                )
                .bind(key.bytes().as_slice())
                .bind(&*self.body)
                .bind(read::checksum(&self.body))
                .execute(&mut *tx.db)
                .await?;
                return Ok(Finish::Same);
            }
            Some((false, true)) => return Ok(Finish::Differs),
            Some((_, false)) | None => {}
        }
        sqlx::query(
            "INSERT INTO result (key, size, summary, digest, created, last_access, checksum)
             VALUES (?1, length(?2), ?3, ?4, ?5, ?5, ?6)
             ON CONFLICT DO UPDATE SET size = length(?2), summary = ?3, digest = ?4,
                 last_access = ?5, checksum = ?6, evicted = NULL;
             INSERT OR REPLACE INTO result_blob (key, body) VALUES (?1, ?2);
             INSERT OR IGNORE INTO result_task (key, task) VALUES (?1, ?7)",
        )
        .bind(key.bytes().as_slice())
        .bind(&*self.body)
        .bind(&self.summary)
        .bind(self.digest.as_slice())
        .bind(tx.now)
        .bind(read::checksum(&self.body))
        .bind(task)
        .execute(&mut *tx.db)
        .await?;
        tx.effects.push(Effect::Stored(self.body.len() as u64));
        Ok(Finish::Stored)
    }
}

pub(super) struct Finished {
    run: RunId,
    attempt: u32,
    answer: Kept,
}

impl Finished {
    pub(super) fn new(run: RunId, attempt: u32, answer: &Answer) -> Self {
        Self { run, attempt, answer: Kept::new(answer) }
    }
}

impl Verb for Finished {
    type Answer = Finish;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Finish, Error> {
        let row = sqlx::query(
            "UPDATE run SET state = 'succeeded', progress = 1, finished = ?3, changed = ?3
             WHERE id = ?1 AND attempt = ?2 AND state = 'running'
             RETURNING id, key, started, task",
        )
        .bind(self.run.0)
        .bind(self.attempt)
        .bind(tx.now)
        .fetch_optional(&mut *tx.db)
        .await?;
        let (Some(row), Some(key)) = (&row, ended(tx, row.as_ref(), Ending::Succeeded)?) else {
            return Ok(Finish::Refused);
        };
        self.answer.keep(tx, key, row.try_get("task")?).await
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
        let id = self.0.0.as_bytes().as_slice();
        let (run, others): (i64, bool) = sqlx::query_as(
            "SELECT run, EXISTS (
                 SELECT 1 FROM job AS other
                 WHERE other.run = job.run AND other.finished IS NULL AND other.id <> job.id
             ) FROM job WHERE id = ?1",
        )
        .bind(id)
        .fetch_one(&mut *tx.db)
        .await?;
        let run = RunId(run);
        if others {
            sqlx::query(
                "UPDATE job SET state = 'canceled', finished = ?2,
                     changes = changes || char(10) || 'canceled ' || attempt || ' ' || ?2
                 WHERE id = ?1",
            )
            .bind(id)
            .bind(tx.now)
            .execute(&mut *tx.db)
            .await?;
            tx.queue.leave(run, job.priority, job.id);
        } else {
            // A run that is already canceling stays as it is, until its worker lets go.
            sqlx::query(
                "UPDATE run SET finished = iif(state = 'queued', ?2, NULL), changed = ?2,
                     state = iif(state = 'queued', 'canceled', 'canceling')
                 WHERE id = ?1 AND state IN ('queued', 'running')",
            )
            .bind(run.0)
            .bind(tx.now)
            .execute(&mut *tx.db)
            .await?;
            tx.queue.remove(run);
            if job.state == JobState::Queued {
                tx.effects.push(Effect::Settled(Ending::Canceled, None));
            }
            tx.effects.push(Effect::Unwanted(run));
        }
        tx.effects.push(Effect::Ended(job.key));
        let after = read::job(&mut *tx.db, self.0).await?;
        Ok(after.map_or(Canceled::NotFound, Canceled::Done))
    }
}

/// Cancels a part of the jobs that match: some, so that nobody waits long behind it.
pub(super) struct CancelSome {
    pub(super) filter: Filter,
    /// Only jobs submitted before this one: what comes while jobs are canceled is not meant.
    pub(super) before: JobId,
    pub(super) at_most: u32,
}

impl Verb for CancelSome {
    /// How many were canceled, and where to go on; none if there are no more.
    type Answer = (u64, Option<JobId>);

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Self::Answer, Error> {
        let ids = read::unfinished(&mut *tx.db, &self.filter, self.before, self.at_most).await?;
        let mut canceled = 0;
        for id in &ids {
            canceled += u64::from(matches!(Cancel(*id).apply(tx).await?, Canceled::Done(_)));
        }
        let more = ids.len() as u64 == u64::from(self.at_most);
        Ok((canceled, ids.last().copied().filter(|_| more)))
    }
}

pub(super) struct Delete(pub(super) JobId);

impl Verb for Delete {
    type Answer = Deleted;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Deleted, Error> {
        let Some(job) = read::job(&mut *tx.db, self.0).await? else {
            return Ok(Deleted::NotFound);
        };
        if !job.state.is_finished() {
            return Ok(Deleted::Unfinished(job.state));
        }
        let id = self.0.0.as_bytes().as_slice();
        let run: Option<i64> = sqlx::query_scalar("DELETE FROM job WHERE id = ?1 RETURNING run")
            .bind(id)
            .fetch_one(&mut *tx.db)
            .await?;
        if let Some(run) = run {
            delete_unnamed(tx, run).await?;
        }
        tx.effects.push(Effect::Ended(job.key));
        Ok(Deleted::Done)
    }
}

pub(super) struct Pin {
    pub(super) key: Key,
    pub(super) pinned: bool,
}

impl Verb for Pin {
    /// Whether there is such a result.
    type Answer = bool;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<bool, Error> {
        let done = sqlx::query("UPDATE result SET pinned = ?2 WHERE key = ?1 AND evicted IS NULL")
            .bind(self.key.bytes().as_slice())
            .bind(self.pinned)
            .execute(&mut *tx.db)
            .await?;
        Ok(done.rows_affected() > 0)
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
