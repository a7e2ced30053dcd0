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
/// The range of the coefficient of friction.
const FRICTION: [f64; 2] = [0.1, 1.5];
/// Minimum number of points for two parameters.
const FEWEST: usize = 3;

/// Fits, and prints the estimates. The exit code is 2 if the file, the scenario or the fit has faults.
pub fn fit(settings: &Fit) -> Result<ExitCode, Error> {
    let prepare = if settings.profile { Prepare::Trace } else { Prepare::Points };
    let (x, y) = (settings.x.as_deref(), settings.y.as_deref());
    let wanted = Wanted { x, y, prepare, level: true, centre: true };
    let mut measured = match fretwork_measured::read(&read(&settings.file)?, &wanted) {
        Ok(measured) => measured,
        Err(faults) => return Ok(print_faults(&faults.below(&settings.file.to_string_lossy()).0)),
    };
    let mut data = measured.prepared["data"].take();
    for (name, given) in [
        ("sigma", settings.sigma.as_ref().map(|sigma| json!(sigma))),
        ("relative", settings.relative.map(|relative| json!(relative))),
        ("at", settings.at.map(|at| json!(at))),
    ] {
        if let Some(given) = given {
            data[name] = given;
        }
    }
    if data.get("sigma").or(data.get("relative")).is_none() {
        data["noise"] = json!("estimate");
    }
    let mut scenario: Value = serde_json::from_slice(&read(&settings.scenario)?)?;
    if scenario.get("scenario").is_some() {
        scenario = scenario["scenario"].take();
    }
    let known =
        data["y"].as_array().map_or(usize::MAX, |y| y.iter().filter(|y| !y.is_null()).count());
    let mut parameters = settings.parameter.iter().map(given).collect();
    if settings.parameter.is_empty() {
        parameters = defaults(&scenario, known)?;
    }
    loop {
        let tests = json!([{"data": [data]}]);
        let fit = json!({"scenario": scenario, "parameters": parameters, "tests": tests});
        let body = json!({"fit": fit});
        if settings.print {
            return print(format!("{body:#}\n").as_bytes()).map(|()| ExitCode::SUCCESS);
        }
        let job = match Submission::parse(body.to_string().as_bytes()) {
            Ok(job) => job,
            Err(BadBody::Faults(faults)) => return Ok(print_faults(&faults)),
            Err(error) => return Err(error.into()),
        };
        let (answer, _) = compute(&job.prepared)?;
        let found: Value = serde_json::from_slice(&answer.body)?;
        let friction = &found["parameters"][1];
        let is_told = friction["at_bound"] == false
            && friction["interval"].as_array().is_some_and(|ends| !ends.contains(&Value::Null));
        if settings.parameter.is_empty() && parameters.len() == 2 && !is_told {
            parameters.pop();
            measured.notes.push(
                "These data do not tell the friction. It stays as in the scenario.".to_owned(),
            );
            continue;
        }
        return print(told(&found, &measured.notes)?.as_bytes()).map(|()| ExitCode::SUCCESS);
    }
}

/// A parameter that the user names.
fn given((pointer, low, high): &(String, String, String)) -> Value {
    let read =
        |text: &String| text.parse().map_or_else(|_| json!(text), |number: f64| json!(number));
    let spacing = if pointer.starts_with("/wear/") { "log" } else { "linear" };
    json!({"pointer": pointer, "from": read(low), "to": read(high), "spacing": spacing})
}

/// The wear coefficient, and the friction if there are enough points.
fn defaults(scenario: &Value, points: usize) -> Result<Vec<Value>, Error> {
    let names = [
        ("/wear/coefficient", Dimension::WearCoefficient),
        ("/wear/energy_coefficient", Dimension::EnergyWear),
    ];
    let found = names.into_iter().find_map(|(pointer, dimension)| {
        let value = scenario.pointer(pointer)?;
        let text = || parse(value.as_str()?, dimension).ok();
        Some((pointer, value.as_f64().or_else(text)?))
    });
    let (pointer, start) = found.ok_or(
        "the scenario has no constant wear coefficient; name a number to fit with --parameter",
    )?;
    let mut parameters = vec![
        json!({"pointer": pointer, "from": start / RANGE, "to": start * RANGE, "spacing": "log"}),
    ];
    if points >= FEWEST && scenario["friction"].is_number() {
        let [from, to] = FRICTION;
        parameters.push(json!({"pointer": "/friction", "from": from, "to": to}));
    }
    Ok(parameters)
}

/// The units in which numbers are printed: the SI unit, the printed unit and its factor.
const UNITS: [(&str, &str, f64); 5] = [
    ("m^3", "mm^3", 1e9),
    ("m", "um", 1e6),
    ("1/Pa", "mm^3/(N m)", 1e9),
    ("m^3/J", "mm^3/J", 1e9),
    ("1", "", 1.0),
];

/// A number for people, and its unit.
fn shown<'a>(number: &Value, unit: &'a str) -> (String, &'a str) {
    let (_, unit, factor) =
        UNITS.into_iter().find(|(si, ..)| *si == unit).unwrap_or((unit, unit, 1.0));
    let Some(number) = number.as_f64() else { return ("-".to_owned(), unit) };
    let scaled = number * factor;
    let is_plain = scaled == 0.0 || (1e-2..1e6).contains(&scaled.abs());
    (if is_plain { format!("{scaled:.4}") } else { format!("{scaled:.3e}") }, unit)
}

/// The estimates, the notes and the predictions in words.
fn told(found: &Value, notes: &[String]) -> Result<String, Error> {
    let mut text = String::new();
    let list = |name: &str| found[name].as_array().into_iter().flatten();
    let details = list("notes").filter_map(|note| note["detail"].as_str());
    for note in notes.iter().map(String::as_str).chain(details) {
        writeln!(text, "{note}")?;
    }
    let percent = found["fit"]["confidence"].as_f64().unwrap_or(0.0) * 100.0;
    writeln!(text, "\n{:<28} {:>11}  interval of {percent} %", "", "estimate")?;
    for parameter in list("parameters").chain(list("combinations")) {
        let name =
            parameter["pointer"].as_str().or(parameter["combination"].as_str()).unwrap_or_default();
        let unit = parameter["unit"].as_str().unwrap_or("1");
        let [low, high] = [0, 1].map(|end| shown(&parameter["interval"][end], unit).0);
        let (estimate, unit) = shown(&parameter["estimate"], unit);
        writeln!(text, "{name:<28} {estimate:>11}  {low} to {high} {unit}")?;
    }
    let table = &found["table"];
    writeln!(
        text,
        "\n{:>12} {:>12} {:>12}  band of {percent} % for a new test",
        table["over"][0].as_str().unwrap_or(""),
        "measured",
        "predicted"
    )?;
    for row in 0..table["x"].as_array().map_or(0, Vec::len) {
        let unit = table["unit"][row].as_str().unwrap_or("1");
        let over = match table["over"][row].as_str() {
            Some("cycles") => "1",
            Some("dissipated_energy") => "J",
            _ => "m",
        };
        let (x, _) = shown(&table["x"][row], over);
        let [measured, predicted, low, high] =
            ["measured", "predicted", "prediction_low", "prediction_high"]
                .map(|name| shown(&table[name][row], unit).0);
        writeln!(
            text,
            "{x:>12} {measured:>12} {predicted:>12}  {low} to {high} {}",
            shown(&Value::Null, unit).1
        )?;
    }
    Ok(text)
}
