//! Administrators make, list and revoke access keys over HTTP.

use std::num::NonZeroU32;
use std::sync::Arc;

use fretwork::http::{Limits, Origins};
use fretwork_job::Task;
use fretwork_store::Role;
use serde_json::{Value, json};

use crate::access::{MASTER, ask, get, made, server};
use crate::keeping::eventually;
use crate::server::{JSON, Reply, Server};

async fn make(server: &Server, by: &str, body: &Value) -> Reply {
    ask(server, by, "POST", "/v1/keys", &body.to_string()).await
}

/// The keys by their names. Keys of the same millisecond have no order.
async fn listed(server: &Server) -> Vec<Value> {
    let mut keys = get(server, MASTER, "/v1/keys").await.json()["keys"].as_array().unwrap().clone();
    keys.sort_by_key(|key| key["name"].to_string());
    keys
}

/// Waits until the server refuses a key.
async fn refused(server: &Server, key: &str) {
    eventually(async || get(server, key, "/v1/me").await.status == 401).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_administrator_makes_a_key_that_works_until_it_is_revoked() {
    let limits = Limits { per_minute: NonZeroU32::new(50_000), ..Limits::default() };
    let server = server(limits).await;
    let chief = made(server.place(), "chief", Role::Admin).await;
    let reply = make(&server, &chief, &json!({"name": "anna", "role": "submit"})).await;
    assert_eq!((reply.status, reply.header("cache-control")), (201, Some("no-store")));
    let made = reply.json();
    let (id, key) = (made["id"].as_str().unwrap(), made["access_key"].as_str().unwrap());
    assert!(key.starts_with(&format!("fretwork_{id}_")), "{key}");
    let me = get(&server, key, "/v1/me").await.json();
    assert_eq!(
        (&me["name"], &me["role"], &me["key"]),
        (&json!("anna"), &json!("submit"), &made["id"])
    );

    let limited =
        json!({"name": "ben", "role": "read", "expires_in": "90d", "requests_per_minute": 7});
    make(&server, &chief, &limited).await;
    make(&server, &chief, &json!({"name": "carl", "role": "admin", "requests_per_minute": 0}))
        .await;
    let keys = listed(&server).await;
    let row = |key: &Value| json!([key["name"], key["role"], key["requests_per_minute"]]);
    assert_eq!(
        keys.iter().map(row).collect::<Vec<_>>(),
        [
            json!(["anna", "submit", 50_000]),
            json!(["ben", "read", 7]),
            json!(["carl", "admin", null]),
            json!(["chief", "admin", 50_000]),
        ]
    );
    assert!(keys[1]["expires"].is_string() && keys[0]["expires"].is_null(), "{keys:?}");
    assert!(keys.iter().all(|key| key["revoked"].is_null()));
    // No answer has a secret again.
    let text = get(&server, MASTER, "/v1/keys").await.text().to_owned();
    assert!(!text.contains(&key[17..]), "{text}");

    let own = format!("/v1/keys/{id}");
    assert_eq!(ask(&server, &chief, "DELETE", &own, "").await.status, 204);
    refused(&server, key).await;
    ask(&server, &chief, "DELETE", &own, "").await.problem(404, "not-found");
    assert!(listed(&server).await[0]["revoked"].is_string());
    let log = get(&server, MASTER, "/v1/audit").await.json();
    let of_chief = |act: &str| {
        let entries = log["entries"].as_array().unwrap().iter();
        entries
            .filter(|entry| entry["act"] == act && entry["actor"] == "chief")
            .cloned()
            .collect::<Vec<_>>()
    };
    assert_eq!(of_chief("add_key").len(), 3, "{log}");
    let [revoked] = &of_chief("revoke_key")[..] else { panic!("{log}") };
    assert_eq!((&revoked["subject"], &revoked["owner"]), (&json!(id), &json!("anna")));
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_have_the_rules_of_the_command() {
    let server = server(Limits::default()).await;
    for (body, pointer) in [
        (json!({"name": "admin", "role": "read"}), "/name"),
        (json!({"name": "127.0.0.1", "role": "read"}), "/name"),
        (json!({"name": "0a1b2c3d", "role": "read"}), "/name"),
        (json!({"name": "a b", "role": "read"}), "/name"),
        (json!({"name": "anna", "role": "chief"}), "/role"),
        (json!({"name": "anna", "role": "read", "expires_in": "soon"}), "/expires_in"),
        (json!({"name": "anna", "role": "read", "expires_in": "101years"}), "/expires_in"),
        (
            json!({"name": "anna", "role": "read", "requests_per_minute": -1}),
            "/requests_per_minute",
        ),
        (json!({"name": "anna", "role": "read", "digest": "00"}), "/digest"),
    ] {
        let problem = make(&server, MASTER, &body).await.json();
        assert_eq!(problem["errors"][0]["pointer"], pointer, "{body}: {problem}");
    }
    assert_eq!(listed(&server).await, Vec::<Value>::new());
}

#[tokio::test(flavor = "multi_thread")]
async fn only_a_signed_in_administrator_changes_keys() {
    let server = server(Limits::default()).await;
    let body = json!({"name": "mallory", "role": "admin"});
    for (name, role) in [("reader", Role::Read), ("worker", Role::Submit)] {
        let key = made(server.place(), name, role).await;
        make(&server, &key, &body).await.problem(403, "forbidden");
        get(&server, &key, "/v1/keys").await.problem(403, "forbidden");
        let id = key.split('_').nth(1).unwrap();
        ask(&server, &key, "DELETE", &format!("/v1/keys/{id}"), "").await.problem(403, "forbidden");
    }
    // An id names one key. A name could be that of many.
    for other in ["worker", "0a1b2c3d", "0A1B2C3D", "%27%20OR%201=1"] {
        let address = format!("/v1/keys/{other}");
        ask(&server, MASTER, "DELETE", &address, "").await.problem(404, "not-found");
    }
    assert!(
        listed(&server)
            .await
            .iter()
            .all(|key| key["revoked"].is_null() && key["name"] != "mallory")
    );

    // Everyone is an administrator of a server without keys. A key would outlast that.
    let open = Server::computing(Arc::new(Task::start), &Origins::Own).await;
    let reply = open.send("POST", "/v1/keys", &[JSON], body.to_string()).await;
    reply.problem(403, "forbidden");
    open.send("DELETE", "/v1/keys/0a1b2c3d", &[], "").await.problem(403, "forbidden");
    assert_eq!(open.get("/v1/keys").await.json(), json!({"keys": []}));
}
