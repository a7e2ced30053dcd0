//! Results out of a file.

use std::path::Path;
use std::time::{Duration, UNIX_EPOCH};

use serde_json::json;
use sha2::{Digest as _, Sha256};
use sqlx::sqlite::SqliteRow;
use sqlx::{Connection as _, Executor as _, Row as _, SqliteConnection};

use super::{AT_ONCE, EXPORT, FORM, Moving, beside};
use crate::engine::scenario::MAX_ANSWER;
use crate::job::{Answer, Cost, ENGINE, Key};
use crate::store::keep::{Answered, Source};
use crate::store::library::Program;
use crate::store::open::{self, DATABASE};
use crate::store::outline::Body;
use crate::store::{Error, Options, Store, now};

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
        Some(length) if usize::try_from(length).is_ok_and(|length| length > 2 * MAX_ANSWER) => {
            return refuse("its body is too large");
        }
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

fn milliseconds(text: &str) -> Option<i64> {
    let since = humantime::parse_rfc3339(text).ok()?.duration_since(UNIX_EPOCH).ok()?;
    i64::try_from(since.as_millis()).ok()
}
