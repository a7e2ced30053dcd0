//! The real program, killed while it computes: what was acknowledged is done after the restart,
//! once, with the same bytes.

use std::collections::HashMap;
use std::env;
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, Command};
use std::time::Duration;

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::program::serve;
use crate::server::{JSON, Reply, send, steel_ball};
use crate::store::{crash, raw};

/// How many jobs there are.
const JOBS: u32 = 200;

/// One of many scenarios, all different. Measured on one core of 2.5 GHz: at least 60 ms each,
/// about all of it in the 90 inverse transforms of 2048 points.
fn long(number: u32) -> String {
    let mut body = steel_ball();
    let scenario = &mut body["scenario"];
    scenario["motion"] = json!({"stick_ratio": 0.3 + 0.4 * f64::from(number) / 1024.0});
    scenario["cycles"] = json!({"from": 100, "to": 1e6, "count": 90, "spacing": "log"});
    scenario["profiles_at"] = json!("none");
    scenario["model"] = json!({"points": 2048});
    body.to_string()
}

/// A running server; it is killed in any case.
struct Program {
    child: Child,
    address: SocketAddr,
}

impl Program {
    fn start(dir: &Path, workers: &str) -> Self {
        let (child, address) = serve(dir, &["--workers", workers]);
        let address = address.strip_prefix("http://").unwrap().parse().unwrap();
        Self { child, address }
    }

    /// SIGKILL: no handler runs, nothing is flushed.
    fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// SIGTERM, and the end that comes of it.
    fn end(mut self) {
        let id = self.child.id().to_string();
        assert!(Command::new("kill").args(["-TERM", &id]).status().unwrap().success());
        assert_eq!(self.child.wait().unwrap().code(), Some(0));
    }

    async fn get(&self, target: &str) -> Reply {
        send(self.address, "GET", target, &[], "").await.unwrap()
    }

    /// The id of an acknowledged job.
    async fn submit(&self, number: u32) -> String {
        submit(self.address, number).await.unwrap()
    }

    /// The ids of the jobs in a state, the newest first.
    async fn having(&self, state: &str) -> Vec<String> {
        let mut ids = Vec::new();
        let mut next = Some(format!("/v1/jobs?limit=200&state={state}"));
        while let Some(target) = next {
            let page = self.get(&target).await.json();
            let jobs = page["jobs"].as_array().unwrap();
            ids.extend(jobs.iter().map(|job| job["id"].as_str().unwrap().to_owned()));
            next = page["next"].as_str().map(str::to_owned);
        }
        ids
    }

    /// The job, once it has ended.
    async fn ended(&self, id: &str) -> Value {
        loop {
            let job = self.get(&format!("/v1/jobs/{id}?wait=60")).await.json();
            if job["times"]["finished"].is_string() {
                return job;
            }
        }
    }

    async fn result(&self, job: &Value) -> Vec<u8> {
        let reply = self.get(job["links"]["result"].as_str().unwrap()).await;
        assert_eq!(reply.status, 200);
        reply.body
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // It has ended, or a test has failed.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// None if the server died before it acknowledged.
async fn submit(address: SocketAddr, number: u32) -> Option<String> {
    let reply = send(address, "POST", "/v1/jobs", &[JSON], long(number)).await.ok()?;
    let job = reply.json();
    assert!(matches!(reply.status, 200 | 202), "{job}");
    Some(job["id"].as_str().unwrap().to_owned())
}

/// Asserts that the results, by number, are those of a server that nobody disturbs.
async fn are_undisturbed(results: HashMap<u32, Vec<u8>>) {
    let dir = TempDir::new().unwrap();
    let server = Program::start(dir.path(), "2");
    let mut ids = Vec::new();
    for number in results.keys() {
        ids.push((number, server.submit(*number).await));
    }
    for (number, id) in ids {
        let job = server.ended(&id).await;
        assert!(server.result(&job).await == results[number], "the result of {number} differs");
    }
    server.end();
}

/// Asserts that each of so many keys has one run and one result, and that it ended well.
async fn each_key_was_completed_once(dir: &Path, keys: u32) {
    let mut db = raw(dir).await;
    let counts: (u32, u32, u32, u32) = sqlx::query_as(
        "SELECT count(*), count(DISTINCT key), count(*) FILTER (WHERE state = 'succeeded'),
            (SELECT count(*) FROM result) FROM run",
    )
    .fetch_one(&mut db)
    .await
    .unwrap();
    assert_eq!(counts, (keys, keys, keys, keys));
}

#[tokio::test(flavor = "multi_thread")]
async fn after_a_kill_every_acknowledged_job_is_done_once_and_as_if_nothing_had_been() {
    let dir = TempDir::new().unwrap();
    let server = Program::start(dir.path(), "1");
    let mut ids = Vec::new();
    for number in 0..JOBS {
        ids.push(server.submit(number).await);
    }
    // The moment after another run has begun: it is interrupted, and not between two runs.
    let before = server.having("running").await;
    loop {
        let running = server.having("running").await;
        if !running.is_empty() && running != before {
            break;
        }
        for id in running {
            server.ended(&id).await;
        }
    }
    server.kill();

    // A copy, so that it is the next server that finds what the last one left.
    let copy = crash(dir.path());
    let mut left = raw(copy.path()).await;
    let running = "SELECT lower(hex(key)) FROM run WHERE state = 'running'";
    let interrupted: Vec<String> = sqlx::query_scalar(running).fetch_all(&mut left).await.unwrap();
    let unfinished: u32 = sqlx::query_scalar("SELECT count(*) FROM job WHERE finished IS NULL")
        .fetch_one(&mut left)
        .await
        .unwrap();
    assert_eq!(interrupted.len(), 1, "one worker, one run");
    assert!(unfinished >= JOBS / 2, "only {unfinished} of {JOBS} were unfinished");

    let server = Program::start(dir.path(), "1");
    let mut results = HashMap::new();
    for (number, id) in (0..JOBS).zip(&ids) {
        let job = server.ended(id).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        let attempt = if job["key"] == interrupted[0] { 2 } else { 1 };
        assert_eq!(job["attempt"], attempt, "{job}");
        results.insert(number, server.result(&job).await);
    }
    server.end();
    each_key_was_completed_once(dir.path(), JOBS).await;
    are_undisturbed(results).await;
}

/// A small generator, so that a failure comes again: splitmix64.
struct Dice(u64);

impl Dice {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % limit
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn kills_at_any_moment_lose_nothing_and_change_no_result() {
    // A tenth of it by default; tests/long runs all.
    let long = env::var_os("FRETWORK_TEST_LONG").is_some();
    let (most, jobs) = if long { (10, JOBS) } else { (2, JOBS / 10) };
    let dir = TempDir::new().unwrap();
    let mut dice = Dice(env::var("FRETWORK_TEST_SEED").map_or(1, |seed| seed.parse().unwrap()));
    let mut ids = HashMap::new();
    let mut kills = 0;
    while kills < most || ids.len() < jobs as usize {
        let server = Program::start(dir.path(), "1");
        // A run that kills its server three times is given up. These did not, so each server lives
        // until the run that its predecessor left has ended: it is the first that is computed.
        let mut unfinished = server.having("queued").await;
        unfinished.extend(server.having("running").await);
        if let Some(oldest) = unfinished.iter().min() {
            server.ended(oldest).await;
        }
        // Jobs keep coming while the server dies. What it did not acknowledge is sent to the next.
        let missing: Vec<u32> = (0..jobs).filter(|number| !ids.contains_key(number)).collect();
        let address = server.address;
        let share = if kills < most { jobs as usize / most } else { missing.len() };
        let submitting = tokio::spawn(async move {
            let mut acknowledged = Vec::new();
            for number in missing.into_iter().take(share) {
                match submit(address, number).await {
                    Some(id) => acknowledged.push((number, id)),
                    None => break,
                }
            }
            acknowledged
        });
        if kills < most {
            // It stands for chance, nothing is waited for.
            tokio::time::sleep(Duration::from_micros(dice.below(150_000))).await;
            server.kill();
            kills += 1;
            ids.extend(submitting.await.unwrap());
        } else {
            ids.extend(submitting.await.unwrap());
            server.end();
        }
    }
    let server = Program::start(dir.path(), "1");
    let mut results = HashMap::new();
    let mut again = 0;
    for (number, id) in &ids {
        let job = server.ended(id).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        again += job["attempt"].as_u64().unwrap() - 1;
        results.insert(*number, server.result(&job).await);
    }
    // The clean end of a server between may have let go of one more. Of many kills one meets a run.
    let expected = u64::from(long)..=most as u64 + 1;
    assert!(expected.contains(&again), "{again} interrupted runs from {kills} kills");
    server.end();
    each_key_was_completed_once(dir.path(), jobs).await;
    are_undisturbed(results).await;
}
