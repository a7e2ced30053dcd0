//! Submits a job.

use std::time::Duration;

use axum::http::header::{self, HeaderName};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse as _, Response};

use super::answer::{JobAnswer, address, result_of, write};
use crate::http::answer::text::Text;
use crate::http::api::documents;
use crate::http::api::scenarios::parse;
use crate::http::wire::include::{Include, JobMembers, NULL};
use crate::http::wire::{REPLAYED, idempotency_key, says, urgency, wait};
use crate::http::{App, Body, Caller, Problem, Query, Result, kinds, schemas};
use crate::service::{Accepted, Refusal, Terms};
use fretwork_job::{Job, JobState, Origin, Submission};
use fretwork_store::Asked;

/// Submits a scenario: computes it, joins the run of another job, or finds the stored result.
///
/// Every submission is a job, and is kept. Equal scenarios are computed once, even if they are written in
/// different units. With `Prefer: wait=10` the server answers when the job is finished, at most 10 s later.
/// `include=result` then adds the result. After a lost connection a client can repeat its submission with
/// the same `Idempotency-Key`: it stays one job.
#[utoipa::path(post, path = "/v1/jobs", operation_id = "submit_job", tag = "jobs",
    params(
        ("include" = Option<schemas::Include>, Query, style = Form, explode = false,
            description = "Adds to the job, separated by commas: the `result`, if the job is \
                finished; the canonical `scenario`; the scenario as `submitted`.",
            example = json!(["result"])),
        ("Prefer" = Option<String>, Header,
            description = "`wait=N`: the server answers when the job is finished, or after N seconds \
                (at most 60).", example = "wait=10"),
        ("Idempotency-Key" = Option<String>, Header,
            description = "A name for this submission, for example a random UUID. A repeated \
                submission with the same name and body is the same job, as long as the job is kept. Its answer has \
                `Idempotency-Replayed: true`."),
        ("Priority" = Option<String>, Header,
            description = "`u=0` (most urgent) to `u=7` (least urgent), RFC 9218: the order of the \
                caller's own jobs. It does not affect the jobs of other callers, which take turns.", example = "u=3"),
        ("Cache-Control" = Option<String>, Header,
            description = "`no-cache`: computes again, and compares with the stored result. \
                `only-if-cached`: does not compute; 504 if the result is not known."),
        ("traceparent" = Option<String>, Header,
            description = "W3C Trace Context. The log of the request and of the run contains it."),
    ),
    request_body(content = documents::JobBody, description = "The job. A \
        physical quantity is a number in SI units or a string with a unit."),
    responses(
        (status = 200, description = "The job is finished: it succeeded, failed or was canceled.",
            body = JobAnswer, headers(
                ("Cache-Status" = String, description = "RFC 9211: `fretwork; hit`, or `fretwork; \
                    fwd=miss` with `stored` or `collapsed`; `fwd=request` after `no-cache`."),
                ("Content-Location" = String, description = "The address of the job."),
                ("Link" = String, description = "The address of the result, `rel=\"related\"`."),
                ("Preference-Applied" = String, description = "The longest wait, as granted."),
            )),
        (status = 202, description = "The job is accepted. Its address is in `Location`.",
            body = JobAnswer, headers(
                ("Location" = String, description = "The address of the job."),
                ("Cache-Status" = String, description = "RFC 9211: `fretwork; fwd=miss`, with \
                    `collapsed` if it joined the run of another job."),
                ("Link" = String, description = "The address of the result, `rel=\"related\"`."),
                ("Preference-Applied" = String, description = "The longest wait, as granted."),
            )),
        (status = 422, description = "The body or a header has faults, which `errors` lists; or the run \
            would take longer than the server allows; or the Idempotency-Key belongs to another \
            submission."),
        (status = 503, description = "The server is shutting down, or its queue is full; see \
            `Retry-After`.", headers(("Retry-After" = u32, description = "Seconds."))),
        (status = 504, description = "With `only-if-cached`: the result is not known."),
    ),
)]
pub async fn submit(
    app: App,
    caller: Caller,
    mut query: Query,
    headers: HeaderMap,
    body: Body,
) -> Result<Response> {
    let include = Include::take(&mut query);
    query.finish()?;
    let reader = caller.clone();
    let terms = terms(caller, &headers)?;
    let (wait, afresh) = (terms.wait, terms.afresh);
    let submission = parse(body, Submission::parse).await?;
    let mut asked = Asked {
        task: include.scenario.then(|| submission.prepared.stored.to_string()),
        submitted: submission.submitted.clone().filter(|_| include.submitted),
    };
    let Accepted { job, answer, repeated } = app.service.submit(submission, terms).await?;
    if repeated && include.submitted {
        asked = app.store.asked(job.id).await?;
    }
    let result = match answer {
        _ if !include.result => None,
        Some(answer) if job.state == JobState::Succeeded => Some(Text::of(answer.body)),
        // The job is accepted, so the client must get it even if its result cannot be read.
        _ => Some(result_of(&app, &reader, &job).await.unwrap_or_else(|problem| {
            if let Some(error) = problem.cause() {
                let request = reader.trace.as_ref().map(|trace| &*trace.id);
                tracing::error!(request, job = %job.id, error, "cannot read the result");
            }
            Text::of(NULL)
        })),
    };
    let answer = accepted(job, include.members(&asked), result, wait, afresh)?;
    Ok((repeated.then_some([(REPLAYED, "true")]), answer).into_response())
}

/// The terms of a submission, from its headers.
fn terms(caller: Caller, headers: &HeaderMap) -> Result<Terms> {
    let only_known = says(headers, "only-if-cached");
    Ok(Terms {
        owner: caller.owner,
        private: caller.private,
        priority: urgency(headers),
        idempotency_key: idempotency_key(headers)?,
        afresh: says(headers, "no-cache") && !only_known,
        only_known,
        wait: wait(headers),
        trace: caller.trace.map(|trace| trace.to_string()),
    })
}

/// The answer to an accepted submission: 200 if its job is finished, otherwise 202.
fn accepted(
    job: Job,
    members: JobMembers,
    result: Option<Text>,
    wait: Option<Duration>,
    afresh: bool,
) -> Result<Response> {
    let cache = [(header::CACHE_STATUS, cache_status(&job, afresh))];
    let preference = HeaderName::from_static("preference-applied");
    let applied = wait.map(|time| [(preference, format!("wait={}", time.as_secs()))]);
    let (status, location) = if job.state.is_finished() {
        (StatusCode::OK, None)
    } else {
        (StatusCode::ACCEPTED, Some([(header::LOCATION, address(job.id))]))
    };
    Ok((status, cache, applied, location, write(job, members, result)?).into_response())
}

impl From<Refusal> for Problem {
    fn from(refusal: Refusal) -> Self {
        let detail = refusal.to_string();
        match refusal {
            Refusal::Draining => Self::new(&kinds::DRAINING, detail).retry_after(5),
            Refusal::IdempotencyConflict => Self::new(&kinds::KEY_REUSED, detail),
            Refusal::NotCached => Self::new(&kinds::NOT_CACHED, detail),
            Refusal::TooExpensive(_) => Self::new(&kinds::TOO_EXPENSIVE, detail),
            Refusal::QueueFull { retry_after, .. } => {
                Self::new(&kinds::QUEUE_FULL, detail).retry_after(retry_after.as_secs() as u32)
            }
            Refusal::Store(error) => error.into(),
        }
    }
}

/// How the cache handled the submission (RFC 9211).
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
