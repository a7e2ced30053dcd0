//! The store over years: idempotency, fairness, retention, eviction, damage, migrations.

use std::path::Path;
use std::time::Duration;

use fretwork_job::{Answer, Cost, Job, JobState, Origin};
use fretwork_store::{
    Actor, Answered, Changed, Claimed, Deleted, Error, Filter, NewJob, Options, Reach, Repeatable,
    Seen, Store, StoredResult, Submitted,
};
use serde_json::json;
use sqlx::{Connection as _, Executor as _};
use tempfile::TempDir;
use tokio::time::{sleep, timeout};

use crate::database::{Database, Engine, PATIENCE, open_with};
use crate::store::{accepted, answer, body, fresh, key, new_job, open, raw};

fn repeatable(number: u8, name: &str, sent: &str) -> NewJob {
    let fingerprint = sent.as_bytes().to_vec();
    let repeatable = Some(Repeatable { key: name.into(), fingerprint });
    NewJob { repeatable, ..new_job(number) }
}

async fn claim(store: &Store) -> Claimed {
    store.claim().await.unwrap().unwrap()
}

/// Stores a result for a key, and returns its job.
pub async fn compute(store: &Store, number: u8, bytes: usize) -> Job {
    let task = json!({"scenario": {"number": number, "exactly": 0.1}}).to_string();
    let job = accepted(store.submit(NewJob { task, ..new_job(number) }).await);
    let claimed = claim(store).await;
    let text = json!({"number": 0.1, "rest": noise(bytes)}).to_string();
    let answer = Answer { body: text.into(), summary: json!({}), outline: Box::default() };
    store.finish(&claimed, &Answered::new(&answer, None), Cost::default()).await.unwrap();
    job
}

/// Letters that Zstandard compresses to three quarters of their size.
fn noise(letters: usize) -> String {
    let letter = |i: usize| {
        let hash = (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        char::from(b'0' + ((hash ^ hash >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 58) as u8)
    };
    (0..letters).map(letter).map(|c| if c == '\\' { '~' } else { c }).collect()
}

/// Waits until something holds.
pub async fn eventually(mut holds: impl AsyncFnMut() -> bool) {
    let waiting = async {
        while !holds().await {
            sleep(Duration::from_millis(10)).await;
        }
    };
    timeout(PATIENCE, waiting).await.expect("the effect does not occur");
}

async fn is_evicted(store: &Store, number: u8) -> bool {
    matches!(store.result(&key(number)).await.unwrap(), Some(StoredResult::Evicted { .. }))
}

#[tokio::test]
async fn results_above_256_kib_are_not_returned_as_small_results() {
    const SMALL: usize = 1 << 18;
    let (_dir, store) = fresh().await;
    let around = json!({"number": 0.1, "rest": ""}).to_string().len();
    for (number, size) in [(1, SMALL), (2, SMALL + 1)] {
        compute(&store, number, size - around).await;
        let Some(StoredResult::Whole(body)) = store.result(&key(number)).await.unwrap() else {
            panic!("the result is stored");
        };
        assert_eq!(body.json().unwrap().len(), size);
        let found = store.small_result(&key(number)).await.unwrap();
        let small =
            if size > SMALL { StoredResult::Large(size) } else { StoredResult::Whole(body) };
        assert_eq!(found, Some(small));
    }
    assert!(store.small_result(&key(3)).await.unwrap().is_none());
}

on_both! {
    a_repeated_idempotency_key_gives_the_same_job,
    a_single_job_of_another_owner_is_claimed_next,
    the_order_of_claims_survives_a_restart_and_a_failed_transaction,
    a_full_queue_refuses_new_runs_and_reserves_a_tenth_for_other_owners,
    a_known_result_is_computed_again_on_request,
    a_job_records_its_state_changes_in_order,
    only_finished_jobs_can_be_deleted_and_their_results_stay,
    many_jobs_can_be_cancelled_with_a_filter,
}

async fn a_repeated_idempotency_key_gives_the_same_job(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let first = accepted(store.submit(repeatable(1, "a", "one")).await);
    let again = store.submit(repeatable(1, "a", "one")).await.unwrap();
    assert_eq!(again, Submitted::Repeated(first.clone()));
    assert_eq!(
        store.submit(repeatable(2, "a", "two")).await.unwrap(),
        Submitted::IdempotencyConflict
    );
    // Each owner has its own idempotency keys.
    let other = NewJob { owner: "bob".into(), ..repeatable(1, "a", "two") };
    assert_ne!(accepted(store.submit(other).await).id, first.id);
    let claimed = claim(&store).await;
    store.finish(&claimed, &answer("{}"), Cost::default()).await.unwrap();
    match store.submit(repeatable(1, "a", "one")).await.unwrap() {
        Submitted::Repeated(job) => {
            assert_eq!((job.id, job.state), (first.id, JobState::Succeeded));
        }
        other => panic!("{other:?}"),
    }
}

async fn a_single_job_of_another_owner_is_claimed_next(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    for number in 0..100 {
        accepted(store.submit(new_job(number)).await);
    }
    let single = NewJob { owner: "bob".into(), ..new_job(200) };
    accepted(store.submit(single).await);
    assert_eq!(claim(&store).await.key, key(0), "ada submitted first");
    assert_eq!(claim(&store).await.key, key(200));
    assert_eq!(claim(&store).await.key, key(1));
}

async fn the_order_of_claims_survives_a_restart_and_a_failed_transaction(on: Engine) {
    let (db, store) = Database::fresh(on).await;
    for (number, owner, priority) in [(1, "ada", 3), (2, "ada", 0), (3, "bob", 3), (4, "ada", 7)] {
        let new = NewJob { owner: owner.into(), priority, ..new_job(number) };
        accepted(store.submit(new).await);
    }
    store.close().await;
    let store = db.open().await;
    // A duplicate job id makes the transaction fail.
    let job = store.jobs(&Filter::default(), None, 1).await.unwrap().jobs.remove(0);
    let twice = store.submit(NewJob { id: job.id, ..new_job(9) }).await;
    assert!(matches!(twice, Err(Error::JobExists(_))), "{twice:?}");
    for number in [2, 3, 1, 4] {
        assert_eq!(claim(&store).await.key, key(number));
    }
    assert!(store.claim().await.unwrap().is_none());
}

async fn a_full_queue_refuses_new_runs_and_reserves_a_tenth_for_other_owners(on: Engine) {
    let db = Database::new(on);
    let options = Options { queue_limit: 10, ..Options::default() };
    let store = db.open_with(&options).await;
    compute(&store, 100, 0).await;
    for number in 0..9 {
        accepted(store.submit(new_job(number)).await);
    }
    let refused = Submitted::QueueFull { queued: 9 };
    assert_eq!(
        store.submit(new_job(9)).await.unwrap(),
        refused,
        "the last place is reserved for other owners"
    );
    let other = NewJob { owner: "bob".into(), ..new_job(10) };
    accepted(store.submit(other).await);
    let other = NewJob { owner: "eve".into(), ..new_job(11) };
    let refused = Submitted::QueueFull { queued: 10 };
    assert_eq!(store.submit(other.clone()).await.unwrap(), refused);
    // A known result and a running run need no place in the queue.
    assert_eq!(accepted(store.submit(new_job(100)).await).origin, Origin::Cached);
    let claimed = claim(&store).await;
    accepted(store.submit(other).await);
    let joins = NewJob { key: claimed.key, ..new_job(0) };
    assert_eq!(accepted(store.submit(joins).await).origin, Origin::Coalesced);
}

async fn a_known_result_is_computed_again_on_request(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    compute(&store, 1, 0).await;
    let again = accepted(store.submit(NewJob { afresh: true, ..new_job(1) }).await);
    assert_eq!((again.origin, again.state), (Origin::Computed, JobState::Queued));
    let joined = accepted(store.submit(NewJob { afresh: true, ..new_job(1) }).await);
    assert_eq!(joined.origin, Origin::Coalesced);
    // Other submissions still get the stored result.
    assert_eq!(accepted(store.submit(new_job(1)).await).origin, Origin::Cached);
    let claimed = claim(&store).await;
    let before = body(&store, 1).await;
    store.finish(&claimed, &answer("{}"), Cost::default()).await.unwrap();
    assert_eq!(body(&store, 1).await, before, "the stored result stays");
    let job = store.job(again.id).await.unwrap().unwrap();
    assert_eq!(job.state, JobState::Succeeded);
}

async fn a_job_records_its_state_changes_in_order(on: Engine) {
    use JobState::{Canceled, Canceling, Queued, Running};
    let (_db, store) = Database::fresh(on).await;
    let trace = Some("request traceparent".to_owned());
    let job = accepted(store.submit(NewJob { trace: trace.clone(), ..new_job(1) }).await);
    let claimed = claim(&store).await;
    assert_eq!(claimed.trace, trace);
    store.release(&claimed).await.unwrap();
    let claimed = claim(&store).await;
    store.cancel(job.id, Actor::default()).await.unwrap();
    store.stopped(&claimed).await.unwrap();
    let job = store.job(job.id).await.unwrap().unwrap();
    let changes: Vec<_> = job.changes.iter().map(|change| (change.state, change.attempt)).collect();
    let expected =
        [(Queued, 0), (Running, 1), (Queued, 1), (Running, 2), (Canceling, 2), (Canceled, 2)];
    assert_eq!(changes, expected);
    assert!(job.changes.windows(2).all(|pair| pair[0].at <= pair[1].at));
}

async fn only_finished_jobs_can_be_deleted_and_their_results_stay(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let job = accepted(store.submit(new_job(1)).await);
    assert!(matches!(
        store.delete(job.id, Actor::default()).await.unwrap(),
        Deleted::Unfinished(_)
    ));
    let shared = accepted(store.submit(new_job(1)).await);
    let claimed = claim(&store).await;
    store.finish(&claimed, &answer("{}"), Cost::default()).await.unwrap();
    for id in [job.id, shared.id] {
        assert_eq!(store.delete(id, Actor::default()).await.unwrap(), Deleted::Done);
        assert_eq!(store.delete(id, Actor::default()).await.unwrap(), Deleted::NotFound);
    }
    assert_eq!(body(&store, 1).await, b"{}");
}

async fn many_jobs_can_be_cancelled_with_a_filter(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    for number in 0..250 {
        let tags = vec![if number % 2 == 0 { "even" } else { "odd" }.to_owned()];
        accepted(store.submit(NewJob { tags, ..new_job(number) }).await);
    }
    let running = claim(&store).await;
    let even = Filter { tag: Some("even".into()), ..Filter::default() };
    assert_eq!(store.cancel_all(&even, &Actor::default()).await.unwrap(), 125);
    assert!(running.stop.is_raised());
    assert_eq!(store.cancel_all(&even, &Actor::default()).await.unwrap(), 0);
    store.stopped(&running).await.unwrap();
    let mut left = 0;
    while let Some(claimed) = store.claim().await.unwrap() {
        assert_eq!(claimed.key.bytes()[0] % 2, 1);
        left += 1;
    }
    assert_eq!(left, 125);
}

#[tokio::test]
async fn old_jobs_are_deleted_and_their_results_stay() {
    let (dir, store) = fresh().await;
    let waiting = accepted(store.submit(new_job(1)).await);
    let job = compute(&store, 1, 0).await;
    let later = accepted(store.submit(new_job(2)).await);
    assert_eq!(store.job(waiting.id).await.unwrap().unwrap().state, JobState::Succeeded);
    store.close().await;
    let options = Options { keep_jobs: Some(Duration::from_millis(50)), ..Options::default() };
    let store = open_with(dir.path(), &options).await;
    eventually(async || store.job(job.id).await.unwrap().is_none()).await;
    assert!(store.job(later.id).await.unwrap().is_some(), "it is still queued");
    assert!(store.has_result(&key(1)).await.unwrap());
    let runs: i64 = sqlx::query_scalar("SELECT count(*) FROM run")
        .fetch_one(&mut raw(dir.path()).await)
        .await
        .unwrap();
    assert_eq!(runs, 1, "a run is deleted with its last job");
}

#[tokio::test]
async fn the_least_recently_read_result_is_evicted_unless_it_is_pinned() {
    let dir = TempDir::new().unwrap();
    let options = Options { budget: Some(1_700_000), ..Options::default() };
    let store = Store::open(dir.path().into(), &options).await.unwrap();
    for number in 0..3 {
        compute(&store, number, 500_000).await;
        // Times of reading have a resolution of 1 ms.
        sleep(Duration::from_millis(5)).await;
    }
    let ada = || Reach { owner: "ada".into(), jobs: Seen::Shared };
    assert_eq!(store.pin(&key(0), true, ada()).await.unwrap(), Changed::Done);
    body(&store, 1).await;
    sleep(Duration::from_millis(5)).await;
    compute(&store, 3, 500_000).await;
    sleep(Duration::from_millis(5)).await;
    compute(&store, 4, 500_000).await;
    let store = &store;
    eventually(|| is_evicted(store, 2)).await;
    for kept in [0, 1, 3, 4] {
        assert!(!is_evicted(store, kept).await || kept == 1, "{kept}");
    }
    match store.result(&key(2)).await.unwrap() {
        Some(StoredResult::Evicted { at, asked, .. }) => {
            assert!(at > 0);
            assert_eq!(asked.unwrap().value, json!({"number": 2, "exactly": 0.1}));
        }
        other => panic!("{other:?}"),
    }
    let pinned = store.pin(&key(2), true, ada()).await.unwrap();
    assert_eq!(pinned, Changed::NotFound, "an evicted result cannot be pinned");
    // Computing it again stores it again.
    let job = compute(store, 2, 500_000).await;
    assert_eq!(job.origin, Origin::Computed);
    assert!(body(store, 2).await.len() > 500_000);
}

#[tokio::test]
async fn the_scenario_of_an_evicted_result_is_kept_for_a_year_and_as_long_as_it_has_jobs() {
    let (dir, store) = fresh().await;
    let mut jobs = Vec::new();
    for number in 1..=3 {
        jobs.push(compute(&store, number, 0).await);
    }
    let forget = "UPDATE result SET evicted = 1 WHERE substr(key, 1, 1) <> x'03'";
    raw(dir.path()).await.execute(forget).await.unwrap();
    for number in [1, 3] {
        store.delete(jobs[number - 1].id, Actor::default()).await.unwrap();
    }
    let store = &store;
    eventually(async || store.result(&key(1)).await.unwrap().is_none()).await;
    assert!(is_evicted(store, 2).await && store.has_result(&key(3)).await.unwrap());
}

/// Writes a database of the first version: a queued job, and a result.
pub async fn write_first_version(dir: &Path) {
    let mut db = raw(dir).await;
    let first = include_str!("../../migrations/sqlite/0001_jobs.sql");
    db.execute(first).await.unwrap();
    db.execute(
        "PRAGMA application_id = 0x66726574;
         INSERT INTO run (id, key, task, owner, state, created)
         VALUES (1, zeroblob(32), 'task 0', 'ada', 'queued', 5);
         INSERT INTO job VALUES (unhex('018bcfe568007000800000000000ff01'), 'ada', zeroblob(32), 1,
             'queued', 0, 'computed', NULL, '[]', '[]', 5, NULL, NULL);
         INSERT INTO result VALUES (randomblob(32), '{}',
             unhex('44136fa355b3678a1146ad16f7e8649e94fb4fc21fe77e8310c060f61caaff8a'), 2, 7);
         INSERT INTO result_blob SELECT key, CAST('{}' AS BLOB) FROM result;",
    )
    .await
    .unwrap();
    // sqlx records each migration with its checksum.
    let checksum: Vec<u8> = {
        use sha2::{Digest as _, Sha384};
        Sha384::digest(first).to_vec()
    };
    db.execute(
        "CREATE TABLE _sqlx_migrations (version BIGINT PRIMARY KEY, description TEXT NOT NULL,
             installed_on TIMESTAMP NOT NULL DEFAULT CURRENT_TIMESTAMP, success BOOLEAN NOT NULL,
             checksum BLOB NOT NULL, execution_time BIGINT NOT NULL)",
    )
    .await
    .unwrap();
    sqlx::query("INSERT INTO _sqlx_migrations VALUES (1, 'jobs', 0, TRUE, ?1, 0)")
        .bind(checksum)
        .execute(&mut db)
        .await
        .unwrap();
    db.close().await.unwrap();
}

#[tokio::test]
async fn a_database_of_the_first_version_is_migrated_with_its_contents() {
    let dir = TempDir::new().unwrap();
    write_first_version(dir.path()).await;
    let store = open(dir.path()).await;
    let job = store.jobs(&Filter::default(), None, 1).await.unwrap().jobs.remove(0);
    assert_eq!((job.state, job.priority, job.changes[0].at), (JobState::Queued, 3, 5));
    let claimed = claim(&store).await;
    store.finish(&claimed, &answer("{}"), Cost::default()).await.unwrap();
    let job = store.job(job.id).await.unwrap().unwrap();
    let states: Vec<_> = job.changes.iter().map(|change| change.state).collect();
    assert_eq!(states, [JobState::Queued, JobState::Running, JobState::Succeeded]);
}
