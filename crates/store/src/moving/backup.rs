//! Backup and restore of the whole database.
//!
//! Both make a copy and check it. A damaged body of a result does not prevent this. The copy keeps the scenario of such
//! a result, but not its body, as if the result had been evicted.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use sqlx::{Connection as _, SqliteConnection};

use super::check::{of_pages, of_rows};
use super::damage::Damage;
use super::{
    COMPANIONS, Moving, PartialFile, put, reading, refused, remove, require, settle, sync_directory,
};
use crate::administration::PATIENCE;
use crate::database::{
    Body, Command, Connected as _, Error, Statement, Sum, Tables as _, sql, unless_damaged,
};
use crate::sqlite::open::{self, DATABASE, LOCK};
use crate::sqlite::{ledger, schema};
use fretwork_job::{Key, clock};

/// The contents of a backup.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Saved {
    /// The number of jobs.
    pub jobs: u64,
    /// The number of results with a body.
    pub results: u64,
    /// Bytes of their bodies.
    pub bytes: u64,
    /// The number of results without a body, whose scenarios are still known.
    pub evicted: u64,
    /// Results whose damaged bodies were left out of the copy. `evicted` counts them, too.
    pub damaged: Vec<Key>,
}

/// Copies a snapshot of the database into a file, and checks the copy.
///
/// # Errors
/// The file exists, something other than bodies of results is damaged, or a database fails.
pub fn backup<'a>(dir: &'a Path, file: &'a Path) -> Command<'a, Saved, Moving> {
    Box::pin(async move {
        if file.exists() {
            return Err(Moving::Exists(file.to_owned()));
        }
        let path = dir.join(DATABASE);
        require(&path)?;
        let part = PartialFile::of(file, ".part")?;
        let from = CopySource::of(&path, file)?;
        inspect(&from.path, &path).await?;
        copy(&from.path, &part.0).await?;
        let saved = check(&part.0, &path).await?;
        part.name(file)?;
        Ok(saved)
    })
}

/// Records the time of a backup, which the metrics of the server show.
///
/// # Errors
/// The database cannot be written, or an earlier version of the program wrote it.
pub fn note_backup(dir: &Path) -> Command<'_, ()> {
    Box::pin(async move {
        let options = open::connecting(&dir.join(DATABASE)).busy_timeout(PATIENCE);
        let mut db = SqliteConnection::connect_with(&options).await?;
        db.execute(sql!("UPDATE room SET backed_up = $1"; clock::now())).await?;
        Ok(db.close().await?)
    })
}

/// Puts a backup in place of the database, with the tables of this version. No server may use the directory. With
/// `replace`, an existing database is renamed. Returns the contents of the backup, and the path of the former database.
///
/// # Errors A server is running, there is a database and `replace` is false, or something other than bodies of results
/// is damaged. After an error, nothing has changed.
pub fn restore<'a>(
    dir: &'a Path,
    file: &'a Path,
    replace: bool,
) -> Command<'a, (Saved, Option<PathBuf>), Moving> {
    Box::pin(async move {
        require(file)?;
        let lock = dir.join(LOCK);
        let missing: Vec<&Path> = [&*lock].into_iter().chain(dir.ancestors()).collect();
        let missing: Vec<&Path> = missing.into_iter().take_while(|path| !path.exists()).collect();
        // This holds the lock until everything is removed. If another server holds the lock, the files belong to that
        // server and stay.
        let locked = open::lock(dir).await;
        let done = match &locked {
            Ok(locked) => put_in_place(dir, locked, file, replace).await,
            Err(error) => Err(error.clone().into()),
        };
        if !matches!(done, Ok(_) | Err(Moving::Store(Error::Locked { .. }))) {
            for path in missing {
                // This fails if another command has put a file there in the meantime. Then the directory stays.
                let _ = if path == lock { fs::remove_file(path) } else { fs::remove_dir(path) };
            }
        }
        done
    })
}

async fn put_in_place(
    dir: &Path,
    lock: &File,
    file: &Path,
    replace: bool,
) -> Result<(Saved, Option<PathBuf>), Moving> {
    let path = dir.join(DATABASE);
    if path.exists() && !replace {
        return Err(Moving::Occupied(path));
    }
    let part = PartialFile::of(&path, ".part")?;
    let from = CopySource::of(file, &path)?;
    inspect(&from.path, file).await?;
    copy(&from.path, &part.0).await?;
    let mut db = SqliteConnection::connect_with(&open::connecting(&part.0)).await?;
    schema::migrate(&mut db, file).await?;
    db.close().await?;
    let saved = check(&part.0, file).await?;
    let former = path.exists().then(|| dir.join(format!("fretwork.replaced-{}.db", clock::now())));
    if former.is_some() {
        settle(&path).await?;
    }
    ledger::forget(lock).map_err(refused(&dir.join(LOCK)))?;
    supplant(&part.0, &path, former.as_deref())
        .map_err(|source| Moving::NotReplaced { path: path.clone(), source })?;
    Ok((saved, former))
}

/// Refuses a file of a later version, and one with damage to its schema or indexes, because a copy would repair or hide that.
/// Errors show the path `name`.
async fn inspect(file: &Path, name: &Path) -> Result<(), Moving> {
    open::inspect(file).await?;
    let mut db = reading(file).await?;
    schema::compare(&mut db, name).await?;
    refuse(of_pages(&mut db).await?, name)?;
    let (found, known) = (schema::version(&mut db).await?, schema::latest());
    db.close().await?;
    if found > known {
        return Err(Error::Newer { path: name.to_owned(), found, known }.into());
    }
    Ok(())
}

/// The database to be copied.
struct CopySource {
    path: PathBuf,
    /// Removes the files at `path` when this is dropped, if they are a copy of the database with its log and journal.
    _copy: Option<PartialFile>,
}

impl CopySource {
    /// To read a database with a log or a journal, SQLite must write files beside it. On a read-only file system this
    /// is impossible, so the files are copied to the directory of `target`. The copy is sound only if no server writes
    /// to the database at the same time.
    fn of(path: &Path, target: &Path) -> Result<Self, Moving> {
        let opened = File::options().write(true).open(path);
        let is_read_only =
            opened.is_err_and(|error| error.kind() == io::ErrorKind::ReadOnlyFilesystem);
        let has_journal = open::with_suffix(path, "-journal").exists();
        let uses_log = || open::uses_log(path).map_err(refused(path));
        if !is_read_only || !has_journal && uses_log()? != Some(true) {
            return Ok(Self { path: path.to_owned(), _copy: None });
        }
        let copy = PartialFile::of(target, ".source")?;
        for suffix in ["", "-wal", "-journal"] {
            let [from, to] = [path, &copy.0].map(|path| open::with_suffix(path, suffix));
            match fs::copy(&from, &to) {
                Err(error) if suffix.is_empty() || from.exists() => {
                    return Err(refused(&to)(error));
                }
                _ => {}
            }
        }
        Ok(Self { path: copy.0.clone(), _copy: Some(copy) })
    }
}

/// Puts a new database in the place of an old one, which is kept at `former`.
///
/// SQLite would apply the log or the journal of the old database to the new one. So both are removed before the
/// exchange. After [`settle`], only a database that SQLite cannot read still has a log or a journal. So even after an
/// interruption, a complete database is in place, unless the old one was already unreadable.
fn supplant(new: &Path, path: &Path, former: Option<&Path>) -> io::Result<()> {
    let beside = |suffix: &str| open::with_suffix(path, suffix);
    let kept: Vec<(PathBuf, PathBuf)> = former
        .iter()
        .flat_map(|former| [""].into_iter().chain(COMPANIONS).map(move |suffix| (suffix, former)))
        .map(|(suffix, former)| (beside(suffix), open::with_suffix(former, suffix)))
        .filter(|(old, _)| old.exists())
        .collect();
    let done = kept
        .iter()
        .try_for_each(|(old, second)| second_name(old, second))
        .and_then(|()| COMPANIONS.iter().try_for_each(|suffix| remove(&beside(suffix))))
        .and_then(|()| {
            sync_directory(path);
            put(new, path)
        });
    if done.is_err() {
        for (old, second) in kept {
            // Undo: remove the second name of a file that still exists, and rename a file that was removed.
            let _ = if old.exists() { remove(&second) } else { fs::rename(&second, &old) };
        }
    }
    done
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

/// Copies a snapshot of a database.
async fn copy(from: &Path, to: &Path) -> Result<(), Moving> {
    let mut db = reading(from).await?;
    let target = to.to_string_lossy().into_owned();
    let copied = sqlx::query("VACUUM INTO ?1").bind(target).execute(&mut db).await;
    db.close().await?;
    match copied.map_err(Error::from) {
        Ok(_) => Ok(()),
        // If only bodies of results are damaged, all other rows can still be read. SQLite calls the disk full if a link has
        // the largest page number, as after the erasure of a page. If the disk is full, the second copy fails, too.
        Err(Error::Damaged(_) | Error::Full(_)) => {
            fs::remove_file(to).map_err(refused(to))?;
            copy_readable(from, to).await
        }
        Err(error) => Err(error.into()),
    }
}

/// Copies a snapshot of a database row by row. Leaves out the bodies that cannot be read, and all chunks, which a
/// server computes again.
async fn copy_readable(from: &Path, to: &Path) -> Result<(), Moving> {
    const BODIES: [&str; 2] = ["result_blob", "chunk"];
    let options = open::connecting(to)
        .busy_timeout(PATIENCE)
        .create_if_missing(true)
        .foreign_keys(false)
        .auto_vacuum(sqlx::sqlite::SqliteAutoVacuum::Incremental)
        .pragma("application_id", open::APPLICATION_ID.to_string());
    let mut db = SqliteConnection::connect_with(&options).await?;
    db.execute(sql!("ATTACH $1 AS source"; from.to_string_lossy().into_owned())).await?;
    let mut tx = db.begin().await?;
    // First the tables, then the indexes and triggers, which refer to tables.
    let parts: Vec<(String, String, String)> = sqlx::query_as(
        "SELECT type, name, sql FROM source.sqlite_schema
         WHERE sql IS NOT NULL AND name NOT LIKE 'sqlite!_%' ESCAPE '!' ORDER BY type <> 'table'",
    )
    .fetch_all(&mut *tx)
    .await?;
    for (kind, name, sql) in parts {
        tx.execute(Statement::of(sql)).await?;
        if kind == "table" && !BODIES.contains(&&*name) {
            let insert = format!("INSERT INTO main.\"{name}\" SELECT * FROM source.\"{name}\"");
            tx.execute(Statement::of(insert)).await?;
        }
    }
    let bodies: Vec<i64> =
        sqlx::query_scalar("SELECT rowid FROM source.result_blob").fetch_all(&mut *tx).await?;
    // A connection that has read a damaged page cannot commit. So a second connection tries to read each body first.
    let mut reader = reading(from).await?;
    for body in bodies {
        let read = sqlx::query("SELECT body FROM result_blob WHERE rowid = ?1").bind(body);
        if unless_damaged(read.fetch_optional(&mut reader).await)?.is_err() {
            continue;
        }
        tx.execute(sql!(
            "INSERT INTO main.result_blob (key, body)
             SELECT key, body FROM source.result_blob WHERE rowid = $1";
            body,
        ))
        .await?;
    }
    reader.close().await?;
    tx.commit().await?;
    Ok(db.close().await?)
}

/// Checks every page and every result of a copy. Leaves out the bodies that are damaged, and counts what the copy
/// contains.
async fn check(copy: &Path, of: &Path) -> Result<Saved, Moving> {
    let options = open::connecting(copy).foreign_keys(true);
    let mut db = SqliteConnection::connect_with(&options).await?;
    let said: Vec<String> =
        sqlx::query_scalar("PRAGMA integrity_check(10)").fetch_all(&mut db).await?;
    if said != ["ok"] {
        return Err(Moving::Damaged { path: of.to_owned(), said: said.join("; ") });
    }
    let damaged = damaged(&mut db).await?;
    for key in &damaged {
        leave_out(&mut db, key).await?;
    }
    // The tables of earlier versions lack columns.
    if schema::version(&mut db).await? == schema::latest() {
        refuse(of_rows(&mut db).await?, of)?;
    }
    let (jobs, results, bytes, evicted) = sqlx::query_as(
        "SELECT (SELECT count(*) FROM job), count(body), coalesce(sum(length(body)), 0),
             count(*) - count(body)
         FROM result LEFT JOIN result_blob USING (key)",
    )
    .fetch_one(&mut db)
    .await?;
    db.close().await?;
    Ok(Saved { jobs, results, bytes, evicted, damaged })
}

/// Refuses a database with damage that a copy cannot leave out. A copy would hide the damage, because SQLite builds new
/// indexes for the copy.
fn refuse(mut damage: Vec<Damage>, path: &Path) -> Result<(), Moving> {
    damage.retain(|damage| !damage.can_be_left_out());
    if damage.is_empty() {
        return Ok(());
    }
    let said: Vec<String> = damage.iter().map(Damage::to_string).collect();
    Err(Moving::Damaged { path: path.to_owned(), said: said.join("; ") })
}

/// The results whose bodies have changed or are missing.
async fn damaged(db: &mut SqliteConnection) -> Result<Vec<Key>, Moving> {
    let mut damaged = Vec::new();
    let mut last: Vec<u8> = Vec::new();
    // Reads one body at a time, to save memory. In the tables of the first version, `result` has no columns `checksum`
    // and `evicted`. Then SQLite resolves these names to the columns of `absent`, which are null.
    loop {
        let next = db.row(sql!(
            "SELECT key, digest, body,
                 (SELECT checksum FROM result AS same WHERE same.key = result.key) AS checksum,
                 (SELECT evicted FROM result AS same WHERE same.key = result.key) AS evicted
             FROM result LEFT JOIN result_blob USING (key),
                 (SELECT NULL AS checksum, NULL AS evicted) AS absent
             WHERE key > $1 ORDER BY key LIMIT 1";
            &last,
        ));
        let Some(row) = next.await? else { return Ok(damaged) };
        last = row.get("key")?;
        let body: Option<Vec<u8>> = row.get("body")?;
        let evicted: Option<i64> = row.get("evicted")?;
        let sum = Sum::read(&row)?;
        let is_sound = |body| sum.is_of(&Body::stored(body));
        if evicted.is_none() && !body.is_some_and(is_sound) {
            damaged.push(row.get("key")?);
        }
    }
}

/// Deletes a body, and keeps the scenario of the result.
async fn leave_out(db: &mut SqliteConnection, key: &Key) -> Result<(), Moving> {
    let change = sql!(
        "UPDATE result SET evicted = $2 WHERE key = $1; DELETE FROM result_blob WHERE key = $1";
        key, clock::now(),
    );
    Ok(db.execute(change).await?)
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
        let journal = open::with_suffix(&path, "-journal");
        fs::write(&journal, "journal").unwrap();
        let former = Some(&*aside);
        assert!(supplant(&new, &path, former).is_err(), "the new database does not exist");
        assert_eq!(fs::read(&path).unwrap(), b"former");
        assert_eq!(fs::read(open::with_suffix(&path, "-wal")).unwrap(), b"log");
        assert_eq!(fs::read(&journal).unwrap(), b"journal");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 3);
        fs::write(&new, "new").unwrap();
        supplant(&new, &path, former).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert!(!open::with_suffix(&path, "-wal").exists() && !journal.exists());
        assert_eq!(fs::read(&aside).unwrap(), b"former");
        assert_eq!(fs::read(open::with_suffix(&aside, "-wal")).unwrap(), b"log");
        assert_eq!(fs::read(open::with_suffix(&aside, "-journal")).unwrap(), b"journal");
    }
}
