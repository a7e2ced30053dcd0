//! Stores results of other servers, which an import has read from a file.

use crate::database::{Change, Connected, Connection, Result, Tables, sql};
use crate::results::library::Program;
use crate::results::notes::Note;
use crate::results::storing::{Answered, Source};
use crate::{postgres, sqlite};
use fretwork_job::{Key, Verified};

/// A result of another server that passed all checks, so that it may be stored.
#[derive(Debug)]
pub struct Accepted {
    pub(crate) key: Key,
    pub(crate) answer: Answered,
    /// The task in its stored form.
    pub(crate) task: String,
    pub(crate) owner: Option<String>,
    pub(crate) warnings: Option<String>,
    pub(crate) program: Option<Program>,
    pub(crate) computed: Option<i64>,
    pub(crate) note: Option<Note>,
    pub(crate) verified: Verified,
}

/// What the database has under the key of a result before the result is imported.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Before {
    /// Nothing, or the same result without its body, which was evicted.
    Nothing,
    /// The same result.
    Same,
    /// A different result.
    Another,
    /// Someone has deleted the result.
    DeletedBy(String),
    /// A different result, whose body was evicted.
    AnotherEvicted,
}

impl Before {
    /// What the database has under the key of a result with this digest.
    pub(crate) async fn of(key: &Key, digest: &[u8], mut db: impl Tables) -> Result<Self> {
        let query = sql!(
            "SELECT evicted IS NULL AS held, digest = $2 AS same, deleted_by FROM result WHERE key = $1";
            key, digest
        );
        let Some(row) = db.row(query).await? else { return Ok(Self::Nothing) };
        Ok(match (row.get("held")?, row.get("same")?, row.get::<Option<String>>("deleted_by")?) {
            (false, true, None) => Self::Nothing,
            (true, true, _) => Self::Same,
            (true, false, _) => Self::Another,
            (false, _, Some(who)) => Self::DeletedBy(who),
            (false, false, None) => Self::AnotherEvicted,
        })
    }

    /// Why the import refuses the result, if it does.
    pub(crate) fn refusal(&self) -> Option<String> {
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

/// What an import did with the note of a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NoteTaken {
    /// The file has no note, or the same note as the database.
    Unchanged,
    /// The note is stored: the result had none.
    Stored,
    /// The note is not stored: the result keeps its own different note.
    Refused,
}

/// Stores a result from the file with this name, if the database does not have it. Stores its note, unless the database
/// already has a note of the result.
pub(crate) async fn store_import(
    (import, file): &(Accepted, String),
    mut tx: Change<'_>,
) -> Result<(Before, NoteTaken)> {
    let (key, digest) = (&import.key, &import.answer.digest);
    let mut found = Before::of(key, digest, &mut tx).await?;
    if found == Before::Nothing && !insert(import, file, &mut tx).await? {
        // A server has stored the result meanwhile.
        found = Before::of(key, digest, &mut tx).await?;
    }
    if found.refusal().is_some() {
        return Ok((found, NoteTaken::Unchanged));
    }
    Ok((found, note_result(key, import.note.as_ref(), &mut tx).await?))
}

/// Inserts the result. Returns false if a server has stored the key in the meantime.
async fn insert(import: &Accepted, file: &str, tx: &mut Change<'_>) -> Result<bool> {
    let Accepted { key, task, owner, warnings, answer, .. } = import;
    let program = match &import.program {
        Some(program) => Some(program.id(tx).await?),
        None => None,
    };
    let source = Source {
        key: *key,
        task,
        owner: owner.as_deref(),
        job: None,
        warnings: warnings.clone(),
        trace: None,
        program,
        now: tx.now().await?,
    };
    let stored = match tx.connection() {
        // No other writer can store it during the transaction.
        Connection::Sqlite(db) => {
            sqlite::storing::import(answer, db, &source).await?;
            true
        }
        Connection::Postgres(db) => postgres::storing::store(db, answer, &source, true).await?,
    };
    if stored {
        let update = sql!(
            "UPDATE result SET imported = $2, imported_from = $3, computed = $4, verified = $5 WHERE key = $1";
            key, source.now, file, import.computed, import.verified.to_string()
        );
        tx.execute(update).await?;
    }
    Ok(stored)
}

/// Stores the note of a result that the database has, unless the result already has a note.
pub(crate) async fn take_note(
    (key, note): &(Key, Option<Note>),
    mut tx: Change<'_>,
) -> Result<NoteTaken> {
    note_result(key, note.as_ref(), &mut tx).await
}

async fn note_result(key: &Key, note: Option<&Note>, tx: &mut Change<'_>) -> Result<NoteTaken> {
    let Some(Note { text, owner, at, .. }) = note else { return Ok(NoteTaken::Unchanged) };
    // The result may have been deleted since the caller found it. Then this inserts nothing.
    let insert = sql!(
        "INSERT INTO note (key, text, owner, at) SELECT key, $2, $3, $4 FROM result WHERE key = $1
         ON CONFLICT (key) DO NOTHING";
        key, text, owner, *at
    );
    if tx.changed_by(insert).await? > 0 {
        return Ok(NoteTaken::Stored);
    }
    let there = tx.row(sql!("SELECT text FROM note WHERE key = $1"; key)).await?;
    Ok(match there.map(|row| row.get::<String>("text")).transpose()? {
        Some(there) if there != *text => NoteTaken::Refused,
        _ => NoteTaken::Unchanged,
    })
}
