//! The tables in PostgreSQL, which any number of servers share.
//!
//! Each verb is one short transaction at the isolation level *read committed*. A statement sees what was committed
//! before the statement began. So a verb locks rows in one statement, and reads them in the next one. A lock on the row
//! of a run protects the run and its jobs. A lock on the row of a study protects its pieces. A verb locks the study
//! before the run. After a conflict with another transaction, a verb is retried.
//!
//! A server may compute a run or piece as long as it renews the lease of it. Any server revokes expired leases.
//!
//! Servers send each other notifications about what to read again. A notification can be lost, so each server also
//! reads the tables periodically. Only a notification of a deleted result must not be lost. So a server that may have
//! missed one removes all results from its memory.

mod backlog;
pub(super) mod cancel;
pub(super) mod chunks;
mod contact;
mod eviction;
mod follow;
mod hints;
mod lease;
pub(super) mod maintenance;
mod node;
pub(super) mod open;
mod pool;
mod queue;
mod rest;
pub(super) mod runs;
mod schema;
pub(super) mod storing;
pub(super) mod submit;
mod transaction;

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use tokio::sync::{RwLock, Semaphore, watch};
use tokio::time::timeout;

use crate::database::{Error, Purpose, Result, Row, Signals, Statement, Tables, sql};

use backlog::Backlog;
use contact::Contact;
use hints::Hints;
use pool::Pool;
use queue::Queue;
use transaction::reading;

/// Timeout of one attempt of a verb, for a database server that never answers. It is longer than `statement_timeout`.
const PATIENCE: Duration = Duration::from_secs(45);

/// This process, as one of the servers that share the database.
#[derive(Debug)]
struct Node {
    id: String,
    /// The id of the row of this program in the table `program`.
    program: i64,
    /// The duration of a lease after it was begun or renewed.
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
    /// The hints for the other servers.
    hints: Arc<Hints>,
    node: Node,
    backlog: Backlog,
    queue: Queue,
    /// Locked by claims: for writing by one that may take a part that was lost.
    claiming: RwLock<()>,
    /// The name of the database for messages, without the password.
    name: String,
    /// The reason why this program may no longer write the tables, if there is one: a later version of the program has
    /// changed them, and writes of this version would do harm.
    refusal: OnceLock<Error>,
    /// A directory on the disk of the database, if this machine has it.
    disk: Option<PathBuf>,
    /// The tasks in the background end when this becomes true or is dropped.
    closing: watch::Sender<bool>,
}

impl Database {
    /// Free bytes on the disk that the user has configured. PostgreSQL does not report them, and may be on another
    /// machine.
    pub(super) fn free_bytes(&self) -> Option<u64> {
        fs4::available_space(self.0.disk.as_ref()?).ok()
    }

    /// The number of open connections for verbs and leases. The connection that waits for notifications is not counted.
    pub(super) fn connections(&self) -> u64 {
        self.0.pool.open() + self.0.renewals.open()
    }

    pub(super) async fn close(&self) {
        self.0.closing.send_replace(true);
        self.0.pool.close().await;
        self.0.renewals.close().await;
    }

    /// Reads with a connection of the pool.
    pub(super) async fn read(&self, purpose: Purpose, statement: Statement) -> Result<Vec<Row>> {
        let permit = async {
            match purpose {
                Purpose::Any | Purpose::Keys => Ok(None),
                Purpose::Scan => self.0.scans.acquire().await.map(Some),
                Purpose::Large => self.0.large.acquire().await.map(Some),
            }
        };
        let permit = timeout(PATIENCE, permit).await.map_err(|_| Error::Exhausted)?;
        let _permit = permit.map_err(|_| Error::Closed)?;
        reading!(self, db => db.rows(statement.clone()).await)
    }

    /// The time that the oldest queued run has waited. Also counts the queued and running runs and the dead rows for the
    /// metrics, and finds the age of the oldest snapshot. After a long count, the last one is used for a while.
    pub(super) async fn longest_wait(&self) -> Result<Duration> {
        let (backlog, tally) = (&self.0.backlog, &self.0.signals.tally);
        if let Some(waited) = backlog.waited(tally.dead()) {
            return Ok(waited);
        }
        let begun = Instant::now();
        let query = sql!(
            "SELECT count(*) AS queued, moment() - min(created) AS waited,
                 (SELECT count(*) FROM lease) AS running,
                 (SELECT count(*) FROM job WHERE state = 'queued') AS jobs,
                 pg_stat_get_dead_tuples('job'::REGCLASS) + pg_stat_get_dead_tuples('run'::REGCLASS)
                     + pg_stat_get_dead_tuples('lease'::REGCLASS) AS dead,
                 (SELECT extract(epoch FROM max(now() - xact_start))::DOUBLE PRECISION FROM pg_stat_get_activity(NULL)
                  WHERE backend_xmin IS NOT NULL AND backend_type <> 'autovacuum worker') AS snapshot
             FROM run WHERE state = 'queued'"
        );
        let counted = reading!(self, db => db.one(query.clone()).await);
        let row = counted.inspect_err(|_| backlog.is_unknown())?;
        let count = |column| row.get::<u64>(column).map(|count| count as usize);
        tally.queue_is(count("queued")?, count("running")?);
        tally.database_keeps(row.get("dead")?, row.get::<Option<f64>>("snapshot")?.unwrap_or(0.0));
        let waited: Option<i64> = row.get("waited")?;
        let waited = Duration::from_millis(waited.unwrap_or(0).max(0).unsigned_abs());
        backlog.read(count("jobs")?, waited, begun);
        Ok(waited)
    }

    /// Fails if only later versions of the program may write the tables.
    fn may_write(&self) -> Result<()> {
        self.0.refusal.get().cloned().map_or(Ok(()), Err)
    }
}
