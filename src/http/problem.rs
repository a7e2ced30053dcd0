//! All errors of the API: problem documents (RFC 9457) and their types.
//!
//! A handler returns a [`Problem`], which becomes an extension of the response. `layers` writes the document,
//! because it knows the request id. It does the same for the 404 and 405 of axum and for panics.

use std::error::Error;
use std::fmt::Write as _;
use std::iter;

use axum::http::header::{CACHE_CONTROL, CONTENT_LENGTH, CONTENT_TYPE};
use axum::http::{HeaderName, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use crate::job::{Canonical, Key, TaskKind};
use crate::{store, study};
use fretwork_engine::request::fault::{Fault, Faults};

/// A problem type.
#[derive(Debug)]
pub struct Kind {
    /// The last part of the problem's `type`, and of the address of its page.
    pub slug: &'static str,
    /// The HTTP status of the answer.
    pub status: StatusCode,
    /// The title, the same in every answer of this type.
    pub title: &'static str,
    /// The meaning, for the page of the type.
    pub meaning: &'static str,
    /// What to do, for the page of the type.
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
        /// All problem types.
        pub static ALL: &[&Kind] = &[$(&$name),*];
    };
}

kinds! {
    INVALID_JSON = BAD_REQUEST "invalid-json" "The body is not JSON"
        "The body of the request cannot be parsed as JSON. The detail names the line and the column."
        "Send one JSON document in UTF-8. JSON has no NaN, Infinity, comments or trailing commas.";
    BAD_HOST = BAD_REQUEST "bad-host" "The Host header is missing or repeated"
        "A request of HTTP/1.1 must have exactly one Host header (RFC 9112). Otherwise the server and a proxy \
         before it could read different addresses from the same request."
        "Send one Host header. All usual clients do.";
    SLOW_BODY = REQUEST_TIMEOUT "slow-body" "The body arrives too slowly"
        "The body of the request did not arrive in time. After ten seconds, the server waits only for a client \
         that sends at least 4 KiB per second."
        "Send the request again over a faster connection, or send a smaller body.";
    NOT_FOUND = NOT_FOUND "not-found" "Not found"
        "No route, job or document has this address."
        "Compare the address with the list of routes under /docs. GET /v1/jobs lists jobs.";
    UNAUTHORIZED = UNAUTHORIZED "unauthorized" "A key is required"
        "This server requires a key. The request has none, or its key is unknown, expired or revoked."
        "Send your key as `Authorization: Bearer fretwork_…` (curl: `-H \"Authorization: Bearer \
         $FRETWORK_KEY\"`), or as the password of Basic authentication. The operator of the server makes \
         a key with `fretwork keys add NAME --role submit`.";
    FORBIDDEN = FORBIDDEN "forbidden" "The role of the key does not allow this"
        "A key with role `read` reads results and checks scenarios. `submit` also submits, cancels and \
         deletes jobs, pins results and makes links. `admin` also does this with the jobs of all owners."
        "Use a key with the role that the detail names. GET /v1/me returns the role of a key.";
    OTHER_OWNER = FORBIDDEN "other-owner" "The pin or the note belongs to another owner"
        "Only its owner and administrators can remove a pin, or change or remove a note."
        "Ask its owner, which the detail names, or an administrator.";
    BAD_LINK = FORBIDDEN "bad-link" "The link is not valid here"
        "A link opens one result for readers without a key. It ends when it expires, or when the key that \
         made it is revoked. This link is incomplete, belongs to another result, or has ended."
        "Ask its sender for a new link. POST /v1/results/{key}/links makes one.";
    CROSS_SITE = FORBIDDEN "cross-site" "A page of another site sent the request"
        "A browser sent the request for a web page of an origin that this server does not know."
        "The operator of the server can allow the origin of the page with --cors-origin. Behind a proxy \
         that changes the Host header, allow the origin of the server's own pages. Programs other than \
         browsers never get this problem.";
    UNKNOWN_RESULT = NOT_FOUND "unknown-result" "No result has this key"
        "This server has not computed this key. If a run is computing it, the Link header \
         (rel=\"related\") names its job."
        "Submit the scenario to POST /v1/jobs. The same scenario always has the same key. POST \
         /v1/scenarios returns the key of a scenario without a run.";
    NO_SUCH_PART = NOT_FOUND "no-such-part" "The result does not have this part"
        "A run has a history and may have profiles and loops. A study, such as a sweep, has a table and figures."
        "The detail names the parts of the result. GET /v1/results/{key} has all of them.";
    UNKNOWN_HOST = MISDIRECTED_REQUEST "unknown-host" "The server does not accept this host name"
        "A server without keys accepts only localhost or an IP address as `Host`. Otherwise any web page \
         could reach it through a browser on its machine, under a name of its own."
        "Use http://127.0.0.1 or http://localhost. The operator of the server can make keys (`fretwork \
         keys add`), or open it to everyone who can reach it (--no-auth).";
    METHOD_NOT_ALLOWED = METHOD_NOT_ALLOWED "method-not-allowed" "The address does not have this method"
        "The address exists, but not for the method of the request."
        "Use one of the methods in the Allow header of the answer.";
    NOT_ACCEPTABLE = NOT_ACCEPTABLE "not-acceptable" "The format is not available"
        "The request accepts no format in which the document is available."
        "The detail names the available formats. Choose one with the Accept header, or with ?format=, \
         which overrides the header.";
    NOT_FINISHED = CONFLICT "not-finished" "The job is not finished"
        "The request is for the result of a job that is not finished."
        "Try again after the seconds in Retry-After, or wait for the job: GET /v1/jobs/{id}?wait=10.";
    STILL_GOING = CONFLICT "still-going" "The job is not finished"
        "Only a finished job can be deleted."
        "Cancel the job first with POST /v1/jobs/{id}/cancel, or wait until it is finished.";
    PINNED = CONFLICT "pinned" "The result is pinned"
        "A pinned result cannot be deleted."
        "Unpin it with DELETE /v1/results/{key}/pin, then delete it.";
    PIN_QUOTA = CONFLICT "pin-quota" "Too many pinned results"
        "The results that one owner has pinned may take a limited part of the disk, and so may those of all owners, \
         because the server never evicts them."
        "Unpin results with DELETE /v1/results/{key}/pin; GET /v1/results?pinned_by=me lists them. The operator of \
         the server can raise the quota (--pin-quota, --keep-results).";
    JOB_FAILED = CONFLICT "job-failed" "The job failed"
        "The job ended with an error, so it has no result."
        "The `error` of the job gives the reason. Failures are not cached: a new submission computes again.";
    JOB_CANCELED = CONFLICT "job-canceled" "The job was canceled"
        "The job was canceled before it was finished, so it has no result."
        "To get the result, submit the scenario again.";
    EVICTED = GONE "evicted" "The result is no longer stored"
        "The result was computed here. Later it was deleted, or evicted to free disk space as the least \
         recently read one. `scenario` is its scenario, or `sweep`, `sensitivity` or `map` its study."
        "POST `{\"scenario\": …}` with the `scenario` (or the study) of this answer to /v1/jobs. The result will have the \
         same key and the same numbers. PUT /v1/results/{key}/pin prevents eviction.";
    BODY_TOO_LARGE = PAYLOAD_TOO_LARGE "body-too-large" "The body is too large"
        "The body of a request may have at most 4 MiB, 10 000 objects and arrays, 50 000 members, 250 000 values \
         and 32 levels. The detail names the limit."
        "Remove rows from long tables (`profile`, `cycles`): 10 000 rows are enough for every shape. Submit a \
         large set of runs as many small jobs.";
    UNSUPPORTED_MEDIA_TYPE = UNSUPPORTED_MEDIA_TYPE "unsupported-media-type" "The Content-Type is not JSON"
        "The body of a request must be JSON, and its Content-Type must say so."
        "Send the header Content-Type: application/json. With curl: -H 'Content-Type: \
         application/json'.";
    UNSUPPORTED_CODING = UNSUPPORTED_MEDIA_TYPE "unsupported-content-encoding" "The body is compressed"
        "The request has a Content-Encoding. The server reads bodies only as they are."
        "Send the body without compression, and without the header Content-Encoding.";
    INVALID_REQUEST = UNPROCESSABLE_ENTITY "invalid-request" "The request has faults"
        "The body is JSON, but not a valid request. A member has a wrong type, an unknown name, a unit of a \
         wrong dimension or a value out of range. `errors` lists all faults, each with a JSON pointer \
         (RFC 6901) into the body."
        "Correct every member that `errors` names. GET /v1/schema/scenario is the schema, and GET \
         /v1/examples has valid bodies.";
    INVALID_PARAMETERS = UNPROCESSABLE_ENTITY "invalid-parameters" "A parameter has faults"
        "A query parameter is unknown or repeated, or a parameter or header has an invalid value. `errors` \
         names each of them."
        "Correct the parameters that `errors` names. It also says which values they accept.";
    TOO_EXPENSIVE = UNPROCESSABLE_ENTITY "too-expensive" "The run would take too long"
        "The estimated time of the run is longer than the limit of this server, or than the 20 ms of an evaluation \
         (POST /v1/evaluate) or the 30 s of derivatives."
        "Submit a job instead of an evaluation. Request fewer `points`, output cycles or profiles, an earlier last cycle, or a larger `tolerance`. POST \
         /v1/scenarios returns the `cost` of a scenario. The operator of the server can raise the limit \
         (--run-limit).";
    KEY_REUSED = UNPROCESSABLE_ENTITY "idempotency-key-reused" "The Idempotency-Key belongs to another submission"
        "An earlier submission with the same Idempotency-Key had another body. A repeated submission must \
         not differ."
        "Use a new Idempotency-Key for each new submission, for example a random UUID.";
    RATE_LIMITED = TOO_MANY_REQUESTS "rate-limited" "Too many requests"
        "The key has sent as many requests in this minute as its limit allows. The limits of other keys \
         are separate, and so is the limit of evaluations (POST /v1/evaluate)."
        "Continue after the seconds in Retry-After. The RateLimit header of each counted answer says how many \
         requests remain (r), and after how many seconds there is one more (t). Waiting for a job \
         (`Prefer: wait=10`) or following its events takes one request, and polling takes many. The \
         operator of the server can raise the limits (--rate-limit, --evaluate-rate, or `fretwork keys add --rate`).";
    TOO_MANY_AT_ONCE = TOO_MANY_REQUESTS "too-many-at-once" "Too many concurrent requests"
        "The key has as many concurrent requests as its limit allows. A request ends when its answer has \
         been read to the end; waits and event streams count until then."
        "Read or close open answers, then continue. The server cannot know when one ends, so there is no \
         Retry-After: try again at increasing intervals. The operator of the server can raise the limit \
         (--concurrency).";
    INTERNAL = INTERNAL_SERVER_ERROR "internal" "The server has a bug"
        "An error occurred that should be impossible. The server logged it with the request id in \
         `instance`."
        "The request may be valid: try once more. If it fails again, report it with the `instance`.";
    DAMAGED = INTERNAL_SERVER_ERROR "database-damaged" "The database is damaged"
        "A part of the database differs from what was stored in it, or cannot be read as a result. The cause is the \
         disk, or another program that wrote to it. The server returns no damaged data."
        "If the detail names a result, submit its scenario with `Cache-Control: no-cache`: the server then computes the \
         result again and repairs it. If the answer says `differs`, an administrator deletes the result first (DELETE \
         /v1/results/{key}). Otherwise the operator should stop the server, copy its data directory, and restore a \
         backup or recover the readable part (`.recover` of sqlite3).";
    QUEUE_FULL = SERVICE_UNAVAILABLE "queue-full" "The queue is full"
        "Too many jobs are queued. The server still accepts submissions whose result is known or is being \
         computed."
        "Submit again after the seconds in Retry-After. The operator of the server can allow a longer \
         queue (--queue-limit).";
    NOT_READY = SERVICE_UNAVAILABLE "not-ready" "The server is not ready"
        "The server answers but cannot accept jobs. The detail gives the reason."
        "Try again in a moment. If the problem continues, the operator should read the log of the server.";
    DRAINING = SERVICE_UNAVAILABLE "draining" "The server is shutting down"
        "The server finishes its running jobs and accepts no new ones."
        "Submit again after the seconds in Retry-After. All accepted jobs are kept.";
    MEMORY_FULL = SERVICE_UNAVAILABLE "memory-full" "The memory for large bodies is in use"
        "The memory for large bodies of requests and answers is limited, in total and for each caller. Answers use it \
         until their clients have read them. Small answers are not limited."
        "Read your other answers to the end, then send the request again after the seconds in Retry-After. The \
         operator of the server can allow more memory (--transfer-memory).";
    EVALUATIONS_FULL = SERVICE_UNAVAILABLE "evaluations-full" "Too many evaluations at the same time"
        "The server evaluates as many scenarios at a time as it has workers. Others wait for a quarter of a second."
        "Evaluate again after the seconds in Retry-After. The operator of the server can allow more workers \
         (--workers).";
    BUSY = SERVICE_UNAVAILABLE "busy" "The database is busy"
        "Another program, for example a backup, has locked the database for some seconds, or the database server \
         restarts."
        "Send the request again after the seconds in Retry-After.";
    NOT_CACHED = GATEWAY_TIMEOUT "not-cached" "The result is not known yet"
        "The request accepts only a known result (Cache-Control: only-if-cached), and this result is not \
         known. The server did not accept a job."
        "To compute the result, submit without that header.";
    DISK_FULL = INSUFFICIENT_STORAGE "disk-full" "The disk is full"
        "The server cannot store more data. It still returns known results."
        "The operator of the server must free disk space in its data directory. Then submit again.";
    WORKER_LOST = INTERNAL_SERVER_ERROR "worker-lost" "The server crashed repeatedly during the run"
        "The server process ended several times while it computed this run, so it does not try again. \
         This is the `error` of a job."
        "Report it with the scenario. A smaller run (fewer points or output cycles) may succeed.";
    TIME_LIMIT = INTERNAL_SERVER_ERROR "time-limit" "The run took too long"
        "The run reached the time limit of this server, which stopped it. This is the `error` of a job."
        "Request fewer `points` or output cycles, or a larger `tolerance`. The operator of the server can \
         raise the limit (--run-limit).";
    NOT_STORED = INTERNAL_SERVER_ERROR "not-stored" "The result could not be stored"
        "The run was computed, but the database repeatedly refused its result: a part of the database is \
         damaged. This is the `error` of a job."
        "The operator of the server should check its log and its database.";
    PANICKED = INTERNAL_SERVER_ERROR "panicked" "The computation stopped at a bug"
        "The engine has a bug that stopped this run. Other runs are not affected. This is the `error` of a \
         job."
        "Report it with the scenario of the job (`include=scenario`).";
    UNREADABLE_TASK = INTERNAL_SERVER_ERROR "unreadable-task" "The stored task cannot be read"
        "Another version of the program stored the task, and this version cannot read it. This is the \
         `error` of a job."
        "Submit the scenario again.";
}

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
    /// What an evicted result was computed from. Boxed, because few problems have it.
    asked: Option<Box<Canonical>>,
    headers: Vec<(HeaderName, String)>,
    /// For the log.
    cause: Option<String>,
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
    #[schema(example = "The body has 1 fault, see `errors`.")]
    detail: &'a str,
    /// The request id, as in the `x-request-id` header and in the log of the server.
    #[schema(example = "019aa0f3-1f4e-7cc0-9d8b-1c5b0c1f9a11")]
    instance: &'a str,
    /// All faults of the request.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    #[schema(required = false)]
    errors: &'a [Complaint],
    /// The scenario of an evicted result.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    scenario: Option<&'a Value>,
    /// The sweep of an evicted result.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    sweep: Option<&'a Value>,
    /// The sensitivity study of an evicted result.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    sensitivity: Option<&'a Value>,
    /// The map of an evicted result.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    map: Option<&'a Value>,
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
        Self::complaints(&INVALID_REQUEST, "body", errors)
    }

    /// The problem for query parameters with faults.
    pub fn parameters(errors: Vec<Complaint>) -> Self {
        Self::complaints(&INVALID_PARAMETERS, "query", errors)
    }

    /// The problem for a header with a fault.
    pub fn header(error: Complaint) -> Self {
        Self::complaints(&INVALID_PARAMETERS, "header of the request", vec![error])
    }

    fn complaints(kind: &'static Kind, part: &str, errors: Vec<Complaint>) -> Self {
        let plural = if errors.len() == 1 { "fault" } else { "faults" };
        let detail = format!("The {part} has {} {plural}, see `errors`.", errors.len());
        Self { errors, ..Self::new(kind, detail) }
    }

    /// The problem for a bug of the server. Its cause is in the log, not in the answer.
    pub fn internal() -> Self {
        Self::new(
            &INTERNAL,
            "The server has a bug. Its log contains the details: search it for the `instance` of this problem.",
        )
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
        Self::new(&DAMAGED, detail)
    }

    /// The problem for a pin or a note of another owner.
    pub fn other_owner(what: &str, owner: Option<String>) -> Self {
        let owner =
            owner.map_or_else(|| "an unknown owner".to_owned(), |owner| format!("{owner:?}"));
        let detail = format!(
            "The {what} belongs to {owner}. Ask the owner or an administrator to change it."
        );
        Self::new(&OTHER_OWNER, detail)
    }

    /// Adds the error that caused the problem, for the log.
    #[must_use]
    pub fn caused_by(self, error: &(dyn Error + 'static)) -> Self {
        let causes = iter::successors(Some(error), |&error| error.source());
        let causes: Vec<_> = causes.map(ToString::to_string).collect();
        Self { cause: Some(causes.join(": ")), ..self }
    }

    /// The error that caused the problem. It is for the log, not for the client.
    pub fn cause(&self) -> Option<&str> {
        self.cause.as_deref()
    }

    /// Its type, and its detail with all faults, for another protocol.
    pub fn in_words(&self) -> (&'static str, String) {
        let Self { kind, detail, errors, .. } = self;
        let place = |error: &Complaint| error.pointer.clone().or(error.parameter.clone());
        let faults = errors
            .iter()
            .map(|error| format!(" {} {}.", place(error).unwrap_or_default(), error.detail));
        (kind.slug, iter::once(detail.clone()).chain(faults).collect())
    }

    /// Adds what an evicted result was computed from.
    #[must_use]
    pub fn with_asked(self, asked: Option<Canonical>) -> Self {
        Self { asked: asked.map(Box::new), ..self }
    }

    /// Adds a header to the answer.
    #[must_use]
    pub fn with_header(mut self, name: HeaderName, value: impl Into<String>) -> Self {
        self.headers.push((name, value.into()));
        self
    }

    /// Adds `Retry-After`.
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
        let problem = match error {
            store::Error::Closed => {
                return Self::new(&DRAINING, "The server is shutting down. Try again in a moment.")
                    .retry_after(5);
            }
            store::Error::Busy(..) => {
                Self::new(&BUSY, "The database of the server is busy. Try again in a moment.")
                    .retry_after(1)
            }
            store::Error::Unreachable(..) | store::Error::Exhausted => Self::new(
                &BUSY,
                "The database of the server cannot be reached. Try again in a moment.",
            )
            .retry_after(2),
            store::Error::Full(..) => Self::new(
                &DISK_FULL,
                "The disk of the server is full. Its operator must free space.",
            ),
            store::Error::DamagedResult(key) => Self::damaged_result(&key),
            store::Error::Damaged(..) => {
                let detail = "A part of the server's database is damaged. Its operator must repair \
                    it. The log contains the details: search it for the `instance` of this problem.";
                Self::new(&DAMAGED, detail)
            }
            _ => Self::internal(),
        };
        problem.caused_by(&error)
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
    let asked = |kind| {
        let asked = problem.asked.as_deref().filter(|asked| asked.kind == kind);
        asked.map(|asked| &asked.value)
    };
    let document = ProblemDocument {
        r#type: format!("/problems/{}", problem.kind.slug),
        title: problem.kind.title,
        status: status.as_u16(),
        detail: &problem.detail,
        instance,
        errors: &problem.errors,
        scenario: asked(TaskKind::Run),
        sweep: asked(TaskKind::Study(study::Kind::Sweep)),
        sensitivity: asked(TaskKind::Study(study::Kind::Sensitivity)),
        map: asked(TaskKind::Study(study::Kind::Map)),
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
            &METHOD_NOT_ALLOWED,
            "This address does not have this method. The Allow header lists its methods.",
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

/// Changes `` `code` `` to HTML.
fn code(text: &str) -> String {
    let mut parts = text.split('`');
    let mut out = parts.next().unwrap_or_default().to_owned();
    for (index, part) in parts.enumerate() {
        out.push_str(if index % 2 == 0 { "<code>" } else { "</code>" });
        out.push_str(part);
    }
    out
}

/// The page that lists all problem types.
pub(super) fn index() -> String {
    let mut body = "<h1>Problems</h1><p>Every error is \
        <code>application/problem+json</code>. Its <code>type</code> is one of these.</p><ul>"
        .to_owned();
    for Kind { slug, status, title, .. } in ALL {
        let status = status.as_u16();
        let _ = write!(body, "<li>{status} <a href=\"/problems/{slug}\">{title}</a>");
    }
    body.push_str("</ul>");
    html("Problems", &body)
}

/// The page of one problem type.
pub(super) fn page(slug: &str) -> Option<String> {
    let kind = ALL.iter().find(|kind| kind.slug == slug)?;
    let Kind { status, title, meaning, remedy, .. } = kind;
    let body = format!(
        "<small>{status}</small><h1>{title}</h1><p>{meaning}</p><h2>What to do</h2><p>{remedy}</p>\
         <p><a href=\"/problems\">All problems</a> · <a href=\"/docs\">API documentation</a></p>"
    );
    Some(html(title, &body))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_problem_type_has_a_unique_slug_and_a_page() {
        for (place, kind) in ALL.iter().enumerate() {
            assert!(ALL[..place].iter().all(|other| other.slug != kind.slug), "{}", kind.slug);
            assert!(page(kind.slug).is_some_and(|page| page.contains(&code(kind.remedy))));
            assert!(index().contains(kind.title));
        }
        assert!(page("no-such-problem").is_none());
    }
}
