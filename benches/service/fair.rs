//! How long the short runs of an owner wait while ten others let the workers compute for minutes.

use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::shared::Cluster;
use super::{PROGRAM, Server, ball, body_scenario, directory, request};

/// Owners with fits, long runs and sweeps.
const OTHERS: usize = 10;
/// Short runs of one more owner.
const RUNS: usize = 200;

/// One server of two workers; and three nodes of two workers with one PostgreSQL.
pub fn fairness() {
    println!("a short run beside the fits, long runs and sweeps of ten owners");
    let dir = directory();
    let place = ["--data-dir".to_owned(), dir.path().display().to_string()];
    let keys = add_keys(&place);
    let server = Server::program(dir.path(), &["--workers", "2"]);
    report("one server", (0.3, 1.0), &server, &keys);
    drop(server);

    let (cluster, dirs) = (Cluster::start(), [directory(), directory(), directory()]);
    let database = cluster.database("fair");
    let place = ["--database".to_owned(), database.clone()];
    let options = ["--database", &database, "--workers", "2"];
    let nodes = dirs.each_ref().map(|dir| Server::program(dir.path(), &options));
    report("three nodes", (0.5, 2.0), &nodes[0], &add_keys(&place));
}

/// Makes a key for each owner. Returns them.
fn add_keys(place: &[String; 2]) -> Vec<String> {
    let key = |number| {
        let mut command = Command::new(PROGRAM);
        command.args(["keys", "add", &format!("owner{number}"), "--role", "submit", "--rate", "0"]);
        let output = command.args(place).output().expect("a key");
        let words = String::from_utf8_lossy(&output.stdout).into_owned();
        let key = words.split_whitespace().find(|word| word.starts_with("fretwork_"));
        key.unwrap_or_else(|| panic!("no key: {output:?}")).to_owned()
    };
    (0..=OTHERS).map(key).collect()
}

fn report(what: &str, (median, longest): (f64, f64), server: &Server, keys: &[String]) {
    let mut client = server.connect();
    let mut ask = |status, line: &str, key: &str, body: &str| {
        client.json(status, &request(line, &format!("authorization: Bearer {key}\r\n"), body))
    };
    for (number, key) in keys[..OTHERS].iter().enumerate() {
        ask(202, "POST /v1/jobs", key, &long(number).to_string());
    }
    thread::sleep(Duration::from_secs(2));
    let mut waits: Vec<_> = (0..RUNS)
        .map(|number| {
            let start = Instant::now();
            let body = ball("none", &format!("{number:08}"));
            let job = ask(202, "POST /v1/jobs", &keys[OTHERS], &body);
            let line = format!("GET {}?wait=60", job["links"]["self"].as_str().expect("a link"));
            let job = ask(200, &line, &keys[OTHERS], "");
            assert_eq!(job["state"], "succeeded", "{job}");
            start.elapsed().as_secs_f64()
        })
        .collect();
    waits.sort_by(f64::total_cmp);
    let (middle, last) = (waits[RUNS / 2], waits[RUNS - 1]);
    println!(
        "  {what}: {middle:.3} s in the median   (at most {median}), {last:.3} s at most   (at most {longest}), {:.0} MB \
         of memory",
        server.resident()
    );
}

/// The job of an owner: a fit, a long run or a sweep, each with scenarios of its own.
fn long(number: usize) -> Value {
    let mut scenario = body_scenario(&ball("none", &format!("9{number:07}")));
    match number {
        0..4 => {
            let text = include_str!("../../examples/studies/fit.json");
            let mut job: Value = serde_json::from_str(text).expect("an example");
            let scenario = &mut job["fit"]["scenario"];
            scenario["load"]["held"] = json!("force");
            scenario["model"] = json!({"tolerance": 1e-4, "points": 1024});
            scenario["cycles"] = json!([10_000 + number]);
            job
        }
        4..7 => {
            let block = |number| json!({"amplitude": 2.5e-6 + f64::from(number % 2) * 5.5e-6, "cycles": 200_000});
            scenario["motion"] = json!({"blocks": (0..1000).map(block).collect::<Vec<_>>()});
            scenario["load"]["held"] = json!("force");
            scenario["model"] = json!({"tolerance": 1e-4, "points": 4096, "compare": true});
            scenario["cycles"] =
                json!({"from": 200_000, "to": 2e8, "count": 1000, "spacing": "linear"});
            json!({"scenario": scenario})
        }
        _ => {
            scenario["model"] = json!({});
            json!({"sweep": {
                "scenario": scenario,
                "vary": [
                    {"pointer": "/friction", "from": 0.65, "to": 0.75},
                    {"pointer": "/motion/amplitude", "from": "2 um", "to": "2.4 um"},
                ],
                "design": "sobol",
                "samples": 100_000,
                "outputs": ["wear_volume"],
            }})
        }
    }
}
