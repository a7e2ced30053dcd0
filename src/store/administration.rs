//! Access to the database for the administrative commands, with or without a running server.

use std::path::Path;

use sqlx::{Connection as _, SqliteConnection};

use super::keys::{self, AccessKey, NewKey};
use super::{Error, open};
use crate::job::clock::now;

/// The database of a data directory, opened by an administrative command.
///
/// Each change is one statement, so a running server waits only briefly.
#[derive(Debug)]
pub struct Administration(SqliteConnection);

impl Administration {
    /// Opens the database in a directory. If no server uses it, creates or migrates it where necessary.
    pub async fn open(dir: &Path) -> Result<Self, Error> {
        open::beside(dir, open::BUSY).await.map(Self)
    }

    /// Whether there is a database in a directory.
    #[must_use]
    pub fn is_in(dir: &Path) -> bool {
        dir.join(open::DATABASE).exists()
    }

    /// Creates an access key and returns it. It cannot be read again.
    pub async fn add_key(&mut self, new: &NewKey) -> Result<String, Error> {
        keys::add(&mut self.0, new, now()).await
    }

    /// All access keys, also expired and revoked ones, the oldest first.
    pub async fn keys(&mut self) -> Result<Vec<AccessKey>, Error> {
        keys::list(&mut self.0).await
    }

    /// Revokes the valid keys with this id or name; returns how many.
    pub async fn revoke_keys(&mut self, name: &str) -> Result<u64, Error> {
        keys::revoke(&mut self.0, name, now()).await
    }

    /// Closes the database.
    pub async fn close(self) -> Result<(), Error> {
        Ok(self.0.close().await?)
    }
}
