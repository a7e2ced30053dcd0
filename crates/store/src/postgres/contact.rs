//! For how long the database has answered without a pause. After a pause of the database or of this process, other nodes need
//! time to renew their leases before one of them counts as lost. They also need it after the clock of the database was set.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::time::Instant;

/// For how long the database has answered without a pause.
#[derive(Debug)]
pub(super) struct Contact {
    /// A shorter pause is none; and how long a contact must last.
    enough: Duration,
    /// How much more or less time may have passed by the clock of the database than here. Leases are renewed so early that a
    /// smaller step ends none, and an answer may be late.
    tolerance: Duration,
    /// When it began, and the last answer.
    times: Mutex<Option<(Instant, Answer)>>,
}

/// An answer of the database.
#[derive(Debug, Clone, Copy)]
struct Answer {
    at: Instant,
    /// The time by the clock of the database, in milliseconds.
    clock: i64,
}

impl Contact {
    pub(super) fn new(lease: Duration) -> Self {
        Self { enough: lease / 2, tolerance: lease / 3, times: Mutex::default() }
    }

    /// The database has answered, and its clock shows this time. Returns whether the contact has lasted long enough to take
    /// leases away.
    pub(super) fn goes_on(&self, clock: i64) -> bool {
        let now = Answer { at: Instant::now(), clock };
        let mut times = self.times();
        let began =
            times.filter(|(_, last)| self.is_soon_after(*last, now)).map(|(began, _)| began);
        let began = began.unwrap_or(now.at);
        *times = Some((began, now));
        began.elapsed() >= self.enough
    }

    /// Whether there was no pause between two answers, and no step of the clock. The own clock stands still while the machine
    /// sleeps, which looks like a step.
    fn is_soon_after(&self, last: Answer, now: Answer) -> bool {
        let passed = now.at - last.at;
        let step = now.clock - last.clock - (passed.as_millis() as u64).cast_signed();
        passed < self.enough && step.unsigned_abs() <= self.tolerance.as_millis() as u64
    }

    /// The database has not answered.
    pub(super) fn ends(&self) {
        *self.times() = None;
    }

    /// A poisoned lock is safe: each change is one assignment.
    fn times(&self) -> MutexGuard<'_, Option<(Instant, Answer)>> {
        self.times.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use tokio::time;

    use super::*;

    /// Lets seconds pass, after each of which the database answers. Its clock is ahead by a time. Returns whether the contact
    /// lasts then.
    async fn answers_for(contact: &Contact, seconds: u64, start: Instant, ahead: i64) -> bool {
        let mut lasts = false;
        for _ in 0..seconds {
            time::sleep(Duration::from_secs(1)).await;
            lasts = contact.goes_on(start.elapsed().as_millis() as i64 + ahead);
        }
        lasts
    }

    #[tokio::test(start_paused = true)]
    async fn a_contact_is_interrupted_by_an_error_and_by_a_pause_of_the_process() {
        let (contact, start) = (Contact::new(Duration::from_secs(30)), Instant::now());
        let answers_for = async |seconds| answers_for(&contact, seconds, start, 0).await;
        assert!(!answers_for(15).await, "it began after the first second");
        assert!(answers_for(1).await);
        contact.ends();
        assert!(!answers_for(15).await);
        assert!(answers_for(1).await);
        time::sleep(Duration::from_secs(20)).await;
        assert!(!answers_for(15).await, "the process has slept");
        assert!(answers_for(1).await);
    }

    #[tokio::test(start_paused = true)]
    async fn a_contact_is_interrupted_by_a_step_of_the_clock_of_the_database() {
        let (contact, start) = (Contact::new(Duration::from_secs(30)), Instant::now());
        let mut ahead = 0;
        for step in [3_600_000, -3_600_000, -86_400_000, 86_400_000, 12_000, -12_000] {
            assert!(answers_for(&contact, 16, start, ahead).await);
            ahead += step;
            assert!(!answers_for(&contact, 15, start, ahead).await, "{step} ms");
        }
        assert!(answers_for(&contact, 1, start, ahead).await);
        assert!(answers_for(&contact, 1, start, ahead + 9000).await, "no lease can end by so much");
    }
}
