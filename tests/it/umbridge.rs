//! UM-Bridge: its numbers, its errors, its keys and limits, and a port of its own.

use std::f64::consts::PI;
use std::io::{BufRead as _, BufReader};
use std::num::NonZeroU32;
use std::process::{Command, Stdio};

use data_encoding::BASE64;
use fretwork::http::Limits;
use fretwork_store::Role;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::access::{made, server};
use crate::program::Running;
use crate::server::{Reply, Server, send, steel_ball};

const CALLS: [&str; 7] = [
    "/ModelInfo",
    "/InputSizes",
    "/OutputSizes",
    "/Evaluate",
    "/Gradient",
    "/ApplyJacobian",
    "/ApplyHessian",
];

/// Calls the server as the Python client does: without a content type.
async fn call(server: &Server, path: &str, body: &Value) -> Reply {
    server.send("POST", path, &[], body.to_string()).await
}

/// Asserts an error of the protocol, and returns its message.
fn error(reply: &Reply, status: u16, kind: &str) -> String {
    let document = reply.json();
    assert_eq!(reply.status, status, "{document}");
    assert_eq!(reply.header("content-type"), Some("application/json"));
    let message = document["error"]["message"].as_str().unwrap();
    assert_eq!(document, json!({"error": {"type": kind, "message": message}}));
    message.to_owned()
}

fn config(parameters: &Value, outputs: &Value) -> Value {
    json!({"scenario": steel_ball()["scenario"], "parameters": parameters, "outputs": outputs})
}

#[tokio::test(flavor = "multi_thread")]
async fn an_evaluation_returns_the_numbers_of_the_result() {
    let server = Server::start().await;
    let info = server.get("/Info").await.json();
    assert_eq!(info, json!({"protocolVersion": 1.0, "models": ["wear", "log_likelihood"]}));
    let support = call(&server, "/ModelInfo", &json!({"name": "wear"})).await.json();
    let expected = json!({"support": {
        "Evaluate": true, "Gradient": true, "ApplyJacobian": true, "ApplyHessian": false}});
    assert_eq!(support, expected);

    let mut job = steel_ball();
    job["scenario"]["friction"] = json!(0.6);
    job["scenario"]["motion"]["amplitude"] = json!(3e-6);
    let link = server.compute(&job).await.json()["links"]["result"].clone();
    let result = server.get(link.as_str().unwrap()).await.json();
    let expected = json!({"output": [[
        result["history"]["wear_volume"][5], result["history"]["wear_depth"][1],
        result["limit"]["wear_volume"]]]});
    let config = config(
        &json!(["/friction", "/motion/amplitude"]),
        &json!(["wear_volume", "wear_depth@1000", "limit.wear_volume"]),
    );
    // The second call finds the model in memory.
    for _ in 0..2 {
        let sizes = json!({"name": "wear", "config": config});
        let inputs = call(&server, "/InputSizes", &sizes).await.json();
        assert_eq!(inputs, json!({"inputSizes": [2]}));
        let outputs = call(&server, "/OutputSizes", &sizes).await.json();
        assert_eq!(outputs, json!({"outputSizes": [3]}));
        let body = json!({"name": "wear", "input": [[0.6, 3e-6]], "config": config});
        assert_eq!(call(&server, "/Evaluate", &body).await.json(), expected);
    }
    // Without a config, the model has the scenario of the example.
    let known = server.compute(&steel_ball()).await.json()["links"]["result"].clone();
    let known = server.get(known.as_str().unwrap()).await.json();
    let expected = json!({"output": [[known["history"]["wear_volume"][5]]]});
    for config in [json!(null), json!({})] {
        let body = json!({"name": "wear", "input": [[0.7]], "config": config});
        assert_eq!(call(&server, "/Evaluate", &body).await.json(), expected);
    }
}

/// Hertz: a = (3FR/4E)^⅓, p₀ = 3F/(2πa²).
#[tokio::test(flavor = "multi_thread")]
async fn gradients_agree_with_the_closed_form() {
    let server = Server::start().await;
    let mut config = config(
        &json!(["/load/normal_force", "/profile/radius"]),
        &json!(["scales.contact_radius", "unworn.peak_pressure"]),
    );
    let object = config["scenario"].as_object_mut().unwrap();
    object.remove("bodies");
    object.insert("moduli".into(), json!({"normal": 113e9, "tangential": 93e9}));
    let (force, radius) = (80.0, 0.02);
    let contact = (0.75_f64 * force * radius / 113e9).cbrt();
    let peak = 1.5 * force / (PI * contact * contact);
    let slopes = [
        [contact / (3.0 * force), contact / (3.0 * radius)],
        [peak / (3.0 * force), -2.0 * peak / (3.0 * radius)],
    ];
    let ask = async |path: &str, name: &str, weights: [f64; 2]| -> Vec<f64> {
        let mut body = json!({"name": "wear", "input": [[force, radius]], "config": config,
            "outWrt": 0, "inWrt": 0});
        body[name] = json!(weights);
        let answer = call(&server, path, &body).await.json();
        serde_json::from_value(answer["output"].clone()).unwrap_or_else(|_| panic!("{answer}"))
    };
    for [a, b] in [[1.0, 0.0], [0.0, 1.0], [1e10, -2.5]] {
        let gradient = ask("/Gradient", "sens", [a, b]).await;
        let product = ask("/ApplyJacobian", "vec", [a, b]).await;
        for i in 0..2 {
            for (found, [first, second]) in [
                (gradient[i], [a * slopes[0][i], b * slopes[1][i]]),
                (product[i], [a * slopes[i][0], b * slopes[i][1]]),
            ] {
                let scale = first.abs().max(second.abs());
                let expected = first + second;
                assert!((found - expected).abs() <= 1e-8 * scale, "{found} {expected}");
            }
        }
    }
    assert_eq!(ask("/Gradient", "sens", [0.0, 0.0]).await, [0.0, 0.0]);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_log_likelihood_of_a_stored_fit_has_a_gradient() {
    let server = Server::start().await;
    let mut scenario = steel_ball()["scenario"].clone();
    scenario["cycles"] = json!([10_000]);
    let data = json!({"output": "wear_volume", "relative": 0.05, "x": [3e3, 1e4, 3e4],
        "y": ["3.3e-5 mm^3", "7.5e-5 mm^3", "2.1e-4 mm^3"]});
    let fit = json!({"fit": {"scenario": scenario, "starts": 1, "tests": [{"data": [data]}],
        "parameters": [{"pointer": "/wear/coefficient", "from": 1e-16, "to": 1e-12, "spacing": "log"}]}});
    let link = server.compute(&fit).await.json()["links"]["result"].clone();
    let found = server.get(link.as_str().unwrap()).await.json();
    let estimate = found["parameters"][0]["estimate"].as_f64().unwrap();
    let error = found["parameters"][0]["standard_error"].as_f64().unwrap();
    let ask = async |path: &str, x: f64, weight: f64| -> f64 {
        let body = json!({"name": "log_likelihood", "config": {"fit": found["key"]}, "input": [[x]],
            "outWrt": 0, "inWrt": 0, "sens": [weight], "vec": [weight]});
        let answer = call(&server, path, &body).await.json();
        let output = &answer["output"];
        let number = output[0].as_f64().or_else(|| output[0][0].as_f64());
        number.unwrap_or_else(|| panic!("{answer}"))
    };
    let sizes = json!({"name": "log_likelihood", "config": {"fit": found["key"]}});
    assert_eq!(call(&server, "/InputSizes", &sizes).await.json(), json!({"inputSizes": [1]}));
    assert_eq!(call(&server, "/OutputSizes", &sizes).await.json(), json!({"outputSizes": [1]}));
    let [below, best, above] = [-1.0, 0.0, 1.0].map(|step| estimate + step * error);
    let values = [
        ask("/Evaluate", below, 1.0).await,
        ask("/Evaluate", best, 1.0).await,
        ask("/Evaluate", above, 1.0).await,
    ];
    // One standard error is half a unit of log likelihood.
    for beside in [values[0], values[2]] {
        assert!((0.4..0.6).contains(&(values[1] - beside)), "{values:?}");
    }
    assert!((error * ask("/Gradient", best, 1.0).await).abs() < 0.02);
    let slope = ask("/Gradient", above, 1.0).await;
    let [near, far] = [0.5, 1.5].map(|step| estimate + step * error);
    let difference = ask("/Evaluate", far, 1.0).await - ask("/Evaluate", near, 1.0).await;
    assert!((error * slope - difference).abs() < 0.03, "{} {difference}", error * slope);
    let product = ask("/ApplyJacobian", above, 2.0).await;
    assert!((product / (2.0 * slope) - 1.0).abs() < 1e-11, "{product} {slope}");
    // Outside of the range, the value falls with the distance from it.
    assert!(ask("/Evaluate", 2e-12, 1.0).await < -1e200);
    assert!(ask("/Gradient", 2e-12, 1.0).await < 0.0);

    let run = server.compute(&steel_ball()).await.json()["key"].clone();
    for (fit, status, kind, words) in [
        (json!(null), 400, "InvalidInput", "Enter {\"fit\": \"KEY\"} with the key"),
        (json!("7"), 400, "InvalidInput", "config/fit is no key"),
        (run, 400, "InvalidInput", "key of another result"),
        (json!("0".repeat(64)), 404, "unknown-result", "POST /v1/jobs"),
    ] {
        let body = json!({"name": "log_likelihood", "config": {"fit": fit}, "input": [[1e-14]]});
        let message = self::error(&call(&server, "/Evaluate", &body).await, status, kind);
        assert!(message.contains(words), "{message}");
    }
    let body =
        json!({"name": "log_likelihood", "config": {"fit": found["key"]}, "input": [[1.0, 2.0]]});
    let message = self::error(&call(&server, "/Evaluate", &body).await, 400, "InvalidInput");
    assert!(message.contains("must have 1 numbers, not 2"), "{message}");
}

#[tokio::test(flavor = "multi_thread")]
async fn each_fault_has_the_error_of_the_protocol() {
    let server = Server::start().await;
    let derive =
        json!({"name": "wear", "input": [[0.5]], "outWrt": 0, "inWrt": 0, "sens": [1], "vec": [1]});
    let with = |name: &str, value: Value| {
        let mut body = derive.clone();
        body[name] = value;
        body
    };
    for path in CALLS {
        let unknown = with("name", json!("belief"));
        let message = error(&call(&server, path, &unknown).await, 400, "ModelNotFound");
        assert!(message.contains("Enter \"wear\" as `name`"), "{message}");
        for body in ["", "{}"] {
            let reply = server.send("POST", path, &[], body).await;
            assert_eq!(error(&reply, 400, "InvalidInput"), "`name` is missing.");
        }
        let message =
            error(&server.send("POST", path, &[], "{\"name\": NaN}").await, 400, "InvalidInput");
        assert!(message.contains("line 1 column"), "{message}");
        error(&server.get(path).await, 405, "method-not-allowed");
    }
    let hessian = call(&server, "/ApplyHessian", &json!({"name": "wear"})).await;
    error(&hessian, 400, "UnsupportedFeature");
    for (path, name, value, words) in [
        ("/Evaluate", "input", json!(null), "`input` is missing"),
        ("/Evaluate", "input", json!([0.5]), "invalid type"),
        ("/Evaluate", "input", json!([]), "must have one vector, not 0"),
        ("/Evaluate", "input", json!([[0.5], [1.0]]), "must have one vector, not 2"),
        ("/Evaluate", "input", json!([[0.5, 0.5]]), "must have 1 numbers, not 2"),
        ("/Evaluate", "input", json!([[-0.5]]), "/friction must be greater than 0"),
        ("/Evaluate", "config", json!({"outputs": ["wear_volumes"]}), "config/outputs/0 "),
        ("/Evaluate", "config", json!({"parameters": ["/frction"]}), "Did you mean `/friction`?"),
        ("/Evaluate", "config", json!({"scenario": {}}), "config/scenario/profile is missing"),
        ("/Evaluate", "config", json!({"output": []}), "config/output "),
        ("/InputSizes", "config", json!({"parameters": []}), "config/parameters must have"),
        ("/Gradient", "sens", json!([1, 2]), "`sens` must have 1 numbers, not 2"),
        ("/Gradient", "outWrt", json!(1), "`outWrt` must be 0, not 1"),
        ("/Gradient", "inWrt", json!(-1), "`inWrt` must be 0, not -1"),
        ("/ApplyJacobian", "vec", json!(null), "`vec` is missing"),
    ] {
        let message = error(&call(&server, path, &with(name, value)).await, 400, "InvalidInput");
        assert!(message.contains(words), "{message}");
    }
    let config = json!({"outputs": ["wear_volume", "events.shakedown"]});
    let message =
        error(&call(&server, "/Evaluate", &with("config", config)).await, 500, "InvalidOutput");
    assert_eq!(message, "events.shakedown has no value: this event did not happen.");
    let mut body = with("config", config_of_long_run());
    body["input"] = json!([[0.7]]);
    let message = error(&call(&server, "/Evaluate", &body).await, 400, "InvalidInput");
    assert!(message.contains("the limit of a request is 30 s"), "{message}");
}

fn config_of_long_run() -> Value {
    let mut config = config(&json!(["/friction"]), &json!(["wear_volume"]));
    config["scenario"]["model"] = json!({"method": "exact", "tolerance": 1e-4});
    config["scenario"]["load"]["held"] = json!("force");
    config["scenario"]["cycles"] = json!([1e12]);
    config
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_and_limits_apply_and_a_key_may_be_a_basic_password() {
    let evaluations = NonZeroU32::new(3);
    let server = server(Limits { evaluations, ..Limits::default() }).await;
    let anna = made(server.place(), "anna", Role::Submit).await;
    let eve = made(server.place(), "eve", Role::Read).await;
    let body = json!({"name": "wear", "input": [[0.5]]}).to_string();
    let ask = async |key: &str, path: &str| {
        let basic = format!("Basic {}", BASE64.encode(format!("any:{key}").as_bytes()));
        server.send("POST", path, &[("Authorization", &basic)], &body).await
    };
    for path in CALLS {
        let message = error(&server.send("POST", path, &[], &body).await, 401, "unauthorized");
        assert!(message.contains("This server requires an access key"), "{message}");
    }
    error(&server.get("/Info").await, 401, "unauthorized");
    assert_eq!(ask(&eve, "/InputSizes").await.status, 200);
    error(&ask(&eve, "/Evaluate").await, 403, "forbidden");
    for _ in 0..3 {
        assert_eq!(ask(&anna, "/Evaluate").await.status, 200);
    }
    let refused = ask(&anna, "/Evaluate").await;
    let message = error(&refused, 429, "rate-limited");
    assert!(message.contains("3 evaluations per minute"), "{message}");
    assert!(refused.header("retry-after").is_some());
    assert_eq!(ask(&anna, "/ModelInfo").await.status, 200, "this is no evaluation");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_separate_port_serves_only_um_bridge() {
    let dir = TempDir::new().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_fretwork"));
    command.args(["--listen", "127.0.0.1:0", "--umbridge-listen", "127.0.0.1:0", "--data-dir"]);
    command.arg(dir.path()).env("FRETWORK_LOG", "off").stdout(Stdio::piped());
    let mut child = Running(command.spawn().unwrap());
    let lines = BufReader::new(child.stdout.as_mut().unwrap()).lines();
    let line = lines
        .map(Result::unwrap)
        .find_map(|line| line.strip_prefix("UM-Bridge alone: http://").map(str::to_owned));
    let address = line.unwrap().parse().unwrap();
    let body = json!({"name": "wear", "input": [[0.5]]}).to_string();
    let ask =
        async |method: &str, path: &str| send(address, method, path, &[], &body).await.unwrap();
    assert_eq!(ask("POST", "/Evaluate").await.status, 200);
    for path in ["/", "/v1/jobs", "/healthz"] {
        ask("GET", path).await.problem(404, "not-found");
    }
}
