//! The connections to the database. A broken connection is replaced when it is needed next.
//!
//! The pool of sqlx pings a connection each time it is returned, which takes as long as a short statement. This pool
//! does not ping: a broken connection is noticed when a transaction begins, before anything has changed.

use std::mem;
use std::time::Duration;

use parking_lot::Mutex;
use sqlx::postgres::{PgConnectOptions, PgConnection};
use sqlx::{ConnectOptions as _, Connection as _};
use tokio::sync::{Semaphore, SemaphorePermit};
use tokio::time::timeout;

use crate::database::{Connected, Connection, Error, Result};

/// Maximum time that a caller waits for a free connection, and maximum time to open one.
const PATIENCE: Duration = Duration::from_secs(10);

/// A fixed number of connections. Each is opened when it is needed first.
#[derive(Debug)]
pub(super) struct Pool {
    options: PgConnectOptions,
    /// Connections that are not borrowed. The last one is borrowed first, so that few connections are opened.
    idle: Mutex<Vec<PgConnection>>,
    /// One permit for each connection that is not borrowed or not opened yet.
    free: Semaphore,
    count: u32,
}

/// A borrowed connection. If its last statement was answered, the connection returns to the pool when this is dropped.
/// Otherwise it is closed: it is broken, or the caller was dropped before the answer, and the next caller would have to
/// wait for that answer.
pub(super) struct Borrowed<'a> {
    pool: &'a Pool,
    connection: Option<PgConnection>,
    /// Whether the connection was opened for this caller.
    pub(super) is_new: bool,
    /// Whether the last statement was answered, and no transaction is open.
    pub(super) has_answered: bool,
    // Dropped after the connection was returned.
    _permit: SemaphorePermit<'a>,
}

impl Pool {
    pub(super) fn new(options: PgConnectOptions, count: u32) -> Self {
        let free = Semaphore::new(count as usize);
        Self { options, idle: Mutex::default(), free, count }
    }

    /// Waits until a connection is free, and borrows it. The connection may be broken.
    pub(super) async fn get(&self) -> Result<Borrowed<'_>> {
        let permit = timeout(PATIENCE, self.free.acquire()).await.map_err(|_| Error::Exhausted)?;
        let permit = permit.map_err(|_| Error::Closed)?;
        let idle = self.idle.lock().pop();
        let is_new = idle.is_none();
        let connection = if let Some(connection) = idle {
            connection
        } else {
            let connecting = timeout(PATIENCE, self.options.connect()).await;
            connecting.map_err(|_| Error::Exhausted)??
        };
        let connection = Some(connection);
        Ok(Borrowed { pool: self, connection, is_new, has_answered: false, _permit: permit })
    }

    /// The number of connections that are open or being opened.
    pub(super) fn open(&self) -> u64 {
        // A connection that returns meanwhile may be counted twice.
        let borrowed = self.count as usize - self.free.available_permits();
        (borrowed + self.idle.lock().len()).min(self.count as usize) as u64
    }

    /// Waits a while for earlier borrowers, refuses later ones, and closes all connections.
    pub(super) async fn close(&self) {
        let _ = timeout(PATIENCE, self.free.acquire_many(self.count)).await;
        self.free.close();
        let idle = mem::take(&mut *self.idle.lock());
        for connection in idle {
            // If the connection is broken, the server rolls back its transaction.
            let _ = connection.close().await;
        }
    }
}

impl Borrowed<'_> {
    #[expect(clippy::expect_used, reason = "it is only taken when this is dropped")]
    pub(super) fn connection(&mut self) -> &mut PgConnection {
        self.connection.as_mut().expect("it was not dropped")
    }
}

impl Connected for Borrowed<'_> {
    fn connection(&mut self) -> Connection<'_> {
        Connection::Postgres(self.connection())
    }
}

impl Drop for Borrowed<'_> {
    fn drop(&mut self) {
        if let Some(mut connection) = self.connection.take()
            && self.has_answered
            && !self.pool.free.is_closed()
        {
            // Otherwise each connection would keep room for the largest result that it has carried.
            connection.shrink_buffers();
            self.pool.idle.lock().push(connection);
        }
    }
}
