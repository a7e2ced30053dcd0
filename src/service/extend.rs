//! Studies that extend an earlier one.

use super::Service;
use crate::job::{Prepared, Submission};
use crate::store::Error;

/// Why a study cannot extend the result that its submission names.
#[derive(Debug, thiserror::Error)]
pub enum NotExtended {
    /// A sentence for the client: what is wrong with the member `extends`.
    #[error("{0}")]
    Refused(String),
    /// The study could not be prepared: a thread has panicked.
    #[error("the study could not be prepared")]
    Panicked,
    /// The database failed.
    #[error(transparent)]
    Store(#[from] Error),
}

impl Service {
    /// Prepares the task of a submission so that it takes the rows of the result that `extends` names. If that result was
    /// evicted, deleted or imported, all points are computed.
    ///
    /// # Errors
    /// The study does not extend that result, or the database fails.
    pub async fn extend(&self, submission: &Submission) -> Result<Prepared, NotExtended> {
        let prepared = submission.prepared.clone();
        let Some(key) = submission.extends else { return Ok(prepared) };
        let Some(earlier) = self.known(&key).await? else {
            let detail =
                "is the key of no result. Wait until that sweep has succeeded, or remove `extends`";
            return Err(NotExtended::Refused(detail.to_owned()));
        };
        // A study takes milliseconds to prepare.
        let extending = tokio::task::spawn_blocking(move || {
            let extended = prepared.extending(&key, &earlier.asked)?;
            let is_usable = earlier.held && !earlier.imported;
            Ok(if is_usable { extended } else { prepared })
        });
        // The rows are needed when the study begins, so they should not be evicted before.
        self.was_read(&key);
        extending.await.map_err(|_| NotExtended::Panicked)?.map_err(NotExtended::Refused)
    }
}
