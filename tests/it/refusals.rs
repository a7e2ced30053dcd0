//! Refused requests: each gets the right problem with all its faults, and the server keeps running.

use serde_json::{Map, Value, json};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;

use crate::server::{JSON, Server, answer, steel_ball};

/// A request and the expected answer.
struct Case {
    name: &'static str,
    method: &'static str,
    target: String,
    content_type: Option<&'static str>,
    body: Vec<u8>,
    status: u16,
    slug: &'static str,
    /// The pointers or parameters of all faults.
    places: Vec<String>,
    /// Words that the text of at least one fault contains.
    says: &'static str,
}

fn case(
    name: &'static str,
    method: &'static str,
    target: &str,
    status: u16,
    slug: &'static str,
) -> Case {
    let content_type = (method == "POST").then_some(JSON.1);
    let target = target.to_owned();
    Case {
        name,
        method,
        target,
        content_type,
        body: vec![],
        status,
        slug,
        places: vec![],
        says: "",
    }
}

/// A body that is not valid JSON.
fn text(name: &'static str, body: impl Into<Vec<u8>>) -> Case {
    Case { body: body.into(), ..case(name, "POST", "/v1/jobs", 400, "invalid-json") }
}

/// A job with faults at these places.
fn faulty(name: &'static str, body: &str, places: &[&str]) -> Case {
    Case {
        body: body.into(),
        places: places.iter().map(ToString::to_string).collect(),
        ..case(name, "POST", "/v1/jobs", 422, "invalid-request")
    }
}

/// A line of `tests/data/faults.txt`.
fn listed(line: &'static str) -> Case {
    let [name, changes, places, says] = line.split('|').map(str::trim).collect::<Vec<_>>()[..]
    else {
        panic!("{line}");
    };
    let whole = |place: &str| {
        format!(
            "{}/{}",
            if place.starts_with('/') { "/scenario" } else { "" },
            place.trim_start_matches('/')
        )
    };
    let mut body = steel_ball();
    for (place, value) in serde_json::from_str::<Map<String, Value>>(changes).expect(line) {
        let place = whole(&place);
        let (parent, member) = place.rsplit_once('/').unwrap();
        body.pointer_mut(parent).expect(line)[member] = value;
    }
    let places: Vec<String> = places.split(' ').map(whole).collect();
    Case { places, says, ..faulty(name, &body.to_string(), &[]) }
}

/// A query with a fault in one parameter.
fn query(name: &'static str, target: &str, parameter: &'static str) -> Case {
    Case {
        places: vec![parameter.to_owned()],
        ..case(name, "GET", target, 422, "invalid-parameters")
    }
}

const ID: &str = "019aa0f3-1f4e-7cc0-9d8b-1c5b0c1f9a11";
const KEY: &str = "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";

async fn all_are_refused(cases: Vec<Case>) {
    let server = Server::start().await;
    let mut failures = Vec::new();
    for case in cases {
        let headers: Vec<_> = case.content_type.map(|kind| (JSON.0, kind)).into_iter().collect();
        let reply = server.send(case.method, &case.target, &headers, &case.body).await;
        if reply.status != case.status {
            let shown = String::from_utf8_lossy(&reply.body).chars().take(300).collect::<String>();
            failures.push(format!("{}: {} {shown}", case.name, reply.status));
            continue;
        }
        let problem = reply.problem(case.status, case.slug);
        let mut expected = case.places;
        expected.sort_unstable();
        let mut places: Vec<&str> = problem["errors"]
            .as_array()
            .into_iter()
            .flatten()
            .map(|error| error["pointer"].as_str().or(error["parameter"].as_str()).unwrap())
            .collect();
        places.sort_unstable();
        if places != expected {
            failures.push(format!("{}: {places:?}, expected {expected:?}", case.name));
        }
        let mut details = problem["errors"].as_array().into_iter().flatten();
        if !case.says.is_empty()
            && !details.any(|error| error["detail"].as_str().unwrap().contains(case.says))
        {
            failures.push(format!("{}: no {:?} in {problem}", case.name, case.says));
        }
        assert_eq!(server.get("/healthz").await.status, 200, "after {}", case.name);
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_json_and_unknown_paths_are_refused() {
    let oversized = format!("{{\"label\": \"{}\"}}", "x".repeat(5 << 20));
    let deep = "[".repeat(100_000);
    all_are_refused(vec![
        text("empty body", ""),
        text("blank body", " \n"),
        text("truncated", r#"{"scenario": {"#),
        text("trailing comma", r#"{"scenario": {},}"#),
        text("NaN literal", r#"{"scenario": {"friction": NaN}}"#),
        text("infinite literal", r#"{"scenario": {"friction": Infinity}}"#),
        text("number too large", r#"{"scenario": {"friction": 1e999}}"#),
        text("not UTF-8", b"{\"label\": \"\xff\"}".to_vec()),
        text("two documents", "{} {}"),
        Case { status: 413, slug: "body-too-large", ..text("deep nesting", deep) },
        text("YAML", "scenario:\n  friction: 0.7"),
        Case { status: 413, slug: "body-too-large", ..text("oversized body", oversized) },
        Case {
            content_type: Some("application/x-www-form-urlencoded"),
            status: 415,
            slug: "unsupported-media-type",
            ..text("form", "scenario=steel")
        },
        Case {
            content_type: Some("text/plain"),
            status: 415,
            slug: "unsupported-media-type",
            ..text("plain text", steel_ball().to_string())
        },
        Case {
            content_type: None,
            status: 415,
            slug: "unsupported-media-type",
            ..text("no type", steel_ball().to_string())
        },
        case("unknown path", "GET", "/v2/jobs", 404, "not-found"),
        case("slash at the end", "GET", "/v1/jobs/", 404, "not-found"),
        case("wrong method", "DELETE", "/v1/jobs", 405, "method-not-allowed"),
        case(
            "wrong method on a result",
            "PUT",
            &format!("/v1/results/{KEY}"),
            405,
            "method-not-allowed",
        ),
        case("GET of a check", "GET", "/v1/scenarios", 405, "method-not-allowed"),
        case("bad id", "GET", "/v1/jobs/42", 404, "not-found"),
        case("unknown id", "GET", &format!("/v1/jobs/{ID}"), 404, "not-found"),
        case("path that is not UTF-8", "GET", "/v1/jobs/%FF", 404, "not-found"),
        case("bad key", "GET", "/v1/results/XYZ", 404, "unknown-result"),
        case("unknown key", "GET", &format!("/v1/results/{KEY}"), 404, "unknown-result"),
        case(
            "history of an unknown key",
            "GET",
            &format!("/v1/results/{KEY}/history"),
            404,
            "unknown-result",
        ),
    ])
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_invalid_query_is_refused_with_the_parameter_name() {
    all_are_refused(vec![
        query("unknown parameter", "/v1/jobs?lmit=5", "lmit"),
        query("bad state", "/v1/jobs?state=done", "state"),
        query("bad limit", "/v1/jobs?limit=0", "limit"),
        query("large limit", "/v1/jobs?limit=100000", "limit"),
        query("bad cursor", "/v1/jobs?cursor=first", "cursor"),
        query("bad key filter", "/v1/jobs?key=abc", "key"),
        query("owner without a name", "/v1/jobs?owner=", "owner"),
        query("repeated parameter", "/v1/jobs?limit=1&limit=2", "limit"),
        query("bad wait", &format!("/v1/jobs/{ID}?wait=soon"), "wait"),
        query("long wait", &format!("/v1/jobs/{ID}?wait=3600"), "wait"),
        query("bad include", &format!("/v1/jobs/{ID}?include=everything"), "include"),
        query("bad format", &format!("/v1/results/{KEY}?format=xml"), "format"),
        query("parameter on a route without parameters", "/healthz?verbose=1", "verbose"),
        Case {
            places: ["limit", "sort", "state"].map(str::to_owned).into(),
            ..query("three faults", "/v1/jobs?sort=up&limit=x&state=y", "")
        },
        Case {
            body: steel_ball().to_string().into(),
            method: "POST",
            content_type: Some(JSON.1),
            ..query("bad include of a submission", "/v1/jobs?include=all", "include")
        },
    ])
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn faults_of_a_scenario_are_reported_with_pointers() {
    let repeated =
        steel_ball().to_string().replace("\"friction\":", "\"friction\":0.1,\"friction\":");
    let mut cases = vec![
        faulty("not an object", "[]", &[""]),
        faulty("no scenario", "{}", &["/scenario"]),
        faulty("scenario of the wrong type", r#"{"scenario": 7}"#, &["/scenario"]),
        faulty("repeated member", &repeated, &["/scenario/friction"]),
    ];
    let block = json!({"amplitude": "2 um", "cycles": 1e5});
    for (name, place, value) in [
        ("many output cycles", "/scenario/cycles", json!(vec![1; 200_000])),
        ("many blocks", "/scenario/motion/blocks", json!(vec![block; 1001])),
    ] {
        let mut body = steel_ball();
        body["scenario"]["motion"].as_object_mut().unwrap().retain(|_, _| name != "many blocks");
        let (parent, member) = place.rsplit_once('/').unwrap();
        body.pointer_mut(parent).unwrap()[member] = value;
        cases.push(faulty(name, &body.to_string(), &[place]));
    }
    let lines = include_str!("../data/faults.txt").lines();
    let lines = lines.filter(|line| !line.is_empty() && !line.starts_with('#'));
    cases.extend(lines.map(listed));
    all_are_refused(cases).await;
}

/// Sends the head of a request. The caller sends the body later.
async fn send_head(server: &Server, head: &str, length: usize) -> TcpStream {
    let mut connection = TcpStream::connect(server.address).await.unwrap();
    let head = format!("{head}Host: localhost\r\nContent-Length: {length}\r\n\r\n");
    connection.write_all(head.as_bytes()).await.unwrap();
    connection
}

#[tokio::test(flavor = "multi_thread")]
async fn a_connection_stays_usable_if_the_answer_precedes_the_body() {
    let server = Server::start().await;
    let json = "Content-Type: application/json\r\n";
    for (status, head, length) in [
        (415, "POST /v1/jobs HTTP/1.1\r\n".to_owned(), 200_000),
        (404, format!("POST /nowhere HTTP/1.1\r\n{json}"), 200_000),
        (405, format!("POST /healthz HTTP/1.1\r\n{json}"), 200_000),
        (403, format!("POST /v1/jobs HTTP/1.1\r\n{json}Origin: http://evil.example\r\n"), 200_000),
        (200, "GET /healthz HTTP/1.1\r\n".to_owned(), 200_000),
        (413, format!("POST /v1/jobs HTTP/1.1\r\n{json}"), (4 << 20) + 1),
    ] {
        let mut connection = send_head(&server, &head, length).await;
        let early = answer(&mut connection).await.unwrap();
        assert_eq!((early.status, early.header("connection")), (status, None), "{head}");
        connection.write_all(&vec![b' '; length]).await.unwrap();
        let next = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
        connection.write_all(next).await.unwrap();
        let next = answer(&mut connection).await;
        assert_eq!(next.map(|reply| reply.status).ok(), Some(200), "after {status} to {head}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_connection_closes_when_the_unread_body_is_too_large() {
    let server = Server::start().await;
    let head = "POST /v1/jobs HTTP/1.1\r\n";
    let mut connection = send_head(&server, head, 1 << 30).await;
    // The client has sent 8 MiB before it reads the answer. The answer must still arrive.
    connection.write_all(&vec![b' '; 8 << 20]).await.unwrap();
    let early = answer(&mut connection).await.unwrap();
    assert_eq!((early.status, early.header("connection")), (415, Some("close")));

    // A client that sends `Expect: 100-continue` gets the refusal instead of a 100.
    let head = format!("{head}Expect: 100-continue\r\n");
    let mut connection = send_head(&server, &head, 1000).await;
    let mut text = String::new();
    connection.read_to_string(&mut text).await.unwrap();
    assert!(text.starts_with("HTTP/1.1 415 ") && text.contains("connection: close"), "{text}");
}

#[tokio::test(flavor = "multi_thread")]
async fn accept_encoding_never_causes_a_refusal() {
    let server = Server::start().await;
    for accepted in ["identity;q=0", "*;q=0", "*;q=0.0, IDENTITY ; Q=0.000", "gzip;q=0, *;q=0"] {
        let coding = ("Accept-Encoding", accepted);
        let ball = steel_ball().to_string();
        let ask = async |method, target, status| {
            let headers = [JSON, ("Prefer", "wait=60"), coding];
            let reply = server.send(method, target, &headers, &ball).await;
            assert_eq!((reply.status, reply.header("content-encoding")), (status, None));
            reply
        };
        assert_eq!(ask("POST", "/v1/jobs", 200).await.json()["state"], "succeeded", "{accepted}");
        ask("GET", "/v1/jobs?no=1", 422).await.problem(422, "invalid-parameters");
        ask("GET", "/nowhere", 404).await.problem(404, "not-found");
        ask("GET", "/openapi.json", 200).await;
    }
    let packed = [("Accept-Encoding", "gzip, identity;q=0, *;q=0")];
    let packed = server.send("GET", "/openapi.json", &packed, "").await;
    assert_eq!((packed.status, packed.header("content-encoding")), (200, Some("gzip")));
}
