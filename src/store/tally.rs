//! What has happened since the start, in numbers for those who watch the server.

use std::sync::atomic::AtomicU64;

use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::registry::{Registry, Unit};

use super::Error;
use crate::job::Origin;

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ending {
    Succeeded,
    Failed,
    Canceled,
    /// It waits again.
    Released,
}

impl Ending {
    const ALL: [Self; 4] = [Self::Succeeded, Self::Failed, Self::Canceled, Self::Released];

    fn as_str(self) -> &'static str {
        match self {
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
            Self::Canceled => "canceled",
            Self::Released => "released",
        }
    }
}

/// Counters that differ in one label.
type Counters = Family<[(&'static str, &'static str); 1], Counter>;

fn count(counters: &Counters, label: &'static str, value: &'static str) {
    counters.get_or_create(&[(label, value)]).inc();
}

/// Counters of the store, and the state of its queue.
#[derive(Debug)]
pub struct Tally {
    jobs: Counters,
    runs: Counters,
    seconds: Histogram,
    recomputes: Counters,
    evicted: Counter,
    errors: Counters,
    queued: Gauge,
    working: Gauge,
    bytes: Gauge,
    /// About how long a run takes, in seconds: the last ones count most.
    usual: Gauge<f64, AtomicU64>,
}

impl Default for Tally {
    fn default() -> Self {
        let tally = Self {
            jobs: Family::default(),
            runs: Family::default(),
            // From a millisecond to a quarter of an hour.
            seconds: Histogram::new(exponential_buckets(1e-3, 4.0, 11)),
            recomputes: Family::default(),
            evicted: Counter::default(),
            errors: Family::default(),
            queued: Gauge::default(),
            working: Gauge::default(),
            bytes: Gauge::default(),
            usual: Gauge::default(),
        };
        // What never happened is 0, not absent: an alert needs something to compare with.
        for ending in Ending::ALL {
            let _ = tally.runs.get_or_create(&[("outcome", ending.as_str())]);
        }
        for origin in Origin::ALL {
            let _ = tally.jobs.get_or_create(&[("origin", origin.as_str())]);
        }
        for result in ["same", "differs"] {
            let _ = tally.recomputes.get_or_create(&[("result", result)]);
        }
        for kind in ["busy", "damaged", "full", "other"] {
            let _ = tally.errors.get_or_create(&[("kind", kind)]);
        }
        tally
    }
}

impl Tally {
    /// Makes all of it part of what is told.
    pub fn register(&self, registry: &mut Registry) {
        registry.register(
            "jobs",
            "Jobs accepted, by how they come to their result",
            self.jobs.clone(),
        );
        registry.register(
            "runs",
            "Computations ended, by how; released ones wait again",
            self.runs.clone(),
        );
        registry.register_with_unit(
            "run_duration",
            "From the beginning of a computation to its end",
            Unit::Seconds,
            self.seconds.clone(),
        );
        registry.register(
            "recomputes",
            "Results computed again; one that differs is a fault of program or machine",
            self.recomputes.clone(),
        );
        registry.register(
            "results_evicted",
            "Results dropped because all took more room than they may",
            self.evicted.clone(),
        );
        registry.register(
            "store_errors",
            "What the database refused; full means that the disk is",
            self.errors.clone(),
        );
        registry.register(
            "queued_runs",
            "Computations that wait for a worker",
            self.queued.clone(),
        );
        registry.register("running_runs", "Computations that workers are at", self.working.clone());
        registry.register_with_unit(
            "results",
            "Size of the results that are kept",
            Unit::Bytes,
            self.bytes.clone(),
        );
    }

    /// Computations that wait.
    #[must_use]
    pub fn queued(&self) -> u64 {
        u64::try_from(self.queued.get()).unwrap_or(0)
    }

    /// Computations that workers are at.
    #[must_use]
    pub fn running(&self) -> u64 {
        u64::try_from(self.working.get()).unwrap_or(0)
    }

    /// How long a computation takes, about; 0 as long as none has ended.
    #[must_use]
    pub fn seconds_per_run(&self) -> f64 {
        self.usual.get()
    }

    pub(super) fn submitted(&self, origin: Origin) {
        count(&self.jobs, "origin", origin.as_str());
    }

    pub(super) fn settled(&self, ending: Ending, milliseconds: Option<i64>) {
        count(&self.runs, "outcome", ending.as_str());
        if let Some(milliseconds) = milliseconds {
            let seconds = milliseconds as f64 / 1e3;
            self.seconds.observe(seconds);
            let usual = self.usual.get();
            self.usual.set(if usual > 0.0 { usual + 0.1 * (seconds - usual) } else { seconds });
        }
    }

    pub(super) fn recomputed(&self, same: bool) {
        count(&self.recomputes, "result", if same { "same" } else { "differs" });
    }

    pub(super) fn evicted(&self) {
        self.evicted.inc();
    }

    pub(super) fn failed(&self, error: &Error) {
        let kind = match error {
            Error::Full(_) => "full",
            Error::Busy(_) => "busy",
            Error::Damaged(_) | Error::DamagedResult(_) => "damaged",
            Error::Closed | Error::JobExists(_) => return,
            _ => "other",
        };
        count(&self.errors, "kind", kind);
    }

    pub(super) fn queue_is(&self, queued: usize, working: usize) {
        self.queued.set(i64::try_from(queued).unwrap_or(i64::MAX));
        self.working.set(i64::try_from(working).unwrap_or(i64::MAX));
    }

    pub(super) fn room_is(&self, bytes: u64) {
        self.bytes.set(i64::try_from(bytes).unwrap_or(i64::MAX));
    }
}
