//! Starts a server for a test, with a real store, real workers and real sockets.

use std::fmt::Write as _;
use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

use fretwork::http::{self, Origins, Settings};
use fretwork::service::workers::Workers;
use fretwork::service::{Service, WorkLimits};
use fretwork_job::{Answer, Begin, Key, Step, Task, Work};
use fretwork_store::{Options, Place, Store};
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};

use crate::database::{Database, Engine};

pub struct Server {
    pub address: SocketAddr,
    pub service: Service,
    _workers: Workers,
    pub dir: TempDir,
    /// The tables, if they are in PostgreSQL.
    shared: Option<Database>,
}

pub struct Reply {
    pub status: u16,
    pub headers: Vec<(String, String)>,
    pub body: Vec<u8>,
}

/// Whether the servers of this pass of the tests have their tables in PostgreSQL. `tests/with-postgres` sets this
/// variable.
pub fn in_postgres() -> bool {
    std::env::var_os("FRETWORK_TEST_POSTGRES").is_some()
}

impl Server {
    /// Starts a server that computes with the engine.
    pub async fn start() -> Self {
        Self::computing(Arc::new(Task::start), &Origins::Own).await
    }

    pub async fn computing(begin: Begin, origins: &Origins) -> Self {
        let settings = Settings { origins: origins.clone(), ..Settings::default() };
        Self::with(begin, &settings, &Options::default()).await
    }

    pub async fn with(begin: Begin, settings: &Settings, options: &Options) -> Self {
        Self::with_limit(begin, None, settings, options).await
    }

    /// Starts a server with a limit for the time of a run.
    pub async fn with_limit(
        begin: Begin,
        limit: Option<Duration>,
        settings: &Settings,
        options: &Options,
    ) -> Self {
        Self::opening(TempDir::new().unwrap(), begin, limit, settings, options).await
    }

    /// Starts a server with the database of a directory.
    pub async fn opening(
        dir: TempDir,
        begin: Begin,
        limit: Option<Duration>,
        settings: &Settings,
        options: &Options,
    ) -> Self {
        let limits = WorkLimits { run: limit, ..WorkLimits::default() };
        Self::limited(dir, begin, limits, settings, options).await
    }

    /// Starts a server with limits for runs and studies, and the database of a directory.
    pub async fn limited(
        dir: TempDir,
        begin: Begin,
        limits: WorkLimits,
        settings: &Settings,
        options: &Options,
    ) -> Self {
        let shared = in_postgres().then(|| Database::new(Engine::Postgres));
        let store = match &shared {
            Some(shared) => shared.open_with(options).await,
            None => Store::open(dir.path().into(), options).await.unwrap(),
        };
        store.recover().await.unwrap();
        let service = Service::new(store.clone(), begin, 2, limits);
        let workers = Workers::start(&store, 2, limits, &service.compute()).unwrap();
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let (api, settings) = (service.clone(), settings.clone());
        tokio::spawn(async move {
            http::serve(listener, None, api, &settings, std::future::pending()).await;
        });
        Self { address, service, _workers: workers, dir, shared }
    }

    /// Where the tables are.
    pub fn place(&self) -> Place {
        match &self.shared {
            Some(shared) => Place::Shared(shared.url()),
            None => self.dir.path().into(),
        }
    }

    /// Sends one request and reads the whole answer.
    pub async fn send(
        &self,
        method: &str,
        target: &str,
        headers: &[(&str, &str)],
        body: impl AsRef<[u8]>,
    ) -> Reply {
        send(self.address, method, target, headers, body).await.unwrap()
    }

    pub async fn get(&self, target: &str) -> Reply {
        self.send("GET", target, &[], "").await
    }

    pub async fn post(&self, target: &str, body: &Value) -> Reply {
        self.send("POST", target, &[JSON], body.to_string()).await
    }

    /// Submits a job and waits for its end.
    pub async fn compute(&self, body: &Value) -> Reply {
        let headers = [JSON, ("Prefer", "wait=60")];
        self.send("POST", "/v1/jobs", &headers, body.to_string()).await
    }
}

/// Sends one request and reads the whole answer. Fails if the connection breaks.
pub async fn send(
    address: SocketAddr,
    method: &str,
    target: &str,
    headers: &[(&str, &str)],
    body: impl AsRef<[u8]>,
) -> io::Result<Reply> {
    let body = body.as_ref();
    let mut head =
        format!("{method} {target} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n");
    if !body.is_empty() || method == "POST" {
        write!(head, "Content-Length: {}\r\n", body.len()).unwrap();
    }
    for (name, value) in headers {
        write!(head, "{name}: {value}\r\n").unwrap();
    }
    let mut connection = TcpStream::connect(address).await?;
    connection.write_all((head + "\r\n").as_bytes()).await?;
    connection.write_all(body).await?;
    let mut answer = Vec::new();
    connection.read_to_end(&mut answer).await?;
    Reply::parse(&answer).ok_or_else(|| io::ErrorKind::UnexpectedEof.into())
}

/// Reads one answer from a connection that stays open. Fails if the connection breaks.
pub async fn answer(connection: &mut TcpStream) -> io::Result<Reply> {
    let (mut answer, mut buffer) = (Vec::new(), [0; 4096]);
    loop {
        let whole = Reply::parse(&answer).filter(|reply| {
            let length = reply.header("content-length").unwrap().parse();
            length == Ok(reply.body.len())
        });
        if let Some(reply) = whole {
            return Ok(reply);
        }
        match connection.read(&mut buffer).await? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            length => answer.extend_from_slice(&buffer[..length]),
        }
    }
}

/// Reads a metric by its name and labels.
pub async fn metric(address: SocketAddr, name: &str) -> f64 {
    let reply = send(address, "GET", "/metrics", &[], "").await.unwrap();
    assert_eq!(reply.header("content-type"), Some("text/plain; version=0.0.4; charset=utf-8"));
    let line = reply.text().lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    line.unwrap_or_else(|| panic!("no {name} in {}", reply.text())).parse().unwrap()
}

pub const JSON: (&str, &str) = ("Content-Type", "application/json");

impl Reply {
    /// Returns none if the answer is incomplete.
    fn parse(answer: &[u8]) -> Option<Self> {
        let end = answer.windows(4).position(|window| window == b"\r\n\r\n")?;
        let head = std::str::from_utf8(&answer[..end]).unwrap();
        let mut lines = head.lines();
        let status = lines.next().unwrap().split(' ').nth(1).unwrap().parse().unwrap();
        let headers = lines
            .map(|line| line.split_once(": ").unwrap())
            .map(|(name, value)| (name.to_owned(), value.to_owned()))
            .collect();
        let reply = Self { status, headers, body: answer[end + 4..].to_vec() };
        let whole = reply.header("content-length").and_then(|length| length.parse().ok());
        // The answer to HEAD has a length but no body.
        (reply.body.is_empty() || whole.is_none_or(|length: usize| length == reply.body.len()))
            .then_some(reply)
    }

    pub fn header(&self, name: &str) -> Option<&str> {
        let mut found = self.headers.iter().filter(|(header, _)| header == name);
        let (_, value) = found.next()?;
        assert!(found.next().is_none(), "{name} appears twice");
        Some(value)
    }

    pub fn text(&self) -> &str {
        std::str::from_utf8(&self.body).unwrap()
    }

    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|error| {
            panic!("{error} in {}: {}", self.status, String::from_utf8_lossy(&self.body))
        })
    }

    /// Asserts that this is a complete problem of this kind, and returns it.
    pub fn problem(&self, status: u16, slug: &str) -> Value {
        let problem = self.json();
        assert_eq!(self.status, status, "{problem}");
        assert_eq!(self.header("content-type"), Some("application/problem+json"));
        assert_eq!(problem["type"], format!("/problems/{slug}"), "{problem}");
        assert_eq!(problem["status"], status);
        assert!(problem["title"].as_str().is_some_and(|title| !title.is_empty()));
        assert!(problem["detail"].as_str().is_some_and(|detail| !detail.is_empty()));
        assert_eq!(problem["instance"].as_str(), self.header("x-request-id"));
        problem
    }
}

/// The example with this name.
pub fn example(name: &str) -> Value {
    let found = http::EXAMPLES.iter().find(|example| example.name == name);
    serde_json::from_str(found.unwrap().body).unwrap()
}

/// The steel ball by the simplified rule, the quickest of the examples.
pub fn steel_ball() -> Value {
    example("steel-ball-simplified")
}

/// The steel ball with another amplitude, and so another key.
pub fn ball(amplitude: f64) -> Value {
    let mut body = steel_ball();
    body["scenario"]["motion"]["amplitude"] = json!(amplitude * 1e-6);
    body
}

/// The steel ball in a job whose bodies yield. It has the same key.
pub fn yielding_ball() -> Value {
    let mut body = steel_ball();
    for i in 0..2 {
        body["scenario"]["bodies"][i]["yield_strength"] = json!("300 MPa");
    }
    body
}

/// Asserts that these are the warnings of [`yielding_ball`] about its bodies.
pub fn assert_yields(warnings: &Value) {
    let warnings = warnings.as_array().unwrap_or_else(|| panic!("{warnings}"));
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    for (i, warning) in warnings.iter().enumerate() {
        assert_eq!(warning["kind"], "yield");
        let words =
            format!("exceeds the yield strength of the {} body (300 MPa)", ["first", "second"][i]);
        assert!(warning["detail"].as_str().unwrap().contains(&words), "{warning}");
    }
}

/// Blocks runs until a test opens the gate.
#[derive(Clone, Default)]
pub struct Gate(Arc<(Mutex<bool>, Condvar)>);

impl Gate {
    pub fn open(&self) {
        *self.0.0.lock().unwrap() = true;
        self.0.1.notify_all();
    }

    /// Runs that end when the gate opens, with a small document as their result.
    pub fn compute(&self) -> Begin {
        let gate = self.clone();
        Arc::new(move |key: &Key, _: &str, _| {
            Ok(Box::new(Gated { gate: gate.clone(), key: *key }) as Box<dyn Work>)
        })
    }

    /// Waits for a short time until the gate is open, so that the run can be canceled. Returns whether it is open.
    pub fn is_passed(&self) -> bool {
        let (open, changed) = &*self.0;
        let step = Duration::from_millis(20);
        *changed.wait_timeout_while(open.lock().unwrap(), step, |open| !*open).unwrap().0
    }

    /// The same runs, with a gate that is already open.
    pub fn opened() -> Begin {
        let gate = Self::default();
        gate.open();
        gate.compute()
    }
}

struct Gated {
    gate: Gate,
    key: Key,
}

impl Work for Gated {
    fn step(&mut self) -> Step {
        if !self.gate.is_passed() {
            return Step::Working { progress: 0.5 };
        }
        let body = document(&self.key.to_string()).into();
        Step::Done(Answer {
            body,
            summary: json!({"regime": "partial_slip", "wear_volume": 2.5e-13}),
            outline: Box::default(),
        })
    }
}

/// A small document with the members of a result.
pub fn document(key: &str) -> String {
    format!(
        "{{\"key\":\"{key}\",\"engine\":{{\"name\":\"fretwork\",\"numerics\":1}},\
         \"units\":{{\"cycles\":\"1\",\"radius\":\"m\",\"wear\":\"m\",\"wear_volume\":\"m^3\"}},\
         \"history\":{{\"cycles\":[0.0,1000.0],\"wear_volume\":[0.0,2.50e-13]}},\
         \"profiles\":{{\"cycles\":[0.0,1000.0],\"radius\":[0.0,1e-4,2e-4],\"limiting\":null,\
         \"wear\":[[0.0,0.0,0.0],[0.0,1.5e-7,null]]}}}}"
    )
}
