//! Changes to results: storing, pinning, notes, deletion.

use std::sync::LazyLock;

use sqlx::AssertSqlSafe;
use sqlx::postgres::{PgConnection, PgRow};

use super::audit::record;
use super::transaction::{Transaction, writing};
use super::{Database, Lock, hints};
use crate::audit::{Act, Actor};
use crate::error::Error;
use crate::keep::{Answered, Changed, Editor, Finish, Removed, Source};
use crate::pins::PinQuota;
use crate::row::Columns;
use crate::search::names;
use crate::signals::Effect;
use fretwork_job::{Key, Recomputed};

/// Stores a result with its body, task and outline, unless one is stored. $16 says whether it replaces an evicted one.
/// Returns a row if it was stored.
static STORE: LazyLock<String> = LazyLock::new(|| {
    let columns: Vec<_> = names().collect();
    let values: Vec<_> = (17..17 + columns.len()).map(|place| format!("${place}")).collect();
    let changed: Vec<_> = columns.iter().map(|name| format!("{name} = excluded.{name}")).collect();
    let [columns, values, changed] = [columns.join(", "), values.join(", "), changed.join(", ")];
    format!(
        "WITH kept AS (
             INSERT INTO result AS old (key, size, stored, summary, digest, created, last_access, computed, checksum,
                 owner, job, warnings, trace, wall, cpu, program)
             VALUES ($1, $2, octet_length($3), $4, $5, $6, $6, $6, $7, $9, $10, $11, $12, $13, $14, $15)
             ON CONFLICT (key) DO UPDATE SET size = excluded.size, stored = excluded.stored,
                 summary = excluded.summary, digest = excluded.digest, last_access = excluded.last_access,
                 computed = excluded.computed, checksum = excluded.checksum, owner = excluded.owner,
                 job = excluded.job, warnings = excluded.warnings, trace = excluded.trace,
                 wall = excluded.wall, cpu = excluded.cpu, program = excluded.program, imported = NULL,
                 imported_from = NULL, deleted_by = NULL, evicted = NULL
             WHERE old.evicted IS NOT NULL AND $16
             RETURNING key, created, owner
         ), body AS (
             INSERT INTO result_blob (key, body) SELECT key, $3 FROM kept
             ON CONFLICT (key) DO UPDATE SET body = excluded.body
         ), task AS (
             INSERT INTO result_task (key, task) SELECT key, $8 FROM kept
             ON CONFLICT (key) DO UPDATE SET task = excluded.task RETURNING id, key
         ), outlined AS (
             INSERT INTO outline (id, created, size, present, owner, {columns})
             SELECT task.id, kept.created, $2, TRUE, kept.owner, {values} FROM kept JOIN task USING (key)
             ON CONFLICT (id) DO UPDATE SET size = excluded.size, present = TRUE, owner = excluded.owner, {changed}
         )
         SELECT key FROM kept"
    )
});

/// What a run found before it stored its result.
pub(super) struct Kept {
    /// Whether the key had the same result before, and whether that was still stored.
    before: Option<(bool, bool)>,
}

impl Kept {
    /// Reads the columns `same` and `held`.
    pub(super) fn read(row: &PgRow) -> Result<Self, sqlx::Error> {
        let before: (Option<bool>, Option<bool>) = (row.get("same")?, row.get("held")?);
        Ok(Self { before: before.0.zip(before.1) })
    }
}

/// Stores a result, unless one is stored; `replaces` says whether it takes the place of an evicted one. Returns whether it
/// was stored.
pub(super) async fn store(
    db: &mut PgConnection,
    answered: &Answered,
    source: &Source<'_>,
    replaces: bool,
) -> Result<bool, Error> {
    let (wall, cpu) = (
        answered.cost.map(|cost| cost.wall.as_secs_f64()),
        answered.cost.and_then(|cost| cost.cpu).map(|cpu| cpu.as_secs_f64()),
    );
    let query = sqlx::query(AssertSqlSafe(STORE.as_str()))
        .bind(source.key.bytes().as_slice())
        .bind((answered.size as u64).cast_signed())
        .bind(&**answered.body.bytes())
        .bind(&answered.summary)
        .bind(answered.digest.as_slice())
        .bind(source.now)
        .bind(answered.body.checksum())
        .bind(source.task)
        .bind(source.owner)
        .bind(source.job.map(|job| job.0.as_bytes().to_vec()))
        .bind(source.warnings)
        .bind(source.trace)
        .bind(wall)
        .bind(cpu)
        .bind(source.program)
        .bind(replaces);
    let words = answered.outline.words.iter();
    let query = words.fold(query, |query, word| query.bind(word.as_deref()));
    let scalars = answered.outline.scalars.iter();
    let query = scalars.fold(query, |query, number| query.bind(*number));
    Ok(query.fetch_optional(db).await?.is_some())
}

/// What became of the result of a run.
pub(super) async fn kept(
    tx: &mut Transaction<'_>,
    answered: &Answered,
    key: Key,
    kept: &Kept,
) -> Result<Finish, Error> {
    if let Some((same, held)) = kept.before {
        let how = match (same, held) {
            (true, _) => Recomputed::Same,
            (false, true) => Recomputed::Differs,
            (false, false) => Recomputed::Replaced,
        };
        tx.effects.push(Effect::Recomputed { key, how });
    }
    match kept.before {
        Some((true, true)) => {
            // If the stored body was damaged on the disk, this repairs it.
            sqlx::query(
                "WITH repaired AS (UPDATE result_blob SET body = $2 WHERE key = $1)
                 UPDATE result SET checksum = $3, stored = octet_length($2) WHERE key = $1",
            )
            .bind(key.bytes().as_slice())
            .bind(&**answered.body.bytes())
            .bind(answered.body.checksum())
            .execute(&mut *tx.db)
            .await?;
            Ok(Finish::Same)
        }
        Some((false, true)) => Ok(Finish::Differs),
        Some((_, false)) | None => Ok(Finish::Stored),
    }
}

impl Database {
    pub(crate) async fn pin(
        &self,
        key: &Key,
        pinned: bool,
        editor: Editor,
    ) -> Result<Changed, Error> {
        let quota = self.0.pin_quota;
        writing!(self, tx => pin(tx, key, pinned, &editor, quota).await)
    }

    pub(crate) async fn annotate(
        &self,
        key: &Key,
        text: Option<String>,
        editor: Editor,
    ) -> Result<Changed, Error> {
        writing!(self, tx => annotate(tx, key, text.as_deref(), &editor).await)
    }

    pub(crate) async fn remove(&self, key: &Key, by: Actor) -> Result<Removed, Error> {
        writing!(self, tx => remove(tx, key, &by).await)
    }
}

/// Pins a result within the quota, or unpins it.
async fn pin(
    tx: &mut Transaction<'_>,
    key: &Key,
    pinned: bool,
    editor: &Editor,
    quota: PinQuota,
) -> Result<Changed, Error> {
    // Pins of several servers are counted one after the other. Any constant number serves, if no other lock has it.
    sqlx::query("SELECT pg_advisory_xact_lock($1)")
        .bind(Lock::Pins as i64)
        .execute(&mut *tx.db)
        .await?;
    let key = key.bytes().as_slice();
    let found: Option<(bool, Option<String>, i64)> = sqlx::query_as(
        "SELECT pinned, pinned_by, stored FROM result WHERE key = $1 AND evicted IS NULL FOR NO KEY UPDATE",
    )
    .bind(key)
    .fetch_optional(&mut *tx.db)
    .await?;
    let Some((was_pinned, owner, bytes)) = found else { return Ok(Changed::NotFound) };
    if was_pinned == pinned {
        return Ok(Changed::Done);
    }
    if pinned {
        let (all, own): (i64, i64) = sqlx::query_as(
            "SELECT coalesce(sum(stored), 0)::BIGINT,
                 coalesce(sum(stored) FILTER (WHERE pinned_by = $1), 0)::BIGINT
             FROM result WHERE pinned",
        )
        .bind(&editor.owner)
        .fetch_one(&mut *tx.db)
        .await?;
        let [own, all] = [own + bytes, all + bytes].map(i64::cast_unsigned);
        if let Some(exceeded) = quota.exceeded_by(own, all) {
            return Ok(exceeded);
        }
    } else if !editor.may_change(owner.as_deref()) {
        return Ok(Changed::OtherOwner(owner));
    }
    sqlx::query("UPDATE result SET pinned = $2, pinned_by = $3 WHERE key = $1")
        .bind(key)
        .bind(pinned)
        .bind(pinned.then_some(&editor.owner))
        .execute(&mut *tx.db)
        .await?;
    Ok(Changed::Done)
}

/// Writes the note of a result, or removes it. The result may be evicted.
async fn annotate(
    tx: &mut Transaction<'_>,
    key: &Key,
    text: Option<&str>,
    editor: &Editor,
) -> Result<Changed, Error> {
    let key = key.bytes().as_slice();
    let found: Option<(Option<String>,)> = sqlx::query_as(
        "SELECT note.owner FROM result LEFT JOIN note USING (key)
         WHERE result.key = $1 FOR NO KEY UPDATE OF result",
    )
    .bind(key)
    .fetch_optional(&mut *tx.db)
    .await?;
    match found {
        None => return Ok(Changed::NotFound),
        Some((Some(owner),)) if !editor.may_change(Some(&owner)) => {
            return Ok(Changed::OtherOwner(Some(owner)));
        }
        Some(_) => {}
    }
    let change = match text {
        Some(text) => sqlx::query(
            "INSERT INTO note (key, text, owner, at) VALUES ($1, $2, $3, moment())
             ON CONFLICT (key) DO UPDATE SET text = excluded.text, owner = excluded.owner, at = excluded.at",
        )
        .bind(key)
        .bind(text)
        .bind(&editor.owner),
        None => sqlx::query("DELETE FROM note WHERE key = $1").bind(key),
    };
    change.execute(&mut *tx.db).await?;
    Ok(Changed::Done)
}

/// Deletes the body of a result. Its scenario and its jobs stay.
async fn remove(tx: &mut Transaction<'_>, key: &Key, by: &Actor) -> Result<Removed, Error> {
    let found: Option<(bool, bool, Option<String>)> = sqlx::query_as(
        "SELECT evicted IS NULL, pinned, owner FROM result WHERE key = $1 FOR NO KEY UPDATE",
    )
    .bind(key.bytes().as_slice())
    .fetch_optional(&mut *tx.db)
    .await?;
    let owner = match found {
        None => return Ok(Removed::NotFound),
        // Servers may still have it in memory.
        Some((false, ..)) => {
            hints::tell_deleted(&mut tx.db, key).await?;
            return Ok(Removed::NotFound);
        }
        Some((true, true, _)) => return Ok(Removed::Pinned),
        Some((true, false, owner)) => owner.unwrap_or_default(),
    };
    record(&mut tx.db, (by, Act::DeleteResult), &key.to_string(), &owner).await?;
    evict(tx, key.bytes(), Some(&by.name)).await?;
    hints::tell_deleted(&mut tx.db, key).await?;
    Ok(Removed::Done)
}

/// Deletes the body of a result; its scenario stays known. Names who deleted it, unless it is evicted to free space.
pub(super) async fn evict(
    tx: &mut Transaction<'_>,
    key: &[u8],
    deleted_by: Option<&str>,
) -> Result<(), Error> {
    sqlx::query(
        "WITH evicted AS (UPDATE result SET evicted = moment(), deleted_by = $2 WHERE key = $1),
             outlined AS (UPDATE outline SET present = FALSE
                 WHERE id = (SELECT id FROM result_task WHERE key = $1))
         DELETE FROM result_blob WHERE key = $1",
    )
    .bind(key)
    .bind(deleted_by)
    .execute(&mut *tx.db)
    .await?;
    Ok(())
}
