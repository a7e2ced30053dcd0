//! What the server says about itself: health, version, contract, documentation, problem pages.

use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use axum::Json;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::header::{CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE};
use axum::response::{Html, IntoResponse, Response};
use serde::Serialize;
use tokio::sync::Mutex;
use utoipa::ToSchema;

use super::App;
use super::problem::{self, Problem};
use super::wire::{self, NoQuery, Segment};
use crate::store::{self, Store};
use fretwork_engine::request::fields::{MAX_CYCLES, POINTS_RANGE};
use fretwork_engine::scenario::{MAX_ANSWER, NUMERICS};

/// Whether the server is well.
#[derive(Debug, Serialize, ToSchema)]
pub struct Health {
    /// `ok`.
    #[schema(example = "ok")]
    status: &'static str,
}

/// Says that the process is alive and answers.
///
/// Does not touch the database, so it stays cheap enough to be asked every second.
#[utoipa::path(get, path = "/healthz", operation_id = "health", tag = "system", responses(
    (status = 200, description = "The server answers.", body = Health),
))]
pub async fn health(_: NoQuery) -> Json<Health> {
    Json(Health { status: "ok" })
}

/// Whether the server can do its work.
#[derive(Debug, Serialize, ToSchema)]
pub struct Readiness {
    /// `ready`.
    #[schema(example = "ready")]
    status: &'static str,
    /// Computations that wait.
    #[schema(example = 0)]
    queued: u64,
    /// For how long the oldest of them has waited.
    #[schema(example = 0.0)]
    oldest_seconds: f64,
}

/// A queue in which something waits so long while nothing runs is stuck.
const STUCK: Duration = Duration::from_mins(1);
/// A database that takes longer to answer is not there.
const PATIENCE: Duration = Duration::from_secs(3);

/// Whether the database takes changes: found out once in a while, however often it is asked. Anybody may
/// ask, and to find out is to write.
#[derive(Debug, Default)]
pub struct Pulse(Mutex<Option<Instant>>);

impl Pulse {
    async fn feel(&self, store: &Store) -> Result<(), store::Error> {
        let mut felt = self.0.lock().await;
        if felt.is_none_or(|felt| felt.elapsed() > Duration::from_millis(500)) {
            *felt = None;
            store.ping().await?;
            *felt = Some(Instant::now());
        }
        Ok(())
    }
}

/// Says whether the server can do its work: the database takes changes and the queue moves.
///
/// For load balancers and start scripts. `GET /healthz` says only that the process is alive.
#[utoipa::path(get, path = "/readyz", operation_id = "readiness", tag = "system", responses(
    (status = 200, description = "It can.", body = Readiness),
    (status = 503, description = "It cannot; the detail says why."),
))]
pub async fn ready(State(app): State<App>, _: NoQuery) -> Result<Json<Readiness>, Problem> {
    let unready = |detail: &str| Problem::new(&problem::NOT_READY, detail).retry_after(5);
    if *app.draining.borrow() {
        return Err(unready("The server is going down."));
    }
    let looked = async {
        app.pulse.feel(&app.store).await?;
        app.store.longest_wait().await
    };
    let wait = match tokio::time::timeout(PATIENCE, looked).await {
        Ok(Ok(wait)) => wait,
        Ok(Err(error)) => return Err(unready(&format!("The database: {error}."))),
        Err(_) => return Err(unready("The database does not answer.")),
    };
    let (queued, running) = (app.store.tally().queued(), app.store.tally().running());
    if running == 0 && wait > STUCK {
        let detail = format!("The queue is stuck: {queued} wait, none runs.");
        return Err(unready(&detail));
    }
    Ok(Json(Readiness { status: "ready", queued, oldest_seconds: wait.as_secs_f64() }))
}

/// Which program this is, whose digits it computes and what it accepts.
#[derive(Debug, Serialize, ToSchema)]
pub struct Version {
    /// `fretwork`.
    #[schema(example = "fretwork")]
    name: &'static str,
    /// The release.
    #[serde(rename = "version")]
    #[schema(example = "0.1.0")]
    release: &'static str,
    /// The version of the digits. It rises when the same scenario would give other numbers, and
    /// enters every key.
    #[schema(example = 1)]
    numerics: u32,
    /// The limits of a request.
    limits: Limits,
}

/// The limits of a request.
#[derive(Debug, Serialize, ToSchema)]
pub struct Limits {
    /// The fewest and the most radii, `points`.
    #[schema(example = json!([16, 4096]))]
    points: [u16; 2],
    /// The most instants, `cycles`.
    #[schema(example = 1000)]
    cycles: usize,
    /// The largest request body, in bytes.
    #[schema(example = 4_194_304)]
    body_bytes: usize,
    /// The largest result as JSON, in bytes.
    #[schema(example = 64_000_000)]
    answer_bytes: usize,
    /// The longest wait of one request, in seconds.
    #[schema(example = 60)]
    wait_seconds: u64,
}

/// Says which program this is, whose digits it computes and what it accepts.
///
/// When `numerics` rises, the same scenario gives other digits and has another key.
#[utoipa::path(get, path = "/version", operation_id = "version", tag = "system", responses(
    (status = 200, description = "Name, release, numerics and limits.", body = Version),
))]
pub async fn version(_: NoQuery) -> Json<Version> {
    Json(Version {
        name: env!("CARGO_PKG_NAME"),
        release: env!("CARGO_PKG_VERSION"),
        numerics: NUMERICS,
        limits: Limits {
            points: [POINTS_RANGE.0, POINTS_RANGE.1],
            cycles: MAX_CYCLES,
            answer_bytes: MAX_ANSWER,
            body_bytes: wire::BODY_LIMIT,
            wait_seconds: wire::LONGEST_WAIT.as_secs(),
        },
    })
}

/// Returns the contract of this interface.
///
/// It is generated from the routes themselves, so it says what this server does.
#[utoipa::path(get, path = "/openapi.json", operation_id = "openapi", tag = "system", responses(
    (status = 200, description = "An OpenAPI 3.1 document.", body = serde_json::Value),
))]
pub async fn openapi(_: NoQuery) -> Response {
    // Built on first use: most processes are never asked.
    static DOCUMENT: LazyLock<Bytes> = LazyLock::new(|| super::openapi::document().into());
    ([(CONTENT_TYPE, "application/json")], DOCUMENT.clone()).into_response()
}

/// Lists the kinds of problems.
///
/// Every answer that is not a success has one of these as its `type`.
#[utoipa::path(get, path = "/problems", operation_id = "problems", tag = "system", responses(
    (status = 200, description = "A page for people.", body = String, content_type = "text/html"),
))]
pub async fn problems(_: NoQuery) -> Html<String> {
    Html(problem::index())
}

/// Explains one kind of problem.
///
/// What it means, and what to do about it.
#[utoipa::path(get, path = "/problems/{slug}", operation_id = "problem", tag = "system",
    params(("slug" = String, Path, description = "The last part of a problem's `type`.",
        example = "invalid-request")),
    responses(
        (status = 200, description = "A page for people.", body = String, content_type = "text/html"),
        (status = 404, description = "No problem has this name."),
    ),
)]
pub async fn explain(Segment(slug): Segment, _: NoQuery) -> Result<Html<String>, Problem> {
    let none = "No problem has this name; GET /problems lists them all.";
    problem::page(&slug).map(Html).ok_or_else(|| Problem::new(&problem::NOT_FOUND, none))
}

/// Swagger UI, from files inside the program: it works without a network.
pub async fn docs(Segment(path): Segment) -> Result<Response, Problem> {
    static CONFIG: LazyLock<Arc<utoipa_swagger_ui::Config<'static>>> = LazyLock::new(|| {
        let config = utoipa_swagger_ui::Config::from("/openapi.json");
        Arc::new(config.try_it_out_enabled(true).display_request_duration(true))
    });
    let file = utoipa_swagger_ui::serve(&path, CONFIG.clone()).map_err(|error| {
        tracing::error!(error, "the documentation could not be served");
        Problem::internal()
    })?;
    let file = file.ok_or_else(|| {
        Problem::new(&problem::NOT_FOUND, "The documentation has no such page; start at /docs/.")
    })?;
    let headers = [
        (CONTENT_TYPE, file.content_type.as_str()),
        (CACHE_CONTROL, "max-age=3600"),
        (
            CONTENT_SECURITY_POLICY,
            "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; \
             frame-ancestors 'none'",
        ),
    ];
    Ok((headers, file.bytes).into_response())
}
