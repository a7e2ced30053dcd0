//! The report of a run: its last output cycle, the unworn contact, its events and its figures.

use serde_json::{Value, json};

use super::entry::{Entry, Number};
use super::html::{self, in_unit, percent};
use crate::document::Document;
use crate::error::{Error, Result};
use crate::figure;
use crate::figure::words::{capital, shortened, typeset};
use crate::kind::Part;
use crate::quantity::Quantity;
use crate::view::{FigureOptions, View};
use fretwork_engine::outcome::{self, EVENTS, History};

/// The figures of a report.
const FIGURES: [&str; 4] = ["worn", "wear_volume", "wear_depth", "loops"];
/// The numbers that stand first.
const FIRST: [&str; 2] = ["wear_volume", "wear_depth"];
/// The numbers of the unworn contact and of the limiting state.
const UNWORN: [(&str, &[&str]); 3] = [
    ("scales", &["contact_radius", "indentation_depth", "normal_force"]),
    ("unworn", &["gross_slip_amplitude", "peak_pressure", "amplitude", "tangential_force"]),
    ("limit", &["wear_volume", "wear_depth"]),
];
/// Smaller numerical errors are not told apart.
const SMALLEST: f64 = 1e-4;

/// Fills in what only runs have.
pub fn fill(
    entry: &mut Entry,
    document: &Document<'_>,
    view: &View,
    scenario: &Value,
) -> Result<()> {
    let history = document.table(Part::History, &View::default())?;
    let last = history.cycles().saturating_sub(1);
    let at = |name: &str| history.column(name).map_or(f64::NAN, |column| column.at(last, 0));
    let word = |value: &Value| value.as_str().unwrap_or_default().replace('_', " ");
    let is_exact = scenario["model"]["method"] == "exact";
    let method = if is_exact { "exact method" } else { "simplified rule" };
    let regime = word(&document.value("regime")?);
    entry.title = format!("Fretting wear: {}", word(&scenario["profile"]["shape"]));
    entry.subtitle = format!("{} · {regime} when unworn", capital(method));
    entry.results = format!("Results after {} cycles", shortened(at("cycles"), 6));
    let accuracy = document.value("accuracy")?;
    // The exact method solves the equations of the theory.
    let model = match accuracy["model_error"].as_f64() {
        _ if is_exact => "not included".to_owned(),
        Some(error) => format!("about {}", percent(error)),
        None => "unknown".to_owned(),
    };
    let errors = |name: &str| {
        let numerical = match at(&format!("{name}_error")) {
            error if error > 0.0 && error < SMALLEST => format!("below {}", percent(SMALLEST)),
            error if error > 0.0 => percent(error),
            _ => "–".to_owned(),
        };
        let has_errors = FIRST.contains(&name);
        [numerical, model.clone()].map(|text| if has_errors { text } else { String::new() })
    };
    let unit = |name: &str| typeset(document.head.units.of(name).unwrap_or("1"));
    let own = History::MEMBERS.iter().map(|member| member.name);
    let own =
        own.filter(|name| !name.ends_with("_error") && !FIRST.contains(name) && *name != "cycles");
    for name in FIRST.into_iter().chain(own) {
        let Some(quantity) = outcome::Quantity::named(name) else { continue };
        let value = Some(at(name)).filter(|value| value.is_finite());
        if value.is_some() {
            let words = quantity.words.to_owned();
            entry.numbers.push(Number { words, value, unit: unit(name), errors: errors(name) });
        }
    }
    let mut rows = Vec::new();
    for (section, names) in UNWORN {
        let values = document.value(section)?;
        for name in names {
            let Some(quantity) = outcome::Quantity::named(name) else { continue };
            let words = match section {
                "limit" => format!("{} in the limiting state", quantity.words),
                _ => quantity.words.to_owned(),
            };
            if let Some(value) = values[*name].as_f64() {
                rows.push(vec![words, html::number(Some(value), &unit(name))]);
            }
        }
    }
    for event in document.value("events")?.as_array().into_iter().flatten() {
        let known = EVENTS.iter().find(|(kind, _)| json!(kind) == event["kind"]);
        let cycles = event["cycles"].as_f64().map(|cycles| shortened(cycles.round(), 6));
        if let (Some((_, words)), Some(cycles)) = (known, cycles) {
            rows.push(vec![(*words).to_owned(), in_unit(&cycles, "cycles")]);
        }
    }
    let table = html::table(&["Quantity", "Value"], rows);
    entry.sections = html::section("Unworn contact, limiting state, events", &table);
    for quantity in FIGURES.iter().filter_map(|name| Quantity::named(name)) {
        let options = FigureOptions { quantity, ..view.figure.clone() };
        let view = View { figure: options, ..view.clone() };
        match figure::svg(document, &view) {
            // A run without profiles lacks some figures.
            Err(Error::Missing(_)) => continue,
            svg => entry.figures.push(String::from_utf8_lossy(&svg?).into_owned()),
        }
        entry.curves.push(figure::last_curve(document, &view)?);
    }
    Ok(())
}
