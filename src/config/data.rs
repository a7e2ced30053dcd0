//! Where the database of a command is.

use std::convert::Infallible;
use std::fmt;
use std::path::{Path, PathBuf};

use clap::Args;

use fretwork_store::{DatabaseUrl, Place};

/// The database of a command.
#[derive(Debug, Clone, Args)]
pub struct Data {
    /// The directory of the database; created if it is missing.
    #[arg(long, env = "FRETWORK_DATA_DIR", default_value = "data", value_name = "DIR")]
    pub data_dir: PathBuf,
    /// Instead of a directory, the address of a PostgreSQL database that several servers share, such as
    /// postgres://user:password@host/name. Prefer the environment variable, because other users can see the command line.
    #[arg(long, env = "FRETWORK_DATABASE", hide_env_values = true, value_name = "URL",
        value_parser = database)]
    pub database: Option<DatabaseText>,
}

/// The address of a database as it was given. It may contain a password.
#[derive(Clone)]
pub struct DatabaseText(String);

impl fmt::Debug for DatabaseText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("(not shown)")
    }
}

impl Data {
    /// Where the database is.
    pub fn place(&self) -> Result<Place, String> {
        match &self.database {
            None => Ok(Place::Directory(self.data_dir.clone())),
            Some(DatabaseText(url)) => {
                let url = url.parse::<DatabaseUrl>();
                url.map(Place::Shared).map_err(|error| format!("--database: {error}"))
            }
        }
    }

    /// The directory of the database. A database of PostgreSQL has none, and `instead` says what to do with it.
    pub fn directory(&self, instead: &str) -> Result<&Path, String> {
        match self.database {
            None => Ok(&self.data_dir),
            Some(_) => Err(format!("--database names a PostgreSQL database: {instead}")),
        }
    }
}

/// Accepts any text, because an error of clap would print the password. [`Data::place`] checks it.
#[expect(clippy::unnecessary_wraps, reason = "clap requires this signature")]
fn database(text: &str) -> Result<DatabaseText, Infallible> {
    Ok(DatabaseText(text.to_owned()))
}
