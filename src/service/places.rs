//! Limits the number of computations that run at the same time while their clients wait.

use std::panic::{self, AssertUnwindSafe};
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::Semaphore;
use tokio::task;
use tokio::time::timeout;

/// Longest estimated time of a run that a submission waits for without the queue, in seconds.
pub const SHORT: f64 = 0.02;
/// Maximum time of such a run. If it takes longer, its estimate was grossly wrong.
pub const MAX_TIME: Duration = Duration::from_millis(50);
/// Computations with a shorter estimated time, in seconds, run on the async thread: passing them to another thread
/// would take as long. A default run without profiles has an estimate of 2e-4.
pub const INLINE: f64 = 3e-4;
/// Longest scenario, in bytes, whose run is computed on the async thread.
pub const INLINE_BYTES: usize = 1 << 14;
/// Longest wait for the first place.
pub const MAX_WAIT: Duration = Duration::from_millis(250);

/// A computation needs one of these places. There are as many as workers, because more computations at a time would
/// only share the processors.
pub struct Places {
    free: Arc<Semaphore>,
    /// How many there are.
    pub number: usize,
}

/// Why a computation has no outcome.
pub enum Unfinished {
    /// All places were taken.
    NoPlace,
    /// The computation panicked.
    Panicked,
}

impl Places {
    pub fn new(number: usize) -> Self {
        Self { free: Arc::new(Semaphore::new(number)), number }
    }

    /// Calls `turn` until it returns an outcome. Waits for a place before each turn; before the first one, at most for
    /// `patience`. Places are given in the order of the requests, so the turns of long computations do not delay a short
    /// one for long. Only the first turn can run on the async thread.
    ///
    /// # Errors
    /// There is no place, or a turn panics.
    pub async fn compute_in_turns<T: Send + 'static>(
        &self,
        mut inline: bool,
        mut patience: Duration,
        mut turn: impl FnMut() -> Option<T> + Send + 'static,
    ) -> Result<T, Unfinished> {
        loop {
            let place = timeout(patience, Arc::clone(&self.free).acquire_owned()).await;
            let place = place.ok().and_then(Result::ok).ok_or(Unfinished::NoPlace)?;
            let work = move || {
                let _place = place;
                (turn(), turn)
            };
            let done = if inline {
                panic::catch_unwind(AssertUnwindSafe(work)).ok()
            } else {
                task::spawn_blocking(work).await.ok()
            };
            let (outcome, next) = done.ok_or(Unfinished::Panicked)?;
            if let Some(outcome) = outcome {
                return Ok(outcome);
            }
            (turn, inline, patience) = (next, false, Duration::MAX);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    async fn compute<T: Send + 'static>(
        places: &Places,
        inline: bool,
        work: fn() -> T,
    ) -> Result<T, Unfinished> {
        places.compute_in_turns(inline, MAX_WAIT, move || Some(work())).await
    }

    #[tokio::test(start_paused = true)]
    async fn a_computation_waits_for_a_place_for_a_short_time() {
        let places = Places::new(1);
        let taken = Arc::clone(&places.free).acquire_owned().await.unwrap();
        assert!(matches!(compute(&places, true, || 1).await, Err(Unfinished::NoPlace)));
        let (soon, ()) = tokio::join!(compute(&places, true, || 2), async {
            tokio::time::sleep(MAX_WAIT / 2).await;
            drop(taken);
        });
        assert!(matches!(soon, Ok(2)));
    }

    #[tokio::test(start_paused = true)]
    async fn another_computation_can_run_between_two_turns() {
        let places = Places::new(1);
        let mut turns = 0;
        let long = places.compute_in_turns(true, MAX_WAIT, move || {
            turns += 1;
            (turns == 3).then_some(turns)
        });
        let (long, short) = tokio::join!(long, compute(&places, true, || 1));
        assert!(matches!((long, short), (Ok(3), Ok(1))));
    }

    #[tokio::test(start_paused = true)]
    async fn a_short_computation_waits_for_one_turn_of_each_long_one() {
        let places = Places::new(1);
        let ended = parking_lot::Mutex::new(Vec::new());
        let long = async |name| {
            let mut turns = 0;
            let end = places.compute_in_turns(false, Duration::MAX, move || {
                turns += 1;
                (turns == 9).then_some(())
            });
            assert!(end.await.is_ok());
            ended.lock().push(name);
        };
        let short = async {
            assert!(compute(&places, true, || ()).await.is_ok());
            ended.lock().push("short");
        };
        tokio::join!(long("first"), long("second"), short);
        assert_eq!(ended.into_inner()[0], "short");
        let _taken = Arc::clone(&places.free).acquire_owned().await.unwrap();
        let refused = places.compute_in_turns(true, MAX_WAIT, || Some(())).await;
        assert!(matches!(refused, Err(Unfinished::NoPlace)));
    }

    #[tokio::test]
    async fn a_panic_frees_its_place() {
        let places = Places::new(1);
        for inline in [true, false] {
            let panicked = compute(&places, inline, || panic!("a bug")).await;
            assert!(matches!(panicked, Err::<(), _>(Unfinished::Panicked)));
            assert!(matches!(compute(&places, inline, || 1).await, Ok(1)));
        }
    }
}
