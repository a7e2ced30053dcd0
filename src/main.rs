//! The program: parses the command line, wires the rooms together, serves and drains.

mod cli;
mod config;
mod telemetry;

use std::fs;
use std::io::{self, IsTerminal as _, Read as _, Write as _};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpStream};
use std::pin::pin;
use std::process::ExitCode;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use axum::http::Uri;
use axum::http::uri::Authority;
use clap::{ArgMatches, CommandFactory as _, FromArgMatches as _};
use fretwork::format::{self, Format, Part, Quantity, View};
use fretwork::http::{self, IdleTimeout, Peer};
use fretwork::job::{Answer, BadSubmission, Prepared, Submission, Task};
use fretwork::service::workers::Workers;
use fretwork::service::{self, Service};
use fretwork::store::Store;
use fretwork::verification;
use serde_json::Value;
use tokio::net::TcpListener;
use tokio::sync::watch;

use cli::{Failure, complain, say};
use config::{Cli, Command, Health, Run, Serve};

/// How long connections may stay open when everything else has ended. With the time to drain it stays
/// below the ten seconds after which service managers kill.
const HANG_UP: Duration = Duration::from_secs(2);

/// How long runs have to let go when a second signal stops the server at once: some steps.
const LET_GO: Duration = Duration::from_millis(300);

/// How long a connection may stand still; requests wait for a minute at most.
const STILL: Duration = Duration::from_mins(2);

fn main() -> ExitCode {
    let matches = Cli::command().get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    // What people take elsewhere is theirs to guard.
    if !matches!(cli.command, Some(Command::Run(_) | Command::Export(_))) {
        keep_to_oneself();
    }
    let done = match cli.command {
        None => serve(&cli.serve, &matches),
        Some(Command::Serve(settings)) => {
            serve(&settings, matches.subcommand_matches("serve").unwrap_or(&matches))
        }
        Some(Command::Run(settings)) => return run(&settings),
        Some(Command::Openapi) => say(&http::document()),
        Some(Command::Verify) => verify(),
        Some(Command::Health(settings)) => health(&settings),
        Some(Command::Keys(command)) => cli::administration::keys(command),
        Some(Command::Export(settings)) => cli::moving::export(&settings),
        Some(Command::Import(settings)) => return cli::moving::import(&settings),
        Some(Command::Backup(settings)) => cli::moving::backup(&settings),
        Some(Command::Restore(settings)) => cli::moving::restore(&settings),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            complain(failure.as_ref());
            ExitCode::FAILURE
        }
    }
}

/// Lets files that are made from now on be read by nobody else: they hold the jobs of all, and what
/// links are signed with.
fn keep_to_oneself() {
    #[cfg(unix)]
    rustix::process::umask(rustix::fs::Mode::from_raw_mode(0o077));
}

fn serve(settings: &Serve, matches: &ArgMatches) -> Result<(), Failure> {
    if settings.print_config {
        return say(config::described(matches).as_bytes());
    }
    settings.check()?;
    telemetry::start(settings.log_format);
    // Requests are short; computing has threads of its own.
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .max_blocking_threads(8)
        .enable_all()
        .build()?
        .block_on(serve_until_told(settings))
}

async fn serve_until_told(settings: &Serve) -> Result<(), Failure> {
    let mut told = Signals::new()?;
    let store = Store::open(&settings.data_dir, &settings.storage()).await?;
    let keys = store.access_keys().await?;
    let asks = !settings.no_auth && (settings.admin_key.is_some() || !keys.is_empty());
    if !settings.listen.ip().is_loopback() && !settings.no_auth && !asks {
        return Err(format!(
            "{} can be reached from other machines, and there are no keys to tell callers apart; make \
             one with `fretwork keys add NAME --role admin --data-dir {}`, or set FRETWORK_ADMIN_KEY, \
             or listen on 127.0.0.1, or add --no-auth if everyone who reaches it may do everything",
            settings.listen,
            settings.data_dir.display(),
        )
        .into());
    }
    if settings.no_auth && !keys.is_empty() {
        tracing::warn!("there are keys, but nobody is asked for one (--no-auth)");
    }
    let listener = TcpListener::bind(settings.listen).await.map_err(|error| {
        format!("cannot listen on {}: {error}; choose another with --listen", settings.listen)
    })?;
    let address = listener.local_addr()?;
    let recovered = store.recover().await?;
    tracing::info!(?recovered, "opened the data directory");
    let count = settings
        .workers
        .map_or_else(|| thread::available_parallelism().map_or(1, usize::from), usize::from);
    let service = Service::new(store.clone(), Arc::new(Task::start), count, settings.limit());
    let workers = Workers::start(&store, count, settings.limit(), &service.compute())?;
    let (close, mut closed) = watch::channel(false);
    let router = http::router(service.clone(), &settings.interface());
    let connections = router.into_make_service_with_connect_info::<Peer>();
    let listener = IdleTimeout { listener, timeout: STILL };
    let mut shut = closed.clone();
    let server = axum::serve(listener, connections).with_graceful_shutdown(async move {
        let _ = shut.wait_for(|shut| *shut).await;
    });
    let mut server = pin!(server.into_future());
    tracing::info!(%address, "listening");
    // The greeting is for people: a server serves without anyone who reads it.
    if let Err(error) = greet(address, settings, asks) {
        tracing::warn!(%error, "nobody reads the greeting");
    }

    tokio::select! {
        () = told.next() => {}
        ended = &mut server => ended?,
    }
    tracing::info!("draining; a second signal stops at once");
    service.drain();
    let calmly = async {
        let computing = async {
            workers.drain(settings.drain_seconds).await;
            close.send_replace(true);
        };
        // States and results can be read until the last computation has ended.
        let answering = async {
            // A client that does not hang up must not keep the process.
            let impatient = async {
                let _ = closed.wait_for(|closed| *closed).await;
                tokio::time::sleep(HANG_UP).await;
            };
            tokio::select! {
                _ = &mut server => {}
                () = impatient => {}
            }
        };
        tokio::join!(computing, answering);
        store.close().await;
    };
    tokio::select! {
        () = calmly => tracing::info!("drained"),
        () = told.next() => {
            // The workers have been told to let go; those that do not lose their run.
            tokio::time::sleep(LET_GO).await;
            let _ = tokio::time::timeout(LET_GO, store.close()).await;
            tracing::warn!("stopped; what was running begins anew after the start");
        }
    }
    Ok(())
}

/// The two ways of asking a process to end: SIGTERM and ctrl-c.
struct Signals {
    #[cfg(unix)]
    terminate: tokio::signal::unix::Signal,
}

impl Signals {
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

/// Says where the server is, and one line to try it with.
fn greet(address: SocketAddr, settings: &Serve, asks: bool) -> io::Result<()> {
    let base = format!("http://{}", reachable(address));
    let example = http::EXAMPLES.first().map_or("{}", |example| example.body);
    // Within single quotes of a shell.
    let body = compact(example).replace('\'', "'\\''");
    let mut out = io::stdout().lock();
    writeln!(out, "fretwork {} listens on {base}", env!("CARGO_PKG_VERSION"))?;
    writeln!(
        out,
        "dashboard: {base}/   documentation: {base}/docs/   data: {}",
        settings.data_dir.display()
    )?;
    let (hint, key) = if asks {
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

/// JSON on one line, its members in their order.
fn compact(json: &str) -> String {
    json.lines().map(str::trim).collect()
}

/// The address under which this machine itself reaches a listener.
fn reachable(mut address: SocketAddr) -> SocketAddr {
    if address.ip().is_unspecified() {
        address.set_ip(IpAddr::V4(Ipv4Addr::LOCALHOST));
    }
    address
}

/// Computes one job body; the exit code is 2 if it has faults.
fn run(settings: &Run) -> ExitCode {
    let mut err = io::stderr().lock();
    let job = match read(settings) {
        Ok(text) => Submission::parse(&text),
        Err(error) => {
            let _ = writeln!(err, "fretwork: cannot read {}: {error}", settings.file.display());
            return ExitCode::FAILURE;
        }
    };
    let job = match job {
        Ok(job) => job,
        Err(BadSubmission::Faults(faults)) => {
            for fault in faults {
                let _ = writeln!(err, "{}: {}", fault.pointer, fault.detail);
            }
            return ExitCode::from(2);
        }
        Err(unsound) => {
            drop(err);
            complain(&unsound);
            return ExitCode::from(2);
        }
    };
    drop(err);
    match compute(&job.prepared).and_then(|(answer, time)| {
        print(&answer, settings)?;
        draw(&answer, settings)?;
        summarise(&job, &answer, time)
    }) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            complain(failure.as_ref());
            ExitCode::FAILURE
        }
    }
}

fn read(settings: &Run) -> io::Result<Vec<u8>> {
    if settings.file.as_os_str() == "-" {
        let mut text = Vec::new();
        io::stdin().read_to_end(&mut text)?;
        return Ok(text);
    }
    fs::read(&settings.file)
}

fn compute(prepared: &Prepared) -> Result<(Answer, Duration), Failure> {
    let started = Instant::now();
    let mut shown = None;
    let mut err = io::stderr();
    let answer = service::evaluate(prepared, |progress| {
        let last = shown.unwrap_or(started);
        if err.is_terminal() && last.elapsed() > Duration::from_millis(500) {
            shown = Some(Instant::now());
            // A progress that cannot be shown does not stop the run.
            let _ = write!(err, "\r{:4.0} %", progress * 100.0);
        }
    });
    if shown.is_some() {
        write!(err, "\r      \r")?;
    }
    Ok((answer, started.elapsed()))
}

/// Writes the result where it is wanted.
fn print(answer: &Answer, settings: &Run) -> Result<(), Failure> {
    let (part, format) = settings.format.form();
    let mut bytes = Vec::new();
    format::write(&mut bytes, &answer.body, part, format, &View::default())?;
    if format == Format::Json {
        bytes.push(b'\n');
    }
    match &settings.output {
        Some(file) => fs::write(file, bytes)
            .map_err(|error| format!("cannot write {}: {error}", file.display()).into()),
        None if matches!(format, Format::Npz | Format::Arrow) && io::stdout().is_terminal() => {
            Err("this is no text for a terminal; give it a file with --output".into())
        }
        None => say(&bytes),
    }
}

/// Draws the result where a figure of it is wanted.
fn draw(answer: &Answer, settings: &Run) -> Result<(), Failure> {
    let Some(file) = &settings.plot else { return Ok(()) };
    let view = Quantity::named(&settings.quantity).map(View::figure).unwrap_or_default();
    let mut figure = Vec::new();
    format::write(&mut figure, &answer.body, Part::Plot, Format::Svg, &view)?;
    fs::write(file, figure)
        .map_err(|error| format!("cannot write {}: {error}", file.display()).into())
}

/// A few lines for people: what was computed, what came out, what to know about it.
fn summarise(job: &Submission, answer: &Answer, time: Duration) -> Result<(), Failure> {
    let mut err = io::stderr().lock();
    let label = job.label.as_deref().unwrap_or("computed");
    writeln!(err, "{label} ({:.1} ms)", time.as_secs_f64() * 1e3)?;
    let units: Value = serde_json::from_slice::<Value>(&answer.body)?["units"].take();
    for (name, value) in answer.summary.as_object().into_iter().flatten() {
        let unit = units[name].as_str().filter(|unit| *unit != "1").unwrap_or_default();
        let shown = match value.as_f64() {
            Some(number) => format!("{number:>12.5e} {unit}"),
            None => format!("{:>12}", value.as_str().unwrap_or_default()),
        };
        writeln!(err, "  {name:<20} {}", shown.trim_end())?;
    }
    for warning in &job.prepared.warnings {
        writeln!(err, "  warning: {}", warning.detail)?;
    }
    Ok(())
}

/// Prints the verification page; that a check fails is an error.
fn verify() -> Result<(), Failure> {
    let page = verification::page();
    say(page.to_string().as_bytes())?;
    match page.failures().count() {
        0 => Ok(()),
        1 => Err("1 check fails".into()),
        failed => Err(format!("{failed} checks fail").into()),
    }
}

/// Asks a server whether it is well, in the simplest HTTP there is.
fn health(settings: &Health) -> Result<(), Failure> {
    let patience = Duration::from_secs(5);
    let (host, path) = match &settings.url {
        None => (reachable(settings.listen).to_string(), "/healthz".to_owned()),
        Some(url) => {
            let url: Uri = url.parse().map_err(|error| format!("{url} is no URL: {error}"))?;
            if url.scheme_str() != Some("http") {
                return Err("the URL must begin with http://".into());
            }
            let path = if url.path() == "/" { "/healthz" } else { url.path() };
            let host = url.authority().map_or("", Authority::as_str);
            (host.to_owned(), path.to_owned())
        }
    };
    let has_port = host.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
    let named = if has_port { host.clone() } else { format!("{host}:80") };
    let mut found = std::net::ToSocketAddrs::to_socket_addrs(&named)
        .map_err(|error| format!("cannot find {host}: {error}"))?;
    let address = found.next().ok_or_else(|| format!("cannot find {host}"))?;
    let mut connection = TcpStream::connect_timeout(&address, patience)
        .map_err(|error| format!("no server answers at {host}: {error}"))?;
    connection.set_read_timeout(Some(patience))?;
    write!(connection, "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n")?;
    let mut answer = Vec::new();
    connection.take(1 << 16).read_to_end(&mut answer)?;
    let answer = String::from_utf8_lossy(&answer);
    let status = answer.lines().next().unwrap_or_default();
    if status.split(' ').nth(1) != Some("200") {
        return Err(format!("the server at {host} answers \"{status}\"").into());
    }
    say(b"ok\n")
}
