//! What can be asked of the tables, and how a row becomes a job.

use serde::de::DeserializeOwned;
use sqlx::sqlite::SqliteRow;
use sqlx::{FromRow, QueryBuilder, Row, Sqlite, SqliteExecutor};

use super::{Error, Filter, Page, StoredResult};
use crate::job::{Failure, FailureKind, Job, JobId, JobState, Key};

/// A job with what it takes from its run and result. A run may go on, or fail, after a job of it
/// was canceled: that is no longer the job's business.
const SELECT_JOB: &str = "
    SELECT job.id, job.owner, job.key, job.state, job.origin, job.label, job.tags, job.warnings,
        job.created, job.started, job.finished, job.attempt, run.progress, run.error_kind,
        run.error, result.summary
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
            label: row.try_get("label")?,
            tags: json(row.try_get("tags")?)?,
            warnings: json(row.try_get("warnings")?)?,
            created: row.try_get("created")?,
            started: row.try_get("started")?,
            finished: row.try_get("finished")?,
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

fn job_id(bytes: &[u8]) -> Result<JobId, sqlx::Error> {
    uuid::Uuid::from_slice(bytes).map(JobId).map_err(|error| sqlx::Error::Decode(Box::new(error)))
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

pub(super) async fn jobs(
    db: impl SqliteExecutor<'_>,
    filter: &Filter,
    cursor: Option<JobId>,
    limit: u32,
) -> Result<Page, Error> {
    let mut query = QueryBuilder::<Sqlite>::new(SELECT_JOB);
    let mut conditions = query.separated(" AND ");
    conditions.push("TRUE");
    if let Some(state) = filter.state {
        conditions.push("job.state = ").push_bind_unseparated(state.as_str());
    }
    if let Some(label) = &filter.label {
        conditions.push("job.label = ").push_bind_unseparated(label);
    }
    if let Some(key) = &filter.key {
        conditions.push("job.key = ").push_bind_unseparated(key.bytes().as_slice());
    }
    if let Some(owner) = &filter.owner {
        conditions.push("job.owner = ").push_bind_unseparated(owner);
    }
    if let Some(tag) = &filter.tag {
        conditions
            .push("EXISTS (SELECT 1 FROM json_each(job.tags) WHERE value = ")
            .push_bind_unseparated(tag)
            .push_unseparated(")");
    }
    if let Some(cursor) = cursor {
        conditions.push("job.id < ").push_bind_unseparated(cursor.0.as_bytes().as_slice());
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

pub(super) async fn result(
    db: impl SqliteExecutor<'_>,
    key: &Key,
) -> Result<Option<StoredResult>, Error> {
    let row: Option<(Vec<u8>, String)> = sqlx::query_as(
        "SELECT body, summary FROM result_blob JOIN result USING (key) WHERE key = ?1",
    )
    .bind(key.bytes().as_slice())
    .fetch_optional(db)
    .await?;
    let stored = row.map(|(body, summary)| Ok(StoredResult { body, summary: json(&summary)? }));
    stored.transpose()
}

pub(super) async fn has_result(db: impl SqliteExecutor<'_>, key: &Key) -> Result<bool, Error> {
    let known = sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM result_blob WHERE key = ?1)")
        .bind(key.bytes().as_slice())
        .fetch_one(db)
        .await?;
    Ok(known)
}

pub(super) async fn live_job(
    db: impl SqliteExecutor<'_>,
    key: &Key,
) -> Result<Option<JobId>, Error> {
    let id: Option<Vec<u8>> = sqlx::query_scalar(
        "SELECT job.id FROM run JOIN job ON job.run = run.id AND job.finished IS NULL
         WHERE run.key = ?1 AND run.state IN ('queued', 'running') ORDER BY job.id LIMIT 1",
    )
    .bind(key.bytes().as_slice())
    .fetch_optional(db)
    .await?;
    Ok(id.map(|bytes| job_id(&bytes)).transpose()?)
}

pub(super) async fn ping(db: impl SqliteExecutor<'_>) -> Result<(), Error> {
    // Reading a table, unlike a constant, touches the file.
    sqlx::query("SELECT 1 FROM job LIMIT 1").execute(db).await?;
    Ok(())
}
