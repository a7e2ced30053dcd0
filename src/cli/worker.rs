//! `fretwork worker`: computes the runs of servers that share a database.

use std::collections::BTreeMap;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;

use futures_util::future::OptionFuture;

use super::listening::{greeting, listen};
use super::printing::Error;
use super::signals::ShutdownSignals;
use crate::config::Worker;
use crate::http;
use crate::service::workers::Workers;
use crate::service::{Service, WorkLimits, processors};
use crate::telemetry::Logging;
use fretwork_job::Task;
use fretwork_store::{Options, Place, Store};

/// Starts worker threads on a store, one per processor by default. Returns the service that they share with clients.
pub fn start(
    store: &Store,
    threads: Option<u16>,
    limits: WorkLimits,
) -> io::Result<(Service, Workers)> {
    let count = threads.map_or_else(processors, usize::from);
    let service = Service::new(store.clone(), Arc::new(Task::start), count, limits);
    let workers = Workers::start(store, count, limits, &service.compute())?;
    Ok((service, workers))
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
    let (lease, settle) = (settings.lease, settings.crash_pause);
    let options = Options { lease, settle, ..Options::default() };
    let store = Store::open(place.clone(), &options).await?;
    let (service, workers) = start(&store, settings.workers, settings.limits())?;
    tracing::info!(%place, workers = service.workers(), "working");
    if let Some(listener) = &listener {
        greet_monitors(&settings.logging, listener.local_addr()?);
    }
    // Monitors get answers until the process ends.
    let monitored = service.clone();
    let monitoring = listener.map(|listener| http::serve_monitoring(listener, monitored));
    let time_is_up = OptionFuture::from(settings.until.map(tokio::time::sleep));
    let work = async {
        let idle = async {
            // Until then, the worker may pass over all that is left.
            tokio::time::sleep(settings.crash_pause).await;
            workers.idle_for(settings.idle_exit).await;
        };
        tokio::select! {
            () = signals.next() => tracing::info!("draining; a second signal stops at once"),
            Some(()) = time_is_up => tracing::info!("draining after the time of --until"),
            () = idle => tracing::info!("nothing to compute"),
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
        Some(()) = OptionFuture::from(monitoring) => {}
    }
    Ok(())
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
