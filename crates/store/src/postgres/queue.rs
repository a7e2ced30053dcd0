//! Whose turn it is: the owners with work, and where the queue of each owner begins.
//!
//! The queue is an index of the jobs. A claim reads it from its beginning. While a transaction with an old snapshot is
//! open, such as a backup, PostgreSQL removes no dead entries, and all of them are at this beginning. If there are
//! many, this server remembers the owners and the places of its last claims, and begins there. It still reads from the
//! beginning now and then, because it finds new owners and runs that were queued again only so.

use std::collections::HashMap;
use std::time::Instant;

use parking_lot::Mutex;

use super::rest::{self, Rest};
use crate::database::{Result, Statement, Tables};
use fretwork_job::ENGINE;

/// The owners with work for a worker of the `numerics` version $1, with their most urgent jobs and the numbers of their
/// running parts. The owner with the oldest of these jobs comes first. The query jumps from owner to owner in the index
/// `job_claimable`, so the length of the queue does not matter, and it reads dead entries only once.
const OWNERS: &str = "
    WITH RECURSIVE waiting AS (
        (SELECT owner, priority, study, id FROM job WHERE claimable = $1 ORDER BY owner, priority, study, id LIMIT 1)
        UNION ALL
        SELECT next.* FROM waiting CROSS JOIN LATERAL (
            SELECT owner, priority, study, id FROM job WHERE claimable = $1 AND owner > waiting.owner
            ORDER BY owner, priority, study, id LIMIT 1) AS next
    )
    SELECT *, (SELECT count(*) FROM lease WHERE lease.owner = waiting.owner) AS running FROM waiting ORDER BY id";

/// Jobs have the priorities from 0 to 7.
const PRIORITIES: usize = 8;
/// After the queue was read from its beginning, it is read from remembered places for this multiple of the time that
/// this has taken: while a claim finds runs, and if it finds none.
const REST: (u32, u32) = (20, 4);
/// Maximum number of owners whose last turns are remembered.
const REMEMBERED: usize = 1000;

/// An owner with work.
#[derive(Debug, Clone)]
pub(super) struct Waiting {
    pub(super) owner: String,
    /// What this server has computed for the owner lately.
    usage: u64,
    /// The number of running parts.
    pub(super) running: u64,
    /// The number of the last turn. A larger number is a later turn.
    turn: u64,
    /// For each priority, the id of a job before which no whole run of the owner waits.
    pub(super) places: [Vec<u8>; PRIORITIES],
    /// Whether this claim leaves the owner out, or has found no more parts of it.
    pub(super) is_done: bool,
    /// Whether this claim takes nothing, because a part of this owner must run alone.
    pub(super) must_wait: bool,
}

/// The owners with work. Among owners with equally many running parts and equal turns, the first one comes first.
#[derive(Debug, Clone, Default)]
pub(super) struct Turns {
    pub(super) owners: Vec<Waiting>,
    last: u64,
    /// When the queue was read from its beginning; `None` if the owners were remembered.
    read: Option<Rest>,
}

impl Turns {
    /// Leaves out the owners without a `usage`.
    pub(super) fn rank(&mut self, usage: impl Fn(&str) -> Option<u64>) {
        for waiting in &mut self.owners {
            let used = usage(&waiting.owner);
            (waiting.usage, waiting.is_done) = (used.unwrap_or(0), used.is_none());
            waiting.must_wait = false;
        }
    }

    /// Whether all owners are left out.
    pub(super) fn are_done(&self) -> bool {
        self.owners.iter().all(|waiting| waiting.is_done)
    }

    /// Distributes up to `count` parts. Each goes to the owner with the least usage; among equals, to the one with the
    /// fewest running parts; among equals, to the one whose last turn was longest ago. Returns the places of owners in the list, and their numbers of parts.
    pub(super) fn shares(&mut self, count: usize) -> Vec<(usize, usize)> {
        let mut shares: Vec<(usize, usize)> = Vec::new();
        for _ in 0..count {
            let share = |place| {
                shares.iter().find(|(other, _)| *other == place).map_or(0, |(_, share)| *share)
            };
            let waiting = self.owners.iter().enumerate().filter(|(_, waiting)| !waiting.is_done);
            let next = waiting
                .min_by_key(|(place, of)| (of.usage, of.running + share(*place) as u64, of.turn));
            let Some((next, _)) = next else { break };
            self.last += 1;
            self.owners[next].turn = self.last;
            match shares.iter_mut().find(|(place, _)| *place == next) {
                Some((_, share)) => *share += 1,
                None => shares.push((next, 1)),
            }
        }
        shares
    }
}

/// What this server remembers of the queue.
#[derive(Debug, Default)]
pub(super) struct Queue(Mutex<Memory>);

#[derive(Debug, Default)]
struct Memory {
    turns: Turns,
    /// The last turn of each owner. Servers do not share their turns, but they share the numbers of running parts.
    served: HashMap<String, u64>,
    /// When the queue was last read from its beginning.
    read: Rest,
    /// When a claim has begun to read it.
    reading: Option<Instant>,
}

impl Queue {
    /// The remembered owners and places; `None` if the queue must be read from its beginning. `dead` is the number of
    /// dead rows. `has_failed` says whether nothing was found at the remembered places.
    pub(super) fn remembered(&self, dead: u64, has_failed: bool) -> Option<Turns> {
        let mut memory = self.0.lock();
        // While one claim reads the queue from its beginning, the others go on.
        let is_read = || memory.reading.is_some_and(|begun| begun.elapsed() < rest::MAX);
        let goes_on = if has_failed {
            memory.read.lasts(REST.1, dead)
        } else {
            memory.read.lasts(REST.0, dead) || (dead > rest::FEW && is_read())
        };
        if goes_on {
            return Some(memory.turns.clone());
        }
        memory.reading = Some(Instant::now());
        None
    }

    /// Reads the owners with work.
    pub(super) async fn read(&self, db: &mut impl Tables) -> Result<Turns> {
        let begun = Instant::now();
        let rows = db.rows(Statement::of(OWNERS).with(ENGINE.numerics)).await?;
        let memory = self.0.lock();
        let last = memory.turns.last;
        let mut owners = Vec::new();
        for row in rows {
            let owner: String = row.get("owner")?;
            let turn = memory.served.get(&owner).copied().unwrap_or(last.saturating_sub(1));
            let mut places: [Vec<u8>; PRIORITIES] = Default::default();
            if !row.get::<bool>("study")? {
                places[usize::from(row.get::<u8>("priority")?)] = row.get("id")?;
            }
            let running = row.get("running")?;
            let (usage, is_done, must_wait) = (0, false, false);
            owners.push(Waiting { owner, usage, running, turn, places, is_done, must_wait });
        }
        Ok(Turns { owners, last, read: Some(Rest::since(begun)) })
    }

    /// Remembers the turns and places after a claim.
    pub(super) fn remember(&self, mut turns: Turns) {
        let mut memory = self.0.lock();
        if let Some(read) = turns.read.take() {
            (memory.read, memory.reading) = (read, None);
        }
        turns.last = turns.last.max(memory.turns.last);
        for waiting in &mut turns.owners {
            waiting.is_done = false;
            memory.served.insert(waiting.owner.clone(), waiting.turn);
        }
        if memory.served.len() > REMEMBERED {
            let oldest = turns.last.saturating_sub(REMEMBERED as u64 / 2);
            memory.served.retain(|_, turn| *turn > oldest);
        }
        memory.turns = turns;
    }
}
