//! The settings of the commands that talk to a server.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;

use super::run::{Destination, ScenarioChange};
use super::values::resolve;
use crate::http::Secret;

/// The server of a command.
#[derive(Debug, Args)]
pub struct Remote {
    /// Base address of the server, http:// or https:// [default: the address in `FRETWORK_LISTEN`, on this machine].
    /// SSL_CERT_FILE names the certificates of an own authority.
    #[arg(long, env = "FRETWORK_URL")]
    pub url: Option<String>,
    /// Address of the server if no URL is given.
    #[arg(long, env = "FRETWORK_LISTEN", hide = true, default_value = "127.0.0.1:8080",
        value_parser = resolve)]
    pub listen: SocketAddr,
    /// An access key, which goes to the server of --url. Prefer the environment variable, because other users can see the command
    /// line.
    #[arg(long, env = "FRETWORK_KEY", hide_env_values = true)]
    pub key: Option<Secret>,
    /// A file with an access key, which applies without `--key`.
    #[arg(long, env = "FRETWORK_KEY_FILE", value_name = "FILE")]
    pub key_file: Option<PathBuf>,
}

/// The settings of `submit`.
#[derive(Debug, Args)]
pub struct Submit {
    /// Input files, or directories of them; - reads standard input.
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// The changes of the scenario.
    #[command(flatten)]
    pub change: ScenarioChange,
    /// Wait until all jobs have ended.
    #[arg(long)]
    pub wait: bool,
    /// The server.
    #[command(flatten)]
    pub server: Remote,
}

/// The settings of `get`.
#[derive(Debug, Args)]
pub struct Get {
    /// The key of the result.
    #[arg(value_name = "KEY")]
    pub key_of_result: String,
    /// Where the result goes, and how.
    #[command(flatten)]
    pub output: Destination,
    /// The server.
    #[command(flatten)]
    pub server: Remote,
}

/// The settings of `watch` and `cancel`.
#[derive(Debug, Args)]
pub struct OneJob {
    /// The id of the job.
    pub id: String,
    /// The server.
    #[command(flatten)]
    pub server: Remote,
}

/// The settings of `list`.
#[derive(Debug, Args)]
pub struct List {
    /// Largest number of jobs.
    #[arg(long, default_value_t = 50)]
    pub limit: u16,
    /// The server.
    #[command(flatten)]
    pub server: Remote,
}

/// The settings of `evaluate`.
#[derive(Debug, Args)]
pub struct Evaluate {
    /// Input file; - reads standard input.
    pub file: PathBuf,
    /// The outputs, separated by commas, if the file names none.
    #[arg(long, value_name = "NAMES", value_delimiter = ',',
        default_values = ["wear_volume", "wear_depth"])]
    pub outputs: Vec<String>,
    /// The changes of the scenario.
    #[command(flatten)]
    pub change: ScenarioChange,
    /// The server.
    #[command(flatten)]
    pub server: Remote,
}
