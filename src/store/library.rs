//! What is known about results beside their numbers: where they come from, what people say of them,
//! and how they are found.

use serde_json::Value;
use sqlx::sqlite::SqliteRow;
use sqlx::{Row, SqliteConnection, SqliteExecutor};
use tokio::sync::SemaphorePermit;

use super::outline::{self, Outline};
use super::search::{self, Cursor, Found, Search};
use super::writer::{Transaction, Verb};
use super::{Error, Removed, Store, keep, read};
use crate::job::{ENGINE, JobId, Key};

/// What somebody says of a result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// What is said.
    pub text: String,
    /// Who says it.
    pub owner: String,
    /// Since when, in milliseconds since 1970.
    pub at: i64,
}

/// The longest note in characters.
const LONGEST_NOTE: usize = 4000;

impl Note {
    /// What a text must be to be a note, if it is not that.
    #[must_use]
    pub fn fault(text: &str) -> Option<String> {
        let length = text.chars().count();
        let strange = |c: char| c.is_control() && c != '\n' && c != '\t';
        if length == 0 || length > LONGEST_NOTE {
            return Some(format!("must have 1 to {LONGEST_NOTE} characters, not {length}"));
        }
        text.contains(strange).then(|| {
            "must not contain control characters other than line breaks and tabs".to_owned()
        })
    }

    /// Reads the columns `note`, `noted_by` and `noted`.
    pub(super) fn read(row: &SqliteRow) -> Result<Option<Self>, sqlx::Error> {
        let Some(text) = row.try_get("note")? else { return Ok(None) };
        Ok(Some(Self { text, owner: row.try_get("noted_by")?, at: row.try_get("noted")? }))
    }
}

/// Where a result comes from, and what became of it. What is not known of results of earlier
/// versions is none. Times are in milliseconds since 1970.
#[derive(Debug, Clone, PartialEq)]
pub struct Provenance {
    /// When the key was first known here.
    pub created: i64,
    /// For whom it was computed.
    pub owner: Option<String>,
    /// When it was computed.
    pub computed: Option<i64>,
    /// Seconds by the clock.
    pub wall: Option<f64>,
    /// Seconds of a processor.
    pub cpu: Option<f64>,
    /// The job that had it computed.
    pub job: Option<JobId>,
    /// The request that submitted that job, and after a blank its `traceparent`.
    pub trace: Option<String>,
    /// What computed it.
    pub program: Option<Program>,
    /// How many jobs named it, of those that are kept.
    pub jobs: u64,
    /// Whether it is kept whatever room it takes.
    pub pinned: bool,
    /// When it was last read.
    pub last_access: i64,
    /// When its body was dropped.
    pub evicted: Option<i64>,
    /// Who had it deleted; none if it had to make room.
    pub deleted_by: Option<String>,
    /// What somebody says of it.
    pub note: Option<Note>,
    /// Bytes of its body.
    pub size: u64,
    /// SHA-256 of its body.
    pub sha256: Key,
    /// When it came from another server, and in which file.
    pub imported: Option<(i64, String)>,
}

/// A version of the program on a machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Program {
    /// The release.
    pub version: String,
    /// The version of its digits.
    pub numerics: u32,
    /// The name of the machine; empty, as the next, if that is not known.
    pub host: String,
    /// Its kind of processor.
    pub architecture: String,
    /// How many of them it has; 0 if that is not known.
    pub processors: u32,
}

impl Program {
    /// This program on this machine.
    fn this() -> Self {
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

    /// The number of its row, which is made if there is none.
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

    /// The number of the row of this program on this machine.
    pub(super) async fn register(db: &mut SqliteConnection) -> Result<i64, Error> {
        Self::this().row(db).await
    }
}

/// What is known of a key, whether or not its body is there.
#[derive(Debug, Clone, PartialEq)]
pub struct Known {
    /// The canonical scenario.
    pub scenario: Value,
    /// The last entry of the history and the regime.
    pub summary: Value,
    /// The version of the digits.
    pub numerics: u32,
    /// Whether the body is there.
    pub held: bool,
}

pub(super) const PROVENANCE: &str = "
    SELECT result.key AS key, created, result.owner AS owner, computed, wall, cpu, job, trace,
        pinned, last_access, evicted, deleted_by, size, digest, imported, imported_from, version,
        numerics, host, architecture, processors, note.text AS note, note.owner AS noted_by,
        note.at AS noted, (SELECT count(*) FROM job WHERE job.key = result.key) AS jobs
    FROM result LEFT JOIN program ON program.id = result.program
    LEFT JOIN note ON note.key = result.key WHERE result.key = ?1";

pub(super) fn provenance(row: &SqliteRow) -> Result<Provenance, sqlx::Error> {
    let version: Option<String> = row.try_get("version")?;
    let program = match version {
        Some(version) => Some(Program {
            version,
            numerics: row.try_get("numerics")?,
            host: row.try_get("host")?,
            architecture: row.try_get("architecture")?,
            processors: row.try_get("processors")?,
        }),
        None => None,
    };
    let job: Option<&[u8]> = row.try_get("job")?;
    let imported: Option<i64> = row.try_get("imported")?;
    let from: Option<String> = row.try_get("imported_from")?;
    Ok(Provenance {
        created: row.try_get("created")?,
        owner: row.try_get("owner")?,
        computed: row.try_get("computed")?,
        wall: row.try_get("wall")?,
        cpu: row.try_get("cpu")?,
        job: job.map(read::job_id).transpose()?,
        trace: row.try_get("trace")?,
        program,
        jobs: u64::try_from(row.try_get::<i64, _>("jobs")?).unwrap_or(0),
        pinned: row.try_get("pinned")?,
        last_access: row.try_get("last_access")?,
        evicted: row.try_get("evicted")?,
        deleted_by: row.try_get("deleted_by")?,
        note: Note::read(row)?,
        size: u64::try_from(row.try_get::<i64, _>("size")?).unwrap_or(0),
        sha256: read::key(row, "digest")?,
        imported: imported.map(|at| (at, from.unwrap_or_default())),
    })
}

async fn known(db: impl SqliteExecutor<'_>, key: &Key) -> Result<Option<Known>, Error> {
    let row = sqlx::query(
        "SELECT task, summary, numerics, evicted IS NULL AS held
         FROM result JOIN result_task USING (key) LEFT JOIN program ON program.id = result.program
         WHERE result.key = ?1",
    )
    .bind(key.bytes().as_slice())
    .fetch_optional(db)
    .await?;
    let Some(row) = row else { return Ok(None) };
    let task: Value = serde_json::from_str(row.try_get("task")?).unwrap_or_default();
    let scenario = task.get("scenario").cloned().unwrap_or_default();
    let numerics = match row.try_get("numerics")? {
        Some(numerics) => numerics,
        None => numerics_of(key, &scenario),
    };
    let (summary, held) = (read::json(row.try_get("summary")?)?, row.try_get("held")?);
    Ok(Some(Known { scenario, summary, numerics, held }))
}

/// The version of the digits under which a scenario has this key; 0 if no known one does.
fn numerics_of(key: &Key, scenario: &Value) -> u32 {
    (1..=ENGINE.numerics).rev().find(|numerics| Key::of(*numerics, scenario) == *key).unwrap_or(0)
}

/// Writes outlines that are still to come.
pub(super) struct CatchUp;

impl Verb for CatchUp {
    /// Whether there may be more.
    type Answer = bool;

    async fn apply(&self, tx: &mut Transaction<'_>) -> Result<bool, Error> {
        outline::catch_up(tx.db).await
    }
}

impl Store {
    /// Where a result comes from.
    pub async fn provenance(&self, key: &Key) -> Result<Option<Provenance>, Error> {
        let key = key.bytes().as_slice();
        self.reading(async |db| {
            let row = sqlx::query(PROVENANCE).bind(key).fetch_optional(db).await?;
            Ok(row.as_ref().map(provenance).transpose()?)
        })
        .await
    }

    /// Says something of a result, or takes it back; false if there is no such result.
    pub async fn annotate(
        &self,
        key: &Key,
        text: Option<String>,
        owner: String,
    ) -> Result<bool, Error> {
        self.write(keep::Annotate { key: *key, text, owner }).await
    }

    /// Deletes the body of a result; what it was computed from is remembered.
    pub async fn remove(&self, key: &Key, owner: String) -> Result<Removed, Error> {
        self.write(keep::Remove { key: *key, owner }).await
    }

    /// Up to `limit` results that are asked for, behind `cursor`; among everything that was committed
    /// before this call.
    pub async fn search(
        &self,
        search: &Search,
        cursor: Option<Cursor>,
        limit: u32,
    ) -> Result<Found, Error> {
        self.catch_up().await?;
        let _turn = self.scan().await?;
        self.reading(async |db| search::page(db, search, cursor, limit).await).await
    }

    /// The result that is there whose scenario is nearest to this one, save one.
    pub async fn nearest(&self, to: &Outline, except: Option<Key>) -> Result<Option<Key>, Error> {
        self.catch_up().await?;
        let _turn = self.scan().await?;
        self.reading(async |db| search::nearest(db, to, except).await).await
    }

    /// What is known of a key.
    pub async fn known(&self, key: &Key) -> Result<Option<Known>, Error> {
        self.reading(async |db| known(db, key).await).await
    }

    /// A turn to look through many results: who wants to read but one is not to wait for that.
    async fn scan(&self) -> Result<SemaphorePermit<'_>, Error> {
        self.scans.acquire().await.map_err(|_| Error::Closed)
    }

    async fn catch_up(&self) -> Result<(), Error> {
        if self.reading(async |db| outline::is_behind(db).await).await? {
            while self.write(CatchUp).await? {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{JobId, Options, SCANS};

    /// Of one result a million jobs may be kept.
    #[tokio::test]
    async fn the_jobs_of_a_result_are_counted_along_an_index_of_keys() {
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

    #[tokio::test]
    async fn who_looks_through_many_results_keeps_nobody_from_reading_one() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path(), &Options::default()).await.unwrap();
        let turns = store.scans.acquire_many(u32::try_from(SCANS).unwrap()).await.unwrap();
        let all = Search::default();
        let mut search = std::pin::pin!(store.search(&all, None, 1));
        let reads = async {
            for _ in 0..100 {
                assert_eq!(store.job(JobId::generate()).await.unwrap(), None);
            }
        };
        tokio::select! {
            _ = &mut search => panic!("there is no turn for it"),
            () = reads => {}
        }
        drop(turns);
        assert!(search.await.unwrap().results.is_empty());
    }
}
