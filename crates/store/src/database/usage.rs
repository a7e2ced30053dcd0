//! How much the workers of this process have computed for each owner lately. By this, owners take turns.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use parking_lot::Mutex;

/// What was computed this long ago counts half.
const LATELY: Duration = Duration::from_secs(10);
/// Times are compared in this unit, so that short runs take turns by their number.
const UNIT: Duration = Duration::from_millis(100);
/// If there are more owners than this, those without a whole unit are forgotten.
const MANY: usize = 1000;

/// The owners whose work a claim may take.
#[derive(Debug, Clone)]
pub struct Owners {
    /// Their usage is below this.
    pub below: u64,
    /// They are not among these.
    pub except: Vec<String>,
}

impl Owners {
    /// All owners.
    pub const ALL: Self = Self { below: u64::MAX, except: Vec::new() };

    /// The usage of an owner, if the claim may take its work.
    pub(crate) fn usage_of(&self, owner: &str, usage: &Usage, now: Instant) -> Option<u64> {
        let used = usage.of(owner, now);
        (used < self.below && !self.except.iter().any(|other| other == owner)).then_some(used)
    }
}

/// The time that was computed lately for each owner, and when it was added up.
#[derive(Debug, Default)]
pub(crate) struct Usage(Mutex<HashMap<String, (f64, Instant)>>);

impl Usage {
    /// Adds the time of a computation that ends now.
    pub(crate) fn add(&self, owner: &str, time: Duration, now: Instant) {
        let mut owners = self.0.lock();
        if owners.len() > MANY {
            owners.retain(|_, used| units(*used, now) > 0);
        }
        let used = owners.entry(owner.to_owned()).or_insert((0.0, now));
        *used = (left(*used, now) + time.as_secs_f64(), now);
    }

    /// The whole units that were computed lately for an owner.
    pub(crate) fn of(&self, owner: &str, now: Instant) -> u64 {
        self.0.lock().get(owner).map_or(0, |used| units(*used, now))
    }
}

/// What still counts of a time, in seconds.
#[expect(clippy::disallowed_methods, reason = "no digits of results depend on it")]
fn left((seconds, at): (f64, Instant), now: Instant) -> f64 {
    seconds * (-now.duration_since(at).div_duration_f64(LATELY)).exp2()
}

fn units(used: (f64, Instant), now: Instant) -> u64 {
    (left(used, now) / UNIT.as_secs_f64()) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_counts_less_the_longer_ago_it_was() {
        let (usage, start) = (Usage::default(), Instant::now());
        usage.add("ada", 10 * UNIT, start);
        usage.add("ada", 10 * UNIT, start);
        assert_eq!([usage.of("ada", start), usage.of("bob", start)], [20, 0]);
        assert_eq!(usage.of("ada", start + LATELY), 10);
        usage.add("ada", UNIT, start + LATELY);
        assert_eq!(usage.of("ada", start + LATELY), 11);
    }

    #[test]
    fn owners_of_short_runs_long_ago_are_forgotten() {
        let (usage, start) = (Usage::default(), Instant::now());
        for owner in 0..=MANY {
            usage.add(&owner.to_string(), UNIT, start);
        }
        usage.add("ada", UNIT, start + LATELY);
        assert_eq!(usage.0.lock().len(), 1);
    }
}
