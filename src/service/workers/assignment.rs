//! What a thread computes: a claimed piece, and its computation.

use std::time::Duration;

use fretwork_job::{Cost, Step};
use fretwork_store::{Answered, Claimed};

/// Estimated memory of a piece that was not begun.
const CLAIM_MEMORY: usize = 1 << 10;

/// A claimed piece, until its outcome is known.
pub(super) struct Assignment {
    pub(super) claimed: Claimed,
    /// `None` if it was not begun.
    pub(super) begun: Option<Begun>,
}

impl From<Claimed> for Assignment {
    fn from(claimed: Claimed) -> Self {
        Self { claimed, begun: None }
    }
}

impl Assignment {
    /// Estimated memory.
    pub(super) fn bytes(&self) -> usize {
        self.begun.as_ref().map_or(CLAIM_MEMORY, |begun| begun.bytes)
    }
}

/// The data that a worker has computed.
pub(super) enum Made {
    /// The result. It is compressed at once, because it may wait for the store.
    Answer(Answered),
    /// The rows of a chunk.
    Rows(Vec<u8>),
}

/// A computation that was begun.
pub(super) struct Begun {
    pub(super) step: Box<dyn FnMut() -> Step<Made> + Send>,
    /// Estimated memory.
    pub(super) bytes: usize,
    /// The longest time that it may take.
    pub(super) limit: Option<Duration>,
    /// What it has cost until the end of the last slice.
    pub(super) cost: Cost,
}

#[cfg(test)]
impl Begun {
    /// A computation without an end.
    pub(super) fn endless(bytes: usize) -> Self {
        let step = Box::new(|| Step::Working { progress: 0.0 });
        Self { step, bytes, limit: None, cost: Cost::ZERO }
    }
}
