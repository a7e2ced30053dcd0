//! What a worker has claimed.

use super::error::Error;
use super::row::{Part, RunId};
use super::signals::Stop;
use super::transaction::Transaction;
use crate::job::{Cost, Key};

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

impl Claim {
    /// The attempt of the running run. Returns `None` if the worker has lost its piece of it. For a whole run the caller compares
    /// the attempt.
    pub(super) async fn attempt_of_run(self, tx: &mut Transaction) -> Result<Option<u32>, Error> {
        let (run, number) = self.part;
        let Some(number) = number else { return Ok(Some(self.attempt)) };
        let query = sqlx::query_scalar(
            "SELECT run.attempt FROM chunk JOIN run ON run.id = chunk.run
             WHERE chunk.run = ?1 AND number = ?2 AND chunk.attempt = ?3
                 AND chunk.state = 'running' AND run.state = 'running'",
        );
        let query = query.bind(run.0).bind(number).bind(self.attempt);
        Ok(query.fetch_optional(&mut tx.db).await?)
    }
}
