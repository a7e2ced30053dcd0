//! A run of a study. It is simulated only if its outputs need a simulation.

use fretwork_engine::{Advance, Case, Outcome, Preview, Simulation, Warning};

use super::output::{NoValue, Output};

/// A run in progress. It ends at once if all outputs follow from the unworn contact.
#[derive(Debug)]
pub struct Run {
    case: Case,
    simulation: Option<Simulation>,
}

/// A run that has ended.
#[derive(Debug)]
pub struct Ended<'a> {
    pub(super) case: &'a Case,
    pub(super) found: Result<Box<Outcome>, Preview>,
}

impl Run {
    pub(super) fn new(case: Case, needs_wear: bool, warnings: Vec<Warning>) -> Self {
        let simulation = needs_wear.then(|| Simulation::new(case.clone(), warnings));
        Self { case, simulation }
    }

    /// Estimated processor time, in seconds.
    pub fn seconds(&self) -> f64 {
        if self.simulation.is_some() { self.case.seconds() } else { 0.0 }
    }

    /// Computes for at most about 30 ms. Returns the end of the run, once.
    ///
    /// # Panics
    /// An earlier call has returned the end.
    pub fn step(&mut self) -> Option<Ended<'_>> {
        let case = &self.case;
        let found = match self.simulation.as_mut().map(Simulation::step) {
            Some(Advance::Working(_)) => return None,
            Some(Advance::Done(outcome)) => Ok(outcome),
            None => Err(Preview::of(case)),
        };
        Some(Ended { case, found })
    }
}

impl Ended<'_> {
    /// The value of an output.
    ///
    /// # Errors
    /// The run does not have it.
    pub fn value(&self, output: &Output) -> Result<f64, NoValue> {
        output.value(self.case, self.found.as_deref())
    }

    pub(super) fn outcome(&self) -> Option<&Outcome> {
        self.found.as_deref().ok()
    }
}
