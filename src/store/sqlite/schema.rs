//! The schema of a database: what the file contains, and what the migrations of its version make.
//!
//! A foreign trigger could delete results when a job is submitted. So a database whose schema differs is neither backed up nor
//! restored.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use sqlx::migrate::Migrator;
use sqlx::{Connection as _, SqliteConnection};

use super::open::{MIGRATIONS, latest, version};
use crate::store::error::Error;

/// A table, index, trigger or view, and the statement that makes it.
#[derive(Debug)]
pub(in crate::store) struct Part {
    kind: String,
    pub(in crate::store) sql: String,
}

impl Part {
    /// The statement without white space and quotes, which versions of SQLite write differently.
    fn essence(&self) -> String {
        self.sql.chars().filter(|c| !c.is_whitespace() && *c != '"').collect()
    }
}

/// The parts of a file by their names. A file in which they are not text is damaged: sqlx panics at a column whose type is
/// not text, and may then wait without end.
pub(in crate::store) async fn parts(
    db: &mut SqliteConnection,
) -> Result<BTreeMap<String, Part>, Error> {
    let encoding: String = sqlx::query_scalar("PRAGMA encoding").fetch_one(&mut *db).await?;
    if encoding != "UTF-8" {
        let error = sqlx::Error::Decode(format!("its texts are {encoding}, not UTF-8").into());
        return Err(Error::Damaged(Arc::new(error)));
    }
    let rows: Vec<(Vec<u8>, Vec<u8>, Vec<u8>)> = sqlx::query_as(
        "SELECT CAST(ifnull(name, '') AS BLOB), CAST(ifnull(type, '') AS BLOB), CAST(ifnull(sql, '') AS BLOB)
         FROM sqlite_schema",
    )
    .fetch_all(db)
    .await?;
    let text = |bytes| String::from_utf8(bytes).map_err(|error| sqlx::Error::Decode(error.into()));
    let part = |(name, kind, sql)| Ok((text(name)?, Part { kind: text(kind)?, sql: text(sql)? }));
    let parts: Result<_, sqlx::Error> = rows.into_iter().map(part).collect();
    parts.map_err(|error| Error::Damaged(Arc::new(error)))
}

/// Refuses a database whose schema is not the one of its version. That of a later version is unknown.
pub(in crate::store) async fn compare(db: &mut SqliteConnection, path: &Path) -> Result<(), Error> {
    let found = parts(db).await?;
    let altered = |(name, part): (&String, &Part), what: &str| {
        // The name may contain anything.
        let what = format!("the {} {} {what}", part.kind.escape_debug(), name.escape_debug());
        Error::Altered { path: path.to_owned(), what }
    };
    for part in &made_by(0).await? {
        // Only then it is a table, whose rows can be read.
        if found.get(part.0).is_none_or(|found| found.essence() != part.1.essence()) {
            return Err(altered(part, "is missing or changed"));
        }
    }
    let version = version(db).await?;
    if version > latest() {
        return Ok(());
    }
    let expected = made_by(version).await?;
    for part in &found {
        match expected.get(part.0) {
            Some(expected) if expected.essence() == part.1.essence() => {}
            Some(_) => return Err(altered(part, "is changed")),
            None => return Err(altered(part, "does not belong to fretwork; drop it")),
        }
    }
    match expected.iter().find(|(name, _)| !found.contains_key(*name)) {
        Some(part) => Err(altered(part, "is missing")),
        None => Ok(()),
    }
}

/// The schema that the migrations up to a version make.
async fn made_by(version: i64) -> Result<BTreeMap<String, Part>, Error> {
    let migrations = MIGRATIONS.iter().filter(|migration| migration.version <= version);
    let migrator = Migrator::with_migrations(migrations.cloned().collect());
    let mut db = SqliteConnection::connect("sqlite::memory:").await?;
    let path = Path::new(":memory:").to_owned();
    let failed = |source| Error::Migration { path, source: Arc::new(source) };
    migrator.run(&mut db).await.map_err(failed)?;
    let parts = parts(&mut db).await?;
    db.close().await?;
    Ok(parts)
}
