//! Reads the file of an import, which may be malicious.
//!
//! A view or a generated column can compute without end, or produce values of gigabytes. So this module checks the
//! structure of the file before it reads rows, and the size of a row before it reads the values. A damaged file can
//! have an endless list of rows. So each statement may only take a limited number of steps of SQLite's virtual machine.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use futures_util::TryStreamExt as _;
use sqlx::sqlite::SqliteRow;
use sqlx::{AssertSqlSafe, Connection as _, Encode, Sqlite, SqliteConnection, Type};

use super::{EXPORT, FORM, Moving};
use crate::error::{Error, Result, is_other_file};
use crate::row::Columns as _;
use crate::sqlite::{open, schema};

/// Maximum size of a row of the table `results`, in bytes. The largest scenarios have about 1 MB.
const MAX_ROW: u64 = 16_000_000;
/// Maximum number of steps to read one row. A normal row needs about 100.
const STEPS_OF_A_ROW: i64 = 100_000;
/// The limit is checked each time after this number of steps.
const INTERVAL: i32 = 1000;

/// Maximum length of a key, in bytes. A file with a longer key is refused as a whole. A shorter text that is no key is
/// refused with its row only.
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
    /// Number of steps that the current statement may still take.
    steps: Arc<AtomicI64>,
    /// SQL for the size of a row of `results`.
    size_of_result: String,
    /// SQL for the size of a row of `bodies`.
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
            // A schema with views, triggers or virtual tables is refused.
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
            // To find a row, SQLite reads whole keys into memory.
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
        // Tries both statements once, because they fail if a column is missing.
        let result = self.row(self.result_statement(), STEPS_OF_A_ROW, 0_i64).await;
        result.map_err(|error| unreadable(&self.path, error))?;
        let body = self.row(BODY.to_owned(), STEPS_OF_A_ROW, "").await;
        body.map(drop).map_err(|error| unreadable(&self.path, error))
    }

    /// The names of the columns of a table. Each must be stored, not computed.
    async fn columns(&mut self, table: &str) -> Result<Vec<String>, Moving> {
        self.steps.store(STEPS_OF_A_ROW, Ordering::Relaxed);
        let columns: sqlx::Result<Vec<(String, bool)>> =
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

    /// Maximum number of steps to read all rows of a table. A result takes more than 1000 bytes in the file, and
    /// reading its row takes less than 20 steps.
    fn steps_of_a_table(&self) -> i64 {
        let bytes = fs::metadata(&self.path).map_or(0, |file| file.len());
        STEPS_OF_A_ROW + bytes.cast_signed() / 50
    }

    /// A row of `results`; `None` if it is too large.
    pub(super) async fn result(&mut self, row: i64) -> Result<Option<SqliteRow>> {
        let size = format!("SELECT {} AS size FROM results WHERE rowid = ?1", self.size_of_result);
        let size = self.row(size, STEPS_OF_A_ROW, row).await?;
        if size.map_or(Ok(0), |row| row.get::<u64>("size"))? > MAX_ROW {
            return Ok(None);
        }
        self.row(self.result_statement(), STEPS_OF_A_ROW, row).await
    }

    /// The body of a result, if there is one.
    pub(super) async fn body(&mut self, key: &str, most: u64) -> Result<Option<Found>> {
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

    /// Executes a statement that has one parameter, and returns its first row. The statement may take `steps` steps.
    async fn row<'q, T>(
        &mut self,
        statement: String,
        steps: i64,
        parameter: T,
    ) -> Result<Option<SqliteRow>>
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

/// Whether a column with this name would hide SQLite's row number, which this module reads.
fn is_row_number(name: &str) -> bool {
    ["rowid", "oid", "_rowid_"].iter().any(|number| name.eq_ignore_ascii_case(number))
}

/// SQL for the sum of the sizes of these columns. SQLite computes it without reading the values.
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
