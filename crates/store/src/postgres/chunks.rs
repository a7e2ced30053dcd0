//! Claims and ends the pieces of a study: its chunks, and then the assembly of its result.
//!
//! A lock on the row of the study protects all its pieces. The row contains the number of pieces in each state, so that
//! no verb counts rows.

use super::follow::follow;
use super::lease;
use super::queue::Waiting;
use super::transaction::Transaction;
use crate::database::caution::{Caution, Verdict};
use crate::database::{Body, Connected, Effect, Result, Row, RunId, Tables, read, sql};
use crate::jobs::claimed::{Claim, Claimed, Stages, Study, is_step};
use fretwork_job::Cost;

/// Locks a study until the end of the transaction. Returns `None` if the run is no study.
pub(super) async fn lock(tx: &mut Transaction<'_>, run: RunId) -> Result<Option<Study>> {
    let query = sql!(
        "SELECT chunks, next, queued, running, stages FROM study WHERE run = $1 FOR NO KEY UPDATE";
        run
    );
    let Some(row) = tx.db.row(query).await? else { return Ok(None) };
    let stages = Stages::read(row.get("stages")?);
    Ok(Some(read!(row => Study { chunks, next, queued, running; stages })))
}

/// Stores the numbers of pieces of a locked study. The jobs of a study are in the queue while a worker can claim a
/// piece of it.
async fn store(
    tx: &mut Transaction<'_>,
    run: RunId,
    (before, after): (&Study, &Study),
) -> Result<()> {
    let query = sql!(
        "UPDATE study SET next = $2, queued = $3, running = $4, done = $5 WHERE run = $1";
        run, after.next, after.queued, after.running, after.done()
    );
    tx.db.execute(query).await?;
    if before.is_ready() != after.is_ready() {
        let query = sql!(
            "UPDATE job SET claimable = CASE WHEN $2 THEN run.numerics END
             FROM run WHERE run.id = $1 AND job.run = $1 AND job.finished IS NULL";
            run, after.is_ready()
        );
        tx.db.execute(query).await?;
    }
    Ok(())
}

/// Claims a piece of a study: a chunk that was lost; if there is none, a new chunk; if there is none, a chunk that was
/// released; if there is none, the assembly. Returns `None` if no piece can be claimed.
pub(super) async fn claim(
    tx: &mut Transaction<'_>,
    run: RunId,
    waiting: &mut Waiting,
    caution: Caution,
) -> Result<Option<Claimed>> {
    let Some(before) = lock(tx, run).await?.filter(Study::is_ready) else {
        return Ok(None);
    };
    let query = sql!(
        "SELECT state, key, trace, wall, cpu, (
             SELECT number FROM chunk WHERE chunk.run = $1 AND chunk.state = 'queued'
             ORDER BY chunk.lost DESC, number LIMIT 1) AS waiting,
             coalesce((SELECT max(lost) FROM chunk WHERE chunk.run = $1 AND chunk.state = 'queued'), 0) AS lost
         FROM run JOIN study ON study.run = run.id
         WHERE run.id = $1 AND state <> 'canceling' AND finished IS NULL";
        run
    );
    let Some(row) = tx.db.row(query).await? else { return Ok(None) };
    let lost = row.get("lost")?;
    let verdict = caution.on(lost);
    if verdict != Verdict::Claims {
        waiting.must_wait = verdict == Verdict::Waits;
        return Ok(None);
    }
    let mut after = before.clone();
    let number = match row.get("waiting")? {
        Some(queued) if lost > 0 || before.next >= before.chunks || !before.is_next_ready() => {
            after.queued -= 1;
            queued
        }
        _ => {
            after.next += 1;
            before.next
        }
    };
    after.running += 1;
    let query = sql!(
        "INSERT INTO chunk (run, number, state, attempt, lost) VALUES ($1, $2, 'running', 1, 1)
         ON CONFLICT (run, number) DO UPDATE
         SET state = 'running', attempt = chunk.attempt + 1, lost = chunk.lost + 1 RETURNING attempt";
        run, number
    );
    let attempt = tx.db.one(query).await?;
    if row.value("state")? == Some("queued") {
        start(tx, run).await?;
        tx.effects.push(Effect::Changed(row.get("key")?));
    }
    store(tx, run, (&before, &after)).await?;
    Ok(Some(Claimed::piece(
        run,
        waiting.owner.clone(),
        (number, before.chunks),
        attempt.get("attempt")?,
        &row,
    )?))
}

/// Starts the run of a study.
async fn start(tx: &mut Transaction<'_>, run: RunId) -> Result<()> {
    let query = sql!(
        "UPDATE run SET state = 'running', attempt = attempt + 1, started = moment(), changed = moment()
         WHERE id = $1 AND state NOT IN ('running', 'canceling') AND finished IS NULL";
        run
    );
    tx.db.execute(query).await?;
    follow(tx, &[run.0]).await
}

pub(crate) async fn finish_chunk(
    (claim, body, cost): &(Claim, Body, Cost),
    tx: &mut Transaction<'_>,
) -> Result<bool> {
    let Claim { part: (run, Some(number)), attempt, .. } = *claim else { return Ok(false) };
    let Some(before) = lock(tx, run).await? else { return Ok(false) };
    let query = sql!(
        "UPDATE chunk SET state = 'done', body = $4, checksum = $5
         FROM run WHERE chunk.run = $1 AND number = $2 AND chunk.attempt = $3
             AND chunk.state = 'running' AND run.id = $1 AND run.state NOT IN ('queued', 'canceling')
                 AND run.finished IS NULL";
        run, number, attempt, &**body.bytes(), body.checksum()
    );
    if tx.db.changed_by(query).await? == 0 {
        return Ok(false);
    }
    let after = Study { running: before.running - 1, ..before.clone() };
    let query = sql!(
        "UPDATE study SET wall = wall + $2, cpu = cpu + $3 WHERE run = $1";
        run, cost.wall.as_secs_f64(), cost.cpu.map(|cpu| cpu.as_secs_f64())
    );
    tx.db.execute(query).await?;
    store(tx, run, (&before, &after)).await?;
    lease::end(tx, claim.part).await?;
    tx.effects.push(Effect::LetGo(claim.part));
    if after.is_ready() && !before.is_ready() {
        tx.effects.push(Effect::Queued);
    }
    if is_step(after.done(), after.chunks) {
        tx.effects.push(Effect::Changed(claim.key));
    }
    Ok(true)
}

/// Queues a running piece again. Returns false if the worker has lost it.
pub(super) async fn release(
    tx: &mut Transaction<'_>,
    run: RunId,
    number: u32,
    attempt: u32,
) -> Result<bool> {
    let Some(before) = lock(tx, run).await? else { return Ok(false) };
    let query = sql!(
        "UPDATE chunk SET state = 'queued', lost = lost - 1
         WHERE run = $1 AND number = $2 AND attempt = $3 AND state = 'running'
             AND (SELECT state FROM run WHERE id = $1) = 'running'";
        run, number, attempt
    );
    if tx.db.changed_by(query).await? == 0 {
        return Ok(false);
    }
    let after = Study { running: before.running - 1, queued: before.queued + 1, ..before.clone() };
    store(tx, run, (&before, &after)).await?;
    lease::end(tx, (run, Some(number))).await?;
    tx.effects.push(Effect::Queued);
    Ok(true)
}

/// Queues pieces again after their leases expired. Returns how often one of these pieces was lost.
pub(super) async fn lose(
    tx: &mut Transaction<'_>,
    run: RunId,
    before: &Study,
    pieces: &[i64],
) -> Result<u32> {
    let lost = sqlx::query(
        "WITH requeued AS (
             UPDATE chunk SET state = 'queued' WHERE run = $1 AND number = ANY ($2) AND state = 'running'
             RETURNING lost)
         SELECT count(*) AS pieces, coalesce(max(lost), 0) AS most FROM requeued",
    );
    let lost = lost.bind(run.0).bind(pieces).fetch_one(tx.db.connection()).await?;
    let lost = Row::Postgres(lost);
    let pieces: u32 = lost.get("pieces")?;
    let after = Study {
        running: before.running - pieces,
        queued: before.queued + pieces,
        ..before.clone()
    };
    store(tx, run, (before, &after)).await?;
    Ok(lost.get("most")?)
}
