//! The limits of one job: processor time, points and size.

use std::time::Duration;

use fretwork_engine::scenario::MAX_ANSWER;

use fretwork_job::{Prepared, Task};

/// Maximum size of the result of a new run as JSON, in bytes. A result that is already known may be larger.
pub const RUN_BYTES: usize = 16_000_000;

/// The limits of new runs and studies.
#[derive(Debug, Clone, Copy)]
pub struct WorkLimits {
    /// Maximum processor time of a run; `None` means no limit.
    pub run: Option<Duration>,
    /// Maximum processor time of a study; `None` means no limit.
    pub study: Option<Duration>,
    /// Maximum number of points of a study.
    pub study_points: usize,
    /// Maximum size of the result of a study as JSON, in bytes.
    pub study_bytes: usize,
}

impl Default for WorkLimits {
    fn default() -> Self {
        Self { run: None, study: None, study_points: 1 << 20, study_bytes: MAX_ANSWER }
    }
}

impl WorkLimits {
    /// Why a task is refused if its result is not known.
    pub fn refuse(&self, prepared: &Prepared) -> Option<Excess> {
        let time = Duration::try_from_secs_f64(prepared.seconds).unwrap_or(Duration::MAX);
        let limit = match &prepared.task {
            Task::Run(run) => {
                let bytes = run.1.answer_bytes();
                if bytes > RUN_BYTES {
                    return Some(Excess::RunBytes { bytes, limit: RUN_BYTES });
                }
                self.run
            }
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

/// A limit, and what a task that exceeds it would take. The displayed text also says what to change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Excess {
    /// Processor time.
    #[error(
        "The computation would take about {}, and the limit of this server is {}. Request fewer points, output cycles \
         or profiles, an earlier last cycle, or a larger `tolerance`.",
        humantime::format_duration(Duration::from_secs(time.as_secs())),
        humantime::format_duration(*limit)
    )]
    Time {
        /// The estimated time of the task.
        time: Duration,
        /// The limit.
        limit: Duration,
    },
    /// Points of a study.
    #[error(
        "The study has {points} points, and the limit of this server is {limit}. Request fewer values or samples."
    )]
    Points {
        /// The number of points of the study.
        points: usize,
        /// The limit.
        limit: usize,
    },
    /// Size of the result of a run.
    #[error(
        "The result would have about {:.1} MB, and the limit is {:.1} MB. Request profiles at fewer output cycles \
         (`profiles_at`), fewer output cycles (`cycles`), or fewer radii (`points`).",
        *bytes as f64 / 1e6,
        *limit as f64 / 1e6
    )]
    RunBytes {
        /// The estimated size of the result.
        bytes: usize,
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
        /// The largest possible size of the result.
        bytes: usize,
        /// The limit.
        limit: usize,
    },
}
