//! Changes to results: storing, pinning, notes, deletion.

use std::array;
use std::sync::{Arc, LazyLock};

use sqlx::sqlite::SqliteRow;
use sqlx::{AssertSqlSafe, SqliteConnection};

use super::audit::record;
use super::outline::{self, Statement};
use super::transaction::Transaction;
use crate::audit::{Act, Actor};
use crate::error::Error;
use crate::keep::{Answered, Changed, Editor, Finish, Reason, Removed, Source};
use crate::pins::PinQuota;
use crate::row::Columns;
use crate::signals::Effect;
use fretwork_job::{Key, Recomputed};

/// What the statements for [`Reason::Run`] did.
pub(super) struct Kept {
    /// When the run began that is now ended; `None` if the worker has lost it.
    pub(super) started: Option<i64>,
    /// Whether the key had the same result before, and whether that was still stored.
    before: Option<(bool, bool)>,
}

/// The statements that store a result. The parameters of [`bind`] are those from `first` on.
///
/// They are sent to the database together, because each call takes longer than a statement. `changes()` is the number of
/// rows that the statement before has changed. So a result is stored only if its run was ended, and one that is stored
/// already stays. After the last statement it is 1 if the result was stored.
pub(super) fn keeping(reason: Reason, first: usize) -> Arc<str> {
    let p = |place: usize| format!("${}", first + place);
    let [attempt, now, key, digest, body, size, summary, sum] = array::from_fn(p);
    let [task, owner, job, warnings, trace, wall, cpu, program] =
        array::from_fn(|place| p(8 + place));
    let outline =
        outline::insert(&format!("WHERE changes() = 1 AND result.key = {key}"), first + 16);
    let end = format!(
        "UPDATE run SET state = 'succeeded', progress = 1, finished = {now}, changed = {now},
             recomputed = (SELECT CASE WHEN digest = {digest} THEN 'same' WHEN evicted IS NULL THEN 'differs'
                 ELSE 'replaced' END FROM result WHERE result.key = run.key)
         WHERE id = $1 AND attempt = {attempt} AND state = 'running'
         RETURNING started, (SELECT digest = {digest} FROM result WHERE result.key = run.key) AS same,
             (SELECT evicted IS NULL FROM result WHERE result.key = run.key) AS held;"
    );
    let of_run = |column: &str| format!("(SELECT {column} FROM run WHERE id = $1)");
    let first_job = "(SELECT min(id) FROM job WHERE run = $1)".to_owned();
    let (end, ended, owner, job, warnings) = match reason {
        Reason::Run => (end, "changes() = 1", of_run("owner"), first_job, of_run("warnings")),
        Reason::Job | Reason::Import => (String::new(), "TRUE", owner, job, warnings),
    };
    let replaces = if reason == Reason::Job { "FALSE" } else { "evicted IS NOT NULL" };
    format!(
        "{end}
         INSERT INTO result (key, size, stored, summary, digest, created, last_access, computed, checksum,
             owner, job, warnings, trace, wall, cpu, program)
         SELECT {key}, {size}, length({body}), {summary}, {digest}, {now}, {now}, {now}, {sum}, {owner},
             {job}, {warnings}, {trace}, {wall}, {cpu}, {program}
         WHERE {ended}
         ON CONFLICT (key) DO UPDATE SET size = excluded.size, stored = excluded.stored,
             summary = excluded.summary, digest = excluded.digest, last_access = excluded.last_access,
             computed = excluded.computed, checksum = excluded.checksum, owner = excluded.owner,
             job = excluded.job, warnings = excluded.warnings, trace = excluded.trace,
             wall = excluded.wall, cpu = excluded.cpu, program = excluded.program, imported = NULL,
             imported_from = NULL, deleted_by = NULL, evicted = NULL
         WHERE {replaces};
         INSERT OR REPLACE INTO result_blob (key, body) SELECT {key}, {body} WHERE changes() = 1;
         INSERT INTO result_task (key, task) SELECT {key}, {task} WHERE changes() = 1
         ON CONFLICT (key) DO UPDATE SET task = excluded.task;
         {outline}"
    )
    .into()
}

/// Stores a result without a run.
static IMPORT: LazyLock<Arc<str>> = LazyLock::new(|| keeping(Reason::Import, 1));

/// Adds the parameters of [`keeping`] to a statement.
pub(super) fn bind<'q>(
    answered: &'q Answered,
    query: Statement<'q>,
    source: &Source<'q>,
) -> Statement<'q> {
    let query = query
        .bind(source.attempt)
        .bind(source.now)
        .bind(source.key.bytes().to_vec())
        .bind(answered.digest.as_slice())
        .bind(&**answered.body.bytes())
        .bind((answered.size as u64).cast_signed())
        .bind(&answered.summary)
        .bind(answered.body.checksum())
        .bind(source.task)
        .bind(source.owner)
        .bind(source.job.map(|job| job.0.as_bytes().to_vec()))
        .bind(source.warnings)
        .bind(source.trace)
        .bind(answered.cost.map(|cost| cost.wall.as_secs_f64()))
        .bind(answered.cost.and_then(|cost| cost.cpu).map(|cpu| cpu.as_secs_f64()))
        .bind(source.program);
    outline::bind(query, &answered.outline)
}

/// Stores an imported result, unless one with the same key is stored.
pub(super) async fn import(
    answered: &Answered,
    db: &mut SqliteConnection,
    source: &Source<'_>,
) -> Result<(), Error> {
    let query = sqlx::query(AssertSqlSafe(Arc::clone(&IMPORT)));
    bind(answered, query, source).execute(db).await?;
    Ok(())
}

/// What became of the result, after [`keeping`]. The digest is compared with that of a stored or evicted result of
/// the key.
pub(super) async fn kept(
    answered: &Answered,
    tx: &mut Transaction,
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
                "UPDATE result_blob SET body = $2 WHERE key = $1;
                 UPDATE result SET checksum = $3, stored = length($2) WHERE key = $1",
            )
            .bind(key.bytes().as_slice())
            .bind(&**answered.body.bytes())
            .bind(answered.body.checksum())
            .execute(&mut tx.db)
            .await?;
            Ok(Finish::Same)
        }
        Some((false, true)) => Ok(Finish::Differs),
        Some((_, false)) | None => Ok(Finish::Stored),
    }
}

impl Kept {
    /// Reads what the statements have returned.
    pub(super) fn read(rows: &[SqliteRow]) -> Result<Self, sqlx::Error> {
        let Some(row) = rows.first() else { return Ok(Self { started: None, before: None }) };
        let before: (Option<bool>, Option<bool>) = (row.get("same")?, row.get("held")?);
        Ok(Self { started: row.get("started")?, before: before.0.zip(before.1) })
    }
}

/// Pins a result within the quota, or unpins it.
pub(super) async fn pin(
    (key, pinned, editor, quota): &(Key, bool, Editor, PinQuota),
    tx: &mut Transaction,
) -> Result<Changed, Error> {
    let key = key.bytes().as_slice();
    let found: Option<(bool, Option<String>, u64)> = sqlx::query_as(
        "SELECT pinned, pinned_by, stored FROM result WHERE key = ?1 AND evicted IS NULL",
    )
    .bind(key)
    .fetch_optional(&mut tx.db)
    .await?;
    let Some((was_pinned, owner, bytes)) = found else { return Ok(Changed::NotFound) };
    if was_pinned == *pinned {
        return Ok(Changed::Done);
    }
    if *pinned {
        let (all, own): (u64, u64) = sqlx::query_as(
            "SELECT coalesce(sum(stored), 0), coalesce(sum(stored) FILTER (WHERE pinned_by = ?1), 0)
             FROM result INDEXED BY result_pinned_by WHERE pinned",
        )
        .bind(&editor.owner)
        .fetch_one(&mut tx.db)
        .await?;
        if let Some(exceeded) = quota.exceeded_by(own + bytes, all + bytes) {
            return Ok(exceeded);
        }
    } else if !editor.may_change(owner.as_deref()) {
        return Ok(Changed::OtherOwner(owner));
    }
    sqlx::query("UPDATE result SET pinned = ?2, pinned_by = ?3 WHERE key = ?1")
        .bind(key)
        .bind(pinned)
        .bind(pinned.then_some(&editor.owner))
        .execute(&mut tx.db)
        .await?;
    Ok(Changed::Done)
}

/// Writes the note of a result, or removes it. The result may be evicted.
pub(super) async fn annotate(
    (key, text, editor): &(Key, Option<String>, Editor),
    tx: &mut Transaction,
) -> Result<Changed, Error> {
    let key = key.bytes().as_slice();
    let found: Option<(Option<String>,)> = sqlx::query_as(
        "SELECT note.owner FROM result LEFT JOIN note USING (key) WHERE result.key = ?1",
    )
    .bind(key)
    .fetch_optional(&mut tx.db)
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
            "INSERT OR REPLACE INTO note (key, text, owner, at) VALUES (?1, ?2, ?3, ?4)",
        )
        .bind(key)
        .bind(text)
        .bind(&editor.owner)
        .bind(tx.now),
        None => sqlx::query("DELETE FROM note WHERE key = ?1").bind(key),
    };
    change.execute(&mut tx.db).await?;
    Ok(Changed::Done)
}

/// Deletes the body of a result. Its scenario and its jobs stay.
pub(super) async fn remove(
    (key, by): &(Key, Actor),
    tx: &mut Transaction,
) -> Result<Removed, Error> {
    let (name, key) = (key.to_string(), key.bytes().as_slice());
    let found: Option<(bool, bool, Option<String>)> =
        sqlx::query_as("SELECT evicted IS NULL, pinned, owner FROM result WHERE key = ?1")
            .bind(key)
            .fetch_optional(&mut tx.db)
            .await?;
    let owner = match found {
        None | Some((false, ..)) => return Ok(Removed::NotFound),
        Some((true, true, _)) => return Ok(Removed::Pinned),
        Some((true, false, owner)) => owner.unwrap_or_default(),
    };
    record(&mut tx.db, tx.now, (by, Act::DeleteResult), &name, &owner).await?;
    sqlx::query(
        "UPDATE result SET evicted = ?2, deleted_by = ?3 WHERE key = ?1;
         DELETE FROM result_blob WHERE key = ?1",
    )
    .bind(key)
    .bind(tx.now)
    .bind(&by.name)
    .execute(&mut tx.db)
    .await?;
    Ok(Removed::Done)
}
