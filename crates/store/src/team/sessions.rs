//! Sessions of browsers. A browser that has signed in with an access key sends a cookie with a random token. The
//! database stores only the digest of the token, and the digest of the key. So a session is valid only as long as its key.

use crate::database::{Change, Connected, Result, Tables, sql};
use crate::team::keys::digest;

/// Lifetime of a session in milliseconds: a week.
const LIFETIME: i64 = 7 * 24 * 3600 * 1000;
/// Maximum number of sessions of one key. A new session ends the oldest one.
const MOST: u32 = 100;

/// The access key that signed in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SignedIn {
    /// The public id of the key.
    pub key: String,
    /// The digest of the whole key.
    pub key_digest: [u8; 32],
}

/// Stores a new session, and deletes the expired ones.
pub(crate) async fn begin((token, by): &(String, SignedIn), mut tx: Change<'_>) -> Result<()> {
    let now = tx.now().await?;
    tx.execute(sql!("DELETE FROM session WHERE expires <= $1"; now)).await?;
    let oldest = sql!(
        "DELETE FROM session WHERE key = $1 AND digest NOT IN (
             SELECT digest FROM session WHERE key = $1 ORDER BY created DESC, digest LIMIT $2)";
        &by.key, MOST - 1
    );
    tx.execute(oldest).await?;
    let insert = sql!(
        "INSERT INTO session (digest, key, key_digest, created, expires) VALUES ($1, $2, $3, $4, $5)";
        &digest(token), &by.key, &by.key_digest, now, now + LIFETIME
    );
    tx.execute(insert).await
}

/// The key of the session whose token has this digest; `None` if there is no such session at this time.
pub(crate) async fn find(
    digest: &[u8; 32],
    now: i64,
    mut db: impl Tables,
) -> Result<Option<SignedIn>> {
    let query = sql!(
        "SELECT key, key_digest FROM session WHERE digest = $1 AND expires > $2"; digest, now
    );
    let Some(row) = db.row(query).await? else { return Ok(None) };
    let wrong = |_| sqlx::Error::Decode("a stored digest does not have 32 bytes".into());
    let key_digest = row.get::<&[u8]>("key_digest")?.try_into().map_err(wrong)?;
    Ok(Some(SignedIn { key: row.get("key")?, key_digest }))
}

/// Ends the session whose token has this digest, if there is one.
pub(crate) async fn end(digest: &[u8; 32], mut tx: Change<'_>) -> Result<()> {
    tx.execute(sql!("DELETE FROM session WHERE digest = $1"; digest)).await
}
