//! Short runs, computed while their client waits.
//!
//! A run of milliseconds costs more on its way through the queue than in the engine. If its client waits
//! anyway, it is computed first; then the job, its run and its result are committed together, and nothing
//! is acknowledged before. Equal submissions that arrive meanwhile join it (single-flight). A run that
//! takes longer than estimated goes through the queue.

use std::collections::HashMap;
use std::panic::{self, AssertUnwindSafe};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::{Semaphore, oneshot};
use tokio::task;
use tokio::time::timeout;

use super::stopwatch::Stopwatch;
use super::{Begin, Service};
use crate::job::{Answer, Cost, Job, Key, Prepared, Step};
use crate::store::{Admission, Error, NewJob, Store, Submitted};

/// Longest estimate of a short run, in seconds.
const SHORT: f64 = 0.02;
/// Runs with a shorter estimate, in seconds, are computed on the async thread: handing them over would
/// take as long.
const INLINE: f64 = 1e-4;
/// Longest stored form, in bytes, of a run that is computed on the async thread.
const INLINE_BYTES: usize = 1 << 14;
/// Most submissions that wait for a place to compute; further ones go through the queue.
const MAX_WAITING: usize = 64;
/// Longest wait for a place, and longest computation; then the run goes through the queue.
const TIMEOUT: Duration = Duration::from_millis(50);

/// Computes short runs.
pub struct ShortRuns {
    begin: Begin,
    entrance: Arc<Semaphore>,
    /// As many computations at a time as there are workers: more would only share the processors.
    places: Arc<Semaphore>,
    /// For each computation under way, the submissions that joined it.
    flights: Mutex<HashMap<Key, Vec<Joined>>>,
}

/// A submission that joined, and where to send the job that it becomes.
struct Joined {
    job: NewJob,
    reply: oneshot::Sender<Job>,
}

impl ShortRuns {
    /// As many places as there are workers.
    pub fn new(begin: Begin, workers: usize) -> Self {
        let entrance = Arc::new(Semaphore::new(MAX_WAITING));
        let places = Arc::new(Semaphore::new(workers));
        Self { begin, entrance, places, flights: Mutex::default() }
    }

    /// Whether a submission is to be computed here. A repetition must find its first job in the tables, and
    /// a new run must not overtake queued ones.
    pub fn suits(store: &Store, job: &NewJob, prepared: &Prepared) -> bool {
        prepared.seconds < SHORT
            && job.repeatable.is_none()
            && job.admission == Admission::NewRun
            && !job.afresh
            && store.tally().queued() == 0
    }

    /// The answer and its cost; none if it takes too long or cannot be computed.
    async fn compute(&self, prepared: &Prepared) -> Option<(Answer, Cost)> {
        let place = timeout(TIMEOUT, Arc::clone(&self.places).acquire_owned()).await.ok()?.ok()?;
        let inline = prepared.seconds < INLINE && prepared.stored.len() <= INLINE_BYTES;
        let (begin, prepared) = (Arc::clone(&self.begin), prepared.clone());
        let work = move || {
            let _place = place;
            let watch = Stopwatch::start();
            let (key, stored) = (prepared.key, Arc::clone(&prepared.stored));
            let mut work = begin(&key, &stored, Some(prepared)).ok()?;
            while watch.elapsed() < TIMEOUT {
                if let Step::Done(answer) = work.step() {
                    return Some((answer, watch.cost()));
                }
            }
            None
        };
        // A run that panics here goes through the queue, where its worker records the failure.
        if inline {
            panic::catch_unwind(AssertUnwindSafe(work)).ok().flatten()
        } else {
            task::spawn_blocking(work).await.ok().flatten()
        }
    }

    /// Joins the computation of this key. None if there is none: the caller then leads one.
    fn join(&self, job: &NewJob) -> Option<oneshot::Receiver<Job>> {
        let mut flights = self.flights();
        let Some(joined) = flights.get_mut(&job.key) else {
            flights.insert(job.key, Vec::new());
            return None;
        };
        let (reply, answer) = oneshot::channel();
        joined.push(Joined { job: job.clone(), reply });
        Some(answer)
    }

    fn flights(&self) -> MutexGuard<'_, HashMap<Key, Vec<Joined>>> {
        self.flights.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Service {
    /// Computes a short run and records it with its job, or joins the computation under way.
    pub(super) async fn submit_short(
        &self,
        job: NewJob,
        prepared: Prepared,
    ) -> Result<(Submitted, Option<Answer>), Error> {
        let (store, short) = (&self.0.store, &self.0.short);
        let entered = short.entrance.try_acquire().ok();
        if entered.is_none() && !short.flights().contains_key(&job.key) {
            return Ok((self.enqueue(job, prepared).await?, None));
        }
        let probe = NewJob { admission: Admission::NoNewRun, ..job.clone() };
        match store.submit(probe).await? {
            Submitted::NeedsRun => {}
            other => return Ok((other, None)),
        }
        if let Some(became) = short.join(&job) {
            // A submission that only joins takes no place from others.
            drop(entered);
            if let Ok(job) = became.await {
                return Ok((Submitted::Accepted(job), None));
            }
            // The leader was dropped. Our job may already be recorded.
            return match self.enqueue(job, prepared).await {
                Err(Error::JobExists(id)) => {
                    let job = store.job(id).await?.ok_or(Error::Closed)?;
                    Ok((Submitted::Accepted(job), None))
                }
                other => Ok((other?, None)),
            };
        }
        let mut leader = Leader { short, key: job.key, landed: false };
        let answer = match entered {
            Some(_) => short.compute(&prepared).await,
            None => None,
        };
        let Some((answer, cost)) = answer else {
            return Ok((self.enqueue(job, prepared).await?, None));
        };
        let (mut jobs, mut replies) = (vec![job], Vec::new());
        for Joined { job, reply } in leader.land() {
            jobs.push(job);
            replies.push(reply);
        }
        let mut became = store.record(jobs, &answer, cost).await?.into_iter();
        let first = became.next().ok_or(Error::Closed)?;
        for (submitted, reply) in became.zip(replies) {
            if let Submitted::Accepted(job) = submitted {
                // If its client has left, the job is kept all the same.
                let _ = reply.send(job);
            }
        }
        Ok((first, Some(answer)))
    }
}

/// The submission that computes. Dropped, it releases those that joined, and each goes on alone.
struct Leader<'a> {
    short: &'a ShortRuns,
    key: Key,
    landed: bool,
}

impl Leader<'_> {
    /// Ends the flight: later submissions of this key begin another one. Returns those that joined.
    fn land(&mut self) -> Vec<Joined> {
        if std::mem::replace(&mut self.landed, true) {
            return Vec::new();
        }
        self.short.flights().remove(&self.key).unwrap_or_default()
    }
}

impl Drop for Leader<'_> {
    fn drop(&mut self) {
        self.land();
    }
}
