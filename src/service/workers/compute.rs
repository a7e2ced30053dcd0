//! Computes a claimed piece: a whole run, a chunk of a study, or the result of a study from its chunks.

use std::sync::Arc;
use std::thread;

use super::assignment::{Assignment, Begun, Made};
use super::parking::SLICE;
use super::{MAX_REFUSALS, NotMade, PAUSE, Worker, WorkerOrder};
use crate::service::stopwatch::Stopwatch;
use fretwork_job::{Answer, Cost, FailureKind, Prepared, Step, Task, TaskKind, asked_in};
use fretwork_store::{Answered, Claimed, Error, Piece, Result, RunId};
use fretwork_study::{Points, Rows, Study};

/// Maximum number of prepared studies that all threads together keep in memory. The owners of studies take turns. So
/// with more studies than this, a study must be prepared again for each of its chunks.
const STUDIES: usize = 8;

impl Worker {
    /// Computes a piece for a slice. Returns `None` if it is not done.
    pub(super) fn compute(&self, piece: &mut Assignment) -> Result<Option<(Made, Cost)>, NotMade> {
        let watch = Stopwatch::start();
        let claimed = &piece.claimed;
        let begun = match (&mut piece.begun, &claimed.piece) {
            (_, Piece::Assembly { of }) => {
                let Some(_turn) = self.parking.assembling.try_lock() else {
                    return self.pause(claimed).map(|()| None);
                };
                let answer = Answered::new(&self.assemble(claimed, *of)?, None);
                return Ok(Some((Made::Answer(answer), watch.cost())));
            }
            (Some(begun), _) => begun,
            (begun, Piece::Whole { task }) => begun.insert(self.begin_run(claimed, task)?),
            (begun, Piece::Chunk { number, of }) => {
                begun.insert(self.begin_chunk(claimed, *number, *of)?)
            }
        };
        loop {
            self.hand_over();
            self.check(claimed)?;
            let step = (begun.step)();
            let cost = begun.cost + watch.cost();
            let progress = match step {
                Step::Done(made) => return Ok(Some((made, cost))),
                Step::Working { progress } => progress,
            };
            let spent = claimed.spent + cost;
            if let Some(limit) = begun.limit
                && spent.cpu.unwrap_or(spent.wall) > limit
            {
                let message = format!(
                    "the computation took longer than the {} that this server allows",
                    humantime::format_duration(limit)
                );
                return Err(NotMade::Failed(FailureKind::TimeLimit, message));
            }
            if watch.elapsed() >= SLICE && self.batch.lock().waiting.is_empty() {
                begun.cost = cost;
                match self.runtime.block_on(self.store.progress(claimed, progress)) {
                    Ok(true) => {}
                    Ok(false) => return Err(NotMade::Unwanted),
                    // The computation continues: only the displayed progress is missing.
                    Err(error) => tracing::debug!(%error, "cannot store the progress of a run"),
                }
                return Ok(None);
            }
        }
    }

    fn begin_run(&self, claimed: &Claimed, task: &str) -> Result<Begun, NotMade> {
        let mut work = (self.compute)(&claimed.key, task).map_err(unreadable)?;
        let limit = match asked_in(task) {
            Some((TaskKind::Study(_), _)) => self.limits.study,
            _ => self.limits.run,
        };
        let bytes = work.bytes();
        let step = Box::new(move || match work.step() {
            Step::Done(answer) => Step::Done(Made::Answer(Answered::new(&answer, None))),
            Step::Working { progress } => Step::Working { progress },
        });
        Ok(Begun { step, bytes, limit, cost: Cost::ZERO })
    }

    fn begin_chunk(&self, claimed: &Claimed, number: u32, of: u32) -> Result<Begun, NotMade> {
        let study = self.study(claimed)?;
        let (bytes, limit) = (study.memory_of_chunk(of as usize), self.limits.study);
        // A study that was canceled has computed its first chunks.
        let known = self.runtime.block_on(self.store.canceled_chunk(claimed, number, of));
        if let Ok(Some(rows)) = known
            && Rows::from_bytes(&rows).is_some_and(|rows| {
                rows.count == study.points_of(number as usize, of as usize).len()
            })
        {
            let step = Box::new(move || Step::Done(Made::Rows(rows.to_vec())));
            return Ok(Begun { step, bytes, limit, cost: Cost::ZERO });
        }
        let mut earlier = Rows::default();
        for number in 0..study.earlier_chunks(number as usize, of as usize) as u32 {
            earlier.append(self.stored_rows(claimed, number)?);
        }
        let mut points = Points::chunk(study, number as usize, of as usize, earlier);
        let step = Box::new(move || match points.step() {
            Some(rows) => Step::Done(Made::Rows(rows.to_bytes())),
            None => Step::Working { progress: points.progress() },
        });
        Ok(Begun { step, bytes, limit, cost: Cost::ZERO })
    }

    /// The rows of a finished chunk.
    fn stored_rows(&self, claimed: &Claimed, number: u32) -> Result<Rows, NotMade> {
        let bytes = self.read(claimed, async || self.store.chunk(claimed, number).await)?;
        let form = || unreadable(format!("chunk {number} has the form of another version"));
        Rows::from_bytes(&bytes).ok_or_else(form)
    }

    /// Makes the result of a study from its chunks.
    fn assemble(&self, claimed: &Claimed, of: u32) -> Result<Answer, NotMade> {
        let study = self.study(claimed)?;
        let mut rows = Rows::default();
        for number in 0..of {
            self.hand_over();
            self.check(claimed)?;
            rows.append(self.stored_rows(claimed, number)?);
        }
        if rows.count != study.points() {
            let message = format!(
                "the stored parts of the study have {} rows, not {}",
                rows.count,
                study.points()
            );
            return Err(unreadable(message));
        }
        let goes_on = &mut || self.check(claimed).is_ok();
        // If `check` fails during the computation, it fails again, because a reason to stop never disappears.
        let stopped = || self.check(claimed).err().unwrap_or(NotMade::Interrupted);
        Answer::of_study_while(claimed.key, &study, rows, goes_on).ok_or_else(stopped)
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
