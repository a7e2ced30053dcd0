//! Kills during the first start of a database and at the end of a restore, and journals that such kills have left.

use std::env;
use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::thread::sleep;
use std::time::{Duration, Instant};

use fretwork_store::{backup, check, restore};
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection as _, Executor as _, SqliteConnection};
use tempfile::TempDir;

use crate::keeping::{compute, write_first_version};
use crate::kill::{Dice, Program};
use crate::program::fretwork;
use crate::server::{JSON, ball, send};
use crate::store::{body, crash, fresh, key, open};
use crate::upgrade;

/// A file that `backup` wrote, with these results.
async fn backup_of(numbers: std::ops::RangeInclusive<u8>) -> TempDir {
    let (dir, store) = fresh().await;
    for number in numbers {
        compute(&store, number, 20_000).await;
    }
    let target = TempDir::new().unwrap();
    backup(dir.path(), &target.path().join("fretwork.db")).await.unwrap();
    store.close().await;
    target
}

/// Copies the files of a directory.
fn copy(from: &Path) -> TempDir {
    let copy = TempDir::new().unwrap();
    for file in fs::read_dir(from).unwrap() {
        let file = file.unwrap();
        fs::copy(file.path(), copy.path().join(file.file_name())).unwrap();
    }
    copy
}

/// A copy of a database as a crash would leave it in the middle of a transaction with a rollback journal.
async fn interrupted(from: &Path) -> TempDir {
    let dir = copy(from);
    let options = SqliteConnectOptions::new().filename(dir.path().join("fretwork.db"));
    let mut db = SqliteConnection::connect_with(&options).await.unwrap();
    db.execute("PRAGMA cache_size = 1; BEGIN IMMEDIATE").await.unwrap();
    // Each statement changes more pages than the cache can hold. So SQLite writes pages before the commit.
    for statement in [
        "UPDATE result_blob SET body = zeroblob(length(body))",
        "UPDATE job SET label = hex(zeroblob(500))",
        "UPDATE result SET summary = 'lost'",
    ] {
        db.execute(statement).await.unwrap();
    }
    let crashed = copy(dir.path());
    assert!(fs::metadata(crashed.path().join("fretwork.db-journal")).unwrap().len() > 4096);
    crashed
}

async fn is_intact(dir: &Path) {
    let options = SqliteConnectOptions::new().filename(dir.join("fretwork.db"));
    let mut db = SqliteConnection::connect_with(&options).await.unwrap();
    let said: Vec<String> =
        sqlx::query_scalar("PRAGMA integrity_check").fetch_all(&mut db).await.unwrap();
    assert_eq!(said, ["ok"]);
    db.close().await.unwrap();
    assert_eq!(check(dir).await.unwrap().damage, []);
}

#[tokio::test]
async fn a_transaction_that_a_crash_interrupted_is_rolled_back_at_the_start() {
    let saved = backup_of(1..=3).await;
    let crashed = interrupted(saved.path()).await;
    let store = open(crashed.path()).await;
    for number in 1..=3 {
        assert!(body(&store, number).await.len() > 20_000);
    }
    store.close().await;
    is_intact(crashed.path()).await;
}

#[tokio::test]
async fn a_restored_database_does_not_get_the_journal_of_the_former_one() {
    let (old, new) = (backup_of(1..=3).await, backup_of(4..=9).await);
    let file = new.path().join("fretwork.db");
    let crashed = interrupted(old.path()).await;
    let (_, former) = restore(crashed.path(), &file, true).await.unwrap();
    // The journal may remain although the database file is gone.
    let alone = interrupted(old.path()).await;
    fs::remove_file(alone.path().join("fretwork.db")).unwrap();
    restore(alone.path(), &file, false).await.unwrap();
    for dir in [crashed.path(), alone.path()] {
        assert!(!dir.join("fretwork.db-journal").exists());
        let store = open(dir).await;
        for number in 4..=9 {
            assert!(body(&store, number).await.len() > 20_000);
        }
        compute(&store, 10, 1000).await;
        store.close().await;
        is_intact(dir).await;
    }
    // The database that the restore has moved aside is intact.
    let dir = TempDir::new().unwrap();
    restore(dir.path(), &former.unwrap(), false).await.unwrap();
    let store = open(dir.path()).await;
    assert!(body(&store, 1).await.len() > 20_000 && !store.has_result(&key(4)).await.unwrap());
}

/// The number of rounds: `number` in tests/long, otherwise a tenth of it.
fn rounds(number: u64) -> u64 {
    if env::var_os("FRETWORK_TEST_LONG").is_some() { number } else { number / 10 }
}

fn dice() -> Dice {
    Dice(env::var("FRETWORK_TEST_SEED").map_or(1, |seed| seed.parse().unwrap()))
}

/// Starts a command, and kills it after a time.
fn kill_after(words: &[&str], dir: &Path, time: Duration) {
    let mut command = fretwork(words);
    command.arg("--data-dir").arg(dir).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = command.spawn().unwrap();
    sleep(time);
    // The command may have ended already.
    let _ = child.kill();
    child.wait().unwrap();
}

/// The number of results and of jobs, after a start that must succeed. The database is then intact.
async fn counts(dir: &Path) -> (usize, usize) {
    let server = Program::start(dir, "1");
    let results = server.get("/v1/results?limit=100").await.json();
    let counts = (results["results"].as_array().unwrap().len(), server.jobs("").await.len());
    let headers = [JSON, ("Prefer", "wait=60")];
    let job = ball(1.5).to_string();
    let reply = send(server.address, "POST", "/v1/jobs", &headers, job).await.unwrap();
    assert_eq!(reply.status, 200, "{}", reply.text());
    server.end();
    is_intact(dir).await;
    counts
}

/// This takes more than 5 s, because it starts and checks 30 servers.
#[tokio::test(flavor = "multi_thread")]
async fn every_directory_starts_again_after_a_kill_in_its_first_milliseconds() {
    let (empty, saved) = (TempDir::new().unwrap(), backup_of(1..=3).await);
    let (old, oldest) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    upgrade::write_database(old.path());
    write_first_version(oldest.path()).await;
    // Each directory has its number of results and of jobs. A server also computes the unfinished runs of an earlier
    // version.
    let kinds = [(&saved, 3, 3), (&empty, 0, 0), (&saved, 3, 3), (&old, 2, 7), (&oldest, 0, 1)];
    let mut dice = dice();
    for round in 0..rounds(300) {
        let (from, results, jobs) = kinds[round as usize % kinds.len()];
        let dir = copy(from.path());
        let time = Duration::from_micros(dice.below(50_000));
        kill_after(&["--listen", "127.0.0.1:0"], dir.path(), time);
        let found = counts(dir.path()).await;
        let is_whole = found.0 >= results && found.1 == jobs;
        assert!(is_whole, "round {round}, killed after {time:?}: {found:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_restore_that_is_killed_near_its_end_leaves_one_of_the_two_databases() {
    let new = backup_of(4..=9).await;
    let file = new.path().join("fretwork.db");
    let words = ["restore", "--replace", file.to_str().unwrap()];
    // The former database has a log, as after a crash.
    let (dir, store) = fresh().await;
    for number in 1..=3 {
        compute(&store, number, 20_000).await;
    }
    let old = crash(dir.path());
    store.close().await;
    let mut longest = Duration::ZERO;
    for _ in 0..3 {
        let dir = copy(old.path());
        let began = Instant::now();
        let mut command = fretwork(&words);
        command.arg("--data-dir").arg(dir.path()).stdout(Stdio::null());
        assert!(command.status().unwrap().success());
        longest = longest.max(began.elapsed());
    }
    let mut dice = dice();
    let mut met = [0, 0];
    for round in 0..rounds(100) {
        let dir = copy(old.path());
        let before = Duration::from_micros(dice.below(40_000));
        kill_after(&words, dir.path(), longest.saturating_sub(before));
        let (results, jobs) = counts(dir.path()).await;
        assert!([(3, 3), (6, 6)].contains(&(results, jobs)), "round {round}: {results}, {jobs}");
        met[usize::from(results == 6)] += 1;
    }
    println!("{} kept the former database, {} have the backup", met[0], met[1]);
}
