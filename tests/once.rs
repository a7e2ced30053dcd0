//! Every submission is parsed once and builds one case. The tests count for the whole process, and so they are
//! a program of their own.

#![expect(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "tests may stop"
)]
#![expect(dead_code, reason = "the other tests use the rest of these modules")]

use std::sync::atomic::Ordering;

use fretwork_engine::scenario::work_done::{CASES, PARSES};
use serde_json::json;

#[path = "it/database.rs"]
mod database;
#[path = "it/server.rs"]
mod server;

use server::{JSON, Server, ball};

/// Scenarios parsed and cases built so far.
fn counts() -> [u64; 2] {
    [&PARSES, &CASES].map(|counter| counter.load(Ordering::Relaxed))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_submission_is_parsed_once_and_builds_one_case() {
    let server = Server::start().await;
    let mut exact = ball(2.0);
    exact["scenario"]["model"] = json!({"method": "exact"});
    let mut long = ball(2.5);
    long["scenario"]["model"] = json!({"method": "exact", "points": 1024, "tolerance": 1e-4});
    long["scenario"]["cycles"] = json!({"normalized": [1, 2, 4, 8, 16, 32]});
    for (body, wait, way) in [
        (ball(1.0), true, "computed while the client waits"),
        (ball(1.5), false, "computed by a worker"),
        (exact, true, "exact, computed while the client waits"),
        (long, true, "too long to compute at once, computed by a worker"),
        (ball(1.0), true, "found in the cache"),
    ] {
        let before = counts();
        let wait = if wait { "wait=60" } else { "wait=0" };
        let reply =
            server.send("POST", "/v1/jobs", &[JSON, ("Prefer", wait)], body.to_string()).await;
        let id = reply.json()["id"].as_str().unwrap().to_owned();
        let job = server.get(&format!("/v1/jobs/{id}?wait=60")).await.json();
        assert_eq!(job["state"], "succeeded", "{job}");
        let [parses, cases] = counts();
        assert_eq!([parses - before[0], cases - before[1]], [1, 1], "{way}");
    }
    let before = counts();
    let body = json!({"scenario": ball(1.0)["scenario"], "outputs": ["wear_volume@1000"]});
    assert_eq!(server.post("/v1/evaluate", &body).await.status, 200);
    let [parses, cases] = counts();
    assert_eq!([parses - before[0], cases - before[1]], [1, 1], "evaluated");
}
