//! Measurements of several processes that share one PostgreSQL.

use std::io::{BufRead as _, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::Instant;

use axum::Router;
use axum::body::Bytes;
use axum::http::StatusCode;
use axum::http::header::CONTENT_TYPE;
use axum::routing::post;
use serde_json::{Value, json};
use sqlx::postgres::{PgPool, PgPoolOptions};
use sqlx::{AssertSqlSafe, Connection as _, Executor as _, PgConnection};

use super::{
    Load, PROGRAM, Repeated, Server, TURNS, ball, compare, directory, listen, report, request,
    submission,
};

const POSTGRES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/postgres");
/// Number of connections to PostgreSQL: the same number that a server of the program opens for its operations.
const CONNECTIONS: u32 = 8;
/// Runs that the workers compute in one turn.
const RUNS: u32 = 4;
/// Short runs that wait in the queue before a turn, and rows of the bare queue.
const QUEUED: u32 = 3000;

/// A private PostgreSQL that syncs each commit. It stops when its input is closed.
pub struct Cluster {
    process: Child,
    address: String,
}

impl Cluster {
    pub fn start() -> Self {
        let mut command = Command::new(POSTGRES);
        command.arg("--durable").stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut process = command.spawn().expect("tests/postgres");
        let output = process.stdout.take().expect("its output");
        let mut address = String::new();
        BufReader::new(output).read_line(&mut address).expect("an address");
        Self { process, address: address.trim().to_owned() }
    }

    /// Creates a database. Returns its address.
    pub fn database(&self, name: &str) -> String {
        self.execute(&format!("CREATE DATABASE {name}"));
        self.address.replace("/postgres?", &format!("/{name}?"))
    }

    /// The number that a query of a database returns.
    #[tokio::main(flavor = "current_thread")]
    async fn number(database: &str, sql: &str) -> f64 {
        let mut db = PgConnection::connect(database).await.expect("a database");
        sqlx::query_scalar(AssertSqlSafe(sql)).fetch_one(&mut db).await.expect("a number")
    }

    #[tokio::main(flavor = "current_thread")]
    async fn execute(&self, sql: &str) {
        let mut db = PgConnection::connect(&self.address).await.expect("a database");
        db.execute(AssertSqlSafe(sql)).await.expect("a statement");
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        drop(self.process.stdin.take());
        let _ = self.process.wait();
    }
}

/// A server without workers, and with room for many jobs in its queue.
fn front(database: &str) -> Server {
    let dir = directory();
    Server::program(
        dir.path(),
        &["--database", database, "--workers", "0", "--queue-limit", "1000000"],
    )
}

/// Submissions that are queued, compared with a bare server that inserts the same two rows in a transaction.
pub fn submissions() {
    println!("a queued submission / the same inserts into PostgreSQL");
    let cluster = Cluster::start();
    let server = front(&cluster.database("front"));
    let rows = cluster.database("rows");
    // This server creates the tables, and is then stopped.
    drop(front(&rows));
    let mut command = Command::new(std::env::current_exe().expect("this program"));
    let bare = Server::start(command.arg("bare-shared").arg(&rows), &[]);
    let body = ball("none", "########");
    let known = ball("none", "00000000");
    let submitted = Load::answered(&server, submission("", &body), 202);
    let inserted = Load::answered(&bare, request("POST /rows", "", &known), 202);
    report("new scenarios", 0.5, &compare(submitted, inserted));
}

/// A server that inserts a run and its job for each request, with the body as its task.
#[tokio::main(worker_threads = 2)]
pub async fn serve_bare(database: &str) {
    let pool = PgPoolOptions::new().max_connections(CONNECTIONS).connect(database).await;
    let pool = pool.expect("a database");
    let insert = async move |body: Bytes| {
        let id = insert_rows(&pool, &body).await.expect("two rows");
        (StatusCode::ACCEPTED, [(CONTENT_TYPE, "application/json")], format!("{{\"id\":{id}}}"))
    };
    listen(Router::new().route("/rows", post(insert))).await;
}

async fn insert_rows(pool: &PgPool, body: &[u8]) -> sqlx::Result<i64> {
    let (mut key, mut id) = ([0; 32], [0; 16]);
    getrandom::fill(&mut key).expect("random bytes");
    getrandom::fill(&mut id[6..]).expect("random bytes");
    let mut tx = pool.begin().await?;
    let run: i64 = sqlx::query_scalar(
        "INSERT INTO run (key, owner, numerics, created, task, state, changed)
         VALUES ($1, '127.0.0.1', 2, moment(), $2, 'queued', moment()) RETURNING id",
    )
    .bind(key.as_slice())
    .bind(std::str::from_utf8(body).expect("a text"))
    .fetch_one(&mut *tx)
    .await?;
    sqlx::query(
        "INSERT INTO job (id, owner, key, run, state, attempt, origin, tags, warnings, created, priority,
             changes, claimable, study, submitted)
         VALUES ($1, '127.0.0.1', $2, $3, 'queued', 0, 'computed', '[]', '[]', moment(), 3, 'queued 0', 2,
             FALSE, $4)",
    )
    .bind(id.as_slice())
    .bind(key.as_slice())
    .bind(run)
    .bind(std::str::from_utf8(body).expect("a text"))
    .execute(&mut *tx)
    .await?;
    tx.commit().await?;
    Ok(run)
}

/// Workers of one thread that compute runs of several seconds. A turn ends when the last run is finished.
struct Workers<'a> {
    front: &'a Server,
    database: &'a str,
    count: usize,
    /// The number of turns so far. It gives each run a number of its own.
    turns: &'a std::cell::Cell<u32>,
}

/// A run of several seconds: blocks of different amplitudes at a constant force, with a small tolerance. Runs of
/// different numbers have different keys, but are the same problem on another scale of pressures. So all of them take
/// the same time.
fn long_run(number: u32) -> String {
    let mut job: Value = serde_json::from_str(&ball("none", "00000000")).expect("a job");
    let scale = 1.0 + f64::from(number) * 1e-6;
    let body = json!({"youngs_modulus": 205e9 * scale, "poisson_ratio": 0.3});
    let block = |number: u32| json!({"amplitude": 2e-6 + 1e-7 * f64::from(number), "cycles": 1e8});
    let scenario = &mut job["scenario"];
    scenario["bodies"] = json!([body, body]);
    scenario["wear"] = json!({"coefficient": 3.03e-14 / scale});
    scenario["load"] = json!({"normal_force": 100.0 * scale, "held": "force"});
    scenario["motion"] = json!({"blocks": (0..10).map(block).collect::<Vec<_>>()});
    scenario["cycles"] = json!([1e8, 1e9]);
    scenario["model"] = json!({"method": "exact", "tolerance": 1e-4, "points": 1024});
    job.to_string()
}

/// Starts a program that only computes.
fn worker(threads: &str, database: &str) -> super::Process {
    let mut command = Command::new(PROGRAM);
    command.args(["worker", "--workers", threads, "--database", database]);
    super::Process(command.stderr(Stdio::null()).spawn().expect("a worker"))
}

impl Repeated for Workers<'_> {
    fn turn(&mut self) -> f64 {
        let first = self.turns.replace(self.turns.get() + 1) * RUNS;
        let mut client = self.front.connect();
        let _workers: Vec<_> = (0..self.count).map(|_| worker("1", self.database)).collect();
        let began = Instant::now();
        let jobs: Vec<Value> = (first..first + RUNS)
            .map(|number| client.json(202, &submission("", &long_run(number))))
            .collect();
        for job in jobs {
            let address = job["links"]["self"].as_str().expect("a link");
            while client.json(200, &request(&format!("GET {address}?wait=60"), "", ""))["state"]
                != "succeeded"
            {}
        }
        f64::from(RUNS) / began.elapsed().as_secs_f64()
    }

    fn cost(&self) -> f64 {
        f64::NAN
    }
}

/// The throughput of two workers, compared with one. The database shares the processor cores with them.
pub fn nodes() {
    println!("two workers of one thread / one, for runs of several seconds");
    let cluster = Cluster::start();
    let database = cluster.database("nodes");
    let front = front(&database);
    let turns = std::cell::Cell::new(0);
    let workers = |count| Workers { front: &front, database: &database, count, turns: &turns };
    let (mut two, mut one) = (workers(2), workers(1));
    let pairs: Vec<_> = (0..TURNS / 2).map(|_| [two.turn(), one.turn()]).collect();
    for [two, one] in pairs {
        println!(
            "  {:.2}   (at least 1.7)   [{:.1} and {:.1} s for each run]",
            two / one,
            1.0 / two,
            1.0 / one
        );
    }
}

/// Short runs that two threads take from the queue, compute and store, compared with a bare queue: two connections take
/// a row and finish it, with a statement each.
pub fn queue() {
    println!("a short run from the queue / a row of a bare queue of two statements");
    let cluster = Cluster::start();
    let database = cluster.database("queue");
    let front = front(&database);
    for turn in 0..TURNS as u32 / 2 {
        let mut client = front.connect();
        for number in turn * QUEUED..(turn + 1) * QUEUED {
            client.ask(202, &submission("", &ball("none", &format!("{number:08}"))));
        }
        let worker = worker("2", &database);
        let live = "SELECT count(*)::FLOAT8 FROM run WHERE finished IS NULL";
        while Cluster::number(&database, live) > 0.0 {
            std::thread::sleep(std::time::Duration::from_millis(300));
        }
        drop(worker);
        let rate = format!(
            "SELECT count(*) * 1e3::FLOAT8 / (max(finished) - min(started)) FROM run WHERE id > {}",
            turn * QUEUED
        );
        let (runs, rows) = (Cluster::number(&database, &rate), bare_queue(&database));
        println!("  {:.2}   (at least 0.5)   [{runs:.0} and {rows:.0} per second]", runs / rows);
    }
}

/// The rows per second of the bare queue.
#[tokio::main(flavor = "current_thread")]
async fn bare_queue(database: &str) -> f64 {
    let mut db = PgConnection::connect(database).await.expect("a database");
    let table = format!(
        "DROP TABLE IF EXISTS bare;
         CREATE TABLE bare (id BIGINT PRIMARY KEY, state TEXT NOT NULL, task TEXT NOT NULL);
         CREATE INDEX bare_queued ON bare (id) WHERE state = 'queued';
         INSERT INTO bare SELECT id, 'queued', repeat('x', 500) FROM generate_series(1, {QUEUED}) AS id"
    );
    db.execute(AssertSqlSafe(table)).await.expect("a table");
    let work = async || {
        let mut db = PgConnection::connect(database).await.expect("a database");
        loop {
            let claim = sqlx::query_scalar::<_, i64>(
                "UPDATE bare SET state = 'running' WHERE id = (
                     SELECT id FROM bare WHERE state = 'queued' ORDER BY id LIMIT 1 FOR UPDATE SKIP LOCKED)
                 RETURNING id",
            );
            let Some(id) = claim.fetch_optional(&mut db).await.expect("a claim") else { return };
            let finish = sqlx::query("UPDATE bare SET state = 'succeeded' WHERE id = $1");
            finish.bind(id).execute(&mut db).await.expect("an update");
        }
    };
    let began = Instant::now();
    tokio::join!(work(), work());
    f64::from(QUEUED) / began.elapsed().as_secs_f64()
}
