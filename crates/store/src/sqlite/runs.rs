//! How workers claim and end runs.
//!
//! Each change names the run and the attempt. So a worker that has lost its run changes nothing.

use std::borrow::Cow;
use std::sync::{Arc, LazyLock};

use sqlx::query::Query;
use sqlx::sqlite::{SqliteArguments, SqliteRow};
use sqlx::{AssertSqlSafe, Sqlite};

use super::Database;
use super::chunks;
use super::keep::{self, Kept, keeping};
use super::queue::Queue;
use super::transaction::Transaction;
use crate::claimed::{Claim, Claimed, Piece};
use crate::error::Error;
use crate::keep::{Answered, Finish, Reason, Source};
use crate::options::{MAX_LOST, Recovered};
use crate::row::{Columns, RunId, job_id, key};
use crate::signals::{Effect, Stop};
use crate::tally::Ending;
use fretwork_job::{Cost, FailureKind, Key};

impl Database {
    pub(crate) async fn claim(&self) -> Result<Option<Claimed>, Error> {
        self.write(claim, ()).await
    }

    pub(crate) async fn progress(&self, claimed: &Claimed, share: f64) -> Result<bool, Error> {
        self.write(progress, (claimed.claim(), share)).await
    }

    pub(crate) async fn finish(
        &self,
        claimed: &Claimed,
        answer: Answered,
    ) -> Result<Finish, Error> {
        self.write(finish, Finished { claimed: claimed.clone(), answer }).await
    }

    pub(crate) async fn fail(
        &self,
        claimed: &Claimed,
        kind: FailureKind,
        message: &str,
    ) -> Result<bool, Error> {
        self.write(fail, (claimed.claim(), kind, message.to_owned())).await
    }

    pub(crate) async fn stopped(&self, claimed: &Claimed) -> Result<bool, Error> {
        self.write(stopped, (claimed.run, claimed.attempt)).await
    }

    pub(crate) async fn release(&self, claimed: &Claimed) -> Result<bool, Error> {
        self.write(release, claimed.claim()).await
    }

    pub(crate) async fn recover(&self) -> Result<Recovered, Error> {
        self.write(recover, ()).await
    }
}

async fn claim((): &(), tx: &mut Transaction) -> Result<Option<Claimed>, Error> {
    let Some((run, owner)) = tx.queue.next() else { return Ok(None) };
    let claimed = if tx.queue.is_study(run) {
        chunks::claim(run, tx).await?
    } else {
        claim_whole(run, tx).await?
    };
    tx.queue.take(claimed.part(), owner);
    tx.effects.push(Effect::Started(claimed.part(), claimed.stop.clone()));
    Ok(Some(claimed))
}

async fn claim_whole(run: RunId, tx: &mut Transaction) -> Result<Claimed, Error> {
    let row = sqlx::query(
        "UPDATE run SET state = 'running', attempt = attempt + 1, progress = 0, started = ?2,
             changed = ?2
         WHERE id = ?1 AND state = 'queued' RETURNING attempt, key, task, trace",
    )
    .bind(run.0)
    .bind(tx.now)
    .fetch_one(&mut tx.db)
    .await?;
    let claimed = Claimed {
        run,
        attempt: row.get("attempt")?,
        key: key(&row, "key")?,
        piece: Piece::Whole { task: row.get("task")? },
        spent: Cost::ZERO,
        trace: row.get("trace")?,
        stop: Stop::default(),
    };
    tx.effects.push(Effect::Changed(claimed.key));
    Ok(claimed)
}

async fn progress((claim, share): &(Claim, f64), tx: &mut Transaction) -> Result<bool, Error> {
    let Claim { part: (run, None), attempt } = *claim else {
        return Ok(attempt_of_run(*claim, tx).await?.is_some());
    };
    let row = sqlx::query(
        "UPDATE run SET progress = ?3 WHERE id = ?1 AND attempt = ?2 AND state = 'running'
         RETURNING key",
    )
    .bind(run.0)
    .bind(attempt)
    // SQLite would store NaN as null.
    .bind(if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) })
    .fetch_optional(&mut tx.db)
    .await?;
    let Some(row) = row else { return Ok(false) };
    tx.effects.push(Effect::Changed(key(&row, "key")?));
    Ok(true)
}

/// A result and the run that it ends.
struct Finished {
    claimed: Claimed,
    answer: Answered,
}

async fn finish(
    Finished { claimed, answer }: &Finished,
    tx: &mut Transaction,
) -> Result<Finish, Error> {
    static FINISH: LazyLock<Arc<str>> = LazyLock::new(|| keeping(Reason::Run, 2));
    let Claimed { run, key, ref piece, ref trace, .. } = *claimed;
    let Some(attempt) = attempt_of_run(claimed.claim(), tx).await? else {
        return Ok(Finish::Refused);
    };
    let task = match piece {
        Piece::Whole { task } => Cow::Borrowed(task),
        Piece::Chunk { .. } | Piece::Assembly { .. } => {
            let task = sqlx::query_scalar("SELECT task FROM run WHERE id = ?1").bind(run.0);
            Cow::Owned(task.fetch_one(&mut tx.db).await?)
        }
    };
    let (owner, job, warnings) = (None, None, None);
    let (trace, program, now) = (trace.as_deref(), Some(tx.program), tx.now);
    let source = Source { key, attempt, task: &task, owner, job, warnings, trace, program, now };
    let query = sqlx::query(AssertSqlSafe(Arc::clone(&FINISH))).bind(run.0);
    // The first statement returns a row. The others must be executed, too.
    let rows = keep::bind(answer, query, &source).fetch_all(&mut tx.db).await?;
    let kept = Kept::read(&rows)?;
    if kept.started.is_none() {
        return Ok(Finish::Refused);
    }
    ended(tx, run, key, kept.started, Ending::Succeeded);
    keep::kept(answer, tx, key, &kept).await
}

async fn fail(
    (claim, kind, message): &(Claim, FailureKind, String),
    tx: &mut Transaction,
) -> Result<bool, Error> {
    let (run, _) = claim.part;
    let Some(attempt) = attempt_of_run(*claim, tx).await? else { return Ok(false) };
    let update = sqlx::query(
        "UPDATE run SET state = 'failed', finished = ?5, changed = ?5, error_kind = ?1, error = ?2
         WHERE id = ?3 AND attempt = ?4 AND state = 'running' RETURNING key, started",
    );
    let update = update.bind(kind.as_str()).bind(message);
    Ok(end(tx, update, run, attempt, Ending::Failed).await?.is_some())
}

async fn stopped((run, attempt): &(RunId, u32), tx: &mut Transaction) -> Result<bool, Error> {
    let update = sqlx::query(
        "UPDATE run SET state = 'canceled', finished = ?3, changed = ?3
         WHERE id = ?1 AND attempt = ?2 AND state = 'canceling' RETURNING key, started",
    );
    Ok(end(tx, update, *run, *attempt, Ending::Canceled).await?.is_some())
}

async fn release(claim: &Claim, tx: &mut Transaction) -> Result<bool, Error> {
    let Claim { part: (run, number), attempt } = *claim;
    if let Some(number) = number {
        return chunks::release(run, number, attempt, tx).await;
    }
    // `started` is null after the update, and a released run does not count in the durations.
    let update = sqlx::query(
        "UPDATE run SET state = 'queued', progress = 0, started = NULL, changed = ?3
         WHERE id = ?1 AND attempt = ?2 AND state = 'running' RETURNING key, started",
    );
    if end(tx, update, run, attempt, Ending::Released).await?.is_none() {
        return Ok(false);
    }
    let jobs: Vec<(String, u8, Vec<u8>)> =
        sqlx::query_as("SELECT owner, priority, id FROM job WHERE run = ?1 AND finished IS NULL")
            .bind(run.0)
            .fetch_all(&mut tx.db)
            .await?;
    for (owner, priority, id) in jobs {
        tx.queue.add(run, &owner, priority, job_id(&id)?);
    }
    tx.effects.push(Effect::Queued);
    Ok(true)
}

async fn recover((): &(), tx: &mut Transaction) -> Result<Recovered, Error> {
    let canceled = sqlx::query(
        "UPDATE run SET state = 'canceled', finished = ?1, changed = ?1
         WHERE state = 'canceling' AND finished IS NULL RETURNING key",
    )
    .bind(tx.now)
    .fetch_all(&mut tx.db)
    .await?;
    let failed = sqlx::query(
        "UPDATE run SET state = 'failed', lost = lost + 1, finished = ?1, changed = ?1,
             error_kind = ?2, error = ?3
         WHERE state = 'running' AND finished IS NULL AND (EXISTS (
             SELECT 1 FROM chunk WHERE chunk.run = run.id AND chunk.state = 'running'
                 AND chunk.state <> 'done' AND (chunk.lost + 1 >= ?4 OR run.lost + 1 >= ?4)
         ) OR lost + 1 >= ?4 AND id NOT IN (SELECT run FROM study)) RETURNING key",
    )
    .bind(tx.now)
    .bind(FailureKind::WorkerLost.as_str())
    .bind(format!("the server died {MAX_LOST} times while computing this"))
    .bind(MAX_LOST)
    .fetch_all(&mut tx.db)
    .await?;
    let requeued = sqlx::query(
        "UPDATE run SET state = 'queued', lost = lost + 1, progress = 0, started = NULL,
             changed = ?1
         WHERE state = 'running' AND finished IS NULL AND id NOT IN (SELECT run FROM study)
         RETURNING key",
    )
    .bind(tx.now)
    .fetch_all(&mut tx.db)
    .await?;
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
            tx.effects.extend([Effect::Ended(key(&row, "key")?), Effect::Settled(ending, None)]);
        }
    }
    tx.queue = Queue::load(&mut tx.db).await?;
    tx.effects.push(Effect::Queued);
    Ok(counts)
}

/// Takes a run from its worker with the statement `update`, which returns at least `key` and `started`. The next three
/// parameters of the statement are the run, the attempt and the time. Returns `None` if the worker has
/// lost the run.
async fn end(
    tx: &mut Transaction,
    update: Query<'_, Sqlite, SqliteArguments>,
    run: RunId,
    attempt: u32,
    ending: Ending,
) -> Result<Option<SqliteRow>, Error> {
    let update = update.bind(run.0).bind(attempt).bind(tx.now);
    let Some(row) = update.fetch_optional(&mut tx.db).await? else { return Ok(None) };
    ended(tx, run, key(&row, "key")?, row.get("started")?, ending);
    Ok(Some(row))
}

/// Signals the end of a run.
fn ended(tx: &mut Transaction, run: RunId, key: Key, started: Option<i64>, ending: Ending) {
    // A study may have waited for a long time between its pieces.
    let started = started.filter(|_| !tx.queue.is_study(run));
    tx.queue.end(run);
    tx.effects.push(Effect::Unwanted(run));
    tx.effects.push(Effect::Ended(key));
    tx.effects.push(Effect::Settled(ending, started.map(|started| tx.now - started)));
}

/// The attempt of the running run. Returns `None` if the worker has lost its piece of it. For a whole run the caller compares
/// the attempt.
async fn attempt_of_run(claim: Claim, tx: &mut Transaction) -> Result<Option<u32>, Error> {
    let (run, number) = claim.part;
    let Some(number) = number else { return Ok(Some(claim.attempt)) };
    let query = sqlx::query_scalar(
        "SELECT run.attempt FROM chunk JOIN run ON run.id = chunk.run
         WHERE chunk.run = ?1 AND number = ?2 AND chunk.attempt = ?3
             AND chunk.state = 'running' AND run.state = 'running'",
    );
    let query = query.bind(run.0).bind(number).bind(claim.attempt);
    Ok(query.fetch_optional(&mut tx.db).await?)
}
