//! The HTTP interface: what the service is told and what it answers.
//!
//! One file per noun. A handler translates the request, makes one call to the left, and translates
//! the answer. What all answers share (request id, log line, problems, CORS) happens once, in
//! [`router`].

mod access;
mod caller;
mod coding;
mod connection;
mod dashboard;
mod diff;
mod drain_body;
mod events;
mod jobs;
mod library;
mod limits;
mod links;
mod memory;
mod metrics;
mod negotiation;
mod openapi;
mod problem;
mod representation;
mod results;
mod scenarios;
mod system;
mod wire;

use std::any::Any;
use std::collections::HashMap;
use std::ops::Deref;
use std::sync::{Arc, LazyLock};
use std::time::Instant;

use axum::Router;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::{MethodRouter, get};
use tower::util::option_layer;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use tower_http::cors::{AllowHeaders, Any as AnyOrigin, CorsLayer};
use tracing::Instrument as _;
use utoipa_axum::router::{OpenApiRouter, UtoipaMethodRouter};
use utoipa_axum::routes;

pub use access::{ADMIN, Access, AdminKey};
pub use caller::{ME, Peer};
pub use connection::IdleTimeout;
pub use limits::Limits;
pub use openapi::document;
pub use scenarios::{EXAMPLES, Example};

use crate::service::Service;
use crate::store::Store;
use access::{Gate, Identity, Needs};
use caller::{REQUEST_ID, Trace};
use coding::Coding;
use drain_body::drain_body;
use memory::Memory;
use metrics::Metrics;
use problem::Problem;
use system::Pulse;
use wire::Segment;

/// What every handler can reach; one count of references, for it is cloned with each request.
#[derive(Debug, Clone)]
pub struct App(Arc<Shared>);

impl Deref for App {
    type Target = Shared;
    fn deref(&self) -> &Shared {
        &self.0
    }
}

/// What is shared by all requests.
#[derive(Debug)]
pub struct Shared {
    store: Store,
    service: Service,
    gate: Arc<Gate>,
    pulse: Pulse,
    memory: Memory,
    metrics: Arc<Metrics>,
}

/// How the interface is set up.
#[derive(Debug, Clone)]
pub struct Settings {
    /// How callers are told apart.
    pub access: Access,
    /// Bytes of answers kept in memory.
    pub memory: u64,
    /// Which web pages may call.
    pub origins: Origins,
}

impl Default for Settings {
    fn default() -> Self {
        Self { access: Access::default(), memory: 64 << 20, origins: Origins::Own }
    }
}

/// Which web pages may call the service from a browser.
#[derive(Debug, Clone, Default)]
pub enum Origins {
    /// Only pages of the service itself.
    #[default]
    Own,
    /// Every page.
    Any,
    /// Pages of these origins.
    These(Vec<HeaderValue>),
}

/// The routes, with their documentation and with what each needs.
struct Routes {
    router: OpenApiRouter<App>,
    needs: HashMap<String, Vec<(&'static str, Needs)>>,
}

/// What each route needs: by its path, and by its method.
static NEEDS: LazyLock<HashMap<String, Vec<(&'static str, Needs)>>> =
    LazyLock::new(|| Routes::all().needs);

impl Routes {
    fn all() -> Self {
        let router = OpenApiRouter::with_openapi(openapi::frame());
        Self { router, needs: HashMap::new() }
            .add(Needs::SUBMIT, routes!(jobs::submit))
            .add(Needs::READ, routes!(jobs::list))
            .add(Needs::READ, routes!(jobs::show))
            .add(Needs::STOP, routes!(jobs::delete))
            .add(Needs::READ, routes!(jobs::result))
            .add(Needs::STOP, routes!(jobs::cancel))
            .add(Needs::STOP, routes!(jobs::cancel_all))
            .add(Needs::READ, routes!(events::follow))
            .add(Needs::READ, routes!(library::list))
            .add(Needs::READ, routes!(diff::diff))
            .add(Needs::READ, routes!(results::whole))
            .add(Needs::ADMIN, routes!(library::delete))
            .add(Needs::READ, routes!(results::history))
            .add(Needs::READ, routes!(results::profiles))
            .add(Needs::READ, routes!(results::loops))
            .add(Needs::READ, routes!(results::plot))
            .add(Needs::SUBMIT, routes!(results::pin, results::unpin))
            .add(Needs::SUBMIT, routes!(links::share))
            .add(Needs::READ, routes!(library::provenance))
            .add(Needs::SUBMIT, routes!(library::note, library::delete_note))
            .add(Needs::READ, routes!(scenarios::check))
            .add(Needs::READ, routes!(scenarios::examples))
            .add(Needs::READ, routes!(scenarios::example))
            .add(Needs::READ, routes!(scenarios::schema))
            .add(Needs::READ, routes!(access::me))
            .add(Needs::NOTHING, routes!(system::health))
            .add(Needs::NOTHING, routes!(system::ready))
            .add(Needs::READ, routes!(metrics::metrics))
            .add(Needs::READ, routes!(system::version))
            .add(Needs::READ, routes!(system::openapi))
            .add(Needs::READ, routes!(system::problems))
            .add(Needs::READ, routes!(system::explain))
            // The dashboard holds no data; what it asks for needs a role.
            .page(Needs::NOTHING, "/", get(dashboard::page))
            .page(Needs::NOTHING, "/assets/{*name}", get(dashboard::asset))
            .page(Needs::READ, "/docs", get(|| async { Redirect::to("/docs/") }))
            .page(Needs::READ, "/docs/", get(|| system::docs(Segment(String::new()))))
            .page(Needs::READ, "/docs/{*path}", get(system::docs))
    }

    /// Adds documented routes.
    fn add(mut self, needs: Needs, routes: UtoipaMethodRouter<App>) -> Self {
        for (path, item) in &routes.1.paths {
            let methods = [
                ("GET", &item.get),
                ("POST", &item.post),
                ("PUT", &item.put),
                ("DELETE", &item.delete),
            ];
            let declared = self.needs.entry(path.clone()).or_default();
            let here = methods.into_iter().filter(|(_, operation)| operation.is_some());
            declared.extend(here.map(|(method, _)| (method, needs)));
        }
        Self { router: self.router.routes(routes), ..self }
    }

    /// Adds a page for browsers, which is not part of the documented interface.
    fn page(mut self, needs: Needs, path: &str, page: MethodRouter<App>) -> Self {
        self.needs.entry(path.to_owned()).or_default().push(("GET", needs));
        Self { router: self.router.route(path, page), ..self }
    }
}

/// The whole interface to a service.
pub fn router(service: Service, settings: &Settings) -> Router {
    let store = service.store().clone();
    let gate = Arc::new(Gate::new(&store, &settings.access));
    let metrics = Arc::new(Metrics::new(&store, service.workers()));
    let app = App(Arc::new(Shared {
        store,
        service,
        gate: Arc::clone(&gate),
        pulse: Pulse::default(),
        memory: Memory::new(settings.memory),
        metrics: Arc::clone(&metrics),
    }));
    let (router, _) = Routes::all().router.split_for_parts();
    with_layers(router.fallback(nowhere), gate, metrics, &settings.origins).with_state(app)
}

/// Puts around the routes what all answers share. It is one layer: each is cloned with each request.
fn with_layers<S: Clone + Send + Sync + 'static>(
    routes: Router<S>,
    gate: Arc<Gate>,
    metrics: Arc<Metrics>,
    origins: &Origins,
) -> Router<S> {
    routes.layer((
        from_fn_with_state((metrics, Arc::new(origins.clone())), edge),
        // Problems are readable by web pages too, so this is outside of what makes them.
        option_layer(cors(origins)),
        CatchPanicLayer::custom(panicked),
        CompressionLayer::new().compress_when(coding::CompressedWhileSent),
        from_fn_with_state(gate, access::pass),
    ))
}

/// Where every request comes in and every answer goes out: gives it an id, writes its problem if
/// it has one, counts it and logs one line.
async fn edge(
    State((metrics, origins)): State<(Arc<Metrics>, Arc<Origins>)>,
    mut request: Request,
    next: Next,
) -> Response {
    let started = Instant::now();
    let trace = Trace::read(request.headers());
    let id = Arc::clone(&trace.id);
    let route = request.extensions().get::<MatchedPath>().cloned();
    let (method, uri) = (request.method().clone(), request.uri().clone());
    let span = tracing::info_span!("request", id = &*id, traceparent = trace.parent.as_deref());
    request.extensions_mut().insert(trace);
    Coding::settle(request.headers_mut());
    let closes_after_error = drain_body(&mut request);
    let answer = if is_strange(&origins, &request) {
        drop(request);
        let detail = "The page's origin is not among those that this server knows (--cors-origin).";
        Problem::new(&problem::CROSS_SITE, detail).into_response()
    } else {
        next.run(request).instrument(span.clone()).await
    };
    let mut response = problem::write(answer, &id);
    let route = route.as_ref().map_or("none", MatchedPath::as_str);
    metrics.answered(&method, route, response.status(), started);
    let caller = response.extensions().get::<Identity>();
    let caller = caller.map(|identity| format!("{} {}", identity.owner, identity.key));
    let status = response.status().as_u16();
    let milliseconds = (started.elapsed().as_secs_f64() * 1e6).round() / 1e3;
    let path = uri.path();
    span.in_scope(|| {
        // What only reads and finds is counted, and told to who wants to know.
        if method.is_safe() && status < 400 {
            tracing::debug!(%method, path, status, milliseconds, caller, "answered");
        } else {
            tracing::info!(%method, path, status, milliseconds, caller, "answered");
        }
    });
    let headers = response.headers_mut();
    if closes_after_error && status >= 400 {
        headers.insert(header::CONNECTION, HeaderValue::from_static("close"));
    }
    if let Ok(id) = HeaderValue::from_str(&id) {
        headers.insert(REQUEST_ID, id);
    }
    for (name, value) in SAFE {
        headers.entry(name).or_insert(HeaderValue::from_static(value));
    }
    response
}

/// What browsers are told of every answer, unless it says otherwise: it is what it is declared as,
/// runs nothing, is shown in no frame, and its address (which may hold a link) is told to nobody.
const SAFE: [(HeaderName, &str); 4] = [
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'",
    ),
];

/// Whether a page of an unknown site would change something through the browser of somebody who
/// may: a browser asks beforehand only where the request is unusual.
fn is_strange(known: &Origins, request: &Request) -> bool {
    let text = |name: HeaderName| request.headers().get(name).map(HeaderValue::as_bytes);
    let site = text(HeaderName::from_static("sec-fetch-site"));
    let origin = text(header::ORIGIN);
    let own = request.uri().authority().map(|own| own.as_str().as_bytes()).or(text(header::HOST));
    let is_known = match known {
        Origins::Own => false,
        Origins::Any => true,
        Origins::These(list) => list.iter().any(|known| Some(known.as_bytes()) == origin),
    };
    // Over plain HTTP browsers name the origin only, and not the site.
    let is_own = match (site, origin) {
        (Some(b"same-origin" | b"none"), _) | (None, None) => true,
        (_, Some(origin)) => {
            let end = origin.windows(3).position(|mark| mark == b"://").map(|at| at + 3);
            end.is_some_and(|end| Some(&origin[end..]) == own)
        }
        (Some(_), None) => false,
    };
    !request.method().is_safe() && !is_known && !is_own
}

async fn nowhere(request: Request) -> Problem {
    let detail = if request.uri().path().ends_with('/') {
        "No route has this address; addresses here do not end with a slash."
    } else {
        "No route has this address; /docs lists those there are."
    };
    Problem::new(&problem::NOT_FOUND, detail)
}

/// Answers for a handler that panicked. The panic itself has been logged by the panic hook.
fn panicked(_: Box<dyn Any + Send>) -> Response {
    Problem::internal().into_response()
}

fn cors(origins: &Origins) -> Option<CorsLayer> {
    let exposed = [
        header::LOCATION,
        header::CONTENT_LOCATION,
        header::CONTENT_DISPOSITION,
        header::LINK,
        header::CACHE_STATUS,
        header::ETAG,
        header::RETRY_AFTER,
        header::WWW_AUTHENTICATE,
        header::CONTENT_DISPOSITION,
        HeaderName::from_static("preference-applied"),
        HeaderName::from_static("ratelimit"),
        HeaderName::from_static("ratelimit-policy"),
        REQUEST_ID,
    ];
    let layer = CorsLayer::new()
        .allow_methods([Method::GET, Method::HEAD, Method::POST, Method::PUT, Method::DELETE])
        // A star would not cover Authorization.
        .allow_headers(AllowHeaders::mirror_request())
        .expose_headers(exposed);
    match origins {
        Origins::Own => None,
        Origins::Any => Some(layer.allow_origin(AnyOrigin)),
        Origins::These(list) => Some(layer.allow_origin(list.clone())),
    }
}

#[cfg(test)]
mod tests {
    use axum::body::Body;
    use http_body_util::BodyExt as _;
    use tower::ServiceExt as _;

    use super::*;

    #[tokio::test]
    async fn a_panic_is_a_problem_that_tells_nothing_of_its_cause() {
        async fn panics() {
            panic!("a secret");
        }
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path(), &crate::store::Options::default()).await.unwrap();
        let metrics = Arc::new(Metrics::new(&store, 1));
        let gate = Arc::new(Gate::new(&store, &Access { open: true, ..Access::default() }));
        let router = Router::new().route("/", get(panics));
        let router = with_layers(router, gate, metrics, &Origins::Any);
        let response = router.oneshot(Request::new(Body::empty())).await.unwrap();
        assert_eq!(response.status(), 500);
        assert_eq!(response.headers()["content-type"], "application/problem+json");
        assert_eq!(response.headers()["access-control-allow-origin"], "*");
        let id = response.headers()[REQUEST_ID].to_str().unwrap().to_owned();
        let body = response.into_body().collect().await.unwrap().to_bytes();
        let problem: serde_json::Value = serde_json::from_slice(&body).unwrap();
        assert_eq!(problem["instance"], id);
        assert!(!problem.to_string().contains("secret"));
    }
}
