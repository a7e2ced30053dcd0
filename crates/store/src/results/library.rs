//! Data about stored results: the provenance, and the program that computed them.

use serde_json::Value;

use crate::database::{Connected, Error, Result, Row, Statement, Tables, read, sql};
use crate::results::notes::{self, Note};
use fretwork_job::{Canonical, ENGINE, JobId, Key, Verified};

/// Who computed a result, when, with which program and at what cost. Results of earlier versions of the
/// program lack some of these data. Times are in milliseconds since 1970.
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
    /// The import that stored it; `None` if it was computed here.
    pub imported: Option<FromFile>,
}

impl Provenance {
    /// The provenance, with the note that `reader` sees.
    pub(crate) async fn of(key: &Key, reader: &str, mut db: impl Tables) -> Result<Option<Self>> {
        Ok(db.row(Self::query(key, reader)).await?.as_ref().map(Self::read).transpose()?)
    }

    pub(crate) fn query(key: &Key, reader: &str) -> Statement {
        let mut query = sql!(
            "SELECT result.key AS key, created, result.owner AS owner, computed, wall, cpu, job, trace,
                 warnings, pinned, pinned_by, last_access, evicted, deleted_by, size, digest, imported, imported_from, verified,
                 version, numerics, host, architecture, processors,
                 (SELECT count(*) FROM job WHERE job.key = result.key) AS jobs, "
        );
        query.push(notes::COLUMNS);
        query.push(" FROM result LEFT JOIN program ON program.id = result.program");
        query.join_note(reader).push(" WHERE result.key = ").push_bind(key);
        query
    }

    fn read(row: &Row) -> sqlx::Result<Self> {
        Ok(read!(row => Self {
            created, owner, computed, wall, cpu, job, trace, warnings, jobs, pinned, pinned_by, last_access, evicted, deleted_by,
            size;
            program: Program::read(row)?,
            note: Note::read(row)?,
            sha256: row.get("digest")?,
            imported: FromFile::read(row)?,
        }))
    }
}

/// The import of a result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FromFile {
    /// When it was imported.
    pub at: i64,
    /// The name of the file.
    pub from: String,
    /// How much of it was computed again; `None` if an earlier version imported it.
    pub verified: Option<Verified>,
}

impl FromFile {
    fn read(row: &Row) -> sqlx::Result<Option<Self>> {
        let Some(at) = row.get("imported")? else { return Ok(None) };
        Ok(Some(Self { at, from: row.get("imported_from")?, verified: row.get("verified")? }))
    }
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
    pub(crate) fn this() -> Self {
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

    /// The id of the row of this program. Inserts the row if necessary.
    pub(crate) async fn id(&self, db: &mut impl Connected) -> Result<i64> {
        let Self { version, numerics, host, architecture, processors } = self;
        let insert = sql!(
            "INSERT INTO program (version, numerics, host, architecture, processors)
             VALUES ($1, $2, $3, $4, $5) ON CONFLICT DO NOTHING";
            version, *numerics, host, architecture, *processors
        );
        db.execute(insert).await?;
        let find = sql!(
            "SELECT id FROM program WHERE version = $1 AND numerics = $2 AND host = $3
                 AND architecture = $4 AND processors = $5";
            version, *numerics, host, architecture, *processors
        );
        Ok(db.one(find).await?.get("id")?)
    }

    /// Reads the columns of the table `program`.
    fn read(row: &Row) -> sqlx::Result<Option<Self>> {
        let Some(version) = row.get("version")? else { return Ok(None) };
        Ok(Some(read!(row => Self { numerics, host, architecture, processors; version })))
    }
}

/// What the database knows about a key. The body of the result may have been evicted.
#[derive(Debug, Clone, PartialEq)]
pub struct Known {
    /// The canonical scenario or study that was computed.
    pub asked: Canonical,
    /// The summary of the result, which a job shows.
    pub summary: Value,
    /// The `numerics` version of the engine; 0 if unknown.
    pub numerics: u32,
    /// Whether the body is stored.
    pub held: bool,
}

impl Known {
    pub(crate) async fn of(key: &Key, mut db: impl Tables) -> Result<Option<Self>> {
        let query = sql!(
            "SELECT task, summary, numerics, evicted IS NULL AS held
             FROM result JOIN result_task USING (key)
             LEFT JOIN program ON program.id = result.program WHERE result.key = $1";
            key
        );
        let Some(row) = db.row(query).await? else { return Ok(None) };
        let damaged = || Error::DamagedResult(*key);
        let asked = Canonical::in_stored(row.get("task")?).ok_or_else(damaged)?;
        let numerics = match row.get("numerics")? {
            Some(numerics) => numerics,
            None => numerics_of(key, &asked),
        };
        let summary = row.get("summary").map_err(|_| damaged())?;
        Ok(Some(Self { asked, summary, numerics, held: row.get("held")? }))
    }
}

/// The latest `numerics` version under which the task has this key; 0 if there is none.
fn numerics_of(key: &Key, asked: &Canonical) -> u32 {
    (1..=ENGINE.numerics).rev().find(|numerics| asked.key(*numerics) == *key).unwrap_or(0)
}
