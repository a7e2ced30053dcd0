//! Submissions. A job uses the stored result, waits for the live run of its key, or gets a new queued run. For some
//! submissions, the answer is already computed.

use std::time::{Duration, Instant};

use super::transaction::Transaction;
use super::{chunks, storing};
use crate::database::{Connected, Effect, Ending, Error, Result, Row, RunId, Tables, sql};
use crate::jobs::read::read_job;
use crate::jobs::submit::{Admission, NewJob, Queued, Submitted, json};
use crate::results::storing::Answered;
use fretwork_job::{ENGINE, JobState, Origin};

/// Maximum number of attempts of a submission. An attempt fails if another server ends or queues the run of the key at
/// the same time.
const TRIES: usize = 10;

pub(crate) async fn submit(new: &NewJob, tx: &mut Transaction<'_>) -> Result<Submitted> {
    match new.repeated(&mut tx.db).await? {
        Some(repeated) => Ok(repeated),
        None => admit(tx, new).await,
    }
}

/// Where a job gets its result from.
enum ResultSource {
    /// The stored result.
    Known,
    /// A live run, which is locked. It may be new.
    Run { run: RunId, state: JobState, attempt: i64, origin: Origin },
    /// The answer that is stored in the same transaction. Its computation began at the time `began`.
    Recorded { began: i64, origin: Origin },
}

/// Finds the result or run for a job that is no repetition, and inserts the job.
async fn admit(tx: &mut Transaction<'_>, new: &NewJob) -> Result<Submitted> {
    for _ in 0..TRIES {
        let query = sql!(
            "SELECT EXISTS (SELECT 1 FROM result WHERE key = $1 AND evicted IS NULL) AS is_known,
                 (SELECT id FROM run WHERE key = $1 AND state IN ('queued', 'running')) AS live";
            new.key
        );
        let row = tx.db.one(query).await?;
        if row.get("is_known")? && !new.afresh {
            return insert(tx, new, &ResultSource::Known).await;
        }
        if new.admission == Admission::OnlyKnown {
            return Ok(Submitted::Unknown);
        }
        let place = match row.get::<Option<i64>>("live")?.map(RunId) {
            Some(run) => join(tx, new, run).await?,
            None if new.admission == Admission::NoNewRun => return Ok(Submitted::NeedsRun),
            None => queue(tx, new).await?,
        };
        match place {
            // Another server has ended the run, or has queued a run. The next attempt reads again.
            Ok(None) => {}
            Ok(Some(place)) => return insert(tx, new, &place).await,
            Err(full) => return Ok(full),
        }
    }
    let error = sqlx::Error::Protocol("the runs of this key change too fast".into());
    Err(Error::Busy(std::sync::Arc::new(error)))
}

/// A place; `None` if another server was faster; or the answer that the queue is full.
type Attempted = Result<Option<ResultSource>, Submitted>;

/// Locks a live run, so that it cannot end before the job is inserted.
async fn join(tx: &mut Transaction<'_>, new: &NewJob, run: RunId) -> Result<Attempted> {
    if new.chunks.is_some() {
        chunks::lock(tx, run).await?;
    }
    let query = sql!(
        "SELECT state, attempt FROM run WHERE id = $1 AND state <> 'canceling' AND finished IS NULL FOR SHARE";
        run
    );
    let Some(row) = tx.db.row(query).await? else { return Ok(Ok(None)) };
    let state: JobState = row.get("state")?;
    if state == JobState::Queued
        && let Some(full) = queue_is_full(tx, new).await?
    {
        return Ok(Err(full));
    }
    let attempt = row.get("attempt")?;
    Ok(Ok(Some(ResultSource::Run { run, state, attempt, origin: Origin::Coalesced })))
}

/// Queues a new run, unless another server has done so.
async fn queue(tx: &mut Transaction<'_>, new: &NewJob) -> Result<Attempted> {
    if let Some(full) = queue_is_full(tx, new).await? {
        return Ok(Err(full));
    }
    let query = sql!(
        "INSERT INTO run (key, owner, numerics, created, task, state, changed, trace, warnings)
         VALUES ($1, $2, $3, moment(), $4, 'queued', moment(), $5, $6)
         ON CONFLICT (key) WHERE state IN ('queued', 'running') DO NOTHING RETURNING id";
        new.key, &new.owner, ENGINE.numerics, &new.task, new.trace.as_ref(), json(&new.submission_warnings)
    );
    let Some(row) = tx.db.row(query).await? else { return Ok(Ok(None)) };
    let run = RunId(row.get("id")?);
    // Since this transaction has read the tables, an earlier run may have stored the result. Then the new run is
    // deleted.
    let query = sql!(
        "DELETE FROM run WHERE id = $1 AND NOT $2
             AND EXISTS (SELECT 1 FROM result WHERE key = run.key AND evicted IS NULL)";
        run, new.afresh
    );
    if tx.db.changed_by(query).await? > 0 {
        return Ok(Ok(None));
    }
    if let Some(chunks) = new.chunks {
        let query = sql!(
            "INSERT INTO study (run, chunks, stages) VALUES ($1, $2, $3)";
            run, chunks.get(), &*new.stages
        );
        tx.db.execute(query).await?;
    }
    let (state, origin) = (JobState::Queued, Origin::Computed);
    Ok(Ok(Some(ResultSource::Run { run, state, attempt: 0, origin })))
}

/// The answer to a job that must be queued, if the queue is full.
async fn queue_is_full(tx: &mut Transaction<'_>, new: &NewJob) -> Result<Option<Submitted>> {
    let (backlog, dead) = (&tx.of.backlog, tx.of.signals.tally.dead());
    let refused = |queued: Queued| {
        queued.is_full(backlog.limit).then_some(Submitted::QueueFull { queued: queued.all })
    };
    if let Some(queued) = backlog.queued(&new.owner, dead) {
        return Ok(refused(queued));
    }
    let begun = Instant::now();
    let query = sql!(
        "SELECT count(*) AS all_jobs, count(*) FILTER (WHERE owner = $1) AS own FROM job WHERE state = 'queued'";
        &new.owner
    );
    let row = tx.db.one(query).await?;
    let [all, own] = [row.get::<u64>("all_jobs")?, row.get("own")?].map(|count| count as usize);
    let queued = Queued { all, own };
    backlog.counted(&new.owner, queued, dead, begun);
    Ok(refused(queued))
}

/// Inserts a job.
async fn insert(tx: &mut Transaction<'_>, new: &NewJob, place: &ResultSource) -> Result<Submitted> {
    let row = insert_row(tx, new, place).await?;
    let job = read_job(&row)?;
    if !new.tags.is_empty() {
        sqlx::query("INSERT INTO job_tag (tag, job) SELECT DISTINCT unnest($1::TEXT[]), $2")
            .bind(&new.tags)
            .bind(new.id.0.as_bytes().as_slice())
            .execute(tx.db.connection())
            .await?;
    }
    if let ResultSource::Run { state, .. } = place {
        if *state == JobState::Queued {
            tx.of.backlog.grows(&new.owner);
        }
        tx.effects.push(Effect::Queued);
    }
    if job.origin == Origin::Cached {
        tx.effects.push(Effect::Read(new.key));
    }
    tx.effects.push(Effect::Submitted(job.origin));
    Ok(Submitted::Accepted(job))
}

async fn insert_row(tx: &mut Transaction<'_>, new: &NewJob, place: &ResultSource) -> Result<Row> {
    let job = new;
    let repeatable = job.repeatable.as_ref();
    let (run, state, attempt, origin, began) = match *place {
        ResultSource::Known => (None, JobState::Succeeded, 0, Origin::Cached, None),
        ResultSource::Run { run, state, attempt, origin } => {
            (Some(run), state, attempt, origin, None)
        }
        ResultSource::Recorded { began, origin } => {
            (None, JobState::Succeeded, 1, origin, Some(began))
        }
    };
    let query = sql!(
        "INSERT INTO job (id, owner, key, run, state, attempt, origin, label, tags, warnings, priority,
             idempotency_key, fingerprint, submitted, study, private, created, started, finished, changes, claimable)
         SELECT $1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14, $15, $17, coalesce($16, moment()),
             CASE WHEN $16 IS NOT NULL THEN $16 WHEN $5 <> 'queued' THEN moment() END,
             CASE WHEN $4 IS NULL THEN moment() END,
             CASE WHEN $16 IS NOT NULL THEN 'queued 0 ' || $16 || chr(10) || 'running 1 ' || $16 || chr(10) ELSE '' END
                 || $5 || ' ' || $6 || ' ' || moment(),
             (SELECT run.numerics FROM run LEFT JOIN study ON study.run = run.id
              WHERE run.id = $4 AND CASE WHEN $15
                  THEN next < chunks OR queued > 0 OR (next = chunks AND running = 0)
                  ELSE run.state = 'queued' END)
         RETURNING id, owner, key, state, origin, label, tags, private <> 0 AS private, warnings, created, started, finished, attempt, priority,
             changes, NULL AS recomputed,
             coalesce((SELECT progress FROM lease WHERE lease.run = job.run AND number = -1),
                 (SELECT least(done, chunks)::DOUBLE PRECISION / chunks FROM study WHERE study.run = job.run),
                 0) AS progress,
             (SELECT summary FROM result WHERE result.key = job.key AND job.state = 'succeeded') AS summary,
             (SELECT verified FROM result WHERE result.key = job.key AND job.state = 'succeeded') AS verified";
        job.id, &job.owner, job.key, run, state.as_str(), attempt, origin.as_str(), job.label.as_ref(), json(&new.tags),
        json(&new.warnings), job.priority, repeatable.map(|repeatable| &repeatable.key),
        repeatable.map(|repeatable| &repeatable.fingerprint), job.submitted.as_ref(), job.chunks.is_some(), began,
        i64::from(job.private)
    );
    let row = query.postgres().fetch_one(tx.db.connection()).await;
    Ok(Row::Postgres(row.map_err(|error| new.refused(error))?))
}

/// Stores the answer and its jobs, which are finished and have no run. If the result is already stored, or is evicted
/// and a run is live, the jobs use that result or run, and the answer is dropped. If the result is evicted and no run
/// is live, this returns [`Submitted::NeedsRun`].
pub(crate) async fn record(
    (jobs, answer): &(Vec<NewJob>, Answered),
    tx: &mut Transaction<'_>,
) -> Result<Vec<Submitted>> {
    let Some(first) = jobs.first() else { return Ok(Vec::new()) };
    let took = answer.cost.map_or(Duration::ZERO, |cost| cost.wall);
    let took = i64::try_from(took.as_millis()).unwrap_or(i64::MAX);
    let now = tx.now().await?;
    let (key, source) = (first.key, first.source(tx.of.node.program, now));
    let is_stored = storing::store(&mut tx.db, answer, &source, false).await?;
    if is_stored {
        tx.effects.push(Effect::Ended(key));
        tx.effects.push(Effect::Settled(Ending::Succeeded, Some(took)));
    }
    let began = now.saturating_sub(took);
    let mut all = Vec::new();
    for (number, job) in jobs.iter().enumerate() {
        let origin = if number == 0 { Origin::Computed } else { Origin::Coalesced };
        all.push(if is_stored {
            insert(tx, job, &ResultSource::Recorded { began, origin }).await?
        } else {
            admit(tx, job).await?
        });
    }
    Ok(all)
}
