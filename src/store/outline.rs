//! The table that search reads. Each row is written in the transaction that stores its result.

use serde::Deserialize;
use serde_json::{Map, Value, json};
use sqlx::{QueryBuilder, Row, Sqlite, SqliteConnection};

use super::error::Error;
use super::row::{json, key};
use crate::job::{Key, Outline, SCALARS, Task, WORDS, summary};

/// The members of a stored result that search and export need.
#[derive(Debug, Deserialize)]
pub(super) struct Document {
    pub(super) key: String,
    pub(super) engine: Engine,
    pub(super) scenario: Value,
    scales: Value,
    unworn: Value,
    regime: Value,
    pub(super) history: Map<String, Value>,
}

/// The engine that computed a result.
#[derive(Debug, Deserialize)]
pub(super) struct Engine {
    pub(super) name: String,
    pub(super) numerics: u32,
}

impl Document {
    /// Reads a stored result; `None` if the text is not one.
    pub(super) fn read(body: &[u8]) -> Option<Self> {
        serde_json::from_slice(body).ok().filter(Self::has_history)
    }

    /// The short form that the table `result` holds.
    pub(super) fn summary(&self) -> Value {
        summary(&self.regime, &self.history)
    }

    /// Whether the history consists of columns of numbers that all have the same length of at least 1.
    pub(super) fn has_history(&self) -> bool {
        let rows = self.history.get("cycles").and_then(Value::as_array).map_or(0, Vec::len);
        let is_column = |column: &Value| {
            let numbers = column.as_array();
            numbers.is_some_and(|list| list.len() == rows && list.iter().all(Value::is_number))
        };
        rows > 0 && self.history.values().all(is_column)
    }

    pub(super) fn outline(&self) -> Outline {
        let Self { scenario, scales, unworn, .. } = self;
        Outline::of(&json!({
            "scenario": scenario, "scales": scales, "unworn": unworn, "summary": self.summary(),
        }))
    }
}

/// The names of the words and numbers, in the order of an [`Outline`].
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    let words = WORDS.iter().map(|word| word.name);
    words.chain(SCALARS.iter().map(|scalar| scalar.name))
}

/// Writes the outline of a stored result, in place of an older one.
pub(super) async fn write(
    db: &mut SqliteConnection,
    key: Key,
    outline: &Outline,
) -> Result<(), Error> {
    let mut query = QueryBuilder::<Sqlite>::new(
        "INSERT OR REPLACE INTO outline (id, created, size, present, owner",
    );
    for name in names() {
        query.push(", ").push(name);
    }
    query.push(") SELECT result_task.id, created, size, evicted IS NULL, owner");
    for word in &outline.words {
        query.push(", ").push_bind(word.clone());
    }
    for number in &outline.scalars {
        query.push(", ").push_bind(*number);
    }
    query.push(" FROM result JOIN result_task USING (key) WHERE result.key = ");
    query.push_bind(key.bytes().to_vec()).build().execute(db).await?;
    Ok(())
}

/// Writes the outlines that a database of an earlier version lacks. They belong to the results with the
/// largest ids.
pub(super) async fn complete(db: &mut SqliteConnection) -> Result<(), Error> {
    const NEXT: &str = "
        SELECT result.key AS key, task, summary FROM result_task CROSS JOIN result USING (key)
        WHERE result_task.id > (SELECT coalesce(max(id), 0) FROM outline)
        ORDER BY result_task.id LIMIT 1";
    while let Some(row) = sqlx::query(NEXT).fetch_optional(&mut *db).await? {
        let key = key(&row, "key")?;
        let outline = if let Some(document) = document(db, key).await? {
            document.outline()
        } else {
            let scenario = Task::scenario_in(row.try_get("task")?);
            // Without a readable summary, search still finds the result by its inputs.
            let summary: Value = json(row.try_get("summary")?).unwrap_or(Value::Null);
            Outline::of(&json!({"scenario": scenario, "summary": summary}))
        };
        write(db, key, &outline).await?;
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
        Ok(body) => Ok(body.and_then(|body| Document::read(&body))),
        // A damaged page must not keep the server from starting.
        Err(Error::Damaged(_)) => Ok(None),
        Err(error) => Err(error),
    }
}
