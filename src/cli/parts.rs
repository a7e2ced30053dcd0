//! The command `run` for a part of a study: computes every sixteenth chunk, for instance, into a file, and joins the
//! files of all parts.
//!
//! A file of a part has a line for each computed chunk, after a first line that says what is computed. Each line begins
//! with its checksum. A command that was killed may leave an incomplete last line. The next command removes this line
//! and continues.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read as _, Write as _};
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64;

use super::printing::{Error, Progress};
use super::study;
use crate::config::Part;
use fretwork_job::{Answer, Prepared, Submission, Task};
use fretwork_study::{Rows, Study};

/// The version of the form of these files.
const FORM: u32 = 1;

/// Computed chunks by their numbers.
type Chunks = BTreeMap<usize, Rows>;

/// The first line of a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Head {
    /// The version of the form of the file.
    fretwork_part: u32,
    part: Part,
    /// The number of chunks of the whole study.
    chunks: usize,
    /// The key of the study's result. Another version of the engine computes other rows under another key.
    key: String,
    /// The job body.
    job: String,
}

/// The line of a chunk.
#[derive(Debug, Serialize, Deserialize)]
struct Chunk {
    number: usize,
    rows: Rows,
}

/// The content of a file.
#[derive(Debug, Default)]
struct Content {
    head: Option<Head>,
    rows: Chunks,
    /// The length of all complete lines, in bytes.
    length: usize,
}

impl Content {
    /// Reads all lines up to the first damaged or incomplete one.
    fn read(text: &[u8]) -> Self {
        let mut content = Self::default();
        for line in text.split_inclusive(|byte| *byte == b'\n') {
            let Some(json) = checked(line) else { break };
            if content.head.is_none() {
                content.head = serde_json::from_slice(json).ok();
                if content.head.is_none() {
                    break;
                }
            } else {
                let Ok(Chunk { number, rows }) = serde_json::from_slice(json) else { break };
                content.rows.insert(number, rows);
            }
            content.length += line.len();
        }
        content
    }
}

/// The JSON of a line, if the line is complete and its checksum is right.
fn checked(line: &[u8]) -> Option<&[u8]> {
    let (sum, json) = line.strip_suffix(b"\n")?.split_at_checked(16)?;
    (format!("{:016x}", xxh3_64(json)).as_bytes() == sum).then_some(json)
}

fn line(content: &impl Serialize) -> serde_json::Result<Vec<u8>> {
    let json = serde_json::to_vec(content)?;
    Ok([format!("{:016x}", xxh3_64(&json)).as_bytes(), &json, b"\n"].concat())
}

/// The study of a job that can be computed in parts.
fn divisible(prepared: &Prepared) -> Result<&Arc<Study>, Error> {
    match &prepared.task {
        Task::Run(_) => Err("--part needs a study; one run has no parts".into()),
        Task::Study(study) if !study.stages().is_empty() => Err(format!(
            "a {} cannot be computed in parts, because each of its stages needs the rows of all earlier ones; use \
             `fretwork worker` to compute it on several machines",
            study.kind.name
        )
        .into()),
        Task::Study(study) => Ok(study),
    }
}

/// Computes the chunks of a part that the file does not have yet, and appends each to the file.
pub fn compute(job: &Submission, body: &[u8], part: Part, store: &Path) -> Result<ExitCode, Error> {
    let study = divisible(&job.prepared)?;
    let head = Head {
        fretwork_part: FORM,
        part,
        chunks: study.chunks(),
        key: job.prepared.key.to_string(),
        job: String::from_utf8(body.to_vec())?,
    };
    let unusable = |error: io::Error| format!("cannot use {}: {error}", store.display());
    let (file, known) = open(store, &head).map_err(unusable)??;
    let numbers = (part.number - 1..head.chunks).step_by(part.of);
    let all = numbers.clone().count();
    let missing: Vec<_> = numbers.filter(|number| !known.contains_key(number)).collect();
    let file = Mutex::new(file);
    let keep = |number, rows| file.lock().write_all(&line(&Chunk { number, rows })?);
    let computed = missing.len();
    let progress = (&mut Progress::new(), all - computed..all);
    study::chunks(study, &missing, &Rows::default(), progress, keep)?;
    file.into_inner().sync_all().map_err(unusable)?;
    writeln!(io::stderr(), "part {part}: {all} chunks, {} of them known already", all - computed)?;
    Ok(ExitCode::SUCCESS)
}

/// Opens the file of a part, and reads its chunks. Creates the file if it is missing. The inner error says why the file
/// is refused.
fn open(store: &Path, head: &Head) -> io::Result<Result<(File, Chunks), String>> {
    let mut file = OpenOptions::new().create(true).read(true).append(true).open(store)?;
    // Some file systems of clusters have no locks.
    if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
        return Ok(Err(format!("another process computes the part in {}", store.display())));
    }
    let mut text = Vec::new();
    file.read_to_end(&mut text)?;
    let (content, first) = (Content::read(&text), line(head)?);
    match content.head {
        // A command that was killed at its start leaves the beginning of the first line.
        None if first.starts_with(&text) => {
            file.set_len(0)?;
            file.write_all(&first)?;
        }
        Some(found) if found == *head => file.set_len(content.length as u64)?,
        _ => {
            return Ok(Err(format!(
                "{} exists already, and is not the file of this part of this study; name another file",
                store.display()
            )));
        }
    }
    Ok(Ok((file, content.rows)))
}

/// The rows of a whole study, and its job body.
pub struct Joined {
    /// The job body.
    pub body: Vec<u8>,
    key: String,
    /// The number of all chunks.
    count: usize,
    chunks: Chunks,
}

/// Reads the files of all parts of a study.
pub fn join(files: &[impl AsRef<Path>]) -> Result<Joined, Error> {
    let mut joined: Option<(Joined, Head)> = None;
    for file in files.iter().map(AsRef::as_ref) {
        let name = file.display();
        let text = std::fs::read(file).map_err(|error| format!("cannot read {name}: {error}"))?;
        let content = Content::read(&text);
        let head = content.head.filter(|head| head.fretwork_part == FORM);
        let head = head.ok_or_else(|| format!("{name} is not the file of a part of a study"))?;
        let (all, first) = joined.get_or_insert_with(|| {
            let Head { job, key, chunks: count, .. } = head.clone();
            (Joined { body: job.into_bytes(), key, count, chunks: BTreeMap::new() }, head.clone())
        });
        if (&head.key, head.part.of, head.chunks) != (&first.key, first.part.of, first.chunks) {
            return Err(
                format!("{name} has a part of another study, or of another division").into()
            );
        }
        all.chunks.extend(content.rows);
    }
    let (joined, Head { part, chunks, .. }) = joined.ok_or("--join needs a file")?;
    match (0..chunks).find(|number| !joined.chunks.contains_key(number)) {
        None => Ok(joined),
        Some(number) => Err(format!(
            "part {}/{of} is missing or not complete; compute it with --part {}/{of}",
            number % part.of + 1,
            number % part.of + 1,
            of = part.of
        )
        .into()),
    }
}

impl Joined {
    /// The answer of the study that was prepared from the job body, and the time to join it.
    pub fn answer(&self, prepared: &Prepared) -> Result<(Answer, Duration), Error> {
        let started = Instant::now();
        let study = divisible(prepared)?;
        if self.key != prepared.key.to_string() || self.count != study.chunks() {
            return Err("another version of fretwork computed the parts; join them with it".into());
        }
        let mut rows = Rows::default();
        self.chunks.values().for_each(|next| rows.append(next));
        Ok((Answer::of_study(prepared.key, study, &rows), started.elapsed()))
    }
}
