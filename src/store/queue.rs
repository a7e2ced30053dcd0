//! The queued runs by owner, in the memory of the writer task. It decides which run is claimed next.
//!
//! The next owner is the one with the fewest running runs; among equals, the one that was served longest
//! ago. A new owner comes directly before the one that was served last. So an owner that submits one job
//! after another gets no more turns than an owner whose jobs wait. Within an owner, the more urgent job
//! comes first, then the older one. The queued jobs of one owner are its lane. A run that several owners
//! share is in the lane of each.
//!
//! The tables are authoritative. The queue is read from them at the start and after each failed transaction.

use std::collections::{BTreeMap, HashMap};

use sqlx::SqliteConnection;

use super::error::Error;
use super::row::{RunId, job_id};
use crate::job::JobId;

/// The position of a job in the lane of its owner: its priority, then its id, which gives its age.
type Place = (u8, JobId);

#[derive(Debug, Default)]
pub(super) struct Queue {
    lanes: HashMap<String, Lane>,
    /// The positions of each queued run: one for each of its jobs.
    places: HashMap<RunId, BTreeMap<Place, String>>,
    /// The owner in whose turn each running run was claimed.
    working: HashMap<RunId, String>,
    turns: u64,
    /// The number of queued jobs.
    jobs: usize,
}

#[derive(Debug, Default)]
struct Lane {
    waiting: BTreeMap<Place, RunId>,
    working: usize,
    /// The number of the last turn of this owner. A later turn has a larger number.
    served: u64,
}

impl Queue {
    /// Reads the queued and running runs.
    pub(super) async fn load(db: &mut SqliteConnection) -> Result<Self, Error> {
        let mut queue = Self::default();
        // The index has only unfinished runs; the table grows for ever.
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

    /// The number of queued runs.
    pub(super) fn len(&self) -> usize {
        self.places.len()
    }

    /// The number of running runs.
    pub(super) fn working(&self) -> usize {
        self.working.len()
    }

    /// The number of queued jobs.
    pub(super) fn jobs(&self) -> usize {
        self.jobs
    }

    /// The number of queued jobs of an owner.
    pub(super) fn waiting_of(&self, owner: &str) -> usize {
        self.lanes.get(owner).map_or(0, |lane| lane.waiting.len())
    }

    /// Adds a job that waits for a queued run.
    pub(super) fn add(&mut self, run: RunId, owner: &str, priority: u8, job: JobId) {
        let place = (priority, job);
        if self.lane(owner).waiting.insert(place, run).is_none() {
            self.jobs += 1;
        }
        self.places.entry(run).or_default().insert(place, owner.to_owned());
    }

    /// Removes a job. Its run stays queued for other jobs, if there are any.
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

    /// Removes a run with all its jobs.
    pub(super) fn remove(&mut self, run: RunId) {
        for (place, owner) in self.places.remove(&run).unwrap_or_default() {
            self.vacate(&owner, place);
        }
    }

    /// Takes the next run, which is running from now on.
    pub(super) fn take(&mut self) -> Option<RunId> {
        let waiting = self.lanes.iter().filter_map(|(owner, lane)| {
            let ((_, oldest), run) = lane.waiting.first_key_value()?;
            Some(((lane.working, lane.served, *oldest), owner, *run))
        });
        let (_, owner, run) = waiting.min_by_key(|(turn, ..)| *turn)?;
        let owner = owner.clone();
        self.turns += 1;
        self.lane(&owner).served = self.turns;
        self.begin(run, owner);
        self.remove(run);
        Some(run)
    }

    /// Ends a running run.
    pub(super) fn end(&mut self, run: RunId) {
        let Some(owner) = self.working.remove(&run) else { return };
        self.lane(&owner).working -= 1;
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

    /// Removes the lane of an owner without queued and running runs.
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
    fn owners_take_turns_even_if_one_owner_has_more_jobs() {
        let (mut queue, _) =
            queue(&[("ada", 1, 3), ("ada", 2, 3), ("ada", 3, 3), ("bob", 4, 3), ("eve", 5, 3)]);
        assert_eq!(turns(&mut queue), [1, 4, 5, 2, 3]);
        assert!(queue.lanes.is_empty() && queue.places.is_empty() && queue.working.is_empty());
    }

    #[test]
    fn owners_with_one_job_at_a_time_get_the_same_share_of_turns() {
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
    fn the_owner_with_fewer_running_runs_comes_first() {
        let (mut queue, _) = queue(&[("ada", 1, 3), ("ada", 2, 3), ("ada", 3, 3)]);
        assert_eq!(queue.take(), Some(RunId(1)));
        queue.add(RunId(4), "bob", 3, JobId::generate());
        queue.add(RunId(5), "bob", 3, JobId::generate());
        assert_eq!(queue.take(), Some(RunId(4)), "bob has no running run");
        queue.end(RunId(1));
        assert_eq!(queue.take(), Some(RunId(2)), "ada has none now");
    }

    #[test]
    fn priorities_order_only_the_jobs_of_one_owner() {
        let (mut queue, _) =
            queue(&[("ada", 1, 3), ("ada", 2, 0), ("ada", 3, 7), ("bob", 4, 7), ("bob", 5, 6)]);
        assert_eq!(turns(&mut queue), [2, 5, 1, 4, 3]);
    }

    #[test]
    fn a_shared_run_is_claimed_once_at_the_earliest_turn_of_its_owners() {
        let (mut queue, _) =
            queue(&[("ada", 1, 3), ("ada", 2, 3), ("ada", 3, 3), ("bob", 3, 3), ("bob", 4, 3)]);
        assert_eq!(turns(&mut queue), [1, 3, 2, 4]);
    }

    #[test]
    fn a_run_stays_queued_until_its_last_job_is_removed() {
        let (mut queue, ids) = queue(&[("ada", 1, 3), ("bob", 1, 3), ("bob", 2, 3)]);
        queue.leave(RunId(1), 3, ids[1]);
        assert_eq!((queue.len(), queue.waiting_of("bob")), (2, 1));
        queue.leave(RunId(1), 3, ids[0]);
        assert_eq!((queue.len(), queue.waiting_of("ada")), (1, 0));
        assert_eq!(turns(&mut queue), [2]);
    }
}
