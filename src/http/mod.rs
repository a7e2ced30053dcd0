//! The HTTP API.
//!
//! A handler translates the request, calls the service, and translates its answer. Related handlers share a
//! file. `layers` has what all answers share.

mod access;
mod app;
mod audit;
mod caller;
mod coding;
mod connection;
mod dashboard;
mod diff;
mod drain_body;
mod events;
mod include;
mod jobs;
mod keyring;
mod layers;
mod library;
mod limits;
mod links;
mod me;
mod memory;
mod metrics;
mod needs;
mod negotiation;
mod openapi;
mod problem;
mod process;
mod representation;
mod results;
mod routes;
mod scenarios;
mod schemas;
mod signed_link;
mod system;
mod wire;

use std::sync::Arc;

use axum::Router;
use axum::extract::Request;

pub use access::{Access, AdminKey};
pub use caller::{ME, Peer};
pub use connection::IdleTimeout;
pub use layers::Origins;
pub use limits::Limits;
pub use scenarios::{EXAMPLES, Example};
pub use signed_link::ADMIN;

use crate::service::Service;
use access::Gate;
use app::App;
use layers::with_layers;
use memory::Memory;
use metrics::Metrics;
use problem::Problem;
use routes::Routes;

/// Settings of the API.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Access control.
    pub access: Access,
    /// Bytes of answers that are kept in memory.
    pub memory: u64,
    /// The origins whose web pages may use the server.
    pub origins: Origins,
}

impl Default for Settings {
    fn default() -> Self {
        Self { access: Access::default(), memory: 64 << 20, origins: Origins::Own }
    }
}

/// The whole API of a service.
pub fn router(service: Service, settings: &Settings) -> Router {
    let Routes { router, needs } = Routes::all();
    let (router, _) = router.split_for_parts();
    let gate = Arc::new(Gate::new(service.store(), &settings.access, needs));
    let metrics = Arc::new(Metrics::new(service.tally(), service.workers()));
    let layered = with_layers(
        router.fallback(not_found),
        gate.clone(),
        metrics.clone(),
        settings.origins.clone(),
    );
    let memory = Memory::new(settings.memory);
    layered.with_state(App::new(service, gate, memory, metrics, || document().into()))
}

/// The OpenAPI document, as JSON text.
#[must_use]
pub fn document() -> Vec<u8> {
    let Routes { router, needs } = Routes::all();
    openapi::complete(&router.into_openapi(), &needs)
}

async fn not_found(request: Request) -> Problem {
    let detail = if request.uri().path().ends_with('/') {
        "No route has this address. Addresses here do not end with a slash."
    } else {
        "No route has this address. /docs lists all routes."
    };
    Problem::new(&problem::NOT_FOUND, detail)
}
