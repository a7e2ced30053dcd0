//! The tables for a command that looks after them, with or without a server at work on them.

use std::path::Path;

use sqlx::{Connection as _, SqliteConnection};

use super::keys::{self, AccessKey, NewKey};
use super::{Error, now, open};

/// The database of a data directory, for one administrative command.
///
/// Each change is one statement: a server beside it waits for no longer than that.
#[derive(Debug)]
pub struct Desk(SqliteConnection);

impl Desk {
    /// Opens the database in a directory. If no server uses it, it is made if it does not exist, and
    /// brought up to date.
    pub async fn open(dir: &Path) -> Result<Self, Error> {
        open::beside(dir, open::BUSY).await.map(Self)
    }

    /// Whether there is a database in a directory.
    #[must_use]
    pub fn is_in(dir: &Path) -> bool {
        dir.join(open::DATABASE).exists()
    }

    /// Makes an access key and returns it: the only time that it is seen.
    pub async fn add_key(&mut self, new: &NewKey) -> Result<String, Error> {
        keys::add(&mut self.0, new, now()).await
    }

    /// All access keys there ever were, the oldest first.
    pub async fn keys(&mut self) -> Result<Vec<AccessKey>, Error> {
        keys::list(&mut self.0).await
    }

    /// Takes back the keys of this id or name that are in force; returns how many.
    pub async fn revoke_keys(&mut self, name: &str) -> Result<u64, Error> {
        keys::revoke(&mut self.0, name, now()).await
    }

    /// Lets the database go.
    pub async fn close(self) -> Result<(), Error> {
        Ok(self.0.close().await?)
    }
}
