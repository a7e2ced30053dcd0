//! Results: whole documents and their parts, which never change.

use axum::extract::State;
use axum::http::header::{self, HeaderName};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use tokio::task;

use super::App;
use super::problem::{self, Complaint, Problem};
use super::table::{self, Document, Selection};
use super::wire::{Format, Query, Segment};
use crate::job::Key;

const TABLES: [Format; 2] = [Format::Json, Format::Csv];

/// The key that an address names.
fn read_key(text: &str) -> Result<Key, Problem> {
    text.parse().map_err(|bad: crate::job::BadKey| {
        Problem::new(&problem::UNKNOWN_RESULT, format!("No result has this key: {bad}."))
    })
}

/// Finds the stored bytes of a result; an unknown key is answered with the way to its job, if one
/// is under way.
async fn find(app: &App, key: &Key) -> Result<Vec<u8>, Problem> {
    if let Some(stored) = app.store.result(key).await? {
        return Ok(stored.body);
    }
    let Some(job) = app.store.live_job(key).await? else {
        let detail = "No result has this key; submit its scenario to POST /v1/jobs.";
        return Err(Problem::new(&problem::UNKNOWN_RESULT, detail));
    };
    let detail =
        format!("No result has this key yet; wait for it with GET /v1/jobs/{job}?wait=10.");
    let link = format!("</v1/jobs/{job}>; rel=\"related\"");
    Err(Problem::new(&problem::UNKNOWN_RESULT, detail).with_header(header::LINK, link))
}

/// The short answer to a client that holds this representation of a result that exists: results do
/// not change, so the body need not be read.
async fn not_modified(
    app: &App,
    headers: &HeaderMap,
    key: &Key,
    tag: &str,
) -> Result<Option<Response>, Problem> {
    if !is_held(headers, tag) || !app.store.has_result(key).await? {
        return Ok(None);
    }
    Ok(Some((StatusCode::NOT_MODIFIED, caching(tag)).into_response()))
}

/// What every representation carries: results are a pure function of their key, so they may be
/// kept for ever; each representation has its own tag.
fn caching(tag: &str) -> [(HeaderName, String); 3] {
    [
        (header::ETAG, tag.to_owned()),
        (header::CACHE_CONTROL, "max-age=31536000, immutable".to_owned()),
        (header::VARY, "accept".to_owned()),
    ]
}

/// Whether the client holds the representation with this tag already.
fn is_held(headers: &HeaderMap, tag: &str) -> bool {
    let tags =
        headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    tags.flat_map(|value| value.split(','))
        .map(|held| held.trim().trim_start_matches("W/"))
        .any(|held| held == tag || held == "*")
}

fn send(tag: &str, format: Format, body: Vec<u8>) -> Response {
    (caching(tag), [(header::CONTENT_TYPE, format.media_type())], body).into_response()
}

/// Answers a part of a result in JSON or CSV. `write` runs apart from the threads that answer
/// requests, since a large document takes a while.
async fn part(
    app: &App,
    headers: &HeaderMap,
    key: &str,
    name: &'static str,
    asked: Option<Format>,
    write: impl FnOnce(Document<'_>, Format) -> Result<Vec<u8>, table::Error> + Send + 'static,
) -> Result<Response, Problem> {
    let format = Format::choose(asked, headers, &TABLES).ok_or_else(|| {
        let detail = "This is available as application/json and text/csv (?format=json, csv).";
        Problem::new(&problem::NOT_ACCEPTABLE, detail)
    })?;
    let key = read_key(key)?;
    let tag = format!("\"{key}.{name}.{}\"", format.name());
    if let Some(response) = not_modified(app, headers, &key, &tag).await? {
        return Ok(response);
    }
    let stored = find(app, &key).await?;
    let written = task::spawn_blocking(move || write(Document::open(&stored)?, format));
    let body = written.await.map_err(|_| Problem::internal())??;
    Ok(send(&tag, format, body))
}

impl From<table::Error> for Problem {
    fn from(error: table::Error) -> Self {
        match &error {
            table::Error::Field { .. } => {
                Self::parameters(vec![Complaint::parameter("fields", error.to_string())])
            }
            table::Error::Instant { .. } => {
                Self::parameters(vec![Complaint::parameter("cycles", error.to_string())])
            }
            table::Error::Document(_) => {
                let error = &error as &dyn std::error::Error;
                tracing::error!(error, "a stored result does not parse");
                Self::internal()
            }
        }
    }
}

/// Returns a result.
///
/// A result is a pure function of its key, byte for byte, and may be cached for ever. All numbers
/// are SI; `units` names the unit of every quantity. Entry 0 of each history column and row 0 of
/// each profile is the unworn state.
#[utoipa::path(get, path = "/v1/results/{key}", operation_id = "get_result", tag = "results",
    params(
        ("key" = super::openapi::KeyText, Path, description = "The `key` of a job or a checked scenario."),
        ("format" = Option<super::openapi::JsonOnly>, Query, description = "Wins over `Accept`."),
        ("If-None-Match" = Option<String>, Header, description = "The `ETag` of a held copy."),
    ),
    responses(
        (status = 200, description = "The result.",
            content((ref("#/components/schemas/Result") = "application/json")), headers(
                ("ETag" = String, description = "The tag of this representation."),
                ("Cache-Control" = String, description = "`immutable`: keep it for ever."),
            )),
        (status = 304, description = "The held copy is still right. It always is."),
        (status = 404, description = "No result has this key. `Link` leads to its job, if one is \
            under way.", headers(("Link" = String, description = "`rel=\"related\"`."))),
        (status = 406, description = "A whole result is JSON; its history and its profiles are \
            available as CSV."),
    ),
)]
pub async fn whole(
    State(app): State<App>,
    Segment(key): Segment,
    headers: HeaderMap,
    mut query: Query,
) -> Result<Response, Problem> {
    let asked = query.format(&[Format::Json]);
    query.finish()?;
    let Some(format) = Format::choose(asked, &headers, &[Format::Json]) else {
        let detail = format!(
            "A whole result is available as application/json only. CSV is available of its two \
             tables: /v1/results/{key}/history?format=csv and /v1/results/{key}/profiles?format=csv."
        );
        return Err(Problem::new(&problem::NOT_ACCEPTABLE, detail));
    };
    let key = read_key(&key)?;
    let tag = format!("\"{key}\"");
    if let Some(response) = not_modified(&app, &headers, &key, &tag).await? {
        return Ok(response);
    }
    Ok(send(&tag, format, find(&app, &key).await?))
}

/// Returns the history of a result: one entry per instant.
///
/// As CSV it is one row per instant under headers such as `wear_volume[m^3]`, after comment lines
/// (`#`) with the key and the engine.
#[utoipa::path(get, path = "/v1/results/{key}/history", operation_id = "get_history", tag = "results",
    params(
        ("key" = super::openapi::KeyText, Path, description = "The `key` of a job or a checked scenario."),
        ("format" = Option<super::openapi::TableFormat>, Query, description = "Wins over `Accept`."),
        ("If-None-Match" = Option<String>, Header, description = "The `ETag` of a held copy."),
    ),
    responses(
        (status = 200, description = "The history.", content(
            (ref("#/components/schemas/History") = "application/json"),
            (String = "text/csv"),
        ), headers(
                ("ETag" = String, description = "The tag of this representation."),
                ("Cache-Control" = String, description = "`immutable`: keep it for ever."),
            )),
        (status = 304, description = "The held copy is still right. It always is."),
        (status = 404, description = "No result has this key. `Link` leads to its job, if one is \
            under way.", headers(("Link" = String, description = "`rel=\"related\"`."))),
        (status = 406, description = "The history is available as JSON and CSV."),
    ),
)]
pub async fn history(
    State(app): State<App>,
    Segment(key): Segment,
    headers: HeaderMap,
    mut query: Query,
) -> Result<Response, Problem> {
    let asked = query.format(&TABLES);
    query.finish()?;
    part(&app, &headers, &key, "history", asked, |document, format| match format {
        Format::Json => document.history_json(),
        Format::Csv => document.history_csv().map(String::into_bytes),
    })
    .await
}

/// Returns the profiles of a result: worn shape, wear, pressure and slip over the radius.
///
/// As CSV it is one row per instant and radius: `cycles,radius,…`. An infinite pressure is null in
/// JSON and empty in CSV. A result computed with `profiles_at: "none"` has no profiles: null in
/// JSON, no rows in CSV.
#[utoipa::path(get, path = "/v1/results/{key}/profiles", operation_id = "get_profiles", tag = "results",
    params(
        ("key" = super::openapi::KeyText, Path, description = "The `key` of a job or a checked scenario."),
        ("format" = Option<super::openapi::TableFormat>, Query, description = "Wins over `Accept`."),
        ("fields" = Option<String>, Query, description = "Only these columns, separated by commas; \
            `cycles` and `radius` always come along.", example = "wear,pressure"),
        ("cycles" = Option<String>, Query, description = "Only these instants, separated by commas.",
            example = "0"),
        ("points" = Option<u32>, Query, description = "At most so many radii, evenly spread.",
            minimum = 2, maximum = 4096, example = 200),
        ("If-None-Match" = Option<String>, Header, description = "The `ETag` of a held copy."),
    ),
    responses(
        (status = 200, description = "The profiles.", content(
            (ref("#/components/schemas/Profiles") = "application/json"),
            (String = "text/csv"),
        ), headers(
                ("ETag" = String, description = "The tag of this representation."),
                ("Cache-Control" = String, description = "`immutable`: keep it for ever."),
            )),
        (status = 304, description = "The held copy is still right. It always is."),
        (status = 404, description = "No result has this key. `Link` leads to its job, if one is \
            under way.", headers(("Link" = String, description = "`rel=\"related\"`."))),
        (status = 406, description = "The profiles are available as JSON and CSV."),
    ),
)]
pub async fn profiles(
    State(app): State<App>,
    Segment(key): Segment,
    headers: HeaderMap,
    mut query: Query,
) -> Result<Response, Problem> {
    let asked = query.format(&TABLES);
    let wanted = Selection {
        fields: query.text("fields").map(|text| text.split(',').map(str::to_owned).collect()),
        cycles: query.value("cycles", "numbers separated by commas", |text| {
            text.split(',').map(|number| number.trim().parse().ok()).collect()
        }),
        points: query.value("points", "a number from 2 to 4096", |text| {
            text.parse().ok().filter(|points| (2..=4096).contains(points))
        }),
    };
    query.finish()?;
    part(&app, &headers, &key, "profiles", asked, move |document, format| match format {
        Format::Json => document.profiles_json(&wanted),
        Format::Csv => document.profiles_csv(&wanted).map(String::into_bytes),
    })
    .await
}

/// Returns the force–displacement loops of a result, at the instants of its profiles.
///
/// Each loop is a cycle from one turning point over the other back to the first, with a point wherever
/// another spring of the contact starts to slip: straight lines between the points enclose the energy of
/// the cycle, and loops may differ in their number of points. Loops of a displacement record are its
/// outermost. `energy_ratio`,
/// `slip_ratio` and `free_ratio` are the criteria A, D and B of the sliding transition. As CSV it is
/// one row per instant and point. A result computed with `profiles_at: "none"` has no loops.
#[utoipa::path(get, path = "/v1/results/{key}/loops", operation_id = "get_loops", tag = "results",
    params(
        ("key" = super::openapi::KeyText, Path, description = "The `key` of a job or a checked scenario."),
        ("format" = Option<super::openapi::TableFormat>, Query, description = "Wins over `Accept`."),
        ("If-None-Match" = Option<String>, Header, description = "The `ETag` of a held copy."),
    ),
    responses(
        (status = 200, description = "The loops.", content(
            (ref("#/components/schemas/Loops") = "application/json"),
            (String = "text/csv"),
        ), headers(
                ("ETag" = String, description = "The tag of this representation."),
                ("Cache-Control" = String, description = "`immutable`: keep it for ever."),
            )),
        (status = 304, description = "The held copy is still right. It always is."),
        (status = 404, description = "No result has this key. `Link` leads to its job, if one is \
            under way.", headers(("Link" = String, description = "`rel=\"related\"`."))),
        (status = 406, description = "The loops are available as JSON and CSV."),
    ),
)]
pub async fn loops(
    State(app): State<App>,
    Segment(key): Segment,
    headers: HeaderMap,
    mut query: Query,
) -> Result<Response, Problem> {
    let asked = query.format(&TABLES);
    query.finish()?;
    part(&app, &headers, &key, "loops", asked, |document, format| match format {
        Format::Json => document.loops_json(),
        Format::Csv => document.loops_csv().map(String::into_bytes),
    })
    .await
}
