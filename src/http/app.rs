//! What handlers share.

use std::ops::Deref;
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use axum::body::Bytes;
use tokio::sync::Mutex;

use super::access::Gate;
use super::memory::Memory;
use super::metrics::Metrics;
use super::shares::Shares;
use crate::service::Service;
use crate::store::Error;

/// The state of all handlers. axum clones it for each request, so it is one counted reference.
#[derive(Debug, Clone)]
pub struct App(Arc<Shared>);

impl Deref for App {
    type Target = Shared;
    fn deref(&self) -> &Shared {
        &self.0
    }
}

/// What all requests share.
#[derive(Debug)]
pub struct Shared {
    pub service: Service,
    pub gate: Arc<Gate>,
    pub memory: Memory,
    pub shares: Arc<Shares>,
    pub metrics: Arc<Metrics>,
    /// The OpenAPI document. It is made when it is first requested.
    pub document: LazyLock<Bytes>,
    /// When the database was last seen to be writable.
    written: Mutex<Option<Instant>>,
}

/// Shortest time between two writes that check the database.
const WRITE_INTERVAL: Duration = Duration::from_millis(500);

impl App {
    pub fn new(
        service: Service,
        gate: Arc<Gate>,
        memory: Memory,
        shares: Arc<Shares>,
        metrics: Arc<Metrics>,
        document: fn() -> Bytes,
    ) -> Self {
        let (document, written) = (LazyLock::new(document), Mutex::default());
        Self(Arc::new(Shared { service, gate, memory, shares, metrics, document, written }))
    }

    /// Checks that the database is writable, by writing to it. Anyone may request this, so it writes at most
    /// twice per second.
    ///
    /// # Errors
    /// The database is not writable.
    pub async fn check_writable(&self) -> Result<(), Error> {
        let mut written = self.written.lock().await;
        if written.is_none_or(|written| written.elapsed() > WRITE_INTERVAL) {
            *written = None;
            self.service.ping().await?;
            *written = Some(Instant::now());
        }
        Ok(())
    }
}
