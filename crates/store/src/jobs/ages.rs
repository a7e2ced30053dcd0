//! The clock that measures ages of jobs and results.

use std::time::Instant;

use fretwork_job::clock::now;

/// The clock that measures ages of jobs and results, in milliseconds since 1970.
///
/// It follows the system clock. But it advances only while the server runs, at most twice as fast as real time. So
/// nothing is deleted because the system clock has jumped ahead. After a pause of the server, it catches up slowly.
pub(crate) struct AgeClock {
    time: i64,
    /// When the clock was last advanced.
    read: Instant,
    /// The time that was last stored in the database.
    stored: i64,
}

/// Interval at which the time is stored, in milliseconds: 10 minutes.
const STORE_CLOCK: i64 = 10 * 60 * 1000;

impl AgeClock {
    pub(crate) fn at(stored: Option<i64>) -> Self {
        Self { time: stored.unwrap_or_else(now), read: Instant::now(), stored: stored.unwrap_or(0) }
    }

    /// Advances towards the time of the system clock. Returns the earlier one of the two times.
    pub(crate) fn advance(&mut self, system: i64) -> i64 {
        let passed = i64::try_from(self.read.elapsed().as_millis()).unwrap_or(i64::MAX);
        self.read = Instant::now();
        self.time = self.time.max(system.min(self.time.saturating_add(passed.saturating_mul(2))));
        self.time.min(system)
    }

    /// The time, if it must be stored now. The caller stores it.
    pub(crate) fn unstored(&mut self) -> Option<i64> {
        let due = (self.time - self.stored).abs() >= STORE_CLOCK;
        due.then(|| {
            self.stored = self.time;
            self.time
        })
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    const DAY: i64 = 24 * 3600 * 1000;

    #[test]
    fn the_clock_for_ages_ignores_jumps_of_the_system_clock() {
        let start = now() - 5 * DAY;
        let mut clock = AgeClock::at(Some(start));
        for jump in [365 * DAY, -365 * DAY, 0] {
            let time = clock.advance(now() + jump);
            assert!(time < start + 60_000, "{}", time - start);
            assert!(jump < 0 || time >= start, "{}", time - start);
        }
        assert!(clock.unstored().is_none(), "it has hardly advanced");
    }

    #[test]
    fn the_clock_for_ages_catches_up_at_twice_the_speed() {
        let start = now() - 5 * DAY;
        let mut clock = AgeClock::at(Some(start));
        clock.read -= Duration::from_hours(24);
        let time = clock.advance(now());
        assert!((start + 2 * DAY..start + 2 * DAY + 60_000).contains(&time), "{}", time - start);
        assert_eq!(clock.unstored(), Some(time));
        clock.read -= Duration::from_hours(72);
        assert!((now() - clock.advance(now())).abs() < 60_000, "it does not overtake the system");
    }
}
