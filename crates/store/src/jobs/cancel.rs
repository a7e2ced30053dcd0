//! What requests to cancel or delete a job do.

use crate::database::{Change, Connected, Effect, Result, RunId, Tables, sql};
use crate::jobs::read;
use crate::team::audit::{Act, Actor, record};
use fretwork_job::{Job, JobId, JobState};

/// What a request to cancel a job did.
#[derive(Debug, Clone, PartialEq)]
pub enum Canceled {
    /// There is no such job.
    NotFound,
    /// The job had already ended.
    AlreadyFinished(Job),
    /// The job is canceled, or will be as soon as the worker of its run stops.
    Done(Job),
}

/// What a request to delete a job did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deleted {
    /// There is no such job.
    NotFound,
    /// The job has not ended, so it was not deleted.
    Unfinished(JobState),
    /// The job is deleted.
    Done,
}

/// Deletes a job that has ended.
pub(crate) async fn delete((id, by): &(JobId, Actor), mut tx: Change<'_>) -> Result<Deleted> {
    let Some(job) = read::job(*id, &mut tx).await? else { return Ok(Deleted::NotFound) };
    if !job.state.is_finished() {
        return Ok(Deleted::Unfinished(job.state));
    }
    let now = tx.now().await?;
    record(&mut tx, now, (by, Act::DeleteJob), &id.to_string(), &job.owner).await?;
    // Without this lock, two servers could delete the last two jobs of a run at the same time. Each would still see
    // the job of the other, and the run would stay without a job.
    let lock = sql!(
        "SELECT 1 FROM run WHERE id = (SELECT run FROM job WHERE id = $1)" ["" | " FOR NO KEY UPDATE"] "";
        *id
    );
    tx.execute(lock).await?;
    delete_job(id.0.as_bytes(), &mut tx).await?;
    tx.effects.push(Effect::Ended(job.key));
    Ok(Deleted::Done)
}

/// Deletes a finished job. Also deletes its run if the run has ended and has no other job.
pub(crate) async fn delete_job(id: &[u8], tx: &mut impl Connected) -> Result<()> {
    let deleted = tx.row(sql!("DELETE FROM job WHERE id = $1 RETURNING run"; id)).await?;
    let run = deleted.map(|row| row.get::<Option<i64>>("run")).transpose()?.flatten();
    match run {
        Some(run) => delete_unnamed(RunId(run), tx).await,
        None => Ok(()),
    }
}

/// Deletes a run if it is finished and has no jobs.
pub(crate) async fn delete_unnamed(run: RunId, tx: &mut impl Connected) -> Result<()> {
    let delete = sql!(
        "DELETE FROM run WHERE id = $1 AND finished IS NOT NULL
             AND NOT EXISTS (SELECT 1 FROM job WHERE run = $1)";
        run
    );
    tx.execute(delete).await
}
