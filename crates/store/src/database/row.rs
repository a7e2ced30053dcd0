//! Reads columns of the tables, in the same way for both databases.

use std::array::TryFromSliceError;

use serde_json::Value;
use sha2::{Digest as _, Sha256};
use sqlx::error::BoxDynError;
use sqlx::postgres::PgRow;
use sqlx::sqlite::SqliteRow;
use sqlx::{Decode, Postgres, Row as _, Sqlite, Type};
use xxhash_rust::xxh3::xxh3_64;

use crate::database::body::Body;
use fretwork_job::{Change, FailureKind, JobId, JobState, Key, Origin, Recomputed, Verified};

/// The id of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RunId(pub i64);

/// The part of a run that one worker computes: the whole run (`None`), or the piece of a study with this number.
pub(crate) type RunPart = (RunId, Option<u32>);

/// A row of either database.
pub(crate) enum Row {
    Sqlite(SqliteRow),
    Postgres(PgRow),
}

impl Row {
    /// Reads a column as the type that the caller needs.
    pub(crate) fn get<'r, T: Cell<'r>>(&'r self, column: &str) -> sqlx::Result<T> {
        T::read(self, column)
    }

    /// Reads a column as a type that both drivers know. Returns `None` if the column is null.
    pub(crate) fn value<'r, T>(&'r self, column: &str) -> sqlx::Result<Option<T>>
    where
        T: Decode<'r, Sqlite> + Type<Sqlite> + Decode<'r, Postgres> + Type<Postgres>,
    {
        match self {
            Self::Sqlite(row) => row.try_get(column),
            Self::Postgres(row) => row.try_get(column),
        }
    }
}

/// A type that [`Row::get`] can return. For a null column, an `Option` is `None`, and any other type is an error.
pub(crate) trait Cell<'r>: Sized {
    fn read(row: &'r Row, column: &str) -> sqlx::Result<Self>;
}

/// Turns a failed conversion of a value into an error of sqlx.
pub(crate) fn decoded<T, E: Into<BoxDynError>>(
    value: Option<Result<T, E>>,
) -> sqlx::Result<Option<T>> {
    value.transpose().map_err(|error| sqlx::Error::Decode(error.into()))
}

/// Implements [`Cell`] for types. The drivers read the column as the first type, and a function converts the value.
macro_rules! cells {
    ($($raw:ty => $convert:path: $($kind:ty),+;)*) => { $($(
        impl<'r> $crate::database::row::Cell<'r> for Option<$kind> {
            fn read(row: &'r $crate::database::row::Row, column: &str) -> sqlx::Result<Self> {
                $crate::database::row::decoded(row.value::<$raw>(column)?.map(|value| $convert(value)))
            }
        }

        impl<'r> $crate::database::row::Cell<'r> for $kind {
            fn read(row: &'r $crate::database::row::Row, column: &str) -> sqlx::Result<Self> {
                row.get::<Option<$kind>>(column)?.ok_or_else(|| {
                    sqlx::Error::Decode(format!("the column {column} has no value").into())
                })
            }
        }
    )+)* };
}

cells! {
    i64 => TryFrom::try_from: i64, u64, u32, u8;
    f64 => TryFrom::try_from: f64;
    bool => TryFrom::try_from: bool;
    &str => TryFrom::try_from: &'r str, String;
    &str => str::parse: FailureKind, JobState, Origin, Recomputed, Verified;
    &str => changes: Vec<Change>;
    &str => serde_json::from_str: Vec<String>, Value;
    &[u8] => TryFrom::try_from: &'r [u8], Vec<u8>;
    &[u8] => key: Key;
    &[u8] => job_id: JobId;
}

/// Builds a struct from a row. The fields before the semicolon are read from the columns with their names. The caller
/// gives the values of the fields after it.
macro_rules! read {
    ($row:ident => $type:ident { $($column:ident),* $(,)? $(; $($field:ident $(: $value:expr)?),* $(,)?)? }) => {
        $type { $($column: $row.get(stringify!($column))?,)* $($($field $(: $value)?,)*)? }
    };
}

pub(crate) use {cells, read};

/// The rows of a page, and the last one of them if there is a next page. To show that, `rows` has one row more than
/// `limit`.
pub(crate) fn page_of(rows: &[Row], limit: u32) -> (&[Row], Option<&Row>) {
    let page = &rows[..rows.len().min(limit as usize)];
    (page, page.last().filter(|_| page.len() < rows.len()))
}

/// Reads a key.
fn key(bytes: &[u8]) -> Result<Key, TryFromSliceError> {
    bytes.try_into().map(Key::from_bytes)
}

/// Reads the id of a job.
fn job_id(bytes: &[u8]) -> Result<JobId, uuid::Error> {
    uuid::Uuid::from_slice(bytes).map(JobId)
}

/// Reads the changes of a job, one per line: state, attempt, time.
pub(crate) fn changes(text: &str) -> Result<Vec<Change>, &'static str> {
    let read = |line: &str| {
        let mut words = line.split(' ');
        Some(Change {
            state: words.next()?.parse().ok()?,
            attempt: words.next()?.parse().ok()?,
            at: words.next()?.parse().ok()?,
        })
    };
    text.lines()
        .map(|line| read(line).ok_or("a line is not a change of the state of a job"))
        .collect()
}

/// A hash of a stored text, which detects damage.
pub(crate) fn checksum(text: &str) -> i64 {
    xxh3_64(text.as_bytes()).cast_signed()
}

/// The hash of a body as it is stored.
pub(crate) enum Sum {
    Check(i64),
    /// Results that the first version of the program stored have only a SHA-256.
    Digest(Vec<u8>),
}

impl Sum {
    /// Reads the columns `checksum` and `digest`.
    pub(crate) fn read(row: &Row) -> sqlx::Result<Self> {
        Ok(match row.get::<Option<i64>>("checksum")? {
            Some(checksum) => Self::Check(checksum),
            None => Self::Digest(row.get("digest")?),
        })
    }

    /// Whether the body has this hash.
    pub(crate) fn is_of(&self, body: &Body) -> bool {
        match self {
            Self::Check(sum) => body.checksum() == *sum,
            Self::Digest(digest) => *Sha256::digest(body.bytes()) == **digest,
        }
    }
}
