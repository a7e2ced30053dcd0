//! The schema of a database: its migrations, and the comparison of a file with the schema that they make.
//!
//! A trigger that another program has added could delete results when a job is submitted. So a database whose schema
//! differs is neither backed up nor restored.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, LazyLock};

use sqlx::migrate::{MigrateError, Migration, MigrationType, Migrator};
use sqlx::{Connection as _, SqlSafeStr as _, SqliteConnection};

use crate::database::{Error, Result};

/// The migrations of the schema: version, name and SQL.
const CHANGES: [(i64, &str, &str); 21] = [
    (1, "jobs", include_str!("../../../../migrations/sqlite/0001_jobs.sql")),
    (
        2,
        "years of service",
        include_str!("../../../../migrations/sqlite/0002_years_of_service.sql"),
    ),
    (3, "access keys", include_str!("../../../../migrations/sqlite/0003_access_keys.sql")),
    (4, "library", include_str!("../../../../migrations/sqlite/0004_library.sql")),
    (5, "search", include_str!("../../../../migrations/sqlite/0005_search.sql")),
    (6, "submitted", include_str!("../../../../migrations/sqlite/0006_submitted.sql")),
    (7, "compact results", include_str!("../../../../migrations/sqlite/0007_compact_results.sql")),
    (8, "warnings", include_str!("../../../../migrations/sqlite/0008_warnings.sql")),
    (9, "audit", include_str!("../../../../migrations/sqlite/0009_audit.sql")),
    (10, "commits", include_str!("../../../../migrations/sqlite/0010_commits.sql")),
    (11, "trust", include_str!("../../../../migrations/sqlite/0011_trust.sql")),
    (12, "kinds", include_str!("../../../../migrations/sqlite/0012_kinds.sql")),
    (13, "chunks", include_str!("../../../../migrations/sqlite/0013_chunks.sql")),
    (14, "copies", include_str!("../../../../migrations/sqlite/0014_copies.sql")),
    (15, "verified", include_str!("../../../../migrations/sqlite/0015_verified.sql")),
    (16, "geometry", include_str!("../../../../migrations/sqlite/0016_geometry.sql")),
    (17, "stages", include_str!("../../../../migrations/sqlite/0017_stages.sql")),
    (18, "sessions", include_str!("../../../../migrations/sqlite/0018_sessions.sql")),
    (19, "named", include_str!("../../../../migrations/sqlite/0019_named.sql")),
    (20, "shared names", include_str!("../../../../migrations/sqlite/0020_shared_names.sql")),
    (21, "quick checks", include_str!("../../../../migrations/sqlite/0021_quick_checks.sql")),
];

/// All migrations. The macros of sqlx would embed the directory, but they compile SQLite a second time.
static MIGRATIONS: LazyLock<Migrator> = LazyLock::new(|| {
    let migration = |(version, name, sql): (_, &'static str, &'static str)| {
        Migration::new(version, name.into(), MigrationType::Simple, sql.into_sql_str(), false)
    };
    Migrator::with_migrations(CHANGES.map(migration).into())
});

/// A table, index, trigger or view, and the statement that creates it.
pub(crate) struct SchemaPart {
    kind: String,
    pub(crate) sql: String,
}

impl SchemaPart {
    /// The statement without white space and quotes. Versions of SQLite differ in these.
    fn essence(&self) -> String {
        self.sql.chars().filter(|c| !c.is_whitespace() && *c != '"').collect()
    }
}

/// The parts of the schema of a file, by name. They are read as bytes: if a damaged file contains values that are not
/// text, sqlx would panic, and might then wait without end.
pub(crate) async fn parts(db: &mut SqliteConnection) -> Result<BTreeMap<String, SchemaPart>> {
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
    let part =
        |(name, kind, sql)| Ok((text(name)?, SchemaPart { kind: text(kind)?, sql: text(sql)? }));
    let parts: sqlx::Result<_> = rows.into_iter().map(part).collect();
    parts.map_err(|error| Error::Damaged(Arc::new(error)))
}

/// Refuses a database whose schema differs from that of its version. The schema of a later version is not known, and is
/// not compared.
pub(crate) async fn compare(db: &mut SqliteConnection, path: &Path) -> Result<()> {
    let found = parts(db).await?;
    let altered = |(name, part): (&String, &SchemaPart), what: &str| {
        // The name may contain anything.
        let what = format!("the {} {} {what}", part.kind.escape_debug(), name.escape_debug());
        Error::Altered { path: path.to_owned(), what }
    };
    for part in &made_by(0).await? {
        // These parts must be sound before the version can be read from the table of migrations.
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
            None => {
                return Err(altered(
                    part,
                    "does not belong to fretwork; remove it from the database",
                ));
            }
        }
    }
    match expected.iter().find(|(name, _)| !found.contains_key(*name)) {
        Some(part) => Err(altered(part, "is missing")),
        None => Ok(()),
    }
}

/// The schema that the migrations up to a version make.
async fn made_by(version: i64) -> Result<BTreeMap<String, SchemaPart>> {
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

pub(crate) async fn migrate(db: &mut SqliteConnection, path: &Path) -> Result<()> {
    let known = latest();
    MIGRATIONS.run(db).await.map_err(|error| match error {
        MigrateError::VersionMissing(found) if found > known => {
            Error::Newer { path: path.to_owned(), found, known }
        }
        error => Error::Migration { path: path.to_owned(), source: Arc::new(error) },
    })
}

/// The versions whose record in `_sqlx_migrations` differs from the migration of this program. A server does not start
/// with such a record.
pub(crate) async fn wrong_records(db: &mut SqliteConnection) -> sqlx::Result<Vec<i64>> {
    let mut expected: BTreeMap<i64, &[u8]> =
        MIGRATIONS.iter().map(|migration| (migration.version, &*migration.checksum)).collect();
    let recorded: Vec<(i64, Vec<u8>, bool)> =
        sqlx::query_as("SELECT version, checksum, success FROM _sqlx_migrations")
            .fetch_all(db)
            .await?;
    let mut wrong = Vec::new();
    for (version, checksum, success) in recorded {
        if expected.remove(&version) != Some(&*checksum) || !success {
            wrong.push(version);
        }
    }
    wrong.extend(expected.into_keys());
    Ok(wrong)
}

/// The schema version of this program.
#[expect(clippy::expect_used, reason = "the migrations are compiled in")]
pub(crate) fn latest() -> i64 {
    CHANGES.iter().map(|(version, ..)| *version).max().expect("there are migrations")
}

/// Refuses a database whose schema version differs from that of this program.
pub(crate) async fn require_latest(db: &mut SqliteConnection, path: &Path) -> Result<()> {
    let (path, found, known) = (path.to_owned(), version(db).await?, latest());
    match found.cmp(&known) {
        Ordering::Less => Err(Error::Older { path, found, known }),
        Ordering::Equal => Ok(()),
        Ordering::Greater => Err(Error::Newer { path, found, known }),
    }
}

/// The schema version of a database.
pub(crate) async fn version(db: &mut SqliteConnection) -> sqlx::Result<i64> {
    sqlx::query_scalar("SELECT coalesce(max(version), 0) FROM _sqlx_migrations").fetch_one(db).await
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn every_migration_of_the_directory_is_embedded() {
        let mut files: Vec<_> = fs::read_dir("../../migrations/sqlite")
            .unwrap()
            .map(|file| file.unwrap().file_name().into_string().unwrap())
            .collect();
        files.sort();
        let file = |(version, name, _): &(i64, &str, &str)| {
            format!("{version:04}_{}.sql", name.replace(' ', "_"))
        };
        assert_eq!(files, CHANGES.iter().map(file).collect::<Vec<_>>());
    }
}
