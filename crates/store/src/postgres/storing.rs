//! The statement that stores a result.

use std::sync::LazyLock;

use crate::database::{Connected, Result, Statement, Tables};
use crate::results::storing::{Answered, COLUMNS, REPLACE, Source, outlined};

/// Stores a result with its body, task and outline, unless the key already has a result. If $1 is true, it replaces an
/// evicted result. Returns a row if the result was stored.
static STORE: LazyLock<String> = LazyLock::new(|| {
    let [columns, values, changed] = outlined(17);
    format!(
        "WITH kept AS (
             INSERT INTO result AS old {COLUMNS}
             VALUES ($2, $3, octet_length($4), $5, $6, $7, $7, $7, $8, $10, $11, $12, $13, $14, $15, $16)
             {REPLACE} old.evicted IS NOT NULL AND $1
             RETURNING key, created, owner
         ), body AS (
             INSERT INTO result_blob (key, body) SELECT key, $4 FROM kept
             ON CONFLICT (key) DO UPDATE SET body = excluded.body
         ), task AS (
             INSERT INTO result_task (key, task) SELECT key, $9 FROM kept
             ON CONFLICT (key) DO UPDATE SET task = excluded.task RETURNING id, key
         ), outlined AS (
             INSERT INTO outline (id, created, size, present, owner, {columns})
             SELECT task.id, kept.created, $3, TRUE, kept.owner, {values} FROM kept JOIN task USING (key)
             ON CONFLICT (id) DO UPDATE SET size = excluded.size, present = TRUE, owner = excluded.owner, {changed}
         )
         SELECT key FROM kept"
    )
});

/// Stores a result, unless the key already has a result. If `replaces` is true, it replaces an evicted result. Returns
/// whether the result was stored.
pub(crate) async fn store(
    db: &mut impl Connected,
    answered: &Answered,
    source: &Source<'_>,
    replaces: bool,
) -> Result<bool> {
    let query = Statement::of(STORE.as_str()).with(replaces).with_result(answered, source);
    Ok(db.row(query).await?.is_some())
}
