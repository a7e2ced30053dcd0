//! Measures the wall-clock time and the processor time of a computation.

use std::time::{Duration, Instant};

use fretwork_job::Cost;

/// Measures the processor time of the thread that starts it. Read it on the same thread.
#[derive(Clone, Copy)]
pub struct Stopwatch {
    started: Instant,
    cpu: Option<Duration>,
}

impl Stopwatch {
    /// Starts the measurement.
    pub fn start() -> Self {
        Self { started: Instant::now(), cpu: thread_time() }
    }

    /// Wall-clock time since the start.
    pub fn elapsed(&self) -> Duration {
        self.started.elapsed()
    }

    /// Wall-clock time and processor time since the start.
    pub fn cost(&self) -> Cost {
        let since = |before| thread_time().map(|now| now.saturating_sub(before));
        Cost { wall: self.elapsed(), cpu: self.cpu.and_then(since) }
    }
}

/// The processor time of this thread.
#[cfg(unix)]
fn thread_time() -> Option<Duration> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::try_from(time).ok()
}

#[cfg(not(unix))]
fn thread_time() -> Option<Duration> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn a_sleeping_thread_uses_no_processor_time() {
        let watch = Stopwatch::start();
        std::thread::sleep(Duration::from_millis(200));
        let Cost { wall, cpu } = watch.cost();
        assert!(wall >= Duration::from_millis(200));
        assert!(cpu.is_some_and(|cpu| cpu < wall / 2), "{cpu:?}");
    }
}
