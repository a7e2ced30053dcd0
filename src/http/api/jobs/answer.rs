//! A job as JSON, with or without its scenario and its result.

use axum::Extension;
use axum::body::{Body, Bytes};
use axum::http::header;
use axum::response::{IntoResponse, Response};
use futures_util::stream::{self, StreamExt as _};
use serde::Serialize;
use serde_json::{Value, json};
use utoipa::ToSchema;

use crate::http::answer::representation::Representation;
use crate::http::answer::text::Text;
use crate::http::api::documents;
use crate::http::wire::coding::Coding;
use crate::http::wire::include::{Include, JobMembers, NULL};
use crate::http::{App, Caller, Problem, Result, instant, kinds, schemas};
use fretwork_format::{Format, Part, View};
use fretwork_job::{Failure, Job, JobId, JobState, Key, Origin, Recomputed, Verified};
use fretwork_store::{self as store, Asked};

/// A job: one submission and its progress.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Job)]
pub struct JobAnswer {
    /// Its id: a UUID of version 7, so that ids sort by time of submission.
    #[schema(value_type = String, format = "uuid", example = "019aa0f3-1f4e-7cc0-9d8b-1c5b0c1f9a11")]
    id: JobId,
    /// `queued`, `running`, `canceling`, `succeeded`, `failed` or `canceled`.
    #[schema(value_type = schemas::JobState)]
    state: JobState,
    /// Its owner: the name of the key that submitted it, or the address of the client on a server without keys.
    #[schema(example = "anna")]
    owner: String,
    /// The key of the result, which is the same for every submission of the same scenario.
    #[schema(value_type = String, pattern = "^[0-9a-f]{64}$")]
    key: Key,
    /// Whether the result was computed for this job (`computed`), for another job at the same time (`coalesced`), or
    /// before (`cached`).
    #[schema(value_type = schemas::Origin)]
    origin: Origin,
    /// How often its computation was started. It is more than 1 if the server was interrupted.
    #[schema(example = 1)]
    attempt: u32,
    /// The part of the run that is done, 0 to 1.
    #[schema(minimum = 0, maximum = 1, example = 1.0)]
    progress: f64,
    /// The urgency among the jobs of the same owner, from the `Priority` header: 0 is the most urgent, 7 the
    /// least.
    #[schema(minimum = 0, maximum = 7, example = 3)]
    priority: u8,
    /// When it was submitted, started and finished.
    times: Times,
    /// A description for people, as submitted.
    label: Option<String>,
    /// Words for filters, as submitted.
    tags: Vec<String>,
    /// Whether only the owner and administrators see the job, with its label and tags.
    private: bool,
    /// The last entry of the history, and the regime of the unworn contact; null until the job has succeeded.
    #[schema(value_type = Option<Object>)]
    summary: Option<Value>,
    /// How the result of its run compares with the one that the server had before: `same`; `differs` (the stored result
    /// stays, and `warnings` say what to do); `replaced` (the earlier one was evicted or deleted, and the new one is
    /// stored). Null if the server had none, or if this job has no run.
    #[schema(value_type = Option<schemas::Recomputed>)]
    recomputed: Option<Recomputed>,
    /// Warnings about the validity of the model, about a result that differs from an earlier one, and about one that an
    /// import brought and did not verify: a list of `{kind, detail}`.
    #[schema(value_type = Vec<documents::Warning>)]
    warnings: Value,
    /// Why it failed; null unless it did.
    error: Option<JobError>,
    /// The addresses of the job, its result and its events.
    links: Links,
}

/// When a job was submitted, begun and finished: RFC 3339, UTC.
#[derive(Debug, Serialize, ToSchema)]
struct Times {
    /// When it was submitted.
    #[schema(format = "date-time", example = "2026-01-31T12:00:00.000Z")]
    created: String,
    /// When its computation began.
    #[schema(format = "date-time")]
    started: Option<String>,
    /// When it was finished.
    #[schema(format = "date-time")]
    finished: Option<String>,
}

/// Why a job failed.
#[derive(Debug, Serialize, ToSchema)]
struct JobError {
    /// The problem type: the address of a page that explains it.
    #[schema(example = "/problems/worker-lost")]
    r#type: String,
    /// The title of the problem type.
    title: String,
    /// What happened.
    detail: String,
}

/// Addresses related to a job.
#[derive(Debug, Serialize, ToSchema)]
struct Links {
    /// The job itself.
    #[serde(rename = "self")]
    this: String,
    /// Its result, after it has succeeded.
    result: String,
    /// Server-sent events with its progress.
    events: String,
    /// POST to this address to cancel it; null after it is finished.
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
            private: job.private,
            summary: job.summary,
            recomputed: job.recomputed,
            warnings: warnings(job.warnings, &job.key, job.recomputed, job.verified),
            error: job.failure.map(JobError::from),
            links: Links { this, result, events, cancel },
        }
    }
}

/// The warnings of a job, with those about the trust in its result.
fn warnings(
    mut warnings: Value,
    key: &Key,
    recomputed: Option<Recomputed>,
    verified: Option<Verified>,
) -> Value {
    let differs = match recomputed {
        None | Some(Recomputed::Same) => None,
        Some(Recomputed::Differs) => Some(format!(
            "The server has computed the result again, and the stored result differs. One of them is wrong. The stored \
             one stays. To replace it, an administrator deletes it (DELETE /v1/results/{key}) and submits its scenario \
             again."
        )),
        Some(Recomputed::Replaced) => Some(
            "The result differs from the one that was stored before and has been evicted or \
            deleted. One of them is wrong. The new one is stored."
                .to_owned(),
        ),
    };
    let differs = differs.map(|detail| json!({"kind": "recompute_differs", "detail": detail}));
    if let Value::Array(list) = &mut warnings {
        list.extend(differs.into_iter().chain(unverified(verified)));
    }
    warnings
}

/// A warning about a result that an import has brought and not computed again, or not all of it.
pub fn unverified(verified: Option<Verified>) -> Option<Value> {
    let checked = match verified? {
        Verified::All => return None,
        Verified::Rows(rows) => format!("has computed only {rows} of its rows again"),
        Verified::No => "has not computed it again".to_owned(),
    };
    let detail = format!(
        "The result was imported from a file, and this server {checked}. Trust it as much as you trust the file. To verify \
         it, submit its scenario with `Cache-Control: no-cache`."
    );
    Some(json!({"kind": "unverified", "detail": detail}))
}

impl From<Failure> for JobError {
    fn from(failure: Failure) -> Self {
        let slug = failure.kind.as_str();
        let title = kinds::ALL.iter().find(|kind| kind.slug == slug).map(|kind| kind.texts()[0]);
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

/// Answers a job, with the members that `include` names.
pub(super) async fn answer(
    app: &App,
    caller: &Caller,
    job: Job,
    include: Include,
) -> Result<Response> {
    let mut asked = if include.scenario || include.submitted {
        app.store.asked(job.id).await?
    } else {
        Asked::default()
    };
    asked.submitted = asked.submitted.filter(|_| caller.reach().may_change(&job.owner));
    let result = if include.result { Some(result_of(app, caller, &job).await?) } else { None };
    write(job, include.members(&asked), result)
}

/// The JSON of the result of a job; null if it has none.
pub(super) async fn result_of(app: &App, caller: &Caller, job: &Job) -> Result<Text> {
    if job.state == JobState::Succeeded {
        let result =
            Representation::new(caller, job.key, Part::Whole, Format::Json, View::default());
        let text = result.text(app, Coding::Identity).await;
        // The result may have been evicted.
        if text.is_ok() || app.store.has_result(&job.key).await? {
            return text;
        }
    }
    Ok(Text::of(NULL))
}

/// Writes a job, followed by more members, with their names and their JSON, and by its result.
pub(super) fn write(job: Job, members: JobMembers, result: Option<Text>) -> Result<Response> {
    let (key, id) = (job.key, job.id);
    let mut told = serde_json::to_vec(&JobAnswer::from(job)).map_err(Problem::bug)?;
    for (name, text) in members {
        // The stored bytes are copied: to parse and print them again would cost more than everything else
        // here, and could change digits.
        told.pop();
        told.extend_from_slice(format!(",\"{name}\":").as_bytes());
        told.extend_from_slice(&text);
        told.push(b'}');
    }
    let headers = [
        (header::CONTENT_TYPE, "application/json".to_owned()),
        // A job changes, so no cache may keep it.
        (header::CACHE_CONTROL, "no-store".to_owned()),
        (header::CONTENT_LOCATION, address(id)),
        (header::LINK, format!("</v1/results/{key}>; rel=\"related\"")),
    ];
    let Some(result) = result else { return Ok((headers, told).into_response()) };
    told.pop();
    told.extend_from_slice(b",\"result\":");
    if let Some(bytes) = result.bytes().filter(|bytes| bytes.len() <= store::LARGE) {
        told.extend_from_slice(bytes);
        told.push(b'}');
        return Ok((headers, told).into_response());
    }
    let length = told.len() + result.length() + 1;
    let length = [(header::CONTENT_LENGTH, length.to_string())];
    let permit = result.permit.clone().map(Extension);
    let pieces = |bytes: Bytes| stream::iter([Ok(bytes)]);
    let body = pieces(told.into()).chain(result.pieces()).chain(pieces(Bytes::from_static(b"}")));
    Ok((headers, length, permit, Body::from_stream(body)).into_response())
}
