//! What is read: jobs, pages of jobs, results.

use super::body::Body;
use super::error::Error;
use super::row::{Columns, changes, job_id, json, key, optional_word, word};
use super::statement::{Dialect, Statement};
use fretwork_job::{Canonical, Failure, FailureKind, Job, JobId, JobState, Key};

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

impl Page {
    /// The page in the rows of [`page`].
    pub(super) fn read(rows: &[impl Columns], limit: u32) -> Result<Self, sqlx::Error> {
        let more = rows.len() as u64 > u64::from(limit);
        let rows = &rows[..rows.len().min(limit as usize)];
        let jobs: Vec<Job> = rows.iter().map(read_job).collect::<Result<_, _>>()?;
        let next = jobs.last().filter(|_| more).map(|job| job.id);
        Ok(Self { jobs, next })
    }
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

impl StoredResult {
    /// Reads a row with the body, unless its JSON has more than `most` bytes.
    pub(super) fn read(key: &Key, row: &impl Columns, most: i64) -> Result<Self, Error> {
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

pub(super) fn read_job(row: &impl Columns) -> Result<Job, sqlx::Error> {
    let state: JobState = word(row, "state")?;
    let failure = match state {
        JobState::Failed => Some(Failure {
            kind: word::<FailureKind>(row, "error_kind")?,
            message: row.get("error")?,
        }),
        _ => None,
    };
    let summary: Option<&str> = row.get("summary")?;
    Ok(Job {
        id: job_id(row.get("id")?)?,
        state,
        key: key(row, "key")?,
        owner: row.get("owner")?,
        origin: word(row, "origin")?,
        attempt: row.get("attempt")?,
        progress: match state {
            JobState::Succeeded => 1.0,
            JobState::Canceled => 0.0,
            _ => row.get("progress")?,
        },
        priority: row.get("priority")?,
        label: row.get("label")?,
        tags: json(row.get("tags")?)?,
        warnings: json(row.get("warnings")?)?,
        created: row.get("created")?,
        started: row.get("started")?,
        finished: row.get("finished")?,
        changes: changes(row.get("changes")?)?,
        failure,
        summary: summary.map(json).transpose()?,
        recomputed: optional_word(row, "recomputed")?,
    })
}

/// Writes the conditions of a filter.
pub(super) fn matching(query: &mut Statement, filter: &Filter) {
    query.push("TRUE");
    if let Some(state) = filter.state {
        query.push(" AND job.state = ").bind(state.as_str());
        if state != JobState::Succeeded {
            // The index `job_state` requires this condition.
            query.push(" AND job.state <> 'succeeded'");
        }
    }
    if let Some(label) = &filter.label {
        query.push(" AND job.label = ").bind(&**label);
    }
    if let Some(key) = &filter.key {
        query.push(" AND job.key = ").bind(key.bytes().as_slice());
    }
    if let Some(owner) = &filter.owner {
        query.push(" AND job.owner = ").bind(&**owner);
    }
    if let Some(tag) = &filter.tag {
        query.push(" AND job.id IN (SELECT job FROM job_tag WHERE tag = ").bind(&**tag).push(")");
    }
}

/// The statement that reads a page of jobs, newest first, and one row more: it tells whether there is a next page.
pub(super) fn page(
    select: &str,
    filter: &Filter,
    cursor: Option<JobId>,
    limit: u32,
    dialect: Dialect,
) -> Statement {
    let mut query = Statement::new(select, dialect);
    matching(&mut query, filter);
    if let Some(cursor) = cursor {
        query.push(" AND job.id < ").bind(cursor.0.as_bytes().as_slice());
    }
    query.push(" ORDER BY job.id DESC LIMIT ").bind(i64::from(limit) + 1);
    query
}
