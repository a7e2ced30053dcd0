//! Mutated exports, damaged bodies, and inputs of random bytes.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use fretwork::http::Settings;
use fretwork_format::{self as format, FigureOptions, Format, Part, QUANTITIES, View};
use fretwork_job::{Canonical, Key, Prepared, Received, Refused, Submission, Task};
use fretwork_store::{Options, Search, Store, export, restore};
use proptest::prelude::*;
use proptest::sample::Index;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::TestRunner;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::moving::{Lines, import, quiet, sha256};
use crate::server::{JSON, Reply, Server, ball, metric};
use crate::store::raw;

/// A job with a small result.
pub fn small(amplitude: f64, method: &str) -> Value {
    let mut body = ball(amplitude);
    body["scenario"]["cycles"] = json!([1000, 30000]);
    body["scenario"]["model"] = json!({"method": method, "points": 16});
    if method == "exact" {
        body["scenario"]["model"]["tolerance"] = json!(0.03);
    }
    body
}

/// A result, computed without a server.
fn computed(job: &Value) -> (Prepared, String) {
    let task = Submission::parse(job.to_string().as_bytes()).unwrap().prepared;
    let body = String::from_utf8(task.compute(|_| {}).body.to_vec()).unwrap();
    (task, body)
}

/// Replaces the body of a result in an export, and its digest.
pub fn replace(file: &Path, key: &str, body: &str) {
    let mut lines = Lines::open(file);
    lines.replace_body(key, body);
    lines.save();
}

/// An export of these jobs; returns its directory, its path, and keys and bodies of the results.
pub async fn exported(jobs: &[Value]) -> (TempDir, std::path::PathBuf, Vec<(String, Vec<u8>)>) {
    let server = Server::start().await;
    let mut results = Vec::new();
    for job in jobs {
        let key = server.compute(job).await.json()["key"].as_str().unwrap().to_owned();
        let body = server.get(&format!("/v1/results/{key}")).await.body;
        results.push((key, body));
    }
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.ndjson.zst");
    export(server.place(), &file, &Search::default(), &[], &mut quiet).await.unwrap();
    (dir, file, results)
}

/// Multiplies the numbers of a column of a result, and writes the result as the program does.
fn scaled(body: &str, pointer: &str, factor: f64) -> String {
    let mut document: Value = serde_json::from_str(body).unwrap();
    for item in document.pointer_mut(pointer).unwrap().as_array_mut().unwrap() {
        *item = json!(factor * item.as_f64().unwrap());
    }
    fretwork_json::write(&document, body.len())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_result_of_a_later_engine_is_refused() {
    let (task, body) = computed(&small(2.0, "simplified"));
    let mut document: Value = serde_json::from_str(&body).unwrap();
    document["engine"]["numerics"] = json!(99);
    let refused = Received::read(&task.key, document.to_string().as_bytes()).unwrap_err();
    assert!(matches!(refused, Refused::Later(99)), "{refused}");
}

/// Texts that mutations insert into an input.
const TOKENS: [&str; 22] = [
    "0",
    "-1",
    "7",
    "1e999",
    "1e308",
    "1e-320",
    "-0.0",
    "12345678901234567890",
    "null",
    "true",
    "[]",
    "{}",
    "[[]]",
    "\"\"",
    "\"x\"",
    ",",
    ":",
    "\"cycles\":",
    "\"worn\":[[1]],",
    "\\u0000",
    "µ",
    "\u{1F980}",
];

/// A change of some bytes.
#[derive(Debug, Clone)]
enum Edit {
    Replace(Index, u8),
    Remove(Index, u8),
    Repeat(Index, u8),
    Insert(Index, &'static str),
    /// Replaces a number.
    Number(Index, &'static str),
}

impl Edit {
    fn apply(&self, bytes: &mut Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        let length = bytes.len();
        match self {
            Self::Replace(at, byte) => bytes[at.index(length)] = *byte,
            Self::Remove(at, count) => {
                let from = at.index(length);
                bytes.drain(from..(from + usize::from(*count)).min(length));
            }
            Self::Repeat(at, count) => {
                let from = at.index(length);
                let part = bytes[from..(from + usize::from(*count)).min(length)].to_vec();
                bytes.splice(from..from, part);
            }
            Self::Insert(at, token) => {
                let from = at.index(length);
                bytes.splice(from..from, token.bytes());
            }
            Self::Number(at, token) => {
                let is_digit = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
                let start = at.index(length);
                let Some(from) = bytes[start..].iter().position(is_digit) else { return };
                let from = start + from;
                let count = bytes[from..].iter().take_while(|byte| is_digit(byte)).count();
                bytes.splice(from..from + count, token.bytes());
            }
        }
    }
}

fn apply(edits: &[Edit], bytes: &mut Vec<u8>) {
    for edit in edits {
        edit.apply(bytes);
    }
}

fn any_edit() -> impl Strategy<Value = Edit> {
    let (at, token) = (any::<Index>, || prop::sample::select(&TOKENS[..]));
    prop_oneof![
        (at(), any::<u8>()).prop_map(|(at, byte)| Edit::Replace(at, byte)),
        (at(), any::<u8>()).prop_map(|(at, count)| Edit::Remove(at, count)),
        (at(), any::<u8>()).prop_map(|(at, count)| Edit::Repeat(at, count)),
        (at(), token()).prop_map(|(at, token)| Edit::Insert(at, token)),
        (at(), token()).prop_map(|(at, token)| Edit::Number(at, token)),
    ]
}

/// Random bytes, and valid inputs with some changes.
fn any_bytes(valid: Vec<Vec<u8>>) -> impl Strategy<Value = Vec<u8>> {
    let edited = (prop::sample::select(valid), prop::collection::vec(any_edit(), 1..4));
    let edited = edited.prop_map(|(mut bytes, edits)| {
        apply(&edits, &mut bytes);
        bytes
    });
    prop_oneof![1 => prop::collection::vec(any::<u8>(), 0..300), 9 => edited]
}

fn runner() -> TestRunner {
    TestRunner::new(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })
}

/// Draws inputs and calls `read`, which must not panic: 8000 times, or for a quarter of an hour with
/// `FRETWORK_TEST_LONG`.
fn for_random_inputs(inputs: &impl Strategy<Value = Vec<u8>>, mut read: impl FnMut(&[u8])) {
    let mut runner = runner();
    let end =
        std::env::var_os("FRETWORK_TEST_LONG").map(|_| Instant::now() + Duration::from_mins(15));
    let mut count = 0_u32;
    while end.map_or(count < 8000, |end| Instant::now() < end) {
        let input = inputs.new_tree(&mut runner).unwrap().current();
        let told = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| read(&input)));
        assert!(told.is_ok(), "{}", String::from_utf8_lossy(&input));
        count += 1;
    }
}

#[test]
fn a_submission_of_random_bytes_is_accepted_or_refused() {
    let examples = fretwork::http::EXAMPLES.iter();
    let valid = examples.map(|example| example.body.as_bytes().to_vec()).collect();
    let mut accepted = 0;
    for_random_inputs(&any_bytes(valid), |bytes| {
        accepted += u32::from(Submission::parse(bytes).is_ok());
    });
    assert!(accepted > 100, "{accepted}");
}

#[test]
fn a_stored_task_of_random_bytes_is_prepared_or_refused() {
    let tasks = [small(2.0, "exact"), small(1.0, "simplified")].map(|job| computed(&job).0);
    let valid = tasks.iter().map(|task| task.stored.as_bytes().to_vec()).collect();
    for_random_inputs(&any_bytes(valid), |bytes| {
        let text = String::from_utf8_lossy(bytes);
        if let Some(key) = Canonical::key_of(&text) {
            let prepared = Prepared::from_stored(&key, &text);
            assert!(prepared.is_err() || prepared.is_ok_and(|prepared| prepared.key == key));
        }
        let _ = Prepared::from_stored(&tasks[0].key, &text);
    });
}

#[test]
fn a_condition_of_random_text_is_accepted_or_refused() {
    let names: Vec<&str> = Search::names().collect();
    let values =
        ["cone", "0.6..0.8", "..2 um", "50 N..0.2 kN", "2026-01-31..", "-wear_volume", "true"];
    let valid = values.map(|value| value.as_bytes().to_vec()).to_vec();
    let mut place = 0;
    for_random_inputs(&any_bytes(valid), |bytes| {
        place += 1;
        let text = String::from_utf8_lossy(bytes);
        let refused = Search::default().set(names[place % names.len()], &text);
        assert!(refused.err().is_none_or(|why| !why.is_empty()));
    });
}

/// A sweep of three short runs with profiles. One of them is refused.
fn small_sweep() -> Value {
    let mut scenario = small(2.0, "simplified")["scenario"].take();
    scenario["cycles"] = json!([1000]);
    json!({"sweep": {
        "scenario": scenario,
        "vary": [{"pointer": "/friction", "values": [0.5, -1.0, 0.7]}],
        "outputs": ["wear_volume"],
        "profiles": {"radius": [0, 1e-3], "fields": ["wear", "slip"]},
    }})
}

/// Whether all rows of a result agree with a new computation.
fn is_verified(received: &Received, body: &[u8]) -> bool {
    let agrees = |row| matches!(received.verify_row(body, row, || true), Some(Ok(())));
    (0..received.rows()).all(agrees) && received.verified(received.rows()).is_ok()
}

/// This takes more than 5 s, because it reads 8000 bodies.
#[test]
fn an_imported_body_of_random_bytes_is_refused_unless_it_is_the_result() {
    let jobs = [small(2.0, "exact"), small(1.0, "simplified"), small_sweep()];
    let results: Vec<_> = jobs.iter().map(computed).collect();
    let valid = results.iter().map(|(_, body)| body.clone().into_bytes()).collect();
    let differing = std::cell::Cell::new(0_u32);
    for_random_inputs(&any_bytes(valid), |bytes| {
        for (task, body) in &results {
            let Ok(received) = Received::read(&task.key, bytes) else { continue };
            // The check may accept or refuse the bytes, but it must not panic.
            let _ = format::check(bytes);
            let is_true = bytes == body.as_bytes();
            differing.set(differing.get() + u32::from(!is_true));
            // A run is verified by comparing its bytes, so only the verification of studies is tested.
            if let Task::Study(_) = task.task {
                assert_eq!(is_verified(&received, bytes), is_true);
            }
        }
    });
    assert!(differing.get() > 100, "{differing:?}");
    for (task, body) in &results {
        assert!(is_verified(&Received::read(&task.key, body.as_bytes()).unwrap(), body.as_bytes()));
    }
}

/// All parts and formats of a result, and all figures.
fn all_forms() -> Vec<(Part, Format, View)> {
    let mut forms = Vec::new();
    for part in [Part::Whole, Part::History, Part::Profiles, Part::Loops] {
        for format in part.formats() {
            for view in [
                View::default(),
                View { engineering: true, digits: Some(5), ..View::default() },
                View { cycles: Some(vec![0.0]), points: Some(3), ..View::default() },
            ] {
                forms.push((part, *format, view));
            }
        }
    }
    for quantity in &QUANTITIES[..] {
        let figure = FigureOptions { quantity, ..FigureOptions::default() };
        forms.push((Part::Plot, Format::Svg, View { figure, ..View::default() }));
    }
    forms
}

/// This takes more than 5 s, because it writes 300 bodies in all forms.
#[test]
fn a_damaged_body_can_be_written_or_is_refused_in_every_form() {
    let results = [small(2.0, "exact"), small(1.0, "simplified")].map(|job| computed(&job).1);
    let bodies = any_bytes(results.map(String::into_bytes).to_vec());
    let (mut runner, forms) = (runner(), all_forms());
    let count = if std::env::var_os("FRETWORK_TEST_LONG").is_some() { 100_000 } else { 300 };
    for _ in 0..count {
        let body = bodies.new_tree(&mut runner).unwrap().current();
        for (part, format, view) in &forms {
            let written = std::panic::catch_unwind(|| {
                format::write(&mut Vec::new(), &body, *part, *format, view)
            });
            let text = String::from_utf8_lossy(&body);
            match written.unwrap_or_else(|_| panic!("{part:?} {format:?} {view:?}: {text}")) {
                Ok(()) | Err(format::Error::Document(_) | format::Error::Missing(_)) => {}
                Err(other) => panic!("{part:?} {format:?} {other:?}: {text}"),
            }
        }
    }
}

/// Replaces the stored body of a result with a body that has the right checksum.
async fn store_body(server: &Server, key: &str, body: &str) {
    let key: Key = key.parse().unwrap();
    // Version 0.3 and earlier stored plain JSON with a digest.
    sqlx::query("UPDATE result_blob SET body = ?2 WHERE key = ?1")
        .bind(key.bytes().as_slice())
        .bind(body.as_bytes())
        .execute(&mut raw(server.dir.path()).await)
        .await
        .unwrap();
    sqlx::query("UPDATE result SET checksum = NULL, digest = ?2, size = ?3 WHERE key = ?1")
        .bind(key.bytes().as_slice())
        .bind(sha256(body).parse::<Key>().unwrap().bytes().as_slice())
        .bind(i64::try_from(body.len()).unwrap())
        .execute(&mut raw(server.dir.path()).await)
        .await
        .unwrap();
}

/// A server that keeps no answers in memory.
async fn without_memory() -> Server {
    let settings = Settings { memory: 0, ..Settings::default() };
    Server::with(Arc::new(Task::start), &settings, &Options::default()).await
}

async fn no_cache(server: &Server, job: &Value) -> Reply {
    let headers = [JSON, ("Prefer", "wait=60"), ("Cache-Control", "no-cache")];
    server.send("POST", "/v1/jobs?include=result", &headers, job.to_string()).await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_damaged_result_names_its_key_and_the_remedy() {
    let server = without_memory().await;
    let job = small(2.0, "simplified");
    let key = server.compute(&job).await.json()["key"].as_str().unwrap().to_owned();
    let body = server.get(&format!("/v1/results/{key}")).await.text().to_owned();
    for damage in [
        "{}".to_owned(),
        "no JSON".to_owned(),
        body.replacen("\"cycles\":[0.0,", "\"cycles\":[0.0,5.0,", 9),
        body.replacen("\"history\":{", "\"history\":[", 1),
        body.replacen("\"units\":{", "\"units\":{\"worn\":5,", 1),
        body.replacen("\"worn\":[[", "\"worn\":[[],[", 1),
    ] {
        assert_ne!(damage, body);
        store_body(&server, &key, &damage).await;
        for form in [
            "?format=npz",
            "/history?format=csv",
            "/profiles?format=ndjson",
            "/loops?format=arrow",
            "/history?layout=records",
            "/profiles?format=npz&points=3",
            "/plot.svg",
            "/plot.svg?quantity=loops",
            "/plot.svg?quantity=wear_volume",
        ] {
            let reply = server.get(&format!("/v1/results/{key}{form}")).await;
            if reply.status == 200 {
                continue;
            }
            let problem = reply.problem(500, "database-damaged");
            let detail = problem["detail"].as_str().unwrap();
            assert!(detail.contains(&key) && detail.contains("no-cache"), "{form}: {detail}");
        }
        server.get(&format!("/v1/results/{key}?format=npz")).await.problem(500, "database-damaged");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_recomputation_that_differs_warns_the_client_and_an_administrator_can_replace_the_result()
{
    let server = without_memory().await;
    let job = small(2.0, "simplified");
    let first = server.compute(&job).await.json();
    assert_eq!(first["recomputed"], Value::Null);
    let path = first["links"]["result"].as_str().unwrap().to_owned();
    let sound = server.get(&path).await.body;
    let same = no_cache(&server, &job).await.json();
    assert_eq!((&same["recomputed"], &same["warnings"]), (&json!("same"), &first["warnings"]));

    let wrong = scaled(std::str::from_utf8(&sound).unwrap(), "/history/wear_volume", 7.0);
    store_body(&server, first["key"].as_str().unwrap(), &wrong).await;
    let told = no_cache(&server, &job).await.json();
    assert_eq!(told["recomputed"], "differs");
    let warnings = told["warnings"].as_array().unwrap();
    let warning = warnings.last().unwrap();
    assert_eq!(warning["kind"], "recompute_differs");
    let delete = format!("DELETE {path}");
    assert!(warning["detail"].as_str().unwrap().contains(&delete), "{warning}");
    // The job keeps the warning, and the stored result is not replaced.
    let id = told["id"].as_str().unwrap();
    assert_eq!(server.get(&format!("/v1/jobs/{id}")).await.json()["warnings"], told["warnings"]);
    assert_eq!(server.get(&path).await.body, wrong.as_bytes());
    assert!(metric(server.address, "fretwork_recomputes_total{result=\"differs\"}").await >= 1.0);

    assert_eq!(server.send("DELETE", &path, &[], "").await.status, 204);
    let replaced = server.compute(&job).await.json();
    assert_eq!(replaced["recomputed"], "replaced");
    assert_eq!(server.get(&path).await.body, sound);
    assert_eq!(no_cache(&server, &job).await.json()["recomputed"], "same");
}

/// Mutates an export: bytes of the file, bytes of its lines, a member, or a body with its digest.
fn mutate(file: &Path, number: usize, results: &[(String, Vec<u8>)], runner: &mut TestRunner) {
    let edits = prop::collection::vec(any_edit(), 1..4).new_tree(runner).unwrap().current();
    let mut lines = Lines::open(file);
    match number % 5 {
        0 => {
            let mut bytes = fs::read(file).unwrap();
            apply(&edits, &mut bytes);
            fs::write(file, bytes).unwrap();
        }
        1 => {
            let mut bytes = lines.text().into_bytes();
            apply(&edits, &mut bytes);
            fs::write(file, bytes).unwrap();
        }
        2 => {
            let members: Vec<String> =
                lines.results[0].0.as_object().unwrap().keys().cloned().collect();
            let member = &members[number / 5 % members.len()];
            let token = TOKENS[number % TOKENS.len()];
            let value = serde_json::from_str(token).unwrap_or_else(|_| json!(token));
            lines.results[0].0[member] = value;
            lines.save();
        }
        _ => {
            let (key, body) = &results[number % results.len()];
            let mut body = body.clone();
            apply(&edits, &mut body);
            lines.replace_body(key, &String::from_utf8_lossy(&body));
            lines.save();
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_wrong_result_of_a_mutated_export_is_served() {
    let jobs = [small(2.0, "exact"), small(1.0, "simplified"), small(1.5, "simplified")];
    let (dir, file, results) = exported(&jobs).await;
    let mut runner = runner();
    let count = if std::env::var_os("FRETWORK_TEST_LONG").is_some() { 20_000 } else { 300 };
    let (mut stored, mut refused, mut unreadable) = (0, 0, 0);
    let to = TempDir::new().unwrap();
    Store::open(to.path().into(), &Options::default()).await.unwrap().close().await;
    let empty = fs::read(to.path().join("fretwork.db")).unwrap();
    for number in 0..count {
        let mutated = dir.path().join("mutated.zst");
        fs::copy(&file, &mutated).unwrap();
        mutate(&mutated, number, &results, &mut runner);
        match import(to.path(), &mutated).await {
            Err(_) => unreadable += 1,
            Ok(done) => {
                stored += done.results;
                refused += done.refused.len();
            }
        }
        if number % 100 == 99 {
            check_served(to.path(), &results).await;
            for name in ["fretwork.db-wal", "fretwork.db-shm"] {
                let _ = fs::remove_file(to.path().join(name));
            }
            fs::write(to.path().join("fretwork.db"), &empty).unwrap();
        }
    }
    assert!(stored > 0 && refused > 30 && unreadable > 3, "{stored} {refused} {unreadable}");
}

/// Asserts that each stored result equals the original, and that the server serves it in every form.
async fn check_served(dir: &Path, results: &[(String, Vec<u8>)]) {
    let copy = TempDir::new().unwrap();
    fs::copy(dir.join("fretwork.db"), copy.path().join("fretwork.db")).unwrap();
    let log = dir.join("fretwork.db-wal");
    if log.exists() {
        fs::copy(log, copy.path().join("fretwork.db-wal")).unwrap();
    }
    let begin = Arc::new(Task::start);
    let settings = Settings::default();
    let server = Server::opening(copy, begin, None, &settings, &Options::default()).await;
    for (key, body) in results {
        let reply = server.get(&format!("/v1/results/{key}")).await;
        if reply.status == 404 {
            continue;
        }
        assert!(reply.body == *body, "{key}");
        for form in [
            "?format=npz",
            "/history?format=csv",
            "/profiles",
            "/loops?format=arrow",
            "/plot.svg",
            "/provenance",
        ] {
            assert_eq!(server.get(&format!("/v1/results/{key}{form}")).await.status, 200, "{form}");
        }
    }
    for list in ["/v1/results", "/v1/results?note=x&sort=-wear_volume"] {
        assert_eq!(server.get(list).await.status, 200, "{list}");
    }
}

#[tokio::test]
async fn a_compressed_request_body_is_refused() {
    let server = Server::start().await;
    let body = small(2.0, "simplified").to_string();
    for path in ["/v1/jobs", "/v1/scenarios"] {
        let headers = [JSON, ("Content-Encoding", "gzip")];
        let reply = server.send("POST", path, &headers, &body).await;
        reply.problem(415, "unsupported-content-encoding");
        assert_eq!(reply.header("accept-encoding"), Some("identity"));
        let headers = [JSON, ("Content-Encoding", "identity")];
        assert!(server.send("POST", path, &headers, &body).await.status < 300);
    }
}

/// sqlx panics at a column whose type is not text, and then some statements wait without end.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_database_whose_schema_is_not_text_is_refused() {
    let to = TempDir::new().unwrap();
    Store::open(to.path().into(), &Options::default()).await.unwrap().close().await;
    let database = to.path().join("fretwork.db");
    let mut bytes = fs::read(&database).unwrap();
    let mut changed = 0;
    for place in 0..bytes.len() - 5 {
        if &bytes[place..place + 5] == b" BLOB" || &bytes[place..place + 5] == b" TEXT" {
            bytes[place + 1] = 0xff;
            changed += 1;
        }
    }
    assert!(changed > 3, "the database has columns");
    fs::write(&database, bytes).unwrap();
    let other = TempDir::new().unwrap();
    let refused = restore(other.path(), &database, true).await.unwrap_err().to_string();
    assert!(refused.contains("damaged"), "{refused}");
    let refused = Store::open(to.path().into(), &Options::default()).await.unwrap_err().to_string();
    assert!(refused.contains("damaged"), "{refused}");
}
