//! Transactions, which are repeated after a conflict with another one.

use std::time::Duration;

use sqlx::{Executor, Row as _};

use super::hints;
use super::pool::{Borrowed, Pool};
use crate::change::Change;
use crate::error::Error;
use crate::signals::Effect;
use crate::tables::Connected;

/// How long one attempt of a verb may take: longer than a statement may. A server that has vanished never answers.
pub(super) const PATIENCE: Duration = Duration::from_secs(45);

/// How often a verb is done again after a conflict with another transaction.
const CONFLICTS: u32 = 10;

/// An open transaction, and what to signal after its commit. If it is dropped, its connection is closed, and the database rolls
/// it back.
pub(super) struct Transaction<'a> {
    pub(super) db: Borrowed<'a>,
    /// When it began by the clock of the database, in milliseconds since 1970. `moment()` returns it, too.
    pub(super) now: i64,
    pub(super) effects: Vec<Effect>,
}

impl<'a> Transaction<'a> {
    /// Begins a transaction. If a connection is broken, takes another one.
    pub(super) async fn begin(pool: &'a Pool) -> Result<Self, Error> {
        loop {
            let mut db = pool.get().await?;
            match db.connection().fetch_one("BEGIN; SELECT moment()").await.map_err(Error::from) {
                Ok(row) => return Ok(Self { db, now: row.try_get(0)?, effects: Vec::new() }),
                Err(Error::Unreachable(_)) if !db.is_new() => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// The part of it that both databases have.
    pub(super) fn change(&mut self) -> Change<'_> {
        Change {
            db: Connected::connection(&mut self.db),
            now: self.now,
            effects: &mut self.effects,
        }
    }

    /// Tells the other servers what is deleted, when the transaction commits. This is no hint: a server that does not hear it
    /// would answer with the result until its connection breaks.
    async fn tell_deleted(&mut self) -> Result<(), Error> {
        for effect in &self.effects {
            if let Effect::Deleted(key) = effect {
                hints::send(self.db.connection(), &format!("\ndeleted {key}")).await?;
            }
        }
        Ok(())
    }

    /// Commits the changes of a verb, or rolls them back if it has failed.
    pub(super) async fn end<T>(
        mut self,
        mut answer: Result<T, Error>,
    ) -> Result<(T, Vec<Effect>), Error> {
        if answer.is_ok()
            && let Err(error) = self.tell_deleted().await
        {
            answer = Err(error);
        }
        let end = if answer.is_ok() { "COMMIT" } else { "ROLLBACK" };
        let ended = Executor::execute(self.db.connection(), end).await;
        if ended.is_ok() {
            self.db.answered();
        }
        let answer = answer?;
        ended?;
        Ok((answer, self.effects))
    }
}

/// Counts the conflicts of a verb with other transactions.
#[derive(Debug, Default)]
pub(super) struct Conflicts(u32);

impl Conflicts {
    /// Whether a verb must be done again. Waits a moment before.
    pub(super) async fn again<T>(&mut self, done: &Result<T, Error>) -> bool {
        let is_conflict = done.as_ref().is_err_and(Error::is_conflict);
        if !is_conflict || self.0 == CONFLICTS {
            return false;
        }
        self.0 += 1;
        // Servers that have met must not meet again.
        let pause = u64::from(self.0) * (1 + u64::from(std::process::id()) % 5);
        tokio::time::sleep(Duration::from_millis(pause)).await;
        true
    }
}

/// Does a verb in a transaction, again after a conflict, and signals its changes after the commit. This is a macro because
/// the compiler cannot show that the future of a closure with borrowed arguments may move between threads.
macro_rules! writing {
    ($database:expr, $tx:ident => $verb:expr) => {{
        let database: &Database = $database;
        let mut conflicts = $crate::postgres::transaction::Conflicts::default();
        loop {
            let attempt = async {
                database.may_write()?;
                let mut transaction =
                    $crate::postgres::Transaction::begin(&database.0.pool).await?;
                let $tx = &mut transaction;
                let answer: Result<_, Error> = async { $verb }.await;
                transaction.end(answer).await
            };
            let done = tokio::time::timeout($crate::postgres::transaction::PATIENCE, attempt)
                .await
                .unwrap_or(Err(Error::Exhausted));
            if !conflicts.again(&done).await {
                break database.settle(done);
            }
        }
    }};
}

/// Reads with a connection of the pool. If the connection is broken, reads again with another one.
macro_rules! reading {
    ($database:expr, $db:ident => $query:expr) => {
        reading!($database, pool, $db => $query)
    };
    ($database:expr, $pool:ident, $db:ident => $query:expr) => {{
        let database: &Database = $database;
        let attempts = async {
            loop {
                let mut borrowed = database.0.$pool.get().await?;
                let $db = borrowed.connection();
                let answer: Result<_, Error> = async { $query }.await;
                match answer {
                    Err(Error::Unreachable(_)) if !borrowed.is_new() => {}
                    Err(error @ Error::Unreachable(_)) => return Err(error),
                    answer => {
                        borrowed.answered();
                        return answer;
                    }
                }
            }
        };
        let done = tokio::time::timeout($crate::postgres::transaction::PATIENCE, attempts)
            .await
            .unwrap_or(Err(Error::Exhausted));
        database.0.signals.counted(done)
    }};
}

pub(super) use {reading, writing};
