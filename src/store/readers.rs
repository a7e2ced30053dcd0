//! The connections that read, beside the one that writes.
//!
//! The library's pool asks a connection whether it is well each time it comes back, which costs as
//! much as a read. These have nothing that could fail between two reads.

use std::sync::atomic::{AtomicUsize, Ordering};

use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection as _, SqliteConnection};
use tokio::sync::{MappedMutexGuard, Mutex, MutexGuard};

use super::Error;

#[derive(Debug)]
pub(super) struct Readers {
    /// None once closed.
    connections: Vec<Mutex<Option<SqliteConnection>>>,
    next: AtomicUsize,
}

impl Readers {
    pub(super) async fn open(options: &SqliteConnectOptions, count: u32) -> Result<Self, Error> {
        let mut connections = Vec::new();
        for _ in 0..count.max(1) {
            let connection = SqliteConnection::connect_with(options).await?;
            connections.push(Mutex::new(Some(connection)));
        }
        Ok(Self { connections, next: AtomicUsize::new(0) })
    }

    /// A connection that nobody else uses meanwhile.
    pub(super) async fn get(&self) -> Result<MappedMutexGuard<'_, SqliteConnection>, Error> {
        let free = self.connections.iter().find_map(|connection| connection.try_lock().ok());
        let guard = if let Some(guard) = free {
            guard
        } else {
            // Whoever waits is spread over all of them.
            let next = self.next.fetch_add(1, Ordering::Relaxed) % self.connections.len();
            self.connections[next].lock().await
        };
        MutexGuard::try_map(guard, Option::as_mut).map_err(|_| Error::Closed)
    }

    pub(super) async fn close(&self) {
        for connection in &self.connections {
            if let Some(connection) = connection.lock().await.take() {
                // It has nothing to lose.
                let _ = connection.close().await;
            }
        }
    }
}
