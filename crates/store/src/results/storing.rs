//! Stores results, and changes stored ones: pins and deletion.

use sha2::{Digest, Sha256};

use crate::database::{
    Body, Change, Connected, Effect, Lock, Reach, Result, Row, Statement, Tables, sql,
};
use crate::results::search::names;
use crate::team::audit::{Act, Actor, record};
use fretwork_job::{Answer, Cost, JobId, Key, Outline, Recomputed};

/// What happened to the result of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finish {
    /// The result is stored.
    Stored,
    /// The same result was stored before.
    Same,
    /// A different result was stored before, and stays. This is a defect, and it is logged.
    Differs,
    /// The worker has lost the run. The result is not stored.
    Refused,
}

/// What a request to delete a result did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Removed {
    /// There is no such result, or it was evicted or deleted before.
    NotFound,
    /// The result is pinned, so it was not deleted.
    Pinned,
    /// The body is deleted. The scenario is still stored.
    Done,
}

/// A result to be stored, already compressed and hashed. The writer task has no time for that.
#[derive(Debug, Clone)]
pub struct Answered {
    pub(crate) body: Body,
    /// Number of bytes of the JSON.
    pub(crate) size: usize,
    pub(crate) summary: String,
    pub(crate) digest: [u8; 32],
    pub(crate) outline: Box<Outline>,
    /// The cost of the computation; `None` if unknown.
    pub(crate) cost: Option<Cost>,
}

impl Answered {
    /// Compresses and hashes an answer. Large answers take long, so do not call this in the writer task.
    ///
    /// # Panics
    /// There is no memory for the compressor.
    #[expect(clippy::expect_used, reason = "a result must not be lost silently")]
    pub fn new(answer: &Answer, cost: Option<Cost>) -> Self {
        Self {
            body: Body::pack(&answer.body).expect("any bytes can be compressed"),
            size: answer.body.len(),
            summary: answer.summary.to_string(),
            digest: Sha256::digest(&answer.body).into(),
            outline: answer.outline.clone(),
            cost,
        }
    }
}

/// What a change of a pin did.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Changed {
    /// The pin is as requested, now or already before.
    Done,
    /// There is no such result.
    NotFound,
    /// The pin belongs to this other owner; `None` if its owner is unknown.
    OtherOwner(Option<String>),
    /// The pins would take too many bytes.
    QuotaExceeded {
        /// Bytes of the pinned results, including the result of this request.
        used: u64,
        /// The quota.
        quota: u64,
        /// Whether this is the quota for the pins of all owners together.
        of_all: bool,
    },
}

/// Maximum size of the pinned results, in bytes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PinQuota {
    /// Of one owner.
    owner: u64,
    /// Of all owners together; `None` without a limit.
    all: Option<u64>,
}

impl PinQuota {
    /// The quota of one owner is `owner`. All owners together may pin half of the budget.
    pub(crate) fn new(owner: u64, budget: Option<u64>) -> Self {
        let all = budget.map(|budget| budget / 2);
        Self { owner: all.map_or(owner, |all| owner.min(all)), all }
    }

    /// The answer if the pinned results of an owner, or of all owners, take too many bytes.
    fn exceeded_by(&self, own: u64, all: u64) -> Option<Changed> {
        let limits = [(own, Some(self.owner), false), (all, self.all, true)];
        limits.into_iter().find_map(|(used, quota, of_all)| {
            let quota = quota.filter(|quota| used > *quota)?;
            Some(Changed::QuotaExceeded { used, quota, of_all })
        })
    }
}

/// Pins a result within the quota, or unpins it.
pub(crate) async fn pin(
    (key, pinned, editor, quota): &(Key, bool, Reach, PinQuota),
    mut tx: Change<'_>,
) -> Result<Changed> {
    // Without this lock, several servers could exceed the quota together. SQLite needs none, because it has one writer.
    tx.execute(sql!("SELECT " ["" | "pg_advisory_xact_lock"] "($1)"; Lock::Pins as i64)).await?;
    let query = sql!(
        "SELECT pinned, pinned_by, stored FROM result WHERE key = $1 AND evicted IS NULL"
        ["" | " FOR NO KEY UPDATE"] "";
        key
    );
    let Some(row) = tx.row(query).await? else { return Ok(Changed::NotFound) };
    if row.get::<bool>("pinned")? == *pinned {
        return Ok(Changed::Done);
    }
    if *pinned {
        let query = sql!(
            "SELECT CAST(coalesce(sum(stored), 0) AS BIGINT) AS all_pins,
                 CAST(coalesce(sum(stored) FILTER (WHERE pinned_by = $1), 0) AS BIGINT) AS own_pins
             FROM result " ["INDEXED BY result_pinned_by" | ""] " WHERE pinned";
            &editor.owner
        );
        let (sums, bytes) = (tx.one(query).await?, row.get::<u64>("stored")?);
        let [own, all] = [sums.get::<u64>("own_pins")?, sums.get("all_pins")?];
        if let Some(exceeded) = quota.exceeded_by(own + bytes, all + bytes) {
            return Ok(exceeded);
        }
    } else if !editor.may_change(row.value("pinned_by")?.unwrap_or_default()) {
        return Ok(Changed::OtherOwner(row.get("pinned_by")?));
    }
    let owner = pinned.then_some(&editor.owner);
    let update = sql!(
        "UPDATE result SET pinned = $2, pinned_by = $3 WHERE key = $1"; key, *pinned, owner
    );
    tx.execute(update).await?;
    Ok(Changed::Done)
}

/// Deletes the body of a result. Its scenario and its jobs stay.
pub(crate) async fn remove((key, by): &(Key, Actor), mut tx: Change<'_>) -> Result<Removed> {
    let query = sql!(
        "SELECT evicted IS NULL AS held, pinned, owner FROM result WHERE key = $1"
        ["" | " FOR NO KEY UPDATE"] "";
        key
    );
    let Some(row) = tx.row(query).await? else { return Ok(Removed::NotFound) };
    if !row.get::<bool>("held")? {
        // Servers may still have it in memory.
        tx.effects.push(Effect::Deleted(*key));
        return Ok(Removed::NotFound);
    }
    if row.get("pinned")? {
        return Ok(Removed::Pinned);
    }
    let (now, owner) = (tx.now().await?, row.value("owner")?.unwrap_or_default());
    record(&mut tx, now, (by, Act::DeleteResult), &key.to_string(), owner).await?;
    evict(key.bytes(), now, Some(&by.name), &mut tx).await?;
    tx.effects.push(Effect::Deleted(*key));
    Ok(Removed::Done)
}

/// Deletes the body of a result, and keeps its scenario. `deleted_by` is `None` if the result is evicted to free space.
pub(crate) async fn evict(
    key: &[u8],
    now: i64,
    deleted_by: Option<&str>,
    tx: &mut impl Connected,
) -> Result<()> {
    // In SQLite, a trigger updates the outline.
    let evict = sql!(
        "" ["UPDATE result SET evicted = $2, deleted_by = $3 WHERE key = $1;" |
            "WITH evicted AS (UPDATE result SET evicted = $2, deleted_by = $3 WHERE key = $1),
                 outlined AS (UPDATE outline SET present = FALSE
                     WHERE id = (SELECT id FROM result_task WHERE key = $1))"]
        " DELETE FROM result_blob WHERE key = $1";
        key, now, deleted_by
    );
    tx.execute(evict).await
}

/// The provenance of a result to be stored.
pub(crate) struct Source<'a> {
    pub(crate) key: Key,
    pub(crate) task: &'a str,
    /// The owner of the result. For the result of a run, SQLite reads `owner`, `job` and `warnings` from the tables.
    pub(crate) owner: Option<&'a str>,
    pub(crate) job: Option<JobId>,
    /// The warnings of the submission, as JSON.
    pub(crate) warnings: Option<String>,
    pub(crate) trace: Option<&'a str>,
    /// The id of a row in the table `program`.
    pub(crate) program: Option<i64>,
    pub(crate) now: i64,
}

/// The columns of a result, in the order of the first values of [`Statement::with_result`].
pub(crate) const COLUMNS: &str =
    "(key, size, stored, summary, digest, created, last_access, computed, checksum,
    owner, job, warnings, trace, wall, cpu, program)";

/// Ends a statement that inserts a result. If the key already has a result `old`, the new one replaces it under the
/// condition that the caller appends.
pub(crate) const REPLACE: &str = "ON CONFLICT (key) DO UPDATE SET size = excluded.size, stored = excluded.stored,
    summary = excluded.summary, digest = excluded.digest, last_access = excluded.last_access,
    computed = excluded.computed, checksum = excluded.checksum, owner = excluded.owner, job = excluded.job,
    warnings = excluded.warnings, trace = excluded.trace, wall = excluded.wall, cpu = excluded.cpu,
    program = excluded.program, imported = NULL, imported_from = NULL, verified = NULL, deleted_by = NULL, evicted = NULL
    WHERE ";

impl Statement {
    /// Adds the values of a result: 15 of its row, body and task, and those of its outline.
    pub(crate) fn with_result(self, answered: &Answered, source: &Source<'_>) -> Self {
        let Answered { body, size, summary, digest, outline, cost } = answered;
        let row = self
            .with(source.key)
            .with((*size as u64).cast_signed())
            .with(&**body.bytes())
            .with(summary)
            .with(digest)
            .with(source.now)
            .with(body.checksum())
            .with(source.task)
            .with(source.owner)
            .with(source.job)
            .with(source.warnings.as_deref())
            .with(source.trace)
            .with(cost.map(|cost| cost.wall.as_secs_f64()))
            .with(cost.and_then(|cost| cost.cpu).map(|cpu| cpu.as_secs_f64()))
            .with(source.program);
        row.with_outline(outline)
    }

    /// Adds the values of the words and numbers of an outline.
    pub(crate) fn with_outline(self, outline: &Outline) -> Self {
        let words = outline.words.iter().fold(self, |query, word| query.with(word.as_deref()));
        outline.scalars.iter().fold(words, |query, number| query.with(*number))
    }
}

/// Three parts of a statement that inserts an outline: its columns; their parameters, from `$first` on; and the
/// assignments that replace the columns of an existing outline.
pub(crate) fn outlined(first: usize) -> [String; 3] {
    let columns: Vec<_> = names().collect();
    let values: Vec<_> = (first..first + columns.len()).map(|place| format!("${place}")).collect();
    let changes: Vec<_> = columns.iter().map(|name| format!("{name} = excluded.{name}")).collect();
    [columns.join(", "), values.join(", "), changes.join(", ")]
}

/// Decides what happened to the result of a run. The row says whether the key had the `same` result before, and whether
/// the body of that result was `held`. Both are null if the key had no result.
pub(crate) async fn kept(
    answered: &Answered,
    key: Key,
    row: &Row,
    mut tx: Change<'_>,
) -> Result<Finish> {
    let (Some(same), Some(held)) = (row.value("same")?, row.value("held")?) else {
        return Ok(Finish::Stored);
    };
    let (how, finish) = match (same, held) {
        (true, true) => (Recomputed::Same, Finish::Same),
        (true, false) => (Recomputed::Same, Finish::Stored),
        (false, true) => (Recomputed::Differs, Finish::Differs),
        (false, false) => (Recomputed::Replaced, Finish::Stored),
    };
    tx.effects.push(Effect::Recomputed { key, how });
    if finish == Finish::Same {
        // If the stored body was damaged on the disk, this repairs it. If an import brought it, it is verified now.
        let repair = sql!(
            "" ["UPDATE result_blob SET body = $2 WHERE key = $1;" |
                "WITH repaired AS (UPDATE result_blob SET body = $2 WHERE key = $1)"]
            " UPDATE result SET checksum = $3, stored = " ["length" | "octet_length"] "($2),
                 verified = CASE WHEN imported IS NOT NULL THEN 'all' END WHERE key = $1";
            key, &**answered.body.bytes(), answered.body.checksum()
        );
        tx.execute(repair).await?;
    }
    Ok(finish)
}
