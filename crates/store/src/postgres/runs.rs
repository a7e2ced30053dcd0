//! Claims and ends runs.
//!
//! Each statement that changes a run compares the number of the attempt. So a worker that has lost its run changes
//! nothing.
//!
//! A statement that finds runs by their ids does not say that their state is `queued` or `running`, but excludes all other
//! states. Otherwise PostgreSQL may choose the partial index `run_live`, which has many dead entries while an old
//! snapshot is open.

use std::collections::HashMap;
use std::time::Instant;

use super::Database;
use super::chunks;
use super::follow::{ended_by, follow};
use super::lease;
use super::queue::{Turns, Waiting};
use super::transaction::{Transaction, reading};
use crate::database::caution::{Caution, Verdict};
use crate::database::usage::Owners;
use crate::database::{
    Connected, Effect, Ending, MAX_LOST, Recovered, Result, Row, RunId, Statement, Tables, sql,
};
use crate::jobs::claimed::{Claim, Claimed};
use crate::results::storing::{self, Answered, Finish, Source};
use fretwork_job::{ENGINE, FailureKind, JobState};

/// Maximum number of attempts to claim a part. An attempt fails if other workers claim all the parts that it has found.
const TRIES: usize = 4;

impl Database {
    /// Revokes all expired leases.
    pub(crate) async fn recover(&self) -> Result<Recovered> {
        self.reclaim(true).await
    }

    /// Claims up to `most` queued runs, or a piece of a study, of these owners.
    pub(crate) async fn claim(&self, most: usize, owners: Owners) -> Result<Vec<Claimed>> {
        // A claim that may take a part that was lost has no other claim of this process beside it.
        let alone = self.0.claiming.try_write();
        let _beside = if alone.is_err() { Some(self.0.claiming.read().await) } else { None };
        let is_settled = alone.is_ok() && self.0.signals.is_settled();
        let caution = Caution::of(is_settled, self.0.signals.losses().into_iter());
        if caution.on(0) == Verdict::Waits {
            return Ok(Vec::new());
        }
        let (claims, turns) = self.write(claim, (most, owners, caution)).await?;
        if let Some(turns) = turns {
            self.0.queue.remember(turns);
        }
        self.0.backlog.shrinks(claims.iter().filter(|claimed| claimed.part().1.is_none()).count());
        Ok(claims)
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

/// Claims up to `most` runs, or one piece of a study. Returns what the server must remember after the commit.
async fn claim(
    (most, owners, caution): &(usize, Owners, Caution),
    tx: &mut Transaction<'_>,
) -> Result<(Vec<Claimed>, Option<Turns>)> {
    let (dead, now) = (tx.of.signals.tally.dead(), Instant::now());
    if let Some(mut turns) = tx.of.queue.remembered(dead, false) {
        turns.rank(|owner| owners.usage_of(owner, &tx.of.signals.usage, now));
        let claims = claim_in_turn(tx, &mut turns, *most, *caution).await?;
        if !claims.is_empty() || tx.of.queue.remembered(dead, true).is_some() {
            return Ok((claims, Some(turns)));
        }
    }
    let mut found = (Vec::new(), None);
    for _ in 0..TRIES {
        let mut turns = tx.of.queue.read(&mut tx.db).await?;
        turns.rank(|owner| owners.usage_of(owner, &tx.of.signals.usage, now));
        let nobody_waits = turns.are_done();
        found.0 = claim_in_turn(tx, &mut turns, *most, *caution).await?;
        let must_wait = turns.owners.iter().any(|waiting| waiting.must_wait);
        let is_over = nobody_waits || must_wait || !found.0.is_empty();
        found.1 = Some(turns);
        if is_over {
            break;
        }
    }
    Ok(found)
}

async fn claim_in_turn(
    tx: &mut Transaction<'_>,
    turns: &mut Turns,
    most: usize,
    caution: Caution,
) -> Result<Vec<Claimed>> {
    let mut claims: Vec<Claimed> = Vec::new();
    let is_alone = |claimed: &Claimed| claimed.part().1.is_some() || claimed.lost > 0;
    'turns: while claims.len() < most && !claims.iter().any(is_alone) {
        let shares = turns.shares(most - claims.len());
        if shares.is_empty() {
            break;
        }
        for (place, share) in shares {
            let owner = &mut turns.owners[place];
            let found = claim_of(tx, owner, (share, claims.is_empty()), caution).await?;
            owner.running += found.len() as u64;
            claims.extend(found);
            if owner.must_wait || claims.iter().any(is_alone) {
                break 'turns;
            }
        }
    }
    for claimed in &claims {
        tx.effects.push(claimed.started());
    }
    Ok(claims)
}

/// Claims up to `most` of the most urgent runs of an owner. A piece of a study, or a run that was lost, is claimed alone, if
/// `is_first` is true.
async fn claim_of(
    tx: &mut Transaction<'_>,
    waiting: &mut Waiting,
    (most, is_first): (usize, bool),
    caution: Caution,
) -> Result<Vec<Claimed>> {
    let next = sqlx::query(
        "SELECT next.* FROM unnest($3::BYTEA[]) WITH ORDINALITY AS place (first, number) CROSS JOIN LATERAL (
             (SELECT run, study, priority FROM job WHERE claimable = $1 AND owner = $2 AND priority = number - 1
                  AND NOT study AND id >= first ORDER BY id LIMIT 1)
             UNION ALL
             (SELECT run, study, priority FROM job WHERE claimable = $1 AND owner = $2 AND priority = number - 1
                  AND study AND ($4 OR NOT EXISTS (
                      SELECT 1 FROM chunk WHERE chunk.run = job.run AND chunk.state = 'queued' AND chunk.lost > 0))
              ORDER BY id LIMIT 1)) AS next
         ORDER BY priority, study",
    );
    let next = next.bind(i64::from(ENGINE.numerics)).bind(&waiting.owner).bind(&waiting.places[..]);
    let next = next.bind(caution.on(1) != Verdict::PassesOver);
    let mut claims = Vec::new();
    // Other workers may be about to claim all runs of a priority, so this goes on to the next one.
    for next in next.fetch_all(tx.db.connection()).await? {
        let next = Row::Postgres(next);
        if !next.get::<bool>("study")? {
            let limits = (most, is_first, caution);
            claims = claim_whole(tx, waiting, next.get("priority")?, limits).await?;
        } else if is_first {
            claims.extend(chunks::claim(tx, RunId(next.get("run")?), waiting, caution).await?);
        } else {
            break;
        }
        if waiting.must_wait || !claims.is_empty() {
            break;
        }
    }
    waiting.is_done = claims.is_empty();
    lease::begin(tx, &waiting.owner, &claims).await?;
    Ok(claims)
}

/// Claims up to `most` queued runs of an owner and a priority, which are not studies.
async fn claim_whole(
    tx: &mut Transaction<'_>,
    waiting: &mut Waiting,
    priority: u8,
    (most, is_first, caution): (usize, bool, Caution),
) -> Result<Vec<Claimed>> {
    // The limit is a part of the text, because it decides the plan of the query. There are few different ones.
    let query = format!(
        "SELECT run.id AS run, lost, job.id AS job FROM job JOIN run ON run.id = job.run
         WHERE claimable = $1 AND job.owner = $2 AND priority = $3 AND NOT study AND job.id >= $4
             AND run.state NOT IN ('running', 'canceling') AND run.finished IS NULL AND (lost = 0 OR $5)
         ORDER BY job.id LIMIT {} FOR NO KEY UPDATE OF run SKIP LOCKED",
        1 << most.ilog2()
    );
    let takes_lost = caution.on(1) != Verdict::PassesOver;
    let query = Statement::of(query)
        .with(ENGINE.numerics)
        .with(&waiting.owner)
        .with(priority)
        .with(&waiting.places[usize::from(priority)])
        .with(takes_lost);
    let (mut runs, mut last) = (Vec::new(), None);
    for row in tx.db.rows(query).await? {
        // A run that was lost may have killed its node. It is claimed alone, so that it takes no other run with it.
        let lost = row.get("lost")?;
        let was_lost = lost > 0;
        if was_lost && !(runs.is_empty() && is_first) {
            break;
        }
        waiting.must_wait = caution.on(lost) == Verdict::Waits;
        if waiting.must_wait {
            return Ok(Vec::new());
        }
        runs.push(row.get::<i64>("run")?);
        last = Some(row.get::<Vec<u8>>("job")?);
        if was_lost {
            break;
        }
    }
    let Some(last) = last else { return Ok(Vec::new()) };
    // No run that this claim has passed over is before the place.
    if takes_lost {
        waiting.places[usize::from(priority)] = last;
    }
    let rows = sqlx::query(
        "UPDATE run SET state = 'running', attempt = attempt + 1, lost = lost + 1, progress = 0,
             started = moment(), changed = moment()
         WHERE id = ANY ($1) RETURNING id, attempt, lost - 1 AS lost, key, task, trace",
    );
    let mut claims = Vec::new();
    for row in rows.bind(&runs).fetch_all(tx.db.connection()).await? {
        let row = Row::Postgres(row);
        let claimed = Claimed::whole(RunId(row.get("id")?), waiting.owner.clone(), &row)?;
        tx.effects.push(Effect::Changed(claimed.key));
        claims.push(claimed);
    }
    claims.sort_by_key(|claimed| runs.iter().position(|run| *run == claimed.run.0));
    follow(tx, &runs).await?;
    Ok(claims)
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
             AND EXISTS (SELECT 1 FROM run WHERE id = $1 AND attempt = $2 AND state NOT IN ('queued', 'canceling')
                 AND finished IS NULL)";
        run, attempt, *share
    );
    if tx.db.changed_by(query).await? == 0 {
        return Ok(false);
    }
    tx.effects.push(Effect::Changed(key));
    Ok(true)
}

/// Stores the results of runs in one transaction. Returns what happened to each.
pub(crate) async fn finish(
    all: &Vec<(Claimed, Answered)>,
    tx: &mut Transaction<'_>,
) -> Result<Vec<Finish>> {
    let (mut runs, mut attempts, mut digests) = (Vec::new(), Vec::new(), Vec::new());
    for (claimed, answer) in all {
        if let Some(attempt) = attempt_of_run(tx, claimed.claim()).await? {
            runs.push(claimed.run.0);
            attempts.push(i64::from(attempt));
            digests.push(answer.digest.as_slice());
        }
    }
    let rows = sqlx::query(
        "UPDATE run SET state = 'succeeded', progress = 1, finished = moment(), changed = moment(),
             recomputed = (SELECT CASE WHEN digest = ended.digest THEN 'same' WHEN evicted IS NULL THEN 'differs'
                 ELSE 'replaced' END FROM result WHERE result.key = run.key)
         FROM unnest($1::BIGINT[], $2::BIGINT[], $3::BYTEA[]) AS ended (run, attempt, digest)
         WHERE id = ended.run AND run.attempt = ended.attempt AND state NOT IN ('queued', 'canceling') AND finished IS NULL
         RETURNING id, key, started, finished, owner, warnings, EXISTS (SELECT 1 FROM study WHERE run = id) AS study,
             (SELECT (array_agg(job.id ORDER BY job.id))[1] FROM job WHERE job.run = run.id) AS first_job,
             (SELECT result.digest = ended.digest FROM result WHERE result.key = run.key) AS same,
             (SELECT evicted IS NULL FROM result WHERE result.key = run.key) AS held",
    );
    let rows = rows.bind(&runs).bind(attempts).bind(digests).fetch_all(tx.db.connection()).await?;
    let mut rows: HashMap<_, _> = rows
        .into_iter()
        .map(Row::Postgres)
        .map(|row| Ok((RunId(row.get("id")?), row)))
        .collect::<sqlx::Result<_>>()?;
    for (claimed, answer) in all {
        let Some(row) = rows.get(&claimed.run) else { continue };
        let task = claimed.task(&mut tx.db).await?;
        let (key, owner, warnings) = (claimed.key, row.value("owner")?, row.get("warnings")?);
        let (job, trace) = (row.get("first_job")?, claimed.trace.as_deref());
        let (program, now) = (Some(tx.of.node.program), row.get("finished")?);
        let source = Source { key, task: &task, owner, job, warnings, trace, program, now };
        super::storing::store(&mut tx.db, answer, &source, true).await?;
    }
    ended_by(tx, rows.iter(), Ending::Succeeded).await?;
    let mut finished = Vec::new();
    for (claimed, answer) in all {
        finished.push(match rows.remove(&claimed.run) {
            Some(row) => storing::kept(answer, claimed.key, &row, tx.into()).await?,
            None => Finish::Refused,
        });
    }
    Ok(finished)
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
    ended_by(tx, [(&run, &row)], ending).await?;
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
         WHERE id = $1 AND attempt = $2 AND state NOT IN ('queued', 'canceling') AND finished IS NULL
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
         WHERE id = $1 AND attempt = $2 AND state NOT IN ('queued', 'canceling') AND finished IS NULL
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
    if row.value("state")? == Some(JobState::Canceling.as_str()) {
        let query = sql!(
            "UPDATE run SET state = 'canceled', finished = moment(), changed = moment() WHERE id = $1";
            run
        );
        tx.db.execute(query).await?;
        ended_by(tx, [(&run, &row)], Ending::Canceled).await?;
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
