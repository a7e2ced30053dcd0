//! Executes statements in either database.

use sqlx::SqliteConnection;
use sqlx::postgres::PgConnection;

use crate::database::error::{Doing, Result};
use crate::database::row::Row;
use crate::database::statement::Statement;

/// Advisory locks of PostgreSQL, with which servers exclude each other. Other programs in the same database must not
/// use these numbers.
#[derive(Debug, Clone, Copy)]
#[repr(i64)]
pub(crate) enum Lock {
    /// Migrations.
    Schema = 0x6672_6574_0001,
    /// The sum of all pins.
    Pins = 0x6672_6574_0002,
    /// Maintenance.
    Maintenance = 0x6672_6574_0003,
}

/// The purpose for which the store needs a connection.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Purpose {
    /// Any statement: uses a connection of the pool.
    Any,
    /// A scan of all results or jobs: uses a connection of the pool. Scans never use all connections of the pool, so single
    /// results can always be read.
    Scan,
    /// A large result: few connections may read these, because a connection keeps the memory that it has allocated.
    Large,
    /// The access keys: every request needs them, and must not wait for long lists.
    Keys,
}

/// Reads the tables. Implemented by connections, and by the store, which uses one of its connections for each
/// statement.
pub(crate) trait Tables: Send {
    /// The rows that a statement returns.
    fn rows(&mut self, statement: Statement) -> Doing<'_, Vec<Row>>;

    /// The row of a statement that returns at most one.
    async fn row(&mut self, statement: Statement) -> Result<Option<Row>> {
        Ok(self.rows(statement).await?.pop())
    }

    /// The row of a statement that always returns one.
    async fn one(&mut self, statement: Statement) -> Result<Row> {
        Ok(self.row(statement).await?.ok_or(sqlx::Error::RowNotFound)?)
    }
}

/// A connection to either database.
pub(crate) enum Connection<'a> {
    Sqlite(&'a mut SqliteConnection),
    Postgres(&'a mut PgConnection),
}

/// Has a connection. In an open transaction, it can also change the tables.
pub(crate) trait Connected: Send {
    fn connection(&mut self) -> Connection<'_>;

    /// Executes a statement.
    async fn execute(&mut self, statement: Statement) -> Result<()> {
        self.changed_by(statement).await.map(drop)
    }

    /// Executes a statement, and returns the number of rows that the statement has changed.
    fn changed_by(&mut self, statement: Statement) -> Doing<'_, u64> {
        self.connection().changed_by(statement)
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
    fn rows(&mut self, statement: Statement) -> Doing<'_, Vec<Row>> {
        self.connection().rows(statement)
    }
}

/// These futures are boxed, so that the code of the drivers is compiled once, and not in every verb.
impl<'a> Connection<'a> {
    fn changed_by(self, statement: Statement) -> Doing<'a, u64> {
        Box::pin(async {
            Ok(match self {
                Self::Sqlite(db) => statement.sqlite().execute(db).await?.rows_affected(),
                Self::Postgres(db) => statement.postgres().execute(db).await?.rows_affected(),
            })
        })
    }

    fn rows(self, statement: Statement) -> Doing<'a, Vec<Row>> {
        Box::pin(async {
            Ok(match self {
                Self::Sqlite(db) => {
                    let rows = statement.sqlite().fetch_all(db).await?;
                    rows.into_iter().map(Row::Sqlite).collect()
                }
                Self::Postgres(db) => {
                    let rows = statement.postgres().fetch_all(db).await?;
                    rows.into_iter().map(Row::Postgres).collect()
                }
            })
        })
    }
}
