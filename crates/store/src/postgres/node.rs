//! The background tasks of a server: receive and send notifications, renew leases, revoke expired leases, wake waiting
//! clients and workers, and maintenance.

use std::sync::{Arc, Weak};
use std::time::Duration;

use sqlx::Executor as _;
use sqlx::postgres::{PgListener, PgPoolOptions};
use tokio::sync::watch;
use tokio::time::{self, Instant, MissedTickBehavior, timeout};

use super::lease;
use super::maintenance::Maintenance;
use super::transaction::reading;
use super::{Database, Parts, hints, schema};
use crate::database::{DatabaseUrl, Error, Options, Result, Signals};

/// The queue is counted at this interval, for the metrics and the limit of the queue.
const COUNT: Duration = Duration::from_secs(1);
/// After this time without a notification, the connection is tested. This is also the timeout of the test.
const SILENCE: Duration = Duration::from_secs(20);
/// Maximum pause after an error, before leases are renewed, notifications are sent or the listener is connected again.
const PAUSE: Duration = Duration::from_millis(500);
/// Interval between two rounds of maintenance.
const MAINTENANCE: Duration = Duration::from_secs(2);

/// Starts all tasks. They end when the database is closed or dropped.
pub(super) fn start(
    db: &Database,
    url: &DatabaseUrl,
    options: &Options,
    closed: &watch::Receiver<bool>,
) {
    let (signals, node) = (Arc::clone(&db.0.signals), &db.0.node.id);
    spawn(closed, listen(url.clone(), signals, node.clone()));
    spawn(closed, tell(Arc::downgrade(&db.0), Arc::clone(&db.0.hints), node.clone()));
    let maintenance = Box::new(Maintenance::new(options));
    for (every, chore) in [
        (COUNT, Chore::Count),
        (db.0.node.renewal(), Chore::Renew),
        (options.lease / 6, Chore::Reclaim),
        (options.poll, Chore::Look),
        (MAINTENANCE, Chore::Maintenance(maintenance)),
    ] {
        spawn(closed, repeat(every, chore, Arc::downgrade(&db.0)));
    }
}

/// A periodic task of a server.
enum Chore {
    /// Checks whether this program may still write the tables, and counts the queue.
    Count,
    /// Renews the leases of the workers of this process.
    Renew,
    /// Revokes expired leases.
    Reclaim,
    /// Wakes waiting clients and workers, which read the tables again.
    Look,
    Maintenance(Box<Maintenance>),
}

impl Chore {
    async fn execute(&mut self, db: &Database) -> Result<()> {
        match self {
            Self::Count => {
                db.check_version().await?;
                db.longest_wait().await?;
            }
            Self::Renew => db.renew().await?,
            Self::Reclaim => drop(db.reclaim(false).await?),
            Self::Look => db.0.signals.wake(),
            Self::Maintenance(maintenance) => maintenance.round(db).await?,
        }
        Ok(())
    }
}

#[expect(clippy::disallowed_methods, reason = "the task ends with the database")]
fn spawn(closed: &watch::Receiver<bool>, task: impl Future<Output = ()> + Send + 'static) {
    let mut closed = closed.clone();
    tokio::spawn(async move {
        tokio::select! {
            // This is an error if the database was dropped.
            _ = closed.wait_for(|closed| *closed) => {}
            () = task => {}
        }
    });
}

/// Executes a chore periodically. Logs only the first one of consecutive errors.
async fn repeat(every: Duration, mut chore: Chore, db: Weak<Parts>) {
    let mut ticks = time::interval_at(Instant::now() + every, every);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut failed = false;
    loop {
        ticks.tick().await;
        let Some(parts) = db.upgrade() else { return };
        let done = chore.execute(&Database(parts)).await;
        if let Err(error) = &done
            && !failed
        {
            let error = error as &dyn std::error::Error;
            tracing::warn!(error, "a task in the background failed; it will be tried again");
        }
        failed = done.is_err();
        if failed && matches!(chore, Chore::Renew) {
            // Other servers wait for half of a lease before they revoke one. The next attempts must be within this time.
            ticks.reset_after(PAUSE.min(every / 4));
        }
    }
}

/// Sends hints to the other servers. A lost hint does no harm, because the other servers also read periodically.
async fn tell(db: Weak<Parts>, hints: Arc<hints::Hints>, node: String) {
    loop {
        let text = hints.next(&node).await;
        let Some(parts) = db.upgrade() else { return };
        let sent = reading!(&Database(parts), db => hints::send(db, &text).await);
        if sent.is_err() {
            time::sleep(PAUSE).await;
        }
    }
}

/// Receives notifications of other servers, and signals them in this process.
async fn listen(url: DatabaseUrl, signals: Arc<Signals>, node: String) {
    loop {
        let Ok(mut listener) = connect(&url).await else {
            time::sleep(PAUSE).await;
            continue;
        };
        // Notifications from before the connection are lost.
        signals.was_deaf();
        while let Ok(told) = next(&mut listener).await {
            signals.apply(told.map_or_else(Vec::new, |told| hints::read(&told, &node)));
        }
    }
}

/// Connects a listener. When its connection breaks, the listener reports an error and does not reconnect by itself. So
/// the caller notices that notifications may be lost.
async fn connect(url: &DatabaseUrl) -> Result<PgListener> {
    // The listener has its own pool, because a broken listener may hold its connection for a long time.
    let pool = PgPoolOptions::new().max_connections(1).connect_lazy_with(url.listening());
    let connecting = async {
        let mut listener = PgListener::connect_with(&pool).await?;
        listener.eager_reconnect(false);
        listener.listen(hints::CHANNEL).await?;
        Ok(listener)
    };
    timeout(SILENCE, connecting).await.unwrap_or(Err(Error::Exhausted))
}

/// The next notification; `None` if none arrived in the time [`SILENCE`]. Then this has tested the connection. Fails if
/// the connection is broken.
async fn next(listener: &mut PgListener) -> Result<Option<String>> {
    match timeout(SILENCE, listener.try_recv()).await {
        Ok(told) => told?.map(|told| Some(told.payload().to_owned())).ok_or(Error::Exhausted),
        Err(_) => match timeout(SILENCE, listener.execute("SELECT 1")).await {
            Ok(answered) => Ok(answered.map(|_| None)?),
            Err(_) => Err(Error::Exhausted),
        },
    }
}

impl Database {
    /// Checks whether a later version of the program has forbidden this version to write.
    async fn check_version(&self) -> Result<()> {
        let refusal = reading!(self, db => schema::refusal(db, &self.0.name).await)?;
        if let Some(refusal) = refusal
            && self.0.refusal.set(refusal.clone()).is_ok()
        {
            let error = &refusal as &dyn std::error::Error;
            tracing::error!(error, "this program stops writing; replace it by the later version");
        }
        Ok(())
    }

    /// Renews the leases of the workers of this process, and stops the workers that have lost their leases. Uses a
    /// separate connection, so that it never waits for requests of clients.
    async fn renew(&self) -> Result<()> {
        // A server that may not store results must let its leases expire, so that another server computes the runs.
        self.may_write()?;
        let running = self.0.signals.running();
        let parts: Vec<_> = running.iter().map(|(part, _)| *part).collect();
        let renewing =
            async { reading!(self, renewals, db => lease::renew(db, &self.0.node, &parts).await) };
        let renewed = timeout(self.0.node.renewal(), renewing).await;
        let (now, kept) =
            renewed.unwrap_or(Err(Error::Exhausted)).inspect_err(|_| self.0.contact.ends())?;
        self.0.contact.goes_on(now);
        let lost: Vec<_> = running.into_iter().filter(|(part, _)| !kept.contains(part)).collect();
        self.0.signals.stop(&lost);
        Ok(())
    }
}
