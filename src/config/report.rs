//! The settings of `report`.

use std::path::PathBuf;

use clap::Args;

use super::values::file_name;

/// The settings of `report`.
#[derive(Debug, Args)]
pub struct Report {
    /// Results in JSON, as `run` and `get` write them. Of several runs, the report compares the others with the first;
    /// - reads standard input.
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// A file of numbers that were measured in the test of the run, over cycles or dissipated energy, such as CSV; may be
    /// repeated. The report compares the run with them.
    #[arg(long, value_name = "FILE")]
    pub measured: Vec<PathBuf>,
    /// Output file, or a directory [default: standard output].
    #[arg(short = 'o', long = "output", value_name = "FILE.html", value_parser = file_name)]
    pub file: Option<PathBuf>,
    /// The units of numbers: um, mm^3, MPa and mJ, or si.
    #[arg(long, value_parser = ["engineering", "si"], default_value = "engineering")]
    pub units: String,
}
