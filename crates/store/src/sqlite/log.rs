//! Limits the length of the write-ahead log while readers use it.
//!
//! SQLite restarts the log from its beginning only when no reader uses it. Under many overlapping reads, this never
//! happens without a pause for the readers.

use std::fs;
use std::path::PathBuf;

use super::readers::BUSY;

/// The write-ahead log.
pub(super) struct Log {
    path: PathBuf,
    /// Length in bytes at which SQLite runs a checkpoint by itself.
    limit: u64,
    /// Length in bytes above which the writer task waits for readers.
    patience: u64,
}

/// The statements that restart the log. They wait up to 100 ms for readers, which is too short for a backup. The last
/// statement restores the timeout, so it must be executed even if an earlier one fails.
pub(super) fn restart() -> [String; 3] {
    let wait = |time: u128| format!("PRAGMA busy_timeout = {time}");
    [wait(100), "PRAGMA wal_checkpoint(TRUNCATE)".to_owned(), wait(BUSY.as_millis())]
}

impl Log {
    pub(super) fn new(path: PathBuf, limit: u64) -> Self {
        Self { path, limit, patience: limit + limit / 2 }
    }

    fn bytes(&self) -> u64 {
        fs::metadata(&self.path).map_or(0, |log| log.len())
    }

    /// Whether the log is so long that the writer task must restart it.
    pub(super) fn is_long(&self) -> bool {
        self.bytes() > self.patience
    }

    /// Records an attempt to restart the log. If a reader has prevented it, the next attempt is made when the log is
    /// longer.
    pub(super) fn tried(&mut self) {
        self.patience = self.bytes() + self.limit + self.limit / 2;
    }
}
