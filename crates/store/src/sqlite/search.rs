//! Search for results.

use sqlx::SqliteConnection;
use tokio::sync::SemaphorePermit;

use super::Database;
use crate::error::Error;
use crate::row::key;
use crate::search::{self, Cursor, Found, Search};
use crate::statement::SQLITE;
use fretwork_job::{Key, Outline};

impl Database {
    pub(crate) async fn search(
        &self,
        search: &Search,
        cursor: Option<Cursor>,
        limit: u32,
    ) -> Result<Found, Error> {
        let _permit = self.scan().await?;
        self.reading(async |db| page(db, search, cursor, limit).await).await
    }

    pub(crate) async fn nearest(
        &self,
        to: &Outline,
        except: Option<Key>,
    ) -> Result<Option<Key>, Error> {
        let _permit = self.scan().await?;
        let query = search::nearest(to, except, SQLITE).sqlite();
        let row = self.reading(async |db| Ok(query.fetch_optional(db).await?)).await?;
        Ok(row.map(|row| key(&row, "key")).transpose()?)
    }

    /// Waits for permission to scan all results. Scans never take all connections, so single results can
    /// always be read.
    async fn scan(&self) -> Result<SemaphorePermit<'_>, Error> {
        self.scans.acquire().await.map_err(|_| Error::Closed)
    }
}

/// Returns up to `limit` matching results after `cursor`.
pub(crate) async fn page(
    db: &mut SqliteConnection,
    search: &Search,
    cursor: Option<Cursor>,
    limit: u32,
) -> Result<Found, Error> {
    let query = search::page("", search, cursor, limit, SQLITE).sqlite();
    Ok(Found::read(&query.fetch_all(db).await?, limit)?)
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use sqlx::Row as _;

    use super::*;
    use crate::Options;
    use crate::sqlite::open::SCANS;
    use fretwork_job::JobId;

    async fn open(dir: &Path) -> Database {
        Database::open(dir, &Options::default(), Arc::default()).await.unwrap()
    }

    #[tokio::test]
    async fn searches_for_the_newest_results_use_an_index() {
        let dir = tempfile::tempdir().unwrap();
        let store = open(dir.path()).await;
        for (name, value, index) in [
            ("pinned", "false", "outline_created"),
            ("owner", "ann", "outline_owner"),
            ("evicted", "true", "outline_absent"),
        ] {
            let mut search = Search::default();
            search.set(name, value).unwrap();
            let cursor = "4014000000000000-3".parse().ok();
            let query = search::page("EXPLAIN QUERY PLAN ", &search, cursor, 50, SQLITE).sqlite();
            let rows = store.reading(async |db| Ok(query.fetch_all(db).await?));
            let plan: Vec<String> =
                rows.await.unwrap().iter().map(|row| row.get("detail")).collect();
            let is_used =
                |step: &String| step.contains(&format!("SEARCH outline USING INDEX {index}"));
            assert!(plan.iter().any(is_used), "{plan:?}");
        }
    }

    #[tokio::test]
    async fn jobs_can_be_read_while_searches_wait() {
        let dir = tempfile::tempdir().unwrap();
        let store = open(dir.path()).await;
        let permits = store.scans.acquire_many(u32::try_from(SCANS).unwrap()).await.unwrap();
        let all = Search::default();
        let mut search = std::pin::pin!(store.search(&all, None, 1));
        let reads = async {
            for _ in 0..100 {
                assert_eq!(store.job(JobId::generate()).await.unwrap(), None);
            }
        };
        tokio::select! {
            _ = &mut search => panic!("there is no permit for it"),
            () = reads => {}
        }
        drop(permits);
        assert!(search.await.unwrap().results.is_empty());
    }
}
