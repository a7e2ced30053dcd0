//! How columns of the tables are read, the same way from both databases.

use serde::de::DeserializeOwned;
use sha2::{Digest as _, Sha256};
use sqlx::Row as _;
use sqlx::postgres::PgRow;
use sqlx::sqlite::SqliteRow;
use xxhash_rust::xxh3::xxh3_64;

use super::body::Body;
use fretwork_job::{Change, JobId, Key};

/// The id of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct RunId(pub(super) i64);

/// What one worker computes: a run, or the piece of a study with this number.
pub(super) type Part = (RunId, Option<u32>);

/// A row of a database. Each method reads a column of one type; `None` if it is null.
pub(super) trait Columns {
    fn integer(&self, column: &str) -> Result<Option<i64>, sqlx::Error>;
    fn real(&self, column: &str) -> Result<Option<f64>, sqlx::Error>;
    fn truth(&self, column: &str) -> Result<Option<bool>, sqlx::Error>;
    fn text(&self, column: &str) -> Result<Option<&str>, sqlx::Error>;
    fn bytes(&self, column: &str) -> Result<Option<&[u8]>, sqlx::Error>;

    /// Reads a column as the type that the caller needs.
    fn get<'r, T: Cell<'r>>(&'r self, column: &str) -> Result<T, sqlx::Error>
    where
        Self: Sized,
    {
        T::read(self, column)
    }
}

/// A row of either database.
#[derive(Debug)]
pub(super) enum Row {
    Sqlite(SqliteRow),
    Postgres(PgRow),
}

/// Implements [`Columns`] by the conversions of sqlx.
macro_rules! columns {
    ($row:ty, $self:ident, $column:ident => $value:expr) => {
        columns!($row, $self, $column => $value, integer: i64, real: f64, truth: bool, text: &str, bytes: &[u8]);
    };
    ($row:ty, $self:ident, $column:ident => $value:expr, $($method:ident: $kind:ty),*) => {
        impl Columns for $row { $(
            fn $method(&$self, $column: &str) -> Result<Option<$kind>, sqlx::Error> {
                $value
            }
        )* }
    };
}

columns!(SqliteRow, self, column => self.try_get(column));
columns!(PgRow, self, column => self.try_get(column));
columns!(Row, self, column => match self {
    Self::Sqlite(row) => row.try_get(column),
    Self::Postgres(row) => row.try_get(column),
});

/// A type of [`Columns::get`]. An `Option` is `None` where the column is null.
pub(super) trait Cell<'r>: Sized {
    fn read(row: &'r impl Columns, column: &str) -> Result<Self, sqlx::Error>;
}

/// Implements [`Cell`] for types, each by a method of [`Columns`].
macro_rules! cells {
    ($($kind:ty: $method:ident),* $(,)?) => { $(
        impl<'r> Cell<'r> for Option<$kind> {
            fn read(row: &'r impl Columns, column: &str) -> Result<Self, sqlx::Error> {
                let value = row.$method(column)?.map(<$kind>::try_from).transpose();
                value.map_err(|error| sqlx::Error::Decode(error.into()))
            }
        }

        impl<'r> Cell<'r> for $kind {
            fn read(row: &'r impl Columns, column: &str) -> Result<Self, sqlx::Error> {
                Option::<$kind>::read(row, column)?
                    .ok_or_else(|| sqlx::Error::Decode(format!("{column} is null").into()))
            }
        }
    )* };
}

cells! {
    i64: integer, u64: integer, u32: integer, u8: integer, f64: real, bool: truth, &'r str: text, String: text,
    &'r [u8]: bytes, Vec<u8>: bytes,
}

/// The rows of a page, and the last of them if there is a next page. A statement reads one row more than the page has.
pub(super) fn page_of(rows: &[Row], limit: u32) -> (&[Row], Option<&Row>) {
    let page = &rows[..rows.len().min(limit as usize)];
    (page, page.last().filter(|_| page.len() < rows.len()))
}

/// Reads a word that stands for a variant of an enum.
pub(super) fn word<T>(row: &impl Columns, column: &str) -> Result<T, sqlx::Error>
where
    T: std::str::FromStr<Err: std::error::Error + Send + Sync + 'static>,
{
    row.get::<&str>(column)?.parse().map_err(|error| sqlx::Error::Decode(Box::new(error)))
}

/// Reads a word, if there is one.
pub(super) fn optional_word<T>(row: &impl Columns, column: &str) -> Result<Option<T>, sqlx::Error>
where
    T: std::str::FromStr<Err: std::error::Error + Send + Sync + 'static>,
{
    row.text(column)?.map(|_| word(row, column)).transpose()
}

/// Reads a key.
pub(super) fn key(row: &impl Columns, column: &str) -> Result<Key, sqlx::Error> {
    let bytes = row.get::<&[u8]>(column)?;
    let bytes = bytes.try_into().map_err(|error| sqlx::Error::Decode(Box::new(error)))?;
    Ok(Key::from_bytes(bytes))
}

/// Reads the id of a job.
pub(super) fn job_id(bytes: &[u8]) -> Result<JobId, sqlx::Error> {
    uuid::Uuid::from_slice(bytes).map(JobId).map_err(|error| sqlx::Error::Decode(Box::new(error)))
}

/// Reads the changes of a job, one per line: state, attempt, time.
pub(super) fn changes(text: &str) -> Result<Vec<Change>, sqlx::Error> {
    let read = |line: &str| {
        let mut words = line.split(' ');
        Some(Change {
            state: words.next()?.parse().ok()?,
            attempt: words.next()?.parse().ok()?,
            at: words.next()?.parse().ok()?,
        })
    };
    text.lines()
        .map(|line| read(line).ok_or_else(|| sqlx::Error::Decode("not a change of state".into())))
        .collect()
}

/// Reads a JSON document.
pub(super) fn json<T: DeserializeOwned>(text: &str) -> Result<T, sqlx::Error> {
    serde_json::from_str(text).map_err(|error| sqlx::Error::Decode(Box::new(error)))
}

/// A hash of a stored text, by which damage is detected.
pub(super) fn checksum(text: &str) -> i64 {
    xxh3_64(text.as_bytes()).cast_signed()
}

/// The hash of a body as it is stored.
pub(super) enum Sum {
    Check(i64),
    /// Results of the first version have only a SHA-256.
    Digest(Vec<u8>),
}

impl Sum {
    /// Reads the columns `checksum` and `digest`.
    pub(super) fn read(row: &impl Columns) -> Result<Self, sqlx::Error> {
        Ok(match row.get::<Option<i64>>("checksum")? {
            Some(checksum) => Self::Check(checksum),
            None => Self::Digest(row.get("digest")?),
        })
    }

    /// Whether the body has this hash.
    pub(super) fn is_of(&self, body: &Body) -> bool {
        match self {
            Self::Check(sum) => body.checksum() == *sum,
            Self::Digest(digest) => *Sha256::digest(body.bytes()) == **digest,
        }
    }
}
