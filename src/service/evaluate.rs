//! Computing at once, keeping nothing.

use crate::job::{Answer, Prepared, Step};

/// Computes a task on this thread; `progress` is told the share of the work done, in 0…1, after each step.
pub fn evaluate(prepared: &Prepared, mut progress: impl FnMut(f64)) -> Answer {
    let mut work = prepared.start();
    loop {
        match work.step() {
            Step::Done(answer) => return answer,
            Step::Working { progress: share } => progress(share),
        }
    }
}
