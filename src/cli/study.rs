//! The command `run` for studies: computes a study without a server, on all processor cores.

use std::collections::BTreeMap;
use std::io::{self, IsTerminal as _, Write as _};
use std::iter;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{self, ScopedJoinHandle};
use std::time::Duration;

use parking_lot::Mutex;

use super::printing::Error;
use fretwork_study::{Points, Rows, Study};

/// Time between two updates of the progress on a terminal.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(500);

/// Computes all rows on all cores, one stage after another. Shows the progress if standard error is a terminal.
pub fn compute(study: &Arc<Study>) -> Result<Rows, Error> {
    let count = study.chunks();
    let (mut all, mut first) = (Rows::default(), 0);
    while first < count {
        let is_same_stage = |number: &usize| study.earlier_chunks(*number, count) <= first;
        let end = (first..count).take_while(is_same_stage).last().map_or(count, |last| last + 1);
        let stage = Mutex::new(BTreeMap::new());
        let numbers: Vec<_> = (first..end).collect();
        chunks(study, &numbers, &all, first..count, |number, rows| {
            stage.lock().insert(number, rows);
            Ok(())
        })?;
        for rows in stage.into_inner().values() {
            all.append(rows);
        }
        first = end;
    }
    Ok(all)
}

/// Computes chunks on all cores, and hands each to `keep`. `earlier` has the rows of earlier stages. `span` is what the
/// progress shows: the number of chunks that are done already, and of all.
pub fn chunks(
    study: &Arc<Study>,
    numbers: &[usize],
    earlier: &Rows,
    span: Range<usize>,
    keep: impl Fn(usize, Rows) -> io::Result<()> + Sync,
) -> Result<(), Error> {
    let next = AtomicUsize::new(0);
    let work = || {
        while let Some(number) = numbers.get(next.fetch_add(1, Ordering::Relaxed)) {
            let earlier = earlier.clone();
            let mut points = Points::chunk(Arc::clone(study), *number, study.chunks(), earlier);
            let rows = iter::repeat_with(|| points.step()).find_map(|rows| rows);
            keep(*number, rows.unwrap_or_default())?;
        }
        Ok(())
    };
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let done = thread::scope(|scope| {
        let workers: Vec<_> = (0..cores.min(numbers.len())).map(|_| scope.spawn(work)).collect();
        let is_terminal = io::stderr().is_terminal();
        while is_terminal && workers.iter().any(|worker| !worker.is_finished()) {
            let done = span.start + next.load(Ordering::Relaxed).min(numbers.len());
            // Progress is optional: an error here does not stop the study.
            let _ = write!(io::stderr(), "\r{:4.0} %", done as f64 / span.end as f64 * 100.0);
            thread::sleep(PROGRESS_INTERVAL);
        }
        if is_terminal {
            let _ = write!(io::stderr(), "\r      \r");
        }
        let done = workers.into_iter().map(ScopedJoinHandle::join);
        done.collect::<Result<Vec<io::Result<()>>, _>>()
    });
    let done =
        done.map_err(|_| "a thread of the computation failed; this is a defect of fretwork")?;
    let kept: io::Result<()> = done.into_iter().collect();
    kept.map_err(|error| format!("cannot write a chunk of the study: {error}").into())
}
