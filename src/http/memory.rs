//! The answers asked for most, at hand in memory; and those on their way, made and held once for all
//! who read them.

use std::collections::HashMap;
use std::num::NonZero;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread;

use axum::body::Bytes;
use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};
use tokio::sync::{OwnedMutexGuard, OwnedSemaphorePermit, Semaphore};

use super::coding::Coding;
use crate::job::Key;

/// An encoded answer.
#[derive(Debug, Clone)]
pub struct Answer {
    /// Its bytes.
    pub body: Bytes,
    /// What was done to them.
    pub coding: Coding,
}

impl Answer {
    /// An answer as it is.
    pub fn plain(body: Bytes) -> Self {
        Self { body, coding: Coding::Identity }
    }
}

/// Encoded answers up to some size in all; what is asked for rarely gives way. What is not kept, or
/// no longer, is shared all the same as long as somebody reads it.
#[derive(Debug)]
pub struct Memory {
    kept: Option<Cache<String, Answer, Size>>,
    /// What somebody reads.
    lent: Mutex<HashMap<String, Weak<Answer>>>,
    /// Those that are being made: who wants one meanwhile waits for their turn.
    turns: Mutex<HashMap<String, Weak<Turn>>>,
    /// How often something had to be forgotten.
    forgotten: AtomicU64,
    /// Who has a permit may make an answer of what is large.
    making: Arc<Semaphore>,
}

/// So many answers of what is large are made at the same time, at most: each takes several times the bytes
/// it is made of.
const MAKERS: usize = 4;

/// How many names there are before those are looked for that nobody needs.
const NAMES: usize = 64;

type Turn = tokio::sync::Mutex<()>;

/// An answer is being made: as long as this is held nobody else begins with it. It comes back with the
/// answer, so that the next one finds that, and otherwise goes with what is left of the making.
#[derive(Debug)]
pub struct Making {
    /// How often something had to be forgotten before anything was read for it.
    pub since: u64,
    _turn: OwnedMutexGuard<()>,
}

#[derive(Debug, Clone)]
struct Size;

impl Weighter<String, Answer> for Size {
    fn weight(&self, name: &String, answer: &Answer) -> u64 {
        // What an entry takes beside its texts.
        const OVERHEAD: usize = 128;
        (name.len() + answer.body.len() + OVERHEAD) as u64
    }
}

/// The owner of the bytes that are sent: with the last of them the answer is gone.
struct Owner(Arc<Answer>);

impl AsRef<[u8]> for Owner {
    fn as_ref(&self) -> &[u8] {
        &self.0.body
    }
}

impl Owner {
    fn share(answer: Arc<Answer>) -> Answer {
        let coding = answer.coding;
        Answer { body: Bytes::from_owner(Self(answer)), coding }
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
        let kept = options.filter(|_| bytes > 0).map(cache);
        let processors = thread::available_parallelism().map_or(1, NonZero::get);
        Self {
            kept,
            lent: Mutex::default(),
            turns: Mutex::default(),
            forgotten: AtomicU64::new(0),
            making: Arc::new(Semaphore::new(processors.min(MAKERS))),
        }
    }

    /// The right to make an answer of what is large, as long as the permit is held: until it is made,
    /// whether or not somebody still waits for it.
    pub async fn may_make(&self) -> Option<OwnedSemaphorePermit> {
        Arc::clone(&self.making).acquire_owned().await.ok()
    }

    /// The answer of this name, if it is remembered.
    pub fn get(&self, name: &str) -> Option<Answer> {
        self.kept.as_ref()?.get(name)
    }

    /// How often something had to be forgotten: who makes an answer that is to be remembered looks at it
    /// before he reads anything.
    pub fn forgotten(&self) -> u64 {
        self.forgotten.load(Ordering::SeqCst)
    }

    /// Forgets every answer of a result that is there no longer. Who reads on has it to the end.
    pub fn forget(&self, key: &Key) {
        let begins = key.to_string();
        // Under this lock everything is put in. What was made of the result before this moment is
        // either there already and goes, or comes with the old count and is not taken.
        let mut lent = lock(&self.lent);
        if let Some(kept) = &self.kept {
            kept.retain(|name, _| !name.starts_with(&begins));
        }
        lent.retain(|name, _| !name.starts_with(&begins));
        self.forgotten.fetch_add(1, Ordering::SeqCst);
    }

    /// Remembers an answer, unless something was forgotten since: perhaps what it was made of.
    pub fn put(&self, name: String, answer: &Answer, since: u64) {
        let _lent = lock(&self.lent);
        if let Some(kept) = self.kept.as_ref().filter(|_| self.forgotten() == since) {
            kept.insert(name, answer.clone());
        }
    }

    /// The answer of this name, which others may be reading; else it is made, by one of those who want it
    /// at the same time. If that one goes away or fails, the next one makes it, once the turn is free.
    pub async fn share<E, F>(&self, name: &str, make: impl FnOnce(Making) -> F) -> Result<Answer, E>
    where
        F: Future<Output = Result<(Answer, Making), E>>,
    {
        if let Some(answer) = self.get(name) {
            return Ok(answer);
        }
        let turn = entry(&mut lock(&self.turns), name, Arc::default);
        let turn = turn.lock_owned().await;
        // Only now: what was forgotten while this one waited concerns nothing that it reads.
        let since = self.forgotten();
        if let Some(answer) = self.get(name).or_else(|| self.borrow(name)) {
            return Ok(answer);
        }
        let (answer, _making) = make(Making { since, _turn: turn }).await?;
        Ok(self.lend(name, answer, since))
    }

    /// The answer of this name that somebody reads.
    fn borrow(&self, name: &str) -> Option<Answer> {
        let answer = lock(&self.lent).get(name)?.upgrade()?;
        Some(Owner::share(answer))
    }

    /// Has those who come read the same bytes, as long as somebody does, unless something was
    /// forgotten since.
    fn lend(&self, name: &str, answer: Answer, since: u64) -> Answer {
        let mut lent = lock(&self.lent);
        if self.forgotten() != since {
            return answer;
        }
        Owner::share(entry(&mut lent, name, || Arc::new(answer)))
    }
}

/// What has this name, as long as somebody holds it; else what is made now.
fn entry<T>(
    names: &mut HashMap<String, Weak<T>>,
    name: &str,
    make: impl FnOnce() -> Arc<T>,
) -> Arc<T> {
    if let Some(found) = names.get(name).and_then(Weak::upgrade) {
        return found;
    }
    if names.len() >= NAMES && names.len() == names.capacity() {
        names.retain(|_, held| held.strong_count() > 0);
    }
    let made = make();
    names.insert(name.to_owned(), Arc::downgrade(&made));
    made
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use futures_util::FutureExt as _;

    use super::*;

    fn answer(size: usize) -> Answer {
        Answer::plain(Bytes::from(vec![0; size]))
    }

    fn place<E: std::fmt::Debug>(answer: &Result<Answer, E>) -> *const u8 {
        answer.as_ref().unwrap().body.as_ptr()
    }

    #[test]
    fn what_is_remembered_stays_within_its_bytes() {
        let memory = Memory::new(100_000);
        for number in 0..100 {
            memory.put(number.to_string(), &answer(10_000), 0);
        }
        let held = (0..100).filter(|number: &u32| memory.get(&number.to_string()).is_some());
        assert!((1..10).contains(&held.count()));
        assert!(Memory::new(0).get("0").is_none());
    }

    #[tokio::test]
    async fn what_many_want_is_made_once_and_held_once_until_nobody_reads_it() {
        let memory = Memory::new(0);
        let made = AtomicUsize::new(0);
        let want = || {
            memory.share("form", |making| async {
                made.fetch_add(1, Ordering::Relaxed);
                tokio::task::yield_now().await;
                Ok::<_, Infallible>((answer(1000), making))
            })
        };
        let (one, two, three) = tokio::join!(want(), want(), want());
        assert_eq!((place(&one), place(&two)), (place(&two), place(&three)));
        assert_eq!(made.load(Ordering::Relaxed), 1);
        drop((one, two));
        let four = want().await;
        assert_eq!((place(&four), made.load(Ordering::Relaxed)), (place(&three), 1));
        drop((three, four));
        want().await.unwrap();
        assert_eq!(made.load(Ordering::Relaxed), 2);
    }

    #[tokio::test]
    async fn who_fails_or_goes_away_leaves_the_making_to_the_next() {
        let memory = Memory::new(0);
        assert_eq!(
            memory.share("name", |_| async { Err::<(Answer, Making), _>(7) }).await.unwrap_err(),
            7
        );
        let never =
            memory.share("name", |_| std::future::pending::<Result<(Answer, Making), u8>>());
        tokio::select! {
            biased;
            _ = never => unreachable!("it is never made"),
            () = std::future::ready(()) => {}
        }
        let made = memory.share("name", |making| async { Ok::<_, u8>((answer(1), making)) }).await;
        assert_eq!(made.unwrap().body.len(), 1);
    }

    #[tokio::test]
    async fn who_goes_away_while_it_is_made_leaves_it_to_the_next_once_it_is_made() {
        let memory = Memory::new(1 << 20);
        let (begun, turn) = tokio::sync::oneshot::channel();
        let first = memory.share("name", |making| {
            let _ = begun.send(making);
            std::future::pending::<Result<(Answer, Making), u8>>()
        });
        assert!(first.now_or_never().is_none());
        let making = turn.await.unwrap();
        let again = memory.share("name", |_| async { Err::<(Answer, Making), _>(7) });
        let mut again = std::pin::pin!(again);
        assert!((&mut again).now_or_never().is_none(), "it is still made");
        memory.put("name".to_owned(), &answer(1), making.since);
        drop(making);
        assert_eq!(again.await.unwrap().body.len(), 1);
    }

    #[tokio::test]
    async fn what_is_deleted_is_had_by_nobody_who_comes_later() {
        let memory = Memory::new(1 << 20);
        let key = Key::from_bytes([7; 32]);
        let name = key.to_string();
        let read = async || {
            memory.share(&name, |making| async { Ok::<_, Infallible>((answer(1), making)) }).await
        };
        let held = read().await;
        assert_eq!(place(&held), place(&read().await));
        memory.put(name.clone(), &held.unwrap(), memory.forgotten());
        assert!(memory.get(&name).is_some());
        memory.forget(&key);
        assert!(memory.get(&name).is_none() && memory.borrow(&name).is_none());

        // What was read before and comes after is had by who reads it, and not remembered.
        let since = memory.forgotten();
        let read = |making| async {
            memory.forget(&key);
            Ok::<_, Infallible>((answer(1), making))
        };
        let late = memory.share(&name, read).await.unwrap();
        memory.put(name.clone(), &late, since);
        assert!(memory.get(&name).is_none() && memory.borrow(&name).is_none());
    }

    #[tokio::test]
    async fn few_answers_of_what_is_large_are_made_at_the_same_time() {
        let memory = Memory::new(0);
        let mut permits = Vec::new();
        while let Some(Some(permit)) = memory.may_make().now_or_never() {
            permits.push(permit);
        }
        assert!((1..=MAKERS).contains(&permits.len()), "{}", permits.len());
        permits.pop();
        assert!(memory.may_make().now_or_never().flatten().is_some());
    }

    #[tokio::test]
    async fn names_that_nobody_reads_are_forgotten() {
        let memory = Memory::new(0);
        let held = memory
            .share("held", |making| async { Ok::<_, u8>((answer(1), making)) })
            .await
            .unwrap();
        for number in 0..10_000 {
            let name = number.to_string();
            memory.share(&name, |making| async { Ok::<_, u8>((answer(1), making)) }).await.unwrap();
        }
        let (lent, turns) = (memory.lent.lock().unwrap(), memory.turns.lock().unwrap());
        assert!(lent.len() <= 4 * NAMES && lent.contains_key("held"), "{}", lent.len());
        assert!(turns.len() <= 4 * NAMES, "{}", turns.len());
        drop(held);
    }
}
