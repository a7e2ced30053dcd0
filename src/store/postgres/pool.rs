//! The connections to the database. A broken one is replaced when it is next needed.
//!
//! The pool of sqlx pings a connection each time it is returned, which costs as much as a short statement. Here a broken
//! connection shows itself when a transaction begins, and then nothing has happened yet.

use std::time::Duration;

use sqlx::postgres::{PgConnectOptions, PgConnection};
use sqlx::{ConnectOptions as _, Connection as _};
use tokio::sync::{Mutex, MutexGuard, Semaphore, SemaphorePermit};
use tokio::time::timeout;

use crate::store::error::Error;

/// How long a caller waits for a connection, and how long connecting may take.
const PATIENCE: Duration = Duration::from_secs(10);

/// A number of connections, made when they are first needed.
#[derive(Debug)]
pub(super) struct Pool {
    options: PgConnectOptions,
    connections: Vec<Mutex<Option<PgConnection>>>,
    /// One permit for each connection that is not borrowed.
    free: Semaphore,
}

/// A borrowed connection.
pub(super) struct Borrowed<'a> {
    place: MutexGuard<'a, Option<PgConnection>>,
    is_new: bool,
    // Dropped after the connection.
    _permit: SemaphorePermit<'a>,
}

impl Pool {
    pub(super) fn new(options: PgConnectOptions, count: usize) -> Self {
        let connections = (0..count).map(|_| Mutex::new(None)).collect();
        Self { options, connections, free: Semaphore::new(count) }
    }

    /// Borrows a connection, and waits until one is free. It may be broken.
    pub(super) async fn get(&self) -> Result<Borrowed<'_>, Error> {
        let permit = timeout(PATIENCE, self.free.acquire()).await.map_err(|_| Error::Exhausted)?;
        let permit = permit.map_err(|_| Error::Closed)?;
        let mut free = self.connections.iter().filter_map(|place| place.try_lock().ok());
        let mut place = free.next().ok_or(Error::Closed)?;
        if place.is_none() {
            place = free.find(|place| place.is_some()).unwrap_or(place);
        }
        drop(free);
        let is_new = place.is_none();
        if is_new {
            let connecting = timeout(PATIENCE, self.options.connect()).await;
            *place = Some(connecting.map_err(|_| Error::Exhausted)??);
        }
        Ok(Borrowed { place, is_new, _permit: permit })
    }

    /// Closes all connections once they are returned.
    pub(super) async fn close(&self) {
        self.free.close();
        for place in &self.connections {
            if let Some(connection) = place.lock().await.take() {
                // The server ends what a broken connection has begun.
                let _ = connection.close().await;
            }
        }
    }
}

impl Borrowed<'_> {
    #[expect(clippy::expect_used, reason = "`Pool::get` has made the connection")]
    pub(super) fn connection(&mut self) -> &mut PgConnection {
        self.place.as_mut().expect("a borrowed connection was made")
    }

    #[expect(clippy::expect_used, reason = "`Pool::get` has made the connection")]
    pub(super) fn connection_ref(&self) -> &PgConnection {
        self.place.as_ref().expect("a borrowed connection was made")
    }

    /// Whether it was made for this caller.
    pub(super) fn is_new(&self) -> bool {
        self.is_new
    }

    /// Drops a broken connection.
    pub(super) fn discard(&mut self) {
        *self.place = None;
    }
}
