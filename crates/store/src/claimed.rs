//! What a worker has claimed.

use std::time::Duration;

use super::body::Body;
use super::row::{Columns, Part, RunId};
use super::signals::Stop;
use fretwork_job::{Cost, Key};

/// A run, or a piece of a study, that a worker has claimed.
#[derive(Debug, Clone)]
pub struct Claimed {
    /// The id of the run.
    pub run: RunId,
    /// The number of this attempt to compute the piece, from 1.
    pub attempt: u32,
    /// The key of the result.
    pub key: Key,
    /// What to compute.
    pub piece: Piece,
    /// What the finished chunks of the study have cost.
    pub spent: Cost,
    /// The request that submitted it, for the log.
    pub trace: Option<String>,
    /// Tells the worker that its run has ended or that no job needs the result any more.
    pub stop: Stop,
}

/// What a worker computes at a time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Piece {
    /// A whole run.
    Whole {
        /// The task in its stored form.
        task: String,
    },
    /// A chunk of a study.
    Chunk {
        /// Its number, from 0.
        number: u32,
        /// The number of chunks of the study.
        of: u32,
    },
    /// The result of a study, made from its chunks.
    Assembly {
        /// The number of chunks of the study.
        of: u32,
    },
}

impl Claimed {
    pub(super) fn part(&self) -> Part {
        let number = match self.piece {
            Piece::Whole { .. } => None,
            Piece::Chunk { number, .. } => Some(number),
            Piece::Assembly { of } => Some(of),
        };
        (self.run, number)
    }

    pub(super) fn claim(&self) -> Claim {
        Claim { part: self.part(), attempt: self.attempt }
    }
}

/// Names a claim. A worker that has lost it changes nothing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Claim {
    pub(super) part: Part,
    pub(super) attempt: u32,
}

/// A chunk and what was computed for it.
pub(super) struct FinishedChunk {
    pub(super) claim: Claim,
    pub(super) body: Body,
    pub(super) cost: Cost,
}

impl FinishedChunk {
    #[expect(clippy::expect_used, reason = "a chunk must not be lost silently")]
    pub(super) fn new(claimed: &Claimed, bytes: &[u8], cost: Cost) -> Self {
        assert!(matches!(claimed.piece, Piece::Chunk { .. }), "{:?} is no chunk", claimed.piece);
        let body = Body::pack(bytes).expect("any bytes can be compressed");
        Self { claim: claimed.claim(), body, cost }
    }
}

/// Number of steps in which the progress of a study is stored. Each step wakes its listeners.
const STEPS: u64 = 200;

/// Whether the last of `done` finished chunks takes the progress of a study to another step.
pub(super) fn is_step(done: u32, chunks: u32) -> bool {
    let step = |done: u32| u64::from(done) * STEPS / u64::from(chunks);
    step(done) != step(done - 1)
}

/// Reads the columns `wall` and `cpu`, in seconds.
pub(super) fn cost(row: &impl Columns) -> Result<Cost, sqlx::Error> {
    let duration = |seconds| {
        Duration::try_from_secs_f64(seconds).map_err(|error| sqlx::Error::Decode(Box::new(error)))
    };
    let cpu = row.get::<Option<f64>>("cpu")?.map(duration).transpose()?;
    Ok(Cost { wall: duration(row.get("wall")?)?, cpu })
}
