//! Stores results of other servers.

use sqlx::{Connection as _, SqliteConnection};

use super::keep;
use crate::error::Error;
use crate::imports::{BEFORE, Before, Import, NoteTaken};
use crate::keep::Source;
use crate::library::Note;
use fretwork_job::{Key, clock};

pub(crate) async fn before(
    db: &mut SqliteConnection,
    key: &Key,
    digest: &[u8],
) -> Result<Before, Error> {
    let query = sqlx::query(BEFORE).bind(key.bytes().as_slice()).bind(digest);
    Ok(Before::read(query.fetch_optional(db).await?.as_ref())?)
}

pub(crate) async fn import(
    db: &mut SqliteConnection,
    import: &Import<'_>,
) -> Result<(Before, NoteTaken), Error> {
    let mut tx = db.begin_with("BEGIN IMMEDIATE").await?;
    let before = before(&mut tx, &import.key, &import.answer.digest).await?;
    if before.refusal().is_some() {
        return Ok((before, NoteTaken::Unchanged));
    }
    if before == Before::Nothing {
        insert(&mut tx, import).await?;
    }
    let note = annotate(&mut tx, &import.key, import.note).await?;
    tx.commit().await?;
    Ok((before, note))
}

async fn insert(db: &mut SqliteConnection, import: &Import<'_>) -> Result<(), Error> {
    let Import { key, task, owner, warnings, .. } = *import;
    let program = match import.program {
        Some(program) => Some(program.id(db).await?),
        None => None,
    };
    let now = clock::now();
    let (job, trace) = (None, None);
    let source = Source { key, task, owner, job, warnings, trace, program, now };
    keep::import(import.answer, db, &source).await?;
    sqlx::query(
        "UPDATE result SET imported = ?2, imported_from = ?3, computed = ?4, verified = ?5 WHERE key = ?1",
    )
    .bind(key.bytes().as_slice())
    .bind(now)
    .bind(import.file)
    .bind(import.computed)
    .bind(import.verified.to_string())
    .execute(db)
    .await?;
    Ok(())
}

/// Stores the note, unless the result already has a note.
pub(crate) async fn annotate(
    db: &mut SqliteConnection,
    key: &Key,
    note: Option<&Note>,
) -> Result<NoteTaken, Error> {
    let Some(note) = note else { return Ok(NoteTaken::Unchanged) };
    let inserted = sqlx::query(
        "INSERT INTO note (key, text, owner, at) VALUES ($1, $2, $3, $4) ON CONFLICT (key) DO NOTHING",
    )
    .bind(key.bytes().as_slice())
    .bind(&note.text)
    .bind(&note.owner)
    .bind(note.at)
    .execute(&mut *db)
    .await?;
    if inserted.rows_affected() > 0 {
        return Ok(NoteTaken::Stored);
    }
    let there: String = sqlx::query_scalar("SELECT text FROM note WHERE key = $1")
        .bind(key.bytes().as_slice())
        .fetch_one(db)
        .await?;
    Ok(if there == note.text { NoteTaken::Unchanged } else { NoteTaken::Refused })
}
