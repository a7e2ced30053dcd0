//! The command `run`: computes jobs without a server.

use std::fs::{self, File};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::Deserialize;
use serde_json::{Value, json};

use super::parts;
use super::places::{self, inside};
use super::printing::{Ended, Error, Progress, print, print_error, shown};
use super::study;
use crate::config::{Destination, Run, ScenarioChange};
use crate::http::report_page;
use fretwork_engine::Faults;
use fretwork_engine::outcome::Quantity;
use fretwork_format::report::{self, About, ReportedResult};
use fretwork_format::{self as format, Format, Part, View};
use fretwork_job::{Answer, Prepared, Submission, Task, TaskKind, clock};
use fretwork_json::BadBody;

/// Computes job bodies. The exit code is 2 if one of them is invalid. The others are computed anyway.
pub fn run(settings: &Run) -> Result<(), Error> {
    let files = match &settings.join {
        Some(_) => vec![PathBuf::from("-")],
        None => listed(&settings.files)?,
    };
    let taken = places::taken(settings.join.as_ref().unwrap_or(&files));
    let others = [(settings.plot.as_ref(), "svg"), (settings.report.as_ref(), "html")];
    places::check(&files, &settings.output, &others, taken)?;
    if let Some(parts) = &settings.join {
        let joined = parts::join(parts)?;
        let job = parse(joined.body(), &parts[0])?;
        return finish(&job, joined.answer(&job.prepared)?, &files[0], settings);
    }
    if settings.part.is_some() && settings.store.is_none() {
        return Err(
            "--part keeps the part in the file of --store: name that file instead of --output"
                .into(),
        );
    }
    if files.len() > 1 && settings.part.is_some() {
        return Err("--part computes a part of one study: name one input file".into());
    }
    let mut code = 0;
    for file in &files {
        // An error of one file does not hinder the others.
        code = of_file(file, settings).map_or_else(|error| print_error(&error), |()| code);
    }
    Ended::with(code)
}

/// Computes one input file.
fn of_file(file: &Path, settings: &Run) -> Result<(), Error> {
    let text = read_job(file, &settings.change)?;
    let job = parse(&text, file)?;
    if let (Some(part), Some(store)) = (settings.part, &settings.store) {
        return parts::compute(&job, &text, part, store);
    }
    let done = finish(&job, compute(&job.prepared)?, file, settings);
    done.map_err(|error| format!("{}: {error}", file.display()).into())
}

/// Writes the result and the figure of a job, and prints the summary.
fn finish(
    job: &Submission,
    (answer, time): (Answer, Duration),
    file: &Path,
    settings: &Run,
) -> Result<(), Error> {
    write_result(&answer.body, job.prepared.task.kind(), &settings.output, file)?;
    if let Some(plot) = &settings.plot {
        let mut figure = Vec::new();
        let view = View::figure(settings.quantity);
        format::write(&mut figure, &answer.body, Part::Plot, Format::Svg, &view)?;
        write_file(&inside(plot, file, Format::Svg.name()), &figure)?;
    }
    if let Some(report) = &settings.report {
        let submitted = job.submitted.as_ref().map(|text| serde_json::from_str(text));
        let about = About {
            label: job.label.clone(),
            submitted: submitted.transpose()?,
            computed: Some(clock::rfc3339(clock::now())),
            version: Some(env!("CARGO_PKG_VERSION").to_owned()),
            warnings: json!(job.prepared.warnings()),
        };
        let entry = ReportedResult::read(&answer.body, &about, true, 1)?;
        let page = report_page(&report::content(&[entry], true, &[])?);
        write_file(&inside(report, file, "html"), page.as_bytes())?;
    }
    summarise(job, &answer, time)
}

/// Parses the job body of a file. A text that is not JSON has one fault.
fn parse(text: &[u8], file: &Path) -> Result<Submission, Error> {
    let faults = |bad| match bad {
        BadBody::Faults(faults) => faults,
        BadBody::Json(error) => Faults::one("the text is not JSON", error.to_string()).0,
        empty @ BadBody::Empty => Faults::one("", empty.to_string()).0,
    };
    Submission::parse(text).map_err(|bad| Ended::by_faults(&faults(bad), file).into())
}

/// The input files, and those of the directories among them in the order of their names.
pub fn listed(files: &[PathBuf]) -> Result<Vec<PathBuf>, Error> {
    let mut all = Vec::new();
    for file in files {
        if !file.is_dir() {
            all.push(file.clone());
            continue;
        }
        let inside = fs::read_dir(file)?.map(|entry| entry.map(|entry| entry.path()));
        let mut inside: Vec<_> = inside.collect::<Result<_, _>>()?;
        inside.retain(|file| file.extension().is_some_and(|suffix| suffix == "json"));
        inside.sort();
        all.append(&mut inside);
    }
    if all.is_empty() {
        let names: Vec<_> = files.iter().map(|file| file.display().to_string()).collect();
        return Err(format!("{}: no .json file is in it. Name another", names.join(", ")).into());
    }
    Ok(all)
}

/// Reads a job body. A scenario alone becomes a job. Makes the changes of the scenario.
pub fn read_job(file: &Path, change: &ScenarioChange) -> Result<Vec<u8>, Error> {
    let text = read_json(file)?;
    // The parser of jobs reports what is not JSON, and repeated members.
    let Ok(mut body) = serde_json::from_slice::<Value>(&text) else { return Ok(text) };
    let is_bare = body.get("profile").is_some();
    if !is_bare && change.set.is_empty() {
        return Ok(text);
    }
    if is_bare {
        body = json!({"scenario": body});
    }
    let mut members = TaskKind::all().map(TaskKind::member);
    let study = members.find(|member| body[*member].get("scenario").is_some());
    let scenario = study.map_or("/scenario".to_owned(), |member| format!("/{member}/scenario"));
    for (pointer, value) in &change.set {
        let (parent, name) = pointer.rsplit_once('/').unwrap_or_default();
        if let Some(place) = body.pointer_mut(&format!("{scenario}{pointer}")) {
            *place = value.clone();
        } else if let Some(Value::Object(members)) =
            body.pointer_mut(&format!("{scenario}{parent}"))
        {
            members.insert(name.to_owned(), value.clone());
        } else {
            let file = file.display();
            return Err(format!("--set {pointer}: the scenario in {file} has no {parent}").into());
        }
    }
    Ok(serde_json::to_vec(&body)?)
}

/// Largest file or answer that is read, in bytes. A device can be endless.
/// The largest result is smaller.
pub const LARGEST: u64 = 1 << 27;

/// Reads a file, or standard input.
pub fn read(file: &Path) -> Result<Vec<u8>, Error> {
    let mut text = Vec::new();
    let read = if file.as_os_str() == "-" {
        io::stdin().take(LARGEST + 1).read_to_end(&mut text)
    } else {
        File::open(file).and_then(|file| file.take(LARGEST + 1).read_to_end(&mut text))
    };
    let name = file.display();
    match read {
        Ok(size) if size as u64 > LARGEST => {
            Err(format!("{name} has more than {} MB", LARGEST / 1_000_000).into())
        }
        Ok(_) => Ok(text),
        Err(error) => Err(format!("cannot read {name}: {error}").into()),
    }
}

/// The text of a JSON file. Some editors write UTF-16, or a mark before UTF-8.
pub fn read_json(file: &Path) -> Result<Vec<u8>, Error> {
    let bytes = read(file)?;
    Ok(fretwork_measured::marked(&bytes).map_or(bytes, String::into_bytes))
}

/// Computes the result, and shows the progress.
pub fn compute(prepared: &Prepared) -> Result<(Answer, Duration), Error> {
    let started = Instant::now();
    if let Task::Study(study) = &prepared.task {
        let answer = Answer::of_study(prepared.key, study, &study::compute(study)?);
        return Ok((answer, started.elapsed()));
    }
    let mut progress = Progress::new();
    let answer = prepared.compute(|done| progress.show(done));
    Ok((answer, started.elapsed()))
}

/// Writes a result to the output file or to standard output.
pub fn write_result(
    result: &[u8],
    kind: TaskKind,
    output: &Destination,
    input: &Path,
) -> Result<(), Error> {
    let format = output.format()?;
    let part = match (format, kind) {
        (Format::Json | Format::Npz, _) => Part::Whole,
        (_, TaskKind::Run) => Part::History,
        (_, TaskKind::Study(_)) => Part::Table,
    };
    let view = View { engineering: output.units == "engineering", ..View::default() };
    let mut bytes = Vec::new();
    format::write(&mut bytes, result, part, format, &view)?;
    if format == Format::Json {
        bytes.push(b'\n');
    }
    match &output.file {
        Some(file) => write_file(&inside(file, input, format.name()), &bytes),
        None => print(&bytes),
    }
}

/// The units of a result, and what a run says of its unworn contact.
#[derive(Deserialize)]
struct ResultSummary {
    units: Value,
    #[serde(default)]
    unworn: Value,
}

/// Prints a summary of the result and the warnings to standard error.
fn summarise(job: &Submission, answer: &Answer, time: Duration) -> Result<(), Error> {
    let mut err = io::stderr().lock();
    let label = job.label.as_deref().unwrap_or("computed");
    writeln!(err, "{label} ({:.1} ms)", time.as_secs_f64() * 1e3)?;
    // The result of a study can be large, so only its units are kept.
    let ResultSummary { units, unworn } = serde_json::from_slice(&answer.body)?;
    // A line contact has no tangential modulus.
    let is_line = unworn.get("tangential_modulus").is_some_and(Value::is_null);
    let numbers = || answer.summary.as_object().into_iter().flatten();
    for (name, value) in numbers().filter(|(name, _)| !name.ends_with("_error")) {
        let text = value.as_str().map(str::to_owned);
        let text = text.unwrap_or_else(|| shown(value, units[name].as_str().unwrap_or("1")));
        let error = answer.summary[format!("{name}_error")].as_f64();
        let error = error.map_or(String::new(), |error| format!(" ± {:.2} %", 100.0 * error));
        let words = match Quantity::named(name) {
            _ if name == "regime" => "Regime of the unworn contact",
            Some(quantity) => quantity.words_of(is_line),
            None => name,
        };
        writeln!(err, "  {words:<38} {text}{error}")?;
    }
    for warning in job.prepared.warnings() {
        writeln!(err, "  warning: {}", warning.detail)?;
    }
    Ok(())
}

/// Writes a file.
pub fn write_file(file: &Path, bytes: &[u8]) -> Result<(), Error> {
    fs::write(file, bytes)
        .map_err(|error| format!("cannot write {}: {error}", file.display()).into())
}
