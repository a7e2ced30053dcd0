//! The answers asked for most, at hand in memory.

use std::sync::atomic::{AtomicU64, Ordering};

use axum::body::Bytes;
use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};

use crate::job::Key;

/// Encoded answers up to some size in all; what is asked for rarely gives way.
#[derive(Debug)]
pub struct Memory {
    answers: Option<Cache<String, Bytes, Size>>,
    forgotten: AtomicU64,
}

#[derive(Debug, Clone)]
struct Size;

impl Weighter<String, Bytes> for Size {
    fn weight(&self, name: &String, body: &Bytes) -> u64 {
        // What an entry takes beside its texts.
        const OVERHEAD: usize = 128;
        (name.len() + body.len() + OVERHEAD) as u64
    }
}

impl Memory {
    /// A memory of so many bytes; with none, nothing is remembered.
    pub fn new(bytes: u64) -> Self {
        // About how many answers of the usual size there will be.
        let items = usize::try_from(bytes >> 16).unwrap_or(usize::MAX).max(16);
        let options = OptionsBuilder::new()
            // Few parts, or a large answer fits into none of them.
            .shards(2)
            .estimated_items_capacity(items)
            .weight_capacity(bytes)
            .build()
            .ok();
        let cache = |options| {
            let (hash, life) = (DefaultHashBuilder::default(), DefaultLifecycle::default());
            Cache::with_options(options, Size, hash, life)
        };
        Self { answers: options.filter(|_| bytes > 0).map(cache), forgotten: AtomicU64::new(0) }
    }

    /// The answer of this name.
    pub fn get(&self, name: &str) -> Option<Bytes> {
        self.answers.as_ref()?.get(name)
    }

    /// How often something had to be forgotten: who makes an answer to be remembered looks at it
    /// before he reads, and again after it was [`put`](Self::put).
    pub fn forgotten(&self) -> u64 {
        self.forgotten.load(Ordering::SeqCst)
    }

    /// Forgets every answer of a result that is there no longer.
    pub fn forget(&self, key: &Key) {
        // First, so that who puts one in meanwhile sees it and takes it out himself.
        self.forgotten.fetch_add(1, Ordering::SeqCst);
        if let Some(answers) = &self.answers {
            let begins = format!("\"{key}");
            answers.retain(|name, _| !name.starts_with(&begins));
        }
    }

    /// Remembers an answer.
    pub fn put(&self, name: String, body: &Bytes) {
        if let Some(answers) = &self.answers {
            answers.insert(name, body.clone());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_remembered_stays_within_its_bytes() {
        let memory = Memory::new(100_000);
        let body = Bytes::from(vec![0; 10_000]);
        for number in 0..100 {
            memory.put(number.to_string(), &body);
        }
        let held = (0..100).filter(|number: &u32| memory.get(&number.to_string()).is_some());
        assert!((1..10).contains(&held.count()));
        assert!(Memory::new(0).get("0").is_none());
    }
}
