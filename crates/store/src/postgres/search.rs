//! Search for results.

use sqlx::postgres::PgConnection;
use tokio::sync::SemaphorePermit;

use super::Database;
use super::transaction::reading;
use crate::error::Error;
use crate::row::key;
use crate::search::{self, Cursor, Found, Search};
use crate::statement::POSTGRES;
use fretwork_job::{Key, Outline};

impl Database {
    pub(crate) async fn search(
        &self,
        search: &Search,
        cursor: Option<Cursor>,
        limit: u32,
    ) -> Result<Found, Error> {
        let _permit = self.scan().await?;
        reading!(self, db => page(db, search, cursor, limit).await)
    }

    pub(crate) async fn nearest(
        &self,
        to: &Outline,
        except: Option<Key>,
    ) -> Result<Option<Key>, Error> {
        let _permit = self.scan().await?;
        let row = reading!(self, db => {
            Ok(search::nearest(to, except, POSTGRES).postgres().fetch_optional(db).await?)
        });
        Ok(row?.map(|row| key(&row, "key")).transpose()?)
    }

    /// Waits for permission to scan all results. Scans never take all connections, so single results can
    /// always be read.
    async fn scan(&self) -> Result<SemaphorePermit<'_>, Error> {
        self.0.scans.acquire().await.map_err(|_| Error::Closed)
    }
}

/// Returns up to `limit` matching results after `cursor`.
pub(crate) async fn page(
    db: &mut PgConnection,
    search: &Search,
    cursor: Option<Cursor>,
    limit: u32,
) -> Result<Found, Error> {
    let query = search::page("", search, cursor, limit, POSTGRES).postgres();
    Ok(Found::read(&query.fetch_all(db).await?, limit)?)
}
