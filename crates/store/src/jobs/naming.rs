//! Changes the label, the tags and the privacy of a job, and those of all jobs of an owner.

use serde_json::Value;

use crate::database::{Change, Connected as _, Result, Tables as _, sql};
use crate::jobs::read;
use crate::team::audit::{Act, Actor, record};
use fretwork_job::{Job, JobId, Naming};

/// Number of jobs that one transaction gives or shares, so that a server waits only briefly.
const AT_ONCE: u32 = 10_000;

/// Changes the label, the tags and the privacy of a job. Returns the job; `None` if there is none.
pub(crate) async fn rename(
    (id, naming, by): &(JobId, Naming, Actor),
    mut tx: Change<'_>,
) -> Result<Option<Job>> {
    // The lock keeps the tags equal in both tables.
    let query =
        sql!("SELECT tags, owner FROM job WHERE id = $1" ["" | " FOR NO KEY UPDATE"] ""; *id);
    let Some(row) = tx.row(query).await? else { return Ok(None) };
    if let Some(label) = &naming.label {
        tx.execute(sql!("UPDATE job SET label = $2 WHERE id = $1"; *id, label.as_ref())).await?;
    }
    if let Some(private) = naming.private.map(i64::from) {
        tx.execute(sql!("UPDATE job SET private = $2 WHERE id = $1"; *id, private)).await?;
    }
    if let Some(tags) = &naming.tags {
        // In SQLite, only the index by tags finds the tags of a job.
        let delete = sql!(
            "DELETE FROM job_tag WHERE job = $1 AND tag IN (SELECT value FROM "
            ["json_each($2)" | "json_array_elements_text(CAST($2 AS JSON)) AS value"] ")";
            *id, row.value("tags")?.unwrap_or("[]")
        );
        tx.execute(delete).await?;
        let tags = Value::from(tags.clone()).to_string();
        tx.execute(sql!("UPDATE job SET tags = $2 WHERE id = $1"; *id, &tags)).await?;
        let insert = sql!(
            "INSERT INTO job_tag (tag, job) SELECT DISTINCT value, $1 FROM "
            ["json_each($2)" | "json_array_elements_text(CAST($2 AS JSON)) AS value"] "";
            *id, &tags
        );
        tx.execute(insert).await?;
    }
    let now = tx.now().await?;
    record(&mut tx, now, (by, Act::RenameJob), "", row.get("owner")?).await?;
    read::job(*id, &mut tx).await
}

/// Shares the next names of an owner that are older than the choice of privacy, or gives the next ended jobs of the owner, and
/// all notes, to another one. Servers know the owners of jobs that have not ended. Returns the number of jobs and notes.
pub(crate) async fn pass_on(
    (from, to, by): &(String, Option<String>, Actor),
    mut tx: Change<'_>,
) -> Result<u64> {
    let (act, subject, count) = if let Some(to) = to {
        // Two owners can have the same idempotency key.
        let update = sql!(
            "UPDATE job SET owner = $2, idempotency_key = NULL, fingerprint = NULL WHERE id IN (
                 SELECT id FROM job WHERE owner = $1 AND owner <> $2 AND finished IS NOT NULL LIMIT $3)";
            from, to, AT_ONCE
        );
        let notes = sql!("UPDATE note SET owner = $2 WHERE owner = $1 AND owner <> $2"; from, to);
        let count = tx.changed_by(update).await? + tx.changed_by(notes).await?;
        (Act::GiveNames, &format!("{from} to {to}"), count)
    } else {
        let update = sql!(
            "UPDATE job SET private = 0
             WHERE id IN (SELECT id FROM job WHERE owner = $1 AND private = 2 LIMIT $2)";
            from, AT_ONCE
        );
        (Act::ShareNames, from, tx.changed_by(update).await?)
    };
    if count > 0 {
        let now = tx.now().await?;
        record(&mut tx, now, (by, act), subject, "").await?;
    }
    Ok(count)
}
