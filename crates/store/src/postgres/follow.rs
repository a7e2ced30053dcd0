//! Updates the jobs and leases of a run after the run has changed, and adds the signals.

use super::lease;
use super::transaction::Transaction;
use crate::error::Result;
use crate::row::{Columns, Row, RunId};
use crate::signals::Effect;
use crate::statement::sql;
use crate::tables::Connected;
use crate::tally::Ending;

/// Copies the state of a run to its unfinished jobs. An earlier statement must have locked the run. A submission that
/// adds a job to the run waits for this lock.
pub(super) async fn follow(tx: &mut Transaction<'_>, run: RunId) -> Result<()> {
    let query = sql!(
        "UPDATE job SET state = run.state, attempt = run.attempt, finished = run.finished,
             started = CASE WHEN run.started IS NOT NULL THEN greatest(run.started, job.created) END,
             claimable = CASE WHEN run.state = 'queued' THEN run.numerics
                 WHEN run.state = 'running' AND job.study THEN job.claimable END,
             changes = changes || chr(10) || run.state || ' ' || run.attempt || ' ' || run.changed
         FROM run WHERE run.id = $1 AND job.run = run.id AND job.finished IS NULL";
        run
    );
    tx.db.execute(query).await
}

/// Updates the jobs and leases of a run that has ended or was queued again, and adds the signals. The row contains the
/// key of the run and its times.
pub(super) async fn ended_by(
    tx: &mut Transaction<'_>,
    run: RunId,
    row: &Row,
    ending: Ending,
) -> Result<()> {
    follow(tx, run).await?;
    lease::end_all(tx, run).await?;
    let (started, finished): (Option<i64>, Option<i64>) =
        (row.get("started")?, row.get("finished")?);
    // The duration of a study is not recorded, because it may have waited between its pieces.
    let took = finished.zip(started).filter(|_| matches!(row.truth("study"), Ok(Some(false))));
    // Another worker may claim a released run before this signal arrives.
    if ending != Ending::Released {
        tx.effects.push(Effect::Unwanted(run));
    }
    tx.effects.push(Effect::Ended(row.get("key")?));
    tx.effects.push(Effect::Settled(ending, took.map(|(finished, started)| finished - started)));
    Ok(())
}
