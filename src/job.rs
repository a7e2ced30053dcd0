//! What clients ask for and what is kept: jobs, their keys and states, and the [`Task`] behind them.

pub mod clock;
pub mod json;
mod outline;
mod submission;
mod task;

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use data_encoding::HEXLOWER;
use serde::Serialize;
use serde_json::Value;
use sha2::{Digest, Sha256};

pub use outline::{Outline, SCALARS, Scalar, WORDS, Word};
pub use submission::{BadSubmission, MAX_LABEL, MAX_SUBMITTED, MAX_TAG, MAX_TAGS, Submission};
pub use task::{Answer, Begin, Cost, ENGINE, Engine, Prepared, Step, Task, Work, summary};

/// The address of a result: SHA-256 of the engine's name, its `numerics` version and the
/// canonical scenario (RFC 8785), written in lower-case hexadecimal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Key([u8; 32]);

impl Key {
    /// The 32 bytes of the digest.
    #[must_use]
    pub fn bytes(&self) -> &[u8; 32] {
        &self.0
    }
    /// The key whose digest these bytes are.
    #[must_use]
    pub fn from_bytes(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }
    /// The key of a canonical task, for instance `{"scenario": {…}}`, under this `numerics` version.
    ///
    /// # Panics
    /// The task has no form in JSON.
    #[must_use]
    #[expect(clippy::expect_used, reason = "a key must never be made of something else")]
    pub fn of(numerics: u32, task: &impl Serialize) -> Self {
        #[derive(Serialize)]
        struct Identity<'a, T> {
            engine: &'static str,
            numerics: u32,
            #[serde(flatten)]
            task: &'a T,
        }
        let identity = Identity { engine: ENGINE.name, numerics, task };
        let bytes = serde_json_canonicalizer::to_vec(&identity);
        Self::digest(&bytes.expect("a task is made of finite numbers and strings"))
    }
    /// The key of a run by its canonical scenario.
    #[must_use]
    pub fn of_scenario(numerics: u32, scenario: &impl Serialize) -> Self {
        Self::of(numerics, &BTreeMap::from([("scenario", scenario)]))
    }
    fn digest(document: &[u8]) -> Self {
        Self(Sha256::digest(document).into())
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut digits = [0; 64];
        HEXLOWER.encode_mut(&self.0, &mut digits);
        f.write_str(str::from_utf8(&digits).map_err(|_| fmt::Error)?)
    }
}

/// A key must be 64 lower-case hexadecimal digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a key is 64 lower-case hexadecimal digits")]
pub struct BadKey;

impl FromStr for Key {
    type Err = BadKey;
    fn from_str(text: &str) -> Result<Self, BadKey> {
        let mut bytes = [0; 32];
        if text.len() != 64 {
            return Err(BadKey);
        }
        HEXLOWER.decode_mut(text.as_bytes(), &mut bytes).map_err(|_| BadKey)?;
        Ok(Self(bytes))
    }
}

impl Serialize for Key {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

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
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// A text that is not one of the words it should be; it names what was expected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("not a {0}")]
pub struct BadWord(pub &'static str);

/// Where a job stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Waits for a worker.
    Queued,
    /// A worker computes it.
    Running,
    /// Its last listener has left; the worker is being stopped.
    Canceling,
    /// The result is there.
    Succeeded,
    /// It ended with an error.
    Failed,
    /// It was canceled before it ended.
    Canceled,
}

impl JobState {
    /// Every state, in the order of a job's life.
    pub const ALL: [Self; 6] = [
        Self::Queued,
        Self::Running,
        Self::Canceling,
        Self::Succeeded,
        Self::Failed,
        Self::Canceled,
    ];

    /// The word for it, in JSON and in the tables.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Canceling => "canceling",
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
            Self::Canceled => "canceled",
        }
    }

    /// Whether nothing will change any more.
    #[must_use]
    pub fn is_finished(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Canceled)
    }
}

/// How a job came to its result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// This job started the run.
    Computed,
    /// It joined a run that was already queued or running.
    Coalesced,
    /// The result was already known.
    Cached,
}

impl Origin {
    /// Every origin.
    pub const ALL: [Self; 3] = [Self::Computed, Self::Coalesced, Self::Cached];

    /// The word for it, in JSON and in the tables.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Computed => "computed",
            Self::Coalesced => "coalesced",
            Self::Cached => "cached",
        }
    }
}

/// Why a job failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FailureKind {
    /// The computation panicked: a fault of the program.
    Panicked,
    /// The stored task could not be read back.
    UnreadableTask,
    /// The process died each time this was computed.
    WorkerLost,
    /// It took longer than the server allows.
    TimeLimit,
    /// The database could not keep its result.
    NotStored,
}

impl FailureKind {
    /// Every kind.
    pub const ALL: [Self; 5] =
        [Self::Panicked, Self::UnreadableTask, Self::WorkerLost, Self::TimeLimit, Self::NotStored];

    /// The word for it, in JSON and in the tables.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Panicked => "panicked",
            Self::UnreadableTask => "unreadable-task",
            Self::WorkerLost => "worker-lost",
            Self::TimeLimit => "time-limit",
            Self::NotStored => "not-stored",
        }
    }
}

/// Display and `FromStr` of a closed set of words, through its `as_str` and `ALL`.
macro_rules! words {
    ($($type:ty: $name:literal),+) => {$(
        impl fmt::Display for $type {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.as_str())
            }
        }
        impl FromStr for $type {
            type Err = BadWord;
            fn from_str(text: &str) -> Result<Self, BadWord> {
                Self::ALL.into_iter().find(|word| word.as_str() == text).ok_or(BadWord($name))
            }
        }
    )+};
}
words!(JobState: "job state", Origin: "job origin", FailureKind: "kind of failure");

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_reads_back_as_it_was_written() {
        let key = Key::digest(b"a scenario");
        assert_eq!(key.to_string().parse(), Ok(key));
        assert_eq!(key.to_string().to_uppercase().parse::<Key>(), Err(BadKey));
        assert_eq!("12".parse::<Key>(), Err(BadKey));
    }
}
