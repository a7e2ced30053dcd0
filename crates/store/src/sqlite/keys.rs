//! Stores access keys, and the secret for signed links.

use sqlx::{Connection as _, SqliteConnection};

use super::Database;
use super::audit::record;
use super::transaction::Transaction;
use crate::audit::{Act, Actor};
use crate::error::Error;
use crate::keys::{AccessKey, NewKey, digest, secret_of};
use fretwork_job::clock::now;

/// All keys, also expired and revoked ones, the oldest first.
pub(crate) async fn list(db: &mut SqliteConnection) -> Result<Vec<AccessKey>, Error> {
    let rows = sqlx::query("SELECT * FROM access_key ORDER BY created, id").fetch_all(db).await?;
    Ok(rows.iter().map(AccessKey::read).collect::<Result<_, _>>()?)
}

pub(crate) async fn add(
    db: &mut SqliteConnection,
    id: &str,
    key: &str,
    new: &NewKey,
) -> Result<(), Error> {
    let now = now();
    let mut tx = db.begin_with("BEGIN IMMEDIATE").await?;
    sqlx::query(
        "INSERT INTO access_key (id, name, role, digest, per_minute, created, expires)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
    )
    .bind(id)
    .bind(&new.name)
    .bind(new.role.as_str())
    .bind(digest(key).as_slice())
    .bind(new.per_minute)
    .bind(now)
    .bind(new.expires)
    .execute(&mut *tx)
    .await?;
    record(&mut tx, now, (&Actor::of_process(), Act::AddKey), id, &new.name).await?;
    Ok(tx.commit().await?)
}

/// Revokes the valid keys with this id or name; returns how many.
pub(crate) async fn revoke(db: &mut SqliteConnection, name: &str) -> Result<usize, Error> {
    let now = now();
    let mut tx = db.begin_with("BEGIN IMMEDIATE").await?;
    let revoked: Vec<(String, String)> = sqlx::query_as(
        "UPDATE access_key SET revoked = ?2
         WHERE (id = ?1 OR name = ?1) AND revoked IS NULL RETURNING id, name",
    )
    .bind(name)
    .bind(now)
    .fetch_all(&mut *tx)
    .await?;
    for (id, name) in &revoked {
        record(&mut tx, now, (&Actor::of_process(), Act::RevokeKey), id, name).await?;
    }
    tx.commit().await?;
    Ok(revoked.len())
}

impl Database {
    pub(crate) async fn access_keys(&self) -> Result<Vec<AccessKey>, Error> {
        self.reading_by(&self.keys, async |db| list(db).await).await
    }

    pub(crate) async fn key_was_used(&self, by: Actor) -> Result<(), Error> {
        self.write(use_now, by).await
    }

    pub(crate) async fn link_secret(&self, candidate: [u8; 32]) -> Result<[u8; 32], Error> {
        self.write(link_secret, candidate).await
    }

    pub(crate) async fn unfinished(&self, owner: &str) -> Result<(u64, u64), Error> {
        // The index of states skips the many finished jobs.
        let counted = self.reading(async |db| {
            sqlx::query_as(
                "SELECT count(*) FILTER (WHERE state = 'queued'),
                     count(*) FILTER (WHERE state <> 'queued')
                 FROM job INDEXED BY job_state
                 WHERE state IN ('queued', 'running', 'canceling') AND state <> 'succeeded'
                     AND owner = ?1",
            )
            .bind(owner)
            .fetch_one(db)
            .await
            .map_err(Error::from)
        });
        counted.await
    }
}

async fn use_now(by: &Actor, tx: &mut Transaction) -> Result<(), Error> {
    sqlx::query("UPDATE access_key SET last_used = ?2 WHERE id = ?1")
        .bind(&by.key)
        .bind(tx.now)
        .execute(&mut tx.db)
        .await?;
    record(&mut tx.db, tx.now, (by, Act::UseKey), &by.key, &by.name).await
}

/// Stores a secret, if there is none yet; returns the stored one.
async fn link_secret(candidate: &[u8; 32], tx: &mut Transaction) -> Result<[u8; 32], Error> {
    sqlx::query("INSERT INTO link_secret (id, secret) VALUES (1, ?1) ON CONFLICT DO NOTHING")
        .bind(candidate.as_slice())
        .execute(&mut tx.db)
        .await?;
    let kept: Vec<u8> =
        sqlx::query_scalar("SELECT secret FROM link_secret").fetch_one(&mut tx.db).await?;
    Ok(secret_of(kept)?)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::Options;
    use crate::sqlite::open::READERS;

    #[tokio::test]
    async fn access_keys_do_not_wait_for_other_reads() {
        let dir = tempfile::tempdir().unwrap();
        let store = Database::open(dir.path(), &Options::default(), Arc::default()).await.unwrap();
        let mut busy = Vec::new();
        for _ in 0..READERS {
            busy.push(store.readers.get().await.unwrap());
        }
        assert!(store.access_keys().await.unwrap().is_empty());
        drop(busy);
        store.close().await;
    }
}
