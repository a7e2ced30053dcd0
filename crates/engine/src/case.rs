//! The dimensionless problem of a scenario, its scales, and the cost of its run.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::contact::hysteresis::{Backbone, ROW_POINTS};
use crate::contact::row::unworn_integrals;
use crate::contact::{Contact, Control, Final, Held, Series, UnwornSums};
use crate::numeric::root;
use crate::solver::closed::energy;
use crate::solver::closed::simplified::Simplified;
use crate::solver::events::StopCondition;
use crate::solver::stepped::{Law, March, WearProblem};

/// Number of operations, as [`Case::operations`] counts them, that one processor core does per second.
const OPERATIONS_PER_SECOND: f64 = 1e9;

/// Tolerance of the time integration for the simplified rule. The rule is integrated only if it has
/// no closed form.
const RULE_TOLERANCE: f64 = 7e-4;
/// The number of runs of the simplified rule in a comparison. They determine ln ξ to 1e-5.
pub(crate) const COMPARISON_RUNS: usize = 31;
/// Maximum number of output radii of the rule in a comparison. With more radii the volume would
/// change by less than its error.
const COMPARISON_POINTS: usize = 256;

/// Number of evaluations of the wear rate that a time integration needs to find the cycle of an energy.
pub(crate) const SEARCH_EVALUATIONS: usize = 20;

/// If Δ differs from 1 by less than this, it is set to 1, the gross-slip threshold. Rounding U to
/// 12 digits changes Δ by half of this value.
const ONSET: f64 = 1e-11;

/// The dimensionless amplitude Δ of an amplitude, for a gross-slip threshold in the same unit.
pub(crate) fn threshold(amplitude: f64, gross_slip: f64) -> f64 {
    let threshold = amplitude / gross_slip;
    if (threshold - 1.0).abs() < ONSET { 1.0 } else { threshold }
}

/// The scales of the dimensionless problem. They convert results to SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// Contact radius a₀ in m.
    pub contact_radius: f64,
    /// Indentation depth d₀ in m.
    pub indentation_depth: f64,
    /// Characteristic cycles N₀.
    pub cycles: f64,
    /// Amplitude U in m.
    pub amplitude: f64,
    /// Normal modulus E* in Pa.
    pub normal_modulus: f64,
    /// Tangential modulus G* in Pa.
    pub tangential_modulus: f64,
    /// Coefficient of friction μ.
    pub friction: f64,
    /// Wear coefficient k_w in 1/Pa.
    pub wear_coefficient: f64,
    /// The length of a line contact in m. A round contact has none.
    pub length: Option<f64>,
}

impl Scales {
    /// The unit of force in N: E*a₀d₀, or the normal force of a line contact.
    pub(crate) fn force(&self) -> f64 {
        match self.length {
            None => self.normal_modulus * self.contact_radius * self.indentation_depth,
            Some(length) => FRAC_PI_2 * self.normal_modulus * self.indentation_depth * length,
        }
    }

    /// The area of the unworn contact in m².
    pub(crate) fn area(&self) -> f64 {
        match self.length {
            None => PI * self.contact_radius * self.contact_radius,
            Some(length) => 2.0 * self.contact_radius * length,
        }
    }

    /// The unit of pressure in Pa: E*d₀/a₀, or F/a₀ of a line contact, per length.
    pub(crate) fn pressure(&self) -> f64 {
        match self.length {
            None => self.normal_modulus * self.indentation_depth / self.contact_radius,
            Some(length) => self.force() / (self.contact_radius * length),
        }
    }

    /// The unit of volume in m³: a₀²d₀, or a₀h₀ times the length of a line contact.
    pub fn volume(&self) -> f64 {
        let across = self.length.unwrap_or(self.contact_radius);
        self.contact_radius * across * self.indentation_depth
    }

    /// The unit of slip in m: the gross-slip threshold, U at Δ = 1, or μh₀ of a line contact.
    pub(crate) fn slip(&self) -> f64 {
        match self.length {
            None => {
                self.friction * self.normal_modulus / self.tangential_modulus
                    * self.indentation_depth
            }
            Some(_) => self.friction * self.indentation_depth,
        }
    }

    /// The wear volume that an energy in J would produce in the exact method, (k_w/μ)·`energy`, in units of a₀²d₀.
    pub(crate) fn worn_by(&self, energy: f64) -> f64 {
        energy * (self.wear_coefficient / self.friction) / self.volume()
    }

    /// The tangential force Q in N from `half` = ∫ min(Δ, y) dx.
    pub(crate) fn tangential(&self, half: f64) -> f64 {
        2.0 * self.friction * half * self.force()
    }

    /// The energy W in J from `integral` = ∫ y(Δ − y)₊ dx: W = 8μE*·(μE*/G*)·a₀d₀² · `integral`. In a line contact,
    /// W = 4μF·μh₀ ∫ y(θ − y)₊ dx/x.
    pub(crate) fn energy(&self, integral: f64) -> f64 {
        let lost = self.friction * self.force();
        let factor = if self.length.is_some() { 4.0 } else { 8.0 };
        factor * lost * self.slip() * integral
    }
}

/// The method by which wear is computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// The simplified rule (14).
    Simplified {
        /// The parameter ξ of the rule.
        xi: f64,
    },
    /// The exact method: the wear rate is local pressure times local slip.
    Exact {
        /// The target relative error of the run.
        tolerance: f64,
        /// ξ of the simplified rule for a comparison. `None` without a comparison.
        compare: Option<f64>,
    },
}

impl Method {
    /// The wear law of this method.
    pub(crate) fn law(&self) -> Law {
        match *self {
            Self::Simplified { xi } => Law::Simplified(xi),
            Self::Exact { .. } => Law::Exact,
        }
    }
}

/// Estimates the time in N₀ at which (k_w/μ)·ΣW reaches `energy`. It is at most `horizon`.
pub(crate) fn time_of(problem: WearProblem<'_>, energy: f64, horizon: f64) -> f64 {
    match problem.law {
        Law::Simplified(xi) if problem.control.is_closed() => {
            let (times, stop) = energy::times(problem.contact, xi, &[energy], horizon);
            stop.unwrap_or_else(|| times[0])
        }
        _ => March::time_of(problem, energy, horizon),
    }
}

/// The output cycles of a run. The first is 0.
#[derive(Debug, Clone, PartialEq)]
pub enum Outputs {
    /// Numbers of cycles.
    Cycles(Vec<f64>),
    /// The cycles at which the run reaches dissipated energies.
    Energies(EnergyOutputs),
}

/// Dissipated energies at which a run records its state.
#[derive(Debug, Clone, PartialEq)]
pub struct EnergyOutputs {
    /// The energies as (k_w/μ)·ΣW, in units of a₀²d₀. The first is 0.
    pub energies: Vec<f64>,
    /// The time in N₀ at which the run ends, even if it has not reached all energies.
    pub horizon: f64,
    /// The estimated time of the last energy, in N₀.
    pub expected: f64,
}

impl Outputs {
    /// The numbers of cycles, or the dissipated energies.
    pub(crate) fn numbers(&self) -> &[f64] {
        match self {
            Self::Cycles(cycles) => cycles,
            Self::Energies(outputs) => &outputs.energies,
        }
    }

    /// The time of the last output cycle in N₀, for `unit` = N₀. For energies it is an estimate.
    pub(crate) fn last_time(&self, unit: f64) -> f64 {
        match self {
            Self::Cycles(cycles) => cycles[cycles.len() - 1] / unit,
            Self::Energies(outputs) => outputs.expected,
        }
    }
}

/// The dimensionless problem of a scenario and its scales.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// The unworn contact.
    pub contact: Contact,
    /// The quantities that are held constant in the normal and the tangential direction.
    pub control: Control,
    /// The limiting state, if it is known without a run.
    pub tends_to: Option<Final>,
    /// The wear at which the run ends early.
    pub until: StopCondition,
    /// The share of the first body in the wear volume, if requested.
    pub share: Option<f64>,
    /// The scales that convert results to SI.
    pub scales: Scales,
    /// How wear is computed.
    pub method: Method,
    /// The number of output radii.
    pub points: usize,
    /// The output cycles.
    pub outputs: Outputs,
    /// For each output cycle, whether it carries profiles.
    pub profiles: Vec<bool>,
}

impl Case {
    /// Whether the run is computed in closed form, and not in time steps.
    pub fn is_closed(&self) -> bool {
        matches!(self.method, Method::Simplified { .. }) && self.control.is_closed()
    }

    /// The slip of the middle of an unworn line contact, in μh₀.
    pub(crate) fn unworn_middle(&self) -> f64 {
        let Contact { shape, threshold, reference, .. } = &self.contact;
        if let Held::Aperture(aperture) = *self.control.held() {
            return reference.unwrap_or(Series::FAR).at_aperture(shape, aperture).1;
        }
        match (self.control.blocks[0].stroke(), reference) {
            (Some(stroke), Some(reference)) if *threshold >= 1.0 => {
                reference.threshold(shape, stroke).1
            }
            (Some(stroke), None) => stroke,
            _ => 0.0,
        }
    }

    /// The stroke of an unworn line contact in μh₀, with that of the rig. NaN if it is not known.
    pub(crate) fn unworn_stroke(&self) -> f64 {
        self.control.blocks[0].stroke().unwrap_or_else(|| {
            let Contact { shape, threshold, reference, .. } = &self.contact;
            let stroke = reference.map_or(f64::NAN, |it| it.stroke(shape, *threshold));
            stroke + self.unworn_middle()
        })
    }

    /// Δ of the unworn contact at an amplitude of the motion in m, which is that of the actuator if there is a rig, and
    /// the slip of the middle of a line contact. A line contact needs a reference.
    pub(crate) fn threshold_at(&self, amplitude: f64) -> (f64, f64) {
        let (shape, slip) = (&self.contact.shape, self.scales.slip());
        let moved = amplitude / slip;
        match (self.contact.reference, self.control.held()) {
            (Some(reference), _) => reference.threshold(shape, moved),
            (None, Held::Rig { compliance, .. }) => {
                let force = |at| unworn_integrals(shape, shape.stick_radius(at), at).0;
                (root(0.0, moved, |at| at + 2.0 * compliance * force(at) - moved), 0.0)
            }
            (None, _) => (threshold(amplitude, slip), 0.0),
        }
    }

    /// The indentation depth of the unworn contact, in d₀. Of a line contact it is known only against points of the
    /// surface.
    pub(crate) fn unworn_depth(&self) -> f64 {
        match (self.scales.length, self.contact.reference) {
            (None, _) => 1.0,
            (Some(_), Some(reference)) if reference.reach.is_finite() => {
                reference.without_rig().stroke(&self.contact.shape, 1.0)
            }
            (Some(_), _) => f64::NAN,
        }
    }

    /// U/U_rig at Δ. `None` without a rig.
    pub(crate) fn actuator_share(&self, threshold: f64) -> Option<f64> {
        let rig = self.contact.reference.map_or(0.0, |reference| reference.rig());
        match *self.control.held() {
            _ if self.control.varies() => None,
            Held::Rig { amplitude, .. } => Some(threshold / amplitude),
            Held::Stroke(stroke) if rig > 0.0 => Some(1.0 - rig * threshold / stroke),
            _ => None,
        }
    }

    /// The wear rate of a line contact, relative to the rate on which its N₀ is based. 1 for a round contact.
    pub(crate) fn line_pace(&self) -> f64 {
        match self.scales.length {
            None => 1.0,
            Some(_) => self.control.largest_threshold() + self.control.largest_stroke(),
        }
    }

    /// U at which the whole contact slips, in m. NaN for a line contact without a reference.
    pub fn gross_slip_amplitude(&self) -> f64 {
        let contact = &self.contact;
        match (self.scales.length, contact.reference) {
            (None, _) => self.scales.slip(),
            (Some(_), Some(reference)) => {
                self.scales.slip() * reference.without_rig().stroke(&contact.shape, 1.0)
            }
            (Some(_), None) => f64::NAN,
        }
    }

    /// U_rig at which the whole contact slips, in m. `None` without a rig.
    pub fn actuator_gross_slip_amplitude(&self) -> Option<f64> {
        self.has_rig()
            .then(|| self.gross_slip_amplitude() + self.rig_at_limit() * self.scales.slip())
    }

    /// Whether a rig lies between the contact and the actuator.
    pub(crate) fn has_rig(&self) -> bool {
        self.rig_at_limit() > 0.0
    }

    /// What the rig yields when the whole unworn contact slips, in the unit of Δ. 0 without a rig.
    fn rig_at_limit(&self) -> f64 {
        match self.control.held() {
            Held::Rig { compliance, .. } => 2.0 * compliance * self.contact.shape.half_force(),
            _ => self.contact.reference.map_or(0.0, |reference| reference.rig()),
        }
    }

    /// The amplitudes of the contact and of the actuator at which the whole unworn contact slips, in the unit of Δ.
    pub(crate) fn unworn_gross_slip(&self) -> [f64; 2] {
        let contact = self.gross_slip_amplitude() / self.scales.slip();
        [contact, contact + self.rig_at_limit()]
    }

    /// Sums over the unworn springs.
    pub(crate) fn unworn(&self) -> UnwornSums {
        if self.scales.length.is_some() {
            return UnwornSums::in_series(&self.contact, self.unworn_middle());
        }
        let mut sums = match self.control.held() {
            Held::Record(record) => {
                UnwornSums::of(&self.contact, Some(&|ratio| record.slip(ratio)))
            }
            _ => UnwornSums::of(&self.contact, None),
        };
        if let Held::Force(half) = *self.control.held() {
            sums.tangential = half;
        }
        sums
    }

    /// The tolerance of the integration in time.
    pub(crate) fn tolerance(&self) -> f64 {
        match self.method {
            Method::Simplified { .. } => RULE_TOLERANCE,
            Method::Exact { tolerance, .. } => tolerance,
        }
    }

    /// Maximum number of springs that can slip. Each of them is a corner of the friction loop.
    fn springs(&self) -> usize {
        if self.is_closed() {
            return ROW_POINTS;
        }
        March::cells_for(self.problem(), self.tolerance()).max(ROW_POINTS)
    }

    /// The wear problem of this contact, for the integration in time.
    pub(crate) fn problem(&self) -> WearProblem<'_> {
        WearProblem { contact: &self.contact, control: &self.control, law: self.method.law() }
    }

    /// The largest amplitude, divided by the amplitude at N = 0.
    pub fn largest_amplitude(&self) -> f64 {
        self.control.largest_threshold() / self.contact.threshold
    }

    /// The slip path of a spring without load per cycle, divided by that of one harmonic cycle.
    pub(crate) fn loops_per_cycle(&self) -> f64 {
        match self.control.held() {
            Held::Record(record) => record.slip(0.0),
            _ => 1.0,
        }
    }

    /// The run of the simplified rule for a comparison with an exact run. It has the same output
    /// cycles and the same held quantities.
    pub(crate) fn rule(&self, xi: f64) -> Self {
        Self {
            method: Method::Simplified { xi },
            points: self.points.min(COMPARISON_POINTS),
            profiles: vec![false; self.profiles.len()],
            until: StopCondition::default(),
            share: None,
            ..self.clone()
        }
    }

    /// The number of rows in each profile matrix.
    pub(crate) fn profile_rows(&self) -> usize {
        self.profiles.iter().filter(|carries| **carries).count()
    }

    /// Estimated processor time of the run, in seconds.
    pub fn seconds(&self) -> f64 {
        self.operations() / OPERATIONS_PER_SECOND
    }

    /// Estimated number of multiplications of the run.
    pub fn operations(&self) -> f64 {
        let (rows, count) = (self.profile_rows(), self.outputs.numbers().len());
        if self.is_closed() {
            return Simplified::operations(self.points, count, rows);
        }
        let (problem, tolerance) = (self.problem(), self.tolerance());
        let cells = March::cells_for(problem, tolerance);
        let search = match self.outputs {
            Outputs::Cycles(_) => 1,
            Outputs::Energies(_) => SEARCH_EVALUATIONS * cells * cells,
        };
        let output = (self.points * rows + search * count) as f64;
        March::operations(problem, tolerance, self.normalized_end())
            + output
            + self.comparison_operations()
    }

    /// The part of [`operations`](Self::operations) for the comparison with the simplified rule.
    fn comparison_operations(&self) -> f64 {
        let Method::Exact { compare: Some(xi), .. } = self.method else { return 0.0 };
        self.rule(xi).operations() * COMPARISON_RUNS as f64
    }

    /// The comparison with the simplified rule as a share of all work.
    pub(crate) fn comparison_share(&self) -> f64 {
        let operations = self.comparison_operations();
        if operations == 0.0 { 0.0 } else { operations / self.operations() }
    }

    /// The last output cycle in units of N₀. For energies it is an estimate.
    pub(crate) fn normalized_end(&self) -> f64 {
        self.outputs.last_time(self.scales.cycles)
    }

    /// Estimated size of the result as JSON, in bytes.
    pub fn answer_bytes(&self) -> usize {
        /// Bytes of a positive number of 12 digits with its exponent and comma.
        const NUMBER: usize = 18;
        let rows = self.profile_rows();
        let curves = if rows == 0 { 0 } else { 3 + 5 * rows };
        let loops = rows * (2 * Backbone::points(self.springs()) + 5);
        4096 + NUMBER * (self.points * curves + loops + 17 * self.outputs.numbers().len())
    }
}
