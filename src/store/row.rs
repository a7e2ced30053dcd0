//! How columns of the tables are read.

use serde::de::DeserializeOwned;
use sha2::{Digest as _, Sha256};
use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::body::Body;
use crate::job::{Change, JobId, Key};

/// The id of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct RunId(pub(super) i64);

/// What one worker computes: a run, or the piece of a study with this number.
pub(super) type Part = (RunId, Option<u32>);

/// Reads a word that stands for a variant of an enum.
pub(super) fn word<T>(row: &SqliteRow, column: &str) -> Result<T, sqlx::Error>
where
    T: std::str::FromStr<Err: std::error::Error + Send + Sync + 'static>,
{
    row.try_get::<&str, _>(column)?.parse().map_err(|error| sqlx::Error::Decode(Box::new(error)))
}

/// Reads a word, if there is one.
pub(super) fn optional_word<T>(row: &SqliteRow, column: &str) -> Result<Option<T>, sqlx::Error>
where
    T: std::str::FromStr<Err: std::error::Error + Send + Sync + 'static>,
{
    row.try_get::<Option<&str>, _>(column)?.map(|_| word(row, column)).transpose()
}

/// Reads a key.
pub(super) fn key(row: &SqliteRow, column: &str) -> Result<Key, sqlx::Error> {
    let bytes: &[u8] = row.try_get(column)?;
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

/// The hash of a body as it is stored.
pub(super) enum Sum {
    Check(i64),
    /// Results of the first version have only a SHA-256.
    Digest(Vec<u8>),
}

impl Sum {
    /// Reads the columns `checksum` and `digest`.
    pub(super) fn read(row: &SqliteRow) -> Result<Self, sqlx::Error> {
        Ok(match row.try_get("checksum")? {
            Some(checksum) => Self::Check(checksum),
            None => Self::Digest(row.try_get("digest")?),
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
