//! A run, or a piece of a study, that a worker has claimed.

use std::borrow::Cow;
use std::time::Duration;

use crate::database::{Connected, Effect, Result, Row, RunId, RunPart, Stop, Tables, read, sql};
use fretwork_job::{Cost, Key};

/// A run, or a piece of a study, that a worker has claimed.
#[derive(Debug, Clone)]
pub struct Claimed {
    /// The id of the run.
    pub run: RunId,
    /// The owner in whose turn it was claimed.
    pub owner: String,
    /// The number of this attempt to compute the piece, from 1.
    pub attempt: u32,
    /// How often the process has died during earlier attempts.
    pub lost: u32,
    /// The key of the result.
    pub key: Key,
    /// What to compute.
    pub piece: Piece,
    /// What the finished chunks of the study have cost.
    pub spent: Cost,
    /// The id of the request that submitted the run, for the log.
    pub trace: Option<String>,
    /// Tells the worker that its run has ended or that no job needs the result any more.
    pub stop: Stop,
}

/// The work of one claim.
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
    /// A whole run, from its row.
    pub(crate) fn whole(run: RunId, owner: String, row: &Row) -> sqlx::Result<Self> {
        let piece = Piece::Whole { task: row.get("task")? };
        let (spent, stop) = (Cost::ZERO, Stop::default());
        Ok(read!(row => Self { attempt, lost, key, trace; run, owner, piece, spent, stop }))
    }

    /// A piece of a study with this number of chunks, read from the row of the study and its run.
    pub(crate) fn piece(
        run: RunId,
        owner: String,
        (number, of): (u32, u32),
        attempt: u32,
        row: &Row,
    ) -> sqlx::Result<Self> {
        let piece = if number == of { Piece::Assembly { of } } else { Piece::Chunk { number, of } };
        let (spent, stop) = (cost(row)?, Stop::default());
        Ok(read!(row => Self { lost, key, trace; run, owner, attempt, piece, spent, stop }))
    }

    /// The task in its stored form.
    pub(crate) async fn task(&self, db: &mut impl Connected) -> Result<Cow<'_, str>> {
        if let Piece::Whole { task } = &self.piece {
            return Ok(task.into());
        }
        let row = db.one(sql!("SELECT task FROM run WHERE id = $1"; self.run)).await?;
        Ok(Cow::Owned(row.get("task")?))
    }

    pub(crate) fn part(&self) -> RunPart {
        let number = match self.piece {
            Piece::Whole { .. } => None,
            Piece::Chunk { number, .. } => Some(number),
            Piece::Assembly { of } => Some(of),
        };
        (self.run, number)
    }

    /// What is signalled after the claim.
    pub(crate) fn started(&self) -> Effect {
        Effect::Started(self.part(), self.stop.clone(), self.lost)
    }

    pub(crate) fn claim(&self) -> Claim {
        Claim { part: self.part(), attempt: self.attempt, key: self.key }
    }
}

/// Identifies a claim. If another worker has claimed the part since, the changes of the first worker are ignored.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Claim {
    pub(crate) part: RunPart,
    pub(crate) attempt: u32,
    pub(crate) key: Key,
}

impl Claim {
    /// The attempt of the run. For a piece of a study: `None` if the worker has lost the piece. For a whole run, the
    /// caller compares the returned attempt with that in the table.
    pub(crate) async fn attempt_of_run(self, db: &mut impl Connected) -> Result<Option<u32>> {
        let (run, Some(number)) = self.part else { return Ok(Some(self.attempt)) };
        let query = sql!(
            "SELECT run.attempt AS attempt FROM chunk JOIN run ON run.id = chunk.run
             WHERE chunk.run = $1 AND number = $2 AND chunk.attempt = $3
                 AND chunk.state = 'running' AND run.state = 'running'";
            run, number, self.attempt
        );
        Ok(db.row(query).await?.map(|row| row.get("attempt")).transpose()?)
    }
}

/// The number of pieces of an unfinished study in each state.
#[derive(Debug, Clone)]
pub(crate) struct Study {
    pub(crate) chunks: u32,
    /// The number of the first piece that was never claimed.
    pub(crate) next: u32,
    /// Number of pieces that were claimed, and are queued again.
    pub(crate) queued: u32,
    pub(crate) running: u32,
    pub(crate) stages: Stages,
}

/// The pieces with which the later stages of a study begin.
#[derive(Debug, Clone, Default)]
pub(crate) struct Stages(Vec<u32>);

impl Stages {
    /// Reads numbers that are separated by commas, as the database stores them.
    pub(crate) fn read(text: &str) -> Self {
        Self(text.split(',').filter_map(|number| number.parse().ok()).collect())
    }
}

impl Study {
    /// Whether a worker can claim a piece.
    pub(crate) fn is_ready(&self) -> bool {
        self.is_next_ready() || self.queued > 0
    }

    /// Whether a worker can claim the next piece. The first piece of a stage waits for all pieces before it, and so
    /// does the last piece, the assembly.
    pub(crate) fn is_next_ready(&self) -> bool {
        let waits = self.next == self.chunks || self.stages.0.contains(&self.next);
        self.next <= self.chunks && (!waits || self.queued + self.running == 0)
    }

    /// Number of finished pieces.
    pub(crate) fn done(&self) -> u32 {
        self.next - self.queued - self.running
    }
}

/// The progress of a study is stored in this number of steps. Each step wakes the clients that wait for the study.
const STEPS: u64 = 200;

/// Whether the progress of a study reaches a new step with its `done`-th finished chunk.
pub(crate) fn is_step(done: u32, chunks: u32) -> bool {
    let step = |done: u32| u64::from(done) * STEPS / u64::from(chunks);
    step(done) != step(done - 1)
}

/// Reads the columns `wall` and `cpu`, in seconds.
fn cost(row: &Row) -> sqlx::Result<Cost> {
    let duration = |seconds| {
        Duration::try_from_secs_f64(seconds).map_err(|error| sqlx::Error::Decode(Box::new(error)))
    };
    let cpu = row.get::<Option<f64>>("cpu")?.map(duration).transpose()?;
    Ok(Cost { wall: duration(row.get("wall")?)?, cpu })
}
