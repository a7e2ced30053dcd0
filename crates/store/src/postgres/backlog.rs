//! The length of the queue. To count a long queue, or one with many dead rows, takes long. So a submission counts only
//! if the queue may be full, and what was counted is used for a while.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use parking_lot::Mutex;

use super::rest::Rest;
use crate::jobs::submit::Queued;

/// If the limit of the queue is at most this, every submission counts the queue.
const SMALL: usize = 1000;
/// What was counted is used for this multiple of the time that counting has taken.
const REST: u32 = 20;

#[derive(Debug)]
pub(super) struct Backlog {
    pub(super) limit: usize,
    counted: Mutex<BacklogCounts>,
}

#[derive(Debug, Default)]
struct BacklogCounts {
    /// An estimate of the number of queued jobs: the last count, plus the jobs that this server has queued since, minus the
    /// runs that it has claimed.
    all: usize,
    /// The jobs of owners: the last count, plus those that this server has queued since.
    own: HashMap<String, (usize, Rest)>,
    /// The last time that the oldest queued run had waited.
    waited: (Duration, Rest),
}

impl Backlog {
    pub(super) fn new(limit: usize) -> Self {
        // The queue is not counted yet, so it may be full.
        Self {
            limit,
            counted: Mutex::new(BacklogCounts { all: limit, ..BacklogCounts::default() }),
        }
    }

    /// The numbers of queued jobs for a submission of this owner; `None` if they must be counted. `dead` is the number of
    /// dead rows. While the queue is short, the numbers may be too low, because other servers queue jobs too.
    pub(super) fn queued(&self, owner: &str, dead: u64) -> Option<Queued> {
        let counted = self.counted.lock();
        let all = counted.all;
        let (own, rest) = counted.own.get(owner).copied().unwrap_or_default();
        let is_short = self.limit > SMALL && all <= self.limit / 2;
        (is_short || rest.lasts(REST, dead.max(all as u64))).then_some(Queued { all, own })
    }

    /// Stores what a submission of this owner has counted since `begun`.
    pub(super) fn counted(&self, owner: &str, queued: Queued, dead: u64, begun: Instant) {
        let rows = dead.max(queued.all as u64);
        let mut counted = self.counted.lock();
        counted.all = queued.all;
        counted.own.retain(|_, (_, rest)| rest.lasts(REST, rows));
        counted.own.insert(owner.to_owned(), (queued.own, Rest::since(begun)));
    }

    /// The last time that the oldest queued run had waited; `None` if the queue must be read.
    pub(super) fn waited(&self, dead: u64) -> Option<Duration> {
        let BacklogCounts { all, waited: (waited, rest), .. } = *self.counted.lock();
        rest.lasts(REST, dead.max(all as u64)).then_some(waited)
    }

    /// Stores what was read since `begun` about the whole queue.
    pub(super) fn read(&self, all: usize, waited: Duration, begun: Instant) {
        let mut counted = self.counted.lock();
        (counted.all, counted.waited) = (all, (waited, Rest::since(begun)));
    }

    /// Counting has failed, so the queue may be full.
    pub(super) fn is_unknown(&self) {
        self.counted.lock().all = self.limit;
    }

    pub(super) fn grows(&self, owner: &str) {
        let mut counted = self.counted.lock();
        counted.all += 1;
        if let Some((own, _)) = counted.own.get_mut(owner) {
            *own += 1;
        }
    }

    pub(super) fn shrinks(&self, runs: usize) {
        let mut counted = self.counted.lock();
        counted.all = counted.all.saturating_sub(runs);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A count that took a second.
    fn long_ago() -> Instant {
        Instant::now().checked_sub(Duration::from_secs(1)).unwrap()
    }

    #[test]
    fn a_slow_count_is_used_again_for_each_owner_that_it_was_for() {
        let backlog = Backlog::new(100);
        assert!(backlog.queued("anna", 1_000_000).is_none());
        backlog.counted("anna", Queued { all: 95, own: 8 }, 1_000_000, long_ago());
        backlog.grows("anna");
        backlog.grows("ben");
        backlog.shrinks(3);
        let queued = backlog.queued("anna", 1_000_000).unwrap();
        assert_eq!((queued.all, queued.own), (94, 9));
        assert!(backlog.queued("ben", 1_000_000).is_none());
        // With few dead rows, the next count is exact.
        assert!(backlog.queued("anna", 10).is_none());
    }

    #[test]
    fn a_fast_count_is_not_used_again() {
        let backlog = Backlog::new(100);
        let begun = Instant::now();
        backlog.counted("anna", Queued { all: 95, own: 8 }, 1_000_000, begun);
        std::thread::sleep(begun.elapsed() * 30);
        assert!(backlog.queued("anna", 1_000_000).is_none());
    }

    #[test]
    fn a_short_queue_is_counted_only_if_its_limit_is_small() {
        let backlog = Backlog::new(10_000);
        assert!(backlog.queued("anna", 0).is_none());
        backlog.read(5000, Duration::ZERO, Instant::now());
        assert_eq!(backlog.queued("anna", 0).unwrap().all, 5000);
        backlog.grows("anna");
        assert!(backlog.queued("anna", 0).is_none());
        backlog.is_unknown();
        assert!(backlog.queued("anna", 0).is_none());
    }
}
