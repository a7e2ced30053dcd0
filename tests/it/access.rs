//! Access control: keys, roles, owners, links and limits.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{BufRead as _, BufReader};
use std::num::NonZeroU32;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use fretwork::http::{self, Access, Limits, Origins, Secret, Settings};
use fretwork_job::{Begin, Task};
use fretwork_store::{Administration, NewKey, Options, Place, Role};
use futures_util::future::join_all;
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;

use crate::database::PATIENCE;
use crate::keeping::eventually;
use crate::program::{Running, fails, fretwork, run, serve_by};
use crate::server::{
    Gate, JSON, Reply, Server, answer, assert_yields, ball, send, steel_ball, yielding_ball,
};
use crate::store::raw;

pub const MASTER: &str = "the-key-from-the-settings";

pub async fn server(limits: Limits) -> Server {
    computing(Arc::new(Task::start), limits).await
}

pub async fn computing(begin: Begin, limits: Limits) -> Server {
    let access = Access { admin_key: Some(Secret(MASTER.into())), limits, ..Access::default() };
    let settings = Settings { access, ..Settings::default() };
    Server::with(begin, &settings, &Options::default()).await
}

/// Adds a key while the server runs.
pub async fn made(place: impl Into<Place>, name: &str, role: Role) -> String {
    made_with(
        place,
        NewKey { name: name.into(), role, per_minute: None, expires: None, private: false },
    )
    .await
}

pub async fn made_with(place: impl Into<Place>, new: NewKey) -> String {
    let mut administration = Administration::open(place.into()).await.unwrap();
    let key = administration.add_key(&new).await.unwrap();
    administration.close().await.unwrap();
    key
}

/// One request with a key.
pub async fn ask(server: &Server, key: &str, method: &str, target: &str, body: &str) -> Reply {
    let bearer = format!("Bearer {key}");
    let headers = [JSON, ("Authorization", bearer.as_str()), ("Prefer", "wait=60")];
    server.send(method, target, &headers, body).await
}

pub async fn get(server: &Server, key: &str, target: &str) -> Reply {
    ask(server, key, "GET", target, "").await
}

/// Every documented operation: its method, and its address with the id of no job or the key of no result.
fn operations() -> Vec<(String, String)> {
    operations_on("019aa0f3-1f4e-7cc0-9d8b-1c5b0c1f9a11", &"0".repeat(64))
}

/// Every documented operation on this job and this result.
pub fn operations_on(id: &str, key: &str) -> Vec<(String, String)> {
    let document: Value = serde_json::from_slice(http::DOCUMENT).unwrap();
    let mut operations = Vec::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        let target = path
            .replace("{key}", key)
            .replace("{id}", id)
            .replace("{name}", "steel-ball")
            .replace("{slug}", "not-found");
        assert!(!target.contains('{'), "{target}");
        for method in item.as_object().unwrap().keys() {
            operations.push((method.to_uppercase(), target.clone()));
        }
    }
    assert!(operations.len() >= 24, "{operations:?}");
    operations
}

#[tokio::test(flavor = "multi_thread")]
async fn every_route_except_those_without_data_requires_a_key() {
    let server = server(Limits::default()).await;
    let mut asked = operations();
    for page in ["/docs/api", "/docs/api/", "/docs/api/swagger-ui.css", "/nowhere", "/v1/jobs/"] {
        asked.push(("GET".into(), page.into()));
    }
    asked.push(("PATCH".into(), "/v1/jobs".into()));
    let asked = asked.into_iter().map(async |(method, target)| {
        let plain = server.send(&method, &target, &[JSON], "").await;
        let open = [
            "/healthz",
            "/readyz",
            "/openapi.json",
            "/v1/schema",
            "/v1/examples",
            "/problems",
            "/docs/",
        ];
        if open.iter().any(|open| target.starts_with(open)) {
            assert!([200, 303, 404].contains(&plain.status), "{target}: {}", plain.status);
            return;
        }
        plain.problem(401, "unauthorized");
        assert_eq!(plain.header("www-authenticate"), Some("Bearer realm=\"fretwork\""));
        let wrong = format!("fretwork_0a1b2c3d_{}", "0".repeat(40));
        for key in [wrong.as_str(), "nonsense", "", &MASTER[1..]] {
            let refused = ask(&server, key, &method, &target, "").await;
            refused.problem(401, "unauthorized");
            let scheme = refused.header("www-authenticate").unwrap();
            assert_eq!(
                scheme.ends_with("error=\"invalid_token\""),
                !key.is_empty(),
                "{key}: {scheme}"
            );
        }
        let known = ask(&server, MASTER, &method, &target, "").await;
        assert!(![401, 403].contains(&known.status), "{method} {target}: {}", known.status);
    });
    // Refusals of unknown keys wait for each other, so all routes are asked at once.
    join_all(asked).await;
    // Browsers show a login dialog for this header.
    let shown = server.send("GET", "/v1/jobs", &[("Accept", "text/html")], "").await;
    let ways = shown.headers.iter().filter(|(name, _)| name == "www-authenticate");
    assert_eq!((shown.status, ways.count()), (401, 2));
}

#[tokio::test(flavor = "multi_thread")]
async fn each_role_allows_only_its_own_operations() {
    let server = server(Limits::default()).await;
    let read = made(server.place(), "reader", Role::Read).await;
    let submit = made(server.place(), "worker", Role::Submit).await;
    let admin = made(server.place(), "chief", Role::Admin).await;
    for (method, target) in operations() {
        let needs = match (method.as_str(), target.split('/').nth(2).unwrap_or_default()) {
            ("GET", "audit") | (_, "keys") => Role::Admin,
            ("GET", _) | ("POST", "scenarios") | (_, "session") => Role::Read,
            ("POST", "results") if target.ends_with("/diff") => Role::Read,
            ("DELETE", "results") if target.ends_with(&"0".repeat(64)) => Role::Admin,
            _ => Role::Submit,
        };
        for (role, key) in [(Role::Read, &read), (Role::Submit, &submit), (Role::Admin, &admin)] {
            let reply = ask(&server, key, &method, &target, "").await;
            if role < needs {
                let problem = reply.problem(403, "forbidden");
                let detail = problem["detail"].as_str().unwrap();
                assert!(detail.contains(&format!("role {needs}")), "{detail}");
            } else {
                let (status, text) = (reply.status, String::from_utf8_lossy(&reply.body));
                assert!(![401, 403].contains(&status), "{role} {method} {target}: {text}");
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn private_jobs_are_hidden_and_results_are_shared() {
    let gate = Gate::default();
    let server = computing(gate.compute(), Limits::default()).await;
    let anna = made(server.place(), "anna", Role::Submit).await;
    let again = made(server.place(), "anna", Role::Submit).await;
    let ben = made(server.place(), "ben", Role::Submit).await;
    let bearer = format!("Bearer {anna}");
    let headers = [JSON, ("Authorization", bearer.as_str())];
    let mut body = ball(1.0);
    body["private"] = json!(true);
    let job = server.send("POST", "/v1/jobs", &headers, body.to_string()).await.json();
    let id = job["id"].as_str().unwrap();
    let (own, key) = (format!("/v1/jobs/{id}"), job["key"].as_str().unwrap());

    for (method, target) in [
        ("GET", own.clone()),
        ("GET", format!("{own}?include=scenario")),
        ("GET", format!("{own}/result")),
        ("GET", format!("{own}/events")),
        ("POST", format!("{own}/cancel")),
        ("DELETE", own.clone()),
    ] {
        ask(&server, &ben, method, &target, "").await.problem(404, "not-found");
    }
    ask(&server, &ben, "PATCH", &own, "{}").await.problem(404, "not-found");
    let listed = async |key: &str, filter: &str| {
        get(&server, key, &format!("/v1/jobs{filter}")).await.json()["jobs"]
            .as_array()
            .unwrap()
            .len()
    };
    assert_eq!(listed(&ben, "").await, 0);
    assert_eq!(listed(&ben, &format!("?key={key}")).await, 0);
    for key in [&anna, &again, MASTER] {
        assert_eq!(listed(key, "").await, 1);
    }
    for (owner, count) in [("me", 0), ("anna", 1), ("ben", 0), ("nobody", 0)] {
        assert_eq!(listed(MASTER, &format!("?owner={owner}")).await, count, "{owner}");
    }
    // An administrator sees the owner of a job. Other users see only their own private jobs.
    for key in [&anna, MASTER] {
        let told = get(&server, key, "/v1/jobs").await.json();
        assert_eq!(told["jobs"][0]["owner"], "anna", "{told}");
        assert_eq!(get(&server, key, &own).await.json()["owner"], "anna");
    }
    assert_eq!(listed(&anna, "?owner=anna").await, 1);
    assert_eq!(listed(&anna, "?owner=me").await, 1);
    assert_eq!(listed(&ben, "?owner=anna").await, 0);
    // Only its owner gets the address of the running job.
    let result = format!("/v1/results/{key}");
    let told = get(&server, &anna, &result).await;
    assert_eq!(told.header("link"), Some(format!("<{own}>; rel=\"related\"").as_str()));
    let told = get(&server, &ben, &result).await;
    assert_eq!((told.status, told.header("link")), (404, None));
    assert!(!told.text().contains(id), "{}", told.text());
    // After anna has shared it, ben sees and follows it, but cancels it neither by its id nor by a filter.
    let share = json!({"private": false}).to_string();
    assert_eq!(ask(&server, &anna, "PATCH", &own, &share).await.status, 200);
    assert_eq!((listed(&ben, "?owner=anna").await, listed(&ben, "?owner=me").await), (1, 0));
    let told = get(&server, &ben, &result).await;
    assert_eq!(told.header("link"), Some(format!("<{own}>; rel=\"related\"").as_str()));
    ask(&server, &ben, "POST", &format!("{own}/cancel"), "").await.problem(403, "other-owner");
    for filter in ["state=running", "owner=anna", "owner=me", "tag=example"] {
        let target = format!("/v1/jobs/cancel?{filter}");
        assert_eq!(ask(&server, &ben, "POST", &target, "").await.json(), json!({"canceled": 0}));
    }
    // A stream of events ends when anna hides the job again.
    let bearer = format!("Authorization: Bearer {ben}\r\n");
    let stream = followed_with(&server, &bearer, id).await;
    let hide = json!({"private": true}).to_string();
    assert_eq!(ask(&server, &anna, "PATCH", &own, &hide).await.status, 200);

    gate.open();
    assert!(!rest(stream).await.contains("succeeded"));
    let done = get(&server, &again, &format!("{own}?wait=60")).await.json();
    assert_eq!(done["state"], "succeeded", "{done}");
    assert_eq!(get(&server, &ben, &result).await.status, 200);
    let found = async |key: &str, owner: &str| {
        let found = get(&server, key, &format!("/v1/results?owner={owner}")).await.json();
        found["results"].as_array().unwrap().len()
    };
    assert_eq!(found(&anna, "me").await, found(&ben, "anna").await);
    assert_eq!((found(&anna, "me").await, found(&ben, "me").await), (1, 0));
    assert_eq!(get(&server, MASTER, &own).await.status, 200);
    assert_eq!(ask(&server, MASTER, "DELETE", &own, "").await.status, 204);
}

#[tokio::test(flavor = "multi_thread")]
async fn only_its_owner_or_an_administrator_removes_a_pin() {
    let server = server(Limits::default()).await;
    let anna = made(server.place(), "anna", Role::Submit).await;
    let ben = made(server.place(), "ben", Role::Submit).await;
    let job = ask(&server, &anna, "POST", "/v1/jobs", &steel_ball().to_string()).await.json();
    let result = job["links"]["result"].as_str().unwrap();
    let pin = format!("{result}/pin");
    let provenance = async || get(&server, &ben, &format!("{result}/provenance")).await.json();

    assert_eq!(ask(&server, &anna, "PUT", &pin, "").await.status, 204);
    assert_eq!(provenance().await["pinned_by"], "anna");
    // To pin it again changes nothing.
    assert_eq!(ask(&server, &ben, "PUT", &pin, "").await.status, 204);
    let problem = ask(&server, &ben, "DELETE", &pin, "").await.problem(403, "other-owner");
    assert!(problem["detail"].as_str().unwrap().contains("\"anna\""), "{problem}");
    assert_eq!(provenance().await["pinned_by"], "anna");
    let pinned = async |key: &str, owner: &str| {
        let list = get(&server, key, &format!("/v1/results?pinned_by={owner}")).await.json();
        list["results"].as_array().unwrap().len()
    };
    assert_eq!((pinned(&anna, "me").await, pinned(&ben, "me").await), (1, 0));
    assert_eq!(pinned(&ben, "anna").await, 1);

    assert_eq!(ask(&server, MASTER, "DELETE", &pin, "").await.status, 204);
    assert_eq!(provenance().await["pinned_by"], Value::Null);
    assert_eq!(ask(&server, &ben, "PUT", &pin, "").await.status, 204);
    assert_eq!(ask(&server, &ben, "DELETE", &pin, "").await.status, 204);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_pins_of_one_owner_have_a_quota() {
    let access = Access { admin_key: Some(Secret(MASTER.into())), ..Access::default() };
    let settings = Settings { access, ..Settings::default() };
    // A result of the steel ball takes about 60 kB.
    let options = Options { pin_quota: 100_000, ..Options::default() };
    let server = Server::with(Arc::new(Task::start), &settings, &options).await;
    let anna = made(server.place(), "anna", Role::Submit).await;
    let ben = made(server.place(), "ben", Role::Submit).await;
    let mut pins = Vec::new();
    for amplitude in [1.5, 2.0, 2.5] {
        let body = ball(amplitude).to_string();
        let job = ask(&server, &anna, "POST", "/v1/jobs", &body).await.json();
        pins.push(format!("{}/pin", job["links"]["result"].as_str().unwrap()));
    }
    let mut refused = None;
    for pin in &pins {
        let reply = ask(&server, &anna, "PUT", pin, "").await;
        if reply.status != 204 {
            let problem = reply.problem(409, "pin-quota");
            let detail = problem["detail"].as_str().unwrap();
            assert!(detail.contains("pinned_by=me"), "{detail}");
            refused = Some(pin);
            break;
        }
    }
    let refused = refused.expect("the quota is less than three results");
    // Other owners have their own quotas. Removing a pin frees a part of the quota.
    assert_eq!(ask(&server, &ben, "PUT", refused, "").await.status, 204);
    assert_eq!(ask(&server, &ben, "DELETE", refused, "").await.status, 204);
    assert_eq!(ask(&server, &anna, "DELETE", &pins[0], "").await.status, 204);
    assert_eq!(ask(&server, &anna, "PUT", refused, "").await.status, 204);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_pins_of_all_owners_leave_half_of_the_space_for_new_results() {
    let access = Access { admin_key: Some(Secret(MASTER.into())), ..Access::default() };
    let settings = Settings { access, ..Settings::default() };
    let options = Options { budget: Some(2_000_000), ..Options::default() };
    let server = Server::with(Arc::new(Task::start), &settings, &options).await;
    let mut last = None;
    for (name, amplitude) in [("anna", 1.5), ("ben", 2.0)] {
        let key = made(server.place(), name, Role::Submit).await;
        let mut body = ball(amplitude);
        // Each result takes about 0.6 MB, and all results may take 1 MB.
        body["scenario"]["model"]["points"] = json!(4096);
        let job = ask(&server, &key, "POST", "/v1/jobs", &body.to_string()).await.json();
        let pin = format!("{}/pin", job["links"]["result"].as_str().unwrap());
        last = Some(ask(&server, &key, "PUT", &pin, "").await);
    }
    let problem = last.unwrap().problem(409, "pin-quota");
    assert!(problem["detail"].as_str().unwrap().contains("--keep-results"), "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_running_server_applies_new_and_revoked_keys() {
    let server = Server::start().await;
    assert_eq!(server.get("/v1/jobs").await.status, 200);
    let key = made(server.place(), "anna", Role::Read).await;
    let until = async |status: u16, key: &str| {
        eventually(async || get(&server, key, "/v1/jobs").await.status == status).await;
    };
    until(401, "").await;
    until(200, &key).await;
    // A new key is valid at once, before the server reads the keys again.
    let second = made(server.place(), "ben", Role::Read).await;
    assert_eq!(get(&server, &second, "/v1/jobs").await.status, 200);

    let mut administration = Administration::open(server.place()).await.unwrap();
    assert_eq!(administration.revoke_keys("anna").await.unwrap(), 1);
    assert_eq!(administration.revoke_keys("anna").await.unwrap(), 0);
    until(401, &key).await;
    let refused = get(&server, &key, "/v1/jobs").await.problem(401, "unauthorized");
    assert!(refused["detail"].as_str().unwrap().contains("revoked"), "{refused}");
    // Revoking the last key does not open the server.
    let id = administration.keys().await.unwrap()[1].id.clone();
    assert_eq!(administration.revoke_keys(&id).await.unwrap(), 1);
    until(401, &second).await;
    until(401, "").await;

    let past = NewKey {
        name: "c".into(),
        role: Role::Read,
        per_minute: None,
        expires: Some(1000),
        private: false,
    };
    let late = made_with(server.place(), past).await;
    let refused = get(&server, &late, "/v1/jobs").await.problem(401, "unauthorized");
    assert!(refused["detail"].as_str().unwrap().contains("1970-01-01"), "{refused}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_caller_can_read_its_own_name_and_role() {
    let [per_minute, evaluations, at_once] = [100, 20, 7].map(NonZeroU32::new);
    let limits = Limits { per_minute, evaluations, at_once };
    let server = server(limits).await;
    let new = NewKey {
        name: "anna".into(),
        role: Role::Submit,
        per_minute: Some(50),
        expires: None,
        private: false,
    };
    let anna = made_with(server.place(), new).await;
    let me = get(&server, &anna, "/v1/me").await.json();
    assert_eq!((&me["name"], &me["role"]), (&json!("anna"), &json!("submit")));
    assert_eq!(me["key"], anna.split('_').nth(1).unwrap());
    let expected =
        json!({"requests_per_minute": 50, "evaluations_per_minute": 20, "requests_at_once": 7});
    assert_eq!(me["limits"], expected);
    assert_eq!(me["usage"], json!({"requests_left": 49, "jobs_queued": 0, "jobs_running": 0}));
    let master = get(&server, MASTER, "/v1/me").await.json();
    assert_eq!((&master["name"], &master["role"]), (&json!("admin"), &json!("admin")));
    assert_eq!(master["limits"]["requests_per_minute"], 100);

    let open = Server::start().await.get("/v1/me").await.json();
    assert_eq!((&open["name"], &open["key"]), (&json!("127.0.0.1"), &Value::Null));
    assert_eq!(open["limits"]["requests_per_minute"], Value::Null);
}

/// A server with keys and one result: the server, a key that can share the result, and its address.
async fn shared() -> (Server, String, String) {
    let server = server(Limits::default()).await;
    let key = made(server.place(), "anna", Role::Submit).await;
    let job = ask(&server, &key, "POST", "/v1/jobs", &steel_ball().to_string()).await.json();
    let result = job["links"]["result"].as_str().unwrap().to_owned();
    (server, key, result)
}

/// The `link=…` of a new link.
pub async fn link(server: &Server, key: &str, result: &str, query: &str) -> String {
    let reply = ask(server, key, "POST", &format!("{result}/links{query}"), "").await;
    assert_eq!(reply.status, 201, "{}", reply.text());
    let url = reply.json()["url"].as_str().unwrap().to_owned();
    assert_eq!(reply.header("location"), Some(&*url));
    url.strip_prefix(&format!("{result}?")).unwrap().to_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_link_gives_read_access_to_one_result() {
    let (server, key, result) = shared().await;
    let link = link(&server, &key, &result, "").await;
    let whole = server.get(&format!("{result}?{link}")).await;
    assert_eq!(whole.body, get(&server, &key, &result).await.body);
    let caching = whole.header("cache-control").unwrap();
    assert!(caching.starts_with("private, max-age=604"), "{caching}");
    let csv = server.get(&format!("{result}/history?format=csv&{link}")).await;
    assert!(csv.text().contains("wear_volume[m^3]"));
    for part in ["/profiles", "/loops", "/history/smooth"] {
        assert_eq!(server.get(&format!("{result}{part}?{link}")).await.status, 200);
    }
    // An invalid parameter is reported as 422, and not as a bad link.
    server.get(&format!("{result}?{link}&digits=none")).await.problem(422, "invalid-parameters");

    let job = ball(1.0).to_string();
    let other = ask(&server, &key, "POST", "/v1/jobs", &job).await.json();
    let other = other["links"]["result"].as_str().unwrap().to_owned();
    for (method, target) in [
        ("GET", other),
        ("GET", "/v1/jobs".to_owned()),
        ("GET", "/v1/me".to_owned()),
        ("PUT", format!("{result}/pin")),
        ("POST", format!("{result}/links")),
    ] {
        let reply = server.send(method, &format!("{target}?{link}"), &[JSON], "").await;
        reply.problem(403, "bad-link");
    }
    let nobody = format!("/v1/results/{}/links", "0".repeat(64));
    ask(&server, &key, "POST", &nobody, "").await.problem(404, "unknown-result");
    for bad in ["0s", "367d", "soon"] {
        let target = format!("{result}/links?expires_in={bad}");
        ask(&server, &key, "POST", &target, "").await.problem(422, "invalid-parameters");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_link_opens_the_warnings_about_the_bodies_but_not_the_provenance() {
    let server = server(Limits::default()).await;
    let key = made(server.place(), "anna", Role::Submit).await;
    let job = ask(&server, &key, "POST", "/v1/jobs", &yielding_ball().to_string()).await.json();
    let result = job["links"]["result"].as_str().unwrap();
    let link = link(&server, &key, result, "").await;
    let warnings = server.get(&format!("{result}/warnings?{link}")).await;
    assert_eq!(warnings.header("cache-control"), Some("no-store"));
    assert_yields(&warnings.json()["warnings"]);
    // A link does not open the provenance, because it names people and machines.
    server.get(&format!("{result}/provenance?{link}")).await.problem(403, "bad-link");
    server.get(&format!("{result}/warnings")).await.problem(401, "unauthorized");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_changed_or_expired_link_is_refused() {
    let (server, key, result) = shared().await;
    let link_ = link(&server, &key, &result, "?expires_in=2d").await;
    let (expires, rest) = link_["link=".len()..].split_once('.').unwrap();
    let later: u64 = expires.parse::<u64>().unwrap() + 1;
    let mut flipped = link_.clone();
    flipped.replace_range(link_.len() - 1.., if link_.ends_with('0') { "1" } else { "0" });
    for bad in [format!("link={later}.{rest}"), flipped, "link=".into(), "link=1.2.3".into()] {
        server.get(&format!("{result}?{bad}")).await.problem(403, "bad-link");
    }
    let short = link(&server, &key, &result, "?expires_in=1s").await;
    let short = format!("{result}?{short}");
    eventually(async || server.get(&short).await.status == 403).await;
    let problem = server.get(&short).await.problem(403, "bad-link");
    assert!(problem["detail"].as_str().unwrap().contains("expired on"), "{problem}");
    // Revoking the key that made the link revokes the link.
    assert_eq!(server.get(&format!("{result}?{link_}")).await.status, 200);
    Administration::open(server.place()).await.unwrap().revoke_keys("anna").await.unwrap();
    eventually(async || server.get(&format!("{result}?{link_}")).await.status == 403).await;
}

/// Opens the event stream of a job and reads its first event.
async fn followed(server: &Server, key: Option<&str>, id: &str) -> TcpStream {
    let bearer = key.map_or_else(String::new, |key| format!("Authorization: Bearer {key}\r\n"));
    followed_with(server, &bearer, id).await
}

/// The same with a line of the head that identifies the caller.
pub async fn followed_with(server: &Server, line: &str, id: &str) -> TcpStream {
    let mut stream = TcpStream::connect(server.address).await.unwrap();
    let head = "HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n";
    let ask = format!("GET /v1/jobs/{id}/events {head}{line}\r\n");
    stream.write_all(ask.as_bytes()).await.unwrap();
    let (mut text, mut buffer) = (String::new(), [0; 4096]);
    while !text.contains("event: snapshot") {
        let length = stream.read(&mut buffer).await.unwrap();
        assert!(length > 0, "{text}");
        text.push_str(std::str::from_utf8(&buffer[..length]).unwrap());
    }
    stream
}

/// Reads the rest of an event stream. It must end, with the last chunk of a complete answer.
pub async fn rest(mut stream: TcpStream) -> String {
    let mut text = String::new();
    let read = stream.read_to_string(&mut text);
    tokio::time::timeout(PATIENCE, read).await.expect("it goes on").unwrap();
    // The stream may have ended before its next event.
    assert!(format!("\r\n{text}").ends_with("\r\n0\r\n\r\n"), "{text}");
    text
}

#[tokio::test(flavor = "multi_thread")]
async fn an_event_stream_ends_when_its_key_is_revoked_or_expires() {
    let gate = Gate::default();
    let access = Access { admin_key: Some(Secret(MASTER.into())), ..Access::default() };
    let settings = Settings { access, ..Settings::default() };
    let server = Server::with(gate.compute(), &settings, &Options::default()).await;
    let mut keys = Vec::new();
    for _ in 0..3 {
        keys.push(made(server.place(), "anna", Role::Submit).await);
    }
    let bearer = format!("Bearer {}", keys[0]);
    let headers = [JSON, ("Authorization", bearer.as_str())];
    let job = server.send("POST", "/v1/jobs", &headers, ball(1.0).to_string()).await.json();
    let id = job["id"].as_str().unwrap();
    let revoked = followed(&server, Some(&keys[0]), id).await;
    let expired = followed(&server, Some(&keys[1]), id).await;
    let good = followed(&server, Some(&keys[2]), id).await;
    let master = followed(&server, Some(MASTER), id).await;
    let named = |key: &str| key.split('_').nth(1).unwrap().to_owned();
    let mut administration = Administration::open(server.place()).await.unwrap();
    assert_eq!(administration.revoke_keys(&named(&keys[0])).await.unwrap(), 1);
    // The key has expired.
    sqlx::query("UPDATE access_key SET expires = created + 1 WHERE id = ?1")
        .bind(named(&keys[1]))
        .execute(&mut raw(server.dir.path()).await)
        .await
        .unwrap();
    for (stream, key) in [(revoked, &keys[0]), (expired, &keys[1])] {
        assert!(!rest(stream).await.contains("succeeded"));
        get(&server, key, &format!("/v1/jobs/{id}/events")).await.problem(401, "unauthorized");
    }
    gate.open();
    for stream in [good, master] {
        assert!(rest(stream).await.contains("\"state\":\"succeeded\""));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_event_stream_without_a_key_ends_when_the_first_key_is_added() {
    let gate = Gate::default();
    let server = Server::computing(gate.compute(), &Origins::Own).await;
    let job = server.post("/v1/jobs", &ball(1.0)).await.json();
    let id = job["id"].as_str().unwrap();
    let stream = followed(&server, None, id).await;
    made(server.place(), "anna", Role::Read).await;
    assert!(!rest(stream).await.contains("succeeded"));
    server.get(&format!("/v1/jobs/{id}/events")).await.problem(401, "unauthorized");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_revoked_during_a_wait_does_not_receive_the_result() {
    let gate = Gate::default();
    let access = Access { admin_key: Some(Secret(MASTER.into())), ..Access::default() };
    let settings = Settings { access, ..Settings::default() };
    let server = Server::with(gate.compute(), &settings, &Options::default()).await;
    let anna = made(server.place(), "anna", Role::Submit).await;
    let job = ball(1.0).to_string();
    let (waited, ()) = tokio::join!(ask(&server, &anna, "POST", "/v1/jobs", &job), async {
        eventually(async || get(&server, MASTER, "/v1/jobs").await.json()["jobs"] != json!([]))
            .await;
        Administration::open(server.place()).await.unwrap().revoke_keys("anna").await.unwrap();
        // A revoked key may still be accepted for this time.
        tokio::time::sleep(Duration::from_millis(1100)).await;
        gate.open();
    });
    let problem = waited.problem(401, "unauthorized");
    assert!(problem["detail"].as_str().unwrap().contains("revoked"), "{problem}");
}

fn number(reply: &Reply, header: &str, name: &str) -> u32 {
    let text = reply.header(header).unwrap_or_else(|| panic!("no {header} in {}", reply.status));
    let found = text.split(';').find_map(|part| part.strip_prefix(name)?.strip_prefix('='));
    found.unwrap_or_else(|| panic!("no {name} in {text}")).parse().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_rate_limited_key_gets_retry_after_and_other_keys_are_unaffected() {
    let server = server(Limits { per_minute: NonZeroU32::new(6000), ..Limits::default() }).await;
    // The limit allows one more request per second.
    let new = NewKey {
        name: "anna".into(),
        role: Role::Submit,
        per_minute: Some(60),
        expires: None,
        private: false,
    };
    let anna = made_with(server.place(), new).await;
    let ben = made(server.place(), "ben", Role::Read).await;
    let first = get(&server, &anna, "/version").await;
    assert_eq!(number(&first, "ratelimit-policy", "q"), 60);
    assert_eq!(number(&first, "ratelimit-policy", "w"), 60);
    let left = number(&first, "ratelimit", "r");
    assert_eq!((left, number(&first, "ratelimit", "t")), (59, 1));
    // The key can send the reported number of remaining requests, plus one for each second that passes. `t` is always
    // the time in s until the next request is allowed.
    for _ in 0..left {
        let reply = get(&server, &anna, "/version").await;
        assert_eq!((reply.status, number(&reply, "ratelimit", "t")), (200, 1));
    }
    let mut refused = get(&server, &anna, "/version").await;
    while refused.status == 200 {
        refused = get(&server, &anna, "/version").await;
    }
    refused.problem(429, "rate-limited");
    let wait: u32 = refused.header("retry-after").unwrap().parse().unwrap();
    assert_eq!((wait, number(&refused, "ratelimit", "r")), (1, 0));
    assert_eq!(number(&refused, "ratelimit", "t"), wait);
    // The rate limit never refuses a cancellation.
    let cancel = ask(&server, &anna, "POST", "/v1/jobs/cancel?owner=me", "").await;
    assert_eq!((cancel.json(), cancel.header("ratelimit")), (json!({"canceled": 0}), None));
    for _ in 0..5 {
        let reply = get(&server, &ben, "/version").await;
        assert_eq!((reply.status, number(&reply, "ratelimit-policy", "q")), (200, 6000));
    }
    tokio::time::sleep(Duration::from_secs(wait.into())).await;
    assert_eq!(get(&server, &anna, "/version").await.status, 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_has_a_limited_number_of_concurrent_requests() {
    let gate = Gate::default();
    let limits = Limits { at_once: NonZeroU32::new(2), ..Limits::default() };
    let access = Access { admin_key: Some(Secret(MASTER.into())), limits, ..Access::default() };
    let settings = Settings { access, ..Settings::default() };
    let server = Server::with(gate.compute(), &settings, &Options::default()).await;
    let anna = made(server.place(), "anna", Role::Submit).await;
    // The requests of the loop below count too, so a submission can be refused at first.
    let waiting = async || loop {
        let answer = ask(&server, &anna, "POST", "/v1/jobs", &ball(1.0).to_string()).await;
        if answer.status != 429 {
            return answer;
        }
    };
    let (one, two, ()) = tokio::join!(waiting(), waiting(), async {
        let refused = tokio::time::timeout(PATIENCE, async {
            loop {
                let reply = get(&server, &anna, "/version").await;
                if reply.status == 429 {
                    break reply;
                }
            }
        });
        let refused = refused.await.expect("the server refuses a third request");
        let problem = refused.problem(429, "too-many-at-once");
        let detail = problem["detail"].as_str().unwrap();
        assert!(detail.contains("limit of 2 concurrent requests"), "{detail}");
        // The server cannot tell when another request will end, so it names no time.
        assert_eq!(refused.header("retry-after"), None);
        assert_eq!(refused.header("ratelimit"), Some("\"at-once\";r=0"));
        let policy = "\"at-once\";q=2;qu=\"concurrent-requests\"";
        assert_eq!(refused.header("ratelimit-policy"), Some(policy));
        assert_eq!(get(&server, MASTER, "/version").await.status, 200);
        gate.open();
    });
    assert_eq!((one.status, two.status), (200, 200));
    assert_eq!(get(&server, &anna, "/version").await.status, 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn forbidden_requests_count_towards_the_rate_limit() {
    let server = server(Limits { per_minute: NonZeroU32::new(60), ..Limits::default() }).await;
    let read = made(server.place(), "reader", Role::Read).await;
    let refused = ask(&server, &read, "POST", "/v1/jobs", "{}").await;
    refused.problem(403, "forbidden");
    assert_eq!(number(&refused, "ratelimit", "r"), 59);
    assert_eq!(number(&refused, "ratelimit-policy", "q"), 60);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_connection_stays_usable_after_a_refusal_by_access_control() {
    let server = server(Limits::default()).await;
    let read = made(server.place(), "reader", Role::Read).await;
    let once = NewKey {
        name: "s".into(),
        role: Role::Submit,
        per_minute: Some(1),
        expires: None,
        private: false,
    };
    let once = made_with(server.place(), once).await;
    assert_eq!(get(&server, &once, "/version").await.status, 200);
    for (key, status) in [("nonsense", 401), (&*read, 403), (&*once, 429)] {
        let mut connection = TcpStream::connect(server.address).await.unwrap();
        for _ in 0..2 {
            let head = format!(
                "POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {key}\r\n\
                 Content-Type: application/json\r\nContent-Length: 200000\r\n\r\n"
            );
            connection.write_all(head.as_bytes()).await.unwrap();
            let refused = answer(&mut connection).await.unwrap();
            assert_eq!((refused.status, refused.header("connection")), (status, None));
            connection.write_all(&vec![b' '; 200_000]).await.unwrap();
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_of_an_allowed_origin_can_send_a_key() {
    let site = "https://lab.example";
    let access = Access { admin_key: Some(Secret(MASTER.into())), ..Access::default() };
    let origins = Origins::These(vec![axum::http::HeaderValue::from_static(site)]);
    let settings = Settings { access, origins, ..Settings::default() };
    let server = Server::with(Arc::new(Task::start), &settings, &Options::default()).await;
    let asked = [
        ("Origin", site),
        ("Access-Control-Request-Method", "POST"),
        ("Access-Control-Request-Headers", "authorization,content-type"),
    ];
    let reply = server.send("OPTIONS", "/v1/jobs", &asked, "").await;
    assert_eq!(reply.header("access-control-allow-origin"), Some(site));
    assert_eq!(reply.header("access-control-allow-headers"), Some("authorization,content-type"));
    // The page can read the problem too.
    let refused = server.send("GET", "/v1/jobs", &[("Origin", site)], "").await;
    refused.problem(401, "unauthorized");
    assert_eq!(refused.header("access-control-allow-origin"), Some(site));
    for (name, value) in [
        ("x-content-type-options", "nosniff"),
        ("x-frame-options", "DENY"),
        ("referrer-policy", "no-referrer"),
    ] {
        assert_eq!(refused.header(name), Some(value));
    }
    assert!(refused.header("content-security-policy").unwrap().contains("default-src 'none'"));
}

#[tokio::test(flavor = "multi_thread")]
async fn links_have_their_own_rate_limit() {
    let server = server(Limits { per_minute: NonZeroU32::new(6000), ..Limits::default() }).await;
    let new = NewKey {
        name: "anna".into(),
        role: Role::Submit,
        per_minute: Some(20),
        expires: None,
        private: false,
    };
    let anna = made_with(server.place(), new).await;
    let job = ask(&server, &anna, "POST", "/v1/jobs", &steel_ball().to_string()).await.json();
    let result = job["links"]["result"].as_str().unwrap();
    let link = link(&server, &anna, result, "").await;
    let address = format!("{result}/history?{link}");
    let mut opened = 0;
    loop {
        let reply = server.get(&address).await;
        assert_eq!(reply.header("ratelimit").is_some(), reply.status == 429);
        if reply.status == 429 {
            break;
        }
        assert_eq!(reply.status, 200);
        opened += 1;
        assert!(opened < 40, "no end");
    }
    assert!(opened >= 20);
    assert_eq!(get(&server, &anna, "/v1/me").await.status, 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_without_keys_refuses_pages_of_other_origins() {
    let server = Server::start().await;
    let asked = async |host: &str, method: &str, headers: &[(&str, &str)]| {
        let target = if method == "GET" { "/v1/jobs" } else { "/v1/jobs/cancel?owner=me" };
        let mut head =
            format!("{method} {target} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n");
        for (name, value) in headers {
            write!(head, "{name}: {value}\r\n").unwrap();
        }
        let mut connection = TcpStream::connect(server.address).await.unwrap();
        connection.write_all(format!("{head}Content-Length: 0\r\n\r\n").as_bytes()).await.unwrap();
        let mut answer = String::new();
        connection.read_to_string(&mut answer).await.unwrap();
        answer.split(' ').nth(1).unwrap().parse::<u16>().unwrap()
    };
    for own in ["localhost", "localhost:8080", "127.0.0.1:8080", "[::1]:8080", "me.localhost"] {
        assert_eq!(asked(own, "GET", &[]).await, 200, "{own}");
    }
    for foreign in [
        "evil.example",
        "localhost.evil.example",
        "127.0.0.1.evil.example:8080",
        "evil.example:localhost",
        "localhost@evil.example",
        "[::1]evil.example",
        "[localhost]",
        "x%.localhost",
        "\u{e9}.localhost",
    ] {
        assert_eq!(asked(foreign, "GET", &[]).await, 421, "{foreign}");
    }
    let own = "localhost:8080";
    for (status, headers) in [
        (200, &[][..]),
        (200, &[("Origin", "http://localhost:8080")]),
        (200, &[("Origin", "http://other:1"), ("Sec-Fetch-Site", "same-origin")]),
        (403, &[("Origin", "http://evil.example")]),
        (403, &[("Origin", "http://localhost:3000"), ("Sec-Fetch-Site", "same-site")]),
        (403, &[("Origin", "null")]),
        (403, &[("Sec-Fetch-Site", "cross-site")]),
    ] {
        assert_eq!(asked(own, "POST", headers).await, status, "{headers:?}");
    }
}

#[cfg(unix)]
#[test]
fn files_in_the_data_directory_are_readable_by_their_owner_only() {
    use std::os::unix::fs::PermissionsExt as _;
    let dir = TempDir::new().unwrap();
    let data = dir.path().join("data");
    let backup = dir.path().join("backup.db");
    let options = ["--data-dir", data.to_str().unwrap()];
    assert!(
        run(&[&["keys", "add", "anna", "--role", "read"][..], &options].concat(), "")
            .status
            .success()
    );
    let words = ["backup", backup.to_str().unwrap()];
    assert!(run(&[&words[..], &options].concat(), "").status.success());
    let files = std::fs::read_dir(&data).unwrap().map(|file| file.unwrap().path());
    let all: Vec<_> = files.chain([data.clone(), backup]).collect();
    assert!(all.len() >= 4, "{all:?}");
    for path in all {
        let mode = std::fs::metadata(&path).unwrap().permissions().mode();
        assert_eq!(mode & 0o077, 0, "{} is {mode:o}", path.display());
    }
}

#[test]
fn a_bad_admin_key_is_refused_without_printing_it() {
    let dir = TempDir::new().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_fretwork"));
    command.args(["--listen", "127.0.0.1:0", "--data-dir"]).arg(dir.path());
    let bad = "correct horse battery staple";
    let output = command.env("FRETWORK_ADMIN_KEY", bad).output().unwrap();
    fails(&output, "FRETWORK_ADMIN_KEY must have");
    assert!(!String::from_utf8_lossy(&output.stderr).contains("horse"));
    // Other commands ignore the admin key.
    let mut listed = Command::new(env!("CARGO_BIN_EXE_fretwork"));
    let output =
        listed.arg("verify").arg("--help").env("FRETWORK_ADMIN_KEY", bad).output().unwrap();
    assert!(output.status.success());
}

/// Starts a server that other machines can reach. Returns what it prints until it has printed its address.
fn serve_openly(data: &Path, options: &[&str]) -> (Running, String) {
    serve_at("0.0.0.0:0", data, options)
}

fn serve_at(listen: &str, data: &Path, options: &[&str]) -> (Running, String) {
    let mut server = Command::new(env!("CARGO_BIN_EXE_fretwork"));
    server.args(["--listen", listen, "--data-dir"]).arg(data).args(options);
    let mut server =
        Running(server.env("FRETWORK_LOG", "off").stdout(Stdio::piped()).spawn().unwrap());
    let mut said = String::new();
    let mut lines = BufReader::new(server.stdout.as_mut().unwrap());
    while !said.contains(" listens on ") {
        assert!(lines.read_line(&mut said).unwrap() > 0, "{said}");
    }
    (server, said)
}

#[tokio::test]
async fn a_server_that_other_machines_can_reach_prints_the_first_key_once() {
    let dir = TempDir::new().unwrap();
    let (first, said) = serve_openly(dir.path(), &[]);
    let key = said.lines().map(str::trim).find(|line| line.starts_with("fretwork_")).unwrap();
    let address = said.trim().rsplit("//").next().unwrap().parse().unwrap();
    let me = async |headers: &[(&str, &str)]| send(address, "GET", "/v1/me", headers, "").await;
    me(&[]).await.unwrap().problem(401, "unauthorized");
    let bearer = format!("Bearer {key}");
    let caller = me(&[("Authorization", &bearer)]).await.unwrap().json();
    assert_eq!((&caller["name"], &caller["role"]), (&json!("first"), &json!("admin")));
    drop(first);
    let (_second, said) = serve_openly(dir.path(), &[]);
    assert!(!said.contains("fretwork_"), "{said}");
}

#[test]
fn a_server_behind_a_proxy_makes_a_first_key_unless_the_proxy_signs_users_on() {
    let says_key = |options: &[&str]| {
        let dir = TempDir::new().unwrap();
        let (_server, said) = serve_at("127.0.0.1:0", dir.path(), options);
        said.contains("fretwork_")
    };
    let proxy = ["--trusted-proxy", "127.0.0.1"];
    let sign_on = ["--auth-header", "X-User", "--auth-role", "read", "--auth-secret", MASTER];
    assert!(!says_key(&[]));
    assert!(says_key(&proxy), "the clients of a proxy are on other machines");
    assert!(!says_key(&[&proxy[..], &sign_on].concat()));
    assert!(!says_key(&[&proxy[..], &["--no-auth"]].concat()));
}

#[test]
fn a_first_key_that_cannot_be_printed_is_revoked() {
    let dir = TempDir::new().unwrap();
    let mut server = Command::new(env!("CARGO_BIN_EXE_fretwork"));
    server.args(["--listen", "0.0.0.0:0", "--log", "off", "--data-dir"]).arg(dir.path());
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    fails(&server.stdout(full).stderr(Stdio::piped()).output().unwrap(), "fretwork keys add");
    let listed = run(&["keys", "list", "--data-dir", dir.path().to_str().unwrap()], "");
    let listed = String::from_utf8(listed.stdout).unwrap();
    assert!(listed.lines().nth(1).unwrap().contains("revoked 20"), "{listed}");
}

#[tokio::test]
async fn the_key_of_the_administrator_can_be_in_a_file() {
    let dir = TempDir::new().unwrap();
    let (data, file) = (dir.path().join("data"), dir.path().join("key"));
    std::fs::write(&file, format!("{MASTER}\n")).unwrap();
    let options = ["--admin-key-file", file.to_str().unwrap()];
    let (_server, said) = serve_openly(&data, &options);
    assert!(!said.contains("fretwork_"), "{said}");
    let address = said.trim().rsplit("//").next().unwrap().parse().unwrap();
    let bearer = format!("Bearer {MASTER}");
    let caller = send(address, "GET", "/v1/me", &[("Authorization", &bearer)], "").await.unwrap();
    assert_eq!(caller.json()["role"], "admin");
    std::fs::write(&file, "too short\n").unwrap();
    fails(&run(&options, ""), "must have at least 20");
    fails(&run(&["--admin-key-file", "/nowhere/key"], ""), "cannot read the key in /nowhere/key");
    fails(&run(&["--admin-key-file", "/dev/zero"], ""), "the key in /dev/zero must have");
}

#[test]
fn a_server_without_keys_that_allows_all_origins_warns_at_the_start() {
    let dir = TempDir::new().unwrap();
    let log = dir.path().join("log");
    let warned = |origin: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_fretwork"));
        command.args(["--cors-origin", origin, "--log", "warn"]);
        command.stderr(std::fs::File::create(&log).unwrap());
        drop(serve_by(command, &dir.path().join("data")));
        let said = std::fs::read_to_string(&log).unwrap();
        said.contains("every web page that a user of this machine opens")
    };
    assert!(warned("*"));
    assert!(!warned("https://example.org"));
}

#[test]
fn the_keys_command_adds_lists_and_revokes_keys() {
    let dir = TempDir::new().unwrap();
    let data = dir.path().to_str().unwrap();
    let keys = |words: &[&str]| run(&[&["keys"], words, &["--data-dir", data]].concat(), "");
    let out = |words: &[&str]| String::from_utf8(keys(words).stdout).unwrap();
    let key = out(&["add", "anna", "--role", "submit", "--rate", "600"]);
    out(&["add", "guest", "--role", "read", "--expires", "30d"]);
    let (id, listed) = (key.split('_').nth(1).unwrap(), out(&["list"]));
    let lines: Vec<&str> = listed.lines().collect();
    assert_eq!(lines.len(), 3, "{listed}");
    assert!(lines[1].starts_with(id) && lines[1].contains("600/min"), "{listed}");
    assert!(lines[1].ends_with("valid") && lines[2].contains("until 20"), "{listed}");
    assert!(!listed.contains(key.trim().rsplit('_').next().unwrap()));
    assert_eq!(out(&["revoke", id]), "1 key revoked\n");
    assert!(out(&["list"]).lines().nth(1).unwrap().contains("revoked 20"));
    fails(&keys(&["revoke", id]), "no valid access key");
    let nowhere = dir.path().join("nowhere");
    let nowhere = nowhere.to_str().unwrap();
    fails(&run(&["keys", "list", "--data-dir", nowhere], ""), "contains no database");
    assert!(!Path::new(nowhere).exists());
    for bad in [
        &["add", "a b", "--role", "read"][..],
        &["add", "127.0.0.1", "--role", "read"],
        &["add", "anna", "--role", "king"],
        &["add", "admin", "--role", "read"],
        &["add", "me", "--role", "read"],
        &["add", "0a1b2c3d", "--role", "read"],
        &["add", "anna", "--role", "read", "--expires", "0"],
        &["add", "anna", "--role", "read", "--expires", "9000years"],
        &["add", "anna"],
    ] {
        assert_eq!(keys(bad).status.code(), Some(2));
    }
}

/// Sends secrets in all parts of requests, then searches logs, answers and files for them.
#[test]
fn secrets_do_not_appear_in_logs_answers_or_files() {
    let dir = TempDir::new().unwrap();
    let data = dir.path().join("data");
    let made =
        run(&["keys", "add", "anna", "--role", "submit", "--data-dir", data.to_str().unwrap()], "");
    let key = String::from_utf8(made.stdout).unwrap().trim().to_owned();
    let secret = key.rsplit('_').next().unwrap();
    assert!(!String::from_utf8_lossy(&made.stderr).contains(secret));

    let log = dir.path().join("log");
    // The helper `fretwork` switches the log off. This test reads the log, so it starts the program itself.
    let mut command = Command::new("sh");
    let program = env!("CARGO_BIN_EXE_fretwork");
    let script = format!("FRETWORK_LOG=trace exec '{program}' \"$@\" 2>'{}'", log.display());
    command.args(["-c", &script, "fretwork"]).env("FRETWORK_ADMIN_KEY", MASTER);
    let (mut server, address) = serve_by(command, &data);

    let mut seen = String::new();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let address = address.strip_prefix("http://").unwrap().parse().unwrap();
        let send = async |authorization: String, target: &str, body: &str| {
            let headers = [JSON, ("Authorization", authorization.as_str()), ("Prefer", "wait=60")];
            let method = if body.is_empty() { "GET" } else { "POST" };
            let reply = crate::server::send(address, method, target, &headers, body).await.unwrap();
            String::from_utf8_lossy(&reply.body).into_owned() + &format!("{:?}", reply.headers)
        };
        let ball = steel_ball().to_string();
        for good in [key.as_str(), MASTER] {
            seen += &send(format!("Bearer {good}"), "/v1/jobs", &ball).await;
            for target in ["/v1/me", "/v1/jobs", "/v1/nowhere", "/metrics", "/v1/jobs?key=x"] {
                seen += &send(format!("Bearer {good}"), target, "").await;
                // A key in the wrong place is refused, and the answer does not repeat it.
                seen += &send(format!("Bearer {good}x"), target, "").await;
                seen += &send(format!("Basic {good}"), target, "").await;
                seen += &send(good.to_owned(), target, "").await;
            }
        }
    });
    assert!(seen.contains("succeeded") && seen.contains("unauthorized"));
    server.kill().unwrap();
    server.wait().unwrap();

    let mut places = vec![("answers".to_owned(), seen.into_bytes())];
    let files = std::fs::read_dir(&data).unwrap().map(|file| file.unwrap().path());
    for file in files.chain([log]) {
        places.push((file.display().to_string(), std::fs::read(&file).unwrap()));
    }
    assert!(places.iter().any(|(name, text)| name.ends_with("log") && text.len() > 1000));
    for (name, text) in places {
        for secret in [secret, MASTER] {
            let found = text.windows(secret.len()).any(|window| window == secret.as_bytes());
            assert!(!found, "a secret is in {name}");
        }
    }
    let mut shown = Command::new(program);
    let shown = shown.arg("--print-config").env("FRETWORK_ADMIN_KEY", MASTER).output().unwrap();
    let shown = String::from_utf8(shown.stdout).unwrap();
    assert!(shown.contains("FRETWORK_ADMIN_KEY") && !shown.contains(MASTER), "{shown}");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_dashboard_is_public_and_contains_no_data() {
    let server = server(Limits::default()).await;
    let page = server.get("/").await;
    // The page does not depend on the data of the server.
    assert_eq!(page.text(), include_str!("../../src/http/dashboard/index.html"));
    let policy = page.header("content-security-policy").unwrap();
    assert!(policy.contains("default-src 'none'") && !policy.contains("unsafe"), "{policy}");
    let mut wanted: Vec<String> = page
        .text()
        .split('"')
        .filter(|part| part.starts_with("/assets/"))
        .map(Into::into)
        .collect();
    let mut seen = Vec::new();
    while let Some(address) = wanted.pop() {
        if seen.contains(&address) {
            continue;
        }
        let file = server.get(&address).await;
        assert_eq!(file.status, 200, "{address}");
        // Modules name each other by relative addresses. They are at most one folder deep.
        let folder = address.rsplit_once('/').unwrap().0;
        wanted.extend(file.text().split('"').filter_map(|piece| {
            let near = piece.strip_prefix("./").map(|name| format!("{folder}/{name}"));
            let far = piece.strip_prefix("../").map(|name| format!("/assets/{name}"));
            near.or(far).filter(|address| address.ends_with("js"))
        }));
        // A client with a cached copy gets 304 and no body.
        let tag = file.header("etag").unwrap().to_owned();
        let again = server.send("GET", &address, &[("If-None-Match", &tag)], "").await;
        assert_eq!((again.status, again.text().len()), (304, 0), "{address}");
        seen.push(address);
    }
    assert!(seen.len() > 90, "{seen:?}");
    server.get("/assets/no-such-file.js").await.problem(404, "not-found");
    server.send("POST", "/assets/main.js", &[JSON], "").await.problem(401, "unauthorized");
}

#[tokio::test(flavor = "multi_thread")]
async fn all_refusals_are_counted_and_the_log_shows_some_of_them() {
    const COUNT: usize = 200;
    let dir = TempDir::new().unwrap();
    let log = dir.path().join("log");
    let mut command = fretwork(&["--log", "info"]);
    command.env("FRETWORK_ADMIN_KEY", MASTER).stderr(File::create(&log).unwrap());
    let (_process, address) = serve_by(command, dir.path());
    let address = address.strip_prefix("http://").unwrap().parse().unwrap();
    for number in 0..COUNT {
        let (origin, status) =
            if number % 2 == 0 { ("https://evil.example", 403) } else { ("http://localhost", 401) };
        let headers = [("Origin", origin)];
        let refused = send(address, "POST", "/v1/jobs", &headers, "").await.unwrap();
        assert_eq!(refused.status, status);
    }
    let lines = fs::read_to_string(&log).unwrap();
    let shown = |status: u16| {
        lines.lines().filter(|line| line.contains(&format!("status={status} milliseconds"))).count()
    };
    assert_eq!((shown(401), shown(403)), (60, 60), "{lines}");
    // For each status, one line says that the log does not show all refusals.
    assert_eq!(lines.matches("the metrics count them").count(), 2, "{lines}");
    let bearer = format!("Bearer {MASTER}");
    let metrics =
        send(address, "GET", "/metrics", &[("Authorization", &bearer)], "").await.unwrap();
    let counted =
        metrics.text().lines().filter(|line| line.starts_with("fretwork_http_requests_total"));
    let counted: f64 =
        counted.map(|line| line.rsplit_once(' ').unwrap().1.parse::<f64>().unwrap()).sum();
    assert_eq!(counted, COUNT as f64);
}

/// A test of `http::access::keyring` compares the work of both refusals, and so their times.
#[tokio::test]
async fn a_refusal_does_not_show_whether_the_id_of_a_key_is_known() {
    let server = server(Limits::default()).await;
    let known = made(server.place(), "anna", Role::Read).await;
    assert_eq!(get(&server, &known, "/v1/jobs").await.status, 200);
    let wrong = format!("{}{}", &known[..known.len() - 8], "00000000");
    let unknown = format!("fretwork_00000000_{}", "0".repeat(40));
    let mut refusals = Vec::new();
    for key in [wrong, unknown] {
        let mut refused = get(&server, &key, "/v1/jobs").await.problem(401, "unauthorized");
        refused["instance"].take();
        refusals.push(refused);
    }
    assert_eq!(refusals[0], refusals[1]);
}
