//! Jobs: submit, list, show, cancel, delete.

mod answer;
mod submission;

use axum::extract::State;
use axum::http::{StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

use super::app::App;
use super::caller::Caller;
use super::include::Include;
use super::problem::{self, Complaint, Problem};
use super::wire::{NoQuery, Query, Segment};
use crate::job::{Job, JobId, JobState};
use crate::store::{Canceled, Deleted, Filter};

use answer::answer;

pub use answer::JobAnswer;
pub use submission::{__path_submit, submit};

/// How many jobs a page has unless told.
const PAGE: u32 = 50;
/// How many jobs a page may have.
const LONGEST_PAGE: u32 = 200;

/// A page of jobs, the newest first.
#[derive(Debug, Serialize, ToSchema)]
pub struct JobList {
    /// The jobs.
    jobs: Vec<JobAnswer>,
    /// The address of the next page; null on the last.
    #[schema(example = "/v1/jobs?limit=50&cursor=019aa0f3-1f4e-7cc0-9d8b-1c5b0c1f9a11")]
    next: Option<String>,
}

pub(super) fn read_id(text: &str) -> Result<JobId, Problem> {
    text.parse().map_err(|_| {
        let detail = "No job has this id: an id is a UUID in lower case, as in the `id` of a job.";
        Problem::new(&problem::NOT_FOUND, detail)
    })
}

/// The job of this id, if it is within the caller's reach.
pub(super) async fn visible(app: &App, caller: &Caller, id: &str) -> Result<Job, Problem> {
    app.service.job(caller.reach(), read_id(id)?).await?.ok_or_else(unknown)
}

pub(super) fn unknown() -> Problem {
    Problem::new(&problem::NOT_FOUND, "No job has this id; GET /v1/jobs lists those there are.")
}

/// Lists jobs, the newest first.
///
/// All filters given must hold. The address of the next page is in `next` and in the `Link`
/// header; pages stay correct while new jobs arrive.
#[utoipa::path(get, path = "/v1/jobs", operation_id = "list_jobs", tag = "jobs",
    params(
        ("state" = Option<super::schemas::JobState>, Query, description = "Jobs in this state."),
        ("label" = Option<String>, Query, description = "Jobs with exactly this label."),
        ("tag" = Option<String>, Query, description = "Jobs that carry this tag."),
        ("key" = Option<super::schemas::KeyText>, Query, description = "Jobs for the result with this key."),
        ("owner" = Option<String>, Query, example = "me", description = "Jobs of this owner; `me`: my own. \
            Where keys are asked for, only administrators see those of others, and may name them."),
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
    let filter = read_filter(&mut query, &caller);
    let limit = query.value("limit", &format!("a number from 1 to {LONGEST_PAGE}"), |text| {
        text.parse().ok().filter(|limit| (1..=LONGEST_PAGE).contains(limit))
    });
    let cursor = query.value("cursor", "the id of a job", |text| text.parse().ok());
    query.finish()?;
    let page = app.service.jobs(caller.reach(), filter, cursor, limit.unwrap_or(PAGE)).await?;
    let next = page.next.map(|cursor| next_page(&uri, cursor));
    let link = next.as_ref().map(|next| [(header::LINK, format!("<{next}>; rel=\"next\""))]);
    let jobs = page.jobs.into_iter().map(JobAnswer::from).collect();
    Ok((link, axum::Json(JobList { jobs, next })).into_response())
}

/// Takes the parameters that select jobs.
fn read_filter(query: &mut Query, caller: &Caller) -> Filter {
    let states = JobState::ALL.map(JobState::as_str).join(", ");
    let key = "a key of 64 lower-case hexadecimal digits";
    let whose = match caller.reach() {
        Some(_) => "\"me\": only administrators see the jobs of others",
        None => "\"me\" or the name of an owner",
    };
    Filter {
        state: query.value("state", &format!("one of {states}"), |text| text.parse().ok()),
        label: query.text("label"),
        tag: query.text("tag"),
        key: query.value("key", key, |text| text.parse().ok()),
        owner: query.value("owner", whose, |text| caller.owner_named(text)),
    }
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
        ("include" = Option<super::schemas::Include>, Query, style = Form, explode = false,
            description = "What to put into the answer beside the job, separated by commas: `result`, \
                once it is finished, the canonical `scenario`, and the scenario as `submitted` by the \
                client (null if it has more than 64 kB).",
            example = json!(["result", "scenario"])),
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
    let include = Include::take(&mut query);
    query.finish()?;
    let mut job = visible(&app, &caller, &id).await?;
    if let Some(time) = time {
        job = app.service.wait(job, time).await?;
    }
    answer(&app, job, include).await
}

/// Leads to the result of a job.
///
/// A finished job answers with a redirection; clients that follow it have the result.
#[utoipa::path(get, path = "/v1/jobs/{id}/result", operation_id = "get_job_result", tag = "jobs",
    params(("id" = uuid::Uuid, Path, description = "The `id` of a job.")),
    responses(
        (status = 200, description = "What clients receive that follow the redirection by themselves: the \
            result.", content(
            (ref("#/components/schemas/Result") = "application/json"),
            (super::schemas::File = "application/x-npz"),
        )),
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
    match app.service.cancel(caller.reach(), read_id(&id)?).await? {
        Canceled::NotFound => Err(unknown()),
        Canceled::AlreadyFinished(job) | Canceled::Done(job) => {
            answer(&app, job, Include::default()).await
        }
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
        ("state" = Option<super::schemas::JobState>, Query, description = "Jobs in this state."),
        ("label" = Option<String>, Query, description = "Jobs with exactly this label."),
        ("tag" = Option<String>, Query, description = "Jobs that carry this tag."),
        ("key" = Option<super::schemas::KeyText>, Query, description = "Jobs for the result with this key."),
        ("owner" = Option<String>, Query, example = "me", description = "Jobs of this owner; `me`: my own. \
            Where keys are asked for, only administrators see those of others, and may name them."),
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
    let canceled = app.service.cancel_all(caller.reach(), filter).await?;
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
    match app.service.delete(caller.reach(), read_id(&id)?).await? {
        Deleted::Done => Ok(StatusCode::NO_CONTENT),
        Deleted::NotFound => Err(unknown()),
        Deleted::Unfinished(state) => {
            let detail = format!("The job is {state}; cancel it first, POST /v1/jobs/{id}/cancel.");
            Err(Problem::new(&problem::STILL_GOING, detail))
        }
    }
}
