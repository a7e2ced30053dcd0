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

mod administration;
mod database;
mod jobs;
mod moving;
mod postgres;
mod results;
mod sqlite;
mod store;
mod team;

pub use administration::Administration;
pub use database::body::Body;
pub use database::error::{Command, Doing, Error, Result};
pub use database::options::{FileSizes, Options, Recovered};
pub use database::place::{DatabaseUrl, Place};
pub use database::reach::{Reach, Seen};
pub use database::row::RunId;
pub use database::signals::{Changes, Deletions, Stop};
pub use database::tally::Tally;
pub use database::usage::Owners;
pub use database::words::Words;
pub use jobs::cancel::{Canceled, Deleted};
pub use jobs::claimed::{Claimed, Piece};
pub use jobs::read::{Asked, Filter, LARGE, Page, StoredResult, Unfinished};
pub use jobs::submit::{Admission, NewJob, Repeatable, Submitted};
pub use moving::{
    Accepted, Checked, Damage, Exported, Imported, Importer, MAX_BODY, Moving, Repaired, Saved,
    UntrustedResult, backup, check, export, note_backup, repair, restore,
};
pub use results::library::{FromFile, Known, Program, Provenance};
pub use results::notes::{Annotated, Annotator, Note};
pub use results::page::{Cursor, Listed, SearchPage};
pub use results::search::Search;
pub use results::storing::{Answered, Changed, Finish, Removed};
pub use store::Store;
pub use team::audit::{Act, Actor, AuditEntry};
pub use team::keys::{AccessKey, NewKey, Role, digest};
pub use team::sessions::SignedIn;
