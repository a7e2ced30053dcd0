//! Submissions, and what they do.

use std::num::NonZeroU32;

use serde_json::Value;

use super::error::{Error, IDEMPOTENCY};
use super::keep::Source;
use super::read;
use super::row::Columns;
use super::statement::sql;
use super::tables::{Connected, Tables};
use fretwork_engine::scenario::Warning;
use fretwork_job::{Job, JobId, Key};

/// A submission, checked and with its key.
#[derive(Debug, Clone)]
pub struct NewJob {
    /// Its id, made by the caller.
    pub id: JobId,
    /// Who submits it.
    pub owner: String,
    /// The key of its result.
    pub key: Key,
    /// What to compute, in its stored form.
    pub task: String,
    /// The number of chunks into which the work is divided, so that workers share it; `None` if one worker computes all.
    pub chunks: Option<NonZeroU32>,
    /// The scenario as the client wrote it, in JSON.
    pub submitted: Option<String>,
    /// Its priority among the jobs of its owner: 0 is the most urgent, 7 the least.
    pub priority: u8,
    /// A title for people.
    pub label: Option<String>,
    /// Words to find it by.
    pub tags: Vec<String>,
    /// What the client should know about the task.
    pub warnings: Vec<Warning>,
    /// Those of the warnings that the result does not contain: they are about the two bodies. If this submission
    /// computes the result, the provenance of the result has them.
    pub submission_warnings: Vec<Warning>,
    /// How a repetition of this submission is recognised.
    pub repeatable: Option<Repeatable>,
    /// Whether to compute even if the result is known.
    pub afresh: bool,
    /// What it may start.
    pub admission: Admission,
    /// The request that submits it, for the log.
    pub trace: Option<String>,
}

/// What a submission may start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Admission {
    /// A new run, if it needs one.
    #[default]
    NewRun,
    /// No run: it finds a known result or joins a live run.
    NoNewRun,
    /// No run: it finds a known result.
    OnlyKnown,
}

/// How a repetition of a submission is recognised.
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
    /// It is a job.
    Accepted(Job),
    /// It is a repetition. This is the job of the first submission.
    Repeated(Job),
    /// Its idempotency key belongs to another submission.
    IdempotencyConflict,
    /// It needs a new run, and [`Admission`] allows none.
    NeedsRun,
    /// [`Admission::OnlyKnown`] is set, and the result is not known.
    Unknown,
    /// The queue is full.
    QueueFull {
        /// The number of queued jobs.
        queued: usize,
    },
}

/// How many jobs are queued.
#[derive(Debug, Clone, Copy)]
pub(super) struct Queued {
    /// Jobs of all owners.
    pub(super) all: usize,
    /// Jobs of the owner of the submission.
    pub(super) own: usize,
}

impl Queued {
    /// Whether the queue has no place for another job of the owner. The last tenth of the queue is for owners with few jobs
    /// in it, so that no owner fills it all.
    pub(super) fn is_full(self, limit: usize) -> bool {
        let tenth = limit / 10;
        self.all >= limit || (self.all >= limit - tenth && self.own >= tenth)
    }
}

/// A submission with its texts in JSON, written before a transaction begins.
pub(super) struct EncodedJob {
    pub(super) job: NewJob,
    pub(super) tags: String,
    pub(super) warnings: String,
    pub(super) submission_warnings: String,
}

impl EncodedJob {
    #[expect(clippy::expect_used, reason = "a job without its warnings would mislead its client")]
    pub(super) fn new(job: NewJob) -> Self {
        let tags = Value::from(job.tags.clone()).to_string();
        let json = |warnings| serde_json::to_string(warnings).expect("warnings are plain texts");
        let warnings = json(&job.warnings);
        let submission_warnings = json(&job.submission_warnings);
        Self { job, tags, warnings, submission_warnings }
    }

    /// The job that this submission made when it was first sent.
    pub(super) async fn repeated(
        &self,
        db: &mut impl Connected,
    ) -> Result<Option<Submitted>, Error> {
        let Some(repeatable) = &self.job.repeatable else { return Ok(None) };
        let query = sql!(
            "SELECT id, fingerprint FROM job WHERE owner = $1 AND idempotency_key = $2";
            &self.job.owner, &repeatable.key
        );
        let Some(row) = db.row(query).await? else { return Ok(None) };
        if row.get::<&[u8]>("fingerprint")? != repeatable.fingerprint {
            return Ok(Some(Submitted::IdempotencyConflict));
        }
        Ok(read::job(row.get("id")?, db).await?.map(Submitted::Repeated))
    }

    /// The provenance of an answer that was computed before this job was submitted.
    pub(super) fn source(&self, program: i64, now: i64) -> Source<'_> {
        let NewJob { id, key, ref owner, ref task, ref trace, .. } = self.job;
        let (owner, warnings) = (Some(owner.as_str()), Some(self.submission_warnings.as_str()));
        let (job, trace, program) = (Some(id), trace.as_deref(), Some(program));
        Source { key, task, owner, job, warnings, trace, program, now }
    }

    /// The error of the statement that inserts the job.
    pub(super) fn refused(&self, error: sqlx::Error) -> Error {
        match error.as_database_error() {
            // The index of idempotency keys is another one. Two first submissions to several servers meet there.
            Some(refusal)
                if refusal.is_unique_violation() && refusal.constraint() != Some(IDEMPOTENCY) =>
            {
                Error::JobExists(self.job.id)
            }
            _ => error.into(),
        }
    }
}
