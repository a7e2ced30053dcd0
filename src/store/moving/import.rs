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
use crate::store::library::{Note, Program};
use crate::store::open::{self, DATABASE};
use crate::store::outline::Body;
use crate::store::{Error, Options, Store, now};

/// The longest name of an owner, a machine or a release in characters.
const LONGEST_NAME: usize = 200;

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
    /// Results that were taken without their note: their key, and what it would have to be.
    pub without_note: Vec<(String, String)>,
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
    let keys: Vec<Vec<u8>> =
        sqlx::query_scalar("SELECT CAST(coalesce(key, '') AS BLOB) FROM results ORDER BY key")
            .fetch_all(&mut from)
            .await?;
    let mut done = Imported::default();
    let (mut batch, mut bytes) = (Vec::new(), 0);
    for (place, text) in keys.iter().enumerate() {
        let text = String::from_utf8_lossy(text);
        let looked = match sound(&mut from, &mut db, &text).await {
            Err(error) => Looked::Refused(misfit(&error).ok_or(error)?),
            Ok(looked) => looked,
        };
        match looked {
            Looked::Known => done.known += 1,
            Looked::Refused(why) => done.refused.push((text.into_owned(), why)),
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
    note: Option<Note>,
}

/// What was found of a result in an export.
enum Looked {
    Known,
    Refused(String),
    Sound(Box<Taken>),
}

/// What is wrong with a row, if it was that and not a database that refuses.
fn misfit(error: &Moving) -> Option<String> {
    let Moving::Store(Error::Database(error)) = error else { return None };
    match &**error {
        sqlx::Error::ColumnDecode { index, .. } => {
            Some(format!("its column {index} does not hold what it should"))
        }
        sqlx::Error::ColumnNotFound(name) => Some(format!("it has no column {name:?}")),
        _ => None,
    }
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
    .fetch_optional(&mut *from)
    .await?;
    let Some(row) = row else { return refuse("its key is none") };
    let sha256: Option<Key> =
        row.try_get::<Option<&str>, _>("sha256")?.and_then(|sum| sum.parse().ok());
    let Some(sha256) = sha256 else { return refuse("it has no SHA-256") };
    if let Some(settled) = beside_held(db, &key, sha256.bytes()).await? {
        return Ok(settled);
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
    if !parsed.has_history() {
        return refuse("its history is no columns of numbers, all of one length");
    }
    Ok(Looked::Sound(Box::new(taken(key, &row, body, &parsed)?)))
}

fn taken(key: Key, row: &SqliteRow, body: Vec<u8>, parsed: &Body) -> Result<Taken, sqlx::Error> {
    let moment = |column| {
        let text: Option<&str> = row.try_get(column)?;
        Ok::<_, sqlx::Error>(text.and_then(milliseconds))
    };
    let seconds = |column| {
        let seconds: Option<f64> = row.try_get(column)?;
        Ok::<_, sqlx::Error>(seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()))
    };
    // What nobody can check is at least a name, and not a page of something.
    let stated = |column| {
        let text: Option<String> = row.try_get(column)?;
        let fits = |text: &String| {
            text.chars().count() <= LONGEST_NAME && !text.chars().any(char::is_control)
        };
        Ok::<_, sqlx::Error>(text.filter(fits))
    };
    let cpu = seconds("cpu_seconds")?;
    let cost = seconds("wall_seconds")?.map(|wall| Cost { wall, cpu });
    let version = stated("version")?;
    let program = match version {
        Some(version) => Some(Program {
            version,
            numerics: parsed.engine.numerics,
            host: stated("host")?.unwrap_or_default(),
            architecture: stated("architecture")?.unwrap_or_default(),
            processors: row.try_get::<Option<_>, _>("processors")?.unwrap_or_default(),
        }),
        None => None,
    };
    let note: Option<String> = row.try_get("note")?;
    let note = match note {
        Some(text) => {
            let owner = stated("note_owner")?.unwrap_or_default();
            Some(Note { text, owner, at: moment("note_at")?.unwrap_or_else(now) })
        }
        None => None,
    };
    let answer = Answer { body: body.into(), summary: parsed.summary() };
    Ok(Taken {
        key,
        answer: Answered::new(&answer, cost),
        task: json!({"scenario": parsed.scenario}).to_string(),
        owner: stated("owner")?,
        computed: moment("computed")?,
        program,
        note,
    })
}

/// What becomes of a result beside what is held under its key, or was; none if it can be taken.
async fn beside_held(
    db: &mut SqliteConnection,
    key: &Key,
    digest: &[u8; 32],
) -> Result<Option<Looked>, Moving> {
    let row: Option<(bool, bool, Option<String>)> = sqlx::query_as(
        "SELECT evicted IS NULL, digest = ?2, deleted_by FROM result WHERE key = ?1",
    )
    .bind(key.bytes().as_slice())
    .bind(digest.as_slice())
    .fetch_optional(db)
    .await?;
    let why = match row {
        None | Some((false, true, None)) => return Ok(None),
        Some((true, true, _)) => return Ok(Some(Looked::Known)),
        Some((true, false, _)) => "another result is held under its key, and stays".to_owned(),
        Some((false, _, Some(who))) => {
            format!("it was deleted here by {who}; only computing it brings it back")
        }
        Some((false, false, None)) => {
            "it is not the result that was held under its key and dropped".to_owned()
        }
    };
    Ok(Some(Looked::Refused(why)))
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
            done.without_note.extend(some.without_note);
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
    match beside_held(db, key, &answer.digest).await? {
        Some(Looked::Refused(why)) => {
            done.refused.push((key.to_string(), why));
            return Ok(());
        }
        Some(_) => {
            done.known += 1;
            return Ok(());
        }
        None => {}
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
    if let Some(Note { text, owner, at }) = &taken.note {
        if let Some(why) = Note::fault(text) {
            done.without_note.push((key.to_string(), why));
        } else {
            sqlx::query(
                "INSERT OR IGNORE INTO note (key, text, owner, at) VALUES (?1, ?2, ?3, ?4)",
            )
            .bind(key.bytes().as_slice())
            .bind(text)
            .bind(owner)
            .bind(at)
            .execute(db)
            .await?;
        }
    }
    done.results += 1;
    done.bytes += answer.body.len() as u64;
    Ok(())
}

fn milliseconds(text: &str) -> Option<i64> {
    let since = humantime::parse_rfc3339(text).ok()?.duration_since(UNIX_EPOCH).ok()?;
    i64::try_from(since.as_millis()).ok()
}
