//! The rows of a run while it is computed.

use std::num::NonZeroU32;
use std::sync::Arc;

use fretwork::http::Origins;
use fretwork::service::workers::Workers;
use fretwork::service::{Service, WorkLimits};
use fretwork_engine::outcome::History;
use fretwork_job::{Begin, Cost, JobState, Prepared, Step, Submission, Task, Work};
use fretwork_store::{NewJob, StoredResult};
use fretwork_study::{Points, Rows};
use serde_json::{Value, json};

use crate::keeping::eventually;
use crate::server::{Gate, JSON, Server, example};
use crate::store::{accepted, cancel, claim, fresh, job, new_job};
use crate::studies::long_sweep;

/// A run that pauses after its first rows, until its gate opens.
struct Paused {
    run: Box<dyn Work>,
    gate: Gate,
}

impl Work for Paused {
    fn step(&mut self) -> Step {
        if self.so_far().is_some_and(|rows| rows.cycles.len() > 1) && !self.gate.is_passed() {
            return Step::Working { progress: 0.5 };
        }
        self.run.step()
    }

    fn so_far(&self) -> Option<History> {
        self.run.so_far()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_running_job_shows_its_rows_until_it_ends() {
    let gate = Gate::default();
    let own = gate.clone();
    let begin: Begin = Arc::new(move |key, stored, prepared| {
        let run = Task::start(key, stored, prepared)?;
        Ok(Box::new(Paused { run, gate: own.clone() }) as Box<dyn Work>)
    });
    let server = Server::computing(begin, &Origins::Own).await;
    let mut body = example("steel-ball");
    body["scenario"]["model"] = json!({"tolerance": 1e-4});
    body["scenario"]["cycles"] = json!({"from": 10, "to": 1e5, "count": 300, "spacing": "log"});
    let job = server.post("/v1/jobs", &body).await.json();
    let address = format!("/v1/jobs/{}/so-far", job["id"].as_str().unwrap());
    let count = |rows: &Value| rows["history"]["cycles"].as_array().map_or(0, Vec::len);
    eventually(async || {
        let reply = server.get(&address).await;
        reply.status == 200 && count(&reply.json()) > 1
    })
    .await;
    let rows = server.get(&address).await;
    assert_eq!(rows.header("cache-control"), Some("no-store"));
    let rows = rows.json();
    let twin = server.post("/v1/jobs", &body).await.json();
    let shared = server.get(&format!("/v1/jobs/{}/so-far", twin["id"].as_str().unwrap())).await;
    assert_eq!(shared.json(), rows, "two jobs share the run");

    gate.open();
    let job = server.compute(&body).await.json();
    let result = server.get(job["links"]["result"].as_str().unwrap()).await.json();
    assert!(count(&rows) < count(&result), "{}", count(&rows));
    assert_eq!(rows["units"], result["units"]);
    for (name, column) in rows["history"].as_object().unwrap() {
        let smoothed = ["contact_radius", "scar_radius"].contains(&name.as_str());
        let known = if smoothed { 0 } else { count(&rows) };
        let whole = result["history"][name].as_array().unwrap();
        assert_eq!(column.as_array().unwrap(), &whole[..known], "{name}");
    }
    let ended = server.get(&address).await;
    assert_eq!((ended.status, ended.text()), (204, ""));
    server.get("/v1/jobs/0/so-far").await.problem(404, "not-found");
}

#[tokio::test(flavor = "multi_thread")]
async fn other_work_has_no_rows() {
    let gate = Gate::default();
    let server = Server::computing(gate.compute(), &Origins::Own).await;
    let job = server.post("/v1/jobs", &example("steel-ball")).await.json();
    let address = job["links"]["self"].as_str().unwrap();
    eventually(async || server.get(address).await.json()["state"] == "running").await;
    assert_eq!(server.get(&format!("{address}/so-far")).await.status, 204);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_study_shows_its_rows_while_it_runs_and_after_it_was_canceled() {
    let server = Server::start().await;
    let body = long_sweep(100_000);
    let job = server.post("/v1/jobs", &body).await.json();
    let address = job["links"]["self"].as_str().unwrap();
    let so_far = format!("{address}/so-far");
    let computed = |rows: &Value| rows["counts"]["computed"].as_u64().unwrap();
    eventually(async || {
        let reply = server.get(&so_far).await;
        reply.status == 200 && computed(&reply.json()) > 0
    })
    .await;
    assert_eq!(server.get(address).await.json()["state"], "running");
    server.send("POST", &format!("{address}/cancel"), &[JSON], "").await;
    let rows = server.get(&so_far).await.json();
    assert_eq!(rows["counts"]["points"], 100_000);
    assert_eq!(rows["units"]["wear_volume"], "m^3");
    let table = rows["table"].as_object().unwrap();
    for (name, column) in table {
        assert_eq!(column.as_array().unwrap().len() as u64, computed(&rows), "{name}");
    }
    assert_eq!(server.get(&so_far).await.json(), rows);
    // Each row is that of its point.
    let last = computed(&rows) as usize - 1;
    let mut scenario = body["sweep"]["scenario"].clone();
    for (pointer, column) in table.iter().filter(|(name, _)| name.starts_with('/')) {
        *scenario.pointer_mut(pointer).unwrap() = column[last].clone();
    }
    let one = json!({"scenario": scenario, "outputs": ["wear_volume"]});
    let one = server.post("/v1/evaluate", &one).await.json();
    assert_eq!(table["wear_volume"][last], one["outputs"]["wear_volume"]);
    assert_eq!(server.send("DELETE", address, &[], "").await.status, 204);
    server.get(&so_far).await.problem(404, "not-found");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_canceled_study_continues_from_its_points() {
    let (_dir, store) = fresh().await;
    let Prepared { key, stored, task, .. } =
        Submission::parse(long_sweep(400).to_string().as_bytes()).unwrap().prepared;
    let Task::Study(study) = task else { panic!("a run") };
    let asked =
        || NewJob { key, task: stored.to_string(), chunks: NonZeroU32::new(4), ..new_job(1) };
    let first = accepted(store.submit(asked()).await);
    let mut points = Points::chunk(study, 0, 4, Rows::default());
    let rows = loop {
        if let Some(rows) = points.step() {
            break rows;
        }
    };
    // A number that no computation gives shows where the chunk of the result comes from.
    let mut rows: Value = serde_json::from_slice(&rows.to_bytes()).unwrap();
    let column = rows["columns"].as_array_mut().unwrap().last_mut().unwrap();
    *column = format!("12345{}", column.as_str().unwrap().trim_start_matches(|c| c != ',')).into();
    let claimed = claim(&store).await;
    assert!(store.finish_chunk(&claimed, rows.to_string().as_bytes(), Cost::ZERO).await.unwrap());
    assert_eq!(cancel(&store, first.id).await, JobState::Canceled);

    let again = accepted(store.submit(asked()).await);
    let limits = WorkLimits::default();
    let service = Service::new(store.clone(), Arc::new(Task::start), 2, limits);
    let _workers = Workers::start(&store, 2, limits, &service.compute()).unwrap();
    eventually(async || job(&store, again.id).await.state == JobState::Succeeded).await;
    let Some(StoredResult::Whole(body)) = store.result(&key).await.unwrap() else {
        panic!("no result")
    };
    let result: Value = serde_json::from_slice(&body.json().unwrap()).unwrap();
    let table = result["table"].as_object().unwrap();
    assert!(table.values().any(|column| column[0] == 12345), "{table:?}");
    // A study that is computed again for a comparison takes nothing from it.
    assert_eq!(store.canceled_chunk(&claimed, 0, 4).await.unwrap(), None);
}
