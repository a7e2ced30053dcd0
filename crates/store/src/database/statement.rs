//! SQL statements with the values of their parameters, for both databases.

use std::borrow::Cow;
use std::fmt::Write as _;

use sqlx::postgres::PgArguments;
use sqlx::query::Query;
use sqlx::sqlite::SqliteArguments;
use sqlx::{AssertSqlSafe, Postgres, Sqlite};

use crate::database::row::RunId;
use fretwork_job::{JobId, Key};

/// A statement with the values of its parameters `$1`, `$2` and so on.
#[derive(Debug, Clone)]
pub(crate) struct Statement {
    sqlite: Cow<'static, str>,
    postgres: Cow<'static, str>,
    values: Vec<Value>,
}

/// A statement with its values: `sql!("SELECT task FROM run WHERE id = $1"; run)`.
///
/// Where the SQL of the databases differs, brackets contain the text for SQLite and that for PostgreSQL:
/// `sql!("SELECT " ["max" | "greatest"] "(a, b)")`. Both statements are composed at compile time.
macro_rules! sql {
    ($first:literal $([$sqlite:literal | $postgres:literal] $next:literal)* $(; $($value:expr),* $(,)?)?) => {
        $crate::database::statement::Statement::new(
            concat!($first $(, $sqlite, $next)*),
            concat!($first $(, $postgres, $next)*),
        )$($(.with($value))*)?
    };
}

pub(crate) use sql;

/// A value of a parameter, or null.
#[derive(Debug, Clone)]
pub(crate) enum Value {
    Integer(Option<i64>),
    Real(Option<f64>),
    Truth(Option<bool>),
    Text(Option<String>),
    Bytes(Option<Vec<u8>>),
}

/// Implements the conversions from types, and from options of them, to [`Value`].
macro_rules! values {
    ($($kind:ty: $variant:ident($value:ident) => $stored:expr),* $(,)?) => { $(
        impl From<$kind> for Value {
            fn from($value: $kind) -> Self {
                Self::$variant(Some($stored))
            }
        }

        impl From<Option<$kind>> for Value {
            fn from(value: Option<$kind>) -> Self {
                Self::$variant(value.map(|$value| $stored))
            }
        }
    )* };
}

values! {
    i64: Integer(value) => value,
    u32: Integer(value) => value.into(),
    u8: Integer(value) => value.into(),
    RunId: Integer(run) => run.0,
    f64: Real(value) => value,
    bool: Truth(value) => value,
    &str: Text(text) => text.to_owned(),
    &String: Text(text) => text.clone(),
    String: Text(text) => text,
    &[u8]: Bytes(bytes) => bytes.to_owned(),
    &[u8; 32]: Bytes(bytes) => bytes.to_vec(),
    &Vec<u8>: Bytes(bytes) => bytes.clone(),
    &Key: Bytes(key) => key.bytes().to_vec(),
    Key: Bytes(key) => key.bytes().to_vec(),
    JobId: Bytes(id) => id.0.as_bytes().to_vec(),
}

/// Binds a value to a query of either database.
macro_rules! bind {
    ($query:expr, $value:expr) => {
        match $value {
            Value::Integer(value) => $query.bind(value),
            Value::Real(value) => $query.bind(value),
            Value::Truth(value) => $query.bind(value),
            Value::Text(value) => $query.bind(value),
            Value::Bytes(value) => $query.bind(value),
        }
    };
}

impl Statement {
    pub(crate) fn new(sqlite: &'static str, postgres: &'static str) -> Self {
        Self { sqlite: sqlite.into(), postgres: postgres.into(), values: Vec::new() }
    }

    /// A statement with the same text for both databases, such as one that only one database executes.
    pub(crate) fn of(text: impl Into<Cow<'static, str>>) -> Self {
        let text = text.into();
        Self { sqlite: text.clone(), postgres: text, values: Vec::new() }
    }

    /// Adds the value of the next parameter. The text already contains the parameter.
    pub(crate) fn with(mut self, value: impl Into<Value>) -> Self {
        self.values.push(value.into());
        self
    }

    pub(crate) fn push(&mut self, text: &str) -> &mut Self {
        self.push_either(text, text)
    }

    /// Adds text that differs between SQLite and PostgreSQL.
    pub(crate) fn push_either(&mut self, sqlite: &str, postgres: &str) -> &mut Self {
        self.sqlite.to_mut().push_str(sqlite);
        self.postgres.to_mut().push_str(postgres);
        self
    }

    /// Adds a parameter to the text, and its value.
    pub(crate) fn push_bind(&mut self, value: impl Into<Value>) -> &mut Self {
        self.values.push(value.into());
        let place = self.values.len();
        for text in [&mut self.sqlite, &mut self.postgres] {
            // Writing to a `String` cannot fail.
            let _ = write!(text.to_mut(), "${place}");
        }
        self
    }

    /// Limits the statement to `rows` rows. The number is part of the text: SQLite compiles a statement again for each new
    /// value of a parameter in `LIMIT`.
    pub(crate) fn push_limit(&mut self, rows: u32) -> &mut Self {
        self.push(&format!(" LIMIT {rows}"))
    }

    /// The statement that returns the query plan of SQLite for this statement.
    #[cfg(test)]
    pub(crate) fn explained(mut self) -> Self {
        self.sqlite.to_mut().insert_str(0, "EXPLAIN QUERY PLAN ");
        self
    }

    /// The statement for SQLite.
    pub(crate) fn sqlite(self) -> Query<'static, Sqlite, SqliteArguments> {
        let query = sqlx::query(AssertSqlSafe(self.sqlite));
        self.values.into_iter().fold(query, |query, value| bind!(query, value))
    }

    /// The statement for PostgreSQL.
    pub(crate) fn postgres(self) -> Query<'static, Postgres, PgArguments> {
        let query = sqlx::query(AssertSqlSafe(self.postgres));
        self.values.into_iter().fold(query, |query, value| bind!(query, value))
    }
}
