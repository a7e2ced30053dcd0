//! Imports the results of an export, or the JSON of one result, into a database.
//!
//! This module reads and stores the results. The caller verifies each result before it is stored, by computing it
//! again.

use std::path::Path;
use std::time::Duration;

use bytes::Bytes;
use serde::Deserialize;
use serde_json::json;
use sha2::{Digest as _, Sha256};

use super::Moving;
use super::lines::{Line, Lines, MAX_BODY, Maker, Next, Noted, Told, is_stdio};
use crate::administration::Administration;
use crate::database::{Command, Place};
use crate::moving::store_import::{self, Accepted, Before, NoteTaken};
use crate::results::library::Program;
use crate::results::notes::Note;
use crate::results::storing::Answered;
use fretwork_job::{Answer, Cost, Key, ResultDocument, Verified, clock, is_too_deep};

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
    /// Number of results that the first line of the file announces, but the file does not have.
    pub missing: u64,
    /// The key of each refused result, and the reason.
    pub refused: Vec<(String, String)>,
    /// Results that keep their own note, because the note in the file differs.
    pub other_notes: Vec<Key>,
}

/// An import in progress. It skips results that the database already has, so an interrupted import can be repeated.
pub struct Importer {
    lines: Lines,
    /// Number of results that were read.
    read: usize,
    is_over: bool,
    db: Administration,
    /// The name of the file.
    name: String,
    done: Imported,
}

impl Importer {
    /// Opens an export, or the JSON of one result, and the database that receives the results. The file `-` is standard
    /// input.
    ///
    /// # Errors
    /// The file is neither, or a database fails.
    pub fn open(place: Place, file: &Path) -> Command<'_, Self, Moving> {
        Box::pin(async move {
            let (lines, db) = (Lines::open(file)?, Administration::open(place).await?);
            let name = match file.file_name() {
                Some(name) if !is_stdio(file) => name.to_string_lossy().into_owned(),
                _ => "standard input".to_owned(),
            };
            Ok(Self { lines, read: 0, is_over: false, db, name, done: Imported::default() })
        })
    }

    /// Whether everything is read.
    pub fn is_over(&self) -> bool {
        self.is_over
    }

    /// The number of results that were read, and of all in the file, as far as it is known.
    pub fn read(&self) -> (usize, usize) {
        let all = if self.is_over { self.read } else { self.lines.announced.max(self.read) };
        (self.read, all)
    }

    /// Reads the next result. Returns `None` if there is none left, or if it is already stored or is refused.
    ///
    /// # Errors
    /// A database fails.
    pub fn next_entry(&mut self) -> Command<'_, Option<UntrustedResult>, Moving> {
        Box::pin(async move {
            let next = self.lines.next();
            let (name, entry) = match next {
                _ if self.done.refused.len() == MOST_REFUSED => {
                    self.end(&format!("{MOST_REFUSED} results are refused"))
                }
                Ok(Next::Line(line)) if let Some(key) = key_in(&line) => {
                    (key, UntrustedResult::of_line(&line))
                }
                // The rest of a broken line may follow, or the file is no export at all.
                Ok(Next::Line(_)) => self.end("it is nested too deeply, or has no key of a result"),
                Ok(Next::Json(body)) => ("in the file".to_owned(), UntrustedResult::of_json(body)),
                Ok(Next::End) => {
                    self.is_over = true;
                    self.done.missing = self.lines.announced.saturating_sub(self.read) as u64;
                    return Ok(None);
                }
                Err(error) => self.end(&error.to_string()),
            };
            self.read += 1;
            let read = self.unless_known(entry).await?;
            Ok(read.unwrap_or_else(|why| {
                self.done.refused.push((name, why));
                None
            }))
        })
    }

    /// Reads no further line. Returns the name of the last line, and why it is refused.
    fn end<T>(&mut self, why: &str) -> (String, Result<T, String>) {
        self.is_over = true;
        let why = format!("{why}; the rest of the file is not read");
        (format!("in line {}", self.lines.number), Err(why))
    }

    /// Returns `None` if the database already has the result. The inner error is the reason why the result is refused.
    async fn unless_known(
        &mut self,
        entry: Result<(UntrustedResult, [u8; 32]), String>,
    ) -> Result<Result<Option<UntrustedResult>, String>, Moving> {
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
        let note = self.db.change(store_import::take_note, &(entry.key, entry.note)).await?;
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
    pub fn store(&mut self, import: Accepted) -> Command<'_, (), Moving> {
        Box::pin(async move {
            let file = self.name.clone();
            let (key, size, verified) = (import.key, import.answer.size, import.verified);
            let (before, note) =
                self.db.change(store_import::store_import, &(import, file)).await?;
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

    /// Closes the database.
    ///
    /// # Errors
    /// A database fails.
    pub fn close(mut self) -> Command<'static, Imported, Moving> {
        Box::pin(async move {
            self.db.close().await?;
            self.done.refused.sort_unstable();
            self.done.other_notes.sort_unstable();
            Ok(self.done)
        })
    }
}

/// Maximum number of refused results. A small file can have any number of lines when it is decompressed.
const MOST_REFUSED: usize = 10_000;
/// Maximum length of an imported name, in characters.
const MAX_NAME: usize = 200;
/// Maximum length of the imported warnings, in bytes. A submission has at most three of about 200 bytes each.
const MAX_WARNINGS: usize = 4000;

/// A result whose line has passed all checks, but whose body is not trusted.
#[derive(Debug)]
pub struct UntrustedResult {
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

impl UntrustedResult {
    /// Reads a line: the result and its digest.
    fn of_line(line: &Bytes) -> Result<(Self, [u8; 32]), String> {
        let read: Line<'_> = serde_json::from_slice(line)
            .map_err(|error| format!("the line is not one of an export: {error}"))?;
        let body = line.slice_ref(read.result.get().as_bytes());
        if body.len() as u64 > MAX_BODY {
            return Err(too_large());
        }
        let (Ok(key), Ok(sha256)) = (read.key.parse(), read.sha256.parse::<Key>()) else {
            let wrong = "must have 64 lower-case hexadecimal digits";
            return Err(format!("the key of a result, and its SHA-256, {wrong}"));
        };
        let digest = Sha256::digest(&body).into();
        if digest != *sha256.bytes() {
            let wrong = "the JSON of the result does not match its SHA-256; export it again, and choose lines with `grep`, \
                         because other programs, such as `jq`, write numbers in another way";
            return Err(wrong.to_owned());
        }
        let cpu = read.cpu_seconds.map(seconds).transpose()?;
        let wall = read.wall_seconds.map(seconds).transpose()?;
        let entry = Self {
            key,
            body,
            cost: wall.map(|wall| Cost { wall, cpu }),
            owner: read.owner.map(|owner| name("owner", owner)).transpose()?,
            computed: read.computed.map(|at| time(&at)).transpose()?,
            program: read.program.map(program).transpose()?,
            warnings: read.warnings.as_deref().map(warnings).transpose()?,
            note: read.note.map(note).transpose()?,
        };
        Ok((entry, digest))
    }

    /// The result whose JSON is `body`, and its digest. Nothing is known of its computation.
    fn of_json(body: Bytes) -> Result<(Self, [u8; 32]), String> {
        if body.len() as u64 > MAX_BODY {
            return Err(too_large());
        }
        let key = key_in(&body).and_then(|key| key.parse().ok()).ok_or(
            "the JSON is not a result; name a file that `fretwork run` or `fretwork export` wrote",
        )?;
        let digest = Sha256::digest(&body).into();
        let (cost, owner, computed, program, warnings, note) = (None, None, None, None, None, None);
        Ok((Self { key, body, cost, owner, computed, program, warnings, note }, digest))
    }

    /// Accepts the result, whose parsed body is `document`. Compresses the body.
    pub fn accept(self, document: &ResultDocument, verified: Verified) -> Accepted {
        let Self { key, body, cost, owner, computed, program, warnings, note } = self;
        let program = program.map(|it| Program { numerics: document.numerics, ..it });
        let answer = Answered::new(&Answer::new(body, document), cost);
        let task = document.asked.kind.stored(&document.asked.value);
        Accepted { key, answer, task, owner, warnings, program, computed, note, verified }
    }
}

/// The member `key` of a result or a line.
fn key_in(json: &[u8]) -> Option<String> {
    #[derive(Deserialize)]
    struct NamingJob {
        key: String,
    }
    if is_too_deep(json) {
        return None;
    }
    let named: Option<NamingJob> = serde_json::from_slice(json).ok();
    named.map(|named| named.key).filter(|key| key.len() <= 64)
}

fn too_large() -> String {
    format!("the JSON of the result has more than {MAX_BODY} bytes")
}

/// Checks a name. Lists and terminals show names, so control characters are refused.
fn name(member: &str, name: String) -> Result<String, String> {
    if name.chars().count() > MAX_NAME || name.chars().any(char::is_control) {
        let wrong = format!("more than {MAX_NAME} characters, or control characters");
        return Err(format!("`{member}` has {wrong}"));
    }
    Ok(name)
}

fn seconds(seconds: f64) -> Result<Duration, String> {
    Duration::try_from_secs_f64(seconds)
        .map_err(|_| format!("{seconds} is not a time in seconds, 0 or more"))
}

fn time(text: &str) -> Result<i64, String> {
    clock::parse(text)
        .ok_or_else(|| format!("{text:?} is not an RFC 3339 time such as 2026-01-31T12:00:00Z"))
}

/// Checks the program that computed a result. Its `numerics` version is set later, from the body.
fn program(maker: Maker) -> Result<Program, String> {
    Ok(Program {
        version: name("version", maker.version)?,
        numerics: 0,
        host: name("host", maker.host)?,
        architecture: name("architecture", maker.architecture)?,
        processors: maker.processors,
    })
}

/// Checks the warnings of the submission.
fn warnings(told: &[Told]) -> Result<String, String> {
    let told = json!(told).to_string();
    let is_short = told.len() <= MAX_WARNINGS;
    is_short.then_some(told).ok_or_else(|| format!("`warnings` has more than {MAX_WARNINGS} bytes"))
}

fn note(Noted { text, owner, at }: Noted) -> Result<Note, String> {
    if let Some(fault) = Note::fault(&text) {
        return Err(format!("the note on the result {fault}"));
    }
    Ok(Note { text, owner: name("owner", owner)?, at: time(&at)?, private: false })
}
