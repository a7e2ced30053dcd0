//! Results out of a file.

use std::path::Path;
use std::time::{Duration, UNIX_EPOCH};

use serde_json::json;
use sha2::{Digest as _, Sha256};
use sqlx::sqlite::SqliteRow;
use sqlx::{Connection as _, Executor as _, Row as _, Sqlite, SqliteConnection};

use super::{AT_ONCE, EXPORT, FORM, Moving, beside};
use crate::job::{Answer, Cost, ENGINE, Key};
use crate::store::keep::{Answered, Source};
use crate::store::library::{Note, Program};
use crate::store::open::{self, DATABASE};
use crate::store::outline::Body;
use crate::store::{Error, Options, Store, now};
use fretwork_engine::scenario::MAX_ANSWER;

/// What a file may say of results beside what is essential, which are the key, the sum and the body.
const BESIDE: [&str; 11] = [
    "owner",
    "computed",
    "wall_seconds",
    "cpu_seconds",
    "version",
    "host",
    "architecture",
    "processors",
    "note",
    "note_owner",
    "note_at",
];

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
    /// Notes that are new here, of results that are new or were there already.
    pub notes: u64,
    /// Results that were not taken: their key, and why.
    pub refused: Vec<(String, String)>,
    /// Results here that have another note than in the file, and keep it.
    pub other_notes: Vec<Key>,
    /// What was left out of results that were taken: their key, and what is wrong with it.
    pub left_out: Vec<(Key, String)>,
    /// What the file says of no result, as one of an earlier version may not: columns that it lacks.
    pub lacking: Vec<&'static str>,
}

impl Imported {
    fn add(&mut self, more: Self) {
        self.results += more.results;
        self.bytes += more.bytes;
        self.known += more.known;
        self.notes += more.notes;
        self.refused.extend(more.refused);
        self.other_notes.extend(more.other_notes);
        self.left_out.extend(more.left_out);
        self.lacking.extend(more.lacking);
    }
}

/// Takes the results of an export over, as far as they are sound and not known, and the notes of those
/// that are known where there is none. What was taken stays
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
            .await
            .map_err(|error| of_file(file, error.into()))?;
    let columns: Vec<String> = sqlx::query_scalar("SELECT name FROM pragma_table_info('results')")
        .fetch_all(&mut from)
        .await?;
    let is_lacking = |name: &&str| !columns.iter().any(|column| column == name);
    let lacking = BESIDE.into_iter().filter(is_lacking).collect();
    let mut done = Imported { lacking, ..Imported::default() };
    let (mut batch, mut bytes) = (Vec::new(), 0);
    for (place, text) in keys.iter().enumerate() {
        let text = String::from_utf8_lossy(text);
        let looked = match sound(&mut from, &mut db, &text).await {
            Err(error) => Looked::Refused(misfit(&error).ok_or(error)?),
            Ok(looked) => looked,
        };
        match looked {
            Looked::Refused(why) => done.refused.push((text.into_owned(), why)),
            Looked::Sound(taken) => {
                bytes += taken.result.as_ref().map_or(0, |new| new.answer.body.len());
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
    if !file.is_file() {
        return Err(Moving::Nothing(file.to_owned()));
    }
    let options = open::connecting(file).read_only(true);
    let looked = async {
        let mut from = SqliteConnection::connect_with(&options).await?;
        let id: i32 = sqlx::query_scalar("PRAGMA application_id").fetch_one(&mut from).await?;
        let form: i32 = sqlx::query_scalar("PRAGMA user_version").fetch_one(&mut from).await?;
        // A view could make up results without end.
        let tables: bool = sqlx::query_scalar(
            "SELECT count(*) = 4 FROM sqlite_schema AS part, pragma_table_info(part.name) AS has
             WHERE part.type = 'table' AND sql NOT LIKE 'CREATE VIRTUAL%'
                 AND (part.name, has.name) IN (VALUES ('results', 'key'), ('results', 'sha256'),
                     ('bodies', 'key'), ('bodies', 'body'))",
        )
        .fetch_one(&mut from)
        .await?;
        Ok::<_, sqlx::Error>((from, id, form, tables))
    };
    let path = file.to_owned();
    match looked.await.map_err(Error::from) {
        Ok((_, open::APPLICATION_ID, ..)) => Err(Moving::WholeDatabase(path)),
        Ok((_, EXPORT, found, _)) if found > FORM => Err(Moving::LaterForm { path, found }),
        Ok((from, EXPORT, _, true)) => Ok(from),
        Ok(_) => Err(Moving::NoExport(path)),
        Err(error) => Err(of_file(file, error)),
    }
}

/// What is wrong with the file, if it is the file.
fn of_file(file: &Path, error: Error) -> Moving {
    const SQLITE_NOTADB: &str = "26";
    let path = file.to_owned();
    match error {
        Error::Damaged(error) => {
            let code = error.as_database_error().and_then(sqlx::error::DatabaseError::code);
            if code.is_some_and(|code| code == SQLITE_NOTADB) {
                Moving::NoExport(path)
            } else {
                Moving::Damaged { path, said: error.to_string() }
            }
        }
        error => error.into(),
    }
}

/// What is taken of a row, on its way into the tables.
struct Taken {
    key: Key,
    digest: [u8; 32],
    /// None of a result that was there when it was looked at.
    result: Option<New>,
    note: Option<Note>,
    /// What is wrong with that which is not taken.
    left_out: Vec<String>,
}

/// A sound result.
struct New {
    answer: Answered,
    task: String,
    owner: Option<String>,
    computed: Option<i64>,
    program: Option<Program>,
}

/// What was found of a result in an export.
enum Looked {
    Refused(String),
    Sound(Box<Taken>),
}

/// What is held here under the key of a result.
enum Held {
    /// Nothing, or nothing any more.
    Nothing,
    /// The same.
    Same,
    /// What keeps the result out, for this reason.
    Other(String),
}

/// What a row states and nobody can check: taken as far as it fits.
struct Stated<'r> {
    row: &'r SqliteRow,
    /// What does not, and why.
    left_out: Vec<String>,
}

impl<'r> Stated<'r> {
    /// Nothing of a column that is empty or not there; what is of another kind does not fit.
    fn take<T, U>(&mut self, column: &str, what: &str, read: impl Fn(T) -> Option<U>) -> Option<U>
    where
        T: sqlx::Decode<'r, Sqlite> + sqlx::Type<Sqlite>,
    {
        let read = match self.row.try_get::<Option<T>, _>(column) {
            Ok(None) | Err(sqlx::Error::ColumnNotFound(_)) => return None,
            Ok(Some(stated)) => read(stated),
            Err(_) => None,
        };
        if read.is_none() {
            self.left_out.push(format!("its {column} is no {what}"));
        }
        read
    }

    /// At least a name, and not a page of something.
    fn name(&mut self, column: &str) -> Option<String> {
        let fits = |text: &String| {
            text.chars().count() <= LONGEST_NAME && !text.chars().any(char::is_control)
        };
        let what = format!("name of up to {LONGEST_NAME} characters");
        self.take(column, &what, |text: String| Some(text).filter(fits))
    }

    fn moment(&mut self, column: &str) -> Option<i64> {
        self.take(column, "moment such as 2026-01-31T12:00:00.000Z", milliseconds)
    }

    fn seconds(&mut self, column: &str) -> Option<Duration> {
        self.take(column, "time in seconds", |seconds| Duration::try_from_secs_f64(seconds).ok())
    }

    fn note(&mut self) -> Option<Note> {
        let text: String = self.take("note", "text", Some)?;
        if let Some(fault) = Note::fault(&text) {
            self.left_out.push(format!("its note {fault}"));
            return None;
        }
        let owner = self.name("note_owner").unwrap_or_default();
        Some(Note { text, owner, at: self.moment("note_at").unwrap_or_else(now) })
    }

    fn program(&mut self, numerics: u32) -> Option<Program> {
        let count = |stated: i64| u32::try_from(stated).ok();
        let (version, host) = (self.name("version"), self.name("host"));
        let architecture = self.name("architecture");
        let processors = self.take("processors", "number of processors", count);
        let Some(version) = version else {
            if host.is_some() || architecture.is_some() || processors.is_some() {
                self.left_out.push("its machine, for there is no version".to_owned());
            }
            return None;
        };
        let (host, architecture) = (host.unwrap_or_default(), architecture.unwrap_or_default());
        let processors = processors.unwrap_or_default();
        Some(Program { version, numerics, host, architecture, processors })
    }

    /// All of it, with the result that it is of.
    fn result(&mut self, body: Vec<u8>, parsed: &Body) -> New {
        let (owner, computed) = (self.name("owner"), self.moment("computed"));
        let (wall, cpu) = (self.seconds("wall_seconds"), self.seconds("cpu_seconds"));
        let answer = Answer { body: body.into(), summary: parsed.summary() };
        New {
            answer: Answered::new(&answer, wall.map(|wall| Cost { wall, cpu })),
            task: json!({"scenario": parsed.scenario}).to_string(),
            owner,
            computed,
            program: self.program(parsed.engine.numerics),
        }
    }
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

/// Why a result that cannot be read is refused.
const DAMAGED: &str = "the file is damaged where it lies";

/// What a file says; none where it is damaged.
fn legible<T>(said: Result<T, sqlx::Error>) -> Result<Option<T>, Error> {
    match said.map_err(Error::from) {
        Err(Error::Damaged(_)) => Ok(None),
        said => said.map(Some),
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
    .await;
    let Some(row) = legible(row)? else { return refuse(DAMAGED) };
    let Some(row) = row else { return refuse("its key is none") };
    let sha256: Option<Key> =
        row.try_get::<Option<&str>, _>("sha256")?.and_then(|sum| sum.parse().ok());
    let Some(sha256) = sha256 else { return refuse("it has no SHA-256") };
    let digest = *sha256.bytes();
    let mut stated = Stated { row: &row, left_out: Vec::new() };
    match held(db, &key, &digest).await? {
        Held::Nothing => {}
        Held::Same => {
            let note = stated.note();
            let taken = Taken { key, digest, result: None, note, left_out: stated.left_out };
            return Ok(Looked::Sound(Box::new(taken)));
        }
        Held::Other(why) => return Ok(Looked::Refused(why)),
    }
    match row.try_get::<Option<i64>, _>("length")? {
        None => return refuse("it has no body"),
        Some(length) if usize::try_from(length).is_ok_and(|length| length > 2 * MAX_ANSWER) => {
            return refuse("its body is too large");
        }
        Some(_) => {}
    }
    let body = sqlx::query_scalar("SELECT CAST(body AS BLOB) FROM bodies WHERE key = ?1")
        .bind(text)
        .fetch_one(from)
        .await;
    let Some(body): Option<Vec<u8>> = legible(body)? else { return refuse(DAMAGED) };
    if Sha256::digest(&body)[..] != digest[..] {
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
    let result = Some(stated.result(body, &parsed));
    let note = stated.note();
    let taken = Taken { key, digest, result, note, left_out: stated.left_out };
    Ok(Looked::Sound(Box::new(taken)))
}

/// What is held under the key of a result, or was.
async fn held(
    db: &mut SqliteConnection,
    key: &Key,
    digest: &[u8; 32],
) -> Result<Held, sqlx::Error> {
    let row: Option<(bool, bool, Option<String>)> = sqlx::query_as(
        "SELECT evicted IS NULL, digest = ?2, deleted_by FROM result WHERE key = ?1",
    )
    .bind(key.bytes().as_slice())
    .bind(digest.as_slice())
    .fetch_optional(db)
    .await?;
    let why = match row {
        None | Some((false, true, None)) => return Ok(Held::Nothing),
        Some((true, true, _)) => return Ok(Held::Same),
        Some((true, false, _)) => "another result is held under its key, and stays".to_owned(),
        Some((false, _, Some(who))) => {
            format!("it was deleted here by {who}; only computing it brings it back")
        }
        Some((false, false, None)) => {
            "it is not the result that was held under its key and dropped".to_owned()
        }
    };
    Ok(Held::Other(why))
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
            put(db, file, taken, &mut some).await?;
        }
        db.execute("COMMIT").await?;
        Ok::<_, Moving>(some)
    };
    match put.await {
        Ok(some) => {
            done.add(some);
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
    taken: Taken,
    done: &mut Imported,
) -> Result<(), Moving> {
    let Taken { key, digest, result, note, left_out } = taken;
    if let Some(new) = result {
        // The server may have computed it since it was looked at.
        match held(db, &key, &digest).await? {
            Held::Nothing => {
                new.put(db, key, file).await?;
                done.results += 1;
                done.bytes += new.answer.body.len() as u64;
            }
            Held::Same => done.known += 1,
            Held::Other(why) => {
                done.refused.push((key.to_string(), why));
                return Ok(());
            }
        }
    } else {
        done.known += 1;
    }
    done.left_out.extend(left_out.into_iter().map(|what| (key, what)));
    if let Some(note) = note {
        annotate(db, key, &note, done).await?;
    }
    Ok(())
}

impl New {
    async fn put(&self, db: &mut SqliteConnection, key: Key, file: &str) -> Result<(), Moving> {
        let program = match &self.program {
            Some(program) => Some(program.row(db).await?),
            None => None,
        };
        let owner = self.owner.as_deref();
        let source = Source { task: &self.task, owner, job: None, trace: None, program };
        self.answer.insert(db, key, &source, now()).await?;
        sqlx::query(
            "UPDATE result SET imported = ?2, imported_from = ?3, computed = ?4 WHERE key = ?1",
        )
        .bind(key.bytes().as_slice())
        .bind(now())
        .bind(file)
        .bind(self.computed)
        .execute(db)
        .await?;
        Ok(())
    }
}

/// Puts a note to a result that has none.
async fn annotate(
    db: &mut SqliteConnection,
    key: Key,
    note: &Note,
    done: &mut Imported,
) -> Result<(), Moving> {
    let new = sqlx::query(
        "INSERT INTO note (key, text, owner, at) SELECT key, ?2, ?3, ?4 FROM result WHERE key = ?1
         ON CONFLICT DO NOTHING",
    )
    .bind(key.bytes().as_slice())
    .bind(&note.text)
    .bind(&note.owner)
    .bind(note.at)
    .execute(&mut *db)
    .await?;
    if new.rows_affected() > 0 {
        done.notes += 1;
        return Ok(());
    }
    let there: Option<String> = sqlx::query_scalar("SELECT text FROM note WHERE key = ?1")
        .bind(key.bytes().as_slice())
        .fetch_optional(db)
        .await?;
    if there.is_some_and(|there| there != note.text) {
        done.other_notes.push(key);
    }
    Ok(())
}

fn milliseconds(text: &str) -> Option<i64> {
    let since = humantime::parse_rfc3339(text).ok()?.duration_since(UNIX_EPOCH).ok()?;
    i64::try_from(since.as_millis()).ok()
}
