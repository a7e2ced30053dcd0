//! What is sent of a result: found or made, remembered, compressed, tagged.

use axum::body::Bytes;
use axum::http::header::{self, HeaderName};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use tokio::sync::OwnedSemaphorePermit;
use tokio::task;
use xxhash_rust::xxh3::xxh3_64;

use super::App;
use super::caller::Caller;
use super::coding::Coding;
use super::format::Format;
use super::forms::{self, Ask, Part};
use super::memory::{Answer, Making};
use super::problem::{self, Problem};
use super::wire::{instant, words};
use crate::job::Key;
use crate::store::{self, StoredResult};

/// Finds the stored bytes of a result; an unknown key is answered with the way to a job within reach,
/// if one is under way.
pub async fn find(app: &App, reach: Option<&str>, key: &Key) -> Result<Bytes, Problem> {
    match app.store.result(key).await? {
        Some(StoredResult::Whole(body)) => Ok(body),
        other => Err(missing(app, reach, key, other).await?),
    }
}

/// Why there are no bytes of a result.
async fn missing(
    app: &App,
    reach: Option<&str>,
    key: &Key,
    found: Option<StoredResult>,
) -> Result<Problem, Problem> {
    let evicted = match found {
        Some(StoredResult::Evicted { at, deleted_by, scenario }) => {
            Some((at, deleted_by, scenario))
        }
        _ => None,
    };
    let live = app.store.live_job(key, reach).await?;
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
    Ok(match live {
        Some(job) => {
            problem.with_header(header::LINK, format!("</v1/jobs/{job}>; rel=\"related\""))
        }
        None => problem,
    })
}

/// A representation of a result: what is asked for, in one form. Equal ones have equal names.
pub struct Representation {
    key: Key,
    part: Part,
    format: Format,
    ask: Ask,
    /// Whose jobs may be mentioned; none if everyone's.
    reach: Option<String>,
    /// What it is remembered under: whatever distinguishes it.
    name: String,
    /// The tag that clients hold it by.
    tag: String,
}

impl Representation {
    /// This part of this result, as a caller asks for it.
    pub fn new(caller: &Caller, key: Key, part: Part, format: Format, ask: Ask) -> Self {
        let reach = caller.reach().map(str::to_owned);
        let ask = ask.in_order();
        if (part, format) == (Part::Whole, Format::Json) && ask == Ask::default() {
            let (name, tag) = (key.to_string(), format!("\"{key}\""));
            return Self { key, part, format, ask, reach, name, tag };
        }
        let address = format!("{key}.{}.{}", part.name(), format.name());
        let name = format!("{address} {} {ask:?}", forms::VERSION);
        let tag = format!("\"{address}.{:016x}\"", xxh3_64(name.as_bytes()));
        Self { key, part, format, ask, reach, name, tag }
    }

    /// The answer in this coding: remembered, read by others just now, or made.
    pub async fn answer(self, app: &App, coding: Coding) -> Result<Response, Problem> {
        let name = match coding.name() {
            None => self.name.clone(),
            Some(coding) => format!("{} {coding}", self.name),
        };
        let since = app.memory.forgotten();
        let found = app.memory.get(&name);
        app.metrics.looked(found.is_some());
        let answer = match found {
            Some(answer) => answer,
            None if coding == Coding::Identity && self.name == self.key.to_string() => {
                let reach = self.reach.as_deref();
                let answer = match at_hand(app, reach, &self.key).await? {
                    Some(answer) => answer,
                    None => large(app, reach, &self.key).await?,
                };
                app.memory.put(name, &answer, since);
                answer
            }
            None => {
                let make = |making| self.make(app, name.clone(), coding, making);
                app.memory.share(&name, make).await?
            }
        };
        app.store.was_read(&self.key);
        Ok(self.send(answer))
    }

    /// Written and compressed in one, so that the text before it is nowhere as a whole, and remembered:
    /// if who asked for it goes away meanwhile, the next one finds it.
    async fn make(
        &self,
        app: &App,
        name: String,
        coding: Coding,
        making: Making,
    ) -> Result<(Answer, Making), Problem> {
        let (stored, permit) = self.source(app).await?;
        let (app, part, format, ask) = (app.clone(), self.part, self.format, self.ask.clone());
        apart(move || {
            // Who asks for differences asks for few bytes.
            let mut encoder = coding.encoder(format == Format::Differences);
            forms::write_to(&mut encoder, &stored, part, format, &ask)?;
            let (body, coding) = encoder.finish().map_err(forms::Error::from)?;
            let answer = Answer { body, coding };
            app.memory.put(name, &answer, making.since);
            drop(permit);
            Ok((answer, making))
        })
        .await?
    }

    /// The stored bytes that something is made of, and where they are large the right to make it, before
    /// they are read.
    async fn source(&self, app: &App) -> Result<(Bytes, Option<OwnedSemaphorePermit>), Problem> {
        let reach = self.reach.as_deref();
        let held = at_hand(app, reach, &self.key).await?;
        if let Some(Answer { body, .. }) = &held
            && body.len() <= store::LARGE
        {
            return Ok((body.clone(), None));
        }
        let permit = app.memory.may_make().await;
        let answer = match held {
            Some(answer) => answer,
            None => large(app, reach, &self.key).await?,
        };
        Ok((answer.body, permit))
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
    pub async fn not_modified(
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

/// The stored bytes, if they are small, or remembered: read by each for himself, which is what takes
/// least.
async fn at_hand(app: &App, reach: Option<&str>, key: &Key) -> Result<Option<Answer>, Problem> {
    if let Some(answer) = app.memory.get(&key.to_string()) {
        return Ok(Some(answer));
    }
    match app.store.small_result(key).await? {
        Some(StoredResult::Whole(body)) => Ok(Some(Answer::plain(body))),
        Some(StoredResult::Large) => Ok(None),
        other => Err(missing(app, reach, key, other).await?),
    }
}

/// The stored bytes of what is large, read once for all who want them.
pub async fn large(app: &App, reach: Option<&str>, key: &Key) -> Result<Answer, Problem> {
    let find = |making| async move { Ok((Answer::plain(find(app, reach, key).await?), making)) };
    app.memory.share(&key.to_string(), find).await
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
pub fn held(headers: &HeaderMap, tag: &str) -> Option<String> {
    let mut tags = words(headers, header::IF_NONE_MATCH);
    let found = tags.find(|held| *held == "*" || held.trim_start_matches("W/") == tag)?;
    Some(if found == "*" { tag } else { found }.to_owned())
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
