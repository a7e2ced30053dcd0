//! What the command `run` prints and writes.

use std::fs;
use std::io::{self, IsTerminal as _, Write as _};
use std::path::Path;
use std::process::ExitCode;

use fretwork_engine::request::fault::Fault;

use super::printing::{Error, print};
use crate::config::Run;
use fretwork_format::Format;

/// Prints the faults of a body to standard error. Returns the exit code of a body that is not valid.
pub fn print_faults(faults: &[Fault]) -> ExitCode {
    for fault in faults {
        // If standard error is closed, the exit code still reports the faults.
        let _ = writeln!(io::stderr(), "{}: {}", fault.pointer, fault.detail);
    }
    ExitCode::from(2)
}

/// Writes to the output file, or to standard output.
pub fn write_output(settings: &Run, bytes: &[u8]) -> Result<(), Error> {
    let is_binary = matches!(*settings.format, Format::Npz | Format::Arrow);
    match &settings.output {
        Some(file) => write_file(file, bytes),
        None if is_binary && io::stdout().is_terminal() => {
            Err("this format is binary: write it to a file with --output".into())
        }
        None => print(bytes),
    }
}

/// Writes a file.
pub fn write_file(file: &Path, bytes: &[u8]) -> Result<(), Error> {
    fs::write(file, bytes)
        .map_err(|error| format!("cannot write {}: {error}", file.display()).into())
}
