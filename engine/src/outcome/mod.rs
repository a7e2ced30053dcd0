//! What a run finds, in SI and in columns.
//!
//! # Units
//! [`UNITS`] names the unit of every quantity; a name means the same wherever it occurs.
//!
//! Entry 0 of every column and row 0 of every matrix is the unworn state. An infinite pressure (the
//! apex of a cone, late in a run the stick edge) is `f64::INFINITY` here and null in JSON; nothing else is ever non-finite.

use serde::Serialize;

use crate::case::Case;
use crate::contact::unworn::Regime;
use crate::numeric::integrate_beyond;
use crate::request::fault::Fault;
use crate::scenario::{Scenario, Warning};
use crate::solver::events::{self, EventKind};

/// The unit of every quantity in a result, in the order of the result.
pub const UNITS: &[(&str, &str)] = &[
    ("cycles", "1"),
    ("normalized_cycles", "1"),
    ("contact_radius", "m"),
    ("stick_radius", "m"),
    ("scar_radius", "m"),
    ("indentation_depth", "m"),
    ("normal_force", "N"),
    ("tangential_force", "N"),
    ("amplitude", "m"),
    ("gross_slip_amplitude", "m"),
    ("normal_modulus", "Pa"),
    ("tangential_modulus", "Pa"),
    ("wear_coefficient", "1/Pa"),
    ("peak_pressure", "Pa"),
    ("mean_pressure", "Pa"),
    ("wear_volume", "m^3"),
    ("wear_depth", "m"),
    ("wear_depth_radius", "m"),
    ("energy_per_cycle", "J"),
    ("dissipated_energy", "J"),
    ("radius", "m"),
    ("initial", "m"),
    ("limiting", "m"),
    ("worn", "m"),
    ("wear", "m"),
    ("image", "m"),
    ("pressure", "Pa"),
    ("slip", "m"),
    ("displacement", "m"),
    ("energy_ratio", "1"),
    ("slip_ratio", "1"),
    ("free_ratio", "1"),
];

/// [`UNITS`] as a JSON object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ResultUnits;

impl Serialize for ResultUnits {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(UNITS.iter().copied())
    }
}

/// The scales of the unworn contact.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ContactScales {
    /// a₀.
    pub contact_radius: f64,
    /// d₀.
    pub indentation_depth: f64,
    /// F₀.
    pub normal_force: f64,
    /// N₀.
    pub cycles: f64,
}

/// The unworn state.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Unworn {
    /// E*.
    pub normal_modulus: f64,
    /// G*.
    pub tangential_modulus: f64,
    /// k_w.
    pub wear_coefficient: f64,
    /// The largest p; infinite for a cone.
    pub peak_pressure: f64,
    /// F/(πa²).
    pub mean_pressure: f64,
    /// The amplitude from which the whole contact slips.
    pub gross_slip_amplitude: f64,
    /// c; 0 in gross slip.
    pub stick_radius: f64,
    /// U.
    pub amplitude: f64,
    /// Q, the amplitude of the tangential force.
    pub tangential_force: f64,
    /// W.
    pub energy_per_cycle: f64,
    /// A = W/(4QU), the energy ratio of the sliding transition: 0.2 at gross slip of a paraboloid.
    pub energy_ratio: f64,
    /// D = δ₀/U, the slip ratio, δ₀ being half of the loop's width at Q = 0: 0.26 there.
    pub slip_ratio: f64,
    /// B = W/(4Qδ₀), the system-free ratio: 0.77 there.
    pub free_ratio: f64,
}

/// The state that wear tends to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LimitState {
    /// ã: the outer radius of the limiting profile, (13).
    pub contact_radius: f64,
    /// c.
    pub stick_radius: f64,
    /// V∞.
    pub wear_volume: f64,
    /// Deepest wear.
    pub wear_depth: f64,
    /// Where it is.
    pub wear_depth_radius: f64,
    /// F∞, carried inside c alone.
    pub normal_force: f64,
    /// d.
    pub indentation_depth: f64,
    /// Q∞ = 2G*U·c.
    pub tangential_force: f64,
}

/// What is known of a scenario before it is run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Preview {
    /// Units of everything below.
    pub units: ResultUnits,
    /// Scales of the unworn contact.
    pub scales: ContactScales,
    /// The unworn state.
    pub unworn: Unworn,
    /// Its regime.
    pub regime: Regime,
    /// The state that wear tends to.
    pub limit: Option<LimitState>,
    /// What a run takes.
    pub cost: CostEstimate,
}

/// An estimate of what a run takes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CostEstimate {
    /// Multiplications in the inverse transforms and pressures; a core does about 10⁹ a second.
    pub operations: f64,
    /// Size of the result as JSON.
    pub answer_bytes: usize,
}

/// Columns over the instants.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct History {
    /// N.
    pub cycles: Vec<f64>,
    /// Ñ = N/N₀.
    pub normalized_cycles: Vec<f64>,
    /// V.
    pub wear_volume: Vec<f64>,
    /// The largest wear.
    pub wear_depth: Vec<f64>,
    /// The largest radius with wear; 0 before there is any.
    pub scar_radius: Vec<f64>,
    /// g(a) = d. The simplified rule with the depth held keeps a = a₀.
    pub contact_radius: Vec<f64>,
    /// c.
    pub stick_radius: Vec<f64>,
    /// F.
    pub normal_force: Vec<f64>,
    /// d.
    pub indentation_depth: Vec<f64>,
    /// U.
    pub amplitude: Vec<f64>,
    /// Q.
    pub tangential_force: Vec<f64>,
    /// W.
    pub energy_per_cycle: Vec<f64>,
    /// Σ W since N = 0.
    pub dissipated_energy: Vec<f64>,
}

impl History {
    pub(crate) fn with_capacity(instants: usize) -> Self {
        let column = || Vec::with_capacity(instants);
        Self {
            cycles: column(),
            normalized_cycles: column(),
            wear_volume: column(),
            wear_depth: column(),
            scar_radius: column(),
            contact_radius: column(),
            stick_radius: column(),
            normal_force: column(),
            indentation_depth: column(),
            amplitude: column(),
            tangential_force: column(),
            energy_per_cycle: column(),
            dissipated_energy: column(),
        }
    }
}

/// Matrices over the profile instants (rows) and radii (columns).
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Profiles {
    /// N of each row.
    pub cycles: Vec<f64>,
    /// r of each column.
    pub radius: Vec<f64>,
    /// f₀.
    pub initial: Vec<f64>,
    /// f∞.
    pub limiting: Option<Vec<f64>>,
    /// f = f₀ + w.
    pub worn: Vec<Vec<f64>>,
    /// w ≥ 0.
    pub wear: Vec<Vec<f64>>,
    /// g.
    pub image: Vec<Vec<f64>>,
    /// p.
    pub pressure: Vec<Vec<f64>>,
    /// Amplitude of the relative motion of the surfaces, U·s(r); the path is four times it per cycle.
    pub slip: Vec<Vec<f64>>,
}

/// Force–displacement loops at the instants of the profiles: a cycle each, from +U by −U back to +U, with a
/// point wherever a spring gives way, so that straight lines between the points enclose W.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Loops {
    /// N of each row.
    pub cycles: Vec<f64>,
    /// u of the contact; of a record, its outermost loop.
    pub displacement: Vec<Vec<f64>>,
    /// Q at these.
    pub tangential_force: Vec<Vec<f64>>,
    /// A of each loop.
    pub energy_ratio: Vec<f64>,
    /// D of each loop.
    pub slip_ratio: Vec<f64>,
    /// B of each loop; 0 once it has closed.
    pub free_ratio: Vec<f64>,
}

/// What one of the bodies wears.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BodyWear {
    /// Its part of the depth.
    pub share: f64,
    /// The largest wear of this body.
    pub wear_depth: Vec<f64>,
    /// Its V.
    pub wear_volume: Vec<f64>,
}

/// The simplified rule beside an exact run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// The ξ of the history.
    pub xi: f64,
    /// The rule's history over the same instants; it may end sooner, and then elsewhere.
    pub history: History,
    /// By how much the rule is off, relative to the exact run.
    pub errors: Errors,
    /// The ξ whose volumes come closest; none without wear, or if it would lie outside 0.1…10.
    pub best_xi: Option<f64>,
    /// The root mean square of the relative errors of V with it.
    pub best_error: Option<f64>,
}

/// Rule/exact − 1 at each instant that both histories have; 0 where both are 0.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Errors {
    /// Of V.
    pub wear_volume: Vec<f64>,
    /// Of the largest wear.
    pub wear_depth: Vec<f64>,
    /// Of F.
    pub normal_force: Vec<f64>,
    /// Of d.
    pub indentation_depth: Vec<f64>,
    /// Of ΣW.
    pub dissipated_energy: Vec<f64>,
}

/// Something that happened during a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OutcomeEvent {
    /// When.
    pub cycles: f64,
    /// What.
    pub kind: EventKind,
}

impl OutcomeEvent {
    /// An event of a run whose unit of cycles is N₀.
    pub(crate) fn of(event: &events::Event, unit: f64) -> Self {
        Self { cycles: event.at * unit, kind: event.kind }
    }
}

/// How far the numbers can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Accuracy {
    /// (k_w/μ)·ΣW/V − 1 at the last instant. The exact method keeps dV/dN = (k_w/μ)·W in itself, and what
    /// is left is the error of summing over time; the simplified rule does not keep it, and this is by
    /// how much. Null without wear.
    pub energy_mismatch: Option<f64>,
    /// The largest relative error of the volume by discretisation, estimated over the history: for
    /// the simplified rule the difference between the volume under the computed profile and that of
    /// its image (a few times too large as a rule, too small for blunt profiles in gross slip), for
    /// the exact method from the distance to a run with half the cells. Null without wear.
    pub volume_error: Option<f64>,
    /// Cells of the exact method's mesh.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<usize>,
    /// Time steps of the exact method, of both runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<usize>,
    /// How often the exact method evaluated the wear rate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evaluations: Option<usize>,
}

/// Everything a run finds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// Scales of the unworn contact.
    pub scales: ContactScales,
    /// The unworn state.
    pub unworn: Unworn,
    /// Regime of the unworn state.
    pub regime: Regime,
    /// The state that wear tends to.
    pub limit: Option<LimitState>,
    /// Columns over the instants.
    pub history: History,
    /// The part of each body, where `share` was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bodies: Option<[BodyWear; 2]>,
    /// Matrices over instants and radii, where asked for.
    pub profiles: Option<Profiles>,
    /// Force–displacement loops at the same instants.
    pub loops: Option<Loops>,
    /// Changes of regime and early ends.
    pub events: Vec<OutcomeEvent>,
    /// How far the numbers can be trusted.
    pub accuracy: Accuracy,
    /// The simplified rule beside an exact run, where asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub comparison: Option<Comparison>,
    /// What the physics gives reason to warn of.
    pub warnings: Vec<Warning>,
}

impl ContactScales {
    pub(crate) fn of(case: &Case) -> Self {
        Self {
            contact_radius: case.scales.contact_radius,
            indentation_depth: case.scales.indentation_depth,
            normal_force: 2.0 * case.contact.shape.half_force() * case.scales.force(),
            cycles: case.scales.cycles,
        }
    }
}

impl Unworn {
    pub(crate) fn of(case: &Case) -> Self {
        let scales = &case.scales;
        let sums = case.unworn();
        let found = sums.backbone.wind();
        let area = std::f64::consts::PI * scales.contact_radius * scales.contact_radius;
        Self {
            normal_modulus: scales.normal_modulus,
            tangential_modulus: scales.tangential_modulus,
            wear_coefficient: scales.wear_coefficient,
            peak_pressure: case.contact.shape.peak_pressure() * scales.pressure(),
            mean_pressure: ContactScales::of(case).normal_force / area,
            gross_slip_amplitude: scales.gross_slip_amplitude(),
            stick_radius: case.contact.stick * scales.contact_radius,
            amplitude: scales.amplitude,
            tangential_force: scales.tangential(sums.tangential),
            energy_per_cycle: scales.energy(sums.loss * case.contact.threshold),
            energy_ratio: found.energy_ratio,
            slip_ratio: found.slip_ratio,
            free_ratio: found.free_ratio,
        }
    }
}

/// The state that wear tends to, where it is known beforehand.
pub(crate) fn limit_state(case: &Case) -> Option<LimitState> {
    let scales = &case.scales;
    case.tends_to.map(|end| {
        let limit = &end.limit;
        // Inside c the springs are as they were, outside they carry nothing.
        let shape = &case.contact.shape;
        let inside =
            integrate_beyond(0.0, end.stick, shape.kinks(), |x| end.depth - shape.image(x));
        LimitState {
            contact_radius: limit.radius * scales.contact_radius,
            stick_radius: end.stick * scales.contact_radius,
            wear_volume: limit.volume * scales.volume(),
            wear_depth: limit.depth * scales.indentation_depth,
            wear_depth_radius: limit.depth_radius * scales.contact_radius,
            normal_force: 2.0 * inside * scales.force(),
            indentation_depth: end.depth * scales.indentation_depth,
            tangential_force: scales.tangential(end.threshold * end.stick),
        }
    })
}

impl BodyWear {
    pub(crate) fn of(share: f64, history: &History) -> [Self; 2] {
        let part = |share: f64| Self {
            share,
            wear_depth: history.wear_depth.iter().map(|w| share * w).collect(),
            wear_volume: history.wear_volume.iter().map(|v| share * v).collect(),
        };
        [part(share), part(1.0 - share)]
    }
}

impl Preview {
    /// What is known of a case before it is run.
    #[must_use]
    pub fn of(case: &Case) -> Self {
        Self {
            units: ResultUnits,
            scales: ContactScales::of(case),
            unworn: Unworn::of(case),
            regime: case.regime(),
            limit: limit_state(case),
            cost: CostEstimate { operations: case.operations(), answer_bytes: case.answer_bytes() },
        }
    }
}

impl Scenario {
    /// What is known without running: scales, unworn state, limit and cost.
    ///
    /// # Errors
    /// As [`Scenario::case`].
    pub fn preview(&self) -> Result<Preview, Fault> {
        self.case().map(|case| Preview::of(&case))
    }
}
