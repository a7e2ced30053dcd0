//! Measures for how long the database has answered without a pause. After a pause of the database or of this process,
//! other servers need time to renew their leases. Until then, this server does not treat an expired lease as lost. The
//! same holds after a step of the clock of the database.

use std::time::Duration;

use parking_lot::Mutex;
use tokio::time::Instant;

/// The time for which the database has answered without a pause.
#[derive(Debug)]
pub(super) struct Contact {
    /// A pause that is at least this long interrupts the contact. A contact must last this long before leases are
    /// revoked.
    enough: Duration,
    /// Maximum difference between the times that have passed by the clock of the database and by the clock of this
    /// process. Leases are renewed so early that a smaller step of the clock ends none. Late answers also cause a
    /// difference.
    tolerance: Duration,
    /// When the contact began, and the last answer.
    times: Mutex<Option<(Instant, DatabaseAnswer)>>,
}

/// An answer of the database.
#[derive(Debug, Clone, Copy)]
struct DatabaseAnswer {
    at: Instant,
    /// The time by the clock of the database, in milliseconds.
    clock: i64,
}

impl Contact {
    pub(super) fn new(lease: Duration) -> Self {
        Self { enough: lease / 2, tolerance: lease / 3, times: Mutex::default() }
    }

    /// Records an answer of the database, whose clock shows this time. Returns whether the contact has lasted long
    /// enough to revoke leases.
    pub(super) fn goes_on(&self, clock: i64) -> bool {
        let now = DatabaseAnswer { at: Instant::now(), clock };
        let mut times = self.times.lock();
        let began =
            times.filter(|(_, last)| self.is_soon_after(*last, now)).map(|(began, _)| began);
        let began = began.unwrap_or(now.at);
        *times = Some((began, now));
        began.elapsed() >= self.enough
    }

    /// Whether there was neither a pause nor a step of the clock between two answers. The clock of this process stands
    /// still while the machine sleeps, so sleep also counts as a step.
    fn is_soon_after(&self, last: DatabaseAnswer, now: DatabaseAnswer) -> bool {
        let passed = now.at - last.at;
        let step = now.clock - last.clock - (passed.as_millis() as u64).cast_signed();
        passed < self.enough && step.unsigned_abs() <= self.tolerance.as_millis() as u64
    }

    /// Ends the contact, because the database has not answered.
    pub(super) fn ends(&self) {
        *self.times.lock() = None;
    }
}

#[cfg(test)]
mod tests {
    use tokio::time;

    use super::*;

    /// Simulates one answer of the database per second. The clock of the database is ahead by `ahead` milliseconds.
    /// Returns whether the contact has lasted long enough after the last answer.
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
