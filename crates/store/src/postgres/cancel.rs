//! Canceling jobs.

use super::chunks;
use super::follow::{ended_by, follow};
use super::transaction::Transaction;
use crate::database::{Connected, Effect, Ending, Result, RunId, Tables, sql};
use crate::jobs::cancel::Canceled;
use crate::jobs::read;
use crate::team::audit::{Act, Actor, record};
use fretwork_job::{JobId, JobState};

/// Cancels a job, and its run if no other unfinished job shares it.
pub(crate) async fn cancel(
    (id, by): &(JobId, Actor),
    tx: &mut Transaction<'_>,
) -> Result<Canceled> {
    let id = *id;
    let Some(row) = tx.db.row(sql!("SELECT run FROM job WHERE id = $1"; id)).await? else {
        return Ok(Canceled::NotFound);
    };
    let run = row.get::<Option<i64>>("run")?.map(RunId);
    let is_study = match run {
        Some(run) => lock(tx, run).await?,
        None => false,
    };
    let Some(job) = read::job(id, &mut tx.db).await? else { return Ok(Canceled::NotFound) };
    let Some(run) = run.filter(|_| !job.state.is_finished()) else {
        return Ok(Canceled::AlreadyFinished(job));
    };
    let now = tx.now().await?;
    record(&mut tx.db, now, (by, Act::CancelJob), &id.to_string(), &job.owner).await?;
    // If another unfinished job needs the run, this cancels only the job.
    let query = sql!(
        "UPDATE job SET state = 'canceled', finished = moment(), claimable = NULL,
             changes = changes || chr(10) || 'canceled ' || attempt || ' ' || moment()
         WHERE id = $1 AND EXISTS (
             SELECT 1 FROM job AS other WHERE other.run = $2 AND other.finished IS NULL AND other.id <> $1)";
        id, run
    );
    if tx.db.changed_by(query).await? == 0 {
        cancel_run(tx, run, is_study).await?;
    }
    tx.effects.push(Effect::Ended(job.key));
    let after = read::job(id, &mut tx.db).await?;
    Ok(after.map_or(Canceled::NotFound, Canceled::Done))
}

/// Locks a run, and its study if it has one. Returns whether the run is a study.
async fn lock(tx: &mut Transaction<'_>, run: RunId) -> Result<bool> {
    let study = chunks::lock(tx, run).await?;
    tx.db.execute(sql!("SELECT 1 FROM run WHERE id = $1 FOR NO KEY UPDATE"; run)).await?;
    Ok(study.is_some())
}

/// Cancels a locked run. A run that is already canceling does not change until its worker stops. A study ends at once.
/// Its workers are told to stop, and chunks that they finish afterwards are not stored.
async fn cancel_run(tx: &mut Transaction<'_>, run: RunId, is_study: bool) -> Result<()> {
    let query = sql!(
        "UPDATE run SET finished = CASE WHEN state = 'queued' OR $2 THEN moment() END, changed = moment(),
             state = CASE WHEN state = 'queued' OR $2 THEN 'canceled' ELSE 'canceling' END
         WHERE id = $1 AND state <> 'canceling' AND finished IS NULL
         RETURNING key, state, NULL::BIGINT AS started, finished, $2 AS study";
        run, is_study
    );
    let Some(row) = tx.db.row(query).await? else { return Ok(()) };
    if row.value("state")? == Some(JobState::Canceled.as_str()) {
        ended_by(tx, [(&run, &row)], Ending::Canceled).await?;
    } else {
        follow(tx, &[run.0]).await?;
        tx.effects.push(Effect::Unwanted(run));
    }
    Ok(())
}
