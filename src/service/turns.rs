//! Long computations, in turns, while their clients wait.
//!
//! A computation gives its place back after each turn of about 30 ms. So it does not delay the evaluations of others
//! for long, and it ends when its client has disconnected.

use std::time::Duration;

use super::Service;
use super::places::{INLINE, Unfinished};
use super::stopwatch::Stopwatch;
use fretwork_job::Cost;

/// Longest estimated time of a computation that a client waits for.
pub const LONGEST_CALL: Duration = Duration::from_secs(30);
/// Maximum processor time of such a computation. If it takes longer, its estimate was grossly wrong.
pub const MAX_CALL: Duration = Duration::from_mins(1);
/// A turn ends after the first step at whose end it has taken at least this time.
const TURN: Duration = Duration::from_millis(20);

/// Why a computation has no outcome.
#[derive(Debug, thiserror::Error)]
pub enum Unable {
    /// The computation would take too long.
    #[error("The computation would take about {:.0} s; the limit of a request is {} s.", .0.as_secs_f64(), LONGEST_CALL.as_secs())]
    TooLong(Duration),
    /// The computation took much longer than its estimate.
    #[error(
        "The computation was estimated to take less than {LONGEST_CALL:?}. It was stopped after {MAX_CALL:?}."
    )]
    Stopped,
    /// The engine has a bug.
    #[error("the engine panicked")]
    Panicked,
}

impl Service {
    /// Calls `step` until it returns the outcome. Each call computes for at most about 30 ms. `seconds` is the
    /// estimated time of the whole computation.
    ///
    /// # Errors
    /// The computation takes too long, or panics.
    pub async fn compute_in_turns<T: Send + 'static>(
        &self,
        seconds: f64,
        step: impl FnMut() -> Option<T> + Send + 'static,
    ) -> Result<T, Unable> {
        let estimate = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        if estimate > LONGEST_CALL {
            return Err(Unable::TooLong(estimate));
        }
        let turn = turns(MAX_CALL, step);
        match self.0.places.compute_in_turns(seconds < INLINE, Duration::MAX, turn).await {
            Ok(outcome) => outcome.ok_or(Unable::Stopped),
            Err(Unfinished::NoPlace | Unfinished::Panicked) => Err(Unable::Panicked),
        }
    }
}

/// Divides a computation into turns. A turn returns `Some(None)` if the computation took more than `limit` of processor
/// time: on a busy machine, a thread may wait for longer than it computes.
pub fn turns<T>(
    limit: Duration,
    mut step: impl FnMut() -> Option<T>,
) -> impl FnMut() -> Option<Option<T>> {
    let mut used = Duration::ZERO;
    move || {
        let watch = Stopwatch::start();
        loop {
            let outcome = step();
            if outcome.is_some() {
                return Some(outcome);
            }
            let Cost { wall, cpu } = watch.cost();
            if wall >= TURN {
                used += cpu.unwrap_or(wall);
                return (used > limit).then_some(None);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_computation_ends_with_its_outcome_or_at_its_limit() {
        let mut steps = 0;
        let step = || {
            steps += 1;
            (steps == 3).then_some(steps)
        };
        // On a busy machine, a turn can end before its third step.
        let outcome = std::iter::repeat_with(turns(Duration::MAX, step)).flatten().next();
        assert_eq!(outcome, Some(Some(3)));
        let endless = || None::<()>;
        assert_eq!(turns(Duration::MAX, endless)(), None, "it needs another turn");
        assert_eq!(turns(Duration::ZERO, endless)(), Some(None));
    }
}
