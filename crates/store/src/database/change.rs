//! Changes that both databases make with the same statements.

use std::future::Future;

use crate::database::error::Result;
use crate::database::signals::Effect;
use crate::database::statement::sql;
use crate::database::tables::{Connected, Connection, Tables as _};

/// An open transaction of either database.
pub(crate) struct Change<'a> {
    pub(crate) db: Connection<'a>,
    /// The time of the transaction in SQLite. PostgreSQL is asked for it, which takes as long as a short statement.
    pub(crate) now: Option<i64>,
    /// The signals that are sent after the commit.
    pub(crate) effects: &'a mut Vec<Effect>,
}

impl Change<'_> {
    /// The time of the transaction, in milliseconds since 1970.
    pub(crate) async fn now(&mut self) -> Result<i64> {
        match self.now {
            Some(now) => Ok(now),
            None => Ok(self.one(sql!("SELECT moment() AS now")).await?.get("now")?),
        }
    }
}

impl Connected for Change<'_> {
    fn connection(&mut self) -> Connection<'_> {
        self.db.connection()
    }
}

/// Adapts a verb that takes a [`Change`], so that it takes the transaction of one of the two databases.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SharedVerb<V>(pub(crate) V);

impl<'a, 'tx, Input, V, Tx> Verb<'a, Input, &'tx mut Tx> for SharedVerb<V>
where
    Input: 'a,
    V: Verb<'a, Input, Change<'tx>>,
    Change<'tx>: From<&'tx mut Tx>,
{
    type Answer = V::Answer;
    type Done = V::Done;

    fn apply(self, input: &'a Input, tx: &'tx mut Tx) -> V::Done {
        self.0.apply(input, tx.into())
    }
}

/// A function that changes the database in a transaction `Tx`.
///
/// It may be called again after a rollback. So it must not keep state between calls.
pub(crate) trait Verb<'a, Input: 'a, Tx>: Copy + Send + Sync + 'static {
    type Answer;
    type Done: Future<Output = Result<Self::Answer>> + Send;

    fn apply(self, input: &'a Input, tx: Tx) -> Self::Done;
}

impl<'a, Input, Tx, Answer, Function, Done> Verb<'a, Input, Tx> for Function
where
    Input: 'a,
    Function: Fn(&'a Input, Tx) -> Done + Copy + Send + Sync + 'static,
    Done: Future<Output = Result<Answer>> + Send,
{
    type Answer = Answer;
    type Done = Done;

    fn apply(self, input: &'a Input, tx: Tx) -> Done {
        self(input, tx)
    }
}
