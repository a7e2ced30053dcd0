//! Results of other servers, to be stored.

use super::keep::Answered;
use super::library::{Note, Program};
use super::row::Columns;
use fretwork_job::{Key, Verified};

/// A result of another server, checked.
pub(super) struct Import<'a> {
    pub(super) key: Key,
    pub(super) answer: &'a Answered,
    /// The task in its stored form.
    pub(super) task: &'a str,
    pub(super) owner: Option<&'a str>,
    pub(super) warnings: Option<&'a str>,
    pub(super) program: Option<&'a Program>,
    pub(super) computed: Option<i64>,
    pub(super) note: Option<&'a Note>,
    /// The name of the file that contains it.
    pub(super) file: &'a str,
    pub(super) verified: Verified,
}

/// What a database has under the key of a result before its import.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Before {
    /// Nothing, or the result was evicted.
    Nothing,
    /// The same result.
    Same,
    /// Another result.
    Another,
    /// Someone has deleted the result.
    DeletedBy(String),
    /// Another result was evicted.
    AnotherEvicted,
}

/// Reads what [`Before`] says of the key $1 and the digest $2.
pub(super) const BEFORE: &str =
    "SELECT evicted IS NULL AS held, digest = $2 AS same, deleted_by FROM result WHERE key = $1";

impl Before {
    /// Reads the row of [`BEFORE`], if there is one.
    pub(super) fn read(row: Option<&impl Columns>) -> Result<Self, sqlx::Error> {
        let Some(row) = row else { return Ok(Self::Nothing) };
        Ok(match (row.get("held")?, row.get("same")?, row.get::<Option<String>>("deleted_by")?) {
            (false, true, None) => Self::Nothing,
            (true, true, _) => Self::Same,
            (true, false, _) => Self::Another,
            (false, _, Some(who)) => Self::DeletedBy(who),
            (false, false, None) => Self::AnotherEvicted,
        })
    }

    /// Why a result is refused, if it is.
    pub(super) fn refusal(&self) -> Option<String> {
        match self {
            Self::Nothing | Self::Same => None,
            Self::Another => Some("this database has another result under its key".to_owned()),
            Self::DeletedBy(who) => {
                Some(format!("{who} deleted it here; it must be computed again to come back"))
            }
            Self::AnotherEvicted => {
                Some("it differs from the result that was evicted here".to_owned())
            }
        }
    }
}

/// What an import did with a note.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NoteTaken {
    /// There is none, or it is the same.
    Unchanged,
    /// The result has it now.
    Stored,
    /// The result keeps another one.
    Refused,
}
