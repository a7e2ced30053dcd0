//! Claims and ends runs.
//!
//! Each statement that changes a run compares the number of the attempt. So a worker that has lost its run changes
//! nothing.

use std::sync::{Arc, LazyLock};
use std::time::Instant;

use super::queue::Queue;
use super::storing::{Reason, keeping};
use super::transaction::Transaction;
use super::{Database, chunks};
use crate::database::usage::Owners;
use crate::database::{
    Connected, Effect, Ending, MAX_LOST, Recovered, Result, RunId, Signals, Statement, Tables, sql,
};
use crate::jobs::claimed::{Claim, Claimed};
use crate::results::storing::{self, Answered, Finish, Source};
use fretwork_job::{FailureKind, Key};

impl Database {
    pub(crate) async fn recover(&self) -> Result<Recovered> {
        self.write(recover, ()).await
    }

    /// Claims the next queued run, or a piece of a study, of one of these owners. A claim costs so little that
    /// more would save nothing.
    pub(crate) async fn claim(&self, _most: usize, owners: Owners) -> Result<Vec<Claimed>> {
        let signals = Arc::clone(&self.signals);
        Ok(self.write(claim, (signals, owners)).await?.into_iter().collect())
    }
}

async fn claim(
    (signals, owners): &(Arc<Signals>, Owners),
    tx: &mut Transaction,
) -> Result<Option<Claimed>> {
    let now = Instant::now();
    let usage = |owner: &str| owners.usage_of(owner, &signals.usage, now);
    let next = tx.queue.next(usage, signals.is_settled());
    let Some((run, owner)) = next else { return Ok(None) };
    let claimed = if tx.queue.is_study(run) {
        chunks::claim(run, owner, tx).await?
    } else {
        claim_whole(run, owner, tx).await?
    };
    tx.queue.take(claimed.part(), claimed.owner.clone());
    tx.effects.push(claimed.started());
    Ok(Some(claimed))
}

async fn claim_whole(run: RunId, owner: String, tx: &mut Transaction) -> Result<Claimed> {
    let query = sql!(
        "UPDATE run SET state = 'running', attempt = attempt + 1, progress = 0, started = $2,
             changed = $2
         WHERE id = $1 AND state = 'queued' RETURNING attempt, lost, key, task, trace";
        run, tx.now
    );
    let claimed = Claimed::whole(run, owner, &tx.db.one(query).await?)?;
    tx.effects.push(Effect::Changed(claimed.key));
    Ok(claimed)
}

pub(crate) async fn progress((claim, share): &(Claim, f64), tx: &mut Transaction) -> Result<bool> {
    let Claim { part: (run, None), attempt, key } = *claim else {
        return Ok(claim.attempt_of_run(&mut tx.db).await?.is_some());
    };
    let query = sql!(
        "UPDATE run SET progress = $3 WHERE id = $1 AND attempt = $2 AND state = 'running'";
        run, attempt, *share
    );
    if tx.db.changed_by(query).await? == 0 {
        return Ok(false);
    }
    tx.effects.push(Effect::Changed(key));
    Ok(true)
}

pub(crate) async fn finish(
    (claimed, answer): &(Claimed, Answered),
    tx: &mut Transaction,
) -> Result<Finish> {
    static FINISH: LazyLock<String> = LazyLock::new(|| keeping(Reason::Run, 3));
    let Claimed { run, key, ref trace, .. } = *claimed;
    let Some(attempt) = claimed.claim().attempt_of_run(&mut tx.db).await? else {
        return Ok(Finish::Refused);
    };
    let task = claimed.task(&mut tx.db).await?;
    let (owner, job, warnings) = (None, None, None);
    let (trace, program, now) = (trace.as_deref(), Some(tx.program), tx.now);
    let source = Source { key, task: &task, owner, job, warnings, trace, program, now };
    let query = Statement::of(FINISH.as_str()).with(run).with(attempt).with_result(answer, &source);
    let Some(row) = tx.db.row(query).await? else { return Ok(Finish::Refused) };
    ended(tx, run, key, row.get("started")?, Ending::Succeeded);
    storing::kept(answer, key, &row, tx.into()).await
}

pub(crate) async fn fail(
    (claim, kind, message): &(Claim, FailureKind, String),
    tx: &mut Transaction,
) -> Result<bool> {
    let (run, _) = claim.part;
    let Some(attempt) = claim.attempt_of_run(&mut tx.db).await? else { return Ok(false) };
    let update = sql!(
        "UPDATE run SET state = 'failed', finished = $3, changed = $3, error_kind = $4, error = $5
         WHERE id = $1 AND attempt = $2 AND state = 'running' RETURNING key, started";
        run, attempt, tx.now, kind.as_str(), message
    );
    end(tx, update, run, Ending::Failed).await
}

pub(crate) async fn stopped(claim: &Claim, tx: &mut Transaction) -> Result<bool> {
    let (run, _) = claim.part;
    let update = sql!(
        "UPDATE run SET state = 'canceled', finished = $3, changed = $3
         WHERE id = $1 AND attempt = $2 AND state = 'canceling' RETURNING key, started";
        run, claim.attempt, tx.now
    );
    end(tx, update, run, Ending::Canceled).await
}

pub(crate) async fn release(claim: &Claim, tx: &mut Transaction) -> Result<bool> {
    let Claim { part: (run, number), attempt, .. } = *claim;
    if let Some(number) = number {
        return chunks::release(run, number, attempt, tx).await;
    }
    // `started` is null after the update, and a released run does not count in the durations.
    let update = sql!(
        "UPDATE run SET state = 'queued', progress = 0, started = NULL, changed = $3
         WHERE id = $1 AND attempt = $2 AND state = 'running' RETURNING key, started";
        run, attempt, tx.now
    );
    if !end(tx, update, run, Ending::Released).await? {
        return Ok(false);
    }
    let query = sql!(
        "SELECT owner, priority, id FROM job WHERE run = $1 AND finished IS NULL"; run
    );
    for row in tx.db.rows(query).await? {
        tx.queue.add(run, row.get("owner")?, row.get("priority")?, row.get("id")?);
    }
    tx.effects.push(Effect::Queued);
    Ok(true)
}

async fn recover((): &(), tx: &mut Transaction) -> Result<Recovered> {
    let query = sql!(
        "UPDATE run SET state = 'canceled', finished = $1, changed = $1
         WHERE state = 'canceling' AND finished IS NULL RETURNING key";
        tx.now
    );
    let canceled = tx.db.rows(query).await?;
    let query = sql!(
        "UPDATE run SET state = 'failed', lost = lost + 1, finished = $1, changed = $1,
             error_kind = $2, error = $3
         WHERE state = 'running' AND finished IS NULL AND (EXISTS (
             SELECT 1 FROM chunk WHERE chunk.run = run.id AND chunk.state = 'running'
                 AND chunk.state <> 'done' AND chunk.lost + 1 >= $4
         ) OR lost + 1 >= $4 AND id NOT IN (SELECT run FROM study)) RETURNING key";
        tx.now, FailureKind::WorkerLost.as_str(),
        format!("the server died {MAX_LOST} times while it computed this job"), MAX_LOST
    );
    let failed = tx.db.rows(query).await?;
    let query = sql!(
        "UPDATE run SET state = 'queued', lost = lost + 1, progress = 0, started = NULL,
             changed = $1
         WHERE state = 'running' AND finished IS NULL AND id NOT IN (SELECT run FROM study)
         RETURNING key";
        tx.now
    );
    let requeued = tx.db.rows(query).await?;
    let pieces = chunks::recover(tx).await?;
    let counts = Recovered {
        requeued: requeued.len() as u64 + pieces,
        failed: failed.len() as u64,
        canceled: canceled.len() as u64,
    };
    for (rows, ending) in
        [(canceled, Ending::Canceled), (failed, Ending::Failed), (requeued, Ending::Released)]
    {
        for row in rows {
            // No duration is recorded, because it would include the time during which the server was down.
            tx.effects.extend([Effect::Ended(row.get("key")?), Effect::Settled(ending, None)]);
        }
    }
    tx.queue = Queue::load(&mut tx.db).await?;
    tx.effects.push(Effect::Queued);
    Ok(counts)
}

/// Ends or queues a run with the statement `update`, which returns `key` and `started`. Returns false if the worker has
/// lost the run.
async fn end(tx: &mut Transaction, update: Statement, run: RunId, ending: Ending) -> Result<bool> {
    let Some(row) = tx.db.row(update).await? else { return Ok(false) };
    ended(tx, run, row.get("key")?, row.get("started")?, ending);
    Ok(true)
}

/// Tells the queue that a run has ended or was released, and adds the signals of this.
fn ended(tx: &mut Transaction, run: RunId, key: Key, started: Option<i64>, ending: Ending) {
    // The duration of a study is not recorded, because it may have waited between its pieces.
    let started = started.filter(|_| !tx.queue.is_study(run));
    match ending {
        Ending::Released => tx.queue.release((run, None)),
        _ => tx.queue.end(run),
    }
    tx.effects.push(Effect::Unwanted(run));
    tx.effects.push(Effect::Ended(key));
    tx.effects.push(Effect::Settled(ending, started.map(|started| tx.now - started)));
}
