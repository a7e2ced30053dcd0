//! A result that another server computed: whether it can be what it says.

use std::cmp::Ordering;
use std::time::{Duration, Instant};

use fretwork_engine::outcome::{History, Loops, Outcome, Profiles};
use fretwork_engine::request::fault::{Fault, Faults};
use fretwork_engine::simulation::{Flaw, check, check_tables};
use serde::Deserialize;

use super::task::write;
use super::{BadDocument, Document, ENGINE, Key, Prepared, Step, Task, TaskKind};

/// Longest time to compute one result anew.
const LONGEST_RECOMPUTATION: Duration = Duration::from_mins(10);

/// Bytes that a result may have in addition to twice the estimate.
const SLACK: usize = 100_000;

/// Deepest nesting of a result. The parser needs memory for each level. A result has less than 10.
const MAX_DEPTH: usize = 100;

/// How deep a text is nested. Brackets in strings count, too; those of results have none.
fn depth(json: &[u8]) -> usize {
    let (mut depth, mut deepest) = (0_usize, 0);
    for byte in json {
        match byte {
            b'[' | b'{' => depth += 1,
            b']' | b'}' => depth = depth.saturating_sub(1),
            _ => continue,
        }
        deepest = deepest.max(depth);
    }
    deepest
}

/// A result whose key belongs to its scenario, and whose members have the form of a result.
#[derive(Debug)]
pub struct Received {
    /// What the result says.
    pub document: Document,
    /// The task that computes it; `None` if an earlier version of the engine computed it.
    pub task: Option<Prepared>,
    /// What makes the result doubtful. About 1 in 500 correct results has a flaw.
    pub flaw: Option<Flaw>,
}

/// Why a result is refused.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// The body is not a result.
    #[error(transparent)]
    Document(#[from] BadDocument),
    /// Its key is not the key of its scenario.
    #[error(
        "its key does not belong to its scenario: one of them was changed, or another version of fretwork makes keys \
         differently"
    )]
    Key,
    /// A later version computed it.
    #[error("a later version of fretwork computed it (numerics {0}); update this program first")]
    Later(u32),
    /// This version refuses the scenario.
    #[error("its scenario is not valid: {0}")]
    Scenario(String),
    /// A member is missing, added or has another form.
    #[error(
        "its body is not written as this version writes results: a member was changed, added or removed"
    )]
    Form,
    /// An earlier version of the engine computed this study: its rows cannot be checked.
    #[error(
        "an earlier version of the engine computed this study; submit it to the server instead"
    )]
    EarlierStudy,
    /// The rows do not belong to the study.
    #[error("its rows do not belong to its study: {0}")]
    Study(String),
    /// The tables do not agree with each other.
    #[error("its tables contradict each other: {0}")]
    Tables(Flaw),
    /// It is doubtful, and a new computation differs.
    #[error("its numbers contradict its scenario ({0}), and this server computes others")]
    Doubtful(Flaw),
    /// A new computation differs.
    #[error("this server computes other numbers for its scenario")]
    Differs,
    /// A new computation takes too long.
    #[error(
        "to compute it anew takes more than {} minutes: submit its scenario to the server instead",
        LONGEST_RECOMPUTATION.as_secs() / 60
    )]
    Long,
}

/// The tables of a result of any version.
#[derive(Deserialize)]
struct Tables {
    history: History,
    profiles: Option<Profiles>,
    loops: Option<Loops>,
}

impl Received {
    /// Judges the body of a result. A result of this version of the engine must be written exactly as this version writes
    /// it, and is checked against its scenario. A result of an earlier version must have whole tables.
    ///
    /// # Errors
    /// The body cannot be the result of its key.
    pub fn judge(key: &Key, body: &[u8]) -> Result<Self, Refused> {
        if depth(body) > MAX_DEPTH {
            return Err(Refused::Form);
        }
        let document = Document::read(body)?;
        let numerics = document.numerics;
        if numerics > ENGINE.numerics {
            return Err(Refused::Later(numerics));
        }
        if document.engine != ENGINE.name
            || document.key != key.to_string()
            || document.asked.key(numerics) != *key
        {
            return Err(Refused::Key);
        }
        match numerics.cmp(&ENGINE.numerics) {
            Ordering::Equal => Self::judge_present(key, body, document),
            _ => Self::judge_earlier(body, document),
        }
    }

    fn judge_present(key: &Key, body: &[u8], document: Document) -> Result<Self, Refused> {
        let asked = document.asked.clone();
        let told = |faults: Faults| {
            let mut details = faults
                .0
                .into_iter()
                .map(|Fault { pointer, detail }| format!("{pointer}: {detail}"));
            Refused::Scenario(details.next().unwrap_or_default())
        };
        let task = Prepared::read(asked.kind, asked.value).map_err(told)?;
        if task.key != *key {
            return Err(Refused::Form);
        }
        let flaw = match &task.task {
            Task::Run(run) => {
                let (scenario, case) = &**run;
                // The numbers of a text take four times its bytes in memory.
                if body.len() > 2 * case.answer_bytes() + SLACK {
                    return Err(Refused::Form);
                }
                let outcome: Outcome = serde_json::from_slice(body).map_err(|_| Refused::Form)?;
                if write(*key, scenario, &outcome, body.len()).as_bytes() != body {
                    return Err(Refused::Form);
                }
                check(scenario, case, &outcome).err()
            }
            Task::Study(study) => {
                study.judge(key, &ENGINE, body).map_err(Refused::Study)?;
                None
            }
        };
        Ok(Self { document, task: Some(task), flaw })
    }

    fn judge_earlier(body: &[u8], document: Document) -> Result<Self, Refused> {
        if let TaskKind::Study(_) = document.asked.kind {
            return Err(Refused::EarlierStudy);
        }
        let Tables { history, profiles, loops } =
            serde_json::from_slice(body).map_err(BadDocument::from)?;
        check_tables(&history, profiles.as_ref(), loops.as_ref()).map_err(Refused::Tables)?;
        Ok(Self { document, task: None, flaw: None })
    }

    /// Computes the result anew and compares it with its body. Does nothing for a result of an earlier version.
    ///
    /// # Errors
    /// The new result differs, or takes more than 10 minutes.
    pub fn recompute(&self, body: &[u8]) -> Result<(), Refused> {
        let Some(task) = &self.task else { return Ok(()) };
        let (started, mut work) = (Instant::now(), task.start());
        let answer = loop {
            if let Step::Done(answer) = work.step() {
                break answer;
            }
            if started.elapsed() > LONGEST_RECOMPUTATION {
                return Err(Refused::Long);
            }
        };
        if answer.body == body {
            return Ok(());
        }
        Err(self.flaw.clone().map_or(Refused::Differs, Refused::Doubtful))
    }
}
