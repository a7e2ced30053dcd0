//! Export and import between servers; backup and restore.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use fretwork::service::workers::Workers;
use fretwork::service::{self, WorkLimits};
use fretwork_job::{JobState, Key, Task};
use fretwork_store::{
    Administration, Error, Filter, Imported, Moving, NewKey, Options, Place, Role, Search, Store,
    backup, export, restore,
};
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection as _, Executor as _, Row as _, SqliteConnection};
use tempfile::TempDir;

use crate::program::{fails, run};
use crate::server::{JSON, Server, assert_yields, ball, yielding_ball};
use crate::store::{new_job, open, raw};

pub fn quiet(_: usize, _: usize) {}

/// Imports a file, and computes every result again.
pub async fn import(place: impl Into<Place>, file: &Path) -> Result<Imported, Moving> {
    import_within(place, file, Duration::from_mins(10)).await
}

/// As [`import`], with this time limit for each result.
pub async fn import_within(
    place: impl Into<Place>,
    file: &Path,
    limit: Duration,
) -> Result<Imported, Moving> {
    service::import(place.into(), file, limit, |_, _| {}).await
}

/// The SHA-256 of a body in hexadecimal.
pub fn sha256(body: impl AsRef<[u8]>) -> String {
    Key::from_bytes(Sha256::digest(body).into()).to_string()
}

/// Computes a ball for each amplitude; returns the keys.
async fn computed(server: &Server, amplitudes: &[f64]) -> Vec<String> {
    let mut keys = Vec::new();
    for amplitude in amplitudes {
        let job = server.compute(&ball(*amplitude)).await.json();
        keys.push(job["key"].as_str().unwrap().to_owned());
    }
    keys
}

/// Exports all results; returns their number.
pub async fn export_all(server: &Server, file: &Path) -> u64 {
    let all = Search::default();
    export(server.place(), file, &all, &[], &mut quiet).await.unwrap().results
}

pub async fn open_file(file: &Path) -> SqliteConnection {
    SqliteConnection::connect_with(&SqliteConnectOptions::new().filename(file).foreign_keys(false))
        .await
        .unwrap()
}

/// Replaces the body of a result in an export, and its digest.
pub async fn replace_body(db: &mut SqliteConnection, key: &str, body: &str) {
    for sql in [
        "UPDATE bodies SET body = ?2 WHERE key = ?1 AND ?3 = ?3",
        "UPDATE results SET sha256 = ?3 WHERE key = ?1 AND ?2 = ?2",
    ] {
        let update = sqlx::query(sql).bind(key).bind(body).bind(sha256(body));
        assert_eq!(update.execute(&mut *db).await.unwrap().rows_affected(), 1);
    }
}

pub fn assert_refused(done: &Imported, key: &str, words: &str) {
    let why = done.refused.iter().find(|(refused, _)| refused == key);
    assert!(why.is_some_and(|(_, why)| why.contains(words)), "{words}: {:?}", done.refused);
}

async fn number(dir: &Path, sql: &'static str) -> i64 {
    sqlx::query_scalar(sql).fetch_one(&mut raw(dir).await).await.unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_imported_result_equals_the_original_byte_for_byte() {
    let (from, to) = (Server::start().await, Server::start().await);
    let keys = computed(&from, &[1.0, 1.5, 2.0, 2.5]).await;
    let at = format!("/v1/results/{}/note", keys[0]);
    let text = json!({"text": "From the other house."}).to_string();
    assert_eq!(from.send("PUT", &at, &[JSON], text).await.status, 204);
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    assert_eq!(export_all(&from, &file).await, 4);
    // The answer that the result is unknown must not be cached.
    let unknown = to.get(&format!("/v1/results/{}", keys[0])).await;
    unknown.problem(404, "unknown-result");
    let known = computed(&to, &[2.5]).await;
    assert_eq!(known[0], keys[3]);

    let done = import(to.place(), &file).await.unwrap();
    assert_eq!((done.results, done.known, &done.refused), (3, 1, &vec![]));
    for key in &keys {
        for part in ["", "/history?format=csv", "/profiles?points=9", "/loops"] {
            let address = format!("/v1/results/{key}{part}");
            assert_eq!(from.get(&address).await.body, to.get(&address).await.body, "{address}");
        }
        let (one, other) = (
            from.get(&format!("/v1/results/{key}/provenance")).await.json(),
            to.get(&format!("/v1/results/{key}/provenance")).await.json(),
        );
        assert_eq!(one["body"], other["body"]);
        assert_eq!(one["program"], other["program"]);
        if *key == keys[3] {
            assert!(other["imported"].is_null(), "it is not an import");
            continue;
        }
        assert_eq!(other["imported"]["from"], "results.db");
        assert_eq!(other["imported"]["verified"], "all");
        for name in ["owner", "at", "wall_seconds", "cpu_seconds"] {
            assert_eq!(one["computed"][name], other["computed"][name], "{name}");
        }
        assert_eq!(one["note"], other["note"]);
    }
    let hit = to.compute(&ball(1.5)).await;
    assert_eq!(hit.header("cache-status"), Some("fretwork; hit"));
    assert_eq!(hit.json()["summary"], from.compute(&ball(1.5)).await.json()["summary"]);
    // Search finds them, and they count towards the size of all results.
    let found = to.get("/v1/results?sort=amplitude").await.json();
    let found: Vec<&Value> =
        found["results"].as_array().unwrap().iter().map(|entry| &entry["key"]).collect();
    assert_eq!(found, keys.iter().collect::<Vec<_>>());
    assert_eq!(
        number(to.dir.path(), "SELECT used FROM room").await,
        number(to.dir.path(), "SELECT sum(length(body)) FROM result_blob").await
    );
    assert_eq!(done.notes, 1);
    let again = import(to.place(), &file).await.unwrap();
    assert_eq!(again, Imported { known: 4, ..Imported::default() });
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_imported_result_has_the_warnings_of_the_submission_that_computed_it() {
    let from = Server::start().await;
    let job = from.compute(&yielding_ball()).await.json();
    let at = format!("{}/warnings", job["links"]["result"].as_str().unwrap());
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    export_all(&from, &file).await;
    let to = Server::start().await;
    assert_eq!(import(to.place(), &file).await.unwrap().results, 1);
    let imported = to.get(&at).await.json();
    assert_yields(&imported["warnings"]);
    assert_eq!(imported, from.get(&at).await.json());

    // An export of an earlier version has no such column.
    let mut db = open_file(&file).await;
    db.execute("ALTER TABLE results DROP COLUMN warnings").await.unwrap();
    db.close().await.unwrap();
    let other = Server::start().await;
    assert_eq!(import(other.place(), &file).await.unwrap().results, 1);
    assert_eq!(other.get(&at).await.json(), json!({"warnings": null}));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_export_is_a_database_with_readable_columns_and_units() {
    let server = Server::start().await;
    let keys = computed(&server, &[1.0, 2.0]).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    let mut search = Search::default();
    search.set("amplitude", "2 um").unwrap();
    let done = export(server.place(), &file, &search, &[], &mut quiet).await.unwrap();
    assert_eq!(done.results, 1);
    let result = server.get(&format!("/v1/results/{}", keys[1])).await;
    let (body, result) = (result.body.clone(), result.json());
    let mut db = open_file(&file).await;
    let row = sqlx::query("SELECT * FROM results JOIN bodies USING (key)")
        .fetch_one(&mut db)
        .await
        .unwrap();
    assert_eq!(row.get::<String, _>("key"), keys[1]);
    assert_eq!(row.get::<String, _>("body").into_bytes(), body);
    assert_eq!(row.get::<f64, _>("friction"), 0.7);
    assert_eq!(row.get::<String, _>("shape"), "paraboloid");
    let sum = sha256(&body);
    assert_eq!(row.get::<String, _>("sha256"), sum);
    let scenario: Value = serde_json::from_str(row.get("scenario")).unwrap();
    assert_eq!(scenario, result["scenario"]);
    // The table `history` has every column of the history, and each has a unit.
    let rows =
        sqlx::query("SELECT * FROM history ORDER BY entry").fetch_all(&mut db).await.unwrap();
    let history = result["history"].as_object().unwrap();
    assert_eq!(rows.len(), history["cycles"].as_array().unwrap().len());
    for (name, column) in history {
        for (row, value) in rows.iter().zip(column.as_array().unwrap()) {
            assert_eq!(row.get::<f64, _>(name.as_str()), value.as_f64().unwrap(), "{name}");
        }
        let unit: String = sqlx::query_scalar("SELECT unit FROM units WHERE name = ?1")
            .bind(name)
            .fetch_one(&mut db)
            .await
            .unwrap();
        assert_eq!(result["units"][name], unit);
    }
    let columns: Vec<String> = sqlx::query_scalar("SELECT name FROM pragma_table_info('history')")
        .fetch_all(&mut db)
        .await
        .unwrap();
    // Those of the key, the row, and the threshold at an actuator.
    assert_eq!(columns.len(), history.len() + 3);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn altered_results_are_refused_and_the_others_are_imported() {
    let server = Server::start().await;
    let keys = computed(&server, &[1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.2]).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    export_all(&server, &file).await;
    let mut db = open_file(&file).await;
    // A changed digit in the body.
    let digit = "UPDATE bodies SET body = replace(body, '\"wear_volume\":[0.0', '\"wear_volume\":[0.1') WHERE key = ?1";
    sqlx::query(digit).bind(&keys[0]).execute(&mut db).await.unwrap();
    // A changed parameter in the body, with a digest that matches.
    let body: String = sqlx::query_scalar("SELECT body FROM bodies WHERE key = ?1")
        .bind(&keys[1])
        .fetch_one(&mut db)
        .await
        .unwrap();
    let body = body.replacen("\"friction\":0.7", "\"friction\":0.6", 1);
    replace_body(&mut db, &keys[1], &body).await;
    // The body of another result.
    sqlx::query("UPDATE bodies SET body = (SELECT body FROM bodies WHERE key = ?2) WHERE key = ?1")
        .bind(&keys[2])
        .bind(&keys[3])
        .execute(&mut db)
        .await
        .unwrap();
    sqlx::query(
        "UPDATE results SET sha256 = (SELECT sha256 FROM results WHERE key = ?2) WHERE key = ?1",
    )
    .bind(&keys[2])
    .bind(&keys[3])
    .execute(&mut db)
    .await
    .unwrap();
    // A result without a body, one with an invalid digest, and one with an invalid key.
    sqlx::query("DELETE FROM bodies WHERE key = ?1").bind(&keys[4]).execute(&mut db).await.unwrap();
    sqlx::query("UPDATE results SET sha256 = 'none' WHERE key = ?1")
        .bind(&keys[5])
        .execute(&mut db)
        .await
        .unwrap();
    sqlx::query("UPDATE results SET key = 'x' WHERE key = ?1")
        .bind(&keys[6])
        .execute(&mut db)
        .await
        .unwrap();
    db.close().await.unwrap();
    let other = Server::start().await;
    let done = import(other.place(), &file).await.unwrap();
    assert_eq!(done.results, 1, "{done:?}");
    for (key, words) in [
        (keys[0].as_str(), "SHA-256"),
        (&keys[1], "key of the result does not belong"),
        (&keys[2], "key of the result does not belong"),
        (&keys[4], "does not contain the JSON"),
        (&keys[5], "SHA-256 of the result is missing"),
        ("x", "must have 64 lower-case hexadecimal digits"),
    ] {
        assert_refused(&done, key, words);
    }
    assert_eq!(other.get(&format!("/v1/results/{}", keys[3])).await.status, 200);
    for key in [0, 1, 2, 4, 5, 6] {
        assert_eq!(other.get(&format!("/v1/results/{}", keys[key])).await.status, 404);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn importing_a_different_result_under_a_known_key_is_refused() {
    let (from, to) = (Server::start().await, Server::start().await);
    let key = computed(&from, &[1.0]).await.remove(0);
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    export_all(&from, &file).await;
    // A valid result, as a machine that computes other digits would export it.
    let mut db = open_file(&file).await;
    let body: String =
        sqlx::query_scalar("SELECT body FROM bodies").fetch_one(&mut db).await.unwrap();
    let body = body.replacen("\"wear_volume\":[0.0", "\"wear_volume\":[1e-30", 1);
    let sum = sha256(&body);
    sqlx::query("UPDATE bodies SET body = ?1").bind(body).execute(&mut db).await.unwrap();
    sqlx::query("UPDATE results SET sha256 = ?1").bind(sum).execute(&mut db).await.unwrap();
    db.close().await.unwrap();
    computed(&to, &[1.0]).await;
    let before = to.get(&format!("/v1/results/{key}")).await.body;
    let done = import(to.place(), &file).await.unwrap();
    assert_eq!((done.results, done.refused.len()), (0, 1), "{done:?}");
    assert!(done.refused[0].1.contains("another result under its key"), "{done:?}");
    assert_eq!(to.get(&format!("/v1/results/{key}")).await.body, before);
    // After an eviction, only the same result may be imported.
    assert_eq!(to.send("DELETE", &format!("/v1/results/{key}"), &[], "").await.status, 204);
    let mut db = raw(to.dir.path()).await;
    db.execute("UPDATE result SET deleted_by = NULL").await.unwrap();
    let refused = import(to.place(), &file).await.unwrap().refused;
    assert!(refused[0].1.contains("differs from the result that was evicted"), "{refused:?}");
    fs::remove_file(&file).unwrap();
    export_all(&from, &file).await;
    assert_eq!(import(to.place(), &file).await.unwrap().results, 1);
    assert_eq!(to.get(&format!("/v1/results/{key}")).await.body, before);
    // A deleted result is not imported: it must be computed again.
    assert_eq!(to.send("DELETE", &format!("/v1/results/{key}"), &[], "").await.status, 204);
    let refused = import(to.place(), &file).await.unwrap().refused;
    assert!(refused[0].1.contains("127.0.0.1 deleted it here"), "{refused:?}");
    to.get(&format!("/v1/results/{key}")).await.problem(410, "evicted");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_invalid_row_is_refused_with_a_reason() {
    let (from, to) = (Server::start().await, Server::start().await);
    let keys = computed(&from, &[0.6, 0.7, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.2, 2.4]).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    export_all(&from, &file).await;
    let mut db = open_file(&file).await;
    let cases = [
        (format!("note = '{}', note_owner = 'ann'", "x".repeat(4001)), "not 4001"),
        ("computed = 'soon'".to_owned(), "\"soon\" is not an RFC 3339 time"),
        ("cpu_seconds = -1".to_owned(), "-1 is not a time in seconds"),
        ("wall_seconds = 'long'".to_owned(), "column wall_seconds"),
        ("version = x'ff'".to_owned(), "column version"),
        ("processors = -1".to_owned(), "column processors"),
        ("sha256 = CAST(sha256 AS BLOB)".to_owned(), "column sha256"),
        ("warnings = '[\"yield\"]'".to_owned(), "warnings are too long, or not a list"),
        (format!("warnings = '[{}]'", " ".repeat(4000)), "warnings are too long, or not a list"),
        ("warnings = x'ff'".to_owned(), "column warnings"),
    ];
    for (key, (change, _)) in keys.iter().zip(&cases) {
        let sql = format!("UPDATE results SET {change} WHERE key = '{key}'");
        sqlx::raw_sql(sqlx::AssertSqlSafe(sql)).execute(&mut db).await.unwrap();
    }
    // A history whose columns differ in length.
    let body: String = sqlx::query_scalar("SELECT body FROM bodies WHERE key = ?1")
        .bind(&keys[10])
        .fetch_one(&mut db)
        .await
        .unwrap();
    let mut body: Value = serde_json::from_str(&body).unwrap();
    body["history"]["wear_depth"].as_array_mut().unwrap().pop();
    replace_body(&mut db, &keys[10], &body.to_string()).await;
    db.close().await.unwrap();
    let done = import(to.place(), &file).await.unwrap();
    assert_eq!((done.results, done.refused.len()), (0, 11), "{done:?}");
    let words = cases.iter().map(|(_, words)| *words).chain(["lists of numbers of equal length"]);
    for (key, words) in keys.iter().zip(words) {
        assert_refused(&done, key, words);
        to.get(&format!("/v1/results/{key}")).await.problem(404, "unknown-result");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_invalid_key_or_an_oversized_value_is_refused_and_the_rest_is_imported() {
    let (from, to) = (Server::start().await, Server::start().await);
    let keys = computed(&from, &[1.0, 1.2, 1.4, 1.6]).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    export_all(&from, &file).await;
    let mut db = open_file(&file).await;
    let columns = "numerics, scenario, summary, size, created, pinned, sha256, owner, computed, wall_seconds, cpu_seconds, version, host, architecture,
        processors, note, note_owner, note_at";
    for key in ["NULL", "x'00ff'", "'abc'"] {
        let sql = format!(
            "INSERT INTO results (key, {columns}) SELECT {key}, {columns} FROM results LIMIT 1"
        );
        sqlx::raw_sql(sqlx::AssertSqlSafe(sql)).execute(&mut db).await.unwrap();
    }
    let owners = [(&keys[0], "x".repeat(201)), (&keys[1], "\u{1b}[2J".to_owned())];
    for (key, owner) in owners {
        let update = sqlx::query("UPDATE results SET owner = ?2 WHERE key = ?1");
        update.bind(key).bind(owner).execute(&mut db).await.unwrap();
    }
    let body: String = sqlx::query_scalar("SELECT body FROM bodies WHERE key = ?1")
        .bind(&keys[2])
        .fetch_one(&mut db)
        .await
        .unwrap();
    replace_body(&mut db, &keys[2], &(body + &" ".repeat(128_000_001))).await;
    db.close().await.unwrap();
    let done = import(to.place(), &file).await.unwrap();
    assert_eq!((done.results, done.refused.len()), (1, 6), "{:?}", done.refused);
    assert_refused(&done, "abc", "the key of a result must have");
    assert_refused(&done, &keys[0], "a value of the column owner has more than 200 characters");
    assert_refused(&done, &keys[1], "a value of the column owner has more than 200 characters");
    assert_refused(&done, &keys[2], "the JSON of the result has more than 96000000 bytes");
}

#[tokio::test]
async fn an_import_file_with_a_view_is_refused() {
    let from = Server::start().await;
    computed(&from, &[1.0]).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    export_all(&from, &file).await;
    let mut db = open_file(&file).await;
    for sql in [
        "ALTER TABLE results RENAME TO held",
        "CREATE VIEW results AS
         WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT held.* FROM held, n",
    ] {
        sqlx::raw_sql(sql).execute(&mut db).await.unwrap();
    }
    db.close().await.unwrap();
    let to = TempDir::new().unwrap();
    let refused = import(to.path(), &file).await;
    assert!(matches!(refused, Err(Moving::NoExport(_))), "{refused:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_import_file_must_have_all_columns() {
    let (from, to) = (Server::start().await, Server::start().await);
    computed(&from, &[1.0]).await;
    let dir = TempDir::new().unwrap();
    for column in
        ["results DROP COLUMN note", "results DROP COLUMN sha256", "bodies DROP COLUMN body"]
    {
        let file = dir.path().join("results.db");
        export_all(&from, &file).await;
        let sql = format!("ALTER TABLE {column}");
        let mut db = open_file(&file).await;
        sqlx::raw_sql(sqlx::AssertSqlSafe(sql)).execute(&mut db).await.unwrap();
        db.close().await.unwrap();
        let refused = import(to.place(), &file).await;
        assert!(matches!(refused, Err(Moving::NoExport(_))), "{refused:?}");
        fs::remove_file(&file).unwrap();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_damaged_page_of_an_import_file_affects_only_its_result() {
    let (from, to) = (Server::start().await, Server::start().await);
    computed(&from, &[1.0, 1.2, 1.4]).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    export_all(&from, &file).await;
    let mut db = open_file(&file).await;
    let place: i64 = sqlx::query_scalar(
        "SELECT pgoffset FROM dbstat WHERE name = 'bodies' AND pagetype = 'overflow'
         AND path LIKE '%+000001' ORDER BY path LIMIT 1",
    )
    .fetch_one(&mut db)
    .await
    .unwrap();
    db.close().await.unwrap();
    // Overwrite the link to the next page of the body.
    let mut bytes = fs::read(&file).unwrap();
    bytes[usize::try_from(place).unwrap()..][..4].fill(0xff);
    fs::write(&file, bytes).unwrap();
    let done = import(to.place(), &file).await.unwrap();
    let refused: Vec<&str> = done.refused.iter().map(|(_, why)| why.as_str()).collect();
    assert_eq!(
        (done.results, refused),
        (2, vec!["the file is damaged at this result; export it again"])
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_import_never_replaces_an_existing_note() {
    let (from, to) = (Server::start().await, Server::start().await);
    let amplitudes = [1.0, 1.2, 1.4, 1.6];
    let keys = computed(&from, &amplitudes).await;
    computed(&to, &amplitudes).await;
    let note = async |server: &Server, place: usize, text: &str| {
        let at = format!("/v1/results/{}/note", keys[place]);
        let body = json!({"text": text}).to_string();
        assert_eq!(server.send("PUT", &at, &[JSON], body).await.status, 204);
    };
    let noted = async |place: usize| {
        to.get(&format!("/v1/results/{}/provenance", keys[place])).await.json()["note"].clone()
    };
    for (place, text) in ["One.", "Two.", "Three.", "Four."].iter().enumerate() {
        note(&from, place, text).await;
    }
    // Result 0 has no note here; 1 has another one; 2 has the same; 3 has another one, and is evicted.
    for (place, text) in [(1, "Mine."), (2, "Three."), (3, "Mine, too.")] {
        note(&to, place, text).await;
    }
    let dropped = format!("/v1/results/{}", keys[3]);
    assert_eq!(to.send("DELETE", &dropped, &[], "").await.status, 204);
    let mut db = raw(to.dir.path()).await;
    db.execute("UPDATE result SET deleted_by = NULL").await.unwrap();
    let pin = format!("/v1/results/{}/pin", keys[0]);
    assert_eq!(from.send("PUT", &pin, &[], "").await.status, 204);
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    assert_eq!(export_all(&from, &file).await, 4);
    let before = [noted(1).await, noted(2).await, noted(3).await];

    let import = || {
        let data = to.dir.path().to_str().unwrap();
        let output = run(&["import", file.to_str().unwrap(), "--data-dir", data], "");
        assert!(output.status.success(), "{output:?}");
        [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap())
    };
    let [said, told] = import();
    let theirs = from.get(&format!("/v1/results/{}/provenance", keys[0])).await.json();
    assert_eq!(noted(0).await, theirs["note"]);
    assert!(said.contains("imported, 3 known already, 0 refused"), "{said}");
    assert!(said.ends_with("notes: 1 imported, 2 kept\n"), "{said}");
    for place in [1, 3] {
        let line = format!("{} keeps its note", keys[place]);
        assert!(told.contains(&line), "{told}");
    }
    assert_eq!([noted(1).await, noted(2).await, noted(3).await], before);
    assert_eq!(to.get(&dropped).await.status, 200);
    // Pins are not exported: each server decides what to keep.
    let ours = to.get(&format!("/v1/results/{}/provenance", keys[0])).await.json();
    assert_eq!((&theirs["pinned"], &ours["pinned"]), (&json!(true), &json!(false)));
    let [said, _] = import();
    let end = "4 known already, 0 refused; 0 computed again, 0 in part, 0 unverified; notes: 0 imported, 2 kept\n";
    assert!(said.ends_with(end), "{said}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn export_import_backup_and_restore_report_results_and_errors() {
    let server = Server::start().await;
    let key = computed(&server, &[1.0]).await.remove(0);
    computed(&server, &[2.0]).await;
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let data = server.dir.path().to_str().unwrap();
    let said = |output: &std::process::Output| String::from_utf8(output.stdout.clone()).unwrap();
    let output = run(&["export", &path("one.db"), "--key", &key, "--data-dir", data], "");
    assert!(output.status.success() && said(&output).contains(": 1 result ("), "{output:?}");
    let output = run(
        &["export", &path("none.db"), "shape=cone", "friction=0.6..0.8", "--data-dir", data],
        "",
    );
    assert!(output.status.success() && said(&output).contains(": 0 results"), "{output:?}");
    fails(&run(&["export", &path("one.db"), "--data-dir", data], ""), "exists already");
    let zeros = "0".repeat(64);
    fails(
        &run(&["export", &path("x.db"), "--key", &zeros, "--data-dir", data], ""),
        "there is no result with the key",
    );
    fails(&run(&["export", &path("x.db"), "--data-dir", &path("nowhere")], ""), "there is no");
    let refused = run(&["export", &path("x.db"), "shape=cube", "--data-dir", data], "");
    assert!(
        String::from_utf8_lossy(&refused.stderr).contains("must be one of paraboloid"),
        "{refused:?}"
    );
    // An import creates a database if there is none.
    let new = path("new");
    let output = run(&["import", &path("one.db"), "--data-dir", &new], "");
    assert!(output.status.success() && said(&output).contains("1 result ("), "{output:?}");
    let output = run(&["check", "--data-dir", &new], "");
    assert!(said(&output).ends_with(": 1 result, 0 jobs; no damage\n"), "{output:?}");
    let output = run(&["import", &path("one.db"), "--data-dir", &new], "");
    assert!(
        said(&output).contains("0 results (0 B) imported, 1 known already, 0 refused"),
        "{output:?}"
    );
    open_file(Path::new(&path("one.db")))
        .await
        .execute("UPDATE results SET sha256 = 'x'")
        .await
        .unwrap();
    assert_eq!(
        run(&["import", &path("one.db"), "--data-dir", &path("third")], "").status.code(),
        Some(2)
    );
    let mut administration = Administration::open(server.place()).await.unwrap();
    for name in ["anna", "ben"] {
        let name = name.to_owned();
        let new = NewKey { name, role: Role::Read, per_minute: None, expires: None };
        administration.add_key(&new).await.unwrap();
    }
    administration.revoke_keys("ben").await.unwrap();
    administration.close().await.unwrap();
    let output = run(&["backup", &path("backup.db"), "--data-dir", data], "");
    assert!(output.status.success() && said(&output).contains(": 2 results ("), "{output:?}");
    fails(&run(&["backup", &path("backup.db"), "--data-dir", data], ""), "exists already");
    fails(&run(&["import", &path("backup.db"), "--data-dir", &new], ""), "restore");
    fails(
        &run(&["restore", &path("none.db"), "--data-dir", &path("fourth")], ""),
        "another program",
    );
    fails(&run(&["restore", &path("backup.db"), "--data-dir", &new], ""), "exists already");
    fails(
        &run(&["restore", &path("backup.db"), "--replace", "--data-dir", data], ""),
        "another server",
    );
    let output = run(&["restore", &path("backup.db"), "--replace", "--data-dir", &new], "");
    assert!(
        output.status.success() && said(&output).contains("the former database is"),
        "{output:?}"
    );
    assert!(said(&output).contains("valid key: "), "{output:?}");
    assert!(said(&output).contains("anna (read)"), "{output:?}");
    assert!(!said(&output).contains("ben"), "{output:?}");
    let store = open(Path::new(&new)).await;
    assert!(store.has_result(&key.parse().unwrap()).await.unwrap());
    assert_eq!(store.jobs(&Filter::default(), None, 9).await.unwrap().jobs.len(), 2);
}

#[test]
fn a_database_is_not_written_to_standard_output() {
    for command in ["export", "backup"] {
        let refused = run(&[command, "-"], "");
        let why = String::from_utf8_lossy(&refused.stderr);
        assert!(why.contains("enter the name of a file"), "{refused:?}");
    }
}

#[test]
fn a_file_that_is_not_a_database_cannot_be_imported() {
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("text.db");
    let text = "some text, longer than the 100 bytes of a database header".repeat(3);
    fs::write(&file, text).unwrap();
    let data = dir.path().to_str().unwrap();
    fails(&run(&["import", file.to_str().unwrap(), "--data-dir", data], ""), "not an export");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn export_and_restore_refuse_a_database_of_another_version() {
    let (dir, store) = crate::store::fresh().await;
    let file = dir.path().join("out.db");
    let mut db = raw(dir.path()).await;
    let all = Search::default();
    db.execute(
        "DELETE FROM _sqlx_migrations WHERE version = (SELECT max(version) FROM _sqlx_migrations)",
    )
    .await
    .unwrap();
    let refused = export(dir.path().into(), &file, &all, &[], &mut quiet).await;
    assert!(matches!(refused, Err(Moving::Store(Error::Older { .. }))), "{refused:?}");
    db.execute("INSERT INTO _sqlx_migrations VALUES (999, 'later', 0, TRUE, x'', 0)")
        .await
        .unwrap();
    let refused = export(dir.path().into(), &file, &all, &[], &mut quiet).await;
    assert!(matches!(refused, Err(Moving::Store(Error::Newer { found: 999, .. }))), "{refused:?}");
    // A database of a later version can be backed up, but not restored.
    backup(dir.path(), &file).await.unwrap();
    let refused = restore(&dir.path().join("other"), &file, false).await;
    assert!(matches!(refused, Err(Moving::Store(Error::Newer { .. }))), "{refused:?}");
    store.close().await;
}

/// This takes more than 5 s, because it makes several backups under load.
#[tokio::test(flavor = "multi_thread", worker_threads = 3)]
async fn a_backup_under_load_contains_every_acknowledged_job() {
    let dir = TempDir::new().unwrap();
    let store = open(dir.path()).await;
    let workers = Workers::start(
        &store,
        1,
        WorkLimits::default(),
        &(Arc::new(|key: &Key, task: &str| Task::start(key, task, None)) as _),
    )
    .unwrap();
    let over = Arc::new(AtomicBool::new(false));
    let load = tokio::spawn({
        let (store, over) = (store.clone(), Arc::clone(&over));
        async move {
            let mut count = 0_u32;
            while !over.load(Ordering::Relaxed) {
                let body = ball(1.0 + 1e-4 * f64::from(count));
                let task =
                    fretwork_job::Submission::parse(body.to_string().as_bytes()).unwrap().prepared;
                let job = fretwork_store::NewJob {
                    key: task.key,
                    task: task.stored.to_string(),
                    ..new_job(0)
                };
                store.submit(job).await.unwrap();
                count += 1;
                tokio::task::yield_now().await;
            }
            count
        }
    });
    let target = TempDir::new().unwrap();
    for round in 0..3 {
        let before = loop {
            let page = store.jobs(&Filter::default(), None, 200).await.unwrap();
            if page.jobs.len() > 50 {
                break page.jobs;
            }
            tokio::task::yield_now().await;
        };
        let file = target.path().join(format!("{round}.db"));
        let saved = backup(dir.path(), &file).await.unwrap();
        assert!(saved.jobs >= before.len() as u64);
        let data = target.path().join(format!("data-{round}"));
        let (restored, former) = restore(&data, &file, false).await.unwrap();
        assert_eq!((restored, former), (saved, None));
        let copy = open(&data).await;
        copy.recover().await.unwrap();
        for job in &before {
            let kept = copy.job(job.id).await.unwrap().expect("an acknowledged job");
            assert_eq!(kept.key, job.key);
            if job.state == JobState::Succeeded {
                assert_eq!(kept, *job);
                assert!(copy.has_result(&job.key).await.unwrap());
            }
        }
        // A server can continue from the backup.
        let claimed = copy.claim().await.unwrap();
        assert!(claimed.is_some(), "queued runs are still queued");
        let said: String = sqlx::query_scalar("PRAGMA integrity_check")
            .fetch_one(&mut raw(&data).await)
            .await
            .unwrap();
        assert_eq!(said, "ok");
        copy.close().await;
    }
    over.store(true, Ordering::Relaxed);
    assert!(load.await.unwrap() > 50);
    drop(workers);
    store.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_manually_copied_backup_ignores_an_old_write_ahead_log() {
    let server = Server::start().await;
    let keys = computed(&server, &[1.0]).await;
    let target = TempDir::new().unwrap();
    let file = target.path().join("backup.db");
    backup(server.dir.path(), &file).await.unwrap();
    let later = computed(&server, &[1.1, 1.2, 1.3]).await;
    // After a crash the log of the old database remains beside the backup.
    let crashed = crate::store::crash(server.dir.path());
    let log = crashed.path().join("fretwork.db-wal");
    assert!(fs::metadata(&log).unwrap().len() > 0);
    fs::copy(&file, crashed.path().join("fretwork.db")).unwrap();
    let store = open(crashed.path()).await;
    assert!(store.has_result(&keys[0].parse().unwrap()).await.unwrap());
    assert!(!store.has_result(&later[0].parse().unwrap()).await.unwrap());
    store.close().await;
    let said: String = sqlx::query_scalar("PRAGMA integrity_check")
        .fetch_one(&mut raw(crashed.path()).await)
        .await
        .unwrap();
    assert_eq!(said, "ok");
    // A database that was not replaced keeps its log.
    let own = crate::store::crash(server.dir.path());
    let store = Store::open(own.path().into(), &Options::default()).await.unwrap();
    assert!(store.has_result(&later[0].parse().unwrap()).await.unwrap());
    store.close().await;
}
