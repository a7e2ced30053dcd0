//! Jobs that nobody wants any more: canceling and deleting.

use super::Error;
use super::read::{self, Filter};
use super::runs::RunId;
use super::signals::Effect;
use super::tally::Ending;
use super::upkeep::delete_unnamed;
use super::writer::{Transaction, Verb};
use crate::job::{Job, JobId, JobState};

/// What became of a wish to cancel.
#[derive(Debug, Clone, PartialEq)]
pub enum Canceled {
    /// There is no such job.
    NotFound,
    /// It had ended before.
    AlreadyFinished(Job),
    /// It is canceled, or will be as soon as its worker lets go.
    Done(Job),
}

/// What became of a wish to delete.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deleted {
    /// There is no such job.
    NotFound,
    /// It has not ended.
    Unfinished(JobState),
    /// It is gone.
    Done,
}

pub(super) struct Cancel(pub(super) JobId);

impl Verb for Cancel {
    type Answer = Canceled;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Canceled, Error> {
        let Some(job) = read::job(&mut *tx.db, self.0).await? else {
            return Ok(Canceled::NotFound);
        };
        if job.state.is_finished() {
            return Ok(Canceled::AlreadyFinished(job));
        }
        let id = self.0.0.as_bytes().as_slice();
        let (run, others): (i64, bool) = sqlx::query_as(
            "SELECT run, EXISTS (
                 SELECT 1 FROM job AS other
                 WHERE other.run = job.run AND other.finished IS NULL AND other.id <> job.id
             ) FROM job WHERE id = ?1",
        )
        .bind(id)
        .fetch_one(&mut *tx.db)
        .await?;
        let run = RunId(run);
        if others {
            sqlx::query(
                "UPDATE job SET state = 'canceled', finished = ?2,
                     changes = changes || char(10) || 'canceled ' || attempt || ' ' || ?2
                 WHERE id = ?1",
            )
            .bind(id)
            .bind(tx.now)
            .execute(&mut *tx.db)
            .await?;
            tx.queue.leave(run, job.priority, job.id);
        } else {
            // A run that is already canceling stays as it is, until its worker lets go.
            sqlx::query(
                "UPDATE run SET finished = iif(state = 'queued', ?2, NULL), changed = ?2,
                     state = iif(state = 'queued', 'canceled', 'canceling')
                 WHERE id = ?1 AND state IN ('queued', 'running')",
            )
            .bind(run.0)
            .bind(tx.now)
            .execute(&mut *tx.db)
            .await?;
            tx.queue.remove(run);
            if job.state == JobState::Queued {
                tx.effects.push(Effect::Settled(Ending::Canceled, None));
            }
            tx.effects.push(Effect::Unwanted(run));
        }
        tx.effects.push(Effect::Ended(job.key));
        let after = read::job(&mut *tx.db, self.0).await?;
        Ok(after.map_or(Canceled::NotFound, Canceled::Done))
    }
}

/// Cancels a part of the jobs that match: some, so that nobody waits long behind it.
pub(super) struct CancelSome {
    pub(super) filter: Filter,
    /// Only jobs submitted before this one: what comes while jobs are canceled is not meant.
    pub(super) before: JobId,
    pub(super) at_most: u32,
}

impl Verb for CancelSome {
    /// How many were canceled, and where to go on; none if there are no more.
    type Answer = (u64, Option<JobId>);

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Self::Answer, Error> {
        let ids = read::unfinished(&mut *tx.db, &self.filter, self.before, self.at_most).await?;
        let mut canceled = 0;
        for id in &ids {
            canceled += u64::from(matches!(Cancel(*id).apply(tx).await?, Canceled::Done(_)));
        }
        let more = ids.len() as u64 == u64::from(self.at_most);
        Ok((canceled, ids.last().copied().filter(|_| more)))
    }
}

pub(super) struct Delete(pub(super) JobId);

impl Verb for Delete {
    type Answer = Deleted;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<Deleted, Error> {
        let Some(job) = read::job(&mut *tx.db, self.0).await? else {
            return Ok(Deleted::NotFound);
        };
        if !job.state.is_finished() {
            return Ok(Deleted::Unfinished(job.state));
        }
        let id = self.0.0.as_bytes().as_slice();
        let run: Option<i64> = sqlx::query_scalar("DELETE FROM job WHERE id = ?1 RETURNING run")
            .bind(id)
            .fetch_one(&mut *tx.db)
            .await?;
        if let Some(run) = run {
            delete_unnamed(tx, run).await?;
        }
        tx.effects.push(Effect::Ended(job.key));
        Ok(Deleted::Done)
    }
}
