//! A job as it is stored and shown.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};
use serde_json::Value;

use super::key::Key;
use super::words::{BadWord, words};

/// Names one job: a UUID of version 7, so that ids sort by time of submission.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct JobId(pub uuid::Uuid);

impl JobId {
    /// A new id, later than every id this process has made before.
    #[must_use]
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
        // Only the spelling that `Display` writes: a job has one address.
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
        /// Its last job was canceled, and its worker has not stopped yet.
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
    #[must_use]
    pub fn is_finished(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Canceled)
    }
}

words! {
    /// How a job gets its result.
    pub enum Origin: "job origin" {
        /// This job started the run.
        Computed = "computed",
        /// It joined a run that was queued or running.
        Coalesced = "coalesced",
        /// The result was known.
        Cached = "cached",
    }
}

words! {
    /// Why a job failed.
    pub enum FailureKind: "kind of failure" {
        /// The computation panicked: a defect of the program.
        Panicked = "panicked",
        /// The stored task cannot be read.
        UnreadableTask = "unreadable-task",
        /// The process died each time it computed this.
        WorkerLost = "worker-lost",
        /// It took longer than the server allows.
        TimeLimit = "time-limit",
        /// The database could not store its result.
        NotStored = "not-stored",
    }
}

/// One submission, as it stands.
#[derive(Debug, Clone, PartialEq)]
pub struct Job {
    /// Its name.
    pub id: JobId,
    /// Where it stands.
    pub state: JobState,
    /// The address of its result.
    pub key: Key,
    /// Who submitted it.
    pub owner: String,
    /// How it came to its result.
    pub origin: Origin,
    /// How often its run was begun: 0 before the first time and when the result was known.
    pub attempt: u32,
    /// The share of the work done, 0…1; 0 once canceled.
    pub progress: f64,
    /// Among the jobs of its owner: 0 is the most urgent, 7 the least.
    pub priority: u8,
    /// A line for people.
    pub label: Option<String>,
    /// Words to find it by.
    pub tags: Vec<String>,
    /// What the physics says the user should know: a JSON array of warnings.
    pub warnings: Value,
    /// When it was submitted, in milliseconds since 1970, like the times below.
    pub created: i64,
    /// When the present attempt began.
    pub started: Option<i64>,
    /// When it ended.
    pub finished: Option<i64>,
    /// Every state it was in, from the first.
    pub changes: Vec<Change>,
    /// Why it failed.
    pub failure: Option<Failure>,
    /// The short form of the result, once it has succeeded.
    pub summary: Option<Value>,
}

/// A change of a job's state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Change {
    /// The state from then on.
    pub state: JobState,
    /// The attempt it was in.
    pub attempt: u32,
    /// When, in milliseconds since 1970.
    pub at: i64,
}

/// Why a job failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// A word for programs.
    pub kind: FailureKind,
    /// A sentence for people.
    pub message: String,
}
