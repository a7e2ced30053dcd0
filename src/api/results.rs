//! Results: whole documents and their parts, which never change.

use axum::body::Bytes;
use axum::extract::State;
use axum::http::header::{self, HeaderName};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use tokio::task;

use super::App;
use super::problem::{self, Complaint, Problem};
use super::table::{self, Document, Selection};
use super::wire::{Format, NoQuery, Query, Segment, instant};
use crate::job::Key;
use crate::store::StoredResult;

const TABLES: [Format; 2] = [Format::Json, Format::Csv];

/// The key that an address names.
pub(super) fn read_key(text: &str) -> Result<Key, Problem> {
    text.parse().map_err(|bad: crate::job::BadKey| {
        Problem::new(&problem::UNKNOWN_RESULT, format!("No result has this key: {bad}."))
    })
}

/// Finds the stored bytes of a result; an unknown key is answered with the way to its job, if one
/// is under way.
pub(super) async fn find(app: &App, key: &Key) -> Result<Bytes, Problem> {
    let evicted = match app.store.result(key).await? {
        Some(StoredResult::Whole(body)) => return Ok(body),
        Some(StoredResult::Evicted { at, deleted_by, scenario }) => {
            Some((at, deleted_by, scenario))
        }
        None => None,
    };
    let live = app.store.live_job(key).await?;
    let problem = match (evicted, live) {
        (Some((at, deleted_by, scenario)), live) => {
            let way = match live {
                Some(job) => format!("it is computed again, wait with GET /v1/jobs/{job}?wait=10"),
                None => "POST {\"scenario\": …} with the `scenario` of this answer to /v1/jobs to \
                    have it again"
                    .to_owned(),
            };
            let gone = match deleted_by {
                Some(who) => format!("deleted by {who} on {}", instant(at)),
                None => format!("dropped on {} to make room", instant(at)),
            };
            let detail = format!("The result was {gone}; {way}.");
            Problem::new(&problem::EVICTED, detail).with_scenario(scenario)
        }
        (None, Some(job)) => {
            let detail =
                format!("No result has this key yet; wait for it with GET /v1/jobs/{job}?wait=10.");
            Problem::new(&problem::UNKNOWN_RESULT, detail)
        }
        (None, None) => {
            let detail = "No result has this key; submit its scenario to POST /v1/jobs.";
            Problem::new(&problem::UNKNOWN_RESULT, detail)
        }
    };
    Err(match live {
        Some(job) => {
            problem.with_header(header::LINK, format!("</v1/jobs/{job}>; rel=\"related\""))
        }
        None => problem,
    })
}

/// What is at hand in memory under this name; else it is made, and remembered.
async fn remembered(
    app: &App,
    key: &Key,
    name: String,
    make: impl Future<Output = Result<Bytes, Problem>>,
) -> Result<Bytes, Problem> {
    let found = app.memory.get(&name);
    app.metrics.looked(found.is_some());
    if let Some(body) = found {
        app.store.was_read(key);
        return Ok(body);
    }
    let forgotten = app.memory.forgotten();
    let body = make.await?;
    app.memory.put(name, &body);
    if app.memory.forgotten() != forgotten {
        // Perhaps it was deleted while it was read.
        app.memory.forget(key);
    }
    Ok(body)
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
    app.store.was_read(key);
    Ok(Some((StatusCode::NOT_MODIFIED, caching(tag)).into_response()))
}

/// What every representation carries: results are a pure function of their key, so they may be
/// kept for ever; each representation has its own tag.
fn caching(tag: &str) -> [(HeaderName, HeaderValue); 3] {
    // Keys, names and formats are always legal in a header.
    let tag = HeaderValue::try_from(tag).unwrap_or(HeaderValue::from_static("\"\""));
    [
        (header::ETAG, tag),
        (header::CACHE_CONTROL, HeaderValue::from_static("max-age=31536000, immutable")),
        (header::VARY, HeaderValue::from_static("accept")),
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

fn send(tag: &str, format: Format, body: Bytes) -> Response {
    (caching(tag), [(header::CONTENT_TYPE, format.media_type())], body).into_response()
}

/// Answers a part of a result in JSON or CSV. `write` runs apart from the threads that answer
/// requests, since a large document takes a while.
async fn part(
    app: &App,
    (uri, headers): (&Uri, &HeaderMap),
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
    let asked = format!("{tag}{}", uri.query().unwrap_or_default());
    let body = remembered(app, &key, asked, async {
        let stored = find(app, &key).await?;
        let written = task::spawn_blocking(move || write(Document::open(&stored)?, format));
        Ok(written.await.map_err(|_| Problem::internal())??.into())
    });
    Ok(send(&tag, format, body.await?))
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
        (status = 410, description = "The result was dropped to make room; `scenario` is what it was \
            computed from."),
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
    let body = remembered(&app, &key, tag.clone(), find(&app, &key)).await?;
    Ok(send(&tag, format, body))
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
        (status = 410, description = "The result was dropped to make room; `scenario` is what it was \
            computed from."),
        (status = 406, description = "The history is available as JSON and CSV."),
    ),
)]
pub async fn history(
    State(app): State<App>,
    Segment(key): Segment,
    uri: Uri,
    headers: HeaderMap,
    mut query: Query,
) -> Result<Response, Problem> {
    let asked = query.format(&TABLES);
    query.finish()?;
    part(&app, (&uri, &headers), &key, "history", asked, |document, format| match format {
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
        (status = 410, description = "The result was dropped to make room; `scenario` is what it was \
            computed from."),
        (status = 406, description = "The profiles are available as JSON and CSV."),
    ),
)]
pub async fn profiles(
    State(app): State<App>,
    Segment(key): Segment,
    uri: Uri,
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
    part(&app, (&uri, &headers), &key, "profiles", asked, move |document, format| match format {
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
        (status = 410, description = "The result was dropped to make room; `scenario` is what it was \
            computed from."),
        (status = 406, description = "The loops are available as JSON and CSV."),
    ),
)]
pub async fn loops(
    State(app): State<App>,
    Segment(key): Segment,
    uri: Uri,
    headers: HeaderMap,
    mut query: Query,
) -> Result<Response, Problem> {
    let asked = query.format(&TABLES);
    query.finish()?;
    part(&app, (&uri, &headers), &key, "loops", asked, |document, format| match format {
        Format::Json => document.loops_json(),
        Format::Csv => document.loops_csv().map(String::into_bytes),
    })
    .await
}

/// Pins a result: it is kept however much room it takes.
///
/// Results that nobody reads are dropped when the database grows too large, those first that were
/// read longest ago. A pinned result is not. Pinning it again changes nothing.
#[utoipa::path(put, path = "/v1/results/{key}/pin", operation_id = "pin_result", tag = "results",
    params(("key" = super::openapi::KeyText, Path, description = "The `key` of a result.")),
    responses(
        (status = 204, description = "The result is pinned."),
        (status = 404, description = "No result has this key."),
        (status = 410, description = "The result was dropped to make room; `scenario` is what it was \
            computed from."),
        (status = 507, description = "The disk is full."),
    ),
)]
pub async fn pin(
    State(app): State<App>,
    Segment(key): Segment,
    _: NoQuery,
) -> Result<StatusCode, Problem> {
    set_pin(&app, &key, true).await
}

/// Takes the pin off a result.
#[utoipa::path(delete, path = "/v1/results/{key}/pin", operation_id = "unpin_result", tag = "results",
    params(("key" = super::openapi::KeyText, Path, description = "The `key` of a result.")),
    responses(
        (status = 204, description = "The result is not pinned."),
        (status = 404, description = "No result has this key."),
        (status = 410, description = "The result was dropped to make room; `scenario` is what it was \
            computed from."),
        (status = 507, description = "The disk is full."),
    ),
)]
pub async fn unpin(
    State(app): State<App>,
    Segment(key): Segment,
    _: NoQuery,
) -> Result<StatusCode, Problem> {
    set_pin(&app, &key, false).await
}

async fn set_pin(app: &App, key: &str, pinned: bool) -> Result<StatusCode, Problem> {
    let key = read_key(key)?;
    while !app.store.pin(&key, pinned).await? {
        // It says why there is nothing to pin, unless it has come to be meanwhile.
        find(app, &key).await?;
    }
    Ok(StatusCode::NO_CONTENT)
}
