//! Opens the data directory: lock, check of the file, migrations, connections.

use std::fs::{self, File, TryLockError};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous};
use sqlx::{ConnectOptions, Connection, SqliteConnection};
use tokio::sync::Semaphore;
use tokio::time::sleep;

use super::Database;
use super::files::Files;
use super::ledger::Ledger;
use super::log::Log;
use super::maintenance::Maintenance;
use super::outline;
use super::queue::Queue;
use super::readers::{BUSY, Readers};
use super::schema::{self, migrate};
use super::transaction::Transaction;
use super::writer::Writer;
use crate::database::{
    Connected as _, Error, FileSizes, Options, Result, Signals, Tables as _, sql,
};
use crate::jobs::ages::AgeClock;
use crate::results::library::Program;
use fretwork_job::clock::now;
use fretwork_job::{Canonical, ENGINE};

/// The SQLite application id of our databases ("fret"). The program never writes to another database.
pub(crate) const APPLICATION_ID: i32 = 0x6672_6574;

/// The file name of the database.
pub(crate) const DATABASE: &str = "fretwork.db";

/// The file that a server locks, in the data directory.
pub(crate) const LOCK: &str = "fretwork.lock";

/// The number of read-only connections for small results and lists.
pub(super) const READERS: u32 = 4;
/// The number of readers that may scan all results or jobs at the same time. The other reader stays free for single results.
/// One caller may scan with two readers at a time, so one is left for the scan of another caller.
pub(super) const SCANS: usize = 3;

impl Database {
    pub(crate) fn file_sizes(&self) -> FileSizes {
        let database = self.dir.join(DATABASE);
        let size = |path: &Path| fs::metadata(path).ok().map(|file| file.len());
        FileSizes { database: size(&database), log: size(&with_suffix(&database, "-wal")) }
    }

    pub(crate) async fn open(dir: &Path, options: &Options, signals: Arc<Signals>) -> Result<Self> {
        let lock = lock(dir).await?;
        let path = dir.join(DATABASE);
        let log_pages = log_pages(options.budget);
        let writing = writing(&path, options.full_sync)
            .pragma("wal_autocheckpoint", log_pages.to_string())
            .pragma("journal_size_limit", (log_pages * PAGE).to_string());
        let mut db = prepare(dir, writing).await?;
        // From here on, SQLite keeps the data to undo a statement in memory and not in a temporary file. During the
        // migrations above, these data could be large.
        db.execute(sql!("PRAGMA temp_store = memory")).await?;
        // 16 MiB for each connection: enough for the upper pages of all indexes.
        let reading = connecting(&path).read_only(true).pragma("cache_size", "-16384");
        // So a sorted list needs no temporary file, and works when the disk is full.
        let reading = reading.pragma("temp_store", "memory");
        let readers = Arc::new(Readers::open(&reading, READERS).await?);
        let large = Arc::new(Readers::open(&reading, 1).await?);
        let keys = Arc::new(Readers::open(&reading, 1).await?);
        let queue = Queue::load(&mut db).await?;
        let program = Program::this().id(&mut db).await?;
        let ledger = Ledger::open(lock, &mut db).await?;
        signals.tally.lost.set(ledger.missing);
        let files =
            [path.clone(), with_suffix(&path, "-wal"), with_suffix(&path, "-shm"), dir.join(LOCK)];
        let files = Files::at(files).map_err(|error| unusable(dir, error))?;
        // A new database has no stored time.
        let clock = db.one(sql!("SELECT clock FROM room")).await?.get("clock")?;
        let maintenance = Maintenance::new(options.keep_jobs, options.budget, AgeClock::at(clock));
        let queue_limit = options.queue_limit;
        let effects = Vec::new();
        let tx = Transaction { db, now: now(), queue, queue_limit, program, effects };
        let log = Log::new(with_suffix(&path, "-wal"), log_pages * PAGE);
        let writer =
            Writer::new(tx, Arc::clone(&signals), maintenance, (ledger, log, files)).start();
        let (scans, dir) = (Arc::new(Semaphore::new(SCANS)), dir.into());
        Ok(Self { writer, readers, large, keys, scans, signals, dir })
    }
}

/// Opens or creates the database of a locked directory, and migrates it to this version.
async fn prepare(dir: &Path, options: SqliteConnectOptions) -> Result<SqliteConnection> {
    let path = dir.join(DATABASE);
    let refused = |error| unusable(dir, error);
    forget_foreign_log(&path).map_err(refused)?;
    // SQLite does not say that the permission is missing.
    open_or_create(&path).map_err(refused)?;
    inspect(&path).await?;
    if uses_log(&path).map_err(refused)? != Some(true) {
        use_log(&path).await?;
    }
    let options = options.pragma("application_id", APPLICATION_ID.to_string());
    let mut db = SqliteConnection::connect_with(&options).await?;
    migrate(&mut db, &path).await?;
    rekey(&mut db).await?;
    match outline::complete(&mut db).await {
        Ok(()) => {}
        Err(error @ (Error::Full(_) | Error::Busy(_) | Error::Disk(_))) => return Err(error),
        // The server must start even if the table of the search is damaged.
        Err(error) => {
            let error = &error as &dyn std::error::Error;
            tracing::warn!(error, "search does not find some results of an earlier version");
        }
    }
    Ok(db)
}

/// Makes a database use a write-ahead log. Creates the database if there is none.
///
/// This writes no rollback journal. After a crash, SQLite would apply the journal at the next start. If an
/// administrator had put a backup in place before that, the journal would destroy it. A crash without a journal does no
/// harm, because only the first page changes, and the system writes a page as a whole.
async fn use_log(path: &Path) -> Result<()> {
    let options = connecting(path).create_if_missing(true).journal_mode(SqliteJournalMode::Off);
    let mut db = SqliteConnection::connect_with(&options).await?;
    db.execute(sql!("PRAGMA auto_vacuum = INCREMENTAL; PRAGMA journal_mode = WAL")).await?;
    Ok(db.close().await?)
}

/// Gives the unfinished runs of an earlier `numerics` version, and their jobs, the keys of this version, because this
/// version computes their results. Deletes the chunks of studies, because one version must compute a whole result.
async fn rekey(db: &mut SqliteConnection) -> Result<()> {
    let mut tx = db.begin_with("BEGIN IMMEDIATE").await?;
    let numerics: u32 = tx.one(sql!("SELECT numerics FROM room")).await?.get("numerics")?;
    if numerics == ENGINE.numerics {
        return Ok(());
    }
    for run in tx.rows(sql!("SELECT id, task FROM run WHERE finished IS NULL")).await? {
        // A run whose task cannot be read fails when a worker claims it.
        let Some(key) = Canonical::key_of(run.get("task")?) else { continue };
        let id: i64 = run.get("id")?;
        tx.execute(sql!(
            "UPDATE run SET key = $2, progress = 0 WHERE id = $1;
             UPDATE job SET key = $2 WHERE run = $1 AND finished IS NULL;
             UPDATE study SET wall = 0, cpu = 0 WHERE run = $1;
             DELETE FROM chunk WHERE run = $1";
            id, key,
        ))
        .await?;
    }
    tx.execute(sql!("UPDATE room SET numerics = $1"; ENGINE.numerics)).await?;
    Ok(tx.commit().await?)
}

/// Options of a connection that writes.
pub(super) fn writing(path: &Path, full_sync: bool) -> SqliteConnectOptions {
    let synchronous = if full_sync { SqliteSynchronous::Full } else { SqliteSynchronous::Normal };
    connecting(path)
        .synchronous(synchronous)
        .foreign_keys(true)
        // 8 MiB. A larger cache is slower: after a commit that has moved cells between pages, SQLite walks through all
        // cached pages. Random keys cause such commits. The operating system caches the other pages.
        .pragma("cache_size", "-8192")
        .pragma("wal_autocheckpoint", MOST_LOG_PAGES.to_string())
        .pragma("journal_size_limit", (MOST_LOG_PAGES * PAGE).to_string())
}

/// Size of a page in bytes, the default of SQLite.
const PAGE: u64 = 4096;
/// Maximum number of pages in the log (32 MB). A commit that reaches it runs a checkpoint, and the log file shrinks to
/// this size. Usually maintenance runs a checkpoint earlier.
const MOST_LOG_PAGES: u64 = 8000;

/// The maximum number of pages in the log: a sixteenth of the budget, but at least 1 MB, which is a few large
/// transactions.
fn log_pages(budget: Option<u64>) -> u64 {
    budget.map_or(MOST_LOG_PAGES, |budget| (budget / 16 / PAGE).clamp(250, MOST_LOG_PAGES))
}

/// Options of every connection.
pub(crate) fn connecting(path: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new().filename(path).busy_timeout(BUSY).disable_statement_logging()
}

fn unusable(dir: &Path, error: io::Error) -> Error {
    Error::Directory { dir: dir.to_owned(), source: Arc::new(error) }
}

/// How long a process waits for the lock. Commands hold it for a moment, also one after another.
const LOCK_PATIENCE: Duration = Duration::from_secs(5);
/// The pause before the next attempt.
const LOCK_PAUSE: Duration = Duration::from_millis(20);

/// Locks a data directory, and creates it if it is missing. Waits some seconds for another process.
pub(crate) async fn lock(dir: &Path) -> Result<File> {
    let end = Instant::now() + LOCK_PATIENCE;
    loop {
        match try_lock(dir) {
            Err(Error::Locked { .. }) if Instant::now() < end => sleep(LOCK_PAUSE).await,
            done => return done,
        }
    }
}

fn try_lock(dir: &Path) -> Result<File> {
    let refused = |error| unusable(dir, error);
    fs::create_dir_all(dir).map_err(refused)?;
    let path = dir.join(LOCK);
    let file = open_or_create(&path).map_err(refused)?;
    match file.try_lock() {
        // A failed restore removes the lock file. Then another process may have created a new one.
        Ok(()) if is_removed(&file, &path).map_err(refused)? => try_lock(dir),
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => {
            Err(Error::Locked { dir: dir.to_owned(), holder: holder(&file).unwrap_or_default() })
        }
        Err(TryLockError::Error(source)) => Err(refused(source)),
    }
}

/// Opens a file, or creates it.
fn open_or_create(path: &Path) -> io::Result<File> {
    create(path)
        .or_else(|_| File::options().create(true).truncate(false).read(true).write(true).open(path))
}

/// Creates a file that does not exist. What root creates belongs to the owner of the directory, whose server must open
/// it. Some file systems have no owners.
pub(crate) fn create(path: &Path) -> io::Result<File> {
    let file = File::options().create_new(true).read(true).write(true).open(path)?;
    #[cfg(unix)]
    if rustix::process::geteuid().is_root()
        && let Some(Ok(dir)) = path.parent().map(fs::metadata)
    {
        use std::os::unix::fs::{MetadataExt as _, fchown};
        let _ = fchown(&file, Some(dir.uid()), Some(dir.gid()));
    }
    Ok(file)
}

/// The process that holds the lock of a file, as a part of an error text. Only Linux tells it, and no process of another
/// container.
#[cfg(unix)]
fn holder(file: &File) -> Option<String> {
    use std::os::unix::fs::MetadataExt as _;
    let inode = format!(":{}", file.metadata().ok()?.ino());
    let locks = fs::read_to_string("/proc/locks").ok()?;
    let held = locks.lines().find(|line| line.split(' ').any(|word| word.ends_with(&inode)))?;
    Some(format!(" (process {})", held.split_whitespace().nth(4)?))
}

/// Other systems do not tell who holds a lock.
#[cfg(not(unix))]
fn holder(_: &File) -> Option<String> {
    None
}

/// Whether a path no longer leads to the open file.
#[cfg(unix)]
fn is_removed(file: &File, path: &Path) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt as _;
    let open = file.metadata()?;
    match fs::metadata(path) {
        Ok(there) => Ok((there.dev(), there.ino()) != (open.dev(), open.ino())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(true),
        Err(error) => Err(error),
    }
}

/// Other systems refuse to remove an open file.
#[cfg(not(unix))]
fn is_removed(_: &File, _: &Path) -> io::Result<bool> {
    Ok(false)
}

/// Removes a log that belongs to another database.
///
/// Such a log remains when an administrator copies a backup over a database after a crash. SQLite would
/// apply the log to the backup and destroy it. A backup does not use a log.
pub(crate) fn forget_foreign_log(path: &Path) -> io::Result<()> {
    let log = with_suffix(path, "-wal");
    if log.exists() && path.exists() && uses_log(path)? == Some(false) {
        tracing::warn!(log = %log.display(), "removing the log of another database");
        fs::remove_file(log)?;
        let index = with_suffix(path, "-shm");
        if index.exists() {
            fs::remove_file(index)?;
        }
    }
    Ok(())
}

/// Whether a database uses a write-ahead log, according to its header; `None` if the header is not valid.
pub(crate) fn uses_log(path: &Path) -> io::Result<Option<bool>> {
    // The offset in the header of a SQLite file.
    const VERSIONS: usize = 18;
    let mut head = Vec::new();
    File::open(path)?.take(100).read_to_end(&mut head)?;
    Ok(match head.get(VERSIONS..VERSIONS + 2) {
        Some([1, 1]) => Some(false),
        Some([2, 2]) => Some(true),
        _ => None,
    })
}

/// A path with a suffix after its file name.
pub(crate) fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}

/// Refuses a file that is not one of our databases, before anything is written to it.
///
/// If a crash has left a rollback journal, SQLite must apply it before it can read the file. Only a connection that may
/// write can do that.
pub(crate) async fn inspect(path: &Path) -> Result<()> {
    if !path.exists() {
        return Ok(());
    }
    let has_journal = with_suffix(path, "-journal").exists();
    let looked = async {
        let options = connecting(path).read_only(!has_journal);
        let mut db = SqliteConnection::connect_with(&options).await?;
        let id: i32 = sqlx::query_scalar("PRAGMA application_id").fetch_one(&mut db).await?;
        let schema = schema::parts(&mut db).await?;
        db.close().await?;
        // An empty database is accepted, because its creation may have been interrupted.
        Ok::<_, Error>(id == APPLICATION_ID || (id == 0 && schema.is_empty()))
    };
    match looked.await {
        Ok(true) => Ok(()),
        Ok(false) => Err(Error::Foreign { path: path.to_owned() }),
        Err(Error::Damaged(source)) => Err(Error::NotADatabase { path: path.to_owned(), source }),
        Err(error) => Err(error),
    }
}

/// Opens the database of a directory for an administrative command. A server may be using the database. Otherwise this
/// creates or migrates it if necessary.
pub(crate) async fn beside(dir: &Path, patience: Duration) -> Result<SqliteConnection> {
    let path = dir.join(DATABASE);
    let options = writing(&path, false).busy_timeout(patience);
    let end = Instant::now() + LOCK_PATIENCE;
    loop {
        match try_lock(dir) {
            Ok(_lock) => return prepare(dir, options).await,
            Err(Error::Locked { .. }) => {}
            Err(error) => return Err(error),
        }
        // A server that has just started may still create or migrate the database.
        let served = async {
            inspect(&path).await?;
            let mut db = SqliteConnection::connect_with(&options).await?;
            schema::require_latest(&mut db, &path).await?;
            Ok(db)
        };
        match served.await {
            Err(_) if Instant::now() < end => sleep(LOCK_PAUSE).await,
            done => return done,
        }
    }
}
