//! How workers claim and end the pieces of a study: its chunks, and then the assembly of its result.
//!
//! The run of a study is running from its first claim to its end, even while no worker computes a piece of it. A crash or a
//! release queues only the pieces again that were running.

use super::Database;
use super::transaction::Transaction;
use crate::body::Body;
use crate::claimed::{Claim, Claimed, FinishedChunk, Piece, cost, is_step};
use crate::error::Error;
use crate::row::{Columns, RunId, Sum, key};
use crate::signals::{Effect, Stop};

impl Database {
    pub(crate) async fn finish_chunk(&self, finished: FinishedChunk) -> Result<bool, Error> {
        self.write(finish_chunk, finished).await
    }

    pub(crate) async fn chunk(
        &self,
        run: RunId,
        number: u32,
    ) -> Result<Option<(Body, Sum)>, Error> {
        let query = sqlx::query(
            "SELECT body, checksum FROM chunk WHERE run = ?1 AND number = ?2 AND state = 'done'",
        );
        let query = query.bind(run.0).bind(number);
        let row = self.reading(async |db| Ok(query.fetch_optional(db).await?)).await?;
        let Some(row) = row else { return Ok(None) };
        Ok(Some((Body::stored(row.get("body")?), Sum::Check(row.get("checksum")?))))
    }

    pub(crate) async fn task(&self, claimed: &Claimed) -> Result<Option<String>, Error> {
        let query = sqlx::query_scalar("SELECT task FROM run WHERE id = ?1 AND finished IS NULL");
        let query = query.bind(claimed.run.0);
        self.reading(async |db| Ok(query.fetch_optional(db).await?)).await
    }
}

/// Claims a piece of a study: a new chunk; otherwise one that was released or lost; otherwise the assembly. So a chunk that
/// may have caused a crash is computed last.
pub(super) async fn claim(run: RunId, tx: &mut Transaction) -> Result<Claimed, Error> {
    // If no piece can be claimed, the number is null, which the table refuses.
    let row = sqlx::query(
        "INSERT INTO chunk (run, number, state, attempt)
         SELECT ?1, CASE WHEN next < chunks THEN next ELSE coalesce(
                 (SELECT number FROM chunk
                  WHERE run = ?1 AND state = 'queued' AND state <> 'done'
                  ORDER BY lost, number LIMIT 1),
                 (SELECT chunks WHERE next = chunks AND NOT EXISTS (
                      SELECT 1 FROM chunk WHERE run = ?1 AND state <> 'done'))
             ) END, 'running', 1
         FROM (SELECT chunks, coalesce((SELECT max(number) + 1 FROM chunk WHERE run = ?1), 0) AS next
               FROM study WHERE run = ?1)
         WHERE TRUE
         ON CONFLICT (run, number) DO UPDATE SET state = 'running', attempt = attempt + 1
         RETURNING number, attempt",
    )
    .bind(run.0)
    .fetch_one(&mut tx.db)
    .await?;
    let (number, attempt): (u32, u32) = (row.get("number")?, row.get("attempt")?);
    if number == 0 {
        start(run, tx).await?;
    }
    let row = sqlx::query(
        "SELECT key, trace, chunks, wall, cpu FROM run JOIN study ON study.run = run.id WHERE id = ?1",
    )
    .bind(run.0)
    .fetch_one(&mut tx.db)
    .await?;
    let of = row.get("chunks")?;
    let piece = if number == of { Piece::Assembly { of } } else { Piece::Chunk { number, of } };
    let spent = cost(&row)?;
    let (key, trace, stop) = (key(&row, "key")?, row.get("trace")?, Stop::default());
    Ok(Claimed { run, attempt, key, piece, spent, trace, stop })
}

/// Starts the run of a study, unless it is running.
async fn start(run: RunId, tx: &mut Transaction) -> Result<(), Error> {
    let row = sqlx::query(
        "UPDATE run SET state = 'running', attempt = attempt + 1, started = ?2, changed = ?2
         WHERE id = ?1 AND state = 'queued' RETURNING key",
    )
    .bind(run.0)
    .bind(tx.now)
    .fetch_optional(&mut tx.db)
    .await?;
    if let Some(row) = row {
        tx.effects.push(Effect::Changed(key(&row, "key")?));
    }
    Ok(())
}

async fn finish_chunk(
    FinishedChunk { claim, body, cost }: &FinishedChunk,
    tx: &mut Transaction,
) -> Result<bool, Error> {
    let Claim { part: (run, Some(number)), attempt } = *claim else { return Ok(false) };
    let counts: Option<(u32, u32)> = sqlx::query_as(
        "UPDATE chunk SET state = 'done', body = $4, checksum = $5
         WHERE run = $1 AND number = $2 AND attempt = $3 AND state = 'running'
             AND (SELECT state FROM run WHERE id = $1) = 'running';
         UPDATE study SET wall = wall + $6, cpu = cpu + $7 WHERE run = $1 AND changes() = 1
         RETURNING chunks, (SELECT max(number) + 1 FROM chunk WHERE chunk.run = $1)
             - (SELECT count(*) FROM chunk WHERE chunk.run = $1 AND state <> 'done')",
    )
    .bind(run.0)
    .bind(number)
    .bind(attempt)
    .bind(&**body.bytes())
    .bind(body.checksum())
    .bind(cost.wall.as_secs_f64())
    .bind(cost.cpu.map(|cpu| cpu.as_secs_f64()))
    .fetch_optional(&mut tx.db)
    .await?;
    let Some((chunks, done)) = counts else { return Ok(false) };
    sqlx::query("UPDATE run SET lost = 0 WHERE id = ?1 AND lost > 0")
        .bind(run.0)
        .execute(&mut tx.db)
        .await?;
    tx.queue.done(run, number);
    tx.effects.push(Effect::LetGo((run, Some(number))));
    if done == chunks {
        tx.effects.push(Effect::Queued);
    }
    if is_step(done, chunks) {
        let row = sqlx::query("UPDATE run SET progress = ?2 WHERE id = ?1 RETURNING key")
            .bind(run.0)
            .bind(f64::from(done) / f64::from(chunks))
            .fetch_one(&mut tx.db)
            .await?;
        tx.effects.push(Effect::Changed(key(&row, "key")?));
    }
    Ok(true)
}

/// Queues a running piece again. Returns false if the worker has lost it.
pub(super) async fn release(
    run: RunId,
    number: u32,
    attempt: u32,
    tx: &mut Transaction,
) -> Result<bool, Error> {
    let released = sqlx::query(
        "UPDATE chunk SET state = 'queued'
         WHERE run = ?1 AND number = ?2 AND attempt = ?3 AND state = 'running'
             AND (SELECT state FROM run WHERE id = ?1) = 'running'",
    )
    .bind(run.0)
    .bind(number)
    .bind(attempt)
    .execute(&mut tx.db)
    .await?;
    if released.rows_affected() == 0 {
        return Ok(false);
    }
    tx.queue.release(run, number);
    tx.effects.extend([Effect::LetGo((run, Some(number))), Effect::Queued]);
    Ok(true)
}

/// Queues the pieces again that the last process left running in unfinished studies. Returns their number.
pub(super) async fn recover(tx: &mut Transaction) -> Result<u64, Error> {
    // A study is lost too, until another of its chunks is finished. So one that crashes the process in any chunk ends.
    sqlx::query(
        "UPDATE run SET lost = lost + 1 WHERE finished IS NULL AND id IN (
             SELECT run FROM chunk WHERE state = 'running' AND state <> 'done')",
    )
    .execute(&mut tx.db)
    .await?;
    let requeued = sqlx::query(
        "UPDATE chunk SET state = 'queued', lost = lost + 1
         WHERE state = 'running' AND state <> 'done'
             AND run IN (SELECT id FROM run WHERE finished IS NULL)",
    );
    Ok(requeued.execute(&mut tx.db).await?.rows_affected())
}
