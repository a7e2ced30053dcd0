//! Exports results to a file, an SQLite database of its own.

use std::path::Path;

use serde_json::Value;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous};
use sqlx::{Connection as _, QueryBuilder, Sqlite, SqliteConnection};

use super::{EXPORT, FORM, Moving, Part};
use crate::administration::Administration;
use crate::error::{Command, Error, Result};
use crate::library::Provenance;
use crate::place::Place;
use crate::read::{self, StoredResult};
use crate::search::{Found, Search};
use crate::statement::sql;
use crate::tables::Connected as _;
use fretwork_engine::outcome::{History, QUANTITIES};
use fretwork_job::{Document, ENGINE, Key, SCALARS, WORDS, clock};

/// The outcome of an export.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Exported {
    /// Number of results in the file.
    pub results: u64,
    /// Bytes of their bodies.
    pub bytes: u64,
    /// Results that are not in the file, because they are damaged or were evicted during the export.
    pub left_out: Vec<Key>,
}

/// Writes results into a file: those with the given keys, or, without keys, all that match the search.
/// `progress` is called with the number of results done and the number of all.
///
/// # Errors
/// The file exists, a key is unknown, or a database fails.
pub fn export<'a>(
    place: Place,
    file: &'a Path,
    search: &'a Search,
    keys: &'a [Key],
    progress: &'a mut dyn FnMut(usize, usize),
) -> Command<'a, Exported, Moving> {
    Box::pin(async move {
        if file.exists() {
            return Err(Moving::Exists(file.to_owned()));
        }
        if !Administration::is_at(&place) {
            return Err(Moving::NoDatabase(place));
        }
        let mut db = Administration::open(place).await?;
        let named = !keys.is_empty();
        let keys = if named { keys.to_vec() } else { matching(&mut db, search).await? };
        let part = Part::of(file, ".part")?;
        let mut out = create(&part.0).await?;
        let mut done = Exported::default();
        out.execute(sql!("BEGIN")).await?;
        for (place, key) in keys.iter().enumerate() {
            match entry(&mut db, key).await? {
                Ok(entry) => {
                    write(&mut out, key, &entry).await?;
                    done.results += 1;
                    done.bytes += entry.body.len() as u64;
                }
                Err(Absent::Unknown) if named => return Err(Moving::UnknownKey(*key)),
                Err(_) => done.left_out.push(*key),
            }
            progress(place + 1, keys.len());
        }
        out.execute(sql!("COMMIT")).await?;
        out.close().await?;
        db.close().await?;
        part.name(file)?;
        Ok(done)
    })
}

/// The keys of all matching results.
async fn matching(db: &mut Administration, search: &Search) -> Result<Vec<Key>, Moving> {
    let (mut keys, mut cursor) = (Vec::new(), None);
    loop {
        let found = Found::page(search, cursor, 1000, &mut *db).await?;
        keys.extend(found.results.into_iter().map(|listed| listed.key));
        cursor = found.next;
        if cursor.is_none() {
            return Ok(keys);
        }
    }
}

/// A result to be written.
struct Entry {
    body: String,
    document: Document,
    provenance: Provenance,
}

/// Why a result cannot be exported.
enum Absent {
    Unknown,
    Damaged,
}

async fn entry(db: &mut Administration, key: &Key) -> Result<Result<Entry, Absent>> {
    let (body, sum) = match read::result(key, i64::MAX, &mut *db).await {
        Ok(Some((StoredResult::Whole(body), sum))) => (body, sum),
        Ok(_) => return Ok(Err(Absent::Unknown)),
        Err(Error::Damaged(_)) => return Ok(Err(Absent::Damaged)),
        Err(error) => return Err(error),
    };
    let Some(provenance) = Provenance::of(key, &mut *db).await? else {
        return Ok(Err(Absent::Unknown));
    };
    if !sum.is_of(&body) {
        return Ok(Err(Absent::Damaged));
    }
    let Ok(body) = body.json() else { return Ok(Err(Absent::Damaged)) };
    let (Ok(document), Ok(body)) = (Document::read(&body), String::from_utf8(body.into())) else {
        return Ok(Err(Absent::Damaged));
    };
    Ok(Ok(Entry { body, document, provenance }))
}

/// Creates an empty export.
async fn create(path: &Path) -> Result<SqliteConnection, Moving> {
    let options = SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(true)
        .pragma("application_id", EXPORT.to_string())
        .pragma("user_version", FORM.to_string())
        // An interrupted export is discarded, so a journal has no use.
        .journal_mode(SqliteJournalMode::Off)
        .synchronous(SqliteSynchronous::Off);
    let mut out = SqliteConnection::connect_with(&options).await?;
    let mut create = sql!("CREATE TABLE results (key TEXT PRIMARY KEY, numerics INTEGER NOT NULL");
    for word in WORDS {
        create.push(", ").push(word.name).push(" TEXT");
    }
    for scalar in SCALARS {
        create.push(", ").push(scalar.name).push(" REAL");
    }
    create.push(
        ", scenario TEXT NOT NULL, summary TEXT NOT NULL, size INTEGER NOT NULL, sha256 TEXT NOT NULL,
         created TEXT NOT NULL, owner TEXT, computed TEXT, wall_seconds REAL, cpu_seconds REAL,
         version TEXT, host TEXT, architecture TEXT, processors INTEGER, pinned INTEGER NOT NULL,
         note TEXT, note_owner TEXT, note_at TEXT, warnings TEXT);
         CREATE TABLE bodies (key TEXT PRIMARY KEY REFERENCES results (key), body TEXT NOT NULL);
         CREATE TABLE units (name TEXT PRIMARY KEY, unit TEXT NOT NULL);
         CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT NOT NULL);
         CREATE TABLE history (key TEXT NOT NULL REFERENCES results (key), entry INTEGER NOT NULL",
    );
    // `history` is a table and not a view, because a view would parse the whole body for each number.
    for column in History::MEMBERS {
        create.push(", ").push(column.name).push(" REAL");
    }
    create.push(", PRIMARY KEY (key, entry)) WITHOUT ROWID");
    out.execute(create).await?;
    describe(&mut out).await?;
    Ok(out)
}

/// Fills the tables `units` and `about`.
async fn describe(out: &mut SqliteConnection) -> Result<(), Moving> {
    let scalars = SCALARS.iter().map(|scalar| (scalar.name, scalar.unit()));
    let others = [("wall_seconds", "s"), ("cpu_seconds", "s"), ("size", "B")];
    let quantities = QUANTITIES.iter().map(|quantity| (quantity.name, quantity.unit));
    for (name, unit) in quantities.chain(scalars).chain(others) {
        out.execute(sql!("INSERT OR IGNORE INTO units VALUES ($1, $2)"; name, unit)).await?;
    }
    let about = [
        ("format", format!("an export of fretwork, form {FORM}")),
        ("program", format!("{} {}", ENGINE.name, env!("CARGO_PKG_VERSION"))),
        ("exported", clock::rfc3339(clock::now())),
        ("key", "SHA-256 of the engine's name, numerics and scenario (RFC 8785)".to_owned()),
        ("sha256", "of the body, byte for byte as the server answers it".to_owned()),
    ];
    for (name, value) in about {
        out.execute(sql!("INSERT INTO about VALUES ($1, $2)"; name, value)).await?;
    }
    Ok(())
}

async fn write(out: &mut SqliteConnection, key: &Key, entry: &Entry) -> Result<(), Moving> {
    let Entry { body, document, provenance } = entry;
    let outline = &document.outline;
    let mut query = QueryBuilder::<Sqlite>::new("INSERT INTO results VALUES (");
    let mut row = query.separated(", ");
    row.push_bind(key.to_string()).push_bind(document.numerics);
    for word in &outline.words {
        row.push_bind(word.as_deref());
    }
    for number in &outline.scalars {
        row.push_bind(*number);
    }
    let Provenance { owner, wall, cpu, pinned, .. } = provenance;
    let (program, note) = (provenance.program.as_ref(), provenance.note.as_ref());
    row.push_bind(document.asked.value.to_string()).push_bind(document.summary.to_string());
    row.push_bind((body.len() as u64).cast_signed()).push_bind(provenance.sha256.to_string());
    row.push_bind(clock::rfc3339(provenance.created)).push_bind(owner.as_deref());
    row.push_bind(provenance.computed.map(clock::rfc3339)).push_bind(*wall).push_bind(*cpu);
    row.push_bind(program.map(|program| program.version.as_str()));
    row.push_bind(program.map(|program| program.host.as_str()));
    row.push_bind(program.map(|program| program.architecture.as_str()));
    row.push_bind(program.map(|program| program.processors));
    row.push_bind(*pinned);
    row.push_bind(note.map(|note| note.text.as_str()));
    row.push_bind(note.map(|note| note.owner.as_str()));
    row.push_bind(note.map(|note| clock::rfc3339(note.at)));
    row.push_bind(provenance.warnings.as_ref().map(Value::to_string));
    query.push(")");
    query.build().execute(&mut *out).await?;
    out.execute(sql!("INSERT INTO bodies VALUES ($1, $2)"; key.to_string(), body)).await?;
    let columns = History::MEMBERS.iter();
    let columns = columns.map(|column| document.history.get(column.name).and_then(Value::as_array));
    let columns: Vec<_> = columns.collect();
    let rows = columns.iter().flatten().map(|column| column.len()).max().unwrap_or(0);
    for (number, place) in (0_i64..).zip(0..rows) {
        let mut query = QueryBuilder::<Sqlite>::new("INSERT INTO history VALUES (");
        let mut row = query.separated(", ");
        row.push_bind(key.to_string()).push_bind(number);
        for column in &columns {
            row.push_bind(column.and_then(|column| column.get(place)?.as_f64()));
        }
        query.push(")");
        query.build().execute(&mut *out).await?;
    }
    Ok(())
}
