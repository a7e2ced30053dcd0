//! The worker pool: threads that claim runs, compute them step by step, and stop on request.
//!
//! A computation uses a whole processor for seconds, so it must not run on the threads that answer requests.
//! The threads read and change the tables only through the store.

mod assignment;
mod compute;
mod parking;

use std::any::Any;
use std::collections::VecDeque;
use std::future;
use std::io;
use std::mem;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use futures_util::future::join_all;
use parking_lot::Mutex;
use tokio::runtime::Handle;
use tokio::sync::{mpsc, watch};
use tracing::Instrument as _;

use super::WorkLimits;
use fretwork_job::{Cost, FailureKind, Key, Work};
use fretwork_store::{Claimed, Error, Finish, Owners, Result, RunId, Store};
use fretwork_study::Study;

use assignment::{Assignment, Made};
use parking::Parking;

/// A function that prepares the computation of a run from its key and its stored task.
pub type Compute = Arc<dyn Fn(&Key, &str) -> Result<Box<dyn Work>, String> + Send + Sync>;

/// An idle worker checks the queue at this interval even without a signal.
const POLL: Duration = Duration::from_secs(5);
/// The first and the longest pause between two attempts while the store fails. Each pause is twice as long as the
/// previous one.
const PAUSE: (Duration, Duration) = (Duration::from_millis(50), Duration::from_secs(5));
/// A run fails after the database has refused its result this often. A full disk, a busy database and a lost connection
/// do not count.
const MAX_REFUSALS: u32 = 8;
/// A thread claims several runs at once while they are short: as many as it computes in about this time.
const SHORT: Duration = Duration::from_millis(10);
/// Maximum number of runs that a thread claims at once.
const MAX_CLAIMS: usize = 32;
/// So many short runs in succession, without a pause, make a thread claim groups. Before, it claims single runs.
const ALONE: u32 = 4;
/// Maximum time that a drain waits for threads that must abandon their runs. A thread checks for this after each step,
/// which should take only 50 ms.
const MAX_ABANDON: Duration = Duration::from_secs(5);

/// The order to all threads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd)]
enum WorkerOrder {
    /// Claim runs and compute them.
    Work,
    /// Finish what was begun, and claim nothing.
    Finish,
    /// Release what was begun, and end.
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
    /// Starts `count` threads. A run that takes longer than its limit fails. Call this
    /// inside a tokio runtime, on which the store runs.
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
        let studies = Arc::default();
        let used = store.clone();
        let parking = Arc::new(Parking::new(move |owner| used.usage(owner)));
        let start = |number| {
            let mut worker = Worker {
                store: store.clone(),
                compute: Arc::clone(compute),
                limits,
                orders: orders.clone(),
                runtime: Handle::current(),
                studies: Arc::clone(&studies),
                parking: Arc::clone(&parking),
                busy: busy.clone(),
                count,
                batch: Mutex::default(),
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
    parking: Arc<Parking>,
    busy: watch::Sender<usize>,
    /// The number of threads.
    count: usize,
    batch: Mutex<Batch>,
    _living: mpsc::Sender<()>,
}

/// The runs that a thread has claimed together, except the one that it computes.
#[derive(Default)]
struct Batch {
    waiting: VecDeque<Assignment>,
    made: Vec<(Claimed, Outcome)>,
    /// When the thread must hand over these runs, because it takes too long.
    due: Option<Instant>,
}

type Outcome = Result<(Made, Cost), NotMade>;

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
        while let Some(first) = runtime.block_on(self.next()) {
            self.busy.send_modify(|count| *count += 1);
            // Batches of short runs without a pause between them.
            let (mut next, mut short) = (vec![first], 0);
            while !next.is_empty() {
                let (count, began) = (next.len(), Instant::now());
                let made = self.compute_all(next, began);
                let most = most_claims(short);
                short = match began.elapsed() {
                    took if took > SHORT => 0,
                    took if took < SHORT / 2 && count >= most => (short + 1).min(32),
                    _ => short,
                };
                next = runtime.block_on(self.settle_and_claim(&made, most_claims(short)));
            }
            self.busy.send_modify(|count| *count -= 1);
        }
    }

    /// Computes pieces one after the other. Returns the outcomes that are not stored yet.
    fn compute_all(&self, pieces: Vec<Assignment>, began: Instant) -> Vec<(Claimed, Outcome)> {
        let due = Some(began + SHORT);
        *self.batch.lock() = Batch { waiting: pieces.into(), made: Vec::new(), due };
        loop {
            let next = self.batch.lock().waiting.pop_front();
            let Some(mut piece) = next else { return mem::take(&mut self.batch.lock().made) };
            let outcome = loop {
                if let Some(outcome) = self.slice(&mut piece) {
                    break outcome;
                }
                piece = self.parking.next(piece, Instant::now(), |owners| self.claim_of(owners));
            };
            self.batch.lock().made.push((piece.claimed, outcome));
        }
    }

    /// Computes a piece for a slice. Returns `None` if it is not done.
    fn slice(&self, piece: &mut Assignment) -> Option<Outcome> {
        let _span = span(&piece.claimed).entered();
        let began = Instant::now();
        // This is unwind safe: after a panic, nothing of the piece that the closure has changed is used.
        let made = catch_unwind(AssertUnwindSafe(|| self.compute(piece))).unwrap_or_else(|panic| {
            Err(NotMade::Failed(FailureKind::Panicked, message_of(&*panic)))
        });
        // An assembly that waits is never begun, and uses nothing.
        if piece.begun.is_some() || !matches!(made, Ok(None)) {
            self.store.computed(&piece.claimed.owner, began.elapsed());
        }
        made.transpose()
    }

    /// Claims a piece of these owners, unless a thread without a piece does so. After an error of the store, it claims none.
    fn claim_of(&self, owners: Owners) -> Option<Claimed> {
        if self.order() != WorkerOrder::Work || *self.busy.borrow() < self.count {
            return None;
        }
        self.runtime.block_on(self.store.claim_up_to(1, owners)).ok()?.pop()
    }

    /// If the batch takes long, stores its finished runs and releases the waiting ones, so that other workers compute
    /// them.
    fn hand_over(&self) {
        let mut batch = self.batch.lock();
        if batch.due.is_none_or(|due| Instant::now() < due) {
            return;
        }
        batch.due = None;
        let (made, waiting) = (mem::take(&mut batch.made), mem::take(&mut batch.waiting));
        drop(batch);
        self.runtime.block_on(async {
            let (kept, ()) = tokio::join!(self.release_all(waiting.into()), self.settle_all(&made));
            if !kept.is_empty() {
                let mut batch = self.batch.lock();
                (batch.waiting, batch.due) = (kept.into(), Some(Instant::now() + PAUSE.0));
            }
        });
    }

    /// Gives pieces back. Returns those that the store did not accept.
    async fn release_all(&self, pieces: Vec<Assignment>) -> Vec<Assignment> {
        let mut kept = Vec::new();
        for piece in pieces {
            if self.store_outcome(&piece.claimed, &Err(NotMade::Interrupted)).await.is_err() {
                kept.push(piece);
            }
        }
        kept
    }

    /// Stores outcomes and claims the next runs at the same time. Returns no run if none was claimed.
    async fn settle_and_claim(&self, made: &[(Claimed, Outcome)], most: usize) -> Vec<Assignment> {
        if self.order() != WorkerOrder::Work {
            self.settle_all(made).await;
            return Vec::new();
        }
        let owners = self.parking.others(u64::MAX);
        let claiming = self.store.claim_up_to(most, owners);
        let (stored, next) = tokio::join!(self.store_all(made), claiming);
        // After an error, the caller calls `next`, which tries again and logs errors.
        let mut next = next.unwrap_or_default().into_iter().map(Assignment::from).collect();
        if stored.is_err() {
            // Gives the next runs back, because they must not wait until the store accepts these outcomes.
            next = self.release_all(next).await;
            self.settle_each(made).await;
        }
        next
    }

    async fn settle_all(&self, made: &[(Claimed, Outcome)]) {
        if self.store_all(made).await.is_err() {
            self.settle_each(made).await;
        }
    }

    /// Stores each outcome in a transaction of its own. One that the store refuses delays no other.
    async fn settle_each(&self, made: &[(Claimed, Outcome)]) {
        let each = made
            .iter()
            .map(|(claimed, outcome)| self.settle(claimed, outcome).instrument(span(claimed)));
        join_all(each).await;
    }

    /// Stores the outcomes of several runs: the results together, and the other ones one by one.
    async fn store_all(&self, made: &[(Claimed, Outcome)]) -> Result<()> {
        let (mut answers, mut others) = (Vec::new(), Vec::new());
        for (claimed, outcome) in made {
            match outcome {
                Ok((Made::Answer(answer), cost)) => answers.push((claimed, answer, *cost)),
                _ => others.push((claimed, outcome)),
            }
        }
        if !answers.is_empty() {
            let finished = self.store.finish_all(&answers).await?;
            for ((claimed, ..), finish) in answers.iter().zip(finished) {
                self.confirm(claimed, finish != Finish::Refused).await?;
            }
        }
        for (claimed, outcome) in others {
            self.store_outcome(claimed, outcome).instrument(span(claimed)).await?;
        }
        Ok(())
    }

    fn order(&self) -> WorkerOrder {
        *self.orders.borrow()
    }

    /// Takes a parked piece, or waits for one to claim. Returns `None` when the thread must end.
    async fn next(&mut self) -> Option<Assignment> {
        let mut queue = self.store.watch_queue();
        let mut pause = PAUSE.0;
        loop {
            if let Some(piece) = self.parking.take() {
                return Some(piece);
            }
            if self.order() != WorkerOrder::Work {
                return None;
            }
            let wait = match self.store.claim().await {
                Ok(Some(claimed)) => return Some(claimed.into()),
                Ok(None) | Err(Error::Closed) => {
                    pause = PAUSE.0;
                    POLL
                }
                Err(error) => {
                    tracing::error!(error = &error as &dyn std::error::Error, "cannot claim a run");
                    pause = PAUSE.1.min(pause * 2);
                    pause
                }
            };
            tokio::select! {
                () = queue.changed() => {}
                _ = self.orders.changed() => {}
                () = self.parking.parked.notified() => {}
                () = tokio::time::sleep(wait) => {}
            }
        }
    }

    /// Stores the outcome of a run. Tries again as long as the disk is full or the database is busy, because a result
    /// must not be lost. After [`MAX_REFUSALS`] other errors, the run fails, because it would block its thread.
    async fn settle(&self, claimed: &Claimed, outcome: &Outcome) {
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

    async fn store_outcome(&self, claimed: &Claimed, outcome: &Outcome) -> Result<()> {
        let accepted = match outcome {
            Ok((Made::Answer(answer), cost)) => {
                tracing::debug!("finished");
                self.store.finish(claimed, answer, *cost).await? != Finish::Refused
            }
            Ok((Made::Rows(rows), cost)) => self.store.finish_chunk(claimed, rows, *cost).await?,
            Err(NotMade::Failed(kind, message)) => {
                tracing::error!(%kind, message, "a run failed");
                self.store.fail(claimed, *kind, message).await?
            }
            Err(NotMade::Interrupted) => self.store.release(claimed).await?,
            Err(NotMade::Unwanted) => false,
        };
        self.confirm(claimed, accepted).await
    }

    /// Called after the store has accepted the outcome of a run or not.
    async fn confirm(&self, claimed: &Claimed, accepted: bool) -> Result<()> {
        if !accepted {
            // If the run is being canceled, this confirms it. Otherwise the worker has lost the run, and this
            // changes nothing.
            self.store.stopped(claimed).await?;
        }
        Ok(())
    }
}

/// The number of runs that a thread claims at once after `short` batches of short runs in succession.
fn most_claims(short: u32) -> usize {
    (1 << short.saturating_sub(ALONE)).min(MAX_CLAIMS)
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
