//! The settings of the server.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::io::Read as _;
use std::iter;
use std::net::{IpAddr, SocketAddr};
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

use bytesize::ByteSize;
use clap::builder::FalseyValueParser;
use clap::parser::ValueSource;
use clap::{ArgAction, ArgMatches, Args, ValueEnum};
use fretwork_engine::scenario::MAX_ANSWER;
use hyper::Uri;
use hyper::header::{HeaderName, HeaderValue};

use super::data::Data;
use super::keys::role;
use super::values::{duration, lease, nonzero, resolve, seconds};
use crate::http::{self, Access, Connections, Limits, Origins, Secret, SignOn};
use crate::service::WorkLimits;
use crate::telemetry::Logging;
use fretwork_store::{self as store, Place, Role};

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
    #[arg(long, env = "FRETWORK_ADMIN_KEY", hide_env_values = true, value_name = "KEY")]
    pub admin_key: Option<Secret>,
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
    /// A directory on the disk of PostgreSQL, if this machine has it. Its free space is the metric fretwork_disk_free_bytes, which
    /// an alert needs. Only for --database.
    #[arg(long, env = "FRETWORK_DATABASE_DISK", value_name = "DIR", requires = "database")]
    pub database_disk: Option<PathBuf>,
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
    /// Time, such as 30s, for which a server must have been up before it computes again a run during which a server died.
    #[arg(long, env = "FRETWORK_CRASH_PAUSE", default_value = "10s", value_name = "TIME", value_parser = duration)]
    pub crash_pause: Duration,
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
    #[arg(long, env = "FRETWORK_STUDY_SIZE", default_value = "64MB", value_name = "SIZE",
        value_parser = study_size)]
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
    /// Memory for large bodies until they are read or sent: a quarter for requests (half of it for parsing), a quarter for
    /// answers up to 1 MiB, a quarter for larger ones, compressed, and a quarter to decompress these for clients that accept
    /// no compression. One caller may use half of each part.
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
    /// The address of a reverse proxy. It tells the address of each client in X-Forwarded-For, and in X-Forwarded-Proto whether the
    /// client uses TLS. It must remove these headers from the requests of its clients. Repeat the option for more proxies.
    #[arg(
        long = "trusted-proxy",
        env = "FRETWORK_TRUSTED_PROXY",
        value_name = "ADDRESS",
        value_delimiter = ','
    )]
    pub trusted_proxies: Vec<IpAddr>,
    /// The header in which a sign-on proxy, one of --trusted-proxy, names the user, such as X-Remote-User. The proxy must remove this
    /// header from the requests of its clients.
    #[arg(long, env = "FRETWORK_AUTH_HEADER", value_name = "NAME", conflicts_with = "no_auth", value_parser = user_header,
        requires_all = ["trusted_proxies", "auth_secret", "auth_role"])]
    pub auth_header: Option<HeaderName>,
    /// What the sign-on proxy sends in the header X-Fretwork-Proxy-Secret: at least 20 characters. Prefer the environment variable.
    #[arg(long, env = "FRETWORK_AUTH_SECRET", hide_env_values = true, value_name = "SECRET", value_parser = proxy_secret,
        requires = "auth_header")]
    pub auth_secret: Option<Secret>,
    /// The role of all users of the sign-on proxy.
    #[arg(long, env = "FRETWORK_AUTH_ROLE", value_name = "read|submit|admin", value_parser = role, requires = "auth_header")]
    pub auth_role: Option<Role>,
    #[command(flatten)]
    pub logging: Logging,
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

impl Serve {
    /// Where the database is. A directory needs workers in this process.
    pub fn place(&self) -> Result<Place, String> {
        let place = self.data.place()?;
        if self.workers == Some(0) && matches!(place, Place::Directory(_)) {
            return Err(
                "--workers 0 needs --database, so that other machines compute the runs".to_owned()
            );
        }
        Ok(place)
    }

    /// Whether other machines can reach the server: at one of its addresses, or through a proxy that does not sign users on.
    pub fn is_reachable(&self) -> bool {
        let mut addresses = iter::once(self.listen).chain(self.umbridge_listen);
        let has_open_proxy = !self.trusted_proxies.is_empty() && self.auth_header.is_none();
        has_open_proxy || addresses.any(|address| !address.ip().is_loopback())
    }

    /// The settings of the HTTP interface.
    pub fn interface(&self, admin_key: Option<Secret>) -> http::Settings {
        http::Settings {
            access: Access {
                open: self.no_auth,
                admin_key,
                limits: Limits {
                    per_minute: NonZeroU32::new(self.rate_limit),
                    evaluations: NonZeroU32::new(self.evaluate_rate),
                    at_once: NonZeroU32::new(self.concurrency),
                },
                sign_on: self.sign_on(),
            },
            memory: self.memory_cache.as_u64(),
            transfers: self.transfer_memory.as_u64(),
            connections: Connections {
                total: self.connections as usize,
                per_address: self.address_connections as usize,
                proxies: self.trusted_proxies.iter().map(IpAddr::to_canonical).collect(),
            },
            origins: self.origins(),
        }
    }

    /// The sign-on proxy. The command line accepts its options only together.
    fn sign_on(&self) -> Option<SignOn> {
        let (header, secret) = (self.auth_header.clone()?, self.auth_secret.clone()?);
        Some(SignOn { header, secret, role: self.auth_role? })
    }

    /// The settings of the store.
    pub fn storage(&self) -> store::Options {
        store::Options {
            full_sync: self.synchronous == Synchronous::Full,
            queue_limit: self.queue_limit as usize,
            keep_jobs: nonzero(self.keep_jobs),
            budget: Some(self.keep_results.as_u64()).filter(|bytes| *bytes > 0),
            pin_quota: self.pin_quota.as_u64(),
            disk: self.database_disk.clone(),
            lease: self.lease,
            settle: self.crash_pause,
            ..store::Options::default()
        }
    }

    /// The administrator's key from the environment or from a file. The error does not repeat it.
    pub fn admin_key(&self) -> Result<Option<Secret>, String> {
        let (key, source) = match (&self.admin_key, &self.admin_key_file) {
            (None, None) => return Ok(None),
            (Some(Secret(key)), _) => (key.clone(), "FRETWORK_ADMIN_KEY".to_owned()),
            (None, Some(file)) => {
                let file_name = file.display();
                // A device can be endless.
                let mut text = String::new();
                fs::File::open(file)
                    .and_then(|file| file.take(LONGEST_KEY).read_to_string(&mut text))
                    .map_err(|error| format!("cannot read the key in {file_name}: {error}"))?;
                (text.trim_end().to_owned(), format!("the key in {file_name}"))
            }
        };
        if key.len() >= 20 && key.bytes().all(|byte| byte.is_ascii_graphic() && byte != b':') {
            return Ok(Some(Secret(key)));
        }
        Err(format!(
            "{source} must have at least 20 printable characters without blanks and colons; \
             `openssl rand -hex 20` generates one"
        ))
    }

    /// The limits of new runs and studies.
    pub fn limits(&self) -> WorkLimits {
        WorkLimits {
            run: nonzero(self.run_limit),
            study: nonzero(self.study_limit),
            study_points: self.study_points as usize,
            study_bytes: self.study_size.as_u64() as usize,
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

/// Longest key in a file, in bytes.
const LONGEST_KEY: u64 = 1 << 16;

/// Parses the name of the header with the user. Other programs on the way, or the server itself, set headers of HTTP.
fn user_header(text: &str) -> Result<HeaderName, String> {
    const RESERVED: &str = "accept authorization cache- connection content- cookie date: expect forwarded host \
        idempotency-key if- keep-alive last- origin prefer: priority: proxy- range referer sec- te: trailer \
        traceparent transfer-encoding upgrade user-agent via: x-forwarded- x-fretwork- x-real-ip x-request-id";
    let name = text.to_ascii_lowercase() + ":";
    if RESERVED.split(' ').any(|beginning| name.starts_with(beginning)) {
        return Err(format!("{text} has another meaning; name a header such as X-Remote-User"));
    }
    text.parse().map_err(|_| "expected the name of a header".to_owned())
}

/// Parses the largest size of the result of a study.
fn study_size(text: &str) -> Result<ByteSize, String> {
    let size = Some(text.parse::<ByteSize>()?).filter(|size| size.as_u64() <= MAX_ANSWER as u64);
    size.ok_or_else(|| "no result has more than 64MB; enter at most 64MB".to_owned())
}

/// Parses the secret of a sign-on proxy.
fn proxy_secret(text: &str) -> Result<Secret, &'static str> {
    let is_sound = text.len() >= 20 && text.bytes().all(|byte| byte.is_ascii_graphic());
    let secret = is_sound.then(|| Secret(text.to_owned()));
    secret.ok_or("expected at least 20 printable characters")
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
        other => {
            return Err(format!(
                "browsers load no pages from addresses with {other}://; {expected}"
            ));
        }
    };
    let port = uri.port_u16().filter(|port| *port != default_port);
    let port = port.map_or_else(String::new, |port| format!(":{port}"));
    let written = format!("{scheme}://{}{port}", host.to_ascii_lowercase());
    if text != written {
        return Err(format!("browsers send another form of this origin. Enter {written}"));
    }
    HeaderValue::from_str(text).map_err(|_| expected.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_with_another_meaning_names_no_user() {
        for bad in [
            "Host",
            "cookie",
            "Authorization",
            "Proxy-Authorization",
            "X-Forwarded-For",
            "X-Forwarded-Proto",
            "X-Fretwork-Proxy-Secret",
            "Forwarded",
            "Content-Length",
            "TE",
            "Idempotency-Key",
            "Accept-Encoding",
            "Transfer-Encoding",
            "Prefer",
            "Priority",
            "Via",
            "Date",
            "Last-Event-ID",
            "X-Request-Id",
            "X-Real-IP",
            "",
            "a b",
        ] {
            assert!(user_header(bad).is_err(), "{bad}");
        }
        for good in ["X-Remote-User", "Remote-User", "Tailscale-User-Login"] {
            assert!(user_header(good).is_ok(), "{good}");
        }
    }

    #[test]
    fn the_size_of_a_study_is_at_most_that_of_a_result() {
        assert_eq!(study_size("64MB"), Ok(ByteSize(MAX_ANSWER as u64)));
        for bad in ["64.1MB", "1GB", "large"] {
            assert!(study_size(bad).is_err(), "{bad}");
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
