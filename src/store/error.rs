//! What the store could not do.

use std::path::PathBuf;
use std::sync::Arc;

use crate::job::{JobId, Key};

/// What the store could not do.
#[derive(Debug, Clone, thiserror::Error)]
pub enum Error {
    /// The data directory cannot be used.
    #[error("cannot use the data directory {}", dir.display())]
    Directory {
        /// The directory.
        dir: PathBuf,
        /// What the system says.
        source: Arc<std::io::Error>,
    },
    /// Another server holds the data directory.
    #[error("another server is using the data directory {}", dir.display())]
    Locked {
        /// The directory.
        dir: PathBuf,
    },
    /// The file is not a database, or a damaged one.
    #[error("{} is not a database, or it is damaged", path.display())]
    NotADatabase {
        /// The file.
        path: PathBuf,
    },
    /// The database belongs to another program.
    #[error("{} is the database of another program", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// The database was written by a later version of this program.
    #[error(
        "{} was written by a later version of fretwork (its tables are of version {found}, this \
         program knows {known})", path.display()
    )]
    Newer {
        /// The file.
        path: PathBuf,
        /// The version of the tables.
        found: i64,
        /// The latest version this program knows.
        known: i64,
    },
    /// A server of an earlier version of this program is at work on the database.
    #[error(
        "the server that uses {} is of an earlier version (its tables are of version {found}, this \
         program knows {known}); start the server anew with this version first", path.display()
    )]
    Older {
        /// The file.
        path: PathBuf,
        /// The version of the tables.
        found: i64,
        /// The latest version this program knows.
        known: i64,
    },
    /// The system gives no random numbers.
    #[error("the system gives no random numbers")]
    NoRandomness,
    /// The tables could not be brought up to date.
    #[error("cannot bring the tables of {} up to date", path.display())]
    Migration {
        /// The file.
        path: PathBuf,
        /// What the database says.
        source: Arc<sqlx::migrate::MigrateError>,
    },
    /// A job of this id exists.
    #[error("job {0} exists already")]
    JobExists(JobId),
    /// No space is left on the device.
    #[error("no space is left for the database")]
    Full(#[source] Arc<sqlx::Error>),
    /// Something else writes to the database, or every connection is taken, for too long.
    #[error("the database is busy")]
    Busy(#[source] Arc<sqlx::Error>),
    /// A page of the database does not hold what it should.
    #[error("the database is damaged")]
    Damaged(#[source] Arc<sqlx::Error>),
    /// A result is not what was stored.
    #[error("the stored result {0} is damaged")]
    DamagedResult(Key),
    /// The database refused.
    #[error("the database cannot do this now")]
    Database(#[source] Arc<sqlx::Error>),
    /// The store is closed.
    #[error("the store is closed")]
    Closed,
}

impl From<sqlx::Error> for Error {
    fn from(error: sqlx::Error) -> Self {
        const SQLITE_BUSY: u32 = 5;
        const SQLITE_CORRUPT: u32 = 11;
        const SQLITE_FULL: u32 = 13;
        const SQLITE_NOTADB: u32 = 26;
        let code = error.as_database_error().and_then(sqlx::error::DatabaseError::code);
        // The low byte is the kind of error, the rest says more about it.
        let kind = code.and_then(|code| code.parse::<u32>().ok()).map(|code| code & 0xff);
        match (&error, kind) {
            (sqlx::Error::PoolClosed, _) => Self::Closed,
            (sqlx::Error::PoolTimedOut, _) | (_, Some(SQLITE_BUSY)) => Self::Busy(Arc::new(error)),
            (_, Some(SQLITE_FULL)) => Self::Full(Arc::new(error)),
            (_, Some(SQLITE_CORRUPT | SQLITE_NOTADB)) => Self::Damaged(Arc::new(error)),
            _ => Self::Database(Arc::new(error)),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use sqlx::sqlite::SqliteConnectOptions;
    use sqlx::{ConnectOptions as _, Executor as _};

    use super::*;

    #[tokio::test]
    async fn a_database_that_another_writes_to_is_busy_and_not_broken() {
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
