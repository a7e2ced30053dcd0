//! The database as a file of SQLite in a data directory, for one server.
//!
//! One writer task makes all changes. It takes all waiting messages, applies them in one immediate
//! transaction, and answers after the commit. So an acknowledged change survives a crash of the process.
//! A pool of read-only connections serves reads.

pub(super) mod cancel;
pub(super) mod chunks;
mod eviction;
mod files;
pub(super) mod ledger;
mod log;
pub(super) mod maintenance;
pub(super) mod open;
mod outline;
mod queue;
mod readers;
pub(super) mod runs;
pub(super) mod schema;
pub(super) mod storing;
pub(super) mod submit;
mod transaction;
mod writer;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{Semaphore, mpsc};

use crate::database::{Error, Purpose, Result, Row, Signals, Statement, Tables, Verb, sql};
use fretwork_job::clock::now;

use readers::Readers;
use transaction::Transaction;
use writer::Message;

/// The open database, as a handle that is cheap to clone.
#[derive(Debug, Clone)]
pub(super) struct Database {
    writer: mpsc::Sender<Message>,
    readers: Arc<Readers>,
    /// One connection for large results: a connection keeps the memory that it has allocated.
    large: Arc<Readers>,
    /// One connection for access keys: every request needs them, and must not wait for long lists.
    keys: Arc<Readers>,
    /// Permits for scans of all results. They limit the number of concurrent scans.
    scans: Arc<Semaphore>,
    signals: Arc<Signals>,
    /// The data directory.
    dir: Arc<Path>,
}

impl Database {
    pub(super) fn free_bytes(&self) -> Option<u64> {
        fs4::available_space(&self.dir).ok()
    }

    pub(super) async fn close(&self) {
        self.readers.close().await;
        self.large.close().await;
        self.keys.close().await;
        writer::close(&self.writer).await;
    }

    /// The time that the oldest queued run has waited.
    pub(super) async fn longest_wait(&self) -> Result<Duration> {
        let query = sql!(
            "SELECT created FROM run INDEXED BY run_unfinished
             WHERE state = 'queued' AND finished IS NULL ORDER BY id LIMIT 1"
        );
        let oldest = self.read(Purpose::Any, query).await?.pop();
        let waited = oldest.map(|row| row.get::<i64>("created")).transpose()?;
        // The clock of the system may have been set back.
        Ok(Duration::from_millis(waited.map_or(0, |oldest| now() - oldest).max(0).unsigned_abs()))
    }

    /// Reads with a connection of the pool.
    pub(super) async fn read(&self, purpose: Purpose, statement: Statement) -> Result<Vec<Row>> {
        let done = async {
            let (readers, permit) = match purpose {
                Purpose::Any => (&self.readers, None),
                Purpose::Scan => (&self.readers, Some(self.scans.acquire().await)),
                Purpose::Large => (&self.large, None),
                Purpose::Keys => (&self.keys, None),
            };
            let _permit = permit.transpose().map_err(|_| Error::Closed)?;
            readers.get().await?.connection.rows(statement).await
        };
        self.signals.counted(done.await)
    }

    /// Lets the writer task execute a verb. Returns the answer of the verb after the commit.
    pub(super) async fn write<Input, V, Answer>(&self, verb: V, input: Input) -> Result<Answer>
    where
        Input: Send + Sync + 'static,
        V: for<'a> Verb<'a, Input, &'a mut Transaction, Answer = Answer>,
        Answer: Send + 'static,
    {
        let (order, answer) = writer::order(verb, input);
        let done = async {
            self.writer.send(Message::Apply(order)).await.map_err(|_| Error::Closed)?;
            answer.await.map_err(|_| Error::Closed)?
        };
        self.signals.counted(done.await)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Options;
    use crate::results::library::Provenance;
    use crate::results::page::page;
    use crate::results::search::Search;
    use fretwork_job::Key;
    use open::{READERS, SCANS};

    async fn open() -> (tempfile::TempDir, Database) {
        let dir = tempfile::tempdir().unwrap();
        let db = Database::open(dir.path(), &Options::default(), Arc::default()).await.unwrap();
        (dir, db)
    }

    /// The query plan of SQLite for a statement.
    async fn plan(db: &Database, statement: Statement) -> Vec<String> {
        let rows = db.read(Purpose::Any, statement.explained()).await.unwrap();
        rows.iter().map(|row| row.get("detail").unwrap()).collect()
    }

    /// An index is needed because a result can have a million jobs.
    #[tokio::test]
    async fn the_jobs_of_a_result_are_counted_with_an_index() {
        let (_dir, db) = open().await;
        let steps = plan(&db, Provenance::query(&Key::from_bytes([0; 32]), "ada")).await;
        let search = "SEARCH job USING COVERING INDEX job_key (key=?)";
        assert!(steps.iter().any(|step| step == search), "{steps:?}");
        assert!(steps.iter().all(|step| !step.starts_with("SCAN")), "{steps:?}");
    }

    #[tokio::test]
    async fn searches_for_the_newest_results_use_an_index() {
        let (_dir, db) = open().await;
        for (name, value, index) in [
            ("pinned", "false", "outline_created"),
            ("owner", "ann", "outline_owner"),
            ("evicted", "true", "outline_absent"),
        ] {
            let mut search = Search::default();
            search.set(name, value).unwrap();
            let cursor = "4014000000000000-3".parse().ok();
            let steps = plan(&db, page(&search, cursor, 50)).await;
            let used = format!("SEARCH outline USING INDEX {index}");
            assert!(steps.iter().any(|step| step.contains(&used)), "{steps:?}");
        }
    }

    /// Indexes are needed because a database can have a million jobs, results and scenarios.
    #[tokio::test]
    async fn the_query_for_the_oldest_rows_uses_indexes() {
        let (_dir, db) = open().await;
        let steps = plan(&db, eviction::oldest()).await;
        for step in [
            "SCAN result USING INDEX result_unread",
            "SEARCH result USING INDEX result_evicted (evicted>?)",
            "SEARCH job USING COVERING INDEX job_key (key=?)",
        ] {
            assert!(steps.iter().any(|found| found == step), "{steps:#?}");
        }
        // Only the few rows of each kind are sorted.
        let sorted = steps.iter().filter(|step| *step == "USE TEMP B-TREE FOR ORDER BY").count();
        assert_eq!(sorted, 3, "{steps:#?}");
    }

    #[tokio::test]
    async fn access_keys_do_not_wait_for_other_reads() {
        let (_dir, db) = open().await;
        let mut busy = Vec::new();
        for _ in 0..READERS {
            busy.push(db.readers.get().await.unwrap());
        }
        let query = sql!("SELECT id FROM access_key");
        assert!(db.read(Purpose::Keys, query).await.unwrap().is_empty());
        drop(busy);
        db.close().await;
    }

    #[tokio::test]
    async fn jobs_can_be_read_while_searches_wait() {
        let (_dir, db) = open().await;
        let permits = db.scans.acquire_many(u32::try_from(SCANS).unwrap()).await.unwrap();
        let search = page(&Search::default(), None, 1);
        let mut search = std::pin::pin!(db.read(Purpose::Scan, search));
        let reads = async {
            for _ in 0..100 {
                let query = sql!("SELECT id FROM job");
                assert!(db.read(Purpose::Any, query).await.unwrap().is_empty());
            }
        };
        tokio::select! {
            _ = &mut search => panic!("there is no permit for it"),
            () = reads => {}
        }
        drop(permits);
        assert!(search.await.unwrap().is_empty());
    }
}
