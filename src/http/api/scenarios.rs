//! Scenarios: check, examples, schema.

use axum::http::HeaderMap;
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::{Map, Value};
use utoipa::ToSchema;

use crate::http::answer::fixed::fixed;
use crate::http::api::documents;
use crate::http::{App, Body, FRESH_JSON, NoQuery, Problem, Result, Segment, blocking, kinds};
use fretwork_engine::{Preview, SCHEMA, Scenario, Warning};
use fretwork_job::{Canonical, Key, Prepared, Submission, Task, TaskKind};
use fretwork_json::{self as json, BadBody};
use fretwork_study::Kind;

/// A valid job body, from a file in `examples/`.
pub struct Example {
    /// The name of the example in addresses.
    pub name: &'static str,
    /// The job body.
    pub body: &'static str,
}

macro_rules! examples {
    ($($name:literal),*) => {
        &[$(Example {
            name: $name,
            body: include_str!(concat!("../../../examples/", $name, ".json")),
        }),*]
    };
}

/// The job bodies in `examples/`. The program prints the first one when it starts.
pub static EXAMPLES: &[Example] = examples!(
    "steel-ball",
    "steel-ball-simplified",
    "flat-on-rig",
    "amplitude-blocks",
    "held-tangential-force",
    "displacement-record",
    "measured-tip",
    "cylinder-on-flat",
    "coated-cylinder",
    "run-in",
    "measured-friction",
    "paper-figure-3",
    "paper-figure-3-printed",
    "paper-figure-4"
);

impl From<BadBody> for Problem {
    fn from(bad: BadBody) -> Self {
        let advice = "Send one JSON document, such as those under /v1/examples.";
        let detail = match bad {
            BadBody::Json(error) => format!("The body is not JSON: {error}. {advice}"),
            BadBody::Empty => format!("The body is empty. {advice}"),
            BadBody::Faults(faults) => return Self::faults(faults),
        };
        Self::new(&kinds::INVALID_JSON, detail)
    }
}

/// Largest body that is parsed on the async thread, in bytes. Passing the body to another thread takes as long as
/// parsing it.
const SMALL: usize = 1 << 14;

/// Whether a body can contain a study, which takes milliseconds to read. An escape sequence could hide the name of the
/// study, so a body with a backslash counts too.
fn can_be_study(text: &[u8]) -> bool {
    let Ok(text) = str::from_utf8(text) else { return true };
    text.contains('\\') || Kind::ALL.iter().any(|kind| text.contains(kind.name))
}

/// Parses a body with a scenario. A large body or a study is parsed on a blocking thread.
pub(super) async fn parse<T: Send + 'static>(
    Body(body): Body,
    parse: fn(&[u8]) -> Result<T, BadBody>,
) -> Result<T> {
    if body.bytes.len() <= SMALL && !can_be_study(&body.bytes) {
        return Ok(parse(&body.bytes)?);
    }
    Ok(blocking(move || parse(&body.bytes)).await??)
}

/// What is known of a task that is not computed.
#[derive(Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum Checked {
    /// Of a scenario.
    Run(Box<CheckedRun>),
    /// Of a study.
    Study(Box<CheckedStudy>),
}

/// What is known of a study that is not computed.
#[derive(Debug, Serialize, ToSchema)]
pub struct CheckedStudy {
    /// The key of its result.
    #[schema(value_type = String, pattern = "^[0-9a-f]{64}$")]
    key: Key,
    /// Whether the result is stored.
    cached: bool,
    /// The study in SI units with all defaults, such as `sweep`. Submitted again, it has the same key.
    #[serde(flatten)]
    #[schema(value_type = Object)]
    asked: Canonical,
    /// The columns of its rows.
    columns: Vec<String>,
    /// The units of the columns of numbers.
    #[schema(value_type = Object)]
    units: Map<String, Value>,
    /// What it takes.
    cost: StudyCost,
    time: CheckedTime,
    /// The limit of this server that the study exceeds, and what to change. Null if it exceeds none. A server returns a
    /// stored result beyond its limits too.
    excess: Option<String>,
    /// Related addresses.
    links: CheckedLinks,
}

/// What a study takes.
#[derive(Debug, Serialize, ToSchema)]
pub struct StudyCost {
    /// Its points.
    points: usize,
    /// Estimated processor time, in seconds.
    seconds: f64,
    /// The largest possible size of its result as JSON, in bytes.
    answer_bytes: usize,
}

/// What is known of a scenario without a run.
#[derive(Debug, Serialize, ToSchema)]
pub struct CheckedRun {
    /// The key of its result.
    #[schema(value_type = String, pattern = "^[0-9a-f]{64}$")]
    key: Key,
    /// Whether the result is stored.
    cached: bool,
    /// The scenario in SI units with all defaults. Submitted again, it has the same key.
    #[schema(value_type = Object)]
    scenario: Scenario,
    /// `scales`, `unworn`, `regime`, `limit`, `units` and `cost`.
    #[serde(flatten)]
    #[schema(value_type = documents::Preview)]
    preview: Preview,
    /// Warnings about the validity of the model.
    #[schema(value_type = Vec<documents::Warning>)]
    warnings: Vec<Warning>,
    time: CheckedTime,
    /// The limit of this server that the run exceeds, and what to change. Null if it exceeds none. A server returns a
    /// stored result beyond its limits too.
    excess: Option<String>,
    /// Related addresses.
    links: CheckedLinks,
}

/// How long a run or a study takes, and may take.
#[derive(Debug, Serialize, ToSchema)]
struct CheckedTime {
    /// Estimated processor time, in seconds.
    #[schema(example = 0.012)]
    seconds: f64,
    /// The limit of this server for this time, in seconds; null if there is none.
    #[schema(example = 1800)]
    limit: Option<f64>,
}

/// Addresses related to a checked scenario.
#[derive(Debug, Serialize, ToSchema)]
struct CheckedLinks {
    /// The result, after it was computed.
    result: String,
    /// POST the same body to this address to compute it.
    submit: &'static str,
}

/// Checks a scenario or a study without a run.
///
/// The body is that of `POST /v1/jobs`. The answer has the key, the canonical scenario, scales, the unworn
/// state, the limiting state of wear, warnings and the estimated cost; for a study the key, its canonical form, its
/// columns and what it takes. `excess` says which limit of this server it exceeds.
#[utoipa::path(post, path = "/v1/scenarios", operation_id = "check_scenario", tag = "scenarios",
    request_body(content = documents::JobBody, description = "The job body."),
    responses((status = 200, description = "The scenario or study is valid.", body = Checked)),
)]
pub async fn check(app: App, _: NoQuery, body: Body) -> Result<Response> {
    /// Bytes of a usual answer.
    const BYTES: usize = 4096;
    let prepared = parse(body, Submission::parse).await?.prepared;
    let checked = checked(&app, prepared).await?;
    Ok((FRESH_JSON, json::write(&checked, BYTES)).into_response())
}

/// What is known of a prepared task.
pub(super) async fn checked(app: &App, prepared: Prepared) -> Result<Checked> {
    let warnings = prepared.warnings();
    let asked = prepared.asked();
    let limits = app.service.limits();
    let excess = limits.refuse(&prepared).map(|excess| excess.to_string());
    let Prepared { key, task, seconds, .. } = prepared;
    let limit = if task.kind() == TaskKind::Run { limits.run } else { limits.study };
    let time = CheckedTime { seconds, limit: limit.map(|limit| limit.as_secs_f64()) };
    let cached = app.store.has_result(&key).await?;
    let links = CheckedLinks { result: format!("/v1/results/{key}"), submit: "/v1/jobs" };
    Ok(match task {
        Task::Run(run) => {
            // The limiting state takes a few milliseconds to compute.
            let (preview, scenario) =
                blocking(move || (Preview::of(&run.1), run.0.clone())).await?;
            let run = CheckedRun { key, cached, scenario, preview, warnings, time, excess, links };
            Checked::Run(Box::new(run))
        }
        Task::Study(study) => {
            let units = study.units();
            let columns = study.columns().into_iter().map(|column| column.name).collect();
            let (points, seconds, answer_bytes) = (study.points(), study.seconds, study.bytes());
            let cost = StudyCost { points, seconds, answer_bytes };
            let study =
                CheckedStudy { key, cached, asked, columns, units, cost, time, excess, links };
            Checked::Study(Box::new(study))
        }
    })
}

/// An example.
#[derive(Debug, Serialize, ToSchema)]
pub struct ExampleAnswer {
    /// Its name in addresses.
    #[schema(example = "steel-ball")]
    name: &'static str,
    /// A description for people.
    #[schema(value_type = String)]
    label: Value,
    /// The job body.
    #[schema(value_type = Object)]
    body: Value,
}

/// Lists examples of job bodies.
///
/// Each can be sent to `POST /v1/jobs`. The first is the steel ball of the documentation.
#[utoipa::path(get, path = "/v1/examples", operation_id = "list_examples", tag = "scenarios",
    responses(
        (status = 200, description = "The examples.", body = Vec<ExampleAnswer>),
        (status = 304, description = "The client's copy is valid."),
    ),
)]
pub async fn examples(headers: HeaderMap, _: NoQuery) -> Result<Response> {
    let read = |example: &Example| {
        let body: Value = serde_json::from_str(example.body)?;
        Ok(ExampleAnswer { name: example.name, label: body["label"].clone(), body })
    };
    let answers: serde_json::Result<Vec<_>> = EXAMPLES.iter().map(read).collect();
    let text = answers.and_then(|answers| serde_json::to_vec(&answers)).map_err(Problem::bug)?;
    Ok(fixed(&headers, "application/json", text))
}

/// Returns an example of a job body.
///
/// It can be sent to `POST /v1/jobs` unchanged.
#[utoipa::path(get, path = "/v1/examples/{name}", operation_id = "get_example", tag = "scenarios",
    params(("name" = String, Path, description = "The `name` of an example.", example = "steel-ball")),
    responses(
        (status = 200, description = "A job body.",
            content((ref("#/components/schemas/JobBody") = "application/json"))),
        (status = 304, description = "The client's copy is valid."),
        (status = 404, description = "No example has this name."),
    ),
)]
pub async fn example(name: Segment, headers: HeaderMap, _: NoQuery) -> Result<Response> {
    let example = EXAMPLES.iter().find(|example| example.name == &*name).ok_or_else(|| {
        Problem::new(&kinds::NOT_FOUND, "No example has this name. GET /v1/examples lists all.")
    })?;
    Ok(fixed(&headers, "application/json", example.body))
}

/// Returns the JSON Schema of a scenario.
///
/// Draft 2020-12, with the units, bounds and defaults of all members, for editors and forms.
#[utoipa::path(get, path = "/v1/schema/scenario", operation_id = "get_scenario_schema",
    tag = "scenarios",
    responses(
        (status = 200, description = "A JSON Schema, draft 2020-12.",
            content((serde_json::Value = "application/schema+json"))),
        (status = 304, description = "The client's copy is valid."),
    ),
)]
pub async fn schema(headers: HeaderMap, _: NoQuery) -> Response {
    fixed(&headers, "application/schema+json", SCHEMA.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn every_file_in_examples_is_served_under_its_name() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/examples");
        let mut files: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .filter(|name| Path::new(name).extension().is_some_and(|end| end == "json"))
            .collect();
        let mut served: Vec<String> =
            EXAMPLES.iter().map(|example| format!("{}.json", example.name)).collect();
        files.sort();
        served.sort();
        assert_eq!(files, served);
    }

    #[test]
    fn every_example_is_a_valid_job() {
        for example in EXAMPLES {
            assert!(Submission::parse(example.body.as_bytes()).is_ok(), "{}", example.name);
        }
    }
}
