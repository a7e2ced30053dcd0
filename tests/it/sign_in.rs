//! Browsers sign in with a cookie, and sign-on proxies with a header.

use std::fs::File;
use std::process::Command;
use std::sync::Arc;

use fretwork::http::{Access, Connections, Origins, Secret, Settings, SignOn};
use fretwork_job::{Begin, Task};
use fretwork_store::{Administration, Options, Role};
use serde_json::json;
use tempfile::TempDir;

use crate::access::{MASTER, followed_with, made, rest};
use crate::keeping::eventually;
use crate::program::serve_by;
use crate::server::{Gate, JSON, Reply, Server, ball, send};

const OWN: (&str, &str) = ("Origin", "http://localhost");
const SECRET: &str = "the-secret-of-the-proxy";

/// A server to which this machine is a proxy, and whose API every web page may call.
async fn server() -> Server {
    computing(Arc::new(Task::start)).await
}

async fn computing(begin: Begin) -> Server {
    let sign_on = SignOn {
        header: "x-remote-user".parse().unwrap(),
        secret: Secret(SECRET.into()),
        role: Role::Submit,
    };
    let access = Access {
        admin_key: Some(Secret(MASTER.into())),
        sign_on: Some(sign_on),
        ..Access::default()
    };
    let proxies = vec!["127.0.0.1".parse().unwrap()];
    let connections = Connections { proxies, ..Connections::default() };
    let settings = Settings { access, connections, origins: Origins::Any, ..Settings::default() };
    Server::with(begin, &settings, &Options::default()).await
}

/// Signs in with a key. Returns the answer, and the cookie as the browser sends it.
async fn sign_in(server: &Server, key: &str, more: &[(&str, &str)]) -> (Reply, String) {
    let bearer = format!("Bearer {key}");
    let headers = [&[("Authorization", bearer.as_str()), OWN], more].concat();
    let reply = server.send("POST", "/v1/session", &headers, "").await;
    assert_eq!(reply.status, 204, "{}", reply.text());
    let cookie = reply.header("set-cookie").unwrap().split(';').next().unwrap().to_owned();
    (reply, cookie)
}

async fn me(server: &Server, cookie: &str) -> Reply {
    server.send("GET", "/v1/me", &[("Cookie", cookie)], "").await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cookie_signs_in_until_its_session_or_its_key_ends() {
    let server = server().await;
    let key = made(server.place(), "anna", Role::Read).await;
    let (reply, cookie) = sign_in(&server, &key, &[]).await;
    let set = reply.header("set-cookie").unwrap();
    assert!(
        set.starts_with("fretwork=") && set.ends_with("; Path=/; HttpOnly; SameSite=Lax"),
        "{set}"
    );
    let tab = me(&server, &cookie).await;
    assert_eq!((&tab.json()["name"], &tab.json()["role"]), (&json!("anna"), &json!("read")));
    let vary: Vec<_> = tab.headers.iter().filter(|(name, _)| name == "vary").collect();
    assert!(vary.iter().any(|(_, value)| value == "Cookie"), "{vary:?}");
    assert_eq!(tab.header("access-control-allow-credentials"), None);
    // The role of the key counts.
    let headers = [JSON, OWN, ("Cookie", cookie.as_str())];
    let body = ball(2.0).to_string();
    server.send("POST", "/v1/jobs", &headers, &body).await.problem(403, "forbidden");

    // A session that begins in place of another one ends it.
    let (_, second) = sign_in(&server, &key, &[("Cookie", &cookie)]).await;
    assert_ne!(cookie, second);
    me(&server, &cookie).await.problem(401, "session-ended");
    let out = server.send("DELETE", "/v1/session", &[OWN, ("Cookie", &second)], "").await;
    assert!(out.header("set-cookie").unwrap().contains("fretwork=; ") && out.status == 204);
    me(&server, &second).await.problem(401, "session-ended");

    let (_, third) = sign_in(&server, &key, &[]).await;
    let mut administration = Administration::open(server.place()).await.unwrap();
    assert_eq!(administration.revoke_keys("anna").await.unwrap(), 1);
    administration.close().await.unwrap();
    eventually(async || me(&server, &third).await.status == 401).await;
    let problem = me(&server, &third).await.problem(401, "session-ended");
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains("was revoked on") && !detail.contains("Authorization"), "{detail}");
    let (_, chief) = sign_in(&server, MASTER, &[]).await;
    assert_eq!(me(&server, &chief).await.json()["role"], "admin");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cookie_counts_only_for_pages_of_this_server() {
    let server = server().await;
    let key = made(server.place(), "anna", Role::Submit).await;
    let (_, cookie) = sign_in(&server, &key, &[]).await;
    let cookie = ("Cookie", cookie.as_str());
    let body = ball(2.0).to_string();
    let own = server.send("POST", "/v1/jobs", &[JSON, cookie, OWN], &body).await;
    assert!([200, 202].contains(&own.status), "{}", own.text());
    let site = ("Sec-Fetch-Site", "same-origin");
    let own = server.send("POST", "/v1/jobs", &[JSON, cookie, site], &body).await;
    assert!([200, 202].contains(&own.status), "{}", own.text());
    for other in [
        &[][..],
        &[("Origin", "http://localhost:9000")],
        &[("Origin", "https://example.org")],
        &[("Origin", "null")],
        &[("Sec-Fetch-Site", "same-site")],
        &[("Sec-Fetch-Site", "none")],
        &[("Sec-Fetch-Site", "same-site"), OWN],
        &[OWN, ("Origin", "https://example.org")],
        &[("Sec-Fetch-Site", "same-origin"), ("Sec-Fetch-Site", "cross-site")],
    ] {
        let headers = [&[JSON, cookie], other].concat();
        let reply = server.send("POST", "/v1/jobs", &headers, &body).await;
        reply.problem(403, "cross-site");
        if other.len() == 1 && other[0].1 != "none" {
            let reply = server.send("GET", "/v1/jobs", &headers, "").await;
            reply.problem(403, "cross-site");
        }
    }
    // A user who follows a link sees the answer.
    let link = [cookie, ("Sec-Fetch-Site", "cross-site"), ("Sec-Fetch-Mode", "navigate")];
    assert_eq!(server.send("GET", "/v1/jobs", &link, "").await.status, 200);
    let two = format!("{}; {}", cookie.1, cookie.1);
    me(&server, &two).await.problem(401, "session-ended");
    me(&server, &format!("fretwork={}", "0".repeat(64))).await.problem(401, "session-ended");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cookie_is_secure_behind_a_proxy_with_tls() {
    let server = server().await;
    let key = made(server.place(), "anna", Role::Read).await;
    let tls = ("X-Forwarded-Proto", "https");
    let (reply, cookie) = sign_in(&server, &key, &[tls]).await;
    let set = reply.header("set-cookie").unwrap();
    assert!(set.starts_with("__Host-fretwork=") && set.ends_with("; Secure"), "{set}");
    me(&server, &cookie).await.problem(401, "unauthorized");
    let reply = server.send("GET", "/v1/me", &[("Cookie", &cookie), tls], "").await;
    assert_eq!(reply.status, 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_log_warns_once_of_sessions_of_other_machines_without_tls() {
    let dir = TempDir::new().unwrap();
    let log = dir.path().join("log");
    let mut command = Command::new(env!("CARGO_BIN_EXE_fretwork"));
    command.args(["--trusted-proxy", "127.0.0.1", "--log", "warn"]);
    command.env("FRETWORK_ADMIN_KEY", MASTER).stderr(File::create(&log).unwrap());
    let (_server, address) = serve_by(command, &dir.path().join("data"));
    let address = address.strip_prefix("http://").unwrap().parse().unwrap();
    let bearer = format!("Bearer {MASTER}");
    let (plain, tls) = (("X-Forwarded-Proto", "http"), ("X-Forwarded-Proto", "https"));
    let warnings_after = async |client: &str, protocol| {
        let headers = [("Authorization", &*bearer), ("X-Forwarded-For", client), protocol];
        let reply = send(address, "POST", "/v1/session", &headers, "").await.unwrap();
        assert_eq!(reply.status, 204, "{}", reply.text());
        let log = std::fs::read_to_string(&log).unwrap();
        (log.lines().count(), log)
    };
    assert_eq!(warnings_after("198.51.100.6", tls).await.0, 0);
    assert_eq!(warnings_after("127.0.0.1", plain).await.0, 0);
    assert_eq!(warnings_after("::1", plain).await.0, 0);
    let (warnings, log) = warnings_after("198.51.100.7", plain).await;
    let says = ["WARN", "client=198.51.100.7", "without TLS"].iter().all(|word| log.contains(word));
    assert!(warnings == 1 && says, "{log}");
    assert_eq!(warnings_after("198.51.100.8", plain).await.0, 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn only_a_sign_on_proxy_names_a_user() {
    let server = server().await;
    let (user, secret) = (("X-Remote-User", "ben"), ("X-Fretwork-Proxy-Secret", SECRET));
    let me = server.send("GET", "/v1/me", &[user, secret], "").await.json();
    assert_eq!(
        (&me["name"], &me["role"], &me["key"]),
        (&json!("ben"), &json!("submit"), &json!("sign-on"))
    );
    for forged in [
        &[user][..],
        &[user, ("X-Fretwork-Proxy-Secret", "the-secret-of-the-Proxy")],
        &[user, secret, secret],
        &[user, user, secret],
        &[("X-Remote-User", "admin"), secret],
        &[("X-Remote-User", ""), secret],
    ] {
        server.send("GET", "/v1/me", forged, "").await.problem(401, "unauthorized");
        // A good key does not help.
        let bearer = format!("Bearer {MASTER}");
        let headers = [forged, &[("Authorization", bearer.as_str())]].concat();
        server.send("GET", "/v1/me", &headers, "").await.problem(401, "unauthorized");
    }
    let other = ("Origin", "https://example.org");
    let headers = [user, secret, JSON, other];
    let body = ball(2.0).to_string();
    server.send("POST", "/v1/jobs", &headers, &body).await.problem(403, "cross-site");
    let job = server.send("POST", "/v1/jobs", &headers[..3], &body).await.json();
    assert_eq!(job["owner"], "ben");
    let session = server.send("POST", "/v1/session", &[user, secret], "").await;
    session.problem(403, "forbidden");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_event_stream_ends_with_its_session() {
    let gate = Gate::default();
    let server = computing(gate.compute()).await;
    let key = made(server.place(), "anna", Role::Submit).await;
    let (_, cookie) = sign_in(&server, &key, &[]).await;
    let (_, other) = sign_in(&server, &key, &[]).await;
    let headers = [JSON, OWN, ("Cookie", cookie.as_str())];
    let job = server.send("POST", "/v1/jobs", &headers, ball(1.0).to_string()).await.json();
    let id = job["id"].as_str().unwrap();
    let follow =
        async |cookie: &str| followed_with(&server, &format!("Cookie: {cookie}\r\n"), id).await;
    let (ended, good) = (follow(&cookie).await, follow(&other).await);
    server.send("DELETE", "/v1/session", &[OWN, ("Cookie", &cookie)], "").await;
    assert!(!rest(ended).await.contains("succeeded"));
    let events = format!("/v1/jobs/{id}/events");
    let again = server.send("GET", &events, &[("Cookie", &cookie)], "").await;
    again.problem(401, "session-ended");
    gate.open();
    assert!(rest(good).await.contains("\"state\":\"succeeded\""));
}
