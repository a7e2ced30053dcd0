//! Access to the database for the administrative commands, with or without a running server.

use std::path::Path;

use sqlx::{Connection as _, SqliteConnection};

use super::{audit, open, readers};
use crate::store::audit::AuditEntry;
use crate::store::error::Error;

/// The database of a data directory, opened by an administrative command.
///
/// Each change is one short transaction, so a running server waits only briefly.
#[derive(Debug)]
pub struct Administration(pub(super) SqliteConnection);

impl Administration {
    /// Opens the database in a directory. If no server uses it, creates or migrates it where necessary.
    pub async fn open(dir: &Path) -> Result<Self, Error> {
        open::beside(dir, readers::BUSY).await.map(Self)
    }

    /// Whether there is a database in a directory.
    #[must_use]
    pub fn is_in(dir: &Path) -> bool {
        dir.join(open::DATABASE).exists()
    }

    /// Up to `limit` entries of the audit log before another one, the newest first.
    pub async fn audit(
        &mut self,
        before: Option<i64>,
        limit: u32,
    ) -> Result<Vec<AuditEntry>, Error> {
        audit::list(&mut self.0, before, limit).await
    }

    /// Closes the database.
    pub async fn close(self) -> Result<(), Error> {
        Ok(self.0.close().await?)
    }
}
