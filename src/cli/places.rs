//! The output files of commands. A command checks them before it computes, so that no result is computed and lost.

use std::collections::HashSet;
use std::fs::{self, OpenOptions};
use std::io::{self, IsTerminal as _};
use std::path::{Path, PathBuf};

use super::printing::Error;
use crate::config::Output;
use fretwork_format::Format;

/// Files that a command reads, or will write.
pub struct Taken(HashSet<PathBuf>);

impl Taken {
    /// The input files of a command.
    pub fn by(inputs: &[PathBuf]) -> Self {
        Self(inputs.iter().filter_map(|file| fs::canonicalize(file).ok()).collect())
    }

    /// Makes the directory of an output file. Checks that the file can be written, and that it is no other file of the command.
    pub fn reserve(&mut self, file: &Path) -> Result<(), Error> {
        let refused = |error: io::Error| format!("cannot write {}: {error}", file.display());
        if file.exists() && !file.is_file() && !file.is_dir() {
            // A device or a FIFO. Its reader would take an attempt for the end.
            return Ok(());
        }
        make_parent(file).map_err(refused)?;
        let is_new = file.symlink_metadata().is_err();
        OpenOptions::new().create(true).append(true).open(file).map_err(refused)?;
        let whole = fs::canonicalize(file).map_err(refused)?;
        if is_new {
            fs::remove_file(file).map_err(refused)?;
        }
        if self.0.insert(whole) {
            return Ok(());
        }
        let file = file.display();
        Err(format!("{file} would replace an input file or another result. Name another file or directory").into())
    }
}

/// Makes the directory of a file.
pub fn make_parent(file: &Path) -> io::Result<()> {
    file.parent().map_or(Ok(()), fs::create_dir_all)
}

/// Checks the places of all results of some input files, and makes their directories. `others` are the figure and the
/// report, with their suffixes. `taken` has the files that the command reads.
pub fn check(
    inputs: &[PathBuf],
    output: &Output,
    others: &[(Option<&PathBuf>, &str)],
    mut taken: Taken,
) -> Result<(), Error> {
    for place in others.iter().filter_map(|(place, _)| *place).chain(&output.file) {
        make_directory(place, inputs.len() == 1)?;
    }
    let format = output.format()?;
    let is_binary = matches!(format, Format::Npz | Format::Arrow);
    if is_binary && output.file.is_none() && io::stdout().is_terminal() {
        let advice = "write it to a file with --output";
        return Err(format!("the requested format is binary, not for a terminal: {advice}").into());
    }
    for input in inputs {
        let places = [(output.file.as_ref(), format.name())].into_iter().chain(others.to_vec());
        for (place, suffix) in places.filter_map(|(place, suffix)| Some((place?, suffix))) {
            if suffix == "svg" && !place.is_dir() && place.extension() != Some("svg".as_ref()) {
                let place = place.display();
                return Err(format!("{place}: figures are SVG. Enter a name that ends with .svg").into());
            }
            taken.reserve(&inside(place, input, suffix))?;
        }
    }
    Ok(())
}

/// Makes the directory in which several input files, or a name with a slash at its end, put their results.
fn make_directory(place: &Path, is_one: bool) -> Result<(), Error> {
    let is_slash = place.as_os_str().as_encoded_bytes().ends_with(b"/");
    if is_one && !is_slash {
        return Ok(());
    }
    let suffixes = Format::ALL.map(Format::name);
    let suffix = place.extension().and_then(|suffix| suffix.to_str()).unwrap_or_default();
    let is_file = !is_slash && (suffix == "html" || suffixes.contains(&suffix));
    if place.is_dir() || (!is_file && fs::create_dir_all(place).is_ok()) {
        return Ok(());
    }
    let place = place.display();
    Err(format!("{place} is not a directory, which several input files need").into())
}

/// The file itself, or the file in a directory that is named after the input file.
pub fn inside(place: &Path, input: &Path, suffix: &str) -> PathBuf {
    if !place.is_dir() {
        return place.to_owned();
    }
    let name = input.file_stem().filter(|_| input.as_os_str() != "-").unwrap_or("result".as_ref());
    let mut name = name.to_owned();
    name.push(format!(".{suffix}"));
    place.join(name)
}
