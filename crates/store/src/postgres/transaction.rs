//! Transactions. A transaction is retried after a conflict with another one.

use std::time::Duration;

use sqlx::Executor;
use tokio::time::timeout;

use super::pool::Borrowed;
use super::{Database, PATIENCE, Parts, hints};
use crate::database::{Change, Connected, Doing, Effect, Error, Lock, Result, Verb};

/// Maximum number of retries of a verb after conflicts with other transactions.
const CONFLICTS: u32 = 10;

/// An open transaction. If it is dropped, its connection is closed, and the database rolls it back.
pub(crate) struct Transaction<'a> {
    /// The database.
    pub(super) of: &'a Parts,
    pub(super) db: Borrowed<'a>,
    /// The signals that are sent after the commit.
    pub(super) effects: Vec<Effect>,
}

impl<'a> Transaction<'a> {
    /// Begins a transaction. If a connection is broken, takes another one.
    pub(super) async fn begin(of: &'a Parts) -> Result<Self> {
        loop {
            let mut db = of.pool.get().await?;
            match Executor::execute(db.connection(), "BEGIN").await.map_err(Error::from) {
                Ok(_) => return Ok(Self { of, db, effects: Vec::new() }),
                Err(Error::Unreachable(_)) if !db.is_new => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// When the transaction began by the clock of the database, in milliseconds since 1970. The SQL function `moment()`
    /// returns the same time.
    pub(super) async fn now(&mut self) -> Result<i64> {
        Change::from(self).now().await
    }

    /// Whether no other server does maintenance until the end of the transaction.
    pub(super) async fn maintains_alone(&mut self) -> Result<bool> {
        let query = sqlx::query_scalar("SELECT pg_try_advisory_xact_lock($1)");
        Ok(query.bind(Lock::Maintenance as i64).fetch_one(self.db.connection()).await?)
    }

    /// Notifies the other servers of deleted results in this transaction. Unlike a hint, this must not be lost:
    /// otherwise a server would go on to answer with a deleted result from its memory.
    async fn tell_deleted(&mut self) -> Result<()> {
        for effect in &self.effects {
            if let Effect::Deleted(key) = effect {
                hints::send(self.db.connection(), &format!("\ndeleted {key}")).await?;
            }
        }
        Ok(())
    }

    /// Commits the changes of a verb, or rolls them back if it has failed. Returns the signals to send.
    async fn end(mut self, mut done: Result<()>) -> Result<Vec<Effect>> {
        if done.is_ok()
            && let Err(error) = self.tell_deleted().await
        {
            done = Err(error);
        }
        let end = if done.is_ok() { "COMMIT" } else { "ROLLBACK" };
        let ended = Executor::execute(self.db.connection(), end).await;
        if ended.is_ok() {
            self.db.has_answered = true;
        }
        done?;
        ended?;
        Ok(self.effects)
    }
}

impl<'a> From<&'a mut Transaction<'_>> for Change<'a> {
    fn from(tx: &'a mut Transaction<'_>) -> Self {
        let Transaction { db, effects, .. } = tx;
        Self { db: Connected::connection(db), now: None, effects }
    }
}

/// Counts the conflicts of a verb with other transactions.
#[derive(Debug, Default)]
pub(super) struct Conflicts(u32);

impl Conflicts {
    /// Whether a verb must be retried. If so, waits for a short time first.
    async fn again(&mut self, error: &Error) -> bool {
        if !error.is_conflict() || self.0 == CONFLICTS {
            return false;
        }
        self.0 += 1;
        // The pause depends on the process, so that two servers do not conflict again at once.
        let pause = u64::from(self.0) * (1 + u64::from(std::process::id()) % 5);
        tokio::time::sleep(Duration::from_millis(pause)).await;
        true
    }
}

impl Database {
    /// Executes a verb in a transaction, and retries it after a conflict. Sends the signals after the commit.
    #[expect(clippy::expect_used, reason = "an attempt succeeds only after its verb")]
    pub(crate) async fn write<Input, V, Answer>(&self, verb: V, input: Input) -> Result<Answer>
    where
        Input: Send + Sync,
        V: for<'a, 'of> Verb<'a, Input, &'a mut Transaction<'of>, Answer = Answer>,
        Answer: Send,
    {
        let mut conflicts = Conflicts::default();
        loop {
            let mut answer = None;
            let attempt = async {
                self.may_write()?;
                let mut tx = Transaction::begin(&self.0).await?;
                let done = verb.apply(&input, &mut tx).await.map(|done| answer = Some(done));
                tx.end(done).await
            };
            if self.settle(Box::pin(attempt), &mut conflicts).await? {
                return Ok(answer.expect("a committed verb has answered"));
            }
        }
    }

    /// Waits for an attempt to execute a verb. After a commit, sends the signals. Returns false if the verb must be
    /// tried again, after a conflict. This function does not depend on the verb, so its code is compiled once.
    async fn settle(
        &self,
        attempt: Doing<'_, Vec<Effect>>,
        conflicts: &mut Conflicts,
    ) -> Result<bool> {
        let done = timeout(PATIENCE, attempt).await.unwrap_or(Err(Error::Exhausted));
        if let Err(error) = &done
            && conflicts.again(error).await
        {
            return Ok(false);
        }
        let effects = self.0.signals.counted(done)?;
        self.0.hints.add(&effects);
        self.0.signals.apply(effects);
        Ok(true)
    }
}

/// Reads with a connection of the pool. If the connection is broken, reads again with another one. This is a macro
/// because the compiler cannot show that the future of a closure with borrowed arguments may move between threads.
macro_rules! reading {
    ($database:expr, $db:ident => $query:expr) => {
        reading!($database, pool, $db => $query)
    };
    ($database:expr, $pool:ident, $db:ident => $query:expr) => {{
        use $crate::database::error::Error;
        let database: &Database = $database;
        let attempts = async {
            loop {
                let mut borrowed = database.0.$pool.get().await?;
                let $db = borrowed.connection();
                let answer: $crate::database::error::Result<_> = async { $query }.await;
                match answer {
                    Err(Error::Unreachable(_)) if !borrowed.is_new => {}
                    Err(error @ Error::Unreachable(_)) => return Err(error),
                    answer => {
                        borrowed.has_answered = true;
                        return answer;
                    }
                }
            }
        };
        let done = tokio::time::timeout($crate::postgres::PATIENCE, attempts)
            .await
            .unwrap_or(Err(Error::Exhausted));
        database.0.signals.counted(done)
    }};
}

pub(super) use reading;
