//! Maintenance that keeps the tables small over years. An advisory lock ensures that only one server at a time does it.

use std::time::{Duration, Instant};

use super::Database;
use super::eviction::make_room;
use super::transaction::{Transaction, reading};
use crate::database::{Connected, Options, Result, Statement, Verb, sql};
use crate::jobs::ages::AgeClock;
use crate::jobs::maintenance;
use fretwork_job::Key;

/// Maximum time between two cleanings, and between two sums of the sizes of all results.
const OFTEN: Duration = Duration::from_mins(1);
/// The pause between two sums is this multiple of the duration of a sum. So a small database stays within its budget
/// even under many writes, and a large database is not read all the time.
const REST: u32 = 50;
/// Maximum number of jobs that one transaction deletes.
const JOBS: i64 = 100;
/// Maximum number of chunks that one transaction deletes. Each has tens of kilobytes.
const CHUNKS: i64 = 100;
/// Maximum number of transactions of each kind in one round. The times at which results were read are stored between
/// rounds.
const AT_ONCE: usize = 50;
/// Maximum number of entries of the audit log.
const ENTRIES: i64 = 100_000;

/// Sorts 256 KiB. With a small `work_mem`, PostgreSQL writes them to a temporary file.
const SPILL: &str = "
    SELECT count(*) FROM (
        SELECT repeat(md5(n::TEXT), 256) COLLATE \"C\" AS bytes FROM generate_series(1, 32) AS n ORDER BY bytes
    ) AS sorted";

/// The state of the maintenance of one server.
pub(super) struct Maintenance {
    keep_jobs: Option<Duration>,
    budget: Option<u64>,
    /// `None` before the first round.
    clock: Option<AgeClock>,
    /// When old jobs and unneeded chunks must be deleted next.
    due: Instant,
    /// When the sizes of all results must be added up next.
    room_due: Instant,
    /// Whether the results exceed the budget although nothing more can be evicted. The warning is logged only once.
    exceeds: bool,
}

/// Repeats a part of the maintenance, each time in a new transaction. The part returns whether there is more to do, or
/// `None` if another server does maintenance. Returns whether there may be more to do.
async fn again<Input, V>(db: &Database, part: V, input: Input) -> Result<bool>
where
    V: for<'a, 'of> Verb<'a, Input, &'a mut Transaction<'of>, Answer = Option<bool>>,
    Input: Copy + Send + Sync,
{
    for _ in 0..AT_ONCE {
        match db.write(part, input).await? {
            Some(true) => {}
            done => return Ok(done.is_none()),
        }
    }
    Ok(true)
}

impl Maintenance {
    pub(super) fn new(options: &Options) -> Self {
        let Options { keep_jobs, budget, .. } = *options;
        let now = Instant::now();
        Self { keep_jobs, budget, clock: None, due: now, room_due: now, exceeds: false }
    }

    /// Stores the times at which this server has read results, and does the maintenance that is due. After an error in
    /// one kind of work, the other kinds are still done. Returns the first error.
    pub(super) async fn round(&mut self, db: &Database) -> Result<()> {
        let reads = db.0.signals.take_read();
        let written = if reads.is_empty() { Ok(()) } else { db.write(write_reads, reads).await };
        let cleaned = self.clean(db).await.and(db.write(analyze, ()).await);
        let has_room = self.make_room(db).await;
        if has_room.is_err() {
            self.room_due = Instant::now() + OFTEN;
        }
        written.and(cleaned).and(has_room)
    }

    /// If it is due, deletes old jobs, unneeded chunks, and the rows that [`forget`] deletes.
    async fn clean(&mut self, db: &Database) -> Result<()> {
        if Instant::now() < self.due {
            return Ok(());
        }
        let time = self.time(db).await?;
        let (jobs, chunks) = (self.delete_old(db, time).await, again(db, delete_chunks, ()).await);
        db.write(forget, time).await?;
        let more = jobs? | chunks?;
        if !more {
            self.due = Instant::now() + OFTEN;
        }
        Ok(())
    }

    /// Deletes old jobs. Returns whether there may be more.
    async fn delete_old(&self, db: &Database, time: i64) -> Result<bool> {
        let Some(age) = self.keep_jobs else { return Ok(false) };
        let before = time.saturating_sub(i64::try_from(age.as_millis()).unwrap_or(i64::MAX));
        again(db, delete_old, before).await
    }

    /// The time of the [`AgeClock`].
    async fn time(&mut self, db: &Database) -> Result<i64> {
        let (stored, now): (i64, i64) = reading!(db, db => {
            Ok(sqlx::query_as("SELECT clock, moment() FROM upkeep").fetch_one(db).await?)
        })?;
        let clock = self.clock.get_or_insert_with(|| AgeClock::at(Some(stored)));
        let time = clock.advance(now);
        if let Some(time) = clock.unstored() {
            db.write(write_clock, time).await?;
        }
        Ok(time)
    }

    /// If it is due, evicts the least recently read results until the bodies are within the budget.
    async fn make_room(&mut self, db: &Database) -> Result<()> {
        if Instant::now() < self.room_due {
            return Ok(());
        }
        let budget =
            self.budget.map_or(i64::MAX, |budget| i64::try_from(budget).unwrap_or(i64::MAX));
        for _ in 0..AT_ONCE {
            // Another server may have evicted results in the meantime, so each transaction adds up the sizes again.
            let room = db.write(make_room, budget).await?;
            let Some((stored, evicted, took)) = room else { return Ok(()) };
            db.0.signals.tally.bytes.set(stored);
            if evicted == 0 {
                let exceeds = stored > budget;
                if exceeds && !self.exceeds {
                    tracing::warn!(
                        stored,
                        budget,
                        "the results exceed --keep-results, and only pinned results are left; unpin results or raise the limit"
                    );
                }
                self.exceeds = exceeds;
                self.room_due = Instant::now() + rest(self.budget, took);
                return Ok(());
            }
        }
        Ok(())
    }
}

/// The pause until the next sum of the sizes of all results, after a sum that took this time. Without a budget, the sum
/// is only for the metrics.
fn rest(budget: Option<u64>, took: Duration) -> Duration {
    budget.map_or(OFTEN, |_| OFTEN.min(REST * took))
}

/// Lets PostgreSQL analyze the tables after they have doubled. By itself, it does so only after a minute, and until then
/// it plans statements as for nearly empty tables.
async fn analyze((): &(), tx: &mut Transaction<'_>) -> Result<()> {
    let query = sqlx::query_scalar(
        "SELECT pg_stat_get_mod_since_analyze(oid) > greatest(1000, reltuples) FROM pg_class WHERE oid = 'job'::REGCLASS",
    );
    if query.fetch_one(tx.db.connection()).await? && tx.maintains_alone().await? {
        // Otherwise PostgreSQL warns of each table that it analyzes already, and skips.
        tx.db.execute(sql!("SET LOCAL client_min_messages = error")).await?;
        let tables =
            "ANALYZE (SKIP_LOCKED) run, job, lease, result, result_blob, result_task, outline";
        tx.db.execute(Statement::of(tables)).await?;
    }
    Ok(())
}

/// Checks that the disk has room for a submission.
pub(crate) async fn probe((): &(), tx: &mut Transaction<'_>) -> Result<()> {
    // Writes a temporary file of 256 KiB, about the size of a default result with its job. A temporary file always
    // needs new space. A write to a table could use free pages, and would make the table grow if many servers wrote.
    tx.db.execute(sql!("SET LOCAL work_mem = '64kB'")).await?;
    tx.db.execute(Statement::of(SPILL)).await?;
    tx.db.execute(sql!("UPDATE upkeep SET probe = moment()")).await
}

/// Stores the [`AgeClock`].
async fn write_clock(time: &i64, tx: &mut Transaction<'_>) -> Result<()> {
    tx.db.execute(sql!("UPDATE upkeep SET clock = greatest(clock, $1)"; *time)).await
}

/// Stores when results were last read.
async fn write_reads(reads: &Vec<(Key, i64)>, tx: &mut Transaction<'_>) -> Result<()> {
    let (mut keys, mut times) = (Vec::new(), Vec::new());
    for (key, at) in reads {
        keys.push(key.bytes().to_vec());
        times.push(*at);
    }
    sqlx::query(
        "UPDATE result SET last_access = at FROM unnest($1::BYTEA[], $2::BIGINT[]) AS read (key, at)
         WHERE result.key = read.key AND last_access < at",
    )
    .bind(keys)
    .bind(times)
    .execute(tx.db.connection())
    .await?;
    Ok(())
}

/// Deletes jobs that ended before this time, the oldest first, and runs without jobs.
async fn delete_old(before: &i64, tx: &mut Transaction<'_>) -> Result<Option<bool>> {
    if !tx.maintains_alone().await? {
        return Ok(None);
    }
    // A job id begins with the time in milliseconds, so the primary key finds the oldest jobs.
    let mut oldest = [0; 16];
    oldest[..6].copy_from_slice(&(*before).max(0).to_be_bytes()[2..]);
    let ids: Vec<Vec<u8>> = sqlx::query_scalar(
        "SELECT id FROM job WHERE id < $1 AND finished < $2 ORDER BY id LIMIT $3",
    )
    .bind(oldest.as_slice())
    .bind(before)
    .bind(JOBS)
    .fetch_all(tx.db.connection())
    .await?;
    delete_jobs(tx, &ids).await?;
    Ok(Some(ids.len() as u64 == JOBS.unsigned_abs()))
}

/// Deletes finished jobs, and their runs if these have ended and have no other job.
async fn delete_jobs(tx: &mut Transaction<'_>, ids: &[Vec<u8>]) -> Result<()> {
    // Without this lock, two servers could delete the last two jobs of a run at the same time. Each would still see the
    // job of the other, and the run would stay without a job.
    sqlx::query(
        "SELECT 1 FROM run WHERE id IN (SELECT run FROM job WHERE id = ANY ($1)) ORDER BY id FOR NO KEY UPDATE",
    )
    .bind(ids)
    .execute(tx.db.connection())
    .await?;
    let runs: Vec<Option<i64>> =
        sqlx::query_scalar("DELETE FROM job WHERE id = ANY ($1) RETURNING run")
            .bind(ids)
            .fetch_all(tx.db.connection())
            .await?;
    let runs: Vec<i64> = runs.into_iter().flatten().collect();
    if !runs.is_empty() {
        sqlx::query(
            "DELETE FROM run WHERE id = ANY ($1) AND finished IS NOT NULL
                 AND NOT EXISTS (SELECT 1 FROM job WHERE job.run = run.id)",
        )
        .bind(runs)
        .execute(tx.db.connection())
        .await?;
    }
    Ok(())
}

/// Deletes some chunks of a study that has ended. Returns whether there may be more.
async fn delete_chunks((): &(), tx: &mut Transaction<'_>) -> Result<Option<bool>> {
    if !tx.maintains_alone().await? {
        return Ok(None);
    }
    maintenance::delete_chunks(&CHUNKS, tx.into()).await.map(Some)
}

/// Deletes the scenarios of results that were evicted more than a year before this time and have no jobs, and the oldest
/// entries of the audit log.
async fn forget(time: &i64, tx: &mut Transaction<'_>) -> Result<()> {
    let query = sql!("DELETE FROM audit WHERE id <= (SELECT max(id) FROM audit) - $1"; ENTRIES);
    tx.db.execute(query).await?;
    maintenance::forget_evicted(time, tx.into()).await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pause_after_a_sum_is_proportional_to_its_duration_up_to_a_minute() {
        let seconds = Duration::from_secs_f64;
        assert_eq!(rest(Some(1), seconds(0.01)), seconds(0.5));
        assert_eq!(rest(Some(1), seconds(10.0)), OFTEN);
        assert_eq!(rest(None, seconds(0.01)), OFTEN);
    }
}
