//! A job as it is stored and shown.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};
use serde_json::Value;

use super::key::Key;
use super::received::Verified;
use fretwork_json::{BadWord, words};

/// The id of a job: a UUID of version 7, so that ids sort by time of submission.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct JobId(pub uuid::Uuid);

impl JobId {
    /// A new id. It sorts after all ids that this process has generated before.
    pub fn generate() -> Self {
        Self(uuid::Uuid::now_v7())
    }
}

impl fmt::Display for JobId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.hyphenated().fmt(f)
    }
}

impl FromStr for JobId {
    type Err = BadWord;
    fn from_str(text: &str) -> Result<Self, BadWord> {
        // Only the form that `Display` writes is valid, so that each job has only one URL.
        let id = uuid::Uuid::try_parse(text).map(Self).map_err(|_| BadWord("job id"))?;
        if id.to_string() == text { Ok(id) } else { Err(BadWord("job id")) }
    }
}

impl Serialize for JobId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

words! {
    /// The state of a job.
    pub enum JobState: "job state" {
        /// Waits for a worker.
        Queued = "queued",
        /// A worker computes it.
        Running = "running",
        /// The last job of the run was canceled, and the worker has not stopped yet.
        Canceling = "canceling",
        /// The result is stored.
        Succeeded = "succeeded",
        /// It ended with an error.
        Failed = "failed",
        /// It was canceled before it ended.
        Canceled = "canceled",
    }
}

impl JobState {
    /// Whether the state is final.
    pub fn is_finished(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Canceled)
    }
}

words! {
    /// How a job gets its result.
    pub enum Origin: "job origin" {
        /// This job started the run.
        Computed = "computed",
        /// The job shares a run that was already queued or running.
        Coalesced = "coalesced",
        /// The result was already stored.
        Cached = "cached",
    }
}

words! {
    /// How the result of a new computation compares with the earlier result of the same key.
    pub enum Recomputed: "comparison of a result" {
        /// Both are equal.
        Same = "same",
        /// They differ. The stored result stays.
        Differs = "differs",
        /// They differ. The earlier result was evicted or deleted, so the new one is stored.
        Replaced = "replaced",
    }
}

words! {
    /// Why a job failed.
    pub enum FailureKind: "kind of failure" {
        /// The computation panicked: a defect of the program.
        Panicked = "panicked",
        /// The stored task cannot be read.
        UnreadableTask = "unreadable-task",
        /// The process died at each attempt to compute the run.
        WorkerLost = "worker-lost",
        /// It took longer than the server allows.
        TimeLimit = "time-limit",
        /// The database could not store its result.
        NotStored = "not-stored",
    }
}

/// One submission in its current state.
#[derive(Debug, Clone, PartialEq)]
pub struct Job {
    /// Its id.
    pub id: JobId,
    /// Its state.
    pub state: JobState,
    /// The key of its result.
    pub key: Key,
    /// Who submitted it.
    pub owner: String,
    /// How it gets its result.
    pub origin: Origin,
    /// The number of attempts of its run; 0 before the first one, and if the result was known.
    pub attempt: u32,
    /// The share of the work that is done, in 0…1; 0 if it was canceled.
    pub progress: f64,
    /// Its priority among the jobs of its owner: 0 is the most urgent, 7 the least.
    pub priority: u8,
    /// A title for people.
    pub label: Option<String>,
    /// Words to find it by.
    pub tags: Vec<String>,
    /// Whether only its owner and administrators see it.
    pub private: bool,
    /// Warnings about the physics, as a JSON array.
    pub warnings: Value,
    /// When it was submitted. Times are in milliseconds since 1970.
    pub created: i64,
    /// When the current attempt began.
    pub started: Option<i64>,
    /// When it ended.
    pub finished: Option<i64>,
    /// All its states, from the first.
    pub changes: Vec<Change>,
    /// Why it failed.
    pub failure: Option<Failure>,
    /// The summary of the result, once the job has succeeded.
    pub summary: Option<Value>,
    /// How its result compares with an earlier one, if its run has computed the result again.
    pub recomputed: Option<Recomputed>,
    /// How much of its result was computed again, if an import brought the result.
    pub verified: Option<Verified>,
}

/// A change of a job's state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Change {
    /// The new state.
    pub state: JobState,
    /// The attempt.
    pub attempt: u32,
    /// When it changed, in milliseconds since 1970.
    pub at: i64,
}

/// Why a job failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// The kind of failure.
    pub kind: FailureKind,
    /// A message for people.
    pub message: String,
}
