//! Copies of the whole.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use sqlx::{Connection as _, Row as _, SqliteConnection};

use super::{Moving, PATIENCE, later, name, put, unfinished, versions};
use crate::store::open::{self, DATABASE, MIGRATIONS};
use crate::store::{Error, now, read};

/// What a copy of a database holds.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Saved {
    /// Jobs.
    pub jobs: u64,
    /// Results that are there.
    pub results: u64,
    /// Bytes of their bodies.
    pub bytes: u64,
    /// Results of which the scenario is remembered.
    pub dropped: u64,
}

/// Copies the whole database into a file, at one moment, and checks the copy.
///
/// # Errors
/// The file exists, the copy is damaged, or a database refuses.
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

/// Puts a backup in the place of the database, which no server may be using; with `replace` also where
/// there is one, which is then kept beside it. Returns what the backup holds, and where the former
/// database is.
///
/// # Errors
/// A server is running, there is a database that may not be replaced, or the backup is damaged.
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
    let there = versions(&mut from).await?;
    from.close().await?;
    let known: Vec<i64> = MIGRATIONS.iter().map(|migration| migration.version).collect();
    if let Some(found) = later(&there, &known) {
        let known = known.into_iter().max().unwrap_or_default();
        return Err(Error::Newer { path: file.to_owned(), found, known }.into());
    }
    let part = unfinished(&path)?;
    let saved = copy(file, &part).await?;
    let former = if path.exists() {
        let aside = dir.join(format!("fretwork.replaced-{}.db", now()));
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

/// Puts a new database in the place of one, which is kept aside. Whenever this breaks off, one of them is
/// in place, and whole.
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
            // The files themselves are still where they were.
            let _ = fs::remove_file(second);
        }
        return done;
    }
    for suffix in ["-wal", "-shm"] {
        // What is left of a log is known as another's at the start.
        let _ = fs::remove_file(open::with_suffix(path, suffix));
    }
    Ok(())
}

/// Gives a file a second name, or where the disk knows no such thing makes a copy.
fn second_name(old: &Path, second: &Path) -> io::Result<()> {
    match fs::hard_link(old, second) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
            fs::copy(old, second)?;
            File::open(second)?.sync_all()
        }
        done => done,
    }
}

/// Copies a database as it is at one moment, and holds the copy against its own sums.
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
    let saved = inventory(&mut db).await?;
    // By the number of the row: one at a time, however many there are.
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
        let body: &[u8] = row.try_get("body")?;
        if !read::sum(&row)?.is_of(body) {
            let key = read::key(&row, "key")?;
            return Err(damaged(format!("the result {key} is not what was stored")));
        }
    }
    db.close().await?;
    Ok(saved)
}

/// What a database holds.
async fn inventory(db: &mut SqliteConnection) -> Result<Saved, Moving> {
    let (jobs, results, bytes, known): (i64, i64, i64, i64) = sqlx::query_as(
        "SELECT (SELECT count(*) FROM job), (SELECT count(*) FROM result_blob),
             (SELECT coalesce(sum(length(body)), 0) FROM result_blob),
             (SELECT count(*) FROM result)",
    )
    .fetch_one(db)
    .await?;
    let count = |number: i64| u64::try_from(number).unwrap_or(0);
    let (results, known) = (count(results), count(known));
    Ok(Saved {
        jobs: count(jobs),
        results,
        bytes: count(bytes),
        dropped: known.saturating_sub(results),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_database_that_cannot_be_replaced_stays_in_its_place() {
        let dir = tempfile::tempdir().unwrap();
        let [new, path, aside] = ["new", "db", "aside"].map(|name| dir.path().join(name));
        fs::write(&path, "former").unwrap();
        fs::write(open::with_suffix(&path, "-wal"), "log").unwrap();
        assert!(supplant(&new, &path, &aside).is_err(), "there is no new one");
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
