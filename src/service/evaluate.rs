//! Evaluates scenarios: runs of milliseconds that are computed at once and not stored.

use std::cell::LazyCell;
use std::time::Duration;

use super::Service;
use super::places::{INLINE, INLINE_BYTES, MAX_TIME, SHORT, Unfinished};
use super::stopwatch::Stopwatch;
use fretwork_job::Cost;
use fretwork_study::{Evaluated, Evaluation};

/// Largest answer of an evaluation, in bytes. Writing such an answer takes some milliseconds.
pub const LARGEST_EVALUATION: usize = 2_000_000;
/// Longest estimated time of an evaluation.
pub const LONGEST_EVALUATION: Duration = Duration::from_millis((SHORT * 1e3) as u64);

/// Why a scenario was not evaluated.
#[derive(Debug, thiserror::Error)]
pub enum NotEvaluated {
    /// The run would take too long.
    #[error("the run would take {0:?}, too long for an evaluation")]
    TooLong(Duration),
    /// The answer would be too large.
    #[error("the answer would have {0} bytes, too many for an evaluation")]
    TooLarge(usize),
    /// The run took much longer than its estimate.
    #[error("the run took longer than {MAX_TIME:?} and was stopped")]
    Stopped,
    /// Other evaluations took all places.
    #[error("other evaluations use all workers; try again")]
    Busy,
    /// The engine has a bug.
    #[error("the engine panicked")]
    Panicked,
}

impl Service {
    /// Computes a short run at once. It does not use the database.
    ///
    /// # Errors
    /// The run is not short, or the service has no place for it.
    pub async fn evaluate(&self, evaluation: Evaluation) -> Result<Evaluated, NotEvaluated> {
        let seconds = evaluation.seconds();
        if seconds > SHORT {
            let estimate = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
            return Err(NotEvaluated::TooLong(estimate));
        }
        let (bytes, body_bytes) = (evaluation.answer_bytes(), evaluation.body_bytes);
        if bytes > LARGEST_EVALUATION {
            return Err(NotEvaluated::TooLarge(bytes));
        }
        let work = move || {
            // The watch starts after the first step. Most runs need only one step, and starting the watch takes some
            // microseconds.
            let watch = LazyCell::new(Stopwatch::start);
            evaluation.compute(|| {
                // The limit is one of processor time, because on a busy machine a thread may wait for longer than it
                // computes.
                let Cost { wall, cpu } = watch.cost();
                cpu.unwrap_or(wall) < MAX_TIME
            })
        };
        let inline = seconds < INLINE && body_bytes <= INLINE_BYTES;
        match self.0.places.compute(inline, work).await {
            Ok(evaluated) => evaluated.ok_or(NotEvaluated::Stopped),
            Err(Unfinished::NoPlace) => Err(NotEvaluated::Busy),
            Err(Unfinished::Panicked) => Err(NotEvaluated::Panicked),
        }
    }
}
