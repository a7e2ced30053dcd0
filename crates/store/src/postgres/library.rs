//! Provenance of results.

use sqlx::postgres::PgConnection;

use super::Database;
use super::transaction::reading;
use crate::error::Error;
use crate::library::{KNOWN, Known, PROVENANCE, Program, Provenance};
use fretwork_job::Key;

/// The id of the row of a program, which is inserted if necessary.
pub(super) async fn program(program: &Program, db: &mut PgConnection) -> Result<i64, Error> {
    let insert = sqlx::query(
        "INSERT INTO program (version, numerics, host, architecture, processors)
         VALUES ($1, $2, $3, $4, $5) ON CONFLICT DO NOTHING",
    );
    let (numerics, processors) = (i64::from(program.numerics), i64::from(program.processors));
    insert
        .bind(&program.version)
        .bind(numerics)
        .bind(&program.host)
        .bind(&program.architecture)
        .bind(processors)
        .execute(&mut *db)
        .await?;
    let query = sqlx::query_scalar(
        "SELECT id FROM program WHERE version = $1 AND numerics = $2 AND host = $3
             AND architecture = $4 AND processors = $5",
    );
    let query = query.bind(&program.version).bind(numerics).bind(&program.host);
    Ok(query.bind(&program.architecture).bind(processors).fetch_one(db).await?)
}

pub(crate) async fn provenance(
    db: &mut PgConnection,
    key: &Key,
) -> Result<Option<Provenance>, Error> {
    let query = sqlx::query(PROVENANCE).bind(key.bytes().as_slice());
    let row = query.fetch_optional(db).await?;
    Ok(row.as_ref().map(Provenance::read).transpose()?)
}

impl Database {
    pub(crate) async fn provenance(&self, key: &Key) -> Result<Option<Provenance>, Error> {
        reading!(self, db => provenance(db, key).await)
    }

    pub(crate) async fn known(&self, key: &Key) -> Result<Option<Known>, Error> {
        let row = reading!(self, db => {
            let query = sqlx::query(KNOWN).bind(key.bytes().as_slice());
            Ok(query.fetch_optional(db).await?)
        });
        row?.map(|row| Known::read(key, &row)).transpose()
    }
}
