//! Results to be stored, and what changes to stored results did.

use sha2::{Digest, Sha256};

use super::body::Body;
use fretwork_job::{Answer, Cost, JobId, Key, Outline};

/// What happened to the result of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finish {
    /// It is stored.
    Stored,
    /// The same result was stored before.
    Same,
    /// A different result was stored before, and stays. This is a defect, and it is logged.
    Differs,
    /// The worker has lost the run. The result is not stored.
    Refused,
}

/// What a request to delete a result did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Removed {
    /// There is no such result, or it was evicted or deleted before.
    NotFound,
    /// It is pinned.
    Pinned,
    /// Its body is deleted. Its scenario stays known.
    Done,
}

/// A result to be stored: compressed and hashed, outside of the writer task.
#[derive(Debug)]
pub struct Answered {
    pub(super) body: Body,
    /// Number of bytes of the JSON.
    pub(super) size: usize,
    pub(super) summary: String,
    pub(super) digest: [u8; 32],
    pub(super) outline: Box<Outline>,
    /// `None` if unknown.
    pub(super) cost: Option<Cost>,
}

impl Answered {
    /// Compresses and hashes an answer. Large answers take long, so do not call this in the writer task.
    ///
    /// # Panics
    /// There is no memory for the compressor.
    #[must_use]
    #[expect(clippy::expect_used, reason = "a result must not be lost silently")]
    pub fn new(answer: &Answer, cost: Option<Cost>) -> Self {
        Self {
            body: Body::pack(&answer.body).expect("any bytes can be compressed"),
            size: answer.body.len(),
            summary: answer.summary.to_string(),
            digest: Sha256::digest(&answer.body).into(),
            outline: answer.outline.clone(),
            cost,
        }
    }
}

/// The provenance of a result to be stored.
pub(super) struct Source<'a> {
    pub(super) key: Key,
    /// The attempt of the run that it ends.
    pub(super) attempt: u32,
    pub(super) task: &'a str,
    /// Its owner, its job, and the warnings of its submission as JSON; for [`Reason::Run`] those of the run.
    pub(super) owner: Option<&'a str>,
    pub(super) job: Option<JobId>,
    pub(super) warnings: Option<&'a str>,
    pub(super) trace: Option<&'a str>,
    /// The row in the table `program`.
    pub(super) program: Option<i64>,
    pub(super) now: i64,
}

/// Why a result is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reason {
    /// It ends the run $1.
    Run,
    /// It was computed before its job was submitted. It does not replace an evicted result, because it is not compared
    /// with it.
    Job,
    /// It is imported.
    Import,
}

/// What a change of a pin or a note did.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Changed {
    /// It is changed, or was so before.
    Done,
    /// There is no such result.
    NotFound,
    /// It belongs to this other owner; `None` if its owner is unknown.
    OtherOwner(Option<String>),
    /// The pins would take too many bytes.
    QuotaExceeded {
        /// Bytes of the pinned results, with this one.
        used: u64,
        /// The quota.
        quota: u64,
        /// Whether it is the quota for the pins of all owners together.
        of_all: bool,
    },
}

/// Who changes a pin or a note.
#[derive(Debug, Clone)]
pub struct Editor {
    /// The owner of what it adds.
    pub owner: String,
    /// Whether it may also change what others have added.
    pub may_change_all: bool,
}

impl Editor {
    pub(super) fn may_change(&self, owner: Option<&str>) -> bool {
        self.may_change_all || owner == Some(&self.owner)
    }
}
