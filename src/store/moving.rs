//! Results on their way between servers, and copies of the whole.
//!
//! All of it works beside a running server, whose database is opened once more: SQLite keeps the two
//! apart, and no transaction here is long. What is written is written beside its place, checked, and
//! only then given its name.
//!
//! An export is a database of its own kind, for people and their tools as much as for another server:
//! one table with a row per result in plain columns, one with the bodies, one with the units, and the
//! histories as a view. An import believes none of it but the bodies, and those only where their
//! SHA-256 and their key are right.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, UNIX_EPOCH};

use serde_json::json;
use sha2::{Digest as _, Sha256};
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteRow, SqliteSynchronous};
use sqlx::{Connection as _, Executor as _, QueryBuilder, Row as _, Sqlite, SqliteConnection};

use super::keep::{Answered, Source};
use super::library::{self, Program, Provenance};
use super::open::{self, DATABASE, MIGRATIONS};
use super::outline::{self, Body, Outline, SCALARS, WORDS};
use super::search::{self, Search};
use super::{Error, Options, Store, now, read};
use crate::engine::outcome::UNITS;
use crate::engine::scenario::MAX_ANSWER;
use crate::job::{Answer, Cost, ENGINE, Key};

/// Marks an export ("frex").
const EXPORT: i32 = 0x6672_6578;
/// The version of the form of an export.
const FORM: i32 = 1;
/// How long to wait for a server that writes.
const PATIENCE: Duration = Duration::from_secs(30);
/// Results, and bytes of them, in one transaction: so short that a server does not notice.
const AT_ONCE: (usize, usize) = (32, 4 << 20);
/// The columns of a history.
const HISTORY: [&str; 13] = [
    "cycles",
    "normalized_cycles",
    "wear_volume",
    "wear_depth",
    "scar_radius",
    "contact_radius",
    "stick_radius",
    "normal_force",
    "indentation_depth",
    "amplitude",
    "tangential_force",
    "energy_per_cycle",
    "dissipated_energy",
];

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
    /// A server of an earlier version is at work.
    #[error(
        "a server of an earlier version is using {}: stop it, and start this version", .0.display()
    )]
    OlderServer(PathBuf),
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

/// What an export came to.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Exported {
    /// Results in the file.
    pub results: u64,
    /// Bytes of their bodies.
    pub bytes: u64,
    /// Results that were dropped meanwhile or are damaged: left out.
    pub left_out: Vec<Key>,
}

/// What an import came to.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Imported {
    /// Results that are new here, or are there again.
    pub results: u64,
    /// Bytes of their bodies.
    pub bytes: u64,
    /// Results that were there already.
    pub known: u64,
    /// Results that were not taken: their key, and why.
    pub refused: Vec<(String, String)>,
}

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

/// Opens the database of a directory beside the server that may be using it. Tables of an earlier
/// version are brought up to date, unless a server uses them.
async fn beside(dir: &Path) -> Result<SqliteConnection, Moving> {
    let path = dir.join(DATABASE);
    if !path.exists() {
        return Err(Moving::Nothing(path));
    }
    let lock = match open::lock(dir) {
        Ok(lock) => Some(lock),
        Err(Error::Locked { .. }) => None,
        Err(error) => return Err(error.into()),
    };
    if lock.is_some() {
        open::forget_foreign_log(&path).map_err(refused(&path))?;
    }
    open::inspect(&path).await?;
    let options = open::connecting(&path)
        .busy_timeout(PATIENCE)
        .foreign_keys(true)
        .synchronous(SqliteSynchronous::Normal);
    let mut db = SqliteConnection::connect_with(&options).await?;
    if lock.is_some() {
        open::migrate(&mut db, &path).await?;
        return Ok(db);
    }
    let there = versions(&mut db).await?;
    let known: Vec<i64> = MIGRATIONS.iter().map(|migration| migration.version).collect();
    if let Some(later) = later(&there, &known) {
        let known = known.into_iter().max().unwrap_or_default();
        return Err(Error::Newer { path, found: later, known }.into());
    }
    if known.iter().any(|version| !there.contains(version)) {
        return Err(Moving::OlderServer(path));
    }
    Ok(db)
}

async fn versions(db: &mut SqliteConnection) -> Result<Vec<i64>, sqlx::Error> {
    sqlx::query_scalar("SELECT version FROM _sqlx_migrations").fetch_all(db).await
}

/// A version of the tables that is later than all that are known.
fn later(there: &[i64], known: &[i64]) -> Option<i64> {
    let latest = known.iter().max().copied().unwrap_or_default();
    there.iter().max().copied().filter(|found| *found > latest)
}

/// Writes results into a file of their own: those of these keys, or all that are asked for. `tell` hears
/// how many are written, of how many.
///
/// # Errors
/// The file exists, a key is unknown, or a database refuses.
pub async fn export(
    dir: &Path,
    file: &Path,
    search: &Search,
    keys: &[Key],
    mut tell: impl FnMut(usize, usize),
) -> Result<Exported, Moving> {
    if file.exists() {
        return Err(Moving::Exists(file.to_owned()));
    }
    let mut db = beside(dir).await?;
    let named = !keys.is_empty();
    let keys = if named { keys.to_vec() } else { matching(&mut db, search).await? };
    let part = unfinished(file)?;
    let mut out = form(&part).await?;
    let mut done = Exported::default();
    let (mut count, mut bytes) = (0, 0);
    out.execute("BEGIN").await?;
    for (place, key) in keys.iter().enumerate() {
        match entry(&mut db, key).await? {
            Ok(entry) => {
                write(&mut out, key, &entry).await?;
                count += 1;
                bytes += entry.body.len();
                done.results += 1;
                done.bytes += entry.body.len() as u64;
            }
            Err(Absent::Unknown) if named => return Err(Moving::UnknownKey(*key)),
            Err(_) => done.left_out.push(*key),
        }
        if count >= 10 * AT_ONCE.0 || bytes >= 10 * AT_ONCE.1 {
            (count, bytes) = (0, 0);
            out.execute("COMMIT; BEGIN").await?;
        }
        tell(place + 1, keys.len());
    }
    out.execute("COMMIT").await?;
    out.close().await?;
    db.close().await?;
    name(&part, file)?;
    Ok(done)
}

/// The keys of all results that are asked for.
async fn matching(db: &mut SqliteConnection, search: &Search) -> Result<Vec<Key>, Moving> {
    loop {
        db.execute("BEGIN IMMEDIATE").await?;
        let more = outline::catch_up(db).await;
        db.execute(if more.is_ok() { "COMMIT" } else { "ROLLBACK" }).await?;
        if !more? {
            break;
        }
    }
    let (mut keys, mut cursor) = (Vec::new(), None);
    loop {
        let found = search::page(db, search, cursor, 1000).await?;
        keys.extend(found.results.into_iter().map(|listed| listed.key));
        cursor = found.next;
        if cursor.is_none() {
            return Ok(keys);
        }
    }
}

/// A result to be exported.
struct Entry {
    body: String,
    scenario: String,
    summary: String,
    outline: Outline,
    numerics: u32,
    provenance: Provenance,
}

/// Why there is no result to be exported.
enum Absent {
    Unknown,
    Damaged,
}

async fn entry(db: &mut SqliteConnection, key: &Key) -> Result<Result<Entry, Absent>, Error> {
    let kept = read::result(&mut *db, key).await;
    let (body, sum) = match kept {
        Ok(Some(read::Kept::Whole { body, sum })) => (body, sum),
        Ok(_) => return Ok(Err(Absent::Unknown)),
        Err(Error::Damaged(_)) => return Ok(Err(Absent::Damaged)),
        Err(error) => return Err(error),
    };
    let row =
        sqlx::query(library::PROVENANCE).bind(key.bytes().as_slice()).fetch_optional(db).await?;
    let Some(row) = row else { return Ok(Err(Absent::Unknown)) };
    let provenance = library::provenance(&row)?;
    if !sum.is_of(&body) {
        return Ok(Err(Absent::Damaged));
    }
    let (Ok(parsed), Ok(body)) = (serde_json::from_slice::<Body>(&body), String::from_utf8(body))
    else {
        return Ok(Err(Absent::Damaged));
    };
    let (scenario, summary) = (parsed.scenario.to_string(), parsed.summary().to_string());
    let numerics = parsed.engine.numerics;
    let outline = parsed.outline();
    Ok(Ok(Entry { body, scenario, summary, outline, numerics, provenance }))
}

/// Makes an empty export.
async fn form(path: &Path) -> Result<SqliteConnection, Moving> {
    let options = SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(true)
        .pragma("application_id", EXPORT.to_string())
        .pragma("user_version", FORM.to_string())
        // It has no name yet: one that is not finished is not used.
        .journal_mode(SqliteJournalMode::Off)
        .synchronous(SqliteSynchronous::Off);
    let mut out = SqliteConnection::connect_with(&options).await?;
    let mut query = QueryBuilder::<Sqlite>::new(
        "CREATE TABLE results (key TEXT PRIMARY KEY, numerics INTEGER NOT NULL",
    );
    for word in WORDS {
        query.push(", ").push(word.name).push(" TEXT");
    }
    for scalar in SCALARS {
        query.push(", ").push(scalar.name).push(" REAL");
    }
    query.push(
        ", scenario TEXT NOT NULL, summary TEXT NOT NULL, size INTEGER NOT NULL, sha256 TEXT NOT NULL,
         created TEXT NOT NULL, owner TEXT, computed TEXT, wall_seconds REAL, cpu_seconds REAL,
         version TEXT, host TEXT, architecture TEXT, processors INTEGER, pinned INTEGER NOT NULL,
         note TEXT, note_owner TEXT, note_at TEXT)",
    );
    query.build().execute(&mut out).await?;
    out.execute(
        "CREATE TABLE bodies (key TEXT PRIMARY KEY REFERENCES results (key), body TEXT NOT NULL);
         CREATE TABLE units (name TEXT PRIMARY KEY, unit TEXT NOT NULL);
         CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT NOT NULL)",
    )
    .await?;
    let mut query = QueryBuilder::<Sqlite>::new(
        "CREATE VIEW history AS SELECT results.key AS key, entry.key AS entry",
    );
    for name in HISTORY {
        query.push(", json_extract(body, '$.history.").push(name);
        query.push("[' || entry.key || ']') AS ").push(name);
    }
    query.push(
        " FROM results JOIN bodies ON bodies.key = results.key
         JOIN json_each(bodies.body, '$.history.cycles') AS entry",
    );
    query.build().execute(&mut out).await?;
    for (name, unit) in units() {
        let insert = sqlx::query("INSERT OR IGNORE INTO units VALUES (?1, ?2)");
        insert.bind(name).bind(unit).execute(&mut out).await?;
    }
    let about = [
        ("format", format!("an export of fretwork, form {FORM}")),
        ("program", format!("{} {}", ENGINE.name, env!("CARGO_PKG_VERSION"))),
        ("exported", text(now())),
        ("key", "SHA-256 of the engine's name, numerics and scenario (RFC 8785)".to_owned()),
        ("sha256", "of the body, byte for byte as the server answers it".to_owned()),
    ];
    for (name, value) in about {
        let insert = sqlx::query("INSERT INTO about VALUES (?1, ?2)");
        insert.bind(name).bind(value).execute(&mut out).await?;
    }
    Ok(out)
}

/// The units of all columns that have one.
fn units() -> impl Iterator<Item = (&'static str, &'static str)> {
    let scalars = SCALARS.iter().map(|scalar| (scalar.name, scalar.unit()));
    let seconds = [("wall_seconds", "s"), ("cpu_seconds", "s"), ("size", "B")];
    // What a result says of its own units comes first.
    UNITS.iter().copied().chain(scalars).chain(seconds)
}

async fn write(out: &mut SqliteConnection, key: &Key, entry: &Entry) -> Result<(), Moving> {
    let Entry { body, scenario, summary, outline, numerics, provenance } = entry;
    let mut query = QueryBuilder::<Sqlite>::new("INSERT INTO results VALUES (");
    let mut row = query.separated(", ");
    row.push_bind(key.to_string()).push_bind(*numerics);
    for word in &outline.words {
        row.push_bind(word.as_deref());
    }
    for number in &outline.scalars {
        row.push_bind(*number);
    }
    let Provenance { owner, wall, cpu, pinned, .. } = provenance;
    let (program, note) = (provenance.program.as_ref(), provenance.note.as_ref());
    row.push_bind(scenario).push_bind(summary);
    row.push_bind(body.len() as i64).push_bind(provenance.sha256.to_string());
    row.push_bind(text(provenance.created)).push_bind(owner.as_deref());
    row.push_bind(provenance.computed.map(text)).push_bind(*wall).push_bind(*cpu);
    row.push_bind(program.map(|program| program.version.as_str()));
    row.push_bind(program.map(|program| program.host.as_str()));
    row.push_bind(program.map(|program| program.architecture.as_str()));
    row.push_bind(program.map(|program| program.processors));
    row.push_bind(*pinned);
    row.push_bind(note.map(|note| note.text.as_str()));
    row.push_bind(note.map(|note| note.owner.as_str()));
    row.push_bind(note.map(|note| text(note.at)));
    query.push(")");
    query.build().execute(&mut *out).await?;
    let insert = sqlx::query("INSERT INTO bodies VALUES (?1, ?2)");
    insert.bind(key.to_string()).bind(body).execute(out).await?;
    Ok(())
}

/// A moment as people and their tools read it.
fn text(milliseconds: i64) -> String {
    let since = Duration::from_millis(u64::try_from(milliseconds).unwrap_or(0));
    humantime::format_rfc3339_millis(UNIX_EPOCH + since).to_string()
}

fn milliseconds(text: &str) -> Option<i64> {
    let since = humantime::parse_rfc3339(text).ok()?.duration_since(UNIX_EPOCH).ok()?;
    i64::try_from(since.as_millis()).ok()
}

/// Takes the results of an export over, as far as they are sound and not known. What was taken stays
/// whatever comes later, so that an import that was broken off goes on where it was. `tell` hears how
/// many were looked at, of how many.
///
/// # Errors
/// The file is no export, or a database refuses.
pub async fn import(
    dir: &Path,
    file: &Path,
    mut tell: impl FnMut(usize, usize),
) -> Result<Imported, Moving> {
    let mut from = open_export(file).await?;
    if !dir.join(DATABASE).exists() {
        Store::open(dir, &Options::default()).await?.close().await;
    }
    let mut db = beside(dir).await?;
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let keys: Vec<String> =
        sqlx::query_scalar("SELECT key FROM results ORDER BY key").fetch_all(&mut from).await?;
    let mut done = Imported::default();
    let (mut batch, mut bytes) = (Vec::new(), 0);
    for (place, text) in keys.iter().enumerate() {
        match sound(&mut from, &mut db, text).await? {
            Looked::Known => done.known += 1,
            Looked::Refused(why) => done.refused.push((text.clone(), why)),
            Looked::Sound(taken) => {
                bytes += taken.answer.body.len();
                batch.push(*taken);
            }
        }
        if batch.len() >= AT_ONCE.0 || bytes >= AT_ONCE.1 || place + 1 == keys.len() {
            take(&mut db, &name, std::mem::take(&mut batch), &mut done).await?;
            bytes = 0;
        }
        tell(place + 1, keys.len());
    }
    from.close().await?;
    db.close().await?;
    Ok(done)
}

async fn open_export(file: &Path) -> Result<SqliteConnection, Moving> {
    if !file.exists() {
        return Err(Moving::Nothing(file.to_owned()));
    }
    let options = open::connecting(file).read_only(true);
    let looked = async {
        let mut from = SqliteConnection::connect_with(&options).await?;
        let id: i32 = sqlx::query_scalar("PRAGMA application_id").fetch_one(&mut from).await?;
        let form: i32 = sqlx::query_scalar("PRAGMA user_version").fetch_one(&mut from).await?;
        Ok::<_, sqlx::Error>((from, id, form))
    };
    let path = file.to_owned();
    match looked.await.map_err(Error::from) {
        Ok((_, open::APPLICATION_ID, _)) => Err(Moving::WholeDatabase(path)),
        Ok((from, EXPORT, form)) if form <= FORM => Ok(from),
        Ok((_, EXPORT, found)) => Err(Moving::LaterForm { path, found }),
        Ok(_) | Err(Error::Damaged(_)) => Err(Moving::NoExport(path)),
        Err(error) => Err(error.into()),
    }
}

/// A sound result on its way into the tables.
struct Taken {
    key: Key,
    answer: Answered,
    task: String,
    owner: Option<String>,
    computed: Option<i64>,
    program: Option<Program>,
    note: Option<(String, String, i64)>,
}

/// What was found of a result in an export.
enum Looked {
    Known,
    Refused(String),
    Sound(Box<Taken>),
}

/// Looks at a result of an export before anything is changed.
async fn sound(
    from: &mut SqliteConnection,
    db: &mut SqliteConnection,
    text: &str,
) -> Result<Looked, Moving> {
    let refuse = |why: &str| Ok(Looked::Refused(why.to_owned()));
    let Ok(key) = text.parse::<Key>() else { return refuse("its key is none") };
    let row = sqlx::query(
        "SELECT results.*, length(CAST(body AS BLOB)) AS length
         FROM results LEFT JOIN bodies ON bodies.key = results.key WHERE results.key = ?1",
    )
    .bind(text)
    .fetch_one(&mut *from)
    .await?;
    let sha256: Option<Key> =
        row.try_get::<Option<&str>, _>("sha256")?.and_then(|sum| sum.parse().ok());
    let Some(sha256) = sha256 else { return refuse("it has no SHA-256") };
    match held(db, &key).await? {
        Some((digest, true)) if digest == *sha256.bytes() => return Ok(Looked::Known),
        Some((digest, _)) if digest != *sha256.bytes() => return refuse(DIFFERS),
        _ => {}
    }
    match row.try_get::<Option<i64>, _>("length")? {
        None => return refuse("it has no body"),
        Some(length) if length > 2 * MAX_ANSWER as i64 => return refuse("its body is too large"),
        Some(_) => {}
    }
    let body: Vec<u8> = sqlx::query_scalar("SELECT CAST(body AS BLOB) FROM bodies WHERE key = ?1")
        .bind(text)
        .fetch_one(from)
        .await?;
    if Sha256::digest(&body)[..] != sha256.bytes()[..] {
        return refuse("its body does not match its SHA-256: one of them was changed");
    }
    let Ok(parsed) = serde_json::from_slice::<Body>(&body) else {
        return refuse("its body is no result");
    };
    if parsed.engine.name != ENGINE.name
        || parsed.key != text
        || Key::of(parsed.engine.numerics, &parsed.scenario) != key
    {
        return refuse(
            "its key is not that of its scenario: it was changed, or comes from a version of \
             fretwork that makes keys differently",
        );
    }
    Ok(Looked::Sound(Box::new(taken(key, &row, body, &parsed)?)))
}

const DIFFERS: &str = "another result is held under its key, and stays";

fn taken(key: Key, row: &SqliteRow, body: Vec<u8>, parsed: &Body) -> Result<Taken, sqlx::Error> {
    let moment = |column| {
        let text: Option<&str> = row.try_get(column)?;
        Ok::<_, sqlx::Error>(text.and_then(milliseconds))
    };
    let seconds = |column| {
        let seconds: Option<f64> = row.try_get(column)?;
        Ok::<_, sqlx::Error>(seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()))
    };
    let cpu = seconds("cpu_seconds")?;
    let cost = seconds("wall_seconds")?.map(|wall| Cost { wall, cpu });
    let version: Option<String> = row.try_get("version")?;
    let program = match version {
        Some(version) => Some(Program {
            version,
            numerics: parsed.engine.numerics,
            host: row.try_get::<Option<_>, _>("host")?.unwrap_or_default(),
            architecture: row.try_get::<Option<_>, _>("architecture")?.unwrap_or_default(),
            processors: row.try_get::<Option<_>, _>("processors")?.unwrap_or_default(),
        }),
        None => None,
    };
    let note: Option<String> = row.try_get("note")?;
    let note = match note {
        Some(text) => {
            let owner: Option<String> = row.try_get("note_owner")?;
            Some((text, owner.unwrap_or_default(), moment("note_at")?.unwrap_or_else(now)))
        }
        None => None,
    };
    let answer = Answer { body: body.into(), summary: parsed.summary() };
    Ok(Taken {
        key,
        answer: Answered::new(&answer, cost),
        task: json!({"scenario": parsed.scenario}).to_string(),
        owner: row.try_get("owner")?,
        computed: moment("computed")?,
        program,
        note,
    })
}

/// The digest of a result, and whether its body is there.
async fn held(db: &mut SqliteConnection, key: &Key) -> Result<Option<([u8; 32], bool)>, Moving> {
    let row: Option<(Vec<u8>, bool)> =
        sqlx::query_as("SELECT digest, evicted IS NULL FROM result WHERE key = ?1")
            .bind(key.bytes().as_slice())
            .fetch_optional(db)
            .await?;
    Ok(row.and_then(|(digest, held)| Some((digest.try_into().ok()?, held))))
}

/// Puts some results in, in one transaction.
async fn take(
    db: &mut SqliteConnection,
    file: &str,
    batch: Vec<Taken>,
    done: &mut Imported,
) -> Result<(), Moving> {
    if batch.is_empty() {
        return Ok(());
    }
    db.execute("BEGIN IMMEDIATE").await?;
    let put = async {
        let mut some = Imported::default();
        for taken in batch {
            put(db, file, &taken, &mut some).await?;
        }
        db.execute("COMMIT").await?;
        Ok::<_, Moving>(some)
    };
    match put.await {
        Ok(some) => {
            done.results += some.results;
            done.bytes += some.bytes;
            done.known += some.known;
            done.refused.extend(some.refused);
            Ok(())
        }
        Err(error) => {
            // It fails if SQLite has rolled back already: then there is nothing to do.
            let _ = db.execute("ROLLBACK").await;
            Err(error)
        }
    }
}

async fn put(
    db: &mut SqliteConnection,
    file: &str,
    taken: &Taken,
    done: &mut Imported,
) -> Result<(), Moving> {
    let Taken { key, answer, task, owner, .. } = taken;
    // The server may have computed it since it was looked at.
    match held(db, key).await? {
        Some((digest, true)) if digest == answer.digest => {
            done.known += 1;
            return Ok(());
        }
        Some((digest, _)) if digest != answer.digest => {
            done.refused.push((key.to_string(), DIFFERS.to_owned()));
            return Ok(());
        }
        _ => {}
    }
    let program = match &taken.program {
        Some(program) => Some(program.row(db).await?),
        None => None,
    };
    let source = Source { task, owner: owner.as_deref(), job: None, trace: None, program };
    answer.insert(db, *key, &source, now()).await?;
    sqlx::query(
        "UPDATE result SET imported = ?2, imported_from = ?3, computed = ?4 WHERE key = ?1",
    )
    .bind(key.bytes().as_slice())
    .bind(now())
    .bind(file)
    .bind(taken.computed)
    .execute(&mut *db)
    .await?;
    if let Some((text, owner, at)) = &taken.note {
        sqlx::query("INSERT OR IGNORE INTO note (key, text, owner, at) VALUES (?1, ?2, ?3, ?4)")
            .bind(key.bytes().as_slice())
            .bind(text)
            .bind(owner)
            .bind(at)
            .execute(db)
            .await?;
    }
    done.results += 1;
    done.bytes += answer.body.len() as u64;
    Ok(())
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
    let mut former = None;
    let aside = dir.join(format!("fretwork.replaced-{}.db", now()));
    for suffix in ["", "-wal", "-shm"] {
        let old = open::with_suffix(&path, suffix);
        if old.exists() {
            let new = open::with_suffix(&aside, suffix);
            fs::rename(&old, new).map_err(refused(&old))?;
            former = Some(aside.clone());
        }
    }
    name(&part, &path)?;
    drop(lock);
    Ok((saved, former))
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
    let named = || {
        File::open(part)?.sync_all()?;
        if file.exists() {
            return Err(io::Error::from(io::ErrorKind::AlreadyExists));
        }
        fs::rename(part, file)?;
        let dir = file.parent().filter(|dir| !dir.as_os_str().is_empty());
        // Where directories cannot be synced there is nothing to do about it.
        let _ = File::open(dir.unwrap_or(Path::new("."))).and_then(|dir| dir.sync_all());
        Ok(())
    };
    named().map_err(refused(file))
}
