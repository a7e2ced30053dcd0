//! The library of results: finding them, trusting them, saying something of them, deleting them.

use axum::extract::State;
use axum::http::{StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use deserr::{Deserr, IntoValue as _, ValuePointerRef};
use serde::Serialize;
use serde_json::{Map, Value, json};
use utoipa::ToSchema;

use super::App;
use super::caller::{Caller, ME};
use super::jobs::next_page;
use super::problem::{self, Problem};
use super::representation::find;
use super::results::read_key;
use super::scenarios::Unsound;
use super::wire::{self, Body, NoQuery, Query, Segment, instant};
use crate::job::Key;
use crate::store::{self, Listed, Removed, SCALARS, Search, WORDS};
use fretwork_engine::request::fault::{Fault, Faults};

/// How many results a page has unless told.
const PAGE: u32 = 50;
/// How many results a page may have.
const LONGEST_PAGE: u32 = 1000;

/// What somebody says of a result.
#[derive(Debug, Serialize, ToSchema)]
pub struct Note {
    /// What is said.
    #[schema(example = "Agrees with the rig of 2025-11.")]
    text: String,
    /// Who says it.
    owner: String,
    /// Since when: RFC 3339, UTC.
    #[schema(format = "date-time")]
    at: String,
}

impl From<store::Note> for Note {
    fn from(note: store::Note) -> Self {
        Self { text: note.text, owner: note.owner, at: instant(note.at) }
    }
}

/// A result in a list: what it was computed from and what came out, in SI.
#[derive(Debug, Serialize, ToSchema)]
pub struct ResultEntry {
    /// Its address.
    #[schema(value_type = String, pattern = "^[0-9a-f]{64}$")]
    key: Key,
    /// When it was first known here: RFC 3339, UTC.
    #[schema(format = "date-time")]
    created: String,
    /// For whom it was computed; null if that is not known.
    owner: Option<String>,
    /// Bytes of the whole result.
    size: u64,
    /// Whether it is kept whatever room it takes.
    pinned: bool,
    /// When its body was dropped; null if it is there.
    #[schema(format = "date-time")]
    evicted: Option<String>,
    /// What somebody says of it.
    note: Option<Note>,
    /// `shape`, `method`, `regime`, `held` (of the load) and `motion`.
    #[serde(flatten)]
    #[schema(value_type = Object)]
    words: Map<String, Value>,
    /// Parameters and the last entry of the history by their names; null where a result has none.
    /// `normal_force` to `tangential_force` are of the unworn contact.
    #[schema(value_type = Object)]
    values: Map<String, Value>,
    /// The address of the result.
    #[schema(
        example = "/v1/results/7262301ee85039ba4e113b17570ed2e12a9a7b34bc20bf05a1cbfc9b16860c41"
    )]
    link: String,
}

impl From<Listed> for ResultEntry {
    fn from(listed: Listed) -> Self {
        let Listed { key, created, owner, size, pinned, evicted, note, outline } = listed;
        Self {
            key,
            created: instant(created),
            owner,
            size,
            pinned,
            evicted: evicted.map(instant),
            note: note.map(Note::from),
            words: outline.words().map(|(name, word)| (name.to_owned(), json!(word))).collect(),
            values: outline
                .scalars()
                .map(|(name, value)| (name.to_owned(), json!(value)))
                .collect(),
            link: format!("/v1/results/{key}"),
        }
    }
}

/// A page of results.
#[derive(Debug, Serialize, ToSchema)]
pub struct ResultList {
    /// The results.
    results: Vec<ResultEntry>,
    /// The unit of each member of `values`.
    #[schema(value_type = Object)]
    units: Map<String, Value>,
    /// The address of the next page; null on the last.
    next: Option<String>,
}

/// The parameters of [`list`] beside `limit` and `cursor`, as the document has them.
pub(super) fn parameters() -> Vec<Value> {
    let parameter = |name: &str, description: String, schema: Value| {
        let at = json!({"name": name, "in": "query", "required": false});
        let mut parameter = at;
        parameter["description"] = description.into();
        parameter["schema"] = schema;
        parameter
    };
    let text = || json!({"type": "string"});
    let mut all = Vec::new();
    for word in WORDS {
        let words = json!({"type": "string", "enum": word.values});
        all.push(parameter(word.name, format!("Results with this `{}`.", word.name), words));
    }
    for scalar in SCALARS {
        let unit = match scalar.unit() {
            "1" => "a plain number".to_owned(),
            unit => format!("in {unit} or with units"),
        };
        let what = format!(
            "Results whose `{}` lies in this range: `a..b`, `a..`, `..b` or a single value, {unit}. \
             Compared to 9 digits.",
            scalar.name,
        );
        all.push(parameter(scalar.name, what, text()));
    }
    let order = ["created", "size"].into_iter().chain(SCALARS.iter().map(|scalar| scalar.name));
    let orders: Vec<String> =
        order.flat_map(|name| [name.to_owned(), format!("-{name}")]).collect();
    let order = json!({"type": "string", "enum": orders, "default": "-created"});
    let flag = || json!({"type": "boolean"});
    let others = [
        (
            "created",
            "First known here in this range of days or moments: `2026-01-31..`. A day is the whole \
             day, UTC.",
            text(),
        ),
        ("size", "Of so many bytes: a range like those of quantities.", text()),
        ("owner", "Computed for this owner; `me`: for the caller.", text()),
        ("pinned", "Whether they are pinned.", flag()),
        (
            "evicted",
            "`true`: results whose body was dropped, instead of those that are there.",
            flag(),
        ),
        ("note", "Results whose note contains this text, in whatever case.", text()),
        (
            "tag",
            "Results that a job with this tag asked for, among the jobs that the caller may see.",
            text(),
        ),
        (
            "label",
            "Results that a job with this label asked for, among the jobs that the caller may see.",
            text(),
        ),
        (
            "sort",
            "By what they are ordered, after a minus sign the largest first. Results without \
            it come last.",
            order,
        ),
    ];
    all.extend(others.map(|(name, what, schema)| parameter(name, what.to_owned(), schema)));
    all
}

/// Lists results: the team's cache, by what was asked and what came out.
///
/// All filters given must hold. A range is `a..b`, `a..`, `..b` or a single value, in SI or with units:
/// `friction=0.6..0.8`, `wear_depth=..2 um`, `normal_force=50 N..0.2 kN`. The list is complete at the
/// moment of the request. The address of the next page is in `next` and in the `Link` header.
#[utoipa::path(get, path = "/v1/results", operation_id = "list_results", tag = "results",
    params(
        ("limit" = Option<u32>, Query, description = "How many results at most.", minimum = 1,
            maximum = 1000, example = 50),
        ("cursor" = Option<String>, Query, description = "Goes on behind a page; comes from its `next`."),
    ),
    responses(
        (status = 200, description = "A page of results, in SI.", body = ResultList, headers(
            ("Link" = String, description = "The address of the next page, `rel=\"next\"`."),
        )),
        (status = 507, description = "The disk is full."),
    ),
)]
pub async fn list(
    State(app): State<App>,
    caller: Caller,
    uri: Uri,
    mut query: Query,
) -> Result<Response, Problem> {
    let mut search = Search::default();
    search.only_jobs_of(caller.reach());
    for name in Search::names() {
        let text = query.text(name);
        // What is in the library has an owner's name, and `me` is one only here.
        let own = |text: String| if text == ME { caller.owner.clone() } else { text };
        if let Some(text) = if name == "owner" { text.map(own) } else { text }
            && let Err(fault) = search.set(name, &text)
        {
            query.complain(name, fault);
        }
    }
    let limit = query.value("limit", &format!("a number from 1 to {LONGEST_PAGE}"), |text| {
        text.parse().ok().filter(|limit| (1..=LONGEST_PAGE).contains(limit))
    });
    let cursor = query.value("cursor", "the cursor of a page", |text| text.parse().ok());
    query.finish()?;
    let found = app.store.search(&search, cursor, limit.unwrap_or(PAGE)).await?;
    let next = found.next.map(|cursor| next_page(&uri, cursor));
    let link = next.as_ref().map(|next| [(header::LINK, format!("<{next}>; rel=\"next\""))]);
    let results = found.results.into_iter().map(ResultEntry::from).collect();
    let units = SCALARS.iter().map(|scalar| (scalar.name.to_owned(), json!(scalar.unit())));
    let fresh = [(header::CACHE_CONTROL, "no-store")];
    Ok((link, fresh, axum::Json(ResultList { results, units: units.collect(), next }))
        .into_response())
}

/// Where a result comes from. What is not known of results of earlier versions is null.
#[derive(Debug, Serialize, ToSchema)]
pub struct Provenance {
    /// Its address.
    #[schema(value_type = String, pattern = "^[0-9a-f]{64}$")]
    key: Key,
    /// When the key was first known here: RFC 3339, UTC, like the times below.
    #[schema(format = "date-time")]
    created: String,
    /// For whom, when and at what cost it was computed.
    computed: Computation,
    /// What computed it.
    program: Option<Program>,
    /// How many jobs named it, of those that are kept.
    #[schema(example = 3)]
    jobs: u64,
    /// Whether it is kept whatever room it takes.
    pinned: bool,
    /// What somebody says of it.
    note: Option<Note>,
    /// When it was last read, to about a minute.
    #[schema(format = "date-time")]
    last_access: String,
    /// When its body was dropped; null if it is there.
    #[schema(format = "date-time")]
    evicted: Option<String>,
    /// Who had it deleted; null if it was dropped to make room.
    deleted_by: Option<String>,
    /// By what the bytes of `GET /v1/results/{key}` are known.
    body: BodySum,
    /// From where it was imported; null if it was computed here.
    imported: Option<Import>,
}

/// For whom, when and at what cost a result was computed.
#[derive(Debug, Serialize, ToSchema)]
struct Computation {
    /// For whom.
    owner: Option<String>,
    /// When it was done.
    #[schema(format = "date-time")]
    at: Option<String>,
    /// Seconds by the clock.
    wall_seconds: Option<f64>,
    /// Seconds of a processor.
    cpu_seconds: Option<f64>,
    /// The id of the job that had it computed.
    job: Option<String>,
    /// The id of the request that submitted the job, as in the server's log.
    request: Option<String>,
}

/// A version of the program on a machine.
#[derive(Debug, Serialize, ToSchema)]
struct Program {
    /// The release.
    #[schema(example = "0.1.0")]
    version: String,
    /// The version of the digits.
    #[schema(example = 1)]
    numerics: u32,
    /// The name of the machine; null, like the next two, where an imported file does not say.
    host: Option<String>,
    /// Its kind of processor.
    #[schema(example = "x86_64")]
    architecture: Option<String>,
    /// How many of them it has.
    processors: Option<u32>,
}

/// By what the bytes of a result are known.
#[derive(Debug, Serialize, ToSchema)]
struct BodySum {
    /// How many there are.
    bytes: u64,
    /// Their SHA-256.
    #[schema(value_type = String, pattern = "^[0-9a-f]{64}$")]
    sha256: Key,
}

/// From where a result was imported.
#[derive(Debug, Serialize, ToSchema)]
struct Import {
    /// The name of the file.
    from: String,
    /// When.
    #[schema(format = "date-time")]
    at: String,
}

impl Provenance {
    fn of(key: Key, known: store::Provenance) -> Self {
        let request = known.trace.as_deref().and_then(|trace| trace.split(' ').next());
        let request = request.filter(|id| !id.is_empty()).map(str::to_owned);
        Self {
            key,
            created: instant(known.created),
            computed: Computation {
                owner: known.owner,
                at: known.computed.map(instant),
                wall_seconds: known.wall,
                cpu_seconds: known.cpu,
                job: known.job.map(|job| job.to_string()),
                request,
            },
            program: known.program.map(|program| Program {
                version: program.version,
                numerics: program.numerics,
                host: Some(program.host).filter(|host| !host.is_empty()),
                architecture: Some(program.architecture).filter(|kind| !kind.is_empty()),
                processors: Some(program.processors).filter(|count| *count > 0),
            }),
            jobs: known.jobs,
            pinned: known.pinned,
            note: known.note.map(Note::from),
            last_access: instant(known.last_access),
            evicted: known.evicted.map(instant),
            deleted_by: known.deleted_by,
            body: BodySum { bytes: known.size, sha256: known.sha256 },
            imported: known.imported.map(|(at, from)| Import { from, at: instant(at) }),
        }
    }
}

fn unknown() -> Problem {
    let detail = "No result has this key; submit its scenario to POST /v1/jobs.";
    Problem::new(&problem::UNKNOWN_RESULT, detail)
}

/// Says where a result comes from: for whom, when, by what and at what cost it was computed.
///
/// `body.sha256` is the digest of the bytes that `GET /v1/results/{key}` answers as JSON, for whoever
/// has a copy. It is known of results whose body was dropped, too.
#[utoipa::path(get, path = "/v1/results/{key}/provenance", operation_id = "get_provenance", tag = "results",
    params(("key" = super::openapi::KeyText, Path, description = "The `key` of a result.")),
    responses(
        (status = 200, description = "Where it comes from.", body = Provenance),
    ),
)]
pub async fn provenance(
    State(app): State<App>,
    Segment(key): Segment,
    _: NoQuery,
) -> Result<Response, Problem> {
    let key = read_key(&key)?;
    let known = app.store.provenance(&key).await?.ok_or_else(unknown)?;
    let fresh = [(header::CACHE_CONTROL, "no-store")];
    Ok((fresh, axum::Json(Provenance::of(key, known))).into_response())
}

/// What is to be said of a result.
#[derive(Debug, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct NoteBody {
    /// The text, of lines.
    text: String,
}

/// Parses a body with all its faults.
pub(super) fn read<T: Deserr<Faults>>(body: &Body) -> Result<T, Problem> {
    if body.0.iter().all(u8::is_ascii_whitespace) {
        return Err(Unsound::Empty.into());
    }
    let (value, mut faults) = wire::parse(&body.0).map_err(Unsound::Json)?;
    match T::deserialize_from_value(value.into_value(), ValuePointerRef::Origin) {
        Ok(read) if faults.is_empty() => return Ok(read),
        Ok(_) => {}
        Err(more) => faults.extend(more.0),
    }
    Err(Problem::faults(faults))
}

/// Writes a note to a result. There is one per result; a new one takes the place of the old one.
///
/// It is shown in the provenance and in lists with who wrote it and when, and stays when the body is
/// dropped: for a year, like all that is known of such a result.
#[utoipa::path(put, path = "/v1/results/{key}/note", operation_id = "put_note", tag = "results",
    params(("key" = super::openapi::KeyText, Path, description = "The `key` of a result.")),
    request_body(content = ref("#/components/schemas/NoteBody"), description = "What is to be said.",
        example = json!({"text": "Agrees with the rig of 2025-11."})),
    responses(
        (status = 204, description = "The note is kept."),
    ),
)]
pub async fn note(
    State(app): State<App>,
    caller: Caller,
    Segment(key): Segment,
    _: NoQuery,
    body: Body,
) -> Result<StatusCode, Problem> {
    let key = read_key(&key)?;
    let NoteBody { text } = read(&body)?;
    if let Some(detail) = store::Note::fault(&text) {
        return Err(Problem::faults(vec![Fault { pointer: "/text".to_owned(), detail }]));
    }
    let known = app.store.annotate(&key, Some(text), caller.owner).await?;
    if known { Ok(StatusCode::NO_CONTENT) } else { Err(unknown()) }
}

/// Takes the note off a result.
///
/// A result without a note stays as it is.
#[utoipa::path(delete, path = "/v1/results/{key}/note", operation_id = "delete_note", tag = "results",
    params(("key" = super::openapi::KeyText, Path, description = "The `key` of a result.")),
    responses(
        (status = 204, description = "There is no note."),
    ),
)]
pub async fn delete_note(
    State(app): State<App>,
    caller: Caller,
    Segment(key): Segment,
    _: NoQuery,
) -> Result<StatusCode, Problem> {
    let known = app.store.annotate(&read_key(&key)?, None, caller.owner).await?;
    if known { Ok(StatusCode::NO_CONTENT) } else { Err(unknown()) }
}

/// Deletes a result.
///
/// Its address then answers 410 with the scenario, as after the result was dropped to make room; the
/// same scenario computes it again. Jobs that asked for it stay. A pinned result is not deleted.
#[utoipa::path(delete, path = "/v1/results/{key}", operation_id = "delete_result", tag = "results",
    params(("key" = super::openapi::KeyText, Path, description = "The `key` of a result.")),
    responses(
        (status = 204, description = "The result is gone."),
        (status = 409, description = "The result is pinned; take the pin off first."),
        (status = 410, description = "The result is gone already; `scenario` is what it was computed \
            from."),
    ),
)]
pub async fn delete(
    State(app): State<App>,
    caller: Caller,
    Segment(key): Segment,
    _: NoQuery,
) -> Result<StatusCode, Problem> {
    let key = read_key(&key)?;
    loop {
        let (here, owner) = (app.clone(), caller.owner.clone());
        // Whether or not the client waits for it: what is deleted must be forgotten.
        #[expect(clippy::disallowed_methods, reason = "it ends by itself")]
        let removing = tokio::spawn(async move {
            let removed = here.store.remove(&key, owner).await?;
            if removed != Removed::Pinned {
                // Also what was dropped to make room may still be in memory.
                here.memory.forget(&key);
            }
            Ok::<_, Problem>(removed)
        });
        match removing.await.map_err(|_| Problem::internal())?? {
            Removed::Done => return Ok(StatusCode::NO_CONTENT),
            Removed::Pinned => {
                let detail = format!(
                    "The result is pinned; DELETE /v1/results/{key}/pin first if it is to go."
                );
                return Err(Problem::new(&problem::PINNED, detail));
            }
            Removed::NotFound => {
                // It says why there is nothing to delete, unless it has come to be meanwhile.
                find(&app, caller.reach(), &key).await?;
            }
        }
    }
}
