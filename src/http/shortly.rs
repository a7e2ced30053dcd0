//! Short computations, done while their submission waits.
//!
//! A job that takes milliseconds costs more on its way through the queue than in the engine. If its
//! client waits anyway, it is computed first, and the job, its run and its result are committed
//! together; nothing is acknowledged before. Equal submissions that come meanwhile join in. What
//! turns out to take longer goes through the queue like anything else.

use std::collections::HashMap;
use std::fmt;
use std::panic::{self, AssertUnwindSafe};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::{Semaphore, oneshot};
use tokio::task;
use tokio::time::timeout;

use super::scenarios;
use crate::job::{Answer, Cost, Job, Key, Step};
use crate::service::workers::{Compute, Stopwatch};
use crate::store::{Admission, Error, NewJob, Store, Submitted};

/// What may be computed so, by its estimate in seconds.
const SHORT: f64 = 0.02;
/// What takes less is computed on the thread that answers: handing it over would take as long.
const INSTANT: f64 = 1e-4;
/// How many may wait for a place; others go through the queue at once.
const WAITING: usize = 64;
/// When waiting for a place, or computing, is given up: then it goes through the queue.
const GIVEN_UP: Duration = Duration::from_millis(50);

/// Computes what is short.
#[derive(Clone)]
pub struct Shortly {
    compute: Compute,
    entrance: Arc<Semaphore>,
    /// As many at a time as there are workers: more would only take turns.
    places: Arc<Semaphore>,
    /// Who waits for a computation under way here.
    joined: Arc<Mutex<HashMap<Key, Vec<Joined>>>>,
}

/// A submission that joined, and where to send the job it became.
struct Joined {
    job: NewJob,
    reply: oneshot::Sender<Job>,
}

impl fmt::Debug for Shortly {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Shortly").finish_non_exhaustive()
    }
}

impl Shortly {
    /// As many places as there are workers.
    pub fn new(compute: Compute, workers: usize) -> Self {
        let entrance = Arc::new(Semaphore::new(WAITING));
        let places = Arc::new(Semaphore::new(workers));
        Self { compute, entrance, places, joined: Arc::default() }
    }

    /// Submits a job of so many seconds by its estimate, whose client waits for it.
    pub async fn submit(
        &self,
        store: &Store,
        job: NewJob,
        seconds: f64,
    ) -> Result<(Submitted, Option<Answer>), Error> {
        // A repetition must find what it repeats in the tables, and nobody overtakes who waits.
        let short = seconds < SHORT
            && job.repeatable.is_none()
            && job.admission == Admission::default()
            && !job.afresh
            && store.tally().queued() == 0;
        let entered = if short { self.entrance.try_acquire().ok() } else { None };
        if entered.is_none() && !(short && self.is_under_way(&job.key)) {
            return Ok((store.submit(job).await?, None));
        }
        let admission = Admission { unless_needed: true, ..Admission::default() };
        match store.submit(NewJob { admission, ..job.clone() }).await? {
            Submitted::Needed => {}
            other => return Ok((other, None)),
        }
        if let Some(became) = self.join(&job) {
            // Who only joins takes no place from others.
            drop(entered);
            if let Ok(job) = became.await {
                return Ok((Submitted::Accepted(job), None));
            }
            // Who led has gone, perhaps after this had become a job.
            return match store.submit(job).await {
                Err(Error::JobExists(id)) => {
                    let job = store.job(id).await?.ok_or(Error::Closed)?;
                    Ok((Submitted::Accepted(job), None))
                }
                other => Ok((other?, None)),
            };
        }
        // From here on others join; whatever happens, they are released.
        let mut leading = Leading { shortly: self, key: job.key, ended: false };
        let answer = match entered {
            // A long body takes a while before anything is computed.
            Some(_) => {
                let here = seconds < INSTANT && job.task.len() <= scenarios::SHORT;
                self.compute(&job, here).await
            }
            None => None,
        };
        let Some((answer, cost)) = answer else {
            return Ok((store.submit(job).await?, None));
        };
        let (mut jobs, mut replies) = (vec![job], Vec::new());
        for Joined { job, reply } in leading.end() {
            jobs.push(job);
            replies.push(reply);
        }
        let mut became = store.record(jobs, &answer, cost).await?.into_iter();
        let first = became.next().ok_or(Error::Closed)?;
        for (submitted, reply) in became.zip(replies) {
            if let Submitted::Accepted(job) = submitted {
                // Who waited may have left; the job is kept all the same.
                let _ = reply.send(job);
            }
        }
        Ok((first, Some(answer)))
    }

    /// The answer and what it cost, unless it takes too long or it cannot be computed.
    async fn compute(&self, job: &NewJob, here: bool) -> Option<(Answer, Cost)> {
        let place = timeout(GIVEN_UP, Arc::clone(&self.places).acquire_owned()).await.ok()?.ok()?;
        let (compute, key, stored) = (Arc::clone(&self.compute), job.key, job.task.clone());
        let work = move || {
            let _place = place;
            let watch = Stopwatch::start();
            let mut work = compute(&key, &stored).ok()?;
            while watch.elapsed() < GIVEN_UP {
                if let Step::Done(answer) = work.step() {
                    return Some((answer, watch.cost()));
                }
            }
            None
        };
        // A panic is met again by a worker, who knows what to do about it.
        if here {
            panic::catch_unwind(AssertUnwindSafe(work)).ok().flatten()
        } else {
            task::spawn_blocking(work).await.ok().flatten()
        }
    }

    fn is_under_way(&self, key: &Key) -> bool {
        self.table().contains_key(key)
    }

    /// Joins what is under way; none if it is not, and then it is from now on.
    fn join(&self, job: &NewJob) -> Option<oneshot::Receiver<Job>> {
        let mut table = self.table();
        let Some(joined) = table.get_mut(&job.key) else {
            table.insert(job.key, Vec::new());
            return None;
        };
        let (reply, answer) = oneshot::channel();
        joined.push(Joined { job: job.clone(), reply });
        Some(answer)
    }

    fn table(&self) -> MutexGuard<'_, HashMap<Key, Vec<Joined>>> {
        self.joined.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A computation under way. Dropped, it lets those who joined go on alone.
struct Leading<'a> {
    shortly: &'a Shortly,
    key: Key,
    ended: bool,
}

impl Leading<'_> {
    /// Nobody joins from now on; what begins later under this key is another's.
    fn end(&mut self) -> Vec<Joined> {
        if std::mem::replace(&mut self.ended, true) {
            return Vec::new();
        }
        self.shortly.table().remove(&self.key).unwrap_or_default()
    }
}

impl Drop for Leading<'_> {
    fn drop(&mut self) {
        self.end();
    }
}
