//! Provenance, notes and deletion of results.

use sqlx::SqliteConnection;

use super::{Database, keep};
use crate::audit::Actor;
use crate::error::Error;
use crate::keep::{Changed, Editor, Removed};
use crate::library::{KNOWN, Known, PROVENANCE, Program, Provenance};
use fretwork_job::Key;

/// The id of the row of a program, which is inserted if necessary.
pub(super) async fn program(program: &Program, db: &mut SqliteConnection) -> Result<i64, Error> {
    let id = sqlx::query_scalar(
        "INSERT OR IGNORE INTO program (version, numerics, host, architecture, processors)
         VALUES (?1, ?2, ?3, ?4, ?5);
         SELECT id FROM program WHERE version = ?1 AND numerics = ?2 AND host = ?3
             AND architecture = ?4 AND processors = ?5",
    )
    .bind(&program.version)
    .bind(program.numerics)
    .bind(&program.host)
    .bind(&program.architecture)
    .bind(program.processors)
    .fetch_one(db)
    .await?;
    Ok(id)
}

pub(crate) async fn provenance(
    db: &mut SqliteConnection,
    key: &Key,
) -> Result<Option<Provenance>, Error> {
    let query = sqlx::query(PROVENANCE).bind(key.bytes().as_slice());
    let Some(row) = query.fetch_optional(db).await? else { return Ok(None) };
    Ok(Some(Provenance::read(&row)?))
}

impl Database {
    pub(crate) async fn provenance(&self, key: &Key) -> Result<Option<Provenance>, Error> {
        self.reading(async |db| provenance(db, key).await).await
    }

    pub(crate) async fn pin(
        &self,
        key: &Key,
        pinned: bool,
        editor: Editor,
    ) -> Result<Changed, Error> {
        self.write(keep::pin, (*key, pinned, editor, self.pin_quota)).await
    }

    pub(crate) async fn annotate(
        &self,
        key: &Key,
        text: Option<String>,
        editor: Editor,
    ) -> Result<Changed, Error> {
        self.write(keep::annotate, (*key, text, editor)).await
    }

    pub(crate) async fn remove(&self, key: &Key, by: Actor) -> Result<Removed, Error> {
        self.write(keep::remove, (*key, by)).await
    }

    pub(crate) async fn known(&self, key: &Key) -> Result<Option<Known>, Error> {
        let query = sqlx::query(KNOWN).bind(key.bytes().as_slice());
        let row = self.reading(async |db| Ok(query.fetch_optional(db).await?)).await?;
        row.map(|row| Known::read(key, &row)).transpose()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use sqlx::Row as _;

    use crate::Options;

    /// A result can have a million jobs.
    #[tokio::test]
    async fn the_jobs_of_a_result_are_counted_with_an_index() {
        let dir = tempfile::tempdir().unwrap();
        let store = Database::open(dir.path(), &Options::default(), Arc::default()).await.unwrap();
        let plan = format!("EXPLAIN QUERY PLAN {PROVENANCE}");
        let rows = store.reading(async |db| {
            let plan = sqlx::query(sqlx::AssertSqlSafe(plan)).bind([0; 32].as_slice());
            Ok(plan.fetch_all(db).await?)
        });
        let rows = rows.await.unwrap();
        let steps: Vec<&str> = rows.iter().map(|row| row.get("detail")).collect();
        assert!(steps.contains(&"SEARCH job USING COVERING INDEX job_key (key=?)"), "{steps:?}");
        assert!(steps.iter().all(|step| !step.starts_with("SCAN")), "{steps:?}");
    }
}
