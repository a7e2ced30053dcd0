//! The access keys in memory, and how much of its limits each key has used.

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

/// An access key, and how much of its limits it has used.
pub struct KeyHolder {
    pub key: AccessKey,
    pub usage: Arc<Usage>,
}

/// How much of its limits a key has used, and when it was last used.
pub struct Usage {
    /// The requests with the key itself.
    pub account: Account,
    /// The requests with links that the key signed. All these links together have the same limits as the key.
    pub links: Account,
    /// When the store last recorded a use, in milliseconds since 1970. It is 0 if the key was never used.
    last_use: AtomicI64,
}

impl Usage {
    /// The usage of a key with these limits. `last_used` is the time of the last use that the store recorded.
    pub fn new(limits: Limits, last_used: Option<i64>) -> Arc<Self> {
        let last_use = AtomicI64::new(last_used.unwrap_or(0));
        Arc::new(Self { account: Account::new(limits), links: Account::new(limits), last_use })
    }

    /// Whether the store must record this use, because it recorded the previous one more than a minute ago. If several
    /// requests call this at once, it is true for one of them only.
    fn is_due(&self, now: i64) -> bool {
        let last = self.last_use.load(Ordering::Relaxed);
        let (success, failure) = (Ordering::Relaxed, Ordering::Relaxed);
        now - last > LAST_USE_INTERVAL
            && self.last_use.compare_exchange(last, now, success, failure).is_ok()
    }
}

/// Key holders by the public id of the key.
type Holders = Arc<HashMap<String, Arc<KeyHolder>>>;

/// A copy of the access keys in the store. A call reads the keys again if the copy is older than the call accepts.
pub struct Keyring {
    store: Store,
    /// Those of the keys without limits of their own, of the administrator's key, and of the users of a sign-on proxy.
    pub default_limits: Limits,
    /// When the keys were last read, and the keys that were found.
    read: watch::Sender<Option<(Instant, Holders)>>,
    /// The task that reads the keys holds this lock. Other tasks wait for it.
    reading: Mutex<()>,
}

impl Keyring {
    /// The keys of a store. Keys without limits of their own have the default limits.
    pub fn new(store: &Store, default_limits: Limits) -> Self {
        let (read, reading) = (watch::Sender::default(), Mutex::default());
        Self { store: store.clone(), default_limits, read, reading }
    }

    /// All keys, as they were at most [`MAX_AGE`] ago.
    pub async fn holders(&self) -> Result<Holders, Error> {
        self.holders_within(MAX_AGE).await
    }

    /// Finds the key with this id and this digest. If the copy does not contain it, this reads the keys again, so a new
    /// key is found too. It does so for a wrong secret as well as for an unknown id. So the time of an answer does not
    /// show which ids exist.
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
        // Anyone can send unknown keys, and each would cause a read. So reads are at least `PAUSE` apart, and the
        // requests that wait here share the next one.
        let (last, before) = self.read.borrow().clone().unzip();
        if let Some(last) = last {
            sleep_until((last + PAUSE).into()).await;
        }
        let before = before.unwrap_or_default();
        let at = Instant::now();
        let keys = self.store.access_keys().await?;
        let holders = keys.into_iter().map(|key| {
            // A key that has not changed keeps its usage.
            let same = before.get(&key.id).filter(|holder| holder.key.is_like(&key));
            let usage = || Usage::new(self.limits(&key), key.last_used);
            let new = || Arc::new(KeyHolder { usage: usage(), key: key.clone() });
            let holder = same.map_or_else(new, Arc::clone);
            (key.id, holder)
        });
        let holders: Holders = Arc::new(holders.collect());
        self.read.send_replace(Some((at, Arc::clone(&holders))));
        Ok(holders)
    }

    /// The limits of a key.
    pub fn limits(&self, key: &AccessKey) -> Limits {
        let per_minute = match key.per_minute {
            None => self.default_limits.per_minute,
            Some(own) => NonZeroU32::new(own),
        };
        Limits { per_minute, ..self.default_limits }
    }

    /// Records in the store that a key was used, at most once per minute. The caller does not wait for it.
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
            // The time of the last use is only information for people. If the store cannot record it, for example
            // because the disk is full, the request must not fail.
            let _ = store.key_was_used(by).await;
        });
    }
}

#[cfg(test)]
mod tests {
    use fretwork_store::{NewKey, Options, Role};
    use tempfile::TempDir;

    use super::*;

    /// Reading the keys takes almost all of the time of a refusal. If only an unknown id caused it, the time would show
    /// which ids exist.
    #[tokio::test]
    async fn a_wrong_secret_reads_the_keys_again_like_an_unknown_id() {
        let dir = TempDir::new().unwrap();
        let store = Store::open(dir.path().into(), &Options::default()).await.unwrap();
        let new = NewKey {
            name: "anna".into(),
            role: Role::Read,
            per_minute: None,
            expires: None,
            private: false,
        };
        let (known, _) = store.add_key(new, Actor::default()).await.unwrap();
        let keyring = Keyring::new(&store, Limits::default());
        assert!(keyring.holders().await.unwrap().contains_key(&known));
        for id in [&*known, "00000000"] {
            let reads = keyring.read.subscribe();
            assert!(keyring.holder_of(id, &[0; 32]).await.unwrap().is_none());
            assert!(reads.has_changed().unwrap(), "{id}");
        }
        store.close().await;
    }
}
