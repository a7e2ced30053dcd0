//! The state that all handlers share.

use std::convert::Infallible;
use std::ops::Deref;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::extract::FromRequestParts;
use axum::http::request::Parts;
use tokio::sync::Mutex;

use super::access::Gate;
use super::access::session::Unencrypted;
use super::memory::Memory;
use super::memory::models::{self, Models};
use super::metrics::Metrics;
use super::shares::Shares;
use super::transport::admission::Admission;
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

impl FromRequestParts<App> for App {
    type Rejection = Infallible;

    async fn from_request_parts(_: &mut Parts, app: &App) -> Result<Self, Infallible> {
        Ok(app.clone())
    }
}

/// The state that all requests share.
pub struct Shared {
    pub service: Service,
    /// The store, for operations to which the service adds nothing, such as finding a result.
    pub store: Store,
    pub gate: Gate,
    pub memory: Memory,
    pub shares: Arc<Shares>,
    pub metrics: Metrics,
    /// The models of UM-Bridge, by their configs.
    pub models: Models,
    pub unencrypted: Unencrypted,
    /// When the server last probed the database, and the outcome.
    probed: Mutex<Option<(Instant, Result<(), Error>)>>,
}

/// Shortest time between two probes of the database. Each probe writes 256 KiB, and anyone may request one. The server
/// notices a full disk or a missing file within this time.
const PROBE_INTERVAL: Duration = Duration::from_secs(2);

impl App {
    /// `memory` is for answers that are kept, `transfers` for large bodies of requests and answers, in bytes.
    pub fn new(
        service: Service,
        gate: Gate,
        admission: &Admission,
        (memory, transfers): (u64, u64),
    ) -> Self {
        let (store, memory) = (service.store().clone(), Memory::new(memory));
        let shares = Arc::new(Shares::new(transfers, service.places()));
        let metrics = Metrics::new(store.tally(), service.workers(), admission, &shares);
        let models = models::empty();
        Self(Arc::new(Shared {
            service,
            store,
            gate,
            memory,
            shares,
            metrics,
            models,
            unencrypted: Unencrypted::default(),
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
