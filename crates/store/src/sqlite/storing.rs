//! The statements that store a result.

use std::array;
use std::sync::LazyLock;

use sqlx::SqliteConnection;

use super::outline;
use crate::database::{Connected, Result, Statement};
use crate::results::storing::{Answered, COLUMNS, REPLACE, Source};

/// Why a result is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reason {
    /// It is the result of the run $1 at the attempt $2, which ends.
    Run,
    /// It was computed before its job was submitted. It does not replace an evicted result, because the two results are
    /// not compared.
    Job,
    /// It is imported.
    Import,
}

/// The statements that store a result. The parameters of [`Statement::with_result`] begin at `first`. For
/// [`Reason::Run`], owner, job and warnings are read from the run.
///
/// All statements are executed in one call, because a call takes longer than a statement. `changes()` is the number of
/// rows that the previous statement has changed, and each statement requires that it is 1. So a result is stored only
/// if its run was ended, and a result that is already stored stays. After the last statement, `changes()` is 1 if the
/// result was stored.
pub(super) fn keeping(reason: Reason, first: usize) -> String {
    let [
        key,
        size,
        body,
        summary,
        digest,
        now,
        sum,
        task,
        owner,
        job,
        warnings,
        trace,
        wall,
        cpu,
        program,
    ] = array::from_fn(|place| format!("${}", first + place));
    let outline =
        outline::insert(&format!("WHERE changes() = 1 AND result.key = {key}"), first + 15);
    let end = format!(
        "UPDATE run SET state = 'succeeded', progress = 1, finished = {now}, changed = {now},
             recomputed = (SELECT CASE WHEN digest = {digest} THEN 'same' WHEN evicted IS NULL THEN 'differs'
                 ELSE 'replaced' END FROM result WHERE result.key = run.key)
         WHERE id = $1 AND attempt = $2 AND state = 'running'
         RETURNING started, (SELECT digest = {digest} FROM result WHERE result.key = run.key) AS same,
             (SELECT evicted IS NULL FROM result WHERE result.key = run.key) AS held;"
    );
    let of_run = |column: &str| format!("(SELECT {column} FROM run WHERE id = $1)");
    let first_job = "(SELECT min(id) FROM job WHERE run = $1)".to_owned();
    let (end, ended, owner, job, warnings) = match reason {
        Reason::Run => (end, "changes() = 1", of_run("owner"), first_job, of_run("warnings")),
        Reason::Job | Reason::Import => (String::new(), "TRUE", owner, job, warnings),
    };
    let replaces = if reason == Reason::Job { "FALSE" } else { "old.evicted IS NOT NULL" };
    format!(
        "{end}
         INSERT INTO result AS old {COLUMNS}
         SELECT {key}, {size}, length({body}), {summary}, {digest}, {now}, {now}, {now}, {sum}, {owner},
             {job}, {warnings}, {trace}, {wall}, {cpu}, {program}
         WHERE {ended} {REPLACE} {replaces};
         INSERT OR REPLACE INTO result_blob (key, body) SELECT {key}, {body} WHERE changes() = 1;
         INSERT INTO result_task (key, task) SELECT {key}, {task} WHERE changes() = 1
         ON CONFLICT (key) DO UPDATE SET task = excluded.task;
         {outline}"
    )
}

/// Stores an imported result, unless one with the same key is stored.
pub(crate) async fn import(
    answered: &Answered,
    db: &mut SqliteConnection,
    source: &Source<'_>,
) -> Result<()> {
    static IMPORT: LazyLock<String> = LazyLock::new(|| keeping(Reason::Import, 1));
    db.execute(Statement::of(IMPORT.as_str()).with_result(answered, source)).await
}
