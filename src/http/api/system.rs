//! The server itself: health, version, OpenAPI document, problem pages.

use std::time::Duration;

use axum::Json;
use axum::http::HeaderMap;
use axum::http::header::{CONTENT_SECURITY_POLICY, CONTENT_TYPE, VARY};
use axum::response::{Html, IntoResponse, Response};
use serde::Serialize;
use tokio::time::timeout;
use utoipa::ToSchema;

use crate::http::answer::fixed::fixed;
use crate::http::dashboard::docs::POLICY;
use crate::http::metrics::{Measurements, as_prometheus};
use crate::http::transport::body::BODY_LIMIT;
use crate::http::wire::negotiation::choose;
use crate::http::{App, NoQuery, Problem, Result, Segment, kinds, problem, wire};
use crate::service::{LONGEST_CALL, LONGEST_EVALUATION, RUN_BYTES, WorkLimits};
use fretwork_engine::NUMERICS;
use fretwork_engine::input::fields::{MAX_CYCLES, POINTS_RANGE};

/// The OpenAPI document, as JSON text. A test compares it with the routes.
pub const DOCUMENT: &[u8] = include_bytes!("../../../openapi/openapi.json");

/// The health of the process.
#[derive(Debug, Serialize, ToSchema)]
pub struct Health {
    /// `ok`.
    #[schema(example = "ok")]
    status: &'static str,
}

/// Reports that the process answers.
///
/// It does not use the database, so a monitor can call it every second.
#[utoipa::path(get, path = "/healthz", operation_id = "health", tag = "system", responses(
    (status = 200, description = "The server answers.", body = Health),
))]
pub async fn health(_: NoQuery) -> Json<Health> {
    Json(Health { status: "ok" })
}

/// Whether the server can accept jobs.
#[derive(Debug, Serialize, ToSchema)]
pub struct Readiness {
    /// `ready`.
    #[schema(example = "ready")]
    status: &'static str,
    /// Number of queued runs.
    #[schema(example = 0)]
    queued: u64,
    /// Waiting time of the oldest queued run, in seconds.
    #[schema(example = 0.0)]
    oldest_seconds: f64,
}

/// A queue is stuck if a run waits longer than this while no run is computed.
const STUCK: Duration = Duration::from_mins(1);
/// Maximum time to wait for the database.
const TIMEOUT: Duration = Duration::from_secs(3);

/// Reports whether the server can accept jobs: the disk has room for a submission and the queue is not stuck.
///
/// For load balancers and start scripts. `GET /healthz` checks only that the process answers.
#[utoipa::path(get, path = "/readyz", operation_id = "readiness", tag = "system", responses(
    (status = 200, description = "The server can accept jobs.", body = Readiness),
    (status = 503, description = "The server cannot accept jobs; `detail` says why."),
))]
pub async fn ready(app: App, _: NoQuery) -> Result<Json<Readiness>> {
    let unready = |detail: &str| Problem::new(&kinds::NOT_READY, detail).retry_after(5);
    if app.service.is_draining() {
        return Err(unready("The server is shutting down."));
    }
    let check = async {
        app.check_storage().await?;
        app.store.longest_wait().await
    };
    let wait = timeout(TIMEOUT, check).await;
    let wait = wait.map_err(|_| unready("The database does not answer."))?.map_err(|error| {
        unready(&format!("The server cannot store jobs: {error}.")).caused_by(&error)
    })?;
    let tally = app.store.tally();
    let (queued, running) = (tally.queued(), tally.running());
    if running == 0 && wait > STUCK {
        let detail = format!(
            "The queue is stuck: {queued} runs wait and no run is computed. Check the workers."
        );
        return Err(unready(&detail));
    }
    Ok(Json(Readiness { status: "ready", queued, oldest_seconds: wait.as_secs_f64() }))
}

/// The program, the version of its numbers, and its limits.
#[derive(Debug, Serialize, ToSchema)]
pub struct Version {
    /// `fretwork`.
    #[schema(example = "fretwork")]
    name: &'static str,
    /// The release.
    #[serde(rename = "version")]
    #[schema(example = "0.4.0")]
    release: &'static str,
    /// The version of the numbers. It rises when the same scenario gives other digits. It is part of
    /// every key.
    #[schema(example = 1)]
    numerics: u32,
    /// The limits of a request.
    limits: RequestLimits,
}

/// The limits of a request.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Limits)]
pub struct RequestLimits {
    /// Smallest and largest number of radii, `points`.
    #[schema(example = json!([16, 4096]))]
    points: [u16; 2],
    /// Largest number of output cycles, `cycles`.
    #[schema(example = 1000)]
    cycles: usize,
    /// Largest request body, in bytes.
    #[schema(example = 4_194_304)]
    body_bytes: usize,
    /// Largest result of a new run as JSON, in bytes.
    #[schema(example = 16_000_000)]
    answer_bytes: usize,
    /// Longest estimated run of `POST /v1/evaluate`, in seconds.
    #[schema(example = 0.15)]
    evaluate_seconds: f64,
    /// Longest estimated computation of derivatives or of a call of UM-Bridge, in seconds.
    #[schema(example = 30)]
    call_seconds: u64,
    /// Most points of a study.
    #[schema(example = 1_048_576)]
    study_points: usize,
    /// Largest result of a study as JSON, in bytes.
    #[schema(example = 64_000_000)]
    study_bytes: usize,
    /// Longest processor time of a study, in seconds; null if there is no limit.
    #[schema(example = 14_400)]
    study_seconds: Option<u64>,
    /// Longest wait of one request, in seconds.
    #[schema(example = 60)]
    wait_seconds: u64,
}

/// Returns the version of the program and of its numbers, and the limits of a request.
///
/// When `numerics` rises, the same scenario gives other digits and has another key.
#[utoipa::path(get, path = "/version", operation_id = "version", tag = "system", responses(
    (status = 200, description = "Name, release, numerics and limits.", body = Version),
))]
pub async fn version(app: App, _: NoQuery) -> Json<Version> {
    let WorkLimits { study, study_points, study_bytes, .. } = app.service.limits();
    Json(Version {
        name: env!("CARGO_PKG_NAME"),
        release: env!("CARGO_PKG_VERSION"),
        numerics: NUMERICS,
        limits: RequestLimits {
            points: [POINTS_RANGE.0, POINTS_RANGE.1],
            cycles: MAX_CYCLES,
            answer_bytes: RUN_BYTES,
            study_points,
            study_bytes,
            study_seconds: study.map(|time| time.as_secs()),
            body_bytes: BODY_LIMIT,
            evaluate_seconds: LONGEST_EVALUATION.as_secs_f64(),
            call_seconds: LONGEST_CALL.as_secs(),
            wait_seconds: wire::LONGEST_WAIT.as_secs(),
        },
    })
}

/// The text formats of [`metrics`]. The first is the default.
const EXPOSITIONS: [&str; 2] = ["text/plain", "application/openmetrics-text"];

/// Returns the metrics of the server.
///
/// In the text format of Prometheus, or as OpenMetrics text if the header `Accept` prefers it. The file
/// `deploy/alerts.yml` of the program has rules for alerts.
#[utoipa::path(get, path = "/metrics", operation_id = "metrics", tag = "system", responses(
    (status = 200, description = "All metrics.", content(
        (String = "text/plain"),
        (String = "application/openmetrics-text"),
    )),
))]
pub async fn metrics(app: App, headers: HeaderMap, _: NoQuery) -> Result<Response> {
    // If the database does not answer, the other metrics must still be available.
    let read = async {
        (app.store.longest_wait().await.ok(), app.store.last_backup().await.ok().flatten())
    };
    let read = timeout(Duration::from_secs(2), read).await;
    let (longest_wait, last_backup) = read.unwrap_or_default();
    // A network disk can block, so this runs on a blocking thread.
    let store = app.store.clone();
    let disk = tokio::task::spawn_blocking(move || (store.free_bytes(), store.file_sizes()));
    let (free, files) = disk.await.unwrap_or_default();
    let database_connections = app.store.database_connections();
    let measured = Measurements { longest_wait, last_backup, free, files, database_connections };
    let mut text = app.metrics.write(&measured).map_err(Problem::bug)?;
    let kind = match choose(&headers, &EXPOSITIONS, |it| it).unwrap_or(EXPOSITIONS[0]) {
        "text/plain" => {
            text = as_prometheus(&text);
            "text/plain; version=0.0.4; charset=utf-8"
        }
        _ => "application/openmetrics-text; version=1.0.0; charset=utf-8",
    };
    Ok(([(CONTENT_TYPE, kind), (VARY, "accept")], text).into_response())
}

/// Returns the OpenAPI document.
///
/// It is generated from the routes of this server.
#[utoipa::path(get, path = "/openapi.json", operation_id = "openapi", tag = "system", responses(
    (status = 200, description = "An OpenAPI 3.1 document.", body = serde_json::Value),
    (status = 304, description = "The client's copy is valid."),
))]
pub async fn openapi(headers: HeaderMap, _: NoQuery) -> Response {
    fixed(&headers, "application/json", DOCUMENT)
}

/// Lists the problem types.
///
/// Every error has one of them as its `type`.
#[utoipa::path(get, path = "/problems", operation_id = "problems", tag = "system", responses(
    (status = 200, description = "An HTML page.", body = String, content_type = "text/html"),
))]
pub async fn problems(_: NoQuery) -> Response {
    ([(CONTENT_SECURITY_POLICY, POLICY)], Html(problem::index())).into_response()
}

/// Explains a problem type.
///
/// The page says what the problem means and how to solve it.
#[utoipa::path(get, path = "/problems/{slug}", operation_id = "problem", tag = "system",
    params(("slug" = String, Path, description = "The last part of a problem's `type`.",
        example = "invalid-request")),
    responses(
        (status = 200, description = "An HTML page.", body = String, content_type = "text/html"),
        (status = 404, description = "No problem type has this name."),
    ),
)]
pub async fn explain(slug: Segment, _: NoQuery) -> Result<Response> {
    let none = "No problem type has this name; GET /problems lists them all.";
    let page = problem::page(&slug).ok_or_else(|| Problem::new(&kinds::NOT_FOUND, none))?;
    Ok(([(CONTENT_SECURITY_POLICY, POLICY)], Html(page)).into_response())
}
