//! `fretwork serve`: connects the parts of the program, serves, and drains at a signal.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io;
use std::net::SocketAddr;
use std::pin::pin;
use std::time::Duration;

use clap::ArgMatches;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::time;

use super::administration;
use super::listening::{greeting, listen, reachable};
use super::printing::{Error, print};
use super::signals::ShutdownSignals;
use super::worker;
use crate::config::{self, Serve};
use crate::http::{self, Secret};
use crate::telemetry::Logging;
use fretwork_store::{Place, Recovered, Store};

/// How long connections may stay open after the last run has ended. Together with the drain time it is shorter
/// than the 10 s after which service managers kill a process.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);

/// How long runs may take to stop after a second signal: a few steps of about 30 ms.
const STOP_TIMEOUT: Duration = Duration::from_millis(300);

/// Serves until a signal.
pub fn serve(settings: &Serve, matches: &ArgMatches) -> Result<(), Error> {
    if settings.print_config {
        return print(config::described(matches).as_bytes());
    }
    let admin_key = settings.admin_key()?;
    settings.logging.start();
    // Two threads are enough, because requests and the runs that they compute themselves are short. Other runs have their own
    // threads.
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .max_blocking_threads(8)
        .enable_all()
        .build()?
        .block_on(serve_until_signal(settings, admin_key))
}

/// Raises the soft limit of open files to the hard one. Returns the number of connections that it allows.
#[cfg(unix)]
fn allow_open_files(connections: u32) -> u32 {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    /// Number of open files besides the admitted connections: displaced connections, the database, its readers and the
    /// log.
    const OTHERS: u64 = 512;
    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    let raised = setrlimit(Resource::Nofile, Rlimit { current: maximum, maximum });
    let limit = if raised.is_ok() { maximum } else { current };
    let wanted = u64::from(connections) + OTHERS;
    let Some(limit) = limit.filter(|limit| *limit < wanted) else { return connections };
    let allowed = (limit - OTHERS.min(limit / 4)) as u32;
    tracing::warn!(limit, wanted, allowed, "--connections needs a higher limit of open files");
    allowed
}

#[cfg(not(unix))]
fn allow_open_files(connections: u32) -> u32 {
    connections
}

async fn serve_until_signal(settings: &Serve, admin_key: Option<Secret>) -> Result<(), Error> {
    let mut signals = ShutdownSignals::new()?;
    let connections = allow_open_files(settings.connections);
    let place = settings.place()?;
    let store = Store::open(place.clone(), &settings.storage()).await?;
    let listener = listen(settings.listen, "--listen")?;
    let address = listener.local_addr()?;
    let umbridge = settings.umbridge_listen.map(|address| listen(address, "--umbridge-listen"));
    let umbridge = umbridge.transpose()?;
    let umbridge_address = umbridge.as_ref().map(TcpListener::local_addr).transpose()?;
    let requires_key = requires_key(settings, admin_key.is_some(), &place, &store).await?;
    // A server with a shared database recovers the runs of dead servers later, when it has been connected to the
    // database for a while.
    let recovered = match place {
        Place::Directory(_) => store.recover().await?,
        Place::Shared(_) => Recovered::default(),
    };
    tracing::info!(?recovered, %place, "opened the database");
    let (service, workers) = worker::start(&store, settings.workers, settings.limits())?;
    let (close, closed) = oneshot::channel::<()>();
    let mut interface = settings.interface(admin_key);
    interface.connections.total = connections as usize;
    let server = http::serve(listener, umbridge, service.clone(), &interface, async {
        let _ = closed.await;
    });
    let mut server = pin!(server);
    tracing::info!(%address, "listening");
    // Standard output may be closed. The server does not need it.
    let greeted = greet(&settings.logging, address, umbridge_address, &place, requires_key);
    if let Err(error) = greeted {
        tracing::warn!(%error, "cannot print the greeting");
    }

    tokio::select! {
        () = signals.next() => {}
        () = &mut server => {}
    }
    tracing::info!("draining; a second signal stops at once");
    service.drain();
    let drain = async {
        // Clients can read states and results until the last run has ended.
        let close_connections = async {
            workers.drain(settings.drain_seconds).await;
            let _ = close.send(());
            // A client that keeps its connection open must not keep the process alive.
            time::sleep(CLOSE_TIMEOUT).await;
        };
        tokio::select! {
            () = &mut server => {}
            () = close_connections => {}
        }
        store.close().await;
    };
    tokio::select! {
        () = drain => tracing::info!("drained"),
        () = signals.next() => {
            // The drain has asked the workers to stop. A run that does not stop in time is interrupted.
            time::sleep(STOP_TIMEOUT).await;
            let _ = time::timeout(STOP_TIMEOUT, store.close()).await;
            tracing::warn!("stopped; interrupted runs start again at the next start");
        }
    }
    Ok(())
}

/// Whether callers must send an access key. If other machines can reach the server and there is no key yet, this makes
/// the first key.
async fn requires_key(
    settings: &Serve,
    admin_key: bool,
    place: &Place,
    store: &Store,
) -> Result<bool, Error> {
    let keys = store.access_keys().await?;
    if settings.no_auth {
        if !keys.is_empty() {
            tracing::warn!("access keys exist, but --no-auth gives every caller full access");
        }
    } else if admin_key || !keys.is_empty() {
        return Ok(true);
    } else if settings.is_reachable() {
        administration::add_first_key(place, &settings.logging).await?;
        return Ok(true);
    } else if settings.auth_header.is_some() {
        return Ok(true);
    }
    // Without keys, the browser of a user is enough to use the server.
    if settings.cors_origins.iter().any(|origin| origin == "*") {
        tracing::warn!(
            "--cors-origin '*' without access keys: every web page that a user of this machine opens can read and \
             change everything; name the origins of your pages, or add a key with `fretwork keys add`"
        );
    }
    Ok(false)
}

/// Prints the address of the server and a command to try it.
fn greet(
    logging: &Logging,
    address: SocketAddr,
    umbridge: Option<SocketAddr>,
    place: &Place,
    requires_key: bool,
) -> io::Result<()> {
    let base = format!("http://{}", reachable(address));
    // One line of JSON, quoted for a shell.
    let example: String = http::EXAMPLES[0].body.lines().map(str::trim).collect();
    let body = example.replace('\'', "'\\''");
    let message = greeting(address);
    let mut details = BTreeMap::from([
        ("dashboard", format!("{base}/")),
        ("documentation", format!("{base}/docs/")),
        ("data", place.to_string()),
    ]);
    let mut text =
        format!("{message}\ndashboard: {base}/   documentation: {base}/docs/   data: {place}\n");
    if let Some(address) = umbridge {
        let address = format!("http://{}", reachable(address));
        let _ = writeln!(text, "UM-Bridge alone: {address}");
        details.insert("umbridge", address);
    }
    let (hint, key) = if requires_key {
        (", with your key in FRETWORK_KEY", " -H \"Authorization: Bearer $FRETWORK_KEY\"")
    } else {
        ("", "")
    };
    let _ = writeln!(
        text,
        "\nTry it{hint}:\n\ncurl -sS '{base}/v1/jobs?include=result'{key} -H 'Content-Type: application/json' \
         -H 'Prefer: wait=10' -d '{body}'\n"
    );
    logging.announce(&text, &message, &details)
}
