//! Submissions: what becomes of one, and those that come with their answer.

use serde_json::Value;
use sqlx::Row;

use super::Error;
use super::keep::{Answered, Source};
use super::read::{self, json, word};
use super::runs::RunId;
use super::signals::Effect;
use super::tally::Ending;
use super::writer::{Transaction, Verb};
use crate::job::{Answer, Change, Cost, Job, JobId, JobState, Key, Origin};
use fretwork_engine::scenario::Warning;

/// A submission, checked and addressed.
#[derive(Debug, Clone)]
pub struct NewJob {
    /// Its name, made by the caller.
    pub id: JobId,
    /// Who submits it.
    pub owner: String,
    /// The address of its result.
    pub key: Key,
    /// What to compute, in its stored form.
    pub task: String,
    /// Among the jobs of its owner: 0 is the most urgent, 7 the least.
    pub priority: u8,
    /// A line for people.
    pub label: Option<String>,
    /// Words to find it by.
    pub tags: Vec<String>,
    /// What the physics says the user should know.
    pub warnings: Vec<Warning>,
    /// By what a repetition of this submission is known.
    pub repeatable: Option<Repeatable>,
    /// Whether to compute although the result may be known.
    pub afresh: bool,
    /// What of it may be accepted.
    pub admission: Admission,
    /// The request that submits it, for the log.
    pub trace: Option<String>,
}

/// What of a submission may be accepted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Admission {
    /// Only if the result is known.
    pub only_known: bool,
    /// It would take too long to compute.
    pub too_expensive: bool,
    /// Only if it needs no computation of its own.
    pub unless_needed: bool,
}

/// By what a repetition of a submission is known.
#[derive(Debug, Clone)]
pub struct Repeatable {
    /// The name that the client gave to the submission.
    pub key: String,
    /// A digest of what was sent: the same name for something else is a mistake.
    pub fingerprint: Vec<u8>,
}

/// What became of a submission.
#[derive(Debug, Clone, PartialEq)]
pub enum Submitted {
    /// It is a job.
    Accepted(Job),
    /// It was sent before: this is the job it made then.
    Repeated(Job),
    /// Its name belongs to a submission of something else.
    Mistaken,
    /// It needs a computation of its own, and was to be accepted only otherwise.
    Needed,
    /// Only a known result was asked for, and it is not known.
    Unknown,
    /// It would take too long, and the result is not known.
    TooExpensive,
    /// The queue has no place for it.
    Refused {
        /// How many jobs wait.
        queued: usize,
    },
}

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
        if !only_known && !too_expensive && !full {
            return Ok(None);
        }
        let Known { result, live } = known(tx, self.job.key).await?;
        // What needs neither a worker nor a place in the queue is welcome all the same.
        Ok(match live.as_deref() {
            _ if result && !self.job.afresh => None,
            _ if only_known => Some(Submitted::Unknown),
            _ if too_expensive => Some(Submitted::TooExpensive),
            Some("running") => None,
            None if unless_needed => Some(Submitted::Needed),
            _ => Some(Submitted::Refused { queued }),
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
}

async fn known(tx: &mut Transaction<'_>, key: Key) -> Result<Known, Error> {
    let known = sqlx::query_as(
        "SELECT result.key IS NOT NULL AND result.evicted IS NULL AS result, run.state AS live
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
/// there is now. The second statement tells by `changes()` whether the first inserted a run. With ?7
/// there is neither, unless the job needs no run of its own.
const SUBMIT: &str = "
    INSERT INTO run (id, key, owner, created, task, state, changed, trace)
    SELECT (SELECT runs + 1 FROM room), ?1, ?2, ?3, ?4, 'queued', ?3, ?6
    WHERE NOT ?7
        AND (?5 OR NOT EXISTS (SELECT 1 FROM result WHERE key = ?1 AND evicted IS NULL))
    ON CONFLICT (key) WHERE state IN ('queued', 'running') DO NOTHING;

    INSERT INTO job (key, owner, created, id, label, tags, warnings, priority, idempotency_key,
        fingerprint, run, state, attempt, origin, started, finished, changes)
    SELECT ?1, ?2, ?3, ?8, ?9, ?10, ?11, ?12, ?13, ?14, run.id, coalesce(run.state, 'succeeded'),
        coalesce(run.attempt, 0),
        CASE WHEN run.id IS NULL THEN 'cached' WHEN changes() THEN 'computed' ELSE 'coalesced' END,
        iif(run.state = 'queued', NULL, ?3), iif(run.id IS NULL, ?3, NULL),
        coalesce(run.state, 'succeeded') || ' ' || coalesce(run.attempt, 0) || ' ' || ?3
    FROM (SELECT EXISTS (SELECT 1 FROM result WHERE key = ?1 AND evicted IS NULL) AS is_known)
    LEFT JOIN run ON run.key = ?1 AND run.state IN ('queued', 'running') AND (?5 OR NOT is_known)
    WHERE NOT ?7 OR run.id IS NOT NULL OR is_known
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
            .bind(new.admission.unless_needed)
            .bind(new.id.0.as_bytes().as_slice())
            .bind(&new.label)
            .bind(&self.tags)
            .bind(self.warnings.to_string())
            .bind(new.priority)
            .bind(repeatable.map(|repeatable| &repeatable.key))
            .bind(repeatable.map(|repeatable| repeatable.fingerprint.as_slice()))
            .fetch_optional(&mut *tx.db)
            .await
            .map_err(|error| match error.as_database_error() {
                Some(refusal) if refusal.is_unique_violation() => Error::JobExists(new.id),
                _ => error.into(),
            })?;
        let Some(row) = row else { return Ok(Submitted::Needed) };
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
    answer: Answered,
}

impl Record {
    pub(super) fn new(jobs: Vec<Submit>, answer: &Answer, cost: Cost) -> Self {
        let took = i64::try_from(cost.wall.as_millis()).unwrap_or(i64::MAX);
        Self { jobs, took, answer: Answered::new(answer, Some(cost)) }
    }

    /// The run and its first job, in one go, unless there is a result or a live run of the key; with
    /// what a result that was dropped had come to. Numbers that a statement passes over are taken by
    /// the library for as many more arguments.
    const BEGIN: &str = "
        INSERT INTO run (id, key, owner, created, task, trace, started, finished, changed, state,
            attempt, progress)
        SELECT (SELECT runs + 1 FROM room), ?1, ?2, ?3, ?5, ?6, ?3, ?4, ?4, 'succeeded', 1, 1
        WHERE NOT EXISTS (SELECT 1 FROM result WHERE key = ?1 AND evicted IS NULL)
            AND NOT EXISTS (SELECT 1 FROM run WHERE key = ?1 AND state IN ('queued', 'running'));
        INSERT INTO job (key, owner, created, id, label, tags, warnings, priority, run, state,
            attempt, origin, started, finished, changes)
        SELECT ?1, ?2, ?3, ?7, ?8, ?9, ?10, ?11, last_insert_rowid(), 'succeeded', 1,
            'computed', ?3, ?4, ?12
        WHERE changes()
        RETURNING (SELECT digest FROM result WHERE key = ?1)";
    /// Another job of that run.
    const JOIN: &str = "
        INSERT INTO job (key, owner, created, id, label, tags, warnings, priority, run, state,
            attempt, origin, started, finished, changes)
        SELECT ?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, run, 'succeeded', 1, 'coalesced', ?3, finished, changes
        FROM job WHERE id = ?9";

    /// Puts in what was computed and the first of its jobs; false if that is not wanted any more, for
    /// there is a result or a run of the key.
    async fn insert(
        &self,
        tx: &mut Transaction<'_>,
        first: &Submit,
        began: i64,
        changes: &str,
    ) -> Result<bool, Error> {
        let new = &first.job;
        let begun: Option<Option<Vec<u8>>> = sqlx::query_scalar(Self::BEGIN)
            .bind(new.key.bytes().as_slice())
            .bind(&new.owner)
            .bind(began)
            .bind(tx.now)
            .bind(&new.task)
            .bind(&new.trace)
            .bind(new.id.0.as_bytes().as_slice())
            .bind(&new.label)
            .bind(&first.tags)
            .bind(first.warnings.to_string())
            .bind(new.priority)
            .bind(changes)
            .fetch_optional(&mut *tx.db)
            .await?;
        let Some(dropped) = begun else { return Ok(false) };
        if let Some(digest) = dropped {
            let same = *digest == self.answer.digest;
            tx.effects.push(Effect::Recomputed { key: new.key, same });
        }
        let source = Source {
            task: &new.task,
            owner: Some(&new.owner),
            job: Some(new.id),
            trace: new.trace.as_deref(),
            program: Some(tx.program),
        };
        self.answer.insert(tx.db, new.key, &source, tx.now).await?;
        tx.effects.push(Effect::Stored(self.answer.body.len() as u64));
        Ok(true)
    }
}

impl Verb for Record {
    type Answer = Vec<Submitted>;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Self::Answer, Error> {
        let mut became = Vec::with_capacity(self.jobs.len());
        let Some(first) = self.jobs.first() else { return Ok(became) };
        let key = first.job.key;
        let began = tx.now - self.took;
        let changes = [
            (JobState::Queued, 0, began),
            (JobState::Running, 1, began),
            (JobState::Succeeded, 1, tx.now),
        ]
        .map(|(state, attempt, at)| Change { state, attempt, at });
        let lines = changes.map(|Change { state, attempt, at }| format!("{state} {attempt} {at}"));
        if !self.insert(tx, first, began, &lines.join("\n")).await? {
            for job in &self.jobs {
                became.push(job.apply(tx).await?);
            }
            return Ok(became);
        }
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
