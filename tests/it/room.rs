//! The size of the files: the limit under load, space that is given back, commits that the log has lost, and jumps of
//! the clock.

use std::env;
use std::fs::{self, File};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use fretwork_store::{Actor, Changed, Options, Reach, Removed, Seen, Store};
use serde_json::Value;
use sqlx::Executor as _;
use tempfile::TempDir;
use tokio::task::JoinSet;

use crate::database::PATIENCE;
use crate::keeping::{compute, eventually};
use crate::kill::{Program, id};
use crate::server::{JSON, ball, metric, send};
use crate::store::{accepted, key, new_job, open, raw};

/// Bytes of the database and of its log.
fn sizes(dir: &Path) -> (u64, u64) {
    let bytes = |file| fs::metadata(dir.join(file)).map_or(0, |file| file.len());
    (bytes("fretwork.db"), bytes("fretwork.db-wal"))
}

/// The program with these options; the log goes to a file.
fn logging(options: &[&str], log: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fretwork"));
    command.args(["--log", "warn"]).args(options).stderr(File::create(log).unwrap());
    command
}

/// This takes more than 5 s, because it writes until 200 results are evicted.
#[tokio::test(flavor = "multi_thread")]
async fn the_files_stay_within_keep_results_at_the_full_rate_of_writing() {
    // tests/long runs as long as the server of a user whose files had 457 MB although 20 MiB were allowed.
    let long = env::var_os("FRETWORK_TEST_LONG").is_some();
    let (limit, least) =
        if long { (20 << 20, Duration::from_mins(2)) } else { (4 << 20, Duration::ZERO) };
    let dir = TempDir::new().unwrap();
    let (limit_text, log) = (format!("{limit}B"), dir.path().join("log"));
    // Unfinished jobs are never deleted. A long queue would leave no space for evicted scenarios.
    let options = ["--keep-results", &limit_text, "--queue-limit", "1000"];
    let server = Program::start_by(logging(&options, &log), dir.path());
    let address = server.address;
    let (begun, over) = (Instant::now(), Arc::new(AtomicBool::new(false)));
    let submitted = Arc::new(AtomicU64::new(0));
    let mut clients = JoinSet::new();
    for client in 0..8 {
        let (submitted, over) = (Arc::clone(&submitted), Arc::clone(&over));
        clients.spawn(async move {
            while !over.load(Ordering::Relaxed) {
                let number = submitted.fetch_add(1, Ordering::Relaxed);
                // Every other client waits, so that its result is stored without a run.
                let wait: &[_] =
                    if client % 2 == 0 { &[JSON, ("Prefer", "wait=10")] } else { &[JSON] };
                let body = ball(1.0 + number as f64 * 1e-6).to_string();
                let reply = send(address, "POST", "/v1/jobs", wait, body).await.unwrap();
                assert!(matches!(reply.status, 200 | 202 | 503), "{}", reply.text());
            }
        });
    }
    let first: Value = loop {
        let jobs = server.get("/v1/jobs?state=succeeded").await.json()["jobs"].take();
        if let Some(job) = jobs.as_array().unwrap().last() {
            break job.clone();
        }
    };
    let old = [first["links"]["result"].as_str().unwrap(), &format!("/v1/jobs/{}", id(&first))];
    while !clients.is_empty() {
        let (database, log) = sizes(dir.path());
        assert!(database * 10 <= limit * 12, "{database} bytes, {limit} are allowed");
        // The log grows to a sixteenth of the limit, but at least to 1 MB, before it is reused from its beginning.
        let both = database + log;
        assert!(both <= limit + limit / 5 + (4 << 20), "{both} bytes with the log");
        // Readers must not prevent the server from reusing the log from its beginning.
        assert_eq!(server.get("/v1/results?limit=20").await.status, 200);
        // The result and the job that were used longest ago are deleted completely.
        let mut deleted = metric(address, "fretwork_results_evicted_total").await > 200.0;
        for old in old {
            deleted = deleted && server.get(old).await.status == 404;
        }
        let time = begun.elapsed();
        assert!(deleted || time < PATIENCE + least, "the server deletes too little");
        over.fetch_or(deleted && time >= least, Ordering::Relaxed);
        while clients.try_join_next().is_some() {}
    }
    // Some evicted results are still listed.
    let listed = server.get("/v1/results?evicted=true&limit=1").await.json();
    let key = listed["results"][0]["key"].as_str();
    let gone = format!("/v1/results/{}", key.unwrap_or_else(|| panic!("{listed}")));
    assert_eq!(server.get(&gone).await.status, 410);
    server.end();
    let log = fs::read_to_string(&log).unwrap();
    // On a busy machine the queue may be full again and again, which adds these lines to the log.
    let full =
        |line: &str| line.contains("many answers with this status") && line.ends_with("status=503");
    let faults = log.lines().filter(|line| !full(line));
    assert_eq!(faults.collect::<Vec<_>>(), [""; 0]);
}

/// This takes more than 5 s, because it keeps the server busy for some seconds.
#[tokio::test]
async fn space_is_given_back_while_the_server_is_busy() {
    let dir = TempDir::new().unwrap();
    let store = open(dir.path()).await;
    for number in 0..200 {
        compute(&store, number, 130_000).await;
    }
    store.close().await;
    let (before, _) = sizes(dir.path());
    // The file keeps up to 1 MiB of free pages, which is a sixth of this limit.
    let limit = 6 << 20;
    assert!(before > 3 * limit, "{before}");
    let options = Options { budget: Some(limit), ..Options::default() };
    let store = Store::open(dir.path().into(), &options).await.unwrap();
    // The pauses between these writes are too short for the writer task to become idle.
    for number in 200..=255 {
        compute(&store, number, 10).await;
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let (after, _) = sizes(dir.path());
    assert!(after * 10 <= limit * 12, "{after} bytes, {limit} are allowed");
    store.close().await;
}

#[tokio::test]
async fn pinned_results_stay_when_jobs_and_other_results_are_deleted() {
    let dir = TempDir::new().unwrap();
    let options = Options { budget: Some(2 << 20), ..Options::default() };
    let store = Store::open(dir.path().into(), &options).await.unwrap();
    let first = compute(&store, 0, 400_000).await;
    let ada = Reach { owner: "ada".into(), jobs: Seen::Shared };
    assert_eq!(store.pin(&key(0), true, ada).await.unwrap(), Changed::Done);
    for number in 1..50 {
        compute(&store, number, 400_000).await;
    }
    let store = &store;
    eventually(|| async move { store.job(first.id).await.unwrap().is_none() }).await;
    assert!(store.has_result(&key(0)).await.unwrap());
    assert!(store.has_result(&key(49)).await.unwrap(), "it is the newest");
    assert!(store.result(&key(1)).await.unwrap().is_none(), "its scenario is the oldest");
}

#[tokio::test]
async fn the_scenario_of_an_evicted_result_stays_while_it_has_a_job() {
    let dir = TempDir::new().unwrap();
    let options = Options { budget: Some(2 << 20), ..Options::default() };
    let store = Store::open(dir.path().into(), &options).await.unwrap();
    for number in [0, 1] {
        compute(&store, number, 10).await;
        assert!(matches!(
            store.remove(&key(number), Actor::default()).await.unwrap(),
            Removed::Done
        ));
    }
    // A worker claims result 0 again, and does not finish it.
    accepted(store.submit(new_job(0)).await);
    let running = store.claim().await.unwrap().unwrap();
    for number in 2..50 {
        compute(&store, number, 400_000).await;
    }
    let store = &store;
    eventually(|| async move { store.result(&key(1)).await.unwrap().is_none() }).await;
    assert!(store.result(&key(0)).await.unwrap().is_some(), "it has a job");
    drop(running);
}

#[tokio::test]
async fn a_jump_of_the_system_clock_deletes_no_jobs() {
    let dir = TempDir::new().unwrap();
    let store = open(dir.path()).await;
    let jobs = [compute(&store, 1, 0).await, compute(&store, 2, 0).await];
    store.close().await;
    // All times become 100 days older, as after a jump by 100 days. The first job is another 100 days older.
    let mut db = raw(dir.path()).await;
    db.execute("UPDATE room SET clock = committed - 100 * 86400000").await.unwrap();
    let mut ids = Vec::new();
    for (job, days) in jobs.iter().zip([200, 100]) {
        let mut id = job.id;
        let time = job.created - days * 86_400_000;
        let bytes = [&time.to_be_bytes()[2..], &id.0.as_bytes()[6..]].concat();
        sqlx::query(
            "UPDATE job SET id = ?2, created = ?3, started = ?3, finished = ?3 WHERE id = ?1",
        )
        .bind(id.0.as_bytes().as_slice())
        .bind(&bytes)
        .bind(time)
        .execute(&mut db)
        .await
        .unwrap();
        id.0 = uuid::Uuid::from_slice(&bytes).unwrap();
        ids.push(id);
    }
    drop(db);
    let keep_jobs = Some(Duration::from_hours(90 * 24));
    let store =
        Store::open(dir.path().into(), &Options { keep_jobs, ..Options::default() }).await.unwrap();
    let (store, old) = (&store, ids[0]);
    eventually(|| async move { store.job(old).await.unwrap().is_none() }).await;
    assert!(store.job(ids[1]).await.unwrap().is_some(), "it was not old before the jump");
}

#[tokio::test(flavor = "multi_thread")]
async fn commits_that_the_log_has_lost_are_reported_at_the_start() {
    let dir = TempDir::new().unwrap();
    let server = Program::start(dir.path(), "1");
    let post = async |number: u32| {
        let body = ball(1.0 + f64::from(number)).to_string();
        id(&send(server.address, "POST", "/v1/jobs", &[JSON], body).await.unwrap().json())
    };
    let mut last = String::new();
    for number in 0..20 {
        last = post(number).await;
    }
    server.kill();
    // Start with the whole log, with a log that is cut off, and without a log.
    let cut = |share: u64| {
        let copy = TempDir::new().unwrap();
        for file in ["fretwork.db", "fretwork.db-wal", "fretwork.lock"] {
            fs::copy(dir.path().join(file), copy.path().join(file)).unwrap();
        }
        let log = File::options().write(true).open(copy.path().join("fretwork.db-wal")).unwrap();
        let length = log.metadata().unwrap().len();
        assert!(length > 100_000);
        log.set_len(length * share / 4).unwrap();
        copy
    };
    for (share, is_lost) in [(4, false), (2, true), (0, true)] {
        let copy = cut(share);
        for told in [is_lost, false] {
            let log = copy.path().join("log");
            let server = Program::start_by(logging(&[], &log), copy.path());
            let status = server.get(&format!("/v1/jobs/{last}")).await.status;
            assert_eq!(status, if is_lost { 404 } else { 200 });
            let lost = metric(server.address, "fretwork_lost_commits").await;
            assert_eq!(lost > 0.0, told, "{lost}");
            server.end();
            let said = fs::read_to_string(&log).unwrap();
            assert_eq!(said.contains("acknowledged changes are missing"), told, "{said}");
        }
    }
}

#[tokio::test]
async fn an_idle_server_writes_nothing() {
    let dir = TempDir::new().unwrap();
    let store = open(dir.path()).await;
    compute(&store, 1, 0).await;
    let commits = async || -> i64 {
        let query = sqlx::query_scalar("SELECT commits FROM room");
        query.fetch_one(&mut raw(dir.path()).await).await.unwrap()
    };
    // The first round of maintenance stores the clock.
    let clock = async || -> Option<i64> {
        let query = sqlx::query_scalar("SELECT clock FROM room");
        query.fetch_one(&mut raw(dir.path()).await).await.unwrap()
    };
    eventually(async || clock().await.is_some()).await;
    let before = commits().await;
    for _ in 0..3 {
        assert!(store.claim().await.unwrap().is_none());
    }
    tokio::time::sleep(Duration::from_secs(2)).await;
    assert_eq!(commits().await, before);
}
