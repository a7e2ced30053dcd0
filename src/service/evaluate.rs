//! Evaluates scenarios: runs that are computed at once and not stored.

use std::time::Duration;

use super::Service;
use super::places::{INLINE, INLINE_BYTES, MAX_WAIT, Unfinished};
use super::turns::turns;
use fretwork_job::{Answer, Prepared, Step};
use fretwork_study::{Evaluated, Evaluation, LONGEST_EVALUATION as MILLISECONDS};

/// Largest answer of an evaluation, in bytes. Writing such an answer takes some milliseconds.
pub const LARGEST_EVALUATION: usize = 2_000_000;
/// Longest estimated time of an evaluation.
pub const LONGEST_EVALUATION: Duration = Duration::from_millis(MILLISECONDS);
/// Maximum processor time of an evaluation. If it takes longer on any machine, its estimate was grossly wrong.
const MAX_EVALUATION: Duration = LONGEST_EVALUATION.saturating_mul(10);

/// Why a scenario was not evaluated.
#[derive(Debug, thiserror::Error)]
pub enum NotEvaluated {
    /// The run would take too long.
    #[error(
        "The run would take about {:.2} s; the limit of an evaluation is {MILLISECONDS} ms.", .0.as_secs_f64()
    )]
    TooLong(Duration),
    /// The answer would be too large.
    #[error(
        "The answer would have about {:.1} MB; the limit of an evaluation is {:.1} MB. Request fewer `parts`, or \
         profiles at fewer output cycles (`profiles_at`).", *.0 as f64 / 1e6, LARGEST_EVALUATION as f64 / 1e6
    )]
    TooLarge(usize),
    /// The run took much longer than its estimate.
    #[error(
        "The run was estimated to take less than {MILLISECONDS} ms, but it took much longer and was stopped."
    )]
    Stopped,
    /// Other evaluations took all places.
    #[error("Other evaluations use all workers. Try again in a second.")]
    Busy,
    /// The engine has a bug.
    #[error("the engine panicked")]
    Panicked,
}

impl Service {
    /// Computes a run at once, in turns. It does not use the database.
    ///
    /// # Errors
    /// The run is too long, or the service has no place for it.
    pub async fn evaluate(&self, mut evaluation: Evaluation) -> Result<Evaluated, NotEvaluated> {
        let (seconds, bytes) = (evaluation.seconds(), evaluation.answer_bytes());
        if bytes > LARGEST_EVALUATION {
            return Err(NotEvaluated::TooLarge(bytes));
        }
        self.at_once(seconds, evaluation.body_bytes, move || evaluation.step()).await
    }

    /// As [`evaluate`](Self::evaluate), for all of a run.
    ///
    /// # Errors
    /// The run is too long, or the service has no place for it.
    pub async fn recompute(&self, run: &Prepared) -> Result<Answer, NotEvaluated> {
        let mut work = run.start();
        let step = move || match work.step() {
            Step::Done(answer) => Some(answer),
            Step::Working { .. } => None,
        };
        self.at_once(run.seconds, run.stored.len(), step).await
    }

    /// Calls `step` until it returns the outcome. `seconds` is the estimated time of the computation.
    async fn at_once<T: Send + 'static>(
        &self,
        seconds: f64,
        body_bytes: usize,
        step: impl FnMut() -> Option<T> + Send + 'static,
    ) -> Result<T, NotEvaluated> {
        let estimate = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        if estimate > LONGEST_EVALUATION {
            return Err(NotEvaluated::TooLong(estimate));
        }
        let inline = seconds < INLINE && body_bytes <= INLINE_BYTES;
        let turn = turns(MAX_EVALUATION, step);
        match self.0.places.compute_in_turns(inline, MAX_WAIT, turn).await {
            Ok(evaluated) => evaluated.ok_or(NotEvaluated::Stopped),
            Err(Unfinished::NoPlace) => Err(NotEvaluated::Busy),
            Err(Unfinished::Panicked) => Err(NotEvaluated::Panicked),
        }
    }
}
