//! Changes the label and the tags of a job.

use serde_json::Value;

use crate::database::{Change, Columns as _, Connected as _, Result, Tables as _, sql};
use crate::jobs::read;
use fretwork_job::{Job, JobId, Naming};

/// Changes the label and the tags of a job. Returns the job; `None` if there is none.
pub(crate) async fn rename(
    (id, naming): &(JobId, Naming),
    mut tx: Change<'_>,
) -> Result<Option<Job>> {
    // The lock keeps the tags equal in both tables.
    let query = sql!("SELECT tags FROM job WHERE id = $1" ["" | " FOR NO KEY UPDATE"] ""; *id);
    let Some(row) = tx.row(query).await? else { return Ok(None) };
    if let Some(label) = &naming.label {
        tx.execute(sql!("UPDATE job SET label = $2 WHERE id = $1"; *id, label.as_ref())).await?;
    }
    if let Some(tags) = &naming.tags {
        // In SQLite, only the index by tags finds the tags of a job.
        let delete = sql!(
            "DELETE FROM job_tag WHERE job = $1 AND tag IN (SELECT value FROM "
            ["json_each($2)" | "json_array_elements_text(CAST($2 AS JSON)) AS value"] ")";
            *id, row.text("tags")?.unwrap_or("[]")
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
    read::job(*id, &mut tx).await
}
