//! The cookie of a browser that has signed in.
//!
//! A browser adds the cookie to every request to this host, also to requests that other web pages cause. So a request with the
//! cookie counts only if a page of this server sent it: its `Sec-Fetch-Site` or its `Origin` must say so. Reading also
//! works from a bookmark or a link.

use std::time::{Duration, Instant};

use axum::extract::Request;
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderName, HeaderValue, header};
use parking_lot::Mutex;

use super::caller::{Peer, ViaProxy};
use crate::http::problem::{Problem, Result, kinds};

const SEC_FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");
const SEC_FETCH_MODE: HeaderName = HeaderName::from_static("sec-fetch-mode");
const FORWARDED_PROTO: HeaderName = HeaderName::from_static("x-forwarded-proto");

/// Number of hexadecimal digits of a token.
const TOKEN: usize = 64;

/// The page that caused a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Site {
    /// A page of this server.
    Own,
    /// The browser does not say, or the user entered the address, or the client is no browser.
    Unknown,
    /// A page of another origin.
    Other,
}

impl Site {
    /// The page that caused a request.
    pub fn of(request: &Request) -> Self {
        let headers = request.headers();
        if headers.get_all(SEC_FETCH_SITE).iter().count() > 1 {
            return Self::Other;
        }
        let site = headers.get(SEC_FETCH_SITE).map(HeaderValue::as_bytes);
        match (site, is_own_origin(request)) {
            (_, Some(false)) => Self::Other,
            (Some(b"same-origin"), _) | (None, Some(true)) => Self::Own,
            (Some(b"none") | None, None) => Self::Unknown,
            _ => Self::Other,
        }
    }
}

/// Whether the `Origin` of a request is that of this server; `None` if the request has none.
pub fn is_own_origin(request: &Request) -> Option<bool> {
    let mut origins = request.headers().get_all(header::ORIGIN).iter();
    let origin = origins.next()?.as_bytes();
    let host = host_of(request).map(str::as_bytes);
    let end = origin.windows(3).position(|mark| mark == b"://").map(|at| at + 3);
    Some(origins.next().is_none() && end.is_some_and(|end| Some(&origin[end..]) == host))
}

/// The host and the port that the client asked.
fn host_of(request: &Request) -> Option<&str> {
    let host = || request.headers().get(header::HOST)?.to_str().ok();
    request.uri().authority().map(Authority::as_str).or_else(host)
}

/// Whether the client speaks TLS with the trusted proxy that forwards the request.
fn is_encrypted(request: &Request) -> bool {
    let protocol = only(request.headers(), &FORWARDED_PROTO);
    request.extensions().get::<ViaProxy>().is_some() && protocol == Some("https")
}

/// Sessions without TLS are logged at most once in this time.
const WARNING_PAUSE: Duration = Duration::from_hours(1);

/// When the server last warned about a session without TLS.
#[derive(Debug, Default)]
pub struct Unencrypted(Mutex<Option<Instant>>);

impl Unencrypted {
    /// Warns that the client of another machine signs in without TLS.
    pub fn warn(&self, request: &Request) {
        let Some(client) = request.extensions().get::<Peer>() else { return };
        let mut warned = self.0.lock();
        let is_recent = warned.is_some_and(|at| at.elapsed() < WARNING_PAUSE);
        if is_encrypted(request) || client.is_this_machine() || is_recent {
            return;
        }
        *warned = Some(Instant::now());
        tracing::warn!(
            %client,
            "a browser signed in without TLS, so others in its network could read the key and the cookie: use a proxy \
            with TLS that sends X-Forwarded-Proto, as deploy/haproxy-single.cfg does, and pass its address to --trusted-proxy"
        );
    }
}

/// The value of a header that the request has exactly once.
pub fn only<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    let value = values.next()?.to_str().ok()?;
    values.next().is_none().then_some(value)
}

/// The name of the cookie. It has the port, because browsers share cookies between the ports of a host. Browsers accept
/// the prefix `__Host-` only over TLS, and only from this host.
fn name(request: &Request) -> String {
    let port = host_of(request).and_then(|host| host.rsplit_once(':')).map(|(_, port)| port);
    let port =
        port.filter(|port| !port.is_empty() && port.bytes().all(|byte| byte.is_ascii_digit()));
    let port = port.map_or_else(String::new, |port| format!("-{port}"));
    let prefix = if is_encrypted(request) { "__Host-" } else { "" };
    format!("{prefix}fretwork{port}")
}

/// The token in the cookie of a request.
pub fn token(request: &Request) -> Result<Option<String>> {
    let name = name(request);
    let cookies = request.headers().get_all(header::COOKIE).iter();
    let cookies = cookies.filter_map(|value| value.to_str().ok()).flat_map(|text| text.split(';'));
    let cookies = cookies.filter_map(|cookie| cookie.trim().split_once('='));
    let mut tokens = cookies.filter(|(own, _)| *own == name).map(|(_, token)| token);
    let Some(token) = tokens.next() else { return Ok(None) };
    if tokens.next().is_some() {
        let detail = "The request has several session cookies. Delete the cookies of this site, and sign in again.";
        return Err(ended(request.headers(), detail));
    }
    let hex = |byte: u8| matches!(byte, b'0'..=b'9' | b'a'..=b'f');
    Ok((token.len() == TOKEN && token.bytes().all(hex)).then(|| token.to_owned()))
}

/// Refuses a request whose cookie must not count.
pub fn check_site(request: &Request) -> Result<()> {
    let (site, is_safe) = (Site::of(request), request.method().is_safe());
    // A user who follows a link to this server sees the answer, and no page can read it.
    let is_link = only(request.headers(), &SEC_FETCH_MODE) == Some("navigate");
    if site == Site::Own || is_safe && (site == Site::Unknown || is_link) {
        return Ok(());
    }
    let detail = "A session counts only for pages of this server. Send an access key instead: `Authorization: Bearer \
        fretwork_…`.";
    Err(Problem::new(&kinds::CROSS_SITE, detail))
}

/// The header that stores a token in the browser, or deletes the cookie.
pub fn set_cookie(request: &Request, token: Option<&str>) -> (HeaderName, String) {
    let secure = if is_encrypted(request) { "; Secure" } else { "" };
    let ended = if token.is_none() { "; Max-Age=0" } else { "" };
    let (name, token) = (name(request), token.unwrap_or_default());
    let cookie = format!("{name}={token}; Path=/; HttpOnly; SameSite=Lax{secure}{ended}");
    (header::SET_COOKIE, cookie)
}

/// What a request with the cookie of a session that has ended is told.
pub const ENDED: &str = "The session has ended. Sign in again.";

/// The problem for a request without a valid key. `error` is empty, or a parameter of the challenge (RFC 6750).
pub fn unauthorized(headers: &HeaderMap, error: &str, reason: &str) -> Problem {
    let detail = format!("{reason} Send a key as `Authorization: Bearer fretwork_…`.");
    challenge(headers, error, Problem::new(&kinds::UNAUTHORIZED, detail))
}

/// The problem for a browser whose session is not valid.
pub fn ended(headers: &HeaderMap, detail: &str) -> Problem {
    challenge(headers, "", Problem::new(&kinds::SESSION_ENDED, detail))
}

/// Adds an authentication scheme that the client supports.
fn challenge(headers: &HeaderMap, error: &str, problem: Problem) -> Problem {
    let scheme = format!("Bearer realm=\"fretwork\"{error}");
    let problem = problem.with_header(header::WWW_AUTHENTICATE, scheme);
    let accepts = headers.get(header::ACCEPT).and_then(|value| value.to_str().ok());
    if accepts.is_some_and(|accepts| accepts.contains("text/html")) {
        // If the scheme is Basic, a browser asks its user for a name and a password.
        return problem.with_header(header::WWW_AUTHENTICATE, "Basic realm=\"fretwork\"");
    }
    problem
}
