//! Where the database of a command is.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::http::Secret;
use fretwork_store::{DatabaseUrl, Place};

/// The database of a command.
#[derive(Debug, Clone, Args)]
pub struct Data {
    /// The directory of the database; created if it is missing.
    #[arg(long, env = "FRETWORK_DATA_DIR", default_value = "data", value_name = "DIR")]
    pub data_dir: PathBuf,
    /// Instead of a directory, the address of a PostgreSQL database that several servers share, such as
    /// postgres://user:password@host/name. Prefer the environment variable, because other users can see the command line.
    #[arg(long, env = "FRETWORK_DATABASE", hide_env_values = true, value_name = "URL")]
    pub database: Option<Secret>,
}

impl Data {
    /// Where the database is.
    pub fn place(&self) -> Result<Place, String> {
        match &self.database {
            None => Ok(Place::Directory(self.data_dir.clone())),
            Some(Secret(url)) => {
                let url = url.parse::<DatabaseUrl>();
                url.map(Place::Shared).map_err(|error| format!("--database: {error}"))
            }
        }
    }

    /// The directory of the database. A PostgreSQL database has none. The error then says what the user can do
    /// `instead`.
    pub fn directory(&self, instead: &str) -> Result<&Path, String> {
        match self.database {
            None => Ok(&self.data_dir),
            Some(_) => Err(format!(
                "this command needs a data directory, but --database names a PostgreSQL database: {instead}"
            )),
        }
    }
}
