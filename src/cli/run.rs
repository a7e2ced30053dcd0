//! The command `run`: computes jobs without a server.

use std::fs::{self, File};
use std::io::{self, Read as _};
use std::iter;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use serde_json::{Value, json};

use super::parts;
use super::places::{self, inside};
use super::printing::{Ended, Error, Progress, counted, print, shown};
use super::runtime::on_all_cores;
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
pub fn run(settings: Run) -> Result<(), Error> {
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
        give(finish(&job, joined.answer(&job.prepared)?, &files[0], &settings, true)?)?;
        return Ok(());
    }
    if let Some(part) = settings.part {
        let advice =
            "--part keeps the part in the file of --store: name that file instead of --output";
        let store = settings.store.as_ref().ok_or(advice)?;
        let [file] = &files[..] else {
            return Err("--part computes a part of one study: name one input file".into());
        };
        let text = read_job(file, &settings.change)?;
        return parts::compute(&parse(&text, file)?, &text, part, store);
    }
    // An error of one file does not hinder the others.
    let failed = |error: Error| (Vec::new(), Ended::of(&error));
    let (is_only, mut code) = (files.len() == 1, 0);
    let span = (&mut Progress::new(!is_only), 0..files.len());
    let work = move |file: PathBuf| of_file(&file, &settings, is_only).unwrap_or_else(failed);
    on_all_cores(files, span, work, |done| {
        code = give(done.unwrap_or_else(failed))?.max(code);
        Ok(())
    })?;
    Ended::with(code)
}

/// Computes one input file.
fn of_file(file: &Path, settings: &Run, is_only: bool) -> Result<Done, Error> {
    let job = parse(&read_job(file, &settings.change)?, file)?;
    let computed = compute(&job.prepared, is_only)?;
    let done = finish(&job, computed, file, settings, is_only);
    done.map_err(|error| format!("{}: {error}", file.display()).into())
}

/// What a file gives: the result, if it goes to standard output, and the end with the lines of the summary or of the error.
type Done = (Vec<u8>, Ended);

/// Prints what a file gives. Returns the exit code.
fn give((output, end): Done) -> Result<u8, Error> {
    print(&output)?;
    Ok(end.print())
}

/// Writes the result, the figure and the report of a job.
fn finish(
    job: &Submission,
    (answer, time): (Answer, Duration),
    file: &Path,
    settings: &Run,
    is_only: bool,
) -> Result<Done, Error> {
    let output = write_result(&answer.body, job.prepared.task.kind(), &settings.output, file)?;
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
    let file = (!is_only).then_some(file);
    let lines = if settings.quiet { Vec::new() } else { summary(job, &answer, time, file) };
    Ok((output, Ended { code: 0, lines }))
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
        if file.is_dir() {
            let is_json = |file: &PathBuf| file.extension() == Some("json".as_ref());
            all.extend(places::files_in(file)?.into_iter().filter(is_json));
        } else {
            all.push(file.clone());
        }
    }
    if all.is_empty() {
        return Err(format!("{}: no .json file is directly in it", files[0].display()).into());
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

/// Uses all cores, so other studies of this command wait.
static ONE_STUDY: Mutex<()> = Mutex::new(());

/// Computes the result. Shows the progress, if it is wanted.
pub fn compute(prepared: &Prepared, is_shown: bool) -> Result<(Answer, Duration), Error> {
    let mut progress = Progress::new(is_shown);
    let _turn = matches!(prepared.task, Task::Study(_)).then(|| ONE_STUDY.lock());
    let started = Instant::now();
    let answer = match &prepared.task {
        Task::Run(_) => prepared.compute(|done| progress.show(done)),
        Task::Study(study) => {
            Answer::of_study(prepared.key, study, study::compute(study, &mut progress)?)
        }
    };
    Ok((answer, started.elapsed()))
}

/// Writes a result to the output file. Without one, returns the bytes for standard output.
pub fn write_result(
    result: &[u8],
    kind: TaskKind,
    output: &Destination,
    input: &Path,
) -> Result<Vec<u8>, Error> {
    let format = output.format()?;
    let part = match (format, kind) {
        (Format::Json | Format::Npz, _) => Part::Whole,
        (_, TaskKind::Run) => Part::History,
        (_, TaskKind::Study(_)) => Part::Table,
    };
    let view = View { engineering: output.units == "engineering", ..View::default() };
    // Most formats are no longer. A growing vector would be copied.
    let mut bytes = Vec::with_capacity(result.len() + 1);
    format::write(&mut bytes, result, part, format, &view)?;
    if format == Format::Json {
        bytes.push(b'\n');
    }
    if let Some(file) = &output.file {
        write_file(&inside(file, input, format.name()), &bytes)?;
        return Ok(Vec::new());
    }
    Ok(bytes)
}

/// The summary of a result: all numbers and warnings. For one of several files, one line with the wear of a run.
fn summary(job: &Submission, answer: &Answer, time: Duration, file: Option<&Path>) -> Vec<String> {
    let is_line = answer.outline.words()["geometry"] == "line";
    let numbers = answer.summary.as_object().into_iter().flatten();
    let numbers = numbers.filter(|(name, _)| !name.ends_with("_error")).map(|(name, value)| {
        let quantity = Quantity::named(name);
        let unit = quantity.map_or("1", |quantity| quantity.unit);
        let text = value.as_str().map_or_else(|| shown(value, unit), str::to_owned);
        let error = answer.summary[format!("{name}_error")].as_f64();
        let error = error.map_or(String::new(), |error| format!(" ± {:.2} %", 100.0 * error));
        let words = match quantity {
            _ if name == "regime" => "Regime of the unworn contact",
            Some(quantity) => quantity.words_of(is_line),
            None => name,
        };
        (&**name, words, text + &error)
    });
    let (time, warnings) = (time.as_secs_f64() * 1e3, job.prepared.warnings());
    if let Some(file) = file {
        let wear = numbers.filter(|(name, ..)| ["wear_volume", "wear_depth"].contains(name));
        let wear = wear.map(|(_, words, text)| format!("{words} {text}"));
        let parts: Vec<_> = wear.chain([counted(warnings.len() as u64, "warning")]).collect();
        return vec![format!("{}: {} ({time:.1} ms)", file.display(), parts.join(", "))];
    }
    let label = job.label.as_deref().unwrap_or("computed");
    let first = iter::once(format!("{label} ({time:.1} ms)"));
    let numbers = numbers.map(|(_, words, text)| format!("  {words:<38} {text}"));
    let warnings = warnings.iter().map(|warning| format!("  warning: {}", warning.detail));
    first.chain(numbers).chain(warnings).collect()
}

/// Writes a file.
pub fn write_file(file: &Path, bytes: &[u8]) -> Result<(), Error> {
    fs::write(file, bytes)
        .map_err(|error| format!("cannot write {}: {error}", file.display()).into())
}
