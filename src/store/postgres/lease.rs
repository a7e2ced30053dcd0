//! What workers compute now, and for how long it is theirs.
//!
//! A lease lasts for a time by the clock of the database. Its node renews it at a third of that time. Any server takes away
//! a lease that is over.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

use sqlx::postgres::PgConnection;
use tokio::time::Instant;

use super::Node;
use super::transaction::Transaction;
use crate::store::claimed::Claimed;
use crate::store::error::Error;
use crate::store::row::{Columns, Part, RunId};

/// A time in milliseconds.
pub(super) fn milliseconds(time: Duration) -> i64 {
    i64::try_from(time.as_millis()).unwrap_or(i64::MAX)
}

impl Node {
    /// How often it renews its leases.
    pub(super) fn renewal(&self) -> Duration {
        self.lease / 3
    }

    /// How long after its end a lease is taken away, in milliseconds. A renewal may be on its way.
    fn margin(&self) -> i64 {
        milliseconds(self.lease / 6)
    }
}

/// Most runs whose leases are looked up at a time.
const AT_ONCE: i64 = 100;

/// The number of a piece in the table; -1 for a whole run.
fn number(part: Part) -> i64 {
    part.1.map_or(-1, i64::from)
}

/// Begins the lease of what a worker has claimed, and ends the turn of its owner.
pub(super) async fn begin(
    tx: &mut Transaction<'_>,
    node: &Node,
    owner: &str,
    claimed: &Claimed,
) -> Result<(), Error> {
    sqlx::query(
        "WITH served AS (
             INSERT INTO turn (owner, served)
             SELECT $5, coalesce(max(served), 0) + 1 FROM turn
             ON CONFLICT (owner) DO UPDATE SET served = excluded.served
         )
         INSERT INTO lease (run, number, attempt, node, owner, expires)
         VALUES ($1, $2, $3, $4, $5, moment() + $6)",
    )
    .bind(claimed.run.0)
    .bind(number(claimed.part()))
    .bind(i64::from(claimed.attempt))
    .bind(&node.id)
    .bind(owner)
    .bind(milliseconds(node.lease))
    .execute(&mut *tx.db)
    .await?;
    Ok(())
}

/// Ends the lease of a part.
pub(super) async fn end(tx: &mut Transaction<'_>, part: Part) -> Result<(), Error> {
    let query = sqlx::query("DELETE FROM lease WHERE run = $1 AND number = $2");
    query.bind(part.0.0).bind(number(part)).execute(&mut *tx.db).await?;
    Ok(())
}

/// Ends all leases of a run.
pub(super) async fn end_all(tx: &mut Transaction<'_>, run: RunId) -> Result<(), Error> {
    let query = sqlx::query("DELETE FROM lease WHERE run = $1");
    query.bind(run.0).execute(&mut *tx.db).await?;
    Ok(())
}

/// Renews the leases of what this node computes. Returns the parts that it still has.
pub(super) async fn renew(
    db: &mut PgConnection,
    node: &Node,
    parts: &[Part],
) -> Result<Vec<Part>, Error> {
    let (runs, numbers): (Vec<i64>, Vec<i64>) =
        parts.iter().map(|part| (part.0.0, number(*part))).unzip();
    let rows = sqlx::query(
        // Locked in the order in which other verbs lock the leases of a run, so that none waits for the other.
        "WITH own AS MATERIALIZED (
             SELECT lease.run, lease.number FROM lease JOIN unnest($2::BIGINT[], $3::BIGINT[]) AS part (run, number)
                 ON lease.run = part.run AND lease.number = part.number
             WHERE node = $1 ORDER BY lease.run, lease.number FOR UPDATE OF lease
         )
         UPDATE lease SET expires = moment() + $4 FROM own
         WHERE lease.run = own.run AND lease.number = own.number
             AND EXISTS (SELECT 1 FROM run WHERE id = lease.run AND state = 'running')
         RETURNING lease.run AS run, lease.number AS number",
    )
    .bind(&node.id)
    .bind(runs)
    .bind(numbers)
    .bind(milliseconds(node.lease))
    .fetch_all(db)
    .await?;
    let part = |row| {
        let number = Columns::get::<i64>(row, "number")?;
        Ok((RunId(Columns::get(row, "run")?), u32::try_from(number).ok()))
    };
    Ok(rows.iter().map(part).collect::<Result<_, sqlx::Error>>()?)
}

/// The runs of which a lease is over.
pub(super) async fn lost(db: &mut PgConnection, node: &Node) -> Result<Vec<RunId>, Error> {
    let query = sqlx::query_scalar(
        "SELECT DISTINCT run FROM lease WHERE expires + $1 < moment() ORDER BY run LIMIT $2",
    );
    let runs: Vec<i64> = query.bind(node.margin()).bind(AT_ONCE).fetch_all(db).await?;
    Ok(runs.into_iter().map(RunId).collect())
}

/// Takes away the leases of a run that are over. Returns the numbers of its pieces.
pub(super) async fn take_lost(
    tx: &mut Transaction<'_>,
    node: &Node,
    run: RunId,
) -> Result<Vec<i64>, Error> {
    let query = sqlx::query_scalar(
        "DELETE FROM lease WHERE run = $1 AND expires + $2 < moment() RETURNING number",
    );
    Ok(query.bind(run.0).bind(node.margin()).fetch_all(&mut *tx.db).await?)
}

/// For how long the database has answered without a pause. After a pause of the database or of this process, other nodes
/// need time to renew their leases before one of them counts as lost.
#[derive(Debug)]
pub(super) struct Contact {
    /// A shorter pause is none; and how long a contact must last.
    enough: Duration,
    /// When it began, and when the database answered last.
    times: Mutex<Option<(Instant, Moment)>>,
}

/// A moment by both clocks. One of them stands still while the machine sleeps, the other one can be set.
#[derive(Debug, Clone, Copy)]
struct Moment(Instant, SystemTime);

impl Moment {
    fn now() -> Self {
        Self(Instant::now(), SystemTime::now())
    }

    fn elapsed(&self) -> Duration {
        self.0.elapsed().max(self.1.elapsed().unwrap_or_default())
    }
}

impl Contact {
    pub(super) fn new(lease: Duration) -> Self {
        Self { enough: lease / 2, times: Mutex::default() }
    }

    /// The database has answered.
    pub(super) fn goes_on(&self) {
        let now = Moment::now();
        let mut times = self.times();
        let began = times.filter(|(_, last)| last.elapsed() < self.enough).map(|(began, _)| began);
        *times = Some((began.unwrap_or(now.0), now));
    }

    /// The database has not answered.
    pub(super) fn ends(&self) {
        *self.times() = None;
    }

    /// Whether it has lasted long enough to take leases away.
    pub(super) fn lasts(&self) -> bool {
        self.times().is_some_and(|(began, last)| {
            began.elapsed() >= self.enough && last.elapsed() < self.enough
        })
    }

    /// A poisoned lock is safe: each change is one assignment.
    fn times(&self) -> MutexGuard<'_, Option<(Instant, Moment)>> {
        self.times.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use tokio::time;

    use super::*;

    #[tokio::test(start_paused = true)]
    async fn a_contact_is_interrupted_by_an_error_and_by_a_pause_of_the_process() {
        let contact = Contact::new(Duration::from_secs(30));
        let answers_for = async |seconds| {
            for _ in 0..seconds {
                time::sleep(Duration::from_secs(1)).await;
                contact.goes_on();
            }
        };
        assert!(!contact.lasts());
        answers_for(15).await;
        assert!(!contact.lasts(), "it began after the first second");
        answers_for(1).await;
        assert!(contact.lasts());
        contact.ends();
        assert!(!contact.lasts());
        answers_for(16).await;
        assert!(contact.lasts());
        time::sleep(Duration::from_secs(20)).await;
        assert!(!contact.lasts(), "the database was not asked for a while");
        contact.goes_on();
        assert!(!contact.lasts(), "the process has slept");
        answers_for(15).await;
        assert!(contact.lasts());
    }
}
