//! The commands that move results and databases, as people see them.

use std::io::{self, IsTerminal as _, Write as _};
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant, SystemTime};

use bytesize::ByteSize;
use fretwork::store::{self, AccessKey, Desk, Imported, Saved, Search};

use super::{Failure, complain, say};
use crate::config::{Backup, Export, Import, Restore};

/// How often progress is shown where nobody watches a terminal.
const SELDOM: Duration = Duration::from_secs(10);
/// And where somebody does.
const OFTEN: Duration = Duration::from_millis(200);

/// Does something that waits for a database.
fn wait<T>(work: impl Future<Output = Result<T, store::Moving>>) -> Result<T, Failure> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    Ok(runtime.block_on(work)?)
}

/// Shows on standard error how far it has come.
fn progress(what: &'static str) -> impl FnMut(usize, usize) {
    let mut err = io::stderr();
    let watched = err.is_terminal();
    let mut shown = Instant::now();
    move |done, of| {
        if done < of && shown.elapsed() < if watched { OFTEN } else { SELDOM } {
            return;
        }
        shown = Instant::now();
        let (begin, end) = match (watched, done == of) {
            (true, false) => ("\r", ""),
            (true, true) => ("\r", "\n"),
            _ => ("", "\n"),
        };
        // With standard error closed there is nobody to tell.
        let _ = write!(err, "{begin}{what} {done} of {of}{end}").and_then(|()| err.flush());
    }
}

fn results(count: u64, bytes: u64) -> String {
    let plural = if count == 1 { "result" } else { "results" };
    format!("{count} {plural} ({})", ByteSize(bytes))
}

/// Writes results into a file.
pub fn export(settings: &Export) -> Result<(), Failure> {
    let mut search = Search::default();
    for (name, value) in &settings.conditions {
        search.set(name, value)?;
    }
    let Export { file, keys, data, .. } = settings;
    let done = wait(store::export(&data.data_dir, file, &search, keys, progress("exported")))?;
    for key in &done.left_out {
        writeln!(io::stderr(), "left out {key}: it is damaged, or was dropped meanwhile")?;
    }
    say(format!("{}: {}\n", file.display(), results(done.results, done.bytes)).as_bytes())
}

/// Takes over the results of a file; the exit code is 2 if some were refused.
pub fn import(settings: &Import) -> ExitCode {
    match take_over(settings) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(2),
        Err(failure) => {
            complain(failure.as_ref());
            ExitCode::FAILURE
        }
    }
}

/// Whether all could be taken.
fn take_over(settings: &Import) -> Result<bool, Failure> {
    let Import { file, data } = settings;
    let done = wait(store::import(&data.data_dir, file, progress("looked at")))?;
    let Imported { results: count, bytes, known, notes, refused, other_notes, .. } = done;
    let Imported { left_out, lacking, .. } = done;
    for (key, why) in &refused {
        writeln!(io::stderr(), "refused {}: {why}", key.escape_debug())?;
    }
    for column in &lacking {
        writeln!(io::stderr(), "left out of all results: the file has no column {column}")?;
    }
    for (key, what) in &left_out {
        writeln!(io::stderr(), "left out of {key}: {what}")?;
    }
    for key in &other_notes {
        writeln!(io::stderr(), "left the note of {key}: there is another one here")?;
    }
    let (taken, failed) = (results(count, bytes), refused.len());
    let (here, unfit) = (other_notes.len(), left_out.len());
    let file = file.display();
    let line = format!(
        "{file}: {taken} imported, {known} known already, {failed} refused; notes: {notes} taken, \
         {here} left for the ones here; {unfit} details left out\n"
    );
    say(line.as_bytes())?;
    Ok(refused.is_empty())
}

fn holds(saved: &Saved) -> String {
    let Saved { jobs, dropped, .. } = saved;
    let there = results(saved.results, saved.bytes);
    format!("{there}, {jobs} jobs, scenarios of {dropped} dropped results; checked")
}

/// Copies the whole database.
pub fn backup(settings: &Backup) -> Result<(), Failure> {
    let saved = wait(store::backup(&settings.data.data_dir, &settings.file))?;
    say(format!("{}: {}\n", settings.file.display(), holds(&saved)).as_bytes())
}

/// Puts a backup in place.
pub fn restore(settings: &Restore) -> Result<(), Failure> {
    let Restore { file, replace, data } = settings;
    let (saved, former) = wait(store::restore(&data.data_dir, file, *replace))?;
    let keys = wait(keys_in_force(&data.data_dir))?;
    let (dir, holds) = (data.data_dir.display(), holds(&saved));
    let kept = former.map_or_else(String::new, |former| {
        format!("the former database is {}\n", former.display())
    });
    // One that was taken back since the backup is in force again: somebody should see that.
    let keys: Vec<String> = keys
        .iter()
        .map(|AccessKey { id, name, role, .. }| format!("key in force: {id} {name} ({role})\n"))
        .collect();
    let keys = keys.concat();
    say(format!("{dir}: {holds}\n{kept}{keys}").as_bytes())
}

/// The access keys that open the server of this directory.
async fn keys_in_force(dir: &Path) -> Result<Vec<AccessKey>, store::Moving> {
    let mut desk = Desk::open(dir).await?;
    let mut keys = desk.keys().await?;
    desk.close().await?;
    let now = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default().as_millis();
    let is_over = |end: i64| u128::try_from(end).unwrap_or(0) <= now;
    keys.retain(|key| key.revoked.is_none() && !key.expires.is_some_and(is_over));
    Ok(keys)
}
