//! The migrations of the schema, and which versions of the program may write the tables.

use std::sync::Arc;

use sqlx::SqlSafeStr as _;
use sqlx::migrate::{MigrateError, Migration, MigrationType, Migrator};
use sqlx::postgres::PgConnection;

use crate::database::{DatabaseUrl, Error, Result};

/// The migrations of the schema: version, name and SQL.
const CHANGES: [(i64, &str, &str); 11] = [
    (1, "jobs", include_str!("../../../../migrations/postgres/0001_jobs.sql")),
    (2, "study died", include_str!("../../../../migrations/postgres/0002_study_died.sql")),
    (3, "lease lasts", include_str!("../../../../migrations/postgres/0003_lease_lasts.sql")),
    (4, "oldest program", include_str!("../../../../migrations/postgres/0004_oldest_program.sql")),
    (5, "verified", include_str!("../../../../migrations/postgres/0005_verified.sql")),
    (6, "geometry", include_str!("../../../../migrations/postgres/0006_geometry.sql")),
    (7, "stages", include_str!("../../../../migrations/postgres/0007_stages.sql")),
    (8, "sessions", include_str!("../../../../migrations/postgres/0008_sessions.sql")),
    (9, "labelled", include_str!("../../../../migrations/postgres/0009_labelled.sql")),
    (10, "shared names", include_str!("../../../../migrations/postgres/0010_shared_names.sql")),
    (11, "backed up", include_str!("../../../../migrations/postgres/0011_backed_up.sql")),
];

/// The error if this version of the program must not write the tables.
pub(super) async fn refusal(db: &mut PgConnection, name: &str) -> Result<Option<Error>> {
    let (known, ..) = CHANGES[CHANGES.len() - 1];
    let found: Option<i64> = sqlx::query_scalar(
        "SELECT (SELECT max(version) FROM _sqlx_migrations) FROM upkeep WHERE oldest > $1",
    )
    .bind(known)
    .fetch_optional(db)
    .await?;
    Ok(found.map(|found| Error::Newer { path: name.into(), found, known }))
}

/// Creates or migrates the tables if necessary.
pub(super) async fn migrate(db: &mut PgConnection, url: &DatabaseUrl) -> Result<()> {
    let migration = |(version, name, sql): (_, &'static str, &'static str)| {
        Migration::new(version, name.into(), MigrationType::Simple, sql.into_sql_str(), false)
    };
    let mut migrator = Migrator::with_migrations(CHANGES.map(migration).into());
    // A later version of the program may have migrated the tables. [`refusal`] decides whether this version may write
    // them.
    migrator.set_ignore_missing(true).set_locking(false);
    migrator.run(db).await.map_err(|error| match error {
        MigrateError::Execute(error) => error.into(),
        error => Error::Migration { path: url.to_string().into(), source: Arc::new(error) },
    })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn every_migration_of_the_directory_is_embedded() {
        let mut files: Vec<_> = fs::read_dir("../../migrations/postgres")
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
