//! The program: parses the command line, connects the rooms, serves and drains.

mod cli;
mod config;
mod telemetry;

use std::future;
use std::io::{self, Write as _};
use std::net::SocketAddr;
use std::pin::pin;
use std::process::ExitCode;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use clap::{ArgMatches, CommandFactory as _, FromArgMatches as _};
use fretwork::http::{self, AdminKey};
use fretwork::job::Task;
use fretwork::service::Service;
use fretwork::service::workers::Workers;
use fretwork::store::{Options, Place, Recovered, Store};
use fretwork::verification::{self, Accuracy};
use fretwork_engine::simulation::model_error;
use mimalloc::MiMalloc;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::time;

use cli::{Error, print, print_error, reachable};
use config::{Cli, Command, Serve, Worker};

/// Requests and results are many short allocations, freed by other threads than those that made them.
#[global_allocator]
static ALLOCATOR: MiMalloc = MiMalloc;

/// How long connections may stay open after the last run has ended. Together with the drain time it is shorter
/// than the 10 s after which service managers kill a process.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);

/// How long runs may take to stop after a second signal: a few steps of about 30 ms.
const STOP_TIMEOUT: Duration = Duration::from_millis(300);

/// The seed of the random scenarios on the verification page.
const SEED: u64 = 16;

fn main() -> ExitCode {
    let matches = Cli::command().get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    // The files of these two commands are made to be shared.
    if !matches!(cli.command, Some(Command::Run(_) | Command::Export(_))) {
        restrict_permissions();
    }
    let success = |()| ExitCode::SUCCESS;
    let done = match cli.command {
        None => serve(&cli.serve, &matches).map(success),
        Some(Command::Serve(settings)) => {
            let matches = matches.subcommand_matches("serve").unwrap_or(&matches);
            serve(&settings, matches).map(success)
        }
        Some(Command::Worker(settings)) => work(&settings).map(success),
        Some(Command::Run(settings)) => cli::run::run(&settings),
        Some(Command::Openapi) => print(&http::document()).map(success),
        Some(Command::Verify { exact_volumes: true, .. }) => {
            print(model_error::exact_volumes().as_bytes()).map(success)
        }
        Some(Command::Verify { random: Some(count), .. }) => {
            let accuracy = Accuracy::measured(count.get(), SEED);
            print(accuracy.to_string().as_bytes()).map(success)
        }
        Some(Command::Verify { .. }) => verify().map(success),
        Some(Command::Health(settings)) => cli::health::health(&settings).map(success),
        Some(Command::Keys(command)) => cli::administration::keys(command).map(success),
        Some(Command::Audit(data)) => cli::administration::audit(&data).map(success),
        Some(Command::Export(settings)) => cli::moving::export(&settings).map(success),
        Some(Command::Import(settings)) => cli::moving::import(&settings),
        Some(Command::Backup(settings)) => cli::moving::backup(&settings),
        Some(Command::Restore(settings)) => cli::moving::restore(&settings),
    };
    done.unwrap_or_else(|error| {
        print_error(error.as_ref());
        ExitCode::FAILURE
    })
}

/// Makes new files readable for their owner only. They contain the jobs of all users and the key that signs links.
fn restrict_permissions() {
    #[cfg(unix)]
    rustix::process::umask(rustix::fs::Mode::from_raw_mode(0o077));
}

/// Raises the soft limit of open files to the hard one. Returns the number of connections that it allows.
#[cfg(unix)]
fn allow_open_files(connections: u32) -> u32 {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    /// Files besides the connections: displaced connections, the database, its readers and the log.
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

fn serve(settings: &Serve, matches: &ArgMatches) -> Result<(), Error> {
    if settings.print_config {
        return print(config::described(matches).as_bytes());
    }
    let admin_key = settings.admin_key()?;
    settings.logging.start();
    // Two threads are enough, because requests are short and runs have their own threads.
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .max_blocking_threads(8)
        .enable_all()
        .build()?
        .block_on(serve_until_signal(settings, admin_key))
}

/// The number of worker threads: as set, or one per processor.
fn worker_threads(set: Option<u16>) -> usize {
    set.map_or_else(|| thread::available_parallelism().map_or(1, usize::from), usize::from)
}

/// Computes the runs of other servers until a signal.
fn work(settings: &Worker) -> Result<(), Error> {
    let place = settings.data.place()?;
    if matches!(place, Place::Directory(_)) {
        return Err("a worker needs --database: servers share only a PostgreSQL database".into());
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
    // A worker deletes nothing to make room. The servers do, by their own limits.
    let store =
        Store::open(place, &Options { lease: settings.lease, ..Options::default() }).await?;
    let count = worker_threads(settings.workers);
    let service = Service::new(store.clone(), Arc::new(Task::start), count, settings.limits());
    let workers = Workers::start(&store, count, settings.limits(), &service.compute())?;
    tracing::info!(%place, workers = count, "working");
    if let Some(listener) = &listener {
        greet_monitors(listener.local_addr()?);
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
        signals.next().await;
        tracing::info!("draining; a second signal stops at once");
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

async fn serve_until_signal(settings: &Serve, admin_key: Option<AdminKey>) -> Result<(), Error> {
    let mut signals = ShutdownSignals::new()?;
    let connections = allow_open_files(settings.connections);
    let place = settings.place()?;
    let store = Store::open(&place, &settings.storage()).await?;
    let listener = listen(settings.listen, "--listen")?;
    let address = listener.local_addr()?;
    let umbridge = settings.umbridge_listen.map(|address| listen(address, "--umbridge-listen"));
    let umbridge = umbridge.transpose()?;
    let umbridge_address = umbridge.as_ref().map(TcpListener::local_addr).transpose()?;
    let requires_key = requires_key(settings, admin_key.is_some(), &place, &store).await?;
    // Servers that share a database recover the work of dead ones when they have been in contact with it for a while.
    let recovered = match place {
        Place::Directory(_) => store.recover().await?,
        Place::Shared(_) => Recovered::default(),
    };
    tracing::info!(?recovered, %place, "opened the database");
    let count = worker_threads(settings.workers);
    let service = Service::new(store.clone(), Arc::new(Task::start), count, settings.limits());
    let workers = Workers::start(&store, count, settings.limits(), &service.compute())?;
    let (close, closed) = oneshot::channel::<()>();
    let mut interface = settings.interface(admin_key);
    interface.connections.total = connections as usize;
    let sockets = http::Sockets { api: listener, umbridge };
    let server = http::serve(sockets, service.clone(), &interface, async {
        let _ = closed.await;
    });
    let mut server = pin!(server);
    tracing::info!(%address, "listening");
    // Standard output may be closed. The server does not need it.
    if let Err(error) = greet(address, umbridge_address, &place, requires_key) {
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
            // The drain has asked the workers to stop. A run that is too slow is lost.
            time::sleep(STOP_TIMEOUT).await;
            let _ = time::timeout(STOP_TIMEOUT, store.close()).await;
            tracing::warn!("stopped; interrupted runs start again at the next start");
        }
    }
    Ok(())
}

fn listen(address: SocketAddr, option: &str) -> Result<TcpListener, Error> {
    http::listen(address).map_err(|error| {
        format!("cannot listen on {address}: {error}; choose another with {option}").into()
    })
}

/// Whether callers must send an access key. A server that other machines can reach makes the first key.
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
        warn_of_open_origins(settings);
        return Ok(false);
    }
    if admin_key || !keys.is_empty() {
        return Ok(true);
    }
    if !settings.is_reachable() {
        warn_of_open_origins(settings);
        return Ok(false);
    }
    cli::administration::add_first_key(place).await?;
    Ok(true)
}

/// Without keys, the browser of a user is enough to use the server.
fn warn_of_open_origins(settings: &Serve) {
    if settings.cors_origins.iter().any(|origin| origin == "*") {
        tracing::warn!(
            "--cors-origin '*' without access keys: every web page that a user of this machine opens can read and \
             change everything; name the origins of your pages, or add a key with `fretwork keys add`"
        );
    }
}

/// The signals that end the process: SIGTERM and Ctrl-C.
struct ShutdownSignals {
    #[cfg(unix)]
    terminate: tokio::signal::unix::Signal,
}

impl ShutdownSignals {
    fn new() -> io::Result<Self> {
        Ok(Self {
            #[cfg(unix)]
            terminate: tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())?,
        })
    }

    async fn next(&mut self) {
        #[cfg(unix)]
        tokio::select! {
            _ = tokio::signal::ctrl_c() => {}
            _ = self.terminate.recv() => {}
        }
        #[cfg(not(unix))]
        let _ = tokio::signal::ctrl_c().await;
    }
}

/// Prints the address at which a worker answers monitors.
fn greet_monitors(address: SocketAddr) {
    let line = format!("{} for monitors\n", greeting(address));
    // Standard output may be closed. The worker does not need it.
    if let Err(error) = print(line.as_bytes()) {
        tracing::warn!(error, "cannot print the greeting");
    }
}

fn greeting(address: SocketAddr) -> String {
    format!("fretwork {} listens on http://{}", env!("CARGO_PKG_VERSION"), reachable(address))
}

/// Prints the address of the server and a command to try it.
fn greet(
    address: SocketAddr,
    umbridge: Option<SocketAddr>,
    place: &Place,
    requires_key: bool,
) -> io::Result<()> {
    let base = format!("http://{}", reachable(address));
    // One line of JSON, quoted for a shell.
    let example: String = http::EXAMPLES[0].body.lines().map(str::trim).collect();
    let body = example.replace('\'', "'\\''");
    let mut out = io::stdout().lock();
    writeln!(out, "{}", greeting(address))?;
    writeln!(out, "dashboard: {base}/   documentation: {base}/docs/   data: {place}")?;
    if let Some(address) = umbridge {
        writeln!(out, "UM-Bridge alone: http://{}", reachable(address))?;
    }
    let (hint, key) = if requires_key {
        (", with your key in FRETWORK_KEY", " -H \"Authorization: Bearer $FRETWORK_KEY\"")
    } else {
        ("", "")
    };
    writeln!(out, "\nTry it{hint}:\n")?;
    writeln!(
        out,
        "curl -sS '{base}/v1/jobs?include=result'{key} -H 'Content-Type: application/json' \
         -H 'Prefer: wait=10' -d '{body}'\n"
    )?;
    out.flush()
}

/// Prints the verification page. A failed check is an error.
fn verify() -> Result<(), Error> {
    let page = verification::page();
    print(page.to_string().as_bytes())?;
    match page.failures().count() {
        0 => Ok(()),
        1 => Err("1 check fails".into()),
        failed => Err(format!("{failed} checks fail").into()),
    }
}
