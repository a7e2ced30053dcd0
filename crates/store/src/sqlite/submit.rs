//! Submissions. A job uses the stored result, waits for the live run of its key, or gets a new queued run. For some
//! submissions, the answer is already computed.

use std::sync::LazyLock;
use std::time::Duration;

use super::storing::{Reason, keeping};
use super::transaction::Transaction;
use crate::database::{
    Connected, Effect, Ending, Result, Row, RunId, Statement, Tables, checksum, sql,
};
use crate::jobs::claimed::Stages;
use crate::jobs::read::read_job;
use crate::jobs::submit::{Admission, NewJob, Queued, Submitted, json};
use crate::results::storing::Answered;
use fretwork_job::{JobState, Origin};

impl NewJob {
    /// The answer if the submission is refused.
    async fn refusal(&self, tx: &mut Transaction) -> Result<Option<Submitted>> {
        let admission = self.admission;
        let queued = Queued { all: tx.queue.jobs, own: tx.queue.waiting_of(&self.owner) };
        if admission != Admission::OnlyKnown && !queued.is_full(tx.queue_limit) {
            return Ok(None);
        }
        let query = sql!(
            "SELECT result.key IS NOT NULL AND result.evicted IS NULL AS is_known, run.state AS live
             FROM (SELECT $1 AS key) AS asked
             LEFT JOIN result ON result.key = asked.key
             LEFT JOIN run ON run.key = asked.key AND run.state IN ('queued', 'running')";
            self.key
        );
        let row = tx.db.one(query).await?;
        // A job that needs neither a worker nor a place in the queue is always accepted.
        Ok(match row.value("live")? {
            _ if row.get("is_known")? && !self.afresh => None,
            _ if admission == Admission::OnlyKnown => Some(Submitted::Unknown),
            Some("running") => None,
            None if admission == Admission::NoNewRun => Some(Submitted::NeedsRun),
            _ => Some(Submitted::QueueFull { queued: queued.all }),
        })
    }

    /// Inserts the job, and a run if it needs one. The new run is queued.
    async fn insert(&self, tx: &mut Transaction) -> Result<Submitted> {
        let query = self.bind(Statement::of(SUBMIT.as_str()), tx.now, None);
        let row = self.inserted(query, tx).await?;
        if let (Some(chunks), Some(row)) = (self.chunks, &row)
            && row.get::<Origin>("origin")? == Origin::Computed
        {
            let (run, chunks) = (RunId(row.get("run")?), chunks.get());
            let insert = sql!(
                "INSERT INTO study (run, chunks, stages) VALUES ($1, $2, $3)";
                run, chunks, &*self.stages
            );
            tx.db.execute(insert).await?;
            tx.queue.add_study(run, chunks, Stages::read(&self.stages));
        }
        self.submitted(tx, row)
    }

    /// Executes statements that insert the job. Returns the row of the job; `None` if the job needs a run and none is
    /// live.
    async fn inserted(&self, query: Statement, tx: &mut Transaction) -> Result<Option<Row>> {
        let row = query.sqlite().fetch_optional(&mut tx.db).await;
        Ok(row.map_err(|error| self.refused(error))?.map(Row::Sqlite))
    }

    /// Adds the values of the parameters of [`RUN`] and [`JOB`].
    fn bind(&self, query: Statement, now: i64, recorded: Option<Recorded>) -> Statement {
        let repeatable = self.repeatable.as_ref();
        query
            .with(self.key)
            .with(&self.owner)
            .with(recorded.map(|recorded| recorded.began))
            .with(&self.task)
            .with(self.afresh)
            .with(self.trace.as_ref())
            .with(self.admission == Admission::NoNewRun)
            .with(recorded.and_then(|recorded| recorded.origin).map(Origin::as_str))
            .with(self.id)
            .with(self.label.as_ref())
            .with(json(&self.tags))
            .with(json(&self.warnings))
            .with(self.priority)
            .with(repeatable.map(|repeatable| &repeatable.key))
            .with(repeatable.map(|repeatable| &repeatable.fingerprint))
            .with(self.submitted.as_ref())
            .with(now)
            .with(json(&self.submission_warnings))
            .with(self.submitted.as_deref().map(checksum))
            .with(self.private)
    }

    /// Adds an inserted job to the queue if necessary, and adds the signals. `row` is the row that [`JOB`] has
    /// returned.
    fn submitted(&self, tx: &mut Transaction, row: Option<Row>) -> Result<Submitted> {
        let Some(row) = row else { return Ok(Submitted::NeedsRun) };
        let job = read_job(&row)?;
        let (origin, state) = (job.origin, job.state);
        let run = row.get::<Option<i64>>("run")?.map(RunId);
        // A running study is also in the queue, because workers can still claim pieces of it.
        if let Some(run) = run.filter(|run| state == JobState::Queued || tx.queue.is_study(*run)) {
            tx.queue.add(run, &self.owner, self.priority, self.id);
            tx.effects.push(Effect::Queued);
        }
        if origin == Origin::Cached {
            tx.effects.push(Effect::Read(self.key));
        }
        tx.effects.push(Effect::Submitted(origin));
        Ok(Submitted::Accepted(job))
    }
}

/// Inserts a queued run, unless a run is live, a stored result can be used, or $7 forbids a new run.
const RUN: &str = "
    INSERT INTO run (id, key, owner, created, task, state, changed, trace, warnings)
    SELECT (SELECT runs + 1 FROM room), $1, $2, $17, $4, 'queued', $17, $6, $18
    WHERE NOT $7
        AND ($5 OR NOT EXISTS (SELECT 1 FROM result WHERE key = $1 AND evicted IS NULL))
    ON CONFLICT (key) WHERE state IN ('queued', 'running') DO NOTHING";

/// Inserts a job at the time $17, if its result is stored or a run is live.
///
/// `changes()` is 1 if the previous statement has changed a row. In [`SUBMIT`], that statement is [`RUN`], so the run
/// is new. In [`RECORD`], it stores the result. Then the job has the origin $8, and its computation began at $3. For a
/// further job of the same result, the previous statement has inserted the previous job.
const JOB: &str = "
    INSERT INTO job (key, owner, created, id, label, tags, warnings, priority, idempotency_key,
        fingerprint, submitted, submitted_sum, private, run, state, attempt, origin, started, finished, changes)
    WITH found AS (
        SELECT is_known, run.id AS run, coalesce(run.state, 'succeeded') AS state,
            coalesce(run.attempt, 0) AS attempt, changes() = 1 AND NOT $7 AS is_new,
            $8 IS NOT NULL AND changes() = 1 AS is_recorded
        FROM (SELECT EXISTS (SELECT 1 FROM result WHERE key = $1 AND evicted IS NULL) AS is_known)
        LEFT JOIN run ON run.key = $1 AND run.state IN ('queued', 'running') AND ($5 OR NOT is_known)
    )
    SELECT $1, $2, iif(is_recorded, $3, $17), $9, $10, $11, $12, $13, $14, $15, $16, $19, $20, run, state,
        iif(is_recorded, 1, attempt),
        CASE WHEN is_recorded THEN $8 WHEN run IS NULL THEN 'cached'
            WHEN is_new THEN 'computed' ELSE 'coalesced' END,
        CASE WHEN is_recorded THEN $3 WHEN state <> 'queued' THEN $17 END, iif(run IS NULL, $17, NULL),
        iif(is_recorded, 'queued 0 ' || $3 || char(10) || 'running 1 ' || $3 || char(10)
            || 'succeeded 1 ' || $17, state || ' ' || attempt || ' ' || $17)
    FROM found
    WHERE NOT $7 OR run IS NOT NULL OR (is_known AND NOT $5)
    RETURNING run, id, owner, key, state, origin, label, tags, private, warnings, created, started, finished, attempt, priority,
        changes, NULL AS recomputed,
        (SELECT progress FROM run WHERE run.id = job.run) AS progress,
        iif(state = 'succeeded', (SELECT summary FROM result WHERE result.key = job.key), NULL)
            AS summary,
        iif(state = 'succeeded', (SELECT verified FROM result WHERE result.key = job.key), NULL)
            AS verified";

/// Queues a run if the job needs one, and inserts the job. Only the last statement may return a row, because
/// `fetch_optional` skips all statements after the first row.
static SUBMIT: LazyLock<String> = LazyLock::new(|| format!("{RUN}; {JOB}"));

pub(crate) async fn submit(submission: &NewJob, tx: &mut Transaction) -> Result<Submitted> {
    if let Some(repeated) = submission.repeated(&mut tx.db).await? {
        return Ok(repeated);
    }
    if let Some(refusal) = submission.refusal(tx).await? {
        return Ok(refusal);
    }
    submission.insert(tx).await
}

/// The values for a job whose answer was computed before it was submitted.
#[derive(Debug, Clone, Copy)]
struct Recorded {
    /// The origin of the job; `None` if the answer was not stored.
    origin: Option<Origin>,
    /// When the computation began.
    began: i64,
}

/// Stores a result and its first job. Only the last statement returns a row, as in [`SUBMIT`].
static RECORD: LazyLock<String> = LazyLock::new(|| format!("{}; {JOB}", keeping(Reason::Job, 21)));

/// Stores the answer and its jobs, which are finished and have no run. If the result is already stored, or is evicted
/// and a run is live, the jobs use that result or run, and the answer is dropped. If the result is evicted and no run
/// is live, this returns [`Submitted::NeedsRun`].
pub(crate) async fn record(
    (jobs, answer): &(Vec<NewJob>, Answered),
    tx: &mut Transaction,
) -> Result<Vec<Submitted>> {
    let took = answer.cost.map_or(Duration::ZERO, |cost| cost.wall);
    let took = i64::try_from(took.as_millis()).unwrap_or(i64::MAX);
    let (began, now) = (tx.now.saturating_sub(took), tx.now);
    let Some((first, others)) = jobs.split_first() else { return Ok(Vec::new()) };
    let (key, source) = (first.key, first.source(tx.program, now));
    let recorded = Some(Recorded { origin: Some(Origin::Computed), began });
    let query = first.bind(Statement::of(RECORD.as_str()), now, recorded);
    let row = first.inserted(query.with_result(answer, &source), tx).await?;
    let submitted = first.submitted(tx, row)?;
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
        let row = other.inserted(other.bind(Statement::of(JOB), now, recorded), tx).await?;
        all.push(other.submitted(tx, row)?);
    }
    Ok(all)
}
