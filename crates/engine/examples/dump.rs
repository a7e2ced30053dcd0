//! dump
#![allow(missing_docs, clippy::all, clippy::pedantic, clippy::restriction)]
use fretwork_engine::{scenario, simulation::Simulation};
fn main() {
    let text = std::fs::read_to_string(std::env::args().nth(1).unwrap()).unwrap();
    let v: serde_json::Value = serde_json::from_str(&text).unwrap();
    let request = v.get("scenario").cloned().unwrap_or(v);
    let (s, _) = scenario::check(&request, "").unwrap();
    let o = Simulation::of(&s).unwrap().run();
    println!("{}", serde_json::to_string_pretty(&o).unwrap());
}
