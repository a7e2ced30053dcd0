//! Access keys: who may use the server, and for what.
//!
//! A key is `fretwork_<id>_<secret>`. The id names it in lists and logs; of the whole only a digest is
//! kept, so that nobody who reads the tables can use it.

use std::fmt;
use std::str::FromStr;

use data_encoding::HEXLOWER;
use sha2::{Digest as _, Sha256};
use sqlx::sqlite::SqliteRow;
use sqlx::{FromRow, Row, SqliteConnection};
use subtle::ConstantTimeEq as _;

use super::read::word;
use super::writer::{Transaction, Verb};
use super::{Error, Store};
use crate::job::BadWord;

/// What every key begins with: a secret that is found where it should not be can be recognised.
const MARK: &str = "fretwork";
/// Digits of the public part.
const ID: usize = 8;
/// Bytes of the secret part.
const SECRET: usize = 20;

/// What a key is good for; each role may do what those before it may.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Role {
    /// Look at results, check scenarios.
    Read,
    /// Submit jobs; see, cancel and delete one's own.
    Submit,
    /// Everything, with the jobs and results of everyone.
    Admin,
}

impl Role {
    /// All roles.
    pub const ALL: [Self; 3] = [Self::Read, Self::Submit, Self::Admin];

    /// Its name.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Submit => "submit",
            Self::Admin => "admin",
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl FromStr for Role {
    type Err = BadWord;

    fn from_str(text: &str) -> Result<Self, BadWord> {
        Self::ALL.into_iter().find(|role| role.as_str() == text).ok_or(BadWord("role"))
    }
}

/// What is known of a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AccessKey {
    /// Names it.
    pub id: String,
    /// Whose it is: keys of one name are one owner of jobs.
    pub name: String,
    /// What it is good for.
    pub role: Role,
    /// Requests per minute; the server's own limit if there is none.
    pub per_minute: Option<u32>,
    /// When it was made. Times are in milliseconds since 1970.
    pub created: i64,
    /// When it ends.
    pub expires: Option<i64>,
    /// When it was taken back.
    pub revoked: Option<i64>,
    /// When it was last used, to the minute.
    pub last_used: Option<i64>,
    digest: [u8; 32],
}

impl FromRow<'_, SqliteRow> for AccessKey {
    fn from_row(row: &SqliteRow) -> Result<Self, sqlx::Error> {
        let digest: &[u8] = row.try_get("digest")?;
        Ok(Self {
            id: row.try_get("id")?,
            name: row.try_get("name")?,
            role: word(row, "role")?,
            per_minute: row.try_get("per_minute")?,
            created: row.try_get("created")?,
            expires: row.try_get("expires")?,
            revoked: row.try_get("revoked")?,
            last_used: row.try_get("last_used")?,
            digest: digest.try_into().map_err(|error| sqlx::Error::Decode(Box::new(error)))?,
        })
    }
}

impl AccessKey {
    /// Whether this is the key itself. How long it takes tells nothing of it.
    #[must_use]
    pub fn is(&self, presented: &str) -> bool {
        digest(presented).ct_eq(&self.digest).into()
    }

    /// Whether it is the same key, with the same limits and the same end.
    #[must_use]
    pub fn is_like(&self, other: &Self) -> bool {
        Self { last_used: None, ..self.clone() } == Self { last_used: None, ..other.clone() }
    }

    /// The id in a text that has the form of a key.
    #[must_use]
    pub fn id_in(presented: &str) -> Option<&str> {
        let (id, secret) = presented.strip_prefix(MARK)?.strip_prefix('_')?.split_once('_')?;
        let hex = |text: &str| text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        (id.len() == ID && secret.len() == 2 * SECRET && hex(id) && hex(secret)).then_some(id)
    }
}

/// The digest by which a key is known.
#[must_use]
pub fn digest(key: &str) -> [u8; 32] {
    Sha256::digest(key).into()
}

/// A key that is to be made.
#[derive(Debug, Clone)]
pub struct NewKey {
    /// Whose it is.
    pub name: String,
    /// What it is good for.
    pub role: Role,
    /// Requests per minute; the server's own limit if there is none.
    pub per_minute: Option<u32>,
    /// When it ends, in milliseconds since 1970.
    pub expires: Option<i64>,
}

/// Hexadecimal digits of so many random bytes.
fn random<const BYTES: usize>() -> Result<String, Error> {
    let mut bytes = [0; BYTES];
    getrandom::fill(&mut bytes).map_err(|_| Error::NoRandomness)?;
    Ok(HEXLOWER.encode(&bytes))
}

/// Makes a key and returns it: the only time that it is seen.
pub(super) async fn add(
    db: &mut SqliteConnection,
    new: &NewKey,
    now: i64,
) -> Result<String, Error> {
    let (id, secret) = (random::<{ ID / 2 }>()?, random::<SECRET>()?);
    let key = format!("{MARK}_{id}_{secret}");
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
    .execute(db)
    .await?;
    Ok(key)
}

/// All keys there ever were, the oldest first.
pub(super) async fn list(db: &mut SqliteConnection) -> Result<Vec<AccessKey>, Error> {
    Ok(sqlx::query_as("SELECT * FROM access_key ORDER BY created, id").fetch_all(db).await?)
}

/// Takes back the keys of this id or name that are in force; returns how many.
pub(super) async fn revoke(db: &mut SqliteConnection, name: &str, now: i64) -> Result<u64, Error> {
    let done = sqlx::query(
        "UPDATE access_key SET revoked = ?2
         WHERE (id = ?1 OR name = ?1) AND revoked IS NULL",
    )
    .bind(name)
    .bind(now)
    .execute(db)
    .await?;
    Ok(done.rows_affected())
}

impl Store {
    /// All keys there ever were, the oldest first.
    pub async fn access_keys(&self) -> Result<Vec<AccessKey>, Error> {
        // By a connection of their own: who may come in does not wait for who is in.
        let listed = async { list(self.gatekeeper.get().await?.connection()).await };
        self.noted(listed.await)
    }

    /// Notes that a key was used just now.
    pub async fn key_was_used(&self, id: &str) -> Result<(), Error> {
        self.write(Used(id.to_owned())).await
    }

    /// What links to results are signed with: the same for ever, and nobody else's.
    pub async fn link_secret(&self) -> Result<[u8; 32], Error> {
        let mut candidate = [0; 32];
        getrandom::fill(&mut candidate).map_err(|_| Error::NoRandomness)?;
        self.write(LinkSecret(candidate)).await
    }

    /// How many jobs of an owner wait, and how many are computed.
    pub async fn unfinished(&self, owner: &str) -> Result<(u64, u64), Error> {
        // By state: finished jobs are many, and these are few.
        let counted = self.reading(async |db| {
            sqlx::query_as(
                "SELECT count(*) FILTER (WHERE state = 'queued'),
                     count(*) FILTER (WHERE state <> 'queued')
                 FROM job INDEXED BY job_state
                 WHERE state IN ('queued', 'running', 'canceling') AND owner = ?1",
            )
            .bind(owner)
            .fetch_one(db)
            .await
            .map_err(Error::from)
        });
        let (queued, running): (i64, i64) = counted.await?;
        Ok((queued.unsigned_abs(), running.unsigned_abs()))
    }
}

struct Used(String);

impl Verb for Used {
    type Answer = ();

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<(), Error> {
        sqlx::query("UPDATE access_key SET last_used = ?2 WHERE id = ?1")
            .bind(&self.0)
            .bind(tx.now)
            .execute(&mut *tx.db)
            .await?;
        Ok(())
    }
}

/// A secret, if there is none yet.
struct LinkSecret([u8; 32]);

impl Verb for LinkSecret {
    type Answer = [u8; 32];

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<[u8; 32], Error> {
        sqlx::query("INSERT INTO link_secret (id, secret) VALUES (1, ?1) ON CONFLICT DO NOTHING")
            .bind(self.0.as_slice())
            .execute(&mut *tx.db)
            .await?;
        let kept: Vec<u8> =
            sqlx::query_scalar("SELECT secret FROM link_secret").fetch_one(&mut *tx.db).await?;
        kept.try_into().map_err(|_| sqlx::Error::Decode("a secret has 32 bytes".into()).into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_has_the_form_of_a_key_has_an_id() {
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
}
