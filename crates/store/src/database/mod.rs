//! The tables, as both databases have them: statements, rows, transactions, signals and errors.

pub(crate) mod body;
pub(crate) mod caution;
pub(crate) mod change;
pub(crate) mod error;
pub(crate) mod options;
pub(crate) mod place;
pub(crate) mod reach;
pub(crate) mod row;
pub(crate) mod signals;
pub(crate) mod statement;
pub(crate) mod tables;
pub(crate) mod tally;
pub(crate) mod usage;
pub(crate) mod words;

pub(crate) use body::Body;
pub(crate) use change::{Change, SharedVerb, Verb};
pub(crate) use error::{Command, Doing, Error, IDEMPOTENCY, Result, is_other_file, unless_damaged};
pub(crate) use options::{FileSizes, MAX_LOST, Options, Recovered};
pub(crate) use place::{DatabaseUrl, Place};
pub(crate) use reach::Reach;
pub(crate) use row::{Row, RunId, RunPart, Sum, cells, changes, checksum, page_of, read};
pub(crate) use signals::{Changes, Deletions, Effect, READ_AT_ONCE, Signals, Stop};
pub(crate) use statement::{Statement, sql};
pub(crate) use tables::{Connected, Connection, Lock, Purpose, Tables};
pub(crate) use tally::{Ending, Tally};
pub(crate) use words::Words;
