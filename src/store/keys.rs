//! Access keys, their roles, and the secret for signed links.
//!
//! A key is `fretwork_<id>_<secret>`. Lists and logs show only the id. The database stores only a digest
//! of the whole key, so reading the database gives no access.

use data_encoding::HEXLOWER;
use sha2::{Digest as _, Sha256};
use sqlx::sqlite::SqliteRow;
use sqlx::{Connection as _, Row as _, SqliteConnection};
use subtle::ConstantTimeEq as _;

use super::administration::Administration;
use super::audit::{Act, Actor, record};
use super::row::word;
use super::transaction::Transaction;
use super::{Error, Store};
use crate::job::clock::now;
use crate::job::words;

/// Prefix of all keys. Tools that scan for leaked secrets recognise it.
const MARK: &str = "fretwork";
/// Hexadecimal digits of the id.
const ID: usize = 8;
/// Bytes of the secret.
const SECRET: usize = 20;

words! {
    /// What the holder of a key may do. Each role includes the roles before it.
    pub enum Role: "role" {
        /// Read results and check scenarios.
        Read = "read",
        /// Submit jobs; see, cancel and delete own jobs.
        Submit = "submit",
        /// Everything, including jobs and results of all owners.
        Admin = "admin",
    }
}

/// A stored access key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AccessKey {
    /// The public part of the key.
    pub id: String,
    /// The owner of the jobs that are submitted with it. Several keys may have the same name.
    pub name: String,
    /// What its holder may do.
    pub role: Role,
    /// Requests per minute; `None` means the limit of the server.
    pub per_minute: Option<u32>,
    /// When it was created. Times are in milliseconds since 1970.
    pub created: i64,
    /// When it expires.
    pub expires: Option<i64>,
    /// When it was revoked.
    pub revoked: Option<i64>,
    /// When it was last used, with a resolution of one minute.
    pub last_used: Option<i64>,
    digest: Vec<u8>,
}

impl AccessKey {
    fn read(row: &SqliteRow) -> Result<Self, sqlx::Error> {
        Ok(Self {
            id: row.try_get("id")?,
            name: row.try_get("name")?,
            role: word(row, "role")?,
            per_minute: row.try_get("per_minute")?,
            created: row.try_get("created")?,
            expires: row.try_get("expires")?,
            revoked: row.try_get("revoked")?,
            last_used: row.try_get("last_used")?,
            digest: row.try_get("digest")?,
        })
    }

    /// Whether `presented` is this key. The comparison takes constant time.
    #[must_use]
    pub fn is(&self, presented: &str) -> bool {
        digest(presented).ct_eq(&*self.digest).into()
    }

    /// Whether both are equal apart from the time of last use.
    #[must_use]
    pub fn is_like(&self, other: &Self) -> bool {
        Self { last_used: None, ..self.clone() } == Self { last_used: None, ..other.clone() }
    }

    /// The id in a text, if the text has the form of a key.
    #[must_use]
    pub fn id_in(presented: &str) -> Option<&str> {
        let (id, secret) = presented.strip_prefix(MARK)?.strip_prefix('_')?.split_once('_')?;
        let hex = |text: &str| text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        (id.len() == ID && secret.len() == 2 * SECRET && hex(id) && hex(secret)).then_some(id)
    }
}

/// The digest that the database stores for a key.
#[must_use]
pub fn digest(key: &str) -> [u8; 32] {
    Sha256::digest(key).into()
}

/// A key to be created.
#[derive(Debug, Clone)]
pub struct NewKey {
    /// The owner of the jobs that are submitted with it.
    pub name: String,
    /// What its holder may do.
    pub role: Role,
    /// Requests per minute; `None` means the limit of the server.
    pub per_minute: Option<u32>,
    /// When it expires, in milliseconds since 1970.
    pub expires: Option<i64>,
}

/// Random bytes in hexadecimal.
fn random<const BYTES: usize>() -> Result<String, Error> {
    let mut bytes = [0; BYTES];
    getrandom::fill(&mut bytes).map_err(|_| Error::NoRandomness)?;
    Ok(HEXLOWER.encode(&bytes))
}

/// All keys, also expired and revoked ones, the oldest first.
async fn list(db: &mut SqliteConnection) -> Result<Vec<AccessKey>, Error> {
    let rows = sqlx::query("SELECT * FROM access_key ORDER BY created, id").fetch_all(db).await?;
    Ok(rows.iter().map(AccessKey::read).collect::<Result<_, _>>()?)
}

impl Administration {
    /// Creates an access key and returns it. It cannot be read again.
    pub async fn add_key(&mut self, new: &NewKey) -> Result<String, Error> {
        let (id, secret) = (random::<{ ID / 2 }>()?, random::<SECRET>()?);
        let key = format!("{MARK}_{id}_{secret}");
        let now = now();
        let mut tx = self.0.begin_with("BEGIN IMMEDIATE").await?;
        sqlx::query(
            "INSERT INTO access_key (id, name, role, digest, per_minute, created, expires)
             VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
        )
        .bind(&id)
        .bind(&new.name)
        .bind(new.role.as_str())
        .bind(digest(&key).as_slice())
        .bind(new.per_minute)
        .bind(now)
        .bind(new.expires)
        .execute(&mut *tx)
        .await?;
        record(&mut tx, now, (&Actor::of_process(), Act::AddKey), &id, &new.name).await?;
        tx.commit().await?;
        Ok(key)
    }

    /// All access keys, also expired and revoked ones, the oldest first.
    pub async fn keys(&mut self) -> Result<Vec<AccessKey>, Error> {
        list(&mut self.0).await
    }

    /// Revokes the valid keys with this id or name; returns how many.
    pub async fn revoke_keys(&mut self, name: &str) -> Result<usize, Error> {
        let now = now();
        let mut tx = self.0.begin_with("BEGIN IMMEDIATE").await?;
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
}

impl Store {
    /// All keys, also expired and revoked ones, the oldest first.
    pub async fn access_keys(&self) -> Result<Vec<AccessKey>, Error> {
        self.reading_by(&self.keys, async |db| list(db).await).await
    }

    /// Records that a key was used now.
    pub async fn key_was_used(&self, by: Actor) -> Result<(), Error> {
        self.write(use_now, by).await
    }

    /// The secret that signs links to results. It is created once for each database.
    pub async fn link_secret(&self) -> Result<[u8; 32], Error> {
        let mut candidate = [0; 32];
        getrandom::fill(&mut candidate).map_err(|_| Error::NoRandomness)?;
        self.write(link_secret, candidate).await
    }

    /// The number of queued jobs of an owner, and of running ones.
    pub async fn unfinished(&self, owner: &str) -> Result<(u64, u64), Error> {
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
    kept.try_into()
        .map_err(|_| sqlx::Error::Decode("the stored secret does not have 32 bytes".into()).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_well_formed_key_has_an_id() {
        let (id, secret) = ("0a1b2c3d", "0123456789abcdef0123456789abcdef01234567");
        assert_eq!(AccessKey::id_in(&format!("fretwork_{id}_{secret}")), Some(id));
        for bad in [
            String::new(),
            id.to_owned(),
            format!("fretwork_{id}"),
            format!("fretwork_{id}_{}", &secret[1..]),
            format!("fretwork_{id}_{}", secret.to_uppercase()),
            format!("fretwork_{id}x_{secret}"),
            format!("wretfork_{id}_{secret}"),
        ] {
            assert_eq!(AccessKey::id_in(&bad), None, "{bad}");
        }
    }

    #[tokio::test]
    async fn access_keys_do_not_wait_for_other_reads() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path(), &crate::store::Options::default()).await.unwrap();
        let mut busy = Vec::new();
        for _ in 0..crate::store::open::READERS {
            busy.push(store.readers.get().await.unwrap());
        }
        assert!(store.access_keys().await.unwrap().is_empty());
        drop(busy);
        store.close().await;
    }
}
