//! The library of results: search, provenance, notes, deletion and comparison.

use std::collections::HashSet;
use std::time::Duration;

use fretwork::http::Origins;
use fretwork_job::{SCALARS, WORDS};
use fretwork_store::{Cursor, Search};
use proptest::prelude::*;
use serde_json::{Value, json};
use sqlx::{Connection as _, Executor as _, Row as _};
use tokio::io::AsyncWriteExt as _;
use tokio::net::TcpStream;
use tokio::runtime::Builder;

use crate::keeping::eventually;
use crate::moving::sha256;
use crate::server::{Gate, JSON, Server, assert_yields, ball, steel_ball, yielding_ball};
use crate::store::raw;

/// Computes results that differ in shape, method and numbers; returns their keys.
async fn collection(server: &Server) -> Vec<String> {
    let mut bodies = vec![ball(1.0), ball(2.0), ball(2.5), ball(10.0)];
    for (friction, shape) in [(0.3, "sphere"), (0.5, "paraboloid"), (0.9, "paraboloid")] {
        let mut body = ball(1.5);
        body["scenario"]["friction"] = json!(friction);
        body["scenario"]["profile"]["shape"] = json!(shape);
        body["tags"] = json!(["series"]);
        bodies.push(body);
    }
    let mut cone = ball(0.5);
    cone["scenario"]["profile"] = json!({"shape": "cone", "slope_angle": "1 deg"});
    cone["scenario"]["load"] = json!({"normal_force": "20 N"});
    cone["label"] = json!("the cone");
    bodies.push(cone);
    let mut exact = ball(2.0);
    exact["scenario"]["model"] = json!({"method": "exact", "tolerance": 0.01, "points": 64});
    exact["scenario"]["cycles"] = json!([500]);
    bodies.push(exact);
    let mut keys = Vec::new();
    for body in &bodies {
        let job = server.compute(body).await.json();
        assert_eq!(job["state"], "succeeded", "{job}");
        keys.push(job["key"].as_str().unwrap().to_owned());
    }
    keys
}

async fn list(server: &Server, query: &str) -> Vec<Value> {
    let reply = server.get(&format!("/v1/results?{query}")).await;
    assert_eq!(reply.status, 200, "{query}: {}", reply.text());
    reply.json()["results"].as_array().unwrap().clone()
}

fn keys(list: &[Value]) -> Vec<&str> {
    list.iter().map(|entry| entry["key"].as_str().unwrap()).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn results_are_found_by_inputs_and_outputs() {
    let server = Server::start().await;
    let all = collection(&server).await;
    let newest: Vec<&str> = all.iter().rev().map(String::as_str).collect();
    assert_eq!(keys(&list(&server, "").await), newest, "all results, the newest first");
    for (query, places) in [
        ("shape=cone", &[7][..]),
        ("method=exact", &[8]),
        ("regime=gross_slip", &[4, 3]),
        ("friction=0.3", &[4]),
        ("friction=..0.5", &[5, 4]),
        ("friction=0.6..0.8&shape=paraboloid&method=simplified", &[3, 2, 1, 0]),
        ("amplitude=2%20um", &[8, 1]),
        ("amplitude=1500%20nm..2.1%20um&friction=0.7", &[8, 1]),
        ("normal_force=..0.05%20kN", &[7]),
        ("normal_force=100&shape=sphere", &[4]),
        ("held=force", &[7]),
        ("slope_angle=0.5%20deg..2%20deg", &[7]),
        ("tag=series", &[6, 5, 4]),
        ("label=the%20cone", &[7]),
        ("tag=none", &[]),
        ("friction=2..", &[]),
        ("created=2020-01-01..&shape=sphere", &[4]),
        ("created=..2020-01-01", &[]),
        ("dissipated_energy=0%20mJ..1%20kJ&shape=sphere", &[4]),
        ("dissipated_energy=..1e-9%20N%20m&shape=sphere", &[]),
        ("owner=127.0.0.1&shape=cone", &[7]),
        ("owner=nobody", &[]),
        ("friction=..0.5&sort=friction", &[4, 5]),
        ("friction=..0.5&sort=-friction", &[5, 4]),
        ("evicted=true", &[]),
    ] {
        let found = list(&server, query).await;
        let expected: Vec<&str> = places.iter().map(|place| all[*place].as_str()).collect();
        assert_eq!(keys(&found), expected, "{query}");
    }
    // Each value in the list equals that of the result.
    for entry in list(&server, "").await {
        let link = entry["link"].as_str().unwrap();
        let body = server.get(link).await;
        let result = body.json();
        assert_eq!(entry["size"], body.body.len());
        assert_eq!(entry["regime"], result["regime"]);
        assert_eq!(entry["shape"], result["scenario"]["profile"]["shape"]);
        let (values, history) = (&entry["values"], &result["history"]);
        for name in ["wear_volume", "wear_depth", "scar_radius", "cycles"] {
            assert_eq!(values[name], *history[name].as_array().unwrap().last().unwrap(), "{name}");
        }
        assert_eq!(values["normal_force"], result["scales"]["normal_force"]);
        assert_eq!(values["friction"], result["scenario"]["friction"]);
    }
    let page = server.get("/v1/results?limit=1").await.json();
    assert_eq!(
        (&page["units"]["wear_depth"], &page["units"]["friction"]),
        (&json!("m"), &json!("1"))
    );
    assert_eq!(page["units"]["dissipated_energy"], "J");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn pages_are_complete_in_every_sort_order_with_nulls_last() {
    let server = Server::start().await;
    let all = collection(&server).await;
    for sort in
        ["created", "-created", "wear_depth", "-wear_volume", "slope_angle", "-slope_angle", "size"]
    {
        let (mut seen, mut values) = (Vec::new(), Vec::new());
        let mut next = Some(format!("/v1/results?sort={sort}&limit=2"));
        while let Some(address) = next {
            let reply = server.get(&address).await;
            let page = reply.json();
            let entries = page["results"].as_array().unwrap();
            seen.extend(keys(entries).into_iter().map(str::to_owned));
            values.extend(
                entries.iter().map(|entry| entry["values"][sort.trim_start_matches('-')].as_f64()),
            );
            next = page["next"].as_str().map(str::to_owned);
            let link = next.as_ref().map(|next| format!("<{next}>; rel=\"next\""));
            assert_eq!(reply.header("link"), link.as_deref());
        }
        let mut sorted = seen.clone();
        sorted.sort();
        sorted.dedup();
        assert_eq!((seen.len(), sorted.len()), (all.len(), all.len()), "{sort}");
        let numbers: Vec<f64> = values.iter().copied().flatten().collect();
        let ordered = |pair: &[f64]| {
            if sort.starts_with('-') { pair[0] >= pair[1] } else { pair[0] <= pair[1] }
        };
        assert!(numbers.windows(2).all(ordered), "{sort}: {values:?}");
        if sort.ends_with("slope_angle") {
            assert_eq!(numbers.len(), 1);
            assert!(values[0].is_some(), "{sort}: results without the value come last");
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn all_faults_of_a_search_are_listed() {
    let server = Server::start().await;
    let query = "shape=cube&friction=2..1&wear_depth=..2%20N&pinned=yes&sort=colour&limit=0&cursor=x\
        &note=%00&created=soon&normal_force=0.1..0.2%20kN&tangential_force=1e308%20kN..&firction=1";
    let problem =
        server.get(&format!("/v1/results?{query}")).await.problem(422, "invalid-parameters");
    let names: Vec<&str> = problem["errors"]
        .as_array()
        .unwrap()
        .iter()
        .map(|error| error["parameter"].as_str().unwrap())
        .collect();
    let mut sorted = names.clone();
    sorted.sort_unstable();
    assert_eq!(
        sorted,
        [
            "created",
            "cursor",
            "firction",
            "friction",
            "limit",
            "normal_force",
            "note",
            "pinned",
            "shape",
            "sort",
            "tangential_force",
            "wear_depth"
        ],
        "{problem}"
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_provenance_names_the_owner_request_and_program_of_a_result() {
    let server = Server::start().await;
    let headers = [JSON, ("Prefer", "wait=60"), ("x-request-id", "the-first")];
    let first = server.send("POST", "/v1/jobs", &headers, steel_ball().to_string()).await.json();
    server.compute(&steel_ball()).await;
    // A queued run and a short run that skips the queue have the same kind of provenance.
    let headers = [JSON, ("x-request-id", "the-second")];
    let queued = server.send("POST", "/v1/jobs", &headers, ball(1.25).to_string()).await.json();
    let id = queued["id"].as_str().unwrap();
    assert_eq!(server.get(&format!("/v1/jobs/{id}?wait=60")).await.json()["state"], "succeeded");
    for (job, request, jobs) in [(&first, "the-first", 2), (&queued, "the-second", 1)] {
        let key = job["key"].as_str().unwrap();
        let body = server.get(&format!("/v1/results/{key}")).await.body;
        let told = server.get(&format!("/v1/results/{key}/provenance")).await.json();
        let sum = sha256(&body);
        assert_eq!(told["body"], json!({"bytes": body.len(), "sha256": sum}));
        let computed = &told["computed"];
        assert_eq!(
            (&computed["owner"], &computed["request"]),
            (&json!("127.0.0.1"), &json!(request))
        );
        assert_eq!(computed["job"], job["id"]);
        let seconds = |name: &str| computed[name].as_f64().unwrap();
        assert!(seconds("wall_seconds") > 0.0 && seconds("cpu_seconds") > 0.0, "{told}");
        assert_eq!(told["program"]["version"], env!("CARGO_PKG_VERSION"));
        assert_eq!(told["program"]["numerics"], 5);
        assert_eq!(told["program"]["architecture"], std::env::consts::ARCH);
        assert!(told["program"]["host"].as_str().is_some_and(|host| !host.is_empty()));
        assert_eq!(told["jobs"], jobs);
        let nothing = ["note", "evicted", "deleted_by", "imported"];
        assert!(nothing.iter().all(|name| told[name].is_null()), "{told}");
        assert_eq!(told["pinned"], false);
    }
    let unknown = format!("/v1/results/{}/provenance", "0".repeat(64));
    server.get(&unknown).await.problem(404, "unknown-result");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_contact_with_and_without_yield_strength_has_one_key_and_one_result() {
    let (weak, strong) = (Server::start().await, Server::start().await);
    let told = weak.compute(&yielding_ball()).await.json();
    let plain = strong.compute(&steel_ball()).await.json();
    assert_eq!((&told["origin"], &plain["origin"]), (&json!("computed"), &json!("computed")));
    assert_eq!(told["key"], plain["key"]);
    assert_yields(&told["warnings"]);
    assert_eq!(plain["warnings"], json!([]));
    let at = told["links"]["result"].as_str().unwrap().to_owned();
    assert_eq!(weak.get(&at).await.body, strong.get(&at).await.body);
    // Each job has its own warnings, and the result has those of the job that computed it.
    for (server, computed, other) in
        [(&weak, told, steel_ball()), (&strong, plain, yielding_ball())]
    {
        let cached = server.compute(&other).await.json();
        assert_eq!((&cached["origin"], &cached["key"]), (&json!("cached"), &computed["key"]));
        assert_ne!(cached["warnings"], computed["warnings"]);
        let own = json!({"warnings": computed["warnings"]});
        assert_eq!(server.get(&format!("{at}/warnings")).await.json(), own);
        let provenance = server.get(&format!("{at}/provenance")).await.json();
        assert_eq!(provenance["warnings"], own["warnings"]);
    }
    let unknown = format!("/v1/results/{}/warnings", "0".repeat(64));
    weak.get(&unknown).await.problem(404, "unknown-result");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_result_keeps_the_warnings_of_a_queued_job_and_of_a_new_computation() {
    let server = Server::start().await;
    let queued = server.post("/v1/jobs", &yielding_ball()).await.json();
    let id = queued["id"].as_str().unwrap();
    let job = server.get(&format!("/v1/jobs/{id}?wait=60")).await.json();
    assert_eq!(job["state"], "succeeded");
    assert_yields(&job["warnings"]);
    let at = job["links"]["result"].as_str().unwrap();
    let warnings = format!("{at}/warnings");
    assert_yields(&server.get(&warnings).await.json()["warnings"]);
    // The warnings are kept after the result is deleted, until another job computes it again.
    assert_eq!(server.send("DELETE", at, &[], "").await.status, 204);
    assert_yields(&server.get(&warnings).await.json()["warnings"]);
    assert_eq!(server.compute(&steel_ball()).await.json()["origin"], "computed");
    assert_eq!(server.get(&warnings).await.json(), json!({"warnings": []}));
}

/// Version 4 of the numerics computed thin rings of slip with depths that are too small.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_result_of_an_earlier_version_says_what_was_wrong_with_it() {
    let server = Server::start().await;
    let mut ring = steel_ball();
    ring["scenario"]["motion"] = json!({"stick_ratio": 0.98});
    for (job, is_wrong) in [(ring, true), (steel_ball(), false)] {
        let at = server.compute(&job).await.json()["links"]["result"].as_str().unwrap().to_owned();
        let warnings = format!("{at}/warnings");
        assert_eq!(server.get(&warnings).await.json(), json!({"warnings": []}));
        let mut db = raw(server.dir.path()).await;
        db.execute("UPDATE program SET numerics = 4").await.unwrap();
        let told = server.get(&warnings).await.json()["warnings"].take();
        db.execute("UPDATE program SET numerics = 5").await.unwrap();
        let kinds: Vec<_> = told.as_array().unwrap().iter().map(|it| &it["kind"]).collect();
        assert_eq!(kinds.contains(&&json!("earlier_version")), is_wrong, "{told}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_note_is_stored_shown_found_and_deleted() {
    let server = Server::start().await;
    let key = server.compute(&steel_ball()).await.json()["key"].as_str().unwrap().to_owned();
    let at = format!("/v1/results/{key}/note");
    let put = |text: Value| server.send("PUT", &at, &[JSON], json!({"text": text}).to_string());
    assert_eq!(put(json!("Agrees with RIG 7.")).await.status, 204);
    assert_eq!(put(json!("Agrees with RIG 8.\nTwice.")).await.status, 204);
    let told = server.get(&format!("/v1/results/{key}/provenance")).await.json();
    assert_eq!(told["note"]["text"], "Agrees with RIG 8.\nTwice.");
    assert_eq!(told["note"]["owner"], "127.0.0.1");
    assert_eq!(list(&server, "note=rig%208").await[0]["note"], told["note"]);
    assert_eq!(server.get(&at).await.json(), told["note"]);
    let about = server.get(&format!("/v1/results/{key}/about")).await.json();
    assert_eq!(about, list(&server, "note=rig%208").await[0]);
    assert!(list(&server, "note=rig%207").await.is_empty());
    for bad in [json!(""), json!("x".repeat(4001)), json!("\u{7}"), json!(7)] {
        let problem = put(bad).await.problem(422, "invalid-request");
        assert_eq!(problem["errors"][0]["pointer"], "/text");
    }
    let more = json!({"text": "a", "colour": "red"}).to_string();
    server.send("PUT", &at, &[JSON], more).await.problem(422, "invalid-request");
    assert_eq!(server.send("DELETE", &at, &[], "").await.status, 204);
    assert!(server.get(&format!("/v1/results/{key}/provenance")).await.json()["note"].is_null());
    let unknown = format!("/v1/results/{}/note", "0".repeat(64));
    let text = json!({"text": "a"}).to_string();
    server.send("PUT", &unknown, &[JSON], text).await.problem(404, "unknown-result");
    server.get(&unknown).await.problem(404, "unknown-result");
    server.get(&unknown.replace("note", "about")).await.problem(404, "unknown-result");
    server.get(&at).await.problem(404, "not-found");
    server.send("DELETE", &unknown, &[], "").await.problem(404, "unknown-result");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_deleted_result_is_unavailable_until_it_is_computed_again() {
    let server = Server::start().await;
    let job = server.compute(&steel_ball()).await.json();
    let key = job["key"].as_str().unwrap();
    let at = format!("/v1/results/{key}");
    let parts = ["", "/history", "/history?format=csv", "/profiles?points=20", "/loops"];
    for part in parts {
        // The first answer comes from the database, the second from memory.
        assert_eq!(server.get(&format!("{at}{part}")).await.status, 200);
        assert_eq!(server.get(&format!("{at}{part}")).await.status, 200);
    }
    let before = server.get(&at).await.body;
    assert_eq!(server.send("PUT", &format!("{at}/pin"), &[], "").await.status, 204);
    assert_eq!(keys(&list(&server, "pinned=true").await), [key]);
    assert!(list(&server, "pinned=false").await.is_empty());
    server.send("DELETE", &at, &[], "").await.problem(409, "pinned");
    assert_eq!(server.send("DELETE", &format!("{at}/pin"), &[], "").await.status, 204);
    assert_eq!(server.send("DELETE", &at, &[], "").await.status, 204);
    for part in parts {
        let problem = server.get(&format!("{at}{part}")).await.problem(410, "evicted");
        assert_eq!(problem["scenario"]["friction"], 0.7);
        assert!(problem["detail"].as_str().unwrap().contains("deleted by 127.0.0.1"), "{problem}");
    }
    server.send("DELETE", &at, &[], "").await.problem(410, "evicted");
    let unknown = format!("/v1/results/{}", "0".repeat(64));
    server.send("DELETE", &unknown, &[], "").await.problem(404, "unknown-result");
    assert!(list(&server, "").await.is_empty());
    let gone = list(&server, "evicted=true").await;
    assert_eq!(keys(&gone), [key]);
    assert!(gone[0]["evicted"].is_string());
    let told = server.get(&format!("{at}/provenance")).await.json();
    assert_eq!(told["deleted_by"], "127.0.0.1");
    let id = job["id"].as_str().unwrap();
    let still = server.get(&format!("/v1/jobs/{id}")).await.json();
    assert_eq!(still["summary"], job["summary"], "jobs keep their summary");
    let again = server.compute(&steel_ball()).await;
    assert_eq!(again.header("cache-status"), Some("fretwork; fwd=miss; stored"));
    assert_eq!(server.get(&at).await.body, before);
    let told = server.get(&format!("{at}/provenance")).await.json();
    assert!(told["deleted_by"].is_null() && told["evicted"].is_null());
    assert_eq!(keys(&list(&server, "").await), [key]);
}

/// The server may answer from memory after an eviction, but not after a deletion.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn deleting_an_evicted_result_removes_it_from_the_cache() {
    let server = Server::computing(Gate::opened(), &Origins::Own).await;
    let key = server.compute(&ball(1.0)).await.json()["key"].as_str().unwrap().to_owned();
    let at = format!("/v1/results/{key}");
    let forms = [at.clone(), format!("{at}/history?format=csv")];
    for form in &forms {
        assert_eq!(server.get(form).await.status, 200);
    }
    let mut db = raw(server.dir.path()).await;
    db.execute("UPDATE result SET evicted = 1; DELETE FROM result_blob").await.unwrap();
    for form in &forms {
        let found = server.get(form).await;
        assert_eq!(found.status, 200, "{form} is in memory");
        let held = [("If-None-Match", found.header("etag").unwrap())];
        assert_eq!(server.send("GET", form, &held, "").await.status, 304, "{form} is in memory");
    }
    server.send("PUT", &format!("{at}/pin"), &[], "").await.problem(410, "evicted");
    server.send("DELETE", &at, &[], "").await.problem(410, "evicted");
    for form in &forms {
        server.get(form).await.problem(410, "evicted");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_deletion_clears_the_cache_even_if_the_client_disconnects() {
    let server = Server::start().await;
    let mut deleted = 0;
    for attempt in 0..1000_u32 {
        // A busy machine needs more attempts until the server reads a request in time.
        if attempt >= 100 && deleted > 0 {
            break;
        }
        let mut body = steel_ball();
        body["scenario"]["friction"] = json!(0.5 + f64::from(attempt) * 1e-4);
        let job = server.compute(&body).await.json();
        let at = job["links"]["result"].as_str().unwrap().to_owned();
        let form = format!("{at}/history?format=csv");
        assert_eq!(server.get(&form).await.status, 200);
        let mut connection = TcpStream::connect(server.address).await.unwrap();
        let request = format!("DELETE {at} HTTP/1.1\r\nHost: localhost\r\n\r\n");
        connection.write_all(request.as_bytes()).await.unwrap();
        tokio::time::sleep(Duration::from_micros(20 * u64::from(attempt))).await;
        drop(connection);
        // The client may disconnect before the server reads the request. Then nothing is deleted.
        let is_deleted = async || {
            let told = server.get(&format!("{at}/provenance")).await.json();
            !told["evicted"].is_null()
        };
        for _ in 0..10 {
            if is_deleted().await {
                eventually(async || server.get(&form).await.status == 410).await;
                deleted += 1;
                break;
            }
        }
    }
    assert!(deleted > 0);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn a_result_deleted_during_a_read_does_not_stay_in_the_cache() {
    let server = Server::computing(Gate::opened(), &fretwork::http::Origins::Own).await;
    for round in 0..40 {
        let body = ball(1.0 + 0.01 * f64::from(round));
        let key = server.compute(&body).await.json()["key"].as_str().unwrap().to_owned();
        let at = format!("/v1/results/{key}");
        let form = format!("{at}/profiles?format=csv");
        let reads = async {
            tokio::join!(server.get(&at), server.get(&form), server.get(&at), server.get(&form))
        };
        let (deleted, _) = tokio::join!(server.send("DELETE", &at, &[], ""), reads);
        assert_eq!(deleted.status, 204);
        server.get(&at).await.problem(410, "evicted");
        server.get(&form).await.problem(410, "evicted");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_diff_lists_the_parameters_and_outputs_that_differ() {
    let server = Server::start().await;
    let mut other = steel_ball();
    other["scenario"]["friction"] = json!(0.75);
    other["scenario"]["model"]["xi"] = json!(0.9);
    let a = server.compute(&steel_ball()).await.json();
    let b = server.compute(&other).await.json();
    let diff = server.post("/v1/results/diff", &json!({"keys": [a["key"], b["key"]]})).await;
    assert_eq!(diff.status, 200, "{}", diff.text());
    let diff = diff.json();
    let parameters = diff["parameters"].as_array().unwrap();
    let pointers: Vec<&str> =
        parameters.iter().map(|one| one["pointer"].as_str().unwrap()).collect();
    assert_eq!(pointers, ["/friction", "/model/xi"]);
    assert_eq!((&parameters[0]["a"], &parameters[0]["b"]), (&json!(0.7), &json!(0.75)));
    assert!((parameters[0]["relative"].as_f64().unwrap() - 0.05 / 0.7).abs() < 1e-12);
    assert_eq!((&diff["same_scenario"], &diff["a"]["result"]), (&json!(false), &json!("held")));
    for output in diff["outputs"].as_array().unwrap() {
        let name = output["name"].as_str().unwrap();
        assert_eq!((&output["a"], &output["b"]), (&a["summary"][name], &b["summary"][name]));
    }
    assert_eq!(diff["units"]["wear_volume"], "m^3");
    // A deleted result still has its scenario and summary.
    let at = format!("/v1/results/{}", b["key"].as_str().unwrap());
    assert_eq!(server.send("DELETE", &at, &[], "").await.status, 204);
    let sides = json!({"a": {"key": a["key"]}, "b": {"key": b["key"]}});
    let again = server.post("/v1/results/diff", &sides).await.json();
    assert_eq!(
        (&again["b"]["result"], &again["parameters"]),
        (&json!("dropped"), &diff["parameters"])
    );
    // Scenarios that differ only in units are the same.
    let sides = json!({"a": {"key": a["key"]}, "b": {"scenario": steel_ball()["scenario"]}});
    let same = server.post("/v1/results/diff", &sides).await.json();
    assert_eq!((&same["same_scenario"], &same["parameters"]), (&json!(true), &json!([])));
    assert_eq!(same["a"]["key"], same["b"]["key"]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_unknown_scenario_is_compared_with_the_nearest_result() {
    let server = Server::start().await;
    let scenario = |body: &Value| json!({"a": {"scenario": body["scenario"]}});
    let none = server.post("/v1/results/diff", &scenario(&steel_ball())).await;
    none.problem(404, "unknown-result");
    let all = collection(&server).await;
    let mut near = ball(2.5);
    near["scenario"]["friction"] = json!(0.71);
    let diff = server.post("/v1/results/diff", &scenario(&near)).await.json();
    assert_eq!(diff["b"]["key"], all[2].as_str(), "{diff}");
    assert_eq!(diff["a"]["result"], "unknown");
    assert_eq!(diff["parameters"].as_array().unwrap().len(), 1);
    assert_eq!(diff["parameters"][0]["pointer"], "/friction");
    assert!(diff["outputs"].is_null());
    let known = server.post("/v1/results/diff", &scenario(&ball(2.5))).await.json();
    assert_eq!((&known["b"]["key"], &known["same_scenario"]), (&json!(all[2]), &json!(true)));
    // A stored result is compared with the nearest other result.
    let other = server.post("/v1/results/diff", &json!({"a": {"key": all[1]}})).await.json();
    assert_eq!(other["b"]["key"], all[2].as_str(), "{other}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn all_faults_of_a_diff_request_are_listed() {
    let server = Server::start().await;
    let key = "0".repeat(64);
    for (body, pointers) in [
        (json!({}), &[""][..]),
        (json!({"keys": [key]}), &["/keys"]),
        (json!({"keys": ["x", "y"]}), &["/keys/0", "/keys/1"]),
        (json!({"keys": [key, key], "a": {"key": key}}), &[""]),
        (json!({"a": {"key": key, "scenario": {}}}), &["/a"]),
        (json!({"a": {"key": key}, "c": 1}), &["/c"]),
        (json!({"b": {"key": key}}), &[""]),
    ] {
        let problem = server.post("/v1/results/diff", &body).await.problem(422, "invalid-request");
        let found: Vec<&str> = problem["errors"]
            .as_array()
            .unwrap()
            .iter()
            .map(|error| error["pointer"].as_str().unwrap())
            .collect();
        assert_eq!(found, pointers, "{body}: {problem}");
    }
    let mut bad = steel_ball()["scenario"].clone();
    bad["frction"] = json!(1);
    let problem = server
        .post("/v1/results/diff", &json!({"a": {"scenario": bad}, "b": {"key": "x"}}))
        .await
        .problem(422, "invalid-request");
    let text = problem.to_string();
    assert!(text.contains("/a/scenario/frction") && text.contains("/b/key"), "{text}");
    server
        .post("/v1/results/diff", &json!({"keys": [key, key]}))
        .await
        .problem(404, "unknown-result");
}

#[tokio::test]
async fn the_outline_table_has_a_column_for_each_searchable_value() {
    let (dir, store) = crate::store::fresh().await;
    store.close().await;
    let columns: HashSet<String> =
        sqlx::query_scalar("SELECT name FROM pragma_table_info('outline')")
            .fetch_all(&mut raw(dir.path()).await)
            .await
            .unwrap()
            .into_iter()
            .collect();
    let known = ["id", "created", "size", "present", "owner"]
        .into_iter()
        .chain(WORDS.iter().map(|word| word.name))
        .chain(SCALARS.iter().map(|scalar| scalar.name));
    assert_eq!(columns, known.map(str::to_owned).collect::<HashSet<_>>());
    // The schema of the engine has all shapes that users can search by.
    let schema: Value = serde_json::from_str(&fretwork_engine::scenario::SCHEMA).unwrap();
    let schema = schema.to_string();
    let shapes = WORDS.iter().find(|word| word.name == "shape").unwrap();
    for shape in shapes.values {
        assert!(schema.contains(&format!("\"{shape}\"")), "{shape}");
    }
}

/// A row of `outline`.
#[derive(Debug, Clone)]
struct Row {
    id: i64,
    shape: &'static str,
    friction: f64,
    depth: Option<f64>,
    created: i64,
}

fn rows() -> impl Strategy<Value = Vec<Row>> {
    let row = (0..3_usize, 0..8_u8, proptest::option::of(0..6_u8), 0..5_i64);
    proptest::collection::vec(row, 0..40).prop_map(|rows| {
        let shapes = ["cone", "sphere", "table"];
        rows.into_iter()
            .zip(1..)
            .map(|((shape, friction, depth, created), id)| Row {
                id,
                shape: shapes[shape],
                friction: f64::from(friction) / 10.0,
                depth: depth.map(|depth| f64::from(depth) * 1e-6),
                created,
            })
            .collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]
    /// This takes more than 5 s, because each of 24 cases makes a database.
    #[test]
    fn a_search_finds_the_same_rows_as_a_scan_in_memory(
        rows in rows(), low in 0..8_u8, high in 0..8_u8, shape in proptest::option::of(0..3_usize),
        sort in 0..3_usize, descending: bool, limit in 1..7_u32,
    ) {
        let runtime = Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        runtime.block_on(async {
            let (dir, store) = crate::store::fresh().await;
            let mut db = raw(dir.path()).await;
            for row in &rows {
                sqlx::query(
                    "INSERT INTO result (key, summary, digest, size, created)
                     VALUES (CAST(printf('%032d', ?1) AS BLOB), '{}', zeroblob(32), 1, ?2);
                     INSERT INTO result_task (id, key, task)
                     VALUES (?1, CAST(printf('%032d', ?1) AS BLOB), '{}')")
                    .bind(row.id).bind(row.created).execute(&mut db).await.unwrap();
                sqlx::query("INSERT INTO outline (id, created, size, present, shape, friction, wear_depth)
                     VALUES (?1, ?2, 1, 1, ?3, ?4, ?5)")
                    .bind(row.id).bind(row.created).bind(row.shape).bind(row.friction).bind(row.depth)
                    .execute(&mut db).await.unwrap();
            }
            db.close().await.unwrap();
            let (low, high) = (f64::from(low.min(high)) / 10.0, f64::from(low.max(high)) / 10.0);
            let shape = shape.map(|shape| ["cone", "sphere", "table"][shape]);
            let by = ["created", "friction", "wear_depth"][sort];
            let mut search = Search::default();
            search.set("friction", &format!("{low}..{high}")).unwrap();
            if let Some(shape) = shape { search.set("shape", shape).unwrap(); }
            search.set("sort", &format!("{}{by}", if descending { "-" } else { "" })).unwrap();
            let mut expected: Vec<&Row> = rows.iter()
                .filter(|row| (low..=high).contains(&row.friction))
                .filter(|row| shape.is_none_or(|shape| row.shape == shape)).collect();
            let value = |row: &Row| match by {
                "created" => Some(row.created as f64), "friction" => Some(row.friction), _ => row.depth,
            };
            expected.sort_by(|one, other| {
                let order = match (value(one), value(other)) {
                    (None, None) => std::cmp::Ordering::Equal,
                    (None, _) => return std::cmp::Ordering::Greater,
                    (_, None) => return std::cmp::Ordering::Less,
                    (Some(one), Some(other)) => one.total_cmp(&other),
                }.then(one.id.cmp(&other.id));
                if descending { order.reverse() } else { order }
            });
            let expected: Vec<String> = expected.iter().map(|row| format!("{:032}", row.id)).collect();
            let (mut found, mut cursor) = (Vec::new(), None::<Cursor>);
            loop {
                let page = store.search(&search, cursor, limit).await.unwrap();
                found.extend(page.results.iter().map(|listed|
                    String::from_utf8(listed.key.bytes().to_vec()).unwrap()));
                // Clients get the cursor as text.
                cursor = page.next.map(|cursor| cursor.to_string().parse().unwrap());
                if cursor.is_none() { break }
                prop_assert_eq!(page.results.len(), limit as usize);
            }
            prop_assert_eq!(found, expected);
            Ok(())
        })?;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_outline_of_a_result_is_deleted_with_it() {
    let server = Server::start().await;
    let key = server.compute(&steel_ball()).await.json()["key"].as_str().unwrap().to_owned();
    assert_eq!(list(&server, "").await.len(), 1);
    let mut db = raw(server.dir.path()).await;
    sqlx::query("PRAGMA foreign_keys = ON").execute(&mut db).await.unwrap();
    sqlx::query("DELETE FROM result").execute(&mut db).await.unwrap();
    let left: i64 = sqlx::query(
        "SELECT (SELECT count(*) FROM outline) + (SELECT count(*) FROM result_task)
        + (SELECT count(*) FROM result_blob)",
    )
    .fetch_one(&mut db)
    .await
    .unwrap()
    .get(0);
    assert_eq!(left, 0);
    server.compute(&ball(1.0)).await;
    let found = list(&server, "").await;
    assert_eq!(found.len(), 1);
    assert_ne!(keys(&found), [key]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn opening_a_database_adds_missing_outlines() {
    let server = Server::start().await;
    let mut keys = Vec::new();
    for amplitude in [1.0, 2.0] {
        let job = server.compute(&ball(amplitude)).await.json();
        keys.push(job["key"].as_str().unwrap().to_owned());
    }
    let delete = server.send("DELETE", &format!("/v1/results/{}", keys[1]), &[], "").await;
    assert_eq!(delete.status, 204);
    let all = Search::default();
    let mut evicted = Search::default();
    evicted.set("evicted", "true").unwrap();
    let copy = crate::store::crash(server.dir.path());
    let store = crate::store::open(copy.path()).await;
    let whole = store.search(&all, None, 9).await.unwrap();
    store.close().await;
    sqlx::query("DELETE FROM outline").execute(&mut raw(copy.path()).await).await.unwrap();
    let store = crate::store::open(copy.path()).await;
    assert_eq!(store.search(&all, None, 9).await.unwrap(), whole);
    // A deleted result has no body. Its outline comes from its scenario and its summary.
    let listed = store.search(&evicted, None, 9).await.unwrap().results.remove(0);
    let numbers = listed.outline.scalars();
    assert_eq!((listed.key.to_string(), &numbers["friction"]), (keys[1].clone(), &json!(0.7)));
    assert!(numbers["wear_volume"].is_f64() && numbers["contact_radius"].is_null());
    store.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn computing_a_result_again_restores_its_search_values() {
    let server = Server::start().await;
    let key = server.compute(&steel_ball()).await.json()["key"].as_str().unwrap().to_owned();
    server.compute(&ball(1.0)).await;
    let whole = list(&server, "").await;
    let delete = server.send("DELETE", &format!("/v1/results/{key}"), &[], "").await;
    assert_eq!(delete.status, 204);
    let mut db = raw(server.dir.path()).await;
    sqlx::query("UPDATE outline SET contact_radius = NULL").execute(&mut db).await.unwrap();
    let dropped = list(&server, "evicted=true").await;
    assert_eq!(keys(&dropped), [&key]);
    assert!(dropped[0]["values"]["contact_radius"].is_null());
    server.compute(&steel_ball()).await;
    let found = list(&server, "").await;
    // The label is now that of the later job.
    let of_key = |list: &[Value]| {
        let mut entry = list.iter().find(|one| one["key"] == key.as_str()).cloned().unwrap();
        entry["job"].take();
        entry
    };
    assert_eq!(of_key(&found), of_key(&whole));
}
