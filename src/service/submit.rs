//! Submitting: the one way in for every job.

use std::time::Duration;

use serde_json::json;
use sha2::{Digest as _, Sha256};

use super::Service;
use crate::job::{Answer, Job, JobId, JobState, Prepared, Submission, Task};
use crate::store::{Admission, Error, NewJob, Repeatable, Submitted};

/// How a submission is treated.
#[derive(Debug, Clone, Default)]
pub struct Terms {
    /// Who submits it.
    pub owner: String,
    /// Among the jobs of its owner: 0 is the most urgent, 7 the least.
    pub priority: u8,
    /// The client's name for this submission: repeated under the same name, it stays one job.
    pub idempotency_key: Option<String>,
    /// Compute although the result may be known.
    pub afresh: bool,
    /// Accept it only if the result is known.
    pub only_known: bool,
    /// Answer when the job is finished, at the latest after this time; without it, at once.
    pub wait: Option<Duration>,
    /// The request that submits it, for the log.
    pub trace: Option<String>,
}

/// A submission that is a job now.
#[derive(Debug)]
pub struct Accepted {
    /// The job.
    pub job: Job,
    /// The answer, where it was computed just now.
    pub answer: Option<Answer>,
}

/// Why a submission is no job.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// The service takes no new jobs.
    #[error("the server is shutting down and takes no new jobs")]
    Draining,
    /// The idempotency key was used for something else.
    #[error("the idempotency key was used for another submission")]
    IdempotencyConflict,
    /// Only a known result was asked for, and it is not known.
    #[error("the result is not known")]
    NotCached,
    /// The run would take longer than a run may take.
    #[error("the run would take {estimate:?}, and the limit is {limit:?}")]
    TooExpensive {
        /// Estimated processor time of the run.
        estimate: Duration,
        /// The longest that a run may take.
        limit: Duration,
    },
    /// The queue has no place for it.
    #[error("{queued} jobs wait already")]
    QueueFull {
        /// How many jobs wait.
        queued: usize,
        /// When a place is likely to be free.
        retry_after: Duration,
    },
    /// The database failed.
    #[error(transparent)]
    Store(#[from] Error),
}

impl Service {
    /// Makes a job of a submission: finds its result, joins the run under way, or starts a run. A short run
    /// whose client waits is computed here; a longer one goes through the queue.
    ///
    /// # Errors
    /// The submission is refused. Once the job is accepted there is no error: a wait that fails only ends.
    pub async fn submit(&self, submission: Submission, terms: Terms) -> Result<Accepted, Refusal> {
        if self.is_draining() {
            return Err(Refusal::Draining);
        }
        let Submission { prepared, submitted, label, tags } = submission;
        let estimate = Duration::try_from_secs_f64(prepared.seconds).unwrap_or(Duration::MAX);
        let too_long = self.0.run_limit.filter(|limit| estimate > *limit);
        let new = NewJob {
            id: JobId::generate(),
            owner: terms.owner,
            key: prepared.key,
            task: prepared.stored.to_string(),
            submitted,
            priority: terms.priority,
            repeatable: terms.idempotency_key.map(|key| Repeatable {
                key,
                fingerprint: fingerprint(&prepared, label.as_deref(), &tags),
            }),
            label,
            tags,
            warnings: prepared.warnings.clone(),
            afresh: terms.afresh,
            admission: match too_long {
                _ if terms.only_known => Admission::OnlyKnown,
                Some(_) => Admission::NoNewRun,
                None => Admission::NewRun,
            },
            trace: terms.trace,
        };
        let waits = terms.wait.is_some_and(|time| !time.is_zero());
        let short = &self.0.short;
        let recorded = if waits && short.suits(&new, &prepared) {
            short.submit(&new, &prepared).await?
        } else {
            None
        };
        let (submitted, answer) = match recorded {
            Some(recorded) => recorded,
            None => (self.enqueue(new, prepared).await?, None),
        };
        let job = match submitted {
            Submitted::Accepted(job) | Submitted::Repeated(job) => job,
            Submitted::IdempotencyConflict => return Err(Refusal::IdempotencyConflict),
            Submitted::Unknown => return Err(Refusal::NotCached),
            Submitted::NeedsRun => {
                let limit = too_long.unwrap_or_default();
                return Err(Refusal::TooExpensive { estimate, limit });
            }
            Submitted::QueueFull { queued } => {
                let retry_after = self.retry_after();
                return Err(Refusal::QueueFull { queued, retry_after });
            }
        };
        // From here on the job is accepted, and the client must hear so whatever else goes wrong.
        let job = match terms.wait {
            Some(time) => self.wait(job.clone(), time).await.unwrap_or(job),
            None => job,
        };
        Ok(Accepted { job, answer })
    }

    /// Submits to the store. The prepared task waits for the worker that claims its run.
    async fn enqueue(&self, new: NewJob, prepared: Prepared) -> Result<Submitted, Error> {
        let (waiting, key) = (&self.0.waiting, prepared.key);
        // Before the store knows of it: a worker may claim the run before this call returns.
        waiting.keep(prepared);
        let submitted = match self.0.store.submit(new).await {
            // A short run recorded it, and then its leader was dropped before it could say so.
            Err(Error::JobExists(id)) => {
                self.0.store.job(id).await?.map(Submitted::Accepted).ok_or(Error::Closed)
            }
            submitted => submitted,
        };
        let queued = |job: &Job| job.state == JobState::Queued;
        if !matches!(&submitted, Ok(Submitted::Accepted(job) | Submitted::Repeated(job)) if queued(job))
        {
            waiting.take(&key);
        }
        submitted
    }

    /// When the queue is likely to have a place: the time of a run, shared by the workers.
    fn retry_after(&self) -> Duration {
        let seconds = self.0.store.tally().seconds_per_run() / self.0.workers as f64;
        Duration::from_secs_f64(seconds.clamp(1.0, 60.0).ceil())
    }
}

/// A digest of what was sent. It is made of the first stored form of tasks, so that an idempotency key
/// outlives an update of the program.
fn fingerprint(prepared: &Prepared, label: Option<&str>, tags: &[String]) -> Vec<u8> {
    let scenario = Task::scenario_in(&prepared.stored).map(ToString::to_string);
    let first_form = format!("{{\"scenario\":{}}}", scenario.unwrap_or_default());
    Sha256::digest(json!([first_form, label, tags]).to_string()).to_vec()
}
