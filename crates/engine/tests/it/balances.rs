//! What a reader of a result can compute again: a trapezoid over a pressure profile gives the normal force, and the
//! polygon of a loop the energy of one cycle.

use std::f64::consts::PI;

use fretwork_engine::contact::control::Tangential;
use fretwork_engine::outcome::Outcome;
use fretwork_engine::scenario::{self, Scenario};
use fretwork_engine::simulation::Simulation;
use serde_json::{Value, json};

/// The least number of radii from which the force is known.
const RADII: usize = 64;

/// The area below straight lines between points. Values that are not finite are left out.
fn area(x: &[f64], y: &[f64]) -> f64 {
    let points: Vec<_> = x.iter().zip(y).filter(|(_, y)| y.is_finite()).collect();
    points.windows(2).map(|ends| 0.5 * (ends[1].0 - ends[0].0) * (ends[0].1 + ends[1].1)).sum()
}

/// Checks the profiles and the loops of a result. The force of a profile may differ by this share.
pub fn judge(scenario: &Scenario, outcome: &Outcome, most: f64) {
    let case = scenario.case().expect("a case");
    let (history, profiles) = (&outcome.history, outcome.profiles.as_ref().expect("profiles"));
    let loops = outcome.loops.as_ref().expect("loops");
    let radii = &profiles.radius;
    let mut rows = 0..history.cycles.len();
    for (shown, cycles) in profiles.cycles.iter().enumerate() {
        let row = rows.find(|row| history.cycles[*row] >= *cycles).expect("a row");
        let force = history.normal_force[row];
        let pressure =
            radii.iter().zip(&profiles.pressure[shown]).map(|(r, p)| match case.scales.length {
                None => 2.0 * PI * r * p,
                Some(length) => 2.0 * length * p,
            });
        let found = area(radii, &pressure.collect::<Vec<_>>());
        // A contact that has lost nearly all of its force is an exception.
        let slack = most * force + 1e-6 * history.normal_force[0];
        // A profile that ends inside the contact does not contain its whole load.
        let is_whole = radii.last().is_some_and(|last| *last >= history.contact_radius[row]);
        let is_known = radii.len() < RADII || !is_whole || (found - force).abs() <= slack;
        assert!(is_known, "{found} {force} at {cycles}");

        let (u, q) = (&loops.displacement[shown], &loops.tangential_force[shown]);
        assert!(q.iter().filter(|q| **q == 0.0).count() >= 2, "{q:?}");
        if !u[0].is_finite() {
            continue;
        }
        let whole = 4.0 * u[0] * q[0];
        // Of a record, the loop is the largest of a pass.
        let lost = match case.control.tangential {
            Tangential::Record(_) => loops.energy_ratio[shown] * whole,
            _ => history.energy_per_cycle[row],
        };
        let reach = case
            .contact
            .reference
            .map_or(f64::INFINITY, |it| it.reach * case.scales.contact_radius);
        let far = history.contact_radius[row] / reach;
        let longer = (1.0 - far * far).max(1e-300).sqrt().recip() - 1.0;
        let excess = area(u, q).abs() - lost;
        let slack = 1e-3 * lost + 1e-14 * whole + 1e-12 * history.energy_per_cycle[0];
        assert!(-slack <= excess && excess <= longer * lost + slack, "{excess} {lost} at {cycles}");
    }
}

fn run(request: &Value) {
    let (scenario, _) = scenario::check(request, "").expect("a valid scenario");
    let outcome = Simulation::of(&scenario).expect("a contact").run();
    judge(&scenario, &outcome, 0.01);
    let (history, radii) = (&outcome.history, &outcome.profiles.expect("profiles").radius);
    let stick = history.stick_radius.iter().copied().fold(f64::INFINITY, f64::min);
    let inside = radii.iter().filter(|r| **r < stick).count();
    assert!(
        stick == 0.0 || 5 * inside >= radii.len(),
        "{inside} of {} radii inside {stick}",
        radii.len()
    );
}

/// Earlier versions had a single radius inside the stick radius, and no pressure there: the trapezoid gave 4.5 times the
/// force.
#[test]
fn a_wedge_whose_core_carries_the_load_has_radii_in_the_core() {
    let block = |force: f64, cycles: f64| json!({"tangential_force": force, "cycles": cycles});
    run(&json!({
        "profile": {"shape": "wedge", "slope_angle": 0.063_555_783, "length": 0.010_022_535},
        "moduli": {"normal": 55.083_814e9}, "friction": 0.375_352_73,
        "wear": {"coefficient": 6.027_315_7e-14}, "load": {"normal_force": 131.962_374},
        "motion": {"blocks": [block(36.850_932, 14_185.0), block(44.058_425, 14_185.0), block(11.731_692, 113_479.0)]},
        "cycles": [4255, 14_185, 99_294, 141_707], "profiles_at": "all",
    }));
}

/// The stroke of this punch is measured at 3.7 times the contact radius, so its loop encloses 4 % more than the energy.
#[test]
fn a_punch_with_a_thin_ring_of_slip_carries_its_load_at_the_edge() {
    run(&json!({
        "profile": {"shape": "punch", "flat_half_width": 0.000_488_566_1, "edge_radius": 0.001_432_220_3,
                    "length": 0.032_563_079},
        "moduli": {"normal": 37.460_849e9}, "friction": 1.197_047_36,
        "wear": {"coefficient": 2.557_752_9e-14}, "load": {"normal_force": 254.867_046},
        "motion": {"amplitude": 1.731_771_2e-7, "rig_stiffness": 3.624_900_8e9, "reference_distance": 0.001_803_693_6},
        "cycles": [15_475, 257_917, 1_547_504, 4_126_678], "profiles_at": "all",
    }));
}
