//! The errors of a run with the default tolerance, measured by comparison with a run with a finer tolerance.

use serde_json::{Value, json};

use super::known::run;
use fretwork_engine::{EventKind, History, Outcome};

/// The tolerance of the fine run, with which the default run is compared.
pub const FINE: f64 = 1e-4;
/// The energy per cycle is compared only where it is at least this share of its largest value.
const LEAST_ENERGY: f64 = 0.01;

/// A relative error at one output cycle, and the error that the run states there.
#[derive(Clone, Copy)]
pub struct OutputError {
    /// The relative difference from the fine run.
    pub error: f64,
    /// The stated error.
    pub stated: f64,
}

/// The errors of one run, relative to the fine run.
pub struct Deviation {
    /// Errors of the wear volume, one per output cycle.
    pub volume: Vec<OutputError>,
    /// Errors of the largest wear depth, one per output cycle.
    pub depth: Vec<OutputError>,
    /// The largest errors of the contact radius and of the energy per cycle, and the errors of the times of the events
    /// `contact_lost` and `shakedown`. `None` without such an event, or if too little energy is lost.
    pub others: [Option<f64>; 4],
    /// Whether the run has the warning `numerical_error`.
    pub is_warned: bool,
}

impl Deviation {
    /// Compares the default run with the fine run. `None` if a run is refused, or if both runs have no output cycle
    /// with wear in common.
    pub fn of(request: &Value) -> Option<Self> {
        let mut fine = request.clone();
        fine["model"] = json!({"tolerance": FINE});
        Self::between(&run(request)?, &run(&fine)?)
    }

    fn between(outcome: &Outcome, fine: &Outcome) -> Option<Self> {
        let (found, exact) = (&outcome.history, &fine.history);
        let rows = worn_rows(found, exact);
        let energies = &exact.energy_per_cycle;
        let most = energies.iter().copied().fold(0.0, f64::max);
        let lively = rows.iter().filter(|row| energies[**row] >= LEAST_ENERGY * most);
        let radii = (&found.contact_radius, &exact.contact_radius);
        let outputs = |(found, exact, stated): (&[f64], &[f64], &[f64])| {
            let output = |row: &usize| OutputError {
                error: apart(found, exact, *row),
                stated: stated[*row],
            };
            rows.iter().map(output).collect()
        };
        (!rows.is_empty()).then(|| Self {
            volume: outputs((&found.wear_volume, &exact.wear_volume, &found.wear_volume_error)),
            depth: outputs((&found.wear_depth, &exact.wear_depth, &found.wear_depth_error)),
            others: [
                largest(rows.iter().map(|row| apart(radii.0, radii.1, *row))),
                largest(lively.map(|row| apart(&found.energy_per_cycle, energies, *row))),
                moment(EventKind::ContactLost, outcome, fine),
                moment(EventKind::Shakedown, outcome, fine),
            ],
            is_warned: outcome.warnings.iter().any(|warning| warning.kind == "numerical_error"),
        })
    }

    /// The errors of volume and depth.
    pub fn outputs(&self) -> impl Iterator<Item = &OutputError> {
        self.volume.iter().chain(&self.depth)
    }
}

/// The indices of the rows with wear that both histories have in common.
fn worn_rows(found: &History, exact: &History) -> Vec<usize> {
    let pairs = found.cycles.iter().zip(&exact.cycles);
    let common = pairs.take_while(|(a, b)| a.total_cmp(b).is_eq()).count();
    (0..common).filter(|row| exact.wear_volume[*row] > 0.0).collect()
}

fn apart(column: &[f64], exact: &[f64], row: usize) -> f64 {
    (column[row] / exact[row] - 1.0).abs()
}

fn largest(errors: impl Iterator<Item = f64>) -> Option<f64> {
    errors.max_by(f64::total_cmp)
}

/// The relative error of the time of an event. If only one of the runs reports the event, the end of the other run
/// gives a lower bound of the error.
fn moment(kind: EventKind, run: &Outcome, fine: &Outcome) -> Option<f64> {
    let at = |outcome: &Outcome| {
        outcome.events.iter().find(|event| event.kind == kind).map(|event| event.cycles)
    };
    let end = |outcome: &Outcome| outcome.history.cycles.last().copied();
    Some(match (at(run), at(fine)) {
        (Some(found), Some(exact)) => (found / exact - 1.0).abs(),
        (None, Some(exact)) => (end(run)? / exact - 1.0).max(0.0),
        (Some(found), None) => (1.0 - found / end(fine)?).max(0.0),
        (None, None) => return None,
    })
}
