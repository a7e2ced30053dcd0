//! The numerical error of the exact method over random scenarios of all kinds.

use std::fmt::Write;

use serde_json::{Value, json};

use super::known::run;
use super::page::digits;
use super::random::Random;
use fretwork_engine::outcome::{History, Outcome, Preview};
use fretwork_engine::scenario;

/// The tolerance of the runs with which the default runs are compared.
const FINE: f64 = 1e-4;
/// What is held or how the contact moves.
const MODES: [&str; 6] = ["amplitude", "tangential force", "rig", "blocks", "record", "gross slip"];

/// Errors of one run, relative to a run with the tolerance [`FINE`]; the largest of all output
/// cycles.
struct RunErrors {
    mode: String,
    volume: f64,
    depth: f64,
    contact_radius: f64,
    /// The error that the run states for its volume.
    stated: f64,
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

/// The largest relative error of a column over the output cycles that both runs have reached.
fn largest_error(column: fn(&History) -> &Vec<f64>, run: &History, fine: &History) -> f64 {
    let reached =
        run.cycles.iter().zip(&fine.cycles).take_while(|(a, b)| a.total_cmp(b).is_eq()).count();
    let pairs = column(run)[1..reached].iter().zip(&column(fine)[1..reached]);
    pairs.map(|(value, fine)| (value / fine - 1.0).abs()).fold(0.0, f64::max)
}

fn errors(mode: String, request: &Value) -> Option<RunErrors> {
    let with_tolerance = |tolerance: f64| -> Option<Outcome> {
        let mut request = request.clone();
        request["model"] = json!({"tolerance": tolerance});
        run(&request)
    };
    let (found, fine) = (run(request)?, with_tolerance(FINE)?);
    let of = |column| largest_error(column, &found.history, &fine.history);
    Some(RunErrors {
        mode,
        volume: of(|history| &history.wear_volume),
        depth: of(|history| &history.wear_depth),
        contact_radius: of(|history| &history.contact_radius),
        stated: found.accuracy.numerical_error?,
    })
}

/// The value below which a share of the values lies.
fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let index = (share * values.len() as f64).ceil() as usize;
    values[index.clamp(1, values.len()) - 1]
}

/// Runs `count` random scenarios and prints their errors as Markdown.
#[must_use]
pub fn accuracy(count: usize, seed: u64) -> String {
    let mut random = Random::new(seed);
    let mut runs = Vec::new();
    while runs.len() < count {
        // Some random scenarios are refused, for example because the scar would outgrow the sphere.
        let Some((mode, request)) = random_scenario(&mut random) else { continue };
        let Some(found) = errors(mode, &request) else { continue };
        runs.push(found);
    }
    let mut text = String::new();
    let percent = |value: f64| digits(100.0 * value, 2) + " %";
    let mut line = |what: &str, of: &dyn Fn(&RunErrors) -> f64, runs: &[&RunErrors]| {
        let at = |share| percent(quantile(runs.iter().map(|run| of(run)), share));
        let _ = writeln!(
            text,
            "| {what} | {} | {} | {} | {} |",
            runs.len(),
            at(0.5),
            at(0.95),
            at(1.0)
        );
    };
    let all: Vec<&RunErrors> = runs.iter().collect();
    line("wear volume", &|run| run.volume, &all);
    line("wear depth", &|run| run.depth, &all);
    line("contact radius", &|run| run.contact_radius, &all);
    for held in ["depth", "force"] {
        for mode in MODES {
            let name = format!("{held}, {mode}");
            let some: Vec<&RunErrors> = runs.iter().filter(|run| run.mode == name).collect();
            if !some.is_empty() {
                line(&format!("wear volume; {name}"), &|run| run.volume, &some);
            }
        }
    }
    let covered = runs.iter().filter(|run| run.volume <= run.stated).count();
    let ratio = quantile(runs.iter().map(|run| run.stated / run.volume), 0.5);
    let _ = writeln!(
        text,
        "\n`numerical_error` covers the error of the volume in {covered} of {count} runs. In the median it is {} times the error.",
        digits(ratio, 2)
    );
    text
}
