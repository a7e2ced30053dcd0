//! The command `run` for a part of a study: computes a sixteenth of the points, for instance, into a file, and joins
//! the files of all parts.
//!
//! A file of a part has a line for each computed chunk, after a first line that says what is computed. Each line begins
//! with its checksum. A command that was killed may leave an incomplete last line. The next command removes this line
//! and continues.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytesize::ByteSize;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64;

use super::places::make_parent;
use super::printing::{Error, Progress, counted, say};
use super::runtime::on_all_cores;
use super::study;
use crate::config::StudyPart;
use fretwork_job::{Answer, Prepared, Submission, Task};
use fretwork_store::MAX_BODY;
use fretwork_study::{Rows, Study};

/// The version of the form of these files.
const FORM: u32 = 1;
/// Longest line that is read, in bytes. A chunk has at most some thousand points. A file can be endless.
const LONGEST_LINE: u64 = 1 << 27;

/// Computed chunks by their numbers.
type Chunks = BTreeMap<usize, Rows>;

/// The first line of a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct FirstLine {
    /// The version of the form of the file.
    fretwork_part: u32,
    part: StudyPart,
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
    head: Option<FirstLine>,
    rows: Chunks,
    /// The length of all complete lines, in bytes.
    length: usize,
    /// The first damaged or incomplete line.
    rest: Vec<u8>,
}

impl Content {
    /// Reads all lines up to the first damaged or incomplete one.
    fn read(file: &File) -> io::Result<Self> {
        let (mut content, mut file) = (Self::default(), BufReader::new(file));
        loop {
            let line = &mut content.rest;
            line.clear();
            file.by_ref().take(LONGEST_LINE).read_until(b'\n', line)?;
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
        Ok(content)
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

/// The number of chunks of a study in this number of parts, to which the chunks belong in turn. The parts have the same number
/// of chunks, whose sizes differ by at most one point. If that were more than 2 %, each chunk is one point.
fn chunks(study: &Study, of: usize) -> usize {
    let chunks = study.chunks().div_ceil(of).saturating_mul(of);
    if study.points() / 50 < chunks { study.points() } else { chunks }
}

/// Computes the chunks of a part that the file does not have yet, and appends each to the file.
pub fn compute(job: &Submission, body: &[u8], part: StudyPart, store: &Path) -> Result<(), Error> {
    let study = divisible(&job.prepared)?;
    let [bytes, most] = [study.bytes() as u64, MAX_BODY].map(ByteSize::b);
    if bytes > most {
        say(&format!("the joined result could have {bytes}, and `fretwork import` accepts {most}"));
    }
    let head = FirstLine {
        fretwork_part: FORM,
        part,
        chunks: chunks(study, part.of),
        key: job.prepared.key.to_string(),
        job: String::from_utf8(body.to_vec())?,
    };
    let unusable = |error: io::Error| format!("cannot use {}: {error}", store.display());
    let (mut file, known) = open(store, &head).map_err(unusable)??;
    let numbers = (part.number - 1..head.chunks).step_by(part.of);
    let all = numbers.clone().count();
    let missing: Vec<_> = numbers.filter(|number| !known.contains_key(number)).collect();
    let known = all - missing.len();
    let progress = (&mut Progress::new(true), known..all);
    let (study, count) = (Arc::clone(study), head.chunks);
    let work =
        move |number| Chunk { number, rows: study::chunk(&study, number, count, Rows::default()) };
    on_all_cores(missing, progress, work, |chunk| {
        let written = file.write_all(&line(&chunk?)?);
        written.map_err(|error| format!("cannot write a chunk of the study: {error}").into())
    })?;
    file.sync_all().map_err(unusable)?;
    let all = counted(all as u64, "chunk");
    Ok(writeln!(io::stderr(), "part {part}: {all}, {known} of them known already")?)
}

/// Opens the file of a part, and reads its chunks. Creates the file if it is missing. The inner error says why the file
/// is refused.
fn open(store: &Path, head: &FirstLine) -> io::Result<Result<(File, Chunks), String>> {
    make_parent(store)?;
    let mut file = OpenOptions::new().create(true).read(true).append(true).open(store)?;
    if !file.metadata()?.is_file() {
        return Ok(Err(format!("{} is not a regular file; name another one", store.display())));
    }
    // Some file systems of clusters have no locks.
    if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
        return Ok(Err(format!("another process computes the part in {}", store.display())));
    }
    let (content, first) = (Content::read(&file)?, line(head)?);
    match content.head {
        // A command that was killed at its start leaves the beginning of the first line.
        None if first.starts_with(&content.rest) => {
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

/// The rows of a whole study, and what the first line of one of its files says.
pub struct Joined {
    head: FirstLine,
    chunks: Chunks,
}

/// Reads the files of all parts of a study.
pub fn join(files: &[impl AsRef<Path>]) -> Result<Joined, Error> {
    let mut joined: Option<Joined> = None;
    for file in files.iter().map(AsRef::as_ref) {
        let name = file.display();
        // A FIFO would be opened only when another program writes to it, and a device can be endless.
        let content = fs::metadata(file).and_then(|found| {
            if found.is_file() { Content::read(&File::open(file)?) } else { Ok(Content::default()) }
        });
        let content = content.map_err(|error| format!("cannot read {name}: {error}"))?;
        let head = content.head.filter(|head| head.fretwork_part == FORM);
        let head = head.ok_or_else(|| format!("{name} is not the file of a part of a study"))?;
        let first = || Joined { head: head.clone(), chunks: Chunks::new() };
        let all = joined.get_or_insert_with(first);
        let [own, of_all] = [&head, &all.head].map(|it| (&it.key, it.part.of, it.chunks));
        if own != of_all {
            return Err(
                format!("{name} has a part of another study, or of another division").into()
            );
        }
        all.chunks.extend(content.rows);
    }
    let joined = joined.ok_or("--join needs a file")?;
    let of = joined.head.part.of;
    match (0..joined.head.chunks).find(|number| !joined.chunks.contains_key(number)) {
        None => Ok(joined),
        Some(number) => {
            let part = StudyPart { number: number % of + 1, of };
            Err(format!("part {part} is missing or not complete; compute it with --part {part}")
                .into())
        }
    }
}

impl Joined {
    /// The job body.
    pub fn body(&self) -> &[u8] {
        self.head.job.as_bytes()
    }

    /// The answer of the study that was prepared from the job body, and the time to join it.
    pub fn answer(&self, prepared: &Prepared) -> Result<(Answer, Duration), Error> {
        let started = Instant::now();
        let study = divisible(prepared)?;
        let FirstLine { key, part, chunks: count, .. } = &self.head;
        if *key != prepared.key.to_string() || *count != chunks(study, part.of) {
            return Err("another version of fretwork computed the parts; join them with it".into());
        }
        let mut rows = Rows::default();
        self.chunks.values().for_each(|next| rows.append(next.clone()));
        Ok((Answer::of_study(prepared.key, study, rows), started.elapsed()))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    #[test]
    fn parts_have_about_as_many_points() {
        let ball: Value = serde_json::from_str(crate::http::EXAMPLES[0].body).unwrap();
        for (count, of) in [(24, 16), (48, 16), (7, 16), (1000, 7), (99_991, 3), (5, usize::MAX)] {
            let vary = json!([{"pointer": "/friction", "from": 0.5, "to": 0.8, "count": count}]);
            let sweep =
                json!({"scenario": ball["scenario"], "vary": vary, "outputs": ["wear_depth"]});
            let job = Submission::parse(json!({"sweep": sweep}).to_string().as_bytes()).unwrap();
            let study = divisible(&job.prepared).unwrap();
            let mut points = BTreeMap::new();
            let chunks = chunks(study, of);
            for number in 0..chunks {
                *points.entry(number % of).or_insert(0) += study.points_of(number, chunks).len();
            }
            assert_eq!(points.values().sum::<usize>(), count);
            assert_eq!(points.len(), of.min(count));
            let (least, most) = (points.values().min().unwrap(), points.values().max().unwrap());
            assert!(most - least <= 1 + least / 50, "{count} points in {of} parts: {points:?}");
        }
    }
}
