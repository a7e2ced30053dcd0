//! The tables in PostgreSQL, which any number of servers share.
//!
//! Each verb is one short transaction at the isolation level *read committed*. A statement sees what was committed before it
//! began. So a verb locks in one statement, and looks in the next one. The row of a run is the lock of the run and its jobs;
//! the row of a study is the lock of its pieces. A verb locks the study before the run. What still collides is done again.
//!
//! What a worker computes is its for as long as it renews its lease. Any server takes lost leases away.
//!
//! Servers tell each other by notifications what to read again. Each server also looks by itself from time to time. Only that a
//! result was deleted must be heard, so a listener that may have missed something forgets all results in memory.

pub(super) mod audit;
mod backlog;
mod cancel;
mod chunks;
mod contact;
mod follow;
mod hints;
pub(super) mod imports;
mod keep;
pub(super) mod keys;
mod lease;
pub(super) mod library;
mod node;
pub(super) mod open;
mod pool;
pub(super) mod read;
mod runs;
mod schema;
pub(super) mod search;
mod submit;
mod transaction;
mod upkeep;

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use tokio::sync::{Semaphore, watch};

use super::error::Error;
use super::options::FileSizes;
use super::pins::PinQuota;
use super::signals::{Effect, Signals};

use backlog::Backlog;
use contact::Contact;
use hints::Hints;
use pool::Pool;
use transaction::Transaction;

/// Advisory locks, by which servers exclude each other. Other programs in the same database must not use these numbers.
#[derive(Debug, Clone, Copy)]
#[repr(i64)]
enum Lock {
    /// Migrations.
    Schema = 0x6672_6574_0001,
    /// The sum of all pins.
    Pins = 0x6672_6574_0002,
    /// Maintenance.
    Upkeep = 0x6672_6574_0003,
}

/// This process among those that share the database.
#[derive(Debug)]
struct Node {
    id: String,
    /// The row of this program on this machine.
    program: i64,
    /// How long a lease lasts after it was begun or renewed.
    lease: Duration,
}

/// The open database, as a handle that is cheap to clone.
#[derive(Debug, Clone)]
pub(super) struct Database(Arc<Parts>);

#[derive(Debug)]
struct Parts {
    pool: Pool,
    /// The connection that renews leases.
    renewals: Pool,
    contact: Contact,
    /// Permits for scans of all results. They limit the number of concurrent scans.
    scans: Semaphore,
    /// Permits for large results, so that they do not take all connections.
    large: Semaphore,
    signals: Arc<Signals>,
    /// What to tell the other servers.
    hints: Arc<Hints>,
    node: Node,
    backlog: Backlog,
    pin_quota: PinQuota,
    /// The database in words, without its password.
    name: String,
    /// Why this program may no longer write the tables: a later one has changed them so that it would do harm.
    refusal: OnceLock<Error>,
    /// A directory on the disk of the database, if this machine has it.
    disk: Option<PathBuf>,
    /// The tasks in the background end when this becomes true or is dropped.
    closing: watch::Sender<bool>,
}

impl Database {
    /// PostgreSQL does not tell it, and may be on another machine.
    pub(super) fn free_bytes(&self) -> Option<u64> {
        fs4::available_space(self.0.disk.as_ref()?).ok()
    }

    #[expect(clippy::unused_self, reason = "the other engine needs it")]
    pub(super) fn file_sizes(&self) -> FileSizes {
        FileSizes::default()
    }

    /// Those for verbs and leases. One more waits for notifications.
    pub(super) fn connections(&self) -> u64 {
        self.0.pool.open() + self.0.renewals.open()
    }

    pub(super) async fn close(&self) {
        self.0.closing.send_replace(true);
        self.0.pool.close().await;
        self.0.renewals.close().await;
    }

    /// Refuses to change tables that only later programs may write.
    fn may_write(&self) -> Result<(), Error> {
        self.0.refusal.get().cloned().map_or(Ok(()), Err)
    }

    /// Signals the changes of a verb after their commit, here and to the other servers.
    fn settle<T>(&self, done: Result<(T, Vec<Effect>), Error>) -> Result<T, Error> {
        let (answer, effects) = self.0.signals.counted(done)?;
        self.0.hints.add(&effects);
        self.0.signals.apply(effects);
        Ok(answer)
    }
}
