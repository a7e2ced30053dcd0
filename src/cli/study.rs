//! The command `run` for studies: computes a study without a server, on all processor cores.

use std::io::{self, IsTerminal as _, Write as _};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use super::printing::Error;
use fretwork_study::{Points, Rows, Study};

/// Time between two updates of the progress on a terminal.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(500);

/// Computes all rows on all cores. Shows the progress if standard error is a terminal.
pub fn compute(study: &Arc<Study>) -> Result<Rows, Error> {
    let count = study.chunks();
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let chunks = Mutex::new(vec![None; count]);
    let work = || {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= count {
                return;
            }
            let mut points = Points::chunk(Arc::clone(study), number, count);
            let rows = loop {
                if let Some(rows) = points.step() {
                    break rows;
                }
            };
            chunks.lock().unwrap_or_else(PoisonError::into_inner)[number] = Some(rows);
            done.fetch_add(1, Ordering::Relaxed);
        }
    };
    let cores = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        let workers: Vec<_> = (0..cores.min(count)).map(|_| scope.spawn(work)).collect();
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
    });
    let chunks = chunks.into_inner().unwrap_or_else(PoisonError::into_inner);
    let mut all = Rows::default();
    for rows in chunks {
        all.append(&rows.ok_or("a thread failed; this is a defect of fretwork")?);
    }
    Ok(all)
}
