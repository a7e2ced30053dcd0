//! The command `run`: computes one job without a server.

use std::fs;
use std::io::{self, IsTerminal as _, Read as _, Write as _};
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use serde::Deserialize;
use serde_json::Value;

use super::parts;
use super::printing::{Error, print, print_error};
use super::study;
use crate::config::Run;
use fretwork_engine::request::fault::Fault;
use fretwork_format::{self as format, Format, Part, View};
use fretwork_job::{Answer, Prepared, Submission, Task, TaskKind};
use fretwork_json::BadBody;

/// Minimum time between two updates of the progress on a terminal.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(500);

/// Computes one job body. The exit code is 2 if the body is invalid.
pub fn run(settings: &Run) -> Result<ExitCode, Error> {
    let joined = settings.join.as_deref().map(parts::join).transpose()?;
    let text = match (&joined, &settings.file) {
        (Some(joined), _) => joined.body.clone(),
        (None, file) => read(file.as_deref().unwrap_or(Path::new("-")))?,
    };
    let job = match Submission::parse(&text) {
        Ok(job) => job,
        Err(BadBody::Faults(faults)) => return Ok(print_faults(&faults)),
        Err(error) => {
            print_error(&error);
            return Ok(ExitCode::from(2));
        }
    };
    if let (Some(part), Some(store)) = (settings.part, &settings.store) {
        return parts::compute(&job, &text, part, store);
    }
    let (answer, time) = match &joined {
        Some(joined) => joined.answer(&job.prepared)?,
        None => compute(&job.prepared)?,
    };
    write_result(&answer, job.prepared.task.kind(), settings)?;
    if let Some(file) = &settings.plot {
        let mut figure = Vec::new();
        let view = View::figure(settings.quantity);
        format::write(&mut figure, &answer.body, Part::Plot, Format::Svg, &view)?;
        write_file(file, &figure)?;
    }
    summarise(&job, &answer, time)?;
    Ok(ExitCode::SUCCESS)
}

/// Reads a file, or standard input.
pub fn read(file: &Path) -> Result<Vec<u8>, Error> {
    let mut text = Vec::new();
    let is_file = file.as_os_str() != "-";
    let read =
        if is_file { fs::read(file) } else { io::stdin().read_to_end(&mut text).map(|_| text) };
    read.map_err(|error| format!("cannot read {}: {error}", file.display()).into())
}

/// Computes the result. Shows the progress if standard error is a terminal.
pub fn compute(prepared: &Prepared) -> Result<(Answer, Duration), Error> {
    let started = Instant::now();
    if let Task::Study(study) = &prepared.task {
        let answer = Answer::of_study(prepared.key, study, &study::compute(study)?);
        return Ok((answer, started.elapsed()));
    }
    let mut shown = None;
    let mut err = io::stderr();
    let answer = prepared.compute(|progress| {
        if err.is_terminal() && shown.unwrap_or(started).elapsed() > PROGRESS_INTERVAL {
            shown = Some(Instant::now());
            // Progress is optional: an error here does not stop the run.
            let _ = write!(err, "\r{:4.0} %", progress * 100.0);
        }
    });
    if shown.is_some() {
        write!(err, "\r      \r")?;
    }
    Ok((answer, started.elapsed()))
}

/// Writes the result to the output file or to standard output.
fn write_result(answer: &Answer, kind: TaskKind, settings: &Run) -> Result<(), Error> {
    let format = *settings.format;
    let part = match (format, kind) {
        (Format::Json | Format::Npz, _) => Part::Whole,
        (_, TaskKind::Run) => Part::History,
        (_, TaskKind::Study(_)) => Part::Table,
    };
    let mut bytes = Vec::new();
    format::write(&mut bytes, &answer.body, part, format, &View::default())?;
    if format == Format::Json {
        bytes.push(b'\n');
    }
    write_output(settings, &bytes)
}

/// The units of a result.
#[derive(Deserialize)]
struct Units {
    units: Value,
}

/// Prints a summary of the result and the warnings to standard error.
fn summarise(job: &Submission, answer: &Answer, time: Duration) -> Result<(), Error> {
    let mut err = io::stderr().lock();
    let label = job.label.as_deref().unwrap_or("computed");
    writeln!(err, "{label} ({:.1} ms)", time.as_secs_f64() * 1e3)?;
    // The result of a study can be large, so only its units are kept.
    let Units { units } = serde_json::from_slice(&answer.body)?;
    for (name, value) in answer.summary.as_object().into_iter().flatten() {
        let shown = match value.as_f64() {
            Some(number) => format!("{number:>12.5e}"),
            None => format!("{:>12}", value.as_str().unwrap_or("-")),
        };
        let unit = units[name].as_str().filter(|unit| *unit != "1").unwrap_or("");
        writeln!(err, "  {name:<20} {}", format!("{shown} {unit}").trim_end())?;
    }
    for warning in job.prepared.warnings() {
        writeln!(err, "  warning: {}", warning.detail)?;
    }
    Ok(())
}

/// Prints the faults of a body to standard error. Returns the exit code of a body that is not valid.
pub fn print_faults(faults: &[Fault]) -> ExitCode {
    for fault in faults {
        // If standard error is closed, the exit code still reports the faults.
        let _ = writeln!(io::stderr(), "{}: {}", fault.pointer, fault.detail);
    }
    ExitCode::from(2)
}

/// Writes to the output file, or to standard output.
fn write_output(settings: &Run, bytes: &[u8]) -> Result<(), Error> {
    let is_binary = matches!(*settings.format, Format::Npz | Format::Arrow);
    match &settings.output {
        Some(file) => write_file(file, bytes),
        None if is_binary && io::stdout().is_terminal() => Err(
            "the requested format is binary, not for a terminal: write it to a file with --output"
                .into(),
        ),
        None => print(bytes),
    }
}

/// Writes a file.
fn write_file(file: &Path, bytes: &[u8]) -> Result<(), Error> {
    fs::write(file, bytes)
        .map_err(|error| format!("cannot write {}: {error}", file.display()).into())
}
