//! Updates the jobs and leases of a run after the run has changed, and adds the signals.

use super::lease;
use super::transaction::Transaction;
use crate::database::{Effect, Ending, Result, Row, RunId};

/// Copies the states of runs to their unfinished jobs. An earlier statement must have locked the runs. A submission that
/// adds a job to a run waits for this lock.
pub(super) async fn follow(tx: &mut Transaction<'_>, runs: &[i64]) -> Result<()> {
    let query = sqlx::query(
        "UPDATE job SET state = run.state, attempt = run.attempt, finished = run.finished,
             started = CASE WHEN run.started IS NOT NULL THEN greatest(run.started, job.created) END,
             claimable = CASE WHEN run.state = 'queued' THEN run.numerics
                 WHEN run.state = 'running' AND job.study THEN job.claimable END,
             changes = changes || chr(10) || run.state || ' ' || run.attempt || ' ' || run.changed
         FROM run WHERE run.id = ANY ($1) AND job.run = ANY ($1) AND job.run = run.id AND job.finished IS NULL",
    );
    query.bind(runs).execute(tx.db.connection()).await?;
    Ok(())
}

/// Updates the jobs and leases of runs that have ended or were queued again, and adds the signals. Each row contains the
/// key of the run and its times.
pub(super) async fn ended_by<'a>(
    tx: &mut Transaction<'_>,
    ended: impl IntoIterator<Item = (&'a RunId, &'a Row)> + Clone,
    ending: Ending,
) -> Result<()> {
    let runs: Vec<i64> = ended.clone().into_iter().map(|(run, _)| run.0).collect();
    follow(tx, &runs).await?;
    lease::end_all(tx, &runs).await?;
    for (run, row) in ended {
        let (started, finished): (Option<i64>, Option<i64>) =
            (row.get("started")?, row.get("finished")?);
        // The duration of a study is not recorded, because it may have waited between its pieces.
        let took = finished.zip(started).filter(|_| matches!(row.value("study"), Ok(Some(false))));
        // Another worker may claim a released run before this signal arrives.
        if ending != Ending::Released {
            tx.effects.push(Effect::Unwanted(*run));
        }
        tx.effects.push(Effect::Ended(row.get("key")?));
        let took = took.map(|(finished, started)| finished - started);
        tx.effects.push(Effect::Settled(ending, took));
    }
    Ok(())
}
