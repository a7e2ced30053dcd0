//! The writer task, which makes all changes of the database. It commits many changes in one transaction (group commit).

use std::sync::Arc;

use futures_util::future::BoxFuture;
use sqlx::{AssertSqlSafe, Connection, Executor, Row as _};
use tokio::sync::{mpsc, oneshot};
use tokio::time::timeout;

use super::eviction::{self, ROOM, Room, make_room};
use super::files::Files;
use super::ledger::Ledger;
use super::log::{self, Log};
use super::maintenance::{CHUNKS, Maintenance, delete_old, write_clock, write_reads};
use super::queue::Queue;
use super::transaction::Transaction;
use crate::database::{Error, READ_AT_ONCE, Result, SharedVerb, Signals, Verb};
use crate::jobs::maintenance::{delete_chunks, forget_evicted};
use fretwork_job::clock::now;

/// Maximum number of messages that wait for the writer task. Senders of further messages wait.
const WAITING: usize = 1024;
/// After this number of consecutive changes failed because the disk is full, the other changes of the batch fail
/// without an attempt.
const HOPELESS: u32 = 3;
/// Maximum number of changes in one transaction. Many changes share the cost of one commit, but no change waits long.
const BATCH: usize = 256;
/// Number of free pages that maintenance returns to the file system at a time. SQLite moves other pages into their
/// places, which takes a few milliseconds.
const GIVEN_BACK: i64 = 256;

/// A message to the writer task.
pub(super) enum Message {
    Apply(Box<dyn Order>),
    Close(oneshot::Sender<()>),
}

/// A [`Verb`] with its input, and with the channel for its answer. This trait hides their types, so that different
/// verbs fit into one queue.
pub(super) trait Order: Send {
    fn apply<'a>(&'a mut self, tx: &'a mut Transaction) -> BoxFuture<'a, Result<()>>;

    /// Sends the answer. The transaction must have ended.
    fn settle(self: Box<Self>, committed: Result<()>);
}

struct Pending<V, Input, Answer> {
    verb: V,
    input: Input,
    answer: Option<Answer>,
    reply: oneshot::Sender<Result<Answer>>,
}

impl<V, Input, Answer> Order for Pending<V, Input, Answer>
where
    V: for<'a> Verb<'a, Input, &'a mut Transaction, Answer = Answer>,
    Input: Send + Sync,
    Answer: Send,
{
    fn apply<'a>(&'a mut self, tx: &'a mut Transaction) -> BoxFuture<'a, Result<()>> {
        Box::pin(async {
            self.answer = Some(self.verb.apply(&self.input, tx).await?);
            Ok(())
        })
    }

    fn settle(self: Box<Self>, committed: Result<()>) {
        let Self { answer, reply, .. } = *self;
        // If the caller was dropped, the change is still committed.
        let _ = reply.send(committed.and_then(|()| answer.ok_or(Error::Closed)));
    }
}

type PendingAnswer<Answer> = oneshot::Receiver<Result<Answer>>;

/// A verb with its input, for the writer task. The receiver gets the answer after the commit.
pub(super) fn order<V, Input, Answer>(
    verb: V,
    input: Input,
) -> (Box<dyn Order>, PendingAnswer<Answer>)
where
    V: for<'a> Verb<'a, Input, &'a mut Transaction, Answer = Answer>,
    Input: Send + Sync + 'static,
    Answer: Send + 'static,
{
    let (reply, answer) = oneshot::channel();
    (Box::new(Pending { verb, input, answer: None, reply }), answer)
}

/// Lets the writer task complete all earlier messages and end.
pub(super) async fn close(writer: &mpsc::Sender<Message>) {
    let (reply, closed) = oneshot::channel();
    if writer.send(Message::Close(reply)).await.is_ok() {
        // An error means that the writer task has already ended.
        let _ = closed.await;
    }
}

/// The state of the writer task.
pub(super) struct Writer {
    tx: Transaction,
    /// Whether a transaction has failed, so that the queue must be read from the tables again.
    queue_is_stale: bool,
    signals: Arc<Signals>,
    maintenance: Maintenance,
    ledger: Ledger,
    log: Log,
    files: Files,
    /// The value of SQLite's `total_changes()` after the last commit.
    changes: i64,
}

/// Commits a transaction. First increments the number of commits, unless nothing has changed since `total_changes()`
/// was ?1.
const COMMIT: &str = "
    UPDATE room SET commits = commits + 1, committed = ?2 WHERE total_changes() > ?1
    RETURNING commits, total_changes() AS changes, (
        SELECT (page_count - freelist_count) * page_size
        FROM pragma_page_count, pragma_freelist_count, pragma_page_size
    ) AS used;
    COMMIT";

impl Writer {
    pub(super) fn new(
        tx: Transaction,
        signals: Arc<Signals>,
        maintenance: Maintenance,
        (ledger, log, files): (Ledger, Log, Files),
    ) -> Self {
        Self { tx, queue_is_stale: false, signals, maintenance, ledger, log, files, changes: 0 }
    }

    /// Starts the task. It ends when it is closed or the last sender is dropped.
    #[expect(clippy::disallowed_methods, reason = "`close` waits until the task has ended")]
    pub(super) fn start(self) -> mpsc::Sender<Message> {
        let (sender, receiver) = mpsc::channel(WAITING);
        tokio::spawn(self.run(receiver));
        sender
    }

    async fn run(mut self, mut messages: mpsc::Receiver<Message>) {
        let mut inbox = Vec::with_capacity(BATCH);
        let mut closing = Vec::new();
        loop {
            let next = messages.recv_many(&mut inbox, BATCH);
            let Ok(received) = timeout(self.maintenance.pause(), next).await else {
                self.keep_up(true).await;
                continue;
            };
            if received == 0 {
                break;
            }
            let mut orders = Vec::with_capacity(received);
            for message in inbox.drain(..) {
                match message {
                    Message::Apply(order) => orders.push(order),
                    Message::Close(reply) => {
                        messages.close();
                        closing.push(reply);
                    }
                }
            }
            self.process(orders).await;
            if self.log.is_long() {
                for pragma in log::restart() {
                    self.pragma(&pragma).await;
                }
                self.log.tried();
            }
            if self.maintenance.is_due() {
                self.keep_up(false).await;
            }
        }
        if let Err(error) = self.tx.db.close().await {
            tracing::warn!(%error, "the database was not closed cleanly; no data is lost");
        }
        // Unlocks the directory.
        drop(self.ledger);
        for reply in closing {
            let _ = reply.send(());
        }
    }

    /// Applies a batch in one transaction. If that fails, applies each verb in its own transaction, so that only the
    /// faulty verbs fail.
    async fn process(&mut self, mut orders: Vec<Box<dyn Order>>) {
        match self.commit(&mut orders).await {
            Ok(Ok(())) => {
                for order in orders {
                    order.settle(Ok(()));
                }
            }
            Ok(Err(error)) if orders.len() > 1 => {
                tracing::debug!(%error, verbs = orders.len(), "a batch failed; now each change has its own transaction");
                let mut hopeless = 0;
                for mut order in orders {
                    if hopeless == HOPELESS {
                        order.settle(Err(error.clone()));
                        continue;
                    }
                    let committed = self.commit(std::slice::from_mut(&mut order)).await;
                    let full = matches!(committed, Ok(Err(Error::Full(_))));
                    hopeless = if full { hopeless + 1 } else { 0 };
                    order.settle(committed.flatten());
                }
            }
            Ok(Err(error)) | Err(error) => {
                for order in orders {
                    order.settle(Err(error.clone()));
                }
            }
        }
    }

    /// Applies verbs in one transaction. The outer error means that no transaction could begin, so every verb would fail
    /// with it. The inner error is that of a verb or of the commit.
    async fn commit(&mut self, orders: &mut [Box<dyn Order>]) -> Result<Result<()>> {
        self.begin().await?;
        if let Err(error) = self.apply(orders).await {
            self.roll_back().await;
            return Ok(Err(error));
        }
        let effects = std::mem::take(&mut self.tx.effects);
        self.signals.tally.queue_is(self.tx.queue.len(), self.tx.queue.working());
        self.signals.apply(effects);
        Ok(Ok(()))
    }

    async fn begin(&mut self) -> Result<()> {
        // A commit to a deleted or moved file would be acknowledged, but lost.
        self.files.check()?;
        // This does not use a transaction of sqlx. If the disk is full, SQLite rolls back by itself, and sqlx would
        // treat the transaction as open for ever.
        self.tx.db.execute("BEGIN IMMEDIATE").await?;
        if self.queue_is_stale {
            match Queue::load(&mut self.tx.db).await {
                Ok(queue) => self.tx.queue = queue,
                Err(error) => {
                    self.roll_back().await;
                    return Err(error);
                }
            }
            self.queue_is_stale = false;
        }
        self.tx.now = now();
        Ok(())
    }

    async fn apply(&mut self, orders: &mut [Box<dyn Order>]) -> Result<()> {
        for order in orders {
            order.apply(&mut self.tx).await?;
        }
        let commit = sqlx::query(COMMIT).bind(self.changes).bind(self.tx.now);
        // There is no row if nothing was changed.
        if let Some(row) = commit.fetch_all(&mut self.tx.db).await?.first() {
            // The number does not include the update of `room` by this statement.
            self.changes = row.try_get::<i64, _>("changes")? + 1;
            self.maintenance.note(row.try_get("used")?);
            self.ledger.note(row.try_get("commits")?, self.tx.now);
        }
        Ok(())
    }

    async fn roll_back(&mut self) {
        // This fails if SQLite has already rolled back.
        let _ = self.tx.db.execute("ROLLBACK").await;
        // SQLite counts changes that were rolled back, too.
        let changes = sqlx::query_scalar("SELECT total_changes()").fetch_one(&mut self.tx.db);
        self.changes = changes.await.unwrap_or(self.changes);
        self.tx.effects.clear();
        self.queue_is_stale = true;
    }

    /// Does one round of maintenance. If `idle`, also shrinks the files, which is slow.
    async fn keep_up(&mut self, idle: bool) {
        let reads = self.signals.take_read();
        let many = reads.len() == READ_AT_ONCE;
        if !reads.is_empty() {
            // If this fails, the only effect is that a recently read result may be evicted.
            let _ = self.chore(write_reads, reads).await;
        }
        let time = self.maintenance.clock.advance(now());
        if let Some(time) = self.maintenance.clock.unstored() {
            let _ = self.chore(write_clock, time).await;
        }
        let old = match self.maintenance.keep_jobs {
            Some(age) => {
                let age = i64::try_from(age.as_millis()).unwrap_or(i64::MAX);
                self.chore(delete_old, time.saturating_sub(age)).await.unwrap_or(false)
            }
            None => false,
        };
        let chunks = self.chore(SharedVerb(delete_chunks), CHUNKS).await.unwrap_or(false);
        let _ = self.chore(SharedVerb(forget_evicted), time).await;
        let exceeds = match self.maintenance.budget {
            // Chunks that no study needs are deleted before results.
            Some(budget) if !chunks => self.make_room(budget).await,
            _ => false,
        };
        if let Ok(bytes) = self.chore(eviction::stored, ()).await {
            self.signals.tally.bytes.set(bytes);
        }
        let spare = self.give_back().await;
        let more = many || old || chunks || exceeds || spare;
        self.maintenance.did(more);
        if idle && !more {
            self.shrink().await;
        }
    }

    /// Deletes rows to bring the database within its budget. Returns whether there is more to delete.
    async fn make_room(&mut self, budget: u64) -> bool {
        let mut room = self.chore(make_room, (budget, ROOM, false)).await;
        if let Err(Error::Damaged(_)) = room {
            // The transaction failed at a damaged body. So this deletes one row at a time up to that body, and then
            // evicts its result without deleting the body.
            room = self.chore(make_room, (budget, 1, false)).await;
            if let Err(Error::Damaged(_)) = room {
                room = self.chore(make_room, (budget, 1, true)).await;
            }
        }
        let Ok(Room { used, deleted }) = room else {
            self.maintenance.could_not_delete();
            return false;
        };
        let is_stuck = deleted == 0 && used > budget;
        if deleted > 0 {
            tracing::debug!(deleted, used, "deleted what was used longest ago");
        }
        if self.maintenance.cannot_delete(is_stuck.then_some(used)) {
            tracing::warn!(
                used,
                budget,
                "the database exceeds --keep-results, and only pinned results and unfinished jobs are left; unpin \
                 results or raise the limit"
            );
        }
        deleted > 0 && used > budget
    }

    /// Applies a verb of the maintenance in its own transaction.
    async fn chore<V, Input, Answer>(&mut self, verb: V, input: Input) -> Result<Answer>
    where
        V: for<'a> Verb<'a, Input, &'a mut Transaction, Answer = Answer>,
        Input: Send + Sync + 'static,
        Answer: Send + 'static,
    {
        let (mut order, answer) = order(verb, input);
        let committed = self.commit(std::slice::from_mut(&mut order)).await;
        order.settle(committed.flatten());
        answer.await.unwrap_or(Err(Error::Closed)).inspect_err(|error| {
            self.signals.tally.failed(error);
            let error = error as &dyn std::error::Error;
            tracing::warn!(error, "maintenance of the database failed; it will be tried again");
        })
    }

    /// Returns some free pages to the file system, but keeps a part of them for the next changes. Returns whether there
    /// may be more pages to return.
    async fn give_back(&mut self) -> bool {
        let query = sqlx::query_as(
            "SELECT page_count, freelist_count FROM pragma_page_count, pragma_freelist_count",
        );
        let Ok((pages, free)) = query.fetch_one(&mut self.tx.db).await else { return false };
        let (pages, free): (i64, i64) = (pages, free);
        if free <= (pages / 16).max(GIVEN_BACK) {
            return false;
        }
        self.pragma(&format!("PRAGMA incremental_vacuum({GIVEN_BACK})")).await
    }

    /// Returns free pages to the file system, and copies the log into the database. Readers may delay a part of this to
    /// a later round.
    async fn shrink(&mut self) {
        for pragma in ["PRAGMA incremental_vacuum(2000)", "PRAGMA wal_checkpoint(PASSIVE)"] {
            self.pragma(pragma).await;
        }
    }

    /// Executes a pragma that makes the files smaller. Returns whether it succeeded.
    async fn pragma(&mut self, pragma: &str) -> bool {
        let done = self.tx.db.execute(AssertSqlSafe(pragma.to_owned())).await;
        done.inspect_err(|error| tracing::warn!(%error, pragma, "cannot shrink the database"))
            .is_ok()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::atomic::{AtomicU32, Ordering};

    use sqlx::SqliteConnection;

    use super::*;
    use crate::jobs::ages::AgeClock;
    use crate::sqlite::schema::migrate;

    /// Inserts a row of this number and size. Counts its calls.
    async fn insert(
        (number, bytes, calls): &(i64, i64, Arc<AtomicU32>),
        tx: &mut Transaction,
    ) -> Result<i64, Error> {
        calls.fetch_add(1, Ordering::Relaxed);
        sqlx::query("INSERT INTO t VALUES (?1, zeroblob(?2))")
            .bind(number)
            .bind(bytes)
            .execute(&mut tx.db)
            .await?;
        Ok(*number)
    }

    async fn writer() -> Writer {
        let mut db = SqliteConnection::connect("sqlite::memory:").await.unwrap();
        // After a failure, the writer reads the queue from the tables, so they must exist.
        migrate(&mut db, Path::new("db")).await.unwrap();
        db.execute("CREATE TABLE t (x INTEGER PRIMARY KEY, y BLOB)").await.unwrap();
        let queue = Queue::default();
        let ledger = Ledger::open(tempfile::tempfile().unwrap(), &mut db).await.unwrap();
        let maintenance = Maintenance::new(None, None, AgeClock::at(None));
        let (queue_limit, effects) = (1, Vec::new());
        let tx = Transaction { db, now: 0, queue, queue_limit, program: 1, effects };
        let parts = (ledger, Log::new("".into(), 0), Files::default());
        Writer::new(tx, Arc::default(), maintenance, parts)
    }

    /// Applies insertions of (number, bytes) as one batch. Returns the answers and the number of calls.
    async fn batch(writer: &mut Writer, rows: &[(i64, i64)]) -> (Vec<Result<i64, Error>>, u32) {
        let calls = Arc::new(AtomicU32::new(0));
        let (orders, replies): (Vec<_>, Vec<_>) = rows
            .iter()
            .map(|(number, bytes)| order(insert, (*number, *bytes, Arc::clone(&calls))))
            .unzip();
        writer.process(orders).await;
        let mut answers = Vec::new();
        for reply in replies {
            answers.push(reply.await.unwrap());
        }
        (answers, calls.load(Ordering::Relaxed))
    }

    async fn rows(writer: &mut Writer) -> i64 {
        sqlx::query_scalar("SELECT count(*) FROM t").fetch_one(&mut writer.tx.db).await.unwrap()
    }

    #[tokio::test]
    async fn a_batch_without_errors_is_one_transaction() {
        let mut writer = writer().await;
        let (answers, applied) = batch(&mut writer, &[(1, 0), (2, 0), (3, 0)]).await;
        assert!(answers.iter().all(Result::is_ok));
        assert_eq!((applied, rows(&mut writer).await), (3, 3));
    }

    #[tokio::test]
    async fn a_failed_operation_does_not_affect_the_others_in_its_batch() {
        let mut writer = writer().await;
        let (answers, applied) = batch(&mut writer, &[(1, 0), (2, 0), (2, 0), (3, 0)]).await;
        let ok: Vec<_> = answers.iter().map(Result::is_ok).collect();
        assert_eq!(ok, [true, true, false, true]);
        // The first transaction calls the verb three times up to the failure. Then each of the four is called alone.
        assert_eq!((applied, rows(&mut writer).await), (7, 3));
    }

    #[tokio::test]
    async fn a_full_disk_is_reported_and_writing_resumes_when_there_is_space() {
        let mut writer = writer().await;
        writer.tx.db.execute("PRAGMA max_page_count = 60").await.unwrap();
        let (answers, _) = batch(&mut writer, &[(1, 0), (2, 1 << 20), (3, 0)]).await;
        assert!(matches!(answers[..], [Ok(1), Err(Error::Full(_)), Ok(3)]), "{answers:?}");
        writer.tx.db.execute("PRAGMA max_page_count = 10000").await.unwrap();
        let (answers, _) = batch(&mut writer, &[(2, 1 << 20)]).await;
        assert!(matches!(answers[..], [Ok(2)]), "{answers:?}");
        assert_eq!(rows(&mut writer).await, 3);
    }

    #[tokio::test]
    async fn all_operations_fail_if_no_transaction_can_begin() {
        let mut writer = writer().await;
        writer.tx.db.execute("BEGIN").await.unwrap();
        let (answers, applied) = batch(&mut writer, &[(1, 0), (2, 0)]).await;
        assert!(answers.iter().all(Result::is_err));
        assert_eq!(applied, 0);
    }
}
