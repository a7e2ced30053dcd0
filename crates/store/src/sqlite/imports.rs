//! Stores results of other servers.

use sqlx::{Connection as _, SqliteConnection};

use super::keep;
use crate::error::Error;
use crate::imports::{BEFORE, Before, Import, NoteTaken};
use crate::keep::Source;
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
    let note = annotate(&mut tx, import).await?;
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
        "UPDATE result SET imported = ?2, imported_from = ?3, computed = ?4 WHERE key = ?1",
    )
    .bind(key.bytes().as_slice())
    .bind(now)
    .bind(import.file)
    .bind(import.computed)
    .execute(db)
    .await?;
    Ok(())
}

/// Stores the note, unless the result already has a note.
async fn annotate(db: &mut SqliteConnection, import: &Import<'_>) -> Result<NoteTaken, Error> {
    let Some(note) = import.note else { return Ok(NoteTaken::Unchanged) };
    let there: Option<String> = sqlx::query_scalar("SELECT text FROM note WHERE key = ?1")
        .bind(import.key.bytes().as_slice())
        .fetch_optional(&mut *db)
        .await?;
    match there {
        Some(there) if there == note.text => return Ok(NoteTaken::Unchanged),
        Some(_) => return Ok(NoteTaken::Refused),
        None => {}
    }
    sqlx::query("INSERT INTO note (key, text, owner, at) VALUES (?1, ?2, ?3, ?4)")
        .bind(import.key.bytes().as_slice())
        .bind(&note.text)
        .bind(&note.owner)
        .bind(note.at)
        .execute(db)
        .await?;
    Ok(NoteTaken::Stored)
}
