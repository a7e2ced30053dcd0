//! Damage to a database, and the rows that SQLite's integrity check is about. It counts rows instead of naming them.

use std::fmt;

use sqlx::{AssertSqlSafe, SqliteConnection};

/// Damage to a row, or to a page of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// The table.
    pub table: String,
    /// The row, its column and what is wrong with it.
    pub what: String,
}

/// Stands for the table of a page that no table uses.
pub(super) const UNUSED: &str = "unused page";

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.table, self.what)
    }
}

impl Damage {
    pub(super) fn of(table: &str, what: impl Into<String>) -> Self {
        Self { table: table.to_owned(), what: what.into() }
    }

    /// Whether a backup can leave it out: bodies, whose scenarios are kept; chunks, which
    /// are computed again; and pages that no table uses.
    pub(super) fn can_be_left_out(&self) -> bool {
        ["result_blob", "chunk", UNUSED].contains(&&*self.table)
    }
}

/// The damage that a line of the integrity check of a table reports.
pub(super) async fn locate(db: &mut SqliteConnection, table: &str, line: &str) -> Vec<Damage> {
    let found = if let Some((row, index)) = of_index(line) {
        in_index(db, table, row, index).await
    } else if let Some((kind, column)) = of_column(line) {
        in_column(db, kind, table, column).await
    } else {
        Ok(Vec::new())
    };
    // What is damaged may be needed to find the row.
    let found = found.unwrap_or_default();
    if found.is_empty() { vec![Damage::of(table, line)] } else { found }
}

/// The place of a row in its table, and the index that differs from it.
fn of_index(line: &str) -> Option<(i64, &str)> {
    let line = line.strip_prefix("rowid not at end-of-record for ").unwrap_or(line);
    let (row, rest) = line.strip_prefix("row ")?.split_once(' ')?;
    let (_, index) = rest.rsplit_once("index ")?;
    Some((row.parse().ok()?, index))
}

/// A type, or `NULL`, and the column that has a wrong value of it.
fn of_column(line: &str) -> Option<(&str, &str)> {
    let (kind, place) = line.split_once(" value in ")?;
    Some((kind, place.split_once('.')?.1))
}

/// The columns of the primary key, or `rowid`.
async fn keys_of(db: &mut SqliteConnection, table: &str) -> Result<Vec<String>, sqlx::Error> {
    let query = "SELECT name FROM pragma_table_info(?1) WHERE pk > 0 ORDER BY pk";
    let keys: Vec<String> = sqlx::query_scalar(query).bind(table).fetch_all(db).await?;
    Ok(if keys.is_empty() { vec!["rowid".to_owned()] } else { keys })
}

/// The key of a row, in SQL.
fn key(keys: &[String]) -> String {
    let part = |name: &String| {
        format!("CAST(iif(typeof({name}) = 'blob', lower(hex({name})), {name}) AS TEXT)")
    };
    keys.iter().map(part).collect::<Vec<_>>().join(" || ' ' || ")
}

async fn in_index(
    db: &mut SqliteConnection,
    table: &str,
    row: i64,
    index: &str,
) -> Result<Vec<Damage>, sqlx::Error> {
    let keys = keys_of(db, table).await?;
    let query = format!("SELECT {} FROM {table} NOT INDEXED LIMIT 1 OFFSET ?1", key(&keys));
    let name: Option<String> =
        sqlx::query_scalar(AssertSqlSafe(query)).bind(row - 1).fetch_optional(&mut *db).await?;
    let query = "SELECT name FROM pragma_index_info(?1) WHERE name IS NOT NULL";
    let columns: Vec<String> = sqlx::query_scalar(query).bind(index).fetch_all(db).await?;
    let name = name.unwrap_or_else(|| format!("row {row}"));
    let columns = columns.join(", ");
    Ok(vec![Damage::of(table, format!("{name}: one of {columns} differs from the index {index}"))])
}

async fn in_column(
    db: &mut SqliteConnection,
    kind: &str,
    table: &str,
    column: &str,
) -> Result<Vec<Damage>, sqlx::Error> {
    let wrong = match kind.strip_prefix("non-") {
        Some(kind) => format!("typeof({column}) NOT IN ('{}', 'null')", kind.to_lowercase()),
        None if kind == "NULL" => format!("{column} IS NULL"),
        None => format!("typeof({column}) = '{}'", kind.to_lowercase()),
    };
    let keys = keys_of(db, table).await?;
    let query = format!("SELECT {} FROM {table} NOT INDEXED WHERE {wrong} LIMIT 100", key(&keys));
    let names: Vec<String> = sqlx::query_scalar(AssertSqlSafe(query)).fetch_all(db).await?;
    let what = |name: &String| Damage::of(table, format!("{name}: {column} has a {kind} value"));
    Ok(names.iter().map(what).collect())
}

/// Bytes in hexadecimal.
pub(super) fn spelled(bytes: &[u8]) -> String {
    data_encoding::HEXLOWER.encode(bytes)
}
