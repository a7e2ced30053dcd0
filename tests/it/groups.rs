//! Short runs that a worker claims and finishes together, in PostgreSQL.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use fretwork::service::WorkLimits;
use fretwork::service::workers::Workers;
use fretwork_job::{Cost, FailureKind, Job, JobId, JobState};
use fretwork_store::{Claimed, Finish, NewJob, Owners, Store};
use tokio::time::sleep;

use crate::database::{Database, Engine, PATIENCE};
use crate::keeping::eventually;
use crate::store::{accepted, answer, body, cancel, claim, job, new_job};
use crate::worker::{Stage, compute, state, submit};

const TOGETHER: usize = 8;

async fn submit_as(store: &Store, owner: &str, priority: u8, number: u8) -> Job {
    let new = NewJob { owner: owner.into(), priority, ..new_job(number) };
    accepted(store.submit(new).await)
}

async fn claims(store: &Store) -> Vec<Claimed> {
    store.claim_up_to(TOGETHER, Owners::ALL).await.unwrap()
}

/// The numbers of the jobs whose runs are claimed.
fn numbers(claims: &[Claimed]) -> Vec<u8> {
    claims.iter().map(|claimed| claimed.key.bytes()[0]).collect()
}

async fn finish_all(store: &Store, claims: &[Claimed]) -> Vec<Finish> {
    let answer = answer("group");
    let all: Vec<_> = claims.iter().map(|claimed| (claimed, &answer, Cost::ZERO)).collect();
    store.finish_all(&all).await.unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_group_begins_with_urgent_runs_and_is_shared_by_the_owners() {
    let (db, store) = Database::fresh(Engine::Postgres).await;
    for number in 0..20 {
        submit_as(&store, "ada", 3, number).await;
    }
    submit_as(&store, "ada", 0, 20).await;
    // Two jobs share one run.
    for number in [21, 21, 22, 23] {
        submit_as(&store, "bob", 3, number).await;
    }
    let first = claims(&store).await;
    let (of_ada, of_bob): (Vec<_>, Vec<_>) = numbers(&first).into_iter().partition(|n| *n <= 20);
    assert_eq!(of_ada[0], 20, "the urgent run comes first");
    assert_eq!((&of_ada[1..], &*of_bob), (&[0, 1, 2, 3][..], &[21, 22, 23][..]));
    // A new owner with one run does not wait for all runs of the other one.
    submit_as(&store, "eve", 3, 24).await;
    let second = numbers(&claims(&store).await);
    assert_eq!((second.len(), second.contains(&24)), (TOGETHER, true), "{second:?}");
    let finished = finish_all(&store, &first).await;
    assert!(finished.iter().all(|finish| *finish == Finish::Stored));
    let state = "SELECT count(*) FROM job WHERE state = 'succeeded' AND claimable IS NULL";
    assert_eq!(db.count(state).await, 9);
    assert_eq!(db.count("SELECT count(*) FROM lease").await, 8);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn runs_that_another_worker_is_claiming_hide_no_less_urgent_ones() {
    let (db, store) = Database::fresh(Engine::Postgres).await;
    submit_as(&store, "ada", 0, 1).await;
    submit_as(&store, "ada", 3, 2).await;
    let mut other = db.raw().await;
    other.execute("BEGIN; UPDATE run SET lost = 0 WHERE id = 1").await;
    assert_eq!(numbers(&claims(&store).await), [2]);
    other.execute("ROLLBACK").await;
    assert_eq!(numbers(&claims(&store).await), [1]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_runs_of_a_lost_group_are_claimed_one_by_one() {
    let (db, dying) = Database::fresh(Engine::Postgres).await;
    let other = db.open().await;
    for number in 0..4 {
        submit_as(&dying, "ada", 3, number).await;
    }
    assert_eq!(claims(&dying).await.len(), 4);
    for number in 4..6 {
        submit_as(&other, "ada", 3, number).await;
    }
    dying.close().await;
    db.execute("UPDATE lease SET expires = 0").await;
    // The background task of the store may be first.
    other.recover().await.unwrap();
    let queued = "SELECT count(*) FROM job WHERE state = 'queued'";
    eventually(async || db.count(queued).await == 6).await;
    // One of them may have killed the worker. It must not kill the next worker together with the others.
    for number in 0..4 {
        let group = claims(&other).await;
        assert_eq!((numbers(&group), group[0].attempt), (vec![number], 2));
        let beside: &[u8] = if number == 0 { &[4, 5] } else { &[] };
        assert_eq!(numbers(&claims(&other).await), beside);
        assert_eq!(finish_all(&other, &group).await, [Finish::Stored]);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn exactly_the_lost_and_canceled_runs_of_a_group_are_refused() {
    let (db, frozen) = Database::fresh(Engine::Postgres).await;
    let other = db.open().await;
    let mut jobs = Vec::new();
    for number in 0..6 {
        jobs.push(submit_as(&frozen, "ada", 3, number).await.id);
    }
    let group = claims(&frozen).await;
    assert_eq!(numbers(&group), [0, 1, 2, 3, 4, 5]);
    cancel(&other, jobs[1]).await;
    let lost = "UPDATE lease SET expires = 0 WHERE run > (SELECT min(id) + 2 FROM run)";
    db.execute(lost).await;
    eventually(async || {
        other.recover().await.unwrap();
        job(&other, jobs[5]).await.state == JobState::Queued
    })
    .await;
    let first = claim(&other).await;
    other.finish(&first, &answer("first"), Cost::ZERO).await.unwrap();
    let again = [first, claim(&other).await];
    assert_eq!(numbers(&again), [3, 4]);

    let finished = finish_all(&frozen, &group).await;
    let [stored, refused] = [Finish::Stored, Finish::Refused];
    assert_eq!(finished, [stored, refused, stored, refused, refused, refused]);
    assert!(frozen.stopped(&group[1]).await.unwrap());
    assert_eq!(body(&other, 3).await, b"first");
    let expected = [
        JobState::Succeeded,
        JobState::Canceled,
        JobState::Succeeded,
        JobState::Succeeded,
        JobState::Running,
        JobState::Queued,
    ];
    for (id, expected) in jobs.into_iter().zip(expected) {
        assert_eq!(job(&other, id).await.state, expected);
    }
    assert_eq!(finish_all(&other, &again[1..]).await, [Finish::Stored]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_that_remembers_places_finds_released_runs_and_new_owners_later() {
    /// The search for owners takes at least this long.
    const LOCKED: Duration = Duration::from_millis(500);
    let (db, store) = Database::fresh(Engine::Postgres).await;
    db.execute(
        "ALTER TABLE lease SET (autovacuum_enabled = false); BEGIN; INSERT INTO lease (run, number, attempt, node, owner, expires)
         SELECT -number, -1, 1, '', '', 0 FROM generate_series(1, 20000) AS number; ROLLBACK",
    )
    .await;
    let dead = "SELECT pg_stat_get_dead_tuples('lease'::REGCLASS)";
    eventually(async || db.count(dead).await == 20_000).await;
    store.longest_wait().await.unwrap();
    for number in 0..3 {
        submit_as(&store, "ada", 3, number).await;
    }
    // The search for owners takes long. So the next search follows after 4 or 20 times as long.
    let begun = Instant::now();
    let mut slow = db.raw().await;
    slow.execute("BEGIN; LOCK TABLE job IN ACCESS EXCLUSIVE MODE").await;
    let blocked = "SELECT count(*) FROM pg_stat_activity
        WHERE datname = current_database() AND wait_event_type = 'Lock' AND query LIKE '%RECURSIVE%'";
    let unlock = async {
        eventually(async || db.count(blocked).await == 1).await;
        sleep(LOCKED).await;
        slow.execute("COMMIT").await;
    };
    let (first, ()) = tokio::join!(store.claim_up_to(2, Owners::ALL), unlock);
    let first = first.unwrap();
    submit_as(&store, "bob", 0, 3).await;
    assert!(store.release(&first[0]).await.unwrap());
    submit_as(&store, "ada", 0, 4).await;
    assert_eq!(numbers(&claims(&store).await), [4, 2]);
    let mut rest = numbers(&claims(&store).await);
    // On a slow machine, the time has already passed.
    assert!(rest.is_empty() || begun.elapsed() > 4 * LOCKED);
    eventually(async || {
        rest.extend(numbers(&claims(&store).await));
        rest.len() == 2
    })
    .await;
    rest.sort_unstable();
    assert_eq!(rest, [0, 3]);
}

/// Jobs of short runs, one of which is `special`.
async fn submit_group(store: &Store, special: &[(u8, &str)]) -> Vec<JobId> {
    let mut jobs = Vec::new();
    for number in 0..140 {
        let task = special.iter().find(|(other, _)| *other == number).map_or("short", |(_, t)| t);
        jobs.push(submit(store, number, task).await);
    }
    jobs
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_run_that_fails_does_not_affect_the_others_of_its_group() {
    // On a slow machine, a worker may claim all runs one by one, which proves nothing.
    for _ in 0..20 {
        if failing_runs_affect_no_others().await {
            return;
        }
    }
    panic!("no group");
}

/// Whether the worker has stored several runs together.
async fn failing_runs_affect_no_others() -> bool {
    let (db, store) = Database::fresh(Engine::Postgres).await;
    let special = [(60, "panic"), (61, "unreadable"), (110, "panic")];
    let jobs = submit_group(&store, &special).await;
    let stage: Arc<Stage> = Arc::default();
    let workers = Workers::start(&store, 1, WorkLimits::default(), &compute(&stage)).unwrap();
    for (number, id) in (0..).zip(jobs) {
        if let Some((_, task)) = special.iter().find(|(other, _)| *other == number) {
            let kind = state(&store, id, JobState::Failed).await.failure.unwrap().kind;
            assert_eq!(kind == FailureKind::Panicked, *task == "panic");
        } else {
            state(&store, id, JobState::Succeeded).await;
            assert_eq!(body(&store, number).await, b"short");
        }
    }
    workers.drain(PATIENCE).await;
    assert_eq!(stage.begun.load(Ordering::SeqCst), 140, "each run was computed once");
    // All runs of a transaction have the same time.
    db.count("SELECT count(DISTINCT finished) FROM run").await < 130
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_long_run_of_a_group_keeps_neither_results_nor_waiting_runs() {
    let (db, store) = Database::fresh(Engine::Postgres).await;
    let jobs = submit_group(&store, &[(110, "gated")]).await;
    let stage: Arc<Stage> = Arc::default();
    let start = || Workers::start(&store, 1, WorkLimits::default(), &compute(&stage)).unwrap();
    let first = start();
    let ended = async |count: i64| {
        let ended = "SELECT count(*) FROM job WHERE state = 'succeeded'";
        eventually(async || db.count(ended).await == count).await;
    };
    ended(110).await;
    eventually(async || db.count("SELECT count(*) FROM lease").await == 1).await;
    let second = start();
    ended(139).await;
    assert_eq!(job(&store, jobs[110]).await.state, JobState::Running);
    stage.open.store(true, Ordering::SeqCst);
    state(&store, jobs[110], JobState::Succeeded).await;
    assert_eq!(stage.begun.load(Ordering::SeqCst), 140, "each run was computed once");
    first.drain(PATIENCE).await;
    second.drain(PATIENCE).await;
}

/// A worker that computes the run 110 of a group and cannot give back the waiting ones. `None` if the group has no more
/// runs, because the machine was slow.
async fn stuck_group(stage: &Arc<Stage>) -> Option<(Database, Store, Workers, Vec<JobId>)> {
    let (db, store) = Database::fresh(Engine::Postgres).await;
    let jobs = submit_group(&store, &[(110, "gated")]).await;
    db.execute("ALTER TABLE run ADD CONSTRAINT busy CHECK (state <> 'queued' OR attempt = 0)")
        .await;
    let workers = Workers::start(&store, 1, WorkLimits::default(), &compute(stage)).unwrap();
    state(&store, jobs[110], JobState::Running).await;
    let is_waiting = job(&store, jobs[111]).await.state == JobState::Running;
    is_waiting.then_some((db, store, workers, jobs))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_drain_gives_back_the_waiting_runs_of_a_group() {
    let stage: Arc<Stage> = Arc::default();
    let mut stuck = None;
    for _ in 0..20 {
        stuck = stuck_group(&stage).await;
        if stuck.is_some() {
            break;
        }
    }
    let (db, store, workers, jobs) = stuck.expect("a group");
    // The worker also tells that it does not compute a canceled run that waits.
    cancel(&store, jobs[111]).await;
    state(&store, jobs[111], JobState::Canceled).await;
    assert_eq!(job(&store, jobs[112]).await.state, JobState::Running);
    db.execute("ALTER TABLE run DROP CONSTRAINT busy").await;
    workers.drain(Duration::ZERO).await;
    let left = "SELECT count(*) FROM run WHERE state = 'queued' AND lost = 0 AND attempt = 1";
    assert!(db.count(left).await > 1);
    assert_eq!(db.count("SELECT count(*) FROM lease").await, 0);
}
