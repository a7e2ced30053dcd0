//! Results on their way between servers; backups of the whole, taken and put in place.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use fretwork::job::{JobState, Key, Task};
use fretwork::service::workers::Workers;
use fretwork::store::{
    Desk, Error, Filter, Imported, Moving, NewKey, Options, Role, Search, Store, backup, export,
    import, restore,
};
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection as _, Executor as _, Row as _, SqliteConnection};
use tempfile::TempDir;

use crate::program::{fails, run};
use crate::server::{JSON, Server, ball};
use crate::store::{new_job, open, raw};

fn quiet(_: usize, _: usize) {}

/// The digest of a body as it is written.
pub fn sha256(body: impl AsRef<[u8]>) -> String {
    Key::from_bytes(Sha256::digest(body).into()).to_string()
}

/// Computes some balls; returns their keys.
async fn computed(server: &Server, amplitudes: &[f64]) -> Vec<String> {
    let mut keys = Vec::new();
    for amplitude in amplitudes {
        let job = server.compute(&ball(*amplitude)).await.json();
        keys.push(job["key"].as_str().unwrap().to_owned());
    }
    keys
}

async fn all(server: &Server, file: &Path) -> u64 {
    let all = Search::default();
    export(server.dir.path(), file, &all, &[], quiet).await.unwrap().results
}

async fn open_file(file: &Path) -> SqliteConnection {
    SqliteConnection::connect_with(&SqliteConnectOptions::new().filename(file).foreign_keys(false))
        .await
        .unwrap()
}

async fn number(dir: &Path, sql: &'static str) -> i64 {
    sqlx::query_scalar(sql).fetch_one(&mut raw(dir).await).await.unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_one_server_exports_another_serves_byte_for_byte() {
    let (from, to) = (Server::start().await, Server::start().await);
    let keys = computed(&from, &[1.0, 1.5, 2.0, 2.5]).await;
    let at = format!("/v1/results/{}/note", keys[0]);
    let text = json!({"text": "From the other house."}).to_string();
    assert_eq!(from.send("PUT", &at, &[JSON], text).await.status, 204);
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    assert_eq!(all(&from, &file).await, 4);
    // That it is not there was asked before: such an answer is not remembered.
    let unknown = to.get(&format!("/v1/results/{}", keys[0])).await;
    unknown.problem(404, "unknown-result");
    let known = computed(&to, &[2.5]).await;
    assert_eq!(known[0], keys[3]);

    let done = import(to.dir.path(), &file, quiet).await.unwrap();
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
            assert!(other["imported"].is_null(), "it was there before");
            continue;
        }
        assert_eq!(other["imported"]["from"], "results.db");
        for name in ["owner", "at", "wall_seconds", "cpu_seconds"] {
            assert_eq!(one["computed"][name], other["computed"][name], "{name}");
        }
        assert_eq!(one["note"], other["note"]);
    }
    let hit = to.compute(&ball(1.5)).await;
    assert_eq!(hit.header("cache-status"), Some("fretwork; hit"));
    assert_eq!(hit.json()["summary"], from.compute(&ball(1.5)).await.json()["summary"]);
    // They are found, and they take room.
    let found = to.get("/v1/results?sort=amplitude").await.json();
    let found: Vec<&Value> =
        found["results"].as_array().unwrap().iter().map(|entry| &entry["key"]).collect();
    assert_eq!(found, keys.iter().collect::<Vec<_>>());
    assert_eq!(
        number(to.dir.path(), "SELECT used FROM room").await,
        number(to.dir.path(), "SELECT sum(length(body)) FROM result_blob").await
    );
    assert_eq!(done.notes, 1);
    let again = import(to.dir.path(), &file, quiet).await.unwrap();
    assert_eq!(again, Imported { known: 4, ..Imported::default() });
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_export_is_a_database_that_people_read() {
    let server = Server::start().await;
    let keys = computed(&server, &[1.0, 2.0]).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    let mut search = Search::default();
    search.set("amplitude", "2 um").unwrap();
    let done = export(server.dir.path(), &file, &search, &[], quiet).await.unwrap();
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
    // Every column of the history, in its table, with a unit.
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
    assert_eq!(columns.len(), history.len() + 2);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_was_tampered_with_is_refused_and_the_rest_is_taken() {
    let server = Server::start().await;
    let keys = computed(&server, &[1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.2]).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    all(&server, &file).await;
    let mut db = open_file(&file).await;
    let digit = "UPDATE bodies SET body = replace(body, '\"wear_volume\":[0.0', '\"wear_volume\":[0.1') WHERE key = ?1";
    // A digit of the body.
    sqlx::query(digit).bind(&keys[0]).execute(&mut db).await.unwrap();
    // A parameter in the body, and the sum made to match.
    let body: String = sqlx::query_scalar("SELECT body FROM bodies WHERE key = ?1")
        .bind(&keys[1])
        .fetch_one(&mut db)
        .await
        .unwrap();
    let body = body.replacen("\"friction\":0.7", "\"friction\":0.6", 1);
    let sum = sha256(&body);
    sqlx::query("UPDATE bodies SET body = ?2 WHERE key = ?1")
        .bind(&keys[1])
        .bind(body)
        .execute(&mut db)
        .await
        .unwrap();
    sqlx::query("UPDATE results SET sha256 = ?2 WHERE key = ?1")
        .bind(&keys[1])
        .bind(sum)
        .execute(&mut db)
        .await
        .unwrap();
    // A body under the key of another.
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
    // No body, no sum, no key.
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
    let done = import(other.dir.path(), &file, quiet).await.unwrap();
    assert_eq!(done.results, 1, "{done:?}");
    for (key, words) in [
        (&keys[0], "SHA-256"),
        (&keys[1], "key is not that"),
        (&keys[2], "key is not that"),
        (&keys[4], "no body"),
        (&keys[5], "no SHA-256"),
        (&"x".to_owned(), "key is none"),
    ] {
        let why = done.refused.iter().find(|(refused, _)| refused == key);
        assert!(why.is_some_and(|(_, why)| why.contains(words)), "{words}: {:?}", done.refused);
    }
    assert_eq!(other.get(&format!("/v1/results/{}", keys[3])).await.status, 200);
    for key in [0, 1, 2, 4, 5, 6] {
        assert_eq!(other.get(&format!("/v1/results/{}", keys[key])).await.status, 404);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn another_result_under_the_same_key_is_told_and_not_taken() {
    let (from, to) = (Server::start().await, Server::start().await);
    let key = computed(&from, &[1.0]).await.remove(0);
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    all(&from, &file).await;
    // A sound one, but of a machine that computes otherwise.
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
    let done = import(to.dir.path(), &file, quiet).await.unwrap();
    assert_eq!((done.results, done.refused.len()), (0, 1), "{done:?}");
    assert!(done.refused[0].1.contains("another result is held"), "{done:?}");
    assert_eq!(to.get(&format!("/v1/results/{key}")).await.body, before);
    // Dropped here, it is still known what it was.
    assert_eq!(to.send("DELETE", &format!("/v1/results/{key}"), &[], "").await.status, 204);
    let mut db = raw(to.dir.path()).await;
    db.execute("UPDATE result SET deleted_by = NULL").await.unwrap();
    let refused = import(to.dir.path(), &file, quiet).await.unwrap().refused;
    assert!(refused[0].1.contains("held under its key and dropped"), "{refused:?}");
    fs::remove_file(&file).unwrap();
    all(&from, &file).await;
    assert_eq!(import(to.dir.path(), &file, quiet).await.unwrap().results, 1);
    assert_eq!(to.get(&format!("/v1/results/{key}")).await.body, before);
    // What somebody had deleted comes back only when it is computed.
    assert_eq!(to.send("DELETE", &format!("/v1/results/{key}"), &[], "").await.status, 204);
    let refused = import(to.dir.path(), &file, quiet).await.unwrap().refused;
    assert!(refused[0].1.contains("deleted here by 127.0.0.1"), "{refused:?}");
    to.get(&format!("/v1/results/{key}")).await.problem(410, "evicted");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_a_file_states_beside_the_bodies_is_taken_as_far_as_it_fits() {
    let (from, to) = (Server::start().await, Server::start().await);
    let keys = computed(&from, &[1.0, 1.2, 1.4, 1.6, 1.8, 2.0]).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    all(&from, &file).await;
    let mut db = open_file(&file).await;
    let long = "x".repeat(4001);
    for (key, change) in [
        (&keys[0], format!("note = '{long}', note_owner = 'ann'")),
        (
            &keys[1],
            "note = 'a' || char(27) || 'b', owner = char(7), computed = 'soon', cpu_seconds = -1,
             host = printf('%0201d', 7), processors = -1, note_at = NULL"
                .to_owned(),
        ),
        (
            &keys[2],
            "wall_seconds = 'long', owner = x'00ff', version = x'ff', note = x'ff'".to_owned(),
        ),
        (&keys[4], "processors = 'eight', computed = 7".to_owned()),
        // The sum is essential.
        (&keys[5], "sha256 = CAST(sha256 AS BLOB)".to_owned()),
    ] {
        let sql = format!("UPDATE results SET {change} WHERE key = '{key}'");
        sqlx::raw_sql(sqlx::AssertSqlSafe(sql)).execute(&mut db).await.unwrap();
    }
    // A history of columns that are not of one length.
    let body: String = sqlx::query_scalar("SELECT body FROM bodies WHERE key = ?1")
        .bind(&keys[3])
        .fetch_one(&mut db)
        .await
        .unwrap();
    let mut body: Value = serde_json::from_str(&body).unwrap();
    body["history"]["wear_depth"].as_array_mut().unwrap().pop();
    let body = body.to_string();
    sqlx::query("UPDATE results SET sha256 = ?2 WHERE key = ?1")
        .bind(&keys[3])
        .bind(sha256(&body))
        .execute(&mut db)
        .await
        .unwrap();
    sqlx::query("UPDATE bodies SET body = ?2 WHERE key = ?1")
        .bind(&keys[3])
        .bind(body)
        .execute(&mut db)
        .await
        .unwrap();
    db.close().await.unwrap();
    let done = import(to.dir.path(), &file, quiet).await.unwrap();
    assert_eq!((done.results, &done.lacking), (4, &vec![]), "{done:?}");
    for (key, words) in [(&keys[3], "all of one length"), (&keys[5], "sha256")] {
        let why = done.refused.iter().find(|(refused, _)| refused == key);
        assert!(why.is_some_and(|(_, why)| why.contains(words)), "{words}: {done:?}");
    }
    let left_out = |key: &str| -> Vec<&str> {
        let left = done.left_out.iter().filter(|(left, _)| left.to_string() == key);
        left.map(|(_, what)| what.as_str()).collect()
    };
    assert_eq!(left_out(&keys[0]), ["its note must have 1 to 4000 characters, not 4001"]);
    assert_eq!(
        left_out(&keys[1]),
        [
            "its owner is no name of up to 200 characters",
            "its computed is no moment such as 2026-01-31T12:00:00.000Z",
            "its cpu_seconds is no time in seconds",
            "its host is no name of up to 200 characters",
            "its processors is no number of processors",
            "its note must not contain control characters other than line breaks and tabs",
        ]
    );
    assert_eq!(
        left_out(&keys[2]),
        [
            "its owner is no name of up to 200 characters",
            "its wall_seconds is no time in seconds",
            "its version is no name of up to 200 characters",
            "its machine, for there is no version",
            "its note is no text",
        ]
    );
    assert_eq!(
        left_out(&keys[4]),
        [
            "its computed is no moment such as 2026-01-31T12:00:00.000Z",
            "its processors is no number of processors",
        ]
    );
    for key in [0, 1, 2, 4] {
        let told = to.get(&format!("/v1/results/{}/provenance", keys[key])).await.json();
        assert!(told["note"].is_null(), "{told}");
        assert_eq!(told["computed"]["owner"].is_null(), key == 1 || key == 2, "{told}");
        assert_eq!(told["program"].is_null(), key == 2, "{told}");
        assert_eq!(told["program"]["processors"].is_null(), key != 0, "{told}");
        assert_eq!(told["program"]["host"].is_null(), key == 1 || key == 2, "{told}");
    }
    for key in [3, 5] {
        let address = format!("/v1/results/{}", keys[key]);
        to.get(&address).await.problem(404, "unknown-result");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_file_without_some_of_the_columns_is_taken_for_what_it_has() {
    let (from, to) = (Server::start().await, Server::start().await);
    let keys = computed(&from, &[1.0, 1.2]).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    all(&from, &file).await;
    let mut db = open_file(&file).await;
    for column in ["note", "note_owner", "note_at", "processors", "cpu_seconds"] {
        let sql = format!("ALTER TABLE results DROP COLUMN {column}");
        sqlx::raw_sql(sqlx::AssertSqlSafe(sql)).execute(&mut db).await.unwrap();
    }
    let data = to.dir.path().to_str().unwrap();
    let output = run(&["import", file.to_str().unwrap(), "--data-dir", data], "");
    assert!(output.status.success(), "{output:?}");
    let [said, told] =
        [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(said.contains(": 2 results (") && said.contains(" 0 refused"), "{said}");
    for column in ["note", "note_owner", "note_at", "processors", "cpu_seconds"] {
        let line = format!("left out of all results: the file has no column {column}\n");
        assert_eq!(told.matches(&line).count(), 1, "{told}");
    }
    for key in &keys {
        let address = format!("/v1/results/{key}/provenance");
        let (one, other) = (from.get(&address).await.json(), to.get(&address).await.json());
        assert_eq!(one["computed"]["at"], other["computed"]["at"]);
        assert_eq!(one["computed"]["wall_seconds"], other["computed"]["wall_seconds"]);
        assert_eq!(one["program"]["version"], other["program"]["version"]);
        assert!(other["program"]["processors"].is_null(), "{other}");
    }
    // Without what is essential it is no export.
    for column in ["results DROP COLUMN sha256", "bodies DROP COLUMN body"] {
        let sql = format!("ALTER TABLE {column}");
        sqlx::raw_sql(sqlx::AssertSqlSafe(sql)).execute(&mut db).await.unwrap();
        let refused = import(to.dir.path(), &file, quiet).await;
        assert!(matches!(refused, Err(Moving::NoExport(_))), "{refused:?}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_file_that_is_damaged_in_one_place_costs_the_result_that_lies_there() {
    let (from, to) = (Server::start().await, Server::start().await);
    computed(&from, &[1.0, 1.2, 1.4]).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.db");
    all(&from, &file).await;
    let mut db = open_file(&file).await;
    let place: i64 = sqlx::query_scalar(
        "SELECT pgoffset FROM dbstat WHERE name = 'bodies' AND pagetype = 'overflow'
         AND path LIKE '%+000000' ORDER BY path LIMIT 1",
    )
    .fetch_one(&mut db)
    .await
    .unwrap();
    db.close().await.unwrap();
    // The number of the next page of the body.
    let mut bytes = fs::read(&file).unwrap();
    bytes[usize::try_from(place).unwrap()..][..4].fill(0xff);
    fs::write(&file, bytes).unwrap();
    let done = import(to.dir.path(), &file, quiet).await.unwrap();
    let refused: Vec<&str> = done.refused.iter().map(|(_, why)| why.as_str()).collect();
    assert_eq!((done.results, refused), (2, vec!["the file is damaged where it lies"]));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_note_comes_where_there_is_none_and_never_in_the_place_of_another() {
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
    // None here, another one, the same, and another one of a result that was dropped.
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
    assert_eq!(all(&from, &file).await, 4);
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
    assert!(
        said.ends_with("notes: 1 taken, 2 left for the ones here; 0 details left out\n"),
        "{said}"
    );
    for place in [1, 3] {
        let line = format!("left the note of {}: there is another one here", keys[place]);
        assert!(told.contains(&line), "{told}");
    }
    assert_eq!([noted(1).await, noted(2).await, noted(3).await], before);
    assert_eq!(to.get(&dropped).await.status, 200);
    // What is worth its room is for each server to say.
    let ours = to.get(&format!("/v1/results/{}/provenance", keys[0])).await.json();
    assert_eq!((&theirs["pinned"], &ours["pinned"]), (&json!(true), &json!(false)));
    let [said, _] = import();
    assert!(
        said.ends_with(
            "4 known already, 0 refused; notes: 0 taken, 2 left for the ones here; 0 details left \
             out\n"
        ),
        "{said}"
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_commands_say_what_they_did_and_what_is_wrong() {
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
        "no result with the key",
    );
    fails(&run(&["export", &path("x.db"), "--data-dir", &path("nowhere")], ""), "there is no");
    let refused = run(&["export", &path("x.db"), "shape=cube", "--data-dir", data], "");
    assert!(
        String::from_utf8_lossy(&refused.stderr).contains("must be one of paraboloid"),
        "{refused:?}"
    );
    // Where there is no database yet, one is made.
    let new = path("new");
    let output = run(&["import", &path("one.db"), "--data-dir", &new], "");
    assert!(output.status.success() && said(&output).contains("1 result ("), "{output:?}");
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
    let mut desk = Desk::open(server.dir.path()).await.unwrap();
    for name in ["anna", "ben"] {
        let name = name.to_owned();
        let new = NewKey { name, role: Role::Read, per_minute: None, expires: None };
        desk.add_key(&new).await.unwrap();
    }
    desk.revoke_keys("ben").await.unwrap();
    desk.close().await.unwrap();
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
    assert!(said(&output).contains("key in force: "), "{output:?}");
    assert!(said(&output).contains("anna (read)"), "{output:?}");
    assert!(!said(&output).contains("ben"), "{output:?}");
    let store = open(Path::new(&new)).await;
    assert!(store.has_result(&key.parse().unwrap()).await.unwrap());
    assert_eq!(store.jobs(&Filter::default(), None, 9).await.unwrap().jobs.len(), 2);
    fs::write(
        path("text.db"),
        "some text that is no database, and longer than a head of 100 bytes".repeat(3),
    )
    .unwrap();
    fails(&run(&["import", &path("text.db"), "--data-dir", data], ""), "not an export");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn tables_of_another_version_are_told_and_not_touched() {
    let (dir, store) = crate::store::fresh().await;
    let file = dir.path().join("out.db");
    let mut db = raw(dir.path()).await;
    let all = Search::default();
    db.execute(
        "DELETE FROM _sqlx_migrations WHERE version = (SELECT max(version) FROM _sqlx_migrations)",
    )
    .await
    .unwrap();
    let refused = export(dir.path(), &file, &all, &[], quiet).await;
    assert!(matches!(refused, Err(Moving::Store(Error::Older { .. }))), "{refused:?}");
    db.execute("INSERT INTO _sqlx_migrations VALUES (999, 'later', 0, TRUE, x'', 0)")
        .await
        .unwrap();
    let refused = export(dir.path(), &file, &all, &[], quiet).await;
    assert!(matches!(refused, Err(Moving::Store(Error::Newer { found: 999, .. }))), "{refused:?}");
    // A copy can be taken all the same.
    backup(dir.path(), &file).await.unwrap();
    let refused = restore(&dir.path().join("other"), &file, false).await;
    assert!(matches!(refused, Err(Moving::Store(Error::Newer { .. }))), "{refused:?}");
    store.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 3)]
async fn a_backup_under_load_holds_every_job_that_was_acknowledged_before() {
    let dir = TempDir::new().unwrap();
    let store = open(dir.path()).await;
    let workers = Workers::start(&store, 1, None, &(Arc::new(Task::start) as _)).unwrap();
    let over = Arc::new(AtomicBool::new(false));
    let load = tokio::spawn({
        let (store, over) = (store.clone(), Arc::clone(&over));
        async move {
            let mut count = 0_u32;
            while !over.load(Ordering::Relaxed) {
                let body = ball(1.0 + 1e-4 * f64::from(count));
                let task = fretwork::job::Submission::parse(&body).unwrap().task;
                let job =
                    fretwork::store::NewJob { key: task.key(), task: task.to_json(), ..new_job(0) };
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
            let kept = copy.job(job.id).await.unwrap().expect("a job that was acknowledged");
            assert_eq!(kept.key, job.key);
            if job.state == JobState::Succeeded {
                assert_eq!(kept, *job);
                assert!(copy.has_result(&job.key).await.unwrap());
            }
        }
        // It goes on from there.
        let claimed = copy.claim().await.unwrap();
        assert!(claimed.is_some(), "what was queued still is");
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
async fn a_backup_put_in_place_by_hand_is_not_harmed_by_a_log_that_was_left() {
    let server = Server::start().await;
    let keys = computed(&server, &[1.0]).await;
    let target = TempDir::new().unwrap();
    let file = target.path().join("backup.db");
    backup(server.dir.path(), &file).await.unwrap();
    let later = computed(&server, &[1.1, 1.2, 1.3]).await;
    // As after a crash: the log is there, and the database gives way to the backup.
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
    // Its own log is not forgotten.
    let own = crate::store::crash(server.dir.path());
    let store = Store::open(own.path(), &Options::default()).await.unwrap();
    assert!(store.has_result(&later[0].parse().unwrap()).await.unwrap());
    store.close().await;
}
