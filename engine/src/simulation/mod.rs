//! A run in steps, so that the caller can report progress and stop it.
//!
//! # Examples
//! ```
//! use fretwork_engine::{scenario, simulation::Simulation};
//! let request = serde_json::json!({
//!     "profile": {"shape": "paraboloid", "radius": "10 mm"},
//!     "moduli": {"normal": "112.64 GPa", "tangential": "92.76 GPa"},
//!     "friction": 0.7,
//!     "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
//!     "load": {"normal_force": "100 N", "held": "depth"},
//!     "motion": {"stick_ratio": 0.5},
//!     "cycles": {"normalized": [1e9]},
//! });
//! let (scenario, _) = scenario::check(&request, "").expect("a valid scenario");
//! let outcome = Simulation::of(&scenario).expect("a contact").run();
//! // After very many cycles the contact has reached its limiting state (11)–(13).
//! let limit = outcome.limit.expect("a limit");
//! assert!((outcome.history.normal_force[1] / limit.normal_force - 1.0).abs() < 1e-9);
//! assert!((outcome.history.wear_volume[1] / limit.wear_volume - 1.0).abs() < 1e-6);
//! ```

mod comparing;
mod recording;
mod single;

use crate::case::{Case, Method};
use crate::outcome::Outcome;
use crate::request::fault::Fault;
use crate::scenario::{Scenario, Warning};
use comparing::Comparing;
use single::SingleRun;

/// The result of a step.
#[derive(Debug)]
pub enum Advance {
    /// The run goes on. The number is the part that is done.
    Working(f64),
    /// The run is over.
    Done(Box<Outcome>),
}

/// A run under way.
#[derive(Debug)]
pub struct Simulation {
    phase: Phase,
    warnings: Vec<Warning>,
}

/// What the next step does.
#[derive(Debug)]
enum Phase {
    /// Goes on with the run.
    Running(Box<SingleRun>),
    /// Goes on with the comparison. The outcome of the run waits for it.
    Comparing(Box<Outcome>, Box<Comparing>),
    /// Nothing: the caller has the outcome.
    Done,
}

impl Simulation {
    /// Prepares the run of a scenario.
    ///
    /// # Errors
    /// As [`Scenario::case`].
    pub fn of(scenario: &Scenario) -> Result<Self, Fault> {
        let case = scenario.case()?;
        let warnings = scenario.warnings(&case);
        Ok(Self::new(case, warnings))
    }

    /// Prepares the run of a case. The warnings become part of the outcome.
    #[must_use]
    pub fn new(case: Case, warnings: Vec<Warning>) -> Self {
        Self { phase: Phase::Running(Box::new(SingleRun::new(case))), warnings }
    }

    /// Computes some more, for about 30 ms.
    ///
    /// # Panics
    /// If the outcome was returned before.
    pub fn step(&mut self) -> Advance {
        match std::mem::replace(&mut self.phase, Phase::Done) {
            Phase::Running(mut run) => {
                let progress = run.step();
                if !run.has_ended() {
                    self.phase = Phase::Running(run);
                    return Advance::Working(progress);
                }
                let method = run.case().method;
                let Method::Exact { compare: Some(xi), .. } = method else {
                    return Advance::Done(self.with_warnings(run.outcome()));
                };
                let comparing = Box::new(Comparing::new(run.case(), xi, run.history()));
                self.phase = Phase::Comparing(self.with_warnings(run.outcome()), comparing);
                Advance::Working(progress)
            }
            Phase::Comparing(mut outcome, mut comparing) => {
                if let Some(progress) = comparing.step() {
                    self.phase = Phase::Comparing(outcome, comparing);
                    return Advance::Working(progress);
                }
                outcome.comparison = Some(comparing.finish());
                Advance::Done(outcome)
            }
            Phase::Done => unreachable!("the simulation was stepped after its end"),
        }
    }

    /// Runs to the end.
    #[must_use]
    pub fn run(mut self) -> Outcome {
        loop {
            if let Advance::Done(outcome) = self.step() {
                return *outcome;
            }
        }
    }

    fn with_warnings(&mut self, mut outcome: Outcome) -> Box<Outcome> {
        outcome.warnings = std::mem::take(&mut self.warnings);
        Box::new(outcome)
    }
}
