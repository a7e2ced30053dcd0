//! Whose turn it is: what is queued, by owner, in the memory of the writer.
//!
//! The owner with the fewest runs at work is next; among equals the one who was served longest ago.
//! Who comes new comes before the one who was served last, and behind all others: so who comes again
//! and again has no more turns than who waits. Within an owner the more urgent job comes first, then
//! the older one. A run that several owners wait for stands in the lane of each.
//!
//! The tables stay the truth: this is read from them at the start, and again after a transaction
//! that failed.

use std::collections::{BTreeMap, HashMap};

use sqlx::SqliteConnection;

use super::error::Error;
use super::row::{RunId, job_id};
use crate::job::JobId;

/// Where a job stands in its owner's lane: its priority, and its age by its id.
type Place = (u8, JobId);

#[derive(Debug, Default)]
pub(super) struct Queue {
    lanes: HashMap<String, Lane>,
    /// Where each queued run stands: one place for each job that waits for it.
    places: HashMap<RunId, BTreeMap<Place, String>>,
    /// In whose turn each run at work was taken.
    working: HashMap<RunId, String>,
    turns: u64,
    /// How many jobs wait.
    jobs: usize,
}

#[derive(Debug, Default)]
struct Lane {
    waiting: BTreeMap<Place, RunId>,
    working: usize,
    /// The last turn this owner had.
    served: u64,
}

impl Queue {
    /// Reads what is queued and at work.
    pub(super) async fn load(db: &mut SqliteConnection) -> Result<Self, Error> {
        let mut queue = Self::default();
        // By the index, whose size is that of the queue; the table grows for ever.
        let rows: Vec<(i64, String)> = sqlx::query_as(
            "SELECT id, owner FROM run INDEXED BY run_unfinished
             WHERE finished IS NULL AND state IN ('running', 'canceling')",
        )
        .fetch_all(&mut *db)
        .await?;
        for (run, owner) in rows {
            queue.begin(RunId(run), owner);
        }
        let rows: Vec<(i64, String, u8, Vec<u8>)> = sqlx::query_as(
            "SELECT run.id, job.owner, job.priority, job.id
             FROM run INDEXED BY run_unfinished JOIN job ON job.run = run.id
             WHERE run.finished IS NULL AND run.state = 'queued' AND job.finished IS NULL",
        )
        .fetch_all(db)
        .await?;
        for (run, owner, priority, job) in rows {
            queue.add(RunId(run), &owner, priority, job_id(&job)?);
        }
        Ok(queue)
    }

    /// How many runs are queued.
    pub(super) fn len(&self) -> usize {
        self.places.len()
    }

    /// How many runs are at work.
    pub(super) fn working(&self) -> usize {
        self.working.len()
    }

    /// How many jobs wait.
    pub(super) fn jobs(&self) -> usize {
        self.jobs
    }

    /// How many jobs of an owner wait.
    pub(super) fn waiting_of(&self, owner: &str) -> usize {
        self.lanes.get(owner).map_or(0, |lane| lane.waiting.len())
    }

    /// A job begins to wait for a queued run.
    pub(super) fn add(&mut self, run: RunId, owner: &str, priority: u8, job: JobId) {
        let place = (priority, job);
        if self.lane(owner).waiting.insert(place, run).is_none() {
            self.jobs += 1;
        }
        self.places.entry(run).or_default().insert(place, owner.to_owned());
    }

    /// A job waits no longer, though others may for the same run.
    pub(super) fn leave(&mut self, run: RunId, priority: u8, job: JobId) {
        let place = (priority, job);
        let Some(places) = self.places.get_mut(&run) else { return };
        let owner = places.remove(&place);
        if places.is_empty() {
            self.places.remove(&run);
        }
        if let Some(owner) = owner {
            self.vacate(&owner, place);
        }
    }

    /// A run is queued no longer.
    pub(super) fn remove(&mut self, run: RunId) {
        for (place, owner) in self.places.remove(&run).unwrap_or_default() {
            self.vacate(&owner, place);
        }
    }

    /// Takes the run whose turn it is; it is at work from now on.
    pub(super) fn take(&mut self) -> Option<RunId> {
        let waiting = self.lanes.iter().filter_map(|(owner, lane)| {
            let ((_, oldest), run) = lane.waiting.first_key_value()?;
            Some(((lane.working, lane.served, *oldest), owner, *run))
        });
        let (_, owner, run) = waiting.min_by_key(|(turn, ..)| *turn)?;
        let owner = owner.clone();
        self.turns += 1;
        if let Some(lane) = self.lanes.get_mut(&owner) {
            lane.served = self.turns;
        }
        self.begin(run, owner);
        self.remove(run);
        Some(run)
    }

    /// A run is at work no longer.
    pub(super) fn end(&mut self, run: RunId) {
        let Some(owner) = self.working.remove(&run) else { return };
        if let Some(lane) = self.lanes.get_mut(&owner) {
            lane.working = lane.working.saturating_sub(1);
        }
        self.tidy(&owner);
    }

    fn begin(&mut self, run: RunId, owner: String) {
        self.lane(&owner).working += 1;
        self.working.insert(run, owner);
    }

    fn lane(&mut self, owner: &str) -> &mut Lane {
        let served = self.turns.saturating_sub(1);
        let new = || Lane { served, ..Lane::default() };
        self.lanes.entry(owner.to_owned()).or_insert_with(new)
    }

    fn vacate(&mut self, owner: &str, place: Place) {
        if let Some(lane) = self.lanes.get_mut(owner)
            && lane.waiting.remove(&place).is_some()
        {
            self.jobs -= 1;
        }
        self.tidy(owner);
    }

    /// Owners who want nothing are forgotten.
    fn tidy(&mut self, owner: &str) {
        if self.lanes.get(owner).is_some_and(|lane| lane.working == 0 && lane.waiting.is_empty()) {
            self.lanes.remove(owner);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Adds jobs of (owner, run, priority) in their order.
    fn queue(jobs: &[(&str, i64, u8)]) -> (Queue, Vec<JobId>) {
        let mut queue = Queue::default();
        let ids = jobs.iter().map(|(owner, run, priority)| {
            let id = JobId::generate();
            queue.add(RunId(*run), owner, *priority, id);
            id
        });
        let ids = ids.collect();
        (queue, ids)
    }

    fn turns(queue: &mut Queue) -> Vec<i64> {
        std::iter::from_fn(|| {
            let run = queue.take()?;
            queue.end(run);
            Some(run.0)
        })
        .collect()
    }

    #[test]
    fn owners_take_turns_however_much_one_of_them_wants() {
        let (mut queue, _) =
            queue(&[("ada", 1, 3), ("ada", 2, 3), ("ada", 3, 3), ("bob", 4, 3), ("eve", 5, 3)]);
        assert_eq!(turns(&mut queue), [1, 4, 5, 2, 3]);
        assert!(queue.lanes.is_empty() && queue.places.is_empty() && queue.working.is_empty());
    }

    #[test]
    fn who_comes_again_and_again_has_no_more_turns_than_who_waits() {
        let mut queue = Queue::default();
        for run in 0..100 {
            queue.add(RunId(run), "ada", 3, JobId::generate());
        }
        let mut turns = HashMap::new();
        for number in 0..90 {
            for (owner, first) in [("bob", 1000), ("eve", 2000)] {
                if queue.waiting_of(owner) == 0 {
                    queue.add(RunId(first + number), owner, 3, JobId::generate());
                }
            }
            let run = queue.take().unwrap();
            *turns.entry(run.0 / 1000).or_insert(0) += 1;
            queue.end(run);
        }
        assert_eq!(turns, HashMap::from([(0, 30), (1, 30), (2, 30)]));
    }

    #[test]
    fn who_has_fewer_runs_at_work_comes_first() {
        let (mut queue, _) = queue(&[("ada", 1, 3), ("ada", 2, 3), ("ada", 3, 3)]);
        assert_eq!(queue.take(), Some(RunId(1)));
        queue.add(RunId(4), "bob", 3, JobId::generate());
        queue.add(RunId(5), "bob", 3, JobId::generate());
        assert_eq!(queue.take(), Some(RunId(4)), "bob has none at work");
        queue.end(RunId(1));
        assert_eq!(queue.take(), Some(RunId(2)), "now ada has none");
    }

    #[test]
    fn urgency_counts_among_the_jobs_of_one_owner_only() {
        let (mut queue, _) =
            queue(&[("ada", 1, 3), ("ada", 2, 0), ("ada", 3, 7), ("bob", 4, 7), ("bob", 5, 6)]);
        assert_eq!(turns(&mut queue), [2, 5, 1, 4, 3]);
    }

    #[test]
    fn a_run_that_two_wait_for_comes_in_whichever_turn_is_first_and_once() {
        let (mut queue, _) =
            queue(&[("ada", 1, 3), ("ada", 2, 3), ("ada", 3, 3), ("bob", 3, 3), ("bob", 4, 3)]);
        assert_eq!(turns(&mut queue), [1, 3, 2, 4]);
    }

    #[test]
    fn who_leaves_takes_only_his_own_place_with_him() {
        let (mut queue, ids) = queue(&[("ada", 1, 3), ("bob", 1, 3), ("bob", 2, 3)]);
        queue.leave(RunId(1), 3, ids[1]);
        assert_eq!((queue.len(), queue.waiting_of("bob")), (2, 1));
        queue.leave(RunId(1), 3, ids[0]);
        assert_eq!((queue.len(), queue.waiting_of("ada")), (1, 0));
        assert_eq!(turns(&mut queue), [2]);
    }
}
