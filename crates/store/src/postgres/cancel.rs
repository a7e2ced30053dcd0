//! Canceling and deleting jobs.

use super::audit::record;
use super::follow::{ended_by, follow};
use super::transaction::{Transaction, reading, writing};
use super::{Database, chunks, read};
use crate::audit::{Act, Actor};
use crate::cancel::{AT_ONCE, Canceled, Deleted};
use crate::error::Error;
use crate::read::Filter;
use crate::row::{Columns, RunId};
use crate::signals::Effect;
use crate::tally::Ending;
use fretwork_job::{JobId, JobState};

impl Database {
    pub(crate) async fn cancel(&self, id: JobId, by: Actor) -> Result<Canceled, Error> {
        writing!(self, tx => cancel(tx, id, &by).await)
    }

    /// Cancels some of the jobs that match and were submitted before another one. Returns how many, and where to continue;
    /// `None` if there are no more.
    pub(crate) async fn cancel_some(
        &self,
        filter: &Filter,
        before: JobId,
        by: &Actor,
    ) -> Result<(u64, Option<JobId>), Error> {
        let ids = reading!(self, db => read::unfinished(db, filter, before, AT_ONCE).await)?;
        let mut canceled = 0;
        // One transaction for each, so that they hold the locks of one run at a time.
        for id in &ids {
            let done = writing!(self, tx => cancel(tx, *id, by).await)?;
            canceled += u64::from(matches!(done, Canceled::Done(_)));
        }
        let more = ids.len() as u64 == u64::from(AT_ONCE);
        Ok((canceled, ids.last().copied().filter(|_| more)))
    }

    pub(crate) async fn delete(&self, id: JobId, by: Actor) -> Result<Deleted, Error> {
        writing!(self, tx => delete(tx, id, &by).await)
    }
}

async fn cancel(tx: &mut Transaction<'_>, id: JobId, by: &Actor) -> Result<Canceled, Error> {
    let run: Option<Option<i64>> = sqlx::query_scalar("SELECT run FROM job WHERE id = $1")
        .bind(id.0.as_bytes().as_slice())
        .fetch_optional(&mut *tx.db)
        .await?;
    let Some(run) = run else { return Ok(Canceled::NotFound) };
    let is_study = match run {
        Some(run) => lock(tx, RunId(run)).await?,
        None => false,
    };
    let Some(job) = read::job(&mut tx.db, id).await? else { return Ok(Canceled::NotFound) };
    let Some(run) = run.filter(|_| !job.state.is_finished()) else {
        return Ok(Canceled::AlreadyFinished(job));
    };
    record(&mut tx.db, (by, Act::CancelJob), &id.to_string(), &job.owner).await?;
    // Another job needs the run.
    let left = sqlx::query(
        "UPDATE job SET state = 'canceled', finished = moment(), claimable = NULL,
             changes = changes || chr(10) || 'canceled ' || attempt || ' ' || moment()
         WHERE id = $1 AND EXISTS (
             SELECT 1 FROM job AS other WHERE other.run = $2 AND other.finished IS NULL AND other.id <> $1)",
    )
    .bind(id.0.as_bytes().as_slice())
    .bind(run)
    .execute(&mut *tx.db)
    .await?;
    if left.rows_affected() == 0 {
        cancel_run(tx, RunId(run), is_study).await?;
    }
    tx.effects.push(Effect::Ended(job.key));
    let after = read::job(&mut tx.db, id).await?;
    Ok(after.map_or(Canceled::NotFound, Canceled::Done))
}

/// Locks a run and its study. Returns whether it is one.
async fn lock(tx: &mut Transaction<'_>, run: RunId) -> Result<bool, Error> {
    let study = chunks::lock(tx, run).await?;
    let query = sqlx::query("SELECT 1 FROM run WHERE id = $1 FOR NO KEY UPDATE").bind(run.0);
    query.execute(&mut *tx.db).await?;
    Ok(study.is_some())
}

/// Cancels a locked run. A run that is already canceling does not change until its worker stops. A study ends at once: its
/// workers stop, and what they compute meanwhile is refused.
async fn cancel_run(tx: &mut Transaction<'_>, run: RunId, is_study: bool) -> Result<(), Error> {
    let row = sqlx::query(
        "UPDATE run SET finished = CASE WHEN state = 'queued' OR $2 THEN moment() END, changed = moment(),
             state = CASE WHEN state = 'queued' OR $2 THEN 'canceled' ELSE 'canceling' END
         WHERE id = $1 AND state IN ('queued', 'running')
         RETURNING key, state, NULL::BIGINT AS started, finished, $2 AS study",
    )
    .bind(run.0)
    .bind(is_study)
    .fetch_optional(&mut *tx.db)
    .await?;
    let Some(row) = row else { return Ok(()) };
    if row.text("state")? == Some(JobState::Canceled.as_str()) {
        ended_by(tx, run, &row, Ending::Canceled).await?;
    } else {
        follow(tx, run).await?;
        tx.effects.push(Effect::Unwanted(run));
    }
    Ok(())
}

async fn delete(tx: &mut Transaction<'_>, id: JobId, by: &Actor) -> Result<Deleted, Error> {
    let Some(job) = read::job(&mut tx.db, id).await? else { return Ok(Deleted::NotFound) };
    if !job.state.is_finished() {
        return Ok(Deleted::Unfinished(job.state));
    }
    record(&mut tx.db, (by, Act::DeleteJob), &id.to_string(), &job.owner).await?;
    delete_jobs(tx, &[id.0.as_bytes().to_vec()]).await?;
    tx.effects.push(Effect::Ended(job.key));
    Ok(Deleted::Done)
}

/// Deletes finished jobs, and their runs if these have ended and have no other job.
pub(super) async fn delete_jobs(tx: &mut Transaction<'_>, ids: &[Vec<u8>]) -> Result<(), Error> {
    // Otherwise two servers that delete the last two jobs of a run would each leave it to the other.
    sqlx::query(
        "SELECT 1 FROM run WHERE id IN (SELECT run FROM job WHERE id = ANY ($1)) ORDER BY id FOR NO KEY UPDATE",
    )
    .bind(ids)
    .execute(&mut *tx.db)
    .await?;
    let runs: Vec<Option<i64>> =
        sqlx::query_scalar("DELETE FROM job WHERE id = ANY ($1) RETURNING run")
            .bind(ids)
            .fetch_all(&mut *tx.db)
            .await?;
    let runs: Vec<i64> = runs.into_iter().flatten().collect();
    if !runs.is_empty() {
        sqlx::query(
            "DELETE FROM run WHERE id = ANY ($1) AND finished IS NOT NULL
                 AND NOT EXISTS (SELECT 1 FROM job WHERE job.run = run.id)",
        )
        .bind(runs)
        .execute(&mut *tx.db)
        .await?;
    }
    Ok(())
}
