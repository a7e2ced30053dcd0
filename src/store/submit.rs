//! Submissions: they find a known result, join a live run, or queue a new run. For some submissions the answer
//! is already computed.

use std::sync::{Arc, LazyLock};
use std::time::Duration;

use serde_json::Value;
use sqlx::sqlite::SqliteRow;
use sqlx::{AssertSqlSafe, Row};

use super::keep::{Answered, Kept, Source, keeping};
use super::outline::Statement;
use super::row::{RunId, changes, job_id, json, word};
use super::signals::Effect;
use super::transaction::Transaction;
use super::{Error, Store, read, runs};
use crate::job::{Change, Job, JobId, JobState, Key, Origin};
use fretwork_engine::scenario::Warning;

/// A submission, checked and with its key.
#[derive(Debug, Clone)]
pub struct NewJob {
    /// Its id, made by the caller.
    pub id: JobId,
    /// Who submits it.
    pub owner: String,
    /// The key of its result.
    pub key: Key,
    /// What to compute, in its stored form.
    pub task: String,
    /// The scenario as the client wrote it, in JSON.
    pub submitted: Option<String>,
    /// Its priority among the jobs of its owner: 0 is the most urgent, 7 the least.
    pub priority: u8,
    /// A title for people.
    pub label: Option<String>,
    /// Words to find it by.
    pub tags: Vec<String>,
    /// What the client should know about the task.
    pub warnings: Vec<Warning>,
    /// How a repetition of this submission is recognised.
    pub repeatable: Option<Repeatable>,
    /// Whether to compute even if the result is known.
    pub afresh: bool,
    /// What it may start.
    pub admission: Admission,
    /// The request that submits it, for the log.
    pub trace: Option<String>,
}

/// What a submission may start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Admission {
    /// A new run, if it needs one.
    #[default]
    NewRun,
    /// No run: it finds a known result or joins a live run.
    NoNewRun,
    /// No run: it finds a known result.
    OnlyKnown,
}

/// How a repetition of a submission is recognised.
#[derive(Debug, Clone)]
pub struct Repeatable {
    /// The idempotency key that the client gave to the submission.
    pub key: String,
    /// A digest of the submission. The same key with another digest is a mistake of the client.
    pub fingerprint: Vec<u8>,
}

/// What a submission did.
#[derive(Debug, Clone, PartialEq)]
pub enum Submitted {
    /// It is a job.
    Accepted(Job),
    /// It is a repetition. This is the job of the first submission.
    Repeated(Job),
    /// Its idempotency key belongs to another submission.
    IdempotencyConflict,
    /// It needs a new run, and [`Admission`] allows none.
    NeedsRun,
    /// [`Admission::OnlyKnown`] is set, and the result is not known.
    Unknown,
    /// The queue is full.
    QueueFull {
        /// The number of queued jobs.
        queued: usize,
    },
}

impl Store {
    /// Accepts a job. It ends at once if the result is known. Otherwise it joins the live run, or a new run
    /// is queued if the queue is not full.
    pub async fn submit(&self, job: NewJob) -> Result<Submitted, Error> {
        self.write(submit, EncodedJob::new(job, self.queue_limit)).await
    }

    /// Accepts jobs of one key with their answer and its cost, and finishes them in the same commit. If the
    /// result has become known meanwhile, or a run is live, they use that instead.
    pub async fn record(
        &self,
        jobs: Vec<NewJob>,
        answer: Answered,
        wall: Duration,
    ) -> Result<Vec<Submitted>, Error> {
        let limit = self.queue_limit;
        let jobs = jobs.into_iter().map(|job| EncodedJob::new(job, limit)).collect();
        self.write(record, Record { jobs, wall, answer }).await
    }
}

/// A submission with its texts in JSON, written before the writer task gets it.
struct EncodedJob {
    job: NewJob,
    tags: String,
    warnings: Value,
    /// The largest number of queued jobs.
    limit: usize,
}

impl EncodedJob {
    #[expect(clippy::expect_used, reason = "a job without its warnings would mislead its client")]
    fn new(job: NewJob, limit: usize) -> Self {
        let tags = Value::from(job.tags.clone()).to_string();
        let warnings = serde_json::to_value(&job.warnings).expect("warnings are plain texts");
        Self { job, tags, warnings, limit }
    }

    /// The job that this submission made when it was first sent.
    async fn repeated(&self, tx: &mut Transaction) -> Result<Option<Submitted>, Error> {
        let Some(repeatable) = &self.job.repeatable else { return Ok(None) };
        let found: Option<(Vec<u8>, Vec<u8>)> = sqlx::query_as(
            "SELECT id, fingerprint FROM job WHERE owner = ?1 AND idempotency_key = ?2",
        )
        .bind(&self.job.owner)
        .bind(&repeatable.key)
        .fetch_optional(&mut tx.db)
        .await?;
        let Some((id, fingerprint)) = found else { return Ok(None) };
        if fingerprint != repeatable.fingerprint {
            return Ok(Some(Submitted::IdempotencyConflict));
        }
        let job = read::job(&mut tx.db, job_id(&id)?).await?;
        Ok(job.map(Submitted::Repeated))
    }

    /// Why the submission is refused, if it is.
    async fn refusal(&self, tx: &mut Transaction) -> Result<Option<Submitted>, Error> {
        let admission = self.job.admission;
        // The last tenth of the queue is for owners with few jobs in it, so that no owner fills it all.
        let (queued, tenth) = (tx.queue.jobs(), self.limit / 10);
        let full = queued >= self.limit
            || (queued >= self.limit - tenth && tx.queue.waiting_of(&self.job.owner) >= tenth);
        if admission != Admission::OnlyKnown && !full {
            return Ok(None);
        }
        // Whether the result is stored, and the state of the live run.
        let (result, live): (bool, Option<String>) = sqlx::query_as(
            "SELECT result.key IS NOT NULL AND result.evicted IS NULL, run.state
             FROM (SELECT ?1 AS key) AS asked
             LEFT JOIN result ON result.key = asked.key
             LEFT JOIN run ON run.key = asked.key AND run.state IN ('queued', 'running')",
        )
        .bind(self.job.key.bytes().as_slice())
        .fetch_one(&mut tx.db)
        .await?;
        // A job that needs neither a worker nor a place in the queue is always accepted.
        Ok(match live.as_deref() {
            _ if result && !self.job.afresh => None,
            _ if admission == Admission::OnlyKnown => Some(Submitted::Unknown),
            Some("running") => None,
            None if admission == Admission::NoNewRun => Some(Submitted::NeedsRun),
            _ => Some(Submitted::QueueFull { queued }),
        })
    }

    /// Inserts the job, and a run if it needs one. The new run is queued.
    async fn insert(&self, tx: &mut Transaction) -> Result<Submitted, Error> {
        let query = self.bind(sqlx::query(SUBMIT), None, tx.now);
        let rows = query.fetch_all(&mut tx.db).await.map_err(|error| self.refused(error))?;
        Ok(self.submitted(tx, &rows)?.0)
    }

    /// Binds the parameters of [`SUBMIT`]. With `began` a new run is running since then, because it is already computed.
    fn bind<'q>(&'q self, query: Statement<'q>, began: Option<i64>, now: i64) -> Statement<'q> {
        let new = &self.job;
        let repeatable = new.repeatable.as_ref();
        query
            .bind(new.key.bytes().as_slice())
            .bind(&new.owner)
            .bind(began.unwrap_or(now))
            .bind(&new.task)
            .bind(new.afresh)
            .bind(&new.trace)
            .bind(new.admission == Admission::NoNewRun)
            .bind(began.is_some())
            .bind(new.id.0.as_bytes().as_slice())
            .bind(&new.label)
            .bind(&self.tags)
            .bind(self.warnings.to_string())
            .bind(new.priority)
            .bind(repeatable.map(|repeatable| &repeatable.key))
            .bind(repeatable.map(|repeatable| repeatable.fingerprint.as_slice()))
            .bind(&new.submitted)
            .bind(now)
    }

    /// The error of [`SUBMIT`].
    fn refused(&self, error: sqlx::Error) -> Error {
        match error.as_database_error() {
            Some(refusal) if refusal.is_unique_violation() => Error::JobExists(self.job.id),
            _ => error.into(),
        }
    }

    /// Signals a submission after [`SUBMIT`]. Returns the job, and its run if it has one.
    fn submitted(
        &self,
        tx: &mut Transaction,
        rows: &[SqliteRow],
    ) -> Result<(Submitted, Option<RunId>), Error> {
        let new = &self.job;
        let Some(row) = rows.iter().find(|row| row.try_get_raw("origin").is_ok()) else {
            return Ok((Submitted::NeedsRun, None));
        };
        let (origin, state) = (word(row, "origin")?, word(row, "state")?);
        let run = row.try_get::<Option<i64>, _>("run")?.map(RunId);
        if let Some(run) = run.filter(|_| state == JobState::Queued) {
            tx.queue.add(run, &new.owner, new.priority, new.id);
            tx.effects.push(Effect::Queued);
        }
        if origin == Origin::Cached {
            tx.effects.push(Effect::Read(new.key));
        }
        tx.effects.push(Effect::Submitted(origin));
        let job = Job {
            id: new.id,
            state,
            key: new.key,
            owner: new.owner.clone(),
            origin,
            attempt: row.try_get("attempt")?,
            progress: match state {
                JobState::Succeeded => 1.0,
                _ => row.try_get("progress")?,
            },
            priority: new.priority,
            label: new.label.clone(),
            tags: new.tags.clone(),
            warnings: self.warnings.clone(),
            created: row.try_get("created")?,
            started: row.try_get("began")?,
            finished: row.try_get("finished")?,
            changes: changes(row.try_get("changes")?)?,
            failure: None,
            summary: row.try_get::<Option<&str>, _>("summary")?.map(json).transpose()?,
        };
        Ok((Submitted::Accepted(job), run))
    }
}

/// The first statement inserts a run, unless a run is live, the known result is sufficient, or $7 forbids it. The
/// run is queued, or with $8 running since $3. The second statement inserts the job. `changes()` tells it whether
/// the first one inserted a run. The job of a run that this transaction records began at $3. Any other job begins
/// now ($17).
const SUBMIT: &str = "
    INSERT INTO run (id, key, owner, created, task, state, attempt, started, changed, trace)
    SELECT (SELECT runs + 1 FROM room), $1, $2, $3, $4, iif($8, 'running', 'queued'), $8,
        iif($8, $3, NULL), $3, $6
    WHERE NOT $7
        AND ($5 OR NOT EXISTS (SELECT 1 FROM result WHERE key = $1 AND evicted IS NULL))
    ON CONFLICT (key) WHERE state IN ('queued', 'running') DO NOTHING;

    INSERT INTO job (key, owner, created, id, label, tags, warnings, priority, idempotency_key,
        fingerprint, submitted, run, state, attempt, origin, started, finished, changes)
    WITH found AS (
        SELECT is_known, run.id AS run, coalesce(run.state, 'succeeded') AS state,
            coalesce(run.attempt, 0) AS attempt, changes() AS is_new,
            $8 AND run.id = (SELECT runs FROM room) AND run.started = $3 AS is_recorded
        FROM (SELECT EXISTS (SELECT 1 FROM result WHERE key = $1 AND evicted IS NULL) AS is_known)
        LEFT JOIN run ON run.key = $1 AND run.state IN ('queued', 'running') AND ($5 OR NOT is_known)
    ), dated AS (SELECT *, iif(is_recorded, $3, $17) AS at FROM found)
    SELECT $1, $2, at, $9, $10, $11, $12, $13, $14, $15, $16, run, state, attempt,
        CASE WHEN run IS NULL THEN 'cached' WHEN is_new THEN 'computed' ELSE 'coalesced' END,
        iif(state = 'queued', NULL, at), iif(run IS NULL, at, NULL),
        iif(is_recorded, 'queued 0 ' || at || char(10), '') || state || ' ' || attempt || ' ' || at
    FROM dated
    WHERE NOT $7 OR run IS NOT NULL OR (is_known AND NOT $5)
    RETURNING run, created, state, attempt, origin, started AS began, finished, changes,
        (SELECT progress FROM run WHERE run.id = job.run) AS progress,
        iif(state = 'succeeded', (SELECT summary FROM result WHERE result.key = job.key), NULL)
            AS summary";

async fn submit(submission: &EncodedJob, tx: &mut Transaction) -> Result<Submitted, Error> {
    if let Some(repeated) = submission.repeated(tx).await? {
        return Ok(repeated);
    }
    if let Some(refusal) = submission.refusal(tx).await? {
        return Ok(refusal);
    }
    submission.insert(tx).await
}

/// Jobs of one key whose answer was computed before they were submitted.
struct Record {
    jobs: Vec<EncodedJob>,
    /// How long the computation took.
    wall: Duration,
    answer: Answered,
}

/// The attempt of a run that is recorded with its answer. Such a run has only one attempt.
const ATTEMPT: u32 = 1;

/// [`SUBMIT`], and then the end of the run that the job $18 started.
static RECORD: LazyLock<Arc<str>> = LazyLock::new(|| {
    let run = "(SELECT run FROM job WHERE id = $18 AND origin = 'computed')";
    format!("{SUBMIT}; {}", keeping(Some(run), 19)).into()
});

/// The first job starts a run, the others join it, and the answer finishes it. If the result has become
/// known meanwhile, or a run is live, the jobs use that instead and the answer is dropped.
async fn record(record: &Record, tx: &mut Transaction) -> Result<Vec<Submitted>, Error> {
    let Record { jobs, wall, answer } = record;
    let took = i64::try_from(wall.as_millis()).unwrap_or(i64::MAX);
    let (began, now) = (Some(tx.now.saturating_sub(took)), tx.now);
    let Some((last, others)) = jobs.split_last() else { return Ok(Vec::new()) };
    let mut all = Vec::with_capacity(jobs.len());
    let mut first = None;
    for encoded in others {
        let query = encoded.bind(sqlx::query(SUBMIT), began, now);
        let rows = query.fetch_all(&mut tx.db).await.map_err(|error| encoded.refused(error))?;
        let (submitted, run) = encoded.submitted(tx, &rows)?;
        first.get_or_insert(run);
        all.push(submitted);
    }
    let NewJob { id, key, ref task, ref trace, .. } = jobs[0].job;
    let (owner, trace, program) = (None, trace.as_deref(), Some(tx.program));
    let source = Source { key, attempt: ATTEMPT, task, owner, trace, program, now };
    let query = last.bind(sqlx::query(AssertSqlSafe(Arc::clone(&RECORD))), began, now);
    let query = answer.bind(query.bind(id.0.as_bytes().to_vec()), &source);
    let rows = query.fetch_all(&mut tx.db).await.map_err(|error| last.refused(error))?;
    let (submitted, run) = last.submitted(tx, &rows)?;
    all.push(submitted);
    let kept = Kept::read(&rows)?;
    let Some(run) = first.unwrap_or(run).filter(|_| kept.started.is_some()) else { return Ok(all) };
    runs::succeeded(tx, run, key, answer, &kept).await?;
    let summary: Value = json(&answer.summary)?;
    for submitted in &mut all {
        let Submitted::Accepted(job) = submitted else { continue };
        let state = JobState::Succeeded;
        job.state = state;
        job.progress = 1.0;
        job.finished = Some(now);
        job.changes.push(Change { state, attempt: ATTEMPT, at: now });
        job.summary = Some(summary.clone());
    }
    Ok(all)
}
