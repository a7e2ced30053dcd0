//! The length of the queue as it was counted last. To count it takes as long as the queue is, so a submission only counts it
//! while it may be full.

use std::sync::atomic::{AtomicUsize, Ordering};

/// The length of the queue as it was counted last.
#[derive(Debug)]
pub(super) struct Backlog {
    limit: usize,
    jobs: AtomicUsize,
}

impl Backlog {
    /// A limit up to which a submission always counts.
    const SMALL: usize = 1000;

    pub(super) fn new(limit: usize) -> Self {
        // It was not counted yet.
        Self { limit, jobs: AtomicUsize::new(limit) }
    }

    /// Stores the count; `None` if it has failed.
    pub(super) fn counted(&self, jobs: Option<usize>) {
        self.jobs.store(jobs.unwrap_or(self.limit), Ordering::Relaxed);
    }

    pub(super) fn grows(&self) {
        self.jobs.fetch_add(1, Ordering::Relaxed);
    }

    /// The limit, if the queue may have reached it. Other servers may have queued jobs since the last count.
    pub(super) fn limit(&self) -> Option<usize> {
        let near = self.limit <= Self::SMALL || self.jobs.load(Ordering::Relaxed) > self.limit / 2;
        near.then_some(self.limit)
    }
}
