//! Reading jobs and results.

use std::pin::pin;
use std::time::Duration;

use sqlx::sqlite::SqliteRow;
use sqlx::{QueryBuilder, Row, Sqlite, SqliteExecutor};

use super::body::Body;
use super::readers::Readers;
use super::row::{Sum, changes, job_id, json, key, optional_word, word};
use super::{Error, Store, upkeep};
use crate::job::clock::now;
use crate::job::{Canonical, Failure, FailureKind, Job, JobId, JobState, Key};

/// Conditions on the jobs of a list; `None` is no condition.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Filter {
    /// In this state.
    pub state: Option<JobState>,
    /// With exactly this label.
    pub label: Option<String>,
    /// With this tag.
    pub tag: Option<String>,
    /// For this result.
    pub key: Option<Key>,
    /// Of this owner.
    pub owner: Option<String>,
}

/// A page of a list, newest first.
#[derive(Debug, Clone, PartialEq)]
pub struct Page {
    /// The jobs.
    pub jobs: Vec<Job>,
    /// The cursor of the next page; `None` on the last page.
    pub next: Option<JobId>,
}

/// A result as it is stored.
#[derive(Debug, Clone, PartialEq)]
pub enum StoredResult {
    /// The document.
    Whole(Body),
    /// The document is [`LARGE`] and was not read: the number of bytes of its JSON.
    Large(usize),
    /// The document was evicted or deleted.
    Evicted {
        /// When, in milliseconds since 1970.
        at: i64,
        /// Who deleted it; `None` if it was evicted to free space.
        deleted_by: Option<String>,
        /// What the result was computed from; `None` if that is not known any more.
        asked: Option<Canonical>,
    },
}

/// Results whose JSON has more bytes use one dedicated connection, and are checksummed and decompressed on a blocking
/// thread.
pub const LARGE: usize = 1 << 18;

/// What a job was asked to compute.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Asked {
    /// The task in its stored form; `None` if it is no longer stored.
    pub task: Option<String>,
    /// The scenario as the client wrote it, in JSON; `None` if it is not stored.
    pub submitted: Option<String>,
}

impl Store {
    /// A job in its current state.
    pub async fn job(&self, id: JobId) -> Result<Option<Job>, Error> {
        self.reading(async |db| job(db, id).await).await
    }

    /// What a job was asked to compute.
    pub async fn asked(&self, id: JobId) -> Result<Asked, Error> {
        let asked = self.reading(async |db| {
            // The run of a job has its task. A job that found its result, or was stored together with it, has no run.
            // Its task is stored with the result. A version before 0.3 could forget the result; then another job may
            // have a run.
            let query = sqlx::query_as(
                "SELECT coalesce(
                     (SELECT task FROM run WHERE run.id = job.run),
                     (SELECT task FROM result_task WHERE result_task.key = job.key),
                     (SELECT task FROM job AS other JOIN run ON run.id = other.run
                      WHERE other.key = job.key LIMIT 1)) AS task, submitted
                 FROM job WHERE id = ?1",
            );
            let asked = query.bind(id.0.as_bytes().as_slice()).fetch_optional(db).await?;
            let (task, submitted) = asked.unwrap_or_default();
            Ok(Asked { task, submitted })
        });
        asked.await
    }

    /// Returns up to `limit` jobs that match, newest first, older than `cursor`.
    pub async fn jobs(
        &self,
        filter: &Filter,
        cursor: Option<JobId>,
        limit: u32,
    ) -> Result<Page, Error> {
        let mut query = QueryBuilder::<Sqlite>::new(SELECT_JOB);
        matching(&mut query, filter);
        if let Some(cursor) = cursor {
            query.push(" AND job.id < ").push_bind(cursor.0.as_bytes().to_vec());
        }
        // One row more than the page has tells whether there is a next page.
        query.push(" ORDER BY job.id DESC LIMIT ").push_bind(i64::from(limit) + 1);
        let mut rows = self.reading(async |db| Ok(query.build().fetch_all(db).await?)).await?;
        let more = rows.len() as u64 > u64::from(limit);
        rows.truncate(limit as usize);
        let jobs: Vec<Job> = rows.iter().map(read_job).collect::<Result<_, _>>()?;
        let next = jobs.last().filter(|_| more).map(|job| job.id);
        Ok(Page { jobs, next })
    }

    /// The result of a key. Its checksum is verified, so damage to the disk cannot change a number.
    pub async fn result(&self, key: &Key) -> Result<Option<StoredResult>, Error> {
        match self.small_result(key).await? {
            Some(StoredResult::Large(_)) => self.result_by(&self.large, key, i64::MAX).await,
            found => Ok(found),
        }
    }

    /// The result of a key, unless it is [`LARGE`].
    pub async fn small_result(&self, key: &Key) -> Result<Option<StoredResult>, Error> {
        self.result_by(&self.readers, key, (LARGE as u64).cast_signed()).await
    }

    async fn result_by(
        &self,
        readers: &Readers,
        key: &Key,
        most: i64,
    ) -> Result<Option<StoredResult>, Error> {
        let read = async { result(readers.get().await?.connection(), key, most).await };
        let Some((found, sum)) = self.counted(read.await)? else { return Ok(None) };
        let StoredResult::Whole(body) = &found else { return Ok(Some(found)) };
        let sound = if body.bytes().len() <= LARGE {
            sum.is_of(body)
        } else {
            let body = body.clone();
            // If the checksum panicked, the body would not be trusted.
            tokio::task::spawn_blocking(move || sum.is_of(&body)).await.unwrap_or(false)
        };
        if !sound {
            return self.counted(Err(Error::DamagedResult(*key)));
        }
        self.was_read(key);
        Ok(Some(found))
    }

    /// Records that a result was read: the least recently read result is evicted first.
    pub fn was_read(&self, key: &Key) {
        self.signals.read(*key, now());
    }

    /// Whether the result of a key is stored.
    pub async fn has_result(&self, key: &Key) -> Result<bool, Error> {
        let known = self.reading(async |db| {
            let query = sqlx::query_scalar(
                "SELECT EXISTS (SELECT 1 FROM result WHERE key = ?1 AND evicted IS NULL)",
            );
            Ok(query.bind(key.bytes().as_slice()).fetch_one(db).await?)
        });
        known.await
    }

    /// The oldest unfinished job of the live run of a key. With an owner, the oldest of that owner.
    pub async fn live_job(&self, key: &Key, owner: Option<&str>) -> Result<Option<JobId>, Error> {
        let id = self.reading(async |db| {
            let query = sqlx::query_scalar(
                "SELECT job.id FROM run JOIN job ON job.run = run.id AND job.finished IS NULL
                 WHERE run.key = ?1 AND run.state IN ('queued', 'running')
                     AND (?2 IS NULL OR job.owner = ?2)
                 ORDER BY job.id LIMIT 1",
            );
            Ok(query.bind(key.bytes().as_slice()).bind(owner).fetch_optional(db).await?)
        });
        let id: Option<Vec<u8>> = id.await?;
        Ok(id.map(|bytes| job_id(&bytes)).transpose()?)
    }

    /// How long the oldest queued run has waited.
    pub async fn longest_wait(&self) -> Result<Duration, Error> {
        let oldest = self.reading(async |db| {
            let query = sqlx::query_scalar(
                "SELECT created FROM run INDEXED BY run_unfinished
                 WHERE state = 'queued' AND finished IS NULL ORDER BY id LIMIT 1",
            );
            Ok(query.fetch_optional(db).await?)
        });
        let waited = oldest.await?.map_or(0, |oldest: i64| now() - oldest);
        // The clock of the system may have been set back.
        Ok(Duration::from_millis(waited.max(0).unsigned_abs()))
    }

    /// When the last backup ended, in milliseconds since 1970; 0 if there was none.
    pub async fn last_backup(&self) -> Result<i64, Error> {
        self.reading(async |db| {
            Ok(sqlx::query_scalar("SELECT backed_up FROM room").fetch_one(db).await?)
        })
        .await
    }

    /// Checks that the disk has room for a submission, by a write of the same size.
    pub async fn probe(&self) -> Result<(), Error> {
        self.write(upkeep::probe, ()).await
    }

    /// Returns the job once it has finished, or in its current state once `until` has completed.
    pub async fn wait(&self, job: Job, until: impl Future<Output = ()>) -> Result<Job, Error> {
        if job.state.is_finished() {
            return Ok(job);
        }
        let mut changes = self.watch(&job.key);
        let mut until = pin!(until);
        let mut over = false;
        loop {
            match self.job(job.id).await? {
                Some(now) if over || now.state.is_finished() => return Ok(now),
                Some(_) => {}
                None => return Ok(job),
            }
            tokio::select! {
                () = changes.ended() => {}
                () = &mut until => over = true,
            }
        }
    }
}

/// A job, with columns of its run and result. A run may continue or fail after one of its jobs was canceled.
/// That does not change the job.
const SELECT_JOB: &str = "
    SELECT job.id, job.owner, job.key, job.state, job.origin, job.label, job.tags, job.warnings,
        job.created, job.started, job.finished, job.attempt, job.priority, job.changes,
        run.progress, run.error_kind, run.error, run.recomputed, result.summary
    FROM job
    LEFT JOIN run ON run.id = job.run
    LEFT JOIN result ON result.key = job.key AND job.state = 'succeeded'
    WHERE ";

fn read_job(row: &SqliteRow) -> Result<Job, sqlx::Error> {
    let state: JobState = word(row, "state")?;
    let failure = match state {
        JobState::Failed => Some(Failure {
            kind: word::<FailureKind>(row, "error_kind")?,
            message: row.try_get("error")?,
        }),
        _ => None,
    };
    let summary: Option<&str> = row.try_get("summary")?;
    Ok(Job {
        id: job_id(row.try_get("id")?)?,
        state,
        key: key(row, "key")?,
        owner: row.try_get("owner")?,
        origin: word(row, "origin")?,
        attempt: row.try_get("attempt")?,
        progress: match state {
            JobState::Succeeded => 1.0,
            JobState::Canceled => 0.0,
            _ => row.try_get("progress")?,
        },
        priority: row.try_get("priority")?,
        label: row.try_get("label")?,
        tags: json(row.try_get("tags")?)?,
        warnings: json(row.try_get("warnings")?)?,
        created: row.try_get("created")?,
        started: row.try_get("started")?,
        finished: row.try_get("finished")?,
        changes: changes(row.try_get("changes")?)?,
        failure,
        summary: summary.map(json).transpose()?,
        recomputed: optional_word(row, "recomputed")?,
    })
}

pub(super) async fn job(db: impl SqliteExecutor<'_>, id: JobId) -> Result<Option<Job>, Error> {
    let mut query = QueryBuilder::<Sqlite>::new(SELECT_JOB);
    query.push("job.id = ").push_bind(id.0.as_bytes().as_slice());
    let row = query.build().fetch_optional(db).await?;
    Ok(row.as_ref().map(read_job).transpose()?)
}

/// The unfinished jobs that match and are not being canceled, newest first, older than `before`.
pub(super) async fn unfinished(
    db: impl SqliteExecutor<'_>,
    filter: &Filter,
    before: JobId,
    at_most: u32,
) -> Result<Vec<JobId>, Error> {
    // The index of states skips the many finished jobs.
    let mut query =
        QueryBuilder::<Sqlite>::new("SELECT job.id FROM job INDEXED BY job_state WHERE ");
    matching(&mut query, filter);
    query
        .push(" AND job.state IN ('queued', 'running') AND job.state <> 'succeeded' AND job.id < ")
        .push_bind(before.0.as_bytes().to_vec())
        .push(" ORDER BY job.id DESC LIMIT ")
        .push_bind(at_most);
    let ids: Vec<Vec<u8>> = query.build_query_scalar().fetch_all(db).await?;
    Ok(ids.iter().map(|id| job_id(id)).collect::<Result<_, _>>()?)
}

/// Writes the conditions of a filter.
fn matching(query: &mut QueryBuilder<Sqlite>, filter: &Filter) {
    query.push("TRUE");
    if let Some(state) = filter.state {
        query.push(" AND job.state = ").push_bind(state.as_str());
        if state != JobState::Succeeded {
            // The index `job_state` requires this condition.
            query.push(" AND job.state <> 'succeeded'");
        }
    }
    if let Some(label) = &filter.label {
        query.push(" AND job.label = ").push_bind(label.clone());
    }
    if let Some(key) = &filter.key {
        query.push(" AND job.key = ").push_bind(key.bytes().to_vec());
    }
    if let Some(owner) = &filter.owner {
        query.push(" AND job.owner = ").push_bind(owner.clone());
    }
    if let Some(tag) = &filter.tag {
        query
            .push(" AND job.id IN (SELECT job FROM job_tag WHERE tag = ")
            .push_bind(tag.clone())
            .push(")");
    }
}

/// A result and the hash of its body. The body is read if its JSON has at most `most` bytes.
pub(super) async fn result(
    db: impl SqliteExecutor<'_>,
    key: &Key,
    most: i64,
) -> Result<Option<(StoredResult, Sum)>, Error> {
    let row = sqlx::query(
        "SELECT size, iif(size > ?2, NULL, body) AS body, digest, checksum, evicted,
             deleted_by, iif(evicted IS NULL, NULL, (SELECT task FROM result_task WHERE key = ?1)) AS task
         FROM result LEFT JOIN result_blob USING (key) WHERE key = ?1",
    )
    .bind(key.bytes().as_slice())
    .bind(most)
    .fetch_optional(db)
    .await?;
    let Some(row) = row else { return Ok(None) };
    let found = if let Some(at) = row.try_get("evicted")? {
        let task: Option<&str> = row.try_get("task")?;
        let damaged = Error::DamagedResult(*key);
        let asked = task.map(|task| Canonical::in_stored(task).ok_or(damaged)).transpose()?;
        StoredResult::Evicted { at, deleted_by: row.try_get("deleted_by")?, asked }
    } else if let size @ 0.. = row.try_get::<i64, _>("size")?
        && size > most
    {
        StoredResult::Large(size.cast_unsigned() as usize)
    } else {
        StoredResult::Whole(Body::stored(row.try_get("body")?))
    };
    Ok(Some((found, Sum::read(&row)?)))
}
