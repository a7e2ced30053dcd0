//! The file of an import. Someone may have made it to do harm.
//!
//! A view or a generated column can compute without end, or make values of gigabytes. So the structure of the file is
//! checked before its rows are read, and the sizes of the values of a row before the values are. A damaged file can have
//! rows without end. So each statement may only take a limited number of steps.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use futures_util::TryStreamExt as _;
use sqlx::sqlite::SqliteRow;
use sqlx::{AssertSqlSafe, Connection as _, Encode, Sqlite, SqliteConnection, Type};

use super::{EXPORT, FORM, Moving};
use crate::error::{Error, is_other_file};
use crate::row::Columns as _;
use crate::sqlite::{open, schema};

/// Largest row of the table `results`, in bytes. The largest scenarios have about 1 MB.
const MAX_ROW: u64 = 16_000_000;
/// Most steps to read one row. About 100 are needed.
const STEPS_OF_A_ROW: i64 = 100_000;
/// Steps between two looks at the limit.
const INTERVAL: i32 = 1000;

/// Longest key, in bytes. One that is too long to be a key is refused with its row.
const LONGEST_KEY: u64 = 1000;

const BODY: &str = "SELECT CAST(body AS BLOB) AS body FROM bodies WHERE key = ?1";
/// The columns of `results` that an import reads.
const COLUMNS: &str = "sha256, owner, computed, wall_seconds, cpu_seconds, version, host, architecture, processors, note,
    note_owner, note_at";

/// An export that is open for reading.
#[derive(Debug)]
pub(super) struct ExportFile {
    db: SqliteConnection,
    path: PathBuf,
    /// Steps that the statement may still take.
    steps: Arc<AtomicI64>,
    /// The sums of the sizes of all columns, in SQL.
    size_of_result: String,
    size_of_body: String,
    /// Exports of earlier versions have no column `warnings`.
    has_warnings: bool,
}

impl ExportFile {
    /// Opens an export, and checks its structure.
    pub(super) async fn open(path: &Path) -> Result<Self, Moving> {
        if !path.is_file() {
            return Err(Moving::Nothing(path.to_owned()));
        }
        let head = async {
            let options = open::connecting(path).read_only(true).pragma("trusted_schema", "OFF");
            let mut db = SqliteConnection::connect_with(&options).await?;
            let id: i32 = sqlx::query_scalar("PRAGMA application_id").fetch_one(&mut db).await?;
            let form: i32 = sqlx::query_scalar("PRAGMA user_version").fetch_one(&mut db).await?;
            let schema = schema::parts(&mut db).await?;
            Ok::<_, Error>((db, id, form, schema))
        };
        let (mut db, id, found, schema) = head.await.map_err(|error| unreadable(path, error))?;
        let path = path.to_owned();
        match id {
            open::APPLICATION_ID => return Err(Moving::WholeDatabase(path)),
            EXPORT if found > FORM => return Err(Moving::LaterForm { path, found }),
            // Neither views nor triggers nor virtual tables.
            EXPORT if schema.values().all(|part| is_plain(&part.sql)) => {}
            _ => return Err(Moving::NoExport(path)),
        }
        let steps = Arc::new(AtomicI64::new(0));
        let left = Arc::clone(&steps);
        db.lock_handle().await?.set_progress_handler(INTERVAL, move || {
            left.fetch_sub(INTERVAL.into(), Ordering::Relaxed) > 0
        });
        let (size_of_result, size_of_body) = (String::new(), String::new());
        let has_warnings = false;
        let mut file = Self { db, path, steps, size_of_result, size_of_body, has_warnings };
        file.check().await?;
        Ok(file)
    }

    /// Checks the columns and keys of both tables.
    async fn check(&mut self) -> Result<(), Moving> {
        for table in ["results", "bodies"] {
            let names = self.columns(table).await?;
            let longest =
                format!("SELECT ifnull(max(octet_length(key)), 0) AS longest FROM {table}");
            let longest = self.row(longest, self.steps_of_a_table(), 0_i64).await;
            let longest =
                longest.and_then(|row| row.map_or(Ok(0), |row| Ok(row.get::<u64>("longest")?)));
            // SQLite reads whole keys to find one.
            if longest.map_err(|error| unreadable(&self.path, error))? > LONGEST_KEY {
                return Err(Moving::NoExport(self.path.clone()));
            }
            if table == "results" {
                self.has_warnings = names.iter().any(|name| name == "warnings");
                self.size_of_result = size(&names);
            } else {
                self.size_of_body = size(&names);
            }
        }
        // The statements fail if a column is missing.
        let result = self.row(self.result_statement(), STEPS_OF_A_ROW, 0_i64).await;
        result.map_err(|error| unreadable(&self.path, error))?;
        let body = self.row(BODY.to_owned(), STEPS_OF_A_ROW, "").await;
        body.map(drop).map_err(|error| unreadable(&self.path, error))
    }

    /// The names of the columns of a table. Each must be stored, not computed.
    async fn columns(&mut self, table: &str) -> Result<Vec<String>, Moving> {
        self.steps.store(STEPS_OF_A_ROW, Ordering::Relaxed);
        let columns: Result<Vec<(String, bool)>, sqlx::Error> =
            sqlx::query_as("SELECT name, hidden = 0 FROM pragma_table_xinfo(?1)")
                .bind(table)
                .fetch_all(&mut self.db)
                .await;
        let columns = columns.map_err(|error| unreadable(&self.path, error.into()))?;
        let is_sound = |(name, is_stored): &(String, bool)| *is_stored && !is_row_number(name);
        if columns.is_empty() || !columns.iter().all(is_sound) {
            return Err(Moving::NoExport(self.path.clone()));
        }
        Ok(columns.into_iter().map(|(name, _)| name).collect())
    }

    /// The numbers of the rows of `results`, and their keys.
    pub(super) async fn rows(&mut self) -> Result<Vec<(i64, String)>, Moving> {
        self.steps.store(self.steps_of_a_table(), Ordering::Relaxed);
        let statement = "SELECT rowid, CAST(ifnull(key, '') AS BLOB) AS key FROM results";
        let mut found = sqlx::query(statement).fetch(&mut self.db);
        let mut rows = Vec::new();
        let read = async {
            while let Some(row) = found.try_next().await? {
                let key = row.get::<&[u8]>("key")?;
                rows.push((row.get("rowid")?, String::from_utf8_lossy(key).into_owned()));
            }
            Ok::<_, sqlx::Error>(())
        };
        read.await.map_err(|error| unreadable(&self.path, error.into()))?;
        Ok(rows)
    }

    /// Most steps to read all rows of a table. A result takes more than 1000 bytes in the file, and less than 20 steps.
    fn steps_of_a_table(&self) -> i64 {
        let bytes = fs::metadata(&self.path).map_or(0, |file| file.len());
        STEPS_OF_A_ROW + bytes.cast_signed() / 50
    }

    /// A row of `results`; `None` if it is too large.
    pub(super) async fn result(&mut self, row: i64) -> Result<Option<SqliteRow>, Error> {
        let size = format!("SELECT {} AS size FROM results WHERE rowid = ?1", self.size_of_result);
        let size = self.row(size, STEPS_OF_A_ROW, row).await?;
        if size.map_or(Ok(0), |row| row.get::<u64>("size"))? > MAX_ROW {
            return Ok(None);
        }
        self.row(self.result_statement(), STEPS_OF_A_ROW, row).await
    }

    /// The body of a result, if there is one.
    pub(super) async fn body(&mut self, key: &str, most: u64) -> Result<Option<Found>, Error> {
        let size = format!("SELECT {} AS size FROM bodies WHERE key = ?1", self.size_of_body);
        let size = self.row(size, STEPS_OF_A_ROW, key).await?;
        if size.map_or(Ok(0), |row| row.get::<u64>("size"))? > most {
            return Ok(Some(Found::TooLarge));
        }
        let Some(row) = self.row(BODY.to_owned(), STEPS_OF_A_ROW, key).await? else {
            return Ok(None);
        };
        Ok(row.get::<Option<Vec<u8>>>("body")?.map(Found::Body))
    }

    fn result_statement(&self) -> String {
        let warnings = if self.has_warnings { "warnings" } else { "NULL AS warnings" };
        format!("SELECT {COLUMNS}, {warnings} FROM results WHERE rowid = ?1")
    }

    /// Executes a statement that returns one row. It may take this many steps, and has one parameter.
    async fn row<'q, T>(
        &mut self,
        statement: String,
        steps: i64,
        parameter: T,
    ) -> Result<Option<SqliteRow>, Error>
    where
        T: Encode<'q, Sqlite> + Type<Sqlite> + 'q,
    {
        self.steps.store(steps, Ordering::Relaxed);
        let query = sqlx::query(AssertSqlSafe(statement)).bind(parameter);
        Ok(query.fetch_optional(&mut self.db).await?)
    }

    pub(super) async fn close(self) -> Result<(), Moving> {
        Ok(self.db.close().await?)
    }
}

/// A body that an export has.
pub(super) enum Found {
    Body(Vec<u8>),
    TooLarge,
}

/// Whether a statement of a schema makes a table or an index. SQLite writes the first words in this form.
fn is_plain(sql: &str) -> bool {
    let kinds = ["CREATE TABLE ", "CREATE INDEX ", "CREATE UNIQUE INDEX "];
    // The index of a primary key has no statement.
    sql.is_empty() || kinds.iter().any(|kind| sql.starts_with(kind))
}

/// Whether a column with this name hides the number of a row.
fn is_row_number(name: &str) -> bool {
    ["rowid", "oid", "_rowid_"].iter().any(|number| name.eq_ignore_ascii_case(number))
}

/// The sum of the sizes of these columns, in SQL. SQLite does not read the values for it.
fn size(columns: &[String]) -> String {
    let size =
        |name: &String| format!("ifnull(octet_length(\"{}\"), 0)", name.replace('"', "\"\""));
    columns.iter().map(size).collect::<Vec<_>>().join(" + ")
}

/// Translates an error of the export file.
pub(super) fn unreadable(file: &Path, error: Error) -> Moving {
    let path = file.to_owned();
    match error {
        Error::Damaged(error) if is_other_file(&error) => Moving::NoExport(path),
        Error::Damaged(error) => Moving::Damaged { path, said: error.to_string() },
        Error::Database(error) if error.as_database_error().is_some() => Moving::NoExport(path),
        error => error.into(),
    }
}
