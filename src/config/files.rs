//! The settings of the commands that write and read files of results and whole databases.

use std::path::PathBuf;

use clap::Args;

use super::data::Data;
use fretwork_job::Key;
use fretwork_store::Search;

/// What the help of `export` shows.
pub const EXAMPLES: &str = "\
Examples:
  fretwork export all.db                                    all results
  fretwork export cones.db shape=cone friction=0.6..0.8     the results that GET /v1/results lists
  fretwork export one.db --key 7262301e...                  one result, by its whole key";

/// What the help of `check` shows.
pub const CHECK_EXAMPLES: &str = "\
Examples:
  fretwork check                               the database in ./data
  fretwork check --data-dir /var/lib/fretwork  exit code 0: sound; 2: damaged rows, which are named";

/// The settings of `export`.
#[derive(Debug, Args)]
pub struct Export {
    /// The file to write; it must not exist.
    pub file: PathBuf,
    /// A condition, such as shape=cone or wear_depth=..2um.
    #[arg(value_name = "NAME=VALUE", value_parser = condition, conflicts_with = "keys")]
    pub conditions: Vec<(String, String)>,
    /// The key of a result. Repeat the option for more results.
    #[arg(long = "key", value_name = "KEY")]
    pub keys: Vec<Key>,
    /// The database that contains the results.
    #[command(flatten)]
    pub data: Data,
}

/// The settings of `import`.
#[derive(Debug, Args)]
pub struct Import {
    /// The file that `export` wrote.
    pub file: PathBuf,
    /// How many results to compute anew, chosen at random; all if there are fewer. If one differs, all further ones are
    /// computed anew. Results that earlier versions of the engine computed cannot be computed anew.
    #[arg(long, value_name = "COUNT", default_value_t = 100)]
    pub verify: u64,
    /// The database that receives the results.
    #[command(flatten)]
    pub data: Data,
}

/// The settings of `backup`.
#[derive(Debug, Args)]
pub struct Backup {
    /// The file to write; it must not exist.
    pub file: PathBuf,
    /// The database to copy.
    #[command(flatten)]
    pub data: Data,
}

/// The settings of `restore`.
#[derive(Debug, Args)]
pub struct Restore {
    /// The file that `backup` wrote.
    pub file: PathBuf,
    /// Replace an existing database. It is kept under another name in the same directory.
    #[arg(long)]
    pub replace: bool,
    /// The database to replace.
    #[command(flatten)]
    pub data: Data,
}

/// Parses NAME=VALUE.
fn condition(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE, such as shape=cone")?;
    // Reports a bad condition before any file is opened.
    Search::default().set(name, value).map_err(|fault| format!("{name} {fault}"))?;
    Ok((name.to_owned(), value.to_owned()))
}
