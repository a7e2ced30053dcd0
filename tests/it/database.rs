//! A database of either engine for one test.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};
use std::{fs, thread};

use fretwork_store::{DatabaseUrl, Error, Options, Place, Store};
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{AssertSqlSafe, Connection as _, Executor as _, PgConnection, SqliteConnection};
use tempfile::TempDir;
use tokio::runtime;
use tokio::time::sleep;

/// Longest wait of a test for an effect, also on a slow and busy machine. A test that waits longer hangs.
pub const PATIENCE: Duration = Duration::from_mins(5);

/// Where a test keeps its tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Engine {
    Sqlite,
    Postgres,
}

/// A PostgreSQL server for tests. It stops when its standard input is closed.
pub struct Cluster {
    process: Child,
    output: BufReader<ChildStdout>,
    /// The address of the database `postgres` on this server.
    address: String,
}

/// The PostgreSQL server that all tests of this process share.
static CLUSTER: LazyLock<Cluster> = LazyLock::new(|| Cluster::start(&[]));

impl Cluster {
    pub fn start(options: &[&str]) -> Self {
        let mut command = Command::new("tests/postgres");
        command.args(options).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut process = command.spawn().expect("tests/postgres can be executed");
        let output = BufReader::new(process.stdout.take().expect("its output is a pipe"));
        let mut cluster = Self { process, output, address: String::new() };
        cluster.address = cluster.read_address();
        cluster
    }

    fn read_address(&mut self) -> String {
        let mut address = String::new();
        self.output.read_line(&mut address).expect("its output can be read");
        assert!(address.starts_with("postgres://"), "tests/postgres has started no PostgreSQL");
        address.trim().to_owned()
    }

    /// The address of the database `postgres` on this server.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Sends a signal to all processes of the server. Each process gets it before its children are listed, so that a
    /// stopped process cannot start another one.
    pub fn signal(&self, name: &str) {
        let mut processes = vec![self.process.id().to_string()];
        while let Some(process) = processes.pop() {
            // The process may have ended meanwhile.
            let _ = Command::new("kill").args([name, &process]).status();
            let found = Command::new("pgrep").args(["-P", &process]).output().expect("pgrep");
            processes.extend(String::from_utf8_lossy(&found.stdout).lines().map(str::to_owned));
        }
    }

    /// Kills all processes of the server, and starts it again.
    pub fn restart(&mut self) {
        let input = self.process.stdin.as_mut().expect("its input is a pipe");
        input.write_all(b"restart\n").expect("it reads its input");
        self.read_address();
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        drop(self.process.stdin.take());
        let _ = self.process.wait();
    }
}

static NUMBER: AtomicU32 = AtomicU32::new(0);

/// Opens the database of a directory.
pub async fn open_with(dir: &Path, options: &Options) -> Store {
    let begun = Instant::now();
    loop {
        match Store::open(dir.into(), options).await {
            // While another test starts a program, the new process holds copies of all open locks for a moment.
            Err(Error::Locked { .. }) if begun.elapsed() < PATIENCE => {
                sleep(Duration::from_millis(10)).await;
            }
            opened => return opened.unwrap(),
        }
    }
}

/// The address of a database on the shared PostgreSQL server.
fn address(name: &str) -> String {
    CLUSTER.address.replace("/postgres?", &format!("/{name}?"))
}

/// An empty database.
#[derive(Debug)]
pub enum Database {
    Sqlite(TempDir),
    Postgres(Shared),
}

/// A database on the shared PostgreSQL server. It is removed when this value is dropped.
#[derive(Debug)]
pub struct Shared {
    name: String,
    is_owner: bool,
}

impl Drop for Shared {
    fn drop(&mut self) {
        if !self.is_owner {
            return;
        }
        let drop = format!("DROP DATABASE {} WITH (FORCE)", self.name);
        // `drop` is not async. So another thread waits until the database is removed.
        let dropping = thread::spawn(|| administer(drop));
        dropping.join().expect("the database can be removed");
    }
}

/// Executes a statement in the database `postgres`.
fn administer(statement: String) {
    let runtime = runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let mut db = PgConnection::connect(&CLUSTER.address).await.unwrap();
        db.execute(AssertSqlSafe(statement)).await.unwrap();
    });
}

impl Database {
    pub fn new(engine: Engine) -> Self {
        match engine {
            Engine::Sqlite => Self::Sqlite(TempDir::new().unwrap()),
            Engine::Postgres => {
                let name = format!("test_{}", NUMBER.fetch_add(1, Ordering::Relaxed));
                let create = format!("CREATE DATABASE {name} TEMPLATE template0");
                thread::spawn(|| administer(create)).join().unwrap();
                Self::Postgres(Shared { name, is_owner: true })
            }
        }
    }

    /// An empty database with an open store.
    pub async fn fresh(engine: Engine) -> (Self, Store) {
        let database = Self::new(engine);
        let store = database.open().await;
        (database, store)
    }

    pub async fn open(&self) -> Store {
        self.open_with(&Options::default()).await
    }

    pub async fn open_with(&self, options: &Options) -> Store {
        match self {
            Self::Sqlite(dir) => open_with(dir.path(), options).await,
            Self::Postgres(_) => Store::open(Place::Shared(self.url()), options).await.unwrap(),
        }
    }

    /// The address in PostgreSQL.
    pub fn address(&self) -> String {
        match self {
            Self::Sqlite(_) => panic!("SQLite has no address"),
            Self::Postgres(shared) => address(&shared.name),
        }
    }

    pub fn url(&self) -> DatabaseUrl {
        self.address().parse().unwrap()
    }

    /// The database as a crash of its server would leave it now. The leases of its workers have expired, as if time had
    /// passed.
    pub async fn crashed(self) -> Self {
        match self {
            Self::Sqlite(dir) => {
                let copy = TempDir::new().unwrap();
                for file in ["fretwork.db", "fretwork.db-wal"] {
                    if dir.path().join(file).exists() {
                        fs::copy(dir.path().join(file), copy.path().join(file)).unwrap();
                    }
                }
                Self::Sqlite(copy)
            }
            Self::Postgres(_) => {
                self.execute("UPDATE lease SET expires = 0, node = 'crashed'").await;
                self
            }
        }
    }

    /// Opens the database as a crash would leave it now.
    pub async fn after_a_crash(self) -> (Self, Store) {
        let crashed = self.crashed().await;
        let store = crashed.open().await;
        (crashed, store)
    }

    pub async fn raw(&self) -> Raw {
        match self {
            Self::Sqlite(dir) => {
                let options = SqliteConnectOptions::new().filename(dir.path().join("fretwork.db"));
                let options = options.create_if_missing(true);
                Raw::Sqlite(SqliteConnection::connect_with(&options).await.unwrap())
            }
            Self::Postgres(shared) => {
                Raw::Postgres(PgConnection::connect(&address(&shared.name)).await.unwrap())
            }
        }
    }

    /// Executes statements.
    pub async fn execute(&self, statements: &str) {
        self.raw().await.execute(statements).await;
    }

    /// The integer that a statement returns.
    pub async fn count(&self, query: &str) -> i64 {
        self.raw().await.count(query).await
    }
}

/// A connection to the tables, beside that of the store.
pub enum Raw {
    Sqlite(SqliteConnection),
    Postgres(PgConnection),
}

impl Raw {
    pub async fn execute(&mut self, statements: &str) {
        let statements = AssertSqlSafe(statements.to_owned());
        match self {
            Self::Sqlite(db) => drop(db.execute(sqlx::raw_sql(statements)).await.unwrap()),
            Self::Postgres(db) => drop(db.execute(sqlx::raw_sql(statements)).await.unwrap()),
        }
    }

    pub async fn count(&mut self, query: &str) -> i64 {
        let query = AssertSqlSafe(query.to_owned());
        match self {
            Self::Sqlite(db) => sqlx::query_scalar(query).fetch_one(db).await.unwrap(),
            Self::Postgres(db) => sqlx::query_scalar(query).fetch_one(db).await.unwrap(),
        }
    }
}
