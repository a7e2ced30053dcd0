//! Many clients of one server: events, repeated submissions, fairness, metrics.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use fretwork::http::Settings;
use fretwork_job::Task;
use fretwork_store::Options;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;

use crate::keeping::eventually;
use crate::server::{Gate, JSON, Reply, Server, ball, metric, steel_ball};

async fn gated() -> (Server, Gate) {
    let gate = Gate::default();
    let settings = Settings::default();
    (Server::with(gate.compute(), &settings, &Options::default()).await, gate)
}

async fn submit(server: &Server, amplitude: f64, headers: &[(&str, &str)]) -> Reply {
    let headers = [&[JSON], headers].concat();
    server.send("POST", "/v1/jobs", &headers, ball(amplitude).to_string()).await
}

fn id(reply: &Reply) -> String {
    reply.json()["id"].as_str().unwrap().to_owned()
}

/// An event: its name, its id if it has one, and its data.
pub type Event = (String, Option<u32>, Value);

/// A listener to the events of a job.
pub struct Listener {
    connection: TcpStream,
    text: String,
}

impl Listener {
    async fn start(address: SocketAddr, id: &str, last: Option<u32>) -> Self {
        Self::connect(address, id, last).await.unwrap()
    }

    /// Fails if the server has ended.
    pub async fn connect(address: SocketAddr, id: &str, last: Option<u32>) -> io::Result<Self> {
        let mut connection = TcpStream::connect(address).await?;
        let last = last.map_or_else(String::new, |last| format!("Last-Event-ID: {last}\r\n"));
        let head = format!("GET /v1/jobs/{id}/events HTTP/1.1\r\nHost: localhost\r\n{last}\r\n");
        connection.write_all(head.as_bytes()).await?;
        Ok(Self { connection, text: String::new() })
    }

    /// The events so far, once they satisfy `enough` or the stream has ended.
    pub async fn until(&mut self, enough: impl Fn(&[Event]) -> bool) -> Vec<Event> {
        loop {
            let events = self.events();
            if enough(&events) {
                return events;
            }
            let mut buffer = [0; 4096];
            // The death of the server ends the stream too.
            let length = self.connection.read(&mut buffer).await.unwrap_or(0);
            self.text.push_str(std::str::from_utf8(&buffer[..length]).unwrap());
            // The last chunk of a chunked body is empty.
            if length == 0 || self.text.ends_with("\r\n0\r\n\r\n") {
                return self.events();
            }
        }
    }

    pub fn events(&self) -> Vec<Event> {
        let Some((_, body)) = self.text.split_once("\r\n\r\n") else { return Vec::new() };
        // Chunk sizes are on lines of their own, which are not parts of events.
        let blocks = body.split("\n\n").filter(|block| block.contains("data: "));
        let parse = |block: &str| {
            let field = |name| {
                block
                    .lines()
                    .find_map(|line| line.strip_prefix(name))
                    .map(str::trim)
                    .map(str::to_owned)
            };
            let data = serde_json::from_str(&field("data: ")?).ok()?;
            Some((field("event: ")?, field("id: ").map(|id| id.parse().unwrap()), data))
        };
        blocks.filter_map(parse).collect()
    }
}

pub fn states(events: &[Event]) -> Vec<(u32, &str)> {
    let states = events.iter().filter(|(name, ..)| name == "state");
    states.map(|(_, id, data)| (id.unwrap(), data["state"].as_str().unwrap())).collect()
}

pub fn has(events: &[Event], name: &str) -> bool {
    events.iter().any(|(event, ..)| event == name)
}

#[tokio::test]
async fn a_listener_that_reconnects_receives_every_state_exactly_once() {
    let (server, gate) = gated().await;
    let id = id(&submit(&server, 2.0, &[]).await);
    let mut listener = Listener::start(server.address, &id, None).await;
    let halfway = |events: &[Event]| events.iter().any(|(.., data)| data["progress"] == 0.5);
    let events = listener.until(halfway).await;
    assert_eq!(events[0].0, "snapshot");
    assert_eq!((&events[0].1, &events[0].2["id"]), (&None, &json!(id)));
    assert_eq!(states(&events), [(1, "queued"), (2, "running")]);
    let mut progress = events.iter().filter(|(name, ..)| name == "progress");
    assert!(progress.all(|(_, id, data)| id.is_none() && data["attempt"] == 1));
    let head = listener.text.split_once("\r\n\r\n").unwrap().0.to_ascii_lowercase();
    for line in ["content-type: text/event-stream", "x-accel-buffering: no", "no-store"] {
        assert!(head.contains(line), "{head}");
    }
    drop(listener);
    gate.open();
    let mut listener = Listener::start(server.address, &id, Some(2)).await;
    let events = listener.until(|_| false).await;
    assert_eq!(states(&events), [(3, "succeeded")]);
    let last = &events.last().unwrap().2;
    assert_eq!(last["job"]["state"], "succeeded");
    assert_eq!(last["job"]["summary"]["wear_volume"], 2.5e-13);
    // A client that has received all events gets 204, so that it stops.
    let path = format!("/v1/jobs/{id}/events");
    let reply = server.send("GET", &path, &[("Last-Event-ID", "3")], "").await;
    assert_eq!((reply.status, reply.body.len()), (204, 0));
    // A listener without an event id, or with an unknown one, receives all events.
    for last in [None, Some(77)] {
        let events = Listener::start(server.address, &id, last).await.until(|_| false).await;
        assert_eq!(states(&events), [(1, "queued"), (2, "running"), (3, "succeeded")]);
    }
    server
        .get("/v1/jobs/0190a6a0-0000-7000-8000-000000000000/events")
        .await
        .problem(404, "not-found");
}

#[tokio::test(flavor = "multi_thread")]
async fn stalled_listeners_do_not_delay_five_hundred_others() {
    let (server, gate) = gated().await;
    let id = id(&submit(&server, 2.0, &[]).await);
    // These listeners never read the answer.
    let mut silent = Vec::new();
    for _ in 0..20 {
        silent.push(Listener::start(server.address, &id, None).await);
    }
    let mut listeners = Vec::new();
    for _ in 0..500 {
        listeners.push(Listener::start(server.address, &id, None).await);
    }
    for listener in &mut listeners {
        listener.until(|events| has(events, "snapshot")).await;
    }
    gate.open();
    for mut listener in listeners {
        let events = listener.until(|_| false).await;
        assert_eq!(states(&events), [(1, "queued"), (2, "running"), (3, "succeeded")]);
    }
    let job = server.get(&format!("/v1/jobs/{id}")).await.json();
    assert_eq!((&job["attempt"], &job["origin"]), (&json!(1), &json!("computed")));
    drop(silent);
}

#[tokio::test]
async fn event_streams_end_at_shutdown() {
    let (server, gate) = gated().await;
    let first = id(&submit(&server, 2.0, &[]).await);
    let mut listener = Listener::start(server.address, &first, None).await;
    listener.until(|events| has(events, "progress")).await;
    server.service.drain();
    let events = listener.until(|_| false).await;
    assert_eq!(states(&events).len(), 2, "the next server sends the rest");
    server.get("/readyz").await.problem(503, "not-ready");
    gate.open();
}

#[tokio::test]
async fn an_idempotency_key_creates_one_job_and_refuses_another_scenario() {
    let (server, gate) = gated().await;
    let name = ("Idempotency-Key", "\"8e03978e-40d5-43dd-bc93-6894a57f9324\"");
    let first = submit(&server, 2.0, &[name]).await;
    assert_eq!(first.status, 202);
    // The idempotency key may be quoted.
    let bare = ("Idempotency-Key", "8e03978e-40d5-43dd-bc93-6894a57f9324");
    let again = submit(&server, 2.0, &[bare]).await;
    assert_eq!((again.status, id(&again)), (202, id(&first)));
    submit(&server, 3.0, &[name]).await.problem(422, "idempotency-key-reused");
    let long = "x".repeat(300);
    let problem = submit(&server, 3.0, &[("Idempotency-Key", &long)]).await;
    let problem = problem.problem(422, "invalid-parameters");
    assert_eq!(problem["errors"][0]["parameter"], "Idempotency-Key");
    gate.open();
    let done = submit(&server, 2.0, &[name, ("Prefer", "wait=60")]).await;
    assert_eq!((done.status, id(&done)), (200, id(&first)));
    assert_eq!(server.get("/v1/jobs").await.json()["jobs"].as_array().unwrap().len(), 1);
}

#[tokio::test]
async fn cache_control_can_bypass_the_cache_or_require_it() {
    let server = Server::with(Gate::opened(), &Settings::default(), &Options::default()).await;
    let only = ("Cache-Control", "only-if-cached");
    submit(&server, 2.0, &[only]).await.problem(504, "not-cached");
    assert!(server.get("/v1/jobs").await.json()["jobs"].as_array().unwrap().is_empty());
    let wait = ("Prefer", "wait=60");
    submit(&server, 2.0, &[wait]).await;
    let hit = submit(&server, 2.0, &[only]).await;
    assert_eq!((hit.status, hit.header("cache-status")), (200, Some("fretwork; hit")));
    let again = submit(&server, 2.0, &[wait, ("Cache-Control", "no-cache")]).await;
    assert_eq!(again.header("cache-status"), Some("fretwork; fwd=request"));
    assert_eq!(again.json()["origin"], "computed");
    assert!(metric(server.address, "fretwork_recomputes_total{result=\"same\"}").await >= 1.0);
}

#[tokio::test]
async fn a_metric_counts_results_that_differ_when_computed_again() {
    let server = Server::with(Gate::opened(), &Settings::default(), &Options::default()).await;
    let wait = ("Prefer", "wait=60");
    let job = submit(&server, 2.0, &[wait]).await.json();
    let differs = "fretwork_recomputes_total{result=\"differs\"}";
    assert_eq!(metric(server.address, differs).await.to_bits(), 0f64.to_bits());
    // Change the stored digest, as if a faulty machine had computed the first result.
    let mut db = crate::store::raw(server.dir.path()).await;
    sqlx::query("UPDATE result SET digest = zeroblob(32)").execute(&mut db).await.unwrap();
    let again = submit(&server, 2.0, &[wait, ("Cache-Control", "no-cache")]).await.json();
    assert_eq!(again["key"], job["key"]);
    assert_eq!(metric(server.address, differs).await.to_bits(), 1f64.to_bits());
}

#[tokio::test]
async fn metrics_show_a_stuck_queue() {
    let (server, gate) = gated().await;
    for number in 0..4 {
        submit(&server, 2.0 + f64::from(number), &[]).await;
    }
    // Both workers are blocked, so the waiting time grows and no run ends.
    let old = "fretwork_queue_oldest_seconds";
    eventually(async || metric(server.address, "fretwork_running_runs").await >= 2.0).await;
    while metric(server.address, old).await < 0.05 {}
    assert_eq!(metric(server.address, "fretwork_queued_runs").await.to_bits(), 2f64.to_bits());
    assert_eq!(metric(server.address, "fretwork_running_runs").await.to_bits(), 2f64.to_bits());
    let ended = "fretwork_runs_total{outcome=\"succeeded\"}";
    assert_eq!(metric(server.address, ended).await.to_bits(), 0f64.to_bits());
    let ready = server.get("/readyz").await.json();
    assert_eq!((&ready["status"], &ready["queued"]), (&json!("ready"), &json!(2)));
    gate.open();
    while metric(server.address, ended).await < 4.0 {}
    assert_eq!(metric(server.address, old).await.to_bits(), 0f64.to_bits());
    assert!(metric(server.address, "fretwork_disk_free_bytes").await > 0.0);
    let route = "fretwork_http_requests_total{method=\"POST\",route=\"/v1/jobs\",status=\"202\"}";
    assert_eq!(metric(server.address, route).await.to_bits(), 4f64.to_bits());
}

#[tokio::test]
async fn jobs_can_be_cancelled_by_filter_and_deleted_when_finished() {
    let (server, gate) = gated().await;
    let mut body = steel_ball();
    body["label"] = json!("mine");
    let mine = id(&server.post("/v1/jobs", &body).await);
    let other = id(&submit(&server, 3.0, &[]).await);
    let refused = server.send("POST", "/v1/jobs/cancel", &[], "").await;
    refused.problem(422, "invalid-parameters");
    server.send("DELETE", &format!("/v1/jobs/{mine}"), &[], "").await.problem(409, "still-going");
    let canceled = server.send("POST", "/v1/jobs/cancel?label=mine", &[], "").await;
    assert_eq!(canceled.json(), json!({"canceled": 1}));
    let job = server.get(&format!("/v1/jobs/{mine}?wait=60")).await.json();
    assert_eq!(job["state"], "canceled");
    let gone = server.send("DELETE", &format!("/v1/jobs/{mine}"), &[], "").await;
    assert_eq!((gone.status, gone.body.len()), (204, 0));
    server.get(&format!("/v1/jobs/{mine}")).await.problem(404, "not-found");
    gate.open();
    let job = server.get(&format!("/v1/jobs/{other}?wait=60")).await.json();
    assert_eq!(job["state"], "succeeded");
    let all = server.send("POST", "/v1/jobs/cancel?owner=me", &[], "").await;
    assert_eq!(all.json(), json!({"canceled": 0}));
}

#[tokio::test]
async fn a_submission_to_a_full_queue_is_refused_with_a_retry_time() {
    let gate = Gate::default();
    let options = Options { queue_limit: 3, ..Options::default() };
    let server = Server::with(gate.compute(), &Settings::default(), &options).await;
    let mut refused = None;
    for number in 0..6 {
        let reply = submit(&server, 2.0 + f64::from(number), &[]).await;
        if reply.status != 202 {
            refused = Some(reply);
        }
    }
    let refused = refused.unwrap();
    refused.problem(503, "queue-full");
    let seconds: u32 = refused.header("retry-after").unwrap().parse().unwrap();
    assert!((1..=60).contains(&seconds));
    gate.open();
}

#[tokio::test]
async fn urgent_jobs_of_one_owner_come_first() {
    let (server, gate) = gated().await;
    let state =
        async |id: &str| server.get(&format!("/v1/jobs/{id}")).await.json()["state"].clone();
    // Two runs occupy both workers, so the other runs wait in the queue.
    let mut running = String::new();
    for amplitude in [2.0, 2.1] {
        running = id(&submit(&server, amplitude, &[]).await);
        while state(&running).await == "queued" {}
    }
    let late = submit(&server, 3.0, &[("Priority", "u=7")]).await;
    assert_eq!(late.json()["priority"], 7);
    let soon = submit(&server, 3.1, &[("Priority", "u=0, i")]).await;
    assert_eq!(soon.json()["priority"], 0);
    // One worker becomes free.
    server.send("POST", &format!("/v1/jobs/{running}/cancel"), &[], "").await;
    while state(&id(&soon)).await == "queued" {}
    assert_eq!(state(&id(&late)).await, "queued");
    gate.open();
}

#[tokio::test]
async fn a_known_result_can_be_pinned_and_an_unknown_one_cannot() {
    let server = Server::with(Gate::opened(), &Settings::default(), &Options::default()).await;
    let job = submit(&server, 2.0, &[("Prefer", "wait=60")]).await.json();
    let path = format!("/v1/results/{}/pin", job["key"].as_str().unwrap());
    for method in ["PUT", "PUT", "DELETE", "DELETE"] {
        assert_eq!(server.send(method, &path, &[], "").await.status, 204);
    }
    let none = format!("/v1/results/{}/pin", "0".repeat(64));
    server.send("PUT", &none, &[], "").await.problem(404, "unknown-result");
}

#[tokio::test]
async fn an_evicted_result_shows_its_scenario_and_can_be_computed_again() {
    let settings = Settings { memory: 0, ..Settings::default() };
    let server = Server::with(Arc::new(Task::start), &settings, &Options::default()).await;
    let body = steel_ball();
    let job = server.compute(&body).await.json();
    let path = format!("/v1/results/{}", job["key"].as_str().unwrap());
    let before = server.get(&path).await;
    // Evict the result, as the store does when all results exceed the budget.
    let mut db = crate::store::raw(server.dir.path()).await;
    for change in ["UPDATE result SET evicted = 1765432100000", "DELETE FROM result_blob"] {
        sqlx::query(change).execute(&mut db).await.unwrap();
    }
    let problem = server.get(&path).await.problem(410, "evicted");
    assert_eq!(problem["scenario"], before.json()["scenario"]);
    let again = server.compute(&json!({"scenario": problem["scenario"]})).await;
    assert_eq!(again.header("cache-status"), Some("fretwork; fwd=miss; stored"));
    assert_eq!(again.json()["key"], job["key"]);
    assert_eq!(server.get(&path).await.body, before.body);
}

#[tokio::test]
async fn computing_a_damaged_result_again_repairs_it() {
    let settings = Settings { memory: 0, ..Settings::default() };
    let server = Server::with(Gate::opened(), &settings, &Options::default()).await;
    let wait = ("Prefer", "wait=60");
    let job = submit(&server, 2.0, &[wait]).await.json();
    let path = format!("/v1/results/{}", job["key"].as_str().unwrap());
    let before = server.get(&path).await;
    let mut db = crate::store::raw(server.dir.path()).await;
    let change = "UPDATE result_blob SET body = zeroblob(length(body))";
    assert_eq!(sqlx::query(change).execute(&mut db).await.unwrap().rows_affected(), 1);
    server.get(&path).await.problem(500, "database-damaged");
    let damaged = "fretwork_store_errors_total{kind=\"damaged\"}";
    assert!(metric(server.address, damaged).await >= 1.0);
    // A job that asks for the result inline is still accepted.
    let headers = [JSON, wait];
    let body = ball(2.0).to_string();
    let job = server.send("POST", "/v1/jobs?include=result", &headers, body).await;
    assert_eq!((job.status, &job.json()["state"]), (200, &json!("succeeded")));
    submit(&server, 2.0, &[wait, ("Cache-Control", "no-cache")]).await;
    assert_eq!(server.get(&path).await.body, before.body);
}

#[tokio::test]
async fn a_page_of_another_site_cannot_change_anything() {
    let (server, gate) = gated().await;
    submit(&server, 2.0, &[]).await;
    let page = [("Origin", "https://evil.example"), ("Sec-Fetch-Site", "cross-site")];
    let refused = server.send("POST", "/v1/jobs/cancel?owner=me", &page, "").await;
    refused.problem(403, "cross-site");
    // Reads are protected by the browser: it hides the answer from a page of another site.
    assert_eq!(server.send("GET", "/v1/jobs", &page, "").await.status, 200);
    let own = [("Origin", "http://test"), ("Sec-Fetch-Site", "same-origin")];
    let canceled = server.send("POST", "/v1/jobs/cancel?owner=me", &own, "").await;
    assert_eq!(canceled.json(), json!({"canceled": 1}));
    gate.open();
}

#[tokio::test]
async fn a_run_is_refused_if_its_estimated_time_is_too_long() {
    let limit = Some(Duration::from_micros(1));
    let (settings, options) = (Settings::default(), Options::default());
    let server = Server::with_limit(Arc::new(Task::start), limit, &settings, &options).await;
    let problem = server.compute(&steel_ball()).await.problem(422, "too-expensive");
    assert!(problem["detail"].as_str().unwrap().contains("1us"), "{problem}");
}
