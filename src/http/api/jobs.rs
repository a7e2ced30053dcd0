//! Jobs: show, rename, cancel, delete. `submission` submits them, and `list` lists them.

mod answer;
mod list;
mod submission;

use std::sync::Arc;

use axum::Json;
use axum::body::Bytes;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::value::RawValue;
use serde_json::{Map, Value};
use utoipa::ToSchema;

use super::evaluate::fresh;
use super::scenarios::parse;
use crate::http::api::documents;
use crate::http::api::parameters::OfJobs;
use crate::http::wire::include::Include;
use crate::http::{
    App, Body, Caller, Complaint, NoQuery, Problem, Query, Result, Segment, blocking, kinds,
    schemas,
};
use fretwork_engine::{History, ResultUnits};
use fretwork_job::{Job, JobId, JobState, Naming, Prepared, Task};
use fretwork_store::{Canceled, Deleted, Filter, Reach, Role, Seen};
use fretwork_study::Rows;

use answer::answer;
use list::read_filter;

pub use answer::{JobAnswer, unverified};
pub use list::{__path_list, list};
pub use submission::{__path_submit, submit};

pub(super) fn read_id(text: &str) -> Result<JobId> {
    text.parse().map_err(|_| {
        let detail = "No job has this id. An id is a UUID in lower case, as in the `id` of a job.";
        Problem::new(&kinds::NOT_FOUND, detail)
    })
}

/// The job with this id, if the caller may see it. Otherwise it is reported as unknown, so that a caller cannot find out
/// whether it exists.
pub(super) async fn visible(app: &App, caller: &Caller, id: &str) -> Result<Job> {
    let job = app.store.job(read_id(id)?).await?;
    job.filter(|job| caller.reach().sees(&job.owner, job.private)).ok_or_else(unknown)
}

/// The job with this id, if the caller may change it. An open change may be made by every caller who sees the job.
async fn changeable(app: &App, caller: &Caller, id: &str, is_open: bool) -> Result<JobId> {
    let job = visible(app, caller, id).await?;
    if is_open || caller.reach().may_change(&job.owner) {
        return Ok(job.id);
    }
    Err(Problem::other_owner("job", Some(job.owner)))
}

pub(super) fn unknown() -> Problem {
    Problem::new(&kinds::NOT_FOUND, "No job has this id. GET /v1/jobs lists all jobs.")
}

/// Shows a job.
///
/// With `wait` the server answers when the job is finished, which takes fewer requests than polling. `state`
/// says whether the job succeeded.
#[utoipa::path(get, path = "/v1/jobs/{id}", operation_id = "get_job", tag = "jobs",
    params(
        ("id" = uuid::Uuid, Path, description = "The `id` of a job."),
        ("wait" = Option<f64>, Query, description = "Waits until the job is finished, at most \
            this number of seconds.", minimum = 0, maximum = 60, example = 10),
        ("include" = Option<schemas::Include>, Query, style = Form, explode = false,
            description = "Adds to the job, separated by commas: the `result`, if the job is \
                finished; the canonical `scenario`; the scenario as `submitted` by the client (null above \
                64 kB).",
            example = json!(["result", "scenario"])),
    ),
    responses(
        (status = 200, description = "The job.", body = JobAnswer),
    ),
)]
pub async fn show(app: App, caller: Caller, id: Segment, mut query: Query) -> Result<Response> {
    let time = query.wait();
    let include = Include::take(&mut query);
    query.finish()?;
    let mut job = visible(&app, &caller, &id).await?;
    if let Some(time) = time {
        app.service.wait(job, time).await?;
        // Its owner may have hidden the job meanwhile.
        job = visible(&app, &caller, &id).await?;
    }
    answer(&app, &caller, job, include).await
}

/// Redirects to the result of a job.
///
/// Clients that follow the redirection receive the result.
#[utoipa::path(get, path = "/v1/jobs/{id}/result", operation_id = "get_job_result", tag = "jobs",
    params(("id" = uuid::Uuid, Path, description = "The `id` of a job.")),
    responses(
        (status = 200, description = "The result, for clients that follow the redirection \
            automatically.", content(
            (ref("#/components/schemas/Result") = "application/json"),
            (schemas::File = "application/x-npz"),
        )),
        (status = 303, description = "The result is at the address in `Location`.",
            headers(("Location" = String, description = "The address of the result."))),
        (status = 409, description = "The job is not finished (with `Retry-After`), has failed, \
            or was canceled.", headers(("Retry-After" = u32, description = "Seconds."))),
    ),
)]
pub async fn result(app: App, caller: Caller, id: Segment, _: NoQuery) -> Result<Response> {
    let job = visible(&app, &caller, &id).await?;
    let problem = match job.state {
        JobState::Succeeded => {
            let location = format!("/v1/results/{}", job.key);
            return Ok((StatusCode::SEE_OTHER, [(header::LOCATION, location)]).into_response());
        }
        JobState::Queued | JobState::Running | JobState::Canceling => {
            let Job { id, state, .. } = job;
            let detail = format!(
                "The job is {state}. Try again in a second, or wait: GET /v1/jobs/{id}?wait=10."
            );
            Problem::new(&kinds::NOT_FINISHED, detail).retry_after(1)
        }
        JobState::Failed => {
            let cause = job.failure.map_or_else(String::new, |failure| failure.message);
            let detail =
                format!("The job failed: {cause}. To compute it again, submit the scenario again.");
            Problem::new(&kinds::JOB_FAILED, detail)
        }
        JobState::Canceled => {
            let detail = "The job was canceled. To get the result, submit the scenario again.";
            Problem::new(&kinds::JOB_CANCELED, detail)
        }
    };
    Err(problem)
}

/// What a job has computed so far.
#[derive(Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum SoFar {
    /// Of a run.
    Run(RunSoFar),
    /// Of a study.
    Study(StudySoFar),
}

/// The rows of a run that is being computed.
#[derive(Debug, Serialize, ToSchema)]
pub struct RunSoFar {
    /// The units of the columns.
    #[schema(value_type = Object)]
    units: ResultUnits,
    /// The history up to the present output cycle. While the exact method computes it, `contact_radius` and `scar_radius`
    /// have no entries: the run smooths them over time when all rows are known.
    #[schema(value_type = documents::Columns)]
    history: Arc<History>,
}

/// The rows of a study that is being computed or was canceled.
#[derive(Debug, Serialize, ToSchema)]
pub struct StudySoFar {
    /// The units of the columns.
    #[schema(value_type = Object)]
    units: Map<String, Value>,
    /// The number of points of the study, and how many of them are computed, refused and incomplete.
    #[schema(value_type = Object)]
    counts: Value,
    /// One row for each computed point. The column `point` has its number, from 0.
    #[schema(value_type = Object)]
    table: Box<RawValue>,
}

/// Returns the rows that a run or a study has computed so far.
///
/// Their digits are those of the result. Ask again after a `progress` event of the job. The rows of a run exist only while
/// the run is computed, and only on the server that computes it. A study shows its finished chunks, which can leave gaps
/// between the points. A canceled study shows them for a week, until its job is deleted. A study of less than 0.1 s has
/// no chunks.
#[utoipa::path(get, path = "/v1/jobs/{id}/so-far", operation_id = "get_job_so_far", tag = "jobs",
    params(("id" = uuid::Uuid, Path, description = "The `id` of a job.")),
    responses(
        (status = 200, description = "The rows so far.", body = SoFar),
        (status = 204, description = "No rows: the job is queued, finished or a short study, or another server computes it."),
    ),
)]
pub async fn so_far(app: App, caller: Caller, id: Segment, _: NoQuery) -> Result<Response> {
    /// Maximum bytes of a number in JSON, with its comma.
    const NUMBER: usize = 24;
    let job = visible(&app, &caller, &id).await?;
    let Some(history) = app.service.so_far(&job.key).await else {
        return study_so_far(&app, &caller, job.id).await;
    };
    let bytes = 4096 + NUMBER * History::MEMBERS.len() * history.cycles.len();
    let permit = app.shares.answers(bytes).hold(&caller.owner, bytes).await?;
    fresh(permit, bytes, SoFar::Run(RunSoFar { units: ResultUnits, history })).await
}

/// The rows that a study has computed so far.
async fn study_so_far(app: &App, caller: &Caller, id: JobId) -> Result<Response> {
    let _turn = app.shares.heavy.turn(&caller.owner).await;
    let Some(stored) = app.store.unfinished_study(id).await? else {
        return Ok(StatusCode::NO_CONTENT.into_response());
    };
    let (key, task) = (stored.key, stored.task.clone());
    let prepared = blocking(move || Prepared::from_stored(&key, &task)).await?;
    // The version of the program that stored the task may have had other tasks.
    let Ok(Prepared { task: Task::Study(study), .. }) = prepared else {
        return Ok(StatusCode::NO_CONTENT.into_response());
    };
    let share = f64::from(stored.done) / f64::from(stored.chunks);
    let bytes = 4096 + (study.bytes() as f64 * share) as usize;
    // The chunks and the table are in memory at the same time.
    let permit = app.shares.answers(2 * bytes).hold(&caller.owner, 2 * bytes).await?;
    let chunks = app.store.chunks_so_far(id, &stored).await?;
    let made = blocking(move || {
        let rows =
            |(number, bytes): (u32, Bytes)| Some((number as usize, Rows::from_bytes(&bytes)?));
        // A chunk of another version has another form.
        let chunks: Vec<_> = chunks.into_iter().filter_map(rows).collect();
        let (table, counts) = study.table_so_far(chunks, stored.chunks as usize);
        let table = RawValue::from_string(table).map_err(Problem::bug)?;
        Ok::<_, Problem>(SoFar::Study(StudySoFar { units: study.units(), counts, table }))
    });
    fresh(permit, bytes, made.await??).await
}

/// Changes the label, the tags and the privacy of a job.
///
/// What the body does not name stays. A label of null removes the label. Whoever sees a job may change its tags. Only its owner
/// and administrators change the rest.
#[utoipa::path(patch, path = "/v1/jobs/{id}", operation_id = "rename_job", tag = "jobs",
    params(("id" = uuid::Uuid, Path, description = "The `id` of a job.")),
    request_body(content = documents::Naming, description = "What changes.",
        example = json!({"label": "Rig 7, third sample", "tags": ["rig-7"]})),
    responses(
        (status = 200, description = "The job after the change.", body = JobAnswer),
    ),
)]
pub async fn rename(
    app: App,
    caller: Caller,
    id: Segment,
    _: NoQuery,
    body: Body,
) -> Result<Response> {
    let naming = parse(body, Naming::parse).await?;
    let is_open = naming.label.is_none() && naming.private.is_none();
    let id = changeable(&app, &caller, &id, is_open).await?;
    let job = app.store.rename(id, naming, caller.actor()).await?.ok_or_else(unknown)?;
    answer(&app, &caller, job, Include::default()).await
}

/// Cancels a job.
///
/// The run stops when no other job shares it. A finished job does not change, and `state` of the answer shows
/// this. The canceled job can still be read.
#[utoipa::path(post, path = "/v1/jobs/{id}/cancel", operation_id = "cancel_job", tag = "jobs",
    params(("id" = uuid::Uuid, Path, description = "The `id` of a job.")),
    responses(
        (status = 200, description = "The job after the request.", body = JobAnswer),
    ),
)]
pub async fn cancel(app: App, caller: Caller, id: Segment, _: NoQuery) -> Result<Response> {
    let id = changeable(&app, &caller, &id, false).await?;
    match app.store.cancel(id, caller.actor()).await? {
        Canceled::NotFound => Err(unknown()),
        Canceled::AlreadyFinished(job) | Canceled::Done(job) => {
            answer(&app, &caller, job, Include::default()).await
        }
    }
}

/// The number of canceled jobs.
#[derive(Debug, Serialize, ToSchema)]
pub struct CanceledJobs {
    /// The number of jobs.
    #[schema(example = 12)]
    canceled: u64,
}

/// Cancels all jobs that match.
///
/// At least one filter is required, and a job must match all of them. Finished jobs do not change, nor do jobs
/// that are submitted during the request. A run stops when no other job shares it.
#[utoipa::path(post, path = "/v1/jobs/cancel", operation_id = "cancel_jobs", tag = "jobs",
    params(OfJobs),
    responses(
        (status = 200, description = "The jobs are canceled, or will be when their workers \
            stop.", body = CanceledJobs),
    ),
)]
pub async fn cancel_all(app: App, caller: Caller, mut query: Query) -> Result<Json<CanceledJobs>> {
    let filter = read_filter(&mut query, &caller);
    query.finish()?;
    if filter == Filter::default() {
        let detail = "is required, or `label`, `tag`, `key` or `owner`: without them, all jobs would be canceled";
        return Err(Problem::parameters(vec![Complaint::parameter("state", detail)]));
    }
    // Others see shared jobs, but cancel none.
    let jobs = if caller.role == Role::Admin { Seen::All } else { Seen::Own };
    let filter = Filter { reach: Reach { jobs, ..caller.reach() }, ..filter };
    let canceled = app.store.cancel_all(&filter, &caller.actor()).await?;
    Ok(Json(CanceledJobs { canceled }))
}

/// Deletes a finished job.
///
/// Its result stays, because other jobs may share it.
#[utoipa::path(delete, path = "/v1/jobs/{id}", operation_id = "delete_job", tag = "jobs",
    params(("id" = uuid::Uuid, Path, description = "The `id` of a job.")),
    responses(
        (status = 204, description = "The job is deleted."),
        (status = 409, description = "The job is not finished. Cancel it first."),
    ),
)]
pub async fn delete(app: App, caller: Caller, id: Segment, _: NoQuery) -> Result<StatusCode> {
    let id = changeable(&app, &caller, &id, false).await?;
    match app.store.delete(id, caller.actor()).await? {
        Deleted::Done => Ok(StatusCode::NO_CONTENT),
        Deleted::NotFound => Err(unknown()),
        Deleted::Unfinished(state) => {
            let detail = format!("The job is {state}. Cancel it first: POST /v1/jobs/{id}/cancel.");
            Err(Problem::new(&kinds::STILL_GOING, detail))
        }
    }
}
