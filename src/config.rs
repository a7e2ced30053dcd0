//! The command line: commands, options and environment variables.

use std::convert::Infallible;
use std::ffi::OsStr;
use std::fmt::{self, Write as _};
use std::fs;
use std::net::{IpAddr, SocketAddr, ToSocketAddrs};
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::{Path, PathBuf};
use std::time::Duration;

use axum::http::{HeaderValue, Uri};
use bytesize::ByteSize;
use clap::builder::{FalseyValueParser, PossibleValuesParser, TypedValueParser};
use clap::parser::ValueSource;
use clap::{ArgAction, ArgMatches, Args, Parser, Subcommand, ValueEnum};
use fretwork::format::{Format, QUANTITIES, Quantity};
use fretwork::http::{self, Access, AdminKey, Connections, Limits, Origins, Patience};
use fretwork::job::Key;
use fretwork::service::WorkLimits;
use fretwork::store::{self, DatabaseUrl, Place, Role, Search};
use fretwork_engine::scenario::MAX_ANSWER;
use tracing_subscriber::filter::Targets;

use crate::telemetry::{LogFormat, log_levels};

const EXAMPLES: &str = "\
Examples:
  fretwork                                          serve on 127.0.0.1:8080, store results in ./data
  fretwork --listen 127.0.0.1:0 --data-dir /tmp/f   a free port (printed), another directory
  fretwork run examples/steel-ball.json             compute one file, without a server
  fretwork run - --format csv < job.json            read standard input, print the history as CSV
  fretwork run job.json --format npz --output r.npz write the whole result as NumPy arrays
  fretwork run job.json --plot worn.svg             also draw a figure; --quantity selects what
  fretwork verify                                   compare the program with known numbers
  fretwork health                                   exit code 0 if the server answers
  fretwork keys add anna --role submit              add an access key; then callers need one
  fretwork --database postgres://fretwork@db/fretwork   share a PostgreSQL database with other servers
  fretwork worker --database postgres://...         only compute, for these servers
  fretwork --print-config > fretwork.env            write the settings as environment variables

Every option of the server has an environment variable.";

const KEYS_EXAMPLES: &str = "\
Examples:
  fretwork keys add anna --role submit                  print a new key; send it as
                                                        Authorization: Bearer fretwork_...
  fretwork keys add dashboard --role read --rate 600    600 requests a minute
  fretwork keys add guest --role read --expires 30d
  fretwork keys list
  fretwork keys revoke anna                             all keys with this name
  fretwork keys revoke 0a1b2c3d                         one key, by its id";

const WORKER_EXAMPLES: &str = "\
Examples:
  export FRETWORK_DATABASE=postgres://fretwork:PASSWORD@db.example/fretwork
  fretwork worker                               one thread per processor
  fretwork worker --listen 0.0.0.0:9090         also answer Prometheus and health checks
  fretwork health --url http://127.0.0.1:9090   exit code 0 if the worker answers";

const EXPORT_EXAMPLES: &str = "\
Examples:
  fretwork export all.db                                    all results
  fretwork export cones.db shape=cone friction=0.6..0.8     the results that GET /v1/results lists
  fretwork export one.db --key 7262301e...                  one result, by its whole key";

const VERIFY_EXAMPLES: &str = "\
Examples:
  fretwork verify > VERIFICATION.md   write the page again
  fretwork verify --exact-volumes > engine/src/simulation/exact_volumes.csv
  fretwork verify --random 500 > src/verification/accuracy.md";

/// Fretting wear of axisymmetric contacts, as a service with a shared result cache.
///
/// Without a command, the server starts.
#[derive(Debug, Parser)]
#[command(version, args_conflicts_with_subcommands = true, after_help = EXAMPLES)]
pub struct Cli {
    /// The command; `serve` by default.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// The options of `serve` if no command is given.
    #[command(flatten)]
    pub serve: Serve,
}

/// A command.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Start the server (the default).
    Serve(Box<Serve>),
    /// Compute the runs of other servers, which share a PostgreSQL database. Answers no requests of clients.
    ///
    /// Start any number of workers on any number of machines, beside servers with the same --database.
    #[command(after_help = WORKER_EXAMPLES)]
    Worker(Box<Worker>),
    /// Compute a job body from a file, without a server or a database.
    ///
    /// The result goes to standard output or to a file, and a summary to standard error. If the job body is
    /// invalid, each fault is printed as `pointer: detail`, and the exit code is 2.
    Run(Run),
    /// Print the OpenAPI document of the server.
    Openapi,
    /// Compare computed numbers with the same numbers from other sources.
    ///
    /// Prints a page in Markdown. Each check has its reference, the computed value, the error and the accepted
    /// error. The exit code is 1 if a check fails. The command takes some seconds and needs no server.
    #[command(after_help = VERIFY_EXAMPLES)]
    Verify {
        /// Instead, print the table of volumes from which the error of the simplified rule follows.
        #[arg(long)]
        exact_volumes: bool,
        /// Instead, compare this number of random runs with fine ones. 500 take about half a minute.
        #[arg(long, value_name = "COUNT", conflicts_with = "exact_volumes")]
        random: Option<NonZeroUsize>,
    },
    /// Check a server's health: exit code 0 or 1.
    Health(Health),
    /// Write results to an SQLite file that another server can import.
    ///
    /// The server may run meanwhile. Exports all results, or those that match every NAME=VALUE (as in
    /// GET /v1/results), or those with the given keys.
    #[command(after_help = EXPORT_EXAMPLES)]
    Export(Export),
    /// Import the results of an exported file.
    ///
    /// The server may run meanwhile, and serves the imported results at once. The command checks the SHA-256 of
    /// every body, the key of every scenario, and whether the numbers can be the result of the scenario: limits, held
    /// quantities, energy balance. It computes a random sample of the results anew, and refuses what differs. It
    /// overwrites nothing. It imports the note of a result that has no note yet. It does not import pins. Refused
    /// results are printed to standard error; the exit code is then 2. An interrupted import continues when it is
    /// started again.
    Import(Import),
    /// Copy the whole database to a file, and check the copy.
    ///
    /// The server may run meanwhile. The copy is a snapshot.
    Backup(Backup),
    /// Replace the database with a backup. Stop the server first.
    Restore(Restore),
    /// Add, list and revoke access keys.
    ///
    /// Once there is a key, the server requires a key from every caller. A running server applies changes within
    /// a second.
    #[command(subcommand, after_help = KEYS_EXAMPLES)]
    Keys(Keys),
    /// Print who made, revoked and used which key, and who canceled and deleted whose jobs and results.
    ///
    /// Equal acts of one day (UTC) share a line. The last 100 000 lines are kept.
    Audit(Data),
}

/// A command for access keys.
#[derive(Debug, Subcommand)]
pub enum Keys {
    /// Add a key and print it. It cannot be printed again.
    Add(AddKey),
    /// List the keys, without their secrets.
    List(Data),
    /// Revoke keys by id or by name. Their signed links become invalid too.
    Revoke {
        /// The id of one key, or the name of one or more keys.
        name: String,
        #[command(flatten)]
        data: Data,
    },
}

/// A new key.
#[derive(Debug, Args)]
pub struct AddKey {
    /// The owner of the key: letters, digits and . _ @ + -. Keys with the same name own the same jobs.
    #[arg(value_parser = key_name)]
    pub name: String,
    /// What the key allows: `read` reads results, `submit` also submits jobs, `admin` allows everything.
    #[arg(long, value_parser = role, value_name = "read|submit|admin")]
    pub role: Role,
    /// Time until it expires, such as 90d [default: never].
    #[arg(long, value_name = "TIME", value_parser = lifetime)]
    pub expires: Option<Duration>,
    /// Requests per minute; 0 means no limit [default: the server's --rate-limit].
    #[arg(long, value_name = "N")]
    pub rate: Option<u32>,
    #[command(flatten)]
    pub data: Data,
}

/// The settings of the server.
#[derive(Debug, Clone, Args)]
pub struct Serve {
    /// Address and port to listen on; port 0 selects a free port.
    #[arg(long, env = "FRETWORK_LISTEN", default_value = "127.0.0.1:8080", value_parser = resolve)]
    pub listen: SocketAddr,
    /// Address and port that serve only UM-Bridge, for tools of uncertainty quantification. --listen serves it too.
    #[arg(long, env = "FRETWORK_UMBRIDGE_LISTEN", value_name = "ADDRESS", value_parser = resolve)]
    pub umbridge_listen: Option<SocketAddr>,
    /// Give every caller full access without a key, also on an address that other machines can reach.
    #[arg(long, env = "FRETWORK_NO_AUTH", action = ArgAction::SetTrue,
        value_parser = FalseyValueParser::new(), conflicts_with = "admin_key")]
    pub no_auth: bool,
    /// A key with the role `admin`, in addition to those of `fretwork keys`: at least 20 characters. Prefer the
    /// environment variable, because other users can see the command line.
    #[arg(long, env = "FRETWORK_ADMIN_KEY", hide_env_values = true, value_name = "KEY",
        value_parser = admin_key)]
    pub admin_key: Option<AdminKey>,
    /// A file with this key, such as a secret of a container.
    #[arg(long, env = "FRETWORK_ADMIN_KEY_FILE", value_name = "FILE",
        conflicts_with_all = ["admin_key", "no_auth"])]
    pub admin_key_file: Option<PathBuf>,
    /// Requests per minute of a key without its own limit. 0 means no limit.
    #[arg(long, env = "FRETWORK_RATE_LIMIT", default_value = "60000", value_name = "N")]
    pub rate_limit: u32,
    /// Evaluations (POST /v1/evaluate, derivatives, UM-Bridge) per minute of a key. They do not count as other requests. 0 means no limit.
    #[arg(long, env = "FRETWORK_EVALUATE_RATE", default_value = "60000", value_name = "N")]
    pub evaluate_rate: u32,
    /// Concurrent requests of one key. A waiting request and an event stream count until they end. 0 means no
    /// limit.
    #[arg(long, env = "FRETWORK_CONCURRENCY", default_value = "256", value_name = "N")]
    pub concurrency: u32,
    #[command(flatten)]
    pub data: Data,
    /// Worker threads that compute runs [default: one per processor]. With 0, `fretwork worker` computes them on other
    /// machines; this needs --database.
    #[arg(long, env = "FRETWORK_WORKERS", value_name = "N",
        value_parser = clap::value_parser!(u16).range(..=1024))]
    pub workers: Option<u16>,
    /// Allow web pages of this origin to call the server. Repeat the option for more origins; * allows all.
    #[arg(long = "cors-origin", env = "FRETWORK_CORS_ORIGIN", value_name = "URL",
        value_delimiter = ',', value_parser = origin)]
    pub cors_origins: Vec<HeaderValue>,
    /// Durability of a commit. With `full`, no commit is lost in a power cut. With `normal`, the last ones can be
    /// lost, but the database stays consistent.
    #[arg(long, env = "FRETWORK_SYNCHRONOUS", default_value = "normal")]
    pub synchronous: Synchronous,
    /// Seconds that runs may take to finish when the server stops. Unfinished runs start again at the next start.
    #[arg(long, env = "FRETWORK_DRAIN_SECONDS", default_value = "7", value_name = "SECONDS",
        value_parser = seconds)]
    pub drain_seconds: Duration,
    /// Time, such as 30s, after which other servers compute again what this one has left, if it dies. Each server renews its
    /// claim at a third of this time. Only for --database.
    #[arg(long, env = "FRETWORK_LEASE", default_value = "30s", value_name = "TIME", value_parser = lease)]
    pub lease: Duration,
    /// Maximum number of jobs in the queue. The last tenth is reserved for owners with few queued
    /// jobs.
    #[arg(long, env = "FRETWORK_QUEUE_LIMIT", default_value = "20000", value_name = "N",
        value_parser = clap::value_parser!(u32).range(1..))]
    pub queue_limit: u32,
    /// Maximum time of one run, such as 10min or 2h. The server refuses a job with a longer estimate. 0 means no
    /// limit.
    #[arg(long, env = "FRETWORK_RUN_LIMIT", default_value = "30min", value_name = "TIME",
        value_parser = duration)]
    pub run_limit: Duration,
    /// Maximum processor time of one study, such as 10min or 4h. The server refuses a study with a longer estimate. 0 means
    /// no limit.
    #[arg(long, env = "FRETWORK_STUDY_LIMIT", default_value = "4h", value_name = "TIME",
        value_parser = duration)]
    pub study_limit: Duration,
    /// Maximum number of points of one study.
    #[arg(long, env = "FRETWORK_STUDY_POINTS", default_value = "1048576", value_name = "N",
        value_parser = clap::value_parser!(u32).range(1..))]
    pub study_points: u32,
    /// Maximum size of the result of one study as JSON, up to 64MB.
    #[arg(long, env = "FRETWORK_STUDY_SIZE", default_value = "64MB", value_name = "SIZE")]
    pub study_size: ByteSize,
    /// How long finished jobs are kept, such as 90d; 0 means for ever. This does not affect results. Jobs are deleted earlier
    /// if the database would exceed --keep-results.
    #[arg(long, env = "FRETWORK_KEEP_JOBS", default_value = "90d", value_name = "TIME",
        value_parser = duration)]
    pub keep_jobs: Duration,
    /// Size of the database, such as 10GiB: results, jobs, scenarios of evicted results, and indexes. Beyond it, the server
    /// deletes what was used longest ago, except pinned results and unfinished jobs. The write-ahead log takes up to a sixteenth
    /// more (at least 1 MB, at most 32 MB), and for a moment more while a client reads for long. One result has at most 64 MB. 0
    /// means no limit.
    #[arg(long, env = "FRETWORK_KEEP_RESULTS", default_value = "10GiB", value_name = "SIZE")]
    pub keep_results: ByteSize,
    /// Disk space for the results that one owner pins, such as 1GiB. All owners together may pin half of --keep-results.
    /// Pinned results are never evicted.
    #[arg(long, env = "FRETWORK_PIN_QUOTA", default_value = "1GiB", value_name = "SIZE")]
    pub pin_quota: ByteSize,
    /// Memory for frequently read answers, such as 64MiB; 0 switches the memory cache off.
    #[arg(long, env = "FRETWORK_MEMORY_CACHE", default_value = "64MiB", value_name = "SIZE")]
    pub memory_cache: ByteSize,
    /// Memory for large bodies until they are read or sent: a quarter for requests (half of it for parsing), the rest for answers. One caller may
    /// use half of each part.
    #[arg(long, env = "FRETWORK_TRANSFER_MEMORY", default_value = "128MiB", value_name = "SIZE")]
    pub transfer_memory: ByteSize,
    /// Maximum number of connections. The last 64 are reserved for this machine.
    #[arg(long, env = "FRETWORK_CONNECTIONS", default_value = "4096", value_name = "N",
        value_parser = clap::value_parser!(u32).range(128..=1_000_000))]
    pub connections: u32,
    /// Maximum number of connections of one address. This machine and the trusted proxies have no limit of their
    /// own.
    #[arg(long, env = "FRETWORK_ADDRESS_CONNECTIONS", default_value = "1024", value_name = "N",
        value_parser = clap::value_parser!(u32).range(1..))]
    pub address_connections: u32,
    /// The address of a reverse proxy, which tells the address of each client in X-Forwarded-For. Repeat the option
    /// for more proxies.
    #[arg(
        long = "trusted-proxy",
        env = "FRETWORK_TRUSTED_PROXY",
        value_name = "ADDRESS",
        value_delimiter = ','
    )]
    pub trusted_proxies: Vec<IpAddr>,
    /// Level of the log: off, error, warn, info, debug or trace; for single modules as in info,sqlx=debug.
    #[arg(long, env = "FRETWORK_LOG", default_value = "info", value_name = "LEVEL", value_parser = log_levels)]
    pub log: Targets,
    /// Format of the log.
    #[arg(long, env = "FRETWORK_LOG_FORMAT", default_value = "text")]
    pub log_format: LogFormat,
    /// Print these settings with their sources, and exit.
    #[arg(long)]
    pub print_config: bool,
}

/// Durability of a commit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Synchronous {
    /// Commits survive a crash of the program.
    Normal,
    /// Commits survive a power cut.
    Full,
}

/// The settings of `run`.
#[derive(Debug, Args)]
pub struct Run {
    /// A job body, such as the files in examples/; - reads standard input.
    pub file: PathBuf,
    /// The format: json and npz hold the whole result; csv, ndjson and arrow hold the history.
    #[arg(long, default_value = "json", value_parser = one_of(&Format::ALL, |format| format.name()))]
    pub format: &'static Format,
    /// Output file [default: standard output].
    #[arg(long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Also draw a figure to this SVG file.
    #[arg(long, value_name = "FIGURE.svg")]
    pub plot: Option<PathBuf>,
    /// The quantity in the figure of a run: a profile, a history, or the loops.
    #[arg(long, default_value = "worn", requires = "plot",
        value_parser = one_of(&QUANTITIES, |quantity| quantity.name))]
    pub quantity: &'static Quantity,
}

/// Parses the name of one of these items.
fn one_of<T: Clone + Send + Sync>(
    items: &'static [T],
    name: fn(&T) -> &'static str,
) -> impl TypedValueParser<Value = &'static T> {
    PossibleValuesParser::new(items.iter().map(name))
        .try_map(move |text| items.iter().find(|item| name(item) == text).ok_or("unknown name"))
}

/// The settings of `health`.
#[derive(Debug, Args)]
pub struct Health {
    /// URL of the server [default: the address in `FRETWORK_LISTEN`, on this machine].
    #[arg(long, env = "FRETWORK_URL", default_value = None)]
    pub url: Option<String>,
    /// Address of the server if no URL is given.
    #[arg(long, env = "FRETWORK_LISTEN", hide = true, default_value = "127.0.0.1:8080",
        value_parser = resolve)]
    pub listen: SocketAddr,
}

/// The database of a command.
#[derive(Debug, Clone, Args)]
pub struct Data {
    /// The directory of the database; created if it is missing.
    #[arg(long, env = "FRETWORK_DATA_DIR", default_value = "data", value_name = "DIR")]
    pub data_dir: PathBuf,
    /// Instead of a directory, the address of a PostgreSQL database that several servers share, such as
    /// postgres://user:password@host/name. Prefer the environment variable, because other users can see the command line.
    #[arg(long, env = "FRETWORK_DATABASE", hide_env_values = true, value_name = "URL",
        value_parser = database)]
    pub database: Option<DatabaseText>,
}

/// The address of a database as it was given. It may contain a password.
#[derive(Clone)]
pub struct DatabaseText(String);

impl fmt::Debug for DatabaseText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("(not shown)")
    }
}

impl Data {
    /// Where the database is.
    pub fn place(&self) -> Result<Place, String> {
        match &self.database {
            None => Ok(Place::Directory(self.data_dir.clone())),
            Some(DatabaseText(url)) => {
                let url = url.parse::<DatabaseUrl>();
                url.map(Place::Shared).map_err(|error| format!("--database: {error}"))
            }
        }
    }

    /// The directory of the database. A database of PostgreSQL has none, and `instead` says what to do with it.
    pub fn directory(&self, instead: &str) -> Result<&Path, String> {
        match self.database {
            None => Ok(&self.data_dir),
            Some(_) => Err(format!("--database names a PostgreSQL database: {instead}")),
        }
    }
}

/// The settings of `worker`.
#[derive(Debug, Args)]
pub struct Worker {
    #[command(flatten)]
    pub data: Data,
    /// Worker threads that compute runs [default: one per processor].
    #[arg(long, env = "FRETWORK_WORKERS", value_name = "N",
        value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub workers: Option<u16>,
    /// Address and port for monitors: /healthz, /readyz and /metrics. If the database has access keys, /metrics requires
    /// one with the role `read`.
    #[arg(long, env = "FRETWORK_LISTEN", value_name = "ADDRESS", value_parser = resolve)]
    pub listen: Option<SocketAddr>,
    /// Seconds that runs may take to finish when the worker stops. Unfinished runs start again on another one.
    #[arg(long, env = "FRETWORK_DRAIN_SECONDS", default_value = "7", value_name = "SECONDS",
        value_parser = seconds)]
    pub drain_seconds: Duration,
    /// Time, such as 30s, after which other servers compute again what this one has left, if it dies. Each server renews its
    /// claim at a third of this time. Only for --database.
    #[arg(long, env = "FRETWORK_LEASE", default_value = "30s", value_name = "TIME", value_parser = lease)]
    pub lease: Duration,
    /// Maximum time of one run, such as 10min or 2h. 0 means no limit.
    #[arg(long, env = "FRETWORK_RUN_LIMIT", default_value = "30min", value_name = "TIME",
        value_parser = duration)]
    pub run_limit: Duration,
    /// Level of the log: off, error, warn, info, debug or trace; for single modules as in info,sqlx=debug.
    #[arg(long, env = "FRETWORK_LOG", default_value = "info", value_name = "LEVEL", value_parser = log_levels)]
    pub log: Targets,
    /// Format of the log.
    #[arg(long, env = "FRETWORK_LOG_FORMAT", default_value = "text")]
    pub log_format: LogFormat,
}

impl Worker {
    /// What a run may take.
    pub fn limits(&self) -> WorkLimits {
        WorkLimits { run: nonzero(self.run_limit), ..WorkLimits::default() }
    }
}

/// The settings of `export`.
#[derive(Debug, Args)]
pub struct Export {
    /// The file to write; it must not exist.
    pub file: PathBuf,
    /// A condition, such as shape=cone or wear_depth=..2um.
    #[arg(value_name = "NAME=VALUE", value_parser = condition, conflicts_with = "keys")]
    pub conditions: Vec<(String, String)>,
    /// The key of a result. Repeat the option for more results.
    #[arg(long = "key", value_name = "KEY")]
    pub keys: Vec<Key>,
    /// The database that contains the results.
    #[command(flatten)]
    pub data: Data,
}

/// The settings of `import`.
#[derive(Debug, Args)]
pub struct Import {
    /// The file that `export` wrote.
    pub file: PathBuf,
    /// How many results to compute anew, chosen at random; all if there are fewer. If one differs, all further ones are
    /// computed anew. Results that earlier versions of the engine computed cannot be computed anew.
    #[arg(long, value_name = "COUNT", default_value_t = 100)]
    pub verify: u64,
    /// The database that receives the results.
    #[command(flatten)]
    pub data: Data,
}

/// The settings of `backup`.
#[derive(Debug, Args)]
pub struct Backup {
    /// The file to write; it must not exist.
    pub file: PathBuf,
    /// The database to copy.
    #[command(flatten)]
    pub data: Data,
}

/// The settings of `restore`.
#[derive(Debug, Args)]
pub struct Restore {
    /// The file that `backup` wrote.
    pub file: PathBuf,
    /// Replace an existing database. It is kept under another name in the same directory.
    #[arg(long)]
    pub replace: bool,
    /// The database to replace.
    #[command(flatten)]
    pub data: Data,
}

/// Parses NAME=VALUE.
fn condition(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE, such as shape=cone")?;
    // Reports a bad condition before any file is opened.
    Search::default().set(name, value).map_err(|fault| format!("{name} {fault}"))?;
    Ok((name.to_owned(), value.to_owned()))
}

impl Serve {
    /// Where the database is. A directory needs workers in this process.
    pub fn place(&self) -> Result<Place, String> {
        let place = self.data.place()?;
        if self.workers == Some(0) && matches!(place, Place::Directory(_)) {
            return Err("--workers 0 needs --database, so that other machines compute".to_owned());
        }
        Ok(place)
    }

    /// Whether other machines can reach an address of the server.
    pub fn is_reachable(&self) -> bool {
        [Some(self.listen), self.umbridge_listen]
            .into_iter()
            .flatten()
            .any(|address| !address.ip().is_loopback())
    }

    /// The settings of the HTTP interface.
    pub fn interface(&self, admin_key: Option<AdminKey>) -> http::Settings {
        http::Settings {
            access: Access {
                open: self.no_auth,
                admin_key,
                limits: Limits {
                    per_minute: NonZeroU32::new(self.rate_limit),
                    evaluations: NonZeroU32::new(self.evaluate_rate),
                    at_once: NonZeroU32::new(self.concurrency),
                },
            },
            memory: self.memory_cache.as_u64(),
            transfers: self.transfer_memory.as_u64(),
            connections: Connections {
                total: self.connections as usize,
                per_address: self.address_connections as usize,
                proxies: self.trusted_proxies.iter().map(IpAddr::to_canonical).collect(),
            },
            patience: Patience::default(),
            origins: self.origins(),
        }
    }

    /// The settings of the store.
    pub fn storage(&self) -> store::Options {
        store::Options {
            full_sync: self.synchronous == Synchronous::Full,
            queue_limit: self.queue_limit as usize,
            keep_jobs: nonzero(self.keep_jobs),
            budget: Some(self.keep_results.as_u64()).filter(|bytes| *bytes > 0),
            pin_quota: self.pin_quota.as_u64(),
            lease: self.lease,
        }
    }

    /// The administrator's key from the environment or from a file. The error does not repeat it.
    pub fn admin_key(&self) -> Result<Option<AdminKey>, String> {
        let (key, source) = match (&self.admin_key, &self.admin_key_file) {
            (None, None) => return Ok(None),
            (Some(AdminKey(key)), _) => (key.clone(), "FRETWORK_ADMIN_KEY".to_owned()),
            (None, Some(file)) => {
                let file_name = file.display();
                let text = fs::read_to_string(file)
                    .map_err(|error| format!("cannot read the key in {file_name}: {error}"))?;
                (text.trim_end().to_owned(), format!("the key in {file_name}"))
            }
        };
        if key.len() >= 20 && key.bytes().all(|byte| byte.is_ascii_graphic() && byte != b':') {
            return Ok(Some(AdminKey(key)));
        }
        Err(format!(
            "{source} must have at least 20 printable characters without blanks and colons; \
             `openssl rand -hex 20` generates one"
        ))
    }

    /// What new runs and studies may take.
    pub fn limits(&self) -> WorkLimits {
        WorkLimits {
            run: nonzero(self.run_limit),
            study: nonzero(self.study_limit),
            study_points: self.study_points as usize,
            study_bytes: (self.study_size.as_u64() as usize).min(MAX_ANSWER),
        }
    }

    /// The web pages that may call the server.
    fn origins(&self) -> Origins {
        match self.cors_origins.as_slice() {
            [] => Origins::Own,
            list if list.iter().any(|origin| origin == "*") => Origins::Any,
            list => Origins::These(list.to_vec()),
        }
    }
}

/// The settings of the server as a file of environment variables. A comment names the source of each.
pub fn described(matches: &ArgMatches) -> String {
    let mut text = String::new();
    for argument in Serve::augment_args(clap::Command::new("")).get_arguments() {
        let (id, Some(name)) = (argument.get_id().as_str(), argument.get_env()) else { continue };
        let values = matches.get_raw(id).into_iter().flatten();
        let secret = argument.is_hide_env_values_set();
        let shown = |value: &OsStr| {
            if secret { "(not shown)".into() } else { value.to_string_lossy().into_owned() }
        };
        let values: Vec<_> = values.map(shown).collect();
        let source = match matches.value_source(id) {
            None => "not set",
            Some(ValueSource::CommandLine) => "command line",
            Some(ValueSource::EnvVariable) => "environment",
            Some(_) => "default",
        };
        let comment = if values.is_empty() || secret { "# " } else { "" };
        let name = name.to_string_lossy();
        // In such files a comment cannot follow a value on the same line.
        let _ = writeln!(text, "# {source}\n{comment}{name}={}", values.join(","));
    }
    text
}

fn role(text: &str) -> Result<Role, String> {
    text.parse().map_err(|_| "expected read, submit or admin".to_owned())
}

/// Parses the name of a key. The name must differ from addresses, ids of keys and reserved names.
fn key_name(text: &str) -> Result<String, String> {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"._@+-".contains(&byte);
    let is_id = text.len() == 8 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    let sound = (1..=64).contains(&text.len())
        && text.bytes().all(plain)
        && text.parse::<IpAddr>().is_err()
        && !is_id
        && ![http::ADMIN, http::ME].contains(&text);
    let expected = "expected up to 64 letters, digits and . _ @ + -; the name must not be a network \
        address, the id of a key, \"admin\" or \"me\"";
    if sound { Ok(text.to_owned()) } else { Err(expected.to_owned()) }
}

/// Accepts any text, because an error of clap would print the key. [`Serve::admin_key`] checks it.
#[expect(clippy::unnecessary_wraps, reason = "clap requires this signature")]
fn admin_key(text: &str) -> Result<AdminKey, Infallible> {
    Ok(AdminKey(text.to_owned()))
}

/// Parses the time of a lease. A shorter one would be lost by a busy server.
fn lease(text: &str) -> Result<Duration, String> {
    let time = duration(text)?;
    let sound = (Duration::from_secs(1)..=Duration::from_hours(1)).contains(&time);
    if sound { Ok(time) } else { Err("expected a time from 1s to 1h".to_owned()) }
}

/// Accepts any text, because an error of clap would print the password. [`Data::place`] checks it.
#[expect(clippy::unnecessary_wraps, reason = "clap requires this signature")]
fn database(text: &str) -> Result<DatabaseText, Infallible> {
    Ok(DatabaseText(text.to_owned()))
}

/// Parses the time until a key expires.
fn lifetime(text: &str) -> Result<Duration, String> {
    const LONGEST: Duration = Duration::from_hours(100 * 366 * 24);
    let time = duration(text)?;
    let sound = (Duration::from_secs(1)..=LONGEST).contains(&time);
    if sound { Ok(time) } else { Err("expected a time from 1s to 100years".to_owned()) }
}

/// A time limit. `None`, which means no limit, if `time` is 0.
fn nonzero(time: Duration) -> Option<Duration> {
    Some(time).filter(|time| !time.is_zero())
}

/// Parses an address and a port, and resolves the name of a host.
pub fn resolve(text: &str) -> Result<SocketAddr, String> {
    let mut found = text.to_socket_addrs().map_err(|error| {
        format!("{error}; expected an address and a port such as 127.0.0.1:8080")
    })?;
    found.next().ok_or_else(|| "the name has no address".to_owned())
}

/// Parses an origin. Accepts only the form that browsers send, because another form would match no page.
fn origin(text: &str) -> Result<HeaderValue, String> {
    let expected = "expected an origin such as https://example.org or http://localhost:3000, or *";
    if text == "*" {
        return Ok(HeaderValue::from_static("*"));
    }
    let uri: Uri = text.parse().map_err(|_| expected.to_owned())?;
    let (Some(scheme), Some(host)) = (uri.scheme_str(), uri.host()) else {
        return Err(expected.to_owned());
    };
    let default_port = match scheme {
        "http" => 80,
        "https" => 443,
        extension if extension.ends_with("-extension") => 0,
        other => return Err(format!("browsers load no pages with {other}; {expected}")),
    };
    let port = uri.port_u16().filter(|port| *port != default_port);
    let port = port.map_or_else(String::new, |port| format!(":{port}"));
    let written = format!("{scheme}://{}{port}", host.to_ascii_lowercase());
    if text != written {
        return Err(format!("browsers send this origin as {written}"));
    }
    HeaderValue::from_str(text).map_err(|_| expected.to_owned())
}

/// Parses a time with a unit; 0 needs no unit.
fn duration(text: &str) -> Result<Duration, String> {
    if text == "0" {
        return Ok(Duration::ZERO);
    }
    humantime::parse_duration(text)
        .map_err(|error| format!("{error}; expected a time such as 90s, 10min, 2h or 90d"))
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "expected a number of seconds".to_owned())?;
    Duration::try_from_secs_f64(seconds).map_err(|_| "expected seconds, 0 or more".to_owned())
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_command_line_definition_is_valid() {
        Cli::command().debug_assert();
    }

    #[test]
    fn the_options_of_the_server_work_with_and_without_serve() {
        for words in [&["fretwork", "--workers", "3"][..], &["fretwork", "serve", "--workers", "3"]]
        {
            let cli = Cli::try_parse_from(words).unwrap();
            let serve = match cli.command {
                Some(Command::Serve(serve)) => *serve,
                _ => cli.serve,
            };
            assert_eq!(serve.workers, Some(3));
        }
    }

    #[test]
    fn only_origins_that_browsers_send_are_accepted() {
        for good in [
            "*",
            "https://example.org",
            "https://example.org:80",
            "http://localhost:3000",
            "http://[::1]:3000",
            "chrome-extension://abcdefghijklmnop",
        ] {
            assert!(origin(good).is_ok(), "{good}");
        }
        for bad in [
            "",
            "null",
            "example.org",
            "https://example.org/",
            "https://example.org/app",
            "https://example.org?app",
            "https://anna@example.org",
            "ftp://example.org",
            "ws://example.org",
        ] {
            assert!(origin(bad).is_err(), "{bad}");
        }
        // Browsers send another form of these origins.
        for (bad, good) in [
            ("https://Example.org", "https://example.org"),
            ("https://example.org:443", "https://example.org"),
            ("HTTP://localhost:80", "http://localhost"),
        ] {
            assert!(origin(bad).is_err_and(|error| error.ends_with(good)), "{bad}");
        }
    }
}
