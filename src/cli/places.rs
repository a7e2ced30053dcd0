//! The output files of commands. A command checks them before it computes, so that no result is computed and lost.

use std::collections::HashSet;
use std::fs::{self, OpenOptions};
use std::io::{self, IsTerminal as _};
#[cfg(unix)]
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use super::printing::Error;
use crate::config::Destination;
use fretwork_format::Format;

/// Files that a command reads or will write.
pub type Taken = HashSet<(u64, u64, PathBuf)>;

/// The input files of a command.
pub fn taken(inputs: &[PathBuf]) -> Taken {
    inputs.iter().filter_map(|file| identities(file, false).ok()).flatten().collect()
}

/// What tells a file from others: its path without links, and its number on its device, because it can have several
/// paths. A new file is removed, and its number is used again.
#[cfg_attr(not(unix), expect(unused_mut, unused_variables, reason = "files have no numbers"))]
fn identities(file: &Path, is_new: bool) -> io::Result<Vec<(u64, u64, PathBuf)>> {
    let mut all = vec![(0, 0, fs::canonicalize(file)?)];
    #[cfg(unix)]
    if !is_new {
        all.extend(fs::metadata(file).map(|found| (found.dev(), found.ino(), PathBuf::new())));
    }
    Ok(all)
}

/// Makes the directory of an output file. Checks that the file can be written, and that it is no other file of the command.
pub fn reserve(file: &Path, taken: &mut Taken) -> Result<(), Error> {
    let (name, is_new) = (file.display(), file.symlink_metadata().is_err());
    // The reader of a FIFO would take an attempt for the end.
    if file.exists() && !file.is_file() && !file.is_dir() {
        return Ok(());
    }
    let opened = make_parent(file)
        .and_then(|()| OpenOptions::new().create(true).append(true).open(file))
        .and_then(|_| identities(file, is_new));
    let place = opened.map_err(|error| format!("cannot write {name}: {error}"))?;
    if is_new {
        fs::remove_file(file)?;
    }
    let is_free = place.into_iter().all(|it| taken.insert(it));
    let advice = "would replace an input file or another result. Name another place, or rename the input file";
    is_free.then_some(()).ok_or_else(|| format!("{name} {advice}").into())
}

/// The paths in a directory, in the order of their names.
pub fn files_in(directory: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(directory)?.map(|entry| entry.map(|entry| entry.path()));
    let mut paths: Vec<_> = entries.collect::<Result<_, _>>()?;
    paths.sort();
    Ok(paths)
}

/// Makes the directory of a file.
pub fn make_parent(file: &Path) -> io::Result<()> {
    file.parent().map_or(Ok(()), fs::create_dir_all)
}

/// Checks the places of all results of some input files, and makes their directories. `others` are the figure and the
/// report, with their suffixes. `taken` has the files that the command reads.
pub fn check(
    inputs: &[PathBuf],
    output: &Destination,
    others: &[(Option<&PathBuf>, &str)],
    mut taken: Taken,
) -> Result<(), Error> {
    let others = others.iter().filter_map(|(place, suffix)| Some(((*place)?, *suffix)));
    if let Some(place) = &output.file {
        make_directory(place, inputs.len() == 1)?;
    }
    let format = output.format()?;
    let is_binary = matches!(format, Format::Npz | Format::Arrow);
    if is_binary && output.file.is_none() && (inputs.len() > 1 || io::stdout().is_terminal()) {
        return Err("a binary format needs a file for each result: use --output".into());
    }
    let mut places = others.chain(output.file.iter().map(|file| (file, format.name())));
    places.try_for_each(|(place, suffix)| prepare(place, suffix, inputs, &mut taken))
}

/// Checks the place of the results of some input files in one format, and makes its directory.
pub fn prepare(
    place: &Path,
    suffix: &str,
    inputs: &[PathBuf],
    taken: &mut Taken,
) -> Result<(), Error> {
    make_directory(place, inputs.len() == 1)?;
    let is_only = ["svg", "html"].contains(&suffix);
    if is_only && !place.is_dir() && place.extension() != Some(suffix.as_ref()) {
        let (name, format) = (place.display(), suffix.to_uppercase());
        return Err(format!("{name}: the output is {format}. End the name with .{suffix}").into());
    }
    inputs.iter().try_for_each(|input| reserve(&inside(place, input, suffix), taken))
}

/// Makes the directory in which several files, or a name with a slash at its end, put their results.
pub fn make_directory(place: &Path, is_one: bool) -> Result<(), Error> {
    let is_slash = place.as_os_str().as_encoded_bytes().ends_with(b"/");
    let suffix = place.extension().and_then(|suffix| suffix.to_str()).unwrap_or_default();
    let is_file = ["html", "svg"].contains(&suffix)
        || Format::ALL.iter().any(|format| format.name() == suffix);
    if is_one && !is_slash {
        return Ok(());
    }
    let name = place.display();
    if (place.exists() || (is_file && !is_slash)) && !place.is_dir() {
        return Err(format!("{name} is not a directory, which several files need").into());
    }
    fs::create_dir_all(place)
        .map_err(|error| format!("cannot make the directory {name}: {error}").into())
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
