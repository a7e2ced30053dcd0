//! Computes the points of a study, step by step.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use super::{Lack, PointRun, Rows, Study, Tried};

/// Why a point has no row.
const PANICKED: &str =
    "the engine panicked: this is a defect of fretwork. Please report this point";

/// The computation of consecutive points of a study.
#[derive(Debug)]
pub struct Points {
    study: Arc<Study>,
    /// The points that have no row yet.
    rest: Range<usize>,
    all: usize,
    point: PointRun,
    rows: Rows,
    /// The rows of earlier stages, if other chunks have computed them.
    earlier: Option<Rows>,
}

impl Points {
    /// All points of a study.
    pub fn whole(study: Arc<Study>) -> Self {
        Self::chunk(study, 0, 1, Rows::default())
    }

    /// Chunk number `number` of `chunks` of about the same size. `earlier` has the rows of the
    /// [earlier chunks](Study::earlier_chunks), or more rows.
    pub fn chunk(study: Arc<Study>, number: usize, chunks: usize, earlier: Rows) -> Self {
        let points = study.points_of(number, chunks);
        Self {
            study,
            all: points.len(),
            rest: points,
            point: PointRun::default(),
            rows: Rows::default(),
            earlier: (chunks > 1).then_some(earlier),
        }
    }

    /// The share of the points that have a row, in 0…1.
    pub fn progress(&self) -> f64 {
        (self.all - self.rest.len()) as f64 / self.all.max(1) as f64
    }

    /// Continues for at most about 30 ms. Returns the rows when all points have one.
    pub fn step(&mut self) -> Option<Rows> {
        if self.rest.is_empty() {
            return Some(std::mem::take(&mut self.rows));
        }
        let (study, number) = (&self.study, self.rest.start);
        let earlier = self.earlier.as_ref().unwrap_or(&self.rows);
        // A defect of the engine at one point must not end the study. The closure is unwind safe: after a panic, no value that
        // it has changed is used.
        let row = catch_unwind(AssertUnwindSafe(|| study.step(number, earlier, &mut self.point)));
        let row = row
            .unwrap_or_else(|_| Some(study.lacks_all(number, Lack::Refused(PANICKED.to_owned()))));
        if let Some(Tried { values, found }) = row {
            self.rows.push(&values, &found);
            self.point = PointRun::default();
            self.rest.start += 1;
        }
        None
    }
}
