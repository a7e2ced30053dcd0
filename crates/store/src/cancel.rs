//! What requests to cancel or delete a job did.

use fretwork_job::{Job, JobState};

/// What a request to cancel a job did.
#[derive(Debug, Clone, PartialEq)]
pub enum Canceled {
    /// There is no such job.
    NotFound,
    /// The job had already ended.
    AlreadyFinished(Job),
    /// It is canceled, or will be as soon as its worker stops.
    Done(Job),
}

/// What a request to delete a job did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deleted {
    /// There is no such job.
    NotFound,
    /// It has not ended.
    Unfinished(JobState),
    /// It is deleted.
    Done,
}

/// Jobs that one transaction cancels. A larger number would delay other changes.
pub(super) const AT_ONCE: u32 = 100;
