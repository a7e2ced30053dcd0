//! The table that search reads. Each row is written in the transaction that stores its result.

use serde_json::{Value, json};
use sqlx::query::Query;
use sqlx::sqlite::SqliteArguments;
use sqlx::{AssertSqlSafe, Sqlite, SqliteConnection};

use crate::body::Body;
use crate::error::Error;
use crate::row::{Columns, json, key};
use crate::search::names;
use fretwork_job::{Document, Key, Outline, TaskKind, asked_in};

/// The statement that writes the outline of a stored result, in place of an older one. `which` selects the result.
/// The words and numbers are the parameters from `first` on.
pub(super) fn insert(which: &str, first: usize) -> String {
    let columns: Vec<_> = names().collect();
    let values: Vec<_> =
        (first..first + columns.len()).map(|number| format!("${number}")).collect();
    format!(
        "INSERT OR REPLACE INTO outline (id, created, size, present, owner, {})
         SELECT result_task.id, created, size, evicted IS NULL, owner, {}
         FROM result JOIN result_task USING (key) {which}",
        columns.join(", "),
        values.join(", ")
    )
}

/// A statement with its arguments so far.
pub(super) type Statement<'q> = Query<'q, Sqlite, SqliteArguments>;

/// Adds the words and numbers to the arguments of a statement.
pub(super) fn bind<'q>(query: Statement<'q>, outline: &'q Outline) -> Statement<'q> {
    let query = outline.words.iter().fold(query, |query, word| query.bind(word.as_deref()));
    outline.scalars.iter().fold(query, |query, number| query.bind(*number))
}

/// Writes the outlines that a database of an earlier version lacks. They belong to the results with the
/// largest ids.
pub(super) async fn complete(db: &mut SqliteConnection) -> Result<(), Error> {
    const NEXT: &str = "
        SELECT result.key AS key, task, summary FROM result_task CROSS JOIN result USING (key)
        WHERE result_task.id > (SELECT coalesce(max(id), 0) FROM outline)
        ORDER BY result_task.id LIMIT 1";
    let insert = insert("WHERE result.key = $1", 2);
    while let Some(row) = sqlx::query(NEXT).fetch_optional(&mut *db).await? {
        let key = key(&row, "key")?;
        let outline = if let Some(document) = document(db, key).await? {
            document.outline
        } else {
            let asked = asked_in(row.get("task")?);
            let kind = asked.map(|(kind, _)| kind.word());
            let scenario = asked.filter(|(kind, _)| *kind == TaskKind::Run).map(|(_, text)| text);
            // Without a readable summary, search still finds the result by its inputs.
            let summary: Value = json(row.get("summary")?).unwrap_or(Value::Null);
            Outline::of(&json!({"kind": kind, "scenario": scenario, "summary": summary}))
        };
        let query = sqlx::query(AssertSqlSafe(insert.clone())).bind(key.bytes().as_slice());
        bind(query, &outline).execute(&mut *db).await?;
    }
    Ok(())
}

/// Reads a stored result; `None` if it was evicted or is damaged.
async fn document(db: &mut SqliteConnection, key: Key) -> Result<Option<Document>, Error> {
    let body: Result<Option<Vec<u8>>, sqlx::Error> =
        sqlx::query_scalar("SELECT body FROM result_blob WHERE key = ?1")
            .bind(key.bytes().as_slice())
            .fetch_optional(db)
            .await;
    match body.map_err(Error::from) {
        Ok(body) => Ok(body.and_then(|body| Document::read(&Body::stored(body).json().ok()?).ok())),
        // A damaged page must not keep the server from starting.
        Err(Error::Damaged(_)) => Ok(None),
        Err(error) => Err(error),
    }
}
