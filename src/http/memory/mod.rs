//! Encoded answers in memory: a cache, and single-flight for answers that are being made.
//!
//! Concurrent requests for the same answer share one computation and one copy of its bytes, even if the
//! cache does not keep it.

pub mod models;

use std::collections::HashMap;
use std::pin::pin;
use std::ptr;
use std::sync::{Arc, OnceLock, Weak};

use axum::body::Bytes;
use parking_lot::Mutex;
use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};
use tokio::sync::{Notify, OwnedMutexGuard};

use crate::http::shares::{Permit, get_or_insert, holding};
use crate::http::wire::coding::Coding;
use fretwork_job::Key;
use fretwork_store::Deletions;

/// The encoded body of an answer.
#[derive(Debug, Clone)]
pub struct Encoded {
    /// The bytes of the body.
    pub body: Bytes,
    /// How the bytes are compressed.
    pub coding: Coding,
    /// The number of bytes without compression.
    pub size: usize,
    /// Permission for the memory of the bytes while clients read them. Bytes in the cache count against the size of the
    /// cache instead.
    _permit: Option<Arc<Permit>>,
}

impl Encoded {
    /// A body, and the number of its bytes without compression.
    pub fn new(body: Bytes, coding: Coding, size: usize) -> Self {
        Self { body, coding, size, _permit: None }
    }

    /// The body with permission for its memory.
    pub fn counted(self, mut permit: Permit) -> Self {
        permit.shrink(self.body.len());
        Self { _permit: Some(Arc::new(permit)), ..self }
    }
}

/// One answer that is being made or sent.
#[derive(Debug, Default)]
struct Slot {
    /// Empty while the answer is being made.
    answer: OnceLock<Encoded>,
    /// The task that makes the answer holds this lock.
    turn: Arc<tokio::sync::Mutex<()>>,
}

/// A cache of encoded answers by name. When it is full, it evicts the least used answers. A name begins with the key of
/// the result.
pub struct Memory {
    cache: Cache<String, Encoded, EncodedSize>,
    /// Answers that are being made or sent.
    slots: Mutex<HashMap<String, Weak<Slot>>>,
    /// Wakes requests that wait for an answer which another request makes.
    finished: Notify,
}

/// Permission to make an answer. Other requests for it wait until this is dropped.
pub struct Making {
    name: String,
    slot: Arc<Slot>,
    _turn: OwnedMutexGuard<()>,
}

/// An answer, or the permission to make it.
pub enum Lookup {
    /// The answer is in memory.
    Found(Encoded),
    /// The caller must make the answer.
    Missing(Making),
}

#[derive(Debug, Clone)]
struct EncodedSize;

impl Weighter<String, Encoded> for EncodedSize {
    fn weight(&self, name: &String, answer: &Encoded) -> u64 {
        /// Approximate size of an entry without its name and body, in bytes.
        const OVERHEAD: usize = 128;
        (name.len() + answer.body.len() + OVERHEAD) as u64
    }
}

/// An answer whose bytes keep its slot alive, so that other requests find them there.
fn share(answer: &Encoded, slot: &Arc<Slot>) -> Encoded {
    Encoded { body: holding(answer.body.clone(), Arc::clone(slot)), ..answer.clone() }
}

impl Memory {
    /// A cache of this many bytes; 0 disables it.
    #[expect(clippy::expect_used, reason = "both capacities are set")]
    pub fn new(bytes: u64) -> Self {
        // Estimates the number of answers from a size of 64 KiB for each.
        let items = usize::try_from(bytes >> 16).unwrap_or(usize::MAX).max(16);
        let options = OptionsBuilder::new()
            // Few shards: an answer must fit into one shard.
            .shards(2)
            .estimated_items_capacity(items)
            .weight_capacity(bytes)
            .build()
            .expect("the options are complete");
        let (hash, life) = (DefaultHashBuilder::default(), DefaultLifecycle::default());
        Self {
            cache: Cache::with_options(options, EncodedSize, hash, life),
            slots: Mutex::default(),
            finished: Notify::new(),
        }
    }

    /// The cached answer with this name.
    pub fn get(&self, name: &str) -> Option<Encoded> {
        self.cache.get(name)
    }

    /// The answer with this name, shared with requests that read it now. If another request
    /// makes it, this waits. If that request fails or is dropped, the caller makes it.
    pub async fn lookup(&self, name: &str) -> Lookup {
        let slot = get_or_insert(&mut self.slots.lock(), name, Slot::default);
        if let Some(answer) = slot.answer.get() {
            return Lookup::Found(share(answer, &slot));
        }
        let turn = Arc::clone(&slot.turn).lock_owned().await;
        match slot.answer.get() {
            Some(answer) => Lookup::Found(share(answer, &slot)),
            None => Lookup::Missing(Making { name: name.to_owned(), slot, _turn: turn }),
        }
    }

    /// Waits until another request has made the answer with this name and reads it.
    pub async fn made(&self, name: &str) -> Encoded {
        loop {
            let mut finished = pin!(self.finished.notified());
            finished.as_mut().enable();
            let slot = self.slots.lock().get(name).and_then(Weak::upgrade);
            if let Some(slot) = slot
                && let Some(answer) = slot.answer.get()
            {
                return share(answer, &slot);
            }
            finished.await;
        }
    }

    /// Gives a finished answer to all requests that wait for it, and caches it if `keep` is true.
    pub fn finish(&self, making: Making, answer: Encoded, keep: bool) -> Encoded {
        let Making { name, slot, _turn } = making;
        if keep {
            let slots = self.slots.lock();
            // If the slot is no longer under its name, the result was deleted while the answer was made. Then the cache
            // must not keep the answer.
            let current = slots.get(&name).map_or(ptr::null(), Weak::as_ptr);
            if ptr::eq(current, Arc::as_ptr(&slot)) {
                self.cache.insert(name, Encoded { _permit: None, ..answer.clone() });
            }
        }
        let shared = share(slot.answer.get_or_init(|| answer), &slot);
        self.finished.notify_waiters();
        shared
    }

    /// Removes all answers of a deleted result. Requests that already read one continue.
    pub fn forget(&self, key: &Key) {
        let key = key.to_string();
        // `finish` inserts under the same lock.
        let mut slots = self.slots.lock();
        self.cache.retain(|name, _| !name.starts_with(&key));
        slots.retain(|name, _| !name.starts_with(&key));
    }

    /// Removes all answers, because any result may have been deleted.
    fn forget_all(&self) {
        let mut slots = self.slots.lock();
        self.cache.clear();
        slots.clear();
    }

    /// Removes the answers of results that other servers delete. Never ends.
    pub async fn follow(&self, mut deletions: Deletions) {
        loop {
            match deletions.next().await {
                Some(key) => self.forget(&key),
                None => self.forget_all(),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use futures_util::FutureExt as _;

    use super::*;
    use crate::http::shares::NAMES;

    fn answer(size: usize) -> Encoded {
        Encoded::new(vec![0; size].into(), Coding::Identity, size)
    }

    fn address(answer: &Encoded) -> *const u8 {
        answer.body.as_ptr()
    }

    async fn making(memory: &Memory, name: &str) -> Making {
        match memory.lookup(name).await {
            Lookup::Missing(making) => making,
            Lookup::Found(_) => panic!("{name} is in memory"),
        }
    }

    async fn found(memory: &Memory, name: &str) -> Encoded {
        match memory.lookup(name).await {
            Lookup::Found(answer) => answer,
            Lookup::Missing(_) => panic!("{name} is not in memory"),
        }
    }

    #[tokio::test]
    async fn the_cache_stays_within_its_size_limit() {
        let memory = Memory::new(100_000);
        for number in 0..100 {
            let making = making(&memory, &number.to_string()).await;
            memory.finish(making, answer(10_000), true);
        }
        let held = (0..100).filter(|number: &u32| memory.get(&number.to_string()).is_some());
        assert!((1..10).contains(&held.count()));
        assert!(Memory::new(0).get("0").is_none());
    }

    #[tokio::test]
    async fn concurrent_requests_share_one_computation_and_one_copy() {
        let memory = Memory::new(0);
        let made = AtomicUsize::new(0);
        let request = || async {
            match memory.lookup("name").await {
                Lookup::Found(answer) => answer,
                Lookup::Missing(making) => {
                    made.fetch_add(1, Ordering::Relaxed);
                    tokio::task::yield_now().await;
                    memory.finish(making, answer(1000), false)
                }
            }
        };
        let (one, two, three) = tokio::join!(request(), request(), request());
        assert_eq!((address(&one), address(&two)), (address(&two), address(&three)));
        assert_eq!(made.load(Ordering::Relaxed), 1);
        drop((one, two));
        let four = request().await;
        assert_eq!((address(&four), made.load(Ordering::Relaxed)), (address(&three), 1));
        drop((three, four));
        request().await;
        assert_eq!(made.load(Ordering::Relaxed), 2);
    }

    #[tokio::test]
    async fn after_a_failed_request_the_next_one_computes_the_answer() {
        let memory = Memory::new(0);
        drop(making(&memory, "name").await);
        let making = making(&memory, "name").await;
        assert_eq!(memory.finish(making, answer(1), false).body.len(), 1);
    }

    #[tokio::test]
    async fn a_waiting_request_gets_the_answer_of_a_dropped_request() {
        let memory = Memory::new(0);
        // The first request was dropped. Only the thread that makes its answer holds `making`.
        let making = making(&memory, "name").await;
        let mut next = pin!(memory.lookup("name"));
        assert!((&mut next).now_or_never().is_none(), "it waits for the answer");
        drop(memory.finish(making, answer(1), false));
        assert!(matches!(next.await, Lookup::Found(answer) if answer.body.len() == 1));
    }

    #[tokio::test]
    async fn a_request_that_waits_for_memory_learns_that_another_one_made_its_answer() {
        let memory = Memory::new(0);
        let mut made = pin!(memory.made("name"));
        assert!((&mut made).now_or_never().is_none(), "no request has made it yet");
        let other = memory.finish(making(&memory, "other").await, answer(1), false);
        assert!((&mut made).now_or_never().is_none(), "this is another answer");
        let sent = memory.finish(making(&memory, "name").await, answer(1), false);
        assert_eq!(address(&made.await), address(&sent));
        drop(other);
    }

    #[tokio::test]
    async fn deleting_a_result_removes_its_answers_from_the_cache() {
        let memory = Memory::new(1 << 20);
        let key = Key::from_bytes([7; 32]);
        let name = format!("{key}.csv");
        let held = memory.finish(making(&memory, &name).await, answer(1), true);
        assert_eq!(address(&held), address(&found(&memory, &name).await));
        memory.forget(&key);
        drop(making(&memory, &name).await);

        // An answer that was made from the result before its deletion is sent, but not cached.
        let late = making(&memory, &name).await;
        memory.forget(&key);
        let sent = memory.finish(late, answer(1), true);
        drop(making(&memory, &name).await);
        assert_eq!(sent.body.len(), 1);
    }

    #[tokio::test]
    async fn unused_cache_names_are_removed() {
        let memory = Memory::new(0);
        let held = memory.finish(making(&memory, "held").await, answer(1), false);
        for number in 0..10_000 {
            drop(making(&memory, &number.to_string()).await);
        }
        let slots = memory.slots.lock();
        assert!(slots.len() <= 4 * NAMES && slots.contains_key("held"), "{}", slots.len());
        drop(held);
    }
}
