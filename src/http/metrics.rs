//! The numbers for those who watch the server, in the text format of OpenMetrics.

use std::time::{Duration, Instant};

use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::http::{Method, StatusCode};
use axum::response::{IntoResponse, Response};
use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::{ConstGauge, Gauge};
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::metrics::info::Info;
use prometheus_client::registry::{Registry, Unit};

use super::App;
use super::problem::Problem;
use super::wire::NoQuery;
use crate::store::Store;
use fretwork_engine::scenario::NUMERICS;

/// The metrics of this process.
#[derive(Debug)]
pub struct Metrics {
    registry: Registry,
    requests: Family<Answered, Counter>,
    durations: Family<Routed, Histogram, fn() -> Histogram>,
    longest_wait: Gauge<f64, std::sync::atomic::AtomicU64>,
    free: Gauge,
    memory_hits: Counter,
    memory_misses: Counter,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Answered {
    method: &'static str,
    route: String,
    status: u16,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Routed {
    route: String,
}

impl Metrics {
    /// The metrics of a server with this store and so many workers.
    pub fn new(store: &Store, workers: usize) -> Self {
        let mut registry = Registry::with_prefix("fretwork");
        let version = env!("CARGO_PKG_VERSION").to_owned();
        let build = Info::new(vec![("version", version), ("numerics", NUMERICS.to_string())]);
        registry.register("build", "Which program this is", build);
        let workers = ConstGauge::new(i64::try_from(workers).unwrap_or(i64::MAX));
        registry.register("workers", "Threads that compute", workers);
        store.tally().register(&mut registry);
        let buckets: fn() -> Histogram = || Histogram::new(exponential_buckets(1e-4, 4.0, 10));
        let metrics = Self {
            requests: Family::default(),
            durations: Family::new_with_constructor(buckets),
            longest_wait: Gauge::default(),
            free: Gauge::default(),
            memory_hits: Counter::default(),
            memory_misses: Counter::default(),
            registry: Registry::default(),
        };
        registry.register_with_unit(
            "queue_oldest",
            "How long the computation has waited that waits for longest",
            Unit::Seconds,
            metrics.longest_wait.clone(),
        );
        registry.register_with_unit(
            "disk_free",
            "What is free on the disk of the data directory",
            Unit::Bytes,
            metrics.free.clone(),
        );
        registry.register(
            "memory_cache_hits",
            "Answers that were at hand in memory",
            metrics.memory_hits.clone(),
        );
        registry.register(
            "memory_cache_misses",
            "Answers that were not at hand in memory",
            metrics.memory_misses.clone(),
        );
        registry.register(
            "http_requests",
            "Requests answered, by method, route and status",
            metrics.requests.clone(),
        );
        registry.register_with_unit(
            "http_request_duration",
            "From the head of a request to the head of its answer; waits that were asked for count",
            Unit::Seconds,
            metrics.durations.clone(),
        );
        Self { registry, ..metrics }
    }

    /// Counts an answer.
    pub fn answered(&self, method: &Method, route: &str, status: StatusCode, started: Instant) {
        let route = route.to_owned();
        let answered = Answered { method: known(method), route, status: status.as_u16() };
        self.requests.get_or_create(&answered).inc();
        let routed = Routed { route: answered.route };
        self.durations.get_or_create(&routed).observe(started.elapsed().as_secs_f64());
    }

    /// Counts a look into the memory.
    pub fn looked(&self, found: bool) {
        if found { &self.memory_hits } else { &self.memory_misses }.inc();
    }
}

/// Methods are what clients make up, and a label must not have endlessly many values.
fn known(method: &Method) -> &'static str {
    match *method {
        Method::GET => "GET",
        Method::HEAD => "HEAD",
        Method::POST => "POST",
        Method::PUT => "PUT",
        Method::DELETE => "DELETE",
        Method::OPTIONS => "OPTIONS",
        _ => "other",
    }
}

/// Returns the numbers for those who watch the server.
///
/// OpenMetrics text, as Prometheus and its kin collect it. Among them: `fretwork_queued_runs`,
/// `fretwork_running_runs` and `fretwork_queue_oldest_seconds` (a queue that is stuck grows old while
/// nothing runs), `fretwork_disk_free_bytes` and `fretwork_store_errors_total{kind="full"}` (a disk
/// that fills), `fretwork_recomputes_total{result="differs"}` (a fault of program or machine).
#[utoipa::path(get, path = "/metrics", operation_id = "metrics", tag = "system", responses(
    (status = 200, description = "All metrics.", body = String,
        content_type = "application/openmetrics-text"),
))]
pub async fn metrics(State(app): State<App>, _: NoQuery) -> Result<Response, Problem> {
    let metrics = &app.metrics;
    // A database that does not answer must not keep the other numbers back.
    let wait = tokio::time::timeout(Duration::from_secs(2), app.store.longest_wait()).await;
    // What is not known must not look like what it was.
    metrics
        .longest_wait
        .set(wait.map_or(f64::NAN, |wait| wait.map_or(f64::NAN, |t| t.as_secs_f64())));
    // The disk may be one that does not answer.
    let store = app.store.clone();
    if let Ok(Some(free)) = tokio::task::spawn_blocking(move || store.free_bytes()).await {
        metrics.free.set(i64::try_from(free).unwrap_or(i64::MAX));
    }
    let mut text = String::new();
    encode(&mut text, &metrics.registry).map_err(|_| Problem::internal())?;
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    Ok(([(CONTENT_TYPE, kind)], text).into_response())
}
