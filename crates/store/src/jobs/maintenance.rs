//! Maintenance that both databases do with the same statements.

use crate::database::{Change, Connected, Result, RunId, Tables, sql};

/// Time in milliseconds for which the scenario of an evicted result is kept: a year.
const KEEP_EVICTED: i64 = 365 * 24 * 3600 * 1000;

/// Time in milliseconds for which the rows of a canceled study are kept: a week.
const KEEP_CANCELED: i64 = 7 * 24 * 3600 * 1000;

/// Deletes up to `most` chunks of a study that has ended, and then the study. Returns whether there may be more. A
/// canceled study keeps its chunks for a week, as long as it has a job.
pub(crate) async fn delete_chunks(most: &i64, mut tx: Change<'_>) -> Result<bool> {
    let query = sql!(
        "SELECT study.run AS run FROM study LEFT JOIN run ON run.id = study.run
         WHERE run.id IS NULL OR run.finished <= CASE WHEN run.state = 'canceled' THEN $1 ELSE run.finished END
         LIMIT 1";
        tx.now().await? - KEEP_CANCELED
    );
    let Some(ended) = tx.row(query).await? else { return Ok(false) };
    let run = RunId(ended.get("run")?);
    let query = sql!(
        "DELETE FROM chunk WHERE run = $1 AND number IN (
             SELECT number FROM chunk WHERE run = $1 ORDER BY number LIMIT $2)";
        run, *most
    );
    tx.execute(query).await?;
    let query = sql!(
        "DELETE FROM study WHERE run = $1 AND NOT EXISTS (SELECT 1 FROM chunk WHERE chunk.run = $1)"; run
    );
    tx.execute(query).await?;
    Ok(true)
}

/// Deletes the scenarios of results that were evicted more than a year before this time and have no jobs.
pub(crate) async fn forget_evicted(time: &i64, mut tx: Change<'_>) -> Result<()> {
    // Only the oldest 1000 are examined, so that many results with jobs do not slow every round. Newer results are
    // examined after the jobs of older ones were deleted.
    let query = sql!(
        "DELETE FROM result WHERE key IN (
             SELECT key FROM (
                 SELECT key FROM result WHERE evicted < $1 ORDER BY evicted LIMIT 1000
             ) AS old
             WHERE NOT EXISTS (SELECT 1 FROM job WHERE job.key = old.key) LIMIT 100
         )";
        time - KEEP_EVICTED
    );
    tx.execute(query).await
}
