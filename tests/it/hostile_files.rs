//! Exports and backups that were made to do harm: huge lines and values, endless files, triggers.

use std::fs;
use std::io::{Read as _, Seek as _, Write as _};
use std::path::Path;
use std::process::{Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use fretwork_store::{Moving, backup, restore};
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{AssertSqlSafe, Connection as _, SqliteConnection};
use tempfile::TempDir;

use crate::database::PATIENCE;
use crate::moving::{Lines, export_all};
use crate::program::fretwork;
use crate::server::{Server, ball};
use crate::store::{accepted, fresh, new_job, open};

/// Executes statements in a file.
async fn change(file: &Path, statements: &str) {
    let options = SqliteConnectOptions::new().filename(file).foreign_keys(false);
    let mut db = SqliteConnection::connect_with(&options).await.unwrap();
    sqlx::raw_sql(AssertSqlSafe(statements.to_owned())).execute(&mut db).await.unwrap();
    db.close().await.unwrap();
}

/// Runs a command, which must end. Returns its output and its peak memory in MiB.
fn measured(words: &[&str]) -> (Output, u64) {
    let mut command = fretwork(words);
    // A command that writes into a full pipe waits until somebody reads.
    let mut said = tempfile::tempfile().unwrap();
    command.stdout(Stdio::piped()).stderr(said.try_clone().unwrap());
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
    let mut output = child.wait_with_output().unwrap();
    said.rewind().unwrap();
    said.read_to_end(&mut output.stderr).unwrap();
    (output, peak / 1024)
}

/// Imports a file that must be refused, in little memory. Returns what the command says.
fn refused(file: &Path, data: &Path) -> String {
    let words = ["import", file.to_str().unwrap(), "--data-dir", data.to_str().unwrap()];
    let (output, peak) = measured(&words);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && peak < 256, "{peak} MiB: {said:.500}");
    said
}

/// This takes more than 5 s, because the lines are long.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_hostile_export_is_refused_in_little_memory() {
    let from = Server::start().await;
    let key = from.compute(&ball(1.0)).await.json()["key"].as_str().unwrap().to_owned();
    let dir = TempDir::new().unwrap();
    let [file, data] = ["results.ndjson.zst", "data"].map(|name| dir.path().join(name));
    export_all(&from, &file).await;
    let sound = Lines::open(&file);
    let body = sound.results[0].1.clone();
    let zeros = format!("{{\"x\":[{}0],", "0,".repeat(40_000_000));
    for hostile in [
        body.replacen("\"history\":{", &format!("\"history\":{zeros}"), 1),
        body.replacen("\"profiles\":{", &format!("\"profiles\":{zeros}"), 1),
        // A closed list of lists, and an open one.
        format!("{}{}", "[".repeat(40_000_000), "]".repeat(40_000_000)),
        "[".repeat(80_000_000),
    ] {
        assert!(hostile.len() >= 80_000_000);
        let mut lines = Lines::open(&file);
        lines.replace_body(&key, &hostile);
        let held = dir.path().join("hostile.zst");
        fs::write(&held, zstd::encode_all(lines.text().as_bytes(), 1).unwrap()).unwrap();
        assert!(refused(&held, &data).contains("refused the result"), "{}", &hostile[..99]);
    }
    let head = format!("{}\n", sound.head);
    // Each of these small files has hundreds of megabytes.
    let bombs = [
        (format!("{head}{}", "{".repeat(1 << 20)), 400, "has more than"),
        (format!("{head}{{\"key\":\"{}", "x".repeat(1 << 20)), 400, "has more than"),
        ("{ ".to_owned() + &" ".repeat(1 << 20), 400, "it has more than"),
        (
            format!("{head}{}", "{\"key\":\"\"}\n".repeat(100_000)),
            100,
            "10000 results are refused; the rest",
        ),
        (format!("{head}x\n"), 1_000_000, "has no key of a result"),
    ];
    for (text, times, words) in bombs {
        let tail = &text[text.find('\n').map_or(0, |end| end + 1)..];
        let tail = if tail.is_empty() { &*text } else { tail };
        let held = dir.path().join("bomb.zst");
        let mut encoder = zstd::Encoder::new(fs::File::create(&held).unwrap(), 1).unwrap();
        encoder.write_all(text.as_bytes()).unwrap();
        for _ in 0..times {
            encoder.write_all(tail.as_bytes()).unwrap();
        }
        encoder.finish().unwrap();
        let said = refused(&held, &data);
        assert!(said.contains(words), "{tail:.99}: {said:.500}");
    }
    // A decompressor that must keep 128 MiB.
    let mut encoder = zstd::Encoder::new(Vec::new(), 1).unwrap();
    encoder.long_distance_matching(true).unwrap();
    encoder.window_log(27).unwrap();
    encoder.write_all(sound.text().as_bytes()).unwrap();
    fs::write(&file, encoder.finish().unwrap()).unwrap();
    assert!(refused(&file, &data).contains("memory"));
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
