//! Where a database is.

use std::borrow::Cow;
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;
use std::{env, fmt, fs};

use sqlx::ConnectOptions as _;
use sqlx::postgres::{PgConnectOptions, PgSslMode};

/// Where a database is.
#[derive(Debug, Clone)]
pub enum Place {
    /// The directory of a database of SQLite, for one server.
    Directory(PathBuf),
    /// A database of PostgreSQL, which several servers share.
    Shared(DatabaseUrl),
}

impl From<&Path> for Place {
    fn from(dir: &Path) -> Self {
        Self::Directory(dir.to_owned())
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Directory(dir) => dir.display().fmt(f),
            Self::Shared(url) => url.fmt(f),
        }
    }
}

/// The address of a database, such as `postgres://user:password@host/name`. It is shown without its password.
#[derive(Clone)]
pub struct DatabaseUrl(Box<PgConnectOptions>);

/// The options that sqlx supports. For an unknown option, sqlx only logs a warning, which shows the value.
const OPTIONS: &str = "host, hostaddr, port, dbname, user, password, application_name, options, sslmode, \
    ssl-mode, sslrootcert, ssl-root-cert, ssl-ca, sslcert, ssl-cert, sslkey, ssl-key, statement-cache-capacity";

/// The names of the option that names the file of a certificate authority.
const ROOT: [&str; 3] = ["sslrootcert", "ssl-root-cert", "ssl-ca"];

/// The options of an address and their values.
fn given(url: &str) -> impl Iterator<Item = (Cow<'_, str>, Cow<'_, str>)> {
    let query = url.split_once('?').map_or("", |(_, query)| query);
    let query = query.split_once('#').map_or(query, |(query, _)| query);
    form_urlencoded::parse(query.as_bytes())
}

/// The position of the first unknown option in an address, from 1.
fn unknown_option(url: &str) -> Option<usize> {
    let is_known = |name: &str| {
        OPTIONS.split(", ").any(|known| known == name)
            || name.starts_with("options[") && name.ends_with(']')
    };
    given(url).position(|(name, _)| !is_known(&name)).map(|place| place + 1)
}

/// Whether others on the network can neither read nor change the traffic of a connection.
fn is_local(options: &PgConnectOptions) -> bool {
    let host = options.get_host().trim_matches(['[', ']']);
    let is_loopback = host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback());
    options.get_socket().is_some() || host.starts_with('/') || host == "localhost" || is_loopback
}

/// Decides how connections are encrypted. The error says why a mode is refused.
fn encrypted(options: PgConnectOptions, url: &str) -> Result<PgConnectOptions, String> {
    let root = given(url).filter(|(name, _)| ROOT.contains(&&**name)).last();
    if let Some((_, file)) = &root {
        let unread =
            |error| format!("the file of its option `sslrootcert` cannot be read: {error}");
        fs::read(&**file).map_err(unread)?;
    }
    let is_set = given(url).any(|(name, _)| ["sslmode", "ssl-mode"].contains(&&*name));
    if !is_set && env::var_os("PGSSLMODE").is_none() {
        let is_open = is_local(&options) && root.is_none();
        let mode = if is_open { PgSslMode::Disable } else { PgSslMode::VerifyFull };
        return Ok(options.ssl_mode(mode));
    }
    let why = match options.get_ssl_mode() {
        PgSslMode::Disable | PgSslMode::VerifyFull => return Ok(options),
        PgSslMode::Require if root.is_none() => return Ok(options),
        PgSslMode::Require => {
            "`sslmode=require` does not verify the server, so `sslrootcert` has no effect"
        }
        // sqlx trusts the authorities of the system besides that of `sslrootcert`.
        PgSslMode::VerifyCa => {
            "with `sslmode=verify-ca`, anybody who has a certificate can pose as the server"
        }
        PgSslMode::Prefer | PgSslMode::Allow => {
            "with `sslmode=prefer` or `allow`, an attacker on the network can switch the encryption off"
        }
    };
    Err(format!(
        "{why}. Use `sslmode=verify-full`; in a private network, `sslmode=disable` encrypts nothing"
    ))
}

impl FromStr for DatabaseUrl {
    type Err = String;

    fn from_str(url: &str) -> Result<Self, String> {
        if !url.starts_with("postgres://") && !url.starts_with("postgresql://") {
            return Err("must begin with postgres://".to_owned());
        }
        // No error repeats a part of the address, not even the name of an option: a password may contain & and ?.
        if let Some(place) = unknown_option(url) {
            return Err(format!(
                "option {place} of the address is misspelt or unknown; the options are {OPTIONS}"
            ));
        }
        let options: PgConnectOptions = url.parse().map_err(|_| {
            "must be like postgres://user:password@host:5432/name; a part of it cannot be read. Encode special \
             characters in it, such as @ as %40"
                .to_owned()
        })?;
        let options = encrypted(options, url)?;
        Ok(Self(Box::new(options.disable_statement_logging())))
    }
}

impl fmt::Display for DatabaseUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.0.get_database().unwrap_or(self.0.get_username());
        let host = match self.0.get_socket() {
            Some(socket) => socket.display().to_string(),
            None => self.0.get_host().to_owned(),
        };
        write!(f, "the database {name} on {host}:{}", self.0.get_port())
    }
}

impl fmt::Debug for DatabaseUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl DatabaseUrl {
    /// Options of a connection without timeouts, for migrations.
    pub(crate) fn patient(&self) -> PgConnectOptions {
        let name = concat!("fretwork ", env!("CARGO_PKG_VERSION"));
        (*self.0).clone().application_name(name).options([("client_min_messages", "warning")])
    }

    /// Options of the connection that waits for notifications.
    pub(crate) fn listening(&self) -> PgConnectOptions {
        self.patient()
    }

    /// Options of a connection whose statements fail after the time `longest`. The caller tries again later.
    pub(crate) fn hasty(&self, longest: Duration) -> PgConnectOptions {
        let longest = format!("{}ms", longest.as_millis().max(1));
        self.options().options(["statement_timeout", "lock_timeout"].map(|name| (name, &longest)))
    }

    /// Options of the connections for verbs. The timeouts release the locks of a server that hangs in a transaction.
    pub(crate) fn options(&self) -> PgConnectOptions {
        self.patient().options([
            ("statement_timeout", "30s"),
            ("lock_timeout", "10s"),
            ("idle_in_transaction_session_timeout", "10s"),
            // PostgreSQL plans a statement once. Without this, a plan from empty tables would scan full tables, too.
            ("enable_seqscan", "off"),
            // The statements are short. Compilation would take longer than execution.
            ("jit", "off"),
            // To start parallel workers would take longer than execution, too.
            ("max_parallel_workers_per_gather", "0"),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_address_of_a_database_is_shown_without_its_password() {
        let url: DatabaseUrl = "postgres://ada:secret@db.example/wear".parse().unwrap();
        assert_eq!(format!("{url} {url:?}").matches("secret").count(), 0);
        assert_eq!(url.to_string(), "the database wear on db.example:5432");
        assert!("mysql://db.example/wear".parse::<DatabaseUrl>().is_err());
    }

    #[test]
    fn a_misspelt_option_is_an_error_that_shows_no_value() {
        let fault = |url: &str| url.parse::<DatabaseUrl>().unwrap_err();
        let base = "postgres://ada:secret@db.example/wear";
        let misspelt = fault(&format!("{base}?host=/run&pasword=secret&x=secret"));
        assert!(misspelt.starts_with("option 2 of the address is misspelt"), "{misspelt}");
        for bad in [
            "?pasword=secret",
            "?password=a&secret",
            "?sslmode=secret",
            "?port=secret",
            "?hostaddr=secret",
            "?options[secret=1",
            ":secret/",
        ] {
            let text = fault(&if bad.starts_with('?') {
                format!("{base}{bad}")
            } else {
                bad.replace(':', "postgres://a:b:")
            });
            assert!(!text.contains("secret"), "{text}");
        }
        let good = "?host=/run&options[search_path]=wear&statement-cache-capacity=0";
        assert!(format!("{base}{good}").parse::<DatabaseUrl>().is_ok());
    }

    /// How the connections to an address are encrypted, or why it is refused.
    fn mode(address: &str) -> String {
        match address.parse::<DatabaseUrl>() {
            Ok(url) => format!("{:?}", url.0.get_ssl_mode()),
            Err(why) => why,
        }
    }

    #[test]
    fn connections_to_other_machines_are_encrypted_and_verified_by_default() {
        for local in ["localhost", "127.0.0.1", "[::1]", "%2Frun", "db.example/wear?host=/run"] {
            assert_eq!(mode(&format!("postgres://ada@{local}")), "Disable", "{local}");
        }
        for other in ["db.example", "10.0.0.1", "localhost.example", "postgres"] {
            assert_eq!(mode(&format!("postgres://ada@{other}/wear")), "VerifyFull", "{other}");
        }
        let root = tempfile::NamedTempFile::new().unwrap();
        let root = format!("sslrootcert={}", root.path().display());
        assert_eq!(mode(&format!("postgres://ada@localhost/wear?{root}")), "VerifyFull");
        for (set, expected) in
            [("disable", "Disable"), ("verify-full", "VerifyFull"), ("require", "Require")]
        {
            assert_eq!(mode(&format!("postgres://ada@db.example/wear?sslmode={set}")), expected);
        }
        for weak in ["prefer", "allow", "verify-ca", &format!("require&{root}")] {
            let why = mode(&format!("postgres://ada@localhost/wear?sslmode={weak}"));
            assert!(why.ends_with("Use `sslmode=verify-full`; in a private network, `sslmode=disable` encrypts nothing"), "{why}");
        }
        let missing = mode("postgres://ada:secret@db.example/wear?sslrootcert=/missing");
        assert!(
            missing
                .starts_with("the file of its option `sslrootcert` cannot be read: No such file"),
            "{missing}"
        );
    }
}
