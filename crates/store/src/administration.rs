//! Access to the tables for commands, with or without a running server.

use std::io::ErrorKind;
use std::time::Duration;

use sqlx::postgres::PgConnection;
use sqlx::{Connection as _, SqliteConnection};

use crate::database::{Change, Command, Connected, Connection, Place, Result, Tables, Verb, sql};
use crate::jobs::naming;
use crate::team::audit::{self, Actor, AuditEntry};
use crate::team::keys::{self, AccessKey, NewKey};
use crate::{postgres, sqlite};

/// Maximum time that a command waits for the lock of the database while a server writes.
pub(super) const PATIENCE: Duration = Duration::from_secs(30);

/// A database, opened by a command.
///
/// Each change is one short transaction, so a running server waits only briefly.
#[derive(Debug)]
pub struct Administration(Opened);

#[derive(Debug)]
enum Opened {
    Sqlite(SqliteConnection),
    Postgres(PgConnection),
}

impl Connected for Administration {
    fn connection(&mut self) -> Connection<'_> {
        match &mut self.0 {
            Opened::Sqlite(db) => Connection::Sqlite(db),
            Opened::Postgres(db) => Connection::Postgres(db),
        }
    }
}

impl Administration {
    /// Opens the database at a place. Creates or migrates it if necessary, but not in a directory that a server uses.
    pub fn open(place: Place) -> Command<'static, Self> {
        Box::pin(async move {
            Ok(Self(match place {
                Place::Directory(dir) => {
                    Opened::Sqlite(sqlite::open::beside(&dir, PATIENCE).await?)
                }
                Place::Shared(url) => Opened::Postgres(postgres::open::prepare(&url).await?),
            }))
        })
    }

    /// Whether a directory contains a database. Always true for PostgreSQL: a missing database is an error of
    /// [`open`](Self::open).
    pub fn is_at(place: &Place) -> bool {
        match place {
            Place::Directory(dir) => dir
                .join(sqlite::open::DATABASE)
                .try_exists()
                .unwrap_or_else(|error| error.kind() == ErrorKind::PermissionDenied),
            Place::Shared(_) => true,
        }
    }

    /// Up to `limit` entries of the audit log, the newest first. With `before`, only entries with smaller ids.
    pub fn audit(&mut self, before: Option<i64>, limit: u32) -> Command<'_, Vec<AuditEntry>> {
        Box::pin(audit::list(before, limit, self))
    }

    /// Creates an access key and returns it. Only its digest is stored, so the key cannot be read later.
    pub fn add_key<'a>(&'a mut self, new: &'a NewKey) -> Command<'a, String> {
        Box::pin(async move {
            let (id, key) = NewKey::mint()?;
            self.change(keys::add, &(id, key.clone(), new.clone(), Actor::of_process())).await?;
            Ok(key)
        })
    }

    /// All access keys, also expired and revoked ones, the oldest first.
    pub fn keys(&mut self) -> Command<'_, Vec<AccessKey>> {
        Box::pin(keys::list(self))
    }

    /// Revokes the valid keys with this id or name; returns how many.
    pub fn revoke_keys<'a>(&'a mut self, name: &'a str) -> Command<'a, usize> {
        let input = (name.to_owned(), Actor::of_process());
        Box::pin(async move { self.change(keys::revoke, &input).await })
    }

    /// Shares the names that an owner gave before names were shared, or gives its names to another owner. Returns the number
    /// of jobs and notes.
    pub fn pass_names_on(&mut self, from: &str, to: Option<&str>) -> Command<'_, u64> {
        let input = (from.to_owned(), to.map(str::to_owned), Actor::of_process());
        Box::pin(async move {
            let mut count = 0;
            while let passed @ 1.. = self.change(naming::pass_on, &input).await? {
                count += passed;
            }
            Ok(count)
        })
    }

    /// Executes a verb in a transaction of its own.
    pub(super) async fn change<Input, V, Answer>(
        &mut self,
        verb: V,
        input: &Input,
    ) -> Result<Answer>
    where
        V: for<'a> Verb<'a, Input, Change<'a>, Answer = Answer>,
    {
        self.execute(sql!("BEGIN" [" IMMEDIATE" | ""] "")).await?;
        let done = self.commit(verb, input).await;
        if done.is_err() {
            // This fails if the database has already rolled back, or cannot be reached any more. Both are harmless.
            let _ = self.execute(sql!("ROLLBACK")).await;
        }
        done
    }

    /// Executes a verb in the open transaction, and commits.
    async fn commit<Input, V, Answer>(&mut self, verb: V, input: &Input) -> Result<Answer>
    where
        V: for<'a> Verb<'a, Input, Change<'a>, Answer = Answer>,
    {
        let query = sql!(
            "SELECT " ["CAST(round(unixepoch('subsec') * 1000) AS INTEGER)" | "moment()"] " AS now"
        );
        let now = self.one(query).await?.get("now")?;
        // A command has no listeners, so the effects are dropped.
        let (db, effects) = (self.connection(), &mut Vec::new());
        let answer = verb.apply(input, Change { db, now, effects }).await?;
        self.execute(sql!("COMMIT")).await?;
        Ok(answer)
    }

    /// Closes the database.
    pub fn close(self) -> Command<'static, ()> {
        Box::pin(async move {
            match self.0 {
                Opened::Sqlite(db) => Ok(db.close().await?),
                Opened::Postgres(db) => Ok(db.close().await?),
            }
        })
    }
}
