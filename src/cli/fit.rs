//! The command `fit`: fits numbers of a scenario to a file of measured numbers, without a server.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Value, json};

use super::printing::{Ended, Error, print, shown};
use super::run::{compute, read, read_json};
use crate::config::Fit;
use fretwork_engine::input::quantity::parse;
use fretwork_engine::{Dimension, Faults};
use fretwork_format::{Verdict, is_in_verdict};
use fretwork_job::Submission;
use fretwork_json::BadBody;
use fretwork_measured::{Prepare, Wanted};

/// The factor from the wear coefficient of the scenario to the ends of its range.
const RANGE: f64 = 1e4;
/// The options that are members of the data.
const OPTIONS: [&str; 4] = ["sigma", "relative", "at", "density"];
/// Minimum number of points for a wear coefficient and a friction.
const FEWEST: usize = 3;

/// Fits, and prints the estimates. The exit code is 2 if the file, the scenario or the fit has faults, and 1 if the fit finds no
/// minimum.
pub fn fit(settings: &Fit) -> Result<(), Error> {
    let Fit { x, y, table, decimal, sigma, relative, at, density, up, scar, .. } = settings;
    let prepare = if at.is_some() { Prepare::Trace } else { Prepare::Points };
    let wanted = Wanted {
        x: x.as_deref(),
        y: y.as_deref(),
        table: *table,
        decimal: *decimal,
        up: up.copied(),
        scar: *scar,
        ..Wanted::of(prepare)
    };
    let refused = |faults: Faults| Ended::by_faults(&faults.0, &settings.file);
    let measured = fretwork_measured::read(&read(&settings.file)?, &wanted);
    let mut measured = measured.map_err(refused)?;
    let mut data = measured.prepared["data"].take();
    if data.is_null() {
        return Err(refused(Faults::one("", measured.notes.join(" "))).into());
    }
    let given = [json!(sigma), json!(relative), json!(at), json!(density)];
    let given = OPTIONS.into_iter().zip(given);
    for (name, given) in given.filter(|(_, given)| !given.is_null()) {
        data[name] = given;
    }
    let has_sigma = !settings.lognormal && data.get("sigma").is_some();
    let is_estimated = relative.is_none() && !has_sigma;
    if let Some(members) = data.as_object_mut().filter(|_| settings.lognormal || is_estimated) {
        members.shift_remove("sigma");
        let mut noise = json!({"kind": if settings.lognormal { "lognormal" } else { "normal" }});
        if let Some(share) = members.shift_remove("relative") {
            noise["relative"] = share;
        }
        members.insert("noise".to_owned(), noise);
    }
    if is_estimated {
        let note = "The noise is proportional to the numbers, and estimated from the residuals.";
        measured.notes.push(note.to_owned());
    }
    let named = |error: Error| format!("{}: {error}", settings.scenario.display());
    let job = serde_json::from_slice(&read_json(&settings.scenario)?);
    let mut job: Value = job.map_err(|error| named(error.into()))?;
    let scenario = job.get_mut("scenario").map(Value::take).unwrap_or(job);
    let points =
        data["y"].as_array().map_or(FEWEST, |y| y.iter().filter_map(Value::as_f64).count());
    let mut parameters: Vec<Value> = settings.parameter.iter().map(asked).collect();
    if parameters.is_empty() {
        parameters = defaults(&scenario, points).map_err(named)?;
    }
    let body = |parameters: &[Value]| {
        let tests = json!([{"data": [data]}]);
        let fit = json!({"scenario": scenario, "parameters": parameters, "tests": tests});
        format!("{:#}\n", json!({"fit": fit}))
    };
    if settings.print {
        return print(body(&parameters).as_bytes());
    }
    let mut found = fitted(&body(&parameters), settings)?;
    let ends = found.0["parameters"][1]["interval"].as_array();
    if settings.parameter.is_empty() && ends.is_some_and(|ends| ends.contains(&Value::Null)) {
        let less = fitted(&body(&parameters[..1]), settings)?;
        if !is_worse(&less.0, &found.0) {
            found = less;
            let note = "These data do not tell the friction. It stays as in the scenario.";
            measured.notes.push(note.to_owned());
        }
    }
    print(told(&found, &measured.notes)?.as_bytes())?;
    Ended::with(u8::from(found.0["quality"].is_null()))
}

/// A result, and its verdict.
type FittedResult = (Value, Option<Verdict>);

/// The result of a job. A fault of the job names its option or its file.
fn fitted(body: &str, settings: &Fit) -> Result<FittedResult, Error> {
    let mut faults = match Submission::parse(body.as_bytes()) {
        Ok(job) => {
            let result = compute(&job.prepared, true)?.0.body;
            return Ok((serde_json::from_slice(&result)?, Verdict::read(&result)?));
        }
        Err(BadBody::Faults(faults)) => faults,
        Err(error) => return Err(error.into()),
    };
    for fault in &mut faults {
        let member = fault.pointer.strip_prefix("/fit/tests/0/data/0").unwrap_or("");
        let option =
            OPTIONS.into_iter().find(|option| member.split('/').any(|part| part == *option));
        let scenario = fault.pointer.strip_prefix("/fit/scenario");
        fault.pointer = match (option, scenario) {
            (Some(option), _) => format!("--{option}"),
            (_, Some(place)) => format!("{}: {place}", settings.scenario.display()),
            _ if member.is_empty() => continue,
            _ => format!("{}: {member}", settings.file.display()),
        };
    }
    faults.dedup_by(|one, other| one.pointer == other.pointer);
    Err(Ended::by_faults(&faults, Path::new("-")).into())
}

/// Whether a fit with fewer parameters is worse than another one by more than its noise allows.
fn is_worse(less: &Value, other: &Value) -> bool {
    let number = |fit: &Value, place| fit["quality"].pointer(place).and_then(Value::as_f64);
    // The sums of squares are in units of the noise, which a fit can estimate.
    let noise = |fit| number(fit, "/noise/0/factor").map_or(1.0, |factor| factor * factor);
    let sum = |fit| number(fit, "/sum_of_squares").map_or(f64::INFINITY, |sum| sum * noise(fit));
    let rise = number(other, "/allowed_rise").map_or(0.0, |rise| rise * noise(other));
    sum(less) - sum(other) > rise
}

/// A parameter that the user names.
fn asked((pointer, low, high): &(String, String, String)) -> Value {
    let read = |text: &String| text.parse().map_or_else(|_| json!(text), |it: f64| json!(it));
    let spacing = if pointer.starts_with("/wear/") { "log" } else { "linear" };
    json!({"pointer": pointer, "from": read(low), "to": read(high), "spacing": spacing})
}

/// The wear coefficient, and the friction if there are enough points.
fn defaults(scenario: &Value, points: usize) -> Result<Vec<Value>, Error> {
    let wear = [Dimension::WearCoefficient, Dimension::EnergyWear];
    let mut wear = ["coefficient", "energy_coefficient"].into_iter().zip(wear);
    let found = wear.find_map(|(name, dimension)| {
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

/// The notes, the verdict, the estimates and the predictions in words.
fn told((found, verdict): &FittedResult, notes: &[String]) -> Result<String, Error> {
    let mut text = String::new();
    let list = |name: &str| found[name].as_array().into_iter().flatten();
    let details = list("notes").filter(|note| !is_in_verdict(note));
    let details = details.filter_map(|note| note["detail"].as_str());
    for note in notes.iter().map(String::as_str).chain(details) {
        writeln!(text, "{note}")?;
    }
    if let Some(Verdict { verdict, reason, .. }) = verdict {
        writeln!(text, "\n{verdict}\n{reason}")?;
    }
    if found["quality"].is_null() {
        return Ok(text);
    }
    let percent = 100.0 * found["fit"]["confidence"].as_f64().unwrap_or(0.0);
    let assumption = verdict.as_ref().and_then(|verdict| verdict.intervals);
    let assumption = assumption.map_or(String::new(), |it| format!(" {it}"));
    writeln!(text, "\nEstimates, with intervals of {percent} %:{assumption}")?;
    for it in list("parameters") {
        let name = it["pointer"].as_str().unwrap_or("");
        let unit = it["unit"].as_str().unwrap_or("1");
        let end = |x: &Value| if x.is_null() { "open".to_owned() } else { shown(x, unit) };
        let [low, high] = [0, 1].map(|place| end(&it["interval"][place]));
        writeln!(text, "  {name}: {} ({low} to {high})", shown(&it["estimate"], unit))?;
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
