//! Access keys and their roles.
//!
//! A key is `fretwork_<id>_<secret>`. Lists and logs show only the id. The database stores only a digest
//! of the whole key, so reading the database gives no access.

use data_encoding::HEXLOWER;
use sha2::{Digest as _, Sha256};
use subtle::ConstantTimeEq as _;

use crate::database::{Change, Connected, Error, Result, Row, Tables, cells, read, sql};
use crate::team::audit::{Act, Actor, record};
use fretwork_job::words;

/// Prefix of all keys. Tools that scan for leaked secrets recognise it.
const MARK: &str = "fretwork";

/// Number of hexadecimal digits of the id.
const ID: usize = 8;

/// Number of bytes of the secret.
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

cells! { &str => str::parse: Role; }

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
    /// Whether the names that its holder gives are private.
    pub private: bool,
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
    fn read(row: &Row) -> sqlx::Result<Self> {
        Ok(read!(row => Self {
            id, name, role, per_minute, private, created, expires, revoked, last_used, digest
        }))
    }

    /// Whether this is the digest of the key. The comparison takes constant time.
    pub fn has_digest(&self, digest: &[u8; 32]) -> bool {
        digest.ct_eq(&*self.digest).into()
    }

    /// Whether both keys are equal apart from the time of last use.
    pub fn is_like(&self, other: &Self) -> bool {
        Self { last_used: None, ..self.clone() } == Self { last_used: None, ..other.clone() }
    }

    /// The id in the text that a client has sent, if the text has the form of a key.
    pub fn id_in(presented: &str) -> Option<&str> {
        let (id, secret) = presented.strip_prefix(MARK)?.strip_prefix('_')?.split_once('_')?;
        let hex = |text: &str| text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        (id.len() == ID && secret.len() == 2 * SECRET && hex(id) && hex(secret)).then_some(id)
    }
}

/// The digest that the database stores for a key.
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
    /// Whether the names that its holder gives are private.
    pub private: bool,
}

impl NewKey {
    /// Creates a random key. Returns its id and its text.
    pub(crate) fn mint() -> Result<(String, String)> {
        let (id, secret) = (random::<{ ID / 2 }>()?, random::<SECRET>()?);
        let key = format!("{MARK}_{id}_{secret}");
        Ok((id, key))
    }
}

/// Random bytes in hexadecimal.
pub(crate) fn random<const BYTES: usize>() -> Result<String> {
    let mut bytes = [0; BYTES];
    getrandom::fill(&mut bytes).map_err(|_| Error::NoRandomness)?;
    Ok(HEXLOWER.encode(&bytes))
}

/// All keys, also expired and revoked ones, the oldest first.
pub(crate) async fn list(mut db: impl Tables) -> Result<Vec<AccessKey>> {
    let keys = sql!(
        "SELECT id, name, role, digest, per_minute, private, created, expires, revoked, last_used FROM access_key
         ORDER BY created, id"
    );
    Ok(db.rows(keys).await?.iter().map(AccessKey::read).collect::<Result<_, _>>()?)
}

/// Stores a new key. Its text and its id are known already.
pub(crate) async fn add(
    (id, key, new, by): &(String, String, NewKey, Actor),
    mut tx: Change<'_>,
) -> Result<()> {
    let now = tx.now().await?;
    let insert = sql!(
        "INSERT INTO access_key (id, name, role, digest, per_minute, created, expires, private)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8)";
        id, &new.name, new.role.as_str(), &digest(key), new.per_minute, now, new.expires, new.private
    );
    tx.execute(insert).await?;
    record(&mut tx, now, (by, Act::AddKey), id, &new.name).await
}

/// Revokes the valid keys with this id or name; returns how many.
pub(crate) async fn revoke((name, by): &(String, Actor), mut tx: Change<'_>) -> Result<usize> {
    let now = tx.now().await?;
    let update = sql!(
        "UPDATE access_key SET revoked = $2
         WHERE (id = $1 OR name = $1) AND revoked IS NULL RETURNING id, name";
        name, now
    );
    let revoked = tx.rows(update).await?;
    for row in &revoked {
        record(&mut tx, now, (by, Act::RevokeKey), row.get("id")?, row.get("name")?).await?;
    }
    Ok(revoked.len())
}

/// Records that a key was used.
pub(crate) async fn was_used(by: &Actor, mut tx: Change<'_>) -> Result<()> {
    let now = tx.now().await?;
    tx.execute(sql!("UPDATE access_key SET last_used = $2 WHERE id = $1"; &by.key, now)).await?;
    record(&mut tx, now, (by, Act::UseKey), &by.key, &by.name).await
}

/// Stores the candidate as the secret that signs links, if there is none yet. Returns the stored secret.
pub(crate) async fn link_secret(candidate: &[u8; 32], mut tx: Change<'_>) -> Result<[u8; 32]> {
    let insert = sql!(
        "INSERT INTO link_secret (id, secret) VALUES (1, $1) ON CONFLICT DO NOTHING"; candidate
    );
    tx.execute(insert).await?;
    let stored = tx.one(sql!("SELECT secret FROM link_secret")).await?;
    let wrong = |_| sqlx::Error::Decode("the stored secret does not have 32 bytes".into());
    Ok(stored.get::<&[u8]>("secret")?.try_into().map_err(wrong)?)
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
}
