//! Everything that can go wrong on the way from a request to its answer, in one table (RFC 9457).
//!
//! A handler returns a [`Problem`]; it travels to the edge of the router as a response extension
//! and is written there, where the request id is known. So the router's own 404 and a panic take
//! the same way out as a misspelt parameter.

use std::fmt::Write as _;

use axum::http::header::{CACHE_CONTROL, CONTENT_LENGTH, CONTENT_TYPE};
use axum::http::{HeaderName, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use crate::store;
use fretwork_engine::request::fault::{Fault, Faults};

/// One row of the table: what a kind of problem is called, means and asks for.
#[derive(Debug)]
pub struct Kind {
    /// The last part of the problem's `type`, and of the address of its page.
    pub slug: &'static str,
    /// The status it is answered with.
    pub status: StatusCode,
    /// What it is called; the same in every answer of this kind.
    pub title: &'static str,
    /// What it means, for the page.
    pub meaning: &'static str,
    /// What to do about it, for the page.
    pub remedy: &'static str,
}

macro_rules! kinds {
    ($($name:ident = $status:ident $slug:literal $title:literal $meaning:literal $remedy:literal;)*) => {
        $(
            #[doc = $title]
            pub static $name: Kind = Kind {
                slug: $slug,
                status: StatusCode::$status,
                title: $title,
                meaning: $meaning,
                remedy: $remedy,
            };
        )*
        /// Every kind of problem, by status.
        pub static ALL: &[&Kind] = &[$(&$name),*];
    };
}

kinds! {
    INVALID_JSON = BAD_REQUEST "invalid-json" "The body is not JSON"
        "The body of the request does not parse. The detail names the line and the column."
        "Send one JSON document in UTF-8. NaN, Infinity, comments and trailing commas are not JSON.";
    NOT_FOUND = NOT_FOUND "not-found" "There is nothing here"
        "No route, job or document has this address."
        "Compare the address with the list of routes under /docs. Jobs are listed by GET /v1/jobs.";
    UNAUTHORIZED = UNAUTHORIZED "unauthorized" "A key is needed"
        "This server tells its callers apart by keys, and the request has none, or one that is not \
         good (any more)."
        "Send your key as `Authorization: Bearer fretwork_…` (curl: `-H \"Authorization: Bearer \
         $FRETWORK_KEY\"`), or as the password of Basic authentication. Whoever runs the server makes \
         one with `fretwork keys add NAME --role submit`.";
    FORBIDDEN = FORBIDDEN "forbidden" "The key is not good for this"
        "Keys have roles: `read` looks at results and checks scenarios; `submit` submits jobs too, and \
         cancels, deletes, pins and shares; `admin` may do everything, with the jobs of everyone."
        "Use a key of the role that the detail names. GET /v1/me says which role a key has.";
    BAD_LINK = FORBIDDEN "bad-link" "The link does not open this"
        "A link shows one result to somebody without a key, until it expires or the key that made it is \
         taken back. This one is not whole, not for this result, or not good any more."
        "Ask whoever sent it for a new one: POST /v1/results/{key}/links makes it.";
    CROSS_SITE = FORBIDDEN "cross-site" "Pages of other sites may not do this"
        "A browser sent the request on behalf of a page of another site, which this server does not \
         know."
        "Whoever runs the server can allow the page's origin with --cors-origin; behind a proxy that \
         changes the Host header that is the origin of the server's own pages. Programs other than \
         browsers are not concerned.";
    UNKNOWN_RESULT = NOT_FOUND "unknown-result" "No result has this key"
        "Nothing with this key has been computed here. If a run is under way, the answer's Link \
         header (rel=\"related\") points at its job."
        "Submit the scenario to POST /v1/jobs: the same scenario always has the same key. POST \
         /v1/scenarios tells the key of a scenario without running it.";
    UNKNOWN_HOST = MISDIRECTED_REQUEST "unknown-host" "The server does not go by this name"
        "A server without keys answers only to localhost and to addresses: otherwise any web page could \
         reach it through a browser on its machine, under a name of its own."
        "Ask it by http://127.0.0.1 or http://localhost. Whoever runs it can make keys (`fretwork keys \
         add`), or open it to all who reach it (--no-auth).";
    METHOD_NOT_ALLOWED = METHOD_NOT_ALLOWED "method-not-allowed" "The address has no such method"
        "The address exists, but not for this method."
        "Use one of the methods in the answer's Allow header.";
    NOT_ACCEPTABLE = NOT_ACCEPTABLE "not-acceptable" "No such format"
        "The document is not available in a format that the request accepts."
        "The detail names the formats there are. Ask for one of them by the Accept header, or by \
         ?format=, which wins over the header.";
    NOT_FINISHED = CONFLICT "not-finished" "The job is not finished"
        "The result was asked for before the job came to its end."
        "Ask again after the seconds in Retry-After, or wait on the job itself with GET \
         /v1/jobs/{id}?wait=10.";
    STILL_GOING = CONFLICT "still-going" "The job has not ended"
        "Only a job that has ended can be deleted."
        "Cancel it first with POST /v1/jobs/{id}/cancel, or wait for its end.";
    PINNED = CONFLICT "pinned" "The result is pinned"
        "Somebody wants this result to be kept; a pinned result is not deleted."
        "Take the pin off with DELETE /v1/results/{key}/pin, then delete it.";
    JOB_FAILED = CONFLICT "job-failed" "The job failed"
        "The job ended with an error, so there is no result."
        "The job's `error` says why. Failures are not cached: a new submission computes again.";
    JOB_CANCELED = CONFLICT "job-canceled" "The job was canceled"
        "The job was canceled before it ended, so there is no result."
        "Submit the scenario again if its result is wanted after all.";
    EVICTED = GONE "evicted" "The result was dropped"
        "The result was computed here, and deleted, or dropped when room was needed: nobody had read it \
         for longest. `scenario` is what it was computed from."
        "POST `{\"scenario\": …}` with the `scenario` of this answer to /v1/jobs: the result will have \
         the same key and the same numbers. PUT /v1/results/{key}/pin keeps a result for good.";
    BODY_TOO_LARGE = PAYLOAD_TOO_LARGE "body-too-large" "The body is too large"
        "The body of a request may have 4 MiB."
        "Thin out long tables (`profile`, `cycles`): 10 000 rows fit easily. Large sets of runs are \
         many small jobs.";
    UNSUPPORTED_MEDIA_TYPE = UNSUPPORTED_MEDIA_TYPE "unsupported-media-type" "The body is not declared as JSON"
        "Request bodies are JSON, and say so."
        "Send the header Content-Type: application/json. With curl: -H 'Content-Type: \
         application/json'.";
    INVALID_REQUEST = UNPROCESSABLE_ENTITY "invalid-request" "The request has faults"
        "The body is JSON, but not a job: a member has the wrong type, an unknown name, a unit of \
         the wrong dimension or a value out of range. `errors` lists every fault with a JSON pointer \
         (RFC 6901) into the body."
        "Correct every place that `errors` names. GET /v1/schema/scenario is the contract, GET \
         /v1/examples has bodies that work.";
    INVALID_PARAMETERS = UNPROCESSABLE_ENTITY "invalid-parameters" "A parameter has faults"
        "A query parameter is unknown, repeated or has a value that it cannot have, or a header has. \
         `errors` names each of them."
        "Correct the parameters that `errors` names; it also says what they accept.";
    TOO_EXPENSIVE = UNPROCESSABLE_ENTITY "too-expensive" "The run would take too long"
        "By its estimate the run would take longer than this server lets a run take."
        "Ask for fewer `points`, instants or rows of a table, or for a larger `tolerance`; POST \
         /v1/scenarios tells the `cost` of a scenario. Whoever runs the server can raise the limit \
         (--run-limit).";
    KEY_REUSED = UNPROCESSABLE_ENTITY "idempotency-key-reused" "The Idempotency-Key stands for another submission"
        "The same Idempotency-Key came with another body before. A repetition must repeat the \
         submission as it was."
        "Make a new key for a new submission, such as a random UUID.";
    RATE_LIMITED = TOO_MANY_REQUESTS "rate-limited" "Too many requests"
        "The key has sent as many requests in a minute as it may. Others are not concerned."
        "Go on after the seconds in Retry-After. Every answer to a counted request says in RateLimit how \
         many are left (r), and in how many seconds there is one more (t). Waiting for a job (`Prefer: wait=10`) or following its events takes one request \
         where polling takes many. Whoever runs the server can allow more (--rate-limit, or `fretwork \
         keys add --rate`).";
    TOO_MANY_AT_ONCE = TOO_MANY_REQUESTS "too-many-at-once" "Too many requests at the same time"
        "The key has as many requests at work as it may have at the same time. A request is at work \
         until its answer has been read to the end: waits and event streams are."
        "Read or close what is open, then go on. When a request ends is not known, so there is no \
         Retry-After: try again less and less often. Whoever runs the server can allow more (--concurrency).";
    INTERNAL = INTERNAL_SERVER_ERROR "internal" "The server made a mistake"
        "Something happened that should not. It has been logged with the request id in `instance`."
        "Nothing in the request is known to be wrong: try once more, then report it with the \
         `instance`.";
    DAMAGED = INTERNAL_SERVER_ERROR "database-damaged" "The database is damaged"
        "A part of the database does not hold what was stored in it: a fault of the disk, or of a \
         program that wrote to it. Nothing of it is given out."
        "Whoever runs the server should stop it, keep a copy of its data directory, and restore a \
         backup or recover what can be recovered (sqlite3's .recover).";
    QUEUE_FULL = SERVICE_UNAVAILABLE "queue-full" "The queue is full"
        "So many computations wait that no more are accepted. Results that are known, and \
         computations under way, are not refused."
        "Submit again after the seconds in Retry-After. Whoever runs the server can allow a longer \
         queue (--queue-limit).";
    NOT_READY = SERVICE_UNAVAILABLE "not-ready" "The server is not ready"
        "The server answers but cannot do its work; the detail says why."
        "Ask again in a moment. If it stays so, whoever runs the server should look at its log.";
    DRAINING = SERVICE_UNAVAILABLE "draining" "The server is going down"
        "The server finishes what it has begun and takes no new jobs."
        "Submit again after the seconds in Retry-After. Jobs already accepted are kept.";
    BUSY = SERVICE_UNAVAILABLE "busy" "The database is busy"
        "Another program, such as a backup, has kept the server from its database for some seconds."
        "Send the request again after the seconds in Retry-After.";
    NOT_CACHED = GATEWAY_TIMEOUT "not-cached" "The result is not known yet"
        "The request asked only for a result that is known (Cache-Control: only-if-cached), and \
         this one is not. Nothing was submitted."
        "Submit without that header to have it computed.";
    DISK_FULL = INSUFFICIENT_STORAGE "disk-full" "The disk is full"
        "The server could not store anything more. Results that are known are still answered."
        "Whoever runs the server must make room in its data directory; then submit again.";
    WORKER_LOST = INTERNAL_SERVER_ERROR "worker-lost" "The run was lost repeatedly"
        "The process ended several times while this run was being computed, so it is not tried again. \
         Appears as the `error` of a job."
        "Report it with the scenario; a smaller one (fewer points or instants) may pass.";
    TIME_LIMIT = INTERNAL_SERVER_ERROR "time-limit" "The run took too long"
        "The run took longer than this server lets a run take, and was stopped. Appears as the \
         `error` of a job."
        "Ask for fewer `points` or instants, or for a larger `tolerance`. Whoever runs the server can \
         raise the limit (--run-limit).";
    NOT_STORED = INTERNAL_SERVER_ERROR "not-stored" "The result could not be stored"
        "The run was computed, but the database refused its result again and again; a part of it is \
         damaged. Appears as the `error` of a job."
        "Whoever runs the server should look at its log and at its database.";
    PANICKED = INTERNAL_SERVER_ERROR "panicked" "The computation broke off"
        "The engine made a mistake in this run; no other run is affected. Appears as the `error` of \
         a job."
        "Report it with the scenario, which the job's key identifies.";
    UNREADABLE_TASK = INTERNAL_SERVER_ERROR "unreadable-task" "The stored task does not parse"
        "The task was stored by another version of the program, which this one does not read. \
         Appears as the `error` of a job."
        "Submit the scenario again.";
}

/// One thing wrong with a request.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Complaint {
    /// Where in the body: a JSON pointer (RFC 6901).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(example = "/scenario/bodies/0/poisson_ratio")]
    pub pointer: Option<String>,
    /// Which query or path parameter.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(example = "wait")]
    pub parameter: Option<String>,
    /// What is wrong, and what would be right.
    #[schema(example = "must be between -1 and 0.5, got 0.7")]
    pub detail: String,
}

impl Complaint {
    /// Something wrong with a parameter of the address.
    pub fn parameter(name: &str, detail: impl Into<String>) -> Self {
        Self { pointer: None, parameter: Some(name.to_owned()), detail: detail.into() }
    }
}

impl From<Fault> for Complaint {
    fn from(fault: Fault) -> Self {
        Self { pointer: Some(fault.pointer), parameter: None, detail: fault.detail }
    }
}

/// Why a request was not answered as hoped.
#[derive(Debug, Clone)]
pub struct Problem {
    kind: &'static Kind,
    detail: String,
    errors: Vec<Complaint>,
    /// Boxed, for few problems have one.
    scenario: Option<Box<Value>>,
    headers: Vec<(HeaderName, String)>,
}

/// The wire form of every answer that is not a success (RFC 9457).
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Problem)]
pub struct ProblemDocument<'a> {
    /// The kind of problem: the address of a page that explains it.
    #[schema(example = "/problems/invalid-request")]
    r#type: String,
    /// The kind of problem in words.
    #[schema(example = "The request has faults")]
    title: &'a str,
    /// The HTTP status.
    #[schema(example = 422, minimum = 400, maximum = 599)]
    status: u16,
    /// What is wrong with this very request, and what to change.
    #[schema(example = "The body has 1 fault, see `errors`.")]
    detail: &'a str,
    /// The request id, as in the `x-request-id` header and in the server's log.
    #[schema(example = "019aa0f3-1f4e-7cc0-9d8b-1c5b0c1f9a11")]
    instance: &'a str,
    /// Every fault found.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    #[schema(required = false)]
    errors: &'a [Complaint],
    /// The scenario of a result that was dropped.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    scenario: Option<&'a Value>,
}

impl Problem {
    /// A problem of this kind; `detail` says what to change in this very request.
    pub fn new(kind: &'static Kind, detail: impl Into<String>) -> Self {
        Self {
            kind,
            detail: detail.into(),
            errors: Vec::new(),
            scenario: None,
            headers: Vec::new(),
        }
    }

    /// A body that parses but has faults.
    pub fn faults(faults: Vec<Fault>) -> Self {
        let errors = faults.into_iter().map(Complaint::from).collect();
        Self::complaints(&INVALID_REQUEST, "body", errors)
    }

    /// A query or path with faults.
    pub fn parameters(errors: Vec<Complaint>) -> Self {
        Self::complaints(&INVALID_PARAMETERS, "query", errors)
    }

    /// A header with a fault.
    pub fn header(error: Complaint) -> Self {
        Self::complaints(&INVALID_PARAMETERS, "head of the request", vec![error])
    }

    fn complaints(kind: &'static Kind, part: &str, errors: Vec<Complaint>) -> Self {
        let plural = if errors.len() == 1 { "fault" } else { "faults" };
        let detail = format!("The {part} has {} {plural}, see `errors`.", errors.len());
        Self { errors, ..Self::new(kind, detail) }
    }

    /// A mistake of ours; the cause belongs in the log, not in the answer.
    pub fn internal() -> Self {
        Self::new(&INTERNAL, "The server made a mistake. Its log has more under the `instance`.")
    }

    /// Adds the scenario that is meant.
    #[must_use]
    pub fn with_scenario(self, scenario: Value) -> Self {
        Self { scenario: Some(Box::new(scenario)), ..self }
    }

    /// Adds a header to the answer.
    #[must_use]
    pub fn with_header(mut self, name: HeaderName, value: impl Into<String>) -> Self {
        self.headers.push((name, value.into()));
        self
    }

    /// Asks the client to come back after so many seconds.
    #[must_use]
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
        match error {
            store::Error::Closed => {
                Self::new(&DRAINING, "The server is going down; try again in a moment.")
                    .retry_after(5)
            }
            store::Error::Busy(..) => {
                tracing::warn!(error = &error as &dyn std::error::Error, "the database is busy");
                Self::new(&BUSY, "The server's database is busy; try again in a moment.")
                    .retry_after(1)
            }
            store::Error::Full(..) => {
                tracing::error!(error = &error as &dyn std::error::Error, "the disk is full");
                Self::new(&DISK_FULL, "The server's disk is full; its operator must make room.")
            }
            store::Error::Damaged(..) | store::Error::DamagedResult(..) => {
                tracing::error!(
                    error = &error as &dyn std::error::Error,
                    "the database is damaged"
                );
                let detail = "A part of the server's database is damaged; whoever runs it must see \
                    to that. The log has more under the `instance`.";
                Self::new(&DAMAGED, detail)
            }
            // Here a store error stops, so here it is logged.
            _ => {
                tracing::error!(error = &error as &dyn std::error::Error, "the store failed");
                Self::internal()
            }
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

/// Writes the problem a response carries, now that the request id is known. An error that some
/// library answered by itself is given the words of its status.
pub(super) fn write(mut response: Response, instance: &str) -> Response {
    let status = response.status();
    let problem = response.extensions_mut().remove::<Problem>();
    if problem.is_none() && !(status.is_client_error() || status.is_server_error()) {
        return response;
    }
    let problem = problem.unwrap_or_else(|| of_status(status));
    let document = ProblemDocument {
        r#type: format!("/problems/{}", problem.kind.slug),
        title: problem.kind.title,
        status: status.as_u16(),
        detail: &problem.detail,
        instance,
        errors: &problem.errors,
        scenario: problem.scenario.as_deref(),
    };
    let headers = response.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
    // What is wrong now may be right later; some statuses would be cached without this.
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.remove(CONTENT_LENGTH);
    // Writing a struct of strings cannot fail.
    *response.body_mut() = serde_json::to_vec(&document).unwrap_or_default().into();
    response
}

fn of_status(status: StatusCode) -> Problem {
    match status {
        StatusCode::METHOD_NOT_ALLOWED => Problem::new(
            &METHOD_NOT_ALLOWED,
            "This address does not know the method; the Allow header has those it knows.",
        ),
        _ => ALL.iter().find(|kind| kind.status == status).map_or_else(Problem::internal, |kind| {
            Problem::new(kind, format!("{} {}", kind.meaning, kind.remedy))
        }),
    }
}

const STYLE: &str = "body{font:17px/1.5 system-ui,sans-serif;max-width:40em;margin:3em auto;\
    padding:0 1em;color:#222;background:#fff}code{background:#eee;padding:0 .2em}\
    h1{font-size:1.4em}small{color:#666}@media(prefers-color-scheme:dark){\
    body{color:#ddd;background:#181818}code{background:#333}a{color:#8bf}}";

fn html(title: &str, body: &str) -> String {
    let body = code(body);
    format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width\">\
         <title>{title} · fretwork</title><style>{STYLE}</style>{body}</html>\n"
    )
}

/// Sets `` `words` `` in type.
fn code(text: &str) -> String {
    let mut parts = text.split('`');
    let mut out = parts.next().unwrap_or_default().to_owned();
    for (index, part) in parts.enumerate() {
        out.push_str(if index % 2 == 0 { "<code>" } else { "</code>" });
        out.push_str(part);
    }
    out
}

/// The page that lists all kinds.
pub(super) fn index() -> String {
    let mut body = "<h1>Problems</h1><p>Every answer that is not a success is \
        <code>application/problem+json</code>; its <code>type</code> is one of these.</p><ul>"
        .to_owned();
    for Kind { slug, status, title, .. } in ALL {
        let status = status.as_u16();
        let _ = write!(body, "<li>{status} <a href=\"/problems/{slug}\">{title}</a>");
    }
    body.push_str("</ul>");
    html("Problems", &body)
}

/// The page of one kind.
pub(super) fn page(slug: &str) -> Option<String> {
    let kind = ALL.iter().find(|kind| kind.slug == slug)?;
    let Kind { status, title, meaning, remedy, .. } = kind;
    let body = format!(
        "<small>{status}</small><h1>{title}</h1><p>{meaning}</p><h2>What to do</h2><p>{remedy}</p>\
         <p><a href=\"/problems\">All problems</a> · <a href=\"/docs\">The interface</a></p>"
    );
    Some(html(title, &body))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_a_name_of_its_own_and_a_page() {
        for (place, kind) in ALL.iter().enumerate() {
            assert!(ALL[..place].iter().all(|other| other.slug != kind.slug), "{}", kind.slug);
            assert!(page(kind.slug).is_some_and(|page| page.contains(&code(kind.remedy))));
            assert!(index().contains(kind.title));
        }
        assert!(page("no-such-problem").is_none());
    }
}
