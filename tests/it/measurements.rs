//! Files of measured numbers: by the API, and by the command `fit`.

use std::fmt::Write as _;
use std::fs;

use fretwork::http::{Limits, document};
use fretwork_job::Submission;
use fretwork_random::Stream;
use fretwork_store::Role;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::access::{made, server};
use crate::program::run;
use crate::server::{Reply, Server, example, metric};

const PATH: &str = "/v1/measurements";
const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/measured/volumes.csv");
const BALL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/steel-ball.json");
/// Wear coefficient, friction and relative noise of the example.
const TRUTH: (f64, f64, f64) = (4.2e-14, 0.62, 0.05);

async fn sent(server: &Server, query: &str, kind: &str, body: &[u8]) -> Reply {
    server.send("POST", &format!("{PATH}{query}"), &[("Content-Type", kind)], body).await
}

/// A standard normal number, from twelve uniform ones.
fn normal(stream: Stream, place: u64) -> f64 {
    (0..12).map(|at| stream.at(12 * place + at) as f64 / 2f64.powi(64)).sum::<f64>() - 6.0
}

/// The steel ball after these cycles, with the numbers of the example.
fn truth(cycles: &[f64]) -> Value {
    let mut job = example("steel-ball");
    let (coefficient, friction, _) = TRUTH;
    let scenario = &mut job["scenario"];
    scenario["wear"]["coefficient"] = json!(coefficient);
    scenario["friction"] = json!(friction);
    scenario["cycles"] = json!(cycles);
    scenario["model"] = json!({"method": "exact", "tolerance": 1e-4});
    let prepared = Submission::parse(job.to_string().as_bytes()).unwrap().prepared;
    serde_json::from_slice(&prepared.compute(|_| {}).body).unwrap()
}

#[test]
fn the_example_follows_from_its_seed() {
    let cycles = [1e3, 2e3, 5e3, 1e4, 2e4, 5e4];
    let volumes = truth(&cycles);
    let mut text = "Synthetic volumes of examples/steel-ball.json with k_w = 4.2e-5 mm^3/(N m)\n\
        friction 0.62, noise 5 %, seed 38\n\
        cycles;wear_volume [µm³]\n"
        .to_owned();
    for (place, cycles) in cycles.iter().enumerate() {
        let volume = volumes["history"]["wear_volume"][place + 1].as_f64().unwrap();
        let noise = 1.0 + TRUTH.2 * normal(Stream::new(38), place as u64);
        let volume = format!("{:.1}", volume * noise * 1e18).replace('.', ",");
        writeln!(text, "{cycles};{volume}").unwrap();
    }
    text.push_str("100000;\n");
    assert_eq!(fs::read_to_string(FILE).unwrap_or_default(), text, "{text}");
}
