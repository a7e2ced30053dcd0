//! A run, step by step, so that whoever drives it can report progress and stop.
//!
//! # Examples
//! ```
//! use fretwork::engine::{scenario, simulation::Simulation};
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

use super::contact::Decay;
use super::fault::Fault;
use super::outcome::{Accuracy, History, LimitState, Outcome, Profiles, Scales, Unworn};
use super::scenario::{Case, Scenario, Warning};
use super::simplified::{Simplified, State};

/// Multiplications of a step, about: 30 ms.
const STEP_OPERATIONS: f64 = 3e7;
/// Most instants in a step.
const STEP_INSTANTS: usize = 64;

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
    case: Case,
    solver: Simplified,
    warnings: Vec<Warning>,
    history: History,
    profiles: Profiles,
    mismatch: Option<f64>,
    volume_error: Option<f64>,
}

impl Simulation {
    /// Prepares the run of a scenario.
    ///
    /// # Errors
    /// As [`Scenario::case`].
    pub fn of(scenario: &Scenario) -> Result<Self, Fault> {
        let case = scenario.case()?;
        let solver = Simplified::new(case.contact, case.points);
        let warnings = scenario.warnings(&case);
        let (length, height) = (case.scales.contact_radius, case.scales.indentation_depth);
        let profiles = Profiles {
            radius: scaled(solver.radii().to_vec(), length),
            initial: scaled(solver.initial().to_vec(), height),
            limiting: Some(scaled(solver.limiting().to_vec(), height)),
            ..Profiles::default()
        };
        let history = History::with_capacity(case.cycles.len());
        Ok(Self { case, solver, warnings, history, profiles, mismatch: None, volume_error: None })
    }

    /// Computes some more instants.
    pub fn step(&mut self) -> Step {
        let (done, all) = (self.history.cycles.len(), self.case.cycles.len());
        let per_instant = self.case.operations() / all as f64;
        let block = ((STEP_OPERATIONS / per_instant) as usize).clamp(1, STEP_INSTANTS);
        let until = (done + block).min(all);
        let wanted: Vec<(Decay, bool)> = (done..until)
            .map(|i| {
                let normalized = self.case.cycles[i] / self.case.scales.cycles;
                (self.solver.decay(self.case.xi, normalized), self.case.profiles[i])
            })
            .collect();
        for state in self.solver.states(&wanted) {
            self.record(state);
        }
        if until < all {
            return Step::Working(until as f64 / all as f64);
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

    /// Multiplies the units back in and appends a row.
    fn record(&mut self, state: State) {
        let Case { scales, contact, xi, cycles, .. } = &self.case;
        let (length, height) = (scales.contact_radius, scales.indentation_depth);
        let history = &mut self.history;
        let n = cycles[history.cycles.len()];
        // Σ W = μã(F₀ − F)/(ξ k_w E*), and with it (k_w/μ)·ΣW in units of a₀²d₀.
        let worn_by_energy = contact.limit.radius * 2.0 * state.sums.unloaded / xi;
        if state.volume > 0.0 && state.sums.volume > 0.0 {
            self.mismatch = Some(worn_by_energy / state.volume - 1.0);
            let error = (state.mesh_volume / state.sums.volume - 1.0).abs();
            self.volume_error = Some(self.volume_error.map_or(error, |known| known.max(error)));
        }
        history.cycles.push(n);
        history.normalized_cycles.push(n / scales.cycles);
        history.wear_volume.push(state.volume * scales.volume());
        history.wear_depth.push(state.depth * height);
        history.scar_radius.push(state.scar * length);
        history.contact_radius.push(length);
        history.stick_radius.push(contact.stick * length);
        history.normal_force.push(2.0 * state.sums.normal * scales.force());
        history.indentation_depth.push(height);
        history.amplitude.push(scales.amplitude);
        history.tangential_force.push(scales.tangential(state.sums.tangential));
        history.energy_per_cycle.push(scales.energy(state.sums.energy));
        let energy = worn_by_energy * scales.volume() * scales.friction / scales.wear_coefficient;
        history.dissipated_energy.push(energy);
        let Some(curves) = state.curves else { return };
        let profiles = &mut self.profiles;
        profiles.cycles.push(n);
        let worn = self.solver.initial().iter().zip(&curves.wear);
        profiles.worn.push(worn.map(|(initial, wear)| (initial + wear) * height).collect());
        profiles.wear.push(scaled(curves.wear, height));
        profiles.image.push(scaled(curves.image, height));
        profiles.pressure.push(scaled(curves.pressure, scales.pressure()));
        profiles.slip.push(scaled(curves.slip, scales.amplitude));
    }

    fn outcome(&mut self) -> Outcome {
        let row = self.solver.row();
        let profiles = std::mem::take(&mut self.profiles);
        Outcome {
            scales: Scales::of(&self.case),
            unworn: Unworn::of(&self.case, row),
            regime: self.case.regime(),
            limit: Some(LimitState::of(&self.case, row)),
            history: std::mem::take(&mut self.history),
            profiles: (self.case.profile_rows() > 0).then_some(profiles),
            events: Vec::new(),
            accuracy: Accuracy { energy_mismatch: self.mismatch, volume_error: self.volume_error },
            warnings: std::mem::take(&mut self.warnings),
        }
    }
}

fn scaled(mut values: Vec<f64>, scale: f64) -> Vec<f64> {
    for value in &mut values {
        *value *= scale;
    }
    values
}
