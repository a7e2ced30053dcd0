//! The HTTP interface: submitting, waiting, canceling, listing and reading.

use std::sync::Arc;

use axum::http::HeaderValue;
use fretwork::http::Origins;
use serde_json::{Value, json};
use sqlx::Executor as _;

use crate::server::{Gate, JSON, Reply, Server, ball, document, example, steel_ball};
use crate::store::raw;

fn text<'a>(value: &'a Value, pointer: &str) -> &'a str {
    let found = value.pointer(pointer).and_then(Value::as_str);
    found.unwrap_or_else(|| panic!("no text at {pointer} in {value}"))
}

/// A column of numbers.
fn column(value: &Value, pointer: &str) -> Vec<f64> {
    let found = value.pointer(pointer).and_then(Value::as_array);
    let found = found.unwrap_or_else(|| panic!("no column at {pointer}"));
    found.iter().map(|number| number.as_f64().unwrap()).collect()
}

/// The result of a job, computed by the engine.
async fn result(server: &Server, body: &Value) -> Value {
    let job = server.compute(body).await.json();
    assert_eq!(job["state"], "succeeded", "{job}");
    server.get(text(&job, "/links/result")).await.json()
}

fn job_address(reply: &Reply) -> String {
    format!("/v1/jobs/{}", text(&reply.json(), "/id"))
}

async fn gated() -> (Server, Gate) {
    let gate = Gate::default();
    (Server::computing(gate.compute(), &Origins::Own).await, gate)
}

async fn quick() -> Server {
    Server::computing(Gate::opened(), &Origins::Own).await
}

#[tokio::test(flavor = "multi_thread")]
async fn one_request_computes_the_steel_ball() {
    let server = Server::start().await;
    let headers = [JSON, ("Prefer", "wait=60")];
    let body = steel_ball().to_string();
    let reply = server.send("POST", "/v1/jobs?include=result", &headers, body).await;
    let job = reply.json();
    assert_eq!(reply.status, 200, "{job}");
    assert_eq!(reply.header("cache-status"), Some("fretwork; fwd=miss; stored"));
    assert_eq!(reply.header("preference-applied"), Some("wait=60"));
    assert_eq!(job["state"], "succeeded");
    assert_eq!(job["progress"], 1.0);
    assert_eq!(job["label"], steel_ball()["label"]);
    assert_eq!(job["summary"]["regime"], "partial_slip");
    let result = &job["result"];
    assert_eq!(result["key"], job["key"]);
    assert_eq!(result["regime"], "partial_slip");
    assert_eq!(result["units"]["wear_volume"], "m^3");
    assert_eq!(result["history"]["cycles"], json!([0.0, 1e3, 3e3, 1e4, 3e4, 1e5]));
    assert_eq!(result["profiles"]["worn"].as_array().map(Vec::len), Some(6));
    let contact_radius = result["scales"]["contact_radius"].as_f64().unwrap();
    assert!((contact_radius - 0.18813e-3).abs() < 1e-8);

    let key = text(&job, "/key");
    let csv = server.get(&format!("/v1/results/{key}/history?format=csv")).await;
    assert_eq!(csv.text().lines().filter(|line| !line.starts_with('#')).count(), 7);
    assert!(csv.text().contains(",wear_volume[m^3],"), "{}", csv.text());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_checked_scenario_and_its_canonical_form_have_the_same_key() {
    let server = Server::start().await;
    let checked = server.post("/v1/scenarios", &steel_ball()).await;
    let checked = checked.json();
    assert_eq!(checked["cached"], false);
    assert_eq!(checked["regime"], "partial_slip");
    for part in ["scales", "unworn", "limit", "units"] {
        assert!(checked[part].is_object(), "{part} in {checked}");
    }
    let echo = json!({"scenario": checked["scenario"]});
    assert_eq!(server.compute(&echo).await.json()["key"], checked["key"]);
    let again = server.post("/v1/scenarios", &steel_ball()).await.json();
    assert_eq!(again["cached"], true);
    let hit = server.compute(&steel_ball()).await;
    assert_eq!(hit.header("cache-status"), Some("fretwork; hit"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_submission_without_a_wait_returns_202_and_the_address_of_the_job() {
    let (server, gate) = gated().await;
    let reply = server.post("/v1/jobs", &steel_ball()).await;
    let job = reply.json();
    assert_eq!(reply.status, 202);
    let address = job_address(&reply);
    assert_eq!(reply.header("location"), Some(&*address));
    assert_eq!(reply.header("content-location"), Some(&*address));
    assert_eq!(reply.header("cache-status"), Some("fretwork; fwd=miss"));
    assert_eq!(reply.header("preference-applied"), None);
    let related = format!("<{}>; rel=\"related\"", text(&job, "/links/result"));
    assert_eq!(reply.header("link"), Some(&*related));
    assert_eq!(text(&job, "/links/self"), address);

    let early = server.get(&format!("{address}/result")).await;
    early.problem(409, "not-finished");
    assert_eq!(early.header("retry-after"), Some("1"));
    let unknown = server.get(text(&job, "/links/result")).await;
    unknown.problem(404, "unknown-result");
    assert_eq!(unknown.header("link"), Some(&*format!("<{address}>; rel=\"related\"")));

    gate.open();
    let done = server.get(&format!("{address}?wait=60&include=result")).await.json();
    assert_eq!(done["state"], "succeeded");
    assert_eq!(done["result"]["key"], done["key"]);
    assert_eq!(done["links"]["cancel"], Value::Null);
    for time in ["created", "started", "finished"] {
        assert!(text(&done, &format!("/times/{time}")).ends_with('Z'));
    }
    let lead = server.get(&format!("{address}/result")).await;
    assert_eq!((lead.status, lead.header("location")), (303, job["links"]["result"].as_str()));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wait_that_times_out_returns_the_unfinished_job() {
    let (server, _gate) = gated().await;
    let headers = [JSON, ("Prefer", "wait=0")];
    let reply = server.send("POST", "/v1/jobs", &headers, steel_ball().to_string()).await;
    assert_eq!((reply.status, reply.header("preference-applied")), (202, Some("wait=0")));
    let job = server.get(&format!("{}?wait=0.001&include=result", job_address(&reply))).await;
    assert_eq!((job.status, &job.json()["result"]), (200, &Value::Null));
}

#[tokio::test(flavor = "multi_thread")]
async fn equal_submissions_share_one_run_and_have_their_own_jobs() {
    let (server, gate) = gated().await;
    let server = Arc::new(server);
    let mut submitting = tokio::task::JoinSet::new();
    for _ in 0..64 {
        let server = Arc::clone(&server);
        submitting.spawn(async move { server.post("/v1/jobs", &steel_ball()).await });
    }
    let replies = submitting.join_all().await;
    assert!(replies.iter().all(|reply| reply.status == 202));
    let having = |status| {
        replies.iter().filter(|reply| reply.header("cache-status") == Some(status)).count()
    };
    assert_eq!(having("fretwork; fwd=miss"), 1);
    assert_eq!(having("fretwork; fwd=miss; collapsed"), 63);
    gate.open();
    for reply in &replies {
        let job = server.get(&format!("{}?wait=60", job_address(reply))).await.json();
        assert_eq!((&job["state"], &job["attempt"]), (&json!("succeeded"), &json!(1)));
    }
    let hit = server.post("/v1/jobs", &steel_ball()).await;
    assert_eq!((hit.status, hit.header("cache-status")), (200, Some("fretwork; hit")));
    assert_eq!(hit.json()["origin"], "cached");
    let listed = server.get("/v1/jobs?limit=200").await.json();
    assert_eq!(listed["jobs"].as_array().map(Vec::len), Some(65));
}

#[tokio::test(flavor = "multi_thread")]
async fn cancelling_a_job_stops_its_run() {
    let (server, _gate) = gated().await;
    let address = job_address(&server.post("/v1/jobs", &steel_ball()).await);
    let canceled = server.send("POST", &format!("{address}/cancel"), &[], "").await;
    assert_eq!(canceled.status, 200);
    let job = server.get(&format!("{address}?wait=60")).await.json();
    assert_eq!(job["state"], "canceled");
    server.get(&format!("{address}/result")).await.problem(409, "job-canceled");
    let again = server.send("POST", &format!("{address}/cancel"), &[], "").await;
    assert_eq!((again.status, &again.json()["state"]), (200, &json!("canceled")));
    let nobody = "/v1/jobs/019aa0f3-1f4e-7cc0-9d8b-1c5b0c1f9a11/cancel";
    server.send("POST", nobody, &[], "").await.problem(404, "not-found");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_run_that_panics_fails_only_its_job() {
    let server = Server::computing(
        Arc::new(|_: &_, _: &str, _| panic!("made for this test")),
        &Origins::Own,
    )
    .await;
    let reply = server.compute(&steel_ball()).await;
    let job = reply.json();
    assert_eq!((reply.status, &job["state"]), (200, &json!("failed")));
    assert_eq!(text(&job, "/error/type"), "/problems/panicked");
    let page = server.get(text(&job, "/error/type")).await;
    assert_eq!((page.status, page.header("content-type")), (200, Some("text/html; charset=utf-8")));
    server.get(&format!("{}/result", job_address(&reply))).await.problem(409, "job-failed");
    assert_eq!(server.get("/healthz").await.status, 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_has_its_scenario_in_every_state() {
    let (server, gate) = gated().await;
    let mut jobs = Vec::new();
    for number in 1..=4 {
        let body = ball(f64::from(number) / 4.0);
        let reply = server.post("/v1/jobs?include=scenario", &body).await;
        let scenario = server.post("/v1/scenarios", &body).await.json()["scenario"].take();
        assert_eq!((reply.status, &reply.json()["scenario"]), (202, &scenario));
        jobs.push((job_address(&reply), scenario));
    }
    let show = async |(address, scenario): &(String, Value)| {
        let mut job = server.get(&format!("{address}?include=scenario,result")).await.json();
        assert_eq!(&job["scenario"], scenario, "{job}");
        assert_eq!(job["result"].is_null(), job["state"] != "succeeded", "{job}");
        assert!(server.get(address).await.json().get("scenario").is_none());
        job["state"].take()
    };
    // There are two workers. So two jobs run and the last two wait before the first cancellation.
    while show(&jobs[1]).await != "running" {}
    assert_eq!(show(&jobs[3]).await, "queued");
    server.send("POST", &format!("{}/cancel", jobs[3].0), &[], "").await;
    assert_eq!(show(&jobs[3]).await, "canceled");
    server.send("POST", &format!("{}/cancel", jobs[0].0), &[], "").await;
    // The job is `canceling` until the worker stops, then `canceled`. It has its scenario in both states.
    while show(&jobs[0]).await != "canceled" {}
    gate.open();
    server.get(&format!("{}?wait=60", jobs[2].0)).await;
    assert_eq!(show(&jobs[2]).await, "succeeded");

    let panics = Arc::new(|_: &_, _: &str, _| panic!("made for this test"));
    let server = Server::computing(panics, &Origins::Own).await;
    let address = job_address(&server.compute(&ball(0.25)).await);
    let job = server.get(&format!("{address}?include=scenario")).await.json();
    assert_eq!((&job["state"], &job["scenario"]), (&json!("failed"), &jobs[0].1));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_keeps_its_scenario_as_its_client_wrote_it() {
    let server = Server::start().await;
    let submit = async |force: &str, headers: &[(&str, &str)]| {
        let mut body = steel_ball();
        body["scenario"]["load"]["normal_force"] = json!(force);
        let target = "/v1/jobs?include=submitted,scenario";
        let reply = server.send("POST", target, headers, body.to_string()).await;
        (reply.json(), job_address(&reply), body["scenario"].take())
    };
    let named = [JSON, ("Idempotency-Key", "one")];
    let (job, address, typed) = submit("100 N", &named).await;
    assert_eq!(job["submitted"], typed);
    assert_ne!(job["scenario"], typed);
    let shown = server.get(&format!("{address}?include=submitted&wait=60")).await.json();
    assert_eq!(shown["submitted"], typed);
    assert!(shown.get("scenario").is_none());
    // Another job with the same result key has its own text. A submission that repeats the idempotency key returns the
    // first job, with the text of the first submission.
    let (other, _, kilo) = submit("0.1 kN", &[JSON]).await;
    assert_eq!((&other["key"], &other["submitted"]), (&job["key"], &kilo));
    let (again, _, _) = submit("0.1 kN", &named).await;
    assert_eq!((&again["id"], &again["submitted"]), (&job["id"], &typed));
    for (name, mark) in [("one", Some("true")), ("two", None)] {
        let headers = [JSON, ("Idempotency-Key", name)];
        let mut body = steel_ball();
        body["scenario"]["load"]["normal_force"] = json!("0.1 kN");
        let reply = server
            .send("POST", "/v1/jobs?include=submitted,scenario", &headers, body.to_string())
            .await;
        assert_eq!(reply.header("idempotency-replayed"), mark, "{name}");
    }

    let reversal = |i| if i % 2 == 0 { "1.2345 um" } else { "-1.2345 um" };
    let mut large = ball(1.0);
    large["scenario"]["motion"] =
        json!({"reversals": (0..10_000).map(reversal).collect::<Vec<_>>()});
    let reply = server.send("POST", "/v1/jobs?include=submitted", &[JSON], large.to_string()).await;
    assert_eq!((reply.status, &reply.json()["submitted"]), (202, &Value::Null));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_keeps_its_scenario_after_its_result_is_deleted() {
    let server = Server::start().await;
    let headers = [JSON, ("Prefer", "wait=60")];
    let submit = async |body: &Value| {
        let target = "/v1/jobs?include=result,scenario";
        let reply = server.send("POST", target, &headers, body.to_string()).await;
        let (job, own) = (reply.json(), job_address(&reply));
        (reply, job, own)
    };
    let (reply, job, computed) = submit(&steel_ball()).await;
    // The scenario of the job equals that of the result in every digit.
    let scenario = format!("\"scenario\":{}", job["result"]["scenario"]);
    assert_eq!(reply.text().matches(&scenario).count(), 2, "{scenario}");
    let again = json!({"scenario": job["scenario"]});
    let (_, echo, cached) = submit(&again).await;
    assert_eq!((&echo["origin"], &echo["key"]), (&json!("cached"), &job["key"]));
    assert_eq!(echo["scenario"], job["scenario"]);

    // First the body of the result is deleted, then the job that computed it.
    let told = async |address: &str| {
        let job = server.get(&format!("{address}?include=result,scenario")).await;
        assert_eq!((job.status, &job.json()["result"]), (200, &Value::Null));
        job.json()["scenario"].take()
    };
    let result = text(&job, "/links/result");
    assert_eq!(server.send("DELETE", result, &[], "").await.status, 204);
    assert_eq!(
        [told(&computed).await, told(&cached).await],
        [(); 2].map(|()| job["scenario"].clone())
    );
    server.send("DELETE", &computed, &[], "").await;
    assert_eq!(told(&cached).await, job["scenario"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_include_parameter_is_a_list_of_known_members() {
    let server = quick().await;
    let address = job_address(&server.compute(&steel_ball()).await);
    for (asked, result, scenario) in [
        ("result", true, false),
        ("scenario", false, true),
        ("scenario,result", true, true),
        ("result,%20scenario", true, true),
        ("result,result", true, false),
    ] {
        let job = server.get(&format!("{address}?include={asked}")).await.json();
        let has = |name| job.get(name).is_some_and(Value::is_object);
        assert_eq!((has("result"), has("scenario")), (result, scenario), "{asked}");
    }
    for asked in ["scenari", "result,profiles", "result,", ""] {
        let refused = server.get(&format!("{address}?include={asked}")).await;
        let problem = refused.problem(422, "invalid-parameters");
        assert_eq!(text(&problem, "/errors/0/parameter"), "include");
        let detail = text(&problem, "/errors/0/detail");
        assert!(detail.contains("\"result\"") && detail.contains("\"scenario\""), "{detail}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_are_listed_newest_first_with_pages_and_filters() {
    let server = quick().await;
    let mut ids = Vec::new();
    for number in 1..=5 {
        let mut body = ball(f64::from(number) / 4.0);
        body["label"] = json!(format!("ball {number}"));
        body["tags"] = json!([if number % 2 == 0 { "even" } else { "odd" }]);
        ids.push(text(&server.compute(&body).await.json(), "/id").to_owned());
    }
    for order in ["created", "-created"] {
        let mut seen = Vec::new();
        let mut next = Some(format!("/v1/jobs?limit=2&state=succeeded&owner=me&sort={order}"));
        while let Some(target) = next {
            let reply = server.get(&target).await;
            let page = reply.json();
            let jobs = page["jobs"].as_array().unwrap();
            seen.extend(jobs.iter().map(|job| text(job, "/id").to_owned()));
            next = page["next"].as_str().map(str::to_owned);
            let link = next.as_ref().map(|next| format!("<{next}>; rel=\"next\""));
            assert_eq!(reply.header("link"), link.as_deref());
        }
        assert_eq!(seen, ids, "{order}");
        ids.reverse();
    }
    ids.reverse();
    assert_eq!(server.get("/v1/jobs?state=failed").await.json()["jobs"], json!([]));
    let even = server.get("/v1/jobs?tag=even").await.json();
    assert_eq!(even["jobs"].as_array().map(Vec::len), Some(2));
    let third = server.get("/v1/jobs?label=ball%203").await.json();
    assert_eq!(third["jobs"][0]["id"], json!(ids[2]));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_result_is_served_as_stored_and_marked_immutable() {
    let server = quick().await;
    let job = server.compute(&steel_ball()).await.json();
    let (key, address) = (text(&job, "/key"), text(&job, "/links/result"));
    let reply = server.get(address).await;
    assert_eq!(reply.text(), document(key));
    assert_eq!(reply.header("content-type"), Some("application/json"));
    assert_eq!(reply.header("cache-control"), Some("max-age=31536000, immutable"));
    assert_eq!(reply.header("vary"), Some("accept, accept-encoding"));
    let tag = reply.header("etag").unwrap();

    let mut tags = vec![tag.to_owned()];
    for part in ["history", "profiles"] {
        for format in ["json", "csv"] {
            let reply = server.get(&format!("{address}/{part}?format={format}")).await;
            assert_eq!(reply.status, 200);
            tags.push(reply.header("etag").unwrap().to_owned());
        }
    }
    tags.sort();
    tags.dedup();
    assert_eq!(tags.len(), 5, "one tag per representation: {tags:?}");

    for held in [tag.to_owned(), format!("\"other\", {tag}"), "*".to_owned()] {
        let reply = server.send("GET", address, &[("If-None-Match", &held)], "").await;
        assert_eq!((reply.status, reply.header("etag")), (304, Some(tag)));
        assert!(reply.body.is_empty());
    }
    let reply = server.send("GET", address, &[("If-None-Match", "\"other\"")], "").await;
    assert_eq!(reply.status, 200);
    let head = server.send("HEAD", address, &[], "").await;
    assert_eq!((head.status, head.header("etag"), head.body.len()), (200, Some(tag), 0));
    assert_eq!(head.header("content-length"), Some(&*document(key).len().to_string()));
}

#[tokio::test(flavor = "multi_thread")]
async fn tables_are_served_as_json_and_csv() {
    let server = quick().await;
    let job = server.compute(&steel_ball()).await.json();
    let (key, address) = (text(&job, "/key"), text(&job, "/links/result"));
    let csv = ("Accept", "text/csv");
    let comments = |part| {
        format!(
            "# fretwork {part}\n# key: {key}\n# engine: {{\"name\":\"fretwork\",\"numerics\":1}}\n\
             # units: SI\n"
        )
    };

    let history = server.send("GET", &format!("{address}/history"), &[csv], "").await;
    assert_eq!(history.header("content-type"), Some("text/csv; charset=utf-8"));
    let rows = "cycles,wear_volume[m^3]\n0.0,0.0\n1000.0,2.5e-13\n";
    assert_eq!(history.text(), comments("history") + rows);
    let history = server.get(&format!("{address}/history")).await.json();
    assert_eq!(history["history"]["cycles"], json!([0.0, 1000.0]));
    assert_eq!(history["units"]["wear_volume"], "m^3");

    let target = format!("{address}/profiles?format=csv&fields=wear&cycles=1000&points=2");
    let profiles = server.get(&target).await;
    let rows = "cycles,radius[m],wear[m]\n1000.0,0.0,0.0\n1000.0,0.0002,\n";
    assert_eq!(profiles.text(), comments("profiles") + rows);
    let profiles = server.get(&format!("{address}/profiles?fields=wear")).await.json();
    assert_eq!(profiles["profiles"]["limiting"], Value::Null);
    assert_eq!(profiles["profiles"]["wear"][1], json!([0.0, 1.5e-7, null]));

    let whole = server.send("GET", address, &[csv], "").await;
    let problem = whole.problem(406, "not-acceptable");
    for part in ["history", "profiles"] {
        let way = format!("{address}/{part}?format=csv");
        assert!(text(&problem, "/detail").contains(&way), "{problem}");
    }
    server.get(&format!("{address}?format=csv")).await.problem(406, "not-acceptable");
    let image = [("Accept", "image/png")];
    for target in [&*format!("{address}/history"), "/v1/jobs", "/v1/me"] {
        let refused = server.send("GET", target, &image, "").await;
        refused.problem(406, "not-acceptable");
    }
    // A parameter overrides the header. What only monitors read, and what changes something, is never refused.
    let lists = server.send("GET", "/v1/jobs?format=json", &image, "").await;
    let health = server.send("GET", "/healthz", &image, "").await;
    let check = [image[0], ("Content-Type", "application/json")];
    let body = steel_ball().to_string();
    let checked = server.send("POST", "/v1/scenarios", &check, body).await;
    assert_eq!([lists.status, health.status, checked.status], [200; 3]);
    for (query, parameter) in [
        ("fields=warn", "fields"),
        ("cycles=7", "cycles"),
        ("cycles=seven", "cycles"),
        ("points=1", "points"),
        ("format=xlsx", "format"),
    ] {
        let refused = server.get(&format!("{address}/profiles?{query}")).await;
        let problem = refused.problem(422, "invalid-parameters");
        assert_eq!(text(&problem, "/errors/0/parameter"), parameter);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn loops_are_served_as_json_and_csv() {
    let server = Server::start().await;
    let mut body = steel_ball();
    body["scenario"]["profiles_at"] = json!([1000, 30_000]);
    let whole = result(&server, &body).await;
    let key = text(&whole, "/key");
    let address = format!("/v1/results/{key}/loops");

    let reply = server.get(&address).await;
    assert_eq!(reply.header("content-type"), Some("application/json"));
    let tag = reply.header("etag").unwrap().to_owned();
    let loops = reply.json();
    assert_eq!((&loops["key"], &loops["engine"]), (&whole["key"], &whole["engine"]));
    assert_eq!(loops["loops"], whole["loops"]);
    assert_eq!(column(&loops, "/loops/cycles"), [0.0, 1e3, 3e4]);
    assert_eq!(loops["units"]["tangential_force"], "N");
    let mut points = 0;
    for (row, entry) in [0, 1, 4].into_iter().enumerate() {
        let displacement = column(&loops, &format!("/loops/displacement/{row}"));
        let force = column(&loops, &format!("/loops/tangential_force/{row}"));
        assert_eq!(displacement.len(), force.len());
        points += force.len();
        let history = |name: &str| column(&whole, &format!("/history/{name}"))[entry];
        let (stroke, most) = (history("amplitude"), history("tangential_force"));
        // The point at zero force is on both branches.
        assert_eq!(force.iter().filter(|force| force.abs() < 1e-9 * most).count(), 2, "{row}");
        assert!((displacement[0] / stroke - 1.0).abs() < 1e-9, "{row}");
        assert!((force[0] / most - 1.0).abs() < 1e-6, "{row}");
        let ratio = history("energy_per_cycle") / (4.0 * stroke * most);
        let told = column(&loops, "/loops/energy_ratio")[row];
        assert!((told / ratio - 1.0).abs() < 1e-6, "{row}: {told} against {ratio}");
    }

    let csv = server.send("GET", &address, &[("Accept", "text/csv")], "").await;
    assert_eq!(csv.header("content-type"), Some("text/csv; charset=utf-8"));
    assert_ne!(csv.header("etag"), Some(&*tag));
    assert!(csv.text().starts_with(&format!("# fretwork loops\n# key: {key}\n")));
    let mut rows = csv.text().lines().filter(|line| !line.starts_with('#'));
    let names = "cycles,displacement[m],tangential_force[N],energy_ratio,slip_ratio,free_ratio";
    assert_eq!(rows.next(), Some(names));
    assert_eq!(rows.count(), points);

    let known = server.send("GET", &address, &[("If-None-Match", &tag)], "").await;
    assert_eq!((known.status, known.body.len()), (304, 0));
    let image = server.send("GET", &address, &[("Accept", "image/png")], "").await;
    image.problem(406, "not-acceptable");
    server.get(&format!("{address}?format=xlsx")).await.problem(422, "invalid-parameters");
    server.get(&format!("{address}?points=5")).await.problem(422, "invalid-parameters");
    let nothing = address.replace(key, &"0".repeat(64));
    server.get(&nothing).await.problem(404, "unknown-result");

    body["scenario"]["profiles_at"] = json!("none");
    let whole = result(&server, &body).await;
    let address = format!("/v1/results/{}/loops", text(&whole, "/key"));
    assert_eq!(server.get(&address).await.json()["loops"], Value::Null);
    let csv = server.get(&format!("{address}?format=csv")).await;
    assert_eq!(csv.text().lines().filter(|line| !line.starts_with('#')).count(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_output_of_a_stopped_run_ends_at_the_event_that_stopped_it() {
    let server = Server::start().await;
    for (name, kind, asked) in
        [("displacement-record", "until_reached", 9), ("held-tangential-force", "gross_slip", 13)]
    {
        let result = result(&server, &example(name)).await;
        let events = result["events"].as_array().unwrap();
        let last = events.last().unwrap();
        assert_eq!(last["kind"], kind, "{name}");
        for part in ["history", "profiles", "loops"] {
            let cycles = column(&result, &format!("/{part}/cycles"));
            assert!(cycles.len() < asked + 1, "{name}: {cycles:?}");
            assert_eq!(cycles.last().copied(), last["cycles"].as_f64(), "{name}: {part}");
        }
        let depth = *column(&result, "/history/wear_depth").last().unwrap();
        if kind == "until_reached" {
            assert!((depth / 0.8e-6 - 1.0).abs() < 1e-6, "{depth:e}");
        } else {
            // Q = μF, up to the error of the mesh.
            for (member, force) in [("tangential_force", 45.0), ("normal_force", 45.0 / 0.7)] {
                let reached = *column(&result, &format!("/history/{member}")).last().unwrap();
                assert!((reached / force - 1.0).abs() < 1e-4, "{member}: {reached}");
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_result_reports_the_wear_of_each_body_and_the_model_error() {
    let server = Server::start().await;
    let mut body = example("flat-on-rig");
    body["scenario"]["wear"]["share"] = json!(0.25);
    let result = result(&server, &body).await;
    let of_body = |body: usize, name: &str| column(&result, &format!("/bodies/{body}/{name}"));
    let lengths = [0, 1].map(|body| of_body(body, "scar_half_length"));
    for (body, share) in [0.25, 0.75].into_iter().enumerate() {
        assert_eq!(result["bodies"][body]["share"], share);
        let volumes = of_body(body, "wear_volume");
        for (part, whole) in volumes.iter().zip(column(&result, "/history/wear_volume")) {
            assert!((part - share * whole).abs() <= 1e-11 * whole, "{part} of {whole}");
        }
        // Each body wears over its own length. With one amplitude the lengths grow alike, so those of the end nearly tell the
        // whole split.
        let depths = of_body(body, "wear_depth").into_iter();
        let rows = depths.zip(column(&result, "/history/wear_depth")).enumerate().skip(1);
        for (row, (part, whole)) in rows {
            let weight = |body: usize| [0.25, 0.75][body] / lengths[body][row];
            let known = whole * weight(body) / (weight(0) + weight(1));
            assert!((part - known).abs() <= 0.01 * whole, "{part} of {whole}: {known}");
        }
    }
    let exact = column(&result, "/history/wear_volume");
    let rule = column(&result, "/comparison/history/wear_volume");
    let errors = column(&result, "/comparison/errors/wear_volume");
    assert_eq!((rule.len(), errors.len()), (exact.len(), exact.len()));
    for ((exact, rule), error) in exact.iter().zip(&rule).zip(&errors).skip(1) {
        assert!((rule / exact - 1.0 - error).abs() < 1e-11, "{rule} against {exact}: {error}");
    }
    let radius = |pointer: &str| result.pointer(pointer).unwrap().as_f64().unwrap();
    let stick_ratio = radius("/unworn/stick_radius") / radius("/scales/contact_radius");
    let xi = (0.33 + 0.2 / (1.0 - stick_ratio)).sqrt();
    assert!((radius("/comparison/xi") / xi - 1.0).abs() < 1e-9);
    let best = result["comparison"]["best_xi"].as_f64().unwrap();
    assert!((0.8..1.2).contains(&best), "{best}");
    assert_eq!(result["history"]["cycles"], result["comparison"]["history"]["cycles"]);
    let half_length = |body| column(&result, &format!("/bodies/{body}/scar_half_length"));
    assert_eq!(half_length(0), column(&result, "/history/scar_radius"));
    assert!(
        half_length(0).iter().zip(half_length(1)).skip(1).all(|(first, second)| *first < second)
    );
    // The example has a rig, so the result has the criteria at the actuator too.
    let loops = server.get(&format!("/v1/results/{}/loops", text(&result, "/key"))).await.json();
    let share = result["unworn"]["amplitude"].as_f64().unwrap()
        / result["unworn"]["actuator_amplitude"].as_f64().unwrap();
    let at_contact = column(&loops, "/loops/slip_ratio")[0];
    let at_actuator = column(&loops, "/loops/actuator_slip_ratio")[0];
    assert!((at_actuator / at_contact / share - 1.0).abs() < 1e-10, "{at_actuator} {at_contact}");
    // Without a share and a comparison in the scenario, the result has neither.
    let plain = self::result(&server, &steel_ball()).await;
    assert_eq!((&plain["bodies"][0]["share"], &plain["comparison"]), (&Value::Null, &Value::Null));
    assert_eq!(plain["bodies"][1].as_object().unwrap().len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn output_cycles_can_be_given_as_dissipated_energies() {
    let server = Server::start().await;
    let mut body = steel_ball();
    body["scenario"]["cycles"] = json!({"dissipated_energy": ["10 mJ", 0.1]});
    let first = result(&server, &body).await;
    assert_eq!(first["scenario"]["cycles"], json!({"dissipated_energy": [0.01, 0.1]}));
    let found = column(&first, "/history/dissipated_energy");
    for (found, energy) in found.iter().zip([0.0, 0.01, 0.1]) {
        assert!((found - energy).abs() <= 1e-10 * energy, "{found}");
    }
    // A run with the output cycles of the first result has another key and the same numbers.
    body["scenario"]["cycles"] = json!(column(&first, "/history/cycles")[1..]);
    let second = result(&server, &body).await;
    assert_ne!(first["key"], second["key"]);
    for part in ["history", "profiles", "loops", "bodies", "events", "accuracy"] {
        assert_eq!(first[part], second[part], "{part}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_draining_server_answers_waiting_clients_and_refuses_jobs() {
    let (server, _gate) = gated().await;
    let server = Arc::new(server);
    let waiting = tokio::spawn({
        let server = Arc::clone(&server);
        async move { server.compute(&steel_ball()).await }
    });
    // The job can appear in the list before or after the wait begins. In both cases the wait must end with the
    // drain, and not after a minute.
    let mut address = None;
    while address.is_none() {
        let list = server.get("/v1/jobs").await.json();
        address = list["jobs"][0]["links"]["self"].as_str().map(str::to_owned);
    }
    server.service.drain();
    assert_eq!(waiting.await.unwrap().status, 202);
    let refused = server.post("/v1/jobs", &ball(1.0)).await;
    refused.problem(503, "draining");
    assert_eq!(refused.header("retry-after"), Some("5"));
    let address = address.unwrap();
    assert_eq!(server.get(&format!("{address}?wait=60")).await.status, 200);
    assert_eq!(server.send("POST", &format!("{address}/cancel"), &[], "").await.status, 200);
}

/// This takes more than 5 s, because the server waits so long for the lock.
#[tokio::test(flavor = "multi_thread")]
async fn a_locked_database_is_reported_as_busy() {
    let server = quick().await;
    let address = job_address(&server.compute(&steel_ball()).await);
    let mut other = raw(server.dir.path()).await;
    other.execute("BEGIN IMMEDIATE").await.unwrap();
    let refused = server.post("/v1/jobs", &ball(1.0)).await;
    refused.problem(503, "busy");
    assert_eq!(refused.header("retry-after"), Some("1"));
    assert_eq!(server.get(&address).await.status, 200, "reading goes on");
    other.execute("ROLLBACK").await.unwrap();
    assert_eq!(server.compute(&ball(1.0)).await.status, 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_valid_request_id_is_kept_and_an_invalid_one_is_replaced() {
    let server = quick().await;
    let id = |value: &'static str| {
        let server = &server;
        async move {
            let reply = server.send("GET", "/healthz", &[("X-Request-Id", value)], "").await;
            reply.header("x-request-id").unwrap().to_owned()
        }
    };
    assert_eq!(id("run-42/7").await, "run-42/7");
    assert_ne!(id("a b").await, "a b");
    assert_eq!(id("").await.len(), 36);
    let reply = server.send("GET", "/nowhere", &[("X-Request-Id", "mine")], "").await;
    assert_eq!(reply.problem(404, "not-found")["instance"], "mine");
}

#[tokio::test(flavor = "multi_thread")]
async fn pages_of_allowed_origins_can_read_the_exposed_headers() {
    let origins = Origins::These(vec![HeaderValue::from_static("https://lab.example")]);
    let server = Server::computing(Gate::opened(), &origins).await;
    let from = |origin: &'static str| [("Origin", origin)];
    let reply = server.send("GET", "/nowhere", &from("https://lab.example"), "").await;
    reply.problem(404, "not-found");
    assert_eq!(reply.header("access-control-allow-origin"), Some("https://lab.example"));
    let exposed = reply.header("access-control-expose-headers").unwrap();
    for name in ["location", "link", "cache-status", "etag", "preference-applied", "retry-after"] {
        assert!(exposed.contains(name), "{name} in {exposed}");
    }
    let reply = server.send("GET", "/healthz", &from("https://other.example"), "").await;
    assert_eq!(reply.header("access-control-allow-origin"), None);
    let asked = [
        ("Origin", "https://lab.example"),
        ("Access-Control-Request-Method", "POST"),
        ("Access-Control-Request-Headers", "content-type,prefer"),
    ];
    let preflight = server.send("OPTIONS", "/v1/jobs", &asked, "").await;
    assert_eq!(preflight.status, 200);
    assert!(preflight.header("access-control-allow-methods").unwrap().contains("POST"));
    assert_eq!(preflight.header("access-control-max-age"), Some("7200"));
    assert!(preflight.header("x-request-id").is_some());
    assert_eq!(preflight.header("x-content-type-options"), Some("nosniff"));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_documentation_works_offline() {
    let server = quick().await;
    let page = server.get("/docs/api/").await;
    assert_eq!((page.status, page.text().contains("//unpkg")), (200, false));
    for part in page.text().split(['"', '\'']).filter_map(|part| part.strip_prefix("./")) {
        assert_eq!(server.get(&format!("/docs/api/{part}")).await.status, 200, "{part}");
    }
    let start = server.get("/docs/api/swagger-initializer.js").await;
    assert!(start.text().contains("/openapi.json"));
    server.get("/docs/api/no-such-page").await.problem(404, "not-found");

    let version = server.get("/version").await.json();
    assert_eq!(version["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(version["limits"]["body_bytes"], 4 << 20);
    let schema = server.get("/v1/schema/scenario").await;
    assert_eq!(schema.header("content-type"), Some("application/schema+json"));
    assert!(schema.json().is_object());
    assert!(server.get("/problems").await.text().contains("/problems/invalid-request"));
    server.get("/problems/no-such-problem").await.problem(404, "not-found");
}

#[tokio::test(flavor = "multi_thread")]
async fn every_example_can_be_submitted_unchanged() {
    let server = quick().await;
    let examples = server.get("/v1/examples").await.json();
    for example in examples.as_array().unwrap() {
        let name = text(example, "/name");
        assert!(!text(example, "/label").is_empty());
        let alone = server.get(&format!("/v1/examples/{name}")).await.json();
        assert_eq!(alone, example["body"]);
        assert_eq!(server.compute(&alone).await.status, 200);
    }
    server.get("/v1/examples/no-such-example").await.problem(404, "not-found");
}
