//! Writes and reads the audit log.

use sqlx::postgres::PgConnection;

use super::Database;
use super::transaction::reading;
use crate::audit::{Act, Actor, AuditEntry};
use crate::error::Error;

/// Records an act on something of an owner, in the transaction of the act.
pub(super) async fn record(
    db: &mut PgConnection,
    (actor, act): (&Actor, Act),
    subject: &str,
    owner: &str,
) -> Result<(), Error> {
    sqlx::query(
        "INSERT INTO audit (first, last, times, act, actor, key, subject, owner)
         VALUES (moment(), moment(), 1, $1, $2, $3, $4, $5)
         ON CONFLICT (act, actor, key, subject, owner, (first / 86400000))
         DO UPDATE SET last = excluded.last, times = audit.times + 1",
    )
    .bind(act.as_str())
    .bind(&actor.name)
    .bind(&actor.key)
    .bind(actor.named(act, subject, owner))
    .bind(owner)
    .execute(db)
    .await?;
    Ok(())
}

/// Up to `limit` entries before another one, the newest first.
pub(crate) async fn list(
    db: &mut PgConnection,
    before: Option<i64>,
    limit: u32,
) -> Result<Vec<AuditEntry>, Error> {
    let query = sqlx::query(
        "SELECT id, first, last, times, act, actor, key, subject, owner FROM audit
         WHERE id < $1 ORDER BY id DESC LIMIT $2",
    );
    let query = query.bind(before.unwrap_or(i64::MAX)).bind(i64::from(limit));
    let rows = query.fetch_all(db).await?;
    Ok(rows.iter().map(AuditEntry::read).collect::<Result<_, _>>()?)
}

impl Database {
    pub(crate) async fn audit(
        &self,
        before: Option<i64>,
        limit: u32,
    ) -> Result<Vec<AuditEntry>, Error> {
        reading!(self, db => list(db, before, limit).await)
    }
}
