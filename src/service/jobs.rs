//! Accepted jobs: find, wait, rename, cancel, delete.
//!
//! `reach` is the owner whose jobs a caller may see and change; `None` is all owners. A job out of reach is
//! reported as unknown, so that a caller cannot find out whether it exists.

use std::time::Duration;

use tokio::time::sleep;

use super::Service;
use fretwork_job::{Job, JobId, Naming};
use fretwork_store::{Actor, Canceled, Deleted, Filter, Page, Result};

impl Service {
    /// A job, if it is within reach: if its owner is `reach`, or if `reach` is `None`.
    ///
    /// # Errors
    /// The database fails.
    pub async fn job(&self, reach: Option<&str>, id: JobId) -> Result<Option<Job>> {
        let job = self.0.store.job(id).await?;
        Ok(job.filter(|job| reach.is_none_or(|owner| owner == job.owner)))
    }

    /// Up to `limit` jobs within reach that match after `cursor`, in the order of the filter.
    ///
    /// # Errors
    /// The database fails.
    pub async fn jobs(
        &self,
        reach: Option<&str>,
        filter: Filter,
        cursor: Option<JobId>,
        limit: u32,
    ) -> Result<Page> {
        self.0.store.jobs(&within(filter, reach), cursor, limit).await
    }

    /// The number of jobs within reach that match.
    ///
    /// # Errors
    /// The database fails.
    pub async fn count(&self, reach: Option<&str>, filter: Filter) -> Result<u64> {
        self.0.store.count_jobs(&within(filter, reach)).await
    }

    /// Changes the label and the tags of a job within reach. Returns the job; `None` if there is none.
    ///
    /// # Errors
    /// The database fails.
    pub async fn rename(
        &self,
        reach: Option<&str>,
        id: JobId,
        naming: Naming,
    ) -> Result<Option<Job>> {
        match self.job(reach, id).await? {
            Some(_) => self.0.store.rename(id, naming).await,
            None => Ok(None),
        }
    }

    /// Waits until the job is finished, the time is over or the service drains. Returns the job as it is then.
    ///
    /// # Errors
    /// The database fails.
    pub async fn wait(&self, job: Job, time: Duration) -> Result<Job> {
        let until = async {
            tokio::select! {
                () = sleep(time) => {}
                () = self.drained() => {}
            }
        };
        self.0.store.wait(job, until).await
    }

    /// Cancels a job within reach. Its run stops if no other job shares it.
    ///
    /// # Errors
    /// The database fails.
    pub async fn cancel(&self, reach: Option<&str>, id: JobId, by: Actor) -> Result<Canceled> {
        match self.job(reach, id).await? {
            Some(_) => self.0.store.cancel(id, by).await,
            None => Ok(Canceled::NotFound),
        }
    }

    /// Cancels all unfinished jobs within reach that match. Returns their number.
    ///
    /// # Errors
    /// The database fails.
    pub async fn cancel_all(&self, reach: Option<&str>, filter: Filter, by: &Actor) -> Result<u64> {
        self.0.store.cancel_all(&within(filter, reach), by).await
    }

    /// Deletes a finished job within reach. Its result stays.
    ///
    /// # Errors
    /// The database fails.
    pub async fn delete(&self, reach: Option<&str>, id: JobId, by: Actor) -> Result<Deleted> {
        match self.job(reach, id).await? {
            Some(_) => self.0.store.delete(id, by).await,
            None => Ok(Deleted::NotFound),
        }
    }
}

/// Limits a filter to jobs within reach.
fn within(filter: Filter, reach: Option<&str>) -> Filter {
    Filter { owner: reach.map(str::to_owned).or(filter.owner), ..filter }
}
