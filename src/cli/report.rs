//! The command `report`: writes the report of results in files.

use std::path::Path;

use serde_json::{Value, json};

use super::places::{inside, prepare, taken};
use super::printing::{Error, print};
use super::run::{read, write_file};
use crate::config::Report;
use crate::http::report_page;
use fretwork_engine::outcome::Quantity;
use fretwork_format::report::{About, MOST, ReportedResult, content};
use fretwork_measured::{Prepare, Wanted};

/// Writes the report of one result, or a comparison of several runs.
pub fn report(settings: &Report) -> Result<(), Error> {
    if settings.files.len() > MOST {
        return Err(format!("a report compares at most {MOST} runs").into());
    }
    if settings.files.len() > 1 && !settings.measured.is_empty() {
        return Err("--measured belongs to the report of one run".into());
    }
    let mut taken = taken(&[&settings.files[..], &settings.measured].concat());
    if let Some(place) = &settings.file {
        prepare(place, "html", &settings.files[..1], &mut taken)?;
    }
    let measured: Vec<_> =
        settings.measured.iter().map(|file| read_measured(file)).collect::<Result<_, _>>()?;
    let engineering = settings.units == "engineering";
    let entries = settings.files.iter().map(|file| {
        // The names of the files distinguish the runs of a comparison.
        let label = file.file_stem().filter(|_| settings.files.len() > 1);
        let label = label.map(|name| name.to_string_lossy().into_owned());
        let about = About { label, ..About::default() };
        let entry = ReportedResult::read(&read(file)?, &about, engineering, settings.files.len());
        entry.map_err(|error| {
            let file = file.display();
            Error::from(format!(
                "{file}: {error}. Enter a .json file that `run` or `get` has written"
            ))
        })
    });
    let html =
        report_page(&content(&entries.collect::<Result<Vec<_>, _>>()?, engineering, &measured)?);
    match &settings.file {
        Some(file) => write_file(&inside(file, &settings.files[0], "html"), html.as_bytes()),
        None => print(html.as_bytes()),
    }
}

/// The first two columns of numbers of a file, as a set of the page.
fn read_measured(file: &Path) -> Result<Value, Error> {
    let name = file.display().to_string();
    let found = fretwork_measured::read(&read(file)?, &Wanted::of(Prepare::Points));
    let mut found = found.map_err(|faults| format!("{name}: {}", faults.0[0].detail))?;
    let mut set = found.prepared["data"].take();
    if set["output"].as_str().and_then(Quantity::named).is_none() {
        return Err(format!("{name} has no output of a run: {}", found.notes.join(" ")).into());
    }
    set["kind"] = json!("points");
    set["name"] = json!(name);
    Ok(set)
}
