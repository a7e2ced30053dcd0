//! Provenance, notes and deletion of results.

use serde_json::Value;
use sqlx::sqlite::SqliteRow;
use sqlx::{Row, SqliteConnection};

use super::audit::Actor;
use super::keep::{self, Changed, Editor, Removed};
use super::{Error, Store, row};
use crate::job::{Canonical, ENGINE, JobId, Key};

/// What a user wrote about a result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// The text.
    pub text: String,
    /// Who wrote it.
    pub owner: String,
    /// When it was written, in milliseconds since 1970.
    pub at: i64,
}

/// The longest note in characters.
const LONGEST_NOTE: usize = 4000;

impl Note {
    /// What is wrong with the text of a note, if anything.
    #[must_use]
    pub fn fault(text: &str) -> Option<String> {
        let length = text.chars().count();
        let is_control = |c: char| c.is_control() && c != '\n' && c != '\t';
        if length == 0 || length > LONGEST_NOTE {
            return Some(format!("must have 1 to {LONGEST_NOTE} characters, not {length}"));
        }
        text.contains(is_control).then(|| {
            "must not contain control characters other than line breaks and tabs".to_owned()
        })
    }

    /// Reads the columns `note`, `noted_by` and `noted`.
    pub(super) fn read(row: &SqliteRow) -> Result<Option<Self>, sqlx::Error> {
        let Some(text) = row.try_get("note")? else { return Ok(None) };
        Ok(Some(Self { text, owner: row.try_get("noted_by")?, at: row.try_get("noted")? }))
    }
}

/// Who computed a result, when, with which program and at what cost. Results of earlier versions of the
/// program lack some of it. Times are in milliseconds since 1970.
#[derive(Debug, Clone, PartialEq)]
pub struct Provenance {
    /// When this server first stored the key.
    pub created: i64,
    /// The owner whose job computed it.
    pub owner: Option<String>,
    /// When it was computed.
    pub computed: Option<i64>,
    /// Wall-clock time of the computation in seconds.
    pub wall: Option<f64>,
    /// Processor time of the computation in seconds.
    pub cpu: Option<f64>,
    /// The job that computed it.
    pub job: Option<JobId>,
    /// The id of the request that submitted that job, and after a blank its `traceparent`.
    pub trace: Option<String>,
    /// The warnings of the submission that computed it, as a JSON array. They are about the two bodies, and the
    /// result does not contain them.
    pub warnings: Option<Value>,
    /// The program that computed it.
    pub program: Option<Program>,
    /// The number of stored jobs with this key.
    pub jobs: u64,
    /// Whether it is pinned: never evicted.
    pub pinned: bool,
    /// Who pinned it.
    pub pinned_by: Option<String>,
    /// When it was last read.
    pub last_access: i64,
    /// When its body was evicted or deleted.
    pub evicted: Option<i64>,
    /// Who deleted it; `None` if it was evicted to free space.
    pub deleted_by: Option<String>,
    /// Its note.
    pub note: Option<Note>,
    /// Size of its body in bytes.
    pub size: u64,
    /// SHA-256 of its body.
    pub sha256: Key,
    /// When it was imported, and from which file.
    pub imported: Option<(i64, String)>,
}

/// A version of the program on a machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Program {
    /// The version of the program.
    pub version: String,
    /// The `numerics` version of its engine.
    pub numerics: u32,
    /// The host name; empty if unknown.
    pub host: String,
    /// The processor architecture; empty if unknown.
    pub architecture: String,
    /// The number of processors; 0 if unknown.
    pub processors: u32,
}

impl Program {
    /// This program on this machine.
    pub(super) fn this() -> Self {
        #[cfg(unix)]
        let host = rustix::system::uname().nodename().to_string_lossy().into_owned();
        #[cfg(not(unix))]
        let host = std::env::var("COMPUTERNAME").unwrap_or_else(|_| "unknown".to_owned());
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            numerics: ENGINE.numerics,
            host,
            architecture: std::env::consts::ARCH.to_owned(),
            processors: u32::try_from(processors).unwrap_or(u32::MAX),
        }
    }

    /// The id of its row, which is inserted if necessary.
    pub(super) async fn row(&self, db: &mut SqliteConnection) -> Result<i64, Error> {
        let id = sqlx::query_scalar(
            "INSERT OR IGNORE INTO program (version, numerics, host, architecture, processors)
             VALUES (?1, ?2, ?3, ?4, ?5);
             SELECT id FROM program WHERE version = ?1 AND numerics = ?2 AND host = ?3
                 AND architecture = ?4 AND processors = ?5",
        )
        .bind(&self.version)
        .bind(self.numerics)
        .bind(&self.host)
        .bind(&self.architecture)
        .bind(self.processors)
        .fetch_one(db)
        .await?;
        Ok(id)
    }

    /// Reads the columns of the table `program`.
    fn read(row: &SqliteRow) -> Result<Option<Self>, sqlx::Error> {
        let Some(version) = row.try_get("version")? else { return Ok(None) };
        Ok(Some(Self {
            version,
            numerics: row.try_get("numerics")?,
            host: row.try_get("host")?,
            architecture: row.try_get("architecture")?,
            processors: row.try_get("processors")?,
        }))
    }
}

/// What the database knows about a key. The body of the result may have been evicted.
#[derive(Debug, Clone, PartialEq)]
pub struct Known {
    /// What it was computed from.
    pub asked: Canonical,
    /// The short form that a job shows.
    pub summary: Value,
    /// The `numerics` version of the engine; 0 if unknown.
    pub numerics: u32,
    /// Whether the body is stored.
    pub held: bool,
    /// Whether it was imported. Only a sample of its numbers was computed again.
    pub imported: bool,
}

const PROVENANCE: &str = "
    SELECT result.key AS key, created, result.owner AS owner, computed, wall, cpu, job, trace,
        warnings, pinned, pinned_by, last_access, evicted, deleted_by, size, digest, imported, imported_from, version,
        numerics, host, architecture, processors, note.text AS note, note.owner AS noted_by,
        note.at AS noted, (SELECT count(*) FROM job WHERE job.key = result.key) AS jobs
    FROM result LEFT JOIN program ON program.id = result.program
    LEFT JOIN note ON note.key = result.key WHERE result.key = ?1";

pub(super) async fn provenance(
    db: &mut SqliteConnection,
    key: &Key,
) -> Result<Option<Provenance>, Error> {
    let query = sqlx::query(PROVENANCE).bind(key.bytes().as_slice());
    let Some(row) = query.fetch_optional(db).await? else { return Ok(None) };
    let job: Option<&[u8]> = row.try_get("job")?;
    let imported: Option<i64> = row.try_get("imported")?;
    let imported = imported.map(|at| Ok::<_, sqlx::Error>((at, row.try_get("imported_from")?)));
    Ok(Some(Provenance {
        created: row.try_get("created")?,
        owner: row.try_get("owner")?,
        computed: row.try_get("computed")?,
        wall: row.try_get("wall")?,
        cpu: row.try_get("cpu")?,
        job: job.map(row::job_id).transpose()?,
        trace: row.try_get("trace")?,
        warnings: row.try_get::<Option<&str>, _>("warnings")?.map(row::json).transpose()?,
        program: Program::read(&row)?,
        jobs: row.try_get("jobs")?,
        pinned: row.try_get("pinned")?,
        pinned_by: row.try_get("pinned_by")?,
        last_access: row.try_get("last_access")?,
        evicted: row.try_get("evicted")?,
        deleted_by: row.try_get("deleted_by")?,
        note: Note::read(&row)?,
        size: row.try_get("size")?,
        sha256: row::key(&row, "digest")?,
        imported: imported.transpose()?,
    }))
}

/// The `numerics` version for which a task has this key; 0 if there is none.
fn numerics_of(key: &Key, asked: &Canonical) -> u32 {
    (1..=ENGINE.numerics).rev().find(|numerics| asked.key(*numerics) == *key).unwrap_or(0)
}

impl Store {
    /// The provenance of a result.
    pub async fn provenance(&self, key: &Key) -> Result<Option<Provenance>, Error> {
        self.reading(async |db| provenance(db, key).await).await
    }

    /// Pins a result, which is then never evicted, or unpins it.
    pub async fn pin(&self, key: &Key, pinned: bool, editor: Editor) -> Result<Changed, Error> {
        self.write(keep::pin, (*key, pinned, editor, self.pin_quota)).await
    }

    /// Writes the note of a result, or removes it.
    pub async fn annotate(
        &self,
        key: &Key,
        text: Option<String>,
        editor: Editor,
    ) -> Result<Changed, Error> {
        self.write(keep::annotate, (*key, text, editor)).await
    }

    /// Deletes the body of a result; its scenario stays known.
    pub async fn remove(&self, key: &Key, by: Actor) -> Result<Removed, Error> {
        self.write(keep::remove, (*key, by)).await
    }

    /// What the database knows about a key.
    pub async fn known(&self, key: &Key) -> Result<Option<Known>, Error> {
        let row = self.reading(async |db| {
            let query = sqlx::query(
                "SELECT task, summary, numerics, evicted IS NULL AS held, imported IS NOT NULL AS imported
                 FROM result JOIN result_task USING (key)
                 LEFT JOIN program ON program.id = result.program WHERE result.key = ?1",
            );
            Ok(query.bind(key.bytes().as_slice()).fetch_optional(db).await?)
        });
        let Some(row) = row.await? else { return Ok(None) };
        let damaged = || Error::DamagedResult(*key);
        let asked = Canonical::in_stored(row.try_get("task")?).ok_or_else(damaged)?;
        let numerics = match row.try_get("numerics")? {
            Some(numerics) => numerics,
            None => numerics_of(key, &asked),
        };
        let summary = row::json(row.try_get("summary")?).map_err(|_| damaged())?;
        let (held, imported) = (row.try_get("held")?, row.try_get("imported")?);
        Ok(Some(Known { asked, summary, numerics, held, imported }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::Options;

    /// A result can have a million jobs.
    #[tokio::test]
    async fn the_jobs_of_a_result_are_counted_with_an_index() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path(), &Options::default()).await.unwrap();
        let plan = format!("EXPLAIN QUERY PLAN {PROVENANCE}");
        let rows = store.reading(async |db| {
            let plan = sqlx::query(sqlx::AssertSqlSafe(plan)).bind([0; 32].as_slice());
            Ok(plan.fetch_all(db).await?)
        });
        let rows = rows.await.unwrap();
        let steps: Vec<&str> = rows.iter().map(|row| row.get("detail")).collect();
        assert!(steps.contains(&"SEARCH job USING COVERING INDEX job_key (key=?)"), "{steps:?}");
        assert!(steps.iter().all(|step| !step.starts_with("SCAN")), "{steps:?}");
    }
}
