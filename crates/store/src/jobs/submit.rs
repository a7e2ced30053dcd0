//! Submissions of jobs, and their outcomes.

use std::num::NonZeroU32;

use serde::Serialize;

use crate::database::{Connected, Error, IDEMPOTENCY, Result, Tables, sql};
use crate::jobs::read;
use crate::results::storing::Source;
use fretwork_engine::scenario::Warning;
use fretwork_job::{Job, JobId, Key};

/// A submission that passed all checks, with the key of its result.
#[derive(Debug, Clone)]
pub struct NewJob {
    /// The id of the job, which the caller generates.
    pub id: JobId,
    /// Who submits it.
    pub owner: String,
    /// The key of its result.
    pub key: Key,
    /// What to compute, in its stored form.
    pub task: String,
    /// The number of chunks into which the work is divided, so that workers share it; `None` if one worker computes
    /// all.
    pub chunks: Option<NonZeroU32>,
    /// The numbers of the chunks with which later stages of the work begin, separated by commas. Workers compute them
    /// after all chunks before them.
    pub stages: String,
    /// The scenario as the client wrote it, in JSON.
    pub submitted: Option<String>,
    /// Its priority among the jobs of its owner: 0 is the most urgent, 7 the least.
    pub priority: u8,
    /// A title for people.
    pub label: Option<String>,
    /// Words by which users find the job.
    pub tags: Vec<String>,
    /// Whether only its owner and administrators see the job.
    pub private: bool,
    /// The warnings about the task, for the client.
    pub warnings: Vec<Warning>,
    /// Those of the warnings that are about the two bodies. The result does not contain them. If this submission
    /// computes the result, its provenance contains them.
    pub submission_warnings: Vec<Warning>,
    /// Identifies a repetition of this submission; `None` without an idempotency key.
    pub repeatable: Option<Repeatable>,
    /// Whether to compute the result even if it is stored.
    pub afresh: bool,
    /// Whether the submission may start a run.
    pub admission: Admission,
    /// The id of the request that submits the job, for the log.
    pub trace: Option<String>,
}

/// Whether a submission may start a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Admission {
    /// It starts a run if the result is not stored and no run is live.
    #[default]
    NewRun,
    /// It starts no run. It uses the stored result or the live run.
    NoNewRun,
    /// It starts no run. It uses the stored result only.
    OnlyKnown,
}

/// Identifies a repetition of a submission.
#[derive(Debug, Clone)]
pub struct Repeatable {
    /// The idempotency key that the client gave to the submission.
    pub key: String,
    /// A digest of the submission. The same key with another digest is a mistake of the client.
    pub fingerprint: Vec<u8>,
}

/// What a submission did.
#[derive(Debug, Clone, PartialEq)]
pub enum Submitted {
    /// The submission was accepted as this job.
    Accepted(Job),
    /// The submission is a repetition. This is the job of the first submission.
    Repeated(Job),
    /// Its idempotency key belongs to another submission.
    IdempotencyConflict,
    /// It needs a new run, and [`Admission`] allows none.
    NeedsRun,
    /// [`Admission::OnlyKnown`] is set, and the result is not stored.
    Unknown,
    /// The queue is full.
    QueueFull {
        /// The number of queued jobs.
        queued: usize,
    },
}

/// Numbers of queued jobs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Queued {
    /// Jobs of all owners.
    pub(crate) all: usize,
    /// Jobs of the owner of the submission.
    pub(crate) own: usize,
}

impl Queued {
    /// Whether the queue is full for the owner of the submission. The last tenth of the queue is reserved for owners
    /// with few queued jobs, so that no owner can fill the whole queue.
    pub(crate) fn is_full(self, limit: usize) -> bool {
        let tenth = limit / 10;
        self.all >= limit || (self.all >= limit - tenth && self.own >= tenth)
    }
}

/// A list of plain texts or of warnings, as JSON.
#[expect(clippy::expect_used, reason = "a job without its warnings would mislead its client")]
pub(crate) fn json<T: Serialize>(list: &[T]) -> String {
    serde_json::to_string(list).expect("texts are valid JSON")
}

impl NewJob {
    /// The answer if this submission is a repetition, or uses the idempotency key of another submission.
    pub(crate) async fn repeated(&self, db: &mut impl Connected) -> Result<Option<Submitted>> {
        let Some(repeatable) = &self.repeatable else { return Ok(None) };
        let query = sql!(
            "SELECT id, fingerprint FROM job WHERE owner = $1 AND idempotency_key = $2";
            &self.owner, &repeatable.key
        );
        let Some(row) = db.row(query).await? else { return Ok(None) };
        if row.get::<&[u8]>("fingerprint")? != repeatable.fingerprint {
            return Ok(Some(Submitted::IdempotencyConflict));
        }
        Ok(read::job(row.get("id")?, db).await?.map(Submitted::Repeated))
    }

    /// The provenance of an answer that was computed before this job was submitted.
    pub(crate) fn source(&self, program: i64, now: i64) -> Source<'_> {
        let Self { id, key, ref owner, ref task, ref trace, .. } = *self;
        let (owner, warnings) = (Some(owner.as_str()), Some(json(&self.submission_warnings)));
        let (job, trace, program) = (Some(id), trace.as_deref(), Some(program));
        Source { key, task, owner, job, warnings, trace, program, now }
    }

    /// Translates an error of the statement that inserts the job.
    pub(crate) fn refused(&self, error: sqlx::Error) -> Error {
        match error.as_database_error() {
            // A violation of the index of idempotency keys is something else: the same submission was sent to two
            // servers at the same time. It is retried.
            Some(refusal)
                if refusal.is_unique_violation() && refusal.constraint() != Some(IDEMPOTENCY) =>
            {
                Error::JobExists(self.id)
            }
            _ => error.into(),
        }
    }
}
