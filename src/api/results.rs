//! Results: whole documents and their parts, which never change, in the forms that tools take.

use axum::body::Bytes;
use axum::extract::State;
use axum::http::header::{self, HeaderName};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use tokio::task;
use xxhash_rust::xxh3::xxh3_64;

use super::App;
use super::coding::Coding;
use super::forms::{self, Ask, Part};
use super::memory::Answer;
use super::problem::{self, Problem};
use super::wire::{Format, NoQuery, Query, Segment, instant, words};
use crate::job::Key;
use crate::store::StoredResult;

/// The key that an address names.
fn read_key(text: &str) -> Result<Key, Problem> {
    text.parse().map_err(|bad: crate::job::BadKey| {
        Problem::new(&problem::UNKNOWN_RESULT, format!("No result has this key: {bad}."))
    })
}

/// Finds the stored bytes of a result; an unknown key is answered with the way to its job, if one
/// is under way.
async fn find(app: &App, key: &Key) -> Result<Bytes, Problem> {
    let evicted = match app.store.result(key).await? {
        Some(StoredResult::Whole(body)) => return Ok(body),
        Some(StoredResult::Evicted { at, scenario }) => Some((at, scenario)),
        None => None,
    };
    let live = app.store.live_job(key).await?;
    let problem = match (evicted, live) {
        (Some((at, scenario)), live) => {
            let way = match live {
                Some(job) => format!("it is computed again, wait with GET /v1/jobs/{job}?wait=10"),
                None => "POST {\"scenario\": …} with the `scenario` of this answer to /v1/jobs to \
                    have it again"
                    .to_owned(),
            };
            let detail = format!("The result was dropped on {} to make room; {way}.", instant(at));
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

/// A representation of a result: what is asked for, in one form. Equal ones have equal names.
struct Representation {
    key: Key,
    part: Part,
    format: Format,
    ask: Ask,
    /// What it is remembered under: whatever distinguishes it.
    name: String,
    /// The tag that clients hold it by.
    tag: String,
}

impl Representation {
    fn new(key: Key, part: Part, format: Format, ask: Ask) -> Self {
        let ask = ask.in_order();
        if (part, format) == (Part::Whole, Format::Json) && ask == Ask::default() {
            let (name, tag) = (key.to_string(), format!("\"{key}\""));
            return Self { key, part, format, ask, name, tag };
        }
        let address = format!("{key}.{}.{}", part.name(), format.name());
        let name = format!("{address} {} {ask:?}", forms::VERSION);
        let tag = format!("\"{address}.{:016x}\"", xxh3_64(name.as_bytes()));
        Self { key, part, format, ask, name, tag }
    }

    /// The answer in this coding: remembered, read by others just now, or made.
    async fn answer(self, app: &App, coding: Coding) -> Result<Response, Problem> {
        let name = match coding.name() {
            None => self.name.clone(),
            Some(coding) => format!("{} {coding}", self.name),
        };
        let found = app.memory.get(&name);
        app.metrics.looked(found.is_some());
        let answer = if let Some(answer) = found {
            answer
        } else {
            let answer = match coding {
                Coding::Identity => self.plain(app).await?,
                _ => app.memory.share(&name, self.coded(app, coding)).await?,
            };
            app.memory.put(name, &answer);
            answer
        };
        app.store.was_read(&self.key);
        Ok(self.send(answer))
    }

    async fn coded(&self, app: &App, coding: Coding) -> Result<Answer, Problem> {
        let body = self.plain(app).await?.body;
        let coded = apart(move || coding.encode(body)).await?;
        let (body, coding) = coded.map_err(|error| {
            tracing::error!(error = &error as &dyn std::error::Error, "cannot compress an answer");
            Problem::internal()
        })?;
        Ok(Answer { body, coding })
    }

    /// The bytes as they are before they are compressed.
    async fn plain(&self, app: &App) -> Result<Answer, Problem> {
        let stored = async {
            let make = async { find(app, &self.key).await.map(Answer::plain) };
            app.memory.share(&self.key.to_string(), make).await
        };
        if self.name == self.key.to_string() {
            return stored.await;
        }
        let make = async {
            let stored = stored.await?.body;
            let (part, format, ask) = (self.part, self.format, self.ask.clone());
            let made = apart(move || forms::write(&stored, part, format, &ask)).await??;
            Ok(Answer::plain(made.into()))
        };
        app.memory.share(&self.name, make).await
    }

    fn send(&self, Answer { body, coding }: Answer) -> Response {
        let mut response = body.into_response();
        let headers = response.headers_mut();
        let weak = if coding == Coding::Identity { "" } else { "W/" };
        headers.extend(caching(&format!("{weak}{}", self.tag)));
        let kind = HeaderValue::from_static(self.format.media_type());
        headers.insert(header::CONTENT_TYPE, kind);
        if let Some(coding) = coding.name() {
            headers.insert(header::CONTENT_ENCODING, HeaderValue::from_static(coding));
        }
        if self.format.is_file() {
            let (part, end) = (self.part.name(), self.format.name());
            let name = format!(
                "attachment; filename=\"fretwork-{:.12}-{part}.{end}\"",
                self.key.to_string()
            );
            if let Ok(name) = HeaderValue::try_from(name) {
                headers.insert(header::CONTENT_DISPOSITION, name);
            }
        }
        response
    }

    /// The short answer to a client that holds this representation of a result that exists: results
    /// do not change, so the body need not be read.
    async fn not_modified(
        &self,
        app: &App,
        headers: &HeaderMap,
    ) -> Result<Option<Response>, Problem> {
        let Some(held) = held(headers, &self.tag) else { return Ok(None) };
        if !app.store.has_result(&self.key).await? {
            return Ok(None);
        }
        app.store.was_read(&self.key);
        Ok(Some((StatusCode::NOT_MODIFIED, caching(&held)).into_response()))
    }
}

/// Does what takes a while apart from the threads that answer requests.
async fn apart<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Problem> {
    task::spawn_blocking(work).await.map_err(|_| Problem::internal())
}

/// What every representation carries: results are a pure function of their key, so they may be
/// kept for ever; each representation has its own tag.
fn caching(tag: &str) -> [(HeaderName, HeaderValue); 3] {
    // Keys, names and formats are always legal in a header.
    let tag = HeaderValue::try_from(tag).unwrap_or(HeaderValue::from_static("\"\""));
    [
        (header::ETAG, tag),
        (header::CACHE_CONTROL, HeaderValue::from_static("max-age=31536000, immutable")),
        (header::VARY, HeaderValue::from_static("accept, accept-encoding")),
    ]
}

/// The tag by which the client holds the representation with this one, if it does: weak where it was
/// compressed, so that a cache finds what is confirmed.
fn held(headers: &HeaderMap, tag: &str) -> Option<String> {
    let mut tags = words(headers, header::IF_NONE_MATCH);
    let found = tags.find(|held| *held == "*" || held.trim_start_matches("W/") == tag)?;
    Some(if found == "*" { tag } else { found }.to_owned())
}

/// Takes the parameters that say how a result or a part is wanted.
fn ask(query: &mut Query, part: Part) -> Ask {
    let mut ask = Ask {
        records: query.value("layout", "\"columns\" or \"records\"", |text| match text {
            "columns" => Some(false),
            "records" => Some(true),
            _ => None,
        }) == Some(true),
        digits: query.value("digits", "a whole number from 1 to 17", |text| {
            text.parse().ok().filter(|digits| (1..=17).contains(digits))
        }),
        engineering: query.value("units", "\"si\" or \"engineering\"", |text| match text {
            "si" => Some(false),
            "engineering" => Some(true),
            _ => None,
        }) == Some(true),
        cycles: query.value("cycles", "numbers separated by commas", |text| {
            let number =
                |text: &str| text.trim().parse().ok().filter(|number: &f64| number.is_finite());
            text.split(',').map(number).collect()
        }),
        ..Ask::default()
    };
    if part != Part::Whole {
        let names = |text: String| text.split(',').map(|name| name.trim().to_owned()).collect();
        ask.fields = query.text("fields").map(names);
    }
    // A loop without some of its points encloses another energy, and a history is short.
    if matches!(part, Part::Whole | Part::Profiles) {
        ask.points = query.value("points", "a number from 2 to 4096", |text| {
            text.parse().ok().filter(|points| (2..=4096).contains(points))
        });
    }
    ask
}

/// Answers a result or a part of it in the form that the client wants.
async fn answer(
    app: &App,
    (key, part): (&str, Part),
    headers: &HeaderMap,
    mut query: Query,
) -> Result<Response, Problem> {
    let asked = query.format(part.formats());
    let ask = ask(&mut query, part);
    let format = Format::choose(asked, headers, part.formats());
    if ask.records && part == Part::Whole {
        let parts = "/history, /profiles and /loops";
        query.complain("layout", format!("a whole result has no rows; its parts have: {parts}"));
    } else if ask.records && format.is_some_and(|format| format != Format::Json) {
        query.complain("layout", "is for JSON; other formats have one layout each");
    }
    query.finish()?;
    let format = format.ok_or_else(|| not_acceptable(key, part))?;
    let wanted = Representation::new(read_key(key)?, part, format, ask);
    if let Some(response) = wanted.not_modified(app, headers).await? {
        return Ok(response);
    }
    wanted.answer(app, Coding::choose(headers, format)).await
}

fn not_acceptable(key: &str, part: Part) -> Problem {
    let listed = |formats: &[Format]| {
        let named = formats.iter().map(|format| {
            let kind = format.media_type().split(';').next().unwrap_or_default();
            format!("{kind} (?format={})", format.name())
        });
        named.collect::<Vec<_>>().join(", ")
    };
    let mut detail = format!("This is available as {}.", listed(part.formats()));
    if part == Part::Whole {
        detail += " NDJSON, CSV and Arrow hold one table; its parts are available so: ";
        let address = |part: Part| format!("/v1/results/{key}/{}?format=csv", part.name());
        detail += &Part::TABLES.map(address).join(", ");
        detail += ".";
    }
    Problem::new(&problem::NOT_ACCEPTABLE, detail)
}

impl From<forms::Error> for Problem {
    fn from(error: forms::Error) -> Self {
        match error {
            forms::Error::NotThere(complaints) => Self::parameters(complaints),
            error => {
                let error = &error as &dyn std::error::Error;
                tracing::error!(error, "a stored result cannot be given this form");
                Self::internal()
            }
        }
    }
}

/// Returns a result.
///
/// A result is a pure function of its key, byte for byte, and may be cached for ever. All numbers
/// are SI unless `units` says otherwise; the member `units` names the unit of every quantity. Entry 0
/// of each history column and row 0 of each profile is the unworn state. `scenario` is always SI and
/// in full, so that it can be sent again.
///
/// As NPZ each column of its tables is an array, such as `history/wear_volume` and `profiles/wear`
/// (instants × radii), and everything else is JSON in the text array `meta`; `numpy.load` reads it
/// without pickle. An infinite pressure is null in JSON and NaN in NPZ.
#[utoipa::path(get, path = "/v1/results/{key}", operation_id = "get_result", tag = "results",
    params(
        ("key" = super::openapi::KeyText, Path, description = "The `key` of a job or a checked scenario."),
        ("format" = Option<super::openapi::WholeFormat>, Query, description = "Wins over `Accept`."),
        ("layout" = Option<super::openapi::WholeLayout>, Query, description = "Its parts can be had in \
            `records`."),
        ("cycles" = Option<String>, Query, description = "Only the profiles and loops of these instants, separated by commas; the history \
            stays whole.",
            example = "0"),
        ("points" = Option<u32>, Query, description = "At most so many radii of the profiles, evenly spread.",
            minimum = 2, maximum = 4096, example = 200),
        ("digits" = Option<u32>, Query, description = "Rounds every number to so many significant \
            digits. Up to 7, arrays in NPZ and Arrow are float32, but for columns with numbers below \
            1.2e-38.", minimum = 1, maximum = 17, example = 7),
        ("units" = Option<super::openapi::UnitSystem>, Query, description = "`si` (the default), or \
            `engineering`: um, mm^3, MPa (moduli too), mJ, N, mm^3/(N m). The member `units` and the \
            headers say which.", example = "engineering"),
        ("If-None-Match" = Option<String>, Header, description = "The `ETag` of a held copy."),
        ("Accept-Encoding" = Option<String>, Header, description = "`zstd` or `gzip`; NPZ is compressed \
            in itself."),
    ),
    responses(
        (status = 200, description = "The result.", content(
            (ref("#/components/schemas/Result") = "application/json"),
            (super::openapi::File = "application/x-npz"),
        ), headers(
                ("ETag" = String, description = "The tag of this representation; weak where it is \
                    compressed."),
                ("Cache-Control" = String, description = "`immutable`: keep it for ever."),
                ("Content-Disposition" = String, description = "A name for the file: of CSV, NPZ and \
                    Arrow."),
            )),
        (status = 304, description = "The held copy is still right. It always is."),
        (status = 404, description = "No result has this key. `Link` leads to its job, if one is \
            under way.", headers(("Link" = String, description = "`rel=\"related\"`."))),
        (status = 410, description = "The result was dropped to make room; `scenario` is what it was \
            computed from."),
        (status = 406, description = "A whole result is available as JSON and NPZ; its parts are also \
            available as NDJSON, CSV and Arrow."),
    ),
)]
pub async fn whole(
    State(app): State<App>,
    Segment(key): Segment,
    headers: HeaderMap,
    query: Query,
) -> Result<Response, Problem> {
    answer(&app, (&key, Part::Whole), &headers, query).await
}

/// Returns the history of a result: one entry per instant.
///
/// CSV and NDJSON have one row per instant under names such as `wear_volume[m^3]`: CSV after comment
/// lines (`#`) with the key, the engine and the units, in NDJSON each line with `key` and `engine`. As
/// NPZ it is an array per column, as Arrow (an IPC file) a table, whose metadata have key, engine and
/// units. Equal numbers are equal in every format.
#[utoipa::path(get, path = "/v1/results/{key}/history", operation_id = "get_history", tag = "results",
    params(
        ("key" = super::openapi::KeyText, Path, description = "The `key` of a job or a checked scenario."),
        ("format" = Option<super::openapi::TableFormat>, Query, description = "Wins over `Accept`."),
        ("layout" = Option<super::openapi::Layout>, Query, description = "Of JSON: an array per quantity \
            (`columns`, the default), or a list of rows under `records`."),
        ("fields" = Option<String>, Query, description = "Only these columns, separated by commas; \
            `cycles` always comes along.", example = "wear_volume,wear_depth"),
        ("cycles" = Option<String>, Query, description = "Only these instants, separated by commas.",
            example = "0"),
        ("digits" = Option<u32>, Query, description = "Rounds every number to so many significant \
            digits. Up to 7, arrays in NPZ and Arrow are float32, but for columns with numbers below \
            1.2e-38.", minimum = 1, maximum = 17, example = 7),
        ("units" = Option<super::openapi::UnitSystem>, Query, description = "`si` (the default), or \
            `engineering`: um, mm^3, MPa (moduli too), mJ, N, mm^3/(N m). The member `units` and the \
            headers say which.", example = "engineering"),
        ("If-None-Match" = Option<String>, Header, description = "The `ETag` of a held copy."),
        ("Accept-Encoding" = Option<String>, Header, description = "`zstd` or `gzip`; NPZ is compressed \
            in itself."),
    ),
    responses(
        (status = 200, description = "The history.", content(
            (ref("#/components/schemas/HistoryAnswer") = "application/json"),
            (String = "application/x-ndjson"),
            (String = "text/csv"),
            (super::openapi::File = "application/x-npz"),
            (super::openapi::File = "application/vnd.apache.arrow.file"),
        ), headers(
                ("ETag" = String, description = "The tag of this representation; weak where it is \
                    compressed."),
                ("Cache-Control" = String, description = "`immutable`: keep it for ever."),
                ("Content-Disposition" = String, description = "A name for the file: of CSV, NPZ and \
                    Arrow."),
            )),
        (status = 304, description = "The held copy is still right. It always is."),
        (status = 404, description = "No result has this key. `Link` leads to its job, if one is \
            under way.", headers(("Link" = String, description = "`rel=\"related\"`."))),
        (status = 410, description = "The result was dropped to make room; `scenario` is what it was \
            computed from."),
        (status = 406, description = "The history is available as JSON, NDJSON, CSV, NPZ and Arrow."),
    ),
)]
pub async fn history(
    State(app): State<App>,
    Segment(key): Segment,
    headers: HeaderMap,
    query: Query,
) -> Result<Response, Problem> {
    answer(&app, (&key, Part::History), &headers, query).await
}

/// Returns the profiles of a result: worn shape, wear, pressure and slip over the radius.
///
/// Formats with rows have one per instant and radius: `cycles,radius,…`; in NPZ an array has a row per
/// instant and a column per radius. An infinite pressure is null in JSON, NDJSON and Arrow, empty in
/// CSV and NaN in NPZ. A result computed with `profiles_at: "none"` has no profiles: null in JSON, no
/// rows otherwise.
#[utoipa::path(get, path = "/v1/results/{key}/profiles", operation_id = "get_profiles", tag = "results",
    params(
        ("key" = super::openapi::KeyText, Path, description = "The `key` of a job or a checked scenario."),
        ("format" = Option<super::openapi::TableFormat>, Query, description = "Wins over `Accept`."),
        ("layout" = Option<super::openapi::Layout>, Query, description = "Of JSON: an array per quantity \
            (`columns`, the default), or a list of rows under `records`."),
        ("fields" = Option<String>, Query, description = "Only these columns, separated by commas; \
            `cycles` and `radius` always come along.", example = "wear,pressure"),
        ("cycles" = Option<String>, Query, description = "Only these instants, separated by commas.",
            example = "0"),
        ("points" = Option<u32>, Query, description = "At most so many radii, evenly spread.",
            minimum = 2, maximum = 4096, example = 200),
        ("digits" = Option<u32>, Query, description = "Rounds every number to so many significant \
            digits. Up to 7, arrays in NPZ and Arrow are float32, but for columns with numbers below \
            1.2e-38.", minimum = 1, maximum = 17, example = 7),
        ("units" = Option<super::openapi::UnitSystem>, Query, description = "`si` (the default), or \
            `engineering`: um, mm^3, MPa (moduli too), mJ, N, mm^3/(N m). The member `units` and the \
            headers say which.", example = "engineering"),
        ("If-None-Match" = Option<String>, Header, description = "The `ETag` of a held copy."),
        ("Accept-Encoding" = Option<String>, Header, description = "`zstd` or `gzip`; NPZ is compressed \
            in itself."),
    ),
    responses(
        (status = 200, description = "The profiles.", content(
            (ref("#/components/schemas/ProfilesAnswer") = "application/json"),
            (String = "application/x-ndjson"),
            (String = "text/csv"),
            (super::openapi::File = "application/x-npz"),
            (super::openapi::File = "application/vnd.apache.arrow.file"),
        ), headers(
                ("ETag" = String, description = "The tag of this representation; weak where it is \
                    compressed."),
                ("Cache-Control" = String, description = "`immutable`: keep it for ever."),
                ("Content-Disposition" = String, description = "A name for the file: of CSV, NPZ and \
                    Arrow."),
            )),
        (status = 304, description = "The held copy is still right. It always is."),
        (status = 404, description = "No result has this key. `Link` leads to its job, if one is \
            under way.", headers(("Link" = String, description = "`rel=\"related\"`."))),
        (status = 410, description = "The result was dropped to make room; `scenario` is what it was \
            computed from."),
        (status = 406, description = "The profiles are available as JSON, NDJSON, CSV, NPZ and Arrow."),
    ),
)]
pub async fn profiles(
    State(app): State<App>,
    Segment(key): Segment,
    headers: HeaderMap,
    query: Query,
) -> Result<Response, Problem> {
    answer(&app, (&key, Part::Profiles), &headers, query).await
}

/// Returns the force–displacement loops of a result, at the instants of its profiles.
///
/// Each loop is a cycle from one turning point over the other back to the first, with a point wherever
/// another spring of the contact starts to slip: straight lines between the points enclose the energy of
/// the cycle, and loops may differ in their number of points. Loops of a displacement record are its
/// outermost. `energy_ratio`, `slip_ratio` and `free_ratio` are the criteria A, D and B of the sliding
/// transition. Formats with rows have one per instant and point; in NPZ an array has a row per instant,
/// and shorter loops end in NaN. A result computed with `profiles_at: "none"` has no loops.
#[utoipa::path(get, path = "/v1/results/{key}/loops", operation_id = "get_loops", tag = "results",
    params(
        ("key" = super::openapi::KeyText, Path, description = "The `key` of a job or a checked scenario."),
        ("format" = Option<super::openapi::TableFormat>, Query, description = "Wins over `Accept`."),
        ("layout" = Option<super::openapi::Layout>, Query, description = "Of JSON: an array per quantity \
            (`columns`, the default), or a list of rows under `records`."),
        ("fields" = Option<String>, Query, description = "Only these columns, separated by commas; \
            `cycles` always comes along.", example = "displacement,tangential_force"),
        ("cycles" = Option<String>, Query, description = "Only these instants, separated by commas.",
            example = "0"),
        ("digits" = Option<u32>, Query, description = "Rounds every number to so many significant \
            digits. Up to 7, arrays in NPZ and Arrow are float32, but for columns with numbers below \
            1.2e-38.", minimum = 1, maximum = 17, example = 7),
        ("units" = Option<super::openapi::UnitSystem>, Query, description = "`si` (the default), or \
            `engineering`: um, mm^3, MPa (moduli too), mJ, N, mm^3/(N m). The member `units` and the \
            headers say which.", example = "engineering"),
        ("If-None-Match" = Option<String>, Header, description = "The `ETag` of a held copy."),
        ("Accept-Encoding" = Option<String>, Header, description = "`zstd` or `gzip`; NPZ is compressed \
            in itself."),
    ),
    responses(
        (status = 200, description = "The loops.", content(
            (ref("#/components/schemas/LoopsAnswer") = "application/json"),
            (String = "application/x-ndjson"),
            (String = "text/csv"),
            (super::openapi::File = "application/x-npz"),
            (super::openapi::File = "application/vnd.apache.arrow.file"),
        ), headers(
                ("ETag" = String, description = "The tag of this representation; weak where it is \
                    compressed."),
                ("Cache-Control" = String, description = "`immutable`: keep it for ever."),
                ("Content-Disposition" = String, description = "A name for the file: of CSV, NPZ and \
                    Arrow."),
            )),
        (status = 304, description = "The held copy is still right. It always is."),
        (status = 404, description = "No result has this key. `Link` leads to its job, if one is \
            under way.", headers(("Link" = String, description = "`rel=\"related\"`."))),
        (status = 410, description = "The result was dropped to make room; `scenario` is what it was \
            computed from."),
        (status = 406, description = "The loops are available as JSON, NDJSON, CSV, NPZ and Arrow."),
    ),
)]
pub async fn loops(
    State(app): State<App>,
    Segment(key): Segment,
    headers: HeaderMap,
    query: Query,
) -> Result<Response, Problem> {
    answer(&app, (&key, Part::Loops), &headers, query).await
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
