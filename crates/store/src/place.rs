//! Where a database is.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use sqlx::ConnectOptions as _;
use sqlx::postgres::PgConnectOptions;

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

impl From<DatabaseUrl> for Place {
    fn from(url: DatabaseUrl) -> Self {
        Self::Shared(url)
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

/// The position of the first unknown option in an address, from 1.
fn unknown_option(url: &str) -> Option<usize> {
    let (_, query) = url.split_once('?')?;
    let query = query.split_once('#').map_or(query, |(query, _)| query);
    let is_known = |name: &str| {
        OPTIONS.split(", ").any(|known| known == name)
            || name.starts_with("options[") && name.ends_with(']')
    };
    let mut names = form_urlencoded::parse(query.as_bytes()).map(|(name, _)| name);
    names.position(|name| !is_known(&name)).map(|place| place + 1)
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
    pub(super) fn patient(&self) -> PgConnectOptions {
        let name = concat!("fretwork ", env!("CARGO_PKG_VERSION"));
        (*self.0).clone().application_name(name).options([("client_min_messages", "warning")])
    }

    /// Options of the connection that waits for notifications.
    pub(super) fn listening(&self) -> PgConnectOptions {
        self.patient()
    }

    /// Options of a connection whose statements fail after the time `longest`. The caller tries again later.
    pub(super) fn hasty(&self, longest: Duration) -> PgConnectOptions {
        let longest = format!("{}ms", longest.as_millis().max(1));
        self.options().options(["statement_timeout", "lock_timeout"].map(|name| (name, &longest)))
    }

    /// Options of the connections for verbs. The timeouts release the locks of a server that hangs in a transaction.
    pub(super) fn options(&self) -> PgConnectOptions {
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
}
