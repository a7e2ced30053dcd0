//! The table that search reads. Each row is written in the transaction that stores its result.

use serde_json::{Value, json};
use sqlx::SqliteConnection;

use crate::database::{Body, Connected, Error, Result, Statement, Tables, sql};
use crate::results::storing::outlined;
use fretwork_job::{Key, Outline, ResultDocument, TaskKind, asked_in};

/// The statement that writes the outline of a stored result, and replaces an older outline. `which` is a condition that
/// selects the result. The parameters for the words and numbers begin at `first`.
pub(super) fn insert(which: &str, first: usize) -> String {
    let [columns, values, _] = outlined(first);
    format!(
        "INSERT OR REPLACE INTO outline (id, created, size, present, owner, {columns})
         SELECT result_task.id, created, size, evicted IS NULL, owner, {values}
         FROM result JOIN result_task USING (key) {which}"
    )
}

/// Writes the missing outlines of a database of an earlier version. Always the results with the largest ids lack them.
pub(super) async fn complete(db: &mut SqliteConnection) -> Result<()> {
    let next = sql!(
        "SELECT result.key AS key, task, summary FROM result_task CROSS JOIN result USING (key)
         WHERE result_task.id > (SELECT coalesce(max(id), 0) FROM outline)
         ORDER BY result_task.id LIMIT 1"
    );
    let insert = Statement::of(insert("WHERE result.key = $1", 2));
    while let Some(row) = db.row(next.clone()).await? {
        let key = row.get("key")?;
        let outline = if let Some(document) = document(db, key).await? {
            document.outline
        } else {
            let asked = asked_in(row.get("task")?);
            let kind = asked.map(|(kind, _)| kind.word());
            let scenario = asked.filter(|(kind, _)| *kind == TaskKind::Run).map(|(_, text)| text);
            // Without a readable summary, search still finds the result by its inputs.
            let summary = row.get("summary").unwrap_or(Value::Null);
            Outline::of(&json!({"kind": kind, "scenario": scenario, "summary": summary}))
        };
        db.execute(insert.clone().with(key).with_outline(&outline)).await?;
    }
    Ok(())
}

/// Reads a stored result; `None` if it was evicted or is damaged.
async fn document(db: &mut SqliteConnection, key: Key) -> Result<Option<ResultDocument>> {
    match db.row(sql!("SELECT body FROM result_blob WHERE key = $1"; key)).await {
        Ok(Some(row)) => {
            let body = Body::stored(row.get("body")?);
            Ok(body.json().ok().and_then(|json| ResultDocument::read(&json).ok()))
        }
        // The server must start even if a page is damaged.
        Ok(None) | Err(Error::Damaged(_)) => Ok(None),
        Err(error) => Err(error),
    }
}
