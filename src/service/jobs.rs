//! Jobs after they are accepted: found, waited for, canceled, deleted.
//!
//! `reach` says whose jobs a caller may see and touch: those of one owner, or everyone's. The job of
//! another owner is answered like a job that does not exist, so that ids cannot be probed.

use std::time::Duration;

use tokio::time::sleep;

use super::Service;
use crate::job::{Job, JobId};
use crate::store::{Asked, Canceled, Changes, Deleted, Error, Filter, Page};

impl Service {
    /// A job as it stands.
    ///
    /// # Errors
    /// The database fails.
    pub async fn job(&self, reach: Option<&str>, id: JobId) -> Result<Option<Job>, Error> {
        let job = self.0.store.job(id).await?;
        Ok(job.filter(|job| reach.is_none_or(|owner| owner == job.owner)))
    }

    /// Up to `limit` jobs that match, newest first, older than `cursor`.
    ///
    /// # Errors
    /// The database fails.
    pub async fn jobs(
        &self,
        reach: Option<&str>,
        filter: Filter,
        cursor: Option<JobId>,
        limit: u32,
    ) -> Result<Page, Error> {
        self.0.store.jobs(&within(filter, reach), cursor, limit).await
    }

    /// What a job was asked to compute.
    ///
    /// # Errors
    /// The database fails.
    pub async fn asked(&self, id: JobId) -> Result<Asked, Error> {
        self.0.store.asked(id).await
    }

    /// The number of queued jobs of an owner, and of running ones.
    ///
    /// # Errors
    /// The database fails.
    pub async fn unfinished(&self, owner: &str) -> Result<(u64, u64), Error> {
        self.0.store.unfinished(owner).await
    }

    /// Hints that a job has changed, from now on.
    #[must_use]
    pub fn watch(&self, job: &Job) -> Changes {
        self.0.store.watch(&job.key)
    }

    /// The job once it is finished, or as it stands when the time is over or the service drains.
    ///
    /// # Errors
    /// The database fails.
    pub async fn wait(&self, job: Job, time: Duration) -> Result<Job, Error> {
        let until = async {
            tokio::select! {
                () = sleep(time) => {}
                () = self.drained() => {}
            }
        };
        self.0.store.wait(job, until).await
    }

    /// Cancels a job; its run stops when no other job shares it.
    ///
    /// # Errors
    /// The database fails.
    pub async fn cancel(&self, reach: Option<&str>, id: JobId) -> Result<Canceled, Error> {
        match self.job(reach, id).await? {
            Some(_) => self.0.store.cancel(id).await,
            None => Ok(Canceled::NotFound),
        }
    }

    /// Cancels every unfinished job that matches and was submitted before this call. Returns how many.
    ///
    /// # Errors
    /// The database fails.
    pub async fn cancel_all(&self, reach: Option<&str>, filter: Filter) -> Result<u64, Error> {
        self.0.store.cancel_all(&within(filter, reach)).await
    }

    /// Deletes a finished job; its result stays.
    ///
    /// # Errors
    /// The database fails.
    pub async fn delete(&self, reach: Option<&str>, id: JobId) -> Result<Deleted, Error> {
        match self.job(reach, id).await? {
            Some(_) => self.0.store.delete(id).await,
            None => Ok(Deleted::NotFound),
        }
    }
}

/// Of all jobs that match, those within reach.
fn within(filter: Filter, reach: Option<&str>) -> Filter {
    Filter { owner: filter.owner.or_else(|| reach.map(str::to_owned)), ..filter }
}
