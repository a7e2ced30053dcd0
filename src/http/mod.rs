//! The HTTP API.
//!
//! A handler translates the request, calls the service, and translates its answer. `wire` reads query parameters and
//! headers, and `transport` reads connections and bodies. `access` decides who may call a route. `answer` makes the
//! representations of results, and `memory` caches them. `layers` surrounds all routes.

mod access;
mod answer;
mod api;
mod app;
mod dashboard;
mod layers;
mod memory;
mod metrics;
#[cfg(test)]
mod openapi;
mod problem;
mod routes;
mod shares;
mod transport;
mod wire;

use std::future;
use std::sync::Arc;

use axum::Router;
use axum::extract::Request;
use futures_util::FutureExt as _;
use futures_util::future::{OptionFuture, join};
use tokio::net::TcpListener;

pub use access::Access;
pub use access::caller::{ME, is_owner_name};
pub use access::limits::Limits;
pub use access::secret::Secret;
pub use access::sign_on::SignOn;
pub use access::signed_link::ADMIN;
pub use api::keys::{KEY_LIFETIMES, KEY_NAMES, KEY_ROLES, key_lifetime};
pub use api::scenarios::{EXAMPLES, Example};
pub use api::system::DOCUMENT;
pub use dashboard::report::page as report_page;
pub use layers::Origins;
pub use transport::admission::Connections;
pub use transport::server::listen;

use crate::service::Service;
use access::Gate;
use access::caller::Caller;
use access::needs::RouteNeeds;
use app::App;
use layers::with_layers;
use problem::{Complaint, Problem, Result, blocking, kinds};
use routes::Routes;
use transport::admission::Admission;
use transport::body::Body;
use transport::server;
use wire::{FRESH_JSON, Fresh, NoQuery, Query, Segment, instant, read_key, schemas};

/// Settings of the API.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Access control.
    pub access: Access,
    /// Size of the memory cache of answers, in bytes.
    pub memory: u64,
    /// Memory for the bodies of requests and answers until they are read or sent, in bytes.
    pub transfers: u64,
    /// Limits of connections.
    pub connections: Connections,
    /// The origins whose web pages may use the server.
    pub origins: Origins,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            access: Access::default(),
            memory: 64 << 20,
            transfers: 128 << 20,
            connections: Connections::default(),
            origins: Origins::Own,
        }
    }
}

/// The hint in a 404 answer of the main socket.
const API: &str = "/docs/api/ lists all routes.";
/// The hint in a 404 answer of the socket of UM-Bridge.
const UMBRIDGE: &str = "This port serves only UM-Bridge. GET /Info lists its models.";
/// The hint in a 404 answer of the socket of a worker.
const MONITORING: &str = "A worker serves only /healthz, /readyz and /metrics.";

/// Serves the API of a service on one socket and UM-Bridge alone on another, until `closing` ends and all connections are
/// closed.
pub async fn serve(
    api: TcpListener,
    umbridge: Option<TcpListener>,
    service: Service,
    settings: &Settings,
    closing: impl Future<Output = ()>,
) {
    let Routes { router, needs, .. } = Routes::all();
    let server = Server::new(service, settings, needs);
    let closing = closing.shared();
    let umbridge = umbridge.map(|listener| {
        server.serve(listener, Routes::default().umbridge().router, UMBRIDGE, closing.clone())
    });
    let api = server.serve(api, router, API, closing.clone());
    let serving = join(api, OptionFuture::from(umbridge));
    tokio::select! {
        _ = serving => {}
        () = server.app.memory.follow(server.app.store.watch_deletions()) => {}
    }
}

/// Serves only the health, the readiness and the metrics of a service, for monitors. It does not end.
pub async fn serve_monitoring(listener: TcpListener, service: Service) {
    let Routes { router, needs, .. } = Routes::default().monitoring();
    let server = Server::new(service, &Settings::default(), needs);
    server.serve(listener, router, MONITORING, future::pending()).await;
}

/// The state that all sockets of a server share.
struct Server {
    app: App,
    admission: Arc<Admission>,
    origins: Origins,
}

impl Server {
    fn new(service: Service, settings: &Settings, needs: RouteNeeds) -> Self {
        let gate = Gate::new(service.store(), &settings.access, needs);
        let admission = Arc::new(Admission::new(settings.connections.clone()));
        let memory = (settings.memory, settings.transfers);
        let app = App::new(service, gate, &admission, memory);
        Self { app, admission, origins: settings.origins.clone() }
    }

    /// Serves routes on a socket, until `closing` ends and the connections of the socket are closed. The 404 answer to
    /// other addresses contains the hint `served`.
    async fn serve(
        &self,
        listener: TcpListener,
        router: Router<App>,
        served: &'static str,
        closing: impl Future<Output = ()>,
    ) {
        let router = router.fallback(async move |request: Request| not_found(&request, served));
        let router = with_layers(router, self.app.clone(), self.origins.clone());
        let router = router.with_state(self.app.clone());
        server::serve(listener, router, self.admission.clone(), closing).await;
    }
}

fn not_found(request: &Request, served: &str) -> Problem {
    let hint = match request.uri().path() {
        path if path.len() > 1 && path.ends_with('/') => "Remove the slash at the end.",
        _ => served,
    };
    Problem::new(&kinds::NOT_FOUND, format!("No route has this address. {hint}"))
}
