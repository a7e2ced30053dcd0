//! The store: coalescing, fencing, cancellation, recovery, lists, and files that it refuses to open.

use std::collections::{HashMap, HashSet};
use std::env;
use std::fs::{self, File};
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::time::Duration;

use fretwork_job::{Answer, Cost, FailureKind, Job, JobId, JobState, Key, Origin};
use fretwork_store::{
    Actor, Administration, Admission, Answered, Canceled, Claimed, Deleted, Error, Filter, Finish,
    NewJob, Options, Owners, Piece, Reach, Recovered, RunId, Seen, Store, StoredResult, Submitted,
};
use proptest::prelude::*;
use proptest::sample::{Index, subsequence};
use proptest::test_runner::RngSeed;
use serde_json::json;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection, Executor, SqliteConnection};
use tempfile::TempDir;
use tokio::task::JoinSet;

use crate::database::{Database, Engine, Raw, open_with};

pub fn key(number: u8) -> Key {
    Key::from_bytes([number; 32])
}

pub fn new_job(number: u8) -> NewJob {
    NewJob {
        id: JobId::generate(),
        owner: "ada".into(),
        key: key(number),
        task: format!("task {number}"),
        chunks: None,
        stages: String::new(),
        submitted: None,
        priority: 3,
        label: None,
        tags: vec![],
        private: false,
        warnings: vec![],
        submission_warnings: vec![],
        repeatable: None,
        afresh: false,
        admission: Admission::default(),
        trace: None,
    }
}

/// The job that a submission became.
pub fn accepted(submitted: Result<Submitted, Error>) -> Job {
    match submitted {
        Ok(Submitted::Accepted(job)) => job,
        other => panic!("{other:?}"),
    }
}

pub async fn open(dir: &Path) -> Store {
    open_with(dir, &Options::default()).await
}

pub async fn fresh() -> (TempDir, Store) {
    let dir = TempDir::new().unwrap();
    let store = open(dir.path()).await;
    (dir, store)
}

/// The body of a stored result.
pub async fn body(store: &Store, number: u8) -> Vec<u8> {
    match store.result(&key(number)).await.unwrap() {
        Some(StoredResult::Whole(body)) => body.json().unwrap().to_vec(),
        other => panic!("{other:?}"),
    }
}

/// Copies the database as a crash would leave it now.
pub fn crash(dir: &Path) -> TempDir {
    let copy = TempDir::new().unwrap();
    for file in ["fretwork.db", "fretwork.db-wal"] {
        if dir.join(file).exists() {
            fs::copy(dir.join(file), copy.path().join(file)).unwrap();
        }
    }
    copy
}

pub async fn raw(dir: &Path) -> SqliteConnection {
    let options = SqliteConnectOptions::new().filename(dir.join("fretwork.db"));
    SqliteConnection::connect_with(&options.create_if_missing(true)).await.unwrap()
}

pub fn answer(text: &str) -> Answered {
    answer_for(text, None)
}

fn answer_for(text: &str, cost: Option<Cost>) -> Answered {
    let summary = json!({ "regime": text });
    let answer = Answer { body: text.to_owned().into(), summary, outline: Box::default() };
    Answered::new(&answer, cost)
}

pub async fn job(store: &Store, id: JobId) -> Job {
    store.job(id).await.unwrap().unwrap()
}

async fn state(store: &Store, id: JobId) -> JobState {
    job(store, id).await.state
}

pub async fn claim(store: &Store) -> Claimed {
    store.claim().await.unwrap().unwrap()
}

pub async fn cancel(store: &Store, id: JobId) -> JobState {
    match store.cancel(id, Actor::default()).await.unwrap() {
        Canceled::Done(job) => job.state,
        other => panic!("{other:?}"),
    }
}

on_both! {
    sixty_four_equal_submissions_share_one_run,
    a_known_result_finishes_a_job_without_a_run,
    a_submission_returns_the_job_as_stored,
    a_duplicate_job_id_is_refused_without_affecting_other_jobs,
    updates_of_a_worker_from_before_a_crash_are_refused,
    a_different_result_of_the_same_key_does_not_replace_the_first,
    a_cancelled_job_keeps_a_shared_run_alive,
    cancelling_the_last_job_cancels_a_queued_run,
    a_submission_does_not_join_a_run_that_is_being_cancelled,
    cancelling_a_finished_or_unknown_job_is_reported,
    every_unfinished_state_is_recovered_after_a_crash,
    a_run_fails_after_three_crashes_of_the_server,
    after_a_crash_a_run_waits_and_then_no_other_suspect_runs_beside_it,
    runs_are_claimed_in_order_of_submission,
    pages_have_no_gap_and_no_duplicate_while_jobs_arrive,
    jobs_can_be_filtered_by_any_combination_of_fields,
    a_wait_ends_when_the_job_ends_or_at_the_deadline,
    the_live_job_of_a_key_is_the_oldest_unfinished_one,
    changes_requested_before_closing_are_committed,
    a_refused_recomputation_is_not_answered_from_the_cache,
    an_answer_that_is_recorded_during_a_run_is_stored_and_the_run_finds_it_equal,
    equal_jobs_that_are_recorded_together_end_like_the_first,
}

async fn sixty_four_equal_submissions_share_one_run(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let mut submissions = JoinSet::new();
    for _ in 0..64 {
        let store = store.clone();
        submissions.spawn(async move { accepted(store.submit(new_job(1)).await) });
    }
    let jobs = submissions.join_all().await;
    let computed = jobs.iter().filter(|job| job.origin == Origin::Computed).count();
    let coalesced = jobs.iter().filter(|job| job.origin == Origin::Coalesced).count();
    assert_eq!((computed, coalesced), (1, 63));

    let claimed = claim(&store).await;
    assert!(store.claim().await.unwrap().is_none(), "there is one run");
    let whole = Piece::Whole { task: "task 1".into() };
    assert_eq!((claimed.attempt, claimed.key, &claimed.piece), (1, key(1), &whole));
    let done = store.finish(&claimed, &answer("a"), Cost::default()).await.unwrap();
    assert_eq!(done, Finish::Stored);
    for submitted in jobs {
        let job = job(&store, submitted.id).await;
        assert_eq!(job.state, JobState::Succeeded);
        assert_eq!(job.summary, Some(json!({ "regime": "a" })));
        assert_eq!((job.attempt, job.progress.to_bits()), (1, 1f64.to_bits()));
        assert_eq!(job.created, submitted.created);
        assert!(job.started >= Some(job.created) && job.finished >= job.started);
    }
    assert_eq!(body(&store, 1).await, b"a");
    assert_eq!(store.live_job(&key(1), &Reach::default()).await.unwrap(), None);
}

async fn a_known_result_finishes_a_job_without_a_run(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    accepted(store.submit(new_job(1)).await);
    assert!(!store.has_result(&key(1)).await.unwrap());
    let claimed = claim(&store).await;
    store.finish(&claimed, &answer("a"), Cost::default()).await.unwrap();
    assert!(store.has_result(&key(1)).await.unwrap());

    let cached = accepted(store.submit(new_job(1)).await);
    assert_eq!((cached.state, cached.origin), (JobState::Succeeded, Origin::Cached));
    assert_eq!((cached.attempt, cached.summary.clone()), (0, Some(json!({ "regime": "a" }))));
    assert_eq!(job(&store, cached.id).await, cached, "the answer equals what is stored");
    assert!(store.claim().await.unwrap().is_none());
}

async fn a_submission_returns_the_job_as_stored(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let new = NewJob {
        label: Some("ball on flat".into()),
        tags: vec!["µ = 0.7".into(), "b\"c".into()],
        ..new_job(1)
    };
    let queued = accepted(store.submit(new).await);
    assert_eq!(job(&store, queued.id).await, queued);
    let claimed = claim(&store).await;
    assert!(store.progress(&claimed, 0.25).await.unwrap());
    let joined = accepted(store.submit(new_job(1)).await);
    assert_eq!(joined.progress.to_bits(), 0.25f64.to_bits());
    assert_eq!((joined.state, joined.attempt), (JobState::Running, 1));
    assert_eq!(job(&store, joined.id).await, joined);
}

async fn a_duplicate_job_id_is_refused_without_affecting_other_jobs(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let twice = new_job(1);
    let mut submissions = JoinSet::new();
    for number in 0..8 {
        let job = if number < 2 { twice.clone() } else { new_job(number) };
        let store = store.clone();
        submissions.spawn(async move { store.submit(job).await });
    }
    let answers = submissions.join_all().await;
    let (good, bad): (Vec<_>, Vec<_>) = answers.into_iter().partition(Result::is_ok);
    assert_eq!(good.len(), 7);
    assert!(matches!(bad[..], [Err(Error::JobExists(id))] if id == twice.id));
    for submitted in good {
        assert_eq!(state(&store, accepted(submitted).id).await, JobState::Queued);
    }
}

async fn updates_of_a_worker_from_before_a_crash_are_refused(on: Engine) {
    let (db, store) = Database::fresh(on).await;
    let submitted = accepted(store.submit(new_job(1)).await);
    let zombie = claim(&store).await;
    let (_db, store) = db.after_a_crash().await;
    assert_eq!(store.recover().await.unwrap(), Recovered { requeued: 1, ..Recovered::default() });

    let changes_nothing = async |expected: &Job| {
        let finished = store.finish(&zombie, &answer("zombie"), Cost::default()).await.unwrap();
        assert_eq!(finished, Finish::Refused);
        assert!(!store.fail(&zombie, FailureKind::Panicked, "zombie").await.unwrap());
        assert!(!store.progress(&zombie, 0.9).await.unwrap());
        assert!(!store.release(&zombie).await.unwrap());
        assert!(!store.stopped(&zombie).await.unwrap());
        assert_eq!(&job(&store, submitted.id).await, expected);
        assert!(!store.has_result(&key(1)).await.unwrap());
    };
    let waiting = job(&store, submitted.id).await;
    assert_eq!((waiting.state, waiting.started), (JobState::Queued, None));
    changes_nothing(&waiting).await;
    let second = claim(&store).await;
    assert_eq!((second.run, second.attempt), (zombie.run, 2));
    let running = job(&store, submitted.id).await;
    assert_eq!((running.state, running.attempt), (JobState::Running, 2));
    changes_nothing(&running).await;
    assert_eq!(store.finish(&second, &answer("a"), Cost::default()).await.unwrap(), Finish::Stored);
}

async fn a_different_result_of_the_same_key_does_not_replace_the_first(on: Engine) {
    let (db, store) = Database::fresh(on).await;
    for (text, expected) in [("b", Finish::Differs), ("a", Finish::Same)] {
        accepted(store.submit(new_job(1)).await);
        let claimed = claim(&store).await;
        let mut raw = db.raw().await;
        // Another process stores a result during the run, for example an import.
        let sum = xxhash_rust::xxh3::xxh3_64(b"a").cast_signed();
        raw.execute(&match on {
            Engine::Sqlite => {
                "INSERT INTO result (key, summary, digest, size, created)
                 VALUES (unhex(replace(printf('%32s', ''), ' ', '01')), '{}',
                     unhex('ca978112ca1bbdcafac231b39a23dc4da786eff8147c4e72b9807785afee48bb'), 1, 0);
                 INSERT INTO result_blob SELECT key, CAST('a' AS BLOB) FROM result".to_owned()
            }
            Engine::Postgres => {
                format!("INSERT INTO result (key, summary, digest, size, stored, created, last_access, checksum)
                 VALUES (decode(repeat('01', 32), 'hex'), '{{}}',
                     decode('ca978112ca1bbdcafac231b39a23dc4da786eff8147c4e72b9807785afee48bb', 'hex'),
                     1, 1, 0, 0, {sum});
                 INSERT INTO result_blob SELECT key, 'a'::BYTEA FROM result")
            }
        })
        .await;
        let finish = store.finish(&claimed, &answer(text), Cost::default()).await.unwrap();
        assert_eq!(finish, expected);
        assert_eq!(body(&store, 1).await, b"a");
        raw.execute("DELETE FROM result").await;
    }
}

async fn a_cancelled_job_keeps_a_shared_run_alive(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let first = accepted(store.submit(new_job(1)).await);
    let second = accepted(store.submit(new_job(1)).await);
    assert_eq!(cancel(&store, first.id).await, JobState::Canceled);
    let claimed = claim(&store).await;
    let third = accepted(store.submit(new_job(1)).await);
    assert_eq!(cancel(&store, second.id).await, JobState::Canceled);
    assert!(!claimed.stop.is_raised());
    store.finish(&claimed, &answer("a"), Cost::default()).await.unwrap();
    assert_eq!(state(&store, third.id).await, JobState::Succeeded);
    for id in [first.id, second.id] {
        let job = job(&store, id).await;
        assert_eq!((job.state, job.summary), (JobState::Canceled, None));
    }
}

async fn cancelling_the_last_job_cancels_a_queued_run(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let first = accepted(store.submit(new_job(1)).await);
    let second = accepted(store.submit(new_job(1)).await);
    cancel(&store, second.id).await;
    assert_eq!(cancel(&store, first.id).await, JobState::Canceled);
    assert!(store.claim().await.unwrap().is_none());
    let again = accepted(store.submit(new_job(1)).await);
    assert_eq!((again.origin, claim(&store).await.attempt), (Origin::Computed, 1));
}

async fn a_submission_does_not_join_a_run_that_is_being_cancelled(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let first = accepted(store.submit(new_job(1)).await);
    let dying = claim(&store).await;
    assert_eq!(cancel(&store, first.id).await, JobState::Canceling);
    assert!(dying.stop.is_raised());
    assert_eq!(
        cancel(&store, first.id).await,
        JobState::Canceling,
        "cancelling twice changes nothing"
    );

    let second = accepted(store.submit(new_job(1)).await);
    assert_eq!((second.origin, second.state), (Origin::Computed, JobState::Queued));
    let alive = claim(&store).await;
    assert_ne!(alive.run, dying.run);

    let late = store.finish(&dying, &answer("late"), Cost::default()).await.unwrap();
    assert_eq!(late, Finish::Refused);
    assert!(store.stopped(&dying).await.unwrap());
    assert!(!store.stopped(&dying).await.unwrap());
    assert_eq!(state(&store, first.id).await, JobState::Canceled);
    assert_eq!(store.finish(&alive, &answer("a"), Cost::default()).await.unwrap(), Finish::Stored);
    assert_eq!(state(&store, second.id).await, JobState::Succeeded);
    assert_eq!(state(&store, first.id).await, JobState::Canceled);
}

async fn cancelling_a_finished_or_unknown_job_is_reported(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let submitted = accepted(store.submit(new_job(1)).await);
    let claimed = claim(&store).await;
    store.fail(&claimed, FailureKind::Panicked, "index out of bounds").await.unwrap();
    let Canceled::AlreadyFinished(failed) =
        store.cancel(submitted.id, Actor::default()).await.unwrap()
    else {
        panic!("the job has failed");
    };
    let failure = failed.failure.unwrap();
    assert_eq!(failure.kind, FailureKind::Panicked);
    assert_eq!(failure.message, "index out of bounds");
    assert_eq!(
        store.cancel(JobId::generate(), Actor::default()).await.unwrap(),
        Canceled::NotFound
    );
    let again = accepted(store.submit(new_job(1)).await);
    assert_eq!(again.origin, Origin::Computed, "failures are not cached");
}

async fn every_unfinished_state_is_recovered_after_a_crash(on: Engine) {
    let (db, store) = Database::fresh(on).await;
    let canceling = accepted(store.submit(new_job(1)).await);
    let running = accepted(store.submit(new_job(2)).await);
    let joined = accepted(store.submit(new_job(2)).await);
    let left = accepted(store.submit(new_job(2)).await);
    let done = accepted(store.submit(new_job(3)).await);
    let queued = accepted(store.submit(new_job(4)).await);
    claim(&store).await;
    claim(&store).await;
    let third = claim(&store).await;
    cancel(&store, canceling.id).await;
    cancel(&store, left.id).await;
    store.finish(&third, &answer("a"), Cost::default()).await.unwrap();

    let (_db, store) = db.after_a_crash().await;
    let recovered = store.recover().await.unwrap();
    assert_eq!(recovered, Recovered { requeued: 1, failed: 0, canceled: 1 });
    for (id, expected, attempt) in [
        (canceling.id, JobState::Canceled, 1),
        (running.id, JobState::Queued, 1),
        (joined.id, JobState::Queued, 1),
        (left.id, JobState::Canceled, 1),
        (done.id, JobState::Succeeded, 1),
        (queued.id, JobState::Queued, 0),
    ] {
        let job = job(&store, id).await;
        assert_eq!((job.state, job.attempt), (expected, attempt));
    }
    assert_eq!(claim(&store).await.attempt, 2);
    assert_eq!(claim(&store).await.attempt, 1);
    assert_eq!(body(&store, 3).await, b"a");
}

async fn a_run_fails_after_three_crashes_of_the_server(on: Engine) {
    let (mut db, mut store) = Database::fresh(on).await;
    let submitted = accepted(store.submit(new_job(1)).await);
    // A release does not count as a crash.
    let released = claim(&store).await;
    assert!(store.release(&released).await.unwrap());
    for attempt in 2..=4 {
        assert_eq!(claim(&store).await.attempt, attempt);
        (db, store) = db.after_a_crash().await;
        let failed = u64::from(attempt == 4);
        let expected = Recovered { requeued: 1 - failed, failed, canceled: 0 };
        assert_eq!(store.recover().await.unwrap(), expected);
    }
    let job = job(&store, submitted.id).await;
    assert_eq!(job.state, JobState::Failed);
    assert_eq!(job.failure.unwrap().kind, FailureKind::WorkerLost);
    assert!(store.claim().await.unwrap().is_none());
}

async fn after_a_crash_a_run_waits_and_then_no_other_suspect_runs_beside_it(on: Engine) {
    let (db, store) = Database::fresh(on).await;
    for number in 1..=3 {
        accepted(store.submit(new_job(number)).await);
    }
    for number in 1..=2 {
        assert_eq!(claim(&store).await.key, key(number));
    }
    let (db, store) = db.after_a_crash().await;
    store.recover().await.unwrap();
    let suspect = claim(&store).await;
    assert_eq!((suspect.key, suspect.lost), (key(1), 1));
    assert_eq!(claim(&store).await.key, key(3), "not a second run that the crash interrupted");
    assert!(store.claim().await.unwrap().is_none());

    let (_db, store) = db.after_a_crash().await;
    store.recover().await.unwrap();
    accepted(store.submit(NewJob { priority: 0, ..new_job(4) }).await);
    let urgent = claim(&store).await;
    assert_eq!(urgent.key, key(4));
    assert!(store.claim().await.unwrap().is_none(), "a run that was lost twice must run alone");
    store.finish(&urgent, &answer("a"), Cost::ZERO).await.unwrap();
    let alone = claim(&store).await;
    assert_eq!((alone.key, alone.lost), (key(1), 2));
    assert!(store.claim().await.unwrap().is_none(), "nothing runs beside it");
    store.finish(&alone, &answer("a"), Cost::ZERO).await.unwrap();
    for number in [2, 3] {
        let suspect = claim(&store).await;
        assert_eq!((suspect.key, suspect.lost), (key(number), 1));
        assert!(store.claim().await.unwrap().is_none());
        store.finish(&suspect, &answer("a"), Cost::ZERO).await.unwrap();
    }
}

#[tokio::test]
async fn a_run_that_was_lost_and_then_given_back_stays_a_suspect() {
    let (db, store) = Database::fresh(Engine::Sqlite).await;
    for number in 1..=2 {
        accepted(store.submit(new_job(number)).await);
        assert_eq!(claim(&store).await.key, key(number));
    }
    let (_db, store) = db.after_a_crash().await;
    store.recover().await.unwrap();
    let suspect = claim(&store).await;
    assert!(store.release(&suspect).await.unwrap());
    let again = claim(&store).await;
    assert_eq!((again.run, again.attempt, again.lost), (suspect.run, 3, 1));
    assert!(store.claim().await.unwrap().is_none(), "the other run was lost, too");
}

async fn runs_are_claimed_in_order_of_submission(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    for number in 0..5 {
        accepted(store.submit(new_job(number)).await);
    }
    let first = claim(&store).await;
    store.release(&first).await.unwrap();
    for number in 0..5 {
        assert_eq!(claim(&store).await.key, key(number));
    }
}

async fn pages_have_no_gap_and_no_duplicate_while_jobs_arrive(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let mut expected = Vec::new();
    for number in 0..7 {
        expected.insert(0, accepted(store.submit(new_job(number)).await).id);
    }
    let mut seen = Vec::new();
    let mut cursor = None;
    loop {
        let page = store.jobs(&Filter::default(), cursor, 3).await.unwrap();
        accepted(store.submit(new_job(200)).await);
        seen.extend(page.jobs.iter().map(|job| job.id));
        cursor = page.next;
        if cursor.is_none() {
            break;
        }
        assert_eq!(page.jobs.len(), 3);
    }
    assert_eq!(seen, expected);
}

async fn jobs_can_be_filtered_by_any_combination_of_fields(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let label = Some("ball".to_owned());
    let labelled =
        NewJob { label: label.clone(), tags: vec!["x".into(), "y".into()], ..new_job(1) };
    let labelled = accepted(store.submit(labelled).await).id;
    let tagged = NewJob { tags: vec!["y".into()], owner: "bob".into(), ..new_job(2) };
    let tagged = accepted(store.submit(tagged).await).id;
    let plain = accepted(store.submit(new_job(2)).await).id;
    claim(&store).await;

    let tag = |tag: &str| Some(tag.to_owned());
    let all = Filter::default();
    for (filter, expected) in [
        (all.clone(), vec![plain, tagged, labelled]),
        (Filter { state: Some(JobState::Queued), ..all.clone() }, vec![plain, tagged]),
        (Filter { state: Some(JobState::Running), ..all.clone() }, vec![labelled]),
        (Filter { label, ..all.clone() }, vec![labelled]),
        (Filter { tag: tag("y"), ..all.clone() }, vec![tagged, labelled]),
        (Filter { tag: tag("x"), ..all.clone() }, vec![labelled]),
        (Filter { tag: tag("%"), ..all.clone() }, vec![]),
        (Filter { key: Some(key(2)), ..all.clone() }, vec![plain, tagged]),
        (Filter { key: Some(key(2)), tag: tag("y"), ..all.clone() }, vec![tagged]),
        (Filter { owner: Some("bob".into()), ..all.clone() }, vec![tagged]),
        (Filter { owner: Some("bob".into()), key: Some(key(1)), ..all }, vec![]),
    ] {
        let page = store.jobs(&filter, None, 10).await.unwrap();
        let ids: Vec<JobId> = page.jobs.iter().map(|job| job.id).collect();
        assert_eq!((ids, page.next), (expected, None), "{filter:?}");
    }
}

async fn a_wait_ends_when_the_job_ends_or_at_the_deadline(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let submitted = accepted(store.submit(new_job(1)).await);
    let impatient = store.wait(submitted.clone(), async {}).await.unwrap();
    assert_eq!(impatient.state, JobState::Queued);

    let worker = async {
        let claimed = claim(&store).await;
        store.progress(&claimed, 0.5).await.unwrap();
        store.finish(&claimed, &answer("a"), Cost::default()).await.unwrap();
    };
    let wait = store.wait(submitted, std::future::pending());
    let (waited, ()) = tokio::join!(wait, worker);
    assert_eq!(waited.unwrap().state, JobState::Succeeded);
}

async fn the_live_job_of_a_key_is_the_oldest_unfinished_one(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    assert_eq!(store.live_job(&key(1), &Reach::default()).await.unwrap(), None);
    let first = accepted(store.submit(new_job(1)).await);
    let second = accepted(store.submit(new_job(1)).await);
    assert_eq!(store.live_job(&key(1), &Reach::default()).await.unwrap(), Some(first.id));
    cancel(&store, first.id).await;
    assert_eq!(store.live_job(&key(1), &Reach::default()).await.unwrap(), Some(second.id));
    let own = Reach { owner: "somebody".into(), jobs: Seen::Own };
    assert_eq!(store.live_job(&key(1), &own).await.unwrap(), None);
}

#[tokio::test]
async fn a_second_server_on_the_same_directory_is_refused() {
    let (dir, store) = fresh().await;
    let second = Store::open(dir.path().into(), &Options::default()).await;
    let Err(error @ Error::Locked { .. }) = second else { panic!("{second:?}") };
    assert!(error.to_string().contains(&dir.path().display().to_string()));
    store.close().await;
    assert!(matches!(store.submit(new_job(1)).await, Err(Error::Closed)));
    assert!(matches!(store.probe().await, Err(Error::Closed)));
    open(dir.path()).await.probe().await.unwrap();
}

/// A command holds the lock for a moment, and a server that starts creates the database.
#[tokio::test]
async fn servers_and_commands_wait_for_the_lock() {
    async fn locked<T>(open: impl AsyncFnOnce(PathBuf) -> T) -> (TempDir, T) {
        let dir = TempDir::new().unwrap();
        let lock = File::create(dir.path().join("fretwork.lock")).unwrap();
        lock.lock().unwrap();
        // The first attempt of `open` comes before the release.
        let (opened, ()) = tokio::join!(open(dir.path().to_owned()), async { drop(lock) });
        (dir, opened)
    }
    let (_dir, store) =
        locked(async |dir| Store::open((&*dir).into(), &Options::default()).await).await;
    store.unwrap().close().await;
    let (_dir, tables) = locked(async |dir| Administration::open((&*dir).into()).await).await;
    assert!(tables.unwrap().keys().await.unwrap().is_empty());
}

async fn changes_requested_before_closing_are_committed(on: Engine) {
    let (db, store) = Database::fresh(on).await;
    let (submitted, ()) = tokio::join!(store.submit(new_job(1)), store.close());
    let store = db.open().await;
    assert_eq!(state(&store, accepted(submitted).id).await, JobState::Queued);
}

#[tokio::test]
async fn a_database_of_a_later_version_is_refused() {
    let (dir, store) = fresh().await;
    store.close().await;
    let later = "INSERT INTO _sqlx_migrations VALUES (9999, 'later', 0, TRUE, x'00', 0)";
    raw(dir.path()).await.execute(later).await.unwrap();
    let opened = Store::open(dir.path().into(), &Options::default()).await;
    assert!(matches!(opened, Err(Error::Newer { found: 9999, .. })), "{opened:?}");
}

#[tokio::test]
async fn the_database_of_another_program_is_refused_and_not_changed() {
    let dir = TempDir::new().unwrap();
    let mut foreign = raw(dir.path()).await;
    foreign.execute("CREATE TABLE song (title TEXT)").await.unwrap();
    foreign.close().await.unwrap();
    let before = fs::read(dir.path().join("fretwork.db")).unwrap();
    let opened = Store::open(dir.path().into(), &Options::default()).await;
    assert!(matches!(opened, Err(Error::Foreign { .. })), "{opened:?}");
    assert_eq!(fs::read(dir.path().join("fretwork.db")).unwrap(), before);
}

#[tokio::test]
async fn a_file_that_is_not_a_database_is_refused_and_not_changed() {
    let dir = TempDir::new().unwrap();
    let text = "radius, wear\n".repeat(1000);
    fs::write(dir.path().join("fretwork.db"), &text).unwrap();
    let opened = Store::open(dir.path().into(), &Options::default()).await;
    assert!(matches!(opened, Err(Error::NotADatabase { .. })), "{opened:?}");
    assert_eq!(fs::read_to_string(dir.path().join("fretwork.db")).unwrap(), text);
}

#[tokio::test]
async fn an_empty_database_file_is_initialised() {
    let dir = TempDir::new().unwrap();
    fs::write(dir.path().join("fretwork.db"), "").unwrap();
    open(dir.path()).await.submit(new_job(1)).await.unwrap();
}

#[tokio::test]
async fn the_error_names_a_directory_that_cannot_be_created() {
    let dir = TempDir::new().unwrap();
    fs::write(dir.path().join("file"), "").unwrap();
    let opened = Store::open((&*dir.path().join("file/data")).into(), &Options::default()).await;
    let Err(error @ Error::Directory { .. }) = opened else { panic!("{opened:?}") };
    assert!(error.to_string().contains("file/data"));
}

#[cfg(unix)]
#[test]
fn the_error_names_the_required_owner_of_a_directory() {
    let source = std::sync::Arc::new(std::io::ErrorKind::PermissionDenied.into());
    let error = Error::Directory { dir: "/data".into(), source }.to_string();
    let (user, group) = (rustix::process::geteuid(), rustix::process::getegid());
    assert!(error.contains(&format!("`chown -R {user}:{group} /data`")), "{error}");
}

#[derive(Debug, Clone)]
enum Verb {
    Submit(u8),
    /// Claims up to this many parts, of these owners.
    Claim(usize, Vec<&'static str>),
    /// A worker has computed for an owner, for this many seconds.
    Computed(&'static str, u64),
    Progress(Index),
    Finish(Index),
    Fail(Index),
    Stopped(Index),
    Release(Index),
    Cancel(Index),
    CancelAll(u8),
    Delete(Index),
    Crash,
    /// A transaction fails, after which the queue is read from the tables.
    Collide,
}

/// The owners of the random trial.
const OWNERS: [&str; 3] = ["ada", "bob", "eve"];

/// The number of chunks of a task of the random trial.
fn chunks(number: u8) -> Option<NonZeroU32> {
    NonZeroU32::new([0, 0, 0, 2, 5][usize::from(number)])
}

/// The content of a chunk of the trial.
fn chunk(key: &Key, number: u32) -> String {
    format!("chunk {number} of {key}\n")
}

/// The result of a key of the trial.
fn whole(key: &Key) -> String {
    match chunks(key.bytes()[0]) {
        None => key.to_string(),
        Some(chunks) => (0..chunks.get()).map(|number| chunk(key, number)).collect(),
    }
}

fn verbs() -> impl Strategy<Value = Vec<Verb>> {
    let index = any::<Index>;
    let verb = prop_oneof![
        6 => (0..5u8).prop_map(Verb::Submit),
        10 => Just(Verb::Claim(1, OWNERS.to_vec())),
        4 => (1..4usize, subsequence(OWNERS.to_vec(), 1..=3)).prop_map(|(most, of)| Verb::Claim(most, of)),
        4 => (prop::sample::select(&OWNERS[..]), 0..100u64).prop_map(|(of, time)| Verb::Computed(of, time)),
        1 => index().prop_map(Verb::Progress),
        8 => index().prop_map(Verb::Finish),
        1 => index().prop_map(Verb::Fail),
        2 => index().prop_map(Verb::Stopped),
        1 => index().prop_map(Verb::Release),
        4 => index().prop_map(Verb::Cancel),
        1 => (0..5u8).prop_map(Verb::CancelAll),
        2 => index().prop_map(Verb::Delete),
        2 => Just(Verb::Crash),
        2 => Just(Verb::Collide),
    ];
    prop::collection::vec(verb, 1..80)
}

/// Pairs of a fault and a statement that counts it.
const INVARIANTS: [(&str, &str); 15] = [
    (
        "two live runs of one key",
        "SELECT count(*) FROM (SELECT 1 FROM run WHERE state IN ('queued', 'running')
         GROUP BY key HAVING count(*) > 1) AS twice",
    ),
    (
        "an unfinished job whose state differs from that of its run",
        "SELECT count(*) FROM job JOIN run ON run.id = job.run
         WHERE job.finished IS NULL AND job.state <> run.state",
    ),
    (
        "a finished job that is not cancelled and differs from its run",
        "SELECT count(*) FROM job JOIN run ON run.id = job.run
         WHERE job.finished IS NOT NULL AND job.state NOT IN ('canceled', run.state)",
    ),
    (
        "an unfinished run without an unfinished job",
        "SELECT count(*) FROM run WHERE finished IS NULL
         AND NOT EXISTS (SELECT 1 FROM job WHERE job.run = run.id AND job.finished IS NULL)",
    ),
    (
        "an unfinished job whose attempt differs from that of its run",
        "SELECT count(*) FROM job JOIN run ON run.id = job.run
         WHERE job.finished IS NULL AND job.attempt <> run.attempt",
    ),
    (
        "a job that succeeded without a result",
        "SELECT count(*) FROM job WHERE state = 'succeeded' AND key NOT IN (SELECT key FROM result)",
    ),
    (
        "a run without a job",
        "SELECT count(*) FROM run WHERE NOT EXISTS (SELECT 1 FROM job WHERE job.run = run.id)",
    ),
    (
        "a job whose last recorded change is not its state",
        "SELECT count(*) FROM job
         WHERE changes NOT LIKE '%' || state || ' ' || attempt || ' ' || '%'
             OR (finished IS NOT NULL AND changes NOT LIKE '%' || state || ' % ' || finished)",
    ),
    (
        "a result without an outline, or an outline without a result",
        "SELECT (SELECT count(*) FROM result_task) + (SELECT count(*) FROM outline)
             - 2 * (SELECT count(*) FROM result_task JOIN outline USING (id))",
    ),
    (
        "a result without its body, or a body without its result",
        "SELECT (SELECT count(*) FROM result) + (SELECT count(*) FROM result_blob)
             - 2 * (SELECT count(*) FROM result JOIN result_blob USING (key))",
    ),
    (
        "an unfinished study whose pieces have a gap, or that has too many",
        "SELECT count(*) FROM (
             SELECT chunks, count(number) AS pieces, coalesce(max(number), -1) AS last
             FROM study JOIN run ON run.id = study.run LEFT JOIN chunk ON chunk.run = run.id
             WHERE finished IS NULL GROUP BY study.run) AS pieces
         WHERE pieces <> last + 1 OR last > chunks",
    ),
    (
        "an assembly that was claimed, or a study that succeeded, before all chunks were done",
        "SELECT count(*) FROM study JOIN run ON run.id = study.run
         WHERE (run.state = 'succeeded'
                 OR EXISTS (SELECT 1 FROM chunk WHERE chunk.run = study.run AND number = chunks))
             AND (SELECT count(*) FROM chunk WHERE chunk.run = study.run AND chunk.state = 'done')
                 <> chunks",
    ),
    (
        "a piece of a study that was never started",
        "SELECT count(*) FROM chunk JOIN run ON run.id = chunk.run WHERE run.state = 'queued'",
    ),
    (
        "a study that is canceling",
        "SELECT count(*) FROM study JOIN run ON run.id = study.run WHERE run.state = 'canceling'",
    ),
    (
        "a job that has recorded more changes of its study than queued, running and the end",
        "SELECT count(*) FROM job JOIN study USING (run)
         WHERE length(changes) - length(replace(changes, '\n', '')) > 2",
    ),
];

/// Invariants of columns that only SQLite has.
const SQLITE_INVARIANTS: [(&str, &str); 2] = [
    (
        "an unfinished study with a piece that was lost too often",
        "SELECT count(*) FROM chunk JOIN run ON run.id = chunk.run
         WHERE finished IS NULL AND chunk.lost >= 3",
    ),
    (
        "an unfinished study whose progress is not the share of its finished chunks",
        "SELECT count(*) FROM study JOIN run ON run.id = study.run
         WHERE finished IS NULL AND abs(progress * chunks
             - (SELECT count(*) FROM chunk WHERE chunk.run = study.run AND chunk.state = 'done')) > 1e-9",
    ),
];

/// Invariants of tables and columns that only PostgreSQL has.
const POSTGRES_INVARIANTS: [(&str, &str); 6] = [
    (
        "a piece or a run that was lost too often and is queued",
        "SELECT (SELECT count(*) FROM chunk JOIN run ON run.id = chunk.run
                 WHERE finished IS NULL AND chunk.state = 'queued' AND chunk.lost >= 3)
             + (SELECT count(*) FROM run WHERE state = 'queued' AND lost >= 3)",
    ),
    (
        "an unfinished study that counts its pieces wrongly",
        "SELECT count(*) FROM study JOIN run ON run.id = study.run CROSS JOIN LATERAL (
             SELECT count(*) AS claimed, count(*) FILTER (WHERE chunk.state = 'queued') AS waiting,
                 count(*) FILTER (WHERE chunk.state = 'running') AS working,
                 count(*) FILTER (WHERE chunk.state = 'done') AS ready
             FROM chunk WHERE chunk.run = study.run) AS pieces
         WHERE finished IS NULL
             AND (next, queued, running, done) <> (claimed, waiting, working, ready)",
    ),
    (
        "a job that is in the queue without work for it, or has work and is not in the queue",
        "SELECT count(*) FROM job JOIN run ON run.id = job.run LEFT JOIN study ON study.run = run.id
         WHERE job.finished IS NULL AND (claimable IS NOT NULL) <> CASE
             WHEN chunks IS NULL THEN run.state = 'queued'
             ELSE next < chunks OR queued > 0 OR (next = chunks AND running = 0) END",
    ),
    (
        "a running part without a lease",
        "SELECT (SELECT count(*) FROM run WHERE state IN ('running', 'canceling')
                 AND NOT EXISTS (SELECT 1 FROM study WHERE study.run = run.id)
                 AND NOT EXISTS (SELECT 1 FROM lease WHERE lease.run = run.id AND number = -1
                     AND lease.attempt = run.attempt))
             + (SELECT count(*) FROM chunk JOIN run ON run.id = chunk.run
                 WHERE finished IS NULL AND chunk.state = 'running'
                     AND NOT EXISTS (SELECT 1 FROM lease WHERE lease.run = chunk.run
                         AND lease.number = chunk.number AND lease.attempt = chunk.attempt))",
    ),
    (
        "a lease of a run or a piece that is not running",
        "SELECT count(*) FROM lease JOIN run ON run.id = lease.run LEFT JOIN chunk USING (run, number)
         WHERE run.finished IS NOT NULL OR run.state = 'queued'
             OR coalesce(chunk.state, 'running') <> 'running'",
    ),
    (
        "a tag that differs from those of its job",
        "SELECT count(*) FROM job_tag WHERE NOT EXISTS (SELECT 1 FROM job WHERE job.id = job_tag.job)",
    ),
];

/// The number of runs and studies of which a worker can claim a part.
const CLAIMABLE: &str = "
    SELECT count(*) FROM run LEFT JOIN study ON study.run = run.id
    WHERE finished IS NULL AND CASE
        WHEN chunks IS NULL THEN state = 'queued'
        WHEN (SELECT count(*) FROM chunk WHERE chunk.run = run.id) < chunks THEN TRUE
        WHEN EXISTS (SELECT 1 FROM chunk WHERE chunk.run = run.id AND chunk.state = 'queued') THEN TRUE
        ELSE NOT EXISTS (SELECT 1 FROM chunk WHERE chunk.run = run.id AND chunk.state <> 'done') END";

/// The number of runs and studies of which a worker can claim a part in the turn of this owner.
fn claimable_of(owner: &str) -> String {
    format!(
        "{CLAIMABLE} AND EXISTS (SELECT 1 FROM job
             WHERE job.run = run.id AND job.finished IS NULL AND job.owner = '{owner}')"
    )
}

/// The number of unfinished parts that were lost in a crash.
fn suspects(on: Engine) -> String {
    // In PostgreSQL, the last claim of a running part counts as a loss until the part ends.
    let claimed = u32::from(on == Engine::Postgres);
    let lost = format!("lost > CASE WHEN state = 'queued' THEN 0 ELSE {claimed} END");
    format!(
        "SELECT (SELECT count(*) FROM run WHERE finished IS NULL AND {lost} AND id NOT IN (SELECT run FROM study))
             + (SELECT count(*) FROM chunk WHERE state <> 'done' AND {lost}
                AND run IN (SELECT id FROM run WHERE finished IS NULL))"
    )
}

/// The queued runs.
const QUEUED: &str = "SELECT count(*) FROM run WHERE state = 'queued'";

/// The parts that workers compute.
const RUNNING: &str = "
    SELECT (SELECT count(*) FROM run WHERE state IN ('running', 'canceling')
             AND id NOT IN (SELECT run FROM study))
        + (SELECT count(*) FROM chunk JOIN run ON run.id = chunk.run
             WHERE finished IS NULL AND chunk.state = 'running')";

/// A store under random operations, and what it acknowledged.
struct Trial {
    /// `None` only during a crash.
    db: Option<Database>,
    on: Engine,
    store: Store,
    /// Reads the tables.
    raw: Raw,
    jobs: Vec<JobId>,
    finished: HashMap<JobId, Job>,
    claims: Vec<Claimed>,
    /// The claims that have ended, and those that were made before the last crash.
    over: HashSet<usize>,
    /// The last attempt to compute each run or piece of a study.
    attempts: HashMap<(RunId, Option<u32>), u32>,
}

impl Trial {
    async fn new(on: Engine) -> Self {
        let (db, store) = Database::fresh(on).await;
        let raw = db.raw().await;
        let (jobs, finished) = (vec![], HashMap::new());
        let (claims, over, attempts) = (vec![], HashSet::new(), HashMap::new());
        Self { db: Some(db), on, store, raw, jobs, finished, claims, over, attempts }
    }

    async fn apply(&mut self, verb: &Verb) {
        let store = &self.store;
        match verb {
            Verb::Submit(number) => {
                let count = self.jobs.len();
                let owner = OWNERS[count % 3].to_owned();
                let priority = u8::try_from(count * 5 % 8).unwrap();
                let chunks = chunks(*number);
                let new = NewJob { owner, priority, chunks, ..new_job(*number) };
                self.jobs.push(accepted(store.submit(new).await).id);
            }
            Verb::Claim(most, of) => self.claim(*most, of).await,
            Verb::Computed(owner, time) => store.computed(owner, Duration::from_secs(*time)),
            Verb::Cancel(index) if !self.jobs.is_empty() => {
                let canceled =
                    store.cancel(*index.get(&self.jobs), Actor::default()).await.unwrap();
                assert_ne!(canceled, Canceled::NotFound);
            }
            Verb::CancelAll(number) => {
                let filter = Filter { key: Some(key(*number)), ..Filter::default() };
                store.cancel_all(&filter, &Actor::default()).await.unwrap();
                for job in store.jobs(&filter, None, 100).await.unwrap().jobs {
                    assert!(job.state.is_finished() || job.state == JobState::Canceling);
                }
            }
            Verb::Delete(index) if !self.jobs.is_empty() => {
                let place = index.index(self.jobs.len());
                match store.delete(self.jobs[place], Actor::default()).await.unwrap() {
                    Deleted::Done => {
                        self.finished.remove(&self.jobs.remove(place));
                    }
                    other => assert!(matches!(other, Deleted::Unfinished(_)), "{other:?}"),
                }
            }
            Verb::Collide if !self.jobs.is_empty() => {
                let twice = NewJob { id: self.jobs[0], ..new_job(0) };
                let refused = store.submit(twice).await;
                assert!(matches!(refused, Err(Error::JobExists(_))), "{refused:?}");
            }
            Verb::Crash => {
                let db = self.db.take().unwrap().crashed().await;
                self.store = db.open().await;
                self.raw = db.raw().await;
                self.db = Some(db);
                self.store.recover().await.unwrap();
                self.over = (0..self.claims.len()).collect();
            }
            Verb::Progress(index)
            | Verb::Finish(index)
            | Verb::Fail(index)
            | Verb::Stopped(index)
            | Verb::Release(index)
                if !self.claims.is_empty() =>
            {
                self.end(verb, index.index(self.claims.len())).await;
            }
            _ => {}
        }
    }

    async fn claim(&mut self, most: usize, of: &[&str]) {
        let mut waiting = Vec::new();
        for owner in of {
            if self.raw.count(&claimable_of(owner)).await > 0 {
                waiting.push(*owner);
            }
        }
        let except = OWNERS.into_iter().filter(|owner| !of.contains(owner)).map(str::to_owned);
        let owners = Owners { below: u64::MAX, except: except.collect() };
        let claims = self.store.claim_up_to(most, owners).await.unwrap();
        // A part that was lost in a crash waits for others, or others wait for it.
        if self.raw.count(&suspects(self.on)).await == 0 {
            assert_eq!(claims.is_empty(), waiting.is_empty(), "{waiting:?} wait: {claims:?}");
            if let Some(first) = claims.first() {
                // All usage decays at the same rate. So the least one stays the least, except for the rounding.
                let least = waiting.iter().map(|owner| self.store.usage(owner)).min().unwrap();
                let used = self.store.usage(&first.owner);
                assert!(used <= least + 1, "{first:?} has {used}, another owner {least}");
            }
        } else if claims.is_empty() && !waiting.is_empty() {
            assert!(self.raw.count(RUNNING).await > 0, "{waiting:?} wait for nothing");
        }
        assert!(claims.len() <= most);
        for claimed in claims {
            assert!(waiting.contains(&&*claimed.owner), "{claimed:?} is not among {waiting:?}");
            let number = match claimed.piece {
                Piece::Whole { .. } => None,
                Piece::Chunk { number, .. } => Some(number),
                Piece::Assembly { of } => Some(of),
            };
            let part = (claimed.run, number);
            let before = self.attempts.insert(part, claimed.attempt).unwrap_or(0);
            assert_eq!(claimed.attempt, before + 1, "an attempt number is used once");
            self.claims.push(claimed);
        }
    }

    /// Ends a claim, or reports its progress.
    async fn end(&mut self, verb: &Verb, number: usize) {
        let (store, claimed) = (&self.store, &self.claims[number]);
        let accepted = match verb {
            Verb::Progress(_) => store.progress(claimed, 0.0).await.unwrap(),
            Verb::Finish(_) => finish(store, claimed).await,
            Verb::Fail(_) => store.fail(claimed, FailureKind::Panicked, "").await.unwrap(),
            Verb::Stopped(_) => store.stopped(claimed).await.unwrap(),
            _ => store.release(claimed).await.unwrap(),
        };
        assert!(!accepted || !self.over.contains(&number), "a lost claim changed something");
        if accepted && !matches!(verb, Verb::Progress(_)) {
            self.over.insert(number);
        }
    }

    async fn check(&mut self) {
        let raw = &mut self.raw;
        for (fault, count) in INVARIANTS {
            assert_eq!(raw.count(count).await, 0, "{fault}");
        }
        let of_engine = match self.on {
            Engine::Sqlite => &SQLITE_INVARIANTS[..],
            Engine::Postgres => &POSTGRES_INVARIANTS[..],
        };
        for (fault, count) in of_engine {
            assert_eq!(raw.count(count).await, 0, "{fault}");
        }
        let counts = (raw.count(QUEUED).await, raw.count(RUNNING).await);
        // Other servers can change the tables of PostgreSQL. So a store counts them from time to time, in
        // `longest_wait`.
        self.store.longest_wait().await.unwrap();
        let tally = self.store.tally();
        let counted = (tally.queued().cast_signed(), tally.running().cast_signed());
        assert_eq!(counted, counts, "the queue differs from the tables");
        for id in &self.jobs {
            let job = job(&self.store, *id).await;
            if let Some(finished) = self.finished.get(id) {
                assert_eq!(&job, finished, "a finished job changed");
            } else if job.state.is_finished() {
                self.finished.insert(*id, job);
            }
        }
    }

    /// Restarts, and computes all unfinished runs.
    async fn drain(&mut self) {
        self.apply(&Verb::Crash).await;
        while let Some(claimed) = self.store.claim().await.unwrap() {
            assert!(finish(&self.store, &claimed).await);
        }
        for id in &self.jobs {
            let job = job(&self.store, *id).await;
            if job.state == JobState::Succeeded {
                let number = job.key.bytes()[0];
                assert_eq!(body(&self.store, number).await, whole(&job.key).as_bytes());
            }
        }
    }
}

/// Computes and stores a run or a piece of a study as a worker does. Returns whether the store accepted it.
async fn finish(store: &Store, claimed: &Claimed) -> bool {
    let text = match claimed.piece {
        Piece::Whole { .. } => whole(&claimed.key),
        Piece::Chunk { number, .. } => {
            let chunk = chunk(&claimed.key, number);
            return store.finish_chunk(claimed, chunk.as_bytes(), Cost::ZERO).await.unwrap();
        }
        Piece::Assembly { of } => {
            let mut text = String::new();
            for number in 0..of {
                let Some(chunk) = store.chunk(claimed, number).await.unwrap() else { return false };
                text.push_str(std::str::from_utf8(&chunk).unwrap());
            }
            assert_eq!(text, whole(&claimed.key));
            text
        }
    };
    let finish = store.finish(claimed, &answer(&text), Cost::ZERO).await.unwrap();
    assert_ne!(finish, Finish::Differs);
    finish != Finish::Refused
}

fn try_in_order(verbs: &[Verb], on: Engine) {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let mut trial = Trial::new(on).await;
        for verb in verbs {
            trial.apply(verb).await;
            trial.check().await;
        }
        trial.drain().await;
        trial.check().await;
        assert_eq!(trial.finished.len(), trial.jobs.len(), "every job has ended");
    });
}

/// The seed of the histories, and their number on each database.
fn histories() -> ProptestConfig {
    let seed = env::var("FRETWORK_TEST_SEED").map_or(1, |seed| seed.parse().unwrap());
    ProptestConfig {
        cases: if env::var_os("FRETWORK_TEST_LONG").is_some() { 2000 } else { 24 },
        rng_seed: RngSeed::Fixed(seed),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

// A history that fails is printed, and the shortest one that fails. `FRETWORK_TEST_SEED` chooses other histories.
proptest! {
    #![proptest_config(histories())]

    /// This takes more than 5 s, because each of 24 histories opens the database several times.
    #[test]
    fn random_operations_and_crashes_lose_no_acknowledged_job(verbs in verbs()) {
        try_in_order(&verbs, Engine::Sqlite);
    }

    #[test]
    fn random_operations_and_crashes_lose_no_acknowledged_job_in_postgres(verbs in verbs()) {
        try_in_order(&verbs, Engine::Postgres);
    }
}

async fn a_refused_recomputation_is_not_answered_from_the_cache(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    accepted(store.submit(new_job(1)).await);
    let claimed = store.claim().await.unwrap().unwrap();
    store.finish(&claimed, &answer("{}"), Cost::default()).await.unwrap();
    let afresh = NewJob { afresh: true, admission: Admission::NoNewRun, ..new_job(1) };
    assert_eq!(store.submit(afresh).await.unwrap(), Submitted::NeedsRun);
    let known = NewJob { admission: Admission::NoNewRun, ..new_job(1) };
    assert_eq!(accepted(store.submit(known).await).origin, Origin::Cached);
}

async fn an_answer_that_is_recorded_during_a_run_is_stored_and_the_run_finds_it_equal(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let cost = Cost { wall: Duration::from_mins(1), cpu: None };
    let record = async |job| {
        let answered = answer_for("a", Some(cost));
        let recorded = store.record(vec![job], answered).await.unwrap();
        recorded.into_iter().next().unwrap()
    };
    let queued = accepted(store.submit(new_job(1)).await);
    let claimed = store.claim().await.unwrap().unwrap();
    let job = accepted(Ok(record(new_job(1)).await));
    let states: Vec<_> = job.changes.iter().map(|change| change.state).collect();
    assert_eq!(states, [JobState::Queued, JobState::Running, JobState::Succeeded]);
    assert_eq!((job.state, job.origin, job.attempt), (JobState::Succeeded, Origin::Computed, 1));
    let (started, finished) = (job.started.unwrap(), job.finished.unwrap());
    assert_eq!((job.created, finished - started), (started, 60_000));
    assert_eq!(store.job(job.id).await.unwrap(), Some(job.clone()));
    // Another job finds the stored result.
    assert_eq!(accepted(Ok(record(new_job(1)).await)).origin, Origin::Cached);
    let finish = store.finish(&claimed, &answer("a"), Cost::default()).await.unwrap();
    assert_eq!(finish, Finish::Same);
    let queued = store.job(queued.id).await.unwrap().unwrap();
    assert_eq!((queued.state, queued.origin), (JobState::Succeeded, Origin::Computed));
}

/// Equal submissions of a short run are recorded together.
async fn equal_jobs_that_are_recorded_together_end_like_the_first(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let record = async || {
        let answered = answer("a");
        let jobs = (0..3).map(|_| new_job(1)).collect();
        store.record(jobs, answered).await.unwrap()
    };
    let origins = |all: Vec<Submitted>| -> Vec<(JobState, Origin)> {
        let job = |submitted| accepted(Ok(submitted));
        all.into_iter().map(job).map(|job: Job| (job.state, job.origin)).collect()
    };
    let (computed, coalesced, cached) = (Origin::Computed, Origin::Coalesced, Origin::Cached);
    let succeeded = JobState::Succeeded;
    let new = [(succeeded, computed), (succeeded, coalesced), (succeeded, coalesced)];
    assert_eq!(origins(record().await), new);
    assert_eq!(origins(record().await), [(succeeded, cached); 3]);
    // The result was deleted, so it must be computed again by a run, which compares it with the former result.
    store.remove(&key(1), Actor::default()).await.unwrap();
    assert_eq!(record().await, [const { Submitted::NeedsRun }; 3]);
    accepted(store.submit(new_job(1)).await);
    assert_eq!(origins(record().await), [(JobState::Queued, coalesced); 3]);
    store.claim().await.unwrap().unwrap();
    assert_eq!(origins(record().await), [(JobState::Running, coalesced); 3]);
}
