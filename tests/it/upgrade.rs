//! A database that version 0.2.0 has written, as a crash of that version left it: two results, a deleted result, a
//! running run, and a queued run of three jobs, one of which is canceled.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use fretwork::http::Settings;
use fretwork_job::Task;
use fretwork_store::{Options, Search, export};
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use sqlx::{Connection as _, Executor as _};
use tempfile::TempDir;

use crate::moving::import;
use crate::server::Server;

const DATABASE: &[u8] = include_bytes!("../data/version-0.2.0.db.zst");
/// A result of the simplified rule, pinned, with a note.
const SIMPLIFIED: &str = "580cda57e5784922d46f772a438032f913c45d24eb01d3396a6002f6efb648a4";
/// A result of the exact method with profiles.
const EXACT: &str = "7509e1e708ca97b0705e7d15c9d54f2eeef65b0e00f6c6c1be5ca1330b288f60";
/// A deleted result.
const DELETED: &str = "600b65a3248daba789d775a76e2daf794b569168568c37a9560ccfd3f5b68dff";

async fn upgraded() -> Server {
    let dir = TempDir::new().unwrap();
    write_database(dir.path());
    opened(dir).await
}

pub fn write_database(dir: &Path) {
    let database = zstd::bulk::decompress(DATABASE, 1 << 20).unwrap();
    fs::write(dir.join("fretwork.db"), database).unwrap();
}

async fn opened(dir: TempDir) -> Server {
    let (settings, options) = (Settings::default(), Options::default());
    Server::opening(dir, Arc::new(Task::start), None, &settings, &options).await
}

/// Waits for the job with a label, and returns it.
async fn finished(server: &Server, label: &str) -> Value {
    let found = server.get(&format!("/v1/jobs?label={label}")).await.json();
    let id = found["jobs"][0]["id"].as_str().unwrap().to_owned();
    server.get(&format!("/v1/jobs/{id}?wait=60")).await.json()
}

#[tokio::test]
async fn results_of_the_previous_version_are_served_byte_for_byte() {
    let server = upgraded().await;
    for key in [SIMPLIFIED, EXACT] {
        let plain = server.get(&format!("/v1/results/{key}")).await;
        let provenance = server.get(&format!("/v1/results/{key}/provenance")).await.json();
        let digest = data_encoding::HEXLOWER.encode(&Sha256::digest(&plain.body));
        assert_eq!(provenance["body"]["sha256"], digest);
        assert_eq!(provenance["body"]["bytes"], plain.body.len());
        assert_eq!(plain.json()["engine"]["numerics"], 1);
        let zstd = [("Accept-Encoding", "zstd")];
        let packed = server.send("GET", &format!("/v1/results/{key}"), &zstd, "").await;
        assert_eq!(packed.header("content-encoding"), Some("zstd"));
        assert!(zstd::bulk::decompress(&packed.body, 1 << 20).unwrap() == plain.body);
        let csv = server.get(&format!("/v1/results/{key}/history?format=csv")).await;
        assert!(csv.text().contains(r#"# engine: {"name":"fretwork","numerics":1}"#));
    }
    let deleted = server.get(&format!("/v1/results/{DELETED}")).await.problem(410, "evicted");
    let listed = server.get("/v1/results?note=rig").await.json();
    assert_eq!(listed["results"][0]["key"], SIMPLIFIED);
    for (search, has_both) in [("round", true), ("line", false)] {
        let listed = server.get(&format!("/v1/results?geometry={search}")).await;
        let listed = listed.text();
        assert!([SIMPLIFIED, EXACT].iter().all(|key| listed.contains(key) == has_both), "{listed}");
    }
    let deleted_is_round = server.get("/v1/results?geometry=round&evicted=true").await.json();
    assert_eq!(deleted_is_round["results"][0]["key"], DELETED);

    // The same scenario has another key now, and other digits.
    let again = server.compute(&json!({"scenario": deleted["scenario"]})).await.json();
    assert_eq!((&again["state"], &again["origin"]), (&json!("succeeded"), &json!("computed")));
    assert_ne!(again["key"], DELETED);
}

#[tokio::test]
async fn unfinished_runs_of_the_previous_version_get_new_keys_and_are_computed() {
    let server = upgraded().await;
    let running = finished(&server, "running").await;
    let queued = finished(&server, "queued").await;
    let joined = finished(&server, "joined").await;
    assert_eq!((&running["attempt"], &queued["attempt"]), (&json!(2), &json!(1)));
    assert_eq!(queued["key"], joined["key"]);
    for job in [running, queued, joined] {
        assert_eq!(job["state"], "succeeded", "{job}");
        let result = server.get(job["links"]["result"].as_str().unwrap()).await.json();
        assert_eq!((&result["key"], &result["engine"]["numerics"]), (&job["key"], &json!(3)));
        // A submission of the same scenario finds the new result.
        let cached = server.compute(&json!({"scenario": result["scenario"]})).await.json();
        assert_eq!((&cached["key"], &cached["origin"]), (&job["key"], &json!("cached")));
    }
    assert_eq!(finished(&server, "canceled").await["state"], "canceled");
}

#[tokio::test]
async fn a_result_of_the_previous_version_has_the_warnings_about_bodies_that_its_job_has() {
    let dir = TempDir::new().unwrap();
    write_database(dir.path());
    let mut db = crate::store::raw(dir.path()).await;
    let (mismatch, slope) = (
        json!({"kind": "elastic_mismatch", "detail": "different"}),
        json!({"kind": "large_contact", "detail": "steep"}),
    );
    sqlx::query("UPDATE job SET warnings = ?1")
        .bind(json!([mismatch, slope]).to_string())
        .execute(&mut db)
        .await
        .unwrap();
    // The job of this result was deleted.
    sqlx::query("UPDATE result SET job = randomblob(16) WHERE hex(key) = upper(?1)")
        .bind(SIMPLIFIED)
        .execute(&mut db)
        .await
        .unwrap();
    db.close().await.unwrap();
    let server = opened(dir).await;
    let warnings = async |key: &str| {
        server.get(&format!("/v1/results/{key}/warnings")).await.json()["warnings"].take()
    };
    assert_eq!(warnings(EXACT).await, json!([mismatch]));
    assert_eq!(warnings(SIMPLIFIED).await, Value::Null);
    let queued = finished(&server, "queued").await;
    assert_eq!(warnings(queued["key"].as_str().unwrap()).await, json!([mismatch]));
}

#[tokio::test]
async fn a_job_of_the_previous_version_keeps_its_scenario_without_its_result() {
    let server = upgraded().await;
    crate::store::raw(server.dir.path()).await.execute("DELETE FROM result").await.unwrap();
    let found = server.get("/v1/jobs?label=deleted").await.json();
    let job = format!("/v1/jobs/{}?include=scenario", found["jobs"][0]["id"].as_str().unwrap());
    assert_eq!(server.get(&job).await.json()["scenario"]["friction"], 0.7);
}

#[tokio::test]
async fn results_of_both_versions_are_exported_and_imported() {
    let server = upgraded().await;
    let queued = finished(&server, "queued").await;
    let there = TempDir::new().unwrap();
    let file = there.path().join("all.db");
    let exported = export(server.place(), &file, &Search::default(), &[], &mut |_, _| {}).await;
    let exported = exported.unwrap();
    assert!(exported.results >= 3 && exported.left_out.is_empty(), "{exported:?}");
    let imported = import(there.path(), &file).await.unwrap();
    assert_eq!((imported.results, imported.bytes), (exported.results, exported.bytes));
    assert!(imported.refused.is_empty(), "{:?}", imported.refused);
    assert_eq!(imported.unverified, 2, "earlier versions computed them");
    let other = Server::opening(
        there,
        Arc::new(Task::start),
        None,
        &Settings::default(),
        &Options::default(),
    )
    .await;
    for key in [SIMPLIFIED, EXACT, queued["key"].as_str().unwrap()] {
        let target = format!("/v1/results/{key}");
        assert!(server.get(&target).await.body == other.get(&target).await.body);
    }
}
