//! The runs that wait for workers, by owner, in the memory of the writer task. This queue decides which run is claimed
//! next.
//!
//! The next turn is that of the owner for whom the workers have computed least lately. Among equals, it is that of the
//! owner with the fewest running parts, which are runs or pieces of studies; among equals, that of the owner whose last
//! turn was longest ago. A new owner comes directly before the owner who had the
//! last turn. So an owner who submits one job after another gets no more turns than an owner with many waiting jobs.
//! The waiting jobs of an owner are the lane of that owner. In a lane, more urgent jobs come first; among equals, runs
//! before studies; among equals, older jobs. A run that several owners share is in the lane of each.
//!
//! A study is in its lanes while a worker can claim a piece of it. Its pieces are claimed one by one, so other owners
//! need not wait for its end.
//!
//! The tables are authoritative. The queue is read from them at the start and after each failed transaction.

use std::collections::{BTreeMap, HashMap};

use sqlx::SqliteConnection;

use crate::database::caution::{Caution, Verdict};
use crate::database::{Result, RunId, RunPart, Tables as _, read, sql};
use crate::jobs::claimed::{Stages, Study};
use fretwork_job::JobId;

#[cfg(test)]
mod simulation;

/// The position of a job in the lane of its owner: the priority, whether the run is a study, and the id. Ids are
/// ordered by the time of the submission.
type LanePosition = (u8, bool, JobId);

#[derive(Debug, Default)]
pub(super) struct Queue {
    lanes: HashMap<String, Lane>,
    /// The positions of each queued run and of each unfinished study: one for each of its jobs.
    places: HashMap<RunId, BTreeMap<LanePosition, String>>,
    /// The unfinished studies.
    studies: HashMap<RunId, Study>,
    /// The owner in whose turn each running part was claimed.
    working: HashMap<RunPart, String>,
    /// How often each unfinished part was lost, if it was.
    lost: BTreeMap<RunPart, u32>,
    turns: u64,
    /// The number of jobs that wait for a worker.
    pub(super) jobs: usize,
}

#[derive(Debug, Default)]
struct Lane {
    waiting: BTreeMap<LanePosition, RunId>,
    working: usize,
    /// The number of the last turn of this owner. A later turn has a larger number.
    served: u64,
}

impl Queue {
    /// Reads the queued and running runs.
    pub(super) async fn load(db: &mut SqliteConnection) -> Result<Self> {
        let mut queue = Self::default();
        let studies = db.rows(sql!(
            "SELECT run, chunks,
                 coalesce((SELECT max(number) + 1 FROM chunk WHERE chunk.run = study.run), 0) AS next,
                 (SELECT count(*) FROM chunk
                  WHERE chunk.run = study.run AND state = 'queued' AND state <> 'done') AS queued,
                 (SELECT count(*) FROM chunk
                  WHERE chunk.run = study.run AND state = 'running' AND state <> 'done') AS running,
                 stages
             FROM study WHERE run IN (SELECT id FROM run WHERE finished IS NULL)"
        ));
        for row in studies.await? {
            let stages = Stages::read(row.get("stages")?);
            let study = read!(row => Study { chunks, next, queued, running; stages });
            queue.studies.insert(RunId(row.get("run")?), study);
        }
        // The index contains only unfinished runs. The table has many finished ones.
        let running = db.rows(sql!(
            "SELECT run.id AS run, number, owner FROM run INDEXED BY run_unfinished
             LEFT JOIN study ON study.run = run.id
             LEFT JOIN chunk ON chunk.run = run.id AND chunk.state = 'running' AND chunk.state <> 'done'
             WHERE finished IS NULL AND run.state IN ('running', 'canceling')
                 AND (study.run IS NULL OR number IS NOT NULL)"
        ));
        for row in running.await? {
            queue.begin((RunId(row.get("run")?), row.get("number")?), row.get("owner")?);
        }
        let lost = db.rows(sql!(
            "SELECT id AS run, NULL AS number, lost FROM run INDEXED BY run_unfinished
             WHERE finished IS NULL AND lost > 0 AND id NOT IN (SELECT run FROM study)
             UNION ALL
             SELECT run, number, lost FROM chunk
             WHERE lost > 0 AND state <> 'done' AND run IN (SELECT id FROM run WHERE finished IS NULL)"
        ));
        for row in lost.await? {
            queue.lost.insert((RunId(row.get("run")?), row.get("number")?), row.get("lost")?);
        }
        let waiting = db.rows(sql!(
            "SELECT job.run, job.owner, job.priority, job.id
             FROM run INDEXED BY run_unfinished JOIN job ON job.run = run.id
             WHERE run.finished IS NULL AND job.finished IS NULL
                 AND (run.state = 'queued' OR run.id IN (SELECT run FROM study))"
        ));
        for row in waiting.await? {
            let run = RunId(row.get("run")?);
            queue.add(run, row.get("owner")?, row.get("priority")?, row.get("id")?);
        }
        Ok(queue)
    }

    /// The number of queued runs. A study is queued until its first piece is claimed.
    pub(super) fn len(&self) -> usize {
        self.places.len() - self.studies.values().filter(|study| study.next > 0).count()
    }

    /// The number of running parts.
    pub(super) fn working(&self) -> usize {
        self.working.len()
    }

    /// The number of jobs of an owner that wait for a worker.
    pub(super) fn waiting_of(&self, owner: &str) -> usize {
        self.lanes.get(owner).map_or(0, |lane| lane.waiting.len())
    }

    /// Whether an unfinished run is a study.
    pub(super) fn is_study(&self, run: RunId) -> bool {
        self.studies.contains_key(&run)
    }

    /// Adds a new study. The caller adds its jobs afterwards.
    pub(super) fn add_study(&mut self, run: RunId, chunks: u32, stages: Stages) {
        self.studies.insert(run, Study { chunks, next: 0, queued: 0, running: 0, stages });
    }

    /// Adds a job that waits for a queued run or a study.
    pub(super) fn add(&mut self, run: RunId, owner: &str, priority: u8, job: JobId) {
        let study = self.studies.get(&run);
        let (place, is_ready) =
            ((priority, study.is_some(), job), study.is_none_or(Study::is_ready));
        self.places.entry(run).or_default().insert(place, owner.to_owned());
        if is_ready {
            self.occupy(owner, place, run);
        }
    }

    /// Removes a job. If it was the last job of its run, the run is no longer queued.
    pub(super) fn leave(&mut self, run: RunId, priority: u8, job: JobId) {
        let place = (priority, self.is_study(run), job);
        let Some(places) = self.places.get_mut(&run) else { return };
        let owner = places.remove(&place);
        if places.is_empty() {
            self.places.remove(&run);
        }
        if let Some(owner) = owner {
            self.vacate(&owner, place, run);
        }
    }

    /// The next run, and the owner whose turn it is. Owners without a `usage` are left out.
    pub(super) fn next(
        &self,
        usage: impl Fn(&str) -> Option<u64>,
        is_settled: bool,
    ) -> Option<(RunId, String)> {
        let running = self.working.keys().map(|part| self.lost.get(part).copied().unwrap_or(0));
        let caution = Caution::of(is_settled, running);
        let verdict = |run| caution.on(self.lost(run));
        let waiting = self.lanes.iter().filter_map(|(owner, lane)| {
            let usage = usage(owner)?;
            let may = |(_, run): &(_, &RunId)| verdict(**run) != Verdict::PassesOver;
            let ((.., oldest), run) = lane.waiting.iter().find(may)?;
            Some(((usage, lane.working, lane.served, *oldest), owner, *run))
        });
        let (_, owner, run) = waiting.min_by_key(|(turn, ..)| *turn)?;
        (verdict(run) == Verdict::Claims).then(|| (run, owner.clone()))
    }

    /// How often the next part of a run was lost: of a study, the waiting one that was lost most often.
    fn lost(&self, run: RunId) -> u32 {
        let parts = self.lost.range((run, None)..=(run, Some(u32::MAX)));
        let waiting = parts.filter(|(part, _)| !self.working.contains_key(part));
        waiting.map(|(_, lost)| *lost).max().unwrap_or(0)
    }

    /// Records that the next part was claimed in the turn of this owner. The part is running from now on.
    pub(super) fn take(&mut self, part: RunPart, owner: String) {
        self.turns += 1;
        self.lane(&owner).served = self.turns;
        self.begin(part, owner);
        let (run, number) = part;
        match number {
            None => self.remove(run),
            Some(number) => {
                self.start(run);
                self.change(run, |study| {
                    if number == study.next {
                        study.next += 1;
                    } else {
                        study.queued -= 1;
                    }
                    study.running += 1;
                });
            }
        }
    }

    /// Called at each claim of a piece. At the first one, the jobs of the study stop counting as waiting.
    fn start(&mut self, run: RunId) {
        if self.is_waiting(run) {
            self.jobs -= self.places.get(&run).map_or(0, BTreeMap::len);
        }
    }

    /// Whether no worker has claimed a run, or a piece of it.
    fn is_waiting(&self, run: RunId) -> bool {
        self.studies.get(&run).is_none_or(|study| study.next == 0)
    }

    /// Ends a running chunk. Returns whether workers can claim pieces that had to wait for it.
    pub(super) fn done(&mut self, run: RunId, number: u32) -> bool {
        let is_ready = |queue: &Self| queue.studies.get(&run).is_some_and(Study::is_ready);
        let was_ready = is_ready(self);
        self.lost.remove(&(run, Some(number)));
        self.rest((run, Some(number)));
        self.change(run, |study| study.running -= 1);
        is_ready(self) && !was_ready
    }

    /// Ends a running part that waits again. The caller adds the jobs of a whole run afterwards.
    pub(super) fn release(&mut self, part: RunPart) {
        self.rest(part);
        self.change(part.0, |study| {
            study.running -= 1;
            study.queued += 1;
        });
    }

    /// Removes a run with all its jobs and parts.
    pub(super) fn end(&mut self, run: RunId) {
        self.remove(run);
        self.studies.remove(&run);
        self.lost.retain(|(other, _), _| *other != run);
        let running = self.working.keys().filter(|(other, _)| *other == run);
        for part in running.copied().collect::<Vec<_>>() {
            self.rest(part);
        }
    }

    /// Removes all jobs of a run.
    fn remove(&mut self, run: RunId) {
        for (place, owner) in self.places.remove(&run).unwrap_or_default() {
            self.vacate(&owner, place, run);
        }
    }

    fn begin(&mut self, part: RunPart, owner: String) {
        self.lane(&owner).working += 1;
        self.working.insert(part, owner);
    }

    /// Records that a part is no longer running.
    fn rest(&mut self, part: RunPart) {
        let Some(owner) = self.working.remove(&part) else { return };
        self.lane(&owner).working -= 1;
        self.tidy(&owner);
    }

    /// Changes the numbers of pieces of a study. Adds its jobs to their lanes or removes them, depending on whether a
    /// worker can claim a piece.
    fn change(&mut self, run: RunId, change: impl FnOnce(&mut Study)) {
        let Some(study) = self.studies.get_mut(&run) else { return };
        let was_ready = study.is_ready();
        change(study);
        let is_ready = study.is_ready();
        if is_ready == was_ready {
            return;
        }
        let Some(places) = self.places.remove(&run) else { return };
        for (place, owner) in &places {
            if is_ready {
                self.occupy(owner, *place, run);
            } else {
                self.vacate(owner, *place, run);
            }
        }
        self.places.insert(run, places);
    }

    fn lane(&mut self, owner: &str) -> &mut Lane {
        let served = self.turns.saturating_sub(1);
        let new = || Lane { served, ..Lane::default() };
        self.lanes.entry(owner.to_owned()).or_insert_with(new)
    }

    fn occupy(&mut self, owner: &str, place: LanePosition, run: RunId) {
        let is_new = self.lane(owner).waiting.insert(place, run).is_none();
        if is_new && self.is_waiting(run) {
            self.jobs += 1;
        }
    }

    fn vacate(&mut self, owner: &str, place: LanePosition, run: RunId) {
        let is_waiting = self.is_waiting(run);
        if let Some(lane) = self.lanes.get_mut(owner)
            && lane.waiting.remove(&place).is_some()
            && is_waiting
        {
            self.jobs -= 1;
        }
        self.tidy(owner);
    }

    /// Removes the lane of an owner without waiting jobs and running parts.
    fn tidy(&mut self, owner: &str) {
        if self.lanes.get(owner).is_some_and(|lane| lane.working == 0 && lane.waiting.is_empty()) {
            self.lanes.remove(owner);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A queue with these jobs (owner, run, priority), submitted in this order. Also returns their ids.
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

    /// Takes the next run, or the next piece of a study that was never claimed.
    fn take(queue: &mut Queue) -> Option<RunPart> {
        let (run, owner) = queue.next(|_| Some(0), true)?;
        let part = (run, queue.studies.get(&run).map(|study| study.next));
        queue.take(part, owner);
        Some(part)
    }

    /// Takes and ends one run or piece after another. Returns the numbers of their runs.
    fn turns(queue: &mut Queue) -> Vec<i64> {
        std::iter::from_fn(|| {
            let (run, number) = take(queue)?;
            match (number, queue.studies.get(&run)) {
                (Some(number), Some(study)) if number < study.chunks => _ = queue.done(run, number),
                _ => queue.end(run),
            }
            Some(run.0)
        })
        .collect()
    }

    fn is_empty(queue: &Queue) -> bool {
        let Queue { lanes, places, studies, working, lost, turns: _, jobs } = queue;
        lanes.is_empty()
            && places.is_empty()
            && studies.is_empty()
            && working.is_empty()
            && lost.is_empty()
            && *jobs == 0
    }

    #[test]
    fn owners_take_turns_even_if_one_owner_has_more_jobs() {
        let (mut queue, _) =
            queue(&[("ada", 1, 3), ("ada", 2, 3), ("ada", 3, 3), ("bob", 4, 3), ("eve", 5, 3)]);
        assert_eq!(turns(&mut queue), [1, 4, 5, 2, 3]);
        assert!(is_empty(&queue));
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
            let (run, _) = take(&mut queue).unwrap();
            *turns.entry(run.0 / 1000).or_insert(0) += 1;
            queue.end(run);
        }
        assert_eq!(turns, HashMap::from([(0, 30), (1, 30), (2, 30)]));
    }

    #[test]
    fn the_owner_with_fewer_running_runs_comes_first() {
        let (mut queue, _) = queue(&[("ada", 1, 3), ("ada", 2, 3), ("ada", 3, 3)]);
        assert_eq!(take(&mut queue), Some((RunId(1), None)));
        queue.add(RunId(4), "bob", 3, JobId::generate());
        queue.add(RunId(5), "bob", 3, JobId::generate());
        assert_eq!(take(&mut queue), Some((RunId(4), None)), "bob has no running run");
        queue.end(RunId(1));
        assert_eq!(take(&mut queue), Some((RunId(2), None)), "ada has none now");
    }

    #[test]
    fn the_owner_for_whom_least_was_computed_comes_first() {
        let (mut queue, _) = queue(&[("ada", 1, 3), ("bob", 2, 3)]);
        let usage = |owner: &str| Some(if owner == "ada" { 5 } else { 3 });
        assert_eq!(queue.next(|_| None, true), None);
        assert_eq!(queue.next(usage, true), Some((RunId(2), "bob".into())));
        queue.take((RunId(2), None), "bob".into());
        assert_eq!(queue.next(usage, true), Some((RunId(1), "ada".into())));
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

    #[test]
    fn the_pieces_of_a_study_take_turns_with_the_runs_of_other_owners() {
        let mut queue = Queue::default();
        queue.add_study(RunId(1), 3, Stages::default());
        queue.add(RunId(1), "ada", 3, JobId::generate());
        for run in [2, 3] {
            queue.add(RunId(run), "bob", 3, JobId::generate());
        }
        assert_eq!(turns(&mut queue), [1, 2, 1, 3, 1, 1], "three chunks and the assembly");
        assert!(is_empty(&queue));
    }

    #[test]
    fn in_a_lane_a_run_comes_before_a_study_of_equal_priority() {
        let mut queue = Queue::default();
        for (study, priority) in [(1, 3), (2, 2)] {
            queue.add_study(RunId(study), 1, Stages::default());
            queue.add(RunId(study), "ada", priority, JobId::generate());
        }
        queue.add(RunId(3), "ada", 3, JobId::generate());
        assert_eq!(turns(&mut queue), [2, 2, 3, 1, 1]);
    }

    #[test]
    fn a_study_is_in_the_queue_only_while_a_worker_can_claim_a_piece() {
        let mut queue = Queue::default();
        let (study, job) = (RunId(1), JobId::generate());
        queue.add_study(study, 2, Stages::default());
        queue.add(study, "ada", 3, job);
        assert_eq!((queue.len(), queue.jobs), (1, 1));
        for number in 0..2 {
            assert_eq!(take(&mut queue), Some((study, Some(number))));
            assert_eq!(queue.len(), 0, "it is running");
        }
        assert_eq!((take(&mut queue), queue.working(), queue.jobs), (None, 2, 0));
        // A job that joins now waits for the remaining pieces, too.
        queue.add(study, "bob", 3, JobId::generate());
        assert_eq!(queue.jobs, 0);
        queue.release((study, Some(0)));
        assert_eq!((queue.waiting_of("ada"), queue.waiting_of("bob")), (1, 1));
        queue.leave(study, 3, job);
        // Jobs of a study that has begun do not count as queued.
        assert_eq!((queue.waiting_of("ada"), queue.waiting_of("bob"), queue.jobs), (0, 1, 0));
        assert_eq!(queue.next(|_| Some(0), true), Some((study, "bob".into())));
        queue.take((study, Some(0)), "bob".into());
        queue.done(study, 1);
        assert_eq!(take(&mut queue), None, "the assembly waits for all chunks");
        queue.done(study, 0);
        assert_eq!(take(&mut queue), Some((study, Some(2))));
        queue.end(study);
        assert!(is_empty(&queue));
    }

    #[test]
    fn a_part_that_was_lost_waits_and_then_comes_first_in_its_study() {
        let mut queue = Queue::default();
        queue.add_study(RunId(1), 3, Stages::default());
        for (run, owner) in [(1, "ada"), (2, "bob"), (3, "bob")] {
            queue.add(RunId(run), owner, 3, JobId::generate());
        }
        assert_eq!(take(&mut queue), Some((RunId(1), Some(0))));
        queue.release((RunId(1), Some(0)));
        queue.lost = BTreeMap::from([((RunId(1), Some(0)), 1), ((RunId(2), None), 2)]);
        let next = |queue: &Queue, is_settled| queue.next(|_| Some(0), is_settled);
        assert_eq!(next(&queue, false), Some((RunId(3), "bob".into())));
        queue.take((RunId(3), None), "bob".into());
        assert_eq!(next(&queue, true), Some((RunId(1), "ada".into())));
        assert_eq!(queue.lost(RunId(1)), 1);
        queue.take((RunId(1), Some(0)), "ada".into());
        // No second part that was lost runs beside the first one, but other pieces do.
        assert_eq!(take(&mut queue), Some((RunId(1), Some(1))));
        assert_eq!(take(&mut queue), Some((RunId(1), Some(2))));
        assert_eq!(take(&mut queue), None);
        queue.done(RunId(1), 0);
        assert_eq!(next(&queue, true), None, "a run that must be alone waits");
        queue.end(RunId(1));
        queue.end(RunId(3));
        assert_eq!(take(&mut queue), Some((RunId(2), None)));
        queue.add(RunId(4), "eve", 0, JobId::generate());
        assert_eq!(next(&queue, true), None, "a run computes alone");
        queue.end(RunId(2));
        queue.end(RunId(4));
        assert!(is_empty(&queue));
    }

    #[test]
    fn the_end_of_a_study_ends_all_its_pieces() {
        let mut queue = Queue::default();
        queue.add_study(RunId(1), 9, Stages::default());
        queue.add(RunId(1), "ada", 3, JobId::generate());
        queue.add(RunId(2), "bob", 3, JobId::generate());
        for _ in 0..3 {
            take(&mut queue);
        }
        queue.end(RunId(1));
        assert_eq!(queue.working(), 1);
        queue.done(RunId(1), 0);
        queue.end(RunId(2));
        assert!(is_empty(&queue));
    }
}
