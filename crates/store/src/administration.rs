//! Access to the tables for commands, with or without a running server.

use std::time::Duration;

use sqlx::postgres::PgConnection;
use sqlx::{Connection as _, SqliteConnection};

use super::audit::AuditEntry;
use super::error::Error;
use super::imports::{Before, Import, NoteTaken};
use super::keys::{AccessKey, NewKey};
use super::library::{Note, Provenance};
use super::place::Place;
use super::read::StoredResult;
use super::row::Sum;
use super::search::{Cursor, Found, Search};
use super::{postgres, sqlite};
use fretwork_job::Key;

/// How long a command waits while a server writes to a directory.
pub(super) const PATIENCE: Duration = Duration::from_secs(30);

/// A database, opened by a command.
///
/// Each change is one short transaction, so a running server waits only briefly.
#[derive(Debug)]
pub struct Administration(Tables);

#[derive(Debug)]
enum Tables {
    Sqlite(SqliteConnection),
    Postgres(PgConnection),
}

/// Calls the same function of the engine of a database.
macro_rules! each {
    ($administration:expr, $engine:ident, $db:ident => $call:expr) => {
        match &mut $administration.0 {
            Tables::Sqlite($db) => {
                use sqlite as $engine;
                $call
            }
            Tables::Postgres($db) => {
                use postgres as $engine;
                $call
            }
        }
    };
}

impl Administration {
    /// Opens the database at a place. Creates or migrates it where necessary, unless a server uses a directory.
    pub async fn open(place: impl Into<Place>) -> Result<Self, Error> {
        Ok(Self(match place.into() {
            Place::Directory(dir) => Tables::Sqlite(sqlite::open::beside(&dir, PATIENCE).await?),
            Place::Shared(url) => Tables::Postgres(postgres::open::prepare(&url).await?),
        }))
    }

    /// Whether a directory contains a database. A database of PostgreSQL is known when it is opened.
    #[must_use]
    pub fn is_at(place: &Place) -> bool {
        match place {
            Place::Directory(dir) => dir.join(sqlite::open::DATABASE).exists(),
            Place::Shared(_) => true,
        }
    }

    /// Up to `limit` entries of the audit log before another one, the newest first.
    pub async fn audit(
        &mut self,
        before: Option<i64>,
        limit: u32,
    ) -> Result<Vec<AuditEntry>, Error> {
        each!(self, engine, db => engine::audit::list(db, before, limit).await)
    }

    /// Creates an access key and returns it. It cannot be read again.
    pub async fn add_key(&mut self, new: &NewKey) -> Result<String, Error> {
        let (id, key) = NewKey::mint()?;
        each!(self, engine, db => engine::keys::add(db, &id, &key, new).await?);
        Ok(key)
    }

    /// All access keys, also expired and revoked ones, the oldest first.
    pub async fn keys(&mut self) -> Result<Vec<AccessKey>, Error> {
        each!(self, engine, db => engine::keys::list(db).await)
    }

    /// Revokes the valid keys with this id or name; returns how many.
    pub async fn revoke_keys(&mut self, name: &str) -> Result<usize, Error> {
        each!(self, engine, db => engine::keys::revoke(db, name).await)
    }

    /// Closes the database.
    pub async fn close(self) -> Result<(), Error> {
        match self.0 {
            Tables::Sqlite(db) => Ok(db.close().await?),
            Tables::Postgres(db) => Ok(db.close().await?),
        }
    }

    pub(super) async fn page(
        &mut self,
        search: &Search,
        cursor: Option<Cursor>,
        limit: u32,
    ) -> Result<Found, Error> {
        each!(self, engine, db => engine::search::page(db, search, cursor, limit).await)
    }

    pub(super) async fn result(&mut self, key: &Key) -> Result<Option<(StoredResult, Sum)>, Error> {
        each!(self, engine, db => engine::read::result(&mut *db, key, i64::MAX).await)
    }

    pub(super) async fn provenance(&mut self, key: &Key) -> Result<Option<Provenance>, Error> {
        each!(self, engine, db => engine::library::provenance(db, key).await)
    }

    /// What the database has under the key of a result with this digest.
    pub(super) async fn before(&mut self, key: &Key, digest: &[u8]) -> Result<Before, Error> {
        each!(self, engine, db => engine::imports::before(db, key, digest).await)
    }

    /// Stores the note of a result, unless the result already has a note.
    pub(super) async fn annotate(
        &mut self,
        key: &Key,
        note: Option<&Note>,
    ) -> Result<NoteTaken, Error> {
        each!(self, engine, db => engine::imports::annotate(db, key, note).await)
    }

    /// Stores a result that the database does not have, and its note if the result has none.
    pub(super) async fn import(
        &mut self,
        import: &Import<'_>,
    ) -> Result<(Before, NoteTaken), Error> {
        each!(self, engine, db => engine::imports::import(db, import).await)
    }
}
