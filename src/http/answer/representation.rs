//! Answers made from results. This module finds an answer in memory or makes it, compresses it, and adds its entity
//! tag.

use std::sync::Arc;

use axum::http::header::{self, HeaderName};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use tokio::time::{Instant, timeout_at};
use xxhash_rust::xxh3::xxh3_64;

use super::stored::{missing, stored};
use super::text::Text;
use crate::http::access::caller::Caller;
use crate::http::app::App;
use crate::http::memory::{Encoded, Lookup, Making};
use crate::http::problem::{Complaint, Problem, Result, blocking, kinds};
use crate::http::shares::{LargeDocument, Permit, documents_busy, longest_wait};
use crate::http::wire::coding::{Coding, DECODER};
use crate::http::wire::{ascii, words};
use fretwork_format::{self as format, Format, Part, View};
use fretwork_job::Key;
use fretwork_store::{Body, StoredResult};

/// A result in one format and one view. Equal representations have equal names.
pub struct Representation {
    key: Key,
    part: Part,
    format: Format,
    view: View,
    /// Whether the representation is the JSON of the result, unchanged.
    is_unchanged: bool,
    caller: Caller,
    /// The name of the answer in `Memory`, without its coding.
    name: String,
    /// The entity tag.
    tag: String,
}

impl Representation {
    /// The representation that a caller requests.
    pub fn new(caller: &Caller, key: Key, part: Part, format: Format, view: View) -> Self {
        let (view, caller) = (view.sorted(), caller.clone());
        let is_unchanged = (part, format) == (Part::Whole, Format::Json) && view == View::default();
        let (name, tag) = if is_unchanged {
            let name = key.to_string();
            let tag = ["\"", &name, "\""].concat();
            (name, tag)
        } else {
            let address = format!("{key}.{}.{}", part.as_str(), format.name());
            let name = format!("{address} {} {view:?}", format::VERSION);
            let tag = format!("\"{address}.{:016x}\"", xxh3_64(name.as_bytes()));
            (name, tag)
        };
        Self { key, part, format, view, is_unchanged, caller, name, tag }
    }

    /// The answer to a request with these headers.
    pub async fn answer(self, app: &App, headers: &HeaderMap) -> Result<Response> {
        if let Some(response) = self.not_modified(app, headers).await? {
            return Ok(response);
        }
        let text = self.text(app, Coding::choose(headers)).await?;
        app.store.was_read(&self.key);
        Ok(self.response(text))
    }

    /// The name of the answer with this coding in `Memory`.
    fn name_in(&self, coding: Coding) -> String {
        match coding.name() {
            None => self.name.clone(),
            Some(coding) => [&self.name, " ", coding].concat(),
        }
    }

    /// The name in `Memory` of the answer from a large result to a client that accepts this coding.
    fn name_of_large(&self, accepted: Coding) -> String {
        self.name_in(made_in(accepted)) + " large"
    }

    /// Finds the answer in memory, or makes it. `accepted` is what the client accepts.
    pub async fn text(&self, app: &App, accepted: Coding) -> Result<Text> {
        // An NPZ archive is compressed already.
        let is_packed = self.format == Format::Npz;
        let coding = if is_packed { Coding::Identity } else { accepted };
        let name = self.name_in(coding);
        let kept = app.memory.get(&name);
        let is_kept = kept.is_some() || app.memory.get(&self.name_of_large(coding)).is_some();
        app.metrics.looked_up(is_kept);
        if let Some(answer) = kept {
            return Ok(Text::whole(answer));
        }
        let making = match app.memory.lookup(&name).await {
            Lookup::Found(answer) => return Ok(Text::whole(answer)),
            Lookup::Missing(making) => making,
        };
        // The result is read after the lookup, so that `Memory` does not keep the answer if it is deleted meanwhile.
        match stored(app, &self.key).await? {
            Some(StoredResult::Large(size)) => {
                drop(making);
                self.large(app, coding, size).await
            }
            Some(StoredResult::Whole(body)) => match self.as_stored(&body, coding)? {
                Some(answer) => Ok(Text::whole(app.memory.finish(making, answer, true))),
                None => self.make(app, coding, making, body, None).await.map(Text::whole),
            },
            _ => Err(missing(app, &self.caller.reach(), &self.key).await),
        }
    }

    /// The answer, if it is the stored result in a coding that takes little time.
    fn as_stored(&self, body: &Body, coding: Coding) -> Result<Option<Encoded>> {
        let body = match coding {
            Coding::Zstd if self.is_unchanged && body.is_compressed() => body.bytes().clone(),
            Coding::Identity if self.is_unchanged => {
                body.json().map_err(|_| Problem::damaged_result(&self.key))?
            }
            _ => return Ok(None),
        };
        let size = Body::of(body.clone()).size().unwrap_or(body.len());
        Ok(Some(Encoded::new(body, coding, size)))
    }

    /// An answer from a large result. It is made once, compressed, and all its readers share these bytes. For a client that
    /// accepts no compression, they are decompressed while they are sent. `size` is the size of the result as JSON, in
    /// bytes.
    async fn large(&self, app: &App, coding: Coding, size: usize) -> Result<Text> {
        let end = longest_wait();
        let is_decoded = coding == Coding::Identity && self.format != Format::Npz;
        let memory = if is_decoded { DECODER } else { 0 };
        let stream = app.shares.streams.hold_until(end, &self.caller.owner, memory).await?;
        let (made_in, name) = (made_in(coding), self.name_of_large(coding));
        let answer = tokio::select! {
            biased;
            answer = app.memory.made(&name) => answer,
            answer = self.find_large(app, made_in, &name, size, end) => answer?,
        };
        // The bytes of the answer count by the permit that they hold. A permit here, also an empty one, says that they need
        // no other.
        Ok(Text { answer, is_decoded, permit: Some(Arc::new(stream)) })
    }

    /// Finds the answer from a large result under its name in memory, or makes it. The request waits for memory and for
    /// the large document before it takes the single-flight lock, so that it does not delay other callers who want the
    /// same answer.
    async fn find_large(
        &self,
        app: &App,
        coding: Coding,
        name: &str,
        size: usize,
        end: Instant,
    ) -> Result<Encoded> {
        let (caller, shares) = (&self.caller.owner, &app.shares);
        let is_stored = self.is_unchanged && coding == Coding::Zstd;
        loop {
            // An answer takes less memory than its result.
            let kept = app.memory.get(name).map(|answer| answer.body.len());
            let most = kept.unwrap_or(size);
            let permit = shares.answers(most).hold_until(end, caller, most).await?;
            let turn = if is_stored || kept.is_some() {
                None
            } else {
                Some(shares.large_document(end, caller).await?)
            };
            let making = match timeout_at(end, app.memory.lookup(name)).await {
                Ok(Lookup::Found(answer)) => return Ok(answer),
                Ok(Lookup::Missing(making)) => making,
                Err(_) => return Err(documents_busy()),
            };
            if let Some(answer) = app.memory.get(name) {
                return Ok(app.memory.finish(making, answer.counted(permit), false));
            }
            // If the cache has dropped the answer meanwhile, the request needs more memory.
            if kept.is_none() {
                return self.make_large(app, coding, making, permit, turn).await;
            }
        }
    }

    async fn make_large(
        &self,
        app: &App,
        coding: Coding,
        making: Making,
        permit: Permit,
        turn: Option<LargeDocument>,
    ) -> Result<Encoded> {
        let Some(StoredResult::Whole(body)) = app.store.result(&self.key).await? else {
            return Err(missing(app, &self.caller.reach(), &self.key).await);
        };
        let turn = if let Some(turn) = turn {
            turn
        } else if let Some(answer) = self.as_stored(&body, coding)? {
            return Ok(app.memory.finish(making, answer.counted(permit), true));
        } else {
            // A version before 0.3 stored the result without compression.
            app.shares.large_document(longest_wait(), &self.caller.owner).await?
        };
        self.make(app, coding, making, body, Some((permit, turn))).await
    }

    /// Formats and compresses the answer on a blocking thread. The thread finishes the answer even if the client
    /// disconnects, so a retry finds it in memory.
    async fn make(
        &self,
        app: &App,
        coding: Coding,
        making: Making,
        body: Body,
        large: Option<(Permit, LargeDocument)>,
    ) -> Result<Encoded> {
        let (app, key, view) = (app.clone(), self.key, self.view.clone());
        let (part, format) = (self.part, self.format);
        let coding = if format == Format::Npz { Coding::Identity } else { coding };
        let make = move || {
            let json = body.json().map_err(|_| Problem::damaged_result(&key))?;
            drop(body);
            let mut encoder = coding.encoder();
            format::write(&mut encoder, json, part, format, &view)
                .map_err(|error| refused(&key, error))?;
            let (size, (body, coding)) =
                (encoder.written(), encoder.finish().map_err(Problem::bug)?);
            let mut answer = Encoded::new(body, coding, size);
            if let Some((permit, _turn)) = large {
                answer = answer.counted(permit);
            }
            Ok(app.memory.finish(making, answer, true))
        };
        blocking(make).await?
    }

    fn response(&self, text: Text) -> Response {
        let coding = text.coding();
        let mut response = text.into_response();
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
            let (part, end) = (self.part.as_str(), self.format.name());
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

/// The coding in which an answer from a large result is made for clients that accept this coding.
fn made_in(accepted: Coding) -> Coding {
    if accepted == Coding::Gzip { Coding::Gzip } else { Coding::Zstd }
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
            let part = part.as_str();
            let detail = format!(
                "The result has no {part}, but it has {has}. The whole result is at /v1/results/{key}."
            );
            Problem::new(&kinds::NO_SUCH_PART, detail)
        }
        format::Error::Document(_) => Problem::damaged_result(key).caused_by(&error),
        error => Problem::internal().caused_by(&error),
    }
}
