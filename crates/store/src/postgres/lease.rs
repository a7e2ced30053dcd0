//! The leases of running runs and pieces.
//!
//! A lease gives a node, which is one server process, the right to compute a run or piece. It has a fixed duration by
//! the clock of the database. Its node renews it after a third of that duration. Any server revokes an expired lease.
//! If the end of a lease is further in the future than its duration allows, the clock was set back. Such a lease counts
//! as expired, too. [`Contact`](super::contact::Contact) gives the nodes time to renew their leases after a step of the
//! clock.

use std::time::Duration;

use sqlx::AssertSqlSafe;
use sqlx::postgres::PgConnection;

use super::Node;
use super::transaction::Transaction;
use crate::database::{Connected, Result, RunId, RunPart, sql};
use crate::jobs::claimed::Claimed;

/// A duration in milliseconds.
pub(super) fn milliseconds(time: Duration) -> i64 {
    i64::try_from(time.as_millis()).unwrap_or(i64::MAX)
}

impl Node {
    /// The interval at which the node renews its leases.
    pub(super) fn renewal(&self) -> Duration {
        self.lease / 3
    }

    /// The time between the end of a lease and its revocation, in milliseconds. In this time, a late renewal may
    /// arrive.
    fn margin(&self) -> i64 {
        milliseconds(self.lease / 6)
    }
}

/// Maximum number of runs with expired leases that one query returns.
const AT_ONCE: i64 = 1000;

/// The condition that a lease is expired: it ended more than the margin $2 ago, or it ends later than its duration and
/// the margin allow. $1 is the duration of a lease whose column `lasts` is null.
const IS_OVER: &str = "expires + $2 < moment() OR expires > moment() + coalesce(lasts, $1) + $2";

/// The value of the column `number` for a part: the number of the piece, or -1 for a whole run.
fn number(part: RunPart) -> i64 {
    part.1.map_or(-1, i64::from)
}

/// Begins the leases of claimed runs or pieces of this owner.
pub(super) async fn begin(tx: &mut Transaction<'_>, owner: &str, claims: &[Claimed]) -> Result<()> {
    let node = &tx.of.node;
    let column = |value: fn(&Claimed) -> i64| claims.iter().map(value).collect::<Vec<_>>();
    sqlx::query(
        "INSERT INTO lease (run, number, attempt, node, owner, expires, lasts)
         SELECT run, number, attempt, $4, $5, moment() + $6, $6
         FROM unnest($1::BIGINT[], $2::BIGINT[], $3::BIGINT[]) AS claimed (run, number, attempt)",
    )
    .bind(column(|claimed| claimed.run.0))
    .bind(column(|claimed| number(claimed.part())))
    .bind(column(|claimed| claimed.attempt.into()))
    .bind(&node.id)
    .bind(owner)
    .bind(milliseconds(node.lease))
    .execute(tx.db.connection())
    .await?;
    Ok(())
}

/// Ends the lease of a part.
pub(super) async fn end(tx: &mut Transaction<'_>, part: RunPart) -> Result<()> {
    let query = sql!("DELETE FROM lease WHERE run = $1 AND number = $2"; part.0, number(part));
    tx.db.execute(query).await
}

/// Ends all leases of these runs.
pub(super) async fn end_all(tx: &mut Transaction<'_>, runs: &[i64]) -> Result<()> {
    let query = sqlx::query("DELETE FROM lease WHERE run = ANY ($1)");
    query.bind(runs).execute(tx.db.connection()).await?;
    Ok(())
}

/// Renews the leases of these parts. Returns the time by the clock of the database, and the parts whose leases this
/// node still holds.
pub(super) async fn renew(
    db: &mut PgConnection,
    node: &Node,
    parts: &[RunPart],
) -> Result<(i64, Vec<RunPart>)> {
    let (runs, numbers): (Vec<i64>, Vec<i64>) =
        parts.iter().map(|part| (part.0.0, number(*part))).unzip();
    let held: Vec<(i64, i64)> = sqlx::query_as(
        // The fixed order of the locks makes deadlocks between renewals and verbs rare. After a deadlock, one is
        // retried.
        "WITH own AS MATERIALIZED (
             SELECT lease.run, lease.number FROM lease JOIN unnest($2::BIGINT[], $3::BIGINT[]) AS part (run, number)
                 ON lease.run = part.run AND lease.number = part.number
             WHERE node = $1 ORDER BY lease.run, lease.number FOR UPDATE OF lease
         )
         UPDATE lease SET expires = moment() + $4 FROM own
         WHERE lease.run = own.run AND lease.number = own.number
             AND EXISTS (SELECT 1 FROM run WHERE id = lease.run AND state NOT IN ('queued', 'canceling') AND finished IS NULL)
         RETURNING lease.run AS run, lease.number AS number",
    )
    .bind(&node.id)
    .bind(runs)
    .bind(numbers)
    .bind(milliseconds(node.lease))
    .fetch_all(&mut *db)
    .await?;
    let now = sqlx::query_scalar("SELECT moment()").fetch_one(db).await?;
    let part = |(run, number)| (RunId(run), u32::try_from(number).ok());
    Ok((now, held.into_iter().map(part).collect()))
}

/// The time by the clock of the database, and the runs with an expired lease.
pub(super) async fn lost(db: &mut PgConnection, node: &Node) -> Result<(i64, Vec<RunId>)> {
    let query = format!(
        "SELECT moment(), ARRAY (SELECT DISTINCT run FROM lease WHERE {IS_OVER} ORDER BY run LIMIT $3)"
    );
    let query = sqlx::query_as(AssertSqlSafe(query));
    let query = query.bind(milliseconds(node.lease)).bind(node.margin()).bind(AT_ONCE);
    let (now, runs): (i64, Vec<i64>) = query.fetch_one(db).await?;
    Ok((now, runs.into_iter().map(RunId).collect()))
}

/// Revokes the expired leases of a run. Returns the numbers of the parts, as in the column `number`.
pub(super) async fn take_lost(tx: &mut Transaction<'_>, run: RunId) -> Result<Vec<i64>> {
    let node = &tx.of.node;
    let query = format!("DELETE FROM lease WHERE ({IS_OVER}) AND run = $3 RETURNING number");
    let query = sqlx::query_scalar(AssertSqlSafe(query));
    let query = query.bind(milliseconds(node.lease)).bind(node.margin()).bind(run.0);
    Ok(query.fetch_all(tx.db.connection()).await?)
}
