//! The form of an export: lines of JSON, compressed with Zstandard.
//!
//! The first line is a [`Head`], and each other line has one result. The author of a file may be malicious, so the
//! length of a line and the memory of the decompressor are limited.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::path::Path;

use bytes::Bytes;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use zstd::zstd_safe::MAGICNUMBER;

use super::{FORM, Moving, refused, require};
use crate::results::notes::Note;
use crate::sqlite::open::APPLICATION_ID;
use fretwork_engine::scenario::MAX_ANSWER;
use fretwork_job::{ENGINE, clock, is_too_deep};

/// The SQLite application id of form 1 ("frex").
const FIRST_FORM: i32 = 0x6672_6578;

/// Maximum size of an imported result, in bytes. Half more than `MAX_ANSWER`, because the estimate of the size of a
/// result can be too low.
pub const MAX_BODY: u64 = MAX_ANSWER as u64 / 2 * 3;
/// Maximum length of a line, in bytes: a body and what is known about it.
const MAX_LINE: u64 = MAX_BODY + 100_000;
/// The length of most lines, in bytes.
const SHORT_LINE: u64 = 1 << 20;
/// The decompressor keeps at most this number of bytes, as a power of 2. Only `zstd --ultra` and `--long` need more.
const WINDOW: u32 = 23;

/// How a [`Head`] begins.
const HEAD: &[u8] = b"{\"fretwork_export\":";

/// The first line.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Head {
    /// The version of the form.
    fretwork_export: u32,
    /// The version of the program that wrote the file, the version of its digits, and the time.
    version: String,
    numerics: u32,
    exported: String,
    /// The number of results that the program wanted to write.
    results: usize,
}

impl Head {
    /// The first line of an export by this program.
    pub(super) fn of(results: usize) -> Self {
        Self {
            fretwork_export: FORM,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            numerics: ENGINE.numerics,
            exported: clock::rfc3339(clock::now()),
            results,
        }
    }
}

/// A line with a result, and what the exporting server knows about it.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Line<'a> {
    pub(super) key: String,
    /// Of the body, in hexadecimal.
    pub(super) sha256: String,
    pub(super) owner: Option<String>,
    /// The time, as in RFC 3339.
    pub(super) computed: Option<String>,
    pub(super) wall_seconds: Option<f64>,
    pub(super) cpu_seconds: Option<f64>,
    pub(super) program: Option<Maker>,
    pub(super) warnings: Option<Vec<Told>>,
    pub(super) note: Option<Noted>,
    /// The body, byte for byte.
    #[serde(borrow)]
    pub(super) result: &'a RawValue,
}

/// The program that computed a result. The result itself has the version of its digits.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Maker {
    pub(super) version: String,
    #[serde(default)]
    pub(super) host: String,
    #[serde(default)]
    pub(super) architecture: String,
    #[serde(default)]
    pub(super) processors: u32,
}

/// A warning of the submission that computed a result.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Told {
    pub(super) kind: String,
    pub(super) detail: String,
}

/// A note on a result.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Noted {
    pub(super) text: String,
    pub(super) owner: String,
    /// The time, as in RFC 3339.
    pub(super) at: String,
}

impl From<&Note> for Noted {
    fn from(Note { text, owner, at, .. }: &Note) -> Self {
        Self { text: text.clone(), owner: owner.clone(), at: clock::rfc3339(*at) }
    }
}

/// The lines of an export that are not read yet, or the JSON of one result.
pub(super) struct Lines {
    from: Box<dyn BufRead>,
    /// The number of results in the file, as its first line says.
    pub(super) announced: usize,
    /// The number of the last line that was read.
    pub(super) number: u64,
    /// The JSON of a result, if the file is no export.
    json: Option<Bytes>,
}

/// What a file has next.
pub(super) enum Next {
    Line(Bytes),
    /// The JSON of the only result.
    Json(Bytes),
    End,
}

impl Lines {
    /// Opens an export or the JSON of a result: a file, or standard input for `-`. The lines may be compressed.
    pub(super) fn open(path: &Path) -> Result<Self, Moving> {
        let mut file: Box<dyn Read> = match path {
            _ if is_stdio(path) => Box::new(io::stdin()),
            _ => {
                // A FIFO would be opened only when another program writes to it.
                require(path)?;
                Box::new(File::open(path).map_err(refused(path))?)
            }
        };
        let path = if is_stdio(path) { Path::new("standard input") } else { path };
        let damaged =
            |error: io::Error| Moving::Damaged { path: path.to_owned(), said: error.to_string() };
        let mut start = Vec::new();
        (&mut file).take(100).read_to_end(&mut start).map_err(damaged)?;
        let (is_compressed, is_json) =
            (start.starts_with(&MAGICNUMBER.to_le_bytes()), start.starts_with(b"{"));
        if !is_compressed && !is_json {
            return Err(of_database(path, &start));
        }
        let file = BufReader::new(Cursor::new(start).chain(file));
        let from: Box<dyn BufRead> = if is_compressed {
            let mut decoder = zstd::Decoder::with_buffer(file).map_err(damaged)?;
            decoder.window_log_max(WINDOW).map_err(damaged)?;
            Box::new(BufReader::new(decoder))
        } else {
            Box::new(file)
        };
        let mut lines = Self { from, announced: 1, number: 0, json: None };
        let first = lines.line().map_err(damaged)?;
        if let Some(found) = form_of(&first)
            && found != FORM
        {
            return Err(Moving::LaterForm { path: path.to_owned(), found });
        }
        if let Ok(Head { results, .. }) = serde_json::from_slice(&first) {
            return Ok(Self { announced: results, ..lines });
        }
        // Somebody may have removed the first line.
        if !is_too_deep(&first) && serde_json::from_slice::<Line<'_>>(&first).is_ok() {
            let from = Box::new(Cursor::new(first).chain(lines.from));
            return Ok(Self { from, announced: 1, number: 0, json: None });
        }
        // A result is one line, unless somebody has formatted it.
        let mut json = first;
        json.reserve_exact(MAX_LINE as usize);
        lines.from.take(MAX_LINE).read_to_end(&mut json).map_err(damaged)?;
        // `fretwork run` ends the result with a line feed, which is not a part of the result.
        json.pop_if(|last| *last == b'\n');
        Ok(Self { from: Box::new(io::empty()), announced: 1, number: 0, json: Some(json.into()) })
    }

    /// What comes next. After an error, nothing can be read.
    pub(super) fn next(&mut self) -> io::Result<Next> {
        if let Some(json) = self.json.take() {
            return Ok(Next::Json(json));
        }
        loop {
            let mut line = self.line()?;
            if line.is_empty() {
                return Ok(Next::End);
            }
            line.pop_if(|last| *last == b'\n');
            // Exports can follow each other in a file.
            match form_of(&line) {
                Some(FORM) => {
                    let head: Option<Head> = serde_json::from_slice(&line).ok();
                    let more = head.map_or(0, |head| head.results);
                    self.announced = self.announced.saturating_add(more);
                }
                Some(_) => return Err(io::Error::other("a later version of fretwork wrote it")),
                None if line.trim_ascii().is_empty() => {}
                None => return Ok(Next::Line(line.into())),
            }
        }
    }

    /// A line with the line feed at its end; empty at the end of the file.
    fn line(&mut self) -> io::Result<Vec<u8>> {
        let mut line = Vec::new();
        self.number += 1;
        let mut read = |most: u64, line: &mut Vec<u8>| {
            (&mut self.from).take(most).read_until(b'\n', line).map(|length| length as u64 == most)
        };
        let mut is_longer = read(SHORT_LINE, &mut line)?;
        if is_longer && !line.ends_with(b"\n") {
            // A growing vector is copied, which would take memory for two lines.
            line.reserve_exact((MAX_LINE - SHORT_LINE) as usize);
            is_longer = read(MAX_LINE - SHORT_LINE, &mut line)?;
        }
        if is_longer && !line.ends_with(b"\n") {
            return Err(io::Error::other(format!(
                "it has more than {MAX_LINE} bytes, and no line that fretwork writes has so many"
            )));
        }
        Ok(line)
    }
}

/// The version of the form, if a line is the first one of an export.
fn form_of(line: &[u8]) -> Option<u32> {
    #[derive(Deserialize)]
    struct FirstMember {
        fretwork_export: u32,
    }
    let form: Option<FirstMember> =
        line.starts_with(HEAD).then(|| serde_json::from_slice(line).ok())?;
    form.map(|form| form.fretwork_export)
}

/// Whether this is the name of standard input or output.
pub(super) fn is_stdio(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// The error for a file that begins with `start`, which is neither an export nor JSON.
fn of_database(path: &Path, start: &[u8]) -> Moving {
    // The file format of SQLite: https://sqlite.org/fileformat.html#application_id
    let id =
        start.strip_prefix(b"SQLite format 3\0").and_then(|rest| rest.get(52..56)?.try_into().ok());
    let path = path.to_owned();
    match id.map(i32::from_be_bytes) {
        Some(FIRST_FORM) => Moving::FirstForm(path),
        Some(APPLICATION_ID) => Moving::WholeDatabase(path),
        _ => Moving::NoExport(path),
    }
}
