//! Verified imports: which results are computed again, which are refused, and what the provenance says about it.

use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use fretwork_job::{Canonical, TaskKind};
use fretwork_random::Stream;
use fretwork_store::{Imported, Search, export};
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::time::sleep;

use crate::moving::{Lines, assert_refused, import, import_within, quiet};
use crate::program::{fretwork, run};
use crate::server::{Server, steel_ball};
use crate::store::raw;
use crate::studies::{example, sweep};
use crate::trust::{exported, small};

/// A short result of each kind.
fn each_kind() -> [Value; 6] {
    let mut sensitivity = example("sensitivity");
    sensitivity["sensitivity"]["samples"] = json!(8);
    let mut map = example("map");
    for axis in ["normal_force", "amplitude"] {
        map["map"][axis]["count"] = json!(4);
    }
    let mut fit = example("fit");
    fit["fit"]["starts"] = json!(1);
    [small(2.0, "exact"), small(2.0, "simplified"), sweep(), sensitivity, map, fit]
}

/// Changes one digit of a text. `place` is its number; after the last digit, counting continues with the first.
fn altered(body: &str, place: u64, other: u64) -> String {
    let digits = body.bytes().enumerate().filter(|(_, byte)| byte.is_ascii_digit());
    let digits: Vec<usize> = digits.map(|(at, _)| at).collect();
    let at = digits[place as usize % digits.len()];
    let mut bytes = body.as_bytes().to_vec();
    bytes[at] = b'0' + (bytes[at] - b'0' + 1 + (other % 9) as u8) % 10;
    String::from_utf8(bytes).unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_result_of_any_kind_with_one_altered_digit_is_refused() {
    let (_dir, file, results) = exported(&each_kind()).await;
    let to = Server::start().await;
    let random = Stream::new(1);
    for round in 0..20 {
        let mut lines = Lines::open(&file);
        for (kind, (key, body)) in results.iter().enumerate() {
            let random = random.child(round).child(kind as u64);
            let body = altered(std::str::from_utf8(body).unwrap(), random.at(0), random.at(1));
            lines.replace_body(key, &body);
        }
        lines.save();
        let done = import(to.place(), &file).await.unwrap();
        assert_eq!((done.results, done.refused.len()), (0, results.len()), "{done:?}");
    }
    let mut lines = Lines::open(&file);
    for (key, body) in &results {
        lines.replace_body(key, std::str::from_utf8(body).unwrap());
    }
    lines.save();
    let done = import(to.place(), &file).await.unwrap();
    assert_eq!((done.results, done.sampled, done.unverified), (6, 0, 0), "{done:?}");
    for (key, body) in &results {
        assert!(to.get(&format!("/v1/results/{key}")).await.body == *body);
        assert_eq!(doubt(&to, key).await, None);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_refusal_names_the_place_and_both_values() {
    let (_dir, file, results) = exported(&each_kind()).await;
    let names = [
        (
            "history",
            "wear_volume",
            "history.wear_volume[1]: the file has 1.5, this server computes ",
        ),
        ("profiles", "radius", "profiles.radius[1]: the file has 1.5, this server computes "),
        ("table", "wear_volume", "wear_volume[1]: the file has 1.5, this server computes "),
        ("samples", "wear_volume", "wear_volume[1]: the file has 1.5, this server computes "),
        ("table", "wear_volume", "wear_volume[1]: the file has 1.5, this server computes "),
    ];
    let mut lines = Lines::open(&file);
    for ((key, body), (table, column, _)) in results.iter().zip(&names) {
        let mut document: Value = serde_json::from_slice(body).unwrap();
        document[table][column][1] = json!(1.5);
        lines.replace_body(key, &document.to_string());
    }
    lines.save();
    let done = import(TempDir::new().unwrap().path(), &file).await.unwrap();
    // In the sensitivity study, the first difference is in the table that follows from the changed row.
    for ((key, _), (table, _, words)) in results.iter().zip(&names) {
        assert_refused(&done, key, if *table == "samples" { "the file has" } else { words });
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_file_with_other_white_space_is_refused_with_advice() {
    let (_dir, file, results) = exported(&[small(2.0, "exact"), sweep()]).await;
    let mut lines = Lines::open(&file);
    for (key, body) in &results {
        let document: Value = serde_json::from_slice(body).unwrap();
        lines.replace_body(key, &format!("{document:#}").replace('\n', ""));
    }
    lines.save();
    let done = import(TempDir::new().unwrap().path(), &file).await.unwrap();
    let words = "computes: the values are the same, but the file writes them in another way, for example with other white \
                 space. Import the file that `fretwork export` wrote";
    for (key, _) in &results {
        assert_refused(&done, key, words);
    }
}

/// The members `verified` and `verified_rows` in the provenance of an import.
async fn verified(server: &Server, key: &str) -> (Value, Value) {
    let told = server.get(&format!("/v1/results/{key}/provenance")).await.json();
    (told["imported"]["verified"].clone(), told["imported"]["verified_rows"].clone())
}

/// The warning that a result is not verified.
async fn doubt(server: &Server, key: &str) -> Option<String> {
    let told = server.get(&format!("/v1/results/{key}/warnings")).await.json();
    let told = told["warnings"].as_array()?.last()?.clone();
    (told["kind"] == "unverified").then(|| told["detail"].as_str().unwrap().to_owned())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_import_without_time_to_verify_stores_results_whose_tables_are_whole() {
    let (_dir, file, results) = exported(&each_kind()).await;
    let mut lines = Lines::open(&file);
    // A wrong number, a short row, a number that is not finite, and a study whose rows contradict its findings.
    for (place, old, new) in [
        (0, "\"slip\":[[0.0,", "\"slip\":[[1.0,"),
        (1, "\"slip\":[[0.0,", "\"slip\":[["),
        (2, "\"wear_volume\":[", "\"wear_volume\":[1e999,"),
        (3, "\"wear_volume\":[", "\"wear_volume\":[1"),
    ] {
        let (key, body) = &results[place];
        let body = std::str::from_utf8(body).unwrap();
        assert!(body.contains(old), "{old}");
        lines.replace_body(key, &body.replacen(old, new, 1));
    }
    lines.save();
    let to = Server::start().await;
    let done = import_within(to.place(), &file, Duration::ZERO).await.unwrap();
    assert_eq!((done.results, done.unverified), (3, 3), "{done:?}");
    assert_refused(&done, &results[1].0, "the tables of the result are not complete");
    assert_refused(&done, &results[2].0, "column `wear_volume` does not have 6 valid cells");
    assert_refused(&done, &results[3].0, "the file has");
    for place in [0, 4, 5] {
        let key = &results[place].0;
        assert_eq!(verified(&to, key).await, (json!("none"), Value::Null));
        let doubt = doubt(&to, key).await.unwrap();
        assert!(doubt.contains("has not computed it again"), "{doubt}");
        let report = to.get(&format!("/v1/results/{key}/report")).await.body;
        assert!(String::from_utf8(report).unwrap().contains("has not computed it again"));
        // A new job of the result and the same job when it is read again.
        let job = to.compute(&each_kind()[place]).await.json();
        assert_eq!(job["warnings"].as_array().unwrap().last().unwrap()["detail"], doubt);
        let again = to.get(job["links"]["self"].as_str().unwrap()).await.json();
        assert_eq!((&job["origin"], &again["warnings"]), (&json!("cached"), &job["warnings"]));
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn random_rows_are_verified_of_a_study_that_takes_too_long() {
    // Each row takes about 20 µs.
    let study = json!({"sweep": {
        "scenario": steel_ball()["scenario"],
        "vary": [{"pointer": "/friction", "from": 0.5, "to": 0.9, "count": 20_000}],
        "outputs": ["unworn.energy_ratio"],
    }});
    let (_dir, file, results) = exported(&[study]).await;
    let to = Server::start().await;
    let done = import_within(to.place(), &file, Duration::from_millis(20)).await.unwrap();
    assert_eq!((done.results, done.sampled), (1, 1), "{done:?}");
    let (word, rows) = verified(&to, &results[0].0).await;
    assert_eq!(word, "rows");
    assert!((1..20_000).contains(&rows.as_u64().unwrap()), "{rows}");
    let doubt = doubt(&to, &results[0].0).await.unwrap();
    assert!(doubt.contains(&format!("has computed only {rows} of its rows again")), "{doubt}");
}

/// Writes a result as another version of the engine would have written it. Returns its key.
fn in_numerics(file: &Path, numerics: u32, key: &str, body: &str) -> String {
    let mut document: Value = serde_json::from_str(body).unwrap();
    let kind = TaskKind::all().find(|kind| document[kind.member()].is_object()).unwrap();
    let value = document[kind.member()].clone();
    let new = Canonical { kind, value }.key(numerics).to_string();
    document["engine"]["numerics"] = json!(numerics);
    document["key"] = json!(new);
    let mut lines = Lines::open(file);
    lines.of(key).0["key"] = json!(new);
    lines.replace_body(&new, &document.to_string());
    lines.save();
    new
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn runs_of_an_earlier_engine_are_unverified_and_its_studies_are_refused() {
    let jobs = [
        small(2.0, "simplified"),
        small(1.5, "simplified"),
        small(1.6, "exact"),
        sweep(),
        small(1.7, "simplified"),
        small(1.8, "simplified"),
    ];
    let (_dir, file, results) = exported(&jobs).await;
    let changes = [
        ("", ""),
        ("\"slip\":[[0.0,", "\"slip\":[["),
        ("\"wear_depth\":[0.0,", "\"wear_depth\":["),
        ("", ""),
        ("\"friction\":0.7", "\"friction\":0.7000000000001"),
        ("", ""),
    ];
    let mut keys = Vec::new();
    for ((key, body), (old, new)) in results.iter().zip(changes) {
        let body = std::str::from_utf8(body).unwrap();
        assert!(body.contains(old), "{old}");
        let numerics = if keys.len() == 5 { 0 } else { 2 };
        keys.push(in_numerics(&file, numerics, key, &body.replacen(old, new, 1)));
    }
    let to = Server::start().await;
    let done = import(to.place(), &file).await.unwrap();
    assert_eq!((done.results, done.unverified), (1, 1), "{done:?}");
    assert_refused(&done, &keys[1], "the tables of the result are not complete");
    assert_refused(&done, &keys[2], "lists of numbers of equal length");
    assert_refused(&done, &keys[3], "an earlier version of the engine computed this study");
    // The stored form has 12 digits, so it would not give the key. There were no `numerics` before 1.
    for key in &keys[4..] {
        assert_refused(&done, key, "the key of the result does not belong to the scenario");
    }
    assert_eq!(verified(&to, &keys[0]).await, (json!("none"), Value::Null));
}

/// The number of results in a database; 0 until it has tables.
async fn stored(data: &Path) -> i64 {
    if !data.join("fretwork.db").exists() {
        return 0;
    }
    let count = sqlx::query_scalar("SELECT count(*) FROM result");
    count.fetch_one(&mut raw(data).await).await.unwrap_or(0)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_import_that_was_killed_continues_when_it_is_repeated() {
    let from = Server::start().await;
    for number in 0..40 {
        from.compute(&small(1.5 + 0.01 * f64::from(number), "exact")).await;
    }
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("results.ndjson.zst");
    export(from.place(), &file, &Search::default(), &[], &mut quiet).await.unwrap();
    let data = dir.path().join("data");
    let words = ["import", file.to_str().unwrap(), "--data-dir", data.to_str().unwrap()];
    let mut child = fretwork(&words).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    while child.try_wait().unwrap().is_none() && stored(&data).await == 0 {
        sleep(Duration::from_millis(1)).await;
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let done = import(&*data, &file).await.unwrap();
    assert!(done.known > 0, "{done:?}");
    let rest = Imported {
        known: 40 - done.results,
        results: done.results,
        bytes: done.bytes,
        ..Imported::default()
    };
    assert_eq!(done, rest);
    let said = String::from_utf8(run(&words, "").stdout).unwrap();
    assert!(said.contains("40 known already, 0 refused; 0 computed again"), "{said}");
}
