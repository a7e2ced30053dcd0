//! Derivatives of results: their numbers, their errors and their limits.

use serde_json::{Value, json};

use crate::server::{Server, example, steel_ball};

/// Computes a job, and returns the address of the derivatives of its result.
async fn address(server: &Server, job: &Value) -> String {
    let link = server.compute(job).await.json()["links"]["result"].clone();
    format!("{}/derivatives", link.as_str().unwrap())
}

fn ball() -> Value {
    let mut job = steel_ball();
    let scenario = job["scenario"].as_object_mut().unwrap();
    scenario.remove("bodies");
    scenario.insert("moduli".into(), json!({"normal": 113e9, "tangential": 93e9}));
    job
}

/// The expected derivatives follow from Hertz, a = √(Rd) and p₀ = (2E/π) √(d/R), and from N₀ = a/(4UkE).
#[tokio::test(flavor = "multi_thread")]
async fn derivatives_in_closed_form_agree_with_the_formulas() {
    let server = Server::start().await;
    let path = address(&server, &ball()).await;
    let query = "?outputs=scales.contact_radius,unworn.peak_pressure,scales.cycles\
        &parameters=/load/indentation_depth,/profile/radius,/moduli/normal,/wear/coefficient";
    let answer = server.get(&format!("{path}{query}")).await.json();
    let found = answer["derivatives"].as_array().unwrap();
    assert_eq!(found.len(), 12);
    let (force, radius, normal, wear, amplitude) = (100.0, 0.01, 113e9, 3.03e-14, 2.256e-6);
    let contact = (0.75_f64 * force * radius / normal).cbrt();
    let depth = contact * contact / radius;
    let peak = 2.0 * normal / std::f64::consts::PI * contact / radius;
    let cycles = contact / (4.0 * amplitude * wear * normal);
    let outputs = ["scales.contact_radius", "unworn.peak_pressure", "scales.cycles"];
    for (parameter, x, units, powers) in [
        ("/load/indentation_depth", depth, ["m/m", "Pa/m", "1/m"], [0.5, 0.5, 0.5]),
        ("/profile/radius", radius, ["m/m", "Pa/m", "1/m"], [0.5, -0.5, 0.5]),
        ("/moduli/normal", normal, ["m/Pa", "Pa/Pa", "1/Pa"], [0.0, 1.0, -1.0]),
        ("/wear/coefficient", wear, ["m/(1/Pa)", "Pa/(1/Pa)", "1/(1/Pa)"], [0.0, 0.0, -1.0]),
    ] {
        for (i, value) in [contact, peak, cycles].into_iter().enumerate() {
            let is_it =
                |entry: &&Value| entry["output"] == outputs[i] && entry["parameter"] == parameter;
            let entry = found.iter().find(is_it).unwrap();
            let [slope, error] = ["value", "error"].map(|name| entry[name].as_f64().unwrap());
            let (expected, scale) = (powers[i] * value / x, value / x);
            assert!((slope - expected).abs() <= error.max(1e-9 * scale), "{entry}, {expected}");
            assert!(error < 1e-5 * scale, "{entry}");
            assert_eq!((&entry["method"], &entry["unit"]), (&json!("closed"), &json!(units[i])));
        }
    }
}

/// The table has derivatives with respect to the dimensionless amplitude Δ = G*U/(μE*d₀). The wear volume and the
/// normal force depend on ln μ as on −ln Δ. The scale of the tangential force Q is also proportional to μ.
#[tokio::test(flavor = "multi_thread")]
async fn stated_errors_cover_the_difference_to_the_independent_solver() {
    let table: Value =
        serde_json::from_str(include_str!("../../crates/engine/tests/it/slopes.json")).unwrap();
    let server = Server::start().await;
    let mut job = ball();
    job["scenario"]["model"] = json!({"method": "exact"});
    job["scenario"]["motion"] = json!({"stick_ratio": 0.5});
    job["scenario"]["cycles"] = json!({"normalized": [1]});
    let path = address(&server, &job).await;
    let result = server.get(path.trim_end_matches("/derivatives")).await.json();
    let outputs = ["wear_volume", "normal_force", "tangential_force"];
    let query = format!("?parameters=/friction&outputs={}", outputs.join(","));
    let answer = server.get(&format!("{path}{query}")).await.json();
    for (entry, name) in answer["derivatives"].as_array().unwrap().iter().zip(outputs) {
        let unit = 0.7 / result["history"][name][1].as_f64().unwrap();
        let [slope, error] = ["value", "error"].map(|part| entry[part].as_f64().unwrap() * unit);
        let [known, known_error] =
            ["slope", "error"].map(|part| table[name][part].as_f64().unwrap());
        let expected = if name == "tangential_force" { 1.0 - known } else { -known };
        assert!((slope - expected).abs() <= error + known_error, "{entry}: {slope} {expected}");
        assert!(error < 0.05 && entry["method"] == "numerical", "{entry}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn by_default_all_outputs_and_numbers_have_derivatives() {
    let server = Server::start().await;
    let path = address(&server, &ball()).await;
    let answer = server.get(&path).await;
    assert_eq!(answer.header("cache-control"), Some("no-store"));
    let answer = answer.json();
    let found = answer["derivatives"].as_array().unwrap();
    let of = |member: &str| {
        let mut all: Vec<&str> =
            found.iter().map(|entry| entry[member].as_str().unwrap()).collect();
        all.sort_unstable();
        all.dedup();
        all
    };
    let parameters = of("parameter");
    assert_eq!(
        parameters,
        [
            "/friction",
            "/load/indentation_depth",
            "/model/xi",
            "/moduli/normal",
            "/moduli/tangential",
            "/motion/amplitude",
            "/profile/radius",
            "/wear/coefficient"
        ]
    );
    let outputs = of("output");
    assert!(
        outputs.contains(&"wear_volume") && outputs.contains(&"limit.wear_depth"),
        "{outputs:?}"
    );
    assert!(!outputs.contains(&"unworn.actuator_amplitude"), "it has no value");
    assert_eq!(found.len(), parameters.len() * outputs.len());
    assert!(found.iter().all(|entry| entry["error"].is_number()), "{answer}");
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_with_faults_and_long_runs_are_refused() {
    let server = Server::start().await;
    let path = address(&server, &ball()).await;
    let problem =
        server.get(&format!("{path}?outputs=wear_volumes,cycles@5&parameter=/friction")).await;
    let problem = problem.problem(422, "invalid-parameters");
    assert!(
        problem["errors"][0]["detail"].as_str().unwrap().contains("Did you mean `wear_volume`?")
    );
    assert_eq!(problem["errors"][1]["parameter"], "parameter");
    for (query, name, words) in [
        ("parameters=/frction", "parameters", "Did you mean `/friction`?"),
        ("outputs=cycles@5", "outputs", "choose one of 1000, 3000"),
    ] {
        let problem =
            server.get(&format!("{path}?{query}")).await.problem(422, "invalid-parameters");
        assert_eq!(problem["errors"][0]["parameter"], name);
        let detail = problem["errors"][0]["detail"].as_str().unwrap();
        assert!(detail.contains(words), "{detail}");
    }
    let unknown = format!("/v1/results/{}/derivatives", "0".repeat(64));
    server.get(&unknown).await.problem(404, "unknown-result");

    let reason =
        server.get(&format!("{path}?parameters=/model/points&outputs=wear_depth")).await.json();
    let reason = &reason["derivatives"][0];
    assert_eq!((&reason["value"], &reason["method"]), (&Value::Null, &json!("numerical")));
    assert!(reason["reason"].as_str().unwrap().contains("/model/points"), "{reason}");

    let mut long = example("steel-ball");
    long["scenario"]["model"] = json!({"tolerance": 1e-4});
    long["scenario"]["cycles"] = json!([100]);
    let path = address(&server, &long).await;
    let problem = server.get(&path).await.problem(422, "too-expensive");
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains("the limit of a request is 30 s. Name fewer `parameters`"), "{detail}");
}
