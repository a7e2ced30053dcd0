//! Evicts the least recently read results, until the bodies are within the budget.

use std::time::{Duration, Instant};

use super::transaction::Transaction;
use crate::database::{Effect, Result, Tables, sql};
use crate::results::storing;

/// Maximum number of results that one transaction evicts.
const RESULTS: i64 = 256;

/// Evicts some results if the sum of their sizes exceeds the budget. Returns that sum, the number of evicted bytes, and
/// the duration of the sum. Returns `None` if another server does maintenance.
pub(super) async fn make_room(
    budget: &i64,
    tx: &mut Transaction<'_>,
) -> Result<Option<(i64, i64, Duration)>> {
    if !tx.maintains_alone().await? {
        return Ok(None);
    }
    let started = Instant::now();
    let query = "SELECT coalesce(sum(stored), 0)::BIGINT FROM result WHERE evicted IS NULL";
    let stored: i64 = sqlx::query_scalar(query).fetch_one(tx.db.connection()).await?;
    let took = started.elapsed();
    let excess = stored - budget;
    let evicted = if excess > 0 { evict_some(tx, excess).await? } else { 0 };
    Ok(Some((stored, evicted, took)))
}

/// Evicts up to [`RESULTS`] results, until they have at least this number of bytes. Returns the number of evicted
/// bytes; 0 if no result can be evicted.
async fn evict_some(tx: &mut Transaction<'_>, bytes: i64) -> Result<i64> {
    let query = sql!(
        "SELECT key, stored FROM result WHERE NOT pinned AND evicted IS NULL
         ORDER BY last_access LIMIT $1 FOR NO KEY UPDATE SKIP LOCKED";
        RESULTS
    );
    let (oldest, now) = (tx.db.rows(query).await?, tx.now().await?);
    let mut evicted = 0;
    for row in &oldest {
        if evicted >= bytes {
            break;
        }
        storing::evict(row.get("key")?, now, None, &mut tx.db).await?;
        tx.effects.push(Effect::Evicted);
        evicted += row.get::<i64>("stored")?;
    }
    Ok(evicted)
}
