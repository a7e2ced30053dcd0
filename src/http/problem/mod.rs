//! All errors of the API: problem documents (RFC 9457) and their types.
//!
//! A handler returns a [`Problem`], which becomes an extension of the response. `layers` writes the document, because
//! the request id is known there. It also writes the documents of the 404 and 405 answers of axum, and of panics.

pub mod refusals;

pub mod kinds;
mod page;

use std::error::Error;
use std::iter;

use axum::http::header::{CACHE_CONTROL, CONTENT_LENGTH, CONTENT_TYPE};
use axum::http::{HeaderName, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use tokio::task::spawn_blocking;
use utoipa::ToSchema;

use fretwork_engine::{Fault, Faults};
use fretwork_job::{Canonical, Key};
use fretwork_store as store;

use kinds::Kind;
pub use page::{index, page};

/// One fault of a request.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Complaint {
    /// The place in the body: a JSON pointer (RFC 6901).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(example = "/scenario/bodies/0/poisson_ratio")]
    pub pointer: Option<String>,
    /// The name of the query parameter or header.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(example = "wait")]
    pub parameter: Option<String>,
    /// What is wrong, and what is accepted.
    #[schema(example = "must be between -1 and 0.5, got 0.7")]
    pub detail: String,
}

impl Complaint {
    /// A fault of a query parameter or a header.
    pub fn parameter(name: &str, detail: impl Into<String>) -> Self {
        Self { pointer: None, parameter: Some(name.to_owned()), detail: detail.into() }
    }

    /// The place and the fault.
    fn in_words(&self) -> String {
        let place = self.pointer.as_deref().or(self.parameter.as_deref()).unwrap_or_default();
        format!("{place} {}.", self.detail.trim_end_matches('.')).trim_start().to_owned()
    }
}

impl From<Fault> for Complaint {
    fn from(fault: Fault) -> Self {
        Self { pointer: Some(fault.pointer), parameter: None, detail: fault.detail }
    }
}

/// An error, as the answer to a request.
#[derive(Debug, Clone)]
pub struct Problem {
    kind: &'static Kind,
    detail: String,
    errors: Vec<Complaint>,
    /// The canonical scenario or study of an evicted result. Boxed, because few problems have it.
    asked: Option<Box<Canonical>>,
    headers: Vec<(HeaderName, String)>,
    /// The error that caused the problem, for the log.
    cause: Option<String>,
}

/// The result of a handler, and of everything that a handler calls.
pub type Result<T, E = Problem> = std::result::Result<T, E>;

/// Does work that would block the async thread on another thread.
///
/// # Errors
/// The work panics, which is a bug.
pub async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T> {
    // Boxed closures with the same result have one type, so `spawn_blocking` is compiled once for each result.
    let work: Box<dyn FnOnce() -> T + Send> = Box::new(work);
    spawn_blocking(work).await.map_err(Problem::bug)
}

/// Every error, as the server writes it (RFC 9457).
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Problem)]
pub struct ProblemDocument<'a> {
    /// The problem type: the address of a page that explains it.
    #[schema(example = "/problems/invalid-request")]
    r#type: String,
    /// The title of the problem type.
    #[schema(example = "The request has faults")]
    title: &'a str,
    /// The HTTP status.
    #[schema(example = 422, minimum = 400, maximum = 599)]
    status: u16,
    /// What is wrong with this request, and what to change.
    #[schema(example = "The body has a fault: /scenario/friction must be greater than 0, not -1.")]
    detail: &'a str,
    /// The request id, as in the `x-request-id` header and in the log of the server.
    #[schema(example = "019aa0f3-1f4e-7cc0-9d8b-1c5b0c1f9a11")]
    instance: &'a str,
    /// All faults of the request.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    #[schema(required = false)]
    errors: &'a [Complaint],
    /// What an evicted result was computed from.
    #[serde(flatten)]
    #[schema(ignore)]
    asked: Option<&'a Canonical>,
}

impl Problem {
    /// A problem of this type. `detail` says what to change in the request.
    pub fn new(kind: &'static Kind, detail: impl Into<String>) -> Self {
        Self {
            kind,
            detail: detail.into(),
            errors: Vec::new(),
            asked: None,
            headers: Vec::new(),
            cause: None,
        }
    }

    /// The problem for a body with faults.
    pub fn faults(faults: Vec<Fault>) -> Self {
        let errors = faults.into_iter().map(Complaint::from).collect();
        Self::complaints(&kinds::INVALID_REQUEST, "body", errors)
    }

    /// The problem for query parameters with faults.
    pub fn parameters(errors: Vec<Complaint>) -> Self {
        Self::complaints(&kinds::INVALID_PARAMETERS, "query", errors)
    }

    /// The problem for a header with a fault.
    pub fn header(error: Complaint) -> Self {
        Self::complaints(&kinds::INVALID_PARAMETERS, "header of the request", vec![error])
    }

    fn complaints(kind: &'static Kind, part: &str, errors: Vec<Complaint>) -> Self {
        let first = errors.first().map_or_else(String::new, Complaint::in_words);
        let detail = match errors.len() {
            0 | 1 => format!("The {part} has a fault: {first}"),
            count => {
                format!("The {part} has {count} faults, which `errors` lists. The first: {first}")
            }
        };
        Self { errors, ..Self::new(kind, detail) }
    }

    /// The problem for a bug of the server. Its cause is in the log, not in the answer.
    pub fn internal() -> Self {
        let detail = "The server has a bug. Its log contains the details: search it for the `instance` of this problem.";
        Self::new(&kinds::INTERNAL, detail)
    }

    /// The problem for an error that only a bug of the server can cause.
    pub fn bug(error: impl Error + 'static) -> Self {
        Self::internal().caused_by(&error)
    }

    /// The problem for a result that cannot be read.
    pub fn damaged_result(key: &Key) -> Self {
        let detail = format!(
            "The stored result {key} is damaged. Submit its scenario to POST /v1/jobs with `Cache-Control: no-cache`: \
             this repairs it. If the answer says `\"recomputed\":\"differs\"`, an administrator must delete the result \
             first: DELETE /v1/results/{key}."
        );
        Self::new(&kinds::DAMAGED, detail)
    }

    /// The problem for a pin or a note of another owner.
    pub fn other_owner(what: &str, owner: Option<String>) -> Self {
        let owner =
            owner.map_or_else(|| "an unknown owner".to_owned(), |owner| format!("{owner:?}"));
        let detail = format!(
            "The {what} belongs to {owner}. Ask the owner or an administrator to change it."
        );
        Self::new(&kinds::OTHER_OWNER, detail)
    }

    /// Adds the error that caused the problem, for the log.
    pub fn caused_by(self, error: &(dyn Error + 'static)) -> Self {
        let causes = iter::successors(Some(error), |&error| error.source());
        let causes: Vec<_> = causes.map(ToString::to_string).collect();
        Self { cause: Some(causes.join(": ")), ..self }
    }

    /// The error that caused the problem. It is for the log, not for the client.
    pub fn cause(&self) -> Option<&str> {
        self.cause.as_deref()
    }

    /// The type of the problem, and its detail with all faults as one text, for UM-Bridge.
    pub fn in_words(&self) -> (&'static str, String) {
        let Self { kind, detail, errors, .. } = self;
        // The detail contains the first fault.
        let others = errors.iter().skip(1).map(|error| format!(" {}", error.in_words()));
        (kind.slug, iter::once(detail.clone()).chain(others).collect())
    }

    /// Adds the canonical scenario or study of an evicted result.
    pub fn with_asked(self, asked: Option<Canonical>) -> Self {
        Self { asked: asked.map(Box::new), ..self }
    }

    /// Adds a header to the answer.
    pub fn with_header(mut self, name: HeaderName, value: impl Into<String>) -> Self {
        self.headers.push((name, value.into()));
        self
    }

    /// Adds `Retry-After`.
    pub fn retry_after(self, seconds: u32) -> Self {
        self.with_header(axum::http::header::RETRY_AFTER, seconds.to_string())
    }
}

impl From<Faults> for Problem {
    fn from(faults: Faults) -> Self {
        Self::faults(faults.0)
    }
}

impl From<store::Error> for Problem {
    fn from(error: store::Error) -> Self {
        let of = |kind, detail: &str| Self::new(kind, detail).caused_by(&error);
        match &error {
            // A shutdown is no failure, so the log shows no cause.
            store::Error::Closed => {
                let detail = "The server is shutting down. Try again in a moment.";
                Self::new(&kinds::DRAINING, detail).retry_after(5)
            }
            store::Error::Busy(..) => {
                let detail = "The database of the server is busy. Try again in a moment.";
                of(&kinds::BUSY, detail).retry_after(1)
            }
            store::Error::Unreachable(..) | store::Error::Exhausted => {
                let detail = "The database of the server cannot be reached. Try again in a moment.";
                of(&kinds::BUSY, detail).retry_after(2)
            }
            store::Error::Full(..) => {
                let detail = "The disk of the server is full. Its operator must free space.";
                of(&kinds::DISK_FULL, detail)
            }
            store::Error::Disk(..)
            | store::Error::Moved { .. }
            | store::Error::Newer { .. }
            | store::Error::Unfit(..) => {
                let detail =
                    "The server cannot use its database. Its operator finds the reason in the log.";
                of(&kinds::NOT_READY, detail).retry_after(30)
            }
            store::Error::DamagedResult(key) => Self::damaged_result(key).caused_by(&error),
            store::Error::Damaged(..) => {
                let detail = "A part of the server's database is damaged. Its operator must repair \
                    it. The log contains the details: search it for the `instance` of this problem.";
                of(&kinds::DAMAGED, detail)
            }
            _ => Self::internal().caused_by(&error),
        }
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let mut response = self.kind.status.into_response();
        for (name, value) in &self.headers {
            if let Ok(value) = HeaderValue::from_str(value) {
                response.headers_mut().append(name, value);
            }
        }
        response.extensions_mut().insert(self);
        response
    }
}

/// Writes the problem of a response as its body. If a library made an error response, the response contains no
/// problem, and the body describes the general problem of its status.
pub(super) fn write(mut response: Response, instance: &str) -> Response {
    let status = response.status();
    let Some(problem) = taken(&mut response) else { return response };
    let document = ProblemDocument {
        r#type: format!("/problems/{}", problem.kind.slug),
        title: problem.kind.texts()[0],
        status: status.as_u16(),
        detail: &problem.detail,
        instance,
        errors: &problem.errors,
        asked: problem.asked.as_deref(),
    };
    with_error(response, "application/problem+json", &document)
}

/// Takes the problem out of a response. An error response without one gets the general problem of its status.
pub(super) fn taken(response: &mut Response) -> Option<Problem> {
    let status = response.status();
    let problem = response.extensions_mut().remove::<Problem>();
    let is_error = status.is_client_error() || status.is_server_error();
    problem.or_else(|| is_error.then(|| of_status(status)))
}

/// The response with an error document as its body.
pub(super) fn with_error(
    mut response: Response,
    media_type: &'static str,
    document: &impl Serialize,
) -> Response {
    let headers = response.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(media_type));
    // The same request may succeed later. Caches keep some statuses unless this forbids it.
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.remove(CONTENT_LENGTH);
    #[expect(clippy::expect_used, reason = "strings and numbers are valid JSON")]
    let text = serde_json::to_vec(document).expect("an error document");
    *response.body_mut() = text.into();
    response
}

fn of_status(status: StatusCode) -> Problem {
    match status {
        StatusCode::METHOD_NOT_ALLOWED => Problem::new(
            &kinds::METHOD_NOT_ALLOWED,
            "This address does not accept the method of the request. The Allow header lists the accepted methods.",
        ),
        _ => kinds::ALL.iter().find(|kind| kind.status == status).map_or_else(
            Problem::internal,
            |kind| {
                let [_, meaning, remedy] = kind.texts();
                Problem::new(kind, format!("{meaning} {remedy}"))
            },
        ),
    }
}
