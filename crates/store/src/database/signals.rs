//! Signals that are sent after a commit: to listeners of a key, to idle workers, to the workers of running runs, and to
//! the metrics.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{broadcast, watch};

use crate::database::error::Result;
use crate::database::row::{RunId, RunPart};
use crate::database::tally::{Ending, Tally};
use crate::database::usage::Usage;
use fretwork_job::clock::now;
use fretwork_job::{Key, Origin, Recomputed};

/// A signal that is sent after a commit.
pub(crate) enum Effect {
    /// A job or run of this key has changed.
    Changed(Key),
    /// A job or run of this key has changed, and may have ended.
    Ended(Key),
    /// A run or a piece of a study can be claimed.
    Queued,
    /// A worker has claimed this part, which was lost this often. The flag tells the worker to stop.
    Started(RunPart, Stop, u32),
    /// No worker needs to compute this run any more.
    Unwanted(RunId),
    /// No worker computes this part any more.
    LetGo(RunPart),
    /// A job was accepted.
    Submitted(Origin),
    /// A run ended, after this number of milliseconds if known.
    Settled(Ending, Option<i64>),
    /// A result was computed again.
    Recomputed { key: Key, how: Recomputed },
    /// A result was read.
    Read(Key),
    /// A result was evicted.
    Evicted,
    /// A result was deleted.
    Deleted(Key),
}

/// A flag that tells a worker that its run has ended or that no job needs its result any more.
#[derive(Debug, Clone, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Whether the worker must stop.
    pub fn is_raised(&self) -> bool {
        // The flag guards no other data, so no ordering is needed.
        self.0.load(Ordering::Relaxed)
    }

    fn raise(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[derive(Debug, Default)]
pub(crate) struct Signals {
    pub(crate) tally: Tally,
    pub(crate) usage: Usage,
    queue: watch::Sender<u64>,
    deleted: Deleted,
    tables: Mutex<Tables>,
    /// Until when no worker claims a part that was lost.
    settles: Option<Instant>,
}

/// Sends keys of deleted results; `None` if any result may have been deleted.
#[derive(Debug)]
struct Deleted(broadcast::Sender<Option<Key>>);

impl Default for Deleted {
    fn default() -> Self {
        /// Maximum number of deletions that wait for a listener. A listener that has missed older deletions must assume
        /// that any result was deleted.
        const BEHIND: usize = 256;
        Self(broadcast::Sender::new(BEHIND))
    }
}

#[derive(Debug, Default)]
struct Tables {
    /// Each channel counts the ended jobs and runs of its key, and signals every change.
    listeners: HashMap<Key, watch::Sender<u64>>,
    running: HashMap<RunPart, (Stop, u32)>,
    /// The time at which each result was last read. An entry is removed when its time is stored.
    read: HashMap<Key, i64>,
}

/// Maximum number of results whose time of the last read is kept in memory. Further times are dropped. Then an eviction
/// may delete a result that was read recently.
const MAX_READ: usize = 10_000;
/// Maximum number of times of reading that one transaction stores. This takes a few milliseconds.
pub(crate) const READ_AT_ONCE: usize = 500;

impl Tables {
    fn note(&mut self, key: Key, at: i64) {
        if self.read.len() < MAX_READ || self.read.contains_key(&key) {
            self.read.insert(key, at);
        }
    }
}

impl Signals {
    /// Signals of a process that settles for this time. Then idle workers look for parts that were lost.
    #[expect(clippy::disallowed_methods, reason = "the task ends by itself")]
    pub(crate) fn starting(settle: Duration) -> Arc<Self> {
        let settles = Instant::now().checked_add(settle);
        let signals = Arc::new(Self { settles, ..Self::default() });
        let woken = Arc::downgrade(&signals);
        tokio::spawn(async move {
            tokio::time::sleep(settle).await;
            woken.upgrade().inspect(|signals| signals.wake());
        });
        signals
    }

    /// Sends all signals, in the order of the changes.
    pub(crate) fn apply(&self, effects: Vec<Effect>) {
        let mut tables = self.tables.lock();
        for effect in effects {
            match effect {
                Effect::Changed(key) => {
                    if let Some(sender) = tables.listeners.get(&key) {
                        sender.send_modify(|_| {});
                    }
                }
                Effect::Ended(key) => {
                    if let Some(sender) = tables.listeners.get(&key) {
                        sender.send_modify(|ends| *ends += 1);
                    }
                }
                Effect::Queued => {
                    self.queue.send_modify(|_| {});
                }
                Effect::Started(part, stop, lost) => {
                    tables.running.insert(part, (stop, lost));
                }
                Effect::Unwanted(run) => {
                    let mut was_lost = false;
                    tables.running.retain(|(other, _), (stop, lost)| {
                        let is_wanted = *other != run;
                        if !is_wanted {
                            stop.raise();
                            was_lost |= *lost > 0;
                        }
                        is_wanted
                    });
                    self.ended(was_lost);
                }
                Effect::LetGo(part) => {
                    let ended = tables.running.remove(&part);
                    self.ended(ended.is_some_and(|(_, lost)| lost > 0));
                }
                Effect::Submitted(origin) => self.tally.submitted(origin),
                Effect::Settled(how, milliseconds) => self.tally.settled(how, milliseconds),
                Effect::Recomputed { key, how } => {
                    match how {
                        Recomputed::Same => {}
                        Recomputed::Differs => tracing::error!(
                            %key, "a result that was computed again differs from the stored one"
                        ),
                        Recomputed::Replaced => tracing::warn!(
                            %key, "a result that was computed again differs from the one that was deleted or evicted"
                        ),
                    }
                    self.tally.recomputed(how);
                }
                Effect::Read(key) => tables.note(key, now()),
                Effect::Evicted => _ = self.tally.evicted.inc(),
                Effect::Deleted(key) => self.deleted(Some(key)),
            }
        }
    }

    /// Wakes idle workers, because a part that was lost may have had to run alone.
    fn ended(&self, was_lost: bool) {
        if was_lost {
            self.queue.send_modify(|_| {});
        }
    }

    /// Whether workers may claim parts that were lost.
    pub(crate) fn is_settled(&self) -> bool {
        self.settles.is_none_or(|at| Instant::now() >= at)
    }

    /// Counts the error of a failed operation in the metrics, and returns the result unchanged.
    pub(crate) fn counted<T>(&self, result: Result<T>) -> Result<T> {
        result.inspect_err(|error| self.tally.failed(error))
    }

    /// Keeps in memory that a result was read at this time.
    pub(crate) fn read(&self, key: Key, at: i64) {
        self.tables.lock().note(key, at);
    }

    /// The parts that the workers of this process compute, with the stop flag of each worker.
    pub(crate) fn running(&self) -> Vec<(RunPart, Stop)> {
        self.tables.lock().running.iter().map(|(part, (stop, _))| (*part, stop.clone())).collect()
    }

    /// How often each of these parts was lost.
    pub(crate) fn losses(&self) -> Vec<u32> {
        self.tables.lock().running.values().map(|(_, lost)| *lost).collect()
    }

    /// Stops workers that have lost their parts. If a worker has claimed such a part again since, that worker goes on.
    pub(crate) fn stop(&self, lost: &[(RunPart, Stop)]) {
        let mut tables = self.tables.lock();
        for (part, stop) in lost {
            stop.raise();
            if tables.running.get(part).is_some_and(|(latest, _)| Arc::ptr_eq(&latest.0, &stop.0)) {
                tables.running.remove(part);
            }
        }
    }

    /// Lets waiting clients and workers read the tables again, because signals of other servers may have been lost.
    pub(crate) fn wake(&self) {
        self.queue.send_modify(|_| {});
        for sender in self.tables.lock().listeners.values() {
            sender.send_modify(|ends| *ends += 1);
        }
    }

    /// Tells all listeners that a result was deleted; `None` if any result may have been deleted.
    fn deleted(&self, key: Option<Key>) {
        // This fails if nobody listens, which is not an error.
        let _ = self.deleted.0.send(key);
    }

    /// Called after this server may have missed signals of other servers. Lets all listeners read the tables again, and
    /// assume that any result was deleted.
    pub(crate) fn was_deaf(&self) {
        self.wake();
        self.deleted(None);
    }

    /// Removes some results with their times of reading from memory. The caller stores the times.
    pub(crate) fn take_read(&self) -> Vec<(Key, i64)> {
        let mut tables = self.tables.lock();
        let some: Vec<_> = tables.read.keys().copied().take(READ_AT_ONCE).collect();
        some.into_iter().filter_map(|key| tables.read.remove_entry(&key)).collect()
    }

    pub(crate) fn watch(self: &Arc<Self>, key: Key) -> Changes {
        let receiver = self.tables.lock().listeners.entry(key).or_default().subscribe();
        Changes::new(receiver, Some(Listening { signals: Arc::clone(self), key }))
    }

    pub(crate) fn watch_queue(&self) -> Changes {
        Changes::new(self.queue.subscribe(), None)
    }

    pub(crate) fn watch_deletions(&self) -> Deletions {
        Deletions(self.deleted.0.subscribe())
    }
}

/// Waits for changes that were signalled since the last call.
#[derive(Debug)]
pub struct Changes {
    // Dropped before `_listening`, which counts the remaining receivers.
    receiver: watch::Receiver<u64>,
    ends: u64,
    _listening: Option<Listening>,
}

impl Changes {
    fn new(receiver: watch::Receiver<u64>, listening: Option<Listening>) -> Self {
        let ends = *receiver.borrow();
        Self { receiver, ends, _listening: listening }
    }

    /// Returns once something has changed since this was created or last returned. It may return without a
    /// change, but it misses none.
    pub async fn changed(&mut self) {
        if self.receiver.changed().await.is_err() {
            // The store is closed, so nothing changes any more.
            std::future::pending::<()>().await;
        }
    }

    /// Like [`changed`](Self::changed), but ignores changes that end no job or run.
    pub async fn ended(&mut self) {
        let Ok(ends) = self.receiver.wait_for(|ends| *ends != self.ends).await.map(|ends| *ends)
        else {
            return std::future::pending().await;
        };
        self.ends = ends;
    }
}

/// Receives deletions of results since this was created.
#[derive(Debug)]
pub struct Deletions(broadcast::Receiver<Option<Key>>);

impl Deletions {
    /// The next deleted result; `None` if any result may have been deleted.
    pub async fn next(&mut self) -> Option<Key> {
        match self.0.recv().await {
            Ok(key) => key,
            Err(RecvError::Lagged(_)) => None,
            // The store is closed.
            Err(RecvError::Closed) => std::future::pending().await,
        }
    }
}

#[derive(Debug)]
struct Listening {
    signals: Arc<Signals>,
    key: Key,
}

impl Drop for Listening {
    fn drop(&mut self) {
        let mut tables = self.signals.tables.lock();
        if tables.listeners.get(&self.key).is_some_and(|sender| sender.receiver_count() == 0) {
            tables.listeners.remove(&self.key);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_removed_when_its_last_listener_is_dropped() {
        let signals = Arc::new(Signals::default());
        let key = Key::from_bytes([7; 32]);
        let first = signals.watch(key);
        let second = signals.watch(key);
        drop(first);
        assert_eq!(signals.tables.lock().listeners.len(), 1);
        drop(second);
        assert!(signals.tables.lock().listeners.is_empty());
    }

    #[test]
    fn the_stop_flags_of_the_latest_claims_of_a_run_are_raised() {
        let signals = Arc::new(Signals::default());
        let flags: [Stop; 5] = Default::default();
        let [lost, first, second, done, other] = &flags;
        let started =
            |run, number, stop: &Stop| Effect::Started((RunId(run), number), stop.clone(), 0);
        signals.apply(vec![
            started(1, Some(0), lost),
            started(1, Some(0), first),
            started(1, Some(1), second),
            started(1, Some(2), done),
            started(2, None, other),
            Effect::LetGo((RunId(1), Some(2))),
            Effect::Unwanted(RunId(1)),
        ]);
        let raised = flags.each_ref().map(Stop::is_raised);
        assert_eq!(raised, [false, true, true, false, false]);
        signals.apply(vec![Effect::LetGo((RunId(2), None))]);
        assert!(signals.tables.lock().running.is_empty());
    }

    #[test]
    fn stopping_a_worker_that_lost_its_part_does_not_stop_the_next_worker() {
        let signals = Arc::new(Signals::default());
        let part = (RunId(1), None);
        let [lost, next]: [Stop; 2] = Default::default();
        signals.apply(vec![Effect::Started(part, lost.clone(), 0)]);
        let running = signals.running();
        signals.apply(vec![Effect::Started(part, next.clone(), 0)]);
        signals.stop(&running);
        assert!(lost.is_raised() && !next.is_raised());
        let running = signals.running();
        assert_eq!(running.len(), 1);
        signals.stop(&running);
        assert!(next.is_raised() && signals.running().is_empty());
    }
}
