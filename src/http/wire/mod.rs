//! The parts of requests: query parameters, `Prefer` and other headers.
//!
//! A query collects all its faults before it refuses the request, so that a client sees all of them at once.

pub mod coding;
pub mod include;
pub mod negotiation;
pub mod paging;
pub mod schemas;
pub mod weight;

use std::fmt::{self, Display};
use std::mem;
use std::ops::Deref;
use std::time::Duration;

use axum::Json;
use axum::body::HttpBody as _;
use axum::extract::{FromRequestParts, Path};
use axum::http::header::{CACHE_CONTROL, CONTENT_LENGTH, CONTENT_TYPE};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName, HeaderValue};
use axum::response::{IntoResponse, Response};
use serde::Serialize;

use crate::http::problem::{Complaint, Problem, Result, kinds};
use fretwork_format::Format;
use fretwork_job::{BadKey, Key};

pub use fretwork_job::clock::rfc3339 as instant;

/// Longest time that a request may wait for a job.
pub const LONGEST_WAIT: Duration = Duration::from_mins(1);

/// The number of bytes of an answer; `None` if it is not known, as for a stream of events.
pub fn length_of(answer: &Response) -> Option<u64> {
    let stated = || answer.headers().get(CONTENT_LENGTH)?.to_str().ok()?.parse().ok();
    answer.body().size_hint().exact().or_else(stated)
}

/// The query parameters of a request. A handler takes the parameters that it knows out of the query. [`Query::finish`]
/// refuses the others, so that a misspelt parameter is not ignored.
pub struct Query {
    pairs: Vec<(String, String)>,
    known: Vec<&'static str>,
    complaints: Vec<Complaint>,
}

impl<S: Sync> FromRequestParts<S> for Query {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self> {
        let query = parts.uri.query().unwrap_or_default().as_bytes();
        let pairs = form_urlencoded::parse(query).into_owned().collect();
        Ok(Self { pairs, known: Vec::new(), complaints: Vec::new() })
    }
}

impl Query {
    /// Takes a parameter out of the query, as text.
    pub fn text(&mut self, name: &'static str) -> Option<String> {
        let mut values = self.texts(name);
        let found = values.pop();
        if !values.is_empty() {
            self.complain(name, "may be given only once. Remove the other values");
        }
        // No stored text contains this character, and PostgreSQL refuses it in a comparison.
        if found.as_ref().is_some_and(|text| text.contains('\0')) {
            self.complain(name, "must not contain the character U+0000");
            return None;
        }
        found
    }

    /// Takes all values of a parameter out of the query, as text.
    fn texts(&mut self, name: &'static str) -> Vec<String> {
        self.known.push(name);
        let taken = self.pairs.extract_if(.., |(key, _)| key == name);
        taken.map(|(_, value)| value).collect()
    }

    /// Takes a parameter that may be repeated out of the query, and parses its values with `read`.
    pub fn values<T>(
        &mut self,
        name: &'static str,
        accepted: &str,
        read: impl Fn(&str) -> Option<T>,
    ) -> Vec<T> {
        let mut parsed = Vec::new();
        for text in self.texts(name) {
            match read(&text) {
                Some(value) => parsed.push(value),
                None => {
                    self.complain(name, format!("must be {accepted}, got \"{}\"", excerpt(&text)));
                }
            }
        }
        parsed
    }

    /// Takes a parameter out of the query and parses it with `read`. `accepted` completes the fault "must be …".
    pub fn value<T>(
        &mut self,
        name: &'static str,
        accepted: impl Display,
        read: impl FnOnce(&str) -> Option<T>,
    ) -> Option<T> {
        let text = self.text(name)?;
        let value = read(&text);
        if value.is_none() {
            self.complain(name, format!("must be {accepted}, got \"{}\"", excerpt(&text)));
        }
        value
    }

    /// Takes `wait` out of the query: a number of seconds, at most [`LONGEST_WAIT`].
    pub fn wait(&mut self) -> Option<Duration> {
        self.value("wait", "a number of seconds between 0 and 60", |text| {
            let seconds: f64 = text.parse().ok()?;
            (0.0..=LONGEST_WAIT.as_secs_f64())
                .contains(&seconds)
                .then(|| Duration::from_secs_f64(seconds))
        })
    }

    /// Takes `format` out of the query. A fault lists the formats that are `offered`.
    pub fn format(&mut self, offered: &[Format]) -> Option<Format> {
        let accepted = fmt::from_fn(|f| {
            let mut or = "";
            offered.iter().try_for_each(|format| {
                write!(f, "{}\"{}\"", mem::replace(&mut or, " or "), format.name())
            })
        });
        self.value("format", accepted, |text| {
            // An existing format that is not offered here is answered with 406 instead.
            Format::ALL.into_iter().find(|format| format.name() == text)
        })
    }

    /// Adds a fault.
    pub fn complain(&mut self, name: &str, detail: impl Into<String>) {
        self.complaints.push(Complaint::parameter(name, detail));
    }

    /// Refuses the request if its parameters have faults, or if the handler did not take all of them.
    pub fn finish(mut self) -> Result<()> {
        if self.pairs.is_empty() && self.complaints.is_empty() {
            return Ok(());
        }
        let accepted = match self.known.as_slice() {
            [] => "this address has no parameters".to_owned(),
            known => format!("the parameters here are {}", known.join(", ")),
        };
        for (name, _) in mem::take(&mut self.pairs) {
            self.complain(&excerpt(&name), format!("is unknown: {accepted}"));
        }
        Err(Problem::parameters(self.complaints))
    }
}

/// The query of an address without parameters. It refuses all parameters.
pub struct NoQuery;

impl<S: Sync> FromRequestParts<S> for NoQuery {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self> {
        let query = <Query as FromRequestParts<S>>::from_request_parts(parts, state).await?;
        query.finish().map(|()| Self)
    }
}

/// The variable part of an address, as text.
pub struct Segment(String);

impl Deref for Segment {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0
    }
}

impl<S: Send + Sync> FromRequestParts<S> for Segment {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self> {
        let path = Path::<String>::from_request_parts(parts, state).await;
        path.map(|Path(text)| Self(text))
            .map_err(|_| Problem::new(&kinds::NOT_FOUND, "The address is not valid UTF-8."))
    }
}

/// Reads the key in an address.
pub fn read_key(text: &str) -> Result<Key> {
    text.parse().map_err(|bad: BadKey| {
        let detail =
            format!("This is not the key of a result, which the `key` of a job is: {bad}.");
        Problem::new(&kinds::UNKNOWN_RESULT, detail)
    })
}

pub fn excerpt(text: &str) -> String {
    let mut out: String = text.chars().take(60).collect();
    if out.len() < text.len() {
        out.push('…');
    }
    out
}

/// How long the client waits for a job, at most [`LONGEST_WAIT`]: the first `wait` in `Prefer` headers (RFC 7240). Unknown and
/// invalid preferences are ignored, as the RFC requires.
pub fn wait(headers: &HeaderMap) -> Option<Duration> {
    let values = headers.get_all(PREFER).iter().filter_map(|value| value.to_str().ok());
    let (_, seconds) = values
        .flat_map(|value| value.split([',', ';']))
        .filter_map(|preference| preference.split_once('='))
        .find(|(name, _)| name.trim().eq_ignore_ascii_case("wait"))?;
    let seconds = seconds.trim().trim_matches('"').parse().ok()?;
    Some(Duration::from_secs(seconds).min(LONGEST_WAIT))
}

const PREFER: HeaderName = HeaderName::from_static("prefer");

/// The items of all headers with this name, whose values are lists.
pub fn words(headers: &HeaderMap, name: HeaderName) -> impl Iterator<Item = &str> {
    let values = headers.get_all(name).into_iter().filter_map(|value| value.to_str().ok());
    values.flat_map(|value| value.split(',')).map(str::trim)
}

/// A header value from an ASCII text.
#[expect(clippy::expect_used, reason = "callers pass keys, paths, numbers and names of formats")]
pub fn ascii(text: &str) -> HeaderValue {
    HeaderValue::try_from(text).expect("the text is ASCII")
}

/// Whether a submission has this directive in `Cache-Control` (RFC 9111). Unknown directives are ignored, as the RFC requires.
pub fn says(headers: &HeaderMap, directive: &str) -> bool {
    words(headers, CACHE_CONTROL).any(|word| word.eq_ignore_ascii_case(directive))
}

/// The urgency of a submission: `u` in the `Priority` header (RFC 9218), by default 3.
pub fn urgency(headers: &HeaderMap) -> u8 {
    words(headers, PRIORITY)
        .filter_map(|word| word.split(';').next()?.trim().strip_prefix("u=")?.parse().ok())
        .find(|urgency| *urgency <= 7)
        .unwrap_or(3)
}

const PRIORITY: HeaderName = HeaderName::from_static("priority");
const IDEMPOTENCY_KEY: HeaderName = HeaderName::from_static("idempotency-key");
/// Longest `Idempotency-Key`, in characters.
const LONGEST_KEY: usize = 255;

/// The `Idempotency-Key` of a submission. The draft standard requires quotes around the key; here they are optional.
pub fn idempotency_key(headers: &HeaderMap) -> Result<Option<String>> {
    let mut values = headers.get_all(IDEMPOTENCY_KEY).iter();
    let Some(value) = values.next() else { return Ok(None) };
    let key = value.to_str().ok().map(|text| {
        let text = text.trim();
        text.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(text)
    });
    match key {
        Some(key) if (1..=LONGEST_KEY).contains(&key.len()) && values.next().is_none() => {
            Ok(Some(key.to_owned()))
        }
        _ => {
            let detail =
                format!("must be one text of 1 to {LONGEST_KEY} ASCII characters, such as a UUID");
            Err(Problem::header(Complaint::parameter("Idempotency-Key", detail)))
        }
    }
}

/// Marks the answer to a repeated submission.
pub const REPLAYED: HeaderName = HeaderName::from_static("idempotency-replayed");

/// The headers of a text of JSON that no cache may keep, because it changes.
pub const FRESH_JSON: [(HeaderName, &str); 2] =
    [(CONTENT_TYPE, "application/json"), (CACHE_CONTROL, "no-store")];

/// An answer as JSON that no cache may keep, because it changes.
pub struct Fresh<T>(pub T);

impl<T: Serialize> IntoResponse for Fresh<T> {
    fn into_response(self) -> Response {
        ([(CACHE_CONTROL, "no-store")], Json(self.0)).into_response()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wait_preference_is_capped_and_ignored_if_invalid() {
        let prefer = |value| {
            let headers = HeaderMap::from_iter([(PREFER, HeaderValue::from_static(value))]);
            wait(&headers).map(|wait| wait.as_secs())
        };
        assert_eq!(prefer("wait=10"), Some(10));
        assert_eq!(prefer("respond-async, Wait = \"7\""), Some(7));
        assert_eq!(prefer("wait=9999"), Some(60));
        assert_eq!(prefer("wait=soon"), None);
        assert_eq!(prefer("return=minimal"), None);
    }
}
