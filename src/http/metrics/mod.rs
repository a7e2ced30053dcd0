//! Metrics of the server, in the text formats of Prometheus and OpenMetrics.

pub mod process;

use std::fmt;
use std::sync::atomic::AtomicU64;
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

use crate::http::shares::Shares;
use crate::http::transport::admission::Admission;
use fretwork_engine::NUMERICS;
use fretwork_store::{FileSizes, Tally};

/// The metrics of this process.
pub struct Metrics {
    registry: Registry,
    requests: Family<Answered, Counter>,
    durations: Family<Routed, Histogram, fn() -> Histogram>,
    measured: [Gauge<f64, AtomicU64>; MEASURED.len()],
    memory_hits: Counter,
    memory_misses: Counter,
}

/// The values that are measured when a client requests the metrics. `None` means unknown.
#[derive(Debug, Default)]
pub struct Measurements {
    /// How long the oldest queued run has waited.
    pub longest_wait: Option<Duration>,
    /// When the last backup ended, in milliseconds since 1970; 0 if there was none.
    pub last_backup: Option<i64>,
    /// Free space on the disk of the data directory, in bytes.
    pub free: Option<u64>,
    pub files: FileSizes,
    /// Open connections to the database.
    pub database_connections: Option<u64>,
}

/// A metric that is measured when a client requests the metrics: name, unit, help and value.
type MeasuredMetric = (&'static str, Option<Unit>, &'static str, fn(&Measurements) -> Option<f64>);

const MEASURED: [MeasuredMetric; 6] = [
    ("queue_oldest", Some(Unit::Seconds), "Waiting time of the oldest queued run", |measured| {
        measured.longest_wait.map(|wait| wait.as_secs_f64())
    }),
    (
        "last_backup_timestamp",
        Some(Unit::Seconds),
        "When the last backup ended, in seconds since 1970; 0 if there was none",
        |measured| measured.last_backup.map(|at| at as f64 / 1e3),
    ),
    ("disk_free", Some(Unit::Bytes), "Free space on the disk of the data directory", |measured| {
        measured.free.map(|bytes| bytes as f64)
    }),
    ("database", Some(Unit::Bytes), "Size of the database", |measured| {
        measured.files.database.map(|bytes| bytes as f64)
    }),
    (
        "database_log",
        Some(Unit::Bytes),
        "Size of the write-ahead log of the database",
        |measured| measured.files.log.map(|bytes| bytes as f64),
    ),
    ("database_connections", None, "Open connections to PostgreSQL", |measured| {
        measured.database_connections.map(|count| count as f64)
    }),
];

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Answered {
    method: &'static str,
    route: String,
    status: u16,
}

type Routed = [(&'static str, String); 1];

impl Metrics {
    /// The metrics of a server.
    pub fn new(tally: &Tally, workers: usize, admission: &Admission, shares: &Shares) -> Self {
        let mut all = Registry::default();
        process::register(all.sub_registry_with_prefix("process"));
        let registry = all.sub_registry_with_prefix("fretwork");
        let version = env!("CARGO_PKG_VERSION").to_owned();
        let build = Info::new(vec![("version", version), ("numerics", NUMERICS.to_string())]);
        registry.register("build", "Version of the program and of its numbers", build);
        let workers = ConstGauge::new(i64::try_from(workers).unwrap_or(i64::MAX));
        registry.register("workers", "Worker threads", workers);
        tally.register(registry);
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
        let measured = MEASURED.map(|(name, unit, help, _)| {
            let gauge = Gauge::default();
            match unit {
                Some(unit) => registry.register_with_unit(name, help, unit, gauge.clone()),
                None => registry.register(name, help, gauge.clone()),
            }
            gauge
        });
        let [memory_hits, memory_misses] = [
            ("memory_cache_hits", "Answers found in memory"),
            ("memory_cache_misses", "Answers not found in memory"),
        ]
        .map(|(name, help)| {
            let counter = Counter::default();
            registry.register(name, help, counter.clone());
            counter
        });
        let requests = Family::default();
        let help = "Answered requests by method, route and status";
        registry.register("http_requests", help, Family::clone(&requests));
        let buckets: fn() -> Histogram = || Histogram::new(exponential_buckets(1e-4, 4.0, 10));
        let durations = Family::new_with_constructor(buckets);
        let help =
            "Time from the head of a request to the head of its answer, including requested waits";
        registry.register_with_unit(
            "http_request_duration",
            help,
            Unit::Seconds,
            Family::clone(&durations),
        );
        Self { registry: all, requests, durations, measured, memory_hits, memory_misses }
    }

    /// Counts an answer.
    pub fn answered(&self, method: &Method, route: &str, status: StatusCode, started: Instant) {
        let route = route.to_owned();
        let answered = Answered { method: known(method), route, status: status.as_u16() };
        self.requests.get_or_create(&answered).inc();
        let routed = [("route", answered.route)];
        self.durations.get_or_create(&routed).observe(started.elapsed().as_secs_f64());
    }

    /// Counts a lookup in the memory.
    pub fn looked_up(&self, found: bool) {
        if found { &self.memory_hits } else { &self.memory_misses }.inc();
    }

    /// Writes all metrics as OpenMetrics text.
    ///
    /// # Errors
    /// A metric has no text.
    pub fn write(&self, measured: &Measurements) -> Result<String, fmt::Error> {
        for (gauge, (.., value)) in self.measured.iter().zip(MEASURED) {
            // An unknown value must not look like the previous one.
            gauge.set(value(measured).unwrap_or(f64::NAN));
        }
        let mut text = String::new();
        encode(&mut text, &self.registry)?;
        Ok(text)
    }
}

/// The label of a method. Clients can invent methods, but a label must have few values, so all unknown methods share
/// one.
fn known(method: &Method) -> &'static str {
    let known = ["GET", "HEAD", "POST", "PUT", "DELETE", "OPTIONS"];
    known.into_iter().find(|known| *known == method.as_str()).unwrap_or("other")
}

/// Translates OpenMetrics text to the text format 0.0.4 of Prometheus. There the name of a metric family includes the
/// suffix of its samples, and there are neither units nor an end mark.
pub fn as_prometheus(open_metrics: &str) -> String {
    let mut text = String::with_capacity(open_metrics.len());
    let mut help = "";
    for line in open_metrics.lines() {
        if let Some(described) = line.strip_prefix("# HELP ") {
            help = described.split_once(' ').map_or("", |(_, help)| help);
        } else if let Some((name, kind)) =
            line.strip_prefix("# TYPE ").and_then(|typed| typed.split_once(' '))
        {
            let (suffix, kind) = match kind {
                "counter" => ("_total", "counter"),
                "info" => ("_info", "gauge"),
                kind => ("", kind),
            };
            text.extend(["# HELP ", name, suffix, " ", help, "\n"]);
            text.extend(["# TYPE ", name, suffix, " ", kind, "\n"]);
        } else if !line.starts_with('#') {
            text.extend([line, "\n"]);
        }
    }
    text
}
