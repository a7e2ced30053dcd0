//! The tables, as both databases have them: statements, rows, transactions, signals and errors.

pub(crate) mod body;
pub(crate) mod change;
pub(crate) mod error;
pub(crate) mod options;
pub(crate) mod place;
pub(crate) mod row;
pub(crate) mod signals;
pub(crate) mod statement;
pub(crate) mod tables;
pub(crate) mod tally;
pub(crate) mod words;
