//! Prepared tasks of queued runs, kept in memory so that a worker need not parse them again.
//!
//! The queue is in the database. A task that is not in memory, because the budget was full or the server has
//! restarted, is prepared again from its stored form.

use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};

use fretwork_job::{Key, Prepared};

/// Maximum memory of all waiting tasks, in bytes. It fills up where `fretwork worker` shares the queue: tasks whose runs
/// other processes have claimed stay until newer tasks need the space.
const BUDGET: u64 = 4 << 20;
/// Expected number of tasks. Most of them take about 4 kB.
const EXPECTED: usize = 1024;

/// Prepared tasks by the key of their run.
pub struct Waiting(Cache<Key, Prepared, Bytes>);

#[derive(Debug, Clone)]
struct Bytes;

impl Weighter<Key, Prepared> for Bytes {
    fn weight(&self, _: &Key, prepared: &Prepared) -> u64 {
        prepared.bytes() as u64
    }
}

impl Default for Waiting {
    #[expect(clippy::expect_used, reason = "both capacities are set")]
    fn default() -> Self {
        let options = OptionsBuilder::new()
            .estimated_items_capacity(EXPECTED)
            .weight_capacity(BUDGET)
            // Each task is taken at most once. So half of the space is for the newest tasks, even if tasks that nothing here will
            // take fill the other half.
            .hot_allocation(0.5)
            .shards(1)
            .build()
            .expect("the options are complete");
        let (hash, life) = (DefaultHashBuilder::default(), DefaultLifecycle::default());
        Self(Cache::with_options(options, Bytes, hash, life))
    }
}

impl Waiting {
    /// Keeps a task until its run is claimed, or until newer tasks need the space. Returns false if an equal task
    /// is kept already.
    pub fn keep(&self, prepared: Prepared) -> bool {
        let is_new = self.0.peek(&prepared.key).is_none();
        if is_new {
            self.0.insert(prepared.key, prepared);
        }
        is_new
    }

    /// Removes a task and returns it.
    pub fn take(&self, key: &Key) -> Option<Prepared> {
        self.0.remove(key).map(|(_, prepared)| prepared)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// A run whose displacement record has `reversals` reversals.
    fn prepared(reversals: u32) -> Prepared {
        let reversal =
            |i: u32| f64::from(1 + i % 97) * if i.is_multiple_of(2) { 1e-8 } else { -1e-8 };
        let scenario = json!({
            "profile": {"shape": "paraboloid", "radius": "10 mm"},
            "moduli": {"normal": "112 GPa", "tangential": "92 GPa"},
            "friction": 0.5,
            "wear": {"coefficient": "3e-5 mm^3/(N m)"},
            "load": {"normal_force": "100 N", "held": "depth"},
            "motion": {"reversals": (0..reversals).map(reversal).collect::<Vec<_>>()},
            "cycles": [1000],
            "profiles_at": "none",
        });
        Prepared::from_scenario(scenario, "").unwrap_or_else(|faults| panic!("{faults:?}"))
    }

    #[test]
    fn a_waiting_task_can_be_taken_only_once() {
        let waiting = Waiting::default();
        let task = prepared(4);
        waiting.keep(task.clone());
        assert_eq!(waiting.take(&task.key).map(|taken| taken.key), Some(task.key));
        assert!(waiting.take(&task.key).is_none());
    }

    #[test]
    fn the_memory_of_waiting_tasks_is_limited_and_the_newest_are_kept() {
        let waiting = Waiting::default();
        let large = prepared(2000);
        let space = BUDGET / large.bytes() as u64;
        let key = |number: u64| {
            let mut bytes = [0; 32];
            bytes[..8].copy_from_slice(&number.to_le_bytes());
            Key::from_bytes(bytes)
        };
        for number in 0..3 * space {
            waiting.keep(Prepared { key: key(number), ..large.clone() });
        }
        assert!(waiting.0.weight() <= BUDGET, "{} bytes", waiting.0.weight());
        let newest = 3 * space - space / 3..3 * space;
        assert!(newest.map(key).all(|key| waiting.take(&key).is_some()), "the newest are kept");
    }
}
