//! The worker pool: panics, cancellation, and shutdown.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use fretwork::service::WorkLimits;
use fretwork::service::workers::{Compute, Workers};
use fretwork_job::{Answer, FailureKind, Job, JobId, JobState, Key, Step, Work};
use fretwork_store::{Actor, Canceled, NewJob, Store};
use serde_json::json;
use sqlx::Executor;

use crate::database::PATIENCE;
use crate::store::{accepted, body, fresh, new_job, raw};

/// State that a test shares with its tasks: a gate that holds them back, and counters.
#[derive(Default)]
pub struct Stage {
    pub open: AtomicBool,
    pub begun: AtomicU32,
    dropped: AtomicU32,
}

struct Act {
    stage: Arc<Stage>,
    task: String,
}

impl Work for Act {
    fn step(&mut self) -> Step {
        let (body, summary) = (self.task.clone().into_bytes(), json!({}));
        match &*self.task {
            "panic" => panic!("no such spring: {}", 17),
            "gated" if !self.stage.open.load(Ordering::SeqCst) => {
                // A real step takes time too.
                std::thread::yield_now();
                Step::Working { progress: 0.5 }
            }
            _ => Step::Done(Answer { body: body.into(), summary, outline: Box::default() }),
        }
    }
}

impl Drop for Act {
    fn drop(&mut self) {
        self.stage.dropped.fetch_add(1, Ordering::SeqCst);
    }
}

pub fn compute(stage: &Arc<Stage>) -> Compute {
    let stage = Arc::clone(stage);
    Arc::new(move |_: &Key, task: &str| {
        stage.begun.fetch_add(1, Ordering::SeqCst);
        match task {
            "unreadable" => Err("no member `scenario`".to_owned()),
            _ => Ok(Box::new(Act { stage: Arc::clone(&stage), task: task.to_owned() })),
        }
    })
}

pub async fn submit(store: &Store, number: u8, task: &str) -> JobId {
    let job = NewJob { task: task.to_owned(), ..new_job(number) };
    accepted(store.submit(job).await).id
}

/// Waits until a job satisfies a condition.
async fn until(store: &Store, id: JobId, good: impl Fn(&Job) -> bool) -> Job {
    let found = async {
        let job = store.job(id).await.unwrap().unwrap();
        let mut changes = store.watch(&job.key);
        loop {
            let job = store.job(id).await.unwrap().unwrap();
            if good(&job) {
                return job;
            }
            changes.changed().await;
        }
    };
    tokio::time::timeout(PATIENCE, found).await.unwrap()
}

pub async fn state(store: &Store, id: JobId, state: JobState) -> Job {
    until(store, id, |job| job.state == state).await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_job_is_computed_once_and_its_result_is_stored() {
    let (_dir, store) = fresh().await;
    let stage = Arc::default();
    let workers = Workers::start(&store, 3, WorkLimits::default(), &compute(&stage)).unwrap();
    let mut jobs = Vec::new();
    for number in 0..100 {
        jobs.push(submit(&store, number, &format!("task {number}")).await);
    }
    for (number, id) in (0..100).zip(jobs) {
        let job = state(&store, id, JobState::Succeeded).await;
        assert_eq!(job.attempt, 1);
        let body = body(&store, number).await;
        assert_eq!(body, format!("task {number}").into_bytes());
    }
    workers.drain(PATIENCE).await;
    assert_eq!(stage.begun.load(Ordering::SeqCst), 100);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_panic_fails_only_its_own_run() {
    let (_dir, store) = fresh().await;
    let stage = Arc::default();
    let workers = Workers::start(&store, 1, WorkLimits::default(), &compute(&stage)).unwrap();
    let panics = submit(&store, 1, "panic").await;
    let unreadable = submit(&store, 2, "unreadable").await;
    let good = submit(&store, 3, "good").await;
    let failure = state(&store, panics, JobState::Failed).await.failure.unwrap();
    assert_eq!((failure.kind, &*failure.message), (FailureKind::Panicked, "no such spring: 17"));
    let failure = state(&store, unreadable, JobState::Failed).await.failure.unwrap();
    assert_eq!(failure.kind, FailureKind::UnreadableTask);
    assert_eq!(failure.message, "no member `scenario`");
    state(&store, good, JobState::Succeeded).await;
    workers.drain(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn cancelling_the_last_job_stops_the_run_and_frees_the_worker() {
    let (_dir, store) = fresh().await;
    let stage = Arc::default();
    let workers = Workers::start(&store, 1, WorkLimits::default(), &compute(&stage)).unwrap();
    let endless = submit(&store, 1, "gated").await;
    let shared = submit(&store, 1, "gated").await;
    state(&store, shared, JobState::Running).await;
    assert!(matches!(store.cancel(endless, Actor::default()).await.unwrap(), Canceled::Done(_)));
    assert_eq!(stage.dropped.load(Ordering::SeqCst), 0, "the other job still needs the run");
    assert!(matches!(store.cancel(shared, Actor::default()).await.unwrap(), Canceled::Done(_)));
    state(&store, shared, JobState::Canceled).await;
    assert_eq!(stage.dropped.load(Ordering::SeqCst), 1);
    let next = submit(&store, 2, "next").await;
    state(&store, next, JobState::Succeeded).await;
    workers.drain(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn progress_is_stored_during_the_computation() {
    let (_dir, store) = fresh().await;
    let stage: Arc<Stage> = Arc::default();
    let workers = Workers::start(&store, 1, WorkLimits::default(), &compute(&stage)).unwrap();
    let id = submit(&store, 1, "gated").await;
    let job = until(&store, id, |job| job.progress > 0.0).await;
    assert_eq!((job.state, job.progress.to_bits()), (JobState::Running, 0.5f64.to_bits()));
    stage.open.store(true, Ordering::SeqCst);
    state(&store, id, JobState::Succeeded).await;
    workers.drain(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_drain_without_a_grace_period_requeues_running_runs() {
    let (_dir, store) = fresh().await;
    let stage: Arc<Stage> = Arc::default();
    let workers = Workers::start(&store, 2, WorkLimits::default(), &compute(&stage)).unwrap();
    let first = submit(&store, 1, "gated").await;
    let second = submit(&store, 2, "gated").await;
    state(&store, first, JobState::Running).await;
    state(&store, second, JobState::Running).await;
    workers.drain(Duration::ZERO).await;
    for id in [first, second] {
        let job = store.job(id).await.unwrap().unwrap();
        assert_eq!((job.state, job.started), (JobState::Queued, None));
    }
    stage.open.store(true, Ordering::SeqCst);
    let workers = Workers::start(&store, 2, WorkLimits::default(), &compute(&stage)).unwrap();
    for id in [first, second] {
        assert_eq!(state(&store, id, JobState::Succeeded).await.attempt, 2);
    }
    workers.drain(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_drain_finishes_running_runs_and_claims_no_others() {
    let (_dir, store) = fresh().await;
    let stage: Arc<Stage> = Arc::default();
    let workers = Workers::start(&store, 1, WorkLimits::default(), &compute(&stage)).unwrap();
    let running = submit(&store, 1, "gated").await;
    state(&store, running, JobState::Running).await;
    let waiting = submit(&store, 2, "waiting").await;
    let open = async {
        stage.open.store(true, Ordering::SeqCst);
    };
    // `join!` polls the drain first, so it has begun when the gate opens.
    tokio::join!(workers.drain(PATIENCE), open);
    assert_eq!(store.job(running).await.unwrap().unwrap().state, JobState::Succeeded);
    assert_eq!(store.job(waiting).await.unwrap().unwrap().state, JobState::Queued);
}

/// Makes the database refuse every result, as a full disk would.
const REFUSE: &str =
    "CREATE TRIGGER refuse BEFORE INSERT ON result BEGIN SELECT RAISE(ABORT, 'refused'); END";

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_keeps_a_result_until_the_store_accepts_it() {
    let (dir, store) = fresh().await;
    let mut raw = raw(dir.path()).await;
    raw.execute(REFUSE).await.unwrap();
    let stage: Arc<Stage> = Arc::default();
    let workers = Workers::start(&store, 1, WorkLimits::default(), &compute(&stage)).unwrap();
    let refused = submit(&store, 1, "refused").await;
    state(&store, refused, JobState::Running).await;
    // The store still accepts other changes, even in the same batch as the refused result.
    let joined = submit(&store, 1, "refused").await;
    assert!(matches!(store.cancel(joined, Actor::default()).await.unwrap(), Canceled::Done(_)));
    raw.execute("DROP TRIGGER refuse").await.unwrap();
    assert_eq!(state(&store, refused, JobState::Succeeded).await.attempt, 1);
    assert_eq!(stage.begun.load(Ordering::SeqCst), 1, "the run was computed once");
    workers.drain(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_drain_ends_even_if_the_store_refuses_results() {
    let (dir, store) = fresh().await;
    let mut raw = raw(dir.path()).await;
    raw.execute(REFUSE).await.unwrap();
    let stage: Arc<Stage> = Arc::default();
    let workers = Workers::start(&store, 1, WorkLimits::default(), &compute(&stage)).unwrap();
    let id = submit(&store, 1, "gated").await;
    state(&store, id, JobState::Running).await;
    stage.open.store(true, Ordering::SeqCst);
    let failing = submit(&store, 2, "panic").await;
    workers.drain(Duration::ZERO).await;
    let left = store.job(id).await.unwrap().unwrap().state;
    let recovered = store.recover().await.unwrap();
    // Without grace, the run was interrupted during the computation or before its result was stored.
    match left {
        JobState::Queued => assert_eq!(recovered.requeued, 0),
        JobState::Running => assert_eq!(recovered.requeued, 1),
        other => panic!("{other}"),
    }
    raw.execute("DROP TRIGGER refuse").await.unwrap();
    let workers = Workers::start(&store, 1, WorkLimits::default(), &compute(&stage)).unwrap();
    assert_eq!(state(&store, id, JobState::Succeeded).await.attempt, 2);
    state(&store, failing, JobState::Failed).await;
    workers.drain(PATIENCE).await;
}

async fn submit_of(store: &Store, owner: &str, number: u8, task: &str) -> JobId {
    let job = NewJob { task: task.to_owned(), owner: owner.to_owned(), ..new_job(number) };
    accepted(store.submit(job).await).id
}

/// Waits until the computation of this many runs has begun.
async fn begun(stage: &Stage, count: u32) {
    let begun = async {
        while stage.begun.load(Ordering::SeqCst) < count {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    tokio::time::timeout(PATIENCE, begun).await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_long_run_makes_way_for_the_runs_of_others_and_goes_on_afterwards() {
    let (_dir, store) = fresh().await;
    let stage: Arc<Stage> = Arc::default();
    let workers = Workers::start(&store, 1, WorkLimits::default(), &compute(&stage)).unwrap();
    let long = submit(&store, 1, "gated").await;
    state(&store, long, JobState::Running).await;
    // The only worker computes for ada until the gate opens, but bob need not wait for that.
    for number in 2..5 {
        let short = submit_of(&store, "bob", number, "short").await;
        state(&store, short, JobState::Succeeded).await;
    }
    assert_eq!(store.job(long).await.unwrap().unwrap().state, JobState::Running);
    stage.open.store(true, Ordering::SeqCst);
    assert_eq!(state(&store, long, JobState::Succeeded).await.attempt, 1);
    assert_eq!(stage.begun.load(Ordering::SeqCst), 4, "no run was begun twice");
    workers.drain(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_long_runs_of_different_owners_share_one_worker() {
    let (_dir, store) = fresh().await;
    let stage: Arc<Stage> = Arc::default();
    let workers = Workers::start(&store, 1, WorkLimits::default(), &compute(&stage)).unwrap();
    let first = submit(&store, 1, "gated").await;
    begun(&stage, 1).await;
    let second = submit_of(&store, "bob", 2, "gated").await;
    let others = [submit(&store, 3, "gated").await, submit_of(&store, "bob", 4, "gated").await];
    for id in [first, second] {
        until(&store, id, |job| job.progress > 0.0).await;
    }
    for id in others {
        let job = store.job(id).await.unwrap().unwrap();
        assert_eq!(job.state, JobState::Queued, "an owner does not make way for itself");
    }
    stage.open.store(true, Ordering::SeqCst);
    for id in [first, second].into_iter().chain(others) {
        assert_eq!(state(&store, id, JobState::Succeeded).await.attempt, 1);
    }
    workers.drain(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn parked_runs_can_be_canceled_and_go_back_to_the_queue_at_the_end() {
    let (_dir, store) = fresh().await;
    let stage: Arc<Stage> = Arc::default();
    let workers = Workers::start(&store, 1, WorkLimits::default(), &compute(&stage)).unwrap();
    let mut runs = Vec::new();
    for (number, owner) in (1..).zip(["ada", "bob", "eve"]) {
        runs.push(submit_of(&store, owner, number, "gated").await);
        begun(&stage, number.into()).await;
    }
    assert!(matches!(store.cancel(runs[0], Actor::default()).await.unwrap(), Canceled::Done(_)));
    state(&store, runs[0], JobState::Canceled).await;
    assert_eq!(stage.dropped.load(Ordering::SeqCst), 1);
    workers.drain(Duration::ZERO).await;
    for id in &runs[1..] {
        let job = store.job(*id).await.unwrap().unwrap();
        assert_eq!((job.state, job.started), (JobState::Queued, None));
    }
    assert_eq!(stage.dropped.load(Ordering::SeqCst), 3);
}
