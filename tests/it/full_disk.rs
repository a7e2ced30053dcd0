//! The disk becomes full again and again, at random moments under load. No acknowledged job is lost, `/readyz` reports
//! the full disk, lists can be read, and the service resumes.

use std::collections::HashMap;
use std::env;
use std::fs;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use sqlx::{AssertSqlSafe, Connection as _, Executor as _, PgConnection};
use tempfile::TempDir;
use tokio::sync::watch;
use tokio::task::JoinSet;

use crate::database::Cluster;
use crate::faults::{fill, mounting};
use crate::keeping::eventually;
use crate::kill::{Dice, Program, id};
use crate::program::fretwork;
use crate::server::{JSON, Server, ball, metric, send};
use crate::store::raw;

/// The state that the clients share.
#[derive(Default)]
struct Shared {
    submitted: AtomicU32,
    accepted: AtomicU32,
    refused: AtomicU32,
}

/// Submits small scenarios until the end, and returns the ids of the acknowledged jobs.
async fn submit(
    address: SocketAddr,
    mut dice: Dice,
    shared: Arc<Shared>,
    end: watch::Receiver<bool>,
) -> Vec<String> {
    let mut acknowledged = Vec::new();
    while !*end.borrow() {
        let number = shared.submitted.fetch_add(1, Ordering::SeqCst);
        let mut body = ball(1.0 + f64::from(number) * 1e-6);
        body["scenario"]["cycles"] = json!([1000]);
        body["scenario"]["profiles_at"] = json!("none");
        // Some results are stored without a run, the others by a worker.
        let wait: &[_] = if dice.below(2) == 0 { &[JSON, ("Prefer", "wait=1")] } else { &[JSON] };
        let reply = send(address, "POST", "/v1/jobs", wait, body.to_string()).await.unwrap();
        if matches!(reply.status, 200 | 202) {
            acknowledged.push(id(&reply.json()));
            shared.accepted.fetch_add(1, Ordering::SeqCst);
        } else {
            reply.problem(507, "disk-full");
            shared.refused.fetch_add(1, Ordering::SeqCst);
        }
        // A random pause; nothing depends on its length.
        tokio::time::sleep(Duration::from_micros(dice.below(100_000))).await;
    }
    acknowledged
}

/// Fills the disk until `/readyz` reports it and a submission is refused, and frees it again.
async fn one_full_disk(server: &Program, filler: &Path, shared: &Shared) {
    let accepted = || shared.accepted.load(Ordering::SeqCst);
    let refused = || shared.refused.load(Ordering::SeqCst);
    let before = accepted();
    eventually(async || accepted() > before + 5).await;
    let before = refused();
    eventually(async || {
        // The server writes at the same time, so it may have taken the last blocks and still have space.
        fill(filler);
        let reply = server.get("/readyz").await;
        if reply.status != 200 {
            let problem = reply.problem(503, "not-ready");
            assert!(problem["detail"].as_str().unwrap().contains("no space is left"), "{problem}");
        }
        // On a full disk, jobs are accepted as long as the log has space that can be reused.
        reply.status != 200 && refused() > before
    })
    .await;
    for list in ["/v1/results?sort=-wear_volume", "/v1/results?pinned=false", "/v1/jobs"] {
        assert_eq!(server.get(list).await.status, 200, "{list}");
    }
    fs::remove_file(filler).unwrap();
    // The service returns.
    eventually(async || {
        let before = (accepted(), refused());
        tokio::time::sleep(Duration::from_millis(100)).await;
        accepted() > before.0 && refused() == before.1
    })
    .await;
    eventually(async || server.get("/readyz").await.status == 200).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn full_disks_at_random_moments_lose_no_acknowledged_job() {
    // By default 2 rounds are run; tests/long runs all 100.
    let disks = if env::var_os("FRETWORK_TEST_LONG").is_some() { 100 } else { 2 };
    let seed = env::var("FRETWORK_TEST_SEED").map_or(1, |seed| seed.parse().unwrap());
    let dir = TempDir::new().unwrap();
    // Large enough for the jobs of all rounds.
    let mount = "mount -t tmpfs -o size=512m tmpfs \"$0\"";
    let Some(mut command) = mounting(mount, dir.path()) else { return };
    command.args(["--workers", "1", "--memory-cache", "0"]);
    let server = Program::start_by(command, dir.path());
    let root = format!("/proc/{}/root", server.child.id());
    let filler = Path::new(&root).join(dir.path().strip_prefix("/").unwrap()).join("filler");

    let (shared, (end, ended)) = (Arc::new(Shared::default()), watch::channel(false));
    let mut clients = JoinSet::new();
    for client in 0..3 {
        let dice = Dice(seed * 1000 + client);
        clients.spawn(submit(server.address, dice, Arc::clone(&shared), ended.clone()));
    }
    let mut dice = Dice(seed);
    for number in 1..=disks {
        // A random pause; nothing depends on its length.
        tokio::time::sleep(Duration::from_micros(dice.below(300_000))).await;
        one_full_disk(&server, &filler, &shared).await;
        println!("{number} full disks, {} jobs", shared.accepted.load(Ordering::SeqCst));
    }
    end.send_replace(true);
    let acknowledged = clients.join_all().await.concat();
    // The last jobs may still be queued.
    server.ended(acknowledged.last().unwrap()).await;
    while !server.jobs("state=queued").await.is_empty() {}
    let jobs: HashMap<String, Value> =
        server.jobs("").await.into_iter().map(|job| (id(&job), job)).collect();
    for id in &acknowledged {
        let job = jobs.get(id).unwrap_or_else(|| panic!("{id} is lost"));
        assert!(matches!(job["state"].as_str().unwrap(), "succeeded" | "running"), "{job}");
    }
    server.end();
}

/// Fills the disk of a database, up to the last page.
async fn fill_database(db: &mut PgConnection) {
    let create =
        "CREATE TABLE filler (bytes TEXT); ALTER TABLE filler ALTER COLUMN bytes SET STORAGE PLAIN";
    sqlx::raw_sql(create).execute(&mut *db).await.unwrap();
    for pages in [256, 1] {
        let insert = "INSERT INTO filler SELECT repeat('x', 8000) FROM generate_series(1, $1)";
        while sqlx::query(insert).bind(pages).execute(&mut *db).await.is_ok() {}
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn readyz_reports_that_the_disk_of_postgresql_is_full() {
    let dir = TempDir::new().unwrap();
    // The PostgreSQL server does not run as root, so it cannot run in the mount namespace of an unprivileged user.
    // Only root can create a namespace that works here.
    let is_root = rustix::process::geteuid().is_root();
    if !is_root || mounting("mount -t tmpfs tmpfs \"$0\"", dir.path()).is_none() {
        return;
    }
    let cluster = Cluster::start(&["--disk", "32m"]);
    let place = cluster.address().split_once("host=").unwrap().1;
    let mut db = PgConnection::connect(cluster.address()).await.unwrap();
    for create in [
        format!("CREATE TABLESPACE small LOCATION '{place}/small'"),
        "CREATE DATABASE team TABLESPACE small".to_owned(),
    ] {
        db.execute(AssertSqlSafe(create)).await.unwrap();
    }
    let team = cluster.address().replace("/postgres?", "/team?");
    let mut db = PgConnection::connect(&team).await.unwrap();
    let mut command = fretwork(&["--workers", "1", "--memory-cache", "0"]);
    command.env("FRETWORK_DATABASE", &team).env("FRETWORK_DATABASE_DISK", dir.path());
    let server = Program::start_by(command, dir.path());
    assert_eq!(server.get("/readyz").await.status, 200);

    fill_database(&mut db).await;
    let mut refused = 0;
    for number in 0..40 {
        let body = ball(1.0 + f64::from(number) * 1e-3).to_string();
        let reply = send(server.address, "POST", "/v1/jobs", &[JSON], body).await.unwrap();
        refused += u32::from(reply.status == 507);
    }
    assert!(refused > 0, "the disk is not full");
    eventually(async || server.get("/readyz").await.status == 503).await;
    let problem = server.get("/readyz").await.problem(503, "not-ready");
    assert!(problem["detail"].as_str().unwrap().contains("no space is left"), "{problem}");
    let full = "fretwork_store_errors_total{kind=\"full\"}";
    assert!(metric(server.address, full).await >= f64::from(refused));
    // The metric is the free space of the directory that the settings name.
    assert!(metric(server.address, "fretwork_disk_free_bytes").await > 0.0);

    db.execute("DROP TABLE filler").await.unwrap();
    eventually(async || server.get("/readyz").await.status == 200).await;
    server.end();
}

/// A function that changes the data directory at a path.
type Change = fn(&Path);

/// This takes more than 5 s, because it starts several servers.
#[tokio::test(flavor = "multi_thread")]
async fn the_server_stops_writing_when_a_file_of_its_database_is_gone() {
    let changes: [(&str, Change, Change); 5] = [
        ("unlinked log", |dir| fs::remove_file(dir.join("fretwork.db-wal")).unwrap(), |_| ()),
        ("unlinked index", |dir| fs::remove_file(dir.join("fretwork.db-shm")).unwrap(), |_| ()),
        (
            "moved database",
            |dir| fs::rename(dir.join("fretwork.db"), dir.join("moved")).unwrap(),
            |dir| fs::rename(dir.join("moved"), dir.join("fretwork.db")).unwrap(),
        ),
        (
            "replaced database",
            |dir| {
                fs::copy(dir.join("fretwork.db"), dir.join("copy")).unwrap();
                fs::rename(dir.join("fretwork.db"), dir.join("moved")).unwrap();
                fs::rename(dir.join("copy"), dir.join("fretwork.db")).unwrap();
            },
            |dir| fs::rename(dir.join("moved"), dir.join("fretwork.db")).unwrap(),
        ),
        (
            "moved directory",
            |dir| fs::rename(dir, dir.with_extension("moved")).unwrap(),
            |dir| fs::rename(dir.with_extension("moved"), dir).unwrap(),
        ),
    ];
    for (what, change, back) in changes {
        let parent = TempDir::new().unwrap();
        let dir = parent.path().join("data");
        // The worker cannot store its result. With this option it gives up after 1 s.
        let command = fretwork(&["--workers", "1", "--drain-seconds", "1"]);
        let server = Program::start_by(command, &dir);
        let mut acknowledged = Vec::new();
        for number in 0..20 {
            let body = ball(1.0 + f64::from(number) * 1e-3).to_string();
            let reply = send(server.address, "POST", "/v1/jobs", &[JSON], body).await.unwrap();
            assert_eq!(reply.status, 202, "{}", reply.text());
            acknowledged.push(id(&reply.json()));
        }
        change(&dir);
        println!("{what}");
        eventually(async || server.get("/readyz").await.status == 503).await;
        let problem = server.get("/readyz").await.problem(503, "not-ready");
        assert!(problem["detail"].as_str().unwrap().contains("moved or replaced"), "{problem}");
        let reply = send(server.address, "POST", "/v1/jobs", &[JSON], ball(9.0).to_string()).await;
        reply.unwrap().problem(503, "not-ready");
        assert!(metric(server.address, "fretwork_store_errors_total{kind=\"moved\"}").await >= 2.0);

        // When the server ends, it saves everything that it has acknowledged.
        server.end();
        back(&dir);
        let server = Program::start(&dir, "1");
        for id in acknowledged {
            assert_eq!(server.ended(&id).await["state"], "succeeded", "{what}");
        }
        assert_eq!(metric(server.address, "fretwork_lost_commits").await, 0.0, "{what}");
        server.end();
    }
}

#[tokio::test]
async fn readyz_writes_at_most_every_two_seconds() {
    let server = Server::start().await;
    let written = async || -> Vec<u8> {
        assert_eq!(server.get("/readyz").await.status, 200);
        let query = sqlx::query_scalar("SELECT bytes FROM probe");
        query.fetch_one(&mut raw(server.dir.path()).await).await.unwrap()
    };
    let interval = Duration::from_secs(2);
    let begun = Instant::now();
    let first = written().await;
    let second = written().await;
    assert!(second == first || begun.elapsed() > interval);
    tokio::time::sleep(interval).await;
    assert!(written().await != second);
    assert_eq!(first.len(), 256 << 10, "about what a default result takes with its job");
}
