//! An estimate of the length of the queue. To count a long queue takes long. So a submission counts the queue only if
//! the estimate shows that the queue may be full.

use std::sync::atomic::{AtomicUsize, Ordering};

/// An estimate of the number of queued jobs: the last count, plus the jobs that this server has queued since, minus the
/// runs that it has claimed.
#[derive(Debug)]
pub(super) struct Backlog {
    limit: usize,
    jobs: AtomicUsize,
}

impl Backlog {
    /// If the limit of the queue is at most this, every submission counts the queue.
    const SMALL: usize = 1000;

    pub(super) fn new(limit: usize) -> Self {
        // The queue is not counted yet, so it may be full.
        Self { limit, jobs: AtomicUsize::new(limit) }
    }

    /// Stores a count; `None` if counting has failed. Then the queue may be full.
    pub(super) fn counted(&self, jobs: Option<usize>) {
        self.jobs.store(jobs.unwrap_or(self.limit), Ordering::Relaxed);
    }

    pub(super) fn grows(&self) {
        self.jobs.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn shrinks(&self, runs: usize) {
        let less = |jobs: usize| Some(jobs.saturating_sub(runs));
        let _ = self.jobs.fetch_update(Ordering::Relaxed, Ordering::Relaxed, less);
    }

    /// The limit of the queue, if the queue may have reached it: if the limit is small, or the estimate exceeds half of
    /// it. The estimate may be too low, because other servers may have queued jobs since the last count.
    pub(super) fn limit(&self) -> Option<usize> {
        let near = self.limit <= Self::SMALL || self.jobs.load(Ordering::Relaxed) > self.limit / 2;
        near.then_some(self.limit)
    }
}
