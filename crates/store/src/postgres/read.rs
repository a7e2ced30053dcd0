//! Reading jobs and results.

use std::time::Duration;

use sqlx::postgres::PgConnection;

use super::Database;
use super::transaction::{reading, writing};
use crate::error::Error;
use crate::read::{Asked, Filter, LARGE, Page, StoredResult, matching, page, read_job};
use crate::row::{Columns, Sum, job_id};
use crate::statement::{POSTGRES, Statement};
use fretwork_job::{Job, JobId, Key};

/// A job, with columns of its run and result. A run may continue or fail after one of its jobs was canceled.
/// That does not change the job.
const SELECT_JOB: &str = "
    SELECT job.id, job.owner, job.key, job.state, job.origin, job.label, job.tags, job.warnings,
        job.created, job.started, job.finished, job.attempt, job.priority, job.changes,
        coalesce(lease.progress, least(study.done, study.chunks)::DOUBLE PRECISION / study.chunks,
            run.progress) AS progress,
        run.error_kind, run.error, run.recomputed, result.summary
    FROM job
    LEFT JOIN run ON run.id = job.run
    LEFT JOIN lease ON lease.run = job.run AND lease.number = -1
    LEFT JOIN study ON study.run = job.run
    LEFT JOIN result ON result.key = job.key AND job.state = 'succeeded'
    WHERE ";

/// Sorts 256 KiB.
const SPILL: &str = "
    SELECT count(*) FROM (
        SELECT repeat(md5(n::TEXT), 256) COLLATE \"C\" AS bytes FROM generate_series(1, 32) AS n ORDER BY bytes
    ) AS sorted";

impl Database {
    pub(crate) async fn job(&self, id: JobId) -> Result<Option<Job>, Error> {
        reading!(self, db => job(db, id).await)
    }

    pub(crate) async fn asked(&self, id: JobId) -> Result<Asked, Error> {
        reading!(self, db => {
            // The run of a job has its task. A job without a run has it with its result.
            let query = sqlx::query_as(
                "SELECT coalesce(
                     (SELECT task FROM run WHERE run.id = job.run),
                     (SELECT task FROM result_task WHERE result_task.key = job.key)) AS task, submitted
                 FROM job WHERE id = $1",
            );
            let asked = query.bind(id.0.as_bytes().as_slice()).fetch_optional(db).await?;
            let (task, submitted) = asked.unwrap_or_default();
            Ok(Asked { task, submitted })
        })
    }

    pub(crate) async fn jobs(
        &self,
        filter: &Filter,
        cursor: Option<JobId>,
        limit: u32,
    ) -> Result<Page, Error> {
        reading!(self, db => {
            let query = page(SELECT_JOB, filter, cursor, limit, POSTGRES).postgres();
            Ok(Page::read(&query.fetch_all(db).await?, limit)?)
        })
    }

    pub(crate) async fn small_result(
        &self,
        key: &Key,
    ) -> Result<Option<(StoredResult, Sum)>, Error> {
        let most = (LARGE as u64).cast_signed();
        reading!(self, db => result(db, key, most).await)
    }

    /// A result of any size.
    pub(crate) async fn large_result(
        &self,
        key: &Key,
    ) -> Result<Option<(StoredResult, Sum)>, Error> {
        let _permit = self.0.large.acquire().await.map_err(|_| Error::Closed)?;
        reading!(self, db => result(db, key, i64::MAX).await)
    }

    pub(crate) async fn has_result(&self, key: &Key) -> Result<bool, Error> {
        reading!(self, db => {
            let query = sqlx::query_scalar(
                "SELECT EXISTS (SELECT 1 FROM result WHERE key = $1 AND evicted IS NULL)",
            );
            Ok(query.bind(key.bytes().as_slice()).fetch_one(db).await?)
        })
    }

    pub(crate) async fn live_job(
        &self,
        key: &Key,
        owner: Option<&str>,
    ) -> Result<Option<JobId>, Error> {
        let id = reading!(self, db => {
            let query = sqlx::query_scalar(
                "SELECT job.id FROM run JOIN job ON job.run = run.id AND job.finished IS NULL
                 WHERE run.key = $1 AND run.state IN ('queued', 'running')
                     AND ($2 IS NULL OR job.owner = $2)
                 ORDER BY job.id LIMIT 1",
            );
            Ok(query.bind(key.bytes().as_slice()).bind(owner).fetch_optional(db).await?)
        });
        let id: Option<Vec<u8>> = id?;
        Ok(id.map(|bytes| job_id(&bytes)).transpose()?)
    }

    pub(crate) async fn longest_wait(&self) -> Result<Duration, Error> {
        self.count_queue().await
    }

    /// Counts what is queued and running for the metrics. Returns how long the oldest queued run has waited.
    pub(super) async fn count_queue(&self) -> Result<Duration, Error> {
        let counts: (i64, Option<i64>, i64, i64) = reading!(self, db => {
            let query = sqlx::query_as(
                "SELECT count(*), moment() - min(created),
                         (SELECT count(*) FROM lease),
                         (SELECT count(*) FROM job WHERE state = 'queued')
                     FROM run WHERE state = 'queued'",
            );
            Ok(query.fetch_one(db).await?)
        })
        .inspect_err(|_| self.0.backlog.counted(None))?;
        let (queued, waited, running, jobs) = counts;
        self.0.backlog.counted(Some(jobs as usize));
        self.0.signals.tally.queue_is(queued as usize, running as usize);
        Ok(Duration::from_millis(waited.unwrap_or(0).max(0).unsigned_abs()))
    }

    /// Backups of PostgreSQL are not noted here.
    #[expect(clippy::unused_async, reason = "the other engine reads it")]
    pub(crate) async fn last_backup(&self) -> Result<Option<i64>, Error> {
        Ok(None)
    }

    pub(crate) async fn probe(&self) -> Result<(), Error> {
        writing!(self, tx => {
            // A temporary file of 256 KiB, about what a default result takes with its job. It always takes new space. A table
            // may have free pages, and many servers would make it grow.
            sqlx::query("SET LOCAL work_mem = '64kB'").execute(&mut *tx.db).await?;
            sqlx::query(SPILL).execute(&mut *tx.db).await?;
            sqlx::query("UPDATE upkeep SET probe = moment()").execute(&mut *tx.db).await?;
            Ok(())
        })
    }
}

pub(super) async fn job(db: &mut PgConnection, id: JobId) -> Result<Option<Job>, Error> {
    let mut query = Statement::new(SELECT_JOB, POSTGRES);
    query.push("job.id = ").bind(id.0.as_bytes().as_slice());
    let row = query.postgres().fetch_optional(db).await?;
    Ok(row.as_ref().map(read_job).transpose()?)
}

/// The unfinished jobs that match and are not being canceled, newest first, older than `before`.
pub(super) async fn unfinished(
    db: &mut PgConnection,
    filter: &Filter,
    before: JobId,
    at_most: u32,
) -> Result<Vec<JobId>, Error> {
    // The index of states skips the many finished jobs.
    let mut query = Statement::new("SELECT job.id AS id FROM job WHERE ", POSTGRES);
    matching(&mut query, filter);
    query
        .push(" AND job.state IN ('queued', 'running') AND job.state <> 'succeeded' AND job.id < ")
        .bind(before.0.as_bytes().as_slice())
        .push(" ORDER BY job.id DESC LIMIT ")
        .bind(i64::from(at_most));
    let rows = query.postgres().fetch_all(db).await?;
    Ok(rows.iter().map(|row| job_id(row.get("id")?)).collect::<Result<_, _>>()?)
}

/// A result and the hash of its body. The body is read if its JSON has at most `most` bytes.
pub(crate) async fn result(
    db: &mut PgConnection,
    key: &Key,
    most: i64,
) -> Result<Option<(StoredResult, Sum)>, Error> {
    let row = sqlx::query(
        "SELECT size, CASE WHEN size <= $2 THEN body END AS body, digest, checksum, evicted, deleted_by,
             CASE WHEN evicted IS NOT NULL THEN (SELECT task FROM result_task WHERE key = $1) END AS task
         FROM result LEFT JOIN result_blob USING (key) WHERE key = $1",
    )
    .bind(key.bytes().as_slice())
    .bind(most)
    .fetch_optional(db)
    .await?;
    let Some(row) = row else { return Ok(None) };
    Ok(Some((StoredResult::read(key, &row, most)?, Sum::read(&row)?)))
}
