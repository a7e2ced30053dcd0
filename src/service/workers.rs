//! The worker pool: threads that claim runs, compute them step by step, and stop on request.
//!
//! Computing takes whole processors for whole seconds, so it has threads of its own, apart from
//! those that answer requests. What a thread does to the tables goes through the store.

use std::any::Any;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tokio::runtime::Handle;
use tokio::sync::{mpsc, watch};

use super::stopwatch::Stopwatch;
use crate::job::{Answer, Cost, FailureKind, Key, Step, Work};
use crate::store::{Claimed, Error, Finish, Store};

/// Begins the work of a stored task: its key and its stored form.
pub type Compute = Arc<dyn Fn(&Key, &str) -> Result<Box<dyn Work>, String> + Send + Sync>;

/// Progress is stored at most this often.
const REPORT: Duration = Duration::from_millis(250);
/// An idle worker looks into the queue this often even if nothing was signalled.
const POLL: Duration = Duration::from_secs(5);
/// The pauses between attempts to reach a store that refuses grow from the first to the last.
const PAUSE: (Duration, Duration) = (Duration::from_millis(50), Duration::from_secs(5));
/// After so many refusals that no room on the disk would change, a run fails.
const REFUSED_AT_MOST: u32 = 8;
/// A step should take 50 ms; a thread that is silent for so long after it was told to let go is
/// left behind.
const LINGER: Duration = Duration::from_secs(5);

/// What the threads are told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd)]
enum Order {
    /// Claim and compute.
    Work,
    /// Finish what is begun, claim nothing more.
    Finish,
    /// Let go of what is begun.
    LetGo,
}

/// A running pool. Dropping it makes the threads let go of their runs and end, unattended.
#[derive(Debug)]
pub struct Workers {
    order: watch::Sender<Order>,
    threads: Vec<JoinHandle<()>>,
    /// Yields nothing, and ends when the last thread has.
    alive: mpsc::Receiver<()>,
}

impl Workers {
    /// Starts `count` threads; a run that takes longer than `limit` fails. It must be called inside a
    /// tokio runtime, which drives the store.
    ///
    /// # Errors
    ///
    /// The system starts no more threads.
    pub fn start(
        store: &Store,
        count: usize,
        limit: Option<Duration>,
        compute: &Compute,
    ) -> io::Result<Self> {
        let (order, orders) = watch::channel(Order::Work);
        let (living, alive) = mpsc::channel(1);
        let start = |number| {
            let mut worker = Worker {
                store: store.clone(),
                compute: Arc::clone(compute),
                limit,
                orders: orders.clone(),
                runtime: Handle::current(),
                _living: living.clone(),
            };
            thread::Builder::new().name(format!("worker-{number}")).spawn(move || worker.run())
        };
        let threads = (0..count).map(start).collect::<io::Result<_>>()?;
        Ok(Self { order, threads, alive })
    }

    /// Claims nothing more, lets running work finish within `grace`, puts the rest back in the
    /// queue, and ends the threads.
    pub async fn drain(mut self, grace: Duration) {
        self.order.send_replace(Order::Finish);
        if tokio::time::timeout(grace, self.alive.recv()).await.is_err() {
            self.order.send_replace(Order::LetGo);
            if tokio::time::timeout(LINGER, self.alive.recv()).await.is_err() {
                tracing::error!("a run does not let go; it is recovered at the next start");
                return;
            }
        }
        for thread in self.threads.drain(..) {
            // They have all ended, or are about to: this does not block. A panic has been printed.
            let _ = thread.join();
        }
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        self.order.send_replace(Order::LetGo);
    }
}

/// One thread's state.
struct Worker {
    store: Store,
    compute: Compute,
    limit: Option<Duration>,
    orders: watch::Receiver<Order>,
    runtime: Handle,
    _living: mpsc::Sender<()>,
}

/// How the computing of a run ended.
enum Outcome {
    Done(Answer, Cost),
    Failed(FailureKind, String),
    /// Nobody wants it any more.
    Unwanted,
    /// There is no time to finish it.
    Interrupted,
}

impl Worker {
    fn run(&mut self) {
        let runtime = self.runtime.clone();
        while let Some(claimed) = runtime.block_on(self.claim()) {
            let mut next = Some(claimed);
            while let Some(claimed) = next {
                let _span = span(&claimed).entered();
                tracing::debug!("begun");
                // The payload of a panic is all that can come through: nothing the closure could
                // leave half done is used afterwards.
                let outcome = catch_unwind(AssertUnwindSafe(|| self.compute(&claimed)))
                    .unwrap_or_else(|panic| Outcome::Failed(FailureKind::Panicked, said(&*panic)));
                next = runtime.block_on(self.settle_and_claim(&claimed, &outcome));
            }
        }
    }

    /// Both at once, so that they share a commit. None if there is no run at this moment.
    async fn settle_and_claim(&self, claimed: &Claimed, outcome: &Outcome) -> Option<Claimed> {
        if self.order() != Order::Work {
            self.settle(claimed, outcome).await;
            return None;
        }
        let (stored, next) = tokio::join!(self.store_outcome(claimed, outcome), self.store.claim());
        // An error of the claim is met again, and told, where a claim is waited for.
        let mut next = next.ok().flatten();
        if stored.is_err() {
            // The next run must not wait for the store to take this one.
            if let Some(Claimed { run, attempt, .. }) = next
                && self.store.release(run, attempt).await.is_ok()
            {
                next = None;
            }
            self.settle(claimed, outcome).await;
        }
        next
    }

    fn order(&self) -> Order {
        *self.orders.borrow()
    }

    /// Waits for a run to compute; none once the pool is to end.
    async fn claim(&mut self) -> Option<Claimed> {
        let mut queue = self.store.watch_queue();
        let mut pause = PAUSE.0;
        while self.order() == Order::Work {
            let wait = match self.store.claim().await {
                Ok(Some(claimed)) => return Some(claimed),
                Ok(None) => {
                    pause = PAUSE.0;
                    POLL
                }
                Err(Error::Closed) => return None,
                Err(error) => {
                    tracing::error!(error = &error as &dyn std::error::Error, "cannot claim a run");
                    pause = PAUSE.1.min(pause * 2);
                    pause
                }
            };
            tokio::select! {
                () = queue.changed() => {}
                _ = self.orders.changed() => {}
                () = tokio::time::sleep(wait) => {}
            }
        }
        None
    }

    fn compute(&self, claimed: &Claimed) -> Outcome {
        let watch = Stopwatch::start();
        let mut work = match (self.compute)(&claimed.key, &claimed.task) {
            Ok(work) => work,
            Err(message) => return Outcome::Failed(FailureKind::UnreadableTask, message),
        };
        let started = Instant::now();
        let mut reported = started;
        loop {
            if claimed.stop.is_raised() {
                return Outcome::Unwanted;
            }
            if self.order() == Order::LetGo {
                return Outcome::Interrupted;
            }
            let progress = match work.step() {
                Step::Done(answer) => return Outcome::Done(answer, watch.cost()),
                Step::Working { progress } => progress,
            };
            if let Some(limit) = self.limit
                && started.elapsed() > limit
            {
                let message = format!(
                    "it took longer than the {} that this server allows",
                    humantime::format_duration(limit)
                );
                return Outcome::Failed(FailureKind::TimeLimit, message);
            }
            if reported.elapsed() >= REPORT {
                reported = Instant::now();
                let noted = self.store.progress(claimed.run, claimed.attempt, progress);
                match self.runtime.block_on(noted) {
                    Ok(true) => {}
                    Ok(false) => return Outcome::Unwanted,
                    // The work is worth more than its progress.
                    Err(error) => tracing::debug!(%error, "cannot store the progress of a run"),
                }
            }
        }
    }

    /// Stores how a run ended, however long the disk is full or the database busy: a run must not be
    /// lost silently. What the database refuses for good fails the run, or it would keep its thread.
    async fn settle(&self, claimed: &Claimed, outcome: &Outcome) {
        let mut pause = PAUSE.0;
        let mut refused = 0;
        while let Err(error) = self.store_outcome(claimed, outcome).await {
            let run = claimed.run;
            if matches!(error, Error::Damaged(_) | Error::Database(_)) {
                refused += 1;
            }
            let giving_up = matches!(error, Error::Closed) || self.order() == Order::LetGo;
            let message = error.to_string();
            let error = &error as &dyn std::error::Error;
            if giving_up {
                tracing::error!(?run, error, "a run is left to the next start");
                return;
            }
            tracing::error!(?run, error, "cannot store how a run ended; trying again");
            if refused >= REFUSED_AT_MOST {
                let (attempt, kind) = (claimed.attempt, FailureKind::NotStored);
                if self.store.fail(run, attempt, kind, &message).await.is_ok() {
                    return;
                }
            }
            let mut orders = self.orders.clone();
            let let_go = orders.wait_for(|order| *order == Order::LetGo);
            let _ = tokio::time::timeout(pause, let_go).await;
            pause = PAUSE.1.min(pause * 2);
        }
    }

    async fn store_outcome(&self, claimed: &Claimed, outcome: &Outcome) -> Result<(), Error> {
        let Claimed { run, attempt, .. } = claimed;
        let accepted = match outcome {
            Outcome::Done(answer, cost) => {
                tracing::debug!("done");
                self.store.finish(*run, *attempt, answer, *cost).await? != Finish::Refused
            }
            Outcome::Failed(kind, message) => {
                tracing::error!(%kind, message, "a run failed");
                self.store.fail(*run, *attempt, *kind, message).await?
            }
            Outcome::Interrupted => self.store.release(*run, *attempt).await?,
            Outcome::Unwanted => false,
        };
        if !accepted {
            // It was canceled meanwhile, else it is no longer ours and this changes nothing.
            self.store.stopped(*run, *attempt).await?;
        }
        Ok(())
    }
}

/// What the log lines of a run have in common: its key, and the request that wanted it.
fn span(claimed: &Claimed) -> tracing::Span {
    let Claimed { key, attempt, trace, .. } = claimed;
    let mut words = trace.as_deref().unwrap_or_default().split(' ');
    let (request, traceparent) = (words.next().unwrap_or_default(), words.next());
    tracing::info_span!("run", %key, attempt, request, traceparent)
}

/// What a panic said.
fn said(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("the computation panicked")
        .to_owned()
}
