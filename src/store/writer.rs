//! The one task that changes the database, and the group commit.

use std::fs::File;
use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;

use sqlx::{Connection, Executor, SqliteConnection};
use tokio::sync::{mpsc, oneshot};
use tokio::time::timeout;

use super::Error;
use super::queue::Queue;
use super::signals::{Effect, READ_AT_ONCE, Signals};
use super::upkeep::{DeleteOld, Evict, Upkeep, WriteReads};
use crate::job::clock::now;

/// Verbs that may wait for the writer; more wait for a place.
const WAITING: usize = 1024;
/// After so many verbs that met a full disk, the others of their batch are not tried.
const HOPELESS: u32 = 3;
/// Verbs in one transaction: enough to spread the cost of a commit, few enough that none waits long.
const BATCH: usize = 256;

/// A change to the database: a verb of a job's life.
///
/// It may be applied more than once, each time after a rollback of the time before.
pub(super) trait Verb: Send + Sync + 'static {
    type Answer: Send + 'static;
    fn apply(
        &self,
        tx: &mut Transaction<'_>,
    ) -> impl Future<Output = Result<Self::Answer, Error>> + Send;
}

/// An open transaction: where a verb works.
pub(super) struct Transaction<'a> {
    pub(super) db: &'a mut SqliteConnection,
    /// The time of everything that happens in it.
    pub(super) now: i64,
    /// What is queued: changed along with the tables.
    pub(super) queue: &'a mut Queue,
    /// The row of this program on this machine.
    pub(super) program: i64,
    /// Whom to tell after the commit.
    pub(super) effects: Vec<Effect>,
}

/// What the writer is told.
pub(super) enum Message {
    Apply(Box<dyn Order>),
    Close(oneshot::Sender<()>),
}

/// A verb on its way, with the place for its answer. Verbs differ in what they answer, so the
/// writer handles them through this.
pub(super) trait Order: Send {
    fn apply<'a>(
        &'a mut self,
        tx: &'a mut Transaction<'_>,
    ) -> Pin<Box<dyn Future<Output = Result<(), Error>> + Send + 'a>>;
    /// Sends the answer off: only after the commit, or after everything failed.
    fn settle(self: Box<Self>, committed: Result<(), Error>);
}

struct Asked<V: Verb> {
    verb: V,
    answer: Option<V::Answer>,
    reply: oneshot::Sender<Result<V::Answer, Error>>,
}

impl<V: Verb> Order for Asked<V> {
    fn apply<'a>(
        &'a mut self,
        tx: &'a mut Transaction<'_>,
    ) -> Pin<Box<dyn Future<Output = Result<(), Error>> + Send + 'a>> {
        Box::pin(async {
            self.answer = Some(self.verb.apply(tx).await?);
            Ok(())
        })
    }

    fn settle(self: Box<Self>, committed: Result<(), Error>) {
        let Self { answer, reply, .. } = *self;
        // Who asked may have left; the change stands all the same.
        let _ = reply.send(committed.and_then(|()| answer.ok_or(Error::Closed)));
    }
}

/// Has a verb applied, and returns its answer once it is committed.
pub(super) async fn ask<V: Verb>(
    writer: &mpsc::Sender<Message>,
    verb: V,
) -> Result<V::Answer, Error> {
    let (reply, answer) = oneshot::channel();
    let order = Box::new(Asked { verb, answer: None, reply });
    writer.send(Message::Apply(order)).await.map_err(|_| Error::Closed)?;
    answer.await.map_err(|_| Error::Closed)?
}

/// Lets the writer finish what it was told before, and end.
pub(super) async fn close(writer: &mpsc::Sender<Message>) {
    let (reply, closed) = oneshot::channel();
    if writer.send(Message::Close(reply)).await.is_ok() {
        // An error means that the writer ended on its own: closed as well.
        let _ = closed.await;
    }
}

/// The state of the writer task.
pub(super) struct Writer {
    pub(super) db: SqliteConnection,
    pub(super) signals: Arc<Signals>,
    /// What is queued; none after a transaction that failed, until it is read anew.
    pub(super) queue: Option<Queue>,
    pub(super) upkeep: Upkeep,
    /// The row of this program on this machine.
    pub(super) program: i64,
    /// Held as long as this process may write to the data directory.
    pub(super) lock: File,
}

impl Writer {
    /// Starts the task. It ends when it is closed or the last sender is gone.
    #[expect(clippy::disallowed_methods, reason = "`close` ends the task and waits for its end")]
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
            let Ok(received) = timeout(self.upkeep.pause(), next).await else {
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
            if self.upkeep.is_due() {
                self.keep_up(false).await;
            }
        }
        if let Err(error) = self.db.close().await {
            tracing::warn!(%error, "the database did not close cleanly; nothing is lost by it");
        }
        drop(self.lock);
        for reply in closing {
            let _ = reply.send(());
        }
    }

    /// Applies a batch in one transaction. If that fails, each verb gets its own, so that none
    /// suffers from another.
    async fn process(&mut self, mut orders: Vec<Box<dyn Order>>) {
        match self.commit(&mut orders).await {
            Ok(()) => {
                for order in orders {
                    order.settle(Ok(()));
                }
            }
            Err(Failed::Within(error)) if orders.len() > 1 => {
                tracing::debug!(%error, verbs = orders.len(), "a batch failed; one by one now");
                let mut hopeless = 0;
                for mut order in orders {
                    if hopeless == HOPELESS {
                        order.settle(Err(error.clone()));
                        continue;
                    }
                    let committed = self.commit(std::slice::from_mut(&mut order)).await;
                    let full = matches!(committed, Err(Failed::Within(Error::Full(_))));
                    hopeless = if full { hopeless + 1 } else { 0 };
                    order.settle(committed.map_err(Failed::into_error));
                }
            }
            Err(failed) => {
                let error = failed.into_error();
                for order in orders {
                    order.settle(Err(error.clone()));
                }
            }
        }
    }

    async fn commit(&mut self, orders: &mut [Box<dyn Order>]) -> Result<(), Failed> {
        // Plain statements, not the library's transactions: on a full disk SQLite rolls back by
        // itself, and the library would count one transaction as open for ever.
        let begun = self.db.execute("BEGIN IMMEDIATE").await;
        begun.map_err(|error| Failed::ToBegin(error.into()))?;
        let mut queue = match self.queue.take() {
            Some(queue) => queue,
            None => match Queue::load(&mut self.db).await {
                Ok(queue) => queue,
                Err(error) => {
                    let _ = self.db.execute("ROLLBACK").await;
                    return Err(Failed::ToBegin(error));
                }
            },
        };
        let mut tx = Transaction {
            db: &mut self.db,
            now: now(),
            queue: &mut queue,
            program: self.program,
            effects: Vec::new(),
        };
        let applied = async {
            for order in orders {
                order.apply(&mut tx).await?;
            }
            tx.db.execute("COMMIT").await?;
            Ok(tx.effects)
        };
        match applied.await {
            Ok(effects) => {
                self.upkeep.note(&effects);
                self.signals.tally.queue_is(queue.len(), queue.working());
                self.queue = Some(queue);
                self.signals.apply(effects);
                Ok(())
            }
            Err(error) => {
                // It fails if SQLite has rolled back already: then there is nothing to do.
                let _ = self.db.execute("ROLLBACK").await;
                Err(Failed::Within(error))
            }
        }
    }

    /// Does a round of what keeps the database in order; in a quiet moment also what takes longer.
    async fn keep_up(&mut self, idle: bool) {
        let reads = self.signals.take_read();
        let many = reads.len() == READ_AT_ONCE;
        if !reads.is_empty() {
            // That they were read is not worth a second attempt.
            let _ = self.chore(WriteReads(reads)).await;
        }
        let old = match self.upkeep.keep_jobs {
            Some(age) => self.chore(DeleteOld(age)).await.unwrap_or(false),
            None => false,
        };
        let budget = self.upkeep.budget;
        let mut room = self.chore(Evict { budget, leave_body: false }).await;
        if let Err(Error::Damaged(_)) = room {
            room = self.chore(Evict { budget, leave_body: true }).await;
        }
        let mut dropped = false;
        if let Ok(room) = room {
            self.signals.tally.room_is(room.used);
            dropped = room.evicted;
            if !dropped && budget.is_some_and(|budget| room.used > budget) {
                let bytes = room.used;
                tracing::warn!(bytes, "the pinned results alone take more room than they may");
            }
        }
        let more = many || old || dropped;
        self.upkeep.did(more);
        if idle && !more {
            self.shrink().await;
        }
    }

    /// Applies a verb that nobody waits for, in its own transaction.
    async fn chore<V: Verb>(&mut self, verb: V) -> Result<V::Answer, Error> {
        let (reply, answer) = oneshot::channel();
        let mut order: Box<dyn Order> = Box::new(Asked { verb, answer: None, reply });
        let committed = self.commit(std::slice::from_mut(&mut order)).await;
        order.settle(committed.map_err(Failed::into_error));
        let answer = answer.await.unwrap_or(Err(Error::Closed));
        answer.inspect_err(|error| {
            self.signals.tally.failed(error);
            let error = error as &dyn std::error::Error;
            tracing::warn!(error, "could not tidy up the database; trying again later");
        })
    }

    /// Moves the log into the database, and gives room that is free for good back to the disk.
    /// Readers may keep a part of the log back; there will be another quiet moment.
    async fn shrink(&mut self) {
        for pragma in ["PRAGMA incremental_vacuum(2000)", "PRAGMA wal_checkpoint(PASSIVE)"] {
            if let Err(error) = self.db.execute(pragma).await {
                tracing::warn!(%error, pragma, "could not make the database smaller");
            }
        }
    }
}

/// Where a transaction failed: if it did not even begin, no verb is to blame.
enum Failed {
    ToBegin(Error),
    Within(Error),
}

impl Failed {
    fn into_error(self) -> Error {
        match self {
            Self::ToBegin(error) | Self::Within(error) => error,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;
    use crate::store::Options;
    use crate::store::open::MIGRATIONS;

    /// Inserts so many bytes under a number; counts how often it was applied.
    struct Insert(i64, i64, Arc<AtomicU32>);

    impl Verb for Insert {
        type Answer = i64;
        async fn apply(&self, tx: &mut Transaction<'_>) -> Result<i64, Error> {
            self.2.fetch_add(1, Ordering::Relaxed);
            sqlx::query("INSERT INTO t VALUES (?1, zeroblob(?2))")
                .bind(self.0)
                .bind(self.1)
                .execute(&mut *tx.db)
                .await?;
            Ok(self.0)
        }
    }

    async fn writer() -> Writer {
        let mut db = SqliteConnection::connect("sqlite::memory:").await.unwrap();
        // What is queued is read anew after a failure.
        MIGRATIONS.run(&mut db).await.unwrap();
        db.execute("CREATE TABLE t (x INTEGER PRIMARY KEY, y BLOB)").await.unwrap();
        let (queue, upkeep) = (Some(Queue::default()), Upkeep::new(&Options::default()));
        let lock = tempfile::tempfile().unwrap();
        Writer { db, signals: Arc::default(), queue, upkeep, program: 1, lock }
    }

    /// Applies insertions of (number, bytes) as one batch; returns what was answered and applied.
    async fn batch(writer: &mut Writer, rows: &[(i64, i64)]) -> (Vec<Result<i64, Error>>, u32) {
        let applied = Arc::new(AtomicU32::new(0));
        let mut orders: Vec<Box<dyn Order>> = Vec::new();
        let mut replies = Vec::new();
        for (number, bytes) in rows {
            let (reply, answer) = oneshot::channel();
            let verb = Insert(*number, *bytes, Arc::clone(&applied));
            orders.push(Box::new(Asked { verb, answer: None, reply }));
            replies.push(answer);
        }
        writer.process(orders).await;
        let mut answers = Vec::new();
        for reply in replies {
            answers.push(reply.await.unwrap());
        }
        (answers, applied.load(Ordering::Relaxed))
    }

    async fn rows(writer: &mut Writer) -> i64 {
        sqlx::query_scalar("SELECT count(*) FROM t").fetch_one(&mut writer.db).await.unwrap()
    }

    #[tokio::test]
    async fn a_batch_without_fault_is_one_transaction() {
        let mut writer = writer().await;
        let (answers, applied) = batch(&mut writer, &[(1, 0), (2, 0), (3, 0)]).await;
        assert!(answers.iter().all(Result::is_ok));
        assert_eq!((applied, rows(&mut writer).await), (3, 3));
    }

    #[tokio::test]
    async fn a_failing_verb_harms_no_other_in_its_batch() {
        let mut writer = writer().await;
        let (answers, applied) = batch(&mut writer, &[(1, 0), (2, 0), (2, 0), (3, 0)]).await;
        let ok: Vec<_> = answers.iter().map(Result::is_ok).collect();
        assert_eq!(ok, [true, true, false, true]);
        // Three up to the fault, then each of the four alone.
        assert_eq!((applied, rows(&mut writer).await), (7, 3));
    }

    #[tokio::test]
    async fn a_full_disk_is_named_and_writing_resumes_when_there_is_space() {
        let mut writer = writer().await;
        writer.db.execute("PRAGMA max_page_count = 60").await.unwrap();
        let (answers, _) = batch(&mut writer, &[(1, 0), (2, 1 << 20), (3, 0)]).await;
        assert!(matches!(answers[..], [Ok(1), Err(Error::Full(_)), Ok(3)]), "{answers:?}");
        writer.db.execute("PRAGMA max_page_count = 10000").await.unwrap();
        let (answers, _) = batch(&mut writer, &[(2, 1 << 20)]).await;
        assert!(matches!(answers[..], [Ok(2)]), "{answers:?}");
        assert_eq!(rows(&mut writer).await, 3);
    }

    #[tokio::test]
    async fn when_no_transaction_begins_every_verb_is_told_at_once() {
        let mut writer = writer().await;
        writer.db.execute("BEGIN").await.unwrap();
        let (answers, applied) = batch(&mut writer, &[(1, 0), (2, 0)]).await;
        assert!(answers.iter().all(Result::is_err));
        assert_eq!(applied, 0);
    }
}
