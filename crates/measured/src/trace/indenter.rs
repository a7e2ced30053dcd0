//! A trace as the indenter of a scenario, if the scenario would accept it.

use serde_json::{Value, json};

use fretwork_engine::scenario;

use super::radial::Radial;

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
    let faults: Vec<_> = LOADS.iter().map_while(fault).collect();
    let first = faults.first().and_then(|faults| faults.0.first());
    (faults.len() == LOADS.len()).then(|| first.map_or_else(String::new, |it| it.detail.clone()))
}

/// The largest convex profile below the heights (their lower convex hull, by Andrew's monotone chain). It never falls.
fn convex(radius: &[f64], height: &[f64]) -> Vec<f64> {
    let lowest = (0..height.len()).min_by(|one, other| height[*one].total_cmp(&height[*other]));
    let lowest = lowest.unwrap_or(0);
    let slope =
        |one: usize, other: usize| (height[other] - height[one]) / (radius[other] - radius[one]);
    let mut corners: Vec<usize> = Vec::new();
    for at in lowest..height.len() {
        while let [.., before, last] = corners[..] {
            if slope(before, last) < slope(last, at) {
                break;
            }
            corners.pop();
        }
        corners.push(at);
    }
    let mut found = vec![0.0; lowest + 1];
    for pair in corners.windows(2) {
        let own = slope(pair[0], pair[1]);
        let rise = |at: usize| height[pair[0]] + own * (radius[at] - radius[pair[0]]);
        found.extend((pair[0] + 1..=pair[1]).map(|at| rise(at) - height[lowest]));
    }
    found
}

/// The heights over radii, made convex within the noise if a scenario would refuse them. Null if it would refuse these, too.
pub fn of(radial: &Radial, scatter: f64, notes: &mut Vec<String>) -> Value {
    let Radial { reach, height, .. } = radial;
    let table = |height: &[f64]| json!({"shape": "table", "radius": reach, "height": height});
    let Some(detail) = refused(reach, height) else { return table(height) };
    let smooth = convex(reach, height);
    let largest =
        height.iter().zip(&smooth).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
    if largest <= NOISE * scatter && refused(reach, &smooth).is_none() {
        notes.push(format!(
            "The heights of the indenter were made convex, by at most {:.4} um, because noise would split the contact.",
            1e6 * largest
        ));
        return table(&smooth);
    }
    notes.push(format!("There is no indenter, because a scenario would refuse it: it {detail}."));
    Value::Null
}
