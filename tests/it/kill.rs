//! The program is killed while it computes. After the restart every acknowledged job is completed once, with
//! the same bytes.

use std::collections::{HashMap, HashSet};
use std::env;
use std::fs::{self, DirEntry};
use std::io;
use std::net::SocketAddr;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use fretwork_job::{Prepared, TaskKind};
use fretwork_store::check;
use fretwork_study::Kind;
use futures_util::future::join_all;
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::time::timeout;

use crate::keeping::eventually;
use crate::program::{Running, serve, serve_by};
use crate::server::{JSON, Reply, send, steel_ball};
use crate::store::{crash, raw};
use crate::studies::example;
use crate::team::{Listener, states};

/// The number of jobs.
const JOBS: u32 = 100;

/// A scenario that differs for each number. It takes at least 60 ms on one core of 2.5 GHz, almost all of it
/// in 90 inverse transforms of 2048 points.
pub fn long(number: u32) -> Value {
    let mut body = steel_ball();
    let scenario = &mut body["scenario"];
    scenario["motion"] = json!({"stick_ratio": 0.3 + 0.4 * f64::from(number) / 1024.0});
    scenario["cycles"] = json!({"from": 100, "to": 1e6, "count": 90, "spacing": "log"});
    scenario["profiles_at"] = json!("none");
    scenario["model"] = json!({"method": "simplified", "points": 2048});
    body
}

/// A running server. It is killed when this is dropped.
pub struct Program {
    pub child: Running,
    pub address: SocketAddr,
}

impl Program {
    pub fn start(dir: &Path, workers: &str) -> Self {
        Self::of(serve(dir, &["--workers", workers]))
    }

    /// Starts the program with two workers. It computes no run during which it has died.
    fn wary(dir: &Path) -> Self {
        Self::of(serve(dir, &["--workers", "2", "--crash-pause", "1h"]))
    }

    /// Starts the program by a command.
    pub fn start_by(command: Command, dir: &Path) -> Self {
        Self::of(serve_by(command, dir))
    }

    fn of((child, address): (Running, String)) -> Self {
        let address = address.strip_prefix("http://").unwrap().parse().unwrap();
        Self { child, address }
    }

    /// Sends SIGKILL: no handler runs and nothing is flushed.
    pub fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Sends SIGSTOP, and waits until all threads have stopped.
    async fn stop(&self) {
        self.signal("-STOP");
        let threads = format!("/proc/{}/task", self.child.id());
        let has_stopped = |thread: io::Result<DirEntry>| {
            let stat = fs::read_to_string(thread.unwrap().path().join("stat"));
            // A thread may have ended meanwhile.
            stat.is_ok_and(|stat| stat.contains(") T "))
        };
        eventually(async || fs::read_dir(&threads).unwrap().all(has_stopped)).await;
    }

    fn signal(&self, name: &str) {
        let id = self.child.id().to_string();
        assert!(Command::new("kill").args([name, &id]).status().unwrap().success());
    }

    /// Sends SIGTERM.
    pub fn tell_to_end(&self) {
        self.signal("-TERM");
    }

    /// Sends SIGTERM, and waits for a successful end.
    pub fn end(self) {
        self.tell_to_end();
        self.end_of_it();
    }

    /// Waits for a successful end after SIGTERM.
    pub fn end_of_it(mut self) {
        assert_eq!(self.child.wait().unwrap().code(), Some(0));
    }

    pub async fn get(&self, target: &str) -> Reply {
        send(self.address, "GET", target, &[], "").await.unwrap()
    }

    /// The id of an acknowledged job.
    async fn submit(&self, body: &Value) -> String {
        submit(self.address, body, &[]).await.unwrap()
    }

    /// All jobs that match a query, the newest first.
    pub async fn jobs(&self, query: &str) -> Vec<Value> {
        let mut jobs = Vec::new();
        let mut next = Some(format!("/v1/jobs?limit=200&{query}"));
        while let Some(target) = next {
            let mut page = self.get(&target).await.json();
            jobs.append(page["jobs"].as_array_mut().unwrap());
            next = page["next"].as_str().map(str::to_owned);
        }
        jobs
    }

    /// Waits until a job has ended.
    pub async fn ended(&self, id: &str) -> Value {
        loop {
            let job = self.get(&format!("/v1/jobs/{id}?wait=60")).await.json();
            if job["times"]["finished"].is_string() {
                return job;
            }
        }
    }

    pub async fn result(&self, job: &Value) -> Vec<u8> {
        let reply = self.get(job["links"]["result"].as_str().unwrap()).await;
        assert_eq!(reply.status, 200);
        reply.body
    }
}

pub fn id(job: &Value) -> String {
    job["id"].as_str().unwrap().to_owned()
}

/// Submits a job and returns its id, or an error if the server dies before it answers.
async fn submit(address: SocketAddr, body: &Value, headers: &[(&str, &str)]) -> io::Result<String> {
    let headers = [&[JSON], headers].concat();
    let reply = send(address, "POST", "/v1/jobs", &headers, body.to_string()).await?;
    let job = reply.json();
    assert!(matches!(reply.status, 200 | 202), "{job}");
    Ok(id(&job))
}

/// Asserts that a server that is not killed computes the same results from these job bodies.
pub async fn equal_undisturbed_results(results: impl IntoIterator<Item = (Value, Vec<u8>)>) {
    let dir = TempDir::new().unwrap();
    let server = Program::start(dir.path(), "2");
    let mut expected = Vec::new();
    for (body, result) in results {
        let id = submit(server.address, &body, &[]).await.unwrap();
        expected.push((body, id, result));
    }
    for (body, id, result) in expected {
        let job = server.ended(&id).await;
        assert!(server.result(&job).await == result, "the result of {body} differs");
    }
    server.end();
}

/// Asserts that each of this many keys has one run, which succeeded, and one result.
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
async fn every_acknowledged_job_is_completed_once_after_a_kill() {
    let dir = TempDir::new().unwrap();
    let server = Program::start(dir.path(), "1");
    let bodies: Vec<_> = (0..JOBS).map(long).collect();
    // Many jobs are submitted at once, so that the worker cannot keep up with them on a busy machine.
    let mut ids = Vec::new();
    for first in (0..bodies.len()).step_by(20) {
        ids.extend(
            join_all(bodies[first..first + 20].iter().map(|body| server.submit(body))).await,
        );
    }
    // Stops the server at a moment when it computes a run, and kills it.
    let mut interrupted: Vec<String> = Vec::new();
    eventually(async || {
        server.stop().await;
        // Inspect a copy, so that the next server is the first to open the database.
        let copy = crash(dir.path());
        let mut left = raw(copy.path()).await;
        let running = "SELECT lower(hex(key)) FROM run WHERE state = 'running'";
        interrupted = sqlx::query_scalar(running).fetch_all(&mut left).await.unwrap();
        let queued = "SELECT count(*) FROM job WHERE state = 'queued'";
        let queued: u32 = sqlx::query_scalar(queued).fetch_one(&mut left).await.unwrap();
        assert!(queued > 0, "the server has computed all jobs already");
        if interrupted.is_empty() {
            server.signal("-CONT");
        }
        !interrupted.is_empty()
    })
    .await;
    server.kill();
    assert_eq!(interrupted.len(), 1, "one worker computes one run");

    let server = Program::start(dir.path(), "1");
    let mut results = Vec::new();
    for (body, id) in bodies.into_iter().zip(&ids) {
        let job = server.ended(id).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        let attempt = if job["key"] == interrupted[0] { 2 } else { 1 };
        assert_eq!(job["attempt"], attempt, "{job}");
        results.push((body, server.result(&job).await));
    }
    server.end();
    each_key_was_completed_once(dir.path(), JOBS).await;
    equal_undisturbed_results(results).await;
}

/// A random generator (splitmix64) with a fixed seed, so that failures can be repeated.
pub struct Dice(pub u64);

impl Dice {
    pub fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % limit
    }
}

/// A client that uses the server while it is killed again and again, and records its requests.
struct Client {
    name: String,
    dice: Dice,
    asked: Vec<Asked>,
}

/// A submission.
struct Asked {
    number: u32,
    /// The Idempotency-Key.
    name: String,
    /// Whether it has the tag by which many jobs are canceled at once.
    tagged: bool,
    /// `None` before it is acknowledged.
    id: Option<String>,
    /// Whether the client has asked to cancel it.
    canceled: bool,
    /// Whether the client has asked to delete it.
    deleted: bool,
    /// The states that were received as events.
    heard: Vec<String>,
}

impl Client {
    fn new(number: u64, seed: u64) -> Self {
        let dice = Dice(seed.wrapping_mul(1000) + number);
        Self { name: format!("client-{number}"), dice, asked: Vec::new() }
    }

    /// Sends one request after another until the server dies.
    async fn live(mut self, address: SocketAddr, numbers: u32) -> Self {
        while self.act(address, numbers).await.is_ok() {
            // A random pause; nothing depends on its length.
            tokio::time::sleep(Duration::from_micros(self.dice.below(10_000))).await;
        }
        self
    }

    async fn act(&mut self, address: SocketAddr, numbers: u32) -> io::Result<()> {
        if let Some(lost) = self.asked.iter().position(|asked| asked.id.is_none()) {
            // The server may have received this submission although its answer was lost. The idempotency key prevents
            // a second job.
            return self.send(address, lost).await;
        }
        let some = self.dice.below(self.asked.len().max(1) as u64) as usize;
        let act = if self.asked.is_empty() { 0 } else { self.dice.below(10) };
        match act {
            0..4 => self.ask(address, numbers, false).await,
            4 => self.send(address, some).await,
            5 => self.cancel(address, some).await,
            6 => self.ask(address, numbers, true).await,
            7 => self.cancel_tagged(address).await,
            8 => self.delete(address, some).await,
            _ => self.listen(address, some).await,
        }
    }

    /// Submits a scenario, which may be new or the same as that of another client.
    async fn ask(&mut self, address: SocketAddr, numbers: u32, tagged: bool) -> io::Result<()> {
        let number = self.dice.below(numbers.into()) as u32;
        let name = format!("{}-{}", self.name, self.asked.len());
        let (canceled, deleted, heard) = (false, false, Vec::new());
        self.asked.push(Asked { number, name, tagged, id: None, canceled, deleted, heard });
        self.send(address, self.asked.len() - 1).await
    }

    /// Sends a submission, possibly not for the first time.
    async fn send(&mut self, address: SocketAddr, some: usize) -> io::Result<()> {
        let asked = &mut self.asked[some];
        if asked.deleted {
            // The deletion has freed the idempotency key, so another submission would create a new job.
            return Ok(());
        }
        let mut body = long(asked.number);
        body["tags"] = json!([if asked.tagged { &self.name } else { "single" }]);
        let id = submit(address, &body, &[("Idempotency-Key", &asked.name)]).await?;
        assert_eq!(*asked.id.get_or_insert_with(|| id.clone()), id, "{} is two jobs", asked.name);
        Ok(())
    }

    async fn cancel(&mut self, address: SocketAddr, some: usize) -> io::Result<()> {
        let asked = &mut self.asked[some];
        asked.canceled = true;
        let path = format!("/v1/jobs/{}/cancel", asked.id.as_ref().unwrap());
        let status = send(address, "POST", &path, &[], "").await?.status;
        assert!(status == 200 || asked.deleted, "{status}");
        Ok(())
    }

    async fn cancel_tagged(&mut self, address: SocketAddr) -> io::Result<()> {
        for asked in self.asked.iter_mut().filter(|asked| asked.tagged) {
            asked.canceled = true;
        }
        let path = format!("/v1/jobs/cancel?tag={}", self.name);
        assert_eq!(send(address, "POST", &path, &[], "").await?.status, 200);
        Ok(())
    }

    async fn delete(&mut self, address: SocketAddr, some: usize) -> io::Result<()> {
        let asked = &mut self.asked[some];
        let path = format!("/v1/jobs/{}", asked.id.as_ref().unwrap());
        let reply = send(address, "GET", &path, &[], "").await?;
        if reply.status == 200 && reply.json()["times"]["finished"].is_string() {
            asked.deleted = true;
            assert_eq!(send(address, "DELETE", &path, &[], "").await?.status, 204);
        }
        Ok(())
    }

    /// Reads events for a short time, starting after the last event that it has received.
    async fn listen(&mut self, address: SocketAddr, some: usize) -> io::Result<()> {
        let asked = &mut self.asked[some];
        let (id, last) = (asked.id.as_ref().unwrap(), asked.heard.len() as u32);
        let mut listener = Listener::connect(address, id, Some(last)).await?;
        let moment = Duration::from_micros(self.dice.below(50_000));
        let _ = timeout(moment, listener.until(|_| false)).await;
        for (number, state) in states(&listener.events()) {
            asked.heard.push(state.to_owned());
            assert_eq!(number as usize, asked.heard.len(), "{:?}", asked.heard);
        }
        Ok(())
    }

    /// Asserts that every acknowledged job ended once in a permitted state. Collects the results.
    async fn check(&self, server: &Program, results: &mut HashMap<u32, Vec<u8>>) {
        for asked in self.asked.iter().filter(|asked| !asked.deleted) {
            let Some(id) = &asked.id else { continue };
            let job = server.ended(id).await;
            let state = job["state"].as_str().unwrap();
            let good = state == "succeeded" || asked.canceled && state == "canceled";
            assert!(good, "{} of {}: {job}", asked.name, asked.number);
            let events = Listener::connect(server.address, id, None).await.unwrap();
            let events = { events }.until(|_| false).await;
            let all: Vec<_> = states(&events).iter().map(|(_, state)| *state).collect();
            let ends = all.iter().filter(|state| ["succeeded", "canceled"].contains(state));
            assert_eq!((ends.count(), all.last()), (1, Some(&state)), "{all:?}");
            assert!(all.iter().zip(&asked.heard).all(|(told, heard)| told == heard), "{all:?}");
            if state == "succeeded" && !results.contains_key(&asked.number) {
                results.insert(asked.number, server.result(&job).await);
            }
        }
    }
}

/// The ids of the jobs whose run was interrupted when the last server died.
async fn interrupted(server: &Program) -> Vec<String> {
    let mut jobs = server.jobs("state=queued").await;
    jobs.extend(server.jobs("state=running").await);
    let was = |job: &&Value| job["attempt"].as_u64() > Some(u64::from(job["state"] == "running"));
    jobs.iter().filter(was).map(id).collect()
}

/// Asserts that every run has ended, and that no key was completed twice.
async fn no_key_was_completed_twice(dir: &Path) {
    let mut db = raw(dir).await;
    let counts: (u32, u32, u32) = sqlx::query_as(
        "SELECT (SELECT count(*) FROM run WHERE state NOT IN ('succeeded', 'canceled')),
            (SELECT max(n) FROM (
                SELECT count(*) FILTER (WHERE state = 'succeeded') AS n FROM run GROUP BY key
            )),
            (SELECT count(*) FROM result LEFT JOIN result_blob USING (key) WHERE body IS NULL)",
    )
    .fetch_one(&mut db)
    .await
    .unwrap();
    assert_eq!(counts, (0, 1, 0));
    assert_eq!(check(dir).await.unwrap().damage, []);
}

#[tokio::test(flavor = "multi_thread")]
async fn repeated_kills_under_load_lose_no_job_and_change_no_result() {
    // By default a tenth of the rounds; tests/long runs all.
    let kills = if env::var_os("FRETWORK_TEST_LONG").is_some() { 100 } else { 10 };
    let dir = TempDir::new().unwrap();
    let seed = env::var("FRETWORK_TEST_SEED").map_or(1, |seed| seed.parse().unwrap());
    let mut dice = Dice(seed);
    let mut clients: Vec<_> = (1..=3).map(|number| Client::new(number, seed)).collect();
    let (mut kill, mut met) = (0, 0);
    // More rounds follow if by chance no kill has interrupted a run.
    while kill < kills || met == 0 && kill < 10 * kills {
        kill += 1;
        let server = Program::start(dir.path(), "1");
        // A run fails after three crashes. So each server lives until the run that the last one left
        // unfinished has ended.
        for id in interrupted(&server).await {
            server.ended(&id).await;
            met += 1;
        }
        // Each round adds a few scenarios, so most submissions repeat an earlier one.
        let (address, numbers) = (server.address, 3 * kill);
        let living = clients.drain(..).map(|client| tokio::spawn(client.live(address, numbers)));
        let living: Vec<_> = living.collect();
        // A random pause; nothing depends on its length.
        tokio::time::sleep(Duration::from_micros(dice.below(150_000))).await;
        server.kill();
        for client in living {
            clients.push(client.await.unwrap());
        }
    }
    assert!(met > 0, "no kill interrupted a run");
    let server = Program::start(dir.path(), "1");
    let mut results = HashMap::new();
    for client in &clients {
        client.check(&server, &mut results).await;
    }
    // A repeated submission whose answer was lost must not have created a second job.
    let asked = || clients.iter().flat_map(|client| &client.asked);
    let known: HashSet<_> = asked().filter_map(|asked| asked.id.clone()).collect();
    let lost = asked().filter(|asked| asked.id.is_none()).count();
    let unknown: Vec<_> = server.jobs("").await.into_iter().map(|job| id(&job)).collect();
    let unknown = unknown.iter().filter(|id| !known.contains(*id)).count();
    assert!(unknown <= lost, "{unknown} jobs that no client knows, {lost} answers lost at the end");
    server.end();
    no_key_was_completed_twice(dir.path()).await;
    equal_undisturbed_results(results.into_iter().map(|(number, result)| (long(number), result)))
        .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn kills_in_quick_succession_fail_no_run() {
    let rounds = if env::var_os("FRETWORK_TEST_LONG").is_some() { 100 } else { 2 };
    let seed = env::var("FRETWORK_TEST_SEED").map_or(1, |seed| seed.parse().unwrap());
    let (mut dice, mut round, mut met) = (Dice(seed), 0, 0);
    // More rounds follow if by chance no kill has interrupted a run.
    while round < rounds || met == 0 {
        round += 1;
        let dir = TempDir::new().unwrap();
        let mut server = Program::wary(dir.path());
        let bodies: Vec<_> = (0..30).map(long).collect();
        let ids = join_all(bodies.iter().map(|body| server.submit(body))).await;
        for _ in 0..3 {
            // A random pause; nothing depends on its length.
            tokio::time::sleep(Duration::from_millis(60 + dice.below(940))).await;
            server.kill();
            server = Program::wary(dir.path());
        }
        server.kill();
        server = Program::start(dir.path(), "2");
        for id in &ids {
            let job = server.ended(id).await;
            assert_eq!(job["state"], "succeeded", "{job}");
            let attempt = job["attempt"].as_u64().unwrap();
            assert!(attempt <= 2, "a run is not lost again while it waits: {job}");
            met += attempt - 1;
        }
        server.end();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_run_that_kills_the_process_fails_alone() {
    let dir = TempDir::new().unwrap();
    let mut server = Program::start(dir.path(), "2");
    let mut fatal = long(0);
    fatal["scenario"]["cycles"]["count"] = json!(1000);
    let fatal = server.submit(&fatal).await;
    let others: Vec<_> = (1..20).map(long).collect();
    let others = join_all(others.iter().map(|body| server.submit(body))).await;
    let mut kills = 0;
    let failed = loop {
        let job = server.get(&format!("/v1/jobs/{fatal}")).await.json();
        match job["state"].as_str().unwrap() {
            "running" => {
                // As if the run had ended the process.
                server.kill();
                kills += 1;
                server = Program::start(dir.path(), "2");
            }
            "queued" => tokio::task::yield_now().await,
            _ => break job,
        }
    };
    assert_eq!((failed["state"].as_str(), kills), (Some("failed"), 3), "{failed}");
    assert_eq!(failed["error"]["type"], "/problems/worker-lost");
    for id in &others {
        let job = server.ended(id).await;
        assert_eq!(job["state"], "succeeded", "{job}");
    }
    server.end();
}

/// This takes more than 5 s, because the server starts ten times, and the fit is computed twice.
#[tokio::test(flavor = "multi_thread")]
async fn a_fit_that_is_killed_ten_times_has_the_same_bytes() {
    let mut body = example("fit");
    body["fit"]["starts"] = json!(3);
    let kind = TaskKind::Study(Kind::named("fit").unwrap());
    let mut dice = Dice(1);
    for workers in ["1", "4"] {
        let dir = TempDir::new().unwrap();
        let mut server = Program::start(dir.path(), workers);
        let mut kills = 0;
        // On a busy machine a fit can end before it was killed ten times. Then another one follows.
        while kills < 10 {
            body["fit"]["confidence"] = json!(0.95 - 0.01 * f64::from(kills));
            let undisturbed =
                Prepared::read(kind, body["fit"].clone()).unwrap().compute(|_| {}).body;
            let id = submit(server.address, &body, &[]).await.unwrap();
            let mut next = 0.0;
            let job = loop {
                let job = server.get(&format!("/v1/jobs/{id}")).await.json();
                if !job["times"]["finished"].is_null() {
                    break job;
                }
                // A run fails if one chunk crashes three times. So the fit makes progress between two kills.
                let progress = job["progress"].as_f64().unwrap();
                if kills < 10 && progress > next {
                    // A random pause; nothing depends on its length.
                    tokio::time::sleep(Duration::from_micros(dice.below(20_000))).await;
                    server.kill();
                    server = Program::start(dir.path(), workers);
                    (kills, next) = (kills + 1, progress + 1.0 / 12.0);
                }
            };
            assert_eq!(job["state"], "succeeded", "{job}");
            assert_eq!(server.result(&job).await, undisturbed);
        }
        server.end();
    }
}
