//! Databases that versions 0.2.0 and 0.3.0 have written, as a crash of that version left them: two results, a deleted
//! result, a running run, and a queued run of three jobs, one of which is canceled.

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

/// What an earlier version has left.
struct Earlier {
    database: &'static [u8],
    /// The version of its digits.
    numerics: u32,
    /// The key of a result of the simplified rule, pinned, with a note.
    simplified: &'static str,
    /// The key of a result of the exact method with profiles.
    exact: &'static str,
    /// The key of a deleted result.
    deleted: &'static str,
}

const EARLIER: [Earlier; 2] = [
    Earlier {
        database: include_bytes!("../data/version-0.2.0.db.zst"),
        numerics: 1,
        simplified: "580cda57e5784922d46f772a438032f913c45d24eb01d3396a6002f6efb648a4",
        exact: "7509e1e708ca97b0705e7d15c9d54f2eeef65b0e00f6c6c1be5ca1330b288f60",
        deleted: "600b65a3248daba789d775a76e2daf794b569168568c37a9560ccfd3f5b68dff",
    },
    Earlier {
        database: include_bytes!("../data/version-0.3.0.db.zst"),
        numerics: 2,
        simplified: "480a68b740b7f404ae38eaf275f158a353ea37c747bceffb1eb065128858fd30",
        exact: "7aaeab0137a49711d635a6179ee5f39a6b401f4f323418b4f4ff9340be5e09a5",
        deleted: "256469afaed71ffa45630f670e7b98412d22d8015219079324bf17a4393e9a20",
    },
];

impl Earlier {
    fn write(&self, dir: &Path) {
        let database = zstd::bulk::decompress(self.database, 1 << 20).unwrap();
        fs::write(dir.join("fretwork.db"), database).unwrap();
    }

    async fn upgraded(&self) -> Server {
        let dir = TempDir::new().unwrap();
        self.write(dir.path());
        opened(dir).await
    }
}

/// Writes the database of the earliest version.
pub fn write_database(dir: &Path) {
    EARLIER[0].write(dir);
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
async fn results_of_earlier_versions_are_served_byte_for_byte() {
    for version in &EARLIER {
        are_served(version).await;
    }
}

async fn are_served(version: &Earlier) {
    let server = version.upgraded().await;
    for key in [version.simplified, version.exact] {
        let plain = server.get(&format!("/v1/results/{key}")).await;
        let provenance = server.get(&format!("/v1/results/{key}/provenance")).await.json();
        let digest = data_encoding::HEXLOWER.encode(&Sha256::digest(&plain.body));
        assert_eq!(provenance["body"]["sha256"], digest);
        assert_eq!(provenance["body"]["bytes"], plain.body.len());
        assert_eq!(plain.json()["engine"]["numerics"], version.numerics);
        let zstd = [("Accept-Encoding", "zstd")];
        let packed = server.send("GET", &format!("/v1/results/{key}"), &zstd, "").await;
        assert_eq!(packed.header("content-encoding"), Some("zstd"));
        assert!(zstd::bulk::decompress(&packed.body, 1 << 20).unwrap() == plain.body);
        let csv = server.get(&format!("/v1/results/{key}/history?format=csv")).await;
        let engine = format!(r#"# engine: {{"name":"fretwork","numerics":{}}}"#, version.numerics);
        assert!(csv.text().contains(&engine));
    }
    let deleted =
        server.get(&format!("/v1/results/{}", version.deleted)).await.problem(410, "evicted");
    let listed = server.get("/v1/results?note=rig").await.json();
    assert_eq!(listed["results"][0]["key"], version.simplified);
    for (search, has_both) in [("round", true), ("line", false)] {
        let listed = server.get(&format!("/v1/results?geometry={search}")).await;
        let listed = listed.text();
        let both = [version.simplified, version.exact];
        assert!(both.iter().all(|key| listed.contains(key) == has_both), "{listed}");
    }
    let deleted_is_round = server.get("/v1/results?geometry=round&evicted=true").await.json();
    assert_eq!(deleted_is_round["results"][0]["key"], version.deleted);

    // The same scenario has another key now, and other digits.
    let again = server.compute(&json!({"scenario": deleted["scenario"]})).await.json();
    assert_eq!((&again["state"], &again["origin"]), (&json!("succeeded"), &json!("computed")));
    assert_ne!(again["key"], version.deleted);
}

#[tokio::test]
async fn unfinished_runs_of_earlier_versions_get_new_keys_and_are_computed() {
    for version in &EARLIER {
        are_computed(version).await;
    }
}

async fn are_computed(version: &Earlier) {
    let server = version.upgraded().await;
    let running = finished(&server, "running").await;
    let queued = finished(&server, "queued").await;
    let joined = finished(&server, "joined").await;
    assert_eq!((&running["attempt"], &queued["attempt"]), (&json!(2), &json!(1)));
    assert_eq!(queued["key"], joined["key"]);
    for job in [running, queued, joined] {
        assert_eq!(job["state"], "succeeded", "{job}");
        let result = server.get(job["links"]["result"].as_str().unwrap()).await.json();
        assert_eq!((&result["key"], &result["engine"]["numerics"]), (&job["key"], &json!(5)));
        // A submission of the same scenario finds the new result.
        let cached = server.compute(&json!({"scenario": result["scenario"]})).await.json();
        assert_eq!((&cached["key"], &cached["origin"]), (&job["key"], &json!("cached")));
    }
    assert_eq!(finished(&server, "canceled").await["state"], "canceled");
}

#[tokio::test]
async fn a_result_of_an_earlier_version_has_the_warnings_about_bodies_that_its_job_has() {
    let Earlier { simplified, exact, .. } = EARLIER[0];
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
        .bind(simplified)
        .execute(&mut db)
        .await
        .unwrap();
    db.close().await.unwrap();
    let server = opened(dir).await;
    let warnings = async |key: &str| {
        server.get(&format!("/v1/results/{key}/warnings")).await.json()["warnings"].take()
    };
    assert_eq!(warnings(exact).await, json!([mismatch]));
    assert_eq!(warnings(simplified).await, Value::Null);
    let queued = finished(&server, "queued").await;
    assert_eq!(warnings(queued["key"].as_str().unwrap()).await, json!([mismatch]));
}

#[tokio::test]
async fn a_job_of_an_earlier_version_keeps_its_scenario_without_its_result() {
    for version in &EARLIER {
        let server = version.upgraded().await;
        // Version 0.2.0 kept the scenario with the run, and 0.3.0 with the deleted result.
        if version.numerics == 1 {
            crate::store::raw(server.dir.path()).await.execute("DELETE FROM result").await.unwrap();
        }
        let found = server.get("/v1/jobs?label=deleted").await.json();
        let job = format!("/v1/jobs/{}?include=scenario", found["jobs"][0]["id"].as_str().unwrap());
        assert_eq!(server.get(&job).await.json()["scenario"]["friction"], 0.7);
    }
}

#[tokio::test]
async fn results_of_earlier_versions_are_exported_and_imported() {
    for version in &EARLIER {
        are_moved(version).await;
    }
}

async fn are_moved(version: &Earlier) {
    let server = version.upgraded().await;
    let queued = finished(&server, "queued").await;
    let there = TempDir::new().unwrap();
    let file = there.path().join("all.zst");
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
    for key in [version.simplified, version.exact, queued["key"].as_str().unwrap()] {
        let target = format!("/v1/results/{key}");
        assert!(server.get(&target).await.body == other.get(&target).await.body);
    }
}
