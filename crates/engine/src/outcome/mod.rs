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

pub use self::columns::{
    ContactScales, History, LINE_WORDS, LimitState, Member, QUANTITIES, Quantity, ResultUnits,
    SECTION_WORDS, SPECIAL_WORDS, Unworn, words_in,
};
pub use self::condition::Condition;
use crate::case::{Case, Outputs};
use crate::contact::geometry::Geometry;
use crate::contact::row::UnwornSums;
use crate::contact::unworn::Regime;
use crate::numeric::integrate_beyond;
use crate::request::fault::Faults;
use crate::scenario::{Scenario, Warning};
pub use crate::solver::events::EVENTS;
use crate::solver::events::EventKind;

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
    #[must_use]
    pub fn has_reached(&self, case: &Case, row: usize) -> bool {
        let agrees = |a: f64, b: f64, error: f64| (a - b).abs() <= error * a.abs().max(b.abs());
        let Some(cycles) = self.cycles.get(row) else { return false };
        match &case.outputs {
            Outputs::Cycles(known) => {
                known.get(row).is_some_and(|known| agrees(*known, *cycles, CYCLE_ERROR))
            }
            Outputs::Energies(outputs) => outputs.energies.get(row).is_some_and(|energy| {
                agrees(*energy, case.scales.worn_by(self.dissipated_energy[row]), ENERGY_ERROR)
            }),
        }
    }
}

/// Matrices with one row per output cycle with profiles, and one column per output radius.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Profiles {
    /// Number of cycles N of each row.
    pub cycles: Vec<f64>,
    /// Radius r of each column.
    pub radius: Vec<f64>,
    /// Unworn profile f₀.
    pub initial: Vec<f64>,
    /// Limiting profile f∞.
    pub limiting: Option<Vec<f64>>,
    /// Worn profile f = f₀ + w.
    pub worn: Vec<Vec<f64>>,
    /// Wear w ≥ 0.
    pub wear: Vec<Vec<f64>>,
    /// Image g.
    pub image: Vec<Vec<f64>>,
    /// Pressure p.
    pub pressure: Vec<Vec<f64>>,
    /// Amplitude of the local slip, U·s(r). The slip path per cycle is four times as long.
    pub slip: Vec<Vec<f64>>,
}

/// Force–displacement loops, one per row of the profiles. A loop goes from +U to −U and back. It has a point
/// where each spring starts to slip, so that straight lines between the points enclose W.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Loops {
    /// Number of cycles N of each row.
    pub cycles: Vec<f64>,
    /// Displacement u of the contact. For a record it is the displacement of the largest loop.
    pub displacement: Vec<Vec<f64>>,
    /// Tangential force Q at these displacements.
    pub tangential_force: Vec<Vec<f64>>,
    /// Energy ratio A of each loop.
    pub energy_ratio: Vec<f64>,
    /// Slip ratio D of each loop.
    pub slip_ratio: Vec<f64>,
    /// System-free ratio B of each loop. It is 0 if the loop has no width.
    pub free_ratio: Vec<f64>,
    /// Energy ratio of each loop for the stroke at the actuator. Only with a rig.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub actuator_energy_ratio: Option<Vec<f64>>,
    /// Slip ratio of each loop for the stroke at the actuator. Only with a rig.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub actuator_slip_ratio: Option<Vec<f64>>,
}

/// The wear of one body. The first body carries the profile; the other one is the counterbody.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BodyWear {
    /// Share of the wear volume on this body, if the scenario has a `share`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub share: Option<f64>,
    /// The largest wear depth of this body, if the scenario has a `share` or layers. Each body wears over its own length:
    /// dw_i = dw·(k_i/ℓ_i)/Σ(k_j/ℓ_j), where ℓ is the half-length that is swept on it at the time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wear_depth: Option<Vec<f64>>,
    /// The wear volume of this body, if the scenario has a `share` or layers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wear_volume: Option<Vec<f64>>,
    /// Half of the length of the scar on this body along the motion, up to each row of the history. It is 0 without
    /// wear. The contact does not move on the body that carries the profile, so the half-length is the largest radius x
    /// that has slid. On the counterbody, the contact moves to both sides by the amplitude s of the local slip, so the
    /// half-length is the largest x + s(x).
    pub scar_half_length: Vec<f64>,
}

/// The simplified rule compared with an exact run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// The parameter ξ of the simplified rule in `history`.
    pub xi: f64,
    /// The history by the rule at the same output cycles. A run of the rule can end earlier, with a
    /// different last row.
    pub history: History,
    /// The errors of the rule, relative to the exact run.
    pub errors: Errors,
    /// The ξ with the smallest error of V. `None` without wear, or if this ξ lies outside 0.1…10.
    pub best_xi: Option<f64>,
    /// The root mean square of the relative errors of V at `best_xi`.
    pub best_error: Option<f64>,
}

/// The relative error rule/exact − 1 at each output cycle that both histories contain. It is 0
/// where both values are 0.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Errors {
    /// Error of the wear volume V.
    pub wear_volume: Vec<f64>,
    /// Error of the largest wear depth.
    pub wear_depth: Vec<f64>,
    /// Error of the normal force F.
    pub normal_force: Vec<f64>,
    /// Error of the indentation depth d.
    pub indentation_depth: Vec<f64>,
    /// Error of the dissipated energy ΣW.
    pub dissipated_energy: Vec<f64>,
}

/// An event of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OutcomeEvent {
    /// The number of cycles at the event.
    pub cycles: f64,
    /// The kind of the event.
    pub kind: EventKind,
    /// The layer that is worn through.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub layer: Option<WornLayer>,
}

/// A layer that is worn through.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WornLayer {
    /// The index of the body; 0 is that with the profile.
    pub body: usize,
    /// The index of the layer, from the surface inwards.
    pub layer: usize,
    /// The radius at which it is worn through.
    pub radius: f64,
}

/// Estimates of the numerical error.
///
/// They do not contain the errors of the theory. For a Poisson's ratio other than 0, local slip and wear vary
/// around the ring, by ±20 % at ν = 0.42. The result is their mean around the ring, which is right.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Accuracy {
    /// (k_w/μ)·ΣW/V − 1 at the last output cycle. `None` without wear. The exact method satisfies
    /// dV/dN = (k_w/μ)·W at each time, so this number is the error of the time integration. The
    /// simplified rule does not satisfy the equation.
    pub energy_mismatch: Option<f64>,
    /// The largest estimate of the relative discretisation error of V over the history. `None`
    /// without wear. For the closed form of the simplified rule, the estimate is the difference
    /// between the volumes of the computed profile and of its image. It is usually a few times too
    /// large, but too small for blunt profiles in gross slip. Otherwise the estimate comes from a
    /// second run with half as many cells.
    pub numerical_error: Option<f64>,
    /// The same for the largest wear depth. Results of version 0.3 and earlier do not have it.
    pub wear_depth_error: Option<f64>,
    /// The largest relative error of V to expect over the history, compared with the exact method.
    /// It is 0 for the exact method. `None` if the simplified rule was not compared with the exact
    /// method for such a contact.
    pub model_error: Option<f64>,
    /// Number of mesh cells of the time integration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<usize>,
    /// Number of time steps, of both runs together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<usize>,
    /// Number of evaluations of the wear rate, of both runs together.
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
    #[must_use]
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
    pub fn preview(&self) -> Result<Preview, Faults> {
        self.case().map(|case| Preview::of(&case))
    }
}
