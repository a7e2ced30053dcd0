//! Lists of many results and jobs.

use std::env;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use fretwork_store::{Search, export};
use serde_json::json;
use tempfile::TempDir;
use tokio::task::JoinSet;

use crate::moving::{import, quiet};
use crate::server::{JSON, Server, ball, send};

#[tokio::test(flavor = "multi_thread")]
async fn the_first_list_after_an_import_takes_at_most_half_a_second() {
    // tests/long imports 10⁵ results, which takes minutes.
    let count = if env::var_os("FRETWORK_TEST_LONG").is_some() { 100_000 } else { 500 };
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
    let file = dir.path().join("results.db");
    let all = Search::default();
    let exported = export(from.place(), &file, &all, &[], &mut quiet).await.unwrap();
    let imported = import(to.place(), &file).await.unwrap();
    assert_eq!((exported.results, imported.results), (count.into(), count.into()));
    for list in ["/v1/results", "/v1/results?sort=-wear_volume"] {
        let begun = Instant::now();
        let found = to.get(list).await.json();
        assert!(begun.elapsed() < Duration::from_millis(500), "{list}: {:?}", begun.elapsed());
        assert_eq!(found["results"].as_array().unwrap().len(), 50);
    }
}
