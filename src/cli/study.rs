//! The command `run` for studies: computes a study without a server, on all processor cores.

use std::iter;
use std::sync::Arc;

use super::printing::{Error, Progress};
use super::runtime::on_all_cores;
use fretwork_study::{Points, Rows, Study};

/// Computes all rows on all cores, one stage after another, and shows the progress.
pub fn compute(study: &Arc<Study>, progress: &mut Progress) -> Result<Rows, Error> {
    let count = study.chunks();
    let (mut all, mut first) = (Rows::default(), 0);
    while first < count {
        let is_same_stage = |number: &usize| study.earlier_chunks(*number, count) <= first;
        let end = (first..count).take_while(is_same_stage).last().map_or(count, |last| last + 1);
        let (study, earlier) = (Arc::clone(study), all.clone());
        let work = move |number| chunk(&study, number, count, earlier.clone());
        on_all_cores((first..end).collect(), (&mut *progress, first..count), work, |rows| {
            all.append(rows?);
            Ok(())
        })?;
        first = end;
    }
    Ok(all)
}

/// Computes one of `count` chunks. `earlier` has the rows of earlier stages.
pub fn chunk(study: &Arc<Study>, number: usize, count: usize, earlier: Rows) -> Rows {
    let mut points = Points::chunk(Arc::clone(study), number, count, earlier);
    iter::repeat_with(|| points.step()).find_map(|rows| rows).unwrap_or_default()
}
