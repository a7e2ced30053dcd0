//! The access keys in memory, with the use of their limits.

use std::collections::HashMap;
use std::num::NonZeroU32;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::{Duration, Instant};

use tokio::sync::{Mutex, watch};
use tokio::time::sleep_until;

use super::limits::{Account, Limits};
use fretwork_store::{AccessKey, Actor, Error, Store};

/// Longest time that a revoked key may still be accepted.
pub const MAX_AGE: Duration = Duration::from_secs(1);
/// Shortest time between two reads of the keys.
const PAUSE: Duration = Duration::from_millis(50);
/// Shortest time between two updates of the last use of a key, in milliseconds.
const LAST_USE_INTERVAL: i64 = 60_000;

/// A key, and its use.
pub struct KeyHolder {
    pub key: AccessKey,
    pub usage: Arc<Usage>,
}

/// The use of a key.
pub struct Usage {
    /// The use of its limits.
    pub account: Account,
    /// The use by the links that the key signed. They have the same limits as the key.
    pub links: Account,
    /// When the last use was stored. For a key that was never used it is 0, which is long ago.
    last_use: AtomicI64,
}

impl Usage {
    /// The use of a key with these limits, which was `last_used` at this time.
    pub fn new(limits: Limits, last_used: Option<i64>) -> Arc<Self> {
        let last_use = AtomicI64::new(last_used.unwrap_or(0));
        Arc::new(Self { account: Account::new(limits), links: Account::new(limits), last_use })
    }

    /// Whether the use must be stored, because the last one was stored long ago. True for one caller only.
    fn is_due(&self, now: i64) -> bool {
        let last = self.last_use.load(Ordering::Relaxed);
        let (success, failure) = (Ordering::Relaxed, Ordering::Relaxed);
        now - last > LAST_USE_INTERVAL
            && self.last_use.compare_exchange(last, now, success, failure).is_ok()
    }
}

/// Key holders by the public id of the key.
type Holders = Arc<HashMap<String, Arc<KeyHolder>>>;

/// The access keys of the store. They are read again when they are older than a caller accepts.
pub struct Keyring {
    store: Store,
    default_limits: Limits,
    /// When they were read last, and what was found.
    read: watch::Sender<Option<(Instant, Holders)>>,
    /// Held by the task that reads the keys. The others wait for it.
    reading: Mutex<()>,
}

impl Keyring {
    /// The keys of a store. Keys without own limits have the default limits.
    pub fn new(store: &Store, default_limits: Limits) -> Self {
        let (read, reading) = (watch::Sender::default(), Mutex::default());
        Self { store: store.clone(), default_limits, read, reading }
    }

    /// All keys, as they were at most [`MAX_AGE`] ago.
    pub async fn holders(&self) -> Result<Holders, Error> {
        self.holders_within(MAX_AGE).await
    }

    /// The key with this id and this digest. A key that was made a moment ago is found too. A wrong secret takes as long as an
    /// unknown id, so the time does not tell which ids there are.
    pub async fn holder_of(
        &self,
        id: &str,
        digest: &[u8; 32],
    ) -> Result<Option<Arc<KeyHolder>>, Error> {
        let find = |holders: &Holders| {
            holders.get(id).filter(|holder| holder.key.has_digest(digest)).cloned()
        };
        match find(&self.holders().await?) {
            None => Ok(find(&self.holders_within(Duration::ZERO).await?)),
            holder => Ok(holder),
        }
    }

    async fn holders_within(&self, age: Duration) -> Result<Holders, Error> {
        let now = Instant::now();
        let recent = || {
            let read = self.read.borrow();
            read.as_ref().filter(|(at, _)| *at + age >= now).map(|(_, holders)| Arc::clone(holders))
        };
        if let Some(holders) = recent() {
            return Ok(holders);
        }
        let _reading = self.reading.lock().await;
        if let Some(holders) = recent() {
            return Ok(holders);
        }
        // Anyone can send unknown keys. The callers that wait here share the next read.
        let (last, before) = self.read.borrow().clone().unzip();
        if let Some(last) = last {
            sleep_until((last + PAUSE).into()).await;
        }
        let before = before.unwrap_or_default();
        let at = Instant::now();
        let keys = self.store.access_keys().await?;
        let holders = keys.into_iter().map(|key| {
            // An unchanged key keeps the use of its limits.
            let same = before.get(&key.id).filter(|holder| holder.key.is_like(&key));
            let holder = same.map_or_else(|| Arc::new(self.new_holder(key.clone())), Arc::clone);
            (key.id, holder)
        });
        let holders: Holders = Arc::new(holders.collect());
        self.read.send_replace(Some((at, Arc::clone(&holders))));
        Ok(holders)
    }

    fn new_holder(&self, key: AccessKey) -> KeyHolder {
        let per_minute = match key.per_minute {
            None => self.default_limits.per_minute,
            Some(own) => NonZeroU32::new(own),
        };
        let limits = Limits { per_minute, ..self.default_limits };
        KeyHolder { usage: Usage::new(limits, key.last_used), key }
    }

    /// Stores that a key is in use, in the background.
    #[expect(
        clippy::disallowed_methods,
        reason = "no caller waits for the task; it ends by itself"
    )]
    pub fn record_use(&self, usage: &Usage, now: i64, by: impl FnOnce() -> Actor) {
        if !usage.is_due(now) {
            return;
        }
        let (store, by) = (self.store.clone(), by());
        tokio::spawn(async move {
            // The time of the last use is information for people. A request must not fail because a full
            // disk does not take it.
            let _ = store.key_was_used(by).await;
        });
    }
}
