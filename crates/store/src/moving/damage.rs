//! Damage to a database. SQLite's integrity check reports the number of a damaged row in the scan, not its key. This
//! module finds the key.

use std::fmt;

use futures_util::TryStreamExt as _;
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
pub(super) async fn locate(db: &mut SqliteConnection, table: &str, line: &str) -> Vec<Damage> {
    let found = if let Some((row, index)) = of_index(line) {
        in_index(db, table, row, index).await
    } else if let Some((kind, column)) = of_column(line) {
        in_column(db, kind, table, column).await
    } else {
        beside_damage(db, table, line).await
    };
    // The damage may also prevent the search for the row. Then the line itself is reported.
    let found = found.unwrap_or_default();
    if found.is_empty() { vec![Damage::of(table, line)] } else { found }
}

/// The position of a row in its table, from 1, and the name of the index that differs from the row.
fn of_index(line: &str) -> Option<(i64, &str)> {
    let line = line.strip_prefix("rowid not at end-of-record for ").unwrap_or(line);
    let (row, rest) = line.strip_prefix("row ")?.split_once(' ')?;
    let (_, index) = rest.rsplit_once("index ")?;
    Some((row.parse().ok()?, index))
}

/// The wrong type of a value, or `NULL`, and the name of the column.
fn of_column(line: &str) -> Option<(&str, &str)> {
    let (kind, place) = line.split_once(" value in ")?;
    Some((kind, place.split_once('.')?.1))
}

/// The names that a statement with one parameter returns. `of` is its value.
async fn names(
    db: &mut SqliteConnection,
    query: &'static str,
    of: &str,
) -> sqlx::Result<Vec<String>> {
    sqlx::query_scalar(query).bind(of).fetch_all(db).await
}

/// The columns of an index that are columns of its table.
async fn columns_of(db: &mut SqliteConnection, index: &str) -> sqlx::Result<Vec<String>> {
    names(db, "SELECT name FROM pragma_index_info(?1) WHERE name IS NOT NULL", index).await
}

/// The columns of the primary key, or `rowid`.
async fn keys_of(db: &mut SqliteConnection, table: &str) -> sqlx::Result<Vec<String>> {
    let query = "SELECT name FROM pragma_table_info(?1) WHERE pk > 0 ORDER BY pk";
    let keys = names(db, query, table).await?;
    Ok(if keys.is_empty() { vec!["rowid".to_owned()] } else { keys })
}

/// A table in SQL, written so that SQLite reads the rows and not their copies in an index.
async fn rows_of(db: &mut SqliteConnection, table: &str) -> sqlx::Result<String> {
    // For a `WITHOUT ROWID` table, `NOT INDEXED` would still permit an index that has all columns.
    let query = "SELECT iif(wr, 'INDEXED BY sqlite_autoindex_' || name || '_1', 'NOT INDEXED')
         FROM pragma_table_list WHERE schema = 'main' AND name = ?1";
    let how: String = sqlx::query_scalar(query).bind(table).fetch_one(db).await?;
    Ok(format!("{table} {how}"))
}

/// A SQL expression for the key of a row as text.
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
) -> sqlx::Result<Vec<Damage>> {
    let (keys, rows) = (keys_of(db, table).await?, rows_of(db, table).await?);
    let quoted: Vec<String> =
        keys.iter().map(|key| format!("'{key} = ' || quote({key})")).collect();
    let query = format!(
        "SELECT {}, {} FROM {rows} LIMIT 1 OFFSET ?1",
        key(&keys),
        quoted.join(" || ' AND ' || ")
    );
    let found: Option<(String, String)> =
        sqlx::query_as(AssertSqlSafe(query)).bind(row - 1).fetch_optional(&mut *db).await?;
    let Some((name, is_row)) = found else { return Ok(Vec::new()) };
    let columns = columns_of(db, index).await?;
    let column = match differing(db, table, index, &is_row, &columns).await {
        Ok(Some(column)) => column,
        // No column differs, so the index has no entry for the row.
        Ok(None) | Err(_) => format!("one of {}", columns.join(", ")),
    };
    Ok(vec![Damage::at(table, &name, format!("{column} differs from the index {index}"))])
}

/// The column of a row that differs from its copy in an index.
async fn differing(
    db: &mut SqliteConnection,
    table: &str,
    index: &str,
    is_row: &str,
    columns: &[String],
) -> sqlx::Result<Option<String>> {
    let part = filter_of(db, index).await?;
    for column in columns {
        let mut values: [Option<String>; 2] = [None, None];
        let sources = [rows_of(db, table).await?, format!("{table} INDEXED BY {index}")];
        for (value, source) in values.iter_mut().zip(sources) {
            let query = format!("SELECT quote({column}) FROM {source} WHERE {is_row} AND ({part})");
            *value = sqlx::query_scalar(AssertSqlSafe(query)).fetch_optional(&mut *db).await?;
        }
        if let [Some(row), Some(copy)] = values
            && row != copy
        {
            return Ok(Some(column.clone()));
        }
    }
    Ok(None)
}

/// Reports the row next to the first unreadable row, or the index that is damaged.
async fn beside_damage(
    db: &mut SqliteConnection,
    table: &str,
    line: &str,
) -> sqlx::Result<Vec<Damage>> {
    for (order, place) in [("ASC", "after"), ("DESC", "before")] {
        match last_readable(db, table, order).await? {
            Readable::Disordered(row) => {
                let what = format!("this key, or that of the row before it, is damaged: {line}");
                return Ok(vec![Damage::at(table, &row, what)]);
            }
            Readable::All => {
                let index = damaged_index(db, table, line).await?;
                let what = match index {
                    Some(index) => format!("the index {index} is damaged: {line}"),
                    None => format!("all rows can be read: {line}"),
                };
                return Ok(vec![Damage::of(table, what)]);
            }
            Readable::To(row) => {
                let what = format!("the row {place} this one cannot be read: {line}");
                return Ok(vec![Damage::at(table, &row, what)]);
            }
            // No row can be read in this direction. The other direction may work.
            Readable::None => {}
        }
    }
    Ok(vec![Damage::of(table, format!("no row can be read: {line}"))])
}

/// The rows of a table that can be read in one direction.
enum Readable {
    All,
    /// All rows, but this one is not in the order of the keys.
    Disordered(String),
    /// The rows up to this one.
    To(String),
    None,
}

async fn last_readable(
    db: &mut SqliteConnection,
    table: &str,
    order: &str,
) -> sqlx::Result<Readable> {
    let (keys, rows) = (keys_of(db, table).await?, rows_of(db, table).await?);
    let columns = names(db, "SELECT name FROM pragma_table_info(?1)", table).await?;
    // The call of `instr` makes SQLite read the whole value, also from overflow pages.
    let read: Vec<String> = columns.iter().map(|name| format!("instr({name}, '') IS 0")).collect();
    // Rows in the order of the file need no sorting, for which SQLite would read all of them first.
    let is_by_key = rows.contains("INDEXED BY");
    let sorted: Vec<String> = if is_by_key {
        keys.iter().map(|key| format!("{key} {order}")).collect()
    } else {
        vec![format!("rowid {order}")]
    };
    let query = format!(
        "SELECT {}, {} FROM {rows} ORDER BY {}",
        key(&keys),
        read.join(" + "),
        sorted.join(", ")
    );
    let mut rows = sqlx::query_as::<_, (String, i64)>(AssertSqlSafe(query)).fetch(db);
    let (mut last, mut disordered) = (None, None);
    // A key of several columns can have a different order as text.
    let is_ordered = is_by_key && keys.len() == 1 && order == "ASC";
    loop {
        match rows.try_next().await {
            Ok(Some((row, _))) => {
                if is_ordered
                    && disordered.is_none()
                    && last.as_ref().is_some_and(|last| row < *last)
                {
                    disordered = Some(row.clone());
                }
                last = Some(row);
            }
            Ok(None) => return Ok(disordered.map_or(Readable::All, Readable::Disordered)),
            Err(_) => return Ok(last.map_or(Readable::None, Readable::To)),
        }
    }
}

/// The index that a line reports. The line may contain the first page of the index. Otherwise it is the first index
/// that cannot be read.
async fn damaged_index(
    db: &mut SqliteConnection,
    table: &str,
    line: &str,
) -> sqlx::Result<Option<String>> {
    let query = "SELECT name FROM pragma_index_list(?1) WHERE origin <> 'pk' OR NOT (
         SELECT wr FROM pragma_table_list WHERE schema = 'main' AND name = ?1)";
    let indexes = names(db, query, table).await?;
    let root =
        line.strip_prefix("Tree ").and_then(|rest| rest.split(' ').next()?.parse::<i64>().ok());
    if let Some(root) = root {
        let query = "SELECT name FROM sqlite_schema WHERE rootpage = ?1";
        let name: Option<String> = sqlx::query_scalar(query).bind(root).fetch_optional(db).await?;
        return Ok(name.filter(|name| indexes.contains(name)));
    }
    for index in indexes {
        let columns = columns_of(db, &index).await?;
        let part = filter_of(db, &index).await?;
        let query = format!(
            "SELECT count(*) FROM (SELECT {} FROM {table} INDEXED BY {index} WHERE {part})",
            columns.join(", ")
        );
        if sqlx::query_scalar::<_, i64>(AssertSqlSafe(query)).fetch_one(&mut *db).await.is_err() {
            return Ok(Some(index));
        }
    }
    Ok(None)
}

/// The condition of a partial index in SQL; `TRUE` for any other index.
async fn filter_of(db: &mut SqliteConnection, index: &str) -> sqlx::Result<String> {
    let query = "SELECT substr(sql, instr(sql, ' WHERE ') + 7) FROM sqlite_schema
         WHERE name = ?1 AND instr(sql, ' WHERE ') > 0";
    let part: Option<String> = sqlx::query_scalar(query).bind(index).fetch_optional(db).await?;
    Ok(part.unwrap_or_else(|| "TRUE".to_owned()))
}

async fn in_column(
    db: &mut SqliteConnection,
    kind: &str,
    table: &str,
    column: &str,
) -> sqlx::Result<Vec<Damage>> {
    let wrong = match kind.strip_prefix("non-") {
        Some(kind) => format!("typeof({column}) NOT IN ('{}', 'null')", kind.to_lowercase()),
        None if kind == "NULL" => format!("{column} IS NULL"),
        None => format!("typeof({column}) = '{}'", kind.to_lowercase()),
    };
    let (keys, rows) = (keys_of(db, table).await?, rows_of(db, table).await?);
    let query = format!("SELECT {} FROM {rows} WHERE {wrong} LIMIT 100", key(&keys));
    let names: Vec<String> = sqlx::query_scalar(AssertSqlSafe(query)).fetch_all(db).await?;
    let what = |name: &String| Damage::at(table, name, format!("{column} has a {kind} value"));
    Ok(names.iter().map(what).collect())
}
