//! Makes room when the database exceeds its budget: deletes the finished jobs, results and scenarios of evicted results
//! that were used longest ago.

use sqlx::SqliteConnection;

use super::transaction::Transaction;
use crate::database::{Connected, Effect, Result, Statement, Tables, sql};
use crate::jobs::cancel::delete_job;

/// Maximum number of rows that one transaction deletes to free space: twice as many as one transaction adds.
pub(super) const ROOM: usize = 512;
/// Maximum number of rows that one query for the oldest rows returns.
const OLDEST: i64 = 64;

/// The outcome of [`make_room`].
pub(super) struct Room {
    /// Bytes that the database uses now.
    pub(super) used: u64,
    /// The number of jobs, results and scenarios that it deleted.
    pub(super) deleted: usize,
}

/// Deletes the rows of [`oldest`] until the database is within its budget, but at most `rows` rows. Pinned results,
/// unfinished jobs and chunks of unfinished studies stay.
///
/// With `leave_bodies`, it evicts results without deleting their bodies. The caller sets it if damaged pages prevent
/// the deletion of a body.
pub(super) async fn make_room(
    (budget, rows, leave_bodies): &(u64, usize, bool),
    tx: &mut Transaction,
) -> Result<Room> {
    let mut room = Room { used: used(&mut tx.db).await?, deleted: 0 };
    while room.used > *budget && room.deleted < *rows {
        let oldest = tx.db.rows(oldest()).await?;
        if oldest.is_empty() {
            break;
        }
        for row in &oldest {
            if room.used <= *budget || room.deleted == *rows {
                break;
            }
            let (kind, id): (&str, &[u8]) = (row.get("kind")?, row.get("id")?);
            match kind {
                "job" => delete_job(id, &mut tx.db).await?,
                "result" => evict(id, *leave_bodies, tx).await?,
                // The scenario of an evicted result.
                _ => tx.db.execute(sql!("DELETE FROM result WHERE key = $1"; id)).await?,
            }
            room.deleted += 1;
            room.used = used(&mut tx.db).await?;
        }
    }
    Ok(room)
}

/// The number of bytes of all used pages of the database: results, jobs, scenarios and indexes.
async fn used(db: &mut SqliteConnection) -> Result<u64> {
    let query = sqlx::query_scalar(
        "SELECT (page_count - freelist_count) * page_size
         FROM pragma_page_count, pragma_freelist_count, pragma_page_size",
    );
    Ok(query.fetch_one(db).await?)
}

/// The statement that reads the jobs, results and scenarios that were used longest ago, the oldest first. A job counts
/// as used when it ended, a result when it was last read, and a scenario when its result was evicted. A scenario with
/// jobs, or with a damaged body that could not be deleted, is left out. Only the oldest 1000 scenarios are examined, so
/// that many scenarios with jobs do not slow every call.
pub(super) fn oldest() -> Statement {
    sql!(
        "SELECT * FROM (
             SELECT 'job' AS kind, id, finished AS used FROM job
             WHERE finished IS NOT NULL ORDER BY id LIMIT $1)
         UNION ALL SELECT * FROM (
             SELECT 'result', key, last_access FROM result INDEXED BY result_unread
             WHERE NOT pinned AND evicted IS NULL ORDER BY last_access LIMIT $1)
         UNION ALL SELECT * FROM (
             SELECT 'scenario', key, evicted FROM (
                 SELECT key, evicted FROM result INDEXED BY result_evicted
                 WHERE evicted IS NOT NULL AND NOT pinned
                     AND NOT EXISTS (SELECT 1 FROM result_blob WHERE result_blob.key = result.key)
                 ORDER BY evicted LIMIT 1000) AS old
             WHERE NOT EXISTS (SELECT 1 FROM job WHERE job.key = old.key)
             ORDER BY evicted LIMIT $1)
         ORDER BY used LIMIT $1";
        OLDEST
    )
}

/// Evicts a result: deletes its body unless `leave_body`, and keeps its scenario.
async fn evict(key: &[u8], leave_body: bool, tx: &mut Transaction) -> Result<()> {
    tx.db.execute(sql!("UPDATE result SET evicted = $2 WHERE key = $1"; key, tx.now)).await?;
    if !leave_body {
        tx.db.execute(sql!("DELETE FROM result_blob WHERE key = $1"; key)).await?;
    }
    tx.effects.push(Effect::Evicted);
    Ok(())
}

/// The number of bytes of the stored bodies.
pub(super) async fn stored((): &(), tx: &mut Transaction) -> Result<i64> {
    Ok(sqlx::query_scalar("SELECT used FROM room").fetch_one(&mut tx.db).await?)
}
