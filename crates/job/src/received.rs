//! Verifies a result that another server computed: its key must belong to its scenario, and this program must compute
//! the same numbers.

use std::fmt;
use std::str::{self, FromStr};
use std::sync::Arc;

use fretwork_engine::{Fault, Faults};

use super::{
    BadDocument, BadWord, Canonical, ENGINE, Key, Prepared, ResultDocument, Step, Task, TaskKind,
};
use fretwork_json as json;
use fretwork_study::{Claimed, Points, Study};

/// A result may be larger than twice its estimated size by this number of bytes.
const SLACK: usize = 100_000;

/// Deepest nesting of a result. The parser needs memory for each level. A result has less than 10.
const MAX_DEPTH: usize = 100;

/// Whether a text is nested too deeply for a result. Brackets in strings count too. The strings of results contain no
/// brackets.
pub fn is_too_deep(json: &[u8]) -> bool {
    let mut depth = 0_usize;
    json.iter().any(|byte| {
        match byte {
            b'[' | b'{' => depth += 1,
            b']' | b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        depth > MAX_DEPTH
    })
}

/// A result whose key belongs to its scenario.
#[derive(Debug)]
pub struct Received {
    /// The members of the result.
    pub document: ResultDocument,
    work: Work,
}

/// The work that computes the result again.
#[derive(Debug)]
enum Work {
    /// Nothing is computed again, because an earlier version of the engine computed the result.
    Earlier,
    Run(Prepared),
    Study(Arc<Study>, Claimed),
}

/// How much of an imported result was computed again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verified {
    /// All of it.
    All,
    /// This number of randomly chosen rows of a study.
    Rows(u64),
    /// Nothing. Only its form was checked.
    No,
}

impl fmt::Display for Verified {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.write_str("all"),
            Self::Rows(rows) => rows.fmt(f),
            Self::No => f.write_str("none"),
        }
    }
}

impl FromStr for Verified {
    type Err = BadWord;

    fn from_str(text: &str) -> Result<Self, BadWord> {
        match text {
            "all" => Ok(Self::All),
            "none" => Ok(Self::No),
            rows => rows.parse().map(Self::Rows).map_err(|_| BadWord("verification")),
        }
    }
}

/// Why a result is refused.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// The body is not a result.
    #[error(transparent)]
    Document(#[from] BadDocument),
    /// The key is not the key of the scenario.
    #[error(
        "the key of the result does not belong to the scenario in the result: one of them was changed, or another \
         version of fretwork made the key in another way; submit the scenario to the server instead"
    )]
    Key,
    /// A later version of the engine computed the result.
    #[error(
        "a later version of fretwork (numerics {0}) computed the result; update this program first"
    )]
    Later(u32),
    /// This version refuses the scenario.
    #[error("the scenario in the result is not valid: {0}")]
    Scenario(String),
    /// The body is nested too deeply, too large, or not UTF-8.
    #[error("the JSON of the result is too large, nested too deeply, or not UTF-8")]
    Form,
    /// An earlier version of the engine computed this study: its rows cannot be checked.
    #[error(
        "an earlier version of the engine computed this study, so its rows cannot be checked; submit the study to the \
         server instead"
    )]
    EarlierStudy,
    /// This program would write the result in another way.
    #[error("the result is not byte for byte the one that this server computes: {0}")]
    Differs(String),
}

impl Received {
    /// Reads the body of a result under its key.
    ///
    /// # Errors
    /// The body cannot be the result of the key.
    pub fn read(key: &Key, body: &[u8]) -> Result<Self, Refused> {
        let text = str::from_utf8(body).ok().filter(|_| !is_too_deep(body));
        let text = text.ok_or(Refused::Form)?;
        let document = ResultDocument::read(body)?;
        let numerics = document.numerics;
        if numerics > ENGINE.numerics {
            return Err(Refused::Later(numerics));
        }
        // The store keeps the scenario in its stored form, and `check` compares it with the key.
        let asked = &document.asked;
        let stored = Canonical::in_stored(&asked.kind.stored(&asked.value));
        let is_own = |asked: &Canonical| asked.key(numerics) == *key;
        if document.engine != ENGINE.name
            || numerics == 0
            || document.key != key.to_string()
            || !is_own(asked)
            || !stored.is_some_and(|stored| is_own(&stored))
        {
            return Err(Refused::Key);
        }
        let work = match (numerics == ENGINE.numerics, document.asked.kind) {
            (true, _) => Work::of(key, &document, text)?,
            (false, TaskKind::Run) => Work::Earlier,
            (false, TaskKind::Study(_)) => return Err(Refused::EarlierStudy),
        };
        Ok(Self { document, work })
    }

    /// The number of rows that can be computed again independently. A run is one row.
    pub fn rows(&self) -> usize {
        match &self.work {
            Work::Earlier => 0,
            Work::Run(_) => 1,
            Work::Study(study, _) => study.points(),
        }
    }

    /// Estimated processor time of a row, in seconds; `None` if it is not known.
    pub fn row_seconds(&self) -> Option<f64> {
        match &self.work {
            Work::Run(task) => Some(task.seconds),
            Work::Earlier | Work::Study(..) => None,
        }
    }

    /// Computes a row again and compares it. Calls `goes_on` after each step of about 30 ms, and returns `None` if it
    /// is false.
    ///
    /// # Errors
    /// The new row differs.
    pub fn verify_row(
        &self,
        body: &[u8],
        row: usize,
        mut goes_on: impl FnMut() -> bool,
    ) -> Option<Result<(), Refused>> {
        match &self.work {
            Work::Earlier => None,
            Work::Run(task) => {
                let mut work = task.start();
                loop {
                    match work.step() {
                        Step::Done(answer) if answer.body == body => return Some(Ok(())),
                        Step::Done(answer) => return Some(Err(differs(body, &answer.body))),
                        Step::Working { .. } if goes_on() => {}
                        Step::Working { .. } => return None,
                    }
                }
            }
            Work::Study(study, claimed) => {
                let needs_rows = study.earlier_chunks(row, study.points()) > 0;
                // `read` has checked the counts, the only possible fault.
                let earlier = needs_rows.then(|| claimed.rows(study).ok()).flatten();
                let earlier = earlier.unwrap_or_default();
                let mut point = Points::chunk(Arc::clone(study), row, study.points(), earlier);
                loop {
                    match point.step() {
                        Some(own) => {
                            return Some(
                                claimed.compare(study, row, &own).map_err(Refused::Differs),
                            );
                        }
                        None if goes_on() => {}
                        None => return None,
                    }
                }
            }
        }
    }

    /// How much of the result is verified if this number of rows agrees with a new computation.
    ///
    /// # Errors
    /// The result contradicts its rows.
    pub fn verified(&self, rows: usize) -> Result<Verified, Refused> {
        if rows == 0 {
            return Ok(Verified::No);
        }
        if rows < self.rows() {
            return Ok(Verified::Rows(rows as u64));
        }
        if let Work::Study(_, claimed) = &self.work {
            claimed.compare_counts().map_err(Refused::Differs)?;
        }
        Ok(Verified::All)
    }
}

impl Work {
    /// The work that computes a result of this version of the engine again.
    fn of(key: &Key, document: &ResultDocument, body: &str) -> Result<Self, Refused> {
        let told = |Faults(faults): Faults| {
            let first = faults.into_iter().next();
            let told = first.map(|Fault { pointer, detail }| format!("{pointer}: {detail}"));
            Refused::Scenario(told.unwrap_or_default())
        };
        let asked = document.asked.clone();
        let task = Prepared::read(asked.kind, asked.value).map_err(told)?;
        let most = match &task.task {
            Task::Run(run) => 2 * run.1.answer_bytes() + SLACK,
            Task::Study(study) => 2 * study.bytes() + SLACK,
        };
        if task.key != *key || body.len() > most {
            return Err(Refused::Form);
        }
        match &task.task {
            Task::Run(_) => Ok(Self::Run(task)),
            Task::Study(study) => {
                let claimed = Claimed::read(study, key, &ENGINE, body).map_err(Refused::Differs)?;
                Ok(Self::Study(Arc::clone(study), claimed))
            }
        }
    }
}

/// The refusal of a body that differs from the one that this program computes.
fn differs(body: &[u8], own: &[u8]) -> Refused {
    let [file, own] = [body, own].map(String::from_utf8_lossy);
    Refused::Differs(json::difference("", &file, &own))
}
