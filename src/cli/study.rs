//! The command `run` for studies: computes a study without a server, on all processor cores.

use std::collections::BTreeMap;
use std::io;
use std::iter;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{self, ScopedJoinHandle};
use std::time::Duration;

use parking_lot::Mutex;

use super::printing::{Error, Progress};
use crate::service::processors;
use fretwork_study::{Points, Rows, Study};

/// How often the number of finished chunks is read.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(50);

/// Computes all rows on all cores, one stage after another, and shows the progress.
pub fn compute(study: &Arc<Study>, progress: &mut Progress) -> Result<Rows, Error> {
    let count = study.chunks();
    let (mut all, mut first) = (Rows::default(), 0);
    while first < count {
        let is_same_stage = |number: &usize| study.earlier_chunks(*number, count) <= first;
        let end = (first..count).take_while(is_same_stage).last().map_or(count, |last| last + 1);
        let stage = Mutex::new(BTreeMap::new());
        let numbers: Vec<_> = (first..end).collect();
        let span = (&mut *progress, first..count);
        chunks(study, (&numbers, count), &all, span, |number, rows| {
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

/// Computes some of `count` chunks on all cores, and hands each to `keep`. `earlier` has the rows of earlier stages. `span` is what the
/// progress shows: the number of chunks that are done already, and of all.
pub fn chunks(
    study: &Arc<Study>,
    (numbers, count): (&[usize], usize),
    earlier: &Rows,
    (progress, span): (&mut Progress, Range<usize>),
    keep: impl Fn(usize, Rows) -> io::Result<()> + Sync,
) -> Result<(), Error> {
    let kept = on_all_cores(numbers, (progress, span), |_, number| {
        let mut points = Points::chunk(Arc::clone(study), *number, count, earlier.clone());
        let rows = iter::repeat_with(|| points.step()).find_map(|rows| rows);
        keep(*number, rows.unwrap_or_default())
    })?;
    kept.map_err(|error| format!("cannot write a chunk of the study: {error}").into())
}

/// Does some work for each item on all cores. `span` is what the progress shows: the number of items that are done already, and
/// of all. The inner error is that of the work.
pub fn on_all_cores<T: Sync>(
    items: &[T],
    (progress, span): (&mut Progress, Range<usize>),
    work: impl Fn(usize, &T) -> io::Result<()> + Sync,
) -> Result<io::Result<()>, Error> {
    let next = AtomicUsize::new(0);
    let work = || {
        while let number = next.fetch_add(1, Ordering::Relaxed)
            && let Some(item) = items.get(number)
        {
            work(number, item)?;
        }
        Ok(())
    };
    let done = thread::scope(|scope| {
        let workers: Vec<_> =
            (0..processors().min(items.len())).map(|_| scope.spawn(work)).collect();
        while progress.is_terminal && workers.iter().any(|worker| !worker.is_finished()) {
            let done = span.start + next.load(Ordering::Relaxed).min(items.len());
            progress.show(done as f64 / span.end as f64);
            thread::sleep(PROGRESS_INTERVAL);
        }
        let done = workers.into_iter().map(ScopedJoinHandle::join);
        done.collect::<Result<Vec<io::Result<()>>, _>>()
    });
    let done =
        done.map_err(|_| "a thread of the computation failed; this is a defect of fretwork")?;
    Ok(done.into_iter().collect())
}
