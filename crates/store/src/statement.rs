//! Statements whose text and values follow from what a caller asks for. Both databases execute them.

use std::fmt::Write as _;

use sqlx::postgres::PgArguments;
use sqlx::query::Query;
use sqlx::sqlite::SqliteArguments;
use sqlx::{AssertSqlSafe, Postgres, Sqlite};

/// A statement that is being written, with the values of its parameters.
#[derive(Debug)]
pub(super) struct Statement {
    text: String,
    values: Vec<Value>,
    dialect: Dialect,
}

/// What the two databases call differently.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dialect {
    /// The function of two texts that is positive if the first contains the second.
    pub(super) contains: &'static str,
    /// The function that gives the largest of its arguments.
    pub(super) largest: &'static str,
}

/// The words of SQLite.
pub(super) const SQLITE: Dialect = Dialect { contains: "instr", largest: "max" };

/// The words of PostgreSQL.
pub(super) const POSTGRES: Dialect = Dialect { contains: "strpos", largest: "greatest" };

#[derive(Debug, Clone)]
enum Value {
    Integer(i64),
    Real(f64),
    Text(Option<String>),
    Bytes(Vec<u8>),
}

impl From<i64> for Value {
    fn from(value: i64) -> Self {
        Self::Integer(value)
    }
}

impl From<f64> for Value {
    fn from(value: f64) -> Self {
        Self::Real(value)
    }
}

impl From<&str> for Value {
    fn from(value: &str) -> Self {
        Self::Text(Some(value.to_owned()))
    }
}

impl From<Option<String>> for Value {
    fn from(value: Option<String>) -> Self {
        Self::Text(value)
    }
}

impl From<&[u8]> for Value {
    fn from(value: &[u8]) -> Self {
        Self::Bytes(value.to_vec())
    }
}

/// Adds a value to a statement of either database.
macro_rules! bind {
    ($query:expr, $value:expr) => {
        match $value {
            Value::Integer(value) => $query.bind(value),
            Value::Real(value) => $query.bind(value),
            Value::Text(value) => $query.bind(value),
            Value::Bytes(value) => $query.bind(value),
        }
    };
}

impl Statement {
    pub(super) fn new(text: &str, dialect: Dialect) -> Self {
        Self { text: text.to_owned(), values: Vec::new(), dialect }
    }

    pub(super) fn dialect(&self) -> Dialect {
        self.dialect
    }

    pub(super) fn push(&mut self, text: &str) -> &mut Self {
        self.text.push_str(text);
        self
    }

    /// Adds a parameter with its value.
    #[expect(private_bounds, reason = "the kinds of values are those of the two databases")]
    pub(super) fn bind(&mut self, value: impl Into<Value>) -> &mut Self {
        self.values.push(value.into());
        // Writing to a `String` cannot fail.
        let _ = write!(self.text, "${}", self.values.len());
        self
    }

    /// The statement for SQLite.
    pub(super) fn sqlite(self) -> Query<'static, Sqlite, SqliteArguments> {
        let query = sqlx::query(AssertSqlSafe(self.text));
        self.values.into_iter().fold(query, |query, value| bind!(query, value))
    }

    /// The statement for PostgreSQL.
    pub(super) fn postgres(self) -> Query<'static, Postgres, PgArguments> {
        let query = sqlx::query(AssertSqlSafe(self.text));
        self.values.into_iter().fold(query, |query, value| bind!(query, value))
    }
}
