//! The list of jobs: filters, CSV.

use axum::http::{HeaderMap, Uri};
use axum::response::{IntoResponse as _, Response};
use serde::Serialize;
use serde_json::json;
use utoipa::ToSchema;

use super::JobAnswer;
use crate::http::answer::listed;
use crate::http::api::parameters::{OfJobs, OfList};
use crate::http::api::results::either;
use crate::http::wire::paging::{ListView, next_page};
use crate::http::{App, Caller, Query, Result, schemas};
use fretwork_job::{Job, JobState};
use fretwork_store::{Filter, Words};

/// A page of jobs.
#[derive(Debug, Serialize, ToSchema)]
pub struct JobList {
    /// The jobs.
    jobs: Vec<JobAnswer>,
    /// The address of the next page; null on the last page.
    #[schema(example = "/v1/jobs?limit=50&cursor=019aa0f3-1f4e-7cc0-9d8b-1c5b0c1f9a11")]
    next: Option<String>,
    /// With `count=true`: the number of all matching jobs.
    #[serde(skip_serializing_if = "Option::is_none")]
    total: Option<u64>,
}

/// Lists jobs.
///
/// A job must match all filters. The address of the next page is in `next` and in the `Link` header. New jobs
/// do not shift the pages.
#[utoipa::path(get, path = "/v1/jobs", operation_id = "list_jobs", tag = "jobs",
    params(OfJobs, OfList,
        ("sort" = Option<schemas::JobOrder>, Query, description = "`-created` (the default): the newest first; or `created`."),
        ("limit" = Option<u32>, Query, description = "Largest number of jobs on the page.", minimum = 1,
            maximum = 200, example = 50),
        ("cursor" = Option<uuid::Uuid>, Query,
            description = "Continues after this job. The server puts it into `next` of a page."),
    ),
    responses((status = 200, description = "A page of jobs.", content(
        (JobList = "application/json"), (String = "text/csv"),
    ))),
)]
pub async fn list(
    app: App,
    caller: Caller,
    uri: Uri,
    headers: HeaderMap,
    mut query: Query,
) -> Result<Response> {
    let mut filter = read_filter(&mut query, &caller);
    filter.reach = caller.reach();
    filter.oldest_first = either(&mut query, "sort", ["-created", "created"]) == Some(true);
    let view = ListView::take(&mut query, &headers, [50, 200]);
    let cursor = query.value("cursor", "the id of a job", |text| text.parse().ok());
    query.finish()?;
    if let Some(as_csv) = view.csv {
        let read = move |cursor| {
            let (app, caller, filter) = (app.clone(), caller.clone(), filter.clone());
            async move {
                let _turn = app.shares.heavy.turn(&caller.owner).await;
                let page = app.store.jobs(&filter, cursor, view.page).await?;
                Ok((page.jobs.into_iter().map(line).collect(), page.next))
            }
        };
        let columns = COLUMNS.map(|name| (name, "")).into_iter().chain(SUMMARY);
        return listed::answer(("jobs", columns), &uri, as_csv, cursor, read).await;
    }
    let _turn = app.shares.heavy.turn(&caller.owner).await;
    let page = app.store.jobs(&filter, cursor, view.page).await?;
    let total = if view.count { Some(app.store.count_jobs(&filter).await?) } else { None };
    let (next, link) = next_page(&uri, page.next);
    let jobs = page.jobs.into_iter().map(JobAnswer::from).collect();
    Ok((link, axum::Json(JobList { jobs, next, total })).into_response())
}

/// The columns of a list as CSV before those of the summary.
const COLUMNS: [&str; 11] = [
    "id", "label", "tags", "state", "owner", "key", "origin", "created", "started", "finished",
    "error",
];
/// The columns of the summary, and their units.
const SUMMARY: [(&str, &str); 5] = [
    ("regime", ""),
    ("cycles", ""),
    ("wear_volume", "m^3"),
    ("wear_depth", "m"),
    ("dissipated_energy", "J"),
];

/// A line of a list as CSV.
fn line(job: Job) -> String {
    let tags = job.tags.join(", ");
    let told = json!(JobAnswer::from(job));
    let own = COLUMNS.map(|name| match name {
        "tags" => json!(tags),
        "created" | "started" | "finished" => told["times"][name].clone(),
        "error" => told["error"]["detail"].clone(),
        name => told[name].clone(),
    });
    listed::line(own.into_iter().chain(SUMMARY.map(|(name, _)| told["summary"][name].clone())))
}

/// Reads the filters of jobs from the query.
pub(super) fn read_filter(query: &mut Query, caller: &Caller) -> Filter {
    let states = JobState::ALL.map(JobState::as_str).join(", ");
    Filter {
        state: query.value("state", format_args!("one of {states}"), |text| text.parse().ok()),
        label: query.text("label"),
        tag: query.text("tag"),
        words: read_words(query),
        key: query.value("key", "a key of 64 lower-case hex digits", |text| text.parse().ok()),
        owner: query.value("owner", "the name of an owner", |name| caller.owner_named(name)),
        ..Filter::default()
    }
}

fn read_words(query: &mut Query) -> Words {
    query.text("q").unwrap_or_default().parse().unwrap_or_else(|fault: String| {
        query.complain("q", fault);
        Words::default()
    })
}
