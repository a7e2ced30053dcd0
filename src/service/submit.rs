//! Submits jobs. Every job of every interface comes through here.

use std::time::Duration;

use serde_json::json;
use sha2::{Digest as _, Sha256};
use tokio::time::sleep;

use super::{Excess, Service};
use fretwork_job::{Answer, Job, JobId, JobState, Prepared, Submission, asked_in};
use fretwork_store::{Admission, Error, NewJob, Repeatable, Result, Submitted};

/// What a client demands of its submission, besides the scenario.
#[derive(Debug, Clone, Default)]
pub struct Terms {
    /// The owner of the job.
    pub owner: String,
    /// Whether its names are private, unless the submission says so itself.
    pub private: bool,
    /// The urgency among the jobs of the owner: 0 is the most urgent, 7 the least.
    pub priority: u8,
    /// The client's name for this submission. If the client repeats the submission with the same name, it stays one
    /// job.
    pub idempotency_key: Option<String>,
    /// Whether to compute the result even if it is known.
    pub afresh: bool,
    /// Whether to accept the job only if its result is known.
    pub only_known: bool,
    /// How long to wait for the end of the job.
    pub wait: Option<Duration>,
    /// The ids of the request, for the log of the run.
    pub trace: Option<String>,
}

/// An accepted submission.
pub struct Accepted {
    /// The job.
    pub job: Job,
    /// The answer, if this call computed it.
    pub answer: Option<Answer>,
    /// Whether the submission repeats an earlier one. The job then keeps the scenario, the label and the tags of the
    /// first submission.
    pub repeated: bool,
}

/// Why a submission was refused. The displayed text also says what to change.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// The service accepts no new jobs.
    #[error("The server is shutting down and accepts no new jobs. Submit again in a moment.")]
    Draining,
    /// The idempotency key was used for another submission.
    #[error("This Idempotency-Key was used for another submission. Send another Idempotency-Key.")]
    IdempotencyConflict,
    /// The submission accepts only a known result, and the result is not known.
    #[error("The server does not have the result. To compute it, submit without `only-if-cached`.")]
    NotCached,
    /// The task would take more than a limit.
    #[error(transparent)]
    TooExpensive(Excess),
    /// The queue is full.
    #[error(
        "The queue is full: {queued} jobs wait. Submit again after the number of seconds in Retry-After."
    )]
    QueueFull {
        /// The number of queued jobs.
        queued: usize,
        /// Estimated time until the queue has room.
        retry_after: Duration,
    },
    /// The database failed.
    #[error(transparent)]
    Store(#[from] Error),
}

impl Service {
    /// Submits a job: finds the stored result, joins the live run, or makes a new run. If the client waits, a short
    /// run is computed in this call. A longer run is queued.
    ///
    /// # Errors
    /// The submission is refused. After the job is accepted there are no errors: if waiting fails, the wait ends.
    pub async fn submit(&self, submission: Submission, terms: Terms) -> Result<Accepted, Refusal> {
        if self.is_draining() {
            return Err(Refusal::Draining);
        }
        let Submission { prepared, submitted, label, tags, private } = submission;
        let private = private.unwrap_or(terms.private);
        let excess = self.0.limits.refuse(&prepared);
        let new = NewJob {
            id: JobId::generate(),
            owner: terms.owner,
            key: prepared.key,
            task: prepared.stored.to_string(),
            chunks: prepared.chunks(),
            stages: prepared.stages(),
            submitted,
            priority: terms.priority,
            repeatable: terms.idempotency_key.map(|key| Repeatable {
                key,
                fingerprint: fingerprint(&prepared, (label.as_deref(), &tags, private)),
            }),
            label,
            tags,
            private,
            warnings: prepared.warnings(),
            submission_warnings: prepared.submission_warnings.clone(),
            afresh: terms.afresh,
            admission: match excess {
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
        let repeated = matches!(submitted, Submitted::Repeated(_));
        let job = match submitted {
            Submitted::Accepted(job) | Submitted::Repeated(job) => job,
            Submitted::IdempotencyConflict => return Err(Refusal::IdempotencyConflict),
            Submitted::Unknown => return Err(Refusal::NotCached),
            Submitted::NeedsRun => {
                let Some(excess) = excess else {
                    unreachable!("only a task beyond the limit needs a run and gets none")
                };
                return Err(Refusal::TooExpensive(excess));
            }
            Submitted::QueueFull { queued } => {
                let retry_after = self.retry_after();
                return Err(Refusal::QueueFull { queued, retry_after });
            }
        };
        // The job is accepted, so its client must get it even if the wait fails.
        let job = match terms.wait {
            Some(time) => self.wait(job.clone(), time).await.unwrap_or(job),
            None => job,
        };
        Ok(Accepted { job, answer, repeated })
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

    /// Submits to the store. The prepared task stays in memory for the worker that claims its run.
    async fn enqueue(&self, new: NewJob, prepared: Prepared) -> Result<Submitted> {
        let (waiting, key) = (&self.0.waiting, prepared.key);
        // The task is kept before the submission, because a worker may claim the run before `submit` returns. A study
        // is not kept here: its workers keep it themselves.
        let kept = new.chunks.is_none() && waiting.keep(prepared);
        let submitted = match self.0.store.submit(new).await {
            // The job exists already: an equal short run recorded it, and was dropped before it returned the job.
            Err(Error::JobExists(id)) => {
                self.0.store.job(id).await?.map(Submitted::Accepted).ok_or(Error::Closed)
            }
            submitted => submitted,
        };
        let queued = |job: &Job| job.state == JobState::Queued;
        if kept
            && !matches!(&submitted, Ok(Submitted::Accepted(job) | Submitted::Repeated(job)) if queued(job))
        {
            waiting.take(&key);
        }
        submitted
    }

    /// Estimated time until the queue has room: the mean time of a run, divided by the number of workers.
    fn retry_after(&self) -> Duration {
        let seconds = self.0.store.tally().seconds_per_run() / self.places() as f64;
        Duration::from_secs_f64(seconds.clamp(1.0, 60.0).ceil())
    }
}

/// A digest of a submission, by which the server recognises its repetition. The digest is that of version 1 of the
/// stored form, so that the server recognises a repetition after an update of the program too.
#[expect(clippy::expect_used, reason = "a wrong digest would accept another submission")]
fn fingerprint(prepared: &Prepared, named: (Option<&str>, &[String], bool)) -> Vec<u8> {
    let (label, tags, private) = named;
    let (kind, asked) =
        asked_in(&prepared.stored).expect("a prepared task has a scenario or a study");
    let version_1 = format!("{{\"{}\":{asked}}}", kind.member());
    let private = if private { " private" } else { "" };
    Sha256::digest(json!([version_1, label, tags]).to_string() + private).to_vec()
}
