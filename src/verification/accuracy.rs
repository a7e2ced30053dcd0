//! The numerical error of the exact method over random scenarios of all kinds.

use std::fmt::{self, Display, Formatter};

use serde_json::{Value, json};

use super::known::run;
use super::page::digits;
use crate::random::Random;
use fretwork_engine::outcome::{Outcome, Preview};
use fretwork_engine::scenario;
use fretwork_engine::solver::events::EventKind;

/// The tolerance of the runs with which the default runs are compared.
const FINE: f64 = 1e-4;
/// What is held or how the contact moves.
const MODES: [&str; 6] = ["amplitude", "tangential force", "rig", "blocks", "record", "gross slip"];

/// What is compared.
const MEASURES: [&str; 6] = [
    "wear volume",
    "wear depth",
    "contact radius",
    "energy per cycle",
    "contact_lost",
    "shakedown",
];
/// The energy per cycle is compared down to this share of its first value.
const LEAST_ENERGY: f64 = 0.01;

/// Errors of one run, relative to a run with the tolerance [`FINE`].
struct RunErrors {
    mode: String,
    /// The largest error of each of [`MEASURES`] over all output cycles, or the error of the moment of an
    /// event. `None` without such an event, or if too little energy is lost.
    errors: [Option<f64>; MEASURES.len()],
    /// The error that the run states for its volume.
    stated: f64,
}

impl RunErrors {
    fn volume(&self) -> Option<f64> {
        self.errors[0]
    }

    /// The stated error of the volume relative to the true one.
    fn caution(&self) -> Option<f64> {
        self.volume().map(|volume| self.stated / volume)
    }
}

/// The errors of random runs. It is printed as Markdown.
pub struct Accuracy {
    runs: Vec<RunErrors>,
}

/// A random scenario, and the words for its kind.
fn random_scenario(random: &mut Random) -> Option<(String, Value)> {
    let (held, mode) = (random.one_of(&["depth", "force"]), random.one_of(&MODES));
    let exponent = random.one_of(&[1.0, 1.5, 2.0, 3.0, 6.0]);
    let profile = if random.between(0.0, 1.0) < 0.2 {
        json!({"shape": "sphere", "radius": "10 mm"})
    } else {
        json!({"shape": "power", "exponent": exponent, "height": "5 um", "at_radius": "0.2 mm"})
    };
    let stick_ratio = random.between(0.05, 0.98);
    let mut request = json!({
        "profile": profile,
        "moduli": {"normal": "110 GPa", "tangential": "90 GPa"},
        "friction": 0.6,
        "wear": {"coefficient": 1e-14},
        "load": {"normal_force": "50 N", "held": held},
        "motion": {"stick_ratio": stick_ratio},
        "cycles": [1],
        "profiles_at": "none",
    });
    let Preview { scales, unworn, .. } = scenario::check(&request, "").ok()?.0.preview().ok()?;
    let amplitude = unworn.amplitude;
    let last = random.log_between(0.5, 16.0) * scales.cycles;
    request["motion"] = match mode {
        "amplitude" => json!({"stick_ratio": stick_ratio}),
        "tangential force" => json!({"stick_ratio": stick_ratio, "held": "tangential_force"}),
        "rig" => {
            let stiffness =
                unworn.tangential_force / unworn.amplitude * random.log_between(0.3, 30.0);
            json!({"stick_ratio": stick_ratio, "rig_stiffness": stiffness})
        }
        "blocks" => json!({"blocks": [
            {"amplitude": amplitude, "cycles": last * random.between(0.1, 0.4)},
            {"amplitude": amplitude * random.between(0.2, 1.0), "cycles": last * random.between(0.1, 0.4)},
            {"amplitude": amplitude * random.between(0.5, 1.2), "cycles": last},
        ]}),
        "record" => {
            let position = |random: &mut Random| amplitude * random.between(-0.9, 0.9);
            json!({"reversals": [amplitude, -amplitude, position(random), position(random), position(random)]})
        }
        _ => json!({"amplitude": unworn.gross_slip_amplitude * random.log_between(1.02, 5.0)}),
    };
    request["cycles"] = [0.125, 0.25, 0.5, 1.0].map(|share| json!(share * last)).into();
    Some((format!("{held}, {mode}"), request))
}

/// The largest relative error of a column over the rows in question.
fn largest(column: &[f64], fine: &[f64], rows: impl Iterator<Item = usize>) -> Option<f64> {
    rows.map(|row| (column[row] / fine[row] - 1.0).abs()).max_by(f64::total_cmp)
}

/// The relative error of the moment of an event. If one run does not report it, the error is at least that of its end.
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

/// `None` if a run is refused, or if both runs have no output cycle with wear in common.
fn errors(mode: String, request: &Value) -> Option<RunErrors> {
    let with_tolerance = |tolerance: f64| -> Option<Outcome> {
        let mut request = request.clone();
        request["model"] = json!({"tolerance": tolerance});
        run(&request)
    };
    let (outcome, fine) = (run(request)?, with_tolerance(FINE)?);
    let (found, exact) = (&outcome.history, &fine.history);
    let pairs = found.cycles.iter().zip(&exact.cycles);
    let common = pairs.take_while(|(a, b)| a.total_cmp(b).is_eq()).count();
    let rows = || 1..common;
    let energies = &exact.energy_per_cycle;
    let lively = rows().filter(|row| energies[*row] >= LEAST_ENERGY * energies[0]);
    Some(RunErrors {
        mode,
        errors: [
            Some(largest(&found.wear_volume, &exact.wear_volume, rows())?),
            largest(&found.wear_depth, &exact.wear_depth, rows()),
            largest(&found.contact_radius, &exact.contact_radius, rows()),
            largest(&found.energy_per_cycle, energies, lively),
            moment(EventKind::ContactLost, &outcome, &fine),
            moment(EventKind::Shakedown, &outcome, &fine),
        ],
        stated: outcome.accuracy.numerical_error?,
    })
}

/// The value below which a share of the values lies.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    let index = (share * values.len() as f64).ceil() as usize;
    values[index.clamp(1, values.len()) - 1]
}

impl Accuracy {
    /// Computes `count` random scenarios.
    #[must_use]
    pub fn measured(count: usize, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let mut runs = Vec::new();
        while runs.len() < count {
            // Some random scenarios are refused, for example because the scar would outgrow the sphere.
            let Some((mode, request)) = random_scenario(&mut random) else { continue };
            runs.extend(errors(mode, &request));
        }
        Self { runs }
    }

    /// The error of a measure that a share of the runs does not exceed. `None` if no run has this
    /// measure.
    #[must_use]
    pub fn below(&self, measure: &str, share: f64) -> Option<f64> {
        let index = MEASURES.iter().position(|name| *name == measure)?;
        let errors: Vec<_> = self.runs.iter().filter_map(|run| run.errors[index]).collect();
        (!errors.is_empty()).then(|| quantile(&errors, share))
    }

    /// The number of runs whose `numerical_error` is not below the error of the volume.
    #[must_use]
    pub fn covered(&self) -> usize {
        self.runs.iter().filter(|run| run.volume().is_some_and(|error| error <= run.stated)).count()
    }

    /// The median of `numerical_error` over the error of the volume.
    #[must_use]
    pub fn caution(&self) -> f64 {
        quantile(&self.runs.iter().filter_map(RunErrors::caution).collect::<Vec<_>>(), 0.5)
    }
}

impl Display for Accuracy {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut line = |what: &str, errors: Vec<f64>| -> fmt::Result {
            if errors.is_empty() {
                return Ok(());
            }
            let at = |share| digits(100.0 * quantile(&errors, share), 2);
            let (median, most, all) = (at(0.5), at(0.95), at(1.0));
            writeln!(f, "| {what} | {} | {median} % | {most} % | {all} % |", errors.len())
        };
        for (index, measure) in MEASURES.iter().enumerate() {
            line(measure, self.runs.iter().filter_map(|run| run.errors[index]).collect())?;
        }
        for held in ["depth", "force"] {
            for mode in MODES {
                let name = format!("{held}, {mode}");
                let some = self.runs.iter().filter(|run| run.mode == name);
                line(
                    &format!("wear volume; {name}"),
                    some.filter_map(RunErrors::volume).collect(),
                )?;
            }
        }
        let (covered, count, caution) =
            (self.covered(), self.runs.len(), digits(self.caution(), 2));
        writeln!(
            f,
            "\n`numerical_error` covers the error of the volume in {covered} of {count} runs. \
             In the median it is {caution} times the error."
        )
    }
}
