//! A transaction of the writer task.

use sqlx::SqliteConnection;

use super::queue::Queue;
use crate::database::{Change, Connection, Effect};

/// The connection of the writer task while a transaction is open.
pub(crate) struct Transaction {
    pub(super) db: SqliteConnection,
    /// The time of the transaction, in milliseconds since 1970.
    pub(super) now: i64,
    /// The queued runs. Verbs change them together with the tables.
    pub(super) queue: Queue,
    /// Maximum number of queued jobs.
    pub(super) queue_limit: usize,
    /// The id of the row of this program in the table `program`.
    pub(super) program: i64,
    /// The signals that are sent after the commit.
    pub(super) effects: Vec<Effect>,
}

impl<'a> From<&'a mut Transaction> for Change<'a> {
    fn from(tx: &'a mut Transaction) -> Self {
        let Transaction { db, now, effects, .. } = tx;
        Self { db: Connection::Sqlite(db), now: Some(*now), effects }
    }
}
