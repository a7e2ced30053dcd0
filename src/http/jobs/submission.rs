//! A submission: what is read from it, and what becomes of it.

use std::time::Duration;

use axum::extract::State;
use axum::http::header::{self, HeaderName};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::Response;
use serde_json::json;
use sha2::{Digest as _, Sha256};

use super::answer::{Include, JobAnswer, NOTHING, address, result_of, scenario_in, wait, write};
use crate::http::App;
use crate::http::caller::Caller;
use crate::http::problem::{self, Problem};
use crate::http::scenarios::parse;
use crate::http::wire::{Body, Freshness, Prefer, Query, idempotency_key, urgency};
use crate::job::{Job, JobId, JobState, Origin, Submission};
use crate::store::{Admission, NewJob, Repeatable, Submitted};

/// Submits a scenario: computes it, joins the computation under way, or finds its result.
///
/// Every submission is a job of its own and is kept. The same scenario is computed once, however
/// many submit it, and whatever units they write it in. With `Prefer: wait=10` the answer waits
/// up to 10 s for the end; with `include=result` it then holds the result itself. A submission that
/// may have been lost can be repeated under the same `Idempotency-Key`: it stays one job.
#[utoipa::path(post, path = "/v1/jobs", operation_id = "submit_job", tag = "jobs",
    params(
        ("include" = Option<crate::http::openapi::Include>, Query, style = Form, explode = false,
            description = "What to put into the answer beside the job, separated by commas: `result`, \
                if it is finished, and the `scenario` as it was understood.",
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
    let mut inside = Vec::new();
    if include.scenario {
        inside.push(("scenario", scenario_in(&stored)));
    }
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
        trace: caller.trace.map(|trace| trace.to_string()),
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
    // From here on the job is accepted, and the answer must say so whatever else goes wrong (but for a
    // key that is taken back while it waits).
    if let Some(time) = prefer.wait {
        job = wait(&app, job.clone(), time).await.unwrap_or(job);
    }
    let cache = cache_status(&job, freshness.afresh);
    let finished = job.state.is_finished();
    let location = address(job.id);
    if include.result {
        let result = match computed {
            Some(computed) if job.state == JobState::Succeeded => computed.body,
            _ => result_of(&app, &job).await.unwrap_or(NOTHING),
        };
        inside.push(("result", result));
    }
    let mut response = write(job, &inside)?;
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
