//! Export and import of results; check, backup and restore of the database.
//!
//! All commands except restore work while a server uses the database: SQLite isolates their transactions, which are
//! short. Each file is written under a temporary name, checked, and then renamed.
//!
//! An export is lines of JSON: each has the body of a result and its provenance (who computed it, where, when and at
//! what cost). An import reads results from the bodies only, and checks their SHA-256. The module `service` of the server
//! checks their keys, and computes them again. Notes, warnings about the two bodies, and the provenance are stored
//! without a check.

mod backup;
mod check;
mod damage;
mod export;
mod import;
mod lines;
mod store_import;

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use sqlx::{Connection as _, SqliteConnection};

use crate::administration::PATIENCE;
use crate::database::{Error, unless_damaged};
use crate::sqlite::open;
use fretwork_job::Key;

pub use backup::{Saved, backup, note_backup, restore};
pub use check::{Checked, Repaired, check, repair};
pub use damage::Damage;
pub use export::{Exported, export};
pub use import::{Imported, Importer, UntrustedResult};
pub use lines::MAX_BODY;
pub use store_import::Accepted;

/// The version of the form of an export. Form 1 was a database of SQLite.
const FORM: u32 = 2;

/// The suffixes of the files that SQLite keeps beside a database.
const COMPANIONS: [&str; 3] = ["-journal", "-wal", "-shm"];

/// Why an export, import, backup or restore failed.
#[derive(Debug, thiserror::Error)]
pub enum Moving {
    /// The database failed.
    #[error(transparent)]
    Store(#[from] Error),
    /// The source is a directory, a pipe or a device.
    #[error("{} is not a file; only `fretwork import -` reads from a pipe", .0.display())]
    NoFile(PathBuf),
    /// The target exists.
    #[error("{} exists already, and is not overwritten; name another file", .0.display())]
    Exists(PathBuf),
    /// The data directory already has a database.
    #[error(
        "{} exists already; add --replace to put the backup in its place and keep the present database under another \
         name", .0.display()
    )]
    Occupied(PathBuf),
    /// The file is not an export.
    #[error("{} is not an export of fretwork; name a file that `fretwork export` wrote", .0.display())]
    NoExport(PathBuf),
    /// Version 0.4 or earlier wrote the file.
    #[error(
        "{} is an export of fretwork 0.4 or earlier, a database; change its form with \
         `python3 -m fretwork_client.old_export FILE | fretwork import -`", .0.display()
    )]
    FirstForm(PathBuf),
    /// The file is a backup, or the database of a server.
    #[error("{} is a whole database, not an export; if it is a backup, use `fretwork restore`", .0.display())]
    WholeDatabase(PathBuf),
    /// A later program wrote the file.
    #[error(
        "{} was exported by a later version of fretwork (the file has form {found}, this program reads form \
         {FORM}); update this program", path.display()
    )]
    LaterForm {
        /// The file.
        path: PathBuf,
        /// The version of its form.
        found: u32,
    },
    /// The database does not have this result.
    #[error("there is no result with the key {0} in the database")]
    UnknownKey(Key),
    /// A result of the database is damaged.
    #[error(
        "the result with the key {0} is damaged; submit its scenario with `Cache-Control: no-cache`, which computes it again"
    )]
    DamagedResult(Key),
    /// The file has changed since it was written.
    #[error("{} is damaged: {said}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        said: String,
    },
    /// The backup could not replace the database.
    #[error("the backup cannot replace the database; {} is still the former database", path.display())]
    NotReplaced {
        /// The former database, unchanged.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// A file could not be read or written.
    #[error("cannot read or write {}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
}

impl From<sqlx::Error> for Moving {
    fn from(error: sqlx::Error) -> Self {
        Self::Store(error.into())
    }
}

/// Refuses a path without a file.
fn require(file: &Path) -> Result<(), Moving> {
    let found = fs::metadata(file).map_err(refused(file))?;
    found.is_file().then_some(()).ok_or_else(|| Moving::NoFile(file.to_owned()))
}

fn refused(path: &Path) -> impl FnOnce(io::Error) -> Moving {
    let path = path.to_owned();
    move |source| Moving::File { path, source }
}

/// A file that is being written, under a temporary name. It is removed if the command fails.
struct PartialFile(PathBuf);

impl PartialFile {
    /// Makes an empty file, whose name is the path of the file with a suffix. Removes a file with this name, which a killed
    /// command may have left.
    fn of(file: &Path, suffix: &str) -> Result<Self, Moving> {
        let part = Self(open::with_suffix(file, suffix));
        // SQLite would apply an old journal to the new file. It writes into an empty file as if there were none.
        part.remove().and_then(|()| open::create(&part.0)).map_err(refused(file))?;
        Ok(part)
    }

    /// Removes the file, and the journal and log that SQLite keeps beside it.
    fn remove(&self) -> io::Result<()> {
        let suffixes = COMPANIONS.iter().chain(&[""]);
        suffixes.map(|suffix| open::with_suffix(&self.0, suffix)).try_for_each(|file| remove(&file))
    }

    /// Gives the finished file its name, which must be free.
    fn name(self, file: &Path) -> Result<(), Moving> {
        if file.exists() {
            return Err(Moving::Exists(file.to_owned()));
        }
        put(&self.0, file).map_err(refused(file))
    }
}

impl Drop for PartialFile {
    fn drop(&mut self) {
        // If this fails, the next command tries again.
        let _ = self.remove();
    }
}

/// Opens a database for reading only.
async fn reading(path: &Path) -> Result<SqliteConnection, Moving> {
    let options = open::connecting(path).busy_timeout(PATIENCE).read_only(true);
    Ok(SqliteConnection::connect_with(&options).await?)
}

/// Lets SQLite recover a database after a crash, so that neither a log nor a journal is left beside it. A database that
/// SQLite cannot read stays as it is.
async fn settle(path: &Path) -> Result<(), Moving> {
    let not_replaced = |source| Moving::NotReplaced { path: path.to_owned(), source };
    open::forget_foreign_log(path).map_err(not_replaced)?;
    let settled = async {
        let options = open::connecting(path).busy_timeout(PATIENCE);
        let mut db = SqliteConnection::connect_with(&options).await?;
        sqlx::query("SELECT count(*) FROM sqlite_schema").execute(&mut db).await?;
        let is_used: bool =
            sqlx::query_scalar("PRAGMA wal_checkpoint(TRUNCATE)").fetch_one(&mut db).await?;
        db.close().await?;
        Ok(is_used)
    };
    match unless_damaged(settled.await)? {
        Ok(false) | Err(_) => Ok(()),
        Ok(true) => Err(not_replaced(io::Error::other(
            "another program uses the former database; end it first",
        ))),
    }
}

/// Syncs a finished file to the disk and renames it.
fn put(part: &Path, file: &Path) -> io::Result<()> {
    File::open(part)?.sync_all()?;
    fs::rename(part, file)?;
    sync_directory(file);
    Ok(())
}

/// Syncs the directory of a file to the disk.
fn sync_directory(file: &Path) {
    let dir = file.parent().filter(|dir| !dir.as_os_str().is_empty());
    // Some systems cannot sync directories.
    let _ = File::open(dir.unwrap_or(Path::new("."))).and_then(|dir| dir.sync_all());
}

/// Removes a file, if there is one.
fn remove(file: &Path) -> io::Result<()> {
    match fs::remove_file(file) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}
