//! Writes and reads the audit log.

use sqlx::SqliteConnection;

use super::Database;
use crate::audit::{Act, Actor, AuditEntry};
use crate::error::Error;

/// Records an act on something of an owner, in the transaction of the act.
pub(super) async fn record(
    db: &mut SqliteConnection,
    now: i64,
    (actor, act): (&Actor, Act),
    subject: &str,
    owner: &str,
) -> Result<(), Error> {
    sqlx::query(
        "INSERT INTO audit (first, last, times, act, actor, key, subject, owner)
         VALUES (?1, ?1, 1, ?2, ?3, ?4, ?5, ?6)
         ON CONFLICT (act, actor, key, subject, owner, first / 86400000)
         DO UPDATE SET last = excluded.last, times = times + 1",
    )
    .bind(now)
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
    db: &mut SqliteConnection,
    before: Option<i64>,
    limit: u32,
) -> Result<Vec<AuditEntry>, Error> {
    let query = sqlx::query("SELECT * FROM audit WHERE id < ?1 ORDER BY id DESC LIMIT ?2");
    let rows = query.bind(before.unwrap_or(i64::MAX)).bind(limit).fetch_all(db).await?;
    Ok(rows.iter().map(AuditEntry::read).collect::<Result<_, _>>()?)
}

impl Database {
    pub(crate) async fn audit(
        &self,
        before: Option<i64>,
        limit: u32,
    ) -> Result<Vec<AuditEntry>, Error> {
        self.reading(async |db| list(db, before, limit).await).await
    }
}
