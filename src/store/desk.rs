//! The tables for a command that looks after them, with or without a server at work on them.

use std::fs::File;
use std::path::Path;

use sqlx::{Connection as _, SqliteConnection};

use super::keys::{self, AccessKey, NewKey};
use super::open::{self, MIGRATIONS};
use super::{Error, now};

/// The database of a data directory, for one administrative command.
///
/// Each change is one statement: a server beside it waits for no longer than that.
#[derive(Debug)]
pub struct Desk {
    db: SqliteConnection,
    /// None if a server holds the directory.
    _lock: Option<File>,
}

impl Desk {
    /// Opens the database in a directory. If no server uses it, it is made if it does not exist, and
    /// brought up to date.
    pub async fn open(dir: &Path) -> Result<Self, Error> {
        let lock = match open::lock(dir) {
            Ok(lock) => Some(lock),
            Err(Error::Locked { .. }) => None,
            Err(error) => return Err(error),
        };
        let path = dir.join(open::FILE);
        open::inspect(&path).await?;
        let options = open::writing(&path, false).create_if_missing(lock.is_some());
        let mut db = SqliteConnection::connect_with(&options).await?;
        if lock.is_some() {
            open::migrate(&mut db, &path).await?;
        } else {
            let known = open::latest(&MIGRATIONS);
            let found: i64 = sqlx::query_scalar("SELECT max(version) FROM _sqlx_migrations")
                .fetch_one(&mut db)
                .await?;
            if found > known {
                return Err(Error::Newer { path, found, known });
            }
            if found < known {
                return Err(Error::Older { path, found, known });
            }
        }
        Ok(Self { db, _lock: lock })
    }

    /// Makes an access key and returns it: the only time that it is seen.
    pub async fn add_key(&mut self, new: &NewKey) -> Result<String, Error> {
        keys::add(&mut self.db, new, now()).await
    }

    /// All access keys there ever were, the oldest first.
    pub async fn keys(&mut self) -> Result<Vec<AccessKey>, Error> {
        keys::list(&mut self.db).await
    }

    /// Takes back the keys of this id or name that are in force; returns how many.
    pub async fn revoke_keys(&mut self, name: &str) -> Result<u64, Error> {
        keys::revoke(&mut self.db, name, now()).await
    }

    /// Lets the database go.
    pub async fn close(self) -> Result<(), Error> {
        Ok(self.db.close().await?)
    }
}
