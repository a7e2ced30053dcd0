//! A pool of read-only connections.
//!
//! The pool of sqlx pings a connection each time it is returned, which costs as much as a read.
//! A read-only connection to a local file needs no ping.

use std::time::Duration;

use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection as _, SqliteConnection};
use tokio::sync::{MappedMutexGuard, Mutex, MutexGuard, Semaphore, SemaphorePermit};

use crate::database::{Error, Result};

/// Maximum time that a statement waits for a lock that another connection holds.
pub(super) const BUSY: Duration = Duration::from_secs(5);

#[derive(Debug)]
pub(super) struct Readers {
    /// `None` after `close`.
    connections: Vec<Mutex<Option<SqliteConnection>>>,
    /// One permit for each free connection.
    free: Semaphore,
}

/// A borrowed connection.
pub(super) struct Reader<'a> {
    pub(super) connection: MappedMutexGuard<'a, SqliteConnection>,
    // Dropped after the connection.
    _permit: SemaphorePermit<'a>,
}

impl Readers {
    pub(super) async fn open(options: &SqliteConnectOptions, count: u32) -> Result<Self> {
        let mut connections = Vec::new();
        for _ in 0..count {
            let connection = SqliteConnection::connect_with(options).await?;
            connections.push(Mutex::new(Some(connection)));
        }
        let free = Semaphore::new(connections.len());
        Ok(Self { connections, free })
    }

    /// Borrows a connection, and waits until one is free.
    pub(super) async fn get(&self) -> Result<Reader<'_>> {
        let permit = self.free.acquire().await.map_err(|_| Error::Closed)?;
        let free = self.connections.iter().find_map(|connection| connection.try_lock().ok());
        let guard = free.ok_or(Error::Closed)?;
        let connection = MutexGuard::try_map(guard, Option::as_mut).map_err(|_| Error::Closed)?;
        Ok(Reader { connection, _permit: permit })
    }

    /// Closes all connections once they are returned.
    pub(super) async fn close(&self) {
        self.free.close();
        for connection in &self.connections {
            if let Some(connection) = connection.lock().await.take() {
                // A read-only connection has nothing to save.
                let _ = connection.close().await;
            }
        }
    }
}
