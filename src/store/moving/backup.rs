//! Backup and restore of the whole database.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use sqlx::{Connection as _, Row as _, SqliteConnection};

use super::{Moving, PATIENCE, name, put, unfinished};
use crate::job::clock;
use crate::store::Error;
use crate::store::body::Body;
use crate::store::open::{self, DATABASE};
use crate::store::row::{Sum, key};

/// The contents of a backup.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Saved {
    /// The number of jobs.
    pub jobs: u64,
    /// The number of results with a body.
    pub results: u64,
    /// Bytes of their bodies.
    pub bytes: u64,
    /// The number of evicted results, whose scenarios are still known.
    pub evicted: u64,
}

/// Copies a snapshot of the database into a file, and checks the copy.
///
/// # Errors
/// The file exists, the copy is damaged, or a database fails.
pub async fn backup(dir: &Path, file: &Path) -> Result<Saved, Moving> {
    if file.exists() {
        return Err(Moving::Exists(file.to_owned()));
    }
    let path = dir.join(DATABASE);
    if !path.exists() {
        return Err(Moving::Nothing(path));
    }
    open::inspect(&path).await?;
    let part = unfinished(file)?;
    let saved = copy(&path, &part).await?;
    name(&part, file)?;
    Ok(saved)
}

/// Records the time of a backup, which the metrics of the server show.
///
/// # Errors
/// The database cannot be written, or an earlier version of the program wrote it.
pub async fn note_backup(dir: &Path) -> Result<(), Error> {
    let options = open::connecting(&dir.join(DATABASE)).busy_timeout(PATIENCE);
    let mut db = SqliteConnection::connect_with(&options).await?;
    sqlx::query("UPDATE room SET backed_up = ?1").bind(clock::now()).execute(&mut db).await?;
    Ok(db.close().await?)
}

/// Puts a backup in place of the database. No server may use the directory. With `replace`, an existing
/// database is renamed. Returns the contents of the backup, and the path of the former database.
///
/// # Errors
/// A server is running, there is a database and `replace` is false, or the backup is damaged.
pub async fn restore(
    dir: &Path,
    file: &Path,
    replace: bool,
) -> Result<(Saved, Option<PathBuf>), Moving> {
    if !file.exists() {
        return Err(Moving::Nothing(file.to_owned()));
    }
    let lock = open::lock(dir)?;
    let path = dir.join(DATABASE);
    if path.exists() && !replace {
        return Err(Moving::Exists(path));
    }
    open::inspect(file).await?;
    let mut from = SqliteConnection::connect_with(&open::connecting(file).read_only(true)).await?;
    let (found, known) = (open::version(&mut from).await?, open::latest());
    from.close().await?;
    if found > known {
        return Err(Error::Newer { path: file.to_owned(), found, known }.into());
    }
    let part = unfinished(&path)?;
    let saved = copy(file, &part).await?;
    let former = if path.exists() {
        let aside = dir.join(format!("fretwork.replaced-{}.db", clock::now()));
        supplant(&part, &path, &aside)
            .map_err(|source| Moving::NotReplaced { path: path.clone(), source })?;
        Some(aside)
    } else {
        name(&part, &path)?;
        None
    };
    drop(lock);
    Ok((saved, former))
}

/// Replaces a database by a new one and keeps the old one at `aside`. If this is interrupted at any step,
/// one of the two is in place and complete.
fn supplant(new: &Path, path: &Path, aside: &Path) -> io::Result<()> {
    let log = open::with_suffix(path, "-wal");
    let kept = [(path, aside), (&log, &open::with_suffix(aside, "-wal"))];
    let done = kept
        .iter()
        .filter(|(old, _)| old.exists())
        .try_for_each(|(old, second)| second_name(old, second))
        .and_then(|()| put(new, path));
    if done.is_err() {
        for (_, second) in kept {
            // This removes only the second names: the files are still in place.
            let _ = fs::remove_file(second);
        }
        return done;
    }
    for suffix in ["-wal", "-shm"] {
        // If this fails, `forget_foreign_log` removes the log at the next start.
        let _ = fs::remove_file(open::with_suffix(path, suffix));
    }
    Ok(())
}

/// Makes a hard link, or a copy where the file system has no hard links.
fn second_name(old: &Path, second: &Path) -> io::Result<()> {
    match fs::hard_link(old, second) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
            fs::copy(old, second)?;
            File::open(second)?.sync_all()
        }
        done => done,
    }
}

/// Copies a snapshot of a database, and checks every page and every result of the copy.
async fn copy(from: &Path, to: &Path) -> Result<Saved, Moving> {
    let options = open::connecting(from).busy_timeout(PATIENCE).read_only(true);
    let mut db = SqliteConnection::connect_with(&options).await?;
    let target = to.to_string_lossy().into_owned();
    sqlx::query("VACUUM INTO ?1").bind(target).execute(&mut db).await?;
    db.close().await?;
    let mut db = SqliteConnection::connect_with(&open::connecting(to).read_only(true)).await?;
    let damaged = |said: String| Moving::Damaged { path: to.to_owned(), said };
    let said: Vec<String> =
        sqlx::query_scalar("PRAGMA integrity_check(10)").fetch_all(&mut db).await?;
    if said != ["ok"] {
        return Err(damaged(said.join("; ")));
    }
    let (jobs, results, bytes, evicted) = sqlx::query_as(
        "SELECT (SELECT count(*) FROM job) AS jobs, (SELECT count(*) FROM result_blob) AS results,
             (SELECT coalesce(sum(length(body)), 0) FROM result_blob) AS bytes,
             (SELECT count(*) FROM result WHERE evicted IS NOT NULL) AS evicted",
    )
    .fetch_one(&mut db)
    .await?;
    // One body at a time, to keep memory small.
    let mut last = 0;
    loop {
        let row = sqlx::query(
            "SELECT result_blob.rowid AS place, result_blob.key AS key, body, digest, checksum
             FROM result_blob JOIN result USING (key)
             WHERE result_blob.rowid > ?1 AND evicted IS NULL ORDER BY result_blob.rowid LIMIT 1",
        )
        .bind(last)
        .fetch_optional(&mut db)
        .await?;
        let Some(row) = row else { break };
        last = row.try_get("place")?;
        let body = Body::stored(row.try_get("body")?);
        if !Sum::read(&row)?.is_of(&body) {
            let key = key(&row, "key")?;
            return Err(damaged(format!("the body of the result {key} has changed")));
        }
    }
    db.close().await?;
    Ok(Saved { jobs, results, bytes, evicted })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_replacement_leaves_the_old_database_unchanged() {
        let dir = tempfile::tempdir().unwrap();
        let [new, path, aside] = ["new", "db", "aside"].map(|name| dir.path().join(name));
        fs::write(&path, "former").unwrap();
        fs::write(open::with_suffix(&path, "-wal"), "log").unwrap();
        assert!(supplant(&new, &path, &aside).is_err(), "the new database does not exist");
        assert_eq!(fs::read(&path).unwrap(), b"former");
        assert_eq!(fs::read(open::with_suffix(&path, "-wal")).unwrap(), b"log");
        assert!(!aside.exists());
        fs::write(&new, "new").unwrap();
        supplant(&new, &path, &aside).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert!(!open::with_suffix(&path, "-wal").exists());
        assert_eq!(fs::read(&aside).unwrap(), b"former");
        assert_eq!(fs::read(open::with_suffix(&aside, "-wal")).unwrap(), b"log");
    }
}
