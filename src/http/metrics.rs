//! Metrics of the server in the OpenMetrics text format.

use std::time::{Duration, Instant};

use axum::http::{Method, StatusCode};
use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::{ConstGauge, Gauge};
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::metrics::info::Info;
use prometheus_client::registry::{Registry, Unit};

use super::admission::Admission;
use super::shares::Shares;
use crate::store::Tally;
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
    /// The metrics of a server.
    pub fn new(tally: &Tally, workers: usize, admission: &Admission, shares: &Shares) -> Self {
        let mut registry = Registry::with_prefix("fretwork");
        let version = env!("CARGO_PKG_VERSION").to_owned();
        let build = Info::new(vec![("version", version), ("numerics", NUMERICS.to_string())]);
        registry.register("build", "Version of the program and of its numbers", build);
        let workers = ConstGauge::new(i64::try_from(workers).unwrap_or(i64::MAX));
        registry.register("workers", "Worker threads", workers);
        tally.register(&mut registry);
        registry.register("connections", "Open connections", admission.open.clone());
        registry.register(
            "connections_refused",
            "Connections refused because there were too many",
            admission.refused.clone(),
        );
        registry.register_with_unit(
            "transfers",
            "Memory for large bodies of requests and answers",
            Unit::Bytes,
            shares.held.clone(),
        );
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
            "Waiting time of the oldest queued run",
            Unit::Seconds,
            metrics.longest_wait.clone(),
        );
        registry.register_with_unit(
            "disk_free",
            "Free space on the disk of the data directory",
            Unit::Bytes,
            metrics.free.clone(),
        );
        registry.register(
            "memory_cache_hits",
            "Answers found in memory",
            metrics.memory_hits.clone(),
        );
        registry.register(
            "memory_cache_misses",
            "Answers not found in memory",
            metrics.memory_misses.clone(),
        );
        registry.register(
            "http_requests",
            "Answered requests by method, route and status",
            metrics.requests.clone(),
        );
        registry.register_with_unit(
            "http_request_duration",
            "Time from the head of a request to the head of its answer, including requested waits",
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

    /// Counts a lookup in the memory.
    pub fn looked_up(&self, found: bool) {
        if found { &self.memory_hits } else { &self.memory_misses }.inc();
    }
}

/// Clients can invent methods, but a label must have few values.
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

impl Metrics {
    /// Writes all metrics as OpenMetrics text.
    ///
    /// # Errors
    /// A metric has no text.
    pub fn write(
        &self,
        longest_wait: Option<Duration>,
        free_bytes: Option<u64>,
    ) -> Result<String, std::fmt::Error> {
        // An unknown value must not look like the previous one.
        self.longest_wait.set(longest_wait.map_or(f64::NAN, |wait| wait.as_secs_f64()));
        if let Some(free) = free_bytes {
            self.free.set(free.try_into().unwrap_or(i64::MAX));
        }
        let mut text = String::new();
        encode(&mut text, &self.registry)?;
        Ok(text)
    }
}
