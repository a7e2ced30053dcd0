//! Evaluations: their numbers, their faults and their limits, and that nothing is kept.

use std::num::NonZeroU32;

use fretwork::http::{EXAMPLES, Limits};
use fretwork_store::Role;
use fretwork_study::OutputName;
use serde_json::{Value, json};

use crate::access::{ask, get, made, server};
use crate::server::{Server, example, steel_ball};

const PATH: &str = "/v1/evaluate";

/// An evaluation of the steel ball by the simplified rule.
fn ball(outputs: &Value) -> Value {
    json!({"scenario": steel_ball()["scenario"], "outputs": outputs})
}

/// The value that a result has for an output whose name has no output cycle.
fn in_result<'a>(result: &'a Value, name: &str) -> Option<&'a Value> {
    match name.split_once('.') {
        Some(("events", kind)) => {
            let mut events = result["events"].as_array()?.iter();
            Some(&events.find(|event| event["kind"] == kind)?["cycles"])
        }
        Some((section, member)) => result[section].get(member),
        None => result["history"][name].as_array()?.last(),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_numbers_of_an_evaluation_equal_those_of_the_stored_result() {
    let server = Server::start().await;
    let names: Vec<_> = OutputName::all().collect();
    let mut evaluated = 0;
    for known in EXAMPLES {
        let job = example(known.name);
        let mut body = json!({"scenario": job["scenario"], "outputs": names});
        let scalars = server.post(PATH, &body).await;
        if scalars.status == 422 {
            scalars.problem(422, "too-expensive");
            continue;
        }
        evaluated += 1;
        body["parts"] = json!(["history", "profiles", "loops", "events", "accuracy", "check"]);
        let whole = server.post(PATH, &body).await.json();
        let key = server.compute(&job).await.json()["key"].as_str().unwrap().to_owned();
        let result = server.get(&format!("/v1/results/{key}")).await.json();
        // The result of a run that is compared has the same other members.
        for part in ["history", "profiles", "loops", "events", "accuracy", "warnings"] {
            assert_eq!(whole[part], result[part], "{part} of {}", known.name);
        }
        let mut check = server.post("/v1/scenarios", &job).await.json();
        check["cached"] = json!(false);
        assert_eq!(whole["check"], check, "{}", known.name);
        let scalars = scalars.json();
        for part in ["history", "profiles", "loops", "events", "accuracy", "check"] {
            assert!(scalars.get(part).is_none(), "{part} was not requested");
        }
        assert_eq!(scalars["warnings"], result["warnings"], "{}", known.name);
        for name in &names {
            let expected = in_result(&result, name).unwrap_or(&Value::Null);
            for answer in [&scalars, &whole] {
                assert_eq!(&answer["outputs"][name], expected, "{name} of {}", known.name);
                assert!(answer["units"][name].is_string(), "{name}");
                assert_eq!(answer["reasons"][name].is_string(), expected.is_null(), "{name}");
            }
        }
        for (name, unit) in result["units"].as_object().unwrap() {
            assert_eq!(&whole["units"][name], unit, "{name}");
        }
    }
    assert!(evaluated >= 6, "{evaluated} examples are short");
}

#[tokio::test(flavor = "multi_thread")]
async fn outputs_can_be_taken_at_output_cycles_and_may_have_no_value() {
    let server = Server::start().await;
    let names =
        json!(["wear_volume@1000", "wear_volume@3e4", "wear_volume", "events.until_reached"]);
    let history = server.compute(&steel_ball()).await.json();
    let result = server.get(history["links"]["result"].as_str().unwrap()).await.json();
    let volumes = &result["history"]["wear_volume"];
    let reply = server.post(PATH, &ball(&names)).await;
    assert_eq!(reply.header("cache-control"), Some("no-store"));
    let expected = json!({
        "outputs": {
            "wear_volume@1000": volumes[1], "wear_volume@3e4": volumes[4], "wear_volume": volumes[5],
            "events.until_reached": null,
        },
        "units": {
            "wear_volume@1000": "m^3", "wear_volume@3e4": "m^3", "wear_volume": "m^3",
            "events.until_reached": "1",
        },
        "reasons": {"events.until_reached": "this event did not happen"},
        "warnings": [],
    });
    assert_eq!(reply.json(), expected);

    let mut stopped = ball(&names);
    stopped["scenario"]["until"] = json!({"wear_volume": volumes[2]});
    let stopped = server.post(PATH, &stopped).await.json();
    assert_eq!(stopped["outputs"]["wear_volume"], volumes[2]);
    assert_eq!(stopped["outputs"]["wear_volume@3e4"], Value::Null);
    let end = stopped["outputs"]["events.until_reached"].as_f64().unwrap();
    assert!((end / 3000.0 - 1.0).abs() < 1e-9, "{end}");
    let reasons = json!({"wear_volume@3e4": "the run ended before this output cycle"});
    assert_eq!(stopped["reasons"], reasons);
}

#[tokio::test(flavor = "multi_thread")]
async fn all_faults_of_an_evaluation_are_listed() {
    let server = Server::start().await;
    let faults = async |body: &Value| -> Vec<(String, String)> {
        let problem = server.post(PATH, body).await.problem(422, "invalid-request");
        let errors = problem["errors"].as_array().unwrap().iter();
        let text = |value: &Value| value.as_str().unwrap().to_owned();
        errors.map(|error| (text(&error["pointer"]), text(&error["detail"]))).collect()
    };
    let mut body = ball(&json!(["wear_volumes", "wear_volume@5", 3, "cycles"]));
    body["scenario"]["friction"] = json!(-1);
    body["scenario"]["load"]["normal_force"] = json!("1 GPa");
    body["parts"] = json!(["history", "profile"]);
    body["label"] = json!("a job has labels");
    let mut found = faults(&body).await;
    found.sort();
    let pointers: Vec<_> = found.iter().map(|(pointer, _)| pointer.as_str()).collect();
    let expected = [
        "/label",
        "/outputs/0",
        "/outputs/2",
        "/parts/1",
        "/scenario/friction",
        "/scenario/load/normal_force",
    ];
    assert_eq!(pointers, expected);
    assert!(found[1].1.contains("Did you mean `wear_volume`?"), "{found:?}");

    // The output cycles are known although the scenario has a fault.
    let mut body = ball(&json!(["wear_volume", "wear_volume@5"]));
    body["scenario"]["friction"] = json!(-1);
    let pointers: Vec<_> = faults(&body).await.into_iter().map(|(pointer, _)| pointer).collect();
    assert_eq!(pointers, ["/outputs/1", "/scenario/friction"]);

    let many: Vec<_> = (0..101).map(|n| format!("wear_volume@{n}")).collect();
    for (body, pointer) in [
        (json!({"outputs": ["wear_volume"]}), "/scenario"),
        (json!({"scenario": steel_ball()["scenario"]}), "/outputs"),
        (ball(&json!([])), "/outputs"),
        (ball(&json!("wear_volume")), "/outputs"),
        (ball(&json!(["wear_volume", "cycles", "wear_volume"])), "/outputs/2"),
        (ball(&json!(["limit.wear_volume@1000"])), "/outputs/0"),
        (ball(&json!(many)), "/outputs"),
        (json!([]), ""),
    ] {
        let found = faults(&body).await;
        assert_eq!((found.len(), &*found[0].0), (1, pointer), "{found:?}");
    }
    server.send("POST", PATH, &[crate::server::JSON], "{").await.problem(400, "invalid-json");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_longer_run_is_refused_unless_no_run_is_needed() {
    let server = Server::start().await;
    let mut body = ball(&json!(["limit.wear_volume", "wear_volume"]));
    body["scenario"]["model"] = json!({"method": "exact", "tolerance": 1e-4});
    body["scenario"]["cycles"] = json!([1e7]);
    let problem = server.post(PATH, &body).await.problem(422, "too-expensive");
    let detail = problem["detail"].as_str().unwrap();
    assert!(
        detail.contains("the limit of an evaluation is 150 ms. Submit a job instead"),
        "{detail}"
    );

    body["outputs"] = json!(["limit.wear_volume", "unworn.slip_ratio"]);
    body["parts"] = json!(["check"]);
    let known = server.post(PATH, &body).await.json();
    let checked = server.post("/v1/scenarios", &json!({"scenario": body["scenario"]})).await.json();
    assert_eq!(known["check"], checked);
    let expected = json!({
        "limit.wear_volume": checked["limit"]["wear_volume"],
        "unworn.slip_ratio": checked["unworn"]["slip_ratio"],
    });
    let near = |name: &str| {
        let [a, b] = [&known["outputs"], &expected].map(|values| values[name].as_f64().unwrap());
        (a / b - 1.0).abs() < 1e-11
    };
    assert!(near("limit.wear_volume") && near("unworn.slip_ratio"), "{known} {expected}");

    // The comparison with the rule and the profiles are not computed if they are not returned.
    let mut body =
        json!({"scenario": example("steel-ball")["scenario"], "outputs": ["wear_volume"]});
    body["scenario"]["model"] = json!({"compare": true, "points": 4096});
    body["scenario"]["cycles"] = json!({"from": 100, "to": 1e5, "count": 20, "spacing": "log"});
    assert_eq!(server.post(PATH, &body).await.status, 200);
    body["parts"] = json!(["profiles"]);
    let problem = server.post(PATH, &body).await.problem(422, "too-expensive");
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains("Request fewer `parts`"), "{detail}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_evaluation_is_not_kept_and_works_while_the_server_drains() {
    let server = Server::start().await;
    let body = ball(&json!(["wear_volume"]));
    let first = server.post(PATH, &body).await.json();
    for list in ["jobs", "results"] {
        let kept = server.get(&format!("/v1/{list}")).await.json();
        assert_eq!(kept[list], json!([]), "{list}");
    }
    server.service.drain();
    assert_eq!(server.post("/v1/jobs", &steel_ball()).await.status, 503);
    assert_eq!(server.post(PATH, &body).await.json(), first);
}

#[tokio::test(flavor = "multi_thread")]
async fn evaluations_have_their_own_limit_for_each_key() {
    let (per_minute, evaluations) = (NonZeroU32::new(1000), NonZeroU32::new(3));
    let server = server(Limits { per_minute, evaluations, at_once: None }).await;
    let [anna, ben, eve] = [("anna", Role::Submit), ("ben", Role::Submit), ("eve", Role::Read)];
    let place = || server.place();
    let anna = made(place(), anna.0, anna.1).await;
    let (ben, eve) = (made(place(), ben.0, ben.1).await, made(place(), eve.0, eve.1).await);
    let body = ball(&json!(["wear_volume"])).to_string();
    for left in (0..3).rev() {
        let reply = ask(&server, &anna, "POST", PATH, &body).await;
        assert_eq!(reply.status, 200);
        assert_eq!(reply.header("ratelimit-policy"), Some("\"evaluations\";q=3;w=60"));
        assert_eq!(reply.header("ratelimit").unwrap(), format!("\"evaluations\";r={left};t=20"));
    }
    let refused = ask(&server, &anna, "POST", PATH, &body).await;
    let problem = refused.problem(429, "rate-limited");
    assert!(problem["detail"].as_str().unwrap().contains("3 evaluations per minute"), "{problem}");
    let wait: u32 = refused.header("retry-after").unwrap().parse().unwrap();
    assert!((1..=20).contains(&wait), "{wait}");
    let me = get(&server, &anna, "/v1/me").await.json();
    assert_eq!(me["usage"]["requests_left"], 999, "evaluations are no other requests");
    assert_eq!(ask(&server, &ben, "POST", PATH, &body).await.status, 200);
    ask(&server, &eve, "POST", PATH, &body).await.problem(403, "forbidden");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reader_gets_more_points_of_a_history_within_the_limit_of_evaluations() {
    let evaluations = NonZeroU32::new(2);
    let server = server(Limits { evaluations, ..Limits::default() }).await;
    let place = || server.place();
    let (anna, eve) =
        (made(place(), "anna", Role::Submit).await, made(place(), "eve", Role::Read).await);
    let submitted =
        ask(&server, &anna, "POST", "/v1/jobs", &example("steel-ball").to_string()).await;
    let path = submitted.json()["links"]["result"].as_str().unwrap().to_owned();
    let result = get(&server, &eve, &path).await.json();
    let smooth = get(&server, &eve, &format!("{path}/history/smooth")).await.json();
    let last = |history: &Value| {
        ["cycles", "wear_volume"]
            .map(|name| history[name].as_array().unwrap().last().unwrap().as_f64().unwrap())
    };
    for (own, stored) in [
        (&smooth["history"], &result["history"]),
        (&smooth["simplified"], &result["comparison"]["history"]),
    ] {
        assert_eq!(own["cycles"].as_array().unwrap().len(), 61);
        assert_eq!(own["cycles"][1], stored["cycles"][1]);
        let ([n, volume], [end, expected]) = (last(own), last(stored));
        assert!(n == end && (volume / expected - 1.0).abs() < 1e-3, "{volume} {expected}");
    }
    let nobody = format!("/v1/results/{}/history/smooth", "0".repeat(64));
    get(&server, &eve, &nobody).await.problem(404, "unknown-result");
    get(&server, &eve, &format!("{path}/history/smooth")).await.problem(429, "rate-limited");

    // A run that takes longer than an evaluation has no more points.
    let mut long = example("steel-ball");
    long["scenario"]["model"] = json!({"tolerance": 1e-4});
    let submitted = ask(&server, &anna, "POST", "/v1/jobs", &long.to_string()).await;
    let path = submitted.json()["links"]["result"].as_str().unwrap().to_owned();
    let smooth = get(&server, &anna, &format!("{path}/history/smooth")).await.json();
    assert_eq!(smooth, json!({"history": null, "simplified": null}));
}
