//! Errors of the store.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use futures_util::future::{BoxFuture, LocalBoxFuture};

use fretwork_job::{JobId, Key};

/// The unique index of PostgreSQL on idempotency keys. It refuses a second submission with the same key.
pub(crate) const IDEMPOTENCY: &str = "job_idempotency";

/// The result of what the store does. Without `E`, the error is one of the store.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// The future of a verb. All verbs return this boxed type, so that their code is compiled only in this crate, and not
/// again in each crate that awaits them.
pub type Doing<'a, T> = BoxFuture<'a, Result<T>>;

/// The future of a command. Like [`Doing`], but not `Send`.
pub type Command<'a, T, E = Error> = LocalBoxFuture<'a, Result<T, E>>;

/// Why an operation of the store failed.
#[derive(Debug, Clone, thiserror::Error)]
pub enum Error {
    /// The data directory cannot be created, read or written.
    #[error("cannot use the data directory {}{}", dir.display(), advice(dir, source))]
    Directory {
        /// The directory.
        dir: PathBuf,
        /// The error of the operating system.
        source: Arc<io::Error>,
    },
    /// Another server uses the data directory.
    #[error("another server is using the data directory {}{holder}; end it, or name another directory", dir.display())]
    Locked {
        /// The directory.
        dir: PathBuf,
        /// The process of the server, or nothing if it is not known.
        holder: String,
    },
    /// The file is not a database, or it is damaged.
    #[error("{} is not a database of SQLite, or is damaged; name another, or restore a backup", path.display())]
    NotADatabase {
        /// The file.
        path: PathBuf,
        /// What SQLite says. If the schema is damaged, it names the table or the index.
        source: Arc<sqlx::Error>,
    },
    /// The database belongs to another program.
    #[error("{} is the database of another program; name another data directory", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// Another program has changed the schema of the database.
    #[error("{} does not have the tables that fretwork makes: {what}", path.display())]
    Altered {
        /// The file.
        path: PathBuf,
        /// What differs.
        what: String,
    },
    /// The database was written by a later version of this program.
    #[error(
        "{} was written by a later version of fretwork (its tables have version {found}, this program \
         knows version {known}); use the later version", path.display()
    )]
    Newer {
        /// The file.
        path: PathBuf,
        /// The schema version of the database.
        found: i64,
        /// The latest schema version that this program knows.
        known: i64,
    },
    /// A server of an earlier version of this program uses the database.
    #[error(
        "the server that uses {} is an earlier version of fretwork (the tables have version {found}, this program \
         makes version {known}); restart the server with this version first", path.display()
    )]
    Older {
        /// The file.
        path: PathBuf,
        /// The schema version of the database.
        found: i64,
        /// The latest schema version that this program knows.
        known: i64,
    },
    /// The operating system has no random numbers.
    #[error("the operating system does not supply random numbers, which new keys need")]
    NoRandomness,
    /// The database could not be migrated to this version.
    #[error("cannot change the tables of {} to those of this version of fretwork", path.display())]
    Migration {
        /// The file.
        path: PathBuf,
        /// The error of the migration.
        source: Arc<sqlx::migrate::MigrateError>,
    },
    /// There is a job with this id.
    #[error("a job with the id {0} exists already")]
    JobExists(JobId),
    /// The disk is full.
    #[error("no space is left for the database; free space on the disk")]
    Full(#[source] Arc<sqlx::Error>),
    /// The disk does not read or write.
    #[error("the disk of the database cannot be read or written; the log of the system says why")]
    Disk(#[source] Arc<sqlx::Error>),
    /// The server has this file open, but its path now leads to another file or to none.
    #[error(
        "{} was deleted, moved or replaced while the server uses it; end the server by SIGTERM, so that it saves \
         the changes that it has confirmed, and put the files back before its next start", path.display()
    )]
    Moved {
        /// The file.
        path: PathBuf,
    },
    /// Another process locked the database for longer than the timeout.
    #[error("the database is busy: another process has locked it; try again")]
    Busy(#[source] Arc<sqlx::Error>),
    /// The database server cannot be reached, shuts down, or does not prove who it is.
    #[error("{}", unreachable(_0))]
    Unreachable(#[source] Arc<sqlx::Error>),
    /// The database server refuses what fretwork needs until somebody changes a setting.
    #[error("{0}")]
    Unfit(&'static str, #[source] Arc<sqlx::Error>),
    /// The database server does not answer in time, or all connections to it are in use.
    #[error("the database server does not answer in time")]
    Exhausted,
    /// A page of the database is damaged.
    #[error("the database is damaged; restore a backup")]
    Damaged(#[source] Arc<sqlx::Error>),
    /// The checksum of a result is wrong.
    #[error("the stored result {0} is damaged")]
    DamagedResult(Key),
    /// The checksum of a chunk of a study is wrong.
    #[error(
        "part {number} of the stored rows of the study {key} is damaged; submit the study again"
    )]
    DamagedChunk {
        /// The key of the study.
        key: Key,
        /// The number of the chunk.
        number: u32,
    },
    /// Any other error of the database.
    #[error("an operation of the database failed")]
    Database(#[source] Arc<sqlx::Error>),
    /// The store is closed.
    #[error("the database is closed, because the program is ending")]
    Closed,
}

/// Tells the user what to do if the process has no permission for a directory. Otherwise empty.
fn advice(dir: &Path, error: &io::Error) -> String {
    #[cfg(unix)]
    if error.kind() == io::ErrorKind::PermissionDenied {
        let (user, group) = (rustix::process::geteuid(), rustix::process::getegid());
        return format!(
            ": if a server uses it, run this command as the user of the server (`sudo -u USER fretwork …`); if user {user} \
             is that user, run `chown -R {user}:{group} {}` as root (for a container: in its volume)",
            dir.display()
        );
    }
    let _ = (dir, error);
    String::new()
}

/// Says whether there is no connection, or one that was refused because it is not secure.
fn unreachable(error: &sqlx::Error) -> &'static str {
    match error {
        sqlx::Error::Tls(_) => INSECURE,
        // The library for TLS reports a refused certificate in this way.
        sqlx::Error::Io(error) if error.kind() == io::ErrorKind::InvalidData => INSECURE,
        _ => "the database server cannot be reached",
    }
}

/// The message for a server without encryption, or with a certificate that is not accepted.
const INSECURE: &str = "the connection to the database server is refused, because it is not secure; `sslmode` and \
    `sslrootcert` in the address of the database say what is required";

/// What to change so that PostgreSQL does not answer with this error code; `None` if a user cannot change it.
fn setting(code: &str) -> Option<&'static str> {
    Some(match code {
        "42501" => "the database user lacks a privilege; make it the owner of the database",
        "25006" => "the database server is a standby or read-only; name the primary server",
        "28000" | "28P01" => {
            "the database server rejects the user, the password or a connection without TLS; correct the address of the database"
        }
        "3D000" => "the database does not exist; create it, or correct its address",
        // An unknown parameter of a new connection, and prepared statements of other connections.
        "08P01" | "26000" | "42P05" => {
            "a connection pooler changes connections between transactions; connect to PostgreSQL without it, or set \
             `pool_mode = session` and `ignore_startup_parameters = extra_float_digits` in PgBouncer"
        }
        _ => return None,
    })
}

impl From<sqlx::Error> for Error {
    fn from(error: sqlx::Error) -> Self {
        /// Length of an error code of PostgreSQL. Codes of SQLite are shorter.
        const SQLSTATE: usize = 5;
        const SQLITE_BUSY: u32 = 5;
        const SQLITE_IOERR: u32 = 10;
        const SQLITE_CORRUPT: u32 = 11;
        const SQLITE_FULL: u32 = 13;
        const SQLITE_NOTADB: u32 = 26;
        if matches!(error, sqlx::Error::Io(_) | sqlx::Error::Tls(_) | sqlx::Error::Protocol(_)) {
            return Self::Unreachable(Arc::new(error));
        }
        let code = error.as_database_error().and_then(sqlx::error::DatabaseError::code);
        if let Some(state) = code.as_deref().filter(|code| code.len() == SQLSTATE) {
            if let Some(advice) = setting(state) {
                return Self::Unfit(advice, Arc::new(error));
            }
            return match state {
                _ if state.starts_with("57P") || state.starts_with("08") => Self::Unreachable,
                // Too many connections.
                "53300" => Self::Unreachable,
                "53100" => Self::Full,
                "40001" | "40P01" | "55P03" | "57014" | "25P03" => Self::Busy,
                _ if state.starts_with("XX") => Self::Damaged,
                _ => Self::Database,
            }(Arc::new(error));
        }
        // The low byte is the primary result code of SQLite.
        let kind = code.and_then(|code| code.parse::<u32>().ok()).map(|code| code & 0xff);
        match kind {
            Some(SQLITE_BUSY) => Self::Busy(Arc::new(error)),
            Some(SQLITE_FULL) => Self::Full(Arc::new(error)),
            Some(SQLITE_IOERR) => Self::Disk(Arc::new(error)),
            Some(SQLITE_CORRUPT | SQLITE_NOTADB) => Self::Damaged(Arc::new(error)),
            _ => Self::Database(Arc::new(error)),
        }
    }
}

/// The value that was read, or the message of SQLite if the database is damaged there. Other errors are returned.
pub(crate) fn unless_damaged<T>(read: sqlx::Result<T>) -> Result<Result<T, String>> {
    match read.map_err(Error::from) {
        Ok(found) => Ok(Ok(found)),
        Err(Error::Damaged(error)) => Ok(Err(error.to_string())),
        Err(error) => Err(error),
    }
}

/// Whether SQLite says that a file is not a database.
pub(crate) fn is_other_file(error: &sqlx::Error) -> bool {
    const SQLITE_NOTADB: &str = "26";
    let code = error.as_database_error().and_then(sqlx::error::DatabaseError::code);
    code.is_some_and(|code| code == SQLITE_NOTADB)
}

impl Error {
    /// Whether the transaction conflicted with another one in PostgreSQL, so that a retry may succeed. This is a
    /// serialization failure, a deadlock, or a simultaneous submission with the same idempotency key.
    pub(crate) fn is_conflict(&self) -> bool {
        let (Self::Busy(error) | Self::Database(error)) = self else { return false };
        error.as_database_error().is_some_and(|error| {
            matches!(error.code().as_deref(), Some("40001" | "40P01"))
                || error.constraint() == Some(IDEMPOTENCY)
        })
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use sqlx::sqlite::SqliteConnectOptions;
    use sqlx::{ConnectOptions as _, Executor as _};

    use super::*;

    #[tokio::test]
    async fn a_database_locked_by_another_writer_is_reported_as_busy() {
        let dir = tempfile::tempdir().unwrap();
        let options = SqliteConnectOptions::new()
            .filename(dir.path().join("db"))
            .create_if_missing(true)
            .busy_timeout(Duration::ZERO);
        let mut one = options.connect().await.unwrap();
        let mut other = options.connect().await.unwrap();
        one.execute("BEGIN IMMEDIATE").await.unwrap();
        let refused = Error::from(other.execute("BEGIN IMMEDIATE").await.unwrap_err());
        assert!(matches!(refused, Error::Busy(_)), "{refused:?}");
        let refused = Error::from(other.execute("SELECT * FROM nothing").await.unwrap_err());
        assert!(matches!(refused, Error::Database(_)), "{refused:?}");
    }
}
