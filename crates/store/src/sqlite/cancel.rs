//! Canceling and deleting jobs.

use super::Database;
use super::audit::record;
use super::read;
use super::transaction::Transaction;
use super::upkeep::delete_unnamed;
use crate::audit::{Act, Actor};
use crate::cancel::{AT_ONCE, Canceled, Deleted};
use crate::error::Error;
use crate::read::Filter;
use crate::row::RunId;
use crate::signals::Effect;
use crate::tally::Ending;
use fretwork_job::{JobId, JobState};

impl Database {
    pub(crate) async fn cancel(&self, id: JobId, by: Actor) -> Result<Canceled, Error> {
        self.write(cancel, (id, by)).await
    }

    pub(crate) async fn cancel_some(
        &self,
        filter: &Filter,
        before: JobId,
        by: &Actor,
    ) -> Result<(u64, Option<JobId>), Error> {
        self.write(cancel_some, (filter.clone(), before, by.clone())).await
    }

    pub(crate) async fn delete(&self, id: JobId, by: Actor) -> Result<Deleted, Error> {
        self.write(delete, (id, by)).await
    }
}

async fn cancel((id, by): &(JobId, Actor), tx: &mut Transaction) -> Result<Canceled, Error> {
    cancel_one(*id, by, tx).await
}

async fn cancel_one(id: JobId, by: &Actor, tx: &mut Transaction) -> Result<Canceled, Error> {
    let Some(job) = read::job(&mut tx.db, id).await? else {
        return Ok(Canceled::NotFound);
    };
    if job.state.is_finished() {
        return Ok(Canceled::AlreadyFinished(job));
    }
    record(&mut tx.db, tx.now, (by, Act::CancelJob), &id.to_string(), &job.owner).await?;
    let (run, others): (i64, bool) = sqlx::query_as(
        "SELECT run, EXISTS (
             SELECT 1 FROM job AS other
             WHERE other.run = job.run AND other.finished IS NULL AND other.id <> job.id
         ) FROM job WHERE id = ?1",
    )
    .bind(id.0.as_bytes().as_slice())
    .fetch_one(&mut tx.db)
    .await?;
    let run = RunId(run);
    if others {
        sqlx::query(
            "UPDATE job SET state = 'canceled', finished = ?2,
                 changes = changes || char(10) || 'canceled ' || attempt || ' ' || ?2
             WHERE id = ?1",
        )
        .bind(id.0.as_bytes().as_slice())
        .bind(tx.now)
        .execute(&mut tx.db)
        .await?;
        tx.queue.leave(run, job.priority, job.id);
    } else {
        // A run that is already canceling does not change until its worker stops. A study ends at once: its workers stop, and
        // what they compute meanwhile is refused.
        let state: Option<String> = sqlx::query_scalar(
            "UPDATE run SET finished = iif(state = 'queued' OR ?3, ?2, NULL), changed = ?2,
                 state = iif(state = 'queued' OR ?3, 'canceled', 'canceling')
             WHERE id = ?1 AND state IN ('queued', 'running') RETURNING state",
        )
        .bind(run.0)
        .bind(tx.now)
        .bind(tx.queue.is_study(run))
        .fetch_optional(&mut tx.db)
        .await?;
        if state.as_deref() == Some(JobState::Canceled.as_str()) {
            tx.queue.end(run);
            tx.effects.push(Effect::Settled(Ending::Canceled, None));
        }
        tx.effects.push(Effect::Unwanted(run));
    }
    tx.effects.push(Effect::Ended(job.key));
    let after = read::job(&mut tx.db, id).await?;
    Ok(after.map_or(Canceled::NotFound, Canceled::Done))
}

/// Cancels some of the jobs that match and were submitted before another one. Returns how many, and where
/// to continue; `None` if there are no more.
async fn cancel_some(
    (filter, before, by): &(Filter, JobId, Actor),
    tx: &mut Transaction,
) -> Result<(u64, Option<JobId>), Error> {
    let ids = read::unfinished(&mut tx.db, filter, *before, AT_ONCE).await?;
    let mut canceled = 0;
    for id in &ids {
        canceled += u64::from(matches!(cancel_one(*id, by, tx).await?, Canceled::Done(_)));
    }
    let more = ids.len() as u64 == u64::from(AT_ONCE);
    Ok((canceled, ids.last().copied().filter(|_| more)))
}

async fn delete((id, by): &(JobId, Actor), tx: &mut Transaction) -> Result<Deleted, Error> {
    let Some(job) = read::job(&mut tx.db, *id).await? else {
        return Ok(Deleted::NotFound);
    };
    if !job.state.is_finished() {
        return Ok(Deleted::Unfinished(job.state));
    }
    record(&mut tx.db, tx.now, (by, Act::DeleteJob), &id.to_string(), &job.owner).await?;
    let run: Option<i64> = sqlx::query_scalar("DELETE FROM job WHERE id = ?1 RETURNING run")
        .bind(id.0.as_bytes().as_slice())
        .fetch_one(&mut tx.db)
        .await?;
    if let Some(run) = run {
        delete_unnamed(tx, run).await?;
    }
    tx.effects.push(Effect::Ended(job.key));
    Ok(Deleted::Done)
}
