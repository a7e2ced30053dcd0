//! Computes short runs while their clients wait.
//!
//! For a run of milliseconds, the queue takes more time than the engine. If the client waits anyway, the server
//! computes the run first. Then it commits the result and the finished job together, and only then answers. Equal
//! submissions that arrive meanwhile wait for the same computation (single-flight). A run that takes longer than
//! estimated goes through the queue.

use std::collections::HashMap;
use std::sync::Arc;

use parking_lot::Mutex;
use quick_cache::sync::Cache;
use tokio::sync::{Semaphore, oneshot};

use super::places::{INLINE, INLINE_BYTES, MAX_TIME, MAX_WAIT, Places, SHORT};
use super::stopwatch::Stopwatch;
use fretwork_job::{Answer, Begin, Job, JobState, Key, Origin, Prepared, Step};
use fretwork_store::{Admission, Answered, Error, NewJob, Result, Store, Submitted};

/// Maximum number of keys in `known`.
const KNOWN: usize = 1 << 14;

/// Maximum number of submissions that wait for a place or compute. Further ones go through the queue.
const MAX_WAITING: usize = 64;

/// Computes short runs.
pub struct ShortRuns {
    store: Store,
    begin: Begin,
    entrance: Semaphore,
    places: Places,
    /// Keys of results that this server has recently stored or found. For other keys, a run below [`INLINE`] takes less
    /// time than a query of the database. So the run is computed first, and its result is dropped if the database has
    /// one already.
    known: Cache<Key, ()>,
    /// For the key of each computation under way, the submissions that wait for its result.
    flights: Mutex<HashMap<Key, Vec<Joined>>>,
}

/// A submission that waits for an equal one, and the channel on which it receives its job.
struct Joined {
    job: NewJob,
    reply: oneshot::Sender<Job>,
}

impl ShortRuns {
    pub fn new(store: Store, begin: Begin, places: Places) -> Self {
        let (entrance, known) = (Semaphore::new(MAX_WAITING), Cache::new(KNOWN));
        Self { store, begin, entrance, places, known, flights: Mutex::default() }
    }

    /// Whether a submission is computed here. A submission with an idempotency key is not, because the database must
    /// find the job of its first submission. A new run must not overtake queued ones.
    pub fn suits(&self, job: &NewJob, prepared: &Prepared) -> bool {
        prepared.seconds < SHORT
            && job.repeatable.is_none()
            && job.admission == Admission::NewRun
            && !job.afresh
            && self.store.tally().queued() == 0
    }

    /// Computes a run and records it with its job, or waits for an equal computation under way. Returns `None` if the
    /// job must go through the queue.
    ///
    /// # Errors
    /// The database fails.
    pub async fn submit(
        &self,
        job: &NewJob,
        prepared: &Prepared,
    ) -> Result<Option<(Submitted, Option<Answer>)>> {
        let entered = self.entrance.try_acquire().ok();
        if entered.is_none() && !self.flights.lock().contains_key(&job.key) {
            return Ok(None);
        }
        if prepared.seconds >= INLINE || self.known.get(&job.key).is_some() {
            let probe = NewJob { admission: Admission::NoNewRun, ..job.clone() };
            match self.store.submit(probe).await? {
                Submitted::NeedsRun => {}
                other => {
                    self.note(&job.key, &other);
                    return Ok(Some((other, None)));
                }
            }
        }
        if let Some(became) = self.join(job) {
            // A submission that waits for an equal one computes nothing, so it gives its permit back.
            drop(entered);
            // If the submission that computes is dropped, this job goes through the queue.
            return Ok(became.await.ok().map(|job| (Submitted::Accepted(job), None)));
        }
        let mut leader = Leader { short: self, key: job.key, landed: false };
        if entered.is_none() {
            return Ok(None);
        }
        let Some((answer, answered)) = self.compute(prepared).await else {
            return Ok(None);
        };
        let (mut jobs, mut replies) = (vec![job.clone()], Vec::new());
        for Joined { job, reply } in leader.land() {
            jobs.push(job);
            replies.push(reply);
        }
        let mut became = self.store.record(jobs, answered).await?.into_iter();
        let first = became.next().ok_or(Error::Closed)?;
        for (submitted, reply) in became.zip(replies) {
            if let Submitted::Accepted(job) = submitted {
                // If the client has disconnected, the job is still recorded.
                let _ = reply.send(job);
            }
        }
        if first == Submitted::NeedsRun {
            // The result was evicted. The job goes through the queue, where the run compares the new result with the
            // digest of the old one.
            return Ok(None);
        }
        self.note(&job.key, &first);
        // If the database had a result already, the stored bytes must be returned instead of this answer.
        let is_stored =
            matches!(&first, Submitted::Accepted(job) if job.origin == Origin::Computed);
        Ok(Some((first, is_stored.then_some(answer))))
    }

    /// Remembers a key whose result is stored.
    fn note(&self, key: &Key, submitted: &Submitted) {
        if matches!(submitted, Submitted::Accepted(job) if job.state == JobState::Succeeded) {
            self.known.insert(*key, ());
        }
    }

    /// Computes a run, in one turn. Returns its answer, and the same answer ready to be stored; `None` if the run takes
    /// too long or cannot be computed.
    async fn compute(&self, prepared: &Prepared) -> Option<(Answer, Answered)> {
        let inline = prepared.seconds < INLINE && prepared.stored.len() <= INLINE_BYTES;
        let (begin, prepared) = (Arc::clone(&self.begin), prepared.clone());
        let mut run = Some(move || {
            let watch = Stopwatch::start();
            let (key, stored) = (prepared.key, Arc::clone(&prepared.stored));
            let mut work = begin(&key, &stored, Some(prepared)).ok()?;
            while watch.elapsed() < MAX_TIME {
                if let Step::Done(answer) = work.step() {
                    let answered = Answered::new(&answer, Some(watch.cost()));
                    return Some((answer, answered));
                }
            }
            None
        });
        let turn = move || run.take().map(|run| run());
        // A run that panics here goes through the queue, where its worker records the failure.
        self.places.compute_in_turns(inline, MAX_WAIT, turn).await.ok().flatten()
    }

    /// Joins the computation of this key. If there is none, returns `None`, and this submission must compute.
    fn join(&self, job: &NewJob) -> Option<oneshot::Receiver<Job>> {
        let mut flights = self.flights.lock();
        let Some(joined) = flights.get_mut(&job.key) else {
            flights.insert(job.key, Vec::new());
            return None;
        };
        let (reply, answer) = oneshot::channel();
        joined.push(Joined { job: job.clone(), reply });
        Some(answer)
    }
}

/// The submission that computes. If it is dropped, the submissions that wait for it go through the queue.
struct Leader<'a> {
    short: &'a ShortRuns,
    key: Key,
    landed: bool,
}

impl Leader<'_> {
    /// Removes the computation from `flights`: later submissions of this key begin another one. Returns the submissions
    /// that wait.
    #[expect(clippy::expect_used, reason = "submissions that joined must not be forgotten")]
    fn land(&mut self) -> Vec<Joined> {
        if std::mem::replace(&mut self.landed, true) {
            return Vec::new();
        }
        self.short.flights.lock().remove(&self.key).expect("only its leader ends a flight")
    }
}

impl Drop for Leader<'_> {
    fn drop(&mut self) {
        self.land();
    }
}
