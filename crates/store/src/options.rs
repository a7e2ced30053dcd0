//! Settings of the store.

use std::path::PathBuf;
use std::time::Duration;

/// Settings of the store.
#[derive(Debug, Clone)]
pub struct Options {
    /// Whether each commit waits for the disk. If true, an acknowledged change survives a power failure;
    /// otherwise it survives only a crash of the process.
    pub full_sync: bool,
    /// The largest number of queued jobs.
    pub queue_limit: usize,
    /// How long finished jobs are kept; `None` means for ever.
    pub keep_jobs: Option<Duration>,
    /// Bytes of the database beyond which the server deletes what was used longest ago; `None` means no limit.
    pub budget: Option<u64>,
    /// Bytes of results that one owner may pin. If there is a budget, all owners together may pin half of it, so that
    /// there is room for new results.
    pub pin_quota: u64,
    /// A directory on the disk of a shared database, whose free space is a metric.
    pub disk: Option<PathBuf>,
    /// How long the work of a server of several is its own after the server was last heard of. Others take it over then.
    pub lease: Duration,
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
/// How many unfinished runs of the last process were found at the start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Recovered {
    /// Running runs, and running pieces of studies, that are queued again.
    pub requeued: u64,
    /// Running runs that were lost too often and have failed.
    pub failed: u64,
    /// Runs that were being canceled and are canceled now.
    pub canceled: u64,
}

/// A run fails after the process has died this often while computing it, or while computing the same piece of it.
pub(super) const MAX_LOST: u32 = 3;
