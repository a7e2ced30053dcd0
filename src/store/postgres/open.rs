//! Connects to the database, migrates it, and starts the tasks in the background.

use std::sync::{Arc, OnceLock};

use sqlx::migrate::{MigrateError, Migration, MigrationType, Migrator};
use sqlx::postgres::PgConnection;
use sqlx::{ConnectOptions as _, Connection as _, SqlSafeStr as _};
use tokio::sync::{Semaphore, watch};

use super::backlog::Backlog;
use super::contact::Contact;
use super::pool::Pool;
use super::{Database, Lock, Node, Parts, library, node};
use crate::job::JobId;
use crate::store::error::Error;
use crate::store::library::Program;
use crate::store::options::Options;
use crate::store::pins::PinQuota;
use crate::store::place::DatabaseUrl;
use crate::store::signals::Signals;

/// The changes of the schema: version, name and SQL.
const CHANGES: [(i64, &str, &str); 4] = [
    (1, "jobs", include_str!("../../../migrations/postgres/0001_jobs.sql")),
    (2, "study died", include_str!("../../../migrations/postgres/0002_study_died.sql")),
    (3, "lease lasts", include_str!("../../../migrations/postgres/0003_lease_lasts.sql")),
    (4, "oldest program", include_str!("../../../migrations/postgres/0004_oldest_program.sql")),
];

/// The number of connections for verbs.
const CONNECTIONS: u32 = 8;
/// The number of connections that may scan all results at the same time.
const SCANS: usize = 3;
/// The number of connections that may read large results at the same time.
const LARGE: usize = 2;

impl Database {
    pub(in crate::store) async fn open(
        url: &DatabaseUrl,
        options: &Options,
        signals: Arc<Signals>,
    ) -> Result<Self, Error> {
        let mut db = prepare(url).await?;
        let program = library::program(&Program::this(), &mut db).await?;
        db.close().await?;
        let Options { queue_limit, pin_quota, budget, lease, .. } = *options;
        let (closing, closed) = watch::channel(false);
        let database = Self(Arc::new(Parts {
            pool: Pool::new(url.options(), CONNECTIONS),
            renewals: Pool::new(url.hasty(lease / 3), 1),
            contact: Contact::new(lease),
            scans: Semaphore::new(SCANS),
            large: Semaphore::new(LARGE),
            signals,
            hints: Arc::default(),
            node: Node { id: JobId::generate().to_string(), program, lease },
            backlog: Backlog::new(queue_limit),
            pin_quota: PinQuota::new(pin_quota, budget),
            name: url.to_string(),
            refusal: OnceLock::new(),
            disk: options.disk.clone(),
            closing,
        }));
        node::start(&database, url, options, &closed);
        Ok(database)
    }
}

/// Connects to a database, and creates or migrates its tables where necessary.
pub(in crate::store) async fn prepare(url: &DatabaseUrl) -> Result<PgConnection, Error> {
    let mut db = url.patient().connect().await?;
    // Servers that start at the same time wait for each other.
    let lock = |call| sqlx::query(call).bind(Lock::Schema as i64);
    lock("SELECT pg_advisory_lock($1)").execute(&mut db).await?;
    migrate(&mut db, url).await?;
    lock("SELECT pg_advisory_unlock($1)").execute(&mut db).await?;
    match refusal(&mut db, &url.to_string()).await? {
        None => Ok(db),
        Some(error) => Err(error),
    }
}

/// Why this program may not write the tables; `None` if it may.
pub(super) async fn refusal(db: &mut PgConnection, name: &str) -> Result<Option<Error>, Error> {
    let (known, ..) = CHANGES[CHANGES.len() - 1];
    let found: Option<i64> = sqlx::query_scalar(
        "SELECT (SELECT max(version) FROM _sqlx_migrations) FROM upkeep WHERE oldest > $1",
    )
    .bind(known)
    .fetch_optional(db)
    .await?;
    Ok(found.map(|found| Error::Newer { path: name.into(), found, known }))
}

async fn migrate(db: &mut PgConnection, url: &DatabaseUrl) -> Result<(), Error> {
    let migration = |(version, name, sql): (_, &'static str, &'static str)| {
        Migration::new(version, name.into(), MigrationType::Simple, sql.into_sql_str(), false)
    };
    let mut migrator = Migrator::with_migrations(CHANGES.map(migration).into());
    // A later version of the program may run beside this one, unless the tables say otherwise.
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
        let mut files: Vec<_> = fs::read_dir("migrations/postgres")
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
