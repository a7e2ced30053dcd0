//! How a job is told, with its scenario and its result inside or without.

use std::convert::Infallible;
use std::mem;

use axum::body::{Body, Bytes};
use axum::http::header;
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use crate::http::app::App;
use crate::http::include::{Include, NULL};
use crate::http::problem::{self, Problem};
use crate::http::representation;
use crate::http::wire::instant;
use crate::job::{Failure, Job, JobId, JobState, Key, Origin};
use crate::store::{self, Asked, StoredResult};

/// One submission and how far it has come.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Job)]
pub struct JobAnswer {
    /// Names the job: a UUID of version 7, so ids sort by time of submission.
    #[schema(value_type = String, format = "uuid", example = "019aa0f3-1f4e-7cc0-9d8b-1c5b0c1f9a11")]
    id: JobId,
    /// `queued`, `running`, `canceling`, `succeeded`, `failed` or `canceled`.
    #[schema(value_type = crate::http::schemas::JobState)]
    state: JobState,
    /// Whose it is: the name of the key that submitted it, or the address of the client where there were
    /// no keys. Only administrators see the jobs of others.
    #[schema(example = "anna")]
    owner: String,
    /// The address of the result: the same for every submission of the same scenario.
    #[schema(value_type = String, pattern = "^[0-9a-f]{64}$")]
    key: Key,
    /// Whether this job started the computation (`computed`), joined one (`coalesced`) or found
    /// the result ready (`cached`).
    #[schema(value_type = crate::http::schemas::Origin)]
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
    #[schema(value_type = Vec<crate::http::schemas::Warning>)]
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

impl From<Job> for JobAnswer {
    fn from(job: Job) -> Self {
        let this = address(job.id);
        let cancel = (!job.state.is_finished()).then(|| format!("{this}/cancel"));
        let result = format!("/v1/results/{}", job.key);
        let events = format!("{this}/events");
        Self {
            id: job.id,
            state: job.state,
            owner: job.owner,
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

pub(super) fn address(id: JobId) -> String {
    format!("/v1/jobs/{id}")
}

/// Answers a job as it is always answered, with the members that are to be included.
pub(super) async fn answer(app: &App, job: Job, include: Include) -> Result<Response, Problem> {
    let asked = if include.scenario || include.submitted {
        app.service.asked(job.id).await?
    } else {
        Asked::default()
    };
    let result = if include.result { Some(result_of(app, &job).await?) } else { None };
    write(job, include.members(&asked, result))
}

/// The result of a job; null if there is none.
pub(super) async fn result_of(app: &App, job: &Job) -> Result<Bytes, Problem> {
    if job.state != JobState::Succeeded {
        return Ok(NULL);
    }
    Ok(match app.service.small_result(&job.key).await? {
        Some(StoredResult::Whole(body)) => body,
        Some(StoredResult::Large) => representation::large(app, None, &job.key).await?.body,
        _ => NULL,
    })
}

/// Writes a job, with more members behind its own: their names and their JSON.
pub(super) fn write(job: Job, members: Vec<(&str, Bytes)>) -> Result<Response, Problem> {
    let (key, id) = (job.key, job.id);
    let mut told = serde_json::to_vec(&JobAnswer::from(job)).map_err(|_| Problem::internal())?;
    let mut pieces = Vec::new();
    for (name, text) in members {
        // The stored bytes go in as they are: parsing and printing them again would cost more
        // than everything else here and could change digits.
        told.pop();
        told.extend_from_slice(format!(",\"{name}\":").as_bytes());
        if text.len() > store::LARGE {
            // Other answers may share these bytes.
            pieces.extend([mem::take(&mut told).into(), text]);
        } else {
            told.extend_from_slice(&text);
        }
        told.push(b'}');
    }
    let headers = [
        (header::CONTENT_TYPE, "application/json".to_owned()),
        // A job changes; what does not is its result, at an address of its own.
        (header::CACHE_CONTROL, "no-store".to_owned()),
        (header::CONTENT_LOCATION, address(id)),
        (header::LINK, format!("</v1/results/{key}>; rel=\"related\"")),
    ];
    if pieces.is_empty() {
        return Ok((headers, told).into_response());
    }
    pieces.push(told.into());
    let length = pieces.iter().map(Bytes::len).sum::<usize>().to_string();
    let pieces = stream::iter(pieces.into_iter().map(Ok::<_, Infallible>));
    let length = [(header::CONTENT_LENGTH, length)];
    Ok((headers, length, Body::from_stream(pieces)).into_response())
}
