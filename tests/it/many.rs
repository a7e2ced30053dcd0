//! Lists of many results and jobs.

use std::env;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use fretwork_store::{Search, export};
use serde_json::json;
use tempfile::TempDir;
use tokio::task::JoinSet;
use tokio::time::sleep;

use crate::moving::{import, quiet};
use crate::server::{JSON, Server, ball, send};
use crate::store::raw;

#[tokio::test(flavor = "multi_thread")]
async fn results_are_listed_after_an_import() {
    // tests/long imports 10⁵ results, which takes minutes, and measures the lists. The tests of the store check that
    // searches use an index.
    let long = env::var_os("FRETWORK_TEST_LONG").is_some();
    let count = if long { 100_000 } else { 200 };
    let (from, to) = (Server::start().await, Server::start().await);
    let (address, next) = (from.address, Arc::new(AtomicU32::new(0)));
    let mut clients = JoinSet::new();
    for _ in 0..4 {
        let next = Arc::clone(&next);
        clients.spawn(async move {
            loop {
                let number = next.fetch_add(1, Ordering::Relaxed);
                if number >= count {
                    break;
                }
                let mut body = ball(1.0 + f64::from(number) * 1e-6);
                body["scenario"]["cycles"] = json!([1000]);
                body["scenario"]["profiles_at"] = json!("none");
                let headers = [JSON, ("Prefer", "wait=60")];
                let reply = send(address, "POST", "/v1/jobs", &headers, body.to_string()).await;
                assert_eq!(reply.unwrap().json()["state"], "succeeded");
            }
        });
    }
    clients.join_all().await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.ndjson.zst");
    let all = Search::default();
    let exported = export(from.place(), &file, &all, &[], &mut quiet).await.unwrap();
    let imported = import(to.place(), &file).await.unwrap();
    assert_eq!((exported.results, imported.results), (count.into(), count.into()));
    for list in ["/v1/results", "/v1/results?sort=-wear_volume"] {
        let begun = Instant::now();
        let found = to.get(list).await.json();
        let took = begun.elapsed();
        assert!(!long || took < Duration::from_millis(500), "{list}: {took:?}");
        assert_eq!(found["results"].as_array().unwrap().len(), 50);
    }
}

/// This takes more than 5 s, because the lists have to be slow.
#[tokio::test(flavor = "multi_thread")]
async fn a_job_can_be_read_beside_many_slow_lists() {
    let server = Server::start().await;
    let mut jobs = Vec::new();
    for amplitude in [1.0, 1.5] {
        jobs.push(server.compute(&ball(amplitude)).await.json());
    }
    // Of 50 000 jobs, half have the key and the other half have the label, so no job matches both.
    let mut db = raw(server.dir.path()).await;
    for statement in [
        "CREATE TEMP TABLE copy AS
         WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 25000)
         SELECT job.* FROM job, n",
        "UPDATE copy SET id = randomblob(16), label = CASE key WHEN (SELECT key FROM job LIMIT 1) THEN 'x' ELSE 'y' END",
        "INSERT INTO job SELECT * FROM copy",
    ] {
        sqlx::query(statement).execute(&mut db).await.unwrap();
    }
    let key = jobs[0]["key"].as_str().unwrap();
    let (address, done) = (server.address, Arc::new(AtomicU32::new(0)));
    let mut lists = JoinSet::new();
    for _ in 0..40 {
        let (target, done) = (format!("/v1/jobs?key={key}&label=y"), Arc::clone(&done));
        lists.spawn(async move {
            let reply = send(address, "GET", &target, &[], String::new()).await.unwrap();
            assert_eq!(reply.status, 200);
            done.fetch_add(1, Ordering::Relaxed);
        });
    }
    while done.load(Ordering::Relaxed) == 0 {
        sleep(Duration::from_millis(1)).await;
    }
    let job = server.get(jobs[1]["links"]["self"].as_str().unwrap()).await;
    let before = done.load(Ordering::Relaxed);
    assert_eq!(job.status, 200);
    assert!(before < 30, "{before} of 40 lists were answered first");
    lists.join_all().await;
}
