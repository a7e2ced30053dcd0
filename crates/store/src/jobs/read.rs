//! Reads jobs, pages of jobs, and results.

use bytes::Bytes;

use crate::database::{
    Body, Error, Reach, Result, Row, RunId, Statement, Sum, Tables, Words, page_of, read, sql,
};
use crate::jobs::claimed::Claimed;
use fretwork_job::{Canonical, Failure, Job, JobId, JobState, Key};

/// Conditions on the jobs of a list. `None` means no condition.
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
    /// With these words in the label, the tags, or the note of the result.
    pub words: Words,
    /// Within reach of this caller.
    pub reach: Reach,
    /// Whether a list begins with the oldest job.
    pub oldest_first: bool,
}

/// A page of a list of jobs.
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
    /// The stored body of the result.
    Whole(Body),
    /// The result is larger than [`LARGE`], so its body was not read. The value is the number of bytes of its JSON.
    Large(usize),
    /// The body was evicted or deleted.
    Evicted {
        /// The time of the eviction, in milliseconds since 1970.
        at: i64,
        /// Who deleted it; `None` if it was evicted to free space.
        deleted_by: Option<String>,
        /// The canonical scenario or study that was computed; `None` if it is no longer stored.
        asked: Option<Canonical>,
    },
}

impl StoredResult {
    /// Reads a row. It contains the body only if the JSON has at most `most` bytes.
    fn read(key: &Key, row: &Row, most: i64) -> Result<Self> {
        Ok(if let Some(at) = row.get("evicted")? {
            let task: Option<&str> = row.get("task")?;
            let damaged = Error::DamagedResult(*key);
            let asked = task.map(|task| Canonical::in_stored(task).ok_or(damaged)).transpose()?;
            Self::Evicted { at, deleted_by: row.get("deleted_by")?, asked }
        } else if let size @ 0.. = row.get::<i64>("size")?
            && size > most
        {
            Self::Large(size.cast_unsigned() as usize)
        } else {
            Self::Whole(Body::stored(row.get("body")?))
        })
    }
}

/// Larger results, by the bytes of their JSON, are read by one dedicated connection. They are checksummed and
/// decompressed on a blocking thread.
pub const LARGE: usize = 1 << 18;

/// The task of a job, and its original text.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Asked {
    /// The task in its stored form; `None` if it is no longer stored.
    pub task: Option<String>,
    /// The scenario as the client wrote it, in JSON; `None` if it is not stored.
    pub submitted: Option<String>,
}

/// Reads the columns of a job.
pub(crate) fn read_job(row: &Row) -> sqlx::Result<Job> {
    let state = row.get("state")?;
    let failure = match state {
        JobState::Failed => {
            Some(Failure { kind: row.get("error_kind")?, message: row.get("error")? })
        }
        _ => None,
    };
    let progress = match state {
        JobState::Succeeded => 1.0,
        JobState::Canceled => 0.0,
        _ => row.get("progress")?,
    };
    Ok(read!(row => Job {
        id, key, owner, origin, attempt, priority, label, tags, private, warnings, created, started, finished, changes,
        summary, recomputed, verified; state, progress, failure
    }))
}

/// A statement that reads jobs under these conditions, with columns of their runs and results. The state is that of the
/// job: after one job of a run was canceled, the run may continue or fail.
macro_rules! select_job {
    ($($conditions:tt)*) => {
        sql!(
            "SELECT job.id, job.owner, job.key, job.state, job.origin, job.label, job.tags, job.private <> 0 AS private, job.warnings,
                 job.created, job.started, job.finished, job.attempt, job.priority, job.changes, "
            ["run.progress" |
             "coalesce(lease.progress, least(study.done, study.chunks)::DOUBLE PRECISION / study.chunks,
                  run.progress) AS progress"]
            ", run.error_kind, run.error, run.recomputed, result.verified, result.summary
             FROM job
             LEFT JOIN run ON run.id = job.run "
            ["" |
             "LEFT JOIN lease ON lease.run = job.run AND lease.number = -1
              LEFT JOIN study ON study.run = job.run"]
            " LEFT JOIN result ON result.key = job.key AND job.state = 'succeeded' WHERE " ["" | ""] $($conditions)*
        )
    };
}

/// A job in its current state.
pub(crate) async fn job(id: JobId, mut db: impl Tables) -> Result<Option<Job>> {
    let row = db.row(select_job!("job.id = $1"; id)).await?;
    Ok(row.as_ref().map(read_job).transpose()?)
}

/// The number of jobs that match.
pub(crate) async fn count(filter: &Filter, mut db: impl Tables) -> Result<u64> {
    let mut query = sql!("SELECT count(*) AS total FROM job WHERE ");
    matching(&mut query, filter);
    Ok(db.one(query).await?.get("total")?)
}

/// Up to `limit` jobs that match after `cursor`, in the order of the filter.
pub(crate) async fn jobs(
    filter: &Filter,
    cursor: Option<JobId>,
    limit: u32,
    mut db: impl Tables,
) -> Result<Page> {
    let mut query = select_job!("");
    matching(&mut query, filter);
    let (beyond, direction) = if filter.oldest_first { (">", "ASC") } else { ("<", "DESC") };
    if let Some(cursor) = cursor {
        query.push(" AND job.id ").push(beyond).push(" ").push_bind(cursor);
    }
    query.push(" ORDER BY job.id ").push(direction).push_limit(limit + 1);
    let rows = db.rows(query).await?;
    let (rows, last) = page_of(&rows, limit);
    let next = last.map(|row| row.get("id")).transpose()?;
    Ok(Page { jobs: rows.iter().map(read_job).collect::<Result<_, _>>()?, next })
}

/// Up to `at_most` queued or running jobs that match and are older than `before`, newest first.
pub(crate) async fn unfinished(
    filter: &Filter,
    before: JobId,
    at_most: u32,
    mut db: impl Tables,
) -> Result<Vec<JobId>> {
    // The index of states skips the many finished jobs.
    let mut query = sql!("SELECT job.id AS id FROM job " ["INDEXED BY job_state " | ""] "WHERE ");
    matching(&mut query, filter);
    query
        .push(" AND job.state IN ('queued', 'running') AND job.state <> 'succeeded' AND job.id < ")
        .push_bind(before)
        .push(" ORDER BY job.id DESC")
        .push_limit(at_most);
    let rows = db.rows(query).await?;
    Ok(rows.iter().map(|row| row.get("id")).collect::<Result<_, _>>()?)
}

/// The numbers of queued and of running jobs of an owner.
pub(crate) async fn counts(owner: &str, mut db: impl Tables) -> Result<(u64, u64)> {
    // The index of states skips the many finished jobs.
    let query = sql!(
        "SELECT count(*) FILTER (WHERE state = 'queued') AS queued,
             count(*) FILTER (WHERE state <> 'queued') AS running
         FROM job " ["INDEXED BY job_state" | ""] "
         WHERE state IN ('queued', 'running', 'canceling') AND state <> 'succeeded' AND owner = $1";
        owner
    );
    let row = db.one(query).await?;
    Ok((row.get("queued")?, row.get("running")?))
}

/// The task of a job, and the text as the client submitted it.
pub(crate) async fn asked(id: JobId, mut db: impl Tables) -> Result<Asked> {
    // The task is in the row of the run. A job without a run has a result, and the task is stored with the result.
    // Versions before 0.3 could delete such a result completely. Then the run of another job with this key may have the
    // task.
    let query = sql!(
        "SELECT coalesce(
             (SELECT task FROM run WHERE run.id = job.run),
             (SELECT task FROM result_task WHERE result_task.key = job.key),
             (SELECT task FROM job AS other JOIN run ON run.id = other.run
              WHERE other.key = job.key LIMIT 1)) AS task, submitted
         FROM job WHERE id = $1";
        id
    );
    let Some(row) = db.row(query).await? else { return Ok(Asked::default()) };
    Ok(Asked { task: row.get("task")?, submitted: row.get("submitted")? })
}

/// The oldest unfinished job within reach of the live run of a key.
pub(crate) async fn live_job(
    key: &Key,
    reach: &Reach,
    mut db: impl Tables,
) -> Result<Option<JobId>> {
    let mut query = sql!(
        "SELECT job.id AS id FROM run JOIN job ON job.run = run.id AND job.finished IS NULL
         WHERE run.key = $1 AND run.state IN ('queued', 'running')";
        key
    );
    query.job_within(reach);
    query.push(" ORDER BY job.id LIMIT 1");
    Ok(db.row(query).await?.map(|row| row.get("id")).transpose()?)
}

/// A result and the hash of its body. The body is read if its JSON has at most `most` bytes.
pub(crate) async fn result(
    key: &Key,
    most: i64,
    mut db: impl Tables,
) -> Result<Option<(StoredResult, Sum)>> {
    let query = sql!(
        "SELECT size, CASE WHEN size <= $2 THEN body END AS body, digest, checksum, evicted, deleted_by,
             CASE WHEN evicted IS NOT NULL THEN (SELECT task FROM result_task WHERE key = $1) END AS task
         FROM result LEFT JOIN result_blob USING (key) WHERE key = $1";
        key, most
    );
    let Some(row) = db.row(query).await? else { return Ok(None) };
    Ok(Some((StoredResult::read(key, &row, most)?, Sum::read(&row)?)))
}

/// Whether the body of the result of a key is stored.
pub(crate) async fn has_result(key: &Key, mut db: impl Tables) -> Result<bool> {
    let query = sql!(
        "SELECT EXISTS (SELECT 1 FROM result WHERE key = $1 AND evicted IS NULL) AS is_known"; key
    );
    Ok(db.one(query).await?.get("is_known")?)
}

/// The stored data of this chunk of a study. The inner error means that they are damaged.
fn data(row: &Row, key: Key, number: u32) -> sqlx::Result<Result<Bytes>> {
    let body = Body::stored(row.get("body")?);
    let is_sound = body.checksum() == row.get::<i64>("checksum")?;
    let bytes = is_sound.then(|| body.json().ok()).flatten();
    Ok(bytes.ok_or(Error::DamagedChunk { key, number }))
}

/// The stored data of a finished chunk of a claimed study. The inner error means that they are damaged.
pub(crate) async fn chunk(
    claimed: &Claimed,
    number: u32,
    mut db: impl Tables,
) -> Result<Option<Result<Bytes>>> {
    let query = sql!(
        "SELECT body, checksum FROM chunk WHERE run = $1 AND number = $2 AND state = 'done'";
        claimed.run, number
    );
    Ok(db.row(query).await?.map(|row| data(&row, claimed.key, number)).transpose()?)
}

/// The stored data of a finished chunk of a canceled study with this key and number of chunks; `None` if there is none, or it is
/// damaged.
pub(crate) async fn canceled_chunk(
    key: &Key,
    number: u32,
    of: u32,
    mut db: impl Tables,
) -> Result<Option<Bytes>> {
    // Only unfinished studies, and those of a week, have a row in `study`. A study whose result is stored is computed again
    // for a comparison, so nothing computed before may be a part of it.
    let query = sql!(
        "SELECT body, checksum FROM study JOIN run ON run.id = study.run JOIN chunk ON chunk.run = run.id
         WHERE run.key = $1 AND run.state = 'canceled' AND chunks = $3 AND number = $2 AND chunk.state = 'done'
             AND NOT EXISTS (SELECT 1 FROM result WHERE result.key = $1 AND evicted IS NULL)
         LIMIT 1";
        key, number, of
    );
    let found = db.row(query).await?.map(|row| data(&row, *key, number)).transpose()?;
    Ok(found.and_then(Result::ok))
}

/// A study that is being computed or was canceled.
#[derive(Debug)]
pub struct Unfinished {
    /// The key of its result.
    pub key: Key,
    /// The task in its stored form.
    pub task: String,
    /// The number of its chunks.
    pub chunks: u32,
    /// How many of them are finished.
    pub done: u32,
}

/// The study of a job, if it is being computed or was canceled.
pub(crate) async fn unfinished_study(id: JobId, mut db: impl Tables) -> Result<Option<Unfinished>> {
    let query = sql!(
        "SELECT run.key AS key, run.task AS task, study.chunks AS chunks,
             (SELECT count(*) FROM chunk
              WHERE chunk.run = study.run AND chunk.state = 'done' AND number < study.chunks) AS done
         FROM job JOIN run ON run.id = job.run JOIN study ON study.run = run.id
         WHERE job.id = $1 AND (run.finished IS NULL OR run.state = 'canceled')";
        id
    );
    let Some(row) = db.row(query).await? else { return Ok(None) };
    Ok(Some(read!(row => Unfinished { key, task, chunks, done })))
}

/// The stored data of the finished chunks of a job's study, with their numbers: at most as many as were done. The inner errors mean that
/// chunks are damaged.
pub(crate) async fn chunks(
    id: JobId,
    &Unfinished { key, chunks, done, .. }: &Unfinished,
    mut db: impl Tables,
) -> Result<Vec<Result<(u32, Bytes)>>> {
    let query = sql!(
        "SELECT number, body, checksum FROM job JOIN chunk ON chunk.run = job.run
         WHERE job.id = $1 AND chunk.state = 'done' AND number < $2 ORDER BY number LIMIT $3";
        id, chunks, done
    );
    let rows = db.rows(query).await?;
    let chunk = |row: &Row| {
        let number = row.get("number")?;
        Ok(data(row, key, number)?.map(|bytes| (number, bytes)))
    };
    rows.iter().map(chunk).collect()
}

/// The task of an unfinished run in its stored form.
pub(crate) async fn task(run: RunId, mut db: impl Tables) -> Result<Option<String>> {
    let row = db.row(sql!("SELECT task FROM run WHERE id = $1 AND finished IS NULL"; run)).await?;
    Ok(row.map(|row| row.get("task")).transpose()?)
}

/// Writes the conditions of a filter.
fn matching(query: &mut Statement, filter: &Filter) {
    query.push("TRUE");
    query.job_within(&filter.reach);
    if let Some(state) = filter.state {
        query.push(" AND job.state = ").push_bind(state.as_str());
        if state != JobState::Succeeded {
            // The index `job_state` requires this condition.
            query.push(" AND job.state <> 'succeeded'");
        }
    }
    if let Some(label) = &filter.label {
        query.push(" AND job.label = ").push_bind(&**label);
    }
    if let Some(key) = &filter.key {
        query.push(" AND job.key = ").push_bind(key);
    }
    if let Some(owner) = &filter.owner {
        query.push(" AND job.owner = ").push_bind(&**owner);
    }
    if let Some(tag) = &filter.tag {
        query
            .push(" AND job.id IN (SELECT job FROM job_tag WHERE tag = ")
            .push_bind(&**tag)
            .push(")");
    }
    query.job_has_words(&filter.words, &filter.reach);
}
