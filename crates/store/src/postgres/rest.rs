//! Reading the queue takes long while PostgreSQL keeps many dead rows, or while the queue is long. What was read is then
//! used for a while.

use std::time::{Duration, Instant};

/// With fewer rows, reading takes milliseconds and what was read is not used again.
pub(super) const FEW: u64 = 10_000;
/// Maximum time for which something that was read is used.
pub(super) const MAX: Duration = Duration::from_secs(10);

/// When something was last read, and how long this took.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct Rest {
    read: Option<Instant>,
    took: Duration,
}

impl Rest {
    /// Something was read from `begun` until now.
    pub(super) fn since(begun: Instant) -> Self {
        Self { read: Some(Instant::now()), took: begun.elapsed() }
    }

    /// Whether to use what was read: with this many rows, for `times` the time that reading took.
    pub(super) fn lasts(&self, times: u32, rows: u64) -> bool {
        let time = (self.took * times).min(MAX);
        rows > FEW && self.read.is_some_and(|read| read.elapsed() < time)
    }
}
