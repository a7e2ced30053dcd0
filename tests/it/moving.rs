//! Export and import between servers; backup and restore.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use fretwork::http::Settings;
use fretwork::service::workers::Workers;
use fretwork::service::{self, WorkLimits};
use fretwork_job::{JobState, Key, Task};
use fretwork_store::{
    Administration, Error, Filter, Imported, Moving, NewKey, Options, Place, Role, Search, Store,
    backup, export, restore,
};
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use sqlx::{AssertSqlSafe, Executor as _};
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

/// The lines of an export, which a test alters.
pub struct Lines {
    file: PathBuf,
    pub head: String,
    /// What is known of each result, and its body.
    pub results: Vec<(Value, String)>,
}

impl Lines {
    pub fn open(file: &Path) -> Self {
        let text = zstd::decode_all(File::open(file).unwrap()).unwrap();
        Self::of_text(file, std::str::from_utf8(&text).unwrap())
    }

    /// These lines, which [`save`](Self::save) writes into a file.
    fn of_text(file: &Path, text: &str) -> Self {
        let mut lines = text.lines();
        let head = lines.next().unwrap().to_owned();
        let results = lines.map(|line| {
            let (known, body) = line.split_once(",\"result\":").unwrap();
            let known = serde_json::from_str(&format!("{known}}}")).unwrap();
            (known, body.strip_suffix('}').unwrap().to_owned())
        });
        Self { file: file.to_owned(), head, results: results.collect() }
    }

    /// What is known of the result with this key, and its body.
    pub fn of(&mut self, key: &str) -> &mut (Value, String) {
        self.results.iter_mut().find(|(known, _)| known["key"] == key).unwrap()
    }

    /// Replaces a body and its SHA-256.
    pub fn replace_body(&mut self, key: &str, body: &str) {
        let (known, old) = self.of(key);
        known["sha256"] = json!(sha256(body));
        body.clone_into(old);
    }

    /// The lines.
    pub fn text(&self) -> String {
        let line = |(known, body): &(Value, String)| {
            let known = known.to_string();
            format!("{},\"result\":{body}}}\n", known.strip_suffix('}').unwrap())
        };
        let lines: String = self.results.iter().map(line).collect();
        format!("{}\n{lines}", self.head)
    }

    /// Writes the lines into the file.
    pub fn save(&self) {
        fs::write(&self.file, zstd::encode_all(self.text().as_bytes(), 1).unwrap()).unwrap();
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
    let file = dir.path().join("results.ndjson.zst");
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
        assert_eq!(other["imported"]["from"], "results.ndjson.zst");
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
    let file = dir.path().join("results.ndjson.zst");
    export_all(&from, &file).await;
    let to = Server::start().await;
    assert_eq!(import(to.place(), &file).await.unwrap().results, 1);
    let imported = to.get(&at).await.json();
    assert_yields(&imported["warnings"]);
    assert_eq!(imported, from.get(&at).await.json());

    // Nothing but the key, the digest and the result is required.
    let mut lines = Lines::open(&file);
    let (known, _) = &mut lines.results[0];
    *known = json!({"key": known["key"], "sha256": known["sha256"]});
    lines.save();
    let other = Server::start().await;
    assert_eq!(import(other.place(), &file).await.unwrap().results, 1);
    assert_eq!(other.get(&at).await.json(), json!({"warnings": null}));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_export_is_lines_of_json() {
    let server = Server::start().await;
    let keys = computed(&server, &[1.0, 2.0]).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.ndjson.zst");
    let mut search = Search::default();
    search.set("amplitude", "2 um").unwrap();
    let done = export(server.place(), &file, &search, &[], &mut quiet).await.unwrap();
    assert_eq!(done.results, 1);
    let result = server.get(&format!("/v1/results/{}", keys[1])).await;
    let lines = Lines::open(&file);
    let head: Value = serde_json::from_str(&lines.head).unwrap();
    assert_eq!((&head["fretwork_export"], &head["results"]), (&json!(2), &json!(1)));
    assert_eq!(head["numerics"], result.json()["engine"]["numerics"]);
    let [(known, body)] = &lines.results[..] else { panic!("one result") };
    assert_eq!(body.as_bytes(), result.body);
    assert_eq!(done.bytes, body.len() as u64);
    assert_eq!((&known["key"], &known["sha256"]), (&json!(keys[1]), &json!(sha256(body))));
    let told = server.get(&format!("/v1/results/{}/provenance", keys[1])).await.json();
    assert_eq!(known["owner"], told["computed"]["owner"]);
    assert_eq!(known["program"]["host"], told["program"]["host"]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn altered_results_are_refused_and_the_others_are_imported() {
    let server = Server::start().await;
    let keys = computed(&server, &[1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.2]).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.ndjson.zst");
    export_all(&server, &file).await;
    let mut lines = Lines::open(&file);
    // A changed digit in the body.
    let (_, body) = lines.of(&keys[0]);
    *body = body.replacen("\"wear_volume\":[0.0", "\"wear_volume\":[0.1", 1);
    // A changed parameter in the body, with a digest that matches.
    let body = lines.of(&keys[1]).1.replacen("\"friction\":0.7", "\"friction\":0.6", 1);
    lines.replace_body(&keys[1], &body);
    // The body of another result.
    let body = lines.of(&keys[3]).1.clone();
    lines.replace_body(&keys[2], &body);
    // A result without a body, one with an invalid digest, and one with an invalid key.
    lines.of(&keys[4]).1 = "null".to_owned();
    lines.of(&keys[5]).0["sha256"] = json!("none");
    lines.of(&keys[6]).0["key"] = json!("x");
    lines.save();
    let other = Server::start().await;
    let done = import(other.place(), &file).await.unwrap();
    assert_eq!(done.results, 1, "{done:?}");
    for (key, words) in [
        (keys[0].as_str(), "SHA-256"),
        (&keys[1], "key of the result does not belong"),
        (&keys[2], "key of the result does not belong"),
        (&keys[4], "does not match its SHA-256"),
        (&keys[5], "must have 64 lower-case hexadecimal digits"),
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
    let file = dir.path().join("results.ndjson.zst");
    export_all(&from, &file).await;
    // A valid result, as a machine that computes other digits would export it.
    let mut lines = Lines::open(&file);
    let body = lines.of(&key).1.replacen("\"wear_volume\":[0.0", "\"wear_volume\":[1e-30", 1);
    lines.replace_body(&key, &body);
    lines.save();
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
async fn an_invalid_line_is_refused_with_a_reason() {
    let (from, to) = (Server::start().await, Server::start().await);
    let amplitudes: Vec<f64> = (0..14).map(|place| 1.0 + 0.1 * f64::from(place)).collect();
    let keys = computed(&from, &amplitudes).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.ndjson.zst");
    export_all(&from, &file).await;
    let mut lines = Lines::open(&file);
    let note = |text: String| json!({"text": text, "owner": "ann", "at": "2026-01-31T12:00:00Z"});
    let cases = [
        ("note", note("x".repeat(4001)), "not 4001"),
        ("note", json!({"text": "x", "owner": "ann"}), "missing field `at`"),
        ("note", json!({"text": "x", "owner": "ann", "at": "soon"}), "not an RFC 3339 time"),
        ("computed", json!("soon"), "\"soon\" is not an RFC 3339 time"),
        ("cpu_seconds", json!(-1), "-1 is not a time in seconds"),
        ("wall_seconds", json!("long"), "expected f64"),
        ("program", json!({"version": 4}), "expected a string"),
        ("program", json!({"version": "0.4", "processors": -1}), "expected u32"),
        ("program", json!({"version": "0.4", "host": "\u{1b}[2J"}), "`host` has more than 200"),
        ("owner", json!("x".repeat(201)), "`owner` has more than 200 characters"),
        ("sha256", Value::Null, "expected a string"),
        ("warnings", json!(["yield"]), "expected struct Told"),
        (
            "warnings",
            json!([{"kind": "yield", "detail": "x".repeat(4000)}]),
            "`warnings` has more than 4000 bytes",
        ),
    ];
    for (key, (member, value, _)) in keys.iter().zip(&cases) {
        lines.of(key).0[*member] = value.clone();
    }
    // A history whose columns differ in length.
    let last = &keys[cases.len()];
    let mut body: Value = serde_json::from_str(&lines.of(last).1).unwrap();
    body["history"]["wear_depth"].as_array_mut().unwrap().pop();
    lines.replace_body(last, &body.to_string());
    lines.save();
    let done = import(to.place(), &file).await.unwrap();
    assert_eq!((done.results, done.refused.len()), (0, 14), "{done:?}");
    let words = cases.iter().map(|(.., words)| *words).chain(["lists of numbers of equal length"]);
    for (key, words) in keys.iter().zip(words) {
        assert_refused(&done, key, words);
        to.get(&format!("/v1/results/{key}")).await.problem(404, "unknown-result");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_line_that_is_no_line_of_an_export_is_refused_or_ends_the_import() {
    let from = Server::start().await;
    let keys = computed(&from, &[1.0, 1.2, 1.4, 1.6]).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.ndjson.zst");
    export_all(&from, &file).await;
    let sound = Lines::open(&file);
    let text = sound.text();
    // Lines need not be compressed, so that other programs can choose among them.
    for (insert, results, name, words) in [
        ("{\"key\":\"abc\"}", 4, "abc", "the line is not one of an export: missing field"),
        ("some text", 2, "in line 4", "has no key of a result; the rest of the file is not read"),
        (&"[".repeat(101), 2, "in line 4", "it is nested too deeply"),
    ] {
        let mut broken: Vec<&str> = text.lines().collect();
        broken.insert(3, insert);
        fs::write(&file, broken.join("\n")).unwrap();
        let done = import(TempDir::new().unwrap().path(), &file).await.unwrap();
        assert_eq!((done.results, done.refused.len()), (results, 1), "{:?}", done.refused);
        assert_refused(&done, name, words);
    }
    // Exports can follow each other, and an editor may have changed the ends of lines.
    let frame = zstd::encode_all(text.as_bytes(), 1).unwrap();
    let edited = format!("{}\r\n\n{text}", text.replace('\n', "\r\n"));
    for twice in [frame.repeat(2), edited.into_bytes()] {
        fs::write(&file, twice).unwrap();
        let done = import(TempDir::new().unwrap().path(), &file).await.unwrap();
        assert_eq!((done.results, done.known, done.refused.len()), (4, 4, 0), "{done:?}");
    }
    // The first line may be missing, may promise more than there is, or be that of a later version.
    let (head, rest) = text.split_once('\n').unwrap();
    let many = head.replace("\"results\":4", &format!("\"results\":{}", u64::MAX));
    for (changed, results, missing) in [
        (rest.to_owned(), 4, 0),
        (format!("{head}\n{}\n", rest.lines().next().unwrap()), 1, 3),
        (format!("{many}\n{text}"), 4, u64::MAX - 4),
    ] {
        fs::write(&file, changed).unwrap();
        let done = import(TempDir::new().unwrap().path(), &file).await.unwrap();
        assert_eq!((done.results, done.missing, done.refused.len()), (results, missing, 0));
    }
    let later = "{\"fretwork_export\":3,\"more\":[]}";
    fs::write(&file, format!("{later}\n{rest}")).unwrap();
    let refused = import(TempDir::new().unwrap().path(), &file).await;
    assert!(matches!(refused, Err(Moving::LaterForm { found: 3, .. })), "{refused:?}");
    fs::write(&file, format!("{text}{later}\n{rest}")).unwrap();
    let done = import(TempDir::new().unwrap().path(), &file).await.unwrap();
    assert_refused(&done, "in line 6", "a later version of fretwork wrote it; the rest");
    // A body that is too large is refused; a line that is even longer ends the import.
    for (spaces, refused, name) in [(96_000_001, 1, &*keys[1]), (97_000_000, 1, "in line 3")] {
        let mut lines = Lines::of_text(&file, &sound.text());
        let position = lines.results.iter().position(|(known, _)| known["key"] == keys[1]).unwrap();
        lines.results.swap(1, position);
        let body = format!("{{\"x\":[{}]}}", " ".repeat(spaces));
        lines.replace_body(&keys[1], &body);
        lines.save();
        let to = Server::start().await;
        let done = import(to.place(), &file).await.unwrap();
        assert_eq!(done.refused.len(), refused, "{:?}", done.refused);
        let (words, results) = match name {
            "in line 3" => ("it has more than", 1),
            _ => ("the JSON of the result has more than 96000000 bytes", 3),
        };
        assert_refused(&done, name, words);
        assert_eq!(done.results, results);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_truncated_or_damaged_file_gives_the_results_before_the_damage() {
    let from = Server::start().await;
    computed(&from, &[1.0, 1.2, 1.4, 1.6]).await;
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.ndjson.zst");
    export_all(&from, &file).await;
    let sound = fs::read(&file).unwrap();
    let text = Lines::open(&file).text();
    // Blocks of a frame have at most 128 KiB, so the results must be larger than that.
    assert!(text.len() > 300_000, "{}", text.len());
    let mut flipped = sound.clone();
    *flipped.last_mut().unwrap() ^= 1;
    for (bytes, results) in
        [(&sound[..sound.len() / 2], 1..4), (&sound[..sound.len() - 1], 1..5), (&flipped[..], 1..5)]
    {
        fs::write(&file, bytes).unwrap();
        let to = TempDir::new().unwrap();
        let done = import(to.path(), &file).await.unwrap();
        assert!(results.contains(&done.results), "{done:?}");
        let [(_, why)] = &done.refused[..] else { panic!("{done:?}") };
        assert!(why.ends_with("; the rest of the file is not read"), "{why}");
    }
    for length in [0, 3, 40] {
        fs::write(&file, &sound[..length]).unwrap();
        let refused = import(TempDir::new().unwrap().path(), &file).await;
        assert!(
            matches!(refused, Err(Moving::NoExport(_) | Moving::Damaged { .. })),
            "{refused:?}"
        );
    }
}

/// The converter of the Python package, and `python3`, which has no packages.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_export_of_version_0_4_becomes_lines() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (file, there) = (path("results.db"), TempDir::new().unwrap());
    let data = there.path().to_str().unwrap().to_owned();
    let old = zstd::decode_all(&include_bytes!("../data/export-0.4.0.db.zst")[..]).unwrap();
    fs::write(&file, old).unwrap();
    fails(&run(&["import", &file, "--data-dir", &data], ""), "-m fretwork_client.old_export FILE");
    let converter = "clients/python/src/fretwork_client/old_export.py";
    let lines = Command::new("python3").args([converter, &file]).output().unwrap();
    assert!(lines.status.success(), "{lines:?}");
    let lines = String::from_utf8(lines.stdout).unwrap();
    let words = ["import", "-", "--data-dir", &data];
    let output = run(&words, &lines);
    let said = String::from_utf8(output.stdout.clone()).unwrap();
    assert!(
        said.starts_with("standard input: 3 results (")
            && said.ends_with("notes: 1 imported, 0 kept\n"),
        "{output:?}"
    );
    let (settings, options) = (Settings::default(), Options::default());
    let server = Server::opening(there, Arc::new(Task::start), None, &settings, &options).await;
    for line in lines.lines().skip(1) {
        let (known, body) = line.split_once(", \"result\": ").unwrap();
        let known: Value = serde_json::from_str(&format!("{known}}}")).unwrap();
        let at = format!("/v1/results/{}", known["key"].as_str().unwrap());
        assert_eq!(server.get(&at).await.text(), body.strip_suffix('}').unwrap());
        let told = server.get(&format!("{at}/provenance")).await.json();
        assert_eq!(told["imported"]["from"], "standard input");
        assert_eq!(told["program"]["host"], known["program"]["host"]);
        assert_eq!(told["note"]["text"], known["note"]["text"]);
    }
    for (other, words) in [("Cargo.toml", "is no database"), ("nothing.db", "there is no file")] {
        let output = Command::new("python3").args([converter, other]).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && said.contains(words), "{said}");
    }
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
    let file = dir.path().join("results.ndjson.zst");
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
    let output = run(&["export", &path("one.zst"), "--key", &key, "--data-dir", data], "");
    assert!(output.status.success() && said(&output).contains(": 1 result ("), "{output:?}");
    let output = run(
        &["export", &path("none.zst"), "shape=cone", "friction=0.6..0.8", "--data-dir", data],
        "",
    );
    assert!(output.status.success() && said(&output).contains(": 0 results"), "{output:?}");
    fails(&run(&["export", &path("one.zst"), "--data-dir", data], ""), "exists already");
    let zeros = "0".repeat(64);
    fails(
        &run(&["export", &path("x.zst"), "--key", &zeros, "--data-dir", data], ""),
        "there is no result with the key",
    );
    for command in ["export", "backup"] {
        let output = run(&[command, &path("made/x"), "--data-dir", &path("nowhere")], "");
        fails(&output, "nowhere contains no database");
        assert!(!dir.path().join("made").exists(), "{command}");
    }
    let refused = run(&["export", &path("x.zst"), "shape=cube", "--data-dir", data], "");
    assert!(
        String::from_utf8_lossy(&refused.stderr).contains("must be one of paraboloid"),
        "{refused:?}"
    );
    // An import creates a database if there is none.
    let new = path("new");
    let output = run(&["import", &path("one.zst"), "--data-dir", &new], "");
    assert!(output.status.success() && said(&output).contains("1 result ("), "{output:?}");
    let output = run(&["check", "--data-dir", &new], "");
    assert!(said(&output).ends_with(": 1 result, 0 jobs; no damage\n"), "{output:?}");
    let output = run(&["import", &path("one.zst"), "--data-dir", &new], "");
    assert!(
        said(&output).contains("0 results (0 B) imported, 1 known already, 0 refused"),
        "{output:?}"
    );
    let mut lines = Lines::open(Path::new(&path("one.zst")));
    lines.results[0].0["sha256"] = json!("x");
    lines.save();
    assert_eq!(
        run(&["import", &path("one.zst"), "--data-dir", &path("third")], "").status.code(),
        Some(2)
    );
    let mut administration = Administration::open(server.place()).await.unwrap();
    for name in ["anna", "ben"] {
        let name = name.to_owned();
        let new =
            NewKey { name, role: Role::Read, per_minute: None, expires: None, private: false };
        administration.add_key(&new).await.unwrap();
    }
    administration.revoke_keys("ben").await.unwrap();
    administration.close().await.unwrap();
    let output = run(&["backup", &path("backup.db"), "--data-dir", data], "");
    assert!(output.status.success() && said(&output).contains(": 2 results ("), "{output:?}");
    fails(&run(&["backup", &path("backup.db"), "--data-dir", data], ""), "exists already");
    fails(&run(&["import", &path("backup.db"), "--data-dir", &new], ""), "restore");
    fails(
        &run(&["restore", &path("none.zst"), "--data-dir", &path("fourth")], ""),
        "not a database",
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

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_export_goes_through_a_pipe() {
    let server = Server::start().await;
    computed(&server, &[1.0, 1.2]).await;
    let dir = TempDir::new().unwrap();
    let [from, to] = [server.dir.path(), dir.path()].map(|dir| dir.to_str().unwrap().to_owned());
    let exported = run(&["export", "-", "--data-dir", &from], "");
    let said = String::from_utf8(exported.stderr).unwrap();
    assert!(exported.status.success() && said.contains(": 2 results ("), "{said}");
    let output = run(&["import", "-", "--data-dir", &to], exported.stdout);
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && said.contains(": 2 results ("), "{said}");
    let refused = run(&["import", "-", "--data-dir", &to], "some text");
    fails(&refused, "standard input is not an export");
    // A backup is the bytes of a database.
    let saved = run(&["backup", "-", "--data-dir", &from], "");
    let said = String::from_utf8(saved.stderr).unwrap();
    assert!(saved.status.success() && said.starts_with("standard output: 2 results ("), "{said}");
    let file = dir.path().join("saved.db");
    fs::write(&file, saved.stdout).unwrap();
    let restored = restore(&dir.path().join("restored"), &file, false).await.unwrap().0;
    assert_eq!((restored.results, restored.damaged.len()), (2, 0));
    fails(&run(&["backup", "-", "--keep", "3", "--data-dir", &from], ""), "name a file or a dir");
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
    // A database of a later version is neither backed up nor restored.
    let refused = backup(dir.path(), &file).await;
    assert!(matches!(refused, Err(Moving::Store(Error::Newer { .. }))), "{refused:?}");
    db.execute(AssertSqlSafe(format!("VACUUM INTO '{}'", file.display()))).await.unwrap();
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
    for round in 0..2 {
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
