//! Stored results: provenance, notes, deletion. `search` lists them.

use axum::http::header::{ETAG, IF_MATCH};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse as _, Response};
use deserr::Deserr;
use serde::Serialize;
use serde_json::{Value, json};
use utoipa::ToSchema;

use crate::http::answer::stored::require;
use crate::http::api::jobs::unverified;
use crate::http::api::parameters::ResultKey;
use crate::http::wire::words;
use crate::http::{
    App, Body, Caller, Fresh, NoQuery, Problem, Result, Segment, instant, kinds, read_key,
};
use fretwork_engine::{Faults, Warning};
use fretwork_job::{Key, Verified, earlier};
use fretwork_json::{read_body, typed};
use fretwork_store::{self as store, Annotated, Annotator, Removed};

/// What a user wrote about a result.
#[derive(Debug, Serialize, ToSchema)]
pub struct Note {
    /// The text.
    #[schema(example = "Agrees with the rig of 2025-11.")]
    pub(super) text: String,
    /// Who wrote it.
    owner: String,
    /// When it was written: RFC 3339, UTC.
    #[schema(format = "date-time")]
    at: String,
    /// Whether only its owner sees it.
    private: bool,
    /// Its entity tag: send it as `If-Match` to change the note that you have read, and no later one.
    #[schema(example = "\"5f3a9c0b1d2e4f60\"")]
    etag: String,
}

impl From<store::Note> for Note {
    fn from(note: store::Note) -> Self {
        let (at, etag) = (instant(note.at), note.tag());
        Self { text: note.text, owner: note.owner, at, private: note.private, etag }
    }
}

/// Who computed a result, when, and with which program. Values that the server does not know are null.
#[derive(Debug, Serialize, ToSchema)]
pub struct Provenance {
    /// Its key.
    #[schema(value_type = String, pattern = "^[0-9a-f]{64}$")]
    key: Key,
    /// When this server first stored the key: RFC 3339, UTC, like the times below.
    #[schema(format = "date-time")]
    created: String,
    /// Who computed it, when, and how long it took.
    computed: Computation,
    /// The warnings about the two bodies in the submission that computed it: a list of `{kind, detail}`. The
    /// result has the other warnings.
    #[schema(value_type = Option<Vec<Warning>>)]
    warnings: Option<Value>,
    /// The program that computed it.
    program: Option<Program>,
    /// The number of stored jobs with this key.
    #[schema(example = 3)]
    jobs: u64,
    /// Whether it is pinned: never evicted.
    pinned: bool,
    /// Who pinned it; null if it is not pinned, or if that is unknown.
    pinned_by: Option<String>,
    /// Its note.
    note: Option<Note>,
    /// When it was last read, with a resolution of about one minute.
    #[schema(format = "date-time")]
    last_access: String,
    /// When it was evicted or deleted; null if it is stored.
    #[schema(format = "date-time")]
    evicted: Option<String>,
    /// Who deleted it; null if it was evicted to free space.
    deleted_by: Option<String>,
    /// Size and digest of the bytes of `GET /v1/results/{key}`.
    body: BodySum,
    /// The import that brought it; null if it was computed here.
    imported: Option<Import>,
}

/// Who computed a result, when, and how long it took.
#[derive(Debug, Serialize, ToSchema)]
struct Computation {
    /// The owner of the job.
    owner: Option<String>,
    /// When the computation ended.
    #[schema(format = "date-time")]
    at: Option<String>,
    /// Wall-clock time in seconds.
    wall_seconds: Option<f64>,
    /// Processor time in seconds.
    cpu_seconds: Option<f64>,
    /// The id of the job that computed it.
    job: Option<String>,
    /// The id of the request that submitted the job, as in the log of the server.
    request: Option<String>,
}

/// A version of the program on a machine.
#[derive(Debug, Serialize, ToSchema)]
struct Program {
    /// The version of the program.
    #[schema(example = "0.1.0")]
    version: String,
    /// The `numerics` version of the engine.
    #[schema(example = 1)]
    numerics: u32,
    /// The host name; like the next two, null if an imported file does not have it.
    host: Option<String>,
    /// The processor architecture.
    #[schema(example = "x86_64")]
    architecture: Option<String>,
    /// The number of processors.
    processors: Option<u32>,
}

/// Size and digest of a result.
#[derive(Debug, Serialize, ToSchema)]
struct BodySum {
    /// Size in bytes.
    bytes: u64,
    /// SHA-256 of the bytes.
    #[schema(value_type = String, pattern = "^[0-9a-f]{64}$")]
    sha256: Key,
}

/// The import of a result.
#[derive(Debug, Serialize, ToSchema)]
struct Import {
    /// The name of the imported file.
    from: String,
    /// When it was imported.
    #[schema(format = "date-time")]
    at: String,
    /// How much of it this server computed again: `all`, some random `rows` of a study, or `none`. Null if an earlier
    /// version of fretwork imported it.
    #[schema(example = "all", pattern = "^(all|rows|none)$")]
    verified: Option<&'static str>,
    /// The number of these rows.
    verified_rows: Option<u64>,
}

impl From<store::FromFile> for Import {
    fn from(import: store::FromFile) -> Self {
        let (verified, verified_rows) = match import.verified {
            Some(Verified::All) => (Some("all"), None),
            Some(Verified::Rows(rows)) => (Some("rows"), Some(rows)),
            Some(Verified::No) => (Some("none"), None),
            None => (None, None),
        };
        Self { from: import.from, at: instant(import.at), verified, verified_rows }
    }
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
            warnings: known.warnings,
            program: known.program.map(|program| Program {
                version: program.version,
                numerics: program.numerics,
                host: Some(program.host).filter(|host| !host.is_empty()),
                architecture: Some(program.architecture).filter(|kind| !kind.is_empty()),
                processors: Some(program.processors).filter(|count| *count > 0),
            }),
            jobs: known.jobs,
            pinned: known.pinned,
            pinned_by: known.pinned_by,
            note: known.note.map(Note::from),
            last_access: instant(known.last_access),
            evicted: known.evicted.map(instant),
            deleted_by: known.deleted_by,
            body: BodySum { bytes: known.size, sha256: known.sha256 },
            imported: known.imported.map(Import::from),
        }
    }
}

/// The problem for a key that the server does not know.
pub(super) fn unknown() -> Problem {
    let detail = "No result has this key; submit its scenario to POST /v1/jobs.";
    Problem::new(&kinds::UNKNOWN_RESULT, detail)
}

/// Tells who computed a result, when, with which program, and how long it took.
///
/// `body.sha256` is the digest of the JSON bytes of `GET /v1/results/{key}`, so that a client can check a
/// copy. Evicted and deleted results have it too.
#[utoipa::path(get, path = "/v1/results/{key}/provenance", operation_id = "get_provenance", tag = "results",
    params(ResultKey),
    responses(
        (status = 200, description = "The provenance of the result.", body = Provenance),
    ),
)]
pub async fn provenance(
    app: App,
    caller: Caller,
    key: Segment,
    _: NoQuery,
) -> Result<Fresh<Provenance>> {
    let key = read_key(&key)?;
    let known = app.store.provenance(&key, &caller.owner).await?.ok_or_else(unknown)?;
    Ok(Fresh(Provenance::of(key, known)))
}

/// The warnings about a result that it does not contain.
#[derive(Debug, Serialize, ToSchema)]
pub struct SubmissionWarnings {
    /// A list of `{kind, detail}`; null if there is nothing to say, and the server does not know the submission.
    #[schema(value_type = Option<Vec<Warning>>)]
    warnings: Option<Value>,
}

/// Returns the warnings about a result that the result itself does not contain.
///
/// `elastic_mismatch` and `yield` follow from the bodies in the submission that computed it: the key does not contain the
/// bodies. `earlier_version` says that an earlier version of the engine computed the result, and what was wrong with it,
/// `unverified` that an import brought it and did not compute it again. Links open this address too.
#[utoipa::path(get, path = "/v1/results/{key}/warnings", operation_id = "get_warnings", tag = "results",
    params(ResultKey),
    responses(
        (status = 200, description = "The warnings.", body = SubmissionWarnings),
    ),
)]
pub async fn warnings(app: App, key: Segment, _: NoQuery) -> Result<Fresh<SubmissionWarnings>> {
    let key = read_key(&key)?;
    let provenance = app.store.provenance(&key, "").await?.ok_or_else(unknown)?;
    let known = app.store.known(&key).await?.ok_or_else(unknown)?;
    let told = |detail| json!({"kind": "earlier_version", "detail": detail});
    let earlier = earlier::doubt(known.numerics, &known.asked.value).map(told);
    let unverified = unverified(provenance.imported.and_then(|import| import.verified));
    let own = provenance.warnings.as_ref().and_then(Value::as_array);
    let all = own.into_iter().flatten().cloned().chain(earlier).chain(unverified);
    let all: Vec<_> = all.collect();
    let warnings = (own.is_some() || !all.is_empty()).then(|| all.into());
    Ok(Fresh(SubmissionWarnings { warnings }))
}

/// A note on a result.
#[derive(Debug, Deserr, ToSchema)]
#[deserr(error = Faults, deny_unknown_fields)]
#[serde(deny_unknown_fields)]
pub struct NoteBody {
    /// Lines of text, without control characters other than line breaks and tabs.
    #[schema(min_length = 1, max_length = 4000)]
    text: String,
}

/// Parses a JSON body and collects all its faults.
pub(super) fn read<T: Deserr<Faults>>(body: &Body) -> Result<T> {
    Ok(read_body(&body.0.bytes, typed)?)
}

/// Who changes a note, and which one it has read.
fn annotator(caller: &Caller, headers: &HeaderMap) -> Annotator {
    let read = headers.get(IF_MATCH).map(|_| words(headers, IF_MATCH).map(str::to_owned).collect());
    Annotator { by: caller.actor(), private: caller.private, read }
}

/// The answer to a change of a note.
fn annotated(annotated: Annotated) -> Result<StatusCode> {
    let detail = match annotated {
        Annotated::Done => return Ok(StatusCode::NO_CONTENT),
        Annotated::NotFound => return Err(unknown()),
        Annotated::Unread(Some(store::Note { owner, .. })) => {
            format!("{owner:?} wrote the present note. Read it, and send its `etag` as If-Match.")
        }
        Annotated::Unread(None) => "There is no note now. Send no If-Match.".to_owned(),
    };
    Err(Problem::new(&kinds::NOTE_CHANGED, detail))
}

/// Returns the note of a result.
///
/// A result has one note for all who may read. The holder of a key with private names sees its own note in its place. Provenance
/// and lists show the note, too.
#[utoipa::path(get, path = "/v1/results/{key}/note", operation_id = "get_note", tag = "results",
    params(ResultKey),
    responses(
        (status = 200, description = "The note.", body = Note,
            headers(("ETag" = String, description = "The `etag` of the note."))),
        (status = 404, description = "The result has no note, or no result has this key."),
    ),
)]
pub async fn show_note(app: App, caller: Caller, key: Segment, _: NoQuery) -> Result<Response> {
    let provenance = app.store.provenance(&read_key(&key)?, &caller.owner).await?;
    let missing = || Problem::new(&kinds::NOT_FOUND, "The result has no note. PUT writes one.");
    let note = Note::from(provenance.ok_or_else(unknown)?.note.ok_or_else(missing)?);
    Ok(([(ETAG, note.etag.clone())], Fresh(note)).into_response())
}

/// Writes the note of a result, in place of the present one.
///
/// A note of somebody else is replaced only with its `etag` as `If-Match`, so that nobody replaces a note unread. The note of the
/// holder of a key with private names replaces no other. A note stays for a year after the result was evicted or deleted.
#[utoipa::path(put, path = "/v1/results/{key}/note", operation_id = "put_note", tag = "results",
    params(ResultKey, ("If-Match" = Option<String>, Header, description = "The `etag` of the note that the client has read.")),
    request_body(content = NoteBody, description = "The note.",
        example = json!({"text": "Agrees with the rig of 2025-11."})),
    responses(
        (status = 204, description = "The note is stored."),
        (status = 412, description = "Somebody else wrote the note, and `If-Match` is missing or not its `etag`."),
    ),
)]
pub async fn note(
    app: App,
    caller: Caller,
    key: Segment,
    headers: HeaderMap,
    _: NoQuery,
    body: Body,
) -> Result<StatusCode> {
    let NoteBody { text } = read(&body)?;
    if let Some(detail) = store::Note::fault(&text) {
        return Err(Problem::from(Faults::one("/text", detail)));
    }
    let by = annotator(&caller, &headers);
    annotated(app.store.annotate(read_key(&key)?, Some(text), by).await?)
}

/// Deletes the note of a result.
///
/// If there is no note, nothing changes. A note of somebody else is deleted only with its `etag` as `If-Match`.
#[utoipa::path(delete, path = "/v1/results/{key}/note", operation_id = "delete_note", tag = "results",
    params(ResultKey, ("If-Match" = Option<String>, Header, description = "The `etag` of the note that the client has read.")),
    responses(
        (status = 204, description = "The result has no note."),
        (status = 412, description = "Somebody else wrote the note, and `If-Match` is missing or not its `etag`."),
    ),
)]
pub async fn delete_note(
    app: App,
    caller: Caller,
    key: Segment,
    headers: HeaderMap,
    _: NoQuery,
) -> Result<StatusCode> {
    let by = annotator(&caller, &headers);
    annotated(app.store.annotate(read_key(&key)?, None, by).await?)
}

/// Deletes a result.
///
/// Afterwards its path answers 410 with the scenario, as after an eviction. A new job with the same
/// scenario computes it again. Its jobs stay. A pinned result cannot be deleted.
#[utoipa::path(delete, path = "/v1/results/{key}", operation_id = "delete_result", tag = "results",
    params(ResultKey),
    responses(
        (status = 204, description = "The result is deleted."),
        (status = 409, description = "The result is pinned. Unpin it first."),
        (status = 410, description = "The result was evicted or deleted before. `scenario` is its \
            scenario."),
    ),
)]
pub async fn delete(app: App, caller: Caller, key: Segment, _: NoQuery) -> Result<StatusCode> {
    let key = read_key(&key)?;
    loop {
        let (here, by) = (app.clone(), caller.actor());
        // This is a task of its own, because it must clear the memory even if the client disconnects.
        #[expect(clippy::disallowed_methods, reason = "the task ends by itself")]
        let removing = tokio::spawn(async move {
            let removed = here.store.remove(&key, by).await?;
            if removed != Removed::Pinned {
                // An evicted result may still be in memory.
                here.memory.forget(&key);
            }
            Ok::<_, Problem>(removed)
        });
        match removing.await.map_err(Problem::bug)?? {
            Removed::Done => return Ok(StatusCode::NO_CONTENT),
            Removed::Pinned => {
                let detail =
                    format!("The result is pinned. Send DELETE /v1/results/{key}/pin first.");
                return Err(Problem::new(&kinds::PINNED, detail));
            }
            Removed::NotFound => {
                // Returns the problem that says why there is nothing to delete. If the result has just been stored, the
                // loop tries again.
                require(&app, &caller.reach(), &key).await?;
            }
        }
    }
}
