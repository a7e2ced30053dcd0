//! Metrics of the store since the start.

use std::sync::atomic::AtomicU64;

use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::registry::{Registry, Unit};

use crate::database::error::Error;
use fretwork_job::{Origin, Recomputed, words};

words! {
    /// How a run ended.
    pub(crate) enum Ending: "outcome" {
        Succeeded = "succeeded",
        Failed = "failed",
        Canceled = "canceled",
        /// The worker gave the run back, so it is queued again.
        Released = "released",
    }
}

/// Counters with one label.
type Counters = Family<[(&'static str, &'static str); 1], Counter>;

/// Counters that exist from the start with the value 0. Alerts need a value also for events that have not happened yet.
fn counters<const N: usize>(label: &'static str, values: [&'static str; N]) -> Counters {
    let counters = Counters::default();
    for value in values {
        let _ = counters.get_or_create(&[(label, value)]);
    }
    counters
}

fn count(counters: &Counters, label: &'static str, value: &'static str) {
    counters.get_or_create(&[(label, value)]).inc();
}

/// Metrics of the store and its queue.
#[derive(Debug)]
pub struct Tally {
    jobs: Counters,
    runs: Counters,
    seconds: Histogram,
    recomputes: Counters,
    /// Results that were evicted.
    pub(crate) evicted: Counter,
    /// Number of acknowledged commits that were missing at the start.
    pub(crate) lost: Gauge,
    errors: Counters,
    queued: Gauge,
    working: Gauge,
    /// Rows of the queue in PostgreSQL that are deleted or replaced, and are still in the way of the workers.
    dead: Gauge,
    /// Age of the oldest snapshot in PostgreSQL, in seconds.
    snapshot: Gauge<f64, AtomicU64>,
    /// Size of the stored results.
    pub(crate) bytes: Gauge,
    /// Exponential moving average of the duration of a run, in seconds.
    usual: Gauge<f64, AtomicU64>,
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            jobs: counters("origin", Origin::ALL.map(Origin::as_str)),
            runs: counters("outcome", Ending::ALL.map(Ending::as_str)),
            // Buckets from 1 ms to 17 min.
            seconds: Histogram::new(exponential_buckets(1e-3, 4.0, 11)),
            recomputes: counters("result", Recomputed::ALL.map(Recomputed::as_str)),
            evicted: Counter::default(),
            lost: Gauge::default(),
            errors: counters("kind", ["busy", "damaged", "full", "moved", "other"]),
            queued: Gauge::default(),
            working: Gauge::default(),
            dead: Gauge::default(),
            snapshot: Gauge::default(),
            bytes: Gauge::default(),
            usual: Gauge::default(),
        }
    }
}

impl Tally {
    /// Registers all metrics.
    pub fn register(&self, registry: &mut Registry) {
        for (name, help, counters) in [
            ("jobs", "Accepted jobs, by how they get their result", &self.jobs),
            ("runs", "Runs that ended, by outcome; released runs are queued again", &self.runs),
            (
                "recomputes",
                "Results that were computed again. One that differs from the stored one means a defect of the program or the machine; one that differs from a deleted one replaced it",
                &self.recomputes,
            ),
            (
                "store_errors",
                "Errors of the database; full means that the disk is full, moved that its files are gone",
                &self.errors,
            ),
        ] {
            registry.register(name, help, counters.clone());
        }
        let help = "Acknowledged commits that were missing at the start";
        registry.register("lost_commits", help, self.lost.clone());
        let help = "Results that were evicted to free space";
        registry.register("results_evicted", help, self.evicted.clone());
        registry.register("queued_runs", "Runs that wait for a worker", self.queued.clone());
        let help = "Runs and chunks of studies that workers compute";
        registry.register("running_runs", help, self.working.clone());
        let help = "Deleted or replaced rows of the queue that PostgreSQL keeps; 0 with SQLite";
        registry.register("dead_rows", help, self.dead.clone());
        let help =
            "Age of the oldest transaction in PostgreSQL that keeps dead rows; 0 with SQLite";
        registry.register_with_unit(
            "oldest_snapshot_age",
            help,
            Unit::Seconds,
            self.snapshot.clone(),
        );
        let (seconds, bytes) = (self.seconds.clone(), self.bytes.clone());
        registry.register_with_unit("run_duration", "Duration of a run", Unit::Seconds, seconds);
        registry.register_with_unit("results", "Size of the stored results", Unit::Bytes, bytes);
    }

    /// Runs that wait for a worker.
    pub fn queued(&self) -> u64 {
        self.queued.get().unsigned_abs()
    }

    /// Runs and chunks of studies that workers compute.
    pub fn running(&self) -> u64 {
        self.working.get().unsigned_abs()
    }

    /// Deleted or replaced rows of the queue that PostgreSQL keeps.
    pub(crate) fn dead(&self) -> u64 {
        self.dead.get().unsigned_abs()
    }

    /// Typical duration of a run in seconds; 0 before the first one has ended.
    pub fn seconds_per_run(&self) -> f64 {
        self.usual.get()
    }

    pub(crate) fn submitted(&self, origin: Origin) {
        count(&self.jobs, "origin", origin.as_str());
    }

    pub(crate) fn settled(&self, ending: Ending, milliseconds: Option<i64>) {
        count(&self.runs, "outcome", ending.as_str());
        if let Some(milliseconds) = milliseconds {
            // The clock may have been set back during the run.
            let seconds = milliseconds.max(0) as f64 / 1e3;
            self.seconds.observe(seconds);
            let usual = self.usual.get();
            self.usual.set(if usual > 0.0 { usual + 0.1 * (seconds - usual) } else { seconds });
        }
    }

    pub(crate) fn recomputed(&self, how: Recomputed) {
        count(&self.recomputes, "result", how.as_str());
    }

    pub(crate) fn failed(&self, error: &Error) {
        let kind = match error {
            Error::Full(_) => "full",
            Error::Busy(_) | Error::Unreachable(_) | Error::Exhausted => "busy",
            Error::Damaged(_) | Error::DamagedResult(_) | Error::DamagedChunk { .. } => "damaged",
            Error::Moved { .. } => "moved",
            Error::Closed | Error::JobExists(_) => return,
            _ => "other",
        };
        count(&self.errors, "kind", kind);
    }

    pub(crate) fn database_keeps(&self, dead: i64, snapshot: f64) {
        self.dead.set(dead);
        self.snapshot.set(snapshot);
    }

    pub(crate) fn queue_is(&self, queued: usize, working: usize) {
        self.queued.set((queued as u64).cast_signed());
        self.working.set((working as u64).cast_signed());
    }
}
