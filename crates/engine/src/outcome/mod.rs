//! The result of a run, in SI units and in columns.
//!
//! # Units
//! [`QUANTITIES`] names the unit of every quantity. A name has the same meaning everywhere.
//!
//! Entry 0 of every column and row 0 of every matrix is the unworn state. The peak pressure of a cone is infinite:
//! `f64::INFINITY` here, null in JSON. What is not defined, such as the displacements of a line contact without a reference, is
//! NaN here, null in JSON. All other numbers are finite.

mod columns;
mod condition;

use serde::Serialize;
use utoipa::ToSchema;

pub use self::columns::{
    ContactScales, History, LINE_WORDS, LimitState, QUANTITIES, Quantity, ResultUnits,
    SECTION_WORDS, SPECIAL_WORDS, SectionMember, Unworn, words_in,
};
pub use self::condition::Condition;
use crate::case::{Case, Outputs};
use crate::contact::{Geometry, Regime, UnwornSums};
use crate::input::Valid;
use crate::numeric::integrate_beyond;
use crate::scenario::{Scenario, Warning};
pub use crate::solver::events::EVENTS;
use crate::solver::events::{EventKind, WornThrough};

/// The properties of a scenario that are known without a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Preview {
    /// The units of all quantities.
    pub units: ResultUnits,
    /// The scales of the unworn contact.
    pub scales: ContactScales,
    /// The unworn state.
    pub unworn: Unworn,
    /// The regime of the unworn contact.
    pub regime: Regime,
    /// The limiting state, if it is known without a run.
    pub limit: Option<LimitState>,
    /// The estimated cost of the run.
    pub cost: CostEstimate,
}

/// The estimated cost of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CostEstimate {
    /// Estimated number of multiplications. One processor core does about 10⁹ per second.
    pub operations: f64,
    /// Estimated size of the result as JSON, in bytes.
    pub answer_bytes: usize,
}

/// Maximum relative difference of two numbers of cycles that count as equal. One of them may be rounded to 12 digits.
const CYCLE_ERROR: f64 = 1e-10;
/// Maximum relative error of the energy at an output cycle that a run has found.
const ENERGY_ERROR: f64 = 1e-5;

impl History {
    /// Whether row `row` is at output cycle `row` of the case. If not, the run ended before this output cycle.
    pub fn has_reached(&self, case: &Case, row: usize) -> bool {
        let agrees = |a: f64, b: f64, error: f64| (a - b).abs() <= error * a.abs().max(b.abs());
        let found = self.cycles.get(row).zip(case.outputs.numbers().get(row));
        found.is_some_and(|(cycles, wanted)| match case.outputs {
            Outputs::Cycles(_) => agrees(*wanted, *cycles, CYCLE_ERROR),
            Outputs::Energies(_) => {
                agrees(*wanted, case.scales.worn_by(self.dissipated_energy[row]), ENERGY_ERROR)
            }
        })
    }
}

/// Profiles over the radius; null if none were requested. Row 0 of every matrix is the unworn state.
#[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
#[schema(as = Curves)]
pub struct Profiles {
    /// The output cycles with profiles; the first is 0.
    pub cycles: Vec<f64>,
    /// Distance r from the axis, or x from the middle of a line contact.
    pub radius: Vec<f64>,
    /// The unworn profile f₀ over the radius.
    pub initial: Vec<f64>,
    /// The limiting profile f∞ for many cycles; null without a closed form.
    #[schema(value_type = Option<Vec<Option<f64>>>)]
    pub limiting: Option<Vec<f64>>,
    /// The worn profile f = f₀ + w: one row per output cycle, one column per radius.
    pub worn: Vec<Vec<f64>>,
    /// Wear depth w at each output cycle.
    pub wear: Vec<Vec<f64>>,
    /// The one-dimensional image g of the profile at each output cycle.
    pub image: Vec<Vec<f64>>,
    /// Contact pressure p at each output cycle: the mean over a ring around each radius. In results with a `numerics` below 5,
    /// the value at the radius; null where it is infinite.
    #[schema(value_type = Vec<Vec<Option<f64>>>)]
    pub pressure: Vec<Vec<f64>>,
    /// Amplitude of the local slip, U·s(r), at each output cycle. The slip path per cycle is four times as long.
    pub slip: Vec<Vec<f64>>,
}

/// Force–displacement loops at the output cycles of the profiles. A loop is one cycle and has a point wherever another
/// spring starts to slip, so that straight lines between the points enclose `energy_per_cycle`. Loops may differ in their
/// number of points. Null if no profiles were requested.
#[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
#[schema(as = LoopCurves)]
pub struct Loops {
    /// The output cycles with loops; the first is 0.
    pub cycles: Vec<f64>,
    /// Displacement u of the contact: one row per output cycle, from +U to −U and back. For a displacement record it is the
    /// outermost loop. Null for a line contact without a reference.
    #[schema(value_type = Vec<Vec<Option<f64>>>)]
    pub displacement: Vec<Vec<f64>>,
    /// Tangential force Q at these displacements.
    pub tangential_force: Vec<Vec<f64>>,
    /// A = W/(4QU) of each loop. Null for a line contact without a reference.
    #[schema(value_type = Vec<Option<f64>>)]
    pub energy_ratio: Vec<f64>,
    /// D = δ₀/U of each loop. Null for a line contact without a reference.
    #[schema(value_type = Vec<Option<f64>>)]
    pub slip_ratio: Vec<f64>,
    /// B = W/(4Qδ₀) of each loop; 0 if the loop is closed. It is the same for the stroke at the actuator.
    pub free_ratio: Vec<f64>,
    /// W/(4QU_rig) of each loop, for the stroke at the actuator. Only with a rig.
    #[schema(nullable = false)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub actuator_energy_ratio: Option<Vec<f64>>,
    /// δ₀/U_rig of each loop, for the stroke at the actuator. Only with a rig.
    #[schema(nullable = false)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub actuator_slip_ratio: Option<Vec<f64>>,
}

/// The wear of one body. The first body carries the profile; the other one is the counterbody.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct BodyWear {
    /// The part of the wear volume on this body, if the scenario has a `share`.
    #[schema(nullable = false)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub share: Option<f64>,
    /// Its largest wear depth at the output cycles of the history, if the scenario has a `share` or layers. Each body wears
    /// over the half-length ℓ that is swept on it at the time: dw_i = dw·(k_i/ℓ_i)/Σ(k_j/ℓ_j).
    #[schema(nullable = false)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wear_depth: Option<Vec<f64>>,
    /// Its wear volume at these output cycles, if the scenario has a `share` or layers.
    #[schema(nullable = false)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wear_volume: Option<Vec<f64>>,
    /// Half of the length of its scar along the motion at the output cycles of the history: the largest so far; 0 without
    /// wear. On the body that carries the profile it is the largest radius x that has slid. On the counterbody it is the
    /// largest x + s(x), with the amplitude s of the local slip.
    pub scar_half_length: Vec<f64>,
}

/// The simplified rule for the same scenario, if `compare` was requested.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Comparison {
    /// The ξ of `history` and `errors`, as in the scenario.
    pub xi: f64,
    /// The history by the rule at the same output cycles. A run of the rule can end earlier, with a different last row.
    pub history: History,
    /// The errors of the rule.
    pub errors: Errors,
    /// The ξ between 0.1 and 10 whose wear volumes are closest to the exact ones; null without wear, or if no minimum exists in
    /// this range.
    #[schema(required)]
    pub best_xi: Option<f64>,
    /// The root mean square of the relative errors of the wear volume with `best_xi`.
    #[schema(required)]
    pub best_error: Option<f64>,
}

/// Rule/exact − 1 at each output cycle that both histories have; 0 where both are 0.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Errors {
    /// Of the wear volume.
    pub wear_volume: Vec<f64>,
    /// Of the largest wear depth.
    pub wear_depth: Vec<f64>,
    /// Of the normal force.
    pub normal_force: Vec<f64>,
    /// Of the indentation depth.
    pub indentation_depth: Vec<f64>,
    /// Of the dissipated energy.
    pub dissipated_energy: Vec<f64>,
}

/// An event during the run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OutcomeEvent {
    /// The cycle of the event.
    pub cycles: f64,
    /// What happened.
    pub kind: EventKind,
    /// The layer that is worn through.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub layer: Option<WornThrough>,
}

/// The accuracy of the numbers. It does not contain the errors of the theory. For a Poisson's ratio other than 0, local slip and
/// wear vary around the ring, by ±20 % at ν = 0.42. The result is their mean around the ring, which is right.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Accuracy {
    /// (k_w/μ)·ΣW/V − 1 at the last output cycle: the mismatch of wear volume and dissipated energy. The exact method satisfies
    /// dV/dN = (k_w/μ)·W at each time; the mismatch is the error of the sum over time. Null without wear.
    pub energy_mismatch: Option<f64>,
    /// The largest `wear_volume_error` of the history: the largest estimated relative error of the wear volume due to
    /// discretisation. For the closed form of the simplified rule it is the difference between the volume of the computed
    /// profile and that of its image, usually a few times too large, but too small for blunt profiles in gross slip. Otherwise
    /// it follows from a run with half the cells; for the exact method it is at least `energy_mismatch`. Null without wear.
    /// Above 0.02 there is the warning `numerical_error`.
    pub numerical_error: Option<f64>,
    /// The largest `wear_depth_error` of the history. Null without wear. Above 0.02 there is the warning `numerical_error`.
    /// Results of version 0.3.0 and earlier do not have it.
    pub wear_depth_error: Option<f64>,
    /// The largest relative error of the wear volume that is expected because of the simplified rule, compared with the exact
    /// method. It follows from a table of runs of the exact method with the same held quantities, exponent of the profile and
    /// stick ratio. 0 for the exact method. Null, with the warning `model_error_unknown`, if the table contains no such
    /// contact. Above 0.1 there is the warning `model_error`.
    pub model_error: Option<f64>,
    /// Number of cells of the mesh, if the run has time steps. Only the simplified rule with held depth and amplitude has none.
    #[schema(nullable = false)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<usize>,
    /// Number of time steps of both runs together, if the run has any.
    #[schema(nullable = false)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<usize>,
    /// Number of evaluations of the wear rate in both runs together, if the run has time steps.
    #[schema(nullable = false)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evaluations: Option<usize>,
}

/// The result of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// The scales of the unworn contact.
    pub scales: ContactScales,
    /// The unworn state.
    pub unworn: Unworn,
    /// The regime of the unworn contact.
    pub regime: Regime,
    /// The limiting state, if it is known without a run.
    pub limit: Option<LimitState>,
    /// Columns with one entry per output cycle.
    pub history: History,
    /// The wear of each body. The first one carries the profile.
    pub bodies: [BodyWear; 2],
    /// Profiles, if requested.
    pub profiles: Option<Profiles>,
    /// Force–displacement loops at the output cycles with profiles.
    pub loops: Option<Loops>,
    /// The events of the run, for example the start of gross slip or an early end.
    pub events: Vec<OutcomeEvent>,
    /// Estimates of the numerical error.
    pub accuracy: Accuracy,
    /// The comparison with the simplified rule, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub comparison: Option<Comparison>,
    /// Warnings about the validity of the model.
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
    pub(crate) fn of(case: &Case, sums: &UnwornSums) -> Self {
        let scales = &case.scales;
        let found = sums.backbone.wind();
        // U/U_rig. The rig is elastic, so W, Q and δ₀ are the same at the actuator.
        let share = case.actuator_share(case.contact.threshold);
        Self {
            normal_modulus: scales.normal_modulus,
            tangential_modulus: scales.tangential_modulus,
            wear_coefficient: scales.wear_coefficient,
            peak_pressure: case.contact.shape.peak_pressure() * scales.pressure(),
            mean_pressure: ContactScales::of(case).normal_force / scales.area(),
            gross_slip_amplitude: case.gross_slip_amplitude(),
            stick_radius: case.contact.stick * scales.contact_radius,
            amplitude: scales.amplitude,
            tangential_force: scales.tangential(sums.tangential),
            energy_per_cycle: scales.energy(sums.loss * case.contact.threshold),
            energy_ratio: found.energy_ratio,
            slip_ratio: found.slip_ratio,
            free_ratio: found.free_ratio,
            actuator_amplitude: share.map(|share| scales.amplitude / share),
            actuator_energy_ratio: share.map(|share| share * found.energy_ratio),
            actuator_slip_ratio: share.map(|share| share * found.slip_ratio),
            actuator_gross_slip_amplitude: case.actuator_gross_slip_amplitude(),
        }
    }
}

/// The limiting state in SI units, if it is known without a run.
pub(crate) fn limit_state(case: &Case) -> Option<LimitState> {
    let scales = &case.scales;
    case.tends_to.map(|end| {
        let limit = &end.limit;
        // The springs inside c are unworn. The springs outside carry no load.
        let shape = &case.contact.shape;
        let inside =
            integrate_beyond(0.0, end.stick, shape.kinks(), |x| end.depth - shape.image(x));
        let [normal_force, indentation_depth, tangential_force] = match shape.geometry() {
            Geometry::Round => [
                2.0 * inside * scales.force(),
                end.depth * scales.indentation_depth,
                scales.tangential(end.threshold * end.stick),
            ],
            Geometry::Line => [scales.force(), f64::NAN, scales.tangential(0.5 * end.threshold)],
        };
        LimitState {
            contact_radius: limit.radius * scales.contact_radius,
            stick_radius: end.stick * scales.contact_radius,
            wear_volume: limit.volume * scales.volume(),
            wear_depth: limit.depth * scales.indentation_depth,
            wear_depth_radius: limit.depth_radius * scales.contact_radius,
            normal_force,
            indentation_depth,
            tangential_force,
        }
    })
}

/// The result has a warning if the scar of the counterbody is longer than that of the other body by more than this
/// share.
const LONG: f64 = 0.1;

/// The wear depth of each body in m, and its share in the wear volume. The sum of the shares is 1, or 0 without wear.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PartsOfWear {
    pub(crate) depths: [f64; 2],
    pub(crate) volumes: [f64; 2],
}

impl BodyWear {
    /// The wear of both bodies. `parts` has an entry for each row, or none if the wear is not shared.
    pub(crate) fn of(
        share: Option<f64>,
        history: &History,
        parts: &[PartsOfWear],
        half_lengths: &[Vec<f64>; 2],
    ) -> [Self; 2] {
        let share_of = |body: usize| share.map(|share| if body == 0 { share } else { 1.0 - share });
        let is_known = !parts.is_empty();
        let rows = || parts.iter().zip(&history.wear_volume);
        [0, 1].map(|body| Self {
            share: share_of(body),
            wear_depth: is_known.then(|| parts.iter().map(|it| it.depths[body]).collect()),
            wear_volume: is_known.then(|| rows().map(|(it, all)| it.volumes[body] * all).collect()),
            scar_half_length: half_lengths[body].clone(),
        })
    }

    /// Warnings about the two scars: if that of the counterbody is much longer than the contact, and if the wear is too
    /// deep for its split. `depth` is that of the unworn contact.
    pub(crate) fn warnings(bodies: &[Self; 2], history: &History, depth: f64) -> Vec<Warning> {
        let mut warnings = Vec::new();
        let lengths = bodies[0].scar_half_length.iter().zip(&bodies[1].scar_half_length);
        let excess = lengths.map(|(contact, scar)| scar / contact - 1.0).fold(0.0, f64::max);
        if excess > LONG {
            let detail = format!(
                "Along the motion, the scar of the counterbody is up to {:.0} % longer than the contact. Its ends are \
                 uncovered for a part of each cycle, which is not modelled: the counterbody wears less deeply there, \
                 over a greater length.",
                100.0 * excess
            );
            warnings.push(Warning { kind: "long_scar".into(), detail });
        }
        let rows = bodies[0].scar_half_length.iter().zip(&bodies[1].scar_half_length);
        let rows = rows.zip(&history.wear_depth).filter(|((contact, _), _)| **contact > 0.0);
        let steepest = rows.map(|((contact, scar), wear)| wear * (scar / contact - 1.0));
        if bodies[0].wear_depth.is_some() && steepest.fold(0.0, f64::max) > depth {
            let detail = "The contact slides so far over such a deep scar that the wear of the two bodies cannot be told \
                          apart: s·w/a exceeds the depth of the unworn contact. The wear of both together holds.";
            warnings.push(Warning { kind: "split_of_wear".into(), detail: detail.to_owned() });
        }
        warnings
    }
}

impl Preview {
    /// Computes the properties of a case that are known without a run.
    pub fn of(case: &Case) -> Self {
        Self {
            units: ResultUnits,
            scales: ContactScales::of(case),
            unworn: Unworn::of(case, &case.unworn()),
            regime: case.contact.regime,
            limit: limit_state(case),
            cost: CostEstimate { operations: case.operations(), answer_bytes: case.answer_bytes() },
        }
    }
}

impl Scenario {
    /// Computes the properties that are known without a run: scales, unworn contact, limiting state
    /// and cost.
    ///
    /// # Errors
    /// The same fault as for [`Scenario::case`].
    pub fn preview(&self) -> Valid<Preview> {
        self.case().map(|case| Preview::of(&case))
    }
}
