//! Submissions: they find a known result, join a live run, or queue a new run. For some submissions the answer
//! is already computed.

use std::num::NonZeroU32;
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use serde_json::Value;
use sqlx::sqlite::SqliteRow;
use sqlx::{AssertSqlSafe, Row};

use super::keep::{Answered, Reason, Source, keeping};
use super::outline::Statement;
use super::row::{RunId, changes, job_id, json, word};
use super::signals::Effect;
use super::tally::Ending;
use super::transaction::Transaction;
use super::{Error, Store, read};
use crate::job::{Job, JobId, JobState, Key, Origin};
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
    /// The number of chunks into which the work is divided, so that workers share it; `None` if one worker computes all.
    pub chunks: Option<NonZeroU32>,
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
    /// Those of the warnings that the result does not contain: they are about the two bodies. If this submission
    /// computes the result, the provenance of the result has them.
    pub submission_warnings: Vec<Warning>,
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
    submission_warnings: String,
    /// The largest number of queued jobs.
    limit: usize,
}

impl EncodedJob {
    #[expect(clippy::expect_used, reason = "a job without its warnings would mislead its client")]
    fn new(job: NewJob, limit: usize) -> Self {
        let tags = Value::from(job.tags.clone()).to_string();
        let json = |warnings| serde_json::to_value(warnings).expect("warnings are plain texts");
        let warnings = json(&job.warnings);
        let submission_warnings = json(&job.submission_warnings).to_string();
        Self { job, tags, warnings, submission_warnings, limit }
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
        let query = self.bind(sqlx::query(AssertSqlSafe(Arc::clone(&SUBMIT))), tx.now, None);
        let rows = query.fetch_all(&mut tx.db).await.map_err(|error| self.refused(error))?;
        if let (Some(chunks), Some(row)) = (self.job.chunks, rows.first())
            && word::<Origin>(row, "origin")? == Origin::Computed
        {
            let (run, chunks): (i64, u32) = (row.try_get("run")?, chunks.get());
            sqlx::query("INSERT INTO study (run, chunks) VALUES (?1, ?2)")
                .bind(run)
                .bind(chunks)
                .execute(&mut tx.db)
                .await?;
            tx.queue.add_study(RunId(run), chunks);
        }
        self.submitted(tx, &rows)
    }

    /// Binds the parameters of [`RUN`] and [`JOB`].
    fn bind<'q>(
        &'q self,
        query: Statement<'q>,
        now: i64,
        recorded: Option<Recorded>,
    ) -> Statement<'q> {
        let new = &self.job;
        let repeatable = new.repeatable.as_ref();
        query
            .bind(new.key.bytes().as_slice())
            .bind(&new.owner)
            .bind(recorded.map(|recorded| recorded.began))
            .bind(&new.task)
            .bind(new.afresh)
            .bind(&new.trace)
            .bind(recorded.is_some() || new.admission == Admission::NoNewRun)
            .bind(recorded.and_then(|recorded| recorded.origin).map(Origin::as_str))
            .bind(new.id.0.as_bytes().as_slice())
            .bind(&new.label)
            .bind(&self.tags)
            .bind(self.warnings.to_string())
            .bind(new.priority)
            .bind(repeatable.map(|repeatable| &repeatable.key))
            .bind(repeatable.map(|repeatable| repeatable.fingerprint.as_slice()))
            .bind(&new.submitted)
            .bind(now)
            .bind(&self.submission_warnings)
    }

    /// The error of [`JOB`].
    fn refused(&self, error: sqlx::Error) -> Error {
        match error.as_database_error() {
            Some(refusal) if refusal.is_unique_violation() => Error::JobExists(self.job.id),
            _ => error.into(),
        }
    }

    /// Signals a submission after [`JOB`], and returns its job.
    fn submitted(&self, tx: &mut Transaction, rows: &[SqliteRow]) -> Result<Submitted, Error> {
        let new = &self.job;
        let Some(row) = rows.first() else { return Ok(Submitted::NeedsRun) };
        let (origin, state) = (word(row, "origin")?, word(row, "state")?);
        let run = row.try_get::<Option<i64>, _>("run")?.map(RunId);
        // A study has pieces for workers while it is running, too.
        if let Some(run) = run.filter(|run| state == JobState::Queued || tx.queue.is_study(*run)) {
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
            started: row.try_get("started")?,
            finished: row.try_get("finished")?,
            changes: changes(row.try_get("changes")?)?,
            failure: None,
            summary: row.try_get::<Option<&str>, _>("summary")?.map(json).transpose()?,
            recomputed: None,
        };
        Ok(Submitted::Accepted(job))
    }
}

/// Inserts a queued run, unless a run is live, the known result is sufficient, or $7 forbids it.
const RUN: &str = "
    INSERT INTO run (id, key, owner, created, task, state, changed, trace, warnings)
    SELECT (SELECT runs + 1 FROM room), $1, $2, $17, $4, 'queued', $17, $6, $18
    WHERE NOT $7
        AND ($5 OR NOT EXISTS (SELECT 1 FROM result WHERE key = $1 AND evicted IS NULL))
    ON CONFLICT (key) WHERE state IN ('queued', 'running') DO NOTHING";

/// Inserts a job at the time $17, if its result is known or its run is live.
///
/// `changes()` is 1 if the statement before has changed a row. In [`SUBMIT`] this is [`RUN`], so the run is new. In [`RECORD`]
/// it stores the result; then the job has the origin $8, and its computation began at $3. For another job of the same
/// result it is the job before.
const JOB: &str = "
    INSERT INTO job (key, owner, created, id, label, tags, warnings, priority, idempotency_key,
        fingerprint, submitted, run, state, attempt, origin, started, finished, changes)
    WITH found AS (
        SELECT is_known, run.id AS run, coalesce(run.state, 'succeeded') AS state,
            coalesce(run.attempt, 0) AS attempt, changes() = 1 AND NOT $7 AS is_new,
            $8 IS NOT NULL AND changes() = 1 AS is_recorded
        FROM (SELECT EXISTS (SELECT 1 FROM result WHERE key = $1 AND evicted IS NULL) AS is_known)
        LEFT JOIN run ON run.key = $1 AND run.state IN ('queued', 'running') AND ($5 OR NOT is_known)
    )
    SELECT $1, $2, iif(is_recorded, $3, $17), $9, $10, $11, $12, $13, $14, $15, $16, run, state,
        iif(is_recorded, 1, attempt),
        CASE WHEN is_recorded THEN $8 WHEN run IS NULL THEN 'cached'
            WHEN is_new THEN 'computed' ELSE 'coalesced' END,
        CASE WHEN is_recorded THEN $3 WHEN state <> 'queued' THEN $17 END, iif(run IS NULL, $17, NULL),
        iif(is_recorded, 'queued 0 ' || $3 || char(10) || 'running 1 ' || $3 || char(10)
            || 'succeeded 1 ' || $17, state || ' ' || attempt || ' ' || $17)
    FROM found
    WHERE NOT $7 OR run IS NOT NULL OR (is_known AND NOT $5)
    RETURNING run, created, state, attempt, origin, started, finished, changes,
        (SELECT progress FROM run WHERE run.id = job.run) AS progress,
        iif(state = 'succeeded', (SELECT summary FROM result WHERE result.key = job.key), NULL)
            AS summary";

static SUBMIT: LazyLock<Arc<str>> = LazyLock::new(|| format!("{RUN}; {JOB}").into());

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

/// How a job got its answer before it was submitted.
#[derive(Debug, Clone, Copy)]
struct Recorded {
    /// `None` if the answer was not stored.
    origin: Option<Origin>,
    /// When the computation began.
    began: i64,
}

/// Stores a result and its first job.
static RECORD: LazyLock<Arc<str>> =
    LazyLock::new(|| format!("{}; {JOB}", keeping(Reason::Job, 19)).into());

/// Stores the answer and its jobs, which are finished and have no run. If the result is known, or is evicted and a run is
/// live, the jobs use that instead, and the answer is dropped. If it is evicted and no run is live, the jobs need one.
async fn record(record: &Record, tx: &mut Transaction) -> Result<Vec<Submitted>, Error> {
    let Record { jobs, wall, answer } = record;
    let took = i64::try_from(wall.as_millis()).unwrap_or(i64::MAX);
    let (began, now) = (tx.now.saturating_sub(took), tx.now);
    let Some((first, others)) = jobs.split_first() else { return Ok(Vec::new()) };
    let NewJob { id, key, ref owner, ref task, ref trace, .. } = first.job;
    let (owner, job, trace) = (Some(owner.as_str()), Some(id), trace.as_deref());
    let (warnings, program) = (Some(first.submission_warnings.as_str()), Some(tx.program));
    let source = Source { key, attempt: 0, task, owner, job, warnings, trace, program, now };
    let recorded = Some(Recorded { origin: Some(Origin::Computed), began });
    let query = first.bind(sqlx::query(AssertSqlSafe(Arc::clone(&RECORD))), now, recorded);
    let rows = answer.bind(query, &source).fetch_all(&mut tx.db).await;
    let submitted = first.submitted(tx, &rows.map_err(|error| first.refused(error))?)?;
    let is_stored =
        matches!(&submitted, Submitted::Accepted(job) if job.origin == Origin::Computed);
    if is_stored {
        tx.effects.push(Effect::Ended(key));
        tx.effects.push(Effect::Settled(Ending::Succeeded, Some(took)));
    }
    let mut all = vec![submitted];
    let origin = is_stored.then_some(Origin::Coalesced);
    let recorded = Some(Recorded { origin, began });
    for other in others {
        let rows = other.bind(sqlx::query(JOB), now, recorded).fetch_all(&mut tx.db).await;
        all.push(other.submitted(tx, &rows.map_err(|error| other.refused(error))?)?);
    }
    Ok(all)
}
