//! Stores results of other servers.

use sqlx::Connection as _;
use sqlx::postgres::PgConnection;

use super::keep;
use crate::error::Error;
use crate::imports::{BEFORE, Before, Import, NoteTaken};
use crate::keep::Source;
use crate::library::Note;
use fretwork_job::Key;

pub(crate) async fn before(
    db: &mut PgConnection,
    key: &Key,
    digest: &[u8],
) -> Result<Before, Error> {
    let query = sqlx::query(BEFORE).bind(key.bytes().as_slice()).bind(digest);
    Ok(Before::read(query.fetch_optional(db).await?.as_ref())?)
}

pub(crate) async fn import(
    db: &mut PgConnection,
    import: &Import<'_>,
) -> Result<(Before, NoteTaken), Error> {
    let mut tx = db.begin().await?;
    let mut found = before(&mut tx, &import.key, &import.answer.digest).await?;
    if found == Before::Nothing && !insert(&mut tx, import).await? {
        // A server has stored the result meanwhile.
        found = before(&mut tx, &import.key, &import.answer.digest).await?;
    }
    if found.refusal().is_some() {
        return Ok((found, NoteTaken::Unchanged));
    }
    let note = annotate(&mut tx, &import.key, import.note).await?;
    tx.commit().await?;
    Ok((found, note))
}

/// Returns whether the result was stored.
async fn insert(db: &mut PgConnection, import: &Import<'_>) -> Result<bool, Error> {
    let Import { key, task, owner, warnings, .. } = *import;
    let program = match import.program {
        Some(program) => Some(program.id(db).await?),
        None => None,
    };
    let now = sqlx::query_scalar("SELECT moment()").fetch_one(&mut *db).await?;
    let (job, trace) = (None, None);
    let source = Source { key, task, owner, job, warnings, trace, program, now };
    if !keep::store(db, import.answer, &source, true).await? {
        return Ok(false);
    }
    sqlx::query(
        "UPDATE result SET imported = moment(), imported_from = $2, computed = $3, verified = $4 WHERE key = $1",
    )
    .bind(key.bytes().as_slice())
    .bind(import.file)
    .bind(import.computed)
    .bind(import.verified.to_string())
    .execute(db)
    .await?;
    Ok(true)
}

/// Stores the note, unless the result already has a note.
pub(crate) async fn annotate(
    db: &mut PgConnection,
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
