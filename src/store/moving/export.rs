//! Results into a file.

use std::path::Path;
use std::time::{Duration, UNIX_EPOCH};

use serde_json::{Map, Value};
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous};
use sqlx::{Connection as _, Executor as _, QueryBuilder, Sqlite, SqliteConnection};

use super::{AT_ONCE, EXPORT, FORM, Moving, beside, name, unfinished};
use crate::job::{ENGINE, Key};
use crate::store::library::{self, Provenance};
use crate::store::outline::{self, Body, Outline, SCALARS, WORDS};
use crate::store::search::{self, Search};
use crate::store::{Error, now, read};
use fretwork_engine::outcome::UNITS;

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
    history: Map<String, Value>,
    numerics: u32,
    provenance: Provenance,
}

/// Why there is no result to be exported.
enum Absent {
    Unknown,
    Damaged,
}

async fn entry(db: &mut SqliteConnection, key: &Key) -> Result<Result<Entry, Absent>, Error> {
    let kept = read::result(&mut *db, key, i64::MAX).await;
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
    let (numerics, history) = (parsed.engine.numerics, parsed.history.clone());
    let outline = parsed.outline();
    Ok(Ok(Entry { body, scenario, summary, outline, history, numerics, provenance }))
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
    // A table, not a view of the bodies, which would read a large body anew for each number.
    let mut query = QueryBuilder::<Sqlite>::new(
        "CREATE TABLE history (key TEXT NOT NULL REFERENCES results (key), entry INTEGER NOT NULL",
    );
    for name in HISTORY {
        query.push(", ").push(name).push(" REAL");
    }
    query.push(", PRIMARY KEY (key, entry)) WITHOUT ROWID");
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
    let Entry { body, scenario, summary, outline, history, numerics, provenance } = entry;
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
    row.push_bind(i64::try_from(body.len()).unwrap_or(i64::MAX))
        .push_bind(provenance.sha256.to_string());
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
    insert.bind(key.to_string()).bind(body).execute(&mut *out).await?;
    let columns = HISTORY.map(|name| history.get(name).and_then(Value::as_array));
    let instants = columns.iter().flatten().map(|column| column.len()).max().unwrap_or(0);
    for instant in 0..instants {
        let mut query = QueryBuilder::<Sqlite>::new("INSERT INTO history VALUES (");
        let mut row = query.separated(", ");
        row.push_bind(key.to_string()).push_bind(i64::try_from(instant).unwrap_or(i64::MAX));
        for column in columns {
            row.push_bind(column.and_then(|column| column.get(instant)?.as_f64()));
        }
        query.push(")");
        query.build().execute(&mut *out).await?;
    }
    Ok(())
}

/// A moment as people and their tools read it.
fn text(milliseconds: i64) -> String {
    let since = Duration::from_millis(u64::try_from(milliseconds).unwrap_or(0));
    humantime::format_rfc3339_millis(UNIX_EPOCH + since).to_string()
}
