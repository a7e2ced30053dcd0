//! Compares the HTTP service with a bare axum server that does only the minimum.
//!
//! The server is the built program. The bare server is this file, started as another process. Each has two threads for
//! requests. A client here calls both in turn over the same number of open connections. Ratios are medians over the
//! turns. The ratio of the processor times is printed too, because other processes disturb it less; it is read from
//! Linux. The server writes its default log to a closed output; `FRETWORK_LOG=off` switches it off.
//!
//! - `result`: `GET /v1/results/{key}`, compared with a route that has the same bytes in memory; with the memory cache
//!   of the server and without.
//! - `job`: `POST /v1/jobs`, compared with a route that commits one row of the size of a job per request through sqlx
//!   (SQLite, write-ahead log, synchronous NORMAL, one connection). A cached job has a known scenario. A computed job
//!   has a new scenario, and its answer contains the result.
//! - `table`: the time to read a result from a table of a million results, compared with a table of a thousand, with
//!   1 kB each and without the memory cache.
//! - `library`: the time of a page of `GET /v1/results` with a hundred thousand results. It should take at most 0.3 s
//!   for any search.
//! - `memory`: the memory of the server while ten thousand jobs wait.
//!
//! Arguments select the measurements: `cargo bench --bench service -- job memory`.

#![expect(
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a benchmark prints, and may stop where it stands"
)]

use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::net::SocketAddr;
use std::ops::Range;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use std::{env, fs};

use axum::Router;
use axum::body::Bytes;
use axum::http::header::CONTENT_TYPE;
use axum::routing::{get, post};
use axum::serve::ListenerExt as _;
use fretwork::job::SCALARS;
use serde_json::{Value, json};
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{AssertSqlSafe, ConnectOptions as _, Connection as _, SqliteConnection};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::Builder;
use tokio::task::JoinSet;
use xxhash_rust::xxh3::xxh3_64;

const PROGRAM: &str = env!("CARGO_BIN_EXE_fretwork");
const CONNECTIONS: usize = 16;
const ROUNDS: usize = 30;
const TURN: Duration = Duration::from_millis(100);
const WAITING: usize = 10_000;
const INSIDE: &str = "?include=result";
const FEW: u32 = 1000;
const MANY: u32 = 1_000_000;
const LISTED: u32 = 100_000;
/// Size of a row of the bare server in bytes: about the size of a job.
const ROW: usize = 256;

fn main() {
    let words: Vec<String> = env::args().skip(1).collect();
    if let [word, dir] = words.as_slice()
        && word == "bare"
    {
        let runtime = Builder::new_multi_thread().worker_threads(2).enable_all().build();
        return runtime.expect("a runtime").block_on(serve_bare(Path::new(dir)));
    }
    let chosen = |name: &str| {
        words.iter().any(|word| word == name) || words.iter().all(|word| word.starts_with("--"))
    };
    let runtime = Builder::new_current_thread().enable_all().build().expect("a runtime");
    runtime.block_on(async {
        if chosen("result") {
            results().await;
        }
        if chosen("job") {
            jobs().await;
        }
        if chosen("table") {
            tables().await;
        }
        if chosen("library") {
            library().await;
        }
        if chosen("memory") {
            memory().await;
        }
    });
}

async fn results() {
    println!("a kept result / the same bytes from memory");
    for (cache, options, least) in [("", &[][..], 0.7), (", no memory cache", uncached(), 0.3)] {
        let dir = directory();
        let server = Server::program(dir.path(), options);
        for points in [64, 256] {
            let mut client = Connection::to(server.address).await;
            let job = client.json(&submit("", &ball(points).to_string())).await;
            let ask = request("GET", job["links"]["result"].as_str().expect("a link"), "");
            let body = client.ask(&ask).await.to_vec();
            let bare = Server::bare(dir.path(), &body);
            let kept = Load::new(&server, move |_| ask.clone()).await;
            let route = Load::new(&bare, |_| request("GET", "/bytes", "")).await;
            let what = format!("{points} points, {} kB{cache}", body.len() / 1000);
            report(&what, least, &compare(kept, route).await);
        }
    }
}

async fn jobs() {
    println!("a job / a committed row");
    let dir = directory();
    let server = Server::program(dir.path(), &[]);
    let bare = Server::bare(dir.path(), &[]);
    let known = ball(256).to_string();
    let row = request("POST", "/rows", &known);
    let rows = async || {
        let row = row.clone();
        Load::new(&bare, move |_| row.clone()).await
    };
    let cached = submit("", &known);
    let cached = Load::new(&server, move |_| cached.clone()).await;
    report("cached", 0.6, &compare(cached, rows().await).await);
    for (points, profiles) in [(64, "none"), (64, "all"), (256, "all")] {
        let computed = distinct(points, profiles);
        let body =
            Connection::to(server.address).await.ask(&submit(INSIDE, &computed(0))).await.len();
        let computed = Load::new(&server, move |i| submit(INSIDE, &computed(i + 1))).await;
        let what = format!("computed, {points} points, profiles at {profiles}, {} kB", body / 1000);
        report(&what, 0.25, &compare(computed, rows().await).await);
    }
}

async fn tables() {
    let dirs = [directory(), directory()];
    let (mut servers, mut loads) = (vec![], vec![]);
    for (dir, rows) in dirs.iter().zip([FEW, MANY]) {
        // This start only creates the tables.
        drop(Server::program(dir.path(), &[]));
        let keys = fill(dir.path(), rows).await;
        let server = Server::program(dir.path(), uncached());
        // The keys are sorted. A long stride reads them from all over the table.
        let ask = move |i: usize| {
            let key = &keys[7_368_787 * i % keys.len()];
            request("GET", &format!("/v1/results/{key}"), "")
        };
        loads.push(Load::new(&server, ask).await);
        servers.push(server);
    }
    let [many_rows, few_rows] = [loads.pop(), loads.pop()].map(|load| load.expect("two loads"));
    let compared = compare(few_rows, many_rows).await;
    let Compared { ratio, rates: [few, many], by_cost } = compared;
    println!(
        "the time of a result out of {MANY} / out of {FEW} = {ratio:.2}   (at most 1.3)   \
         [by processor time {by_cost:.2}; {many:.0} and {few:.0} per second]"
    );
}

async fn library() {
    println!("the time of a page out of {LISTED} results   (at most 300 ms)");
    let dir = directory();
    // This start only creates the tables.
    drop(Server::program(dir.path(), &[]));
    list(dir.path(), LISTED).await;
    let server = Server::program(dir.path(), &[]);
    let mut connection = Connection::to(server.address).await;
    for query in [
        "",
        "sort=-wear_volume",
        "sort=-slope_angle&shape=cone",
        "evicted=true",
        "note=rig",
        "owner=nobody",
        "friction=0.4..0.6&sort=wear_depth",
        "friction=0.2..0.8&wear_depth=0.2..0.8&normal_force=..0.5",
        "friction=2..",
        "friction=0.2..0.3&shape=table",
    ] {
        let ask = request("GET", &format!("/v1/results?{query}"), "");
        let mut times = Vec::new();
        let mut found = 0;
        for _ in 0..5 {
            let start = Instant::now();
            found = connection.json(&ask).await["results"].as_array().expect("a page").len();
            times.push(start.elapsed());
        }
        times.sort_unstable();
        println!("  {found} of {query:?}: {:.1?}", times[2]);
    }
}

async fn memory() {
    let dir = directory();
    let server = Server::program(dir.path(), &["--workers", "1"]);
    let mut client = Connection::to(server.address).await;
    // Long exact runs under a held force keep the only worker busy.
    for i in 0..40 {
        let mut job = ball(256);
        job["scenario"]["cycles"] = json!([1e9 + f64::from(i)]);
        job["scenario"]["load"]["held"] = json!("force");
        job["scenario"]["model"] = json!({"method": "exact", "tolerance": 1e-4});
        client.ask(&request("POST", "/v1/jobs", &job.to_string())).await;
    }
    let before = server.resident();
    let jobs = distinct(64, "all");
    let mut first = Value::Null;
    for i in 0..WAITING {
        let job = client.json(&request("POST", "/v1/jobs", &jobs(i))).await;
        if i == 0 {
            first = job;
        }
    }
    let full = server.resident();
    let first = first["links"]["self"].as_str().expect("a link");
    assert_eq!(client.json(&request("GET", first, "")).await["state"], "queued");
    println!("{WAITING} jobs wait in {full:.0} MB   (below 150)   [{before:.0} MB before]");
}

/// The steel ball with this number of points.
fn ball(points: u32) -> Value {
    let text = include_str!("../examples/steel-ball.json");
    let mut job: Value = serde_json::from_str(text).expect("an example");
    job["scenario"]["model"]["points"] = json!(points);
    if points < 256 {
        job["scenario"]["cycles"] = json!([10_000, 100_000]);
    }
    job
}

/// Job bodies with different amplitudes.
fn distinct(points: u32, profiles: &str) -> impl Fn(usize) -> String + Send + Sync + use<> {
    let mut job = ball(points);
    job["scenario"]["profiles_at"] = json!(profiles);
    job["scenario"]["motion"]["amplitude"] = json!("HERE");
    let text = job.to_string();
    move |i| text.replace("HERE", &format!("{:.7} um", 2.0 + 1e-6 * i as f64))
}

/// A submission that waits for the end of its job.
fn submit(query: &str, body: &str) -> Vec<u8> {
    let rest = request("POST", &format!("/v1/jobs{query}"), body);
    let line = rest.iter().position(|byte| *byte == b'\n').expect("a line") + 1;
    [&rest[..line], b"prefer: wait=10\r\n", &rest[line..]].concat()
}

fn request(method: &str, path: &str, body: &str) -> Vec<u8> {
    let length = body.len();
    let headers = "host: localhost\r\ncontent-type: application/json";
    format!("{method} {path} HTTP/1.1\r\n{headers}\r\ncontent-length: {length}\r\n\r\n{body}")
        .into_bytes()
}

/// The options of a server without a memory cache.
fn uncached() -> &'static [&'static str] {
    let help = Command::new(PROGRAM).arg("--help").output().expect("the program");
    let known = String::from_utf8_lossy(&help.stdout).contains("--memory-cache");
    if known { &["--memory-cache", "0"] } else { &[] }
}

fn directory() -> TempDir {
    TempDir::new().expect("a directory")
}

/// The requests to one server, and the connections for them.
struct Load {
    connections: Vec<Connection>,
    request: Arc<dyn Fn(usize) -> Vec<u8> + Send + Sync>,
    asked: Arc<AtomicUsize>,
    answered: f64,
    process: u32,
    /// Processor time of the process before the measurement.
    used: f64,
}

impl Load {
    async fn new(
        server: &Server,
        request: impl Fn(usize) -> Vec<u8> + Send + Sync + 'static,
    ) -> Self {
        let mut connections = Vec::new();
        for _ in 0..CONNECTIONS {
            connections.push(Connection::to(server.address).await);
        }
        let process = server.child.id();
        Self {
            connections,
            request: Arc::new(request),
            asked: Arc::default(),
            answered: 0.0,
            process,
            used: used(process),
        }
    }

    /// Runs one turn, and returns the answers per second.
    async fn rate(&mut self) -> f64 {
        let start = Instant::now();
        let asking = self.connections.drain(..).map(|mut connection| {
            let (request, asked) = (Arc::clone(&self.request), Arc::clone(&self.asked));
            async move {
                let mut answers = 0;
                while start.elapsed() < TURN {
                    connection.ask(&request(asked.fetch_add(1, Ordering::Relaxed))).await;
                    answers += 1;
                }
                (connection, answers)
            }
        });
        let (connections, answers): (_, Vec<u32>) =
            asking.collect::<JoinSet<_>>().join_all().await.into_iter().unzip();
        self.connections = connections;
        let answers = f64::from(answers.iter().sum::<u32>());
        self.answered += answers;
        answers / start.elapsed().as_secs_f64()
    }

    /// Processor time per answer, in an arbitrary unit.
    fn cost(&self) -> f64 {
        (used(self.process) - self.used) / self.answered
    }
}

/// The ratios of two loads, as medians over their turns.
struct Compared {
    ratio: f64,
    rates: [f64; 2],
    /// The ratio of the processor times. Other processes disturb it less.
    by_cost: f64,
}

async fn compare(mut one: Load, mut other: Load) -> Compared {
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    // The first turns only warm up.
    one.rate().await;
    other.rate().await;
    let (mut ratios, mut rates) = (vec![], [vec![], vec![]]);
    for _ in 0..ROUNDS {
        let pair = [one.rate().await, other.rate().await];
        ratios.push(pair[0] / pair[1]);
        rates[0].push(pair[0]);
        rates[1].push(pair[1]);
    }
    let by_cost = other.cost() / one.cost();
    Compared { ratio: median(ratios), rates: rates.map(median), by_cost }
}

fn report(what: &str, least: f64, compared: &Compared) {
    let Compared { ratio, rates: [one, other], by_cost } = compared;
    println!(
        "  {what}: {ratio:.2}   (at least {least})   \
         [by processor time {by_cost:.2}; {one:.0} and {other:.0} per second]"
    );
}

/// The processor time of a process, from Linux.
fn used(process: u32) -> f64 {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).expect("a process on Linux");
    let fields = stat.rsplit_once(')').expect("its name").1.split_whitespace();
    fields.skip(11).take(2).map(|ticks| ticks.parse::<f64>().expect("a count")).sum()
}

/// An open connection.
struct Connection {
    stream: TcpStream,
    buffer: Vec<u8>,
}

impl Connection {
    async fn to(address: SocketAddr) -> Self {
        let stream = TcpStream::connect(address).await.expect("a server");
        stream.set_nodelay(true).expect("a connection");
        Self { stream, buffer: Vec::with_capacity(1 << 18) }
    }

    /// Sends a request, asserts success, and returns the body.
    async fn ask(&mut self, request: &[u8]) -> &[u8] {
        self.stream.write_all(request).await.expect("a connection");
        self.buffer.clear();
        let mut body = None;
        while body.as_ref().is_none_or(|body: &Range<usize>| self.buffer.len() < body.end) {
            let read = self.stream.read_buf(&mut self.buffer).await.expect("an answer");
            assert!(read > 0, "the server hung up");
            body = body.or_else(|| body_of(&self.buffer));
        }
        &self.buffer[body.expect("a body")]
    }

    async fn json(&mut self, request: &[u8]) -> Value {
        serde_json::from_slice(self.ask(request).await).expect("JSON")
    }
}

/// The range of the body of an answer; none while its head is incomplete.
fn body_of(answer: &[u8]) -> Option<Range<usize>> {
    let start = answer.windows(4).position(|bytes| bytes == b"\r\n\r\n")? + 4;
    let head = str::from_utf8(&answer[..start]).expect("a head");
    assert!(head.starts_with("HTTP/1.1 20"), "{head}");
    let length = head.split_once("content-length: ").expect("a length").1;
    let length: usize = length.lines().next()?.parse().expect("a length");
    Some(start..start + length)
}

/// A server in another process.
struct Server {
    child: Child,
    address: SocketAddr,
}

impl Server {
    fn program(dir: &Path, options: &[&str]) -> Self {
        let mut command = Command::new(PROGRAM);
        command.args(["--listen", "127.0.0.1:0", "--data-dir"]).arg(dir).args(options);
        Self::start(&mut command, &[])
    }

    /// Starts the bare server, with these bytes in memory and its table in this directory.
    fn bare(dir: &Path, bytes: &[u8]) -> Self {
        let this = env::current_exe().expect("this program");
        Self::start(Command::new(this).arg("bare").arg(dir), bytes)
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
        Self { child, address }
    }

    /// Its resident memory in MB.
    fn resident(&self) -> f64 {
        let status = fs::read_to_string(format!("/proc/{}/status", self.child.id()));
        let status = status.expect("the status of a process, as Linux shows it");
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        let kilobytes = line.and_then(|line| line.trim().strip_suffix(" kB"));
        kilobytes.and_then(|text| text.parse::<f64>().ok()).expect("a size") * 1.024e-3
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // The process may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The bare server. It serves the bytes of its standard input, and writes rows to a table.
async fn serve_bare(dir: &Path) {
    let mut bytes = Vec::new();
    io::stdin().read_to_end(&mut bytes).expect("bytes");
    let bytes = Bytes::from(bytes);
    let options = SqliteConnectOptions::new()
        .filename(dir.join("bare.db"))
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Normal)
        .disable_statement_logging();
    let pool = SqlitePoolOptions::new().max_connections(1).test_before_acquire(false);
    let pool = pool.connect_with(options).await.expect("a database");
    let table = "CREATE TABLE IF NOT EXISTS row (id INTEGER PRIMARY KEY, text BLOB NOT NULL)";
    sqlx::query(table).execute(&pool).await.expect("a table");
    let insert = async move |body: Bytes| {
        let insert = sqlx::query("INSERT INTO row (text) VALUES (?1)").bind(&body[..ROW]);
        let done = insert.execute(&pool).await.expect("a row");
        let answer = format!("{{\"id\":{}}}", done.last_insert_rowid());
        ([(CONTENT_TYPE, "application/json")], answer)
    };
    let router = Router::new()
        .route("/bytes", get(async move || ([(CONTENT_TYPE, "application/json")], bytes.clone())))
        .route("/rows", post(insert));
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    println!("http://{}", listener.local_addr().expect("an address"));
    let listener = listener.tap_io(|connection| {
        let _ = connection.set_nodelay(true);
    });
    axum::serve(listener, router).await.expect("to serve");
}

/// Writes this number of results of 1 kB to the tables of a stopped server. Returns about a hundred thousand of their
/// keys, sorted.
async fn fill(dir: &Path, rows: u32) -> Vec<String> {
    let mut db = written(dir).await;
    let results = "
        WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < ?1)
        INSERT INTO result (key, summary, digest, size, created, checksum)
        SELECT randomblob(32) AS key, ?2, zeroblob(32), 1000, 0, ?3 FROM n ORDER BY key";
    let summary = json!({"regime": "partial_slip", "wear_depth": 1.048_713_745_566e-6});
    let checksum = xxh3_64(&[0; 1000]).cast_signed();
    let results = sqlx::query(results).bind(rows).bind(summary.to_string()).bind(checksum);
    results.execute(&mut db).await.expect("rows");
    let bodies = "INSERT INTO result_blob (key, body) SELECT key, zeroblob(1000) FROM result";
    sqlx::query(bodies).execute(&mut db).await.expect("rows");
    let keys = "SELECT lower(hex(key)) FROM result WHERE random() % ?1 = 0 ORDER BY key";
    let keys = sqlx::query_scalar(keys).bind((rows / 100_000).max(1));
    let keys = keys.fetch_all(&mut db).await.expect("keys");
    db.close().await.expect("the database closed");
    keys
}

/// Writes this number of library entries without results to the tables of a stopped server. Their numbers are between 0
/// and 1, and every second one is a cone.
async fn list(dir: &Path, rows: u32) {
    let names: Vec<&str> = SCALARS.iter().map(|scalar| scalar.name).collect();
    let (names, values) =
        (names.join(", "), vec!["abs(random() / 9.3e18)"; names.len()].join(", "));
    let sql = format!(
        "WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {rows})
         INSERT INTO result (key, summary, digest, size, created)
         SELECT randomblob(32), '{{}}', zeroblob(32), 60000, 1700000000000 + i FROM n;
         INSERT INTO result_task (key, task) SELECT key, '{{}}' FROM result ORDER BY created;
         INSERT INTO outline
             (id, created, size, present, shape, method, regime, held, motion, {names})
         SELECT id, created, size, 1, iif(id % 2, 'cone', 'sphere'), 'exact', 'partial_slip',
             'depth', 'amplitude', {values}
         FROM result_task JOIN result USING (key)"
    );
    let mut db = written(dir).await;
    sqlx::raw_sql(AssertSqlSafe(sql)).execute(&mut db).await.expect("rows");
    db.close().await.expect("the database closed");
}

/// Opens the database of a stopped server for writing.
async fn written(dir: &Path) -> SqliteConnection {
    let options = SqliteConnectOptions::new()
        .filename(dir.join("fretwork.db"))
        .journal_mode(SqliteJournalMode::Off)
        .foreign_keys(false)
        .disable_statement_logging();
    options.connect().await.expect("a database")
}
