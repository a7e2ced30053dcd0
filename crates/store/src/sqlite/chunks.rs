//! Claims and ends the pieces of a study: its chunks, and then the assembly of its result.
//!
//! The run of a study is running from its first claim to its end, even while no worker computes a piece of it. After a
//! crash or a release, only the pieces that were running are queued again.

use super::transaction::Transaction;
use crate::database::{Body, Connected, Effect, Result, RunId, Tables, sql};
use crate::jobs::claimed::{Claim, Claimed, is_step};
use fretwork_job::Cost;

/// Claims a piece of a study: the chunk that was lost; if there is none, a new chunk of this stage; if there is none, a
/// chunk that was released; if there is none, the assembly.
pub(super) async fn claim(run: RunId, owner: String, tx: &mut Transaction) -> Result<Claimed> {
    // If no piece can be claimed, the number is null. Then the constraint of the table makes this an error.
    let query = sql!(
        "INSERT INTO chunk (run, number, state, attempt)
         SELECT $1, CASE WHEN lost IS NOT NULL THEN lost WHEN next < chunks AND NOT (
                 ',' || stages || ',' LIKE '%,' || next || ',%'
                 AND EXISTS (SELECT 1 FROM chunk WHERE run = $1 AND state <> 'done')
             ) THEN next ELSE coalesce(
                 (SELECT number FROM chunk
                  WHERE run = $1 AND state = 'queued' AND state <> 'done'
                  ORDER BY number LIMIT 1),
                 (SELECT chunks WHERE next = chunks AND NOT EXISTS (
                      SELECT 1 FROM chunk WHERE run = $1 AND state <> 'done'))
             ) END, 'running', 1
         FROM (SELECT chunks, stages, coalesce((SELECT max(number) + 1 FROM chunk WHERE run = $1), 0) AS next,
                   (SELECT number FROM chunk WHERE run = $1 AND state = 'queued' AND state <> 'done' AND lost > 0
                    ORDER BY lost DESC, number LIMIT 1) AS lost
               FROM study WHERE run = $1)
         WHERE TRUE
         ON CONFLICT (run, number) DO UPDATE SET state = 'running', attempt = attempt + 1
         RETURNING number, attempt, lost";
        run
    );
    let row = tx.db.one(query).await?;
    let (number, attempt): (u32, u32) = (row.get("number")?, row.get("attempt")?);
    let lost: u32 = row.get("lost")?;
    if number == 0 {
        start(run, tx).await?;
    }
    let query = sql!(
        "SELECT $2 AS lost, key, trace, chunks, wall, cpu FROM run JOIN study ON study.run = run.id WHERE id = $1";
        run, lost
    );
    let row = tx.db.one(query).await?;
    Ok(Claimed::piece(run, owner, (number, row.get("chunks")?), attempt, &row)?)
}

/// Starts the run of a study, unless it is running.
async fn start(run: RunId, tx: &mut Transaction) -> Result<()> {
    let query = sql!(
        "UPDATE run SET state = 'running', attempt = attempt + 1, started = $2, changed = $2
         WHERE id = $1 AND state = 'queued' RETURNING key";
        run, tx.now
    );
    if let Some(row) = tx.db.row(query).await? {
        tx.effects.push(Effect::Changed(row.get("key")?));
    }
    Ok(())
}

pub(crate) async fn finish_chunk(
    (claim, body, cost): &(Claim, Body, Cost),
    tx: &mut Transaction,
) -> Result<bool> {
    let Claim { part: (run, Some(number)), attempt, .. } = *claim else { return Ok(false) };
    let update = sql!(
        "UPDATE chunk SET state = 'done', body = $4, checksum = $5
         WHERE run = $1 AND number = $2 AND attempt = $3 AND state = 'running'
             AND (SELECT state FROM run WHERE id = $1) = 'running';
         UPDATE study SET wall = wall + $6, cpu = cpu + $7 WHERE run = $1 AND changes() = 1
         RETURNING chunks, (SELECT max(number) + 1 FROM chunk WHERE chunk.run = $1)
             - (SELECT count(*) FROM chunk WHERE chunk.run = $1 AND state <> 'done') AS done";
        run, number, attempt, &**body.bytes(), body.checksum(), cost.wall.as_secs_f64(),
        cost.cpu.map(|cpu| cpu.as_secs_f64())
    );
    let Some(row) = tx.db.row(update).await? else { return Ok(false) };
    let (chunks, done) = (row.get("chunks")?, row.get("done")?);
    let more_is_ready = tx.queue.done(run, number);
    tx.effects.push(Effect::LetGo((run, Some(number))));
    if more_is_ready {
        tx.effects.push(Effect::Queued);
    }
    if is_step(done, chunks) {
        let query = sql!(
            "UPDATE run SET progress = $2 WHERE id = $1";
            run, f64::from(done) / f64::from(chunks)
        );
        tx.db.execute(query).await?;
        tx.effects.push(Effect::Changed(claim.key));
    }
    Ok(true)
}

/// Queues a running piece again. Returns false if the worker has lost it.
pub(super) async fn release(
    run: RunId,
    number: u32,
    attempt: u32,
    tx: &mut Transaction,
) -> Result<bool> {
    let query = sql!(
        "UPDATE chunk SET state = 'queued'
         WHERE run = $1 AND number = $2 AND attempt = $3 AND state = 'running'
             AND (SELECT state FROM run WHERE id = $1) = 'running'";
        run, number, attempt
    );
    if tx.db.changed_by(query).await? == 0 {
        return Ok(false);
    }
    tx.queue.release((run, Some(number)));
    tx.effects.extend([Effect::LetGo((run, Some(number))), Effect::Queued]);
    Ok(true)
}

/// Queues the pieces again that the last process left running in unfinished studies. Returns their number.
pub(super) async fn recover(tx: &mut Transaction) -> Result<u64> {
    let requeue = sql!(
        "UPDATE chunk SET state = 'queued', lost = lost + 1
         WHERE state = 'running' AND state <> 'done'
             AND run IN (SELECT id FROM run WHERE finished IS NULL)"
    );
    tx.db.changed_by(requeue).await
}
