//! Damage to a database. For a row that differs from an index, SQLite's integrity check reports its number in the scan.
//! This module finds its key.

use std::fmt;

use sqlx::{AssertSqlSafe, SqliteConnection};
use uuid::Uuid;

/// Damage to a row, or to a page of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// The table.
    pub table: String,
    /// The key of the row: an id, or a key in hexadecimal. `None` if the row is unknown.
    pub row: Option<String>,
    /// The column, and what is wrong with it.
    pub what: String,
}

/// The name that is reported instead of a table for a page that no table uses.
pub(super) const UNUSED: &str = "unused page";

/// The table that contains the schema.
pub(super) const SCHEMA: &str = "sqlite_schema";

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self { table, row: Some(row), what } => write!(f, "{table} {row}: {what}"),
            Self { table, row: None, what } => write!(f, "{table}: {what}"),
        }
    }
}

impl Damage {
    /// Damage to a table.
    pub(super) fn of(table: &str, what: impl Into<String>) -> Self {
        Self { table: table.to_owned(), row: None, what: what.into() }
    }

    /// Damage to a row.
    pub(super) fn at(table: &str, row: &str, what: impl Into<String>) -> Self {
        // Only the ids of jobs have 32 digits.
        let id = Some(row).filter(|row| row.len() == 32).and_then(|row| row.parse::<Uuid>().ok());
        let row = id.map_or_else(|| row.to_owned(), |id| id.to_string());
        Self { table: table.to_owned(), row: Some(row), what: what.into() }
    }

    /// Whether a backup can leave out the damaged rows. It can leave out bodies, because it keeps their scenarios;
    /// chunks, because a server computes them again; and pages that no table uses.
    pub(super) fn can_be_left_out(&self) -> bool {
        ["result_blob", "chunk", UNUSED].contains(&&*self.table)
    }
}

/// Damage to the schema. If SQLite reports an unreadable statement, the row is the name of its table, index or trigger.
pub(super) fn in_schema(error: &sqlx::Error) -> Damage {
    let what = error.to_string();
    let name =
        what.split_once("malformed database schema (").and_then(|(_, rest)| rest.split_once(')'));
    match name {
        // The name may contain anything.
        Some((name, _)) => {
            Damage::at(SCHEMA, &name.escape_debug().to_string(), what.escape_debug().to_string())
        }
        None => Damage::of(SCHEMA, what),
    }
}

/// The damage that a line of the integrity check of a table reports.
pub(super) async fn locate(db: &mut SqliteConnection, table: &str, line: &str) -> Damage {
    // The damage may also prevent the search for the row.
    let row = match number_in(line) {
        Some(number) => row(db, table, number).await.ok().flatten(),
        None => None,
    };
    row.map_or_else(|| Damage::of(table, line), |row| Damage::at(table, &row, line))
}

/// The position of a row in its table, from 1, in a line such as `row 3 missing from index job_key`.
fn number_in(line: &str) -> Option<i64> {
    let line = line.strip_prefix("rowid not at end-of-record for ").unwrap_or(line);
    line.strip_prefix("row ")?.split_once(' ')?.0.parse().ok()
}

/// The key of the row at this position in the table: the columns of the primary key, or `rowid`.
async fn row(db: &mut SqliteConnection, table: &str, number: i64) -> sqlx::Result<Option<String>> {
    let keys = "SELECT name FROM pragma_table_info(?1) WHERE pk > 0 ORDER BY pk";
    let mut keys: Vec<String> = sqlx::query_scalar(keys).bind(table).fetch_all(&mut *db).await?;
    if keys.is_empty() {
        keys.push("rowid".to_owned());
    }
    // SQLite must scan the rows, and not their copies in an index. For a `WITHOUT ROWID` table, `NOT INDEXED` would still
    // permit an index that has all columns.
    let how = "SELECT iif(wr, 'INDEXED BY sqlite_autoindex_' || name || '_1', 'NOT INDEXED')
         FROM pragma_table_list WHERE schema = 'main' AND name = ?1";
    let how: String = sqlx::query_scalar(how).bind(table).fetch_one(&mut *db).await?;
    let text = |name: &String| {
        format!("CAST(iif(typeof({name}) = 'blob', lower(hex({name})), {name}) AS TEXT)")
    };
    let key = keys.iter().map(text).collect::<Vec<_>>().join(" || ' ' || ");
    let query = format!("SELECT {key} FROM {table} {how} LIMIT 1 OFFSET ?1");
    sqlx::query_scalar(AssertSqlSafe(query)).bind(number - 1).fetch_optional(db).await
}
