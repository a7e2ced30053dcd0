//! Computes a task without storing anything.

use crate::job::{Answer, Prepared, Step};

/// Computes a task on this thread. Calls `progress` after each step with the share of the work that is
/// done, in 0…1.
pub fn evaluate(prepared: &Prepared, mut progress: impl FnMut(f64)) -> Answer {
    let mut work = prepared.start();
    loop {
        match work.step() {
            Step::Done(answer) => return answer,
            Step::Working { progress: share } => progress(share),
        }
    }
}
