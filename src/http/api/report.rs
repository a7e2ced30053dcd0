//! Reports of results: pages for people.

use axum::http::header::{CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE};
use axum::response::{IntoResponse as _, Response};
use serde_json::Value;

use super::results::either;
use crate::http::access::LINK_HOLDER;
use crate::http::answer::representation::refused;
use crate::http::answer::stored::document;
use crate::http::api::jobs::unverified;
use crate::http::api::parameters::ResultKey;
use crate::http::dashboard::report::{page, policy};
use crate::http::{
    App, Caller, Problem, Query, Result, Segment, blocking, instant, kinds, read_key, schemas,
};
use fretwork_format::report::{About, MOST, ReportedResult, content};
use fretwork_job::{Job, JobId, Key};
use fretwork_store::Filter;

/// Maximum number of jobs in which a label is looked for.
const JOBS: u32 = 20;

/// Returns a report of a result: one HTML file, to be read, printed and archived.
///
/// The file shows what the page of the result shows to a guest, with figures that can be read, zoomed and saved. It contains the
/// documents that it draws, and needs neither a network nor another file. Of a result of more than 4 MiB, it has some of the
/// output cycles of the profiles and loops, or the first rows. Without scripts, it has the inputs and the main numbers. It also
/// has the versions, and the command that computes the result again. The label and the inputs as submitted are those of the
/// latest job of the result that the caller may see, or of `job`. Without such a job, the inputs are those of the result.
///
/// With `with`, the report compares runs. It has the inputs that differ, and the differences of all numbers to this result.
#[utoipa::path(get, path = "/v1/results/{key}/report", operation_id = "get_report", tag = "results",
    params(
        ResultKey,
        ("units" = Option<schemas::UnitSystem>, Query, description = "The units at first. `engineering` (the default): µm, mm³, MPa, mJ; or SI."),
        ("with" = Option<Vec<String>>, Query, description = "The key of another run. May be repeated, up to seven times."),
        ("job" = Option<uuid::Uuid>, Query, description = "The job whose label and inputs the report shows."),
    ),
    responses((status = 200, description = "The report.", body = String, content_type = "text/html")),
)]
pub async fn report(app: App, caller: Caller, key: Segment, mut query: Query) -> Result<Response> {
    let engineering = either(&mut query, "units", ["si", "engineering"]).unwrap_or(true);
    let job = query.value("job", "the id of a job", |text| text.parse().ok());
    let others: Vec<Key> = query.values("with", "the key of a result", |text| text.parse().ok());
    if others.len() >= MOST {
        query.complain("with", format!("may be given {} times. Compare fewer runs", MOST - 1));
    }
    query.finish()?;
    if caller.owner == LINK_HOLDER && !others.is_empty() {
        let detail = "A link opens only one result. Send an access key to compare it with others.";
        return Err(Problem::new(&kinds::BAD_LINK, detail));
    }
    let _turn = app.shares.heavy.turn(&caller.owner).await;
    let first = read_key(&key)?;
    let mut entries = Vec::new();
    let count = 1 + others.len();
    for key in [first].into_iter().chain(others) {
        let about = about(&app, &caller, &key, job.filter(|_| key == first)).await?;
        let result = document(&app, &caller, &key).await?;
        // Only one result is in memory at a time: what the report has of it is bounded.
        let read = move || ReportedResult::read(&result, &about, engineering, count);
        entries.push(blocking(read).await?.map_err(|error| refused(&key, error))?);
    }
    let made = blocking(move || content(&entries, engineering, &[]).map(|own| page(&own)));
    let html = made.await?.map_err(|error| refused(&first, error))?;
    let headers = [(CONTENT_TYPE, "text/html; charset=utf-8"), (CACHE_CONTROL, "no-store")];
    Ok((headers, [(CONTENT_SECURITY_POLICY, policy())], html).into_response())
}

/// What the database knows about a result, as far as the caller may see it.
async fn about(app: &App, caller: &Caller, key: &Key, job: Option<JobId>) -> Result<About> {
    let reach = caller.reach();
    let jobs: Vec<Job> = if let Some(id) = job {
        app.store.job(id).await?.into_iter().collect()
    } else {
        let all = Filter { key: Some(*key), reach: reach.clone(), ..Filter::default() };
        let own = Filter { owner: Some(reach.owner.clone()), ..all.clone() };
        let own = app.store.jobs(&own, None, JOBS).await?.jobs;
        own.into_iter().chain(app.store.jobs(&all, None, JOBS).await?.jobs).collect()
    };
    let seen = |job: &Job| job.key == *key && reach.sees(&job.owner, job.private);
    let jobs: Vec<_> = jobs.into_iter().filter(seen).collect();
    let submitted = match jobs.first().filter(|job| reach.may_change(&job.owner)) {
        Some(job) => app.store.asked(job.id).await?.submitted,
        None => None,
    };
    let known = app.store.provenance(key, "").await?;
    let own = jobs.first().map(|job| job.warnings.clone());
    let computing = known.as_ref().and_then(|known| known.warnings.clone());
    let program = known.as_ref().and_then(|known| known.program.as_ref());
    let imported = known.as_ref().and_then(|known| known.imported.as_ref());
    let unverified = unverified(imported.and_then(|import| import.verified));
    let own = own.or(computing).unwrap_or(Value::Null);
    let own = own.as_array().into_iter().flatten().cloned();
    Ok(About {
        label: jobs.iter().find_map(|job| job.label.clone()),
        submitted: submitted.and_then(|text| serde_json::from_str(&text).ok()),
        computed: known.as_ref().and_then(|known| known.computed).map(instant),
        version: program.map(|program| program.version.clone()),
        warnings: own.chain(unverified).collect(),
    })
}
