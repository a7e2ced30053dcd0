//! Submissions: they find a known result, join a live run, or queue a new run. For some submissions the answer
//! is already computed.

use std::time::Duration;

use sqlx::postgres::PgRow;

use super::transaction::{Transaction, writing};
use super::{Database, chunks, keep, read};
use crate::error::Error;
use crate::keep::{Answered, Source};
use crate::row::{Columns, RunId, job_id};
use crate::signals::Effect;
use crate::submit::{Admission, EncodedJob, NewJob, Queued, Submitted};
use crate::tally::Ending;
use fretwork_job::{ENGINE, Job, JobState, Origin};

/// How often a submission looks again for a result or a run that others store or end meanwhile.
const TRIES: usize = 10;

impl Database {
    pub(crate) async fn submit(&self, job: NewJob) -> Result<Submitted, Error> {
        let submission = EncodedJob::new(job, self.0.backlog.limit());
        let submitted = writing!(self, tx => submit(tx, &submission).await)?;
        if let Submitted::Accepted(Job { state: JobState::Queued, .. }) = submitted {
            self.0.backlog.grows();
        }
        Ok(submitted)
    }

    pub(crate) async fn record(
        &self,
        jobs: Vec<NewJob>,
        answer: Answered,
        wall: Duration,
    ) -> Result<Vec<Submitted>, Error> {
        let limit = self.0.backlog.limit();
        let jobs: Vec<_> = jobs
            .into_iter()
            .map(|job| NewJob { admission: Admission::NoNewRun, ..job })
            .map(|job| EncodedJob::new(job, limit))
            .collect();
        let program = self.0.node.program;
        writing!(self, tx => record(tx, &jobs, &answer, wall, program).await)
    }
}

async fn submit(tx: &mut Transaction<'_>, new: &EncodedJob) -> Result<Submitted, Error> {
    match repeated(tx, new).await? {
        Some(repeated) => Ok(repeated),
        None => admit(tx, new).await,
    }
}

/// The job that this submission made when it was first sent.
async fn repeated(tx: &mut Transaction<'_>, new: &EncodedJob) -> Result<Option<Submitted>, Error> {
    let Some(repeatable) = &new.job.repeatable else { return Ok(None) };
    let found: Option<(Vec<u8>, Vec<u8>)> =
        sqlx::query_as("SELECT id, fingerprint FROM job WHERE owner = $1 AND idempotency_key = $2")
            .bind(&new.job.owner)
            .bind(&repeatable.key)
            .fetch_optional(&mut *tx.db)
            .await?;
    let Some((id, fingerprint)) = found else { return Ok(None) };
    if fingerprint != repeatable.fingerprint {
        return Ok(Some(Submitted::IdempotencyConflict));
    }
    let job = read::job(&mut tx.db, job_id(&id)?).await?;
    Ok(job.map(Submitted::Repeated))
}

/// Where a job gets its result from.
enum Place {
    /// The result is known.
    Known,
    /// A live run, which is locked. It may be new.
    Run { run: i64, state: JobState, attempt: i64, origin: Origin },
    /// The result was stored with the job: since when it was computed.
    Recorded { began: i64, origin: Origin },
}

/// Finds a place for a job that is no repetition, and inserts it.
async fn admit(tx: &mut Transaction<'_>, new: &EncodedJob) -> Result<Submitted, Error> {
    for _ in 0..TRIES {
        let (known, live): (bool, Option<i64>) = sqlx::query_as(
            "SELECT EXISTS (SELECT 1 FROM result WHERE key = $1 AND evicted IS NULL),
                 (SELECT id FROM run WHERE key = $1 AND state IN ('queued', 'running'))",
        )
        .bind(new.job.key.bytes().as_slice())
        .fetch_one(&mut *tx.db)
        .await?;
        if known && !new.job.afresh {
            return insert(tx, new, &Place::Known).await;
        }
        if new.job.admission == Admission::OnlyKnown {
            return Ok(Submitted::Unknown);
        }
        let place = match live {
            Some(run) => join(tx, new, run).await?,
            None if new.job.admission == Admission::NoNewRun => return Ok(Submitted::NeedsRun),
            None => queue(tx, new).await?,
        };
        match place {
            // Another server has ended the run, or has queued one.
            Ok(None) => {}
            Ok(Some(place)) => return insert(tx, new, &place).await,
            Err(full) => return Ok(full),
        }
    }
    let error = sqlx::Error::Protocol("the runs of this key change too fast".into());
    Err(Error::Busy(std::sync::Arc::new(error)))
}

/// A place, `None` if another server was faster, or that the queue is full.
type Found = Result<Option<Place>, Submitted>;

/// Locks a live run so that it cannot end before the job has joined it.
async fn join(tx: &mut Transaction<'_>, new: &EncodedJob, run: i64) -> Result<Found, Error> {
    if new.job.chunks.is_some() {
        chunks::lock(tx, RunId(run)).await?;
    }
    let row = sqlx::query(
        "SELECT state, attempt FROM run WHERE id = $1 AND state IN ('queued', 'running') FOR SHARE",
    )
    .bind(run)
    .fetch_optional(&mut *tx.db)
    .await?;
    let Some(row) = row else { return Ok(Ok(None)) };
    let state: JobState = crate::row::word(&row, "state")?;
    if state == JobState::Queued
        && let Some(full) = queue_is_full(tx, new).await?
    {
        return Ok(Err(full));
    }
    let attempt = row.get("attempt")?;
    Ok(Ok(Some(Place::Run { run, state, attempt, origin: Origin::Coalesced })))
}

/// Queues a new run, unless another server has done so.
async fn queue(tx: &mut Transaction<'_>, new: &EncodedJob) -> Result<Found, Error> {
    if let Some(full) = queue_is_full(tx, new).await? {
        return Ok(Err(full));
    }
    let run: Option<i64> = sqlx::query_scalar(
        "INSERT INTO run (key, owner, numerics, created, task, state, changed, trace, warnings)
         VALUES ($1, $2, $3, moment(), $4, 'queued', moment(), $5, $6)
         ON CONFLICT (key) WHERE state IN ('queued', 'running') DO NOTHING RETURNING id",
    )
    .bind(new.job.key.bytes().as_slice())
    .bind(&new.job.owner)
    .bind(i64::from(ENGINE.numerics))
    .bind(&new.job.task)
    .bind(&new.job.trace)
    .bind(&new.submission_warnings)
    .fetch_optional(&mut *tx.db)
    .await?;
    let Some(run) = run else { return Ok(Ok(None)) };
    // The run before it may have stored the result since this transaction has looked for it.
    let unneeded = sqlx::query(
        "DELETE FROM run WHERE id = $1 AND NOT $2
             AND EXISTS (SELECT 1 FROM result WHERE key = run.key AND evicted IS NULL)",
    )
    .bind(run)
    .bind(new.job.afresh)
    .execute(&mut *tx.db)
    .await?;
    if unneeded.rows_affected() > 0 {
        return Ok(Ok(None));
    }
    if let Some(chunks) = new.job.chunks {
        sqlx::query("INSERT INTO study (run, chunks) VALUES ($1, $2)")
            .bind(run)
            .bind(i64::from(chunks.get()))
            .execute(&mut *tx.db)
            .await?;
    }
    let (state, origin) = (JobState::Queued, Origin::Computed);
    Ok(Ok(Some(Place::Run { run, state, attempt: 0, origin })))
}

/// The answer to a job that needs a place in the queue, if there is none.
async fn queue_is_full(
    tx: &mut Transaction<'_>,
    new: &EncodedJob,
) -> Result<Option<Submitted>, Error> {
    let Some(limit) = new.limit else { return Ok(None) };
    let (all, own): (i64, i64) = sqlx::query_as(
        "SELECT count(*), count(*) FILTER (WHERE owner = $1) FROM job WHERE state = 'queued'",
    )
    .bind(&new.job.owner)
    .fetch_one(&mut *tx.db)
    .await?;
    let queued = Queued { all: all as usize, own: own as usize };
    Ok(queued.is_full(limit).then_some(Submitted::QueueFull { queued: queued.all }))
}

/// Inserts a job.
async fn insert(
    tx: &mut Transaction<'_>,
    new: &EncodedJob,
    place: &Place,
) -> Result<Submitted, Error> {
    let row = insert_row(tx, new, place).await?;
    let job = new.job(&row)?;
    if !new.job.tags.is_empty() {
        sqlx::query("INSERT INTO job_tag (tag, job) SELECT DISTINCT unnest($1::TEXT[]), $2")
            .bind(&new.job.tags)
            .bind(new.job.id.0.as_bytes().as_slice())
            .execute(&mut *tx.db)
            .await?;
    }
    if let Place::Run { .. } = place {
        tx.effects.push(Effect::Queued);
    }
    if job.origin == Origin::Cached {
        tx.effects.push(Effect::Read(new.job.key));
    }
    tx.effects.push(Effect::Submitted(job.origin));
    Ok(Submitted::Accepted(job))
}

async fn insert_row(
    tx: &mut Transaction<'_>,
    new: &EncodedJob,
    place: &Place,
) -> Result<PgRow, Error> {
    let job = &new.job;
    let repeatable = job.repeatable.as_ref();
    let (run, state, attempt, origin, began) = match *place {
        Place::Known => (None, JobState::Succeeded, 0, Origin::Cached, None),
        Place::Run { run, state, attempt, origin } => (Some(run), state, attempt, origin, None),
        Place::Recorded { began, origin } => (None, JobState::Succeeded, 1, origin, Some(began)),
    };
    let query = sqlx::query(
        "INSERT INTO job (id, owner, key, run, state, attempt, origin, label, tags, warnings, priority,
             idempotency_key, fingerprint, submitted, study, created, started, finished, changes, claimable)
         SELECT $1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14, $15, coalesce($16, moment()),
             CASE WHEN $16 IS NOT NULL THEN $16 WHEN $5 <> 'queued' THEN moment() END,
             CASE WHEN $4 IS NULL THEN moment() END,
             CASE WHEN $16 IS NOT NULL THEN 'queued 0 ' || $16 || chr(10) || 'running 1 ' || $16 || chr(10) ELSE '' END
                 || $5 || ' ' || $6 || ' ' || moment(),
             (SELECT run.numerics FROM run LEFT JOIN study ON study.run = run.id
              WHERE run.id = $4 AND CASE WHEN $15
                  THEN next < chunks OR queued > 0 OR (next = chunks AND running = 0)
                  ELSE run.state = 'queued' END)
         RETURNING run, created, state, attempt, origin, started, finished, changes,
             coalesce((SELECT progress FROM lease WHERE lease.run = job.run AND number = -1),
                 (SELECT least(done, chunks)::DOUBLE PRECISION / chunks FROM study WHERE study.run = job.run),
                 0) AS progress,
             (SELECT summary FROM result WHERE result.key = job.key AND job.state = 'succeeded') AS summary",
    );
    let query = query
        .bind(job.id.0.as_bytes().as_slice())
        .bind(&job.owner)
        .bind(job.key.bytes().as_slice())
        .bind(run)
        .bind(state.as_str())
        .bind(attempt)
        .bind(origin.as_str())
        .bind(&job.label)
        .bind(&new.tags)
        .bind(new.warnings.to_string())
        .bind(i64::from(job.priority))
        .bind(repeatable.map(|repeatable| &repeatable.key))
        .bind(repeatable.map(|repeatable| repeatable.fingerprint.as_slice()))
        .bind(&job.submitted)
        .bind(job.chunks.is_some())
        .bind(began);
    query.fetch_one(&mut *tx.db).await.map_err(|error| new.refused(error))
}

/// Stores the answer and its jobs, which are finished and have no run. If the result is known, or is evicted and a run is
/// live, the jobs use that instead, and the answer is dropped. If it is evicted and no run is live, the jobs need one.
async fn record(
    tx: &mut Transaction<'_>,
    jobs: &[EncodedJob],
    answer: &Answered,
    wall: Duration,
    program: i64,
) -> Result<Vec<Submitted>, Error> {
    let Some(first) = jobs.first() else { return Ok(Vec::new()) };
    let took = i64::try_from(wall.as_millis()).unwrap_or(i64::MAX);
    let now: i64 = sqlx::query_scalar("SELECT moment()").fetch_one(&mut *tx.db).await?;
    let NewJob { id, key, ref owner, ref task, ref trace, .. } = first.job;
    let (owner, job, trace) = (Some(owner.as_str()), Some(id), trace.as_deref());
    let (warnings, program) = (Some(first.submission_warnings.as_str()), Some(program));
    let source = Source { key, attempt: 0, task, owner, job, warnings, trace, program, now };
    let is_stored = keep::store(&mut tx.db, answer, &source, false).await?;
    if is_stored {
        tx.effects.push(Effect::Ended(key));
        tx.effects.push(Effect::Settled(Ending::Succeeded, Some(took)));
    }
    let began = now.saturating_sub(took);
    let mut all = Vec::new();
    for (number, job) in jobs.iter().enumerate() {
        let origin = if number == 0 { Origin::Computed } else { Origin::Coalesced };
        all.push(if is_stored {
            insert(tx, job, &Place::Recorded { began, origin }).await?
        } else {
            admit(tx, job).await?
        });
    }
    Ok(all)
}
