//! Jobs, their keys and states, and the [`Task`] that a job computes.

mod canonical;
pub mod clock;
mod document;
pub mod earlier;
mod key;
mod outline;
mod received;
mod record;
mod submission;
mod task;

pub use canonical::{Canonical, TaskKind, asked_in};
pub use document::{BadDocument, ResultDocument};
pub use fretwork_json::{BadWord, words};
pub use key::{BadKey, ENGINE, Engine, Key};
pub use outline::{Outline, SCALARS, Scalar, WORDS, Word};
pub use received::{Received, Refused, Verified, is_too_deep};
pub use record::{Change, Failure, FailureKind, Job, JobId, JobState, Origin, Recomputed};
pub use submission::{MAX_LABEL, MAX_SUBMITTED, MAX_TAG, MAX_TAGS, Naming, Submission};
pub use task::{Answer, Begin, Cost, Prepared, Step, Task, Work};
