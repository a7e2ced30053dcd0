//! A run, step by step, so that whoever drives it can report progress and stop.
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
//! // After very many cycles the limit (11)–(13) is reached.
//! let limit = outcome.limit.expect("a limit");
//! assert!((outcome.history.normal_force[1] / limit.normal_force - 1.0).abs() < 1e-9);
//! assert!((outcome.history.wear_volume[1] / limit.wear_volume - 1.0).abs() < 1e-6);
//! ```

mod comparing;
mod single;

use crate::case::{Case, Method};
use crate::outcome::Outcome;
use crate::request::fault::Fault;
use crate::scenario::{Scenario, Warning};
use comparing::Comparing;
use single::SingleRun;

/// What a step came to.
#[derive(Debug)]
pub enum Step {
    /// There is more to do; the share done so far.
    Working(f64),
    /// The run is over.
    Done(Box<Outcome>),
}

/// A run under way.
#[derive(Debug)]
pub struct Simulation {
    run: SingleRun,
    comparing: Option<Comparing>,
    warnings: Vec<Warning>,
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

    /// Prepares the run of a case; the warnings become part of the outcome.
    #[must_use]
    pub fn new(case: Case, warnings: Vec<Warning>) -> Self {
        Self { run: SingleRun::new(case), comparing: None, warnings }
    }

    /// Computes some more.
    pub fn step(&mut self) -> Step {
        if let Some(comparing) = &mut self.comparing {
            return match comparing.step() {
                Some(progress) => Step::Working(progress),
                None => Step::Done(Box::new(self.outcome())),
            };
        }
        let progress = self.run.step();
        if !self.run.has_ended() {
            return Step::Working(progress);
        }
        if let Method::Exact { compare: Some(xi), .. } = self.run.case().method {
            self.comparing = Some(Comparing::new(self.run.case(), xi, self.run.history()));
            return Step::Working(progress);
        }
        Step::Done(Box::new(self.outcome()))
    }

    /// Runs to the end.
    #[must_use]
    pub fn run(mut self) -> Outcome {
        loop {
            if let Step::Done(outcome) = self.step() {
                return *outcome;
            }
        }
    }

    fn outcome(&mut self) -> Outcome {
        let mut outcome = self.run.outcome();
        outcome.comparison = self.comparing.take().map(Comparing::finish);
        outcome.warnings = std::mem::take(&mut self.warnings);
        outcome
    }
}
