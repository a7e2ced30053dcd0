//! More points for the histories in figures. A result stores few output cycles, so the run is computed again.

use serde_json::{Value, json};

use crate::document::Document;
use crate::error::Result;
use crate::kind::Part;
use crate::view::View;
use fretwork_job::{Prepared, TaskKind};

/// Number of points from the first output cycle to the last. A history with as many output cycles has no more points.
const POINTS: usize = 60;
/// Longest estimated time of a run that is computed again, in seconds: as long as an evaluation may take.
const SECONDS: f64 = 0.15;

/// The result at more output cycles. `None` if it takes long, or if another version of the engine computed the result.
pub fn smooth(document: &Document<'_>, scenario: &Value) -> Result<Option<Vec<u8>>> {
    let history = document.table(Part::History, &View::default())?;
    let at = history.axis("cycles");
    let first = at.iter().copied().find(|cycles| *cycles > 0.0).unwrap_or(0.0);
    let last = at.last().copied().unwrap_or(0.0);
    if at.len() >= POINTS || first >= last {
        return Ok(None);
    }
    // The key contains the version of the numerics, so an equal key means equal digits.
    let mut scenario = scenario.clone();
    let same = Prepared::read(TaskKind::Run, scenario.clone());
    let is_same = same.is_ok_and(|own| own.key.to_string() == document.head.key);
    let share = |i: usize| i as f64 / (POINTS - 1) as f64;
    let between = (0..POINTS - 1).map(|i| first * libm::pow(last / first, share(i)));
    scenario["cycles"] = between.chain([last]).collect();
    scenario["profiles_at"] = json!("none");
    let prepared = Prepared::read(TaskKind::Run, scenario).ok();
    let prepared = prepared.filter(|own| is_same && own.seconds <= SECONDS);
    Ok(prepared.map(|prepared| prepared.compute(|_| {}).body.to_vec()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_points_agree_with_the_stored_ones_and_belong_to_the_same_engine() {
        let scenario = json!({
            "profile": {"shape": "paraboloid", "radius": "10 mm"},
            "moduli": {"normal": "112.6 GPa", "tangential": "92.8 GPa"},
            "friction": 0.7,
            "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
            "load": {"normal_force": "100 N"},
            "motion": {"amplitude": "2.256 um"},
            "cycles": [1000, 10000, 100_000],
            "model": {"compare": true}
        });
        let stored = Prepared::read(TaskKind::Run, scenario).unwrap().compute(|_| {}).body;
        let view = View::default();
        let document = Document::open(&stored, &view).unwrap();
        let canonical = document.value("scenario").unwrap();
        let dense = smooth(&document, &canonical).unwrap().unwrap();
        let dense = Document::open(&dense, &view).unwrap();
        let table = dense.table(Part::History, &view).unwrap();
        assert!((POINTS..POINTS + 2).contains(&table.cycles()), "{}", table.cycles());
        let other = String::from_utf8(stored.to_vec()).unwrap().replace(&document.head.key, "0");
        let other = Document::open(other.as_bytes(), &view).unwrap();
        assert_eq!(smooth(&other, &canonical).unwrap(), None);
    }
}
