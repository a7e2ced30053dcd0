//! The worker pool: threads that claim runs, compute them step by step, and stop on request.
//!
//! A computation uses a whole processor for seconds, so it must not run on the threads that answer requests.
//! The threads read and change the tables only through the store.

mod compute;

use std::any::Any;
use std::future;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use parking_lot::Mutex;
use tokio::runtime::Handle;
use tokio::sync::{mpsc, watch};

use super::WorkLimits;
use fretwork_job::{Answer, Cost, FailureKind, Key, Work};
use fretwork_store::{Claimed, Error, Finish, Result, RunId, Store};
use fretwork_study::Study;

/// A function that prepares the computation of a run from its key and its stored task.
pub type Compute = Arc<dyn Fn(&Key, &str) -> Result<Box<dyn Work>, String> + Send + Sync>;

/// Minimum time between two updates of the stored progress.
const REPORT: Duration = Duration::from_millis(250);
/// An idle worker checks the queue at this interval even without a signal.
const POLL: Duration = Duration::from_secs(5);
/// The first and the longest pause between two attempts while the store fails. Each pause is twice as long as the
/// previous one.
const PAUSE: (Duration, Duration) = (Duration::from_millis(50), Duration::from_secs(5));
/// A run fails after the database has refused its result this often. A full disk, a busy database and a lost connection
/// do not count.
const MAX_REFUSALS: u32 = 8;
/// Maximum time that a drain waits for threads that must abandon their runs. A thread checks for this after each step,
/// which should take only 50 ms.
const MAX_ABANDON: Duration = Duration::from_secs(5);

/// The order to all threads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd)]
enum WorkerOrder {
    /// Claim runs and compute them.
    Work,
    /// Finish the current run, and claim no further run.
    Finish,
    /// Release the current run, and end.
    Abandon,
}

/// A running pool. If it is dropped, the threads release their runs and end. The drop does not wait for them.
pub struct Workers {
    order: watch::Sender<WorkerOrder>,
    threads: Vec<JoinHandle<()>>,
    /// Carries no messages. It is closed when the last thread has ended.
    alive: mpsc::Receiver<()>,
    /// How many threads have a run.
    busy: watch::Receiver<usize>,
}

impl Workers {
    /// Starts `count` threads. A run that takes longer than its limit fails. Call this inside a tokio runtime,
    /// on which the store runs.
    ///
    /// # Errors
    ///
    /// The system cannot start a thread.
    pub fn start(
        store: &Store,
        count: usize,
        limits: WorkLimits,
        compute: &Compute,
    ) -> io::Result<Self> {
        let (order, orders) = watch::channel(WorkerOrder::Work);
        let (living, alive) = mpsc::channel(1);
        let (busy, busy_threads) = watch::channel(0);
        let (studies, assembling) = (Arc::default(), Arc::default());
        let start = |number| {
            let mut worker = Worker {
                store: store.clone(),
                compute: Arc::clone(compute),
                limits,
                orders: orders.clone(),
                runtime: Handle::current(),
                studies: Arc::clone(&studies),
                assembling: Arc::clone(&assembling),
                busy: busy.clone(),
                _living: living.clone(),
            };
            thread::Builder::new().name(format!("worker-{number}")).spawn(move || worker.run())
        };
        let threads = (0..count).map(start).collect::<io::Result<_>>()?;
        Ok(Self { order, threads, alive, busy: busy_threads })
    }

    /// Waits until no thread has had a run for this time; without a time, forever.
    pub async fn idle_for(&self, time: Option<Duration>) {
        let Some(time) = time else { return future::pending().await };
        let mut busy = self.busy.clone();
        loop {
            // An error means that the threads have ended.
            let idle = busy.wait_for(|count| *count == 0).await.is_ok();
            if !idle || tokio::time::timeout(time, busy.changed()).await.is_err() {
                return;
            }
        }
    }

    /// Claims no more runs, and waits up to `grace` for the current ones. Then releases them to the queue, and
    /// ends the threads.
    pub async fn drain(mut self, grace: Duration) {
        self.order.send_replace(WorkerOrder::Finish);
        if tokio::time::timeout(grace, self.alive.recv()).await.is_err() {
            self.order.send_replace(WorkerOrder::Abandon);
            if tokio::time::timeout(MAX_ABANDON, self.alive.recv()).await.is_err() {
                tracing::error!("a worker does not stop; its run is recovered at the next start");
                return;
            }
        }
        for thread in self.threads.drain(..) {
            // All threads have ended or are about to end, so this does not block. The panic hook has reported any
            // panic.
            let _ = thread.join();
        }
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        self.order.send_replace(WorkerOrder::Abandon);
    }
}

/// The studies whose chunks the threads computed last, in the order of their last use.
type Studies = Mutex<Vec<(RunId, Arc<Study>)>>;

/// The state of one thread.
struct Worker {
    store: Store,
    compute: Compute,
    limits: WorkLimits,
    orders: watch::Receiver<WorkerOrder>,
    runtime: Handle,
    studies: Arc<Studies>,
    /// Held while a result is made from chunks, because a large one takes much memory.
    assembling: Arc<Mutex<()>>,
    busy: watch::Sender<usize>,
    _living: mpsc::Sender<()>,
}

/// The data that a worker has computed.
enum Made {
    /// The result.
    Answer(Answer, Cost),
    /// The rows of a chunk.
    Rows(Vec<u8>, Cost),
}

/// The reason why a worker has not finished a computation.
enum NotMade {
    Failed(FailureKind, String),
    /// No job needs the result any more, or the worker has lost its run or piece.
    Unwanted,
    /// The server shuts down before the computation is finished.
    Interrupted,
}

impl Worker {
    fn run(&mut self) {
        let runtime = self.runtime.clone();
        while let Some(claimed) = runtime.block_on(self.claim()) {
            self.busy.send_modify(|count| *count += 1);
            let mut next = Some(claimed);
            while let Some(claimed) = next {
                let _span = span(&claimed).entered();
                tracing::debug!("started");
                // This is unwind safe: after a panic, nothing that the closure has changed is used.
                let outcome = catch_unwind(AssertUnwindSafe(|| self.compute(&claimed)))
                    .unwrap_or_else(|panic| {
                        Err(NotMade::Failed(FailureKind::Panicked, message_of(&*panic)))
                    });
                next = runtime.block_on(self.settle_and_claim(&claimed, &outcome));
            }
            self.busy.send_modify(|count| *count -= 1);
        }
    }

    /// Stores the outcome and claims the next run at the same time, so that both share a commit. Returns `None` if no
    /// run was claimed.
    async fn settle_and_claim(
        &self,
        claimed: &Claimed,
        outcome: &Result<Made, NotMade>,
    ) -> Option<Claimed> {
        if self.order() != WorkerOrder::Work {
            self.settle(claimed, outcome).await;
            return None;
        }
        let (stored, next) = tokio::join!(self.store_outcome(claimed, outcome), self.store.claim());
        // After an error, the caller calls `claim`, which tries again and logs errors.
        let mut next = next.ok().flatten();
        if stored.is_err() {
            // Gives the next run back, because it must not wait until the store accepts this outcome.
            if let Some(claimed) = &next
                && self.store.release(claimed).await.is_ok()
            {
                next = None;
            }
            self.settle(claimed, outcome).await;
        }
        next
    }

    fn order(&self) -> WorkerOrder {
        *self.orders.borrow()
    }

    /// Waits for a run to compute. Returns `None` when the pool must end.
    async fn claim(&mut self) -> Option<Claimed> {
        let mut queue = self.store.watch_queue();
        let mut pause = PAUSE.0;
        while self.order() == WorkerOrder::Work {
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

    /// Stores the outcome of a run. Tries again as long as the disk is full or the database is busy, because a result
    /// must not be lost. After [`MAX_REFUSALS`] other errors, the run fails, because it would block its thread.
    async fn settle(&self, claimed: &Claimed, outcome: &Result<Made, NotMade>) {
        let mut pause = PAUSE.0;
        let mut refused = 0;
        while let Err(error) = self.store_outcome(claimed, outcome).await {
            let run = claimed.run;
            if matches!(error, Error::Damaged(_) | Error::Database(_)) {
                refused += 1;
            }
            let giving_up = matches!(error, Error::Closed) || self.order() == WorkerOrder::Abandon;
            let message = error.to_string();
            let error = &error as &dyn std::error::Error;
            if giving_up {
                tracing::error!(?run, error, "a run is not stored; the next start recovers it");
                return;
            }
            tracing::error!(?run, error, "cannot store the outcome of a run; trying again");
            if refused >= MAX_REFUSALS
                && self.store.fail(claimed, FailureKind::NotStored, &message).await.is_ok()
            {
                return;
            }
            let mut orders = self.orders.clone();
            let abandon = orders.wait_for(|order| *order == WorkerOrder::Abandon);
            let _ = tokio::time::timeout(pause, abandon).await;
            pause = PAUSE.1.min(pause * 2);
        }
    }

    async fn store_outcome(
        &self,
        claimed: &Claimed,
        outcome: &Result<Made, NotMade>,
    ) -> Result<()> {
        let accepted = match outcome {
            Ok(Made::Answer(answer, cost)) => {
                tracing::debug!("finished");
                self.store.finish(claimed, answer, *cost).await? != Finish::Refused
            }
            Ok(Made::Rows(rows, cost)) => self.store.finish_chunk(claimed, rows, *cost).await?,
            Err(NotMade::Failed(kind, message)) => {
                tracing::error!(%kind, message, "a run failed");
                self.store.fail(claimed, *kind, message).await?
            }
            Err(NotMade::Interrupted) => self.store.release(claimed).await?,
            Err(NotMade::Unwanted) => false,
        };
        if !accepted {
            // If the run is being canceled, this confirms it. Otherwise the worker has lost the run, and this
            // changes nothing.
            self.store.stopped(claimed).await?;
        }
        Ok(())
    }
}

/// The log span of a run: its key, and the request that submitted it.
fn span(claimed: &Claimed) -> tracing::Span {
    let Claimed { key, attempt, trace, .. } = claimed;
    let mut words = trace.as_deref().unwrap_or_default().split(' ');
    let (request, traceparent) = (words.next().unwrap_or_default(), words.next());
    tracing::info_span!("run", %key, attempt, request, traceparent)
}

/// The message of a panic.
pub fn message_of(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("a panic without a message")
        .to_owned()
}
