//! The disk is full again and again, at random moments under load. No acknowledged job is lost, `/readyz` tells, lists
//! can be read, and the service resumes.

use std::collections::HashMap;
use std::env;
use std::fs;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::sync::watch;
use tokio::task::JoinSet;

use crate::faults::{fill, mounting};
use crate::kill::{Dice, Program, id};
use crate::server::{JSON, Server, ball, send};
use crate::store::raw;

/// `/readyz` must tell within this time, and the service must resume within it.
const BOUND: Duration = Duration::from_secs(5);

/// What the clients share.
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

/// Waits until something holds, but not longer than [`BOUND`].
async fn within_bound(what: &str, mut holds: impl AsyncFnMut() -> bool) {
    let begun = Instant::now();
    while !holds().await {
        assert!(begun.elapsed() < BOUND, "{what} took longer than {BOUND:?}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// Fills the disk until `/readyz` tells, and frees it again.
async fn one_full_disk(server: &Program, filler: &Path, shared: &Shared) {
    let accepted = || shared.accepted.load(Ordering::SeqCst);
    let refused = || shared.refused.load(Ordering::SeqCst);
    let (mut since, mut before) = (Instant::now(), (accepted(), refused()));
    loop {
        // The server writes meanwhile, so the last blocks may be its own.
        fill(filler);
        let reply = server.get("/readyz").await;
        if reply.status != 200 {
            let problem = reply.problem(503, "not-ready");
            assert!(problem["detail"].as_str().unwrap().contains("no space is left"), "{problem}");
            break;
        }
        // Jobs are accepted on a full disk while the log has space that is used again.
        if accepted() > before.0 || refused() == before.1 {
            (since, before) = (Instant::now(), (accepted(), refused()));
        }
        assert!(since.elapsed() < BOUND, "/readyz is 200 while every submission is refused");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    for list in ["/v1/results?sort=-wear_volume", "/v1/results?pinned=false", "/v1/jobs"] {
        assert_eq!(server.get(list).await.status, 200, "{list}");
    }
    fs::remove_file(filler).unwrap();
    within_bound("the return of the service", async || {
        let before = (accepted(), refused());
        tokio::time::sleep(Duration::from_millis(100)).await;
        accepted() > before.0 && refused() == before.1
    })
    .await;
    within_bound("a /readyz that is ready", async || server.get("/readyz").await.status == 200)
        .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn full_disks_at_random_moments_lose_no_acknowledged_job() {
    // tests/long runs all.
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
    let refused = shared.refused.load(Ordering::SeqCst) as usize;
    assert!(
        acknowledged.len() > 5 * disks && refused >= disks,
        "{}, {refused}",
        acknowledged.len()
    );
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
