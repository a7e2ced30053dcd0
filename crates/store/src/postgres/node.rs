//! What a server does in the background: it listens, tells, renews its leases, takes lost ones away, and looks by itself.

use std::sync::{Arc, Weak};
use std::time::Duration;

use sqlx::Executor as _;
use sqlx::postgres::{PgListener, PgPoolOptions};
use tokio::sync::watch;
use tokio::time::{self, Instant, MissedTickBehavior, timeout};

use super::lease;
use super::transaction::reading;
use super::upkeep::Upkeep;
use super::{Database, Parts, hints, schema};
use crate::error::Error;
use crate::options::Options;
use crate::place::DatabaseUrl;
use crate::signals::Signals;

/// How often the queue is counted, for the metrics and the limit of the queue.
const COUNT: Duration = Duration::from_secs(1);
/// How often waiting clients and workers read the tables again without a signal.
const POLL: Duration = Duration::from_secs(5);
/// After this time without a notification, the connection is tested. The test must end as soon.
const SILENCE: Duration = Duration::from_secs(20);
/// Longest pause after an error, before leases are renewed, notifications sent, or the listener connected again.
const PAUSE: Duration = Duration::from_millis(500);
/// How often maintenance is due.
const UPKEEP: Duration = Duration::from_secs(2);

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
    let upkeep = Box::new(Upkeep::new(options));
    for (every, chore) in [
        (COUNT, Chore::Count),
        (db.0.node.renewal(), Chore::Renew),
        (options.lease / 6, Chore::Reclaim),
        (POLL, Chore::Look),
        (UPKEEP, Chore::Upkeep(upkeep)),
    ] {
        spawn(closed, repeat(every, chore, Arc::downgrade(&db.0)));
    }
}

/// What a server does again and again.
enum Chore {
    /// Looks whether this program may still write, and counts the queue for the metrics.
    Count,
    /// Renews the leases of its workers.
    Renew,
    /// Takes lost leases away.
    Reclaim,
    /// Lets waiting clients and workers read the tables without a signal.
    Look,
    Upkeep(Box<Upkeep>),
}

impl Chore {
    async fn execute(&mut self, db: &Database) -> Result<(), Error> {
        match self {
            Self::Count => {
                db.check_version().await?;
                db.longest_wait().await?;
            }
            Self::Renew => db.renew().await?,
            Self::Reclaim => drop(db.reclaim(false).await?),
            Self::Look => db.0.signals.wake(),
            Self::Upkeep(upkeep) => upkeep.round(db).await?,
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

/// Does a chore again and again. Logs the first of several errors.
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
            ticks.reset_after(PAUSE.min(every));
        }
    }
}

/// Sends hints to the other servers. If that fails, they look by themselves.
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

/// Signals what other servers tell.
async fn listen(url: DatabaseUrl, signals: Arc<Signals>, node: String) {
    loop {
        let Ok(mut listener) = connect(&url).await else {
            time::sleep(PAUSE).await;
            continue;
        };
        // What was told before is lost.
        signals.was_deaf();
        while let Ok(told) = next(&mut listener).await {
            signals.apply(told.map_or_else(Vec::new, |told| hints::read(&told, &node)));
        }
    }
}

/// Connects a listener. When its connection breaks, it reports an error instead of connecting again by itself, so that the
/// caller knows that it has missed notifications.
async fn connect(url: &DatabaseUrl) -> Result<PgListener, Error> {
    // A pool of its own: a broken listener returns its connection only when the system notices.
    let pool = PgPoolOptions::new().max_connections(1).connect_lazy_with(url.listening());
    let connecting = async {
        let mut listener = PgListener::connect_with(&pool).await?;
        listener.eager_reconnect(false);
        listener.listen(hints::CHANNEL).await?;
        Ok(listener)
    };
    timeout(SILENCE, connecting).await.unwrap_or(Err(Error::Exhausted))
}

/// The next notification; `None` if there was none for a while. Fails if the connection is broken, also if that was silent.
async fn next(listener: &mut PgListener) -> Result<Option<String>, Error> {
    match timeout(SILENCE, listener.try_recv()).await {
        Ok(told) => told?.map(|told| Some(told.payload().to_owned())).ok_or(Error::Exhausted),
        Err(_) => match timeout(SILENCE, listener.execute("SELECT 1")).await {
            Ok(answered) => Ok(answered.map(|_| None)?),
            Err(_) => Err(Error::Exhausted),
        },
    }
}

impl Database {
    /// Looks whether a later program has taken the right to write from this one.
    async fn check_version(&self) -> Result<(), Error> {
        let refusal = reading!(self, db => schema::refusal(db, &self.0.name).await)?;
        if let Some(refusal) = refusal
            && self.0.refusal.set(refusal.clone()).is_ok()
        {
            let error = &refusal as &dyn std::error::Error;
            tracing::error!(error, "this program stops writing; replace it by the later version");
        }
        Ok(())
    }

    /// Renews the leases of what the workers of this process compute, and stops those that have lost theirs. Has a connection
    /// of its own, so that it never waits for clients.
    async fn renew(&self) -> Result<(), Error> {
        // What a server cannot store, another one must compute.
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
