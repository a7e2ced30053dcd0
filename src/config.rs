//! The command line: what can be asked of the program, and with what settings.

use std::convert::Infallible;
use std::ffi::OsStr;
use std::fmt::Write as _;
use std::net::{IpAddr, SocketAddr, ToSocketAddrs};
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

use axum::http::{HeaderValue, Uri};
use bytesize::ByteSize;
use clap::builder::{FalseyValueParser, PossibleValuesParser};
use clap::parser::ValueSource;
use clap::{ArgAction, ArgMatches, Args, Parser, Subcommand, ValueEnum};
use fretwork::format::{Format, Part, QUANTITIES};
use fretwork::http::{self, Access, AdminKey, Limits, Origins};
use fretwork::job::Key;
use fretwork::store::{self, Role, Search};

use crate::telemetry::LogFormat;

const EXAMPLES: &str = "\
Examples:
  fretwork                                          serve on 127.0.0.1:8080, keep results in ./data
  fretwork --listen 127.0.0.1:0 --data-dir /tmp/f   any free port (it is printed), another directory
  fretwork run examples/steel-ball.json             compute one file, without a server
  fretwork run - --format csv < job.json            from standard input; the history as CSV
  fretwork run job.json --format npz --output r.npz everything, as arrays for NumPy
  fretwork run job.json --plot worn.svg             the same and a figure; --quantity says of what
  fretwork verify                                   every check against what is known, as Markdown
  fretwork health                                   exit code 0 if the server answers
  fretwork keys add anna --role submit              make an access key; from then on callers need one
  fretwork --print-config > fretwork.env            the settings, as a file of environment variables

Every option of the server has an environment variable. FRETWORK_LOG selects what is logged
(info, warn, fretwork=debug, ...).";

const KEYS_EXAMPLES: &str = "\
Examples:
  fretwork keys add anna --role submit                  prints the key; send it as
                                                        Authorization: Bearer fretwork_...
  fretwork keys add dashboard --role read --rate 600    600 requests a minute
  fretwork keys add guest --role read --expires 30d
  fretwork keys list
  fretwork keys revoke anna                             all keys of that name
  fretwork keys revoke 0a1b2c3d                         one key, by its id";

const EXPORT_EXAMPLES: &str = "\
Examples:
  fretwork export all.db                                    everything
  fretwork export cones.db shape=cone friction=0.6..0.8     what GET /v1/results would list
  fretwork export one.db --key 7262301e...                  one result; the key in full";

const VERIFY_EXAMPLE: &str = "\
Example:
  fretwork verify > VERIFICATION.md   write the page that comes with the program anew";

/// Fretting wear of axisymmetric contacts, as a service with a shared result cache.
///
/// Without a command, the server starts.
#[derive(Debug, Parser)]
#[command(version, args_conflicts_with_subcommands = true, after_help = EXAMPLES)]
pub struct Cli {
    /// What to do; nothing means `serve`.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// The options of `serve`, without the word.
    #[command(flatten)]
    pub serve: Serve,
}

/// What the program can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Start the server (the default).
    Serve(Serve),
    /// Compute a job body from a file, without a server or a database.
    ///
    /// The result goes to standard output or to a file, a summary to standard error. Faults are printed one per
    /// line as `pointer: detail`; the exit code is then 2.
    Run(Run),
    /// Print the OpenAPI document of the server.
    Openapi,
    /// Compute everything that is known by another way, and print how far off it is.
    ///
    /// The page goes to standard output as Markdown: every check with its reference, the value of
    /// this program, the error and what is accepted. The exit code is 1 if a check fails. It takes
    /// some seconds, needs neither a server nor a file, and prints the same bytes each time.
    #[command(after_help = VERIFY_EXAMPLE)]
    Verify,
    /// Ask a server whether it is well: exit code 0 or 1.
    Health(Health),
    /// Write results into a file that another server imports and any SQLite tool reads.
    ///
    /// Works beside a running server. Takes all results that are there, or those that match every
    /// NAME=VALUE, as in GET /v1/results, or those of the keys given.
    #[command(after_help = EXPORT_EXAMPLES)]
    Export(Export),
    /// Take over the results of an exported file.
    ///
    /// Works beside a running server, which serves them at once. Every body is held against its
    /// SHA-256, every key against its scenario; nothing that is there is overwritten. Notes come
    /// along, also to results that are there already without one; pins do not. What does not come is
    /// named on standard error, and the last line counts it. Broken off, it goes on where it was when
    /// it is started again. The exit code is 2 if a result was refused.
    Import(Import),
    /// Copy the whole database into a file, and check the copy.
    ///
    /// Works beside a running server, which goes on meanwhile: the copy is that of one moment.
    Backup(Backup),
    /// Put a backup in the place of the database. No server may be running on it.
    Restore(Restore),
    /// Make, list and take back access keys.
    ///
    /// From the first key on, a server on this data directory asks every caller for one. Works beside
    /// a running server, which follows within a second.
    #[command(subcommand, after_help = KEYS_EXAMPLES)]
    Keys(Keys),
}

/// What can be done with access keys.
#[derive(Debug, Subcommand)]
pub enum Keys {
    /// Make a key and print it: this once, for it is not kept.
    Add(AddKey),
    /// List the keys, without their secrets.
    List(Data),
    /// Take keys back, by id or by name; links that they made end too.
    Revoke {
        /// The id of a key, or a name: then all keys of that name.
        name: String,
        #[command(flatten)]
        data: Data,
    },
}

/// A key that is to be made.
#[derive(Debug, Args)]
pub struct AddKey {
    /// Whose key it is: letters, digits and . _ @ + -. Keys of one name are one owner of jobs.
    #[arg(value_parser = key_name)]
    pub name: String,
    /// What it is good for: `read` looks at results, `submit` submits jobs too, `admin` may do
    /// everything.
    #[arg(long, value_parser = role, value_name = "read|submit|admin")]
    pub role: Role,
    /// When it ends, such as 90d from now [default: never].
    #[arg(long, value_name = "TIME", value_parser = lifetime)]
    pub expires: Option<Duration>,
    /// Requests per minute; 0 sets no limit [default: the server's --rate-limit].
    #[arg(long, value_name = "N")]
    pub rate: Option<u32>,
    #[command(flatten)]
    pub data: Data,
}

/// The settings of the server.
#[derive(Debug, Clone, Args)]
pub struct Serve {
    /// Address and port to listen on; port 0 takes a free one.
    #[arg(long, env = "FRETWORK_LISTEN", default_value = "127.0.0.1:8080", value_parser = resolve)]
    pub listen: SocketAddr,
    /// Ask nobody for a key, even if there are some, and allow an address that other machines can
    /// reach: everyone who reaches it may do everything.
    #[arg(long, env = "FRETWORK_NO_AUTH", action = ArgAction::SetTrue,
        value_parser = FalseyValueParser::new(), conflicts_with = "admin_key")]
    pub no_auth: bool,
    /// A key that may do everything, beside those made by `fretwork keys`: at least 20 characters,
    /// best set by the variable.
    #[arg(long, env = "FRETWORK_ADMIN_KEY", hide_env_values = true, value_name = "KEY",
        value_parser = admin_key)]
    pub admin_key: Option<AdminKey>,
    /// Requests a minute that one key may send, unless it has a limit of its own. 0 sets no limit.
    #[arg(long, env = "FRETWORK_RATE_LIMIT", default_value = "60000", value_name = "N")]
    pub rate_limit: u32,
    /// Requests of one key at work at the same time; a wait or an event stream is one until it ends.
    /// 0 sets no limit.
    #[arg(long, env = "FRETWORK_CONCURRENCY", default_value = "256", value_name = "N")]
    pub concurrency: u32,
    /// Where jobs and results are kept; created if it is missing.
    #[arg(long, env = "FRETWORK_DATA_DIR", default_value = "data", value_name = "DIR")]
    pub data_dir: PathBuf,
    /// Threads that compute [default: one per processor].
    #[arg(long, env = "FRETWORK_WORKERS", value_name = "N",
        value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub workers: Option<u16>,
    /// Let web pages of this origin call the server; repeat it for more, * for all.
    #[arg(long = "cors-origin", env = "FRETWORK_CORS_ORIGIN", value_name = "URL",
        value_delimiter = ',', value_parser = origin)]
    pub cors_origins: Vec<HeaderValue>,
    /// How hard a commit is: `full` survives a power cut at once, `normal` may lose the last
    /// moments (never consistency).
    #[arg(long, env = "FRETWORK_SYNCHRONOUS", default_value = "normal")]
    pub synchronous: Synchronous,
    /// Seconds that running computations are given to end when the server goes down. What is not
    /// done by then is done after the next start.
    #[arg(long, env = "FRETWORK_DRAIN_SECONDS", default_value = "7", value_name = "SECONDS",
        value_parser = seconds)]
    pub drain_seconds: Duration,
    /// Jobs that may wait; more are refused until some are done. The last tenth is kept for callers
    /// who have little in the queue.
    #[arg(long, env = "FRETWORK_QUEUE_LIMIT", default_value = "20000", value_name = "N",
        value_parser = clap::value_parser!(u32).range(1..))]
    pub queue_limit: u32,
    /// The longest that one computation may take, such as 10min or 2h; what would take longer by its
    /// estimate is refused. 0 sets no limit.
    #[arg(long, env = "FRETWORK_RUN_LIMIT", default_value = "30min", value_name = "TIME",
        value_parser = duration)]
    pub run_limit: Duration,
    /// How long jobs are kept after their end, such as 90d; 0 keeps them for ever. Results are not
    /// touched by it.
    #[arg(long, env = "FRETWORK_KEEP_JOBS", default_value = "90d", value_name = "TIME",
        value_parser = duration)]
    pub keep_jobs: Duration,
    /// How much room results may take, such as 10GiB: beyond it, those that were read longest ago are
    /// dropped, unless they are pinned. A single one may have 64 MB. 0 sets no limit.
    #[arg(long, env = "FRETWORK_KEEP_RESULTS", default_value = "10GiB", value_name = "SIZE")]
    pub keep_results: ByteSize,
    /// Memory for the answers that are asked for most, such as 64MiB; 0 for none.
    #[arg(long, env = "FRETWORK_MEMORY_CACHE", default_value = "64MiB", value_name = "SIZE")]
    pub memory_cache: ByteSize,
    /// What log lines look like.
    #[arg(long, env = "FRETWORK_LOG_FORMAT", default_value = "text")]
    pub log_format: LogFormat,
    /// Print these settings and where each comes from, and do not start.
    #[arg(long)]
    pub print_config: bool,
}

/// How hard a commit is.
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
    /// What to write: the whole result (json, npz), or its history as a table (csv, ndjson, arrow).
    #[arg(long, default_value = "json")]
    pub format: RunFormat,
    /// Where to write it, instead of standard output.
    #[arg(long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Where to draw a figure of it (SVG), besides.
    #[arg(long, value_name = "FIGURE.svg")]
    pub plot: Option<PathBuf>,
    /// What the figure shows: the worn profile or another profile, a history, or the loops.
    #[arg(long, default_value = "worn", requires = "plot", value_parser = quantities())]
    pub quantity: String,
}

/// The quantities that can be drawn.
fn quantities() -> PossibleValuesParser {
    PossibleValuesParser::new(QUANTITIES.iter().map(|quantity| quantity.name))
}

/// What `run` writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum RunFormat {
    /// The whole result.
    Json,
    /// The history, one row per instant.
    Csv,
    /// The history, one JSON object per line.
    Ndjson,
    /// The whole result as NumPy arrays.
    Npz,
    /// The history as an Arrow file.
    Arrow,
}

impl RunFormat {
    /// What of the result is written, and in which form.
    pub fn form(self) -> (Part, Format) {
        match self {
            Self::Json => (Part::Whole, Format::Json),
            Self::Csv => (Part::History, Format::Csv),
            Self::Ndjson => (Part::History, Format::Ndjson),
            Self::Npz => (Part::Whole, Format::Npz),
            Self::Arrow => (Part::History, Format::Arrow),
        }
    }
}

/// The settings of `health`.
#[derive(Debug, Args)]
pub struct Health {
    /// The server [default: where `FRETWORK_LISTEN` says, on this machine].
    #[arg(long, env = "FRETWORK_URL", default_value = None)]
    pub url: Option<String>,
    /// Where the server listens, if no URL is given.
    #[arg(long, env = "FRETWORK_LISTEN", hide = true, default_value = "127.0.0.1:8080",
        value_parser = resolve)]
    pub listen: SocketAddr,
}

/// Where the database lies that a command is about.
#[derive(Debug, Args)]
pub struct Data {
    /// Where jobs and results are kept.
    #[arg(long, env = "FRETWORK_DATA_DIR", default_value = "data", value_name = "DIR")]
    pub data_dir: PathBuf,
}

/// The settings of `export`.
#[derive(Debug, Args)]
pub struct Export {
    /// The file to write; it must not exist.
    pub file: PathBuf,
    /// What to look for, such as shape=cone or wear_depth=..2um.
    #[arg(value_name = "NAME=VALUE", value_parser = condition, conflicts_with = "keys")]
    pub conditions: Vec<(String, String)>,
    /// The key of a result; repeat it for more.
    #[arg(long = "key", value_name = "KEY")]
    pub keys: Vec<Key>,
    /// Where to take them from.
    #[command(flatten)]
    pub data: Data,
}

/// The settings of `import`.
#[derive(Debug, Args)]
pub struct Import {
    /// The file that `export` wrote.
    pub file: PathBuf,
    /// Where to put them.
    #[command(flatten)]
    pub data: Data,
}

/// The settings of `backup`.
#[derive(Debug, Args)]
pub struct Backup {
    /// The file to write; it must not exist.
    pub file: PathBuf,
    /// What to copy.
    #[command(flatten)]
    pub data: Data,
}

/// The settings of `restore`.
#[derive(Debug, Args)]
pub struct Restore {
    /// The file that `backup` wrote.
    pub file: PathBuf,
    /// Take the place of a database that is there; it is kept beside the new one.
    #[arg(long)]
    pub replace: bool,
    /// Where to put it.
    #[command(flatten)]
    pub data: Data,
}

/// A name and a value with = between them.
fn condition(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE, such as shape=cone")?;
    // So that what is wrong is said before anything is opened.
    Search::default().set(name, value).map_err(|fault| format!("{name} {fault}"))?;
    Ok((name.to_owned(), value.to_owned()))
}

impl Serve {
    /// What the interface must know.
    pub fn interface(&self) -> http::Settings {
        http::Settings {
            access: Access {
                open: self.no_auth,
                admin_key: self.admin_key.clone(),
                limits: Limits {
                    per_minute: NonZeroU32::new(self.rate_limit),
                    at_once: NonZeroU32::new(self.concurrency),
                },
            },
            memory: self.memory_cache.as_u64(),
            origins: self.origins(),
        }
    }

    /// How the database is used.
    pub fn storage(&self) -> store::Options {
        store::Options {
            full_sync: self.synchronous == Synchronous::Full,
            queue_limit: usize::try_from(self.queue_limit).unwrap_or(usize::MAX),
            keep_jobs: some(self.keep_jobs),
            budget: Some(self.keep_results.as_u64()).filter(|bytes| *bytes > 0),
            ..store::Options::default()
        }
    }

    /// Why these settings cannot be, if they cannot. A secret is not repeated.
    pub fn check(&self) -> Result<(), String> {
        let sound = |AdminKey(key): &AdminKey| {
            key.len() >= 20 && key.bytes().all(|byte| byte.is_ascii_graphic() && byte != b':')
        };
        match &self.admin_key {
            Some(key) if !sound(key) => Err("FRETWORK_ADMIN_KEY must have at least 20 printable \
                characters and neither blanks nor colons; `openssl rand -hex 20` makes a good one"
                .to_owned()),
            _ => Ok(()),
        }
    }

    /// How long a run may take.
    pub fn limit(&self) -> Option<Duration> {
        some(self.run_limit)
    }

    /// Which web pages may call the server.
    fn origins(&self) -> Origins {
        match self.cors_origins.as_slice() {
            [] => Origins::Own,
            list if list.iter().any(|origin| origin == "*") => Origins::Any,
            list => Origins::These(list.to_vec()),
        }
    }
}

/// The settings of the server as a file of environment variables, each with where it comes from.
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
        // A comment has a line of its own: in such files it cannot follow a value.
        let _ = writeln!(text, "# {source}\n{comment}{name}={}", values.join(","));
    }
    text
}

fn role(text: &str) -> Result<Role, String> {
    text.parse().map_err(|_| "expected read, submit or admin".to_owned())
}

/// A name that stands in lists, logs and answers, and is nobody's address.
fn key_name(text: &str) -> Result<String, String> {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"._@+-".contains(&byte);
    let is_id = text.len() == 8 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    let sound = (1..=64).contains(&text.len())
        && text.bytes().all(plain)
        && text.parse::<IpAddr>().is_err()
        && !is_id
        && ![http::ADMIN, http::ME].contains(&text);
    let expected = "expected up to 64 letters, digits and . _ @ + - that are no network address, no \
        id of a key, not \"admin\" and not \"me\"";
    if sound { Ok(text.to_owned()) } else { Err(expected.to_owned()) }
}

/// Takes whatever is there: a refusal by the parser would show it. [`Serve::check`] judges it.
#[expect(clippy::unnecessary_wraps, reason = "this is the form of a parser")]
fn admin_key(text: &str) -> Result<AdminKey, Infallible> {
    Ok(AdminKey(text.to_owned()))
}

/// How long a key may be good.
fn lifetime(text: &str) -> Result<Duration, String> {
    const LONGEST: Duration = Duration::from_hours(100 * 366 * 24);
    let time = duration(text)?;
    let sound = (Duration::from_secs(1)..=LONGEST).contains(&time);
    if sound { Ok(time) } else { Err("expected a time from 1s to 100years".to_owned()) }
}

/// A limit; 0 is none.
fn some(time: Duration) -> Option<Duration> {
    Some(time).filter(|time| !time.is_zero())
}

fn resolve(text: &str) -> Result<SocketAddr, String> {
    let mut found = text.to_socket_addrs().map_err(|error| {
        format!("{error}; expected an address and a port such as 127.0.0.1:8080")
    })?;
    found.next().ok_or_else(|| "the name has no address".to_owned())
}

/// An origin as browsers send it: the scheme of a page, host and port, and nothing that they write
/// otherwise or leave out, for then no page would ever fit.
fn origin(text: &str) -> Result<HeaderValue, String> {
    let expected = "expected an origin such as https://example.org or http://localhost:3000, or *";
    if text == "*" {
        return Ok(HeaderValue::from_static("*"));
    }
    let uri: Uri = text.parse().map_err(|_| expected.to_owned())?;
    let (Some(scheme), Some(host)) = (uri.scheme_str(), uri.host()) else {
        return Err(expected.to_owned());
    };
    let usual = match scheme {
        "http" => 80,
        "https" => 443,
        extension if extension.ends_with("-extension") => 0,
        other => return Err(format!("no page of a browser comes by {other}; {expected}")),
    };
    let port = uri.port_u16().filter(|port| *port != usual);
    let port = port.map_or_else(String::new, |port| format!(":{port}"));
    let written = format!("{scheme}://{}{port}", host.to_ascii_lowercase());
    if text != written {
        return Err(format!("a browser writes it {written}"));
    }
    HeaderValue::from_str(text).map_err(|_| expected.to_owned())
}

/// A time as people write it; 0 needs no unit.
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
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn the_options_of_the_server_work_with_and_without_its_name() {
        for words in [&["fretwork", "--workers", "3"][..], &["fretwork", "serve", "--workers", "3"]]
        {
            let cli = Cli::try_parse_from(words).unwrap();
            let serve = match cli.command {
                Some(Command::Serve(serve)) => serve,
                _ => cli.serve,
            };
            assert_eq!(serve.workers, Some(3));
        }
    }

    #[test]
    fn an_origin_is_what_a_browser_can_send() {
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
        // Browsers write it otherwise, so it would fit no page.
        for (bad, good) in [
            ("https://Example.org", "https://example.org"),
            ("https://example.org:443", "https://example.org"),
            ("HTTP://localhost:80", "http://localhost"),
        ] {
            assert!(origin(bad).is_err_and(|said| said.ends_with(good)), "{bad}");
        }
    }
}
