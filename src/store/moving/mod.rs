//! Results on their way between servers, and copies of the whole.
//!
//! All of it works beside a running server, whose database is opened once more: SQLite keeps the two
//! apart, and no transaction here is long. What is written is written beside its place, checked, and
//! only then given its name.
//!
//! An export is a database of its own kind, for people and their tools as much as for another server:
//! one table with a row per result in plain columns, one with the bodies, one with the histories, and one
//! with the units. An import takes numbers and scenarios from the bodies only, and those only where
//! their SHA-256 and their key are right. Who computed a result, where, when and at what cost, and its
//! note, nobody can check: these are taken as they are stated.

mod backup;
mod export;
mod import;

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use sqlx::SqliteConnection;

use super::Error;
use super::open::{self, DATABASE};
use crate::job::Key;

pub use backup::{Saved, backup, restore};
pub use export::{Exported, export};
pub use import::{Imported, import};

/// Marks an export ("frex").
const EXPORT: i32 = 0x6672_6578;
/// The version of the form of an export.
const FORM: i32 = 1;
/// How long to wait for a server that writes.
const PATIENCE: Duration = Duration::from_secs(30);
/// Results, and bytes of them, in one transaction: so short that a server does not notice.
const AT_ONCE: (usize, usize) = (32, 4 << 20);

/// Why results or a database could not be moved.
#[derive(Debug, thiserror::Error)]
pub enum Moving {
    /// The database cannot be used.
    #[error(transparent)]
    Store(#[from] Error),
    /// There is nothing to take from.
    #[error("there is no {}", .0.display())]
    Nothing(PathBuf),
    /// Nothing is overwritten.
    #[error("{} exists already, and is not overwritten", .0.display())]
    Exists(PathBuf),
    /// It is something else.
    #[error("{} is not an export of fretwork", .0.display())]
    NoExport(PathBuf),
    /// It is a backup, or the database of a server.
    #[error("{} is a whole database, not an export: `fretwork restore` puts a backup in place", .0.display())]
    WholeDatabase(PathBuf),
    /// A later program wrote it.
    #[error("{} was exported by a later version of fretwork (form {found}, this program knows {FORM})", path.display())]
    LaterForm {
        /// The file.
        path: PathBuf,
        /// The version of its form.
        found: i32,
    },
    /// No such result.
    #[error("no result with the key {0} is there")]
    UnknownKey(Key),
    /// The copy does not hold what it should.
    #[error("{} is damaged: {said}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What was found.
        said: String,
    },
    /// A backup cannot take the place of the database.
    #[error("the backup cannot be put in place; the former database is still {}", path.display())]
    NotReplaced {
        /// The former database, as it was.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The system refuses.
    #[error("cannot write {}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

impl From<sqlx::Error> for Moving {
    fn from(error: sqlx::Error) -> Self {
        Self::Store(error.into())
    }
}

fn refused(path: &Path) -> impl FnOnce(io::Error) -> Moving {
    let path = path.to_owned();
    move |source| Moving::File { path, source }
}

/// Opens the database of a directory beside the server that may be using it.
async fn beside(dir: &Path) -> Result<SqliteConnection, Moving> {
    let path = dir.join(DATABASE);
    if !path.exists() {
        return Err(Moving::Nothing(path));
    }
    Ok(open::beside(dir, PATIENCE).await?)
}

async fn versions(db: &mut SqliteConnection) -> Result<Vec<i64>, sqlx::Error> {
    sqlx::query_scalar("SELECT version FROM _sqlx_migrations").fetch_all(db).await
}

/// A version of the tables that is later than all that are known.
fn later(there: &[i64], known: &[i64]) -> Option<i64> {
    let latest = known.iter().max().copied().unwrap_or_default();
    there.iter().max().copied().filter(|found| *found > latest)
}

/// Where a file is written until it is whole: beside its place. What an earlier attempt left is
/// removed.
fn unfinished(file: &Path) -> Result<PathBuf, Moving> {
    let part = open::with_suffix(file, ".part");
    match fs::remove_file(&part) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(refused(&part)(error)),
        _ => Ok(part),
    }
}

/// Gives a file that is whole its name, once it is on the disk.
fn name(part: &Path, file: &Path) -> Result<(), Moving> {
    if file.exists() {
        return Err(refused(file)(io::ErrorKind::AlreadyExists.into()));
    }
    put(part, file).map_err(refused(file))
}

/// Puts a file that is whole in a place, once it is on the disk, at one moment.
fn put(part: &Path, file: &Path) -> io::Result<()> {
    File::open(part)?.sync_all()?;
    fs::rename(part, file)?;
    let dir = file.parent().filter(|dir| !dir.as_os_str().is_empty());
    // Where directories cannot be synced there is nothing to do about it.
    let _ = File::open(dir.unwrap_or(Path::new("."))).and_then(|dir| dir.sync_all());
    Ok(())
}
