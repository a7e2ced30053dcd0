//! The command `report`: writes the report of results in files.

use std::process::ExitCode;

use super::printing::{Error, print};
use super::run::{read, write_file};
use crate::config::Report;
use fretwork_format::report::{About, Entry, MOST, page};

/// Writes the report of one result, or a comparison of several runs.
pub fn report(settings: &Report) -> Result<ExitCode, Error> {
    if settings.files.len() > MOST {
        return Err(format!("a report compares at most {MOST} runs").into());
    }
    let entries = settings.files.iter().map(|file| {
        let entry = Entry::read(&read(file)?, &About::default(), settings.units == "engineering");
        entry.map_err(|error| {
            let file = file.display();
            Error::from(format!(
                "{file}: {error}. Enter a .json file that `run` or `get` has written"
            ))
        })
    });
    let html = page(&entries.collect::<Result<Vec<_>, _>>()?)?;
    match &settings.file {
        Some(file) => write_file(file, html.as_bytes())?,
        None => print(html.as_bytes())?,
    }
    Ok(ExitCode::SUCCESS)
}
