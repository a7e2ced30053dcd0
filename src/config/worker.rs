//! The settings of a worker.

use std::net::SocketAddr;
use std::time::Duration;

use clap::Args;

use super::data::Data;
use super::values::{duration, lease, nonzero, resolve, seconds};
use crate::service::WorkLimits;
use crate::telemetry::Logging;

/// The settings of `worker`.
#[derive(Debug, Args)]
pub struct Worker {
    #[command(flatten)]
    pub data: Data,
    /// Worker threads that compute runs [default: one per processor].
    #[arg(long, env = "FRETWORK_WORKERS", value_name = "N",
        value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub workers: Option<u16>,
    /// Address and port for monitors: /healthz, /readyz and /metrics. If the database has access keys, /metrics requires
    /// one with the role `read`.
    #[arg(long, env = "FRETWORK_WORKER_LISTEN", value_name = "ADDRESS", value_parser = resolve)]
    pub listen: Option<SocketAddr>,
    /// Seconds that runs may take to finish when the worker stops. Unfinished runs start again on another one.
    #[arg(long, env = "FRETWORK_DRAIN_SECONDS", default_value = "7", value_name = "SECONDS",
        value_parser = seconds)]
    pub drain_seconds: Duration,
    /// Time, such as 30s, after which other servers compute again what this one has left, if it dies. Each server renews its
    /// claim at a third of this time. Only for --database.
    #[arg(long, env = "FRETWORK_LEASE", default_value = "30s", value_name = "TIME", value_parser = lease)]
    pub lease: Duration,
    /// Time, such as 30s, for which a server must have been up before it computes again a run during which a server died.
    #[arg(long, env = "FRETWORK_CRASH_PAUSE", default_value = "10s", value_name = "TIME", value_parser = duration)]
    pub crash_pause: Duration,
    /// Maximum time of one run, such as 10min or 2h. 0 means no limit.
    #[arg(long, env = "FRETWORK_RUN_LIMIT", default_value = "30min", value_name = "TIME",
        value_parser = duration)]
    pub run_limit: Duration,
    /// End when there was nothing to compute for this time, such as 60s.
    #[arg(long, env = "FRETWORK_IDLE_EXIT", value_name = "TIME", value_parser = duration)]
    pub idle_exit: Option<Duration>,
    /// End this time after the start, such as 3h50m: each thread first finishes its run, or its chunk of a study, within
    /// --drain-seconds.
    #[arg(long, env = "FRETWORK_UNTIL", value_name = "TIME", value_parser = duration)]
    pub until: Option<Duration>,
    #[command(flatten)]
    pub logging: Logging,
}

impl Worker {
    /// The limits of a run.
    pub fn limits(&self) -> WorkLimits {
        WorkLimits { run: nonzero(self.run_limit), ..WorkLimits::default() }
    }
}
