//! Running conditions: the unworn contact of a case at other amplitudes.
//!
//! All numbers are integrals over the unworn springs, which take about a microsecond. So a map of many amplitudes does not
//! need a case for each of them.
//!
//! # Sources
//! The paper, (10). For a paraboloid they are the results of Cattaneo and Mindlin.

use crate::case::Case;
use crate::contact::Regime;
use crate::contact::row::unworn_integrals;

/// The unworn contact under a harmonic motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Condition {
    /// The slip regime: partial or gross slip.
    pub regime: Regime,
    /// The tangential force as a share of the friction limit, Q/(μF).
    pub force_ratio: f64,
    /// The stick ratio c/a; 0 in gross slip.
    pub stick_ratio: f64,
    /// Energy W lost per cycle, in J.
    pub energy_per_cycle: f64,
}

impl Condition {
    /// The condition of the contact of a case at an amplitude of its motion in m: that of the actuator behind a rig.
    pub fn of(case: &Case, amplitude: f64) -> Self {
        let (scales, shape) = (&case.scales, &case.contact.shape);
        let (threshold, middle) = case.threshold_at(amplitude);
        let stick = shape.stick_radius(threshold);
        let (tangential, energy) = unworn_integrals(shape, stick, threshold);
        let is_partial = stick > 0.0;
        Self {
            regime: if is_partial { Regime::PartialSlip } else { Regime::GrossSlip },
            force_ratio: if is_partial { tangential / shape.half_force() } else { 1.0 },
            stick_ratio: stick,
            energy_per_cycle: scales.energy(energy + middle),
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::outcome::Preview;
    use crate::scenario;

    #[test]
    fn a_condition_agrees_with_the_unworn_contact_of_a_case_with_its_amplitude() {
        for profile in [
            json!({"shape": "paraboloid", "radius": "10 mm"}),
            json!({"shape": "cone", "slope_angle": "2 deg"}),
            json!({"shape": "truncated_paraboloid", "radius": "10 mm", "flat_radius": "0.1 mm"}),
        ] {
            let case = |amplitude: f64| {
                let scenario = json!({
                    "profile": profile, "moduli": {"normal": 113e9, "tangential": 93e9}, "friction": 0.7,
                    "wear": {"coefficient": 3.03e-14}, "load": {"normal_force": 100.0},
                    "motion": {"amplitude": amplitude}, "cycles": [1000],
                });
                scenario::prepare(scenario, "").unwrap().1
            };
            let base = case(1e-6);
            for amplitude in [1e-8, 3e-7, 2e-6, 4e-6, base.gross_slip_amplitude(), 2e-5] {
                let (found, other) = (Condition::of(&base, amplitude), case(amplitude));
                let Preview { unworn, regime, scales, .. } = Preview::of(&other);
                assert_eq!(found.regime, regime, "{profile} {amplitude}");
                let carried = 0.7 * scales.normal_force;
                for (found, known) in [
                    (found.force_ratio, unworn.tangential_force / carried),
                    (found.stick_ratio, unworn.stick_radius / scales.contact_radius),
                    (found.energy_per_cycle, unworn.energy_per_cycle),
                ] {
                    let error = (found - known).abs();
                    assert!(error <= 1e-10 * known, "{profile} {amplitude}: {found} {known}");
                }
            }
        }
    }
}
