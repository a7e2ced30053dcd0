//! The command line: commands, options and environment variables.

mod data;
mod files;
mod fit;
mod keys;
mod remote;
mod report;
mod run;
mod server;
mod values;
mod worker;

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{CommandFactory as _, Parser, Subcommand};

pub use data::Data;
pub use files::{Backup, Export, Import, Restore};
pub use fit::Fit;
pub use keys::{AddKey, Keys};
pub use remote::{Evaluate, Get, List, OneJob, Remote, Submit};
pub use report::Report;
pub use run::{Destination, Run, ScenarioChange, StudyPart};
pub use server::{Serve, described};
pub use worker::Worker;

/// The examples that the help of a command shows.
macro_rules! examples {
    ($command:literal) => {
        include_str!(concat!("examples/", $command, ".txt")).trim_ascii_end()
    };
}

/// Fretting wear of round and line contacts, as a service with a result cache.
///
/// Without a command, the server starts. `fretwork serve --help` lists its options.
#[derive(Debug, Parser)]
#[command(version, args_conflicts_with_subcommands = true, after_help = examples!("fretwork"))]
pub struct Cli {
    /// The command; `serve` by default.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// The options of `serve` if no command is given.
    #[command(flatten)]
    pub serve: Serve,
}

/// The command line. The help of the program shows its commands, that of `serve` the options of the server.
pub fn command() -> clap::Command {
    Cli::command().mut_args(|option| option.hide(true))
}

/// A command.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Start the server (the default).
    #[command(after_help = examples!("serve"))]
    Serve(Box<Serve>),
    /// Compute the runs of other servers.
    ///
    /// The servers share a PostgreSQL database. A worker answers no requests of clients. Start any number of workers on any number of machines, beside servers with the same --database.
    #[command(after_help = examples!("worker"))]
    Worker(Box<Worker>),
    /// Compute input files, without a server or a database.
    ///
    /// An input file is a job, or a scenario alone. The result goes to standard output or to a file, and a summary to
    /// standard error. Several files are computed on all cores, and have one line each, in their order. A file that is invalid or
    /// cannot be read does not stop the others.
    ///
    /// If a file is invalid, each fault is printed as `file: pointer: detail`, and the exit code is 2. It is 1 after any other
    /// error. Of several, the largest counts.
    Run(Run),
    /// Fit a scenario to measured numbers, without a server.
    ///
    /// Prints what was read, the estimates with their intervals, and measured and predicted numbers with the band of a new
    /// test. A row without a measured number is predicted too.
    #[command(after_help = examples!("fit"))]
    Fit(Fit),
    /// Write the report of a result, or a comparison of runs, as HTML.
    #[command(after_help = examples!("report"))]
    Report(Report),
    /// Submit input files to a server.
    ///
    /// Prints the id, the state and the key of each job.
    ///
    /// The exit code is 0 if all jobs were accepted (with --wait: if all succeeded), 2 if a file has faults, 3 if a job
    /// failed, 4 if a job was canceled, and 1 for any other error. Of several, the largest counts.
    #[command(after_help = examples!("submit"))]
    Submit(Submit),
    /// Print a result of a server, or write it to a file.
    Get(Get),
    /// Wait for the end of a job.
    ///
    /// The exit codes are those of `submit --wait`.
    Watch(OneJob),
    /// List the jobs of a server, the newest first.
    List(List),
    /// Cancel a job.
    Cancel(OneJob),
    /// Compute a scenario on a server at once.
    ///
    /// The server stores nothing. The command prints the answer as JSON.
    Evaluate(Evaluate),
    /// Print the completions of a shell.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Write the manual pages to a directory.
    Man {
        /// The directory.
        #[arg(value_parser = values::file_name)]
        directory: PathBuf,
    },
    /// Print the OpenAPI document of the server.
    Openapi,
    /// Compare computed numbers with the same numbers from other sources.
    ///
    /// Prints a page in Markdown. Each check has its reference, the computed value, the error and the accepted
    /// error. The exit code is 1 if a check fails. The command takes some seconds and needs no server.
    #[command(after_help = examples!("verify"))]
    Verify {
        /// Instead, print the table of volumes from which the error of the simplified rule follows.
        #[arg(long)]
        exact_volumes: bool,
        /// Instead, compare this number of random runs with fine ones. 500 take about half a minute.
        #[arg(long, value_name = "COUNT", conflicts_with = "exact_volumes")]
        random: Option<NonZeroUsize>,
    },
    /// Check a server's health: exit code 0 or 1.
    Health(Remote),
    /// List what is wrong, or soon will be, with a running server.
    ///
    /// Asks the server at its public address for its version, TLS, the headers of its proxy, readiness, disk, damage, the last backup
    /// and the clocks. Each line begins with `ok`, `warns` or `fails`, and says what to do. The exit code is 0, 1 or 2, after the
    /// worst line. Ask each server and worker in turn. A server with keys needs one with the role `read`.
    Doctor(Remote),
    /// Write results to a file that another server can import.
    ///
    /// The server may run meanwhile. Exports all results, or those that match every NAME=VALUE (as in
    /// GET /v1/results), or those with the given keys.
    #[command(after_help = examples!("export"))]
    Export(Export),
    /// Import the results of an exported file, or the JSON of one result.
    ///
    /// The server may run meanwhile, and serves the imported results at once. The command computes every result again, on all
    /// cores, and refuses what differs. Results of earlier versions of the engine, and runs that take longer than
    /// --verify-time, are stored unverified: only the form of their tables is checked. The provenance of a result says so. The
    /// command overwrites nothing. It imports the note of a result that has no note yet. It does not import pins. Refused
    /// results are printed to standard error; the exit code is then 2. An interrupted import continues when it is
    /// started again.
    #[command(after_help = examples!("import"))]
    Import(Import),
    /// Search the database for damage, and name the rows.
    ///
    /// The server may run meanwhile. The command compares every index with its table, every result with its checksum, and what
    /// lists and search show with the stored results. Damaged rows are printed to standard error: table, key, column. The exit
    /// code is then 2.
    #[command(after_help = examples!("check"))]
    Check {
        /// Write numbers and words that contradict a sound result again, and delete nothing. Stop the server first. The
        /// database as it was is kept beside it, as fretwork.unrepaired-TIME.db.
        #[arg(long)]
        repair: bool,
        /// The database to check.
        #[command(flatten)]
        data: Data,
    },
    /// Copy the whole database to a file, and check the copy.
    ///
    /// The server may run meanwhile. The copy is a snapshot. If a stored result is damaged, the copy has only its scenario, and the
    /// exit code is 2.
    #[command(after_help = examples!("backup"))]
    Backup(Backup),
    /// Replace the database with a backup. Stop the server first.
    Restore(Restore),
    /// Add, list and revoke access keys.
    ///
    /// Once there is a key, the server requires a key from every caller. A running server applies changes within
    /// a second.
    #[command(subcommand, after_help = examples!("keys"))]
    Keys(Keys),
    /// Print who used keys, and who deleted what.
    ///
    /// Equal acts of one day (UTC) share a line. The last 100 000 lines are kept.
    Audit(Data),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_definition_is_valid() {
        command().debug_assert();
    }

    #[test]
    fn the_short_help_fits_on_a_screen_and_shows_no_option_of_the_server() {
        let help = command().term_width(80).render_help().to_string();
        assert!(help.lines().count() <= 40, "{help}");
        assert!(!help.contains("--listen <") && help.contains("  submit "), "{help}");
    }

    #[test]
    fn the_options_of_the_server_work_with_and_without_serve() {
        for words in [&["fretwork", "--workers", "3"][..], &["fretwork", "serve", "--workers", "3"]]
        {
            let cli = Cli::try_parse_from(words).unwrap();
            let serve = match cli.command {
                Some(Command::Serve(serve)) => *serve,
                _ => cli.serve,
            };
            assert_eq!(serve.workers, Some(3));
        }
    }
}
