//! Logs to standard error, as text or as JSON.

use std::io::IsTerminal as _;

use clap::ValueEnum;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::LevelFilter;

/// The format of a log line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// Text for people.
    Text,
    /// One JSON object per line, for machines.
    Json,
}

/// Starts logging. `FRETWORK_LOG` sets the level (`info`, `warn`, `fretwork=debug`, …).
pub fn start(format: LogFormat) {
    let filter = EnvFilter::builder()
        .with_env_var("FRETWORK_LOG")
        .with_default_directive(LevelFilter::INFO.into())
        .from_env_lossy();
    let logs = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal());
    match format {
        LogFormat::Text => logs.init(),
        LogFormat::Json => logs.json().flatten_event(true).init(),
    }
    // A panic becomes a log entry in the same format, with the request that caused it.
    std::panic::set_hook(Box::new(|panic| tracing::error!(%panic, "panicked")));
}
