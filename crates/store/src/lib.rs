//! Stores jobs, the runs that they share, and the results of the runs.
//!
//! The database is a file of SQLite for one server, or a database of PostgreSQL that several servers share. The tables
//! are authoritative. A signal ([`Changes`], [`Stop`]) is only a hint to read them again. Every acknowledged change
//! survives a crash of the process.
//!
//! ```text
//! job ──▶ run ──▶ result ── result_blob
//!          └─ study ── chunk
//! ```
//!
//! A job has no run if its result was already stored at the submission, or was stored in the same commit.
//!
//! A run is live while it is queued or running. A key has at most one live run. A submission with the same key adds a
//! job to this run instead of a new run. If the last job of a running run is canceled, the run is `canceling` until its
//! worker stops. Then it is no longer live, so a later submission does not use it.
//!
//! A study is a run whose work is divided into pieces. Workers claim and finish the pieces one by one. All pieces but
//! the last are chunks. The last piece, the assembly, makes the result from the stored chunks.

#![expect(
    clippy::missing_errors_doc,
    reason = "all fail for the same reasons: the database fails or is closed, as `Error` says"
)]
#![expect(clippy::must_use_candidate, reason = "the compiler warns about an unused future")]

mod administration;
mod ages;
mod audit;
mod body;
mod cancel;
mod change;
mod claimed;
mod error;
mod imports;
mod keep;
mod keys;
mod library;
mod moving;
mod naming;
mod options;
mod place;
mod postgres;
mod read;
mod row;
mod search;
mod sessions;
mod signals;
mod sqlite;
mod statement;
mod submit;
mod tables;
mod tally;
mod upkeep;
mod verbs;
mod words;

pub use administration::Administration;
pub use audit::{Act, Actor, AuditEntry};
pub use body::Body;
pub use cancel::{Canceled, Deleted};
pub use claimed::{Claimed, Piece};
pub use error::{Command, Doing, Error, Result};
pub use keep::{Answered, Changed, Editor, Finish, Removed};
pub use keys::{AccessKey, NewKey, Role, digest};
pub use library::{FromFile, Known, Note, Program, Provenance};
pub use moving::{
    Accepted, Checked, Damage, Entry, Exported, Imported, Importer, MAX_BODY, Moving, Repaired,
    Saved, backup, check, export, note_backup, repair, restore,
};
pub use options::{FileSizes, Options, Recovered};
pub use place::{DatabaseUrl, Place};
pub use read::{Asked, Filter, LARGE, Page, StoredResult, Unfinished};
pub use row::RunId;
pub use search::{Cursor, Found, Listed, Search};
pub use sessions::SignedIn;
pub use signals::{Changes, Deletions, Stop};
pub use submit::{Admission, NewJob, Repeatable, Submitted};
pub use tally::Tally;
pub use verbs::Store;
pub use words::Words;
