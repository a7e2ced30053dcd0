//! Jobs: submit, watch, list, cancel, delete.

use std::time::Duration;

use axum::body::Bytes;
use axum::extract::State;
use axum::http::header::{self, HeaderName};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use tokio::time;
use utoipa::ToSchema;

use super::App;
use super::caller::Caller;
use super::problem::{self, Complaint, Problem};
use super::scenarios::parse;
use super::wire::{
    Body, Freshness, NoQuery, Prefer, Query, Segment, idempotency_key, instant, urgency,
};
use crate::job::{Failure, Job, JobId, JobState, Key, Origin, Submission};
use crate::store::{
    Admission, Canceled, Deleted, Filter, NewJob, Repeatable, StoredResult, Submitted,
};

/// How many jobs a page has unless told.
const PAGE: u32 = 50;
/// How many jobs a page may have.
const LONGEST_PAGE: u32 = 200;

/// One submission and how far it has come.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Job)]
pub struct JobAnswer {
    /// Names the job: a UUID of version 7, so ids sort by time of submission.
    #[schema(value_type = String, format = "uuid", example = "019aa0f3-1f4e-7cc0-9d8b-1c5b0c1f9a11")]
    id: JobId,
    /// `queued`, `running`, `canceling`, `succeeded`, `failed` or `canceled`.
    #[schema(value_type = super::openapi::JobState)]
    state: JobState,
    /// The address of the result: the same for every submission of the same scenario.
    #[schema(value_type = String, pattern = "^[0-9a-f]{64}$")]
    key: Key,
    /// Whether this job started the computation (`computed`), joined one (`coalesced`) or found
    /// the result ready (`cached`).
    #[schema(value_type = super::openapi::Origin)]
    origin: Origin,
    /// How often the computation was begun. More than 1 means that the server was interrupted.
    #[schema(example = 1)]
    attempt: u32,
    /// The share of the computation that is done, 0 to 1.
    #[schema(minimum = 0, maximum = 1, example = 1.0)]
    progress: f64,
    /// Among the jobs of the same owner: 0 is the most urgent, 7 the least; from the `Priority`
    /// header.
    #[schema(minimum = 0, maximum = 7, example = 3)]
    priority: u8,
    /// When it was submitted, begun and finished.
    times: Times,
    /// A line for people, as submitted.
    label: Option<String>,
    /// Words to find it by, as submitted.
    tags: Vec<String>,
    /// The last entry of the history and the regime, once it has succeeded.
    #[schema(value_type = Option<Object>)]
    summary: Option<Value>,
    /// What the user should know about the scenario: a list of `{kind, detail}`.
    #[schema(value_type = Vec<super::openapi::Warning>)]
    warnings: Value,
    /// Why it failed, if it did.
    error: Option<JobError>,
    /// Where to go from here.
    links: Links,
}

/// When a job was submitted, begun and finished: RFC 3339, UTC.
#[derive(Debug, Serialize, ToSchema)]
struct Times {
    /// When it was submitted.
    #[schema(format = "date-time", example = "2026-01-31T12:00:00.000Z")]
    created: String,
    /// When a worker began it.
    #[schema(format = "date-time")]
    started: Option<String>,
    /// When it came to its end.
    #[schema(format = "date-time")]
    finished: Option<String>,
}

/// Why a job failed.
#[derive(Debug, Serialize, ToSchema)]
struct JobError {
    /// The kind of failure: the address of a page that explains it.
    #[schema(example = "/problems/worker-lost")]
    r#type: String,
    /// The kind of failure in words.
    title: String,
    /// What happened.
    detail: String,
}

/// Where to go from a job.
#[derive(Debug, Serialize, ToSchema)]
struct Links {
    /// The job itself.
    #[serde(rename = "self")]
    this: String,
    /// Its result, once it has succeeded.
    result: String,
    /// Server-sent events of what becomes of it.
    events: String,
    /// POST here to cancel it; null once it is finished.
    cancel: Option<String>,
}

/// A page of jobs, the newest first.
#[derive(Debug, Serialize, ToSchema)]
pub struct JobList {
    /// The jobs.
    jobs: Vec<JobAnswer>,
    /// The address of the next page; null on the last.
    #[schema(example = "/v1/jobs?limit=50&cursor=019aa0f3-1f4e-7cc0-9d8b-1c5b0c1f9a11")]
    next: Option<String>,
}

impl From<Job> for JobAnswer {
    fn from(job: Job) -> Self {
        let this = address(job.id);
        let cancel = (!job.state.is_finished()).then(|| format!("{this}/cancel"));
        let result = format!("/v1/results/{}", job.key);
        let events = format!("{this}/events");
        Self {
            id: job.id,
            state: job.state,
            key: job.key,
            origin: job.origin,
            attempt: job.attempt,
            progress: job.progress,
            priority: job.priority,
            times: Times {
                created: instant(job.created),
                started: job.started.map(instant),
                finished: job.finished.map(instant),
            },
            label: job.label,
            tags: job.tags,
            summary: job.summary,
            warnings: job.warnings,
            error: job.failure.map(JobError::from),
            links: Links { this, result, events, cancel },
        }
    }
}

impl From<Failure> for JobError {
    fn from(failure: Failure) -> Self {
        let slug = failure.kind.as_str();
        let title = problem::ALL.iter().find(|kind| kind.slug == slug).map(|kind| kind.title);
        Self {
            r#type: format!("/problems/{slug}"),
            title: title.unwrap_or("The job failed").to_owned(),
            detail: failure.message,
        }
    }
}

fn address(id: JobId) -> String {
    format!("/v1/jobs/{id}")
}

pub(super) fn read_id(text: &str) -> Result<JobId, Problem> {
    text.parse().map_err(|_| {
        let detail = "No job has this id: an id is a UUID in lower case, as in the `id` of a job.";
        Problem::new(&problem::NOT_FOUND, detail)
    })
}

/// The job of this id, if the caller may see it. Jobs of others are as good as none: nobody learns
/// what there is.
pub(super) async fn visible(app: &App, caller: &Caller, id: &str) -> Result<Job, Problem> {
    let job = app.store.job(read_id(id)?).await?;
    let seen = |job: &Job| caller.reach().is_none_or(|owner| owner == job.owner);
    job.filter(seen).ok_or_else(unknown)
}

pub(super) fn unknown() -> Problem {
    Problem::new(&problem::NOT_FOUND, "No job has this id; GET /v1/jobs lists those there are.")
}

/// Waits until the job is finished, the time is over or the server goes down.
async fn wait(app: &App, job: Job, time: Duration) -> Result<Job, Problem> {
    let mut draining = app.draining.clone();
    let until = async move {
        tokio::select! {
            () = time::sleep(time) => {}
            // A closed channel is a server that has already gone; an error only ends the wait.
            _ = draining.wait_for(|draining| *draining) => {}
        }
    };
    Ok(app.store.wait(job, until).await?)
}

/// Answers a job as it is always answered; with `include`, its result inside.
async fn answer(app: &App, job: Job, include: bool) -> Result<Response, Problem> {
    if !include {
        return write(job, None);
    }
    let result = result_of(app, &job).await?;
    write(job, Some(&result))
}

/// What stands for a result that there is not.
const NO_RESULT: Bytes = Bytes::from_static(b"null");

/// The result of a job; null if there is none.
async fn result_of(app: &App, job: &Job) -> Result<Bytes, Problem> {
    if job.state != JobState::Succeeded {
        return Ok(NO_RESULT);
    }
    Ok(match app.store.result(&job.key).await? {
        Some(StoredResult::Whole(body)) => body,
        _ => NO_RESULT,
    })
}

/// Writes a job, with a result inside if there is to be one.
fn write(job: Job, result: Option<&Bytes>) -> Result<Response, Problem> {
    let (key, id) = (job.key, job.id);
    let mut body = serde_json::to_vec(&JobAnswer::from(job)).map_err(|_| Problem::internal())?;
    if let Some(result) = result {
        // The stored bytes go in as they are: parsing and printing them again would cost more
        // than everything else here and could change digits.
        body.pop();
        body.extend_from_slice(b",\"result\":");
        body.extend_from_slice(result);
        body.push(b'}');
    }
    let headers = [
        (header::CONTENT_TYPE, "application/json".to_owned()),
        // A job changes; what does not is its result, at an address of its own.
        (header::CACHE_CONTROL, "no-store".to_owned()),
        (header::CONTENT_LOCATION, address(id)),
        (header::LINK, format!("</v1/results/{key}>; rel=\"related\"")),
    ];
    Ok((headers, body).into_response())
}

/// Submits a scenario: computes it, joins the computation under way, or finds its result.
///
/// Every submission is a job of its own and is kept. The same scenario is computed once, however
/// many submit it, and whatever units they write it in. With `Prefer: wait=10` the answer waits
/// up to 10 s for the end; with `include=result` it then holds the result itself. A submission that
/// may have been lost can be repeated under the same `Idempotency-Key`: it stays one job.
#[utoipa::path(post, path = "/v1/jobs", operation_id = "submit_job", tag = "jobs",
    params(
        ("include" = Option<super::openapi::Include>, Query,
            description = "`result` puts a finished result into the answer, as `result`."),
        ("Prefer" = Option<String>, Header,
            description = "`wait=N`: answer when the job is finished, at the latest after N seconds \
                (at most 60).", example = "wait=10"),
        ("Idempotency-Key" = Option<String>, Header,
            description = "A name for this submission, such as a random UUID. The same name with the \
                same body is the same job, for as long as the job is kept."),
        ("Priority" = Option<String>, Header,
            description = "`u=0` (most urgent) to `u=7` (least), RFC 9218: the order among the \
                caller's own jobs. Callers take turns whatever they set.", example = "u=3"),
        ("Cache-Control" = Option<String>, Header,
            description = "`no-cache`: compute again, and compare with the result that is known. \
                `only-if-cached`: do not compute; 504 if the result is not known."),
        ("traceparent" = Option<String>, Header,
            description = "W3C Trace Context: appears in the log of the request and of the run."),
    ),
    request_body(content = ref("#/components/schemas/JobBody"), description = "What to compute. A \
        physical quantity is a number in SI units or a string with a unit."),
    responses(
        (status = 200, description = "The job is finished: it succeeded, failed or was canceled.",
            body = JobAnswer, headers(
                ("Cache-Status" = String, description = "RFC 9211: `fretwork; hit`, or `fretwork; \
                    fwd=miss` with `stored` or `collapsed`; `fwd=request` after `no-cache`."),
                ("Content-Location" = String, description = "The address of the job."),
                ("Link" = String, description = "The address of the result, `rel=\"related\"`."),
                ("Preference-Applied" = String, description = "The wait that was granted."),
            )),
        (status = 202, description = "The job is accepted. Its address is in `Location`.",
            body = JobAnswer, headers(
                ("Location" = String, description = "The address of the job."),
                ("Cache-Status" = String, description = "RFC 9211: `fretwork; fwd=miss`, with \
                    `collapsed` if it joined a computation under way."),
                ("Link" = String, description = "The address of the result, `rel=\"related\"`."),
                ("Preference-Applied" = String, description = "The wait that was granted."),
            )),
        (status = 422, description = "The body or a header has faults, and `errors` lists them all; \
            or the run would take longer than the server allows; or the Idempotency-Key stands for \
            another submission."),
        (status = 503, description = "The server takes no jobs just now, or its queue is full; see \
            `Retry-After`.", headers(("Retry-After" = u32, description = "Seconds."))),
        (status = 504, description = "`only-if-cached` was asked for, and the result is not known."),
    ),
)]
pub async fn submit(
    State(app): State<App>,
    caller: Caller,
    mut query: Query,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Problem> {
    let include = query.include_result();
    query.finish()?;
    if *app.draining.borrow() {
        let detail = "The server is going down and takes no new jobs; submit again in a moment.";
        return Err(Problem::new(&problem::DRAINING, detail).retry_after(5));
    }
    let name = idempotency_key(&headers)?;
    let submission = parse(body).await?;
    let (prefer, freshness) = (Prefer::read(&headers), Freshness::read(&headers));
    let Submission { task, label, tags, warnings } = submission;
    let (key, stored, seconds) = (task.key(), task.to_json(), task.seconds());
    let limit = app.run_limit.filter(|limit| seconds > limit.as_secs_f64());
    let repeatable = name.map(|name| {
        let sent = json!([stored, label, tags]).to_string();
        Repeatable { key: name, fingerprint: Sha256::digest(sent).to_vec() }
    });
    let new = NewJob {
        id: JobId::generate(),
        owner: caller.owner,
        key,
        task: stored,
        priority: urgency(&headers),
        label,
        tags,
        warnings,
        repeatable,
        afresh: freshness.afresh,
        admission: Admission {
            only_known: freshness.only_known,
            too_expensive: limit.is_some(),
            unless_needed: false,
        },
        trace: Some(caller.trace),
    };
    let (submitted, computed) = match prefer.wait {
        Some(time) if !time.is_zero() => app.shortly.submit(&app.store, new, seconds).await?,
        _ => (app.store.submit(new).await?, None),
    };
    let mut job = match submitted {
        Submitted::Accepted(job) | Submitted::Repeated(job) => job,
        Submitted::Mistaken => {
            let detail =
                "This Idempotency-Key came with another submission before; make a new key.";
            return Err(Problem::new(&problem::KEY_REUSED, detail));
        }
        Submitted::Unknown | Submitted::Needed => {
            let detail =
                "The result is not known; submit without only-if-cached to have it computed.";
            return Err(Problem::new(&problem::NOT_CACHED, detail));
        }
        Submitted::TooExpensive => return Err(too_expensive(seconds, limit)),
        Submitted::Refused { queued } => {
            let detail = format!("{queued} jobs wait already; submit again in a moment.");
            let seconds = app.store.tally().seconds_per_run() / app.workers as f64;
            let seconds = seconds.clamp(1.0, 60.0).ceil() as u32;
            return Err(Problem::new(&problem::QUEUE_FULL, detail).retry_after(seconds));
        }
    };
    // From here on the job is accepted, and the answer must say so whatever else goes wrong.
    if let Some(time) = prefer.wait {
        job = wait(&app, job.clone(), time).await.unwrap_or(job);
    }
    let cache = cache_status(&job, freshness.afresh);
    let finished = job.state.is_finished();
    let location = address(job.id);
    let result = match (include, computed) {
        (true, Some(computed)) if job.state == JobState::Succeeded => Some(computed.body),
        (true, _) => Some(result_of(&app, &job).await.unwrap_or(NO_RESULT)),
        (false, _) => None,
    };
    let mut response = write(job, result.as_ref())?;
    response.headers_mut().insert(header::CACHE_STATUS, HeaderValue::from_static(cache));
    let mut set = |name: HeaderName, value: String| {
        // Paths and numbers are always legal in a header.
        if let Ok(value) = HeaderValue::try_from(value) {
            response.headers_mut().insert(name, value);
        }
    };
    if let Some(time) = prefer.wait {
        let name = HeaderName::from_static("preference-applied");
        set(name, format!("wait={}", time.as_secs()));
    }
    if !finished {
        set(header::LOCATION, location);
        *response.status_mut() = StatusCode::ACCEPTED;
    }
    Ok(response)
}

fn too_expensive(seconds: f64, limit: Option<Duration>) -> Problem {
    let about = |time| humantime::format_duration(time);
    let detail = format!(
        "The run would take about {}, and this server lets a run take {}; ask for fewer points, \
         instants or rows, or for a larger tolerance.",
        about(Duration::from_secs(seconds as u64)),
        about(limit.unwrap_or_default()),
    );
    Problem::new(&problem::TOO_EXPENSIVE, detail)
}

/// What the cache had to do with the answer (RFC 9211).
fn cache_status(job: &Job, afresh: bool) -> &'static str {
    match (job.origin, job.state) {
        (Origin::Cached, _) => "fretwork; hit",
        (Origin::Coalesced, _) if afresh => "fretwork; fwd=request; collapsed",
        (Origin::Coalesced, _) => "fretwork; fwd=miss; collapsed",
        (Origin::Computed, _) if afresh => "fretwork; fwd=request",
        (Origin::Computed, JobState::Succeeded) => "fretwork; fwd=miss; stored",
        (Origin::Computed, _) => "fretwork; fwd=miss",
    }
}

/// Lists jobs, the newest first.
///
/// All filters given must hold. The address of the next page is in `next` and in the `Link`
/// header; pages stay correct while new jobs arrive.
#[utoipa::path(get, path = "/v1/jobs", operation_id = "list_jobs", tag = "jobs",
    params(
        ("state" = Option<super::openapi::JobState>, Query, description = "Jobs in this state."),
        ("label" = Option<String>, Query, description = "Jobs with exactly this label."),
        ("tag" = Option<String>, Query, description = "Jobs that carry this tag."),
        ("key" = Option<super::openapi::KeyText>, Query, description = "Jobs for the result with this key."),
        ("owner" = Option<super::openapi::Owner>, Query, description = "`me`: my own jobs. \
            Where keys are asked for, only administrators see those of others."),
        ("limit" = Option<u32>, Query, description = "How many jobs at most.", minimum = 1,
            maximum = 200, example = 50),
        ("cursor" = Option<uuid::Uuid>, Query,
            description = "Goes on behind this job; comes from the `next` of a page."),
    ),
    responses((status = 200, description = "A page of jobs.", body = JobList, headers(
        ("Link" = String, description = "The address of the next page, `rel=\"next\"`."),
    ))),
)]
pub async fn list(
    State(app): State<App>,
    caller: Caller,
    uri: Uri,
    mut query: Query,
) -> Result<Response, Problem> {
    let filter = within(read_filter(&mut query, &caller), &caller);
    let limit = query.value("limit", &format!("a number from 1 to {LONGEST_PAGE}"), |text| {
        text.parse().ok().filter(|limit| (1..=LONGEST_PAGE).contains(limit))
    });
    let cursor = query.value("cursor", "the id of a job", |text| text.parse().ok());
    query.finish()?;
    let page = app.store.jobs(&filter, cursor, limit.unwrap_or(PAGE)).await?;
    let next = page.next.map(|cursor| next_page(&uri, cursor));
    let link = next.as_ref().map(|next| [(header::LINK, format!("<{next}>; rel=\"next\""))]);
    let jobs = page.jobs.into_iter().map(JobAnswer::from).collect();
    Ok((link, axum::Json(JobList { jobs, next })).into_response())
}

/// Takes the parameters that select jobs.
fn read_filter(query: &mut Query, caller: &Caller) -> Filter {
    let states = JobState::ALL.map(JobState::as_str).join(", ");
    let key = "a key of 64 lower-case hexadecimal digits";
    Filter {
        state: query.value("state", &format!("one of {states}"), |text| text.parse().ok()),
        label: query.text("label"),
        tag: query.text("tag"),
        key: query.value("key", key, |text| text.parse().ok()),
        owner: query.value("owner", "\"me\"", |text| (text == "me").then(|| caller.owner.clone())),
    }
}

/// Of all jobs that match, those that the caller may touch.
fn within(filter: Filter, caller: &Caller) -> Filter {
    Filter { owner: filter.owner.or_else(|| caller.reach().map(str::to_owned)), ..filter }
}

/// The address asked for, with another cursor.
pub(super) fn next_page(uri: &Uri, cursor: impl std::fmt::Display) -> String {
    let query = uri.query().unwrap_or_default().as_bytes();
    let rest = form_urlencoded::parse(query).filter(|(name, _)| name != "cursor");
    let query = form_urlencoded::Serializer::new(String::new())
        .extend_pairs(rest)
        .append_pair("cursor", &cursor.to_string())
        .finish();
    format!("{}?{query}", uri.path())
}

/// Shows a job.
///
/// With `wait` the answer comes as soon as the job is finished, which is cheaper than asking again and
/// again. It does not say how the job ended: `state` does.
#[utoipa::path(get, path = "/v1/jobs/{id}", operation_id = "get_job", tag = "jobs",
    params(
        ("id" = uuid::Uuid, Path, description = "The `id` of a job."),
        ("wait" = Option<f64>, Query, description = "Answers when the job is finished, at the latest \
            after so many seconds.", minimum = 0, maximum = 60, example = 10),
        ("include" = Option<super::openapi::Include>, Query,
            description = "`result` puts a finished result into the answer, as `result`."),
    ),
    responses(
        (status = 200, description = "The job.", body = JobAnswer),
    ),
)]
pub async fn show(
    State(app): State<App>,
    caller: Caller,
    Segment(id): Segment,
    mut query: Query,
) -> Result<Response, Problem> {
    let time = query.wait();
    let include = query.include_result();
    query.finish()?;
    let mut job = visible(&app, &caller, &id).await?;
    if let Some(time) = time {
        job = wait(&app, job, time).await?;
    }
    answer(&app, job, include).await
}

/// Leads to the result of a job.
///
/// A finished job answers with a redirection; clients that follow it have the result.
#[utoipa::path(get, path = "/v1/jobs/{id}/result", operation_id = "get_job_result", tag = "jobs",
    params(("id" = uuid::Uuid, Path, description = "The `id` of a job.")),
    responses(
        (status = 303, description = "The result is at the address in `Location`.",
            headers(("Location" = String, description = "The address of the result."))),
        (status = 409, description = "The job is not finished (then with `Retry-After`), failed, or \
            was canceled.", headers(("Retry-After" = u32, description = "Seconds."))),
    ),
)]
pub async fn result(
    State(app): State<App>,
    caller: Caller,
    Segment(id): Segment,
    _: NoQuery,
) -> Result<Response, Problem> {
    let job = visible(&app, &caller, &id).await?;
    let problem = match job.state {
        JobState::Succeeded => {
            let location = format!("/v1/results/{}", job.key);
            return Ok((StatusCode::SEE_OTHER, [(header::LOCATION, location)]).into_response());
        }
        JobState::Queued | JobState::Running | JobState::Canceling => {
            let detail = format!(
                "The job is {}; ask again in a second, or GET /v1/jobs/{id}?wait=10.",
                job.state
            );
            Problem::new(&problem::NOT_FINISHED, detail).retry_after(1)
        }
        JobState::Failed => {
            let cause = job.failure.map_or_else(String::new, |failure| failure.message);
            let detail = format!("The job failed: {cause}. A new submission computes again.");
            Problem::new(&problem::JOB_FAILED, detail)
        }
        JobState::Canceled => {
            let detail = "The job was canceled; submit the scenario again for its result.";
            Problem::new(&problem::JOB_CANCELED, detail)
        }
    };
    Err(problem)
}

/// Cancels a job.
///
/// The computation stops when no other job shares it. A finished job stays as it is: the answer
/// shows its state. The job remains readable.
#[utoipa::path(post, path = "/v1/jobs/{id}/cancel", operation_id = "cancel_job", tag = "jobs",
    params(("id" = uuid::Uuid, Path, description = "The `id` of a job.")),
    responses(
        (status = 200, description = "The job as it is now.", body = JobAnswer),
    ),
)]
pub async fn cancel(
    State(app): State<App>,
    caller: Caller,
    Segment(id): Segment,
    _: NoQuery,
) -> Result<Response, Problem> {
    let job = visible(&app, &caller, &id).await?;
    match app.store.cancel(job.id).await? {
        Canceled::NotFound => Err(unknown()),
        Canceled::AlreadyFinished(job) | Canceled::Done(job) => answer(&app, job, false).await,
    }
}

/// How many jobs were canceled.
#[derive(Debug, Serialize, ToSchema)]
pub struct CanceledJobs {
    /// So many jobs.
    #[schema(example = 12)]
    canceled: u64,
}

/// Cancels all jobs that match.
///
/// At least one filter must be given, and all that are given must hold. What is finished stays as it
/// is, and so do jobs that are submitted meanwhile. Computations stop when no other job shares them.
#[utoipa::path(post, path = "/v1/jobs/cancel", operation_id = "cancel_jobs", tag = "jobs",
    params(
        ("state" = Option<super::openapi::JobState>, Query, description = "Jobs in this state."),
        ("label" = Option<String>, Query, description = "Jobs with exactly this label."),
        ("tag" = Option<String>, Query, description = "Jobs that carry this tag."),
        ("key" = Option<super::openapi::KeyText>, Query, description = "Jobs for the result with this key."),
        ("owner" = Option<super::openapi::Owner>, Query, description = "`me`: my own jobs. \
            Where keys are asked for, only administrators see those of others."),
    ),
    responses(
        (status = 200, description = "They are canceled, or will be as soon as their workers let \
            go.", body = CanceledJobs),
    ),
)]
pub async fn cancel_all(
    State(app): State<App>,
    caller: Caller,
    mut query: Query,
) -> Result<axum::Json<CanceledJobs>, Problem> {
    let filter = read_filter(&mut query, &caller);
    query.finish()?;
    if filter == Filter::default() {
        let detail =
            "one of state, label, tag, key and owner must be given: this cancels many jobs";
        return Err(Problem::parameters(vec![Complaint::parameter("state", detail)]));
    }
    let canceled = app.store.cancel_all(&within(filter, &caller)).await?;
    Ok(axum::Json(CanceledJobs { canceled }))
}

/// Deletes a job that has ended.
///
/// Its result stays, for it belongs to everyone.
#[utoipa::path(delete, path = "/v1/jobs/{id}", operation_id = "delete_job", tag = "jobs",
    params(("id" = uuid::Uuid, Path, description = "The `id` of a job.")),
    responses(
        (status = 204, description = "The job is gone."),
        (status = 409, description = "The job has not ended; cancel it first."),
    ),
)]
pub async fn delete(
    State(app): State<App>,
    caller: Caller,
    Segment(id): Segment,
    _: NoQuery,
) -> Result<StatusCode, Problem> {
    let job = visible(&app, &caller, &id).await?;
    match app.store.delete(job.id).await? {
        Deleted::Done => Ok(StatusCode::NO_CONTENT),
        Deleted::NotFound => Err(unknown()),
        Deleted::Unfinished(state) => {
            let detail = format!("The job is {state}; cancel it first, POST /v1/jobs/{id}/cancel.");
            Err(Problem::new(&problem::STILL_GOING, detail))
        }
    }
}
