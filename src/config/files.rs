//! The settings of the commands that write and read files of results and whole databases.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::data::Data;
use super::values::duration;
use fretwork_job::Key;
use fretwork_store::Search;

/// The settings of `export`.
#[derive(Debug, Args)]
pub struct Export {
    /// The file to write, which must not exist; - for standard output.
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
    /// The file that `export` wrote, or the JSON of one result that `run` wrote; - for standard input.
    pub file: PathBuf,
    /// Longest processor time to compute one result again. Of a study that takes longer, as many random rows are
    /// computed again as this time allows. A run that takes longer is stored unverified. 0 verifies nothing.
    #[arg(long, value_name = "TIME", value_parser = duration, default_value = "10min")]
    pub verify_time: Duration,
    /// The database that receives the results.
    #[command(flatten)]
    pub data: Data,
}

/// The settings of `backup`.
#[derive(Debug, Args)]
pub struct Backup {
    /// The file to write, which must not exist; a directory, in which the file gets the time as its name; or - for standard output.
    pub file: PathBuf,
    /// Keep this number of backups in the directory, which each database needs for itself. Deletes the oldest others after a backup of a
    /// sound database.
    #[arg(long, value_name = "COUNT")]
    pub keep: Option<NonZeroUsize>,
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
