//! Counts commits in the database and in a file beside it, to detect commits that the write-ahead log has lost.
//!
//! SQLite ignores a log from its first damaged page on, and starts without a log that was removed. In both cases, the
//! latest commits are missing without an error. So each transaction increments a number in the table `room`, and the
//! server writes the number to its lock file after the commit. If the number in the file is larger at the next start,
//! commits are missing.
//!
//! The file is not synced. A power failure can lose the number together with the commits. Then the loss is not
//! detected.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, Write as _};

use sqlx::SqliteConnection;

use crate::database::Result;
use fretwork_job::clock::rfc3339;

/// The lock file of the data directory, with the number of commits.
pub(super) struct Ledger {
    /// Locks the directory against other servers.
    lock: File,
    /// Whether the last write of the number failed. Only the first of consecutive failures is logged.
    failed: bool,
    /// The number of commits that were missing at the start.
    pub(super) missing: i64,
}

impl Ledger {
    /// Compares the number in the file with that in the database. Logs an error if commits are missing.
    pub(super) async fn open(mut lock: File, db: &mut SqliteConnection) -> Result<Self> {
        let (commits, at) =
            sqlx::query_as("SELECT commits, committed FROM room").fetch_one(db).await?;
        // The lock file of an earlier version is empty.
        let mut missing = 0;
        if let Some((noted, until)) = read(&mut lock).filter(|(noted, _)| *noted > commits) {
            missing = noted - commits;
            tracing::error!(
                missing,
                since = rfc3339(at),
                until = rfc3339(until),
                "acknowledged changes are missing: the write-ahead log was damaged or removed, or an older copy of \
                 the database was put in place; submit the jobs of that time again, or restore a backup"
            );
        }
        let mut ledger = Self { lock, failed: false, missing };
        ledger.note(commits, at);
        Ok(ledger)
    }

    /// Writes the number of commits and the time of the last one.
    pub(super) fn note(&mut self, commits: i64, at: i64) {
        let line = format!("{commits:020} {at:020}\n");
        let done = self.lock.rewind().and_then(|()| self.lock.write_all(line.as_bytes()));
        if let Err(error) = &done
            && !self.failed
        {
            tracing::warn!(%error, "cannot count commits beside the database: a lost commit would not be noticed");
        }
        self.failed = done.is_err();
    }
}

/// Reads the number of commits, and the time of the last one in milliseconds since 1970; `None` if there is none.
fn read(lock: &mut File) -> Option<(i64, i64)> {
    let mut text = String::new();
    lock.rewind().and_then(|()| lock.read_to_string(&mut text)).ok()?;
    let (commits, at) = text.trim_end().split_once(' ')?;
    Some((commits.parse().ok()?, at.parse().ok()?))
}

/// Deletes the number, because a restored backup replaces the database, and has another number.
pub(crate) fn forget(lock: &File) -> io::Result<()> {
    lock.set_len(0)
}
