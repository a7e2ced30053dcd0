//! Imports the results of an export, or the JSON of one result, into a database.
//!
//! This module reads and stores the results. The caller verifies each result before it is stored, by computing it
//! again.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::time::Duration;
use std::vec;

use bytes::Bytes;
use serde::{Deserialize, Serialize};
use serde_json::json;
use sha2::{Digest as _, Sha256};
use sqlx::Row as _;
use sqlx::sqlite::SqliteRow;

use super::Moving;
use super::untrusted::{ExportFile, Found, unreadable};
use crate::administration::Administration;
use crate::error::{Command, Error, Result};
use crate::imports::{self, Before, Import, NoteTaken};
use crate::keep::Answered;
use crate::library::{Note, Program};
use crate::place::Place;
use fretwork_engine::scenario::MAX_ANSWER;
use fretwork_job::{Answer, Cost, Document, Key, Verified, clock};

/// The outcome of an import.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Imported {
    /// Number of results that were stored.
    pub results: u64,
    /// Bytes of the stored bodies.
    pub bytes: u64,
    /// Number of results that this database already had.
    pub known: u64,
    /// Number of stored studies of which only some random rows were computed again.
    pub sampled: u64,
    /// Number of stored results of which nothing was computed again.
    pub unverified: u64,
    /// Number of notes that were stored.
    pub notes: u64,
    /// The key of each refused result, and the reason.
    pub refused: Vec<(String, String)>,
    /// Results that keep their own note, because the note in the file differs.
    pub other_notes: Vec<Key>,
}

/// An import in progress. It skips results that the database already has, so an interrupted import can be repeated.
#[derive(Debug)]
pub struct Importer {
    from: Source,
    db: Administration,
    path: PathBuf,
    done: Imported,
}

/// The results of a file that are not read yet.
#[derive(Debug)]
enum Source {
    /// An export, and the numbers and keys of its rows.
    Export(ExportFile, vec::IntoIter<(i64, String)>),
    /// The JSON of one result.
    Json(Option<Bytes>),
}

impl Source {
    async fn open(path: &Path) -> Result<Self, Moving> {
        if let Some(json) = json_of(path) {
            return Ok(Self::Json(Some(json)));
        }
        let mut file = ExportFile::open(path).await?;
        let rows = file.rows().await?.into_iter();
        Ok(Self::Export(file, rows))
    }
}

/// The JSON of a result that `fretwork run` has written, or its first bytes if it is too large; `None` if the file is not
/// JSON or cannot be read.
fn json_of(path: &Path) -> Option<Bytes> {
    // A FIFO would be opened only when another program writes to it.
    let mut file = path.is_file().then(|| File::open(path).ok())??;
    let mut json = vec![0];
    file.read_exact(&mut json).ok().filter(|()| json == *b"{")?;
    file.take(MAX_BODY + 1).read_to_end(&mut json).ok()?;
    // The command ends the result with a line feed, which is not a part of the result.
    json.pop_if(|last| *last == b'\n');
    Some(json.into())
}

impl Importer {
    /// Opens an export, or the JSON of one result, and the database that receives the results.
    ///
    /// # Errors
    /// The file is neither, or a database fails.
    pub fn open(place: Place, file: &Path) -> Command<'_, Self, Moving> {
        Box::pin(async move {
            let from = Source::open(file).await?;
            let (db, path) = (Administration::open(place).await?, file.to_owned());
            Ok(Self { from, db, path, done: Imported::default() })
        })
    }

    /// The number of rows that are not read yet.
    pub fn unread(&self) -> usize {
        match &self.from {
            Source::Export(_, rows) => rows.len(),
            Source::Json(json) => usize::from(json.is_some()),
        }
    }

    /// Reads the next row. Returns `None` if there is no row left, or if its result is already stored or is refused.
    ///
    /// # Errors
    /// A database fails.
    pub fn next_entry(&mut self) -> Command<'_, Option<Entry>, Moving> {
        Box::pin(async move {
            let (name, entry) = match &mut self.from {
                Source::Export(file, rows) => {
                    let Some((row, name)) = rows.next() else { return Ok(None) };
                    let entry = match Entry::read(file, row, &name).await {
                        Err(Error::Damaged(_)) => {
                            Err("the file is damaged at this result; export it again".to_owned())
                        }
                        read => read.map_err(|error| unreadable(&self.path, error))?,
                    };
                    (if name.is_empty() { format!("row {row}") } else { name }, entry)
                }
                Source::Json(json) => {
                    let Some(body) = json.take() else { return Ok(None) };
                    ("in the file".to_owned(), Entry::of_json(body))
                }
            };
            let read = self.unless_known(entry).await?;
            Ok(read.unwrap_or_else(|why| {
                self.done.refused.push((name, why));
                None
            }))
        })
    }

    /// Returns `None` if the database already has the result. The inner error is the reason why the result is refused.
    async fn unless_known(
        &mut self,
        entry: Result<(Entry, [u8; 32]), String>,
    ) -> Result<Result<Option<Entry>, String>, Moving> {
        let (entry, digest) = match entry {
            Ok(read) => read,
            Err(why) => return Ok(Err(why)),
        };
        let before = Before::of(&entry.key, &digest, &mut self.db).await?;
        if let Some(why) = before.refusal() {
            return Ok(Err(why));
        }
        if before == Before::Nothing {
            return Ok(Ok(Some(entry)));
        }
        self.done.known += 1;
        let note = self.db.change(imports::take_note, &(entry.key, entry.note)).await?;
        self.count_note(note, entry.key);
        Ok(Ok(None))
    }

    /// Refuses a result.
    pub fn refuse(&mut self, key: Key, why: String) {
        self.done.refused.push((key.to_string(), why));
    }

    /// Stores a result and its note in a transaction.
    ///
    /// # Errors
    /// The database fails.
    pub fn store(&mut self, Accepted(import): Accepted) -> Command<'_, (), Moving> {
        Box::pin(async move {
            let file = self.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let (key, size, verified) = (import.key, import.answer.size, import.verified);
            let (before, note) = self.db.change(imports::import, &(import, file)).await?;
            match before {
                Before::Nothing => {
                    self.done.results += 1;
                    self.done.bytes += size as u64;
                    match verified {
                        Verified::All => {}
                        Verified::Rows(_) => self.done.sampled += 1,
                        Verified::No => self.done.unverified += 1,
                    }
                }
                // A server has stored it meanwhile.
                Before::Same => self.done.known += 1,
                other => self.refuse(key, other.refusal().unwrap_or_default()),
            }
            self.count_note(note, key);
            Ok(())
        })
    }

    fn count_note(&mut self, note: NoteTaken, key: Key) {
        match note {
            NoteTaken::Unchanged => {}
            NoteTaken::Stored => self.done.notes += 1,
            NoteTaken::Refused => self.done.other_notes.push(key),
        }
    }

    /// Closes both databases.
    ///
    /// # Errors
    /// A database fails.
    pub fn close(mut self) -> Command<'static, Imported, Moving> {
        Box::pin(async move {
            if let Source::Export(file, _) = self.from {
                file.close().await?;
            }
            self.db.close().await?;
            self.done.refused.sort_unstable();
            self.done.other_notes.sort_unstable();
            Ok(self.done)
        })
    }
}

/// Maximum size of an imported body, in bytes. Half more than `MAX_ANSWER`, because the estimate of the size of a
/// result can be too low. It is limited because SQLite and sqlx hold two copies of a body in memory.
pub const MAX_BODY: u64 = MAX_ANSWER as u64 / 2 * 3;
/// Maximum length of an imported name, in characters.
const MAX_NAME: usize = 200;
/// Maximum length of the imported warnings, in bytes. A submission has at most three of about 200 bytes each.
const MAX_WARNINGS: usize = 4000;

/// A result of an export whose row has passed all checks, but whose body is not trusted.
#[derive(Debug)]
pub struct Entry {
    /// Its key.
    pub key: Key,
    /// The JSON of the result.
    pub body: Bytes,
    cost: Option<Cost>,
    owner: Option<String>,
    computed: Option<i64>,
    program: Option<Program>,
    warnings: Option<String>,
    note: Option<Note>,
}

/// A result that may be stored.
#[derive(Debug)]
pub struct Accepted(Import);

impl Entry {
    /// Reads a result and its digest. The inner error is the reason why the result is refused.
    async fn read(
        from: &mut ExportFile,
        row: i64,
        name: &str,
    ) -> Result<Result<(Self, [u8; 32]), String>> {
        let Ok(key) = name.parse() else {
            return Ok(Err(
                "the key of a result must have 64 lower-case hexadecimal digits".to_owned()
            ));
        };
        let Some(row) = from.result(row).await? else {
            return Ok(Err("the row of this result in the file is too large".to_owned()));
        };
        Ok(match from.body(name, MAX_BODY).await? {
            Some(Found::Body(body)) => Self::check(key, &row, body.into()),
            Some(Found::TooLarge) => Err(too_large()),
            None => {
                Err("the file does not contain the JSON of the result; export it again".to_owned())
            }
        })
    }

    /// The result whose JSON is `body`, and its digest. Nothing is known of its computation.
    fn of_json(body: Bytes) -> Result<(Self, [u8; 32]), String> {
        #[derive(Deserialize)]
        struct Named {
            key: String,
        }
        if body.len() as u64 > MAX_BODY {
            return Err(too_large());
        }
        let named: Option<Named> = serde_json::from_slice(&body).ok();
        let key = named.and_then(|named| named.key.parse().ok()).ok_or(
            "the JSON is not a result; name a file that `fretwork run` or `fretwork export` wrote",
        )?;
        let digest = Sha256::digest(&body).into();
        let (cost, owner, computed, program, warnings, note) = (None, None, None, None, None, None);
        Ok((Self { key, body, cost, owner, computed, program, warnings, note }, digest))
    }

    /// Checks a row, and that its SHA-256 is that of the body.
    fn check(key: Key, row: &SqliteRow, body: Bytes) -> Result<(Self, [u8; 32]), String> {
        let sha256: Option<Key> = column::<&str>(row, "sha256")?.and_then(|sum| sum.parse().ok());
        let sha256 =
            sha256.ok_or("the SHA-256 of the result is missing or not valid; export it again")?;
        let digest = Sha256::digest(&body).into();
        if digest != *sha256.bytes() {
            return Err(
                "the JSON of the result does not match its SHA-256; export it again".to_owned()
            );
        }
        let wall = column(row, "wall_seconds")?.map(seconds).transpose()?;
        let cpu = column(row, "cpu_seconds")?.map(seconds).transpose()?;
        let entry = Self {
            key,
            body,
            cost: wall.map(|wall| Cost { wall, cpu }),
            owner: name(row, "owner")?,
            computed: column(row, "computed")?.map(time).transpose()?,
            program: program(row)?,
            warnings: warnings(row)?,
            note: note(row)?,
        };
        Ok((entry, digest))
    }

    /// Accepts the result, whose parsed body is `document`. Compresses the body.
    pub fn accept(self, document: &Document, verified: Verified) -> Accepted {
        let Self { key, body, cost, owner, computed, program, warnings, note } = self;
        let program = program.map(|it| Program { numerics: document.numerics, ..it });
        let answer = Answered::new(&Answer::new(body, document), cost);
        let task = document.asked.kind.stored(&document.asked.value);
        Accepted(Import { key, answer, task, owner, warnings, program, computed, note, verified })
    }
}

fn too_large() -> String {
    format!("the JSON of the result has more than {MAX_BODY} bytes")
}

/// Reads a column; `None` if it is empty.
fn column<'r, T>(row: &'r SqliteRow, name: &str) -> Result<Option<T>, String>
where
    T: sqlx::Decode<'r, sqlx::Sqlite> + sqlx::Type<sqlx::Sqlite>,
{
    row.try_get(name)
        .map_err(|_| format!("the column {name} of the file has a value of a wrong type"))
}

/// Reads a column that contains a name. Lists and terminals show names, so control characters are refused.
fn name(row: &SqliteRow, column_name: &str) -> Result<Option<String>, String> {
    let name: Option<String> = column(row, column_name)?;
    match name {
        Some(name) if name.chars().count() > MAX_NAME || name.chars().any(char::is_control) => {
            Err(format!(
                "a value of the column {column_name} has more than {MAX_NAME} characters, or control characters"
            ))
        }
        name => Ok(name),
    }
}

fn seconds(seconds: f64) -> Result<Duration, String> {
    Duration::try_from_secs_f64(seconds)
        .map_err(|_| format!("{seconds} is not a time in seconds, 0 or more"))
}

fn time(text: &str) -> Result<i64, String> {
    clock::parse(text)
        .ok_or_else(|| format!("{text:?} is not an RFC 3339 time such as 2026-01-31T12:00:00Z"))
}

/// Reads the program that computed a result. Its `numerics` version is set later, from the body.
fn program(row: &SqliteRow) -> Result<Option<Program>, String> {
    let Some(version) = name(row, "version")? else { return Ok(None) };
    Ok(Some(Program {
        version,
        numerics: 0,
        host: name(row, "host")?.unwrap_or_default(),
        architecture: name(row, "architecture")?.unwrap_or_default(),
        processors: column(row, "processors")?.unwrap_or_default(),
    }))
}

/// Reads the warnings of the submission. Unknown members of a warning are dropped.
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
    told.ok_or(
        "the warnings are too long, or not a list of objects with `kind` and `detail`".to_owned(),
    )
    .map(Some)
}

fn note(row: &SqliteRow) -> Result<Option<Note>, String> {
    let Some(text) = column::<String>(row, "note")? else { return Ok(None) };
    if let Some(fault) = Note::fault(&text) {
        return Err(format!("the note on the result {fault}"));
    }
    let owner = name(row, "note_owner")?.ok_or("the note on the result has no owner")?;
    let at = column(row, "note_at")?.ok_or("the note on the result has no time")?;
    Ok(Some(Note { text, owner, at: time(at)? }))
}
