//! The HTTP interface: what the service is told and what it answers.
//!
//! One file per noun. A handler translates the request, makes one call to the left, and translates
//! the answer. What all answers share (request id, log line, problems, CORS) happens once, in
//! [`router`].

mod jobs;
mod openapi;
mod problem;
mod results;
mod scenarios;
mod system;
mod table;
mod wire;

use std::any::Any;
use std::time::Instant;

use axum::Router;
use axum::extract::Request;
use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::middleware::{Next, from_fn};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::get;
use tokio::sync::watch;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::cors::{Any as AnyOrigin, CorsLayer};
use tracing::Instrument as _;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

pub use openapi::document;
pub use scenarios::{EXAMPLES, Example, Unsound, parse_job};
pub use table::{Document, Error as TableError};

use crate::store::Store;
use problem::Problem;
use wire::Segment;

const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// What every handler can reach.
#[derive(Clone)]
pub struct App {
    /// What is kept.
    pub store: Store,
    /// Turns true when the server stops taking new jobs.
    pub draining: watch::Receiver<bool>,
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

/// The documented routes, with their documentation.
fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::with_openapi(openapi::frame())
        .routes(routes!(jobs::submit, jobs::list))
        .routes(routes!(jobs::show))
        .routes(routes!(jobs::result))
        .routes(routes!(jobs::cancel))
        .routes(routes!(results::whole))
        .routes(routes!(results::history))
        .routes(routes!(results::profiles))
        .routes(routes!(results::loops))
        .routes(routes!(scenarios::check))
        .routes(routes!(scenarios::examples))
        .routes(routes!(scenarios::example))
        .routes(routes!(scenarios::schema))
        .routes(routes!(system::health))
        .routes(routes!(system::version))
        .routes(routes!(system::openapi))
        .routes(routes!(system::problems))
        .routes(routes!(system::explain))
}

/// The whole interface as one service.
pub fn router(app: App, origins: &Origins) -> Router {
    let (documented, _) = routes().split_for_parts();
    let router = documented
        .route("/", get(system::root))
        .route("/docs", get(|| async { Redirect::to("/docs/") }))
        .route("/docs/", get(|| system::docs(Segment(String::new()))))
        .route("/docs/{*path}", get(system::docs))
        .fallback(nowhere);
    dressed(router, origins).with_state(app)
}

/// Puts around the routes what all answers share.
fn dressed<S: Clone + Send + Sync + 'static>(routes: Router<S>, origins: &Origins) -> Router<S> {
    let mut router = routes.layer(CatchPanicLayer::custom(panicked));
    if let Some(cors) = cors(origins) {
        // Problems are readable by web pages too, so this is outside of what makes them.
        router = router.layer(cors);
    }
    router.layer(from_fn(edge))
}

/// Where every request comes in and every answer goes out: gives it an id, writes its problem if
/// it has one, and logs one line.
async fn edge(request: Request, next: Next) -> Response {
    let started = Instant::now();
    let id = request
        .headers()
        .get(REQUEST_ID)
        .and_then(|value| value.to_str().ok())
        .filter(|id| is_sane(id))
        .map_or_else(|| uuid::Uuid::now_v7().to_string(), str::to_owned);
    let (method, path) = (request.method().clone(), request.uri().path().to_owned());
    let span = tracing::info_span!("request", id);
    let mut response = problem::write(next.run(request).instrument(span).await, &id);
    let status = response.status().as_u16();
    let milliseconds = (started.elapsed().as_secs_f64() * 1e6).round() / 1e3;
    tracing::info!(%method, path, status, milliseconds, id, "answered");
    if let Ok(id) = HeaderValue::from_str(&id) {
        response.headers_mut().insert(REQUEST_ID, id);
    }
    response
}

/// An id from outside goes into the log and into answers, so it must be short and plain.
fn is_sane(id: &str) -> bool {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.:/+=".contains(&byte);
    (1..=128).contains(&id.len()) && id.bytes().all(plain)
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
        header::LINK,
        header::CACHE_STATUS,
        header::ETAG,
        header::RETRY_AFTER,
        HeaderName::from_static("preference-applied"),
        REQUEST_ID,
    ];
    let layer = CorsLayer::new()
        .allow_methods([Method::GET, Method::HEAD, Method::POST])
        .allow_headers(AnyOrigin)
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
        let router = dressed(Router::new().route("/", get(panics)), &Origins::Any);
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
