//! For how long the database has answered without a pause. After a pause of the database or of this process, other nodes need
//! time to renew their leases before one of them counts as lost.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

use tokio::time::Instant;

/// For how long the database has answered without a pause.
#[derive(Debug)]
pub(super) struct Contact {
    /// A shorter pause is none; and how long a contact must last.
    enough: Duration,
    /// When it began, and when the database answered last.
    times: Mutex<Option<(Instant, Moment)>>,
}

/// A moment by both clocks. One of them stands still while the machine sleeps, the other one can be set.
#[derive(Debug, Clone, Copy)]
struct Moment(Instant, SystemTime);

impl Moment {
    fn now() -> Self {
        Self(Instant::now(), SystemTime::now())
    }

    fn elapsed(&self) -> Duration {
        self.0.elapsed().max(self.1.elapsed().unwrap_or_default())
    }
}

impl Contact {
    pub(super) fn new(lease: Duration) -> Self {
        Self { enough: lease / 2, times: Mutex::default() }
    }

    /// The database has answered.
    pub(super) fn goes_on(&self) {
        let now = Moment::now();
        let mut times = self.times();
        let began = times.filter(|(_, last)| last.elapsed() < self.enough).map(|(began, _)| began);
        *times = Some((began.unwrap_or(now.0), now));
    }

    /// The database has not answered.
    pub(super) fn ends(&self) {
        *self.times() = None;
    }

    /// Whether it has lasted long enough to take leases away.
    pub(super) fn lasts(&self) -> bool {
        self.times().is_some_and(|(began, last)| {
            began.elapsed() >= self.enough && last.elapsed() < self.enough
        })
    }

    /// A poisoned lock is safe: each change is one assignment.
    fn times(&self) -> MutexGuard<'_, Option<(Instant, Moment)>> {
        self.times.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use tokio::time;

    use super::*;

    #[tokio::test(start_paused = true)]
    async fn a_contact_is_interrupted_by_an_error_and_by_a_pause_of_the_process() {
        let contact = Contact::new(Duration::from_secs(30));
        let answers_for = async |seconds| {
            for _ in 0..seconds {
                time::sleep(Duration::from_secs(1)).await;
                contact.goes_on();
            }
        };
        assert!(!contact.lasts());
        answers_for(15).await;
        assert!(!contact.lasts(), "it began after the first second");
        answers_for(1).await;
        assert!(contact.lasts());
        contact.ends();
        assert!(!contact.lasts());
        answers_for(16).await;
        assert!(contact.lasts());
        time::sleep(Duration::from_secs(20)).await;
        assert!(!contact.lasts(), "the database was not asked for a while");
        contact.goes_on();
        assert!(!contact.lasts(), "the process has slept");
        answers_for(15).await;
        assert!(contact.lasts());
    }
}
