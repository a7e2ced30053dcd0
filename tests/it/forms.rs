//! Formats of results over HTTP: negotiation, selections, tags, compression, memory.

use std::collections::HashSet;
use std::io::Read as _;
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use fretwork::http::{Access, Origins, Secret, Settings};
use fretwork_format::{Format, Part};
use fretwork_job::Task;
use fretwork_store::{Options, Role};
use futures_util::future::join_all;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpSocket, TcpStream};

use crate::access::{MASTER, ask, made};
use crate::program;
use crate::server::{Gate, JSON, Reply, Server, metric, send, steel_ball};

/// A server with one result, and the address of the result.
async fn with_result(body: &Value) -> (Server, String) {
    let server = Server::start().await;
    let job = server.compute(body).await.json();
    assert_eq!(job["state"], "succeeded", "{job}");
    let address = job["links"]["result"].as_str().unwrap().to_owned();
    (server, address)
}

/// The tables of a run.
const RUN_TABLES: [Part; 3] = [Part::History, Part::Profiles, Part::Loops];

/// The steel ball with 200 profiles of 512 radii.
fn large(method: &str) -> Value {
    let mut body = steel_ball();
    body["scenario"]["cycles"] =
        json!({"from": 100, "to": 1_000_000, "count": 200, "spacing": "log"});
    body["scenario"]["profiles_at"] = json!("all");
    body["scenario"]["model"] = json!({"method": method, "points": 512});
    body
}

async fn coded(server: &Server, target: &str, coding: &str) -> Reply {
    server.send("GET", target, &[("Accept-Encoding", coding)], "").await
}

fn gunzipped(body: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    flate2::read::GzDecoder::new(body).read_to_end(&mut out).unwrap();
    out
}

/// Decodes a body with chunked transfer coding.
fn joined(mut chunks: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    loop {
        let line = chunks.iter().position(|byte| *byte == b'\r').unwrap();
        let size = std::str::from_utf8(&chunks[..line]).unwrap();
        let size = usize::from_str_radix(size, 16).unwrap();
        if size == 0 {
            return out;
        }
        out.extend(&chunks[line + 2..][..size]);
        chunks = &chunks[line + 2 + size + 2..];
    }
}

pub fn unpacked(reply: &Reply) -> Vec<u8> {
    let body = match reply.header("transfer-encoding") {
        Some("chunked") => joined(&reply.body),
        _ => reply.body.clone(),
    };
    match reply.header("content-encoding") {
        Some("gzip") => gunzipped(&body),
        Some("zstd") => zstd::stream::decode_all(&*body).unwrap(),
        None => body,
        other => panic!("{other:?}"),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_selects_a_format_by_name_or_by_media_type() {
    let (server, address) = with_result(&steel_ball()).await;
    for part in RUN_TABLES.into_iter().chain([Part::Whole]) {
        let path = match part {
            Part::Whole => address.clone(),
            part => format!("{address}/{}", part.as_str()),
        };
        let mut tags = HashSet::new();
        for &format in part.formats() {
            let kind = format.media_type();
            let accept = kind.split(';').next().unwrap();
            let by_name = server.get(&format!("{path}?format={}", format.name())).await;
            let by_type = server.send("GET", &path, &[("Accept", accept)], "").await;
            assert_eq!((by_name.status, by_name.header("content-type")), (200, Some(kind)));
            assert_eq!(by_type.header("content-type"), Some(kind));
            assert!(by_name.body == by_type.body, "{part:?} {format:?}");
            assert!(tags.insert(by_name.header("etag").unwrap().to_owned()));
            let name = by_name.header("content-disposition");
            let key = address.rsplit('/').next().unwrap();
            let file = format!("fretwork-{}-{}.{}", &key[..12], part.as_str(), format.name());
            let expected = format!("attachment; filename=\"{file}\"");
            assert_eq!(name, Some(&*expected).filter(|_| format.is_file()));
        }
        for format in Format::ALL.into_iter().filter(|format| !part.formats().contains(format)) {
            let refused = server.get(&format!("{path}?format={}", format.name())).await;
            let problem = refused.problem(406, "not-acceptable");
            assert!(problem["detail"].as_str().unwrap().contains("?format=npz"), "{problem}");
        }
    }
}

/// The number of significant digits of a number as it is written.
fn significant(number: &str) -> usize {
    let digits = number.split('e').next().unwrap().replace(['-', '.'], "");
    digits.trim_start_matches('0').trim_end_matches('0').len()
}

/// The largest number of significant digits in a JSON document.
fn most_digits(value: &Value) -> usize {
    match value {
        Value::Number(number) => significant(&number.to_string()),
        Value::Array(items) => items.iter().map(most_digits).max().unwrap_or(0),
        Value::Object(members) => members.values().map(most_digits).max().unwrap_or(0),
        _ => 0,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn numbers_have_twelve_digits_in_every_part_and_in_both_unit_systems() {
    let mut body = steel_ball();
    body["scenario"]["model"] = json!({"method": "exact", "points": 64, "compare": true});
    let (server, address) = with_result(&body).await;
    for units in ["si", "engineering"] {
        let whole = server.get(&format!("{address}?units={units}")).await.json();
        assert_eq!(most_digits(&whole), 12, "{units}");
        for part in RUN_TABLES {
            let table =
                server.get(&format!("{address}/{}?format=csv&units={units}", part.as_str())).await;
            let lines = table.text().lines().filter(|line| !line.starts_with('#')).skip(1);
            let most = lines.flat_map(|line| line.split(',')).map(significant).max();
            assert_eq!(most, Some(12), "{part:?} {units}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_error_lists_all_invalid_parameters() {
    let (server, address) = with_result(&steel_ball()).await;
    for (target, expected) in [
        (
            "/profiles?digits=0&units=imperial&layout=rows&cycles=1,x&points=1&colour=red",
            &["layout", "digits", "units", "cycles", "points", "colour"][..],
        ),
        (
            "/profiles?fields=warn,wear,worm&cycles=1000,7,8",
            &["fields", "fields", "cycles", "cycles"],
        ),
        ("/history?points=5&digits=18", &["digits", "points"]),
        ("/loops?points=5", &["points"]),
        ("/history?cycles=inf", &["cycles"]),
        ("/history?format=csv&layout=records", &["layout"]),
        ("?layout=records&digits=1.5", &["digits", "layout"]),
        ("?fields=wear", &["fields"]),
        ("?cycles=7", &["cycles"]),
        ("/history?fields=", &["fields"]),
    ] {
        let refused = server.get(&format!("{address}{target}")).await;
        let problem = refused.problem(422, "invalid-parameters");
        let errors = problem["errors"].as_array().unwrap();
        let names: Vec<_> =
            errors.iter().map(|error| error["parameter"].as_str().unwrap()).collect();
        assert_eq!(names, expected, "{target}: {problem}");
    }
    let unknown = server.get(&format!("{address}/history?fields=volume")).await;
    let problem = unknown.problem(422, "invalid-parameters");
    assert!(problem["errors"][0]["detail"].as_str().unwrap().contains("wear_volume"), "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn numbers_are_equal_in_all_text_formats_and_rounded_on_request() {
    let (server, address) = with_result(&steel_ball()).await;
    let whole = server.get(&address).await;
    for part in RUN_TABLES {
        let path = format!("{address}/{}", part.as_str());
        let table = server.get(&path).await;
        // The table equals that of the stored document character by character.
        let (_, text) = table.text().split_once(&format!("\"{}\":", part.as_str())).unwrap();
        assert!(whole.text().contains(&text[..text.len() - 1]), "{part:?}");

        let csv = server.get(&format!("{path}?format=csv")).await;
        let mut lines = csv.text().lines().filter(|line| !line.starts_with('#'));
        let names: Vec<_> = lines.next().unwrap().split(',').collect();
        let records = server.get(&format!("{path}?layout=records")).await.json();
        let ndjson = server.get(&format!("{path}?format=ndjson")).await;
        let mut rows = 0;
        for ((line, record), object) in
            lines.zip(records["records"].as_array().unwrap()).zip(ndjson.text().lines())
        {
            let object: Value = serde_json::from_str(object).unwrap();
            for ((cell, name), (plain, value)) in
                line.split(',').zip(&names).zip(record.as_object().unwrap())
            {
                assert_eq!(name.split('[').next(), Some(plain.as_str()));
                assert_eq!(cell, if value.is_null() { String::new() } else { value.to_string() });
                assert_eq!(object[*name], *value);
            }
            rows += 1;
        }
        assert_eq!(rows, records["records"].as_array().unwrap().len());
    }
    let rounded = server.get(&format!("{address}/history?digits=3&units=engineering")).await.json();
    let depths = rounded["history"]["wear_depth"].as_array().unwrap();
    assert!(depths.iter().all(|depth| depth.to_string().len() <= 6), "{depths:?}");
    assert_eq!(rounded["units"]["wear_depth"], "um");
}

#[tokio::test(flavor = "multi_thread")]
async fn equivalent_requests_have_the_same_etag_and_others_do_not() {
    let (server, address) = with_result(&steel_ball()).await;
    let tag = async |target: &str| {
        let reply = server.get(&format!("{address}{target}")).await;
        assert_eq!(reply.status, 200, "{target}");
        assert_eq!(reply.header("vary"), Some("accept, accept-encoding"));
        reply.header("etag").unwrap().to_owned()
    };
    let mut tags = HashSet::new();
    for target in [
        "",
        "?digits=7",
        "?units=engineering",
        "?points=9",
        "?cycles=0",
        "/profiles",
        "/history",
        "/profiles?digits=7",
        "/profiles?points=9",
        "/profiles?fields=wear",
        "/profiles?cycles=0",
        "/profiles?layout=records",
        "/loops",
        "/loops?fields=energy_ratio",
    ] {
        assert!(tags.insert(tag(target).await), "{target}");
    }
    for (one, other) in [
        ("?units=si&layout=columns&format=json", ""),
        (
            "/profiles?fields=wear,pressure&cycles=0,1000",
            "/profiles?cycles=1e3,0&fields=pressure,wear",
        ),
    ] {
        assert_eq!(tag(one).await, tag(other).await);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_compressed_answer_has_a_weak_etag_and_is_cached() {
    let (server, address) = with_result(&steel_ball()).await;
    for target in ["", "/profiles?format=csv", "/profiles?format=arrow&digits=7"] {
        let target = format!("{address}{target}");
        let plain = server.get(&target).await;
        let tag = plain.header("etag").unwrap();
        assert!(tag.starts_with('"') && plain.header("content-encoding").is_none());
        for coding in ["gzip", "zstd"] {
            let reply = coded(&server, &target, coding).await;
            assert_eq!(reply.header("content-encoding"), Some(coding));
            assert_eq!(reply.header("etag"), Some(&*format!("W/{tag}")));
            assert!(reply.body.len() < plain.body.len() && unpacked(&reply) == plain.body);

            let hits = metric(server.address, "fretwork_memory_cache_hits_total").await;
            assert!(coded(&server, &target, coding).await.body == reply.body);
            let now = metric(server.address, "fretwork_memory_cache_hits_total").await;
            assert_eq!(now, hits + 1.0);
        }
        // The server confirms strong and weak tags, alone and in lists.
        for held in [tag.to_owned(), format!("W/{tag}"), "*".to_owned()] {
            let list = format!("\"other\", {held} , \"another\"");
            for sent in [&held, &list] {
                let headers = [("If-None-Match", &**sent), ("Accept-Encoding", "gzip")];
                let reply = server.send("GET", &target, &headers, "").await;
                let told = if held == "*" { tag } else { &held };
                assert_eq!((reply.status, reply.header("etag")), (304, Some(told)), "{sent}");
                assert!(reply.body.is_empty() && reply.header("content-encoding").is_none());
            }
        }
    }
    let small =
        coded(&server, &format!("{address}/history?fields=wear_depth&format=csv"), "gzip").await;
    assert!(
        small.header("content-encoding").is_none()
            && small.header("etag").unwrap().starts_with('"')
    );
    let archive = coded(&server, &format!("{address}?format=npz"), "gzip, zstd").await;
    assert!(archive.header("content-encoding").is_none() && archive.body.starts_with(b"PK"));
}

#[tokio::test(flavor = "multi_thread")]
async fn texts_of_the_program_are_compressed_and_read_once_but_event_streams_are_not() {
    let gate = Gate::default();
    let server = Server::computing(gate.compute(), &Origins::Own).await;
    let plain = server.get("/openapi.json").await;
    let reply = coded(&server, "/v1/schema/scenario", "gzip").await;
    assert_eq!(reply.header("content-encoding"), Some("gzip"));
    assert!(reply.header("vary").unwrap().contains("accept-encoding"));
    let reply = coded(&server, "/openapi.json", "zstd").await;
    assert!(unpacked(&reply) == plain.body);
    assert!(coded(&server, "/healthz", "gzip").await.header("content-encoding").is_none());
    // The copies of a client are valid in each coding until the program changes.
    let all = ["/openapi.json", "/v1/schema/scenario", "/v1/examples", "/v1/examples/steel-ball"];
    let mut tags = HashSet::new();
    for address in all {
        let reply = coded(&server, address, "zstd").await;
        let tag = reply.header("etag").unwrap().to_owned();
        assert_eq!((reply.status, reply.header("cache-control")), (200, Some("no-cache")));
        assert!(tag.starts_with("W/\"") && server.get(address).await.header("etag") == Some(&tag));
        for held in [&*tag, "*"] {
            let known = server.send("GET", address, &[("If-None-Match", held)], "").await;
            assert_eq!((known.status, known.body.len()), (304, 0), "{address} {held}");
            assert_eq!(known.header("etag"), Some(&*tag));
        }
        let other = server.send("GET", address, &[("If-None-Match", "W/\"0\"")], "").await;
        assert!(other.status == 200 && tags.insert(tag));
    }

    let job = server.post("/v1/jobs", &steel_ball()).await.json();
    gate.open();
    let events = format!("/v1/jobs/{}/events", job["id"].as_str().unwrap());
    let events = coded(&server, &events, "gzip, zstd").await;
    assert!(events.header("content-encoding").is_none());
    assert!(events.text().contains("event: snapshot"));
}

#[tokio::test(flavor = "multi_thread")]
async fn selected_parts_of_a_large_result_are_small() {
    for method in ["simplified", "exact"] {
        let (server, address) = with_result(&large(method)).await;
        for (target, most) in SELECTIONS {
            let target = format!("{address}{target}");
            let reply = coded(&server, &target, "zstd").await;
            assert_eq!(reply.status, 200);
            assert!(reply.body.len() <= most, "{method} {target}: {}", reply.body.len());
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_includes_the_stored_bytes_of_a_large_result() {
    let body = large("simplified");
    let (server, address) = with_result(&body).await;
    let stored = server.get(&address).await;
    let headers = [JSON, ("Prefer", "wait=60")];
    let target = "/v1/jobs?include=result,scenario";
    let job = server.send("POST", target, &headers, &body.to_string()).await;
    assert_eq!(job.header("content-length"), Some(&*job.body.len().to_string()));
    let (told, inside) = (job.json(), job.text());
    assert_eq!(told["scenario"], stored.json()["scenario"]);
    assert!(inside.ends_with(&format!(",\"result\":{}}}", stored.text())));
    let again = format!("{}?include=result", told["links"]["self"].as_str().unwrap());
    let again = server.get(&again).await;
    assert!(again.text().ends_with(&format!(",\"result\":{}}}", stored.text())));
    assert_eq!(again.json()["state"], "succeeded");
}

/// Selections of 200 output cycles and 512 radii, and the largest size of the compressed answer in bytes.
const SELECTIONS: [(&str, usize); 4] = [
    ("/history?digits=7", 10_000),
    ("/profiles?digits=7&fields=worn", 300_000),
    ("/profiles?digits=7&points=64", 300_000),
    ("?digits=3&points=128", 300_000),
];

/// Peak memory of a process, in kB.
#[cfg(target_os = "linux")]
fn most_resident(process: u32) -> usize {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    line.trim().trim_end_matches(" kB").parse().unwrap()
}

/// Sends a request by a connection whose small buffers keep the answer in the memory of the server.
#[cfg(target_os = "linux")]
async fn slow_reader(address: SocketAddr, request: &str) -> TcpStream {
    let socket = TcpSocket::new_v4().unwrap();
    socket.set_recv_buffer_size(1 << 16).unwrap();
    let mut reader = socket.connect(address).await.unwrap();
    reader.write_all(request.as_bytes()).await.unwrap();
    reader
}

/// This takes more than 5 s, because eight answers of many MiB go to many slow readers each. tests/long sends ten.
#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn slow_readers_share_one_copy_of_a_large_answer() {
    const MOST: usize = 125_000;
    let is_long = std::env::var_os("FRETWORK_TEST_LONG").is_some();
    for (cache, targets) in [("0", if is_long { 5 } else { 3 }), ("64MiB", 5)] {
        let dir = tempfile::TempDir::new().unwrap();
        let (mut child, address) = program::serve(dir.path(), &["--memory-cache", cache]);
        let address = address.strip_prefix("http://").unwrap().parse().unwrap();
        let body = large("simplified").to_string();
        let headers = [JSON, ("Prefer", "wait=60")];
        let job = send(address, "POST", "/v1/jobs", &headers, body).await.unwrap().json();
        let (result, job) = (&job["links"]["result"], &job["links"]["self"]);
        let (result, job) = (result.as_str().unwrap(), job.as_str().unwrap());
        for (target, coding) in [
            (result.to_owned(), "zstd"),
            (result.to_owned(), ""),
            (format!("{result}/profiles?format=csv"), ""),
            (format!("{result}/profiles?format=ndjson&digits=9"), "gzip"),
            (format!("{job}?include=result"), ""),
        ]
        .into_iter()
        .take(targets)
        {
            // One caller may have 15 decompressors.
            let count = if coding.is_empty() { 12 } else { 50 };
            let request = format!(
                "GET {target} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\
                 Accept-Encoding: {coding}\r\n\r\n"
            );
            // The server refuses a reader for whom it has no memory within 5 s, with a short answer. Such a reader comes
            // again.
            let readers = (0..count).map(async |_| {
                loop {
                    let (mut reader, mut read) =
                        (slow_reader(address, &request).await, vec![0; 1 << 12]);
                    if reader.read_exact(&mut read).await.is_ok() {
                        assert!(read.starts_with(b"HTTP/1.1 200 "), "{target}");
                        return (reader, read);
                    }
                }
            });
            let readers = join_all(readers).await;
            let held = most_resident(child.id());
            println!("{cache} {target} {coding}: {held} kB");
            let sizes = readers.into_iter().map(async |(mut reader, mut read)| {
                reader.read_to_end(&mut read).await.unwrap();
                read.len()
            });
            let sizes: HashSet<_> = join_all(sizes).await.into_iter().collect();
            assert_eq!(sizes.len(), 1, "{sizes:?}");
            assert!(sizes.into_iter().all(|size| size > 2 << 20), "it is a large answer");
            assert!(held < MOST, "{target} to {count} readers takes {held} kB");
        }
        child.kill().unwrap();
        child.wait().unwrap();
    }
}

/// The answer to a request. A server that has no memory for a large one within 5 s refuses it, and the client comes again.
async fn patient(request: impl AsyncFn() -> Reply) -> Reply {
    loop {
        let reply = request().await;
        if reply.status != 503 {
            return reply;
        }
    }
}

/// This takes more than 5 s, because it makes four answers of many MiB.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_large_answer_is_decompressed_while_it_is_sent() {
    let (server, address) = with_result(&large("simplified")).await;
    for view in ["", "/profiles?format=csv&fields=worn,wear"] {
        let target = format!("{address}{view}");
        let (plain, again, zstd) = tokio::join!(
            patient(async || server.get(&target).await),
            patient(async || server.get(&target).await),
            patient(async || coded(&server, &target, "zstd").await),
        );
        let gzip = patient(async || coded(&server, &target, "gzip").await).await;
        assert_eq!(plain.header("content-length"), Some(&*plain.body.len().to_string()), "{view}");
        assert!(plain.body.len() > 2 << 20 && again.body == plain.body, "{view}");
        for (coded, coding) in [(gzip, "gzip"), (zstd, "zstd")] {
            assert_eq!(coded.header("content-encoding"), Some(coding), "{view}");
            assert!(unpacked(&coded) == plain.body, "{view} {coding}");
        }
        let tag = plain.header("etag").unwrap();
        let again = server.send("GET", &target, &[("If-None-Match", tag)], "").await;
        assert_eq!(again.status, 304);
    }
    // A fault of the request is reported before the first row is sent.
    let missing = server.get(&format!("{address}/profiles?format=ndjson&fields=volume")).await;
    missing.problem(422, "invalid-parameters");
    let short = server.get(&format!("{address}/profiles?format=csv&cycles=100&points=8")).await;
    let rows = short.text().lines().filter(|line| !line.starts_with('#')).count();
    assert_eq!((short.status, rows), (200, 1 + 8));
    let archive = coded(&server, &format!("{address}?format=npz"), "gzip").await;
    assert_eq!((archive.status, archive.header("content-encoding")), (200, None));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_new_run_with_a_result_that_is_too_large_is_refused() {
    let mut body = large("simplified");
    body["scenario"]["cycles"]["count"] = json!(600);
    let server = Server::start().await;
    let refused = server.send("POST", "/v1/jobs", &[JSON], body.to_string()).await;
    let problem = refused.problem(422, "too-expensive");
    let detail = problem["detail"].as_str().unwrap();
    assert!(
        detail.contains("the limit is 16.0 MB") && detail.contains("`profiles_at`"),
        "{detail}"
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_reader_of_a_large_result_reserves_its_bytes_and_those_of_the_stream() {
    let body = large("simplified");
    // The share of a caller is an eighth: once less than the compressed result, and once more.
    for transfers in [8, 96] {
        let settings = Settings { transfers: transfers << 20, memory: 0, ..Settings::default() };
        let server = Server::with(Arc::new(Task::start), &settings, &Options::default()).await;
        let job = server.compute(&body).await.json();
        let result = job["links"]["result"].as_str().unwrap();
        let packed = coded(&server, result, "zstd").await.body.len();
        let share = (transfers as usize / 8) << 20;
        assert_eq!(packed > share, transfers == 8, "{packed}");
        let socket = TcpSocket::new_v4().unwrap();
        socket.set_recv_buffer_size(1 << 12).unwrap();
        let mut reader = socket.connect(server.address).await.unwrap();
        let request = format!("GET {result} HTTP/1.1\r\nHost: localhost\r\n\r\n");
        reader.write_all(request.as_bytes()).await.unwrap();
        let mut head = [0; 12];
        reader.read_exact(&mut head).await.unwrap();
        assert_eq!(&head, b"HTTP/1.1 200");
        let held = metric(server.address, "fretwork_transfers_bytes").await as usize;
        let expected = share.min(packed) + (1 << 20);
        assert!(held.abs_diff(expected) < 1 << 12, "{held} instead of {expected}");
    }
}

/// This takes more than 5 s, because a request waits so long for memory.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_caller_who_waits_for_memory_delays_no_other_caller() {
    let access = Access { admin_key: Some(Secret(MASTER.into())), ..Access::default() };
    let settings = Settings { access, transfers: 32 << 20, memory: 0, ..Settings::default() };
    let server = Server::with(Arc::new(Task::start), &settings, &Options::default()).await;
    let anna = made(server.place(), "anna", Role::Submit).await;
    let berta = made(server.place(), "berta", Role::Submit).await;
    let body = large("simplified").to_string();
    let job = ask(&server, &anna, "POST", "/v1/jobs", &body).await.json();
    let result = job["links"]["result"].as_str().unwrap();
    // Anna holds most of her share of the memory, because she does not read this answer.
    let socket = TcpSocket::new_v4().unwrap();
    socket.set_recv_buffer_size(1 << 12).unwrap();
    let mut reader = socket.connect(server.address).await.unwrap();
    let request = format!(
        "GET {result}?digits=11 HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {anna}\r\n\r\n"
    );
    reader.write_all(request.as_bytes()).await.unwrap();
    reader.read_exact(&mut [0; 16]).await.unwrap();
    // These are the stored bytes, which also a slow machine sends within the 5 s that Anna's request waits.
    let stored = async |key: &str| {
        let bearer = format!("Bearer {key}");
        let headers = [("Authorization", bearer.as_str()), ("Accept-Encoding", "zstd")];
        server.send("GET", result, &headers, "").await
    };
    let mut annas = pin!(stored(&anna));
    let other = async {
        tokio::time::sleep(Duration::from_millis(500)).await;
        stored(&berta).await
    };
    let bertas = tokio::select! {
        annas = &mut annas => panic!("Anna's request ended first, with {}", annas.status),
        bertas = other => bertas,
    };
    assert_eq!(bertas.status, 200);
    annas.await.problem(503, "memory-full");
    drop(reader);
}
