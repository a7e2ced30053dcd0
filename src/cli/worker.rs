//! `fretwork worker`: computes the runs of servers that share a database.

use std::collections::BTreeMap;
use std::future;
use std::net::SocketAddr;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use super::listening::{greeting, listen};
use super::printing::Error;
use super::signals::ShutdownSignals;
use crate::config::Worker;
use crate::http;
use crate::service::Service;
use crate::service::workers::Workers;
use crate::telemetry::Logging;
use fretwork_job::Task;
use fretwork_store::{Options, Place, Store};

/// The number of worker threads: the number in the settings, or one per processor.
pub fn worker_threads(set: Option<u16>) -> usize {
    set.map_or_else(|| thread::available_parallelism().map_or(1, usize::from), usize::from)
}

/// Computes the runs of other servers until a signal.
pub fn work(settings: &Worker) -> Result<(), Error> {
    let place = settings.data.place()?;
    if matches!(place, Place::Directory(_)) {
        return Err("a worker needs --database: it takes its runs from a PostgreSQL database that servers share".into());
    }
    settings.logging.start();
    // Two threads are enough, because runs have their own threads.
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()?
        .block_on(work_until_signal(settings, &place))
}

async fn work_until_signal(settings: &Worker, place: &Place) -> Result<(), Error> {
    let mut signals = ShutdownSignals::new()?;
    let listener = settings.listen.map(|address| listen(address, "--listen")).transpose()?;
    // A worker deletes nothing to free disk space. The servers do that, by their own limits.
    let store =
        Store::open(place.clone(), &Options { lease: settings.lease, ..Options::default() })
            .await?;
    let count = worker_threads(settings.workers);
    let service = Service::new(store.clone(), Arc::new(Task::start), count, settings.limits());
    let workers = Workers::start(&store, count, settings.limits(), &service.compute())?;
    tracing::info!(%place, workers = count, "working");
    if let Some(listener) = &listener {
        greet_monitors(&settings.logging, listener.local_addr()?);
    }
    let monitored = service.clone();
    // Monitors get answers until the process ends.
    let monitoring = async {
        match listener {
            Some(listener) => http::serve_monitoring(listener, monitored).await,
            None => future::pending().await,
        }
    };
    let work = async {
        tokio::select! {
            () = signals.next() => tracing::info!("draining; a second signal stops at once"),
            () = passed(settings.until) => tracing::info!("draining after the time of --until"),
            () = workers.idle_for(settings.idle_exit) => tracing::info!("nothing to compute"),
        }
        service.drain();
        let drain = async {
            workers.drain(settings.drain_seconds).await;
            store.close().await;
        };
        tokio::select! {
            () = drain => tracing::info!("drained"),
            () = signals.next() => {
                tracing::warn!("stopped; other workers compute the interrupted runs again");
            }
        }
    };
    tokio::select! {
        () = work => {}
        () = monitoring => {}
    }
    Ok(())
}

/// Waits for this time, or forever.
async fn passed(time: Option<Duration>) {
    match time {
        Some(time) => tokio::time::sleep(time).await,
        None => future::pending().await,
    }
}

/// Prints the address at which a worker answers monitors.
fn greet_monitors(logging: &Logging, address: SocketAddr) {
    let message = format!("{} for monitors", greeting(address));
    let text = format!("{message}\n");
    // Standard output may be closed. The worker does not need it.
    if let Err(error) = logging.announce(&text, &message, &BTreeMap::new()) {
        tracing::warn!(%error, "cannot print the greeting");
    }
}
