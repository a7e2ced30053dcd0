//! Keeps the write-ahead log short while readers use it.
//!
//! SQLite starts the log anew only when no reader uses it. Under many overlapping reads that never happens by itself.

use std::fs;
use std::path::PathBuf;

use super::readers::BUSY;

/// The write-ahead log.
#[derive(Debug)]
pub(super) struct Log {
    path: PathBuf,
    /// Bytes up to which SQLite checkpoints by itself.
    limit: u64,
    /// Bytes from which the writer task waits for readers.
    patience: u64,
}

/// The statements that start the log anew. They wait up to 100 ms for readers; a backup reads for longer. The last one
/// is needed also if one before it fails.
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

    /// Whether the log is so long that the writer task must start it anew.
    pub(super) fn is_long(&self) -> bool {
        self.bytes() > self.patience
    }

    /// Records an attempt. If a reader has prevented it, the next one waits until the log is longer.
    pub(super) fn tried(&mut self) {
        self.patience = self.bytes() + self.limit + self.limit / 2;
    }
}
