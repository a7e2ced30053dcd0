//! Executes statements in either database.

use std::future::Future;

use sqlx::SqliteConnection;
use sqlx::postgres::PgConnection;

use super::error::Error;
use super::row::Row;
use super::statement::Statement;

/// Advisory locks of PostgreSQL, by which servers exclude each other. Other programs in the same database must not use these
/// numbers.
#[derive(Debug, Clone, Copy)]
#[repr(i64)]
pub(super) enum Lock {
    /// Migrations.
    Schema = 0x6672_6574_0001,
    /// The sum of all pins.
    Pins = 0x6672_6574_0002,
    /// Maintenance.
    Upkeep = 0x6672_6574_0003,
}

/// How many rows of an answer are read.
#[derive(Debug, Clone, Copy)]
pub(super) enum Most {
    One,
    All,
}

/// What the store needs a connection for.
#[derive(Debug, Clone, Copy)]
pub(super) enum Purpose {
    /// One of a pool.
    Any,
    /// One of a pool, for a scan of all results. Scans never take all connections, so single results can always be read.
    Scan,
    /// One for large results: a connection keeps the memory that it has allocated.
    Large,
    /// One for access keys: every request needs them, and must not wait for long lists.
    Keys,
}

/// What reads the tables: a connection, or the store, which takes one of its connections for each statement.
pub(super) trait Tables: Send {
    /// Reads the rows that a statement returns.
    fn read(
        &mut self,
        statement: Statement,
        most: Most,
    ) -> impl Future<Output = Result<Vec<Row>, Error>> + Send;

    /// All rows.
    async fn rows(&mut self, statement: Statement) -> Result<Vec<Row>, Error> {
        self.read(statement, Most::All).await
    }

    /// The first row, if there is one.
    async fn row(&mut self, statement: Statement) -> Result<Option<Row>, Error> {
        Ok(self.read(statement, Most::One).await?.pop())
    }

    /// The first row of a statement that always returns one.
    async fn one(&mut self, statement: Statement) -> Result<Row, Error> {
        Ok(self.row(statement).await?.ok_or(sqlx::Error::RowNotFound)?)
    }
}

/// A connection to either database.
#[derive(Debug)]
pub(super) enum Connection<'a> {
    Sqlite(&'a mut SqliteConnection),
    Postgres(&'a mut PgConnection),
}

/// What has a connection. In an open transaction it also changes the tables.
pub(super) trait Connected: Send {
    fn connection(&mut self) -> Connection<'_>;

    /// Returns the number of rows that the statement has changed.
    async fn execute(&mut self, statement: Statement) -> Result<u64, Error> {
        Ok(match self.connection() {
            Connection::Sqlite(db) => statement.sqlite().execute(db).await?.rows_affected(),
            Connection::Postgres(db) => statement.postgres().execute(db).await?.rows_affected(),
        })
    }

    /// Executes a statement that locks something until the end of the transaction. SQLite has one writer.
    async fn lock(&mut self, statement: Statement) -> Result<(), Error> {
        if let Connection::Postgres(db) = self.connection() {
            statement.postgres().execute(db).await?;
        }
        Ok(())
    }
}

impl<T: Connected> Connected for &mut T {
    fn connection(&mut self) -> Connection<'_> {
        (**self).connection()
    }
}

/// Implements [`Connected`] for types that are, or have, a connection.
macro_rules! connected {
    ($($kind:ty, $self:ident => $connection:expr);* $(;)?) => { $(
        impl Connected for $kind {
            fn connection(&mut $self) -> Connection<'_> {
                $connection
            }
        }
    )* };
}

connected! {
    SqliteConnection, self => Connection::Sqlite(self);
    PgConnection, self => Connection::Postgres(self);
    Connection<'_>, self => match self {
        Connection::Sqlite(db) => Connection::Sqlite(db),
        Connection::Postgres(db) => Connection::Postgres(db),
    };
}

impl<T: Connected> Tables for T {
    async fn read(&mut self, statement: Statement, most: Most) -> Result<Vec<Row>, Error> {
        macro_rules! fetch {
            ($query:expr, $db:ident => $row:path) => {
                match most {
                    Most::One => $query.fetch_optional($db).await?.into_iter().map($row).collect(),
                    Most::All => $query.fetch_all($db).await?.into_iter().map($row).collect(),
                }
            };
        }
        Ok(match self.connection() {
            Connection::Sqlite(db) => fetch!(statement.sqlite(), db => Row::Sqlite),
            Connection::Postgres(db) => fetch!(statement.postgres(), db => Row::Postgres),
        })
    }
}
