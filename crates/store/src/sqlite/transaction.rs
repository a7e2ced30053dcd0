//! A transaction of the writer task.

use sqlx::SqliteConnection;

use super::queue::Queue;
use crate::change::Change;
use crate::signals::Effect;
use crate::tables::Connection;

/// The connection of the writer task while a transaction is open.
pub(crate) struct Transaction {
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

impl Transaction {
    /// The part of it that both databases have.
    pub(super) fn change(&mut self) -> Change<'_> {
        let Self { db, now, effects, .. } = self;
        Change { db: Connection::Sqlite(db), now: *now, effects }
    }
}
