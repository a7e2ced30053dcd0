//! Exports and backups that were made to do harm: endless views, generated columns, triggers, huge values.

use std::fs;
use std::path::Path;
use std::process::{Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use fretwork_store::{Moving, backup, restore};
use sqlx::{AssertSqlSafe, Connection as _};
use tempfile::TempDir;

use crate::database::PATIENCE;
use crate::moving::{export_all, open_file, replace_body};
use crate::program::fretwork;
use crate::server::{Server, ball};
use crate::store::{accepted, fresh, new_job, open};

/// Executes statements in a file.
async fn change(file: &Path, statements: &str) {
    let mut db = open_file(file).await;
    sqlx::raw_sql(AssertSqlSafe(statements.to_owned())).execute(&mut db).await.unwrap();
    db.close().await.unwrap();
}

/// Runs a command, which must end. Returns its output and its peak memory in MiB.
fn measured(words: &[&str]) -> (Output, u64) {
    let mut command = fretwork(words);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let (began, mut peak) = (Instant::now(), 0);
    while child.try_wait().unwrap().is_none() {
        if began.elapsed() > PATIENCE {
            child.kill().unwrap();
            panic!("it does not end: {words:?}");
        }
        let status = fs::read_to_string(format!("/proc/{}/status", child.id()));
        let status = status.unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kib = line.and_then(|line| line.trim().strip_suffix(" kB")?.parse().ok());
        peak = kib.unwrap_or(0).max(peak);
        sleep(Duration::from_millis(1));
    }
    (child.wait_with_output().unwrap(), peak / 1024)
}

/// A recursive view without end.
const ENDLESS: &str = "WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)";
/// More bytes than a body may have.
const HUGE: u32 = 150_000_000;

/// This takes more than 5 s, because the files are large.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_hostile_export_is_refused_in_little_memory() {
    let from = Server::start().await;
    from.compute(&ball(1.0)).await;
    let dir = TempDir::new().unwrap();
    let sound = dir.path().join("results.db");
    export_all(&from, &sound).await;
    let view = |name| {
        format!(
            "ALTER TABLE {name} RENAME TO held;
             CREATE VIEW {name} AS {ENDLESS} SELECT held.* FROM n CROSS JOIN held"
        )
    };
    let without_body = |column: &str| {
        format!(
            "CREATE TABLE held (key TEXT PRIMARY KEY, {column}); INSERT INTO held (key) SELECT key FROM results;
             DROP TABLE bodies; ALTER TABLE held RENAME TO bodies"
        )
    };
    let no_export = "is not an export of fretwork";
    let cases = [
        (view("results"), no_export),
        (view("bodies"), no_export),
        // The schema lists the view as if it were a table.
        (
            format!(
                "{}; PRAGMA writable_schema = ON;
                 UPDATE sqlite_schema SET type = 'table', rootpage = 2 WHERE name = 'results'",
                view("results")
            ),
            "",
        ),
        (without_body("body TEXT AS (hex(zeroblob(400000000)))"), no_export),
        (without_body("body TEXT AS (hex(zeroblob(400000000))) STORED"), no_export),
        (without_body("body TEXT, rowid INTEGER"), no_export),
        (without_body("body TEXT, x AS (hex(zeroblob(400000000)))"), no_export),
        (
            "CREATE TRIGGER t AFTER INSERT ON results BEGIN DELETE FROM bodies; END".to_owned(),
            no_export,
        ),
        (
            format!("UPDATE bodies SET body = zeroblob({HUGE})"),
            "the JSON of the result has more than",
        ),
        (format!("UPDATE bodies SET key = CAST(zeroblob({HUGE}) AS TEXT)"), no_export),
        (format!("UPDATE results SET key = zeroblob({HUGE})"), no_export),
        // Without an index, the search for each body would read all rows.
        (
            format!(
                "{}; {ENDLESS} INSERT INTO bodies (key) SELECT i FROM n LIMIT 300000",
                without_body("body TEXT").replace("PRIMARY KEY", "")
            ),
            no_export,
        ),
        (
            format!("UPDATE results SET note = zeroblob({HUGE})"),
            "the row of this result in the file is too large",
        ),
        (
            format!("ALTER TABLE bodies ADD COLUMN x; UPDATE bodies SET x = zeroblob({HUGE})"),
            "the JSON of the result has more than",
        ),
    ];
    for (statements, words) in cases {
        let file = dir.path().join("hostile.db");
        fs::copy(&sound, &file).unwrap();
        change(&file, &statements).await;
        let data = dir.path().join("data");
        let words_of = ["import", file.to_str().unwrap(), "--data-dir", data.to_str().unwrap()];
        let (output, peak) = measured(&words_of);
        let said = String::from_utf8(output.stderr).unwrap();
        println!("{peak} MiB, {:?}: {said}", output.status.code());
        assert!(!output.status.success() && said.contains(words), "{statements}: {said}");
        assert!(peak < 256, "{statements}: {peak} MiB");
    }
}

/// This takes more than 5 s, because the bodies have 80 MB.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_body_of_many_values_is_refused_in_little_memory() {
    let from = Server::start().await;
    let key = from.compute(&ball(1.0)).await.json()["key"].as_str().unwrap().to_owned();
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    export_all(&from, &file).await;
    let body = from.get(&format!("/v1/results/{key}")).await.text().to_owned();
    let zeros = format!("{{\"x\":[{}0],", "0,".repeat(40_000_000));
    let nested = "[".repeat(80_000_000);
    for hostile in [
        body.replacen("\"history\":{", &format!("\"history\":{zeros}"), 1),
        body.replacen("\"profiles\":{", &format!("\"profiles\":{zeros}"), 1),
        nested,
    ] {
        assert!(hostile.len() >= 80_000_000);
        let mut db = open_file(&file).await;
        replace_body(&mut db, &key, &hostile).await;
        db.close().await.unwrap();
        let data = dir.path().join("data");
        let words = ["import", file.to_str().unwrap(), "--data-dir", data.to_str().unwrap()];
        let (output, peak) = measured(&words);
        let said = String::from_utf8(output.stderr).unwrap();
        println!("{peak} MiB: {said}");
        assert!(
            said.contains(&format!("refused the result {key}")) && peak < 256,
            "{peak} MiB: {said}"
        );
    }
}

#[tokio::test]
async fn a_backup_with_a_foreign_trigger_or_table_is_refused() {
    let (dir, store) = fresh().await;
    accepted(store.submit(new_job(1)).await);
    let target = TempDir::new().unwrap();
    let sound = target.path().join("backup.db");
    backup(dir.path(), &sound).await.unwrap();
    for (number, (statement, name)) in [
        ("CREATE TRIGGER gone AFTER INSERT ON job BEGIN DELETE FROM result; END", "gone"),
        ("CREATE TRIGGER early AFTER INSERT ON _sqlx_migrations BEGIN DELETE FROM job; END", "early"),
        ("DROP TRIGGER jobs_follow_their_run", "jobs_follow_their_run"),
        ("CREATE TABLE mine (x)", "mine"),
        ("ALTER TABLE job ADD COLUMN x TEXT AS (hex(zeroblob(400000000)))", "job"),
        ("DROP INDEX job_key", "job_key"),
        (
            "ALTER TABLE _sqlx_migrations RENAME TO held;
             CREATE VIEW _sqlx_migrations AS
             WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT held.* FROM held, n",
            "_sqlx_migrations",
        ),
    ]
    .into_iter()
    .enumerate()
    {
        let file = target.path().join(format!("{number}.db"));
        fs::copy(&sound, &file).unwrap();
        change(&file, statement).await;
        let data = target.path().join("data");
        let refused = tokio::time::timeout(PATIENCE, restore(&data, &file, false));
        let refused = refused.await.unwrap();
        assert!(matches!(refused, Err(Moving::Store(_))), "{statement}: {refused:?}");
        let said = refused.unwrap_err().to_string();
        assert!(said.contains(name) && said.contains(file.to_str().unwrap()), "{said}");
        assert!(!data.exists());
    }
    // The unchanged backup can be restored.
    let data = target.path().join("data");
    restore(&data, &sound, false).await.unwrap();
    open(&data).await.close().await;
    // A database that could not be restored is not backed up as if it were sound.
    store.close().await;
    let trigger = "CREATE TRIGGER gone AFTER INSERT ON job BEGIN DELETE FROM result; END";
    change(&dir.path().join("fretwork.db"), trigger).await;
    let refused = backup(dir.path(), &target.path().join("second.db")).await;
    assert!(refused.unwrap_err().to_string().contains("gone"));
}

#[test]
fn endless_files_devices_and_pipes_are_refused() {
    let dir = TempDir::new().unwrap();
    let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (pipe, huge) = (at("pipe"), at("huge"));
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    fs::File::create(&huge).unwrap().set_len(1 << 40).unwrap();
    let data = at("data");
    for file in ["/dev/zero", &*pipe, &*huge, dir.path().to_str().unwrap()] {
        for words in [
            &["run", "--join", file][..],
            &["run", "examples/studies/sweep.json", "--part", "1/2", "--store", file],
            &["import", file, "--data-dir", &data],
            &["restore", file, "--data-dir", &data],
        ] {
            let (output, peak) = measured(words);
            let said = String::from_utf8(output.stderr).unwrap();
            assert_eq!(
                (output.status.code(), said.lines().count()),
                (Some(1), 1),
                "{words:?} {said}"
            );
            assert!(peak < 600, "{words:?} takes {peak} MiB");
        }
    }
    for words in
        [&["run", "/dev/zero"][..], &["list", "--key-file", "/dev/zero", "--url", "http://[::1]:1"]]
    {
        assert!(!measured(words).0.status.success(), "{words:?}");
    }
    assert_eq!(fs::metadata(&huge).unwrap().len(), 1 << 40);
}
