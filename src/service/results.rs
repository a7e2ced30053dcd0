//! Results: find, read, pin, annotate, remove.

use super::Service;
use fretwork_job::{JobId, Key, Outline};
use fretwork_store::{
    Actor, Changed, Cursor, Editor, Error, Found, Known, Provenance, Removed, Search, StoredResult,
};

impl Service {
    /// The result of a key. Its bytes have been checked against their checksum.
    ///
    /// # Errors
    /// The database fails, or the bytes are damaged.
    pub async fn result(&self, key: &Key) -> Result<Option<StoredResult>, Error> {
        self.0.store.result(key).await
    }

    /// The result of a key, without its bytes if there are more than [`LARGE`](fretwork_store::LARGE).
    ///
    /// # Errors
    /// As [`Service::result`].
    pub async fn small_result(&self, key: &Key) -> Result<Option<StoredResult>, Error> {
        self.0.store.small_result(key).await
    }

    /// Whether the result of a key is stored.
    ///
    /// # Errors
    /// The database fails.
    pub async fn has_result(&self, key: &Key) -> Result<bool, Error> {
        self.0.store.has_result(key).await
    }

    /// Records that a result was read from memory. The least recently read results are evicted first.
    pub fn was_read(&self, key: &Key) {
        self.0.store.was_read(key);
    }

    /// The unfinished job that computes a key, among those within reach.
    ///
    /// # Errors
    /// The database fails.
    pub async fn live_job(&self, key: &Key, reach: Option<&str>) -> Result<Option<JobId>, Error> {
        self.0.store.live_job(key, reach).await
    }

    /// Up to `limit` results that match, after `cursor`.
    ///
    /// # Errors
    /// The database fails.
    pub async fn search(
        &self,
        search: &Search,
        cursor: Option<Cursor>,
        limit: u32,
    ) -> Result<Found, Error> {
        self.0.store.search(search, cursor, limit).await
    }

    /// The stored result whose scenario is nearest to an outline, other than `except`.
    ///
    /// # Errors
    /// The database fails.
    pub async fn nearest(&self, to: &Outline, except: Option<Key>) -> Result<Option<Key>, Error> {
        self.0.store.nearest(to, except).await
    }

    /// The scenario and the summary of a key, which outlive its result.
    ///
    /// # Errors
    /// The database fails.
    pub async fn known(&self, key: &Key) -> Result<Option<Known>, Error> {
        self.0.store.known(key).await
    }

    /// Who computed a result, when, and with which program.
    ///
    /// # Errors
    /// The database fails.
    pub async fn provenance(&self, key: &Key) -> Result<Option<Provenance>, Error> {
        self.0.store.provenance(key).await
    }

    /// Pins a result, or unpins it.
    ///
    /// # Errors
    /// The database fails.
    pub async fn pin(&self, key: &Key, pinned: bool, editor: Editor) -> Result<Changed, Error> {
        self.0.store.pin(key, pinned, editor).await
    }

    /// Writes the note of a result, or removes it without a text.
    ///
    /// # Errors
    /// The database fails.
    pub async fn annotate(
        &self,
        key: &Key,
        text: Option<String>,
        editor: Editor,
    ) -> Result<Changed, Error> {
        self.0.store.annotate(key, text, editor).await
    }

    /// Deletes the bytes of a result. Its scenario and summary stay known.
    ///
    /// # Errors
    /// The database fails.
    pub async fn remove(&self, key: &Key, by: Actor) -> Result<Removed, Error> {
        self.0.store.remove(key, by).await
    }
}
