//! Canceling jobs.

use super::transaction::Transaction;
use crate::database::{Connected, Effect, Ending, Result, RunId, Tables, sql};
use crate::jobs::cancel::Canceled;
use crate::jobs::read;
use crate::team::audit::{Act, Actor, record};
use fretwork_job::{JobId, JobState};

/// Cancels a job, and its run if no other unfinished job shares it.
pub(crate) async fn cancel((id, by): &(JobId, Actor), tx: &mut Transaction) -> Result<Canceled> {
    let id = *id;
    let Some(job) = read::job(id, &mut tx.db).await? else { return Ok(Canceled::NotFound) };
    if job.state.is_finished() {
        return Ok(Canceled::AlreadyFinished(job));
    }
    record(&mut tx.db, tx.now, (by, Act::CancelJob), &id.to_string(), &job.owner).await?;
    let query = sql!(
        "SELECT run, EXISTS (
             SELECT 1 FROM job AS other
             WHERE other.run = job.run AND other.finished IS NULL AND other.id <> job.id
         ) AS others FROM job WHERE id = $1";
        id
    );
    let found = tx.db.one(query).await?;
    let run = RunId(found.get("run")?);
    if found.get("others")? {
        let update = sql!(
            "UPDATE job SET state = 'canceled', finished = $2,
                 changes = changes || char(10) || 'canceled ' || attempt || ' ' || $2
             WHERE id = $1";
            id, tx.now
        );
        tx.db.execute(update).await?;
        tx.queue.leave(run, job.priority, job.id);
    } else {
        // A run that is already canceling does not change until its worker stops. A study ends at once. Its workers are
        // told to stop, and chunks that they finish afterwards are not stored.
        let update = sql!(
            "UPDATE run SET finished = iif(state = 'queued' OR $3, $2, NULL), changed = $2,
                 state = iif(state = 'queued' OR $3, 'canceled', 'canceling')
             WHERE id = $1 AND state IN ('queued', 'running') RETURNING state";
            run, tx.now, tx.queue.is_study(run)
        );
        let changed = tx.db.row(update).await?;
        let state = changed.as_ref().map(|row| row.value("state")).transpose()?.flatten();
        if state == Some(JobState::Canceled.as_str()) {
            tx.queue.end(run);
            tx.effects.push(Effect::Settled(Ending::Canceled, None));
        }
        tx.effects.push(Effect::Unwanted(run));
    }
    tx.effects.push(Effect::Ended(job.key));
    let after = read::job(id, &mut tx.db).await?;
    Ok(after.map_or(Canceled::NotFound, Canceled::Done))
}
