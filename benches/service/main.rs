//! Compares the HTTP service with a bare axum server that does only the minimum.
//!
//! The server is the built program. The bare server is this file, started as another process. Each has two threads for
//! requests. `wrk` (a Debian package) calls both in turn for a second, with one thread and 32 connections. Rates and
//! ratios are medians over the turns. Processor times are those of the server per answer, as Linux reports them. The
//! server writes its default log to `/dev/null`; `FRETWORK_LOG=off` switches it off.
//!
//! The databases are in the temporary directory. A busy disk slows both servers and hides the difference:
//! `TMPDIR=/dev/shm` selects memory.
//!
//! The scenario is `examples/steel-ball-simplified.json`, with 256 points and five output cycles.
//!
//! - `result`: `GET /v1/results/{key}`, compared with a route that has the same bytes in memory; plain and compressed,
//!   with the memory cache of the server and without.
//! - `job`: `POST /v1/jobs` with `Prefer: wait`, compared with a route that commits the body as one row per request
//!   through sqlx (SQLite, write-ahead log, synchronous NORMAL, one connection). A cached job has a known scenario. A
//!   computed job has a new scenario, and its result is stored.
//! - `evaluate`: `POST /v1/evaluate` for the last wear volume, force and energy, compared with the engine alone on all
//!   processor cores. `wrk` shares the cores with the server; the engine has them alone. The engine runs the prepared case, or
//!   also parses and prepares the body for each run, as the server does. Each is measured with the closed form, and with
//!   the default method. A closed run takes about as long as HTTP and the preparation together.
//! - `study`: a point of a Sobol sweep, as a job that is computed and stored, compared with the engine alone on all
//!   processor cores, which runs the same prepared case repeatedly.
//! - `umbridge`: `POST /Evaluate` for a wear depth in closed form, compared with UM-Bridge's own Python server and the
//!   same rule in NumPy (`umbridge_peer.py`, with the Python packages of `tests/clients/install`).
//! - `memory`: the memory of the server while ten thousand jobs wait.
//! - `front`: `POST /v1/jobs` of new scenarios at a server without workers whose tables are in PostgreSQL, compared with a
//!   route that inserts the same two rows in one transaction through sqlx, with as many connections.
//! - `nodes`: two `fretwork worker` of one thread with one PostgreSQL, compared with one, on runs of seconds. Both and the
//!   database share the processor cores.
//! - `queue`: short runs that a worker of two threads takes from the queue in PostgreSQL, computes and stores, compared with
//!   a bare queue, of which two connections take and finish rows with a statement each (`FOR UPDATE SKIP LOCKED`).
//!
//! - `fair`: how long the short runs of an owner take while two workers compute fits, long runs and sweeps of ten other
//!   owners; with SQLite, and on three nodes with one PostgreSQL. It has no baseline.
//!
//! `tests/postgres` starts the database, which syncs each commit.
//!
//! Arguments select the measurements: `cargo bench --bench service -- job memory`.

#![expect(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stderr,
    clippy::print_stdout,
    reason = "a benchmark prints, and stops at the first error"
)]

mod fair;
mod shared;

use std::hint::black_box;
use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::{self, Child, Command, ExitCode, Stdio};
use std::time::{Duration, Instant};
use std::{env, fs, iter, thread};

use axum::Router;
use axum::body::Bytes;
use axum::http::HeaderValue;
use axum::http::header::{CONTENT_ENCODING, CONTENT_TYPE};
use axum::routing::{get, post};
use axum::serve::ListenerExt as _;
use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use fretwork_study::Evaluation;
use serde_json::{Value, json};
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous};
use tempfile::TempDir;
use tokio::net::TcpListener;

const MEASUREMENTS: [(&str, fn()); 10] = [
    ("result", results),
    ("job", jobs),
    ("evaluate", evaluations),
    ("study", studies),
    ("umbridge", umbridge),
    ("memory", memory),
    ("front", shared::submissions),
    ("nodes", shared::nodes),
    ("queue", shared::queue),
    ("fair", fair::fairness),
];
const PROGRAM: &str = env!("CARGO_BIN_EXE_fretwork");
/// Python with the package `umbridge`, from `tests/clients/install`.
const PYTHON: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/target/clients/bin/python");
const PEER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/umbridge_peer.py");
const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/load.lua");
/// Number of measured turns of each server, after one turn that warms it up.
const TURNS: usize = 7;
/// A number that is larger than the number of requests that `wrk` sends in a turn.
const REQUESTS_PER_TURN: usize = 1_000_000;
const WAIT: &str = "prefer: wait=10\r\n";
const UNCACHED: &[&str] = &["--memory-cache", "0"];
const WAITING: usize = 10_000;

fn main() -> ExitCode {
    // Cargo adds `--bench`.
    let words: Vec<String> = env::args().skip(1).filter(|word| word != "--bench").collect();
    if let [word, dir, coding] = words.as_slice()
        && word == "bare"
    {
        serve_bare(Path::new(dir), coding);
        return ExitCode::SUCCESS;
    }
    if let [word, database] = words.as_slice()
        && word == "bare-shared"
    {
        shared::serve_bare(database);
        return ExitCode::SUCCESS;
    }
    if let Some(word) = words.iter().find(|word| MEASUREMENTS.iter().all(|(name, _)| name != word))
    {
        eprintln!("There is no measurement {word:?}.");
        return ExitCode::FAILURE;
    }
    if Command::new("wrk").arg("--version").output().is_err() {
        eprintln!("`wrk` is missing. Install it, on Debian with `apt-get install wrk`.");
        return ExitCode::FAILURE;
    }
    for (name, measure) in MEASUREMENTS {
        if words.is_empty() || words.iter().any(|word| word == name) {
            measure();
        }
    }
    ExitCode::SUCCESS
}

fn results() {
    println!("a stored result / the same bytes from memory");
    for (cache, options, least) in [("", &[][..], 0.8), (", no memory cache", UNCACHED, 0.3)] {
        let dir = directory();
        let server = Server::program(dir.path(), options);
        let mut client = server.connect();
        let job = client.json(200, &submission(WAIT, &ball("all", "00000000")));
        let result = format!("GET {}", job["links"]["result"].as_str().expect("a link"));
        for coding in ["identity", "zstd"] {
            let stored = request(&result, &format!("accept-encoding: {coding}\r\n"), "");
            let body = client.ask(200, &stored);
            let bare = Server::bare(dir.path(), coding, &body);
            let compared = compare(
                Load::new(&server, stored),
                Load::new(&bare, request("GET /bytes", "", "")),
            );
            report(&format!("{coding}, {} kB{cache}", body.len() / 1000), least, &compared);
        }
    }
}

fn jobs() {
    println!("a job / a committed row");
    let dir = directory();
    let server = Server::program(dir.path(), &[]);
    let bare = Server::bare(dir.path(), "identity", &[]);
    let known = ball("all", "00000000");
    let compared = |body: &str| {
        let job = Load::new(&server, submission(WAIT, body));
        compare(job, Load::new(&bare, request("POST /rows", "", &known)))
    };
    // `Load::new` has sent the same job once, so its result is cached.
    report("cached", 0.6, &compared(&known));
    let without_profiles = compared(&ball("none", "########"));
    report("computed, no profiles", 0.25, &without_profiles);
    println!("    {:.2} ms of processor time   (at most 0.45)", without_profiles.costs[0]);
    report("computed, all profiles", 0.06, &compared(&ball("all", "########")));
}

fn evaluations() {
    println!("an evaluation / a run of the engine alone");
    let dir = directory();
    let server = Server::program(dir.path(), &[]);
    for (method, model, once) in [
        ("closed form", json!({"method": "simplified", "xi": 0.8, "points": 256}), 0.35),
        ("exact", json!({}), 0.5),
    ] {
        let job: Value = serde_json::from_str(&ball("all", "########")).expect("a job");
        let mut body = json!({
            "scenario": job["scenario"],
            "outputs": ["wear_volume", "normal_force", "dissipated_energy"],
        });
        body["scenario"]["model"] = model;
        let (one, text) = (body.to_string().replace('#', "0"), body.to_string());
        let load = || Load::new(&server, request("POST /v1/evaluate", "", &text));
        let run = || {
            let mut evaluation = Evaluation::parse(one.as_bytes()).expect("a body");
            iter::repeat_with(|| evaluation.step()).find_map(|evaluated| evaluated)
        };
        let prepared = scenario::prepare(body_scenario(&one), "").expect("a scenario");
        let (scenario, mut case, _) = prepared;
        case.profiles.fill(false);
        let warnings = scenario.warnings(&case);
        let engine = || drop(black_box(Simulation::new(case.clone(), warnings.clone()).run()));
        report(&format!("{method}, prepared once"), once, &compare(load(), Alone::new(&engine)));
        let engine = || drop(black_box(run()));
        report(
            &format!("{method}, prepared each time"),
            0.5,
            &compare(load(), Alone::new(&engine)),
        );
    }
}

fn umbridge() {
    println!("Evaluate of UM-Bridge / of its Python server with the same rule in NumPy");
    let dir = directory();
    let server = Server::program(dir.path(), &[]);
    let peer = Server::start(Command::new(PYTHON).arg(PEER), &[]);
    let mut scenario = body_scenario(&ball("none", "56000000"));
    scenario["cycles"] = json!([1000]);
    let config = json!({
        "scenario": scenario, "parameters": ["/friction", "/cycles/0"], "outputs": ["wear_depth"]});
    let body = json!({"name": "wear", "input": [["varied", 10000]], "config": config});
    let body = body.to_string().replace("\"varied\"", "0.6########");
    let evaluate = request("POST /Evaluate", "", &body);
    let depth = |server: &Server| {
        let answer = server.connect().json(200, &evaluate.replace('#', "5"));
        answer["output"][0][0].as_f64().expect("a depth")
    };
    let (one, other) = (depth(&server), depth(&peer));
    assert!((one / other - 1.0).abs() < 0.02, "{one:e} and {other:e}");
    let load = |server| Load::new(server, evaluate.clone());
    report("closed form", 5.0, &compare(load(&server), load(&peer)));
}

fn studies() {
    println!("a point of a sweep / a run of the engine alone on all cores");
    let dir = directory();
    let server = Server::program(dir.path(), &[]);
    for (method, model, points) in [
        ("closed form", json!({"method": "simplified", "xi": 0.8, "points": 256}), 30_000),
        ("exact", json!({}), 5000),
    ] {
        let mut scenario = body_scenario(&ball("none", "00000000"));
        scenario["model"] = model;
        let sweep = json!({
            "scenario": scenario,
            "vary": [
                {"pointer": "/friction", "from": 0.65, "to": 0.75},
                {"pointer": "/motion/amplitude", "from": "2 um", "to": "2.4 um"},
            ],
            "design": "sobol",
            "samples": points,
            "outputs": ["wear_volume", "wear_depth"],
        });
        let study = Study { server: &server, sweep, points, turns: 0, used: server.used() };
        let (_, case, _) = scenario::prepare(scenario, "").expect("a scenario");
        let engine = || drop(black_box(Simulation::new(case.clone(), Vec::new()).run()));
        report(method, 0.7, &compare(study, Alone::new(&engine)));
    }
}

/// The scenario in a body.
fn body_scenario(body: &str) -> Value {
    serde_json::from_str::<Value>(body).expect("a body")["scenario"].take()
}

fn memory() {
    let dir = directory();
    let server = Server::program(dir.path(), &["--workers", "1"]);
    let mut client = server.connect();
    // Long exact runs under a held force keep the only worker busy.
    let mut long: Value = serde_json::from_str(&ball("all", "00000000")).expect("a job");
    long["scenario"]["load"]["held"] = json!("force");
    long["scenario"]["model"] = json!({"method": "exact", "tolerance": 1e-4, "points": 256});
    for i in 0..40 {
        long["scenario"]["cycles"] = json!([1e9 + f64::from(i)]);
        client.ask(202, &submission("", &long.to_string()));
    }
    let before = server.resident();
    let mut first = Value::Null;
    for i in 0..WAITING {
        let job = client.json(202, &submission("", &ball("all", &format!("{i:08}"))));
        if i == 0 {
            first = job;
        }
    }
    let full = server.resident();
    let first = first["links"]["self"].as_str().expect("a link");
    let first = client.json(200, &request(&format!("GET {first}"), "", ""));
    assert_eq!(first["state"], "queued", "the long runs ended");
    println!("{WAITING} jobs wait in {full:.0} MB   (below 150)   [{before:.0} MB before]");
}

/// A job: the steel ball with profiles at these cycles and these digits in its amplitude.
fn ball(profiles: &str, digits: &str) -> String {
    let text = include_str!("../../examples/steel-ball-simplified.json");
    let mut job: Value = serde_json::from_str(text).expect("an example");
    let scenario = &mut job["scenario"];
    assert_eq!(scenario["cycles"].as_array().map(Vec::len), Some(5), "output cycles");
    scenario["model"] = json!({"method": "simplified", "xi": 0.8, "points": 256});
    scenario["motion"]["amplitude"] = json!(format!("2.2{digits} um"));
    scenario["profiles_at"] = json!(profiles);
    job.to_string()
}

fn submission(headers: &str, job: &str) -> String {
    request("POST /v1/jobs", headers, job)
}

fn request(line: &str, headers: &str, body: &str) -> String {
    let length = body.len();
    format!(
        "{line} HTTP/1.1\r\nhost: localhost\r\n{headers}content-type: application/json\r\n\
         content-length: {length}\r\n\r\n{body}"
    )
}

fn directory() -> TempDir {
    TempDir::new().expect("a directory")
}

/// A request that `wrk` sends to a server again and again.
struct Load<'a> {
    server: &'a Server,
    /// The text of the request. `wrk` replaces the marks (`###`) in it by digits.
    request: String,
    turns: usize,
    answers: f64,
    /// Processor time of the server before the first turn, in ms.
    used: f64,
}

impl<'a> Load<'a> {
    /// Asserts that the server answers the request with 200.
    fn new(server: &'a Server, request: String) -> Self {
        Self::answered(server, request, 200)
    }

    /// Asserts that the server answers the request with this status.
    fn answered(server: &'a Server, request: String, status: u16) -> Self {
        server.connect().ask(status, &request.replace('#', "9"));
        Self { server, request, turns: 0, answers: 0.0, used: server.used() }
    }
}

/// A load that can be repeated and measured.
trait Repeated {
    /// Repeats the load for a second, and returns the number of repetitions per second.
    fn turn(&mut self) -> f64;

    /// Processor time of one repetition, in ms.
    fn cost(&self) -> f64;
}

impl Repeated for Load<'_> {
    fn turn(&mut self) -> f64 {
        let url = format!("http://{}", self.server.address);
        let sent = self.turns * REQUESTS_PER_TURN;
        let wrk = Command::new("wrk")
            .args(["-t1", "-c32", "-d1s", "-s", SCRIPT, &url, "--", &self.request])
            .arg(sent.to_string())
            .output()
            .expect("`wrk`, from `apt-get install wrk`");
        let output = String::from_utf8_lossy(&wrk.stdout);
        let last = output.lines().last().unwrap_or_default();
        let numbers: Vec<u32> = last.split_whitespace().map_while(|n| n.parse().ok()).collect();
        let [answers, microseconds, 0] = numbers[..] else {
            panic!("`wrk` reports errors: {wrk:?}");
        };
        self.turns += 1;
        self.answers += f64::from(answers);
        f64::from(answers) / f64::from(microseconds) * 1e6
    }

    fn cost(&self) -> f64 {
        (self.server.used() - self.used) / self.answers
    }
}

/// A sweep that a server computes repeatedly, each time with another seed.
struct Study<'a> {
    server: &'a Server,
    sweep: Value,
    points: u32,
    turns: u32,
    /// Processor time of the server before the first turn, in ms.
    used: f64,
}

impl Repeated for Study<'_> {
    fn turn(&mut self) -> f64 {
        self.sweep["seed"] = json!(self.turns);
        self.turns += 1;
        let body = json!({"sweep": self.sweep}).to_string();
        let start = Instant::now();
        let job = self.server.connect().json(200, &submission("prefer: wait=60\r\n", &body));
        assert_eq!(job["state"], "succeeded", "{job}");
        f64::from(self.points) / start.elapsed().as_secs_f64()
    }

    fn cost(&self) -> f64 {
        (self.server.used() - self.used) / f64::from(self.turns * self.points)
    }
}

/// Work that this process does on all processor cores.
struct Alone<'a> {
    work: &'a (dyn Fn() + Sync),
    done: f64,
    /// Processor time of this process before the first turn, in ms.
    used: f64,
}

impl<'a> Alone<'a> {
    fn new(work: &'a (dyn Fn() + Sync)) -> Self {
        Self { work, done: 0.0, used: used(process::id()) }
    }
}

impl Repeated for Alone<'_> {
    fn turn(&mut self) -> f64 {
        let start = Instant::now();
        let count = || {
            let mut count = 0_u32;
            while start.elapsed() < Duration::from_secs(1) {
                (self.work)();
                count += 1;
            }
            f64::from(count)
        };
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let done: f64 = thread::scope(|scope| {
            let threads: Vec<_> = (0..cores).map(|_| scope.spawn(count)).collect();
            threads.into_iter().map(|thread| thread.join().expect("a count")).sum()
        });
        self.done += done;
        done / start.elapsed().as_secs_f64()
    }

    fn cost(&self) -> f64 {
        (used(process::id()) - self.used) / self.done
    }
}

/// The comparison of two loads.
struct Compared {
    /// Median of the ratios of their rates.
    ratio: f64,
    /// Medians of the answers per second.
    rates: [f64; 2],
    /// Processor times per answer, in ms. Other processes disturb them less than the rates.
    costs: [f64; 2],
}

fn compare(mut one: impl Repeated, mut other: impl Repeated) -> Compared {
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    one.turn();
    other.turn();
    let pairs: Vec<_> = (0..TURNS).map(|_| [one.turn(), other.turn()]).collect();
    Compared {
        ratio: median(pairs.iter().map(|pair| pair[0] / pair[1]).collect()),
        rates: [0, 1].map(|i| median(pairs.iter().map(|pair| pair[i]).collect())),
        costs: [one.cost(), other.cost()],
    }
}

fn report(what: &str, least: f64, compared: &Compared) {
    let Compared { ratio, rates: [one, other], costs: [cost, other_cost] } = compared;
    println!(
        "  {what}: {ratio:.2}   (at least {least})   [{one:.0} and {other:.0} per second; \
         {cost:.3} and {other_cost:.3} ms of processor time]"
    );
}

/// A connection for single requests.
struct Client(BufReader<TcpStream>);

impl Client {
    /// Sends a request, asserts the status, and returns the body.
    fn ask(&mut self, status: u16, request: &str) -> Vec<u8> {
        self.0.get_mut().write_all(request.as_bytes()).expect("a connection");
        let mut head = String::new();
        while !head.ends_with("\r\n\r\n") {
            let read = self.0.read_line(&mut head).expect("an answer");
            assert!(read > 0, "the server closed the connection");
        }
        assert!(head.starts_with(&format!("HTTP/1.1 {status} ")), "{request}\n{head}");
        let named = head.to_lowercase();
        let length = named.split_once("content-length: ").and_then(|(_, rest)| rest.lines().next());
        let mut body = vec![0; length.expect("a length").parse().expect("a length")];
        self.0.read_exact(&mut body).expect("a body");
        body
    }

    fn json(&mut self, status: u16, request: &str) -> Value {
        serde_json::from_slice(&self.ask(status, request)).expect("JSON")
    }
}

/// Another process. It is killed when this is dropped.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        // The process may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A server in another process.
struct Server {
    process: Process,
    address: SocketAddr,
}

impl Server {
    fn program(dir: &Path, options: &[&str]) -> Self {
        let mut command = Command::new(PROGRAM);
        command.args(["--listen", "127.0.0.1:0", "--data-dir"]).arg(dir).args(options);
        Self::start(&mut command, &[])
    }

    /// Starts the bare server, with these encoded bytes in memory and its table in this directory.
    fn bare(dir: &Path, coding: &str, bytes: &[u8]) -> Self {
        let this = env::current_exe().expect("this program");
        Self::start(Command::new(this).arg("bare").arg(dir).arg(coding), bytes)
    }

    /// Starts a server that prints its address at the end of a line.
    fn start(command: &mut Command, input: &[u8]) -> Self {
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().expect("a server");
        child.stdin.take().expect("its input").write_all(input).expect("a reader");
        let mut line = String::new();
        let output = child.stdout.as_mut().expect("its output");
        BufReader::new(output).read_line(&mut line).expect("a line");
        let address = line.trim_end().rsplit("http://").next().expect("an address");
        let address = address.parse().expect("an address");
        Self { process: Process(child), address }
    }

    fn connect(&self) -> Client {
        let stream = TcpStream::connect(self.address).expect("a server");
        stream.set_nodelay(true).expect("a connection");
        Client(BufReader::new(stream))
    }

    /// The processor time of the server, in ms.
    fn used(&self) -> f64 {
        used(self.process.0.id())
    }

    /// The resident memory of the server, in MB.
    fn resident(&self) -> f64 {
        let status = status(self.process.0.id(), "status");
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        let kilobytes = line.and_then(|line| line.trim().strip_suffix(" kB"));
        kilobytes.and_then(|text| text.parse::<f64>().ok()).expect("a size") * 1.024e-3
    }
}

/// The processor time of a process, in ms.
fn used(process: u32) -> f64 {
    // Linux reports processor time in units of 10 ms.
    const TICK: f64 = 10.0;
    let stat = status(process, "stat");
    let fields = stat.rsplit_once(')').expect("its name").1.split_whitespace();
    let ticks = fields.skip(11).take(2).map(|ticks| ticks.parse::<f64>().expect("a count"));
    ticks.sum::<f64>() * TICK
}

/// The text of a file about a process under `/proc`.
fn status(process: u32, file: &str) -> String {
    fs::read_to_string(format!("/proc/{process}/{file}")).expect("a process on Linux")
}

/// The bare server. It serves the bytes of its standard input, and writes rows to a table.
#[tokio::main(worker_threads = 2)]
async fn serve_bare(dir: &Path, coding: &str) {
    let mut bytes = Vec::new();
    io::stdin().read_to_end(&mut bytes).expect("bytes");
    let bytes = Bytes::from(bytes);
    let json = (CONTENT_TYPE, HeaderValue::from_static("application/json"));
    let head = [json, (CONTENT_ENCODING, coding.parse().expect("a coding"))];
    let options = SqliteConnectOptions::new()
        .filename(dir.join("bare.db"))
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Normal);
    let pool = SqlitePoolOptions::new().max_connections(1).connect_with(options);
    let pool = pool.await.expect("a database");
    let table = "CREATE TABLE IF NOT EXISTS row (id INTEGER PRIMARY KEY, body BLOB NOT NULL)";
    sqlx::query(table).execute(&pool).await.expect("a table");
    let insert = async move |body: Bytes| {
        let insert = sqlx::query("INSERT INTO row (body) VALUES (?1)").bind(&body[..]);
        let done = insert.execute(&pool).await.expect("a row");
        let answer = format!("{{\"id\":{}}}", done.last_insert_rowid());
        ([(CONTENT_TYPE, "application/json")], answer)
    };
    let router = Router::new()
        .route("/bytes", get(async move || (head.clone(), bytes.clone())))
        .route("/rows", post(insert));
    listen(router).await;
}

/// Serves on a free port, and prints its address.
async fn listen(router: Router) {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    println!("http://{}", listener.local_addr().expect("an address"));
    let listener = listener.tap_io(|connection| {
        let _ = connection.set_nodelay(true);
    });
    axum::serve(listener, router).await.expect("to serve");
}
