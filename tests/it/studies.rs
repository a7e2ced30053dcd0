//! Studies as jobs: their keys, rows, faults, limits and formats.

use std::collections::HashMap;
use std::env;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use fretwork::http::{Limits, Settings};
use fretwork::service::WorkLimits;
use fretwork_job::{Prepared, Task, TaskKind};
use fretwork_store::{Options, Role};
use fretwork_study::Kind;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::access::{self, ask, get, made};
use crate::keeping::eventually;
use crate::kill::Program;
use crate::moving::{assert_refused, export_all, import};
use crate::server::{JSON, Reply, Server, send, steel_ball};
use crate::store::{crash, raw};
use crate::trust::replace;

/// A sweep of the steel ball by the simplified rule: friction × amplitude, 2 × 3 points.
pub fn sweep() -> Value {
    let mut scenario = steel_ball()["scenario"].clone();
    scenario["motion"] = json!({"amplitude": "2 um"});
    scenario["cycles"] = json!([1000, 10000]);
    json!({"sweep": {
        "scenario": scenario,
        "vary": [
            {"pointer": "/friction", "values": [0.5, 0.7]},
            {"pointer": "/motion/amplitude", "from": "1 um", "to": "3 um", "count": 3},
        ],
        "outputs": ["wear_volume", "wear_depth@1000", "unworn.energy_ratio"],
    }})
}

/// The key and the job of a body that succeeds.
pub async fn computed(server: &Server, body: &Value) -> (String, Value) {
    let mut job = server.compute(body).await.json();
    if job["times"]["finished"].is_null() {
        // A fit has many stages, which are slow on a busy machine.
        job =
            server.get(&format!("{}?wait=60", job["links"]["self"].as_str().unwrap())).await.json();
    }
    assert_eq!(job["state"], "succeeded", "{job}");
    let key = job["key"].as_str().unwrap().to_owned();
    (key, job)
}

async fn table(server: &Server, key: &str, format: &str) -> Reply {
    let reply = server.get(&format!("/v1/results/{key}/table?format={format}")).await;
    assert_eq!(reply.status, 200, "{}", String::from_utf8_lossy(&reply.body));
    reply
}

#[tokio::test(flavor = "multi_thread")]
async fn each_row_of_a_study_has_the_outputs_of_a_single_evaluation() {
    let server = Server::start().await;
    let body = sweep();
    let (key, job) = computed(&server, &body).await;
    assert_eq!(job["summary"], json!({"points": 6, "refused": 0, "incomplete": 0}));
    let result = server.get(&format!("/v1/results/{key}")).await.json();
    let table = &result["table"];
    let names = body["sweep"]["outputs"].as_array().unwrap();
    for row in 0..6 {
        let mut scenario = body["sweep"]["scenario"].clone();
        scenario["friction"] = table["/friction"][row].clone();
        scenario["motion"]["amplitude"] = table["/motion/amplitude"][row].clone();
        let one = json!({"scenario": scenario, "outputs": names});
        let one = server.post("/v1/evaluate", &one).await.json();
        for name in names {
            let name = name.as_str().unwrap();
            assert_eq!(table[name][row], one["outputs"][name], "{name} in row {row}");
            assert_eq!(result["units"][name], one["units"][name], "{name}");
        }
    }
    let friction = json!([0.5, 0.5, 0.5, 0.7, 0.7, 0.7]);
    assert_eq!(
        (&table["/friction"], &table["reason"]),
        (&friction, &json!([null, null, null, null, null, null]))
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn units_and_defaults_do_not_change_the_key_of_a_study() {
    let server = Server::start().await;
    let (key, job) = computed(&server, &sweep()).await;
    assert_eq!(job["origin"], "computed");
    let mut other = sweep();
    other["sweep"]["scenario"]["motion"]["amplitude"] = json!(2e-6);
    other["sweep"]["vary"][1]["to"] = json!("0.003 mm");
    other["sweep"]["design"] = json!("grid");
    let (again, job) = computed(&server, &other).await;
    assert_eq!((&again, &job["origin"]), (&key, &json!("cached")));
    // The canonical form, as the server returns it, has the same key too.
    let result = server.get(&format!("/v1/results/{key}")).await.json();
    let checked = server.post("/v1/scenarios", &json!({"sweep": result["sweep"]})).await.json();
    assert_eq!((&checked["key"], &checked["cached"]), (&json!(key), &json!(true)));
    assert_eq!(checked["cost"]["points"], 6);
    assert_eq!(checked["sweep"], result["sweep"]);
    let mut seeded = sweep();
    seeded["sweep"]["vary"] = json!([{"pointer": "/friction", "from": 0.5, "to": 0.7}]);
    seeded["sweep"]["design"] = json!("sobol");
    seeded["sweep"]["samples"] = json!(4);
    let (first, _) = computed(&server, &seeded).await;
    seeded["sweep"]["seed"] = json!(1);
    let (second, _) = computed(&server, &seeded).await;
    assert_ne!(first, second);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_study_is_kept_as_typed_and_found_as_a_study() {
    let server = Server::start().await;
    let (key, job) = computed(&server, &sweep()).await;
    computed(&server, &steel_ball()).await;
    let address = format!("{}?include=scenario,submitted", job["links"]["self"].as_str().unwrap());
    let job = server.get(&address).await.json();
    assert_eq!(job["submitted"], sweep()["sweep"]);
    assert_eq!(job["sweep"]["vary"][1]["to"], json!(3e-6));
    assert!(job.get("scenario").is_none());
    for (kind, found) in [("sweep", true), ("run", false)] {
        let list = server.get(&format!("/v1/results?kind={kind}")).await.json();
        let list = list["results"].as_array().unwrap();
        assert_eq!((list.len(), list[0]["key"] == json!(key)), (1, found), "{kind}");
    }
    let difference = server.post("/v1/results/diff", &json!({"a": {"key": key}})).await;
    assert_eq!(difference.problem(422, "invalid-request")["errors"][0]["pointer"], "/b");
    let mut other = sweep();
    other["sweep"]["vary"][0]["values"][1] = json!(0.8);
    let (other, _) = computed(&server, &other).await;
    let difference = server.post("/v1/results/diff", &json!({"keys": [key, other]})).await.json();
    assert_eq!(difference["parameters"][0]["pointer"], "/vary/0/values/1");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_table_is_the_same_in_every_format() {
    let server = Server::start().await;
    let mut body = sweep();
    body["sweep"]["vary"][0]["values"][0] = json!(-0.5);
    let (key, job) = computed(&server, &body).await;
    assert_eq!(job["summary"], json!({"points": 6, "refused": 3, "incomplete": 0}));
    let columns = table(&server, &key, "json").await.json();
    let reason = columns["table"]["reason"][0].as_str().unwrap();
    assert!(reason.starts_with("/friction: must be greater than 0"), "{reason}");
    let records = server.get(&format!("/v1/results/{key}/table?layout=records")).await.json();
    let csv = String::from_utf8(table(&server, &key, "csv").await.body).unwrap();
    let csv: Vec<&str> = csv.lines().filter(|line| !line.starts_with('#')).collect();
    assert_eq!(
        csv[0],
        "/friction,/motion/amplitude[m],wear_volume[m^3],wear_depth@1000[m],unworn.energy_ratio,reason"
    );
    let lines = String::from_utf8(table(&server, &key, "ndjson").await.body).unwrap();
    for (row, (csv, line)) in csv[1..].iter().zip(lines.lines()).enumerate() {
        let line: Value = serde_json::from_str(line).unwrap();
        let volume = &columns["table"]["wear_volume"][row];
        assert_eq!(&records["records"][row]["wear_volume"], volume);
        assert_eq!(&line["wear_volume[m^3]"], volume);
        let cell = csv.split(',').nth(2).unwrap();
        assert_eq!(cell, volume.as_f64().map_or(String::new(), |volume| json!(volume).to_string()));
    }
    for format in ["npz", "arrow"] {
        assert!(table(&server, &key, format).await.body.len() > 500);
    }
    for part in ["history", "profiles", "loops"] {
        server.get(&format!("/v1/results/{key}/{part}")).await.problem(404, "no-such-part");
    }
    let (run, _) = computed(&server, &steel_ball()).await;
    server.get(&format!("/v1/results/{run}/table")).await.problem(404, "no-such-part");
}

#[tokio::test(flavor = "multi_thread")]
async fn profiles_of_a_sweep_are_the_same_in_every_format() {
    let server = Server::start().await;
    let mut body = sweep();
    body["sweep"]["vary"][0]["values"] = json!([-0.5, 0.7]);
    body["sweep"]["profiles"] = json!({
        "radius": [0, "100 um", "1 mm"], "fields": ["wear", "slip"]});
    let (key, _) = computed(&server, &body).await;
    let path = format!("/v1/results/{key}/profiles");
    let columns = server.get(&path).await.json();
    let curves = &columns["profiles"];
    assert_eq!(curves["radius"], json!([0.0, 1e-4, 1e-3]));
    assert_eq!(curves["wear"][0], json!([null, null, null]), "the first friction is refused");
    let wear = curves["wear"][5][1].as_f64().unwrap();
    assert!(wear > 0.0 && curves["wear"][5][2] == 0.0, "{curves}");
    assert_eq!(curves["slip"][5][2], Value::Null, "the radii of the run end before");
    let records = server.get(&format!("{path}?layout=records")).await.json();
    let found = &records["records"][5 * 3 + 1];
    assert_eq!((&found["point"], &found["wear"]), (&json!(5.0), &json!(wear)));
    let csv = String::from_utf8(server.get(&format!("{path}?format=csv")).await.body).unwrap();
    let csv: Vec<&str> = csv.lines().filter(|line| !line.starts_with('#')).collect();
    assert_eq!((csv[0], csv.len()), ("point,radius[m],wear[m],slip[m]", 1 + 6 * 3));
    assert_eq!(csv[1], "0.0,0.0,,");
    assert!(csv[1 + 5 * 3 + 1].starts_with(&format!("5.0,0.0001,{wear:e},")), "{}", csv[17]);
    let lines = String::from_utf8(server.get(&format!("{path}?format=ndjson")).await.body).unwrap();
    assert_eq!(lines.lines().count(), 6 * 3);
    for format in ["npz", "arrow"] {
        assert!(server.get(&format!("{path}?format={format}")).await.body.len() > 500);
    }
    let engineering = format!("{path}?units=engineering&fields=wear&points=2");
    let engineering = server.get(&engineering).await.json();
    assert_eq!(engineering["profiles"]["radius"], json!([0.0, 1000.0]));
    assert_eq!(engineering["profiles"].as_object().unwrap().len(), 3);
    server.get(&format!("{path}?cycles=1000")).await.problem(422, "invalid-parameters");
    let first = server.get(&format!("/v1/results/{key}?rows=4")).await.json();
    assert_eq!(first["profiles"]["radius"], curves["radius"]);
    assert_eq!(first["profiles"]["point"], json!([0.0, 1.0, 2.0, 3.0]));
    assert_eq!(first["profiles"]["wear"], json!(curves["wear"].as_array().unwrap()[..4]));

    let (plain, _) = computed(&server, &sweep()).await;
    let problem = server.get(&format!("/v1/results/{plain}/profiles")).await;
    let problem = problem.problem(404, "no-such-part");
    assert!(problem["detail"].as_str().unwrap().contains("with `profiles`"), "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn every_fault_of_a_study_is_listed_with_its_pointer() {
    let server = Server::start().await;
    let refused = async |body: &Value| {
        let reply = server.post("/v1/jobs", body).await;
        let problem = reply.problem(422, "invalid-request");
        let mut faults: Vec<(String, String)> = Vec::new();
        for fault in problem["errors"].as_array().unwrap() {
            let text = |member: &str| fault[member].as_str().unwrap().to_owned();
            faults.push((text("pointer"), text("detail")));
        }
        faults.sort_unstable();
        faults
    };
    let mut body = sweep();
    body["label"] = json!("");
    body["sweep"]["scenario"]["friction"] = json!(-1);
    body["sweep"]["vary"][0]["pointer"] = json!("/frction");
    body["sweep"]["vary"][1]["to"] = json!("3 GPa");
    body["sweep"]["outputs"][1] = json!("wear_deph");
    let faults = refused(&body).await;
    let pointers: Vec<&str> = faults.iter().map(|(pointer, _)| pointer.as_str()).collect();
    let expected = [
        "/label",
        "/sweep/outputs/1",
        "/sweep/scenario/friction",
        "/sweep/vary/0/pointer",
        "/sweep/vary/1/to",
    ];
    assert_eq!(pointers, expected);
    assert!(faults[3].1.contains("Did you mean `/friction`?"), "{}", faults[3].1);

    let mut both = sweep();
    both["scenario"] = steel_ball()["scenario"].clone();
    assert!(refused(&both).await[0].1.contains("Submit two jobs"));
    let neither = refused(&json!({"label": "nothing"})).await;
    assert_eq!(neither[0].0, "/scenario");
    assert!(neither[0].1.contains("`sweep`"), "{}", neither[0].1);

    let mut large = sweep();
    for place in [0, 1] {
        let pointer = sweep()["sweep"]["vary"][place]["pointer"].clone();
        large["sweep"]["vary"][place] =
            json!({"pointer": pointer, "from": 1e-6, "to": 2e-6, "count": 31_623});
    }
    let faults = refused(&large).await;
    assert_eq!(faults[0].0, "/sweep/vary");
    assert!(faults[0].1.starts_with("gives 1000014129 points"), "{}", faults[0].1);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_small_body_that_needs_much_work_is_refused() {
    let server = Server::start().await;
    let count =
        |pointer: &str| json!({"pointer": pointer, "from": 1.0, "to": 2.0, "count": 100_000});
    let mut body = sweep();
    body["sweep"]["scenario"]["cycles"] = json!((1..=100).collect::<Vec<_>>());
    let many = (0..100).map(|place| count(&format!("/cycles/{place}")));
    body["sweep"]["vary"] = many.collect();
    body["sweep"]["design"] = json!("zip");
    let problem = server.post("/v1/scenarios", &body).await.problem(422, "invalid-request");
    let fault = &problem["errors"][0];
    assert_eq!(fault["pointer"], "/sweep/vary");
    assert!(fault["detail"].as_str().unwrap().starts_with("has 10000000 values"), "{fault}");

    let (key, _) = computed(&server, &steel_ball()).await;
    let twice = format!("/v1/results/{key}/derivatives?parameters=/friction,/friction");
    assert!(
        server.get(&twice).await.problem(422, "invalid-parameters")["errors"]
            .to_string()
            .contains("twice")
    );
    let many = vec!["wear_volume"; 101].join(",");
    let many = format!("/v1/results/{key}/derivatives?outputs={many}");
    assert!(
        server.get(&many).await.problem(422, "invalid-parameters")["errors"]
            .to_string()
            .contains("at most 100")
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn impossible_amplitudes_of_a_map_are_rows_with_reasons() {
    let server = Server::start().await;
    let scenario = sweep()["sweep"]["scenario"].clone();
    let map = json!({"map": {
        "scenario": scenario,
        "normal_force": {"from": "50 N", "to": "100 N", "count": 2},
        "amplitude": {"from": "-1 um", "to": "3 um", "count": 5},
    }});
    let (key, job) = computed(&server, &map).await;
    assert_eq!(job["summary"]["refused"], 4, "{job}");
    let table = table(&server, &key, "json").await.json()["table"].take();
    let reason = table["reason"][0].as_str().unwrap();
    assert!(reason.starts_with("/motion/amplitude: must be from 1e-12 to 1e6 m"), "{reason}");
    assert_eq!(table["regime"][0], Value::Null);
    assert!(table["regime"][2].is_string() && table["reason"][2].is_null());
}

#[tokio::test(flavor = "multi_thread")]
async fn the_refusal_of_a_study_beyond_a_limit_states_its_size() {
    let study = Some(Duration::from_hours(1));
    let limits = WorkLimits { study, study_points: 5, study_bytes: 5000, ..WorkLimits::default() };
    let (settings, options) = (Settings::default(), Options::default());
    let server = Server::limited(
        TempDir::new().unwrap(),
        Arc::new(Task::start),
        limits,
        &settings,
        &options,
    )
    .await;
    let reply = server.post("/v1/jobs", &sweep()).await;
    let problem = reply.problem(422, "too-expensive");
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains("has 6 points, and the limit of this server is 5"), "{detail}");
    let checked = server.post("/v1/scenarios", &sweep()).await.json();
    assert_eq!(checked["excess"], json!(detail));
    assert_eq!(checked["time"], json!({"seconds": checked["cost"]["seconds"], "limit": 3600.0}));
    let checked = server.post("/v1/scenarios", &steel_ball()).await.json();
    assert!(checked["time"]["seconds"].as_f64().unwrap() > 0.0, "{}", checked["time"]);
    assert_eq!(checked["time"]["limit"], Value::Null);
    assert_eq!(checked.get("excess"), Some(&json!(null)));
    let mut small = sweep();
    small["sweep"]["vary"][1]["count"] = json!(2);
    let problem = server.post("/v1/jobs", &small).await.problem(422, "too-expensive");
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains("could have 0.0 MB"), "{detail}");
    let version = server.get("/version").await.json();
    assert_eq!(
        (&version["limits"]["study_points"], &version["limits"]["study_bytes"]),
        (&json!(5), &json!(5000))
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_repeated_submission_of_a_study_is_one_job() {
    let server = Server::start().await;
    let headers = [JSON, ("Prefer", "wait=60"), ("Idempotency-Key", "\"once\"")];
    let submit =
        async |body: Value| server.send("POST", "/v1/jobs", &headers, body.to_string()).await;
    let first = submit(sweep()).await.json();
    let second = submit(sweep()).await.json();
    assert_eq!(first["id"], second["id"]);
    submit(steel_ball()).await.problem(422, "idempotency-key-reused");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_exported_study_is_imported_and_a_changed_one_is_not() {
    let (from, to) = (Server::start().await, Server::start().await);
    let (key, _) = computed(&from, &sweep()).await;
    let file = from.dir.path().join("studies.zst");
    export_all(&from, &file).await;
    let changed = from.dir.path().join("changed.zst");
    fs::copy(&file, &changed).unwrap();
    let body = String::from_utf8(from.get(&format!("/v1/results/{key}")).await.body).unwrap();
    let volume = body.split("\"wear_volume\":[").nth(1).unwrap().split(',').next().unwrap();
    replace(&changed, &key, &body.replacen(volume, "1e-15", 1));
    let done = import(to.place(), &changed).await.unwrap();
    assert_refused(&done, &key, "wear_volume[0]: the file has 1e-15, this server computes ");
    let done = import(to.place(), &file).await.unwrap();
    assert_eq!(done.results, 1);
    let address = format!("/v1/results/{key}");
    assert_eq!(from.get(&address).await.body, to.get(&address).await.body);
    let (_, job) = computed(&to, &sweep()).await;
    assert_eq!(job["origin"], "cached");
}

/// An example in `examples/studies`.
pub fn example(name: &str) -> Value {
    let directory = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/studies");
    let text = fs::read_to_string(format!("{directory}/{name}.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_sensitivity_study_answers_with_its_indices() {
    let server = Server::start().await;
    let mut body = example("sensitivity");
    body["sensitivity"]["samples"] = json!(64);
    let (key, job) = computed(&server, &body).await;
    assert_eq!(job["summary"], json!({"points": 384, "refused": 0, "incomplete": 0}));
    let result = server.get(&format!("/v1/results/{key}")).await.json();
    let indices = &result["table"];
    assert_eq!(indices["member"][1], "/wear/coefficient");
    let total = |place: usize| indices["total"][place].as_f64().unwrap();
    assert!(total(1) > total(0) && total(1) > 0.4, "{indices}");
    assert_eq!(result["samples"]["wear_volume"].as_array().unwrap().len(), 384);
    let csv = String::from_utf8(table(&server, &key, "csv").await.body).unwrap();
    let csv: Vec<&str> = csv.lines().filter(|line| !line.starts_with('#')).collect();
    let names = "output,unit,member,first_order,first_order_low,first_order_high,total,total_low,total_high";
    assert_eq!((csv[0], csv.len()), (names, 1 + 3 * 4));
    let rounded = format!("/v1/results/{key}?digits=3&units=engineering");
    let rounded = server.get(&rounded).await.json();
    assert_eq!(
        (&rounded["notes"], &rounded["units"]["wear_volume"]),
        (&result["notes"], &json!("mm^3"))
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_can_read_the_first_rows_only() {
    let server = Server::start().await;
    let mut body = example("sensitivity");
    body["sensitivity"]["samples"] = json!(64);
    let (key, _) = computed(&server, &body).await;
    let address = format!("/v1/results/{key}");
    let whole = server.get(&address).await.json();
    let part = server.get(&format!("{address}?rows=3")).await.json();
    for (name, value) in whole.as_object().unwrap() {
        if !["table", "samples"].contains(&name.as_str()) {
            assert_eq!(&part[name], value, "{name}");
            continue;
        }
        for (column, rows) in value.as_object().unwrap() {
            let rows = rows.as_array().unwrap();
            assert!(rows.len() > 3, "{name} {column}");
            assert_eq!(part[name][column], json!(rows[..3]), "{name} {column}");
        }
    }
    let table = server.get(&format!("{address}/table?rows=0&layout=records")).await.json();
    assert_eq!(table["records"], json!([]));
    for rows in ["-1", "many"] {
        let reply = server.get(&format!("{address}?rows={rows}")).await;
        assert_eq!(reply.problem(422, "invalid-parameters")["errors"][0]["parameter"], "rows");
    }
    // A run has no rows. So the parameter changes neither the answer nor its ETag.
    let (run, _) = computed(&server, &steel_ball()).await;
    let whole = server.get(&format!("/v1/results/{run}")).await;
    let part = server.get(&format!("/v1/results/{run}?rows=3")).await;
    assert_eq!((part.header("etag"), &part.body), (whole.header("etag"), &whole.body));
    server.get(&format!("/v1/results/{run}/table?rows=3")).await.problem(404, "no-such-part");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_statistics_of_a_random_sample_are_those_of_a_known_distribution() {
    const POINTS: u32 = 4096;
    let server = Server::start().await;
    let mut body = sweep();
    // In gross slip, the wear volume of one cycle is proportional to the wear coefficient.
    body["sweep"]["scenario"]["motion"]["amplitude"] = json!("20 um");
    body["sweep"]["scenario"]["friction"] = json!(0.1);
    body["sweep"]["scenario"]["cycles"] = json!([1]);
    let one =
        json!({"scenario": body["sweep"]["scenario"], "outputs": ["wear_volume", "stick_radius"]});
    let one = server.post("/v1/evaluate", &one).await.json();
    assert_eq!(one["outputs"]["stick_radius"], 0.0);
    let normal = json!({"normal": {"mean": 3.03e-14, "standard_deviation": 3.03e-15}});
    body["sweep"]["vary"] = json!([{"pointer": "/wear/coefficient", "distribution": normal}]);
    body["sweep"]["outputs"] = json!(["unworn.stick_radius", "wear_volume@1"]);
    body["sweep"]["design"] = json!("latin_hypercube");
    body["sweep"]["samples"] = json!(POINTS);
    let (key, _) = computed(&server, &body).await;
    let count = f64::from(POINTS);

    let address = format!("/v1/results/{key}");
    let found = server.get(&format!("{address}/statistics?layout=records")).await.json();
    let found = &found["records"][1];
    assert_eq!((&found["output"], &found["unit"]), (&json!("wear_volume@1"), &json!("m^3")));
    assert_eq!(found["points"], count);
    let middle = one["outputs"]["wear_volume"].as_f64().unwrap();
    let deviation = 0.1 * middle;
    // A percentile at share p, z deviations from the mean, has the standard error √(p (1 − p) / n) / density(z).
    for (name, share, z) in [
        ("percentile_2_5", 0.025, -1.959_964),
        ("percentile_5", 0.05, -1.644_854),
        ("percentile_10", 0.1, -1.281_552),
        ("percentile_25", 0.25, -0.674_490),
        ("median", 0.5, 0.0),
        ("percentile_75", 0.75, 0.674_490),
        ("percentile_90", 0.9, 1.281_552),
        ("percentile_95", 0.95, 1.644_854),
        ("percentile_97_5", 0.975, 1.959_964),
    ] {
        let density = f64::exp(-0.5 * z * z) / (2.0 * std::f64::consts::PI).sqrt();
        let error = deviation * f64::sqrt(share * (1.0 - share) / count) / density;
        let difference = found[name].as_f64().unwrap() - (middle + z * deviation);
        assert!(difference.abs() < error, "{name}: {difference} {error} {found}");
    }
    let known = [
        ("mean", middle, deviation),
        ("standard_deviation", deviation, deviation / 2.0_f64.sqrt()),
    ];
    for (name, known, spread) in known {
        let difference = found[name].as_f64().unwrap() - known;
        assert!(difference.abs() < spread / count.sqrt(), "{name}: {found}");
    }

    let bins = server.get(&format!("{address}/histogram")).await.json();
    let points = bins["histogram"]["points"].as_array().unwrap().iter().filter_map(Value::as_f64);
    // The first output is 0 in all points, so it has one bin.
    assert_eq!(points.clone().sum::<f64>(), 2.0 * count);
    assert_eq!((points.clone().next(), points.count()), (Some(count), 1 + 50));
    let csv = server.get(&format!("{address}/statistics?format=csv&units=engineering")).await;
    let csv = csv.text();
    assert!(csv.contains("\n\"wear_volume@1\",\"mm^3\",4096.0,"), "{csv}");
    let (run, _) = computed(&server, &steel_ball()).await;
    server.get(&format!("/v1/results/{run}/statistics")).await.problem(404, "no-such-part");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_map_answers_with_regimes_and_wear() {
    let server = Server::start().await;
    let mut body = example("map");
    for axis in ["normal_force", "amplitude"] {
        body["map"][axis]["count"] = json!(5);
    }
    let (key, job) = computed(&server, &body).await;
    assert_eq!(job["summary"]["points"], 25);
    let result = server.get(&format!("/v1/results/{key}")).await.json();
    assert_eq!(result["boundary"]["/motion/amplitude"].as_array().unwrap().len(), 5);
    let (regimes, wear) = (&result["table"]["regime"], &result["table"]["wear_volume"]);
    assert_eq!((&regimes[4], &regimes[20]), (&json!("gross_slip"), &json!("partial_slip")));
    assert!(wear[1].as_f64() > wear[0].as_f64(), "{wear}");
    for format in ["json", "csv", "ndjson", "npz", "arrow"] {
        assert!(!table(&server, &key, format).await.body.is_empty());
    }
    let list = server.get("/v1/results?kind=map").await.json();
    assert_eq!(list["results"][0]["key"], json!(key));
    body["map"]["amplitude"]["to"] = json!("1 N");
    let refused = server.post("/v1/jobs", &body).await.problem(422, "invalid-request");
    assert_eq!(refused["errors"][0]["pointer"], "/map/amplitude/to");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_fit_that_workers_compute_in_stages_equals_that_of_one_process() {
    let server = Server::start().await;
    let mut body = example("fit");
    body["fit"]["starts"] = json!(2);
    let (key, job) = computed(&server, &body).await;
    let found = server.get(&format!("/v1/results/{key}")).await;
    let asked = Prepared::read(TaskKind::Study(Kind::named("fit").unwrap()), body["fit"].take());
    let prepared = asked.unwrap();
    assert!(prepared.chunks().is_some_and(|chunks| chunks.get() == job["summary"]["points"]));
    assert_eq!(found.body, prepared.compute(|_| {}).body);
    for format in ["csv", "ndjson", "npz", "arrow"] {
        assert!(!table(&server, &key, format).await.body.is_empty());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_result_of_a_private_study_is_shared() {
    let server = access::server(Limits::default()).await;
    let anna = made(server.place(), "anna", Role::Submit).await;
    let ben = made(server.place(), "ben", Role::Submit).await;
    let eve = made(server.place(), "eve", Role::Read).await;
    let mut body = sweep();
    body["private"] = json!(true);
    let body = body.to_string();
    ask(&server, &eve, "POST", "/v1/jobs", &body).await.problem(403, "forbidden");
    let job = ask(&server, &anna, "POST", "/v1/jobs", &body).await.json();
    assert_eq!(job["state"], "succeeded", "{job}");
    let address = job["links"]["self"].as_str().unwrap();
    let result = job["links"]["result"].as_str().unwrap();
    for key in [&ben, &eve] {
        get(&server, key, address).await.problem(404, "not-found");
        assert_eq!(get(&server, key, &format!("{result}/table?format=csv")).await.status, 200);
    }
    let link = ask(&server, &anna, "POST", &format!("{result}/links"), "").await.json();
    let (path, credentials) = link["url"].as_str().unwrap().split_once('?').unwrap();
    let linked = server.get(&format!("{path}/table?{credentials}")).await;
    assert_eq!(linked.status, 200, "{}", linked.text());
    server.get(&format!("{path}/table")).await.problem(401, "unauthorized");
}

/// A sweep with many chunks.
pub fn long_sweep(points: u32) -> Value {
    let mut body = sweep();
    body["sweep"]["vary"] = json!([
        {"pointer": "/friction", "from": 0.4, "to": 0.8, "count": points / 10},
        {"pointer": "/motion/amplitude", "from": "1 um", "to": "2 um", "count": 10}]);
    body
}

/// Waits until a computation uses hardly any processor time.
pub async fn until_idle(processor_time: impl Fn() -> Duration) {
    eventually(async || {
        let before = processor_time();
        tokio::time::sleep(Duration::from_millis(300)).await;
        processor_time().saturating_sub(before) < Duration::from_millis(30)
    })
    .await;
}

/// Processor time of a process since its start.
pub fn processor_time(process: u32) -> Duration {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).unwrap();
    // The fields after the name in parentheses: state, …, utime, stime in ticks of 10 ms.
    let times = stat.rsplit_once(") ").unwrap().1.split(' ').skip(11).take(2);
    Duration::from_millis(10 * times.map(|ticks| ticks.parse::<u64>().unwrap()).sum::<u64>())
}

/// Submits a study to the program; returns its job.
async fn submitted(server: &Program, body: &Value) -> Value {
    let reply = send(server.address, "POST", "/v1/jobs", &[JSON], body.to_string()).await.unwrap();
    assert_eq!(reply.status, 202);
    reply.json()
}

/// The chunks in the database whose rows are stored, with the number of claims of each.
async fn chunks_done(dir: &Path) -> HashMap<i64, i64> {
    let copy = crash(dir);
    let sql = "SELECT number, attempt FROM chunk WHERE state = 'done'";
    let rows: Vec<(i64, i64)> =
        sqlx::query_as(sql).fetch_all(&mut raw(copy.path()).await).await.unwrap();
    rows.into_iter().collect()
}

/// Kills the server ten times, each time after it has stored another part of the study. On a busy machine the study may end
/// after fewer kills. Returns the last server.
async fn kill_after_each_step(dir: &Path, mut server: Program, job: &Value) -> Program {
    let (mut progress, mut done) = (0.0, HashMap::new());
    for kills in 0..10 {
        let shown = loop {
            let job = server.get(job["links"]["self"].as_str().unwrap()).await.json();
            if job["times"]["finished"].is_string() {
                assert!(kills >= 3, "the study ended after {kills} kills");
                return server;
            }
            let shown = job["progress"].as_f64().unwrap();
            assert!(shown >= progress, "the progress fell from {progress} to {shown}");
            if shown > progress {
                break shown;
            }
        };
        server.kill();
        let now = chunks_done(dir).await;
        for (number, attempt) in &done {
            assert_eq!(now.get(number), Some(attempt), "chunk {number} was stored before");
        }
        (progress, done) = (shown, now);
        server = Program::start(dir, "2");
    }
    server
}

/// This takes more than 5 s, because the server starts ten times, and each study is computed twice.
#[tokio::test(flavor = "multi_thread")]
async fn a_study_continues_after_each_of_ten_kills() {
    let studies = if env::var_os("FRETWORK_TEST_LONG").is_some() { 10 } else { 1 };
    for number in 0..studies {
        // Each study has another number of points, so its chunks differ from those of the others.
        let body = long_sweep(60_000 + 1230 * number);
        let dir = TempDir::new().unwrap();
        let server = Program::start(dir.path(), "2");
        let job = submitted(&server, &body).await;
        let server = kill_after_each_step(dir.path(), server, &job).await;
        let job = server.ended(job["id"].as_str().unwrap()).await;
        assert_eq!((&job["state"], &job["attempt"]), (&json!("succeeded"), &json!(1)), "{job}");
        let interrupted = server.result(&job).await;
        server.end();

        // One worker that is not interrupted makes the same bytes.
        let dir = TempDir::new().unwrap();
        let server = Program::start(dir.path(), "1");
        let job = submitted(&server, &body).await;
        let job = server.ended(job["id"].as_str().unwrap()).await;
        assert!(server.result(&job).await == interrupted, "the results differ");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cancelled_study_stops_using_the_processor() {
    let dir = TempDir::new().unwrap();
    let server = Program::start(dir.path(), "2");
    let job = submitted(&server, &long_sweep(100_000)).await;
    let address = job["links"]["self"].as_str().unwrap();
    while server.get(address).await.json()["progress"] == json!(0.0) {}
    let reply = send(server.address, "POST", &format!("{address}/cancel"), &[], "").await;
    assert_eq!(reply.unwrap().json()["state"], "canceled");
    let before = processor_time(server.child.id());
    until_idle(|| processor_time(server.child.id())).await;
    // The whole study takes many times as long as its first chunks.
    let after = processor_time(server.child.id()).saturating_sub(before);
    assert!(after < before, "it used {before:?} before its cancellation, and then {after:?}");
}
