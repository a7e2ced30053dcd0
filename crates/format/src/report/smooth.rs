//! More points for the histories in figures. A result stores few output cycles, so the run is computed again.

use serde::{Deserialize, Serialize};
use serde_json::value::{RawValue, to_raw_value};
use serde_json::{Value, json};
use utoipa::ToSchema;

use crate::{Document, Part, Result, View};
use fretwork_engine::History;
use fretwork_job::{Prepared, TaskKind};
use fretwork_study::LONGEST_EVALUATION;

/// Number of points from the first output cycle to the last. A history with as many output cycles has no more points.
const POINTS: usize = 60;
/// Largest relative difference between the last wear volume and the stored one.
const DIFFERENCE: f64 = 1e-3;

/// The run of a result, with more output cycles.
#[derive(Debug)]
pub struct Denser {
    /// The run to compute.
    pub run: Prepared,
    /// The last wear volume of the result.
    volume: f64,
}

/// The histories of a run at more output cycles, in SI. Both are null if the stored points are the best there are.
#[derive(Debug, Default, Serialize, ToSchema)]
#[schema(as = SmoothHistories)]
pub struct Histories {
    /// The history.
    #[schema(value_type = Option<History>)]
    pub history: Option<Box<RawValue>>,
    /// The history by the simplified rule; null if the result has no comparison.
    #[schema(value_type = Option<History>)]
    pub simplified: Option<Box<RawValue>>,
}

/// A result or a comparison: its histories.
#[derive(Deserialize)]
struct WithHistory {
    history: Box<RawValue>,
    comparison: Option<Box<Self>>,
}

impl Denser {
    /// The run of a stored result. `None` if the result has enough output cycles, if the run would take longer than an
    /// evaluation may, or if another version of the engine computed the result.
    ///
    /// # Errors
    /// The bytes are not the result of a run.
    pub fn of(stored: &[u8]) -> Result<Option<Self>> {
        let view = View::default();
        let document = Document::open(stored, &view)?;
        Self::read(&document, document.value("scenario")?)
    }

    fn read(document: &Document<'_>, mut scenario: Value) -> Result<Option<Self>> {
        let history = document.table(Part::History, &View::default())?;
        let at = history.axis("cycles");
        let first = at.iter().copied().find(|cycles| *cycles > 0.0).unwrap_or(0.0);
        let last = at.last().copied().unwrap_or(0.0);
        if at.len() >= POINTS || first >= last {
            return Ok(None);
        }
        // The key contains the version of the numerics, so an equal key means equal digits.
        let same = Prepared::read(TaskKind::Run, scenario.clone());
        let is_same = same.is_ok_and(|own| own.key.to_string() == document.head.key);
        let share = |i: usize| i as f64 / (POINTS - 1) as f64;
        let between = (0..POINTS - 1).map(|i| first * libm::pow(last / first, share(i)));
        scenario["cycles"] = between.chain([last]).collect();
        scenario["profiles_at"] = json!("none");
        let run = Prepared::read(TaskKind::Run, scenario).ok();
        let longest = LONGEST_EVALUATION as f64 / 1e3;
        let run = run.filter(|own| is_same && own.seconds <= longest);
        let volume = last_volume(document)?;
        Ok(run.map(|run| Self { run, volume }))
    }

    /// The histories of the computed run. There are none if the wear volume is not that of the result.
    ///
    /// # Errors
    /// The bytes are not the result of a run.
    pub fn histories(&self, computed: &[u8]) -> Result<Histories> {
        let view = View::default();
        let document = Document::open(computed, &view)?;
        if !self.agrees(&document)? {
            return Ok(Histories::default());
        }
        let WithHistory { history, comparison } = serde_json::from_slice(computed)?;
        let simplified = comparison.map(|own| own.history);
        Ok(Histories { history: Some(history), simplified })
    }

    fn agrees(&self, computed: &Document<'_>) -> Result<bool> {
        Ok((last_volume(computed)? - self.volume).abs() <= DIFFERENCE * self.volume.abs())
    }
}

fn last_volume(document: &Document<'_>) -> Result<f64> {
    let history = document.table(Part::History, &View::default())?;
    Ok(history.axis("wear_volume").last().copied().unwrap_or(f64::NAN))
}

/// The histories of a result as JSON. `None` for the reasons of [`Denser::of`], or if its wear volume differs.
pub(super) fn smooth(document: &Document<'_>) -> Result<Option<Box<RawValue>>> {
    let Some(denser) = Denser::read(document, document.value("scenario")?)? else {
        return Ok(None);
    };
    let found = denser.histories(&denser.run.compute(|_| {}).body)?;
    Ok(found.history.is_some().then(|| to_raw_value(&found)).transpose()?)
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
        let body: Value = serde_json::from_str(smooth(&document).unwrap().unwrap().get()).unwrap();
        let count = body["history"]["cycles"].as_array().unwrap().len();
        assert!((POINTS..POINTS + 2).contains(&count), "{count}");
        let mut denser = Denser::of(&stored).unwrap().unwrap();
        let body = denser.run.compute(|_| {}).body;
        let both = denser.histories(&body).unwrap();
        assert!(both.history.is_some() && both.simplified.is_some());
        // Another wear volume is that of another program.
        denser.volume *= 1.002;
        assert!(denser.histories(&body).unwrap().history.is_none());
        let other = String::from_utf8(stored.to_vec()).unwrap().replace(&document.head.key, "0");
        let other = Document::open(other.as_bytes(), &view).unwrap();
        assert!(smooth(&other).unwrap().is_none());
    }
}
