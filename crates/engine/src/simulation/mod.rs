//! A run in short steps. Between two steps the caller can report progress or stop the run.
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
//!     "model": {"method": "simplified"},
//! });
//! let (scenario, _) = scenario::check(&request, "").expect("a valid scenario");
//! let outcome = Simulation::of(&scenario).expect("a contact").run();
//! // After very many cycles the contact has reached its limiting state (11)–(13).
//! let limit = outcome.limit.expect("a limit");
//! assert!((outcome.history.normal_force[1] / limit.normal_force - 1.0).abs() < 1e-9);
//! assert!((outcome.history.wear_volume[1] / limit.wear_volume - 1.0).abs() < 1e-6);
//! ```

mod comparing;
pub mod model_error;
mod numerical_error;
mod recording;
mod single;

use crate::case::{Case, Method};
use crate::input::Valid;
use crate::outcome::{History, Outcome};
use crate::scenario::{Scenario, Warning};
use comparing::Comparing;
use single::SingleRun;

/// The result of a step.
#[derive(Debug)]
pub enum Advance {
    /// The run is not complete. The number is the completed share.
    Working(f64),
    /// The run is complete.
    Done(Box<Outcome>),
}

/// A run and its present state.
#[derive(Debug)]
pub struct Simulation {
    phase: Phase,
    warnings: Vec<Warning>,
}

/// The work of the next step.
#[derive(Debug)]
enum Phase {
    /// Continues the run.
    Running(Box<SingleRun>),
    /// Continues the comparison, after the share `before` of the work. The outcome of the run is kept until the
    /// comparison is complete.
    Comparing { outcome: Box<Outcome>, comparing: Box<Comparing>, before: f64 },
    /// No work is left, because the caller has received the outcome.
    Done,
}

impl Simulation {
    /// Prepares the run of a scenario.
    ///
    /// # Errors
    /// The same fault as for [`Scenario::case`].
    pub fn of(scenario: &Scenario) -> Valid<Self> {
        let case = scenario.case()?;
        let warnings = scenario.warnings(&case);
        Ok(Self::new(case, warnings))
    }

    /// Prepares the run of a case. The warnings become part of the outcome.
    pub fn new(case: Case, warnings: Vec<Warning>) -> Self {
        Self { phase: Phase::Running(Box::new(SingleRun::new(case))), warnings }
    }

    /// Computes for about 30 ms.
    ///
    /// # Panics
    /// Panics if an earlier step has returned the outcome.
    pub fn step(&mut self) -> Advance {
        match std::mem::replace(&mut self.phase, Phase::Done) {
            Phase::Running(mut run) => {
                let progress = (1.0 - run.case.comparison_share()) * run.step();
                if !run.has_ended() {
                    self.phase = Phase::Running(run);
                    return Advance::Working(progress);
                }
                let method = run.case.method;
                let Method::Exact { compare: Some(xi), .. } = method else {
                    return Advance::Done(self.with_warnings(run.outcome()));
                };
                let comparing = Box::new(Comparing::new(&run.case, xi, &run.recording.history));
                let outcome = self.with_warnings(run.outcome());
                self.phase = Phase::Comparing { outcome, comparing, before: progress };
                Advance::Working(progress)
            }
            Phase::Comparing { mut outcome, mut comparing, before } => {
                if let Some(progress) = comparing.step() {
                    self.phase = Phase::Comparing { outcome, comparing, before };
                    return Advance::Working((before + (1.0 - before) * progress).min(0.999));
                }
                outcome.comparison = Some(comparing.finish());
                Advance::Done(outcome)
            }
            Phase::Done => unreachable!("the simulation was stepped after its end"),
        }
    }

    /// The rows that are computed so far. Their digits are those of the outcome. The contact radii and scar radii of the
    /// exact method are missing until all rows are computed, because the run then smooths them over time.
    pub fn so_far(&self) -> History {
        match &self.phase {
            Phase::Running(run) => {
                let mut history = run.recording.history.clone();
                if matches!(run.case.method, Method::Exact { .. }) {
                    history.contact_radius.clear();
                    history.scar_radius.clear();
                }
                history
            }
            Phase::Comparing { outcome, .. } => outcome.history.clone(),
            Phase::Done => History::default(),
        }
    }

    /// Runs to the end.
    pub fn run(mut self) -> Outcome {
        loop {
            if let Advance::Done(outcome) = self.step() {
                return *outcome;
            }
        }
    }

    fn with_warnings(&mut self, mut outcome: Outcome) -> Box<Outcome> {
        // The warnings about the scenario come first, then those of the run.
        outcome.warnings.splice(0..0, self.warnings.drain(..));
        Box::new(outcome)
    }
}
