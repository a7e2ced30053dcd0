//! A submission: what is read from it, and what becomes of it.

use std::time::Duration;

use axum::extract::State;
use axum::http::header::{self, HeaderName};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::Response;

use super::answer::{JobAnswer, address, result_of, write};
use crate::http::app::App;
use crate::http::caller::Caller;
use crate::http::include::{Include, NULL};
use crate::http::problem::{self, Problem};
use crate::http::scenarios::parse;
use crate::http::wire::{Body, Freshness, Prefer, Query, idempotency_key, urgency};
use crate::job::{Job, JobState, Origin};
use crate::service::{Accepted, Refusal, Terms};
use crate::store::Asked;

/// Submits a scenario: computes it, joins the computation under way, or finds its result.
///
/// Every submission is a job of its own and is kept. The same scenario is computed once, however
/// many submit it, and whatever units they write it in. With `Prefer: wait=10` the answer waits
/// up to 10 s for the end; with `include=result` it then holds the result itself. A submission that
/// may have been lost can be repeated under the same `Idempotency-Key`: it stays one job.
#[utoipa::path(post, path = "/v1/jobs", operation_id = "submit_job", tag = "jobs",
    params(
        ("include" = Option<crate::http::schemas::Include>, Query, style = Form, explode = false,
            description = "What to put into the answer beside the job, separated by commas: `result`, \
                if it is finished, the canonical `scenario`, and the scenario as `submitted`.",
            example = json!(["result"])),
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
    let include = Include::take(&mut query);
    query.finish()?;
    let (prefer, freshness) = (Prefer::read(&headers), Freshness::read(&headers));
    let terms = Terms {
        owner: caller.owner,
        priority: urgency(&headers),
        idempotency_key: idempotency_key(&headers)?,
        afresh: freshness.afresh,
        only_known: freshness.only_known,
        wait: prefer.wait,
        trace: caller.trace.map(|trace| trace.to_string()),
    };
    if app.service.is_draining() {
        return Err(Refusal::Draining.into());
    }
    let submission = parse(body).await?;
    let asked = Asked {
        task: include.scenario.then(|| submission.prepared.stored.to_string()),
        submitted: submission.submitted.clone().filter(|_| include.submitted),
    };
    let Accepted { job, answer } = app.service.submit(submission, terms).await?;
    let result = match answer {
        _ if !include.result => None,
        Some(answer) if job.state == JobState::Succeeded => Some(answer.body),
        // The job is accepted: an answer without the result is better than an error.
        _ => Some(result_of(&app, &job).await.unwrap_or(NULL)),
    };
    let finished = job.state.is_finished();
    let (location, cache) = (address(job.id), cache_status(&job, freshness.afresh));
    let mut response = write(job, include.members(&asked, result))?;
    let headers = response.headers_mut();
    headers.insert(header::CACHE_STATUS, HeaderValue::from_static(cache));
    if let Some(time) = prefer.wait {
        let name = HeaderName::from_static("preference-applied");
        headers.insert(name, header_value(format!("wait={}", time.as_secs())));
    }
    if !finished {
        headers.insert(header::LOCATION, header_value(location));
        *response.status_mut() = StatusCode::ACCEPTED;
    }
    Ok(response)
}

#[expect(clippy::expect_used, reason = "paths and numbers are always valid in a header")]
fn header_value(text: String) -> HeaderValue {
    HeaderValue::try_from(text).expect("a path or a number")
}

impl From<Refusal> for Problem {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::Draining => {
                let detail = "The server is shutting down and takes no new jobs; submit again in a \
                    moment.";
                Self::new(&problem::DRAINING, detail).retry_after(5)
            }
            Refusal::IdempotencyConflict => {
                let detail =
                    "This Idempotency-Key was used for another submission; make a new one.";
                Self::new(&problem::KEY_REUSED, detail)
            }
            Refusal::NotCached => {
                let detail =
                    "The result is not known; submit without only-if-cached to compute it.";
                Self::new(&problem::NOT_CACHED, detail)
            }
            Refusal::TooExpensive { estimate, limit } => {
                let whole = |time: Duration| {
                    humantime::format_duration(Duration::from_secs(time.as_secs()))
                };
                let detail = format!(
                    "The run would take about {}, and this server lets a run take {}; ask for fewer \
                     points, output cycles or rows, or for a larger tolerance.",
                    whole(estimate),
                    humantime::format_duration(limit),
                );
                Self::new(&problem::TOO_EXPENSIVE, detail)
            }
            Refusal::QueueFull { queued, retry_after } => {
                let detail = format!("{queued} jobs wait already; submit again in a moment.");
                Self::new(&problem::QUEUE_FULL, detail).retry_after(retry_after.as_secs() as u32)
            }
            Refusal::Store(error) => error.into(),
        }
    }
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
