//! Claims and ends runs.
//!
//! Each statement that changes a run compares the number of the attempt. So a worker that has lost its run changes
//! nothing.

use super::Database;
use super::chunks;
use super::follow::{ended_by, follow};
use super::lease;
use super::transaction::{Transaction, reading};
use crate::claimed::{Claim, Claimed};
use crate::error::Result;
use crate::keep::{self, Answered, Finish, Source};
use crate::options::{MAX_LOST, Recovered};
use crate::row::{Columns, RunId};
use crate::signals::Effect;
use crate::statement::{Statement, sql};
use crate::tables::{Connected, Tables};
use crate::tally::Ending;
use fretwork_job::{ENGINE, FailureKind, JobState};

/// The owners with work for a worker of the `numerics` version $1, in the order of their turns. The owner with the
/// fewest running parts comes first; among equals, the owner whose last turn was longest ago; among equals, the owner
/// with the oldest job. The query jumps from owner to owner in the index `job_claimable`, so the length of the queue
/// does not matter.
const TURNS: &str = "
    WITH RECURSIVE waiting AS (
        (SELECT owner FROM job WHERE claimable = $1 ORDER BY owner LIMIT 1)
        UNION ALL
        SELECT (SELECT owner FROM job WHERE claimable = $1 AND owner > waiting.owner ORDER BY owner LIMIT 1)
        FROM waiting WHERE owner IS NOT NULL
    )
    SELECT owner FROM waiting
    LEFT JOIN turn USING (owner)
    CROSS JOIN (SELECT coalesce(max(served), 0) AS last FROM turn) AS turns
    WHERE owner IS NOT NULL
    ORDER BY (SELECT count(*) FROM lease WHERE lease.owner = waiting.owner), coalesce(served, last - 1),
        (SELECT id FROM job WHERE claimable = $1 AND job.owner = waiting.owner
         ORDER BY priority, study, id LIMIT 1)
    LIMIT 8";

/// Maximum number of attempts to claim a part. An attempt fails if other workers claim all the parts that it has found.
const TRIES: usize = 4;

impl Database {
    /// Revokes all expired leases.
    pub(crate) async fn recover(&self) -> Result<Recovered> {
        self.reclaim(true).await
    }

    /// Revokes expired leases. Unless `always`, it does so only while the contact with the database lasts. If the clock
    /// of the database has jumped over the end of a lease, its node had no time to renew it. Each transaction checks
    /// this again, because it may begin late.
    pub(super) async fn reclaim(&self, always: bool) -> Result<Recovered> {
        let mut recovered = Recovered::default();
        let (now, runs) = reading!(self, db => lease::lost(db, &self.0.node).await)?;
        if !always && !self.0.contact.goes_on(now) {
            return Ok(recovered);
        }
        for run in runs {
            let found = self.write(reclaim, (run, always)).await?;
            recovered.requeued += found.requeued;
            recovered.failed += found.failed;
            recovered.canceled += found.canceled;
        }
        Ok(recovered)
    }
}

pub(crate) async fn claim((): &(), tx: &mut Transaction<'_>) -> Result<Option<Claimed>> {
    for _ in 0..TRIES {
        let owners = tx.db.rows(Statement::of(TURNS).with(ENGINE.numerics)).await?;
        if owners.is_empty() {
            return Ok(None);
        }
        for row in owners {
            if let Some(claimed) = claim_of(tx, row.get("owner")?).await? {
                let part = claimed.part();
                tx.effects.push(Effect::Started(part, claimed.stop.clone()));
                return Ok(Some(claimed));
            }
        }
    }
    Ok(None)
}

/// Claims the most urgent part of an owner. Returns `None` if other workers have claimed it in the meantime.
async fn claim_of(tx: &mut Transaction<'_>, owner: &str) -> Result<Option<Claimed>> {
    let query = sql!(
        "SELECT run, study FROM job WHERE claimable = $1 AND owner = $2
         ORDER BY priority, study, id LIMIT 1";
        ENGINE.numerics, owner
    );
    let Some(next) = tx.db.row(query).await? else { return Ok(None) };
    let claimed = if next.get("study")? {
        chunks::claim(tx, RunId(next.get("run")?)).await?
    } else {
        claim_whole(tx, owner).await?
    };
    if let Some(claimed) = &claimed {
        lease::begin(tx, owner, claimed).await?;
    }
    Ok(claimed)
}

async fn claim_whole(tx: &mut Transaction<'_>, owner: &str) -> Result<Option<Claimed>> {
    let query = sql!(
        "UPDATE run SET state = 'running', attempt = attempt + 1, lost = lost + 1, progress = 0,
             started = moment(), changed = moment()
         WHERE id = (
             SELECT run.id FROM job JOIN run ON run.id = job.run
             WHERE claimable = $1 AND job.owner = $2 AND NOT study AND run.state = 'queued'
             ORDER BY priority, study, job.id LIMIT 1 FOR NO KEY UPDATE OF run SKIP LOCKED)
         RETURNING id, attempt, key, task, trace";
        ENGINE.numerics, owner
    );
    let Some(row) = tx.db.row(query).await? else { return Ok(None) };
    let run = RunId(row.get("id")?);
    follow(tx, run).await?;
    let claimed = Claimed::whole(run, &row)?;
    tx.effects.push(Effect::Changed(claimed.key));
    Ok(Some(claimed))
}

pub(crate) async fn progress(
    (claim, share): &(Claim, f64),
    tx: &mut Transaction<'_>,
) -> Result<bool> {
    let Claim { part: (run, None), attempt, key } = *claim else {
        return Ok(claim.attempt_of_run(&mut tx.db).await?.is_some());
    };
    let query = sql!(
        "UPDATE lease SET progress = $3 WHERE run = $1 AND number = -1 AND attempt = $2
             AND EXISTS (SELECT 1 FROM run WHERE id = $1 AND attempt = $2 AND state = 'running')";
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
    tx: &mut Transaction<'_>,
) -> Result<Finish> {
    let Claimed { run, key, ref trace, .. } = *claimed;
    let Some(attempt) = attempt_of_run(tx, claimed.claim()).await? else {
        return Ok(Finish::Refused);
    };
    let query = sql!(
        "UPDATE run SET state = 'succeeded', progress = 1, finished = moment(), changed = moment(),
             recomputed = (SELECT CASE WHEN digest = $3 THEN 'same' WHEN evicted IS NULL THEN 'differs'
                 ELSE 'replaced' END FROM result WHERE result.key = run.key)
         WHERE id = $1 AND attempt = $2 AND state = 'running'
         RETURNING key, started, finished, owner, warnings, EXISTS (SELECT 1 FROM study WHERE run = id) AS study,
             (SELECT job.id FROM job WHERE job.run = run.id ORDER BY job.id LIMIT 1) AS first_job,
             (SELECT digest = $3 FROM result WHERE result.key = run.key) AS same,
             (SELECT evicted IS NULL FROM result WHERE result.key = run.key) AS held";
        run, attempt, answer.digest.as_slice()
    );
    let Some(row) = tx.db.row(query).await? else { return Ok(Finish::Refused) };
    let task = claimed.task(&mut tx.db).await?;
    let (owner, warnings) = (row.text("owner")?, row.text("warnings")?);
    let job = row.get("first_job")?;
    let (trace, program, now) = (trace.as_deref(), Some(tx.of.node.program), row.get("finished")?);
    let source = Source { key, task: &task, owner, job, warnings, trace, program, now };
    super::keep::store(&mut tx.db, answer, &source, true).await?;
    ended_by(tx, run, &row, Ending::Succeeded).await?;
    keep::kept(answer, key, &row, tx.into()).await
}

pub(crate) async fn fail(
    (claim, kind, message): &(Claim, FailureKind, String),
    tx: &mut Transaction<'_>,
) -> Result<bool> {
    let (run, _) = claim.part;
    let Some(attempt) = attempt_of_run(tx, *claim).await? else { return Ok(false) };
    fail_run(tx, run, attempt, (*kind, message)).await
}

pub(crate) async fn stopped(claim: &Claim, tx: &mut Transaction<'_>) -> Result<bool> {
    let (run, _) = claim.part;
    let query = sql!(
        "UPDATE run SET state = 'canceled', finished = moment(), changed = moment()
         WHERE id = $1 AND attempt = $2 AND state = 'canceling'
         RETURNING key, started, finished, FALSE AS study";
        run, claim.attempt
    );
    end(tx, query, run, Ending::Canceled).await
}

pub(crate) async fn release(claim: &Claim, tx: &mut Transaction<'_>) -> Result<bool> {
    let Claim { part: (run, number), attempt, .. } = *claim;
    match number {
        Some(number) => chunks::release(tx, run, number, attempt).await,
        // The claim has counted the run as lost, which this undoes.
        None => requeue(tx, run, attempt, 1).await,
    }
}

/// Ends or queues a run with the statement `update`, which returns the row that [`ended_by`] reads. Returns false if
/// the worker has lost the run.
async fn end(
    tx: &mut Transaction<'_>,
    update: Statement,
    run: RunId,
    ending: Ending,
) -> Result<bool> {
    let Some(row) = tx.db.row(update).await? else { return Ok(false) };
    ended_by(tx, run, &row, ending).await?;
    Ok(true)
}

/// Queues a running run again, and subtracts `uncounted` from the number of times that it was lost. Returns false if
/// the worker has lost the run.
async fn requeue(
    tx: &mut Transaction<'_>,
    run: RunId,
    attempt: u32,
    uncounted: i64,
) -> Result<bool> {
    // `started` is null after the update, and a released run does not count in the durations.
    let query = sql!(
        "UPDATE run SET state = 'queued', progress = 0, started = NULL, changed = moment(), lost = lost - $3
         WHERE id = $1 AND attempt = $2 AND state = 'running'
         RETURNING key, started, finished, FALSE AS study";
        run, attempt, uncounted
    );
    let released = end(tx, query, run, Ending::Released).await?;
    if released {
        tx.effects.push(Effect::Queued);
    }
    Ok(released)
}

/// Fails a running run. Returns false if the run is not running, or has a later attempt.
async fn fail_run(
    tx: &mut Transaction<'_>,
    run: RunId,
    attempt: u32,
    (kind, message): (FailureKind, &str),
) -> Result<bool> {
    // A text in PostgreSQL cannot contain the character NUL, so it is replaced.
    let query = sql!(
        "UPDATE run SET state = 'failed', finished = moment(), changed = moment(), error_kind = $3, error = $4,
             progress = coalesce(
                 (SELECT progress FROM lease WHERE lease.run = id AND number = -1),
                 (SELECT least(done, chunks)::DOUBLE PRECISION / chunks FROM study WHERE study.run = id), 0)
         WHERE id = $1 AND attempt = $2 AND state = 'running'
         RETURNING key, started, finished, EXISTS (SELECT 1 FROM study WHERE run = id) AS study";
        run, attempt, kind.as_str(), message.replace('\0', " ")
    );
    end(tx, query, run, Ending::Failed).await
}

/// Revokes the expired leases of a run. Fails the run if it was lost too often.
async fn reclaim((run, always): &(RunId, bool), tx: &mut Transaction<'_>) -> Result<Recovered> {
    let (run, mut recovered) = (*run, Recovered::default());
    if !always && !tx.of.contact.goes_on(tx.now().await?) {
        return Ok(recovered);
    }
    let study = chunks::lock(tx, run).await?;
    let query = sql!(
        "SELECT key, started, moment() AS finished, state, attempt, lost, FALSE AS study
         FROM run WHERE id = $1 FOR NO KEY UPDATE";
        run
    );
    let row = tx.db.row(query).await?;
    let pieces = lease::take_lost(tx, run).await?;
    let Some(row) = row.filter(|_| !pieces.is_empty()) else { return Ok(recovered) };
    let attempt = row.get("attempt")?;
    let lost = match &study {
        Some(study) => chunks::lose(tx, run, study, &pieces).await?,
        None => row.get::<u32>("lost")?,
    };
    if row.text("state")? == Some(JobState::Canceling.as_str()) {
        let query = sql!(
            "UPDATE run SET state = 'canceled', finished = moment(), changed = moment() WHERE id = $1";
            run
        );
        tx.db.execute(query).await?;
        ended_by(tx, run, &row, Ending::Canceled).await?;
        recovered.canceled = 1;
    } else if lost >= MAX_LOST {
        let message = format!("the server died {MAX_LOST} times while it computed this job");
        let failed = fail_run(tx, run, attempt, (FailureKind::WorkerLost, &message)).await?;
        recovered.failed = u64::from(failed);
    } else if study.is_some() {
        recovered.requeued = pieces.len() as u64;
        tx.effects.push(Effect::Queued);
    } else {
        recovered.requeued = u64::from(requeue(tx, run, attempt, 0).await?);
    }
    Ok(recovered)
}

/// Returns [`Claim::attempt_of_run`]. For a piece, locks the study first.
async fn attempt_of_run(tx: &mut Transaction<'_>, claim: Claim) -> Result<Option<u32>> {
    if let (run, Some(_)) = claim.part {
        chunks::lock(tx, run).await?;
    }
    claim.attempt_of_run(&mut tx.db).await
}
