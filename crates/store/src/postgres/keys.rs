//! Stores access keys, and the secret for signed links.

use sqlx::Connection as _;
use sqlx::postgres::PgConnection;

use super::Database;
use super::audit::record;
use super::transaction::{reading, writing};
use crate::audit::{Act, Actor};
use crate::error::Error;
use crate::keys::{AccessKey, NewKey, digest, secret_of};

/// All keys, also expired and revoked ones, the oldest first.
pub(crate) async fn list(db: &mut PgConnection) -> Result<Vec<AccessKey>, Error> {
    let rows = sqlx::query("SELECT id, name, role, digest, per_minute, created, expires, revoked, last_used FROM access_key
         ORDER BY created, id",).fetch_all(db).await?;
    Ok(rows.iter().map(AccessKey::read).collect::<Result<_, _>>()?)
}

pub(crate) async fn add(
    db: &mut PgConnection,
    id: &str,
    key: &str,
    new: &NewKey,
) -> Result<(), Error> {
    let mut tx = db.begin().await?;
    sqlx::query(
        "INSERT INTO access_key (id, name, role, digest, per_minute, created, expires)
         VALUES ($1, $2, $3, $4, $5, moment(), $6)",
    )
    .bind(id)
    .bind(&new.name)
    .bind(new.role.as_str())
    .bind(digest(key).as_slice())
    .bind(new.per_minute.map(i64::from))
    .bind(new.expires)
    .execute(&mut *tx)
    .await?;
    record(&mut tx, (&Actor::of_process(), Act::AddKey), id, &new.name).await?;
    Ok(tx.commit().await?)
}

/// Revokes the valid keys with this id or name; returns how many.
pub(crate) async fn revoke(db: &mut PgConnection, name: &str) -> Result<usize, Error> {
    let mut tx = db.begin().await?;
    let revoked: Vec<(String, String)> = sqlx::query_as(
        "UPDATE access_key SET revoked = moment()
         WHERE (id = $1 OR name = $1) AND revoked IS NULL RETURNING id, name",
    )
    .bind(name)
    .fetch_all(&mut *tx)
    .await?;
    for (id, name) in &revoked {
        record(&mut tx, (&Actor::of_process(), Act::RevokeKey), id, name).await?;
    }
    tx.commit().await?;
    Ok(revoked.len())
}

impl Database {
    pub(crate) async fn access_keys(&self) -> Result<Vec<AccessKey>, Error> {
        reading!(self, db => list(db).await)
    }

    pub(crate) async fn key_was_used(&self, by: Actor) -> Result<(), Error> {
        writing!(self, tx => {
            sqlx::query("UPDATE access_key SET last_used = moment() WHERE id = $1")
                .bind(&by.key)
                .execute(&mut *tx.db)
                .await?;
            record(&mut tx.db, (&by, Act::UseKey), &by.key, &by.name).await
        })
    }

    pub(crate) async fn link_secret(&self, candidate: [u8; 32]) -> Result<[u8; 32], Error> {
        writing!(self, tx => {
            let query = sqlx::query(
                "INSERT INTO link_secret (id, secret) VALUES (1, $1) ON CONFLICT DO NOTHING",
            );
            query.bind(candidate.as_slice()).execute(&mut *tx.db).await?;
            let query = sqlx::query_scalar("SELECT secret FROM link_secret");
            Ok(secret_of(query.fetch_one(&mut *tx.db).await?)?)
        })
    }

    pub(crate) async fn unfinished(&self, owner: &str) -> Result<(u64, u64), Error> {
        let counts: (i64, i64) = reading!(self, db => {
            // The index of states skips the many finished jobs.
            let query = sqlx::query_as(
                "SELECT count(*) FILTER (WHERE state = 'queued'),
                         count(*) FILTER (WHERE state <> 'queued')
                     FROM job
                     WHERE state IN ('queued', 'running', 'canceling') AND state <> 'succeeded'
                         AND owner = $1",
            );
            Ok(query.bind(owner).fetch_one(db).await?)
        })?;
        Ok((counts.0.unsigned_abs(), counts.1.unsigned_abs()))
    }
}
