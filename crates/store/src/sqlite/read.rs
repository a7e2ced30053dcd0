//! Reading jobs and results.

use std::time::Duration;

use sqlx::SqliteExecutor;

use super::{Database, upkeep};
use crate::error::Error;
use crate::read::{Asked, Filter, LARGE, Page, StoredResult, matching, page, read_job};
use crate::row::{Columns as _, Sum, job_id};
use crate::statement::{SQLITE, Statement};
use fretwork_job::clock::now;
use fretwork_job::{Job, JobId, Key};

impl Database {
    pub(crate) async fn job(&self, id: JobId) -> Result<Option<Job>, Error> {
        self.reading(async |db| job(db, id).await).await
    }

    pub(crate) async fn asked(&self, id: JobId) -> Result<Asked, Error> {
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

    pub(crate) async fn jobs(
        &self,
        filter: &Filter,
        cursor: Option<JobId>,
        limit: u32,
    ) -> Result<Page, Error> {
        let query = page(SELECT_JOB, filter, cursor, limit, SQLITE).sqlite();
        let rows = self.reading(async |db| Ok(query.fetch_all(db).await?)).await?;
        Ok(Page::read(&rows, limit)?)
    }

    pub(crate) async fn small_result(
        &self,
        key: &Key,
    ) -> Result<Option<(StoredResult, Sum)>, Error> {
        let most = (LARGE as u64).cast_signed();
        self.reading(async |db| result(db, key, most).await).await
    }

    /// A result of any size.
    pub(crate) async fn large_result(
        &self,
        key: &Key,
    ) -> Result<Option<(StoredResult, Sum)>, Error> {
        self.reading_by(&self.large, async |db| result(db, key, i64::MAX).await).await
    }

    pub(crate) async fn has_result(&self, key: &Key) -> Result<bool, Error> {
        let known = self.reading(async |db| {
            let query = sqlx::query_scalar(
                "SELECT EXISTS (SELECT 1 FROM result WHERE key = ?1 AND evicted IS NULL)",
            );
            Ok(query.bind(key.bytes().as_slice()).fetch_one(db).await?)
        });
        known.await
    }

    pub(crate) async fn live_job(
        &self,
        key: &Key,
        owner: Option<&str>,
    ) -> Result<Option<JobId>, Error> {
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

    pub(crate) async fn longest_wait(&self) -> Result<Duration, Error> {
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

    pub(crate) async fn last_backup(&self) -> Result<Option<i64>, Error> {
        self.reading(async |db| {
            Ok(Some(sqlx::query_scalar("SELECT backed_up FROM room").fetch_one(db).await?))
        })
        .await
    }

    pub(crate) async fn probe(&self) -> Result<(), Error> {
        self.write(upkeep::probe, ()).await
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

pub(super) async fn job(db: impl SqliteExecutor<'_>, id: JobId) -> Result<Option<Job>, Error> {
    let mut query = Statement::new(SELECT_JOB, SQLITE);
    query.push("job.id = ").bind(id.0.as_bytes().as_slice());
    let row = query.sqlite().fetch_optional(db).await?;
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
    let select = "SELECT job.id AS id FROM job INDEXED BY job_state WHERE ";
    let mut query = Statement::new(select, SQLITE);
    matching(&mut query, filter);
    query
        .push(" AND job.state IN ('queued', 'running') AND job.state <> 'succeeded' AND job.id < ")
        .bind(before.0.as_bytes().as_slice())
        .push(" ORDER BY job.id DESC LIMIT ")
        .bind(i64::from(at_most));
    let rows = query.sqlite().fetch_all(db).await?;
    Ok(rows.iter().map(|row| job_id(row.get("id")?)).collect::<Result<_, _>>()?)
}

/// A result and the hash of its body. The body is read if its JSON has at most `most` bytes.
pub(crate) async fn result(
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
    Ok(Some((StoredResult::read(key, &row, most)?, Sum::read(&row)?)))
}
