//! Checks whether the paths of the open database still lead to its files.
//!
//! SQLite goes on to write to an open file after the file was deleted, moved or replaced. Every commit succeeds, but
//! the next start of the server does not find these commits.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::database::{Error, Result};

/// The device and the number of a file.
type FileIdentity = (u64, u64);

/// The files of an open database.
#[derive(Debug, Default)]
pub(super) struct Files(Vec<(PathBuf, FileIdentity)>);

impl Files {
    /// The files that have these paths now. This does not open them, because closing a file would end the locks of
    /// SQLite.
    pub(super) fn at(paths: impl IntoIterator<Item = PathBuf>) -> io::Result<Self> {
        let file = |path: PathBuf| identity(&path).map(|identity| (path, identity));
        paths.into_iter().map(file).collect::<io::Result<_>>().map(Self)
    }

    /// Fails if one of the paths now leads to another file or to none. This takes about a microsecond for each file.
    pub(super) fn check(&self) -> Result<()> {
        let moved = self.0.iter().find(|(path, own)| identity(path).ok() != Some(*own));
        moved.map_or(Ok(()), |(path, _)| Err(Error::Moved { path: path.clone() }))
    }
}

#[cfg(unix)]
fn identity(path: &Path) -> io::Result<FileIdentity> {
    use std::os::unix::fs::MetadataExt as _;
    let file = fs::metadata(path)?;
    Ok((file.dev(), file.ino()))
}

/// Other systems do not move a file that is open.
#[cfg(not(unix))]
fn identity(path: &Path) -> io::Result<FileIdentity> {
    fs::metadata(path).map(|_| (0, 0))
}
