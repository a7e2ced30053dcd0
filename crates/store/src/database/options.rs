//! Settings of the store.

use std::path::PathBuf;
use std::time::Duration;

/// Settings of the store.
#[derive(Debug, Clone)]
pub struct Options {
    /// Whether each commit waits for the disk. If true, an acknowledged change survives a power failure;
    /// otherwise it survives only a crash of the process.
    pub full_sync: bool,
    /// Maximum number of queued jobs.
    pub queue_limit: usize,
    /// How long finished jobs are kept; `None` means for ever.
    pub keep_jobs: Option<Duration>,
    /// Maximum size of the database in bytes; `None` means no limit. Above it, the server deletes the jobs, results and
    /// scenarios that were used longest ago. In PostgreSQL, only the bodies of results count, and only these are
    /// evicted.
    pub budget: Option<u64>,
    /// Bytes of results that one owner may pin. If there is a budget, all owners together may pin half of it, so that
    /// there is room for new results.
    pub pin_quota: u64,
    /// A directory on the disk of a shared database, whose free space is a metric.
    pub disk: Option<PathBuf>,
    /// Servers that share a database renew the leases of their runs. If a server has not renewed a lease for this time,
    /// another server takes over the run.
    pub lease: Duration,
    /// Servers that share a database read the tables again at this interval, even without a notification.
    pub poll: Duration,
    /// A run during which the process has died waits until the next process has been up for this time.
    pub settle: Duration,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            full_sync: false,
            queue_limit: 20_000,
            keep_jobs: None,
            budget: None,
            pin_quota: 1 << 30,
            disk: None,
            lease: Duration::from_secs(30),
            poll: Duration::from_secs(5),
            settle: Duration::ZERO,
        }
    }
}

/// Sizes in bytes; `None` if the system does not report them.
#[derive(Debug, Clone, Copy, Default)]
pub struct FileSizes {
    /// The database.
    pub database: Option<u64>,
    /// Its write-ahead log.
    pub log: Option<u64>,
}

/// Numbers of unfinished runs that the last process left behind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Recovered {
    /// Running runs, and running pieces of studies, that are queued again.
    pub requeued: u64,
    /// Running runs that were lost too often and have failed.
    pub failed: u64,
    /// Runs that were being canceled and are canceled now.
    pub canceled: u64,
}

/// A run fails after this number of crashes of the process during its computation. For a study, only crashes during the
/// same piece count.
pub(crate) const MAX_LOST: u32 = 3;
