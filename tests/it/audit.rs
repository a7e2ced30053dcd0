//! The audit log, and the time of the last backup.

use std::time::Duration;

use fretwork::http::Limits;
use fretwork_store::{Administration, Role};
use serde_json::{Value, json};
use sqlx::Executor as _;

use crate::access::{MASTER, ask, computing, get, made, server};
use crate::program::run;
use crate::server::{Gate, JSON, Server, ball, metric};
use crate::store::raw;

/// Submits a ball and returns the finished job.
async fn computed(server: &Server, key: &str, amplitude: f64) -> Value {
    let job = ask(server, key, "POST", "/v1/jobs", &ball(amplitude).to_string()).await.json();
    assert_eq!(job["state"], "succeeded", "{job}");
    job
}

/// The entries of the log for some acts, the oldest first: act, actor, subject, owner and number.
async fn entries(server: &Server, acts: &[&str]) -> Vec<Value> {
    let log = get(server, MASTER, "/v1/audit").await.json();
    let entries = log["entries"].as_array().unwrap().iter().rev();
    let wanted = entries.filter(|entry| acts.iter().any(|act| entry["act"] == *act));
    let row = |entry: &Value| {
        json!([entry["act"], entry["actor"], entry["subject"], entry["owner"], entry["times"]])
    };
    wanted.map(row).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_audit_log_says_who_did_what_to_whom() {
    let server = server(Limits::default()).await;
    let anna = made(server.place(), "anna", Role::Submit).await;
    let ben = made(server.place(), "ben", Role::Submit).await;
    let id_in = |key: &str| key.split('_').nth(1).unwrap().to_owned();
    let mut jobs = Vec::new();
    for amplitude in [1.0, 2.0, 3.0] {
        jobs.push(computed(&server, &anna, amplitude).await);
    }
    let [id, key] = ["id", "key"].map(|name| jobs[2][name].as_str().unwrap().to_owned());
    for job in &jobs[..2] {
        let own = format!("/v1/jobs/{}", job["id"].as_str().unwrap());
        // A deletion that is refused is not recorded.
        assert_eq!(ask(&server, &ben, "DELETE", &own, "").await.status, 403);
        assert_eq!(ask(&server, &anna, "DELETE", &own, "").await.status, 204);
    }
    assert_eq!(ask(&server, MASTER, "DELETE", &format!("/v1/jobs/{id}"), "").await.status, 204);
    let result = format!("/v1/results/{key}");
    assert_eq!(ask(&server, MASTER, "DELETE", &result, "").await.status, 204);
    let mut administration = Administration::open(server.place()).await.unwrap();
    assert_eq!(administration.revoke_keys("ben").await.unwrap(), 1);
    administration.close().await.unwrap();

    let user = format!("uid {}", rustix::process::getuid());
    assert_eq!(
        entries(&server, &["add_key", "revoke_key", "delete_job", "delete_result"]).await,
        [
            json!(["add_key", user, id_in(&anna), "anna", 1]),
            json!(["add_key", user, id_in(&ben), "ben", 1]),
            json!(["delete_job", "anna", null, "anna", 2]),
            json!(["delete_job", "admin", id, "anna", 1]),
            json!(["delete_result", "admin", key, "anna", 1]),
            json!(["revoke_key", user, id_in(&ben), "ben", 1]),
        ]
    );
    // The use of a key is recorded in the background.
    let used = async || {
        let mut used = entries(&server, &["use_key"]).await;
        used.sort_by_key(Value::to_string);
        used
    };
    let expected = [
        json!(["use_key", "admin", "admin", "admin", 1]),
        json!(["use_key", "anna", id_in(&anna), "anna", 1]),
        json!(["use_key", "ben", id_in(&ben), "ben", 1]),
    ];
    while used().await.len() < expected.len() {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    assert_eq!(used().await, expected);

    let output = run(&["audit", "--data-dir", server.dir.path().to_str().unwrap()], "");
    let printed = String::from_utf8(output.stdout).unwrap();
    for line in [
        format!("{user}: revoke key {} of ben", id_in(&ben)),
        format!("anna ({}): delete job (own)", id_in(&anna)),
        format!("admin (admin): delete job {id} of anna"),
    ] {
        assert!(printed.lines().any(|printed| printed.ends_with(&line)), "{line} in {printed}");
    }
}

#[tokio::test]
async fn canceled_jobs_are_recorded_with_their_owner() {
    let gate = Gate::default();
    let server = computing(gate.compute(), Limits::default()).await;
    let anna = made(server.place(), "anna", Role::Submit).await;
    let mut ids = Vec::new();
    for amplitude in [1.0, 2.0, 3.0, 4.0] {
        let bearer = format!("Bearer {anna}");
        let headers = [("Authorization", bearer.as_str()), JSON];
        let body = ball(amplitude).to_string();
        let job = server.send("POST", "/v1/jobs", &headers, body).await.json();
        ids.push(job["id"].as_str().unwrap().to_owned());
    }
    ask(&server, &anna, "POST", &format!("/v1/jobs/{}/cancel", ids[0]), "").await;
    ask(&server, &anna, "POST", &format!("/v1/jobs/{}/cancel", ids[1]), "").await;
    let canceled = ask(&server, MASTER, "POST", "/v1/jobs/cancel?owner=anna", "").await.json();
    assert_eq!(canceled["canceled"], 2);
    let mut recorded = entries(&server, &["cancel_job"]).await;
    recorded[1..].sort_by_key(Value::to_string);
    assert_eq!(
        recorded,
        [
            json!(["cancel_job", "anna", null, "anna", 2]),
            json!(["cancel_job", "admin", ids[2], "anna", 1]),
            json!(["cancel_job", "admin", ids[3], "anna", 1]),
        ]
    );
    gate.open();
}

#[tokio::test]
async fn the_audit_log_has_pages_and_a_maximum_number_of_entries() {
    let server = server(Limits::default()).await;
    let mut db = raw(server.dir.path()).await;
    // The longest texts: names have 64 letters, and keys of results have 64 digits.
    db.execute(
        "WITH RECURSIVE n (n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM n WHERE n < 100007)
         INSERT INTO audit (first, last, times, act, actor, key, subject, owner)
         SELECT 1000000000000 + n, 1000000000000 + n, 1, 'delete_result', printf('%064d', 1), '0a1b2c3d', printf('%064d', n),
             printf('%064d', 2)
         FROM n",
    )
    .await
    .unwrap();
    let (entries, bytes): (u32, u32) = sqlx::query_as(
        "SELECT (SELECT count(*) FROM audit), page_count * page_size
         FROM pragma_page_count, pragma_page_size",
    )
    .fetch_one(&mut db)
    .await
    .unwrap();
    assert_eq!(entries, 100_000);
    assert!(bytes < 60_000_000, "{bytes}");
    // The newest entry is the use of a key.
    let mut next = "/v1/audit?limit=3".to_owned();
    let mut subjects = Vec::new();
    for _ in 0..3 {
        let page = get(&server, MASTER, &next).await;
        let log = page.json();
        next = log["next"].as_str().unwrap().to_owned();
        assert_eq!(page.header("link").unwrap(), format!("<{next}>; rel=\"next\""));
        let entries = log["entries"].as_array().unwrap();
        subjects.extend(entries.iter().map(|entry| entry["subject"].as_str().unwrap().to_owned()));
    }
    // The entry for the use of the key is not compared.
    subjects.retain(|subject| subject.starts_with('0'));
    let expected: Vec<String> = (0..8).map(|back| format!("{:064}", 100_007 - back)).collect();
    assert_eq!(subjects[..8], expected);
    get(&server, MASTER, "/v1/audit?limit=0&cursor=x").await.problem(422, "invalid-parameters");
    let last = get(&server, MASTER, "/v1/audit?cursor=10").await.json();
    assert!(last["next"].is_null());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn metrics_show_the_time_of_the_last_backup() {
    let server = Server::start().await;
    let time = "fretwork_last_backup_timestamp_seconds";
    assert_eq!(metric(server.address, time).await, 0.0);
    let began = fretwork_job::clock::now() as f64 / 1e3;
    let file = server.dir.path().join("backup.db");
    let words =
        ["backup", file.to_str().unwrap(), "--data-dir", server.dir.path().to_str().unwrap()];
    let output = run(&words, "");
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    let ended = metric(server.address, time).await;
    assert!((began..began + 60.0).contains(&ended), "{began} {ended}");
}
