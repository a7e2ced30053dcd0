//! How much one job may take.

use std::time::Duration;

use fretwork_engine::scenario::MAX_ANSWER;

use fretwork_job::{Prepared, Task};

/// What new runs and studies may take.
#[derive(Debug, Clone, Copy)]
pub struct WorkLimits {
    /// Processor time of a run; `None` for any.
    pub run: Option<Duration>,
    /// Processor time of a study; `None` for any.
    pub study: Option<Duration>,
    /// Points of a study.
    pub study_points: usize,
    /// Size of the result of a study as JSON, in bytes.
    pub study_bytes: usize,
}

impl Default for WorkLimits {
    fn default() -> Self {
        Self { run: None, study: None, study_points: 1 << 20, study_bytes: MAX_ANSWER }
    }
}

impl WorkLimits {
    /// Why a task is refused if its result is not known.
    #[must_use]
    pub fn refuse(&self, prepared: &Prepared) -> Option<Excess> {
        let time = Duration::try_from_secs_f64(prepared.seconds).unwrap_or(Duration::MAX);
        let limit = match &prepared.task {
            Task::Run(_) => self.run,
            Task::Study(study) => {
                let (points, bytes) = (study.points(), study.bytes());
                if points > self.study_points {
                    return Some(Excess::Points { points, limit: self.study_points });
                }
                if bytes > self.study_bytes {
                    return Some(Excess::Bytes { bytes, limit: self.study_bytes });
                }
                self.study
            }
        };
        limit.filter(|limit| time > *limit).map(|limit| Excess::Time { time, limit })
    }
}

/// What a task would take, and the limit. In words, it also says what to change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Excess {
    /// Processor time.
    #[error(
        "It would take about {}, and the limit of this server is {}. Request fewer points, output cycles or profiles, an \
         earlier last cycle, or a larger tolerance.",
        humantime::format_duration(Duration::from_secs(time.as_secs())),
        humantime::format_duration(*limit)
    )]
    Time {
        /// The estimate.
        time: Duration,
        /// The limit.
        limit: Duration,
    },
    /// Points of a study.
    #[error(
        "The study has {points} points, and the limit of this server is {limit}. Request fewer values or samples."
    )]
    Points {
        /// Its points.
        points: usize,
        /// The limit.
        limit: usize,
    },
    /// Size of the result of a study.
    #[error(
        "The result of the study could have {:.1} MB, and the limit of this server is {:.1} MB. Request fewer values, \
         samples, outputs or radii.",
        *bytes as f64 / 1e6,
        *limit as f64 / 1e6
    )]
    Bytes {
        /// The largest possible size.
        bytes: usize,
        /// The limit.
        limit: usize,
    },
}
