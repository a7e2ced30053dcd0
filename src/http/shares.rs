//! What requests may use at the same time, in total and for one caller: memory, and heavy work.
//!
//! Without these limits, one caller with many large answers that it does not read, or with many searches, would block
//! all other callers.

use std::collections::HashMap;
use std::sync::{Arc, Weak};
use std::time::Duration;

use axum::body::Bytes;
use parking_lot::Mutex;
use prometheus_client::metrics::gauge::Gauge;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, timeout_at};

use super::problem::{Problem, Result, kinds};

/// Largest body that needs no permit, in bytes. The limits of connections and of concurrent requests bound the memory
/// of such bodies.
pub const SMALL: usize = 32 << 10;
/// Largest answer that does not count as large, in bytes.
const LARGE: usize = 1 << 20;
/// The unit in which memory is counted, in bytes.
const UNIT: u64 = 1 << 10;
/// Maximum time that a request waits in total for memory and for the work of other requests.
const LONGEST_WAIT: Duration = Duration::from_secs(5);
/// The seconds after which a refused client should try again.
const RETRY: u32 = 5;
/// Maximum number of heavy requests of one caller at the same time. Further ones wait.
const HEAVY: usize = 2;
/// A map with at least this number of names drops its unused names before it grows.
pub const NAMES: usize = 64;

/// The limits, and their use.
pub struct Shares {
    /// Memory for the bodies of requests. Slow readers of answers cannot use it.
    pub bodies: Budget,
    /// Memory for the parsed values (the trees) of these bodies. A request waits for it while it holds memory of
    /// `bodies`, and never waits for memory of `bodies` while it holds this. So two requests never wait for each other.
    pub trees: Budget,
    /// Memory for answers of at most `LARGE` bytes. Readers of large answers cannot use it.
    answers: Budget,
    /// Memory for larger answers.
    large_answers: Budget,
    /// Memory for decompressors, while they send answers. A request waits for memory of answers while it holds this, and
    /// never the other way round.
    pub streams: Budget,
    /// Turns for heavy work: searching results or jobs, or comparing results.
    pub heavy: PerCaller,
    /// Turns for evaluations. A caller computes at most as many at a time as there are workers, and its further
    /// evaluations wait here. So an evaluation of another caller does not wait for all of them.
    pub evaluations: PerCaller,
    /// Turns of requests of one caller that want to read a large document.
    documents: PerCaller,
    /// The turn of all callers to read one.
    document: Arc<Semaphore>,
    /// The memory that all permits hold at present, in bytes.
    pub held: Gauge,
}

/// Memory for bodies of one kind. One caller may use half of it.
pub struct Budget {
    memory: Arc<Semaphore>,
    /// Maximum number of units of one caller.
    share: u32,
    /// The advice in the problem for a caller that has used its whole share.
    advice: &'static str,
    shares: PerCaller,
    held: Gauge,
}

/// A semaphore for each caller who uses it.
pub struct PerCaller {
    permits: usize,
    semaphores: Mutex<HashMap<String, Weak<Semaphore>>>,
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
}

/// Permission for heavy work or an evaluation, until this is dropped.
pub type Turn = Option<OwnedSemaphorePermit>;

/// Permission to have a large document in memory, until this is dropped.
pub struct LargeDocument {
    _own: OwnedSemaphorePermit,
    _all: OwnedSemaphorePermit,
}

/// Bytes, and what they keep.
struct Holding<T> {
    bytes: Bytes,
    _held: T,
}

impl<T> AsRef<[u8]> for Holding<T> {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

/// These bytes, which keep `held` until all of their copies are dropped.
pub fn holding<T: Send + 'static>(bytes: Bytes, held: T) -> Bytes {
    Bytes::from_owner(Holding { bytes, _held: held })
}

impl Shares {
    /// Shares of this many bytes: an eighth for the bodies of requests, an eighth for their trees, and a quarter each for
    /// answers, for large answers and for decompressors. Each caller may compute as many evaluations at a time as there are
    /// `workers`.
    pub fn new(bytes: u64, workers: usize) -> Self {
        let held = Gauge::default();
        let of_requests =
            || Budget::new(bytes / 8, &held, "Send fewer large bodies at the same time.");
        let of_answers = || Budget::new(bytes / 4, &held, "Read their answers to the end.");
        Self {
            bodies: of_requests(),
            trees: of_requests(),
            answers: of_answers(),
            large_answers: of_answers(),
            streams: of_answers(),
            heavy: PerCaller::new(HEAVY),
            evaluations: PerCaller::new(workers),
            documents: PerCaller::new(1),
            document: Arc::new(Semaphore::new(1)),
            held,
        }
    }

    /// The memory for an answer of this many bytes.
    pub fn answers(&self, bytes: usize) -> &Budget {
        if bytes > LARGE { &self.large_answers } else { &self.answers }
    }

    /// Waits until a request of this caller may read a large document. One request at a time may.
    ///
    /// # Errors
    /// The requests before it end later than `end`.
    pub async fn large_document(&self, end: Instant, caller: &str) -> Result<LargeDocument> {
        let own = timeout_at(end, self.documents.of(caller).acquire_owned());
        let Ok(Ok(own)) = own.await else { return Err(documents_busy()) };
        let all = timeout_at(end, Arc::clone(&self.document).acquire_owned());
        let Ok(Ok(all)) = all.await else { return Err(documents_busy()) };
        Ok(LargeDocument { _own: own, _all: all })
    }
}

impl Budget {
    fn new(bytes: u64, held: &Gauge, advice: &'static str) -> Self {
        let size = u32::try_from(bytes / UNIT).unwrap_or(u32::MAX).max(2);
        let (memory, share) = (Arc::new(Semaphore::new(size as usize)), size / 2);
        Self { memory, share, advice, shares: PerCaller::new(share as usize), held: held.clone() }
    }

    /// As [`hold`](Self::hold), but does not wait.
    ///
    /// # Errors
    /// The memory is in use.
    pub fn try_hold(&self, caller: &str, bytes: usize) -> Result<Permit> {
        if bytes <= SMALL {
            return Ok(Permit::default());
        }
        let units = self.units(bytes);
        let own =
            self.shares.of(caller).try_acquire_many_owned(units).map_err(|_| self.own_full())?;
        let all = Arc::clone(&self.memory).try_acquire_many_owned(units).map_err(|_| all_full())?;
        Ok(self.permit(own, all))
    }

    /// Reserves memory for a body of this many bytes. Waits up to `LONGEST_WAIT` while other requests use it.
    ///
    /// # Errors
    /// The memory is still in use.
    pub async fn hold(&self, caller: &str, bytes: usize) -> Result<Permit> {
        self.hold_until(longest_wait(), caller, bytes).await
    }

    /// As [`hold`](Self::hold), but waits until this moment.
    ///
    /// # Errors
    /// The memory is still in use.
    pub async fn hold_until(&self, end: Instant, caller: &str, bytes: usize) -> Result<Permit> {
        if bytes <= SMALL {
            return Ok(Permit::default());
        }
        let units = self.units(bytes);
        let own = timeout_at(end, self.shares.of(caller).acquire_many_owned(units));
        let Ok(Ok(own)) = own.await else { return Err(self.own_full()) };
        let all = timeout_at(end, Arc::clone(&self.memory).acquire_many_owned(units));
        let Ok(Ok(all)) = all.await else { return Err(all_full()) };
        Ok(self.permit(own, all))
    }

    fn own_full(&self) -> Problem {
        full(format!(
            "Your other requests use all the memory that one caller may use. {}",
            self.advice
        ))
    }

    /// A body larger than the share of a caller uses the whole share.
    fn units(&self, bytes: usize) -> u32 {
        u32::try_from(bytes as u64 / UNIT + 1).unwrap_or(u32::MAX).min(self.share)
    }

    fn permit(&self, own: OwnedSemaphorePermit, all: OwnedSemaphorePermit) -> Permit {
        let gauge = self.held.clone();
        gauge.inc_by(bytes_of(&all));
        Permit { held: Some(Held { own, all, gauge }) }
    }
}

impl PerCaller {
    fn new(permits: usize) -> Self {
        Self { permits, semaphores: Mutex::default() }
    }

    /// Waits until the caller has a free permit.
    pub async fn turn(&self, caller: &str) -> Turn {
        // The semaphore is never closed.
        self.of(caller).acquire_owned().await.ok()
    }

    /// The semaphore of a caller. The map drops the semaphore when no request waits for it or holds its permits.
    fn of(&self, caller: &str) -> Arc<Semaphore> {
        get_or_insert(&mut self.semaphores.lock(), caller, || Semaphore::new(self.permits))
    }
}

/// Returns the value that a map has under a name, or inserts a new one. The map drops a value that nothing else uses.
pub fn get_or_insert<T>(
    map: &mut HashMap<String, Weak<T>>,
    name: &str,
    new: impl FnOnce() -> T,
) -> Arc<T> {
    let held = map.get_mut(name);
    if let Some(found) = held.as_deref().and_then(Weak::upgrade) {
        return found;
    }
    let new = Arc::new(new());
    if let Some(held) = held {
        *held = Arc::downgrade(&new);
        return new;
    }
    if map.len() >= NAMES && map.len() == map.capacity() {
        map.retain(|_, used| used.strong_count() > 0);
    }
    map.insert(name.to_owned(), Arc::downgrade(&new));
    new
}

impl Permit {
    /// Whether the permit holds memory. A permit for a small body holds none.
    pub fn is_held(&self) -> bool {
        self.held.is_some()
    }

    /// Gives back the memory that a body of this many bytes does not need.
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

/// The time at which a request that begins to wait now must stop waiting.
pub fn longest_wait() -> Instant {
    Instant::now() + LONGEST_WAIT
}

fn all_full() -> Problem {
    full("Other requests use all the memory for large bodies. Try again in a moment.".to_owned())
}

/// The problem while other requests read large documents.
pub fn documents_busy() -> Problem {
    full("The server is reading other large results. Try again in a moment.".to_owned())
}

/// The problem for a request that does not get what it needs in time.
fn full(detail: String) -> Problem {
    Problem::new(&kinds::MEMORY_FULL, detail).retry_after(RETRY)
}

#[cfg(test)]
mod tests {
    use std::pin::pin;

    use futures_util::FutureExt as _;
    use tokio::time::sleep;

    use super::*;

    #[tokio::test(start_paused = true)]
    async fn one_caller_can_hold_half_of_the_memory() {
        let budget = Budget::new(8 << 20, &Gauge::default(), "");
        let mut first = budget.hold("anna", 3 << 20).await.unwrap();
        assert!(budget.hold("anna", 2 << 20).await.is_err());
        assert!(budget.hold("anna", SMALL).await.is_ok(), "small bodies are not counted");
        let other = budget.hold("berta", 4 << 20).await.unwrap();
        assert_eq!(budget.held.get(), (7 << 20) + UNIT.cast_signed());
        first.shrink(1 << 20);
        let second = budget.hold("anna", 2 << 20).await.unwrap();
        drop((first, second, other));
        assert_eq!(budget.held.get(), 0);
        // A body that is larger than the share gets all of it.
        drop(budget.hold("carla", 1 << 30).await.unwrap());
        assert_eq!(budget.memory.available_permits(), 8 << 10);
    }

    #[tokio::test(start_paused = true)]
    async fn one_deadline_covers_the_waits_for_the_share_and_for_the_whole_memory() {
        let budget = Budget::new(8 << 20, &Gauge::default(), "");
        let _other = budget.hold("berta", 4 << 20).await.unwrap();
        let _small = budget.hold("carla", 1 << 20).await.unwrap();
        let own = budget.hold("anna", 2 << 20).await.unwrap();
        let began = Instant::now();
        let free = async {
            sleep(LONGEST_WAIT / 2).await;
            drop(own);
        };
        // The request gets its share after half of the time. Then the memory of all callers is too small by 1 MiB.
        let ((), waited) = tokio::join!(free, budget.hold("anna", 4 << 20));
        assert!(waited.is_err());
        assert_eq!(began.elapsed(), LONGEST_WAIT);
    }

    #[tokio::test(start_paused = true)]
    async fn readers_of_large_answers_leave_memory_for_other_answers_and_for_requests() {
        let shares = Shares::new(16 << 20, 2);
        let hold = async |caller, bytes| shares.answers(bytes).hold(caller, bytes).await;
        let mut readers = Vec::new();
        for caller in ["anna", "berta"] {
            readers.push(hold(caller, 8 << 20).await.unwrap());
        }
        assert!(hold("carla", LARGE + 1).await.is_err());
        drop(hold("carla", LARGE).await.unwrap());
        drop(shares.bodies.hold("carla", 1 << 20).await.unwrap());
        assert_eq!(shares.held.get(), 4 << 20);
        drop(readers);
    }

    #[tokio::test]
    async fn heavy_requests_of_one_caller_wait_for_each_other_and_not_for_others() {
        let shares = Shares::new(1 << 20, 2);
        let mut turns = Vec::new();
        while let Some(turn) = shares.heavy.turn("anna").now_or_never() {
            turns.push(turn);
        }
        assert_eq!(turns.len(), HEAVY);
        assert!(shares.heavy.turn("berta").now_or_never().is_some());
        turns.pop();
        assert!(shares.heavy.turn("anna").now_or_never().is_some());
    }

    #[tokio::test(start_paused = true)]
    async fn one_large_document_is_read_at_a_time_and_one_request_of_a_caller_waits_for_it() {
        let shares = Shares::new(1 << 20, 2);
        let read = |caller| shares.large_document(longest_wait(), caller);
        let first = read("anna").await.unwrap();
        assert!(read("berta").await.is_err() && read("anna").await.is_err());
        let (mut second, mut other) = (pin!(read("anna")), pin!(read("berta")));
        assert!((&mut second).now_or_never().is_none() && (&mut other).now_or_never().is_none());
        drop(first);
        drop(other.await.unwrap());
        drop(second.await.unwrap());
    }

    #[tokio::test]
    async fn the_map_drops_callers_without_requests() {
        let shares = Shares::new(1 << 20, 2);
        let held = shares.heavy.turn("held").await;
        for number in 0..10_000 {
            drop(shares.heavy.turn(&number.to_string()).await);
        }
        let callers = shares.heavy.semaphores.lock();
        assert!(callers.len() <= 4 * NAMES && callers.contains_key("held"), "{}", callers.len());
        drop(held);
    }
}
