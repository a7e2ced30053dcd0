//! Sends requests to a server.

use std::io::Read as _;
use std::net::IpAddr;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

use rustls::{Error as TlsError, InvalidMessage};
use serde::Deserialize;
use serde_json::Value;
use ureq::http::request::Builder;
use ureq::http::{HeaderMap, Request, Uri};
use ureq::tls::{RootCerts, TlsConfig};
use ureq::{Agent, Error as Failure};
use uuid::Uuid;

use super::listening::reachable;
use super::printing::{Ended, Error, say};
use super::run::{LARGEST, read};
use crate::config::Remote;

/// Maximum time to connect, and to wait for an answer that needs no computation.
const TIMEOUT: Duration = Duration::from_secs(5);
/// How often a request is sent again if the server is busy.
const RETRIES: u32 = 5;
/// Longest pause before a request is sent again, in seconds. The user decides about a longer one.
const LONGEST_PAUSE: u64 = 60;
/// How long a command waits for a server that has stopped answering, because a restart takes less.
const RESTART: Duration = Duration::from_mins(2);
/// A server, and the key that it gets.
pub struct Client {
    /// The base address, without a slash at its end.
    pub base: String,
    agent: Agent,
    key: Option<String>,
}

/// An answer.
pub struct Reply {
    pub status: u16,
    pub body: Vec<u8>,
    headers: HeaderMap,
}

impl Reply {
    /// The value of a header, or nothing.
    pub fn header(&self, name: &str) -> &str {
        self.headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default()
    }

    /// Reads an answer in JSON.
    pub fn json<'a, T: Deserialize<'a>>(&'a self) -> Result<T, Error> {
        let advice = "the answer of the server is not the JSON of fretwork. Check FRETWORK_URL";
        serde_json::from_slice(&self.body).map_err(|error| format!("{advice}: {error}").into())
    }
}

/// A part of a path. An id of the user or of the server cannot lead to another path.
pub fn escaped(id: &str) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_".contains(&byte);
    let escape = |it: u8| if is_plain(it) { char::from(it).into() } else { format!("%{it:02X}") };
    id.bytes().map(escape).collect()
}

impl Client {
    pub fn new(settings: &Remote) -> Result<Self, Error> {
        let listen = format!("http://{}", reachable(settings.listen));
        let base = settings.url.as_ref().unwrap_or(&listen).trim_end_matches('/').to_owned();
        if !base.starts_with("http://") && !base.starts_with("https://") {
            let better = base.trim_end_matches("/v1");
            return Err(format!(
                "{base} must begin with http:// or https://: enter http://{better}"
            )
            .into());
        }
        if let Some(better) = base.strip_suffix("/v1") {
            return Err(format!("{base} must be the address of the server: {better}").into());
        }
        let key = match (&settings.key, &settings.key_file) {
            (None, Some(file)) => Some(String::from_utf8(read(file)?)?),
            (key, _) => key.as_ref().map(|key| key.0.clone()),
        };
        if key.is_some() && settings.url.is_some() && !is_private(&base) {
            say(&format!(
                "warning: {base} gets the access key unencrypted, which https:// or an SSH tunnel would hide"
            ));
        }
        // An earlier call has installed the same provider.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let tls = TlsConfig::builder().root_certs(RootCerts::PlatformVerifier).build();
        let agent = Agent::config_builder()
            .http_status_as_error(false)
            .tls_config(tls)
            .user_agent(concat!("fretwork/", env!("CARGO_PKG_VERSION")))
            // A proxy of the user cannot reach a server on this machine.
            .proxy(None)
            .max_redirects(0)
            .timeout_connect(Some(TIMEOUT))
            .build()
            .new_agent();
        Ok(Self { base, agent, key: key.map(|key| key.trim().to_owned()) })
    }

    /// Sends a GET request once.
    pub fn get(&self, path: &str) -> Result<Reply, Error> {
        self.once("GET", path, &[])
    }

    /// Sends a request with these headers once.
    pub fn once(&self, method: &str, path: &str, headers: &[(&str, &str)]) -> Result<Reply, Error> {
        let request = self.request(method, path);
        let add = |request: Builder, (name, value): &(&str, &str)| request.header(*name, *value);
        self.send(headers.iter().fold(request, add), None, TIMEOUT)
    }

    fn request(&self, method: &str, path: &str) -> Builder {
        Request::builder().method(method).uri(format!("{}{path}", self.base))
    }

    fn send(
        &self,
        mut request: Builder,
        body: Option<&[u8]>,
        timeout: Duration,
    ) -> Result<Reply, Error> {
        if let Some(key) = &self.key {
            request = request.header("authorization", format!("Bearer {key}"));
        }
        let answer = if let Some(body) = body {
            let request = request.header("content-type", "application/json").body(body)?;
            let request = self.agent.configure_request(request);
            self.agent.run(request.timeout_global(Some(timeout)).build())
        } else {
            let request = self.agent.configure_request(request.body(())?);
            self.agent.run(request.timeout_global(Some(timeout)).build())
        };
        let mut answer = answer.map_err(|error| self.failed(&error, timeout))?;
        let status = answer.status().as_u16();
        let headers = answer.headers().clone();
        let mut body = Vec::new();
        // The beginning of a larger answer is no JSON.
        let read = answer.body_mut().as_reader().take(LARGEST).read_to_end(&mut body);
        read.map_err(|error| self.failed(&error.into(), timeout))?;
        Ok(Reply { status, body, headers })
    }

    /// Sends a request with the body in a file, and sends it again while the server is busy or restarts. Returns an
    /// answer of success. All requests may arrive twice: their key makes two submissions one job, and what is canceled
    /// twice is canceled.
    pub fn call(
        &self,
        method: &str,
        path: &str,
        body: Option<(&Path, &[u8])>,
    ) -> Result<Reply, Error> {
        let (file, body) = body.unzip();
        let once = Uuid::now_v7().to_string();
        let (mut attempt, mut lost) = (0, None);
        loop {
            let request = self.request(method, path).header("idempotency-key", &once);
            let reply = match self.send(request, body, Duration::from_mins(2)) {
                // A proxy answers while its server restarts.
                Ok(reply) if !matches!(reply.status, 502 | 504) => reply,
                reply => {
                    if lost.is_none() {
                        say(&format!("lost {}; trying again for {RESTART:?}", self.base));
                    }
                    let lost = *lost.get_or_insert_with(Instant::now);
                    // The answer of the request can take minutes, that of this one cannot.
                    while lost.elapsed() <= RESTART && self.get("/healthz").is_err() {
                        sleep(Duration::from_secs(1));
                    }
                    if lost.elapsed() > RESTART {
                        return Err(refused(&reply?, file).into());
                    }
                    sleep(Duration::from_secs(1));
                    continue;
                }
            };
            let pause = reply.header("retry-after").parse().unwrap_or(1).max(1);
            match reply.status {
                0..300 => return Ok(reply),
                429 | 503 if attempt < RETRIES && pause <= LONGEST_PAUSE => {
                    say(&format!("the server is busy; next attempt in {pause} s"));
                    sleep(Duration::from_secs(pause));
                    attempt += 1;
                }
                _ => return Err(refused(&reply, file).into()),
            }
        }
    }

    fn failed(&self, error: &Failure, timeout: Duration) -> String {
        let base = &self.base;
        let tls: Option<&TlsError> = match error {
            Failure::Io(error) => error.get_ref().and_then(|cause| cause.downcast_ref()),
            _ => None,
        };
        match (error, tls) {
            // The system accepts connections for a process that is stopped.
            (Failure::Timeout(_), _) => {
                format!("the server at {base} does not answer within {timeout:?}")
            }
            (_, Some(TlsError::InvalidMessage(InvalidMessage::InvalidContentType))) => format!(
                "the server at {base} does not speak TLS. Enter an address that begins with http://"
            ),
            (_, Some(error)) => format!(
                "{base} is not secure: {error}. Enter a name of its certificate, or name the certificates of your own \
                 authority in SSL_CERT_FILE"
            ),
            (Failure::Rustls(error), _) => {
                format!("{error}. Name a readable file of certificates in SSL_CERT_FILE")
            }
            (Failure::BadUri(_) | Failure::Http(_), _) => format!("{base} is not a URL: {error}"),
            _ => format!(
                "no server answers at {base}: {error}. Is it running? Enter the address of a running server in the \
                 environment variable FRETWORK_URL"
            ),
        }
    }
}

/// Whether what the program sends to an address is secret: it is encrypted, or does not leave this machine.
pub fn is_private(base: &str) -> bool {
    let address = base.parse::<Uri>().ok();
    let host = address.as_ref().and_then(Uri::host).unwrap_or_default().trim_matches(['[', ']']);
    let is_loopback = host.parse::<IpAddr>().is_ok_and(|host| host.is_loopback());
    base.starts_with("https://") || host == "localhost" || is_loopback
}

/// Why a server refused a request. The exit code is 2 if the request has faults. The file of the body is named.
pub fn refused(reply: &Reply, file: Option<&Path>) -> Ended {
    let problem: Value = serde_json::from_slice(&reply.body).unwrap_or_default();
    let place = |it: &Value| it["pointer"].as_str().or(it["parameter"].as_str()).map(str::to_owned);
    let line = |it: &Value| Some(format!("{}: {}", place(it)?, it["detail"].as_str()?));
    let faults = problem["errors"].as_array();
    let mut lines: Vec<_> = faults.into_iter().flatten().filter_map(line).collect();
    if lines.is_empty() {
        let mut line = match (problem["detail"].as_str(), reply.status) {
            (Some(detail), _) => detail.to_owned(),
            (None, 502..505) => "a proxy answers, but no fretwork. Start fretwork".to_owned(),
            (None, status) => format!("the server answers {status}. Check FRETWORK_URL"),
        };
        if reply.status == 401 {
            // The advice of the server is for users of its API.
            let reason = line.split(" Send ").next().unwrap_or_default();
            line = format!("{reason} Enter a key in FRETWORK_KEY or FRETWORK_KEY_FILE.");
        }
        lines.push(line);
    }
    let name = file.map_or_else(String::new, |file| format!("{}: ", file.display()));
    let code = if matches!(reply.status, 400 | 422) { 2 } else { 1 };
    Ended { code, lines: lines.iter().map(|line| format!("{name}{line}")).collect() }
}
