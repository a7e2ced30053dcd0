//! A trace as the indenter of a scenario, if the scenario would accept it.

use serde_json::{Value, json};

use fretwork_engine::scenario;

use super::radial::Radial;
use crate::notes::Notes;

/// Loads in N for which an indenter is tried.
const LOADS: [f64; 5] = [10.0, 1.0, 100.0, 0.1, 1000.0];
/// Noise moves a height by at most this many times the scatter.
const NOISE: f64 = 3.0;

/// Why a scenario would refuse the heights with each of several loads.
fn refused(radius: &[f64], height: &[f64]) -> Option<String> {
    let profile = json!({"shape": "table", "radius": radius, "height": height});
    let fault = |load: &f64| {
        let request = json!({
            "profile": profile, "moduli": {"normal": 1e11, "tangential": 1e11}, "friction": 0.5,
            "wear": {"coefficient": 1e-14}, "load": {"normal_force": load}, "motion": {"amplitude": 1e-6}, "cycles": [1],
        });
        scenario::check(&request, "").err()
    };
    // One load without a fault is enough.
    let faults: Option<Vec<_>> = LOADS.iter().map(fault).collect();
    faults?.into_iter().flat_map(|faults| faults.0).map(|fault| fault.detail).next()
}

/// The largest convex profile below the heights from the lowest one on: each corner is the next one in the flattest direction.
fn convex(radius: &[f64], height: &[f64]) -> Vec<f64> {
    let order = |one: &usize, other: &usize| height[*one].total_cmp(&height[*other]);
    let mut corner = (0..height.len()).min_by(order).unwrap_or(0);
    let (lowest, mut found) = (height[corner], vec![0.0; corner + 1]);
    let slope = |from: usize, to: usize| (height[to] - height[from]) / (radius[to] - radius[from]);
    let flattest = |from: usize| {
        (from + 1..height.len())
            .min_by(|one, other| slope(from, *one).total_cmp(&slope(from, *other)))
    };
    while let Some(next) = flattest(corner) {
        let rise = |at: usize| slope(corner, next) * (radius[at] - radius[corner]);
        found.extend((corner + 1..=next).map(|at| height[corner] + rise(at) - lowest));
        corner = next;
    }
    found
}

/// The heights over radii, made convex within the noise if a scenario would refuse them. Null if it would refuse these, too.
pub fn of(radial: &Radial, scatter: f64, notes: &mut Notes) -> Value {
    let Radial { radius, height, .. } = radial;
    let table = |height: &[f64]| json!({"shape": "table", "radius": radius, "height": height});
    let Some(detail) = refused(radius, height) else { return table(height) };
    let smooth = convex(radius, height);
    let largest =
        height.iter().zip(&smooth).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
    if largest <= NOISE * scatter && refused(radius, &smooth).is_none() {
        notes.push(format!(
            "The heights of the indenter were made convex, by at most {:.4} um, because noise would split the contact.",
            1e6 * largest
        ));
        return table(&smooth);
    }
    notes.push(format!("There is no indenter, because a scenario would refuse it: it {detail}."));
    Value::Null
}
