//! The state that all handlers share.

use std::ops::Deref;
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use axum::body::Bytes;
use tokio::sync::Mutex;

use super::access::Gate;
use super::memory::Memory;
use super::memory::models::{self, Models};
use super::metrics::Metrics;
use super::shares::Shares;
use crate::service::Service;
use fretwork_store::{Error, Store};

/// The state of all handlers. axum clones it for each request, so it is a single `Arc`.
#[derive(Clone)]
pub struct App(Arc<Shared>);

impl Deref for App {
    type Target = Shared;
    fn deref(&self) -> &Shared {
        &self.0
    }
}

/// The state that all requests share.
pub struct Shared {
    pub service: Service,
    /// The store, for operations to which the service adds nothing, such as finding a result.
    pub store: Store,
    pub gate: Arc<Gate>,
    pub memory: Memory,
    pub shares: Arc<Shares>,
    pub metrics: Arc<Metrics>,
    /// The models of UM-Bridge, by their configs.
    pub models: Models,
    /// The OpenAPI document. It is made when it is first requested.
    pub document: LazyLock<Bytes>,
    /// When the server last probed the database, and the outcome.
    probed: Mutex<Option<(Instant, Result<(), Error>)>>,
}

/// Shortest time between two probes of the database. Each probe writes 256 KiB, and anyone may request one. The server
/// notices a full disk or a missing file within this time.
const PROBE_INTERVAL: Duration = Duration::from_secs(2);

impl App {
    pub fn new(
        service: Service,
        gate: Arc<Gate>,
        memory: Memory,
        shares: Arc<Shares>,
        metrics: Arc<Metrics>,
        document: fn() -> Bytes,
    ) -> Self {
        Self(Arc::new(Shared {
            store: service.store().clone(),
            service,
            gate,
            memory,
            shares,
            metrics,
            models: models::empty(),
            document: LazyLock::new(document),
            probed: Mutex::default(),
        }))
    }

    /// Checks that the database can store a submission, or did so less than [`PROBE_INTERVAL`] ago.
    ///
    /// # Errors
    /// A submission would fail.
    pub async fn check_storage(&self) -> Result<(), Error> {
        let mut probed = self.probed.lock().await;
        if let Some((at, outcome)) = &*probed
            && at.elapsed() < PROBE_INTERVAL
        {
            return outcome.clone();
        }
        let outcome = self.store.probe().await;
        *probed = Some((Instant::now(), outcome.clone()));
        outcome
    }
}
