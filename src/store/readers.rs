//! The connections that read, beside the one that writes.
//!
//! The library's pool asks a connection whether it is well each time it comes back, which costs as
//! much as a read. These have nothing that could fail between two reads.

use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection as _, SqliteConnection};
use tokio::sync::{MappedMutexGuard, Mutex, MutexGuard, Semaphore, SemaphorePermit};

use super::Error;

#[derive(Debug)]
pub(super) struct Readers {
    /// None once closed.
    connections: Vec<Mutex<Option<SqliteConnection>>>,
    /// Who has a permit finds a connection that nobody uses.
    free: Semaphore,
}

/// A connection, for one reader.
pub(super) struct Reader<'a> {
    connection: MappedMutexGuard<'a, SqliteConnection>,
    // Given back after the connection.
    _permit: SemaphorePermit<'a>,
}

impl Reader<'_> {
    pub(super) fn connection(&mut self) -> &mut SqliteConnection {
        &mut self.connection
    }
}

impl Readers {
    pub(super) async fn open(options: &SqliteConnectOptions, count: u32) -> Result<Self, Error> {
        let mut connections = Vec::new();
        for _ in 0..count.max(1) {
            let connection = SqliteConnection::connect_with(options).await?;
            connections.push(Mutex::new(Some(connection)));
        }
        let free = Semaphore::new(connections.len());
        Ok(Self { connections, free })
    }

    /// A connection that nobody else uses meanwhile.
    pub(super) async fn get(&self) -> Result<Reader<'_>, Error> {
        let permit = self.free.acquire().await.map_err(|_| Error::Closed)?;
        let free = self.connections.iter().find_map(|connection| connection.try_lock().ok());
        let guard = free.ok_or(Error::Closed)?;
        let connection = MutexGuard::try_map(guard, Option::as_mut).map_err(|_| Error::Closed)?;
        Ok(Reader { connection, _permit: permit })
    }

    /// Closes them when who reads is done.
    pub(super) async fn close(&self) {
        self.free.close();
        for connection in &self.connections {
            if let Some(connection) = connection.lock().await.take() {
                // It has nothing to lose.
                let _ = connection.close().await;
            }
        }
    }
}
