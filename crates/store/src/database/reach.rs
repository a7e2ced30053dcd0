//! What a caller sees of the jobs and the notes of others.

use crate::database::statement::Statement;

/// The jobs that a caller sees.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Seen {
    /// All jobs.
    #[default]
    All,
    /// Its own jobs, and those that their owners share.
    Shared,
    /// Its own jobs.
    Own,
}

/// A caller, and what it sees. It always sees its own private notes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Reach {
    /// The owner of its jobs and notes.
    pub owner: String,
    /// The jobs that it sees.
    pub jobs: Seen,
}

impl Reach {
    /// Whether the caller may change what this owner has.
    pub fn may_change(&self, owner: &str) -> bool {
        self.jobs == Seen::All || owner == self.owner
    }

    /// Whether the caller sees a job of this owner.
    pub fn sees(&self, owner: &str, is_private: bool) -> bool {
        self.may_change(owner) || self.jobs == Seen::Shared && !is_private
    }
}

impl Statement {
    /// Adds the condition on `job` that the caller sees it.
    pub(crate) fn job_within(&mut self, reach: &Reach) {
        let shared = match reach.jobs {
            Seen::All => return,
            Seen::Shared => "job.private = 0 OR ",
            Seen::Own => "",
        };
        self.push(" AND (").push(shared).push("job.owner = ").push_bind(&reach.owner).push(")");
    }

    /// Adds a table of the notes that the caller sees: `note`, with the columns `key` and `text`.
    pub(crate) fn notes_within(&mut self, reach: &Reach) -> &mut Self {
        self.push("(SELECT key, text FROM note UNION ALL SELECT key, text FROM private_note WHERE owner = ");
        self.push_bind(&reach.owner).push(") AS note")
    }
}
