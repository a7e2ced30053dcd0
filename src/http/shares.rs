//! What requests may use at the same time, in total and for one caller: memory, and heavy work.
//!
//! Without these limits, one caller with many large answers that it does not read, or with many searches,
//! would take the server from all others.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Duration;

use prometheus_client::metrics::gauge::Gauge;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::timeout;

use super::problem::{self, Problem};

/// Bodies up to this size, in bytes, are not counted. Only the numbers of connections and of requests bound their sum.
pub const SMALL: usize = 32 << 10;
/// The unit in which memory is counted, in bytes.
const UNIT: u64 = 1 << 10;
/// How long a request waits for memory that others use.
const LONGEST_WAIT: Duration = Duration::from_secs(5);
/// The seconds after which a refused client should try again.
const RETRY: u32 = 5;
/// Number of heavy requests of one caller at the same time. The others wait.
const HEAVY: usize = 2;
/// Number of callers from which unused ones are forgotten.
const CALLERS: usize = 64;

/// The limits, and their use.
#[derive(Debug)]
pub struct Shares {
    memory: Arc<Semaphore>,
    /// Units of memory, in total.
    size: u32,
    /// Number of evaluations of one caller at the same time. The others wait.
    evaluations: usize,
    callers: Mutex<HashMap<String, Weak<Share>>>,
    /// Bytes in use.
    pub held: Gauge,
}

/// The share of one caller.
#[derive(Debug)]
struct Share {
    memory: Arc<Semaphore>,
    heavy: Arc<Semaphore>,
    evaluations: Arc<Semaphore>,
}

/// Memory that a request uses, until this is dropped.
#[derive(Debug, Default)]
pub struct Permit {
    held: Option<Held>,
}

#[derive(Debug)]
struct Held {
    own: OwnedSemaphorePermit,
    all: OwnedSemaphorePermit,
    gauge: Gauge,
    /// Keeps the share of the caller.
    _share: Arc<Share>,
}

/// Permission for heavy work or an evaluation, until this is dropped.
#[derive(Debug)]
pub struct Turn {
    _permit: Option<OwnedSemaphorePermit>,
    _share: Arc<Share>,
}

impl Shares {
    /// Shares of this many bytes, and of computations on this many workers.
    pub fn new(bytes: u64, workers: usize) -> Self {
        let size = u32::try_from(bytes / UNIT).unwrap_or(u32::MAX).max(2);
        let memory = Arc::new(Semaphore::new(size as usize));
        let (callers, held) = (Mutex::default(), Gauge::default());
        Self { memory, size, evaluations: workers, callers, held }
    }

    /// As [`hold`](Self::hold), but does not wait.
    ///
    /// # Errors
    /// The memory is in use.
    pub fn try_hold(&self, caller: &str, bytes: usize) -> Result<Permit, Problem> {
        if bytes <= SMALL {
            return Ok(Permit::default());
        }
        let (share, units) = (self.share(caller), self.units(bytes));
        let own =
            Arc::clone(&share.memory).try_acquire_many_owned(units).map_err(|_| own_full())?;
        let all = Arc::clone(&self.memory).try_acquire_many_owned(units).map_err(|_| all_full())?;
        Ok(self.permit(share, own, all))
    }

    /// Memory for a body of this many bytes. Waits for a moment if other requests use it.
    ///
    /// # Errors
    /// The memory is still in use.
    pub async fn hold(&self, caller: &str, bytes: usize) -> Result<Permit, Problem> {
        if bytes <= SMALL {
            return Ok(Permit::default());
        }
        let (share, units) = (self.share(caller), self.units(bytes));
        let own = timeout(LONGEST_WAIT, Arc::clone(&share.memory).acquire_many_owned(units));
        let Ok(Ok(own)) = own.await else { return Err(own_full()) };
        let all = timeout(LONGEST_WAIT, Arc::clone(&self.memory).acquire_many_owned(units));
        let Ok(Ok(all)) = all.await else { return Err(all_full()) };
        Ok(self.permit(share, own, all))
    }

    /// A body larger than the share of a caller uses the whole share.
    fn units(&self, bytes: usize) -> u32 {
        u32::try_from(bytes as u64 / UNIT + 1).unwrap_or(u32::MAX).min(self.size / 2)
    }

    fn permit(
        &self,
        share: Arc<Share>,
        own: OwnedSemaphorePermit,
        all: OwnedSemaphorePermit,
    ) -> Permit {
        let gauge = self.held.clone();
        gauge.inc_by(bytes_of(&all));
        Permit { held: Some(Held { own, all, gauge, _share: share }) }
    }

    /// Waits until the caller may do heavy work: reading many results, or comparing them.
    pub async fn turn(&self, caller: &str) -> Turn {
        self.turn_of(caller, |share| &share.heavy).await
    }

    /// Waits until the caller may evaluate a scenario. So the evaluations of one caller wait for each other, and those
    /// of another caller do not wait for all of them.
    pub async fn evaluation(&self, caller: &str) -> Turn {
        self.turn_of(caller, |share| &share.evaluations).await
    }

    async fn turn_of(&self, caller: &str, of: fn(&Share) -> &Arc<Semaphore>) -> Turn {
        let share = self.share(caller);
        // The semaphore is never closed.
        let permit = Arc::clone(of(&share)).acquire_owned().await.ok();
        Turn { _permit: permit, _share: share }
    }

    fn share(&self, caller: &str) -> Arc<Share> {
        let mut callers = self.callers.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(share) = callers.get(caller).and_then(Weak::upgrade) {
            return share;
        }
        if callers.len() >= CALLERS && callers.len() == callers.capacity() {
            callers.retain(|_, share| share.strong_count() > 0);
        }
        let permits = |most: usize| Arc::new(Semaphore::new(most));
        let (memory, heavy) = (permits(self.size as usize / 2), permits(HEAVY));
        let share = Arc::new(Share { memory, heavy, evaluations: permits(self.evaluations) });
        callers.insert(caller.to_owned(), Arc::downgrade(&share));
        share
    }
}

impl Permit {
    /// Whether it is for a body that is counted.
    pub fn is_held(&self) -> bool {
        self.held.is_some()
    }

    /// Gives back what a body of this many bytes does not use.
    pub fn shrink(&mut self, bytes: usize) {
        let Some(held) = &mut self.held else { return };
        let units = bytes / UNIT as usize + 1;
        let unused = held.all.num_permits().saturating_sub(units);
        held.gauge.dec_by((unused as u64 * UNIT).cast_signed());
        drop((held.own.split(unused), held.all.split(unused)));
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        self.gauge.dec_by(bytes_of(&self.all));
    }
}

fn bytes_of(permit: &OwnedSemaphorePermit) -> i64 {
    (permit.num_permits() as u64 * UNIT).cast_signed()
}

fn own_full() -> Problem {
    full(
        "Your other requests use the memory that one caller may use. Read their answers to the end.",
    )
}

fn all_full() -> Problem {
    full("Other requests use the memory for large bodies.")
}

fn full(detail: &str) -> Problem {
    Problem::new(&problem::MEMORY_FULL, detail).retry_after(RETRY)
}

#[cfg(test)]
mod tests {
    use futures_util::FutureExt as _;

    use super::*;

    #[tokio::test(start_paused = true)]
    async fn one_caller_can_hold_half_of_the_memory() {
        let shares = Shares::new(8 << 20, 2);
        let mut first = shares.hold("anna", 3 << 20).await.unwrap();
        assert!(shares.hold("anna", 2 << 20).await.is_err());
        assert!(shares.hold("anna", SMALL).await.is_ok(), "small bodies are not counted");
        let other = shares.hold("berta", 4 << 20).await.unwrap();
        assert_eq!(shares.held.get(), (7 << 20) + UNIT.cast_signed());
        first.shrink(1 << 20);
        let second = shares.hold("anna", 2 << 20).await.unwrap();
        drop((first, second, other));
        assert_eq!(shares.held.get(), 0);
        // A body that is larger than the share gets all of it.
        drop(shares.hold("carla", 1 << 30).await.unwrap());
        assert_eq!(shares.memory.available_permits(), 8 << 10);
    }

    #[tokio::test]
    async fn heavy_requests_of_one_caller_wait_for_each_other_and_not_for_others() {
        let shares = Shares::new(1 << 20, 2);
        let mut turns = Vec::new();
        while let Some(turn) = shares.turn("anna").now_or_never() {
            turns.push(turn);
        }
        assert_eq!(turns.len(), HEAVY);
        assert!(shares.turn("berta").now_or_never().is_some());
        assert!(shares.evaluation("anna").now_or_never().is_some(), "it is no heavy work");
        turns.pop();
        assert!(shares.turn("anna").now_or_never().is_some());
    }

    #[tokio::test]
    async fn callers_without_requests_are_forgotten() {
        let shares = Shares::new(1 << 20, 2);
        let held = shares.turn("held").await;
        for number in 0..10_000 {
            drop(shares.turn(&number.to_string()).await);
        }
        let callers = shares.callers.lock().unwrap();
        assert!(callers.len() <= 4 * CALLERS && callers.contains_key("held"), "{}", callers.len());
        drop(held);
    }
}
