//! Answers made from results. This module finds an answer in memory or makes it, compresses it, and adds its entity
//! tag.

use std::error::Error as StdError;
use std::io::{self, Write as _};
use std::sync::Arc;
use std::thread;
use std::{iter, mem};

use axum::body::{Body as AnswerBody, Bytes};
use axum::http::header::{self, HeaderName};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use serde_json::Value;
use tokio::sync::oneshot;
use tokio::task;
use xxhash_rust::xxh3::xxh3_64;

use super::pieces::{self, Beginning, PieceWriter, pieces};
use super::stored::{Need, Reserved, find, large_json, makers_busy, missing, stored, unpacked};
use crate::http::access::caller::Caller;
use crate::http::app::App;
use crate::http::memory::{Encoded, Lookup, Making};
use crate::http::problem::{Complaint, Problem, Result, kinds};
use crate::http::shares::{Permit, longest_wait};
use crate::http::wire::coding::Coding;
use crate::http::wire::{ascii, words};
use fretwork_format::{self as format, Format, Part, View};
use fretwork_job::Key;
use fretwork_store::{self as store, Body, StoredResult};

/// Largest uncompressed text that is made as a whole, in bytes. A text that may be larger is sent while it is written.
const WHOLE: usize = 32 << 20;

/// The source from which an answer is made.
enum MadeFrom {
    /// These bytes are the answer.
    Answer(Bytes),
    /// The JSON of the result.
    Json(Bytes),
    /// The result is large. Before the request reads it, the request must reserve this.
    Needs(Need),
    /// The answer is the JSON of the result, which is so large that it must be decompressed while it is sent.
    Packed,
}

/// An answer.
enum Reply {
    /// All bytes of the answer are in memory.
    Whole(Encoded),
    /// The answer is sent while it is written.
    Streamed(Response),
}

/// A result in one format and one view. Equal representations have equal names.
pub struct Representation {
    key: Key,
    part: Part,
    format: Format,
    view: View,
    /// Whether the representation is the JSON of the result, unchanged.
    is_unchanged: bool,
    /// The owner whose jobs an error text may mention; `None` for all owners.
    reach: Option<String>,
    /// The caller whose share of the memory the answer uses.
    caller: String,
    /// The name of the answer in `Memory`, without its coding.
    name: String,
    /// The entity tag.
    tag: String,
}

impl Representation {
    /// The representation that a caller requests.
    pub fn new(caller: &Caller, key: Key, part: Part, format: Format, view: View) -> Self {
        let (reach, caller) = (caller.reach().map(str::to_owned), caller.owner.clone());
        let view = view.sorted();
        let is_unchanged = (part, format) == (Part::Whole, Format::Json) && view == View::default();
        let (name, tag) = if is_unchanged {
            let name = key.to_string();
            let tag = ["\"", &name, "\""].concat();
            (name, tag)
        } else {
            let address = format!("{key}.{}.{}", part.name(), format.name());
            let name = format!("{address} {} {view:?}", format::VERSION);
            let tag = format!("\"{address}.{:016x}\"", xxh3_64(name.as_bytes()));
            (name, tag)
        };
        Self { key, part, format, view, is_unchanged, reach, caller, name, tag }
    }

    /// The answer to a request with these headers.
    pub async fn answer(self, app: &App, headers: &HeaderMap) -> Result<Response> {
        if let Some(response) = self.not_modified(app, headers).await? {
            return Ok(response);
        }
        let coding = match self.format {
            // An NPZ archive is compressed already.
            Format::Npz => Coding::Identity,
            _ => Coding::choose(headers),
        };
        let mut reserved = Reserved::nothing_until(longest_wait());
        let answer = self.find_or_make(app, coding, &mut reserved).await?;
        app.store.was_read(&self.key);
        Ok(match answer {
            Reply::Streamed(response) => response,
            Reply::Whole(Encoded { body, coding, permit }) => {
                self.response(body.into(), coding, permit)
            }
        })
    }

    /// The name of the answer with this coding in `Memory`.
    fn name_in(&self, coding: Coding) -> String {
        match coding.name() {
            None => self.name.clone(),
            Some(coding) => [&self.name, " ", coding].concat(),
        }
    }

    /// Finds the answer in memory, or makes it. Waits for memory and for other requests.
    async fn find_or_make(
        &self,
        app: &App,
        coding: Coding,
        reserved: &mut Reserved,
    ) -> Result<Reply> {
        let name = self.name_in(coding);
        let mut is_first = true;
        loop {
            let found = find(app, &self.caller, &name, reserved).await?;
            if mem::take(&mut is_first) {
                app.metrics.looked_up(matches!(found, Lookup::Found(_)));
            }
            let making = match found {
                Lookup::Found(answer) => return Ok(Reply::Whole(answer)),
                Lookup::Missing(making) => making,
            };
            match self.source(app, coding, reserved).await? {
                MadeFrom::Answer(bytes) => {
                    let answer = Encoded::of(bytes, coding, Some(reserved.take_permit()));
                    return Ok(Reply::Whole(app.memory.finish(making, answer, true)));
                }
                MadeFrom::Json(json) if self.is_streamed(coding, json.len()) => {
                    return self.stream(app, making, json, reserved.take()).await;
                }
                MadeFrom::Json(json) => {
                    let answer = self.make(app, coding, making, json, reserved.take()).await?;
                    return Ok(Reply::Whole(answer));
                }
                MadeFrom::Packed => {
                    drop(making);
                    *reserved = Reserved::nothing_until(reserved.end).beside(pieces::MEMORY);
                    // All readers of this result share one copy of its compressed bytes.
                    let packed = Box::pin(self.find_or_make(app, Coding::Zstd, reserved));
                    return match packed.await? {
                        Reply::Whole(packed) if packed.coding == Coding::Zstd => {
                            let own = reserved.take_own();
                            drop(reserved.take());
                            self.unpack(packed, own).await
                        }
                        answer => Ok(answer),
                    };
                }
                MadeFrom::Needs(need) => {
                    drop(making);
                    reserved.wait(app, &self.caller, &name, need).await?;
                }
            }
        }
    }

    /// Finds what the answer is made from.
    async fn source(&self, app: &App, coding: Coding, reserved: &Reserved) -> Result<MadeFrom> {
        if self.is_unchanged && coding != Coding::Gzip {
            return match stored(app, &self.key, reserved).await? {
                Some(StoredResult::Whole(body))
                    if coding == Coding::Zstd && body.is_compressed() =>
                {
                    Ok(MadeFrom::Answer(body.bytes().clone()))
                }
                Some(StoredResult::Whole(body)) => {
                    let json = unpacked(&self.key, body).await?;
                    let is_answer = coding == Coding::Identity;
                    Ok(if is_answer { MadeFrom::Answer(json) } else { MadeFrom::Json(json) })
                }
                Some(StoredResult::Large(size)) if coding == Coding::Identity && size > WHOLE => {
                    Ok(MadeFrom::Packed)
                }
                Some(StoredResult::Large(size)) => Ok(MadeFrom::Needs(Need::to_unpack(size))),
                found => Err(self.missing(app, found).await),
            };
        }
        let size = match app.memory.get(&self.key.to_string()).map(|answer| answer.body) {
            Some(json) if json.len() <= store::LARGE => return Ok(MadeFrom::Json(json)),
            Some(json) => json.len(),
            None => match app.store.small_result(&self.key).await? {
                Some(StoredResult::Whole(body)) => {
                    return Ok(MadeFrom::Json(unpacked(&self.key, body).await?));
                }
                Some(StoredResult::Large(size)) => size,
                found => return Err(self.missing(app, found).await),
            },
        };
        let is_whole = coding == Coding::Identity && !self.is_streamed(coding, size);
        let growth = if is_whole { self.growth() } else { 1 };
        let need = Need { bytes: (1 + growth) * size, maker: true };
        if !reserved.suffices(need) {
            self.refuse_missing_cycles(app).await?;
            return Ok(MadeFrom::Needs(need));
        }
        match large_json(app, &self.key).await? {
            Some(json) => Ok(MadeFrom::Json(json)),
            None => Err(self.missing(app, app.store.small_result(&self.key).await?).await),
        }
    }

    /// Refuses a request for output cycles that the result does not have, before the large result is read. The scenario
    /// lists all output cycles of the result, except 0 and the last one of a run that ended early. If the scenario has
    /// energies instead of cycles, this checks nothing.
    async fn refuse_missing_cycles(&self, app: &App) -> Result<()> {
        if self.view.cycles.is_none() {
            return Ok(());
        }
        let Some(known) = app.store.known(&self.key).await? else { return Ok(()) };
        let Some(asked) = known.asked.value["cycles"].as_array() else { return Ok(()) };
        let last = &known.summary["cycles"];
        let given = asked.iter().chain([last]).filter_map(Value::as_f64);
        let mut cycles: Vec<f64> = iter::once(0.0).chain(given).collect();
        cycles.dedup();
        let missing = format::missing_cycles(&self.view, &cycles);
        if missing.is_empty() {
            return Ok(());
        }
        Err(refused(&self.key, format::Error::Missing(missing)))
    }

    /// The problem for a result that is not stored.
    async fn missing(&self, app: &App, found: Option<StoredResult>) -> Problem {
        missing(app, self.reach.as_deref(), &self.key, found).await
    }

    /// Formats and compresses the answer on a blocking thread. The thread finishes the answer even if the client
    /// disconnects, so a retry finds it in memory.
    async fn make(
        &self,
        app: &App,
        coding: Coding,
        making: Making,
        json: Bytes,
        reserved: Reserved,
    ) -> Result<Encoded> {
        let (app, key, view) = (app.clone(), self.key, self.view.clone());
        let (part, format) = (self.part, self.format);
        let make = move || {
            let Reserved { permit, maker: _maker, .. } = reserved;
            let mut encoder = coding.encoder();
            // A table has more characters than the columns of the JSON. Reserved space that is not written takes no
            // memory.
            encoder.reserve(json.len() / 4 * 5);
            format::write(&mut encoder, json, part, format, &view)
                .map_err(|error| refused(&key, error))?;
            let (body, coding) = encoder.finish().map_err(Problem::bug)?;
            Ok(app.memory.finish(making, Encoded::of(body, coding, Some(permit)), true))
        };
        task::spawn_blocking(make).await.map_err(Problem::bug)?
    }

    /// Maximum number of bytes of the uncompressed answer for each byte of the result. A row repeats the numbers of its
    /// axes, and in some formats the names of all columns.
    fn growth(&self) -> usize {
        let View { cycles, points, rows, .. } = &self.view;
        let selects = cycles.is_some() || points.is_some() || rows.is_some();
        match self.format {
            // A history is a small part of a large result.
            _ if selects || matches!(self.part, Part::Whole | Part::History) => 1,
            // The table of a study repeats nothing in CSV.
            Format::Csv if self.part == Part::Table => 1,
            Format::Csv => 2,
            Format::Json if self.view.records => 3,
            Format::Ndjson => 5,
            _ => 1,
        }
    }

    /// Whether the answer can be so long that it must be sent while it is written. `size` is the size of the result as
    /// JSON, in bytes.
    fn is_streamed(&self, coding: Coding, size: usize) -> bool {
        // A history is short. Arrays take less memory than the JSON.
        let is_long_text = matches!(self.format, Format::Json | Format::Csv | Format::Ndjson)
            && self.part != Part::History;
        coding == Coding::Identity && is_long_text && self.growth() * size > WHOLE
    }

    /// Formats the answer while the client reads it. A short answer is kept in memory for other requests.
    async fn stream(
        &self,
        app: &App,
        making: Making,
        json: Bytes,
        reserved: Reserved,
    ) -> Result<Reply> {
        let Reserved { mut permit, maker, .. } = reserved;
        // Until the first piece is sent, the JSON and the tables that were parsed from it are in memory. After that,
        // only the tables are.
        let result = permit.split(json.len());
        let (part, format, view) = (self.part, self.format, self.view.clone());
        let write = move |out: &mut PieceWriter<_>| {
            let _tables = permit;
            format::write(out, json, part, format, &view)
        };
        Ok(match self.send((maker, result), write).await? {
            Reply::Whole(answer) => Reply::Whole(app.memory.finish(making, answer, true)),
            streamed @ Reply::Streamed(_) => streamed,
        })
    }

    /// Decompresses the JSON of the result while the client reads it. `own` is the memory for the pieces.
    async fn unpack(&self, packed: Encoded, own: Permit) -> Result<Reply> {
        let Encoded { body, permit, .. } = packed;
        let size = Body::of(body.clone()).size();
        let write = move |out: &mut PieceWriter<_>| {
            let _shared = permit;
            Ok(zstd::stream::copy_decode(&body[..], out)?)
        };
        let mut answer = self.send((), write).await?;
        if let (Reply::Streamed(response), Some(size)) = (&mut answer, size) {
            response.headers_mut().insert(header::CONTENT_LENGTH, size.into());
            response.extensions_mut().insert(Arc::new(own));
        }
        Ok(answer)
    }

    /// Writes the answer on a thread of its own while the client reads it. The thread ends early if the client closes
    /// the stream, or does not read for a minute. It drops `held` before it sends the first piece.
    async fn send<H: Send + 'static>(
        &self,
        held: H,
        write: impl FnOnce(&mut PieceWriter<H>) -> Result<(), format::Error> + Send + 'static,
    ) -> Result<Reply> {
        let (mut pieces, mut received) = pieces(held);
        let (done, written) = oneshot::channel();
        let write = move || {
            let end = write(&mut pieces).and_then(|()| Ok(pieces.flush()?));
            // If the client has disconnected, no task receives this.
            let _ = done.send(end);
        };
        // This is not a blocking thread of the runtime: a client can take hours to read, and the runtime has only few
        // such threads.
        let thread = thread::Builder::new().name("stream".to_owned()).spawn(write);
        thread.map_err(|error| makers_busy().caused_by(&error))?;
        let beginning = match received.beginning().await {
            Beginning::Pieces(beginning) => beginning,
            Beginning::Ended(whole) => {
                written.await.map_err(Problem::bug)?.map_err(|error| refused(&self.key, error))?;
                return Ok(Reply::Whole(Encoded::plain(whole)));
            }
        };
        let key = self.key;
        let body = received.body(beginning, async move {
            let error: Box<dyn StdError + Send + Sync> = match written.await {
                Ok(Ok(())) => return Ok(()),
                Ok(Err(error)) => error.into(),
                Err(panicked) => panicked.into(),
            };
            tracing::error!(%key, error = &*error as &dyn StdError, "an answer ended early");
            Err(io::Error::other(error))
        });
        Ok(Reply::Streamed(self.response(body, Coding::Identity, None)))
    }

    fn response(&self, body: AnswerBody, coding: Coding, permit: Option<Arc<Permit>>) -> Response {
        let mut response = Response::new(body);
        if let Some(permit) = permit {
            response.extensions_mut().insert(permit);
        }
        let headers = response.headers_mut();
        // Space for the headers below and for those that `layers.rs` adds.
        headers.reserve(12);
        let weak = if coding == Coding::Identity { "" } else { "W/" };
        headers.extend(caching(&[weak, &self.tag].concat()));
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
            headers.insert(header::CONTENT_DISPOSITION, ascii(&name));
        }
        response
    }

    /// The answer 304, if the client has this representation already. A result never changes, so it is enough that the
    /// result exists. A representation in memory is enough too, even if the result has been evicted.
    async fn not_modified(&self, app: &App, headers: &HeaderMap) -> Result<Option<Response>> {
        let Some(held) = held(headers, &self.tag) else { return Ok(None) };
        let in_memory =
            Coding::ALL.iter().any(|coding| app.memory.get(&self.name_in(*coding)).is_some());
        if !in_memory && !app.store.has_result(&self.key).await? {
            return Ok(None);
        }
        app.store.was_read(&self.key);
        Ok(Some((StatusCode::NOT_MODIFIED, caching(&held)).into_response()))
    }
}

/// The headers of every representation. A result does not change, so clients may cache it for ever.
fn caching(tag: &str) -> [(HeaderName, HeaderValue); 3] {
    [
        (header::ETAG, ascii(tag)),
        (header::CACHE_CONTROL, HeaderValue::from_static("max-age=31536000, immutable")),
        (header::VARY, HeaderValue::from_static("accept, accept-encoding")),
    ]
}

/// The tag in `If-None-Match` that names the representation with this tag. It is weak if the client has a compressed
/// copy; the answer repeats it, so that caches recognise their copy.
pub fn held(headers: &HeaderMap, tag: &str) -> Option<String> {
    let mut tags = words(headers, header::IF_NONE_MATCH);
    let found = tags.find(|held| *held == "*" || held.trim_start_matches("W/") == tag)?;
    Some(if found == "*" { tag } else { found }.to_owned())
}

/// The problem for a result that cannot be written in a format.
pub fn refused(key: &Key, error: format::Error) -> Problem {
    match error {
        format::Error::Missing(items) => {
            let complaint =
                |item: format::Missing| Complaint::parameter(item.parameter, item.detail);
            Problem::parameters(items.into_iter().map(complaint).collect())
        }
        format::Error::OtherKind(part, has) => {
            let part = part.name();
            let detail = format!(
                "The result has no {part}, but it has {has}. The whole result is at /v1/results/{key}."
            );
            Problem::new(&kinds::NO_SUCH_PART, detail)
        }
        format::Error::Document(_) => Problem::damaged_result(key).caused_by(&error),
        error => Problem::internal().caused_by(&error),
    }
}
