//! A transaction of the writer task, and the functions that change the database in it.

use std::future::Future;

use sqlx::SqliteConnection;

use super::queue::Queue;
use crate::error::Error;
use crate::signals::Effect;

/// The connection of the writer task while a transaction is open.
pub(super) struct Transaction {
    pub(super) db: SqliteConnection,
    /// The time of all its changes, in milliseconds since 1970.
    pub(super) now: i64,
    /// The queued runs. They change together with the tables.
    pub(super) queue: Queue,
    /// The row of this program on this machine.
    pub(super) program: i64,
    /// What to signal after the commit.
    pub(super) effects: Vec<Effect>,
}

/// A function that changes the database.
///
/// The writer task may call it more than once, each time after a rollback of the call before.
pub(super) trait Verb<'a, Input: 'a>: Copy + Send + Sync + 'static {
    type Answer;
    type Done: Future<Output = Result<Self::Answer, Error>> + Send;

    fn apply(self, input: &'a Input, tx: &'a mut Transaction) -> Self::Done;
}

impl<'a, Input, Answer, Function, Done> Verb<'a, Input> for Function
where
    Input: 'a,
    Function: Fn(&'a Input, &'a mut Transaction) -> Done + Copy + Send + Sync + 'static,
    Done: Future<Output = Result<Answer, Error>> + Send,
{
    type Answer = Answer;
    type Done = Done;

    fn apply(self, input: &'a Input, tx: &'a mut Transaction) -> Done {
        self(input, tx)
    }
}
