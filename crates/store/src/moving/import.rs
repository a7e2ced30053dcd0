//! Reading an export into a database.

use std::path::Path;
use std::time::Duration;

use bytes::Bytes;
use serde::{Deserialize, Serialize};
use serde_json::json;
use sha2::{Digest as _, Sha256};
use sqlx::Row as _;
use sqlx::sqlite::SqliteRow;

use super::Moving;
use super::untrusted::{ExportFile, Found, unreadable};
use crate::administration::Administration;
use crate::error::Error;
use crate::imports::{Before, Import, NoteTaken};
use crate::keep::Answered;
use crate::library::{Note, Program};
use crate::place::Place;
use fretwork_engine::scenario::MAX_ANSWER;
use fretwork_job::{Answer, Cost, ENGINE, Key, Received, Refused, clock};

/// What an import did.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Imported {
    /// Results that were stored.
    pub results: u64,
    /// Bytes of their bodies.
    pub bytes: u64,
    /// Results that this database already had.
    pub known: u64,
    /// Results that were computed anew before they were stored or refused.
    pub recomputed: u64,
    /// Results of earlier versions of the engine that were stored. This version cannot compute them anew.
    pub earlier: u64,
    /// Notes that were stored.
    pub notes: u64,
    /// Results that were refused: the key, and why.
    pub refused: Vec<(String, String)>,
    /// Results that keep their own note, because the note in the file differs.
    pub other_notes: Vec<Key>,
}

/// Stores the valid results of an export that this database does not have. Also stores the notes of results
/// that have no note in this database.
///
/// The first `verify` of these results, in random order, are computed anew before they are stored, and so are doubtful ones.
/// As soon as one differs, the file is not trusted: all further results are computed anew.
///
/// Each result has its own transaction, so an interrupted import can be repeated. `progress` is called
/// with the number of results done and the number of all.
///
/// # Errors
/// The file is not an export, or a database fails.
pub async fn import(
    place: impl Into<Place>,
    file: &Path,
    verify: u64,
    mut progress: impl FnMut(usize, usize),
) -> Result<Imported, Moving> {
    let mut from = ExportFile::open(file).await?;
    let rows = from.rows().await?;
    let mut db = Administration::open(place).await?;
    let file_name = file.file_name().ok_or_else(|| Moving::NoExport(file.to_owned()))?;
    let file_name = file_name.to_string_lossy();
    let (mut verify, mut done) = (Verify(verify), Imported::default());
    let of = rows.len();
    for (place, (row, key)) in rows.into_iter().enumerate() {
        let read = Entry::read(&mut from, row, &key).await;
        let refused = match read.map_err(|error| unreadable(file, error))? {
            Ok(entry) => entry.take(&mut db, &file_name, &mut verify, &mut done).await?,
            Err(why) => Some(why),
        };
        let name = if key.is_empty() { format!("row {row}") } else { key };
        done.refused.extend(refused.map(|why| (name, why)));
        progress(place + 1, of);
    }
    from.close().await?;
    db.close().await?;
    done.refused.sort_unstable();
    done.other_notes.sort_unstable();
    Ok(done)
}

/// The number of results that are still to be computed anew.
struct Verify(u64);

impl Verify {
    /// Computes a result anew if it is doubtful, or one of the sample. If it differs, all further results belong to the
    /// sample. A result without a flaw passes if this takes too long.
    fn result(&mut self, entry: &Entry, done: &mut Imported) -> Result<(), Refused> {
        let Entry { received, body, .. } = entry;
        if received.task.is_none() || self.0 == 0 && received.flaw.is_none() {
            return Ok(());
        }
        self.0 = self.0.saturating_sub(1);
        done.recomputed += 1;
        match received.recompute(body) {
            // An honest result can take long.
            Err(Refused::Long) if received.flaw.is_none() => Ok(()),
            Err(Refused::Long) => Err(Refused::Long),
            done => done.inspect_err(|_| self.0 = u64::MAX),
        }
    }
}

/// Maximum size of an imported body, in bytes. Estimates of the size of a result can be too low. SQLite and sqlx hold two
/// copies at a time.
const MAX_BODY: u64 = MAX_ANSWER as u64 / 2 * 3;
/// Maximum length of an imported name, in characters.
const MAX_NAME: usize = 200;
/// Maximum length of the imported warnings, in bytes. A submission has at most three of about 200 bytes each.
const MAX_WARNINGS: usize = 4000;

/// A result of an export whose row has passed all checks.
struct Entry {
    key: Key,
    received: Received,
    body: Bytes,
    cost: Option<Cost>,
    owner: Option<String>,
    computed: Option<i64>,
    program: Option<Program>,
    warnings: Option<String>,
    note: Option<Note>,
}

impl Entry {
    /// Reads and checks a result. The inner error says why it is refused.
    async fn read(
        from: &mut ExportFile,
        row: i64,
        key: &str,
    ) -> Result<Result<Self, String>, Error> {
        let text = key;
        let Ok(key) = text.parse() else {
            return Ok(Err("its key is not 64 lower-case hexadecimal digits".to_owned()));
        };
        let read = async {
            let Some(row) = from.result(row).await? else {
                return Ok(Err("its row is too large".to_owned()));
            };
            Ok(match from.body(text, MAX_BODY).await? {
                Some(Found::Body(body)) => Self::check(key, &row, body.into()),
                Some(Found::TooLarge) => Err(format!("its body has more than {MAX_BODY} bytes")),
                None => Err("it has no body".to_owned()),
            })
        };
        match read.await {
            Err(Error::Damaged(_)) => Ok(Err("the file is damaged at this result".to_owned())),
            read => read,
        }
    }

    /// Checks a row. The body must have the digest of the row, and must be able to be the result of the key.
    fn check(key: Key, row: &SqliteRow, body: Bytes) -> Result<Self, String> {
        let sha256: Option<Key> = column::<&str>(row, "sha256")?.and_then(|sum| sum.parse().ok());
        let sha256 = sha256.ok_or("it has no SHA-256")?;
        if Sha256::digest(&body)[..] != sha256.bytes()[..] {
            return Err("its body does not match its SHA-256: one of them was changed".to_owned());
        }
        let received = Received::judge(&key, &body).map_err(|refused| refused.to_string())?;
        let wall = column(row, "wall_seconds")?.map(seconds).transpose()?;
        let cpu = column(row, "cpu_seconds")?.map(seconds).transpose()?;
        Ok(Self {
            key,
            body,
            cost: wall.map(|wall| Cost { wall, cpu }),
            owner: name(row, "owner")?,
            computed: column(row, "computed")?.map(time).transpose()?,
            program: program(row, received.document.numerics)?,
            warnings: warnings(row)?,
            note: note(row)?,
            received,
        })
    }

    /// Verifies and stores the result if this database does not have it, and its note. If the result is refused, returns
    /// why.
    async fn take(
        &self,
        db: &mut Administration,
        file: &str,
        verify: &mut Verify,
        done: &mut Imported,
    ) -> Result<Option<String>, Error> {
        let document = &self.received.document;
        let answer = Answer::new(self.body.clone(), document);
        let answer = Answered::new(&answer, self.cost);
        let before = db.before(&self.key, &answer.digest).await?;
        if let Some(why) = before.refusal() {
            return Ok(Some(why));
        }
        // Outside of the transaction, because the server waits for it.
        if before == Before::Nothing
            && let Err(refused) = verify.result(self, done)
        {
            return Ok(Some(refused.to_string()));
        }
        let (before, note) = db
            .import(&Import {
                key: self.key,
                answer: &answer,
                task: &document.asked.kind.stored(&document.asked.value),
                owner: self.owner.as_deref(),
                warnings: self.warnings.as_deref(),
                program: self.program.as_ref(),
                computed: self.computed,
                note: self.note.as_ref(),
                file,
            })
            .await?;
        match before {
            Before::Same => done.known += 1,
            Before::Nothing => {
                done.results += 1;
                done.bytes += answer.size as u64;
                done.earlier += u64::from(document.numerics < ENGINE.numerics);
            }
            other => return Ok(other.refusal()),
        }
        match note {
            NoteTaken::Unchanged => {}
            NoteTaken::Stored => done.notes += 1,
            NoteTaken::Refused => done.other_notes.push(self.key),
        }
        Ok(None)
    }
}

/// Reads a column; `None` if it is empty.
fn column<'r, T>(row: &'r SqliteRow, name: &str) -> Result<Option<T>, String>
where
    T: sqlx::Decode<'r, sqlx::Sqlite> + sqlx::Type<sqlx::Sqlite>,
{
    row.try_get(name).map_err(|_| format!("its column {name} has a wrong type"))
}

/// Reads a column that contains a name. Lists and terminals show names, so control characters are refused.
fn name(row: &SqliteRow, column_name: &str) -> Result<Option<String>, String> {
    let name: Option<String> = column(row, column_name)?;
    match name {
        Some(name) if name.chars().count() > MAX_NAME || name.chars().any(char::is_control) => {
            Err(format!(
                "its column {column_name} has more than {MAX_NAME} characters, or control characters"
            ))
        }
        name => Ok(name),
    }
}

fn seconds(seconds: f64) -> Result<Duration, String> {
    Duration::try_from_secs_f64(seconds).map_err(|_| format!("{seconds} is not a time in seconds"))
}

fn time(text: &str) -> Result<i64, String> {
    clock::parse(text).ok_or_else(|| format!("{text:?} is not an RFC 3339 time"))
}

fn program(row: &SqliteRow, numerics: u32) -> Result<Option<Program>, String> {
    let Some(version) = name(row, "version")? else { return Ok(None) };
    Ok(Some(Program {
        version,
        numerics,
        host: name(row, "host")?.unwrap_or_default(),
        architecture: name(row, "architecture")?.unwrap_or_default(),
        processors: column(row, "processors")?.unwrap_or_default(),
    }))
}

/// Reads the warnings of the submission. Members that this version does not know are dropped.
fn warnings(row: &SqliteRow) -> Result<Option<String>, String> {
    #[derive(Serialize, Deserialize)]
    struct Told {
        kind: String,
        detail: String,
    }
    let Some(text) = column::<&str>(row, "warnings")? else { return Ok(None) };
    let told = Some(text).filter(|text| text.len() <= MAX_WARNINGS);
    let told: Option<Vec<Told>> = told.and_then(|text| serde_json::from_str(text).ok());
    let told = told.map(|told| json!(told).to_string());
    told.ok_or("its warnings are too long, or not a list of kinds and details".to_owned()).map(Some)
}

fn note(row: &SqliteRow) -> Result<Option<Note>, String> {
    let Some(text) = column::<String>(row, "note")? else { return Ok(None) };
    if let Some(fault) = Note::fault(&text) {
        return Err(format!("its note {fault}"));
    }
    let owner = name(row, "note_owner")?.ok_or("its note has no owner")?;
    let at = column(row, "note_at")?.ok_or("its note has no time")?;
    Ok(Some(Note { text, owner, at: time(at)? }))
}
