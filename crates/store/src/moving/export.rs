//! Exports results as lines of JSON.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use serde::Serialize;
use serde_json::value::RawValue;
use serde_json::{Value, from_value};
use zstd::Encoder;

use super::lines::{Head, Line, Maker, Noted, is_stdio};
use super::{Moving, PartialFile, refused};
use crate::administration::Administration;
use crate::database::{Command, Error, Place, Result};
use crate::jobs::read::{self, StoredResult};
use crate::results::library::Provenance;
use crate::results::page::SearchPage;
use crate::results::search::Search;
use fretwork_job::{Key, clock};

/// The outcome of an export.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Exported {
    /// Number of results in the file.
    pub results: u64,
    /// Bytes of their bodies.
    pub bytes: u64,
    /// Results that are not in the file, because they are damaged or were evicted during the export.
    pub left_out: Vec<Key>,
}

/// Writes results into a file, or to standard output if the file is `-`: those with the given keys, or, without keys,
/// all that match the search. `progress` is called with the number of results done and the number of all.
///
/// # Errors
/// The file exists, a key is unknown, or a database fails.
pub fn export<'a>(
    place: Place,
    file: &'a Path,
    search: &'a Search,
    keys: &'a [Key],
    progress: &'a mut dyn FnMut(usize, usize),
) -> Command<'a, Exported, Moving> {
    Box::pin(async move {
        let is_stdout = is_stdio(file);
        if !is_stdout && file.exists() {
            return Err(Moving::Exists(file.to_owned()));
        }
        let file = if is_stdout { Path::new("standard output") } else { file };
        let mut db = Administration::open(place).await?;
        let named = !keys.is_empty();
        let keys = if named { keys.to_vec() } else { matching(&mut db, search).await? };
        let (part, out): (_, Box<dyn Write>) = if is_stdout {
            (None, Box::new(io::stdout()))
        } else {
            let part = PartialFile::of(file, ".part")?;
            let out = File::create(&part.0).map_err(refused(file))?;
            (Some(part), Box::new(out))
        };
        let mut out = Writer::start(out, &Head::of(keys.len())).map_err(refused(file))?;
        let mut done = Exported::default();
        for (place, key) in keys.iter().enumerate() {
            match entry(&mut db, key).await {
                Ok((body, provenance)) => {
                    out.result(key, &body, provenance).map_err(refused(file))?;
                    done.results += 1;
                    done.bytes += body.get().len() as u64;
                }
                Err(Moving::UnknownKey(_) | Moving::DamagedResult(_)) if !named => {
                    done.left_out.push(*key);
                }
                Err(error) => return Err(error),
            }
            progress(place + 1, keys.len());
        }
        out.0.finish().and_then(|mut out| out.flush()).map_err(refused(file))?;
        db.close().await?;
        part.map_or(Ok(()), |part| part.name(file))?;
        Ok(done)
    })
}

/// The keys of all matching results.
async fn matching(db: &mut Administration, search: &Search) -> Result<Vec<Key>, Moving> {
    let (mut keys, mut cursor) = (Vec::new(), None);
    loop {
        let found = SearchPage::page(search, cursor, 1000, &mut *db).await?;
        keys.extend(found.results.into_iter().map(|listed| listed.key));
        cursor = found.next;
        if cursor.is_none() {
            return Ok(keys);
        }
    }
}

/// The body of a result and what is known about it.
async fn entry(db: &mut Administration, key: &Key) -> Result<(Box<RawValue>, Provenance), Moving> {
    let (body, sum) = match read::result(key, i64::MAX, &mut *db).await {
        Ok(Some((StoredResult::Whole(body), sum))) => (body, sum),
        Ok(_) => return Err(Moving::UnknownKey(*key)),
        Err(Error::Damaged(_)) => return Err(Moving::DamagedResult(*key)),
        Err(error) => return Err(error.into()),
    };
    let Some(provenance) = Provenance::of(key, "", &mut *db).await? else {
        return Err(Moving::UnknownKey(*key));
    };
    let json = Some(body).filter(|body| sum.is_of(body)).and_then(|body| body.json().ok());
    // A line feed would end the line. No result has one.
    let json = json.and_then(|json| String::from_utf8(json.into()).ok());
    let json =
        json.filter(|json| !json.contains('\n')).and_then(|json| RawValue::from_string(json).ok());
    json.map(|json| (json, provenance)).ok_or(Moving::DamagedResult(*key))
}

/// Compresses the lines of an export.
struct Writer(Encoder<'static, Box<dyn Write>>);

impl Writer {
    fn start(out: Box<dyn Write>, head: &Head) -> io::Result<Self> {
        let mut encoder = Encoder::new(out, zstd::DEFAULT_COMPRESSION_LEVEL)?;
        encoder.include_checksum(true)?;
        let mut writer = Self(encoder);
        writer.line(head)?;
        Ok(writer)
    }

    fn line(&mut self, line: &impl Serialize) -> io::Result<()> {
        serde_json::to_writer(&mut self.0, line)?;
        self.0.write_all(b"\n")
    }

    fn result(&mut self, key: &Key, body: &RawValue, provenance: Provenance) -> io::Result<()> {
        let program = provenance.program.map(|program| Maker {
            version: program.version,
            host: program.host,
            architecture: program.architecture,
            processors: program.processors,
        });
        self.line(&Line {
            key: key.to_string(),
            sha256: provenance.sha256.to_string(),
            owner: provenance.owner,
            computed: provenance.computed.map(clock::rfc3339),
            wall_seconds: provenance.wall,
            cpu_seconds: provenance.cpu,
            program,
            // Earlier versions stored no warnings.
            warnings: provenance.warnings.and_then(|told: Value| from_value(told).ok()),
            note: provenance.note.as_ref().map(Noted::from),
            result: body,
        })
    }
}
