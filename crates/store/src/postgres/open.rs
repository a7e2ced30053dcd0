//! Connects to the database, migrates it, and starts the tasks in the background.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use sqlx::postgres::PgConnection;
use sqlx::{ConnectOptions as _, Connection as _};
use tokio::sync::{RwLock, Semaphore, watch};

use super::backlog::Backlog;
use super::contact::Contact;
use super::pool::Pool;
use super::queue::Queue;
use super::{Database, Node, Parts, node, schema};
use crate::database::{DatabaseUrl, Lock, Options, Result, Signals};
use crate::results::library::Program;
use fretwork_job::JobId;

/// The number of connections for verbs.
const CONNECTIONS: u32 = 8;
/// The number of connections that may scan all results at the same time.
const SCANS: usize = 3;
/// The number of connections that may read large results at the same time.
const LARGE: usize = 2;

/// A larger difference of clocks is logged.
const APART: Duration = Duration::from_secs(2);

impl Database {
    pub(crate) async fn open(
        url: &DatabaseUrl,
        options: &Options,
        signals: Arc<Signals>,
    ) -> Result<Self> {
        let mut db = prepare(url).await?;
        let program = Program::this().id(&mut db).await?;
        let clock: i64 = sqlx::query_scalar("SELECT moment()").fetch_one(&mut db).await?;
        let apart = Duration::from_millis(clock.abs_diff(fretwork_job::clock::now()));
        if apart >= APART {
            tracing::warn!(
                ?apart,
                "the clock of the database differs from that of this machine; set both by NTP"
            );
        }
        db.close().await?;
        let Options { queue_limit, lease, .. } = *options;
        let (closing, closed) = watch::channel(false);
        let database = Self(Arc::new(Parts {
            pool: Pool::new(url.options(), CONNECTIONS),
            renewals: Pool::new(url.hasty(lease / 3), 1),
            contact: Contact::new(lease),
            scans: Semaphore::new(SCANS),
            large: Semaphore::new(LARGE),
            signals,
            hints: Arc::default(),
            node: Node { id: JobId::generate().to_string(), program, lease },
            backlog: Backlog::new(queue_limit),
            queue: Queue::default(),
            claiming: RwLock::default(),
            name: url.to_string(),
            refusal: OnceLock::new(),
            disk: options.disk.clone(),
            closing,
        }));
        node::start(&database, url, options, &closed);
        Ok(database)
    }
}

/// Connects to a database, and creates or migrates its tables if necessary.
pub(crate) async fn prepare(url: &DatabaseUrl) -> Result<PgConnection> {
    let mut db = url.patient().connect().await?;
    // Of several servers that start at the same time, only one migrates at a time.
    let lock = |call| sqlx::query(call).bind(Lock::Schema as i64);
    lock("SELECT pg_advisory_lock($1)").execute(&mut db).await?;
    schema::migrate(&mut db, url).await?;
    lock("SELECT pg_advisory_unlock($1)").execute(&mut db).await?;
    match schema::refusal(&mut db, &url.to_string()).await? {
        None => Ok(db),
        Some(error) => Err(error),
    }
}
