//! The command `run` for studies: computes a study without a server, on all processor cores.

use std::collections::BTreeMap;
use std::io::{self, IsTerminal as _, Write as _};
use std::iter;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{self, ScopedJoinHandle};
use std::time::Duration;

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
        for rows in stage(study, first..end, &all)?.values() {
            all.append(rows);
        }
        first = end;
    }
    Ok(all)
}

/// Computes the chunks of a stage on all cores.
fn stage(
    study: &Arc<Study>,
    chunks: Range<usize>,
    earlier: &Rows,
) -> Result<BTreeMap<usize, Rows>, Error> {
    let count = study.chunks();
    let (next, done) = (AtomicUsize::new(chunks.start), AtomicUsize::new(chunks.start));
    let work = || {
        let mut computed = Vec::new();
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= chunks.end {
                return computed;
            }
            let mut points = Points::chunk(Arc::clone(study), number, count, earlier.clone());
            let rows = iter::repeat_with(|| points.step()).find_map(|rows| rows);
            computed.extend(rows.map(|rows| (number, rows)));
            done.fetch_add(1, Ordering::Relaxed);
        }
    };
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let computed = thread::scope(|scope| {
        let workers: Vec<_> = (0..cores.min(chunks.len())).map(|_| scope.spawn(work)).collect();
        let is_terminal = io::stderr().is_terminal();
        while is_terminal && workers.iter().any(|worker| !worker.is_finished()) {
            let share = done.load(Ordering::Relaxed) as f64 / count as f64;
            // Progress is optional: an error here does not stop the study.
            let _ = write!(io::stderr(), "\r{:4.0} %", share * 100.0);
            thread::sleep(PROGRESS_INTERVAL);
        }
        if is_terminal {
            let _ = write!(io::stderr(), "\r      \r");
        }
        let computed = workers.into_iter().map(ScopedJoinHandle::join);
        computed.collect::<Result<Vec<_>, _>>()
    });
    let computed =
        computed.map_err(|_| "a thread of the computation failed; this is a defect of fretwork")?;
    Ok(computed.into_iter().flatten().collect())
}
