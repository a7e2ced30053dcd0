//! Computes a claimed piece: a whole run, a chunk of a study, or the result of a study from its chunks.

use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use parking_lot::MutexGuard;

use super::parking::{LAST, Parkable, SLICE};
use super::{MAX_REFUSALS, Made, NotMade, PAUSE, REPORT, Worker, WorkerOrder};
use crate::service::stopwatch::Stopwatch;
use fretwork_job::{Answer, Cost, FailureKind, Prepared, Step, Task, TaskKind, asked_in};
use fretwork_store::{Claimed, Error, Piece, Result, RunId};
use fretwork_study::{Points, Rows, Study};

/// Maximum number of prepared studies that all threads together keep in memory. The owners of studies take turns. So
/// with more studies than this, a study must be prepared again for each of its chunks.
const STUDIES: usize = 8;

impl Worker {
    pub(super) fn compute(&self, claimed: &Claimed) -> Result<Made, NotMade> {
        match &claimed.piece {
            Piece::Whole { task } => self.compute_run(claimed, task),
            Piece::Chunk { number, of } => self.compute_chunk(claimed, *number, *of),
            Piece::Assembly { of } => self.assemble(claimed, *of),
        }
    }

    fn compute_run(&self, claimed: &Claimed, task: &str) -> Result<Made, NotMade> {
        let watch = Stopwatch::start();
        let mut work = (self.compute)(&claimed.key, task).map_err(unreadable)?;
        let limit = match asked_in(task) {
            Some((TaskKind::Study(_), _)) => self.limits.study,
            _ => self.limits.run,
        };
        let answer = self.drive(claimed, Some(work.bytes()), limit, || work.step())?;
        Ok(Made::Answer(answer, self.cost(watch)))
    }

    fn compute_chunk(&self, claimed: &Claimed, number: u32, of: u32) -> Result<Made, NotMade> {
        let study = self.study(claimed)?;
        let watch = Stopwatch::start();
        // A study that was canceled has computed its first chunks.
        let known = self.runtime.block_on(self.store.canceled_chunk(claimed, number, of));
        if let Ok(Some(bytes)) = known
            && Rows::from_bytes(&bytes).is_some_and(|rows| {
                rows.count == study.points_of(number as usize, of as usize).len()
            })
        {
            return Ok(Made::Rows(bytes.to_vec(), self.cost(watch)));
        }
        let mut earlier = Rows::default();
        for number in 0..study.earlier_chunks(number as usize, of as usize) as u32 {
            earlier.append(&self.stored_rows(claimed, number)?);
        }
        let bytes = study.memory_of_chunk(of as usize);
        let mut points = Points::chunk(study, number as usize, of as usize, earlier);
        let rows = self.drive(claimed, Some(bytes), self.limits.study, || match points.step() {
            Some(rows) => Step::Done(rows),
            None => Step::Working { progress: points.progress() },
        })?;
        Ok(Made::Rows(rows.to_bytes(), self.cost(watch)))
    }

    /// The rows of a finished chunk.
    fn stored_rows(&self, claimed: &Claimed, number: u32) -> Result<Rows, NotMade> {
        let bytes = self.read(claimed, async || self.store.chunk(claimed, number).await)?;
        let form = || unreadable(format!("chunk {number} has the form of another version"));
        Rows::from_bytes(&bytes).ok_or_else(form)
    }

    /// Makes the result of a study from its chunks.
    fn assemble(&self, claimed: &Claimed, of: u32) -> Result<Made, NotMade> {
        let _turn = self.turn(claimed)?;
        let study = self.study(claimed)?;
        self.parked.take();
        let watch = Stopwatch::start();
        let (mut all, mut number) = (Rows::default(), 0);
        let rows = self.drive(claimed, None, None, || {
            match self.stored_rows(claimed, number) {
                Ok(rows) => all.append(&rows),
                Err(why) => return Step::Done(Err(why)),
            }
            number += 1;
            if number == of {
                return Step::Done(Ok(std::mem::take(&mut all)));
            }
            Step::Working { progress: f64::from(number) / f64::from(of) }
        })??;
        if rows.count != study.points() {
            let message = format!(
                "the stored parts of the study have {} rows, not {}",
                rows.count,
                study.points()
            );
            return Err(unreadable(message));
        }
        let goes_on = &mut || self.check(claimed).is_ok();
        match Answer::of_study_while(claimed.key, &study, &rows, goes_on) {
            Some(answer) => Ok(Made::Answer(answer, self.cost(watch))),
            // `check` failed during the computation. It fails again, because a reason to stop never disappears.
            None => Err(self.check(claimed).err().unwrap_or(NotMade::Interrupted)),
        }
    }

    /// Waits until no other worker makes a result from chunks.
    fn turn(&self, claimed: &Claimed) -> Result<MutexGuard<'_, ()>, NotMade> {
        loop {
            if let Some(turn) = self.parking.assembling.try_lock() {
                return Ok(turn);
            }
            self.pause(claimed)?;
            self.make_way(claimed, (0, true), LAST);
        }
    }

    /// Fails with the reason if the computation must not continue.
    fn check(&self, claimed: &Claimed) -> Result<(), NotMade> {
        if claimed.stop.is_raised() {
            return Err(NotMade::Unwanted);
        }
        if self.order() == WorkerOrder::Abandon {
            return Err(NotMade::Interrupted);
        }
        Ok(())
    }

    /// At the end of a slice, parks the piece if an owner waits for whom less was computed lately. `bytes` is its
    /// estimated memory.
    fn share(&self, claimed: &Claimed, bytes: usize) {
        if self.slice.get().elapsed() < SLICE {
            return;
        }
        self.end_slice(claimed);
        if self.batch.lock().waiting.is_empty() && self.parking.is_full() {
            self.make_way(claimed, (bytes, false), self.store.usage(&claimed.owner));
        }
    }

    /// Parks a piece if an owner waits with a usage below `below`.
    fn make_way(&self, claimed: &Claimed, (bytes, waits): (usize, bool), below: u64) {
        let piece = Parkable { owner: claimed.owner.clone(), bytes, waits };
        if !self.park_for_others(claimed, &piece, below) {
            self.park(claimed, |goes_on| self.parking.swap(&piece, below, goes_on));
        }
    }

    /// Claims a piece of an owner with a usage below `below`, and parks this one. Returns whether it did. After an error
    /// of the store, this piece goes on.
    fn park_for_others(&self, claimed: &Claimed, piece: &Parkable, below: u64) -> bool {
        let owners = self.parking.others(below, (!piece.waits).then_some(&piece.owner));
        let below = owners.below;
        if !self.parking.may_claim(piece, below, Instant::now()) {
            return false;
        }
        let claims = self.runtime.block_on(self.store.claim_up_to(1, owners)).unwrap_or_default();
        if claims.is_empty() {
            self.parking.found_nothing(below, Instant::now());
            return false;
        }
        self.park(claimed, |goes_on| {
            self.parking.park_for(claims, piece, goes_on).unwrap_or_else(|claims| {
                let back = claims.into_iter().map(|claimed| (claimed, Err(NotMade::Interrupted)));
                self.runtime.block_on(self.settle_each(&back.collect::<Vec<_>>()));
                true
            })
        });
        true
    }

    /// Parks the piece with this function, which returns whether the thread has a place afterwards.
    fn park(&self, claimed: &Claimed, parking: impl FnOnce(&dyn Fn() -> bool) -> bool) {
        let started = Instant::now();
        self.has_place.set(parking(&|| self.check(claimed).is_ok()));
        self.parked.set(self.parked.get() + started.elapsed());
        self.slice.set(Instant::now());
    }

    /// Adds what was computed since the last call to the usage of the owner.
    pub(super) fn end_slice(&self, claimed: &Claimed) {
        let began = self.slice.replace(Instant::now());
        self.store.computed(&claimed.owner, began.elapsed());
    }

    /// The cost of a piece, without the time for which it was parked.
    fn cost(&self, watch: Stopwatch) -> Cost {
        let Cost { wall, cpu } = watch.cost();
        Cost { wall: wall.saturating_sub(self.parked.get()), cpu }
    }

    /// Waits for a short time, unless the computation must not continue.
    fn pause(&self, claimed: &Claimed) -> Result<(), NotMade> {
        self.check(claimed)?;
        thread::sleep(PAUSE.0);
        Ok(())
    }

    /// The prepared study of a claimed piece. Prepares it if it is not in memory.
    fn study(&self, claimed: &Claimed) -> Result<Arc<Study>, NotMade> {
        if let Some(study) = latest(&mut self.studies.lock(), claimed.run) {
            return Ok(study);
        }
        let study = self.prepared_study(claimed)?;
        let mut studies = self.studies.lock();
        // Another thread may have prepared the study in the meantime. Then this thread uses that one.
        if let Some(study) = latest(&mut studies, claimed.run) {
            return Ok(study);
        }
        if studies.len() == STUDIES {
            studies.remove(0);
        }
        studies.push((claimed.run, Arc::clone(&study)));
        Ok(study)
    }

    fn prepared_study(&self, claimed: &Claimed) -> Result<Arc<Study>, NotMade> {
        let task = self.read(claimed, async || self.store.task(claimed).await)?;
        let prepared = Prepared::from_stored(&claimed.key, &task).map_err(unreadable)?;
        match prepared.task {
            Task::Study(study) => Ok(study),
            Task::Run(_) => {
                Err(unreadable("the job is one run, but is stored as a part of a study".to_owned()))
            }
        }
    }

    /// Reads data of a study from the store. Tries again while the database is busy or cannot be reached.
    fn read<T>(
        &self,
        claimed: &Claimed,
        read: impl AsyncFn() -> Result<Option<T>>,
    ) -> Result<T, NotMade> {
        let mut refused = 0;
        loop {
            match self.runtime.block_on(read()) {
                Ok(Some(found)) => return Ok(found),
                Ok(None) => return Err(NotMade::Unwanted),
                Err(Error::Closed) => return Err(NotMade::Interrupted),
                Err(
                    Error::Busy(_)
                    | Error::Disk(_)
                    | Error::Unreachable(_)
                    | Error::Unfit(..)
                    | Error::Exhausted,
                ) => {}
                Err(Error::Database(_)) if refused < MAX_REFUSALS => refused += 1,
                Err(error) => return Err(unreadable(error.to_string())),
            }
            self.pause(claimed)?;
        }
    }

    /// Executes the steps of a computation until it is done or must not continue. Reports its progress to the store. A
    /// computation with `bytes` of estimated memory may be parked.
    fn drive<T>(
        &self,
        claimed: &Claimed,
        bytes: Option<usize>,
        limit: Option<Duration>,
        mut step: impl FnMut() -> Step<T>,
    ) -> Result<T, NotMade> {
        let before = claimed.spent.cpu.unwrap_or(claimed.spent.wall);
        let watch = Stopwatch::start();
        let mut reported = Instant::now();
        loop {
            self.hand_over();
            if let Some(bytes) = bytes {
                self.share(claimed, bytes);
            }
            self.check(claimed)?;
            let progress = match step() {
                Step::Done(found) => return Ok(found),
                Step::Working { progress } => progress,
            };
            let Cost { wall, cpu } = self.cost(watch);
            if let Some(limit) = limit
                && before + cpu.unwrap_or(wall) > limit
            {
                let message = format!(
                    "the computation took longer than the {} that this server allows",
                    humantime::format_duration(limit)
                );
                return Err(NotMade::Failed(FailureKind::TimeLimit, message));
            }
            if reported.elapsed() >= REPORT {
                reported = Instant::now();
                match self.runtime.block_on(self.store.progress(claimed, progress)) {
                    Ok(true) => {}
                    Ok(false) => return Err(NotMade::Unwanted),
                    // The computation continues: only the displayed progress is missing.
                    Err(error) => tracing::debug!(%error, "cannot store the progress of a run"),
                }
            }
        }
    }
}

/// The study of this run, if it is in memory. Moves it to the end of the list, as the one that was used last.
fn latest(studies: &mut Vec<(RunId, Arc<Study>)>, run: RunId) -> Option<Arc<Study>> {
    let place = studies.iter().position(|(known, _)| *known == run)?;
    let found = studies.remove(place);
    let study = Arc::clone(&found.1);
    studies.push(found);
    Some(study)
}

fn unreadable(message: String) -> NotMade {
    NotMade::Failed(FailureKind::UnreadableTask, message)
}
