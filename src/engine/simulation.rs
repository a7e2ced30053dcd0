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

use super::exact::Exact;
use super::fault::Fault;
use super::outcome::{Accuracy, History, LimitState, Outcome, Profiles, Scales, Unworn};
use super::scenario::{Case, Method, Scenario, Warning};
use super::simplified::{Curves, Simplified};

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
    /// Lays out the output radii for either method, and computes for the simplified one.
    simplified: Simplified,
    /// The exact run, from its first step on.
    exact: Option<Exact>,
    warnings: Vec<Warning>,
    history: History,
    profiles: Profiles,
    mismatch: Option<f64>,
    volume_error: Option<f64>,
}

/// One row of the history, in dimensionless units, whichever method it comes from.
struct Entry {
    volume: f64,
    depth: f64,
    scar: f64,
    contact_radius: f64,
    /// ∫ y, ∫ min(Δ, y) and ∫ y(Δ − y)₊ over half of the row.
    normal: f64,
    tangential: f64,
    energy: f64,
    /// (k_w/μ)·ΣW.
    worn_by_energy: f64,
    volume_error: f64,
    curves: Option<Curves>,
}

impl Simulation {
    /// Prepares the run of a scenario.
    ///
    /// # Errors
    /// As [`Scenario::case`].
    pub fn of(scenario: &Scenario) -> Result<Self, Fault> {
        let case = scenario.case()?;
        let simplified = Simplified::new(&case.contact, case.points);
        let warnings = scenario.warnings(&case);
        let (length, height) = (case.scales.contact_radius, case.scales.indentation_depth);
        let profiles = Profiles {
            radius: scaled(simplified.radii().to_vec(), length),
            initial: scaled(simplified.initial().to_vec(), height),
            limiting: Some(scaled(simplified.limiting().to_vec(), height)),
            ..Profiles::default()
        };
        let history = History::with_capacity(case.cycles.len());
        let (exact, mismatch, volume_error) = (None, None, None);
        Ok(Self { case, simplified, exact, warnings, history, profiles, mismatch, volume_error })
    }

    /// Computes some more.
    pub fn step(&mut self) -> Step {
        let progress = match self.case.method {
            Method::Simplified { xi } => self.step_simplified(xi),
            // The unworn state is known in closed form.
            Method::Exact { .. } if self.history.cycles.is_empty() => self.step_unworn(),
            Method::Exact { tolerance } => self.step_exact(tolerance),
        };
        if self.history.cycles.len() < self.case.cycles.len() {
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

    /// Some more instants at once, since they share the rows of the matrices.
    fn step_simplified(&mut self, xi: f64) -> f64 {
        let (done, all) = (self.history.cycles.len(), self.case.cycles.len());
        let per_instant = self.case.operations() / all as f64;
        let block = ((STEP_OPERATIONS / per_instant) as usize).clamp(1, STEP_INSTANTS);
        let until = (done + block).min(all);
        let wanted: Vec<_> = (done..until)
            .map(|i| (self.simplified.decay(xi, self.normalized(i)), self.case.profiles[i]))
            .collect();
        let reached = self.case.contact.limit.radius;
        for state in self.simplified.states(&wanted) {
            let sums = state.sums;
            // Σ W = μã(F₀ − F)/(ξ k_w E*).
            let worn_by_energy = reached * 2.0 * sums.unloaded / xi;
            let volume_error =
                if sums.volume > 0.0 { (state.mesh_volume / sums.volume - 1.0).abs() } else { 0.0 };
            self.record(Entry {
                volume: state.volume,
                depth: state.depth,
                scar: state.scar,
                contact_radius: 1.0,
                normal: sums.normal,
                tangential: sums.tangential,
                energy: sums.energy,
                worn_by_energy,
                volume_error,
                curves: state.curves,
            });
        }
        until as f64 / all as f64
    }

    /// A few time steps, and the instants they pass.
    fn step_exact(&mut self, tolerance: f64) -> f64 {
        let (done, all) = (self.history.cycles.len(), self.case.cycles.len());
        let begun = self.exact.take();
        let mut exact = begun.unwrap_or_else(|| Exact::new(&self.case.contact, tolerance));
        let cells = exact.cells() as f64;
        let budget = (STEP_OPERATIONS / (cells * cells)) as usize;
        let (_, before) = exact.work();
        let last = self.normalized(all - 1);
        let mut next = done;
        while next < all && exact.work().1 - before < budget {
            let now = self.normalized(next);
            if exact.advance(now) {
                continue;
            }
            let instant = exact.at(now);
            let worn = instant.volume > 0.0;
            let curves =
                self.case.profiles[next].then(|| exact.curves(&instant, self.simplified.radii()));
            self.record(Entry {
                volume: instant.volume,
                depth: instant.depth,
                scar: if worn { instant.contact_radius } else { 0.0 },
                contact_radius: instant.contact_radius,
                normal: instant.normal,
                tangential: instant.tangential,
                energy: instant.energy,
                worn_by_energy: instant.worn_by_energy,
                volume_error: instant.volume_error,
                curves,
            });
            next += 1;
        }
        let progress = (exact.reached() / last).clamp(next as f64 / all as f64 * 1e-3, 0.999);
        self.exact = Some(exact);
        progress
    }

    fn step_unworn(&mut self) -> f64 {
        let decay = self.simplified.decay(1.0, 0.0);
        let wanted = [(decay, self.case.profiles[0])];
        for state in self.simplified.states(&wanted) {
            self.record(Entry {
                volume: 0.0,
                depth: 0.0,
                scar: 0.0,
                contact_radius: 1.0,
                normal: state.sums.normal,
                tangential: state.sums.tangential,
                energy: state.sums.energy,
                worn_by_energy: 0.0,
                volume_error: 0.0,
                curves: state.curves,
            });
        }
        0.0
    }

    /// Ñ of an instant.
    fn normalized(&self, index: usize) -> f64 {
        self.case.cycles[index] / self.case.scales.cycles
    }

    /// Multiplies the units back in and appends a row.
    fn record(&mut self, entry: Entry) {
        let Case { scales, contact, cycles, .. } = &self.case;
        let (length, height) = (scales.contact_radius, scales.indentation_depth);
        let history = &mut self.history;
        let n = cycles[history.cycles.len()];
        if entry.volume > 0.0 {
            self.mismatch = Some(entry.worn_by_energy / entry.volume - 1.0);
            let error = entry.volume_error;
            self.volume_error = Some(self.volume_error.map_or(error, |known| known.max(error)));
        }
        history.cycles.push(n);
        history.normalized_cycles.push(n / scales.cycles);
        history.wear_volume.push(entry.volume * scales.volume());
        history.wear_depth.push(entry.depth * height);
        history.scar_radius.push(entry.scar * length);
        history.contact_radius.push(entry.contact_radius * length);
        history.stick_radius.push(contact.stick * length);
        history.normal_force.push(2.0 * entry.normal * scales.force());
        history.indentation_depth.push(height);
        history.amplitude.push(scales.amplitude);
        history.tangential_force.push(scales.tangential(entry.tangential));
        history.energy_per_cycle.push(scales.energy(entry.energy));
        let per_wear = scales.friction / scales.wear_coefficient;
        history.dissipated_energy.push(entry.worn_by_energy * scales.volume() * per_wear);
        let Some(curves) = entry.curves else { return };
        let profiles = &mut self.profiles;
        profiles.cycles.push(n);
        let worn = self.simplified.initial().iter().zip(&curves.wear);
        profiles.worn.push(worn.map(|(initial, wear)| (initial + wear) * height).collect());
        profiles.wear.push(scaled(curves.wear, height));
        profiles.image.push(scaled(curves.image, height));
        profiles.pressure.push(scaled(curves.pressure, scales.pressure()));
        profiles.slip.push(scaled(curves.slip, scales.amplitude));
    }

    fn outcome(&mut self) -> Outcome {
        let row = self.simplified.row();
        let profiles = std::mem::take(&mut self.profiles);
        let work = self.exact.as_ref().map(Exact::work);
        Outcome {
            scales: Scales::of(&self.case),
            unworn: Unworn::of(&self.case, row),
            regime: self.case.regime(),
            limit: Some(LimitState::of(&self.case, row)),
            history: std::mem::take(&mut self.history),
            profiles: (self.case.profile_rows() > 0).then_some(profiles),
            events: Vec::new(),
            accuracy: Accuracy {
                energy_mismatch: self.mismatch,
                volume_error: self.volume_error,
                cells: self.exact.as_ref().map(Exact::cells),
                steps: work.map(|(steps, _)| steps),
                evaluations: work.map(|(_, evaluations)| evaluations),
            },
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
