//! The layer around all routes: request ids, log, problems, access control, compression, other origins.

use std::convert::Infallible;
use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::Router;
use axum::extract::{MatchedPath, Request};
use axum::http::{HeaderName, HeaderValue, Method, Version, header};
use axum::response::{IntoResponse, Response};
use axum::routing::Route;
use futures_util::FutureExt as _;
use tower::layer::layer_fn;
use tower::{Layer as _, Service, ServiceExt as _, service_fn};
use tower_http::cors::{AllowHeaders, Any as AnyOrigin, CorsLayer};

use super::access::caller::{Peer, REQUEST_ID, Trace, owner_of};
use super::access::session::is_own_origin;
use super::access::{self, Gate, Identity};
use super::api::evaluate;
use super::api::umbridge;
use super::app::App;
use super::problem::refusals::Refusals;
use super::problem::{self, Problem, Result, kinds};
use super::shares::{Permit, SMALL, Shares};
use super::transport::drain_body::drain_body;
use super::wire::coding::Coding;
use super::wire::negotiation::choose;
use super::wire::{REPLAYED, length_of};
use crate::service::workers::message_of;

/// The origins whose web pages may use the server.
#[derive(Debug, Clone, Default)]
pub enum Origins {
    /// Only the server's own origin.
    #[default]
    Own,
    /// All origins.
    Any,
    /// These origins, and the server's own.
    These(Vec<HeaderValue>),
}

/// Puts one layer around the routes. It is a single layer, because axum clones each layer for each request.
pub fn with_layers<S: Clone + Send + Sync + 'static>(
    routes: Router<S>,
    app: App,
    origins: Origins,
) -> Router<S> {
    let (cors, refusals) = (cors(&origins), Refusals::default());
    let shared = Arc::new(Shared { app, refusals, origins, cors });
    routes.layer(layer_fn(move |route: Route| {
        let shared = Arc::clone(&shared);
        service_fn(move |request| {
            surround(Arc::clone(&shared), request, route.clone()).map(Ok::<_, Infallible>)
        })
    }))
}

/// What the layer uses for every request.
struct Shared {
    app: App,
    refusals: Refusals,
    origins: Origins,
    /// Lets web pages of the other origins read the answers, and answers their preflights.
    cors: Option<CorsLayer>,
}

/// Handles a request: gives it an id, refuses it if a foreign web page sent it, writes the problem of its answer,
/// counts it and logs one line. Of many refusals, it logs only some.
async fn surround(shared: Arc<Shared>, mut request: Request, route: Route) -> Response {
    let Shared { app, refusals, origins, cors } = &*shared;
    let started = Instant::now();
    let trace = Trace::read(request.headers());
    let Trace { id, parent } = trace.clone();
    let pattern = request.extensions().get::<MatchedPath>().cloned();
    let (method, uri) = (request.method().clone(), request.uri().clone());
    request.extensions_mut().insert(trace);
    request.extensions_mut().insert(Arc::clone(&app.shares));
    let peer = request.extensions().get::<Peer>().cloned();
    let closes_after_error = drain_body(&mut request);
    let answer = if peer.is_some() && !has_one_host(&request) {
        Problem::new(&kinds::BAD_HOST, "Send exactly one Host header.").into_response()
    } else if is_cross_site(origins, &request) {
        drop(request);
        let detail = "A web page of an unknown origin sent this request. Add its origin to the option \
            --cors-origin of the server.";
        Problem::new(&kinds::CROSS_SITE, detail).into_response()
    } else {
        match cors {
            None => answer(&app.gate, request, route).await,
            Some(cors) => {
                let inner =
                    |request| answer(&app.gate, request, route.clone()).map(Ok::<_, Infallible>);
                let Ok(answer) = cors.layer(service_fn(inner)).oneshot(request).await;
                answer
            }
        }
    };
    let error = answer.extensions().get::<Problem>().and_then(Problem::cause).map(str::to_owned);
    let pattern = pattern.as_ref().map_or("none", MatchedPath::as_str);
    let is_umbridge = umbridge::has_route(pattern);
    let written = |answer| {
        if is_umbridge { umbridge::write(answer) } else { problem::write(answer, &id) }
    };
    let mut response = match counted(&app.shares, written(answer), &method, peer) {
        Ok(response) => response,
        Err(problem) => written(problem.into_response()),
    };
    app.metrics.answered(&method, pattern, response.status(), started);
    let status = response.status().as_u16();
    let milliseconds = (started.elapsed().as_secs_f64() * 1e6).round() / 1e3;
    macro_rules! log {
        ($level:ident) => {
            tracing::$level!(request = &*id, traceparent = parent.as_deref(), %method, path = uri.path(),
                status, milliseconds,
                caller = response.extensions().get::<Identity>().map(ToString::to_string), error, "answered")
        };
    }
    match (&error, status) {
        (_, 400..) if !refusals.are_shown(status) => {}
        (Some(_), 503) => log!(warn),
        (Some(_), _) => log!(error),
        // In UM-Bridge, an output without a value is an error of the model.
        (None, 500) if !is_umbridge => log!(error),
        // Successful reads and evaluations are too frequent for the default log.
        (None, ..400) if method.is_safe() || is_umbridge || pattern == evaluate::PATH => {
            log!(debug);
        }
        _ => log!(info),
    }
    let headers = response.headers_mut();
    if closes_after_error && status >= 400 {
        headers.insert(header::CONNECTION, HeaderValue::from_static("close"));
    }
    if let Ok(id) = HeaderValue::from_str(&id) {
        headers.insert(REQUEST_ID, id);
    }
    for (name, value) in BROWSER_RULES {
        headers.entry(name).or_insert(HeaderValue::from_static(value));
    }
    response
}

/// Adds a permit for the memory of the body to an answer. If the memory is in use, refuses the request instead, unless
/// the request may have changed something.
fn counted(
    shares: &Shares,
    mut answer: Response,
    method: &Method,
    peer: Option<Peer>,
) -> Result<Response> {
    let size = length_of(&answer).map_or(0, |size| usize::try_from(size).unwrap_or(usize::MAX));
    if size <= SMALL || answer.extensions().get::<Arc<Permit>>().is_some() {
        return Ok(answer);
    }
    if let Some(peer) = peer {
        answer.extensions_mut().insert(peer);
    }
    match shares.answers(size).try_hold(&owner_of(answer.extensions()), size) {
        Ok(permit) => _ = answer.extensions_mut().insert(Arc::new(permit)),
        Err(problem) if method.is_safe() => return Err(problem),
        Err(_) => {}
    }
    Ok(answer)
}

/// Whether a request of HTTP/1.1 has exactly one `Host`.
fn has_one_host(request: &Request) -> bool {
    let hosts = request.headers().get_all(header::HOST).iter().count();
    match request.version() {
        Version::HTTP_11 => hosts == 1,
        _ => hosts <= 1,
    }
}

/// A handler panicked, with this message. The panic hook has logged where.
#[derive(Debug, thiserror::Error)]
#[error("panicked: {0}")]
struct Panicked(String);

/// The answer of the routes, compressed if the client accepts that.
async fn answer(gate: &Gate, request: Request, mut route: Route) -> Response {
    let coding = Coding::choose(request.headers());
    let refuses_json = refuses_json(&request);
    let compressed = move |request: Request| async move {
        let Ok(mut answer) = route.call(request).await;
        if refuses_json && answer.headers().get(header::CONTENT_TYPE).is_some_and(|it| it == JSON) {
            let detail = "The header Accept excludes application/json, which this address offers.";
            answer = Problem::new(&kinds::NOT_ACCEPTABLE, detail).into_response();
        }
        coding.compress(answer).await
    };
    let checked = AssertUnwindSafe(access::check(gate, request, compressed)).catch_unwind().await;
    checked.unwrap_or_else(|panic| Problem::bug(Panicked(message_of(&*panic))).into_response())
}

const JSON: &str = "application/json";

/// Whether a request only reads, and its header `Accept` excludes JSON. A parameter `format` overrides the header.
fn refuses_json(request: &Request) -> bool {
    let uri = request.uri();
    request.method().is_safe()
        && uri.path().starts_with("/v1/")
        && !uri.query().is_some_and(|query| query.contains("format="))
        && choose(request.headers(), &[JSON], |it| it).is_none()
}

/// Rules for browsers, unless a handler sets others: do not guess the content type, run no scripts, show no
/// answer in a frame, and do not send the address, which can contain a link, to other sites.
const BROWSER_RULES: [(HeaderName, &str); 4] = [
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'",
    ),
];

/// Whether a web page of an unknown origin sent a request that can change something. Browsers send some such
/// requests, with the rights of their user, before they check whether the page may read the answer.
fn is_cross_site(known: &Origins, request: &Request) -> bool {
    let text = |name: HeaderName| request.headers().get(name).map(HeaderValue::as_bytes);
    let site = text(HeaderName::from_static("sec-fetch-site"));
    let origin = text(header::ORIGIN);
    let is_known = match known {
        Origins::Own => false,
        Origins::Any => true,
        Origins::These(list) => list.iter().any(|known| Some(known.as_bytes()) == origin),
    };
    // Over plain HTTP, browsers send `Origin`, but not `Sec-Fetch-Site`.
    let is_own = match (site, is_own_origin(request)) {
        (Some(b"same-origin" | b"none"), _) | (None, None) => true,
        (_, is_own) => is_own == Some(true),
    };
    !request.method().is_safe() && !is_known && !is_own
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
        HeaderName::from_static("preference-applied"),
        REPLAYED,
        HeaderName::from_static("ratelimit"),
        HeaderName::from_static("ratelimit-policy"),
        REQUEST_ID,
    ];
    let layer = CorsLayer::new()
        .allow_methods([
            Method::GET,
            Method::HEAD,
            Method::POST,
            Method::PUT,
            Method::PATCH,
            Method::DELETE,
        ])
        // No browser keeps the answer to a preflight request for longer.
        .max_age(Duration::from_hours(2))
        // `*` does not include Authorization.
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
    use std::num::NonZeroU32;

    use axum::body::Body;
    use axum::routing::{MethodRouter, get};
    use http_body_util::BodyExt as _;
    use tempfile::TempDir;
    use tower::ServiceExt as _;

    use super::*;
    use crate::http::access::Access;
    use crate::http::access::limits::Limits;
    use crate::http::access::needs::RouteNeeds;
    use crate::http::access::secret::Secret;
    use crate::http::transport::admission::{Admission, Connections};
    use crate::service::{Service, WorkLimits};
    use fretwork_job::Task;
    use fretwork_store::Store;

    /// A server with one route, and the directory of its database.
    async fn surrounded(route: MethodRouter, access: &Access) -> (Router, TempDir) {
        let dir = TempDir::new().unwrap();
        let store =
            Store::open(dir.path().into(), &fretwork_store::Options::default()).await.unwrap();
        let gate = Gate::new(&store, access, RouteNeeds::default());
        let service = Service::new(store, Arc::new(Task::start), 1, WorkLimits::default());
        let admission = Admission::new(Connections::default());
        let app = App::new(service, gate, &admission, (1 << 20, 1 << 20));
        (with_layers(Router::new().route("/", route), app, Origins::Any), dir)
    }

    #[tokio::test]
    async fn the_log_shows_the_message_of_a_panic_and_the_answer_hides_it() {
        async fn panics() {
            panic!("a secret");
        }
        let access = Access { open: true, ..Access::default() };
        let (router, dir) = surrounded(get(panics), &access).await;
        let log = dir.path().join("log");
        let file = std::fs::File::create(&log).unwrap();
        let lines = tracing_subscriber::fmt().with_writer(file).with_ansi(false).finish();
        let logging = tracing::subscriber::set_default(lines);
        let response = router.oneshot(Request::new(Body::empty())).await.unwrap();
        drop(logging);
        assert_eq!(response.status(), 500);
        assert_eq!(response.headers()["content-type"], "application/problem+json");
        assert_eq!(response.headers()["access-control-allow-origin"], "*");
        let id = response.headers()[REQUEST_ID].to_str().unwrap().to_owned();
        let body = response.into_body().collect().await.unwrap().to_bytes();
        let problem: serde_json::Value = serde_json::from_slice(&body).unwrap();
        assert_eq!(problem["instance"], id);
        assert!(!problem.to_string().contains("secret"));
        // One line of the log has the id and the cause.
        let log = std::fs::read_to_string(log).unwrap();
        let line = log.lines().find(|line| line.contains(&id)).expect("a line with the id");
        assert!(line.contains("ERROR") && line.contains("panicked: a secret"), "{log}");
    }

    #[tokio::test]
    async fn a_compressed_answer_counts_as_concurrent_until_it_was_sent() {
        let limits = Limits { at_once: NonZeroU32::new(1), ..Limits::default() };
        let access =
            Access { admin_key: Some(Secret("secret".into())), limits, ..Access::default() };
        let (router, _dir) = surrounded(get(|| async { "text ".repeat(1000) }), &access).await;
        let ask = async || {
            let request = Request::get("/")
                .header("authorization", "Bearer secret")
                .header("accept-encoding", "gzip");
            router.clone().oneshot(request.body(Body::empty()).unwrap()).await.unwrap()
        };
        let unread = ask().await;
        assert_eq!(unread.headers()["content-encoding"], "gzip");
        assert_eq!(ask().await.status(), 429);
        drop(unread);
        assert_eq!(ask().await.status(), 200);
    }
}
