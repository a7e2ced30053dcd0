//! The command `fit`: fits numbers of a scenario to a file of measured numbers, without a server.

use std::fmt::Write as _;
use std::process::ExitCode;

use serde_json::{Value, json};

use super::printing::{Error, print};
use super::run::{compute, print_faults, read};
use crate::config::Fit;
use fretwork_engine::request::quantity::{Dimension, parse};
use fretwork_job::Submission;
use fretwork_json::BadBody;
use fretwork_measured::{Prepare, Wanted};

/// The factor from the wear coefficient of the scenario to the ends of its range.
const RANGE: f64 = 1e4;
/// The relative noise before the first estimate.
const NOISE: f64 = 0.1;
/// Minimum number of points for a wear coefficient and a friction.
const FEWEST: usize = 3;

/// Fits, and prints the estimates. The exit code is 2 if the file, the scenario or the fit has faults.
pub fn fit(settings: &Fit) -> Result<ExitCode, Error> {
    let Fit { x, y, sigma, relative, at, .. } = settings;
    let prepare = if at.is_some() { Prepare::Trace } else { Prepare::Points };
    let wanted = Wanted { x: x.as_deref(), y: y.as_deref(), prepare, level: true, centre: true };
    let mut measured = match fretwork_measured::read(&read(&settings.file)?, &wanted) {
        Ok(measured) => measured,
        Err(faults) => return Ok(print_faults(&faults.below(&settings.file.to_string_lossy()).0)),
    };
    let mut data = measured.prepared["data"].take();
    let given = [("sigma", json!(sigma)), ("relative", json!(relative)), ("at", json!(at))];
    for (name, given) in given.into_iter().filter(|(_, given)| !given.is_null()) {
        data[name] = given;
    }
    if data.get("sigma").or(data.get("relative")).is_none() {
        (data["relative"], data["noise"]) = (json!(NOISE), json!("estimate"));
        let note = "The noise is proportional to the numbers, and estimated from the residuals.";
        measured.notes.push(note.to_owned());
    }
    let named = |error| format!("{}: {error}", settings.scenario.display());
    let job = serde_json::from_slice(&read(&settings.scenario)?);
    let mut job: Value = job.map_err(named)?;
    let scenario = job.get_mut("scenario").map(Value::take).unwrap_or(job);
    let points =
        data["y"].as_array().map_or(FEWEST, |y| y.iter().filter_map(Value::as_f64).count());
    let mut parameters: Vec<Value> = settings.parameter.iter().map(asked).collect();
    if parameters.is_empty() {
        parameters = defaults(&scenario, points)?;
    }
    loop {
        let tests = json!([{"data": [data]}]);
        let fit = json!({"scenario": scenario, "parameters": parameters, "tests": tests});
        let body = format!("{:#}\n", json!({"fit": fit}));
        let job = match Submission::parse(body.as_bytes()) {
            _ if settings.print => return print(body.as_bytes()).map(|()| ExitCode::SUCCESS),
            Ok(job) => job,
            Err(BadBody::Faults(faults)) => return Ok(print_faults(&faults)),
            Err(error) => return Err(error.into()),
        };
        let found: Value = serde_json::from_slice(&compute(&job.prepared)?.0.body)?;
        let ends = found["parameters"][1]["interval"].as_array();
        if settings.parameter.is_empty() && ends.is_some_and(|ends| ends.contains(&Value::Null)) {
            parameters.truncate(1);
            let note = "These data do not tell the friction. It stays as in the scenario.";
            measured.notes.push(note.to_owned());
            continue;
        }
        return print(told(&found, &measured.notes)?.as_bytes()).map(|()| ExitCode::SUCCESS);
    }
}

/// A parameter that the user names.
fn asked((pointer, low, high): &(String, String, String)) -> Value {
    let read = |text: &String| text.parse().map_or_else(|_| json!(text), |it: f64| json!(it));
    let spacing = if pointer.starts_with("/wear/") { "log" } else { "linear" };
    json!({"pointer": pointer, "from": read(low), "to": read(high), "spacing": spacing})
}

/// The wear coefficient, and the friction if there are enough points.
fn defaults(scenario: &Value, points: usize) -> Result<Vec<Value>, Error> {
    let wear = [
        ("coefficient", Dimension::WearCoefficient),
        ("energy_coefficient", Dimension::EnergyWear),
    ];
    let found = wear.into_iter().find_map(|(name, dimension)| {
        let value = scenario["wear"].get(name)?;
        let start = value.as_f64().or_else(|| parse(value.as_str()?, dimension).ok())?;
        let pointer = format!("/wear/{name}");
        Some(json!({"pointer": pointer, "from": start / RANGE, "to": start * RANGE, "spacing": "log"}))
    });
    let advice =
        "the scenario has no constant wear coefficient. Name a number to fit with --parameter";
    let mut parameters = vec![found.ok_or(advice)?];
    if points >= FEWEST && scenario["friction"].is_number() {
        parameters.push(json!({"pointer": "/friction", "from": 0.1, "to": 1.5}));
    }
    Ok(parameters)
}

/// A number in SI with four digits, in a usual unit.
fn shown(number: &Value, unit: &str) -> String {
    let (unit, factor) = match unit {
        "m^3" => ("mm^3", 1e9),
        "m" => ("um", 1e6),
        "1/Pa" => ("mm^3/(N m)", 1e9),
        "1" => ("", 1.0),
        other => (other, 1.0),
    };
    let digits = number.as_f64().map(|number| format!("{:.3e}", number * factor));
    let rounded: Option<f64> = digits.and_then(|digits| digits.parse().ok());
    match rounded {
        None => "-".to_owned(),
        Some(it) if it == 0.0 || (1e-3..1e9).contains(&it.abs()) => {
            format!("{it} {unit}").trim_end().to_owned()
        }
        Some(it) => format!("{it:e} {unit}").trim_end().to_owned(),
    }
}

/// The estimates, the notes and the predictions in words.
fn told(found: &Value, notes: &[String]) -> Result<String, Error> {
    let mut text = String::new();
    let list = |name: &str| found[name].as_array().into_iter().flatten();
    let details = list("notes").filter_map(|note| note["detail"].as_str());
    for note in notes.iter().map(String::as_str).chain(details) {
        writeln!(text, "{note}")?;
    }
    let percent = 100.0 * found["fit"]["confidence"].as_f64().unwrap_or(0.0);
    writeln!(text, "\nEstimates, with intervals of {percent} %:")?;
    for it in list("parameters").chain(list("combinations")) {
        let name = it["pointer"].as_str().or(it["combination"].as_str()).unwrap_or("");
        let unit = it["unit"].as_str().unwrap_or("1");
        let [x, low, high] =
            [&it["estimate"], &it["interval"][0], &it["interval"][1]].map(|x| shown(x, unit));
        writeln!(text, "  {name}: {x} ({low} to {high})")?;
    }
    let table = &found["table"];
    writeln!(text, "\nPredictions, with the band of {percent} % for a new test:")?;
    for row in 0..table["x"].as_array().map_or(0, Vec::len) {
        let word = |name: &str| table[name][row].as_str().unwrap_or("1");
        let over = match word("over") {
            "cycles" => "cycles",
            "dissipated_energy" => "J",
            _ => "m",
        };
        let [x, y, low, high] = ["predicted", "measured", "prediction_low", "prediction_high"]
            .map(|name| shown(&table[name][row], word("unit")));
        writeln!(text, "  {}: {x} ({low} to {high}), measured {y}", shown(&table["x"][row], over))?;
    }
    Ok(text)
}
