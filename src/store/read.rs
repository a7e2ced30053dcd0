//! What can be asked of the tables, and how a row becomes a job.

use bytes::Bytes;
use serde::de::DeserializeOwned;
use serde_json::Value;
use sha2::{Digest as _, Sha256};
use sqlx::sqlite::SqliteRow;
use sqlx::{FromRow, QueryBuilder, Row, Sqlite, SqliteExecutor};
use xxhash_rust::xxh3::xxh3_64;

use super::Error;
use crate::job::{Change, Failure, FailureKind, Job, JobId, JobState, Key, Task};

/// Which jobs to list; an absent member asks for nothing.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Filter {
    /// In this state.
    pub state: Option<JobState>,
    /// With exactly this label.
    pub label: Option<String>,
    /// With this tag among theirs.
    pub tag: Option<String>,
    /// For this result.
    pub key: Option<Key>,
    /// Of this owner.
    pub owner: Option<String>,
}

/// A part of a list, newest first.
#[derive(Debug, Clone, PartialEq)]
pub struct Page {
    /// The jobs.
    pub jobs: Vec<Job>,
    /// Where the next page begins, if there is one.
    pub next: Option<JobId>,
}

/// A result as it is kept.
#[derive(Debug, Clone, PartialEq)]
pub enum StoredResult {
    /// It is there: the document as it is served.
    Whole(Bytes),
    /// It is there, and large.
    Large,
    /// It was dropped.
    Evicted {
        /// When, in milliseconds since 1970.
        at: i64,
        /// Who had it deleted; none if it had to make room.
        deleted_by: Option<String>,
        /// The scenario that it was the result of.
        scenario: Value,
    },
}

/// A job with what it takes from its run and result. A run may go on, or fail, after a job of it
/// was canceled: that is no longer the job's business.
const SELECT_JOB: &str = "
    SELECT job.id, job.owner, job.key, job.state, job.origin, job.label, job.tags, job.warnings,
        job.created, job.started, job.finished, job.attempt, job.priority, job.changes,
        run.progress, run.error_kind, run.error, result.summary
    FROM job
    LEFT JOIN run ON run.id = job.run
    LEFT JOIN result ON result.key = job.key AND job.state = 'succeeded'
    WHERE ";

struct JobRow(Job);

impl FromRow<'_, SqliteRow> for JobRow {
    fn from_row(row: &SqliteRow) -> Result<Self, sqlx::Error> {
        let state: JobState = word(row, "state")?;
        let failure = match state {
            JobState::Failed => Some(Failure {
                kind: word::<FailureKind>(row, "error_kind")?,
                message: row.try_get("error")?,
            }),
            _ => None,
        };
        let summary: Option<&str> = row.try_get("summary")?;
        Ok(Self(Job {
            id: job_id(row.try_get("id")?)?,
            state,
            key: key(row, "key")?,
            owner: row.try_get("owner")?,
            origin: word(row, "origin")?,
            attempt: row.try_get("attempt")?,
            progress: match state {
                JobState::Succeeded => 1.0,
                JobState::Canceled => 0.0,
                _ => row.try_get::<Option<f64>, _>("progress")?.unwrap_or(0.0),
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
        }))
    }
}

/// Reads a word of a closed set.
pub(super) fn word<T>(row: &SqliteRow, column: &str) -> Result<T, sqlx::Error>
where
    T: std::str::FromStr<Err: std::error::Error + Send + Sync + 'static>,
{
    row.try_get::<&str, _>(column)?.parse().map_err(|error| sqlx::Error::Decode(Box::new(error)))
}

/// Reads a key.
pub(super) fn key(row: &SqliteRow, column: &str) -> Result<Key, sqlx::Error> {
    let bytes: &[u8] = row.try_get(column)?;
    let bytes = bytes.try_into().map_err(|error| sqlx::Error::Decode(Box::new(error)))?;
    Ok(Key::from_bytes(bytes))
}

/// Reads the id of a job.
pub(super) fn job_id(bytes: &[u8]) -> Result<JobId, sqlx::Error> {
    uuid::Uuid::from_slice(bytes).map(JobId).map_err(|error| sqlx::Error::Decode(Box::new(error)))
}

/// Reads the changes of a job, one per line: state, attempt, time.
pub(super) fn changes(text: &str) -> Result<Vec<Change>, sqlx::Error> {
    let read = |line: &str| {
        let mut words = line.split(' ');
        Some(Change {
            state: words.next()?.parse().ok()?,
            attempt: words.next()?.parse().ok()?,
            at: words.next()?.parse().ok()?,
        })
    };
    text.lines()
        .map(|line| read(line).ok_or_else(|| sqlx::Error::Decode("not a change of state".into())))
        .collect()
}

/// Reads a document.
pub(super) fn json<T: DeserializeOwned>(text: &str) -> Result<T, sqlx::Error> {
    serde_json::from_str(text).map_err(|error| sqlx::Error::Decode(Box::new(error)))
}

pub(super) async fn job(db: impl SqliteExecutor<'_>, id: JobId) -> Result<Option<Job>, Error> {
    let mut query = QueryBuilder::<Sqlite>::new(SELECT_JOB);
    query.push("job.id = ").push_bind(id.0.as_bytes().as_slice());
    let row: Option<JobRow> = query.build_query_as().fetch_optional(db).await?;
    Ok(row.map(|JobRow(job)| job))
}

/// What a job was asked to compute.
#[derive(Debug, Clone, Default, PartialEq, Eq, FromRow)]
pub struct Asked {
    /// The task in its stored form.
    pub task: Option<String>,
    /// The scenario as the client wrote it, in JSON.
    pub submitted: Option<String>,
}

/// The run of a job holds its task. A job that found a known result has no run: then the task is with the
/// result, or, once the result is forgotten, with the run of another job.
pub(super) async fn asked(db: impl SqliteExecutor<'_>, id: JobId) -> Result<Asked, Error> {
    let asked = sqlx::query_as(
        "SELECT coalesce(
             (SELECT task FROM run WHERE run.id = job.run),
             (SELECT task FROM result_task WHERE result_task.key = job.key),
             (SELECT task FROM job AS other JOIN run ON run.id = other.run
              WHERE other.key = job.key LIMIT 1)) AS task, submitted
         FROM job WHERE id = ?1",
    )
    .bind(id.0.as_bytes().as_slice())
    .fetch_optional(db)
    .await?;
    Ok(asked.unwrap_or_default())
}

pub(super) async fn jobs(
    db: impl SqliteExecutor<'_>,
    filter: &Filter,
    cursor: Option<JobId>,
    limit: u32,
) -> Result<Page, Error> {
    let mut query = QueryBuilder::<Sqlite>::new(SELECT_JOB);
    matching(&mut query, filter);
    if let Some(cursor) = cursor {
        query.push(" AND job.id < ").push_bind(cursor.0.as_bytes().to_vec());
    }
    // One more than asked for tells whether there is a next page.
    query.push(" ORDER BY job.id DESC LIMIT ").push_bind(i64::from(limit) + 1);
    let rows: Vec<JobRow> = query.build_query_as().fetch_all(db).await?;
    let mut jobs: Vec<Job> = rows.into_iter().map(|JobRow(job)| job).collect();
    let limit = usize::try_from(limit).unwrap_or(usize::MAX);
    let more = jobs.len() > limit;
    jobs.truncate(limit);
    let next = jobs.last().filter(|_| more).map(|job| job.id);
    Ok(Page { jobs, next })
}

/// The unfinished jobs that match and are not being canceled, newest first, older than `before`.
pub(super) async fn unfinished(
    db: impl SqliteExecutor<'_>,
    filter: &Filter,
    before: JobId,
    at_most: u32,
) -> Result<Vec<JobId>, Error> {
    // By the index of states: there are few that have not ended among very many that have.
    let mut query =
        QueryBuilder::<Sqlite>::new("SELECT job.id FROM job INDEXED BY job_state WHERE ");
    matching(&mut query, filter);
    query
        .push(" AND job.state IN ('queued', 'running') AND job.id < ")
        .push_bind(before.0.as_bytes().to_vec())
        .push(" ORDER BY job.id DESC LIMIT ")
        .push_bind(at_most);
    let ids: Vec<Vec<u8>> = query.build_query_scalar().fetch_all(db).await?;
    Ok(ids.iter().map(|id| job_id(id)).collect::<Result<_, _>>()?)
}

/// What a filter asks of a job.
fn matching(query: &mut QueryBuilder<Sqlite>, filter: &Filter) {
    query.push("TRUE");
    if let Some(state) = filter.state {
        query.push(" AND job.state = ").push_bind(state.as_str());
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

/// A result, if its body has no more bytes than this.
pub(super) async fn result(
    db: impl SqliteExecutor<'_>,
    key: &Key,
    most: i64,
) -> Result<Option<Kept>, Error> {
    let row = sqlx::query(
        "SELECT size > ?2 AS larger, iif(size > ?2, NULL, body) AS body, digest, checksum, evicted,
             deleted_by, iif(evicted IS NULL, NULL, (SELECT task FROM result_task WHERE key = ?1)) AS task
         FROM result LEFT JOIN result_blob USING (key) WHERE key = ?1",
    )
    .bind(key.bytes().as_slice())
    .bind(most)
    .fetch_optional(db)
    .await?;
    let Some(row) = row else { return Ok(None) };
    if let Some(at) = row.try_get("evicted")? {
        let task: Option<&str> = row.try_get("task")?;
        let scenario = task.and_then(Task::scenario_in);
        let scenario = scenario.map_or(Ok(Value::Null), |scenario| json(scenario.get()))?;
        let deleted_by = row.try_get("deleted_by")?;
        return Ok(Some(Kept::Evicted { at, deleted_by, scenario }));
    }
    if row.try_get("larger")? {
        return Ok(Some(Kept::Larger));
    }
    let body: Vec<u8> = row.try_get("body")?;
    Ok(Some(Kept::Whole { body, sum: sum(&row)? }))
}

/// Reads the columns `checksum` and `digest`.
pub(super) fn sum(row: &SqliteRow) -> Result<Sum, sqlx::Error> {
    Ok(match row.try_get("checksum")? {
        Some(checksum) => Sum::Check(checksum),
        None => Sum::Digest(row.try_get("digest")?),
    })
}

/// A result as the tables have it.
pub(super) enum Kept {
    Whole {
        body: Vec<u8>,
        sum: Sum,
    },
    /// It has more bytes than were asked for.
    Larger,
    Evicted {
        at: i64,
        deleted_by: Option<String>,
        scenario: Value,
    },
}

/// What the bytes of a body must come to.
pub(super) enum Sum {
    Check(i64),
    /// Results of the first version have nothing else.
    Digest(Vec<u8>),
}

impl Sum {
    pub(super) fn is_of(&self, body: &[u8]) -> bool {
        match self {
            Self::Check(sum) => checksum(body) == *sum,
            Self::Digest(digest) => *Sha256::digest(body) == **digest,
        }
    }
}

pub(super) fn checksum(body: &[u8]) -> i64 {
    xxh3_64(body).cast_signed()
}

pub(super) async fn has_result(db: impl SqliteExecutor<'_>, key: &Key) -> Result<bool, Error> {
    let known = sqlx::query_scalar(
        "SELECT EXISTS (SELECT 1 FROM result WHERE key = ?1 AND evicted IS NULL)",
    )
    .bind(key.bytes().as_slice())
    .fetch_one(db)
    .await?;
    Ok(known)
}

pub(super) async fn live_job(
    db: impl SqliteExecutor<'_>,
    key: &Key,
    owner: Option<&str>,
) -> Result<Option<JobId>, Error> {
    let id: Option<Vec<u8>> = sqlx::query_scalar(
        "SELECT job.id FROM run JOIN job ON job.run = run.id AND job.finished IS NULL
         WHERE run.key = ?1 AND run.state IN ('queued', 'running') AND (?2 IS NULL OR job.owner = ?2)
         ORDER BY job.id LIMIT 1",
    )
    .bind(key.bytes().as_slice())
    .bind(owner)
    .fetch_optional(db)
    .await?;
    Ok(id.map(|bytes| job_id(&bytes)).transpose()?)
}

/// When the oldest queued run was made.
pub(super) async fn oldest_queued(db: impl SqliteExecutor<'_>) -> Result<Option<i64>, Error> {
    let created = sqlx::query_scalar(
        "SELECT created FROM run INDEXED BY run_unfinished
         WHERE state = 'queued' AND finished IS NULL ORDER BY id LIMIT 1",
    )
    .fetch_optional(db)
    .await?;
    Ok(created)
}
