//! The commands `export`, `import`, `check`, `backup` and `restore`.

use std::env;
use std::fs::{self, File};
use std::io::{self, IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bytesize::ByteSize;

use super::administration::{existing, of};
use super::places::{files_in, inside, make_directory, make_parent};
use super::printing::{Ended, Error, counted, harmless, print, say};
use super::runtime::block_on;
use crate::config::{Backup, Data, Export, Import, Restore};
use crate::service;
use fretwork_job::clock;
use fretwork_store::{
    self as store, AccessKey, Administration, Checked, Imported, Repaired, Saved, Search,
};

/// Time between two lines of progress in a log.
const LOG_INTERVAL: Duration = Duration::from_secs(10);
/// Time between two updates of progress on a terminal.
const TERMINAL_INTERVAL: Duration = Duration::from_millis(200);

/// Shows progress on standard error. The first argument is the number of items that are done; its fraction is the part
/// of the next item.
fn progress(what: &'static str) -> impl FnMut(f64, usize) {
    let mut err = io::stderr();
    let is_terminal = err.is_terminal();
    let interval = if is_terminal { TERMINAL_INTERVAL } else { LOG_INTERVAL };
    let mut shown = Instant::now();
    move |done, of| {
        let is_end = done >= of as f64;
        if !is_end && shown.elapsed() < interval {
            return;
        }
        shown = Instant::now();
        let begin = if is_terminal { "\r" } else { "" };
        let end = if is_terminal && !is_end { "" } else { "\n" };
        let (percent, done) = (100.0 * done / of.max(1) as f64, done.floor());
        // Progress is optional: standard error may be closed.
        let _ = write!(err, "{begin}{what} {done} of {of} ({percent:.1} %){end}");
    }
}

fn results(count: u64, bytes: u64) -> String {
    format!("{} ({})", counted(count, "result"), ByteSize(bytes))
}

/// Makes the directory of a file. Whether the file can be written is known when the command begins to write it.
fn prepare(file: &Path) -> Result<(), String> {
    make_parent(file).map_err(|error| format!("cannot write {}: {error}", file.display()))
}

/// Says what is in a file that a command has written. After standard output, on standard error.
fn written(file: &Path, what: &str) -> Result<(), Error> {
    if file.as_os_str() == "-" {
        return Ok(writeln!(io::stderr(), "standard output: {what}")?);
    }
    print(format!("{}: {what}\n", file.display()).as_bytes())
}

/// Writes results to a file.
pub fn export(settings: &Export) -> Result<(), Error> {
    let mut search = Search::default();
    for (name, value) in &settings.conditions {
        search.set(name, value)?;
    }
    let Export { file, keys, data, .. } = settings;
    let place = existing(data)?;
    let is_stdout = file.as_os_str() == "-";
    if is_stdout && io::stdout().is_terminal() {
        return Err(
            "an export is compressed, not for a terminal: name a file, or use a pipe".into()
        );
    }
    if !is_stdout {
        prepare(file)?;
    }
    let mut progress = progress("exported");
    let progress = &mut |done: usize, of| progress(done as f64, of);
    let done = block_on(store::export(place, file, &search, keys, progress))?;
    for key in &done.left_out {
        say(&format!(
            "left out {key}: it is damaged, or was evicted during the export; submitting its scenario computes it again"
        ));
    }
    written(file, &results(done.results, done.bytes))?;
    Ended::with(if done.left_out.is_empty() { 0 } else { 2 })
}

/// Imports the results of a file. The exit code is 2 if some were refused.
pub fn import(settings: &Import) -> Result<(), Error> {
    let Import { file, verify_time, data } = settings;
    let done = block_on(service::import(data.place()?, file, *verify_time, progress("checked")))?;
    let Imported { results: count, known, sampled, unverified, missing, notes, .. } = done;
    for (key, why) in &done.refused {
        writeln!(io::stderr(), "refused the result {}: {}", key.escape_debug(), harmless(why))?;
    }
    for key in &done.other_notes {
        writeln!(io::stderr(), "{key} keeps its note, which differs from the one in the file")?;
    }
    if missing > 0 {
        say(&format!(
            "the file has {missing} fewer results than its first line announces: it was cut, lines were removed, or the export \
             left them out"
        ));
    }
    if unverified > 0 {
        say(&format!(
            "{unverified} of the imported results are not verified: an earlier version of the engine computed them, or \
             it takes longer than --verify-time to compute them again"
        ));
    }
    let (failed, kept) = (done.refused.len(), done.other_notes.len());
    let stored = results(count, done.bytes);
    let name = if file.as_os_str() == "-" { Path::new("standard input") } else { file };
    let (file, verified) = (name.display(), count - sampled - unverified);
    let line = format!(
        "{file}: {stored} imported, {known} known already, {failed} refused; {verified} computed again, \
         {sampled} in part, {unverified} unverified; notes: {notes} imported, {kept} kept\n"
    );
    print(line.as_bytes())?;
    Ended::with(if failed == 0 { 0 } else { 2 })
}

/// Describes the contents of a backup.
fn contents(saved: &Saved) -> String {
    let Saved { jobs, results: count, bytes, evicted, .. } = *saved;
    let (results, jobs) = (results(count, bytes), counted(jobs, "job"));
    format!("{results}, {jobs}, scenarios of {}; checked", counted(evicted, "evicted result"))
}

/// Prints the keys of the damaged results to standard error. The exit code is 2 if there are any.
fn name_damaged(saved: &Saved) -> Result<(), Error> {
    for key in &saved.damaged {
        say(&format!(
            "left out {key}: it is damaged; its scenario is kept, and submitting it computes the result again"
        ));
    }
    Ended::with(if saved.damaged.is_empty() { 0 } else { 2 })
}

/// Searches a database for damage, and prints the damaged rows to standard error. With `is_repair`, first repairs what
/// follows from sound results. The exit code is 2 if there is damage left.
pub fn check(data: &Data, is_repair: bool) -> Result<(), Error> {
    let dir =
        data.directory("check it with `pg_amcheck`, and with `pg_checksums` while it is stopped")?;
    if is_repair {
        let Repaired { copy, damage } = block_on(store::repair(dir))?;
        for row in &damage {
            writeln!(io::stderr(), "repaired: {row}")?;
        }
        if let Some(copy) = copy {
            writeln!(io::stderr(), "the database as it was: {}", copy.display())?;
        }
    }
    let Checked { counts, damage } = block_on(store::check(dir))?;
    for row in &damage {
        writeln!(io::stderr(), "damaged: {row}")?;
    }
    if is_repair && !damage.is_empty() {
        let told = "not repaired, because no sound result proves what is right: submit the scenario of a damaged result with \
                    `Cache-Control: no-cache`, use REINDEX of SQLite for an index, or restore a backup";
        writeln!(io::stderr(), "{told}")?;
    }
    let found = match damage.len() {
        0 => "no damage".to_owned(),
        count => format!("damage in {}", counted(count as u64, "place")),
    };
    let counts = match counts {
        Some((jobs, count)) => format!("{}, {}", counted(count, "result"), counted(jobs, "job")),
        None => "its results and jobs cannot be counted".to_owned(),
    };
    print(format!("{}: {counts}; {found}\n", dir.display()).as_bytes())?;
    Ended::with(if damage.is_empty() { 0 } else { 2 })
}

/// Copies the whole database to a file, to a new file in a directory, or to standard output.
pub fn backup(settings: &Backup) -> Result<(), Error> {
    let instead = "copy it with `pg_dump --format=custom --file=FILE --dbname=URL`";
    let (Backup { file: place, keep, .. }, dir) = (settings, settings.data.directory(instead)?);
    let is_stdout = place.as_os_str() == "-";
    if is_stdout && (keep.is_some() || io::stdout().is_terminal()) {
        return Err("a backup is a database, not for a terminal, and --keep needs a directory: name a file or a directory".into());
    }
    // No file system of Windows accepts colons.
    let name = format!("{DATED}{}.db", clock::rfc3339(clock::now()).replace(':', ""));
    existing(&settings.data)?;
    let target = if is_stdout { &env::temp_dir() } else { place };
    make_directory(target, keep.is_none())?;
    let file = inside(target, Path::new(&name), "db");
    prepare(&file)?;
    let saved = block_on(store::backup(dir, &file))?;
    if is_stdout {
        let mut copy = File::open(&file)?;
        fs::remove_file(&file)?;
        io::copy(&mut copy, &mut io::stdout())?;
    }
    written(if is_stdout { place } else { &file }, &contents(&saved))?;
    if let Err(error) = block_on(store::note_backup(dir)) {
        writeln!(io::stderr(), "the metrics of the server do not show this backup: {error}")?;
    }
    // Earlier backups may have what is damaged now.
    name_damaged(&saved)?;
    let pruned = keep.map_or(Ok(()), |keep| prune(place, keep.get(), &file));
    pruned.map_err(|error| {
        format!("cannot delete old backups in {}: {error}", place.display()).into()
    })
}

/// How the names of backups in a directory begin. The time follows, so their order is that of the times.
const DATED: &str = "fretwork-";

/// Deletes the oldest backups of a directory, except the newest ones and the last one. Deletes what killed commands have left there
/// before the oldest backup that stays.
fn prune(dir: &Path, keep: usize, last: &Path) -> io::Result<()> {
    let is_own = |file: &PathBuf| {
        let (time, end) = file.file_name()?.to_str()?.strip_prefix(DATED)?.split_once("Z.db")?;
        let is_end = end.is_empty() || end.starts_with(".part") || end.starts_with(".source");
        Some(is_end && file.is_file() && time.bytes().all(|it| b"0123456789-T.".contains(&it)))
    };
    let mut own = files_in(dir)?;
    own.retain(|file| is_own(file) == Some(true));
    let whole = own.iter().rev().filter(|file| file.extension() == Some("db".as_ref()));
    let Some(oldest) = whole.take(keep).last() else { return Ok(()) };
    own.iter().filter(|file| *file < oldest && *file != last).try_for_each(fs::remove_file)
}

/// Replaces the database by a backup.
pub fn restore(settings: &Restore) -> Result<(), Error> {
    let Restore { file, replace, data } = settings;
    let instead =
        "stop all servers, and restore it with `pg_restore --clean --if-exists --dbname=URL FILE`";
    let dir = data.directory(instead)?;
    let (saved, former) = block_on(store::restore(dir, file, *replace))?;
    // A key that was revoked after the backup is valid again, so the administrator must see it.
    let mut keys = block_on(of(data, Administration::keys))?;
    let now = clock::now();
    keys.retain(|key| key.revoked.is_none() && key.expires.is_none_or(|end| end > now));
    let (dir, contents) = (dir.display(), contents(&saved));
    let kept = former.map_or_else(String::new, |former| {
        format!("the former database is now {}\n", former.display())
    });
    let keys: Vec<String> = keys
        .iter()
        .map(|AccessKey { id, name, role, .. }| format!("valid key: {id} {name} ({role})\n"))
        .collect();
    let keys = keys.concat();
    print(format!("{dir}: {contents}\n{kept}{keys}").as_bytes())?;
    name_damaged(&saved)
}
