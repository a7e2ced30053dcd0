//! The report of a run: its last output cycle, the unworn contact, its events and its figures.

use serde_json::{Value, json};

use super::entry::{Entry, Number};
use super::html;
use super::inputs::Input;
use super::measured::Measured;
use super::smooth::smooth;
use crate::document::Document;
use crate::error::{Error, Result};
use crate::figure::{self, words};
use crate::kind::Part;
use crate::notation::{cycles, percent, with_unit};
use crate::quantity::Quantity;
use crate::view::{FigureOptions, View};
use fretwork_engine::outcome::{self, EVENTS, History};

/// The figures of a report.
const FIGURES: [&str; 4] = ["worn", "wear_volume", "wear_depth", "loops"];
/// The numbers that stand first.
const FIRST: [&str; 2] = ["wear_volume", "wear_depth"];
/// The numbers of the unworn contact and of the limiting state: section and member.
const UNWORN: [(&str, &str); 11] = [
    ("scales", "contact_radius"),
    ("scales", "indentation_depth"),
    ("scales", "normal_force"),
    ("scales", "cycles"),
    ("unworn", "gross_slip_amplitude"),
    ("unworn", "actuator_gross_slip_amplitude"),
    ("unworn", "peak_pressure"),
    ("unworn", "amplitude"),
    ("unworn", "tangential_force"),
    ("limit", "wear_volume"),
    ("limit", "wear_depth"),
];
/// What the errors do not contain.
const THEORY: &str = "<p>The theory leaves out plasticity, debris and oxidation, and the wear is as uncertain as the wear \
    coefficient.</p>";
/// Smaller numerical errors are not told apart.
const SMALLEST: f64 = 1e-4;
/// Significant digits of a value, and of an error.
const DIGITS: u8 = 3;
const ERROR_DIGITS: u8 = 2;

/// Fills in what only runs have. `si` is the document in SI, and `drawn` the same in the units of figures.
pub fn fill(
    entry: &mut Entry,
    [si, drawn]: [&Document<'_>; 2],
    view: &View,
    scenario: &Value,
    measured: &[Measured],
) -> Result<()> {
    let word = |value: &Value| value.as_str().unwrap_or_default().replace('_', " ");
    let is_exact = scenario["model"]["method"] == "exact";
    let method = if is_exact { "Exact method" } else { "Simplified rule" };
    entry.title = title(&entry.asked, scenario);
    entry.subtitle = format!("{method} · {} when unworn", word(&si.value("regime")?));
    // A line contact has no tangential modulus.
    let is_line = si.value("unworn")?["tangential_modulus"].is_null();
    numbers(entry, si, is_exact, is_line)?;
    contact(entry, si, is_line)?;
    let more = smooth(si, scenario)?;
    let dense = more.as_ref().map(|body| Document::open(body, view)).transpose()?;
    let plain = View::default();
    let history = match &more {
        Some(body) => Document::open(body, &plain)?.table(Part::History, &plain)?,
        None => si.table(Part::History, &plain)?,
    };
    entry.table = measured.iter().map(|own| own.section(&history, entry.notation)).collect();
    for quantity in FIGURES.iter().filter_map(|name| Quantity::named(name)) {
        let options = FigureOptions { quantity, ..view.figure.clone() };
        let view = View { figure: options, ..view.clone() };
        let curve = match figure::last_curve(drawn, dense.as_ref(), &view) {
            // A run without profiles lacks some figures.
            Err(Error::Missing(_)) => continue,
            curve => curve?,
        };
        // A line contact has no loops without a reference.
        if curve.series.iter().any(|series| series.x.iter().any(|x| x.is_finite())) {
            let convert = drawn.head.units.conversion(quantity.name);
            let convert = |y| convert.as_ref().map_or(y, |convert| convert(y));
            let own = measured.iter().filter(|own| own.output == quantity.name);
            let points = own.map(|own| own.series(&history, convert)).collect();
            entry.figures.push(figure::of_run(drawn, dense.as_ref(), &view, points)?);
            entry.curves.push(curve);
        }
    }
    Ok(())
}

/// For example "Paraboloid, R = 10 mm, F = 100 N, U = 2.256 µm, μ = 0.7".
pub fn title(asked: &[Input], scenario: &Value) -> String {
    let part = |input: &Input| {
        let own = ["/profile", "/friction", "/load", "/motion"];
        let symbol = words::symbol(&input.pointer, scenario);
        let is_said = own.iter().any(|own| input.pointer.starts_with(own)) && !symbol.is_empty();
        let words = words::member(&input.pointer, scenario);
        let place = words.strip_prefix("Amplitude").unwrap_or_default();
        is_said.then(|| format!("{symbol}{place} = {}", input.text))
    };
    let shape = asked.iter().find(|input| input.pointer == "/profile/shape");
    let shape = shape.map(|shape| shape.text.clone());
    shape.into_iter().chain(asked.iter().filter_map(part)).collect::<Vec<_>>().join(", ")
}

/// The numbers at the last output cycle.
fn numbers(entry: &mut Entry, si: &Document<'_>, is_exact: bool, is_line: bool) -> Result<()> {
    let history = si.table(Part::History, &View::default())?;
    let last = history.cycles().saturating_sub(1);
    let at = |name: &str| history.column(name).map_or(f64::NAN, |column| column.at(last, 0));
    entry.cycles = at("cycles");
    let accuracy = si.value("accuracy")?;
    let below = |error: f64| match error {
        error if error > 0.0 && error < SMALLEST => {
            format!("below {}", percent(SMALLEST, ERROR_DIGITS))
        }
        error if error > 0.0 => percent(error, ERROR_DIGITS),
        _ => "–".to_owned(),
    };
    // The exact method solves the equations of the theory.
    let model = match accuracy["model_error"].as_f64() {
        _ if is_exact => "not included".to_owned(),
        Some(error) => format!("about {}", percent(error, ERROR_DIGITS)),
        None => "unknown".to_owned(),
    };
    let own = History::MEMBERS.iter().map(|member| member.name);
    let own =
        own.filter(|name| !name.ends_with("_error") && !FIRST.contains(name) && *name != "cycles");
    for quantity in FIRST.into_iter().chain(own).filter_map(outcome::Quantity::named) {
        let name = words::with_symbol(quantity.words_of(is_line), quantity.symbol);
        let mut number = Number::new(name, at(quantity.name), quantity.unit);
        if FIRST.contains(&quantity.name) {
            number.errors = [below(at(&format!("{}_error", quantity.name))), model.clone()];
        }
        entry.numbers.push(number);
    }
    // The energy balance compares the wear volume with the dissipated energy.
    let balance = accuracy["energy_mismatch"].as_f64().map_or(f64::NAN, f64::abs);
    let ratio = at("wear_volume") / at("dissipated_energy");
    let mut number = Number::new("Wear volume per energy V/ΣW".to_owned(), ratio, "m^3/J");
    number.errors[0] = format!("{} (energy balance)", below(balance));
    entry.numbers.push(number);
    entry.numbers.retain(|number| !number.value.is_nan());
    Ok(())
}

/// The numbers of the unworn contact and of the limiting state, and the events.
fn contact(entry: &mut Entry, si: &Document<'_>, is_line: bool) -> Result<()> {
    for (section, name) in UNWORN {
        let values = si.value(section)?;
        // The pressure of a cone is infinite, which JSON does not have.
        let missing = if name == "peak_pressure" { f64::INFINITY } else { f64::NAN };
        let value = values[name].as_f64().unwrap_or(missing);
        let unit = outcome::Quantity::named(name).map_or("1", |quantity| quantity.unit);
        let [words, symbol] = outcome::words_in(section, name, is_line).unwrap_or_default();
        let words = words::with_symbol(&words, &symbol);
        let number = Number { is_unworn: true, ..Number::new(words, value, unit) };
        entry.numbers.extend(Some(number).filter(|number| !number.value.is_nan()));
    }
    let own = entry.numbers.iter().filter(|number| number.is_unworn);
    let row = |own: &Number| vec![own.name.clone(), own.text(entry.notation, own.value, DIGITS)];
    let mut rows: Vec<Vec<String>> = own.map(row).collect();
    for event in si.value("events")?.as_array().into_iter().flatten() {
        let known = EVENTS.iter().find(|(kind, _)| json!(kind) == event["kind"]);
        if let (Some((_, words)), Some(at)) = (known, event["cycles"].as_f64()) {
            rows.push(vec![(*words).to_owned(), with_unit(&cycles(at), "cycles")]);
        }
    }
    let table = html::table(&["Quantity", "Value"], rows);
    entry.sections = html::section("Unworn contact, limiting state, events", &table);
    Ok(())
}

/// The numbers of a run at its last output cycle, as a section.
pub fn results(entry: &Entry) -> String {
    let own = entry.numbers.iter().filter(|number| !number.is_unworn);
    let rows = own.map(|number| {
        let [numerical, model] = number.errors.clone();
        let value = number.text(entry.notation, number.value, DIGITS);
        vec![number.name.clone(), value, numerical, model]
    });
    let table = html::table(&["Quantity", "Value", "Numerical error", "Model error"], rows);
    html::section(&format!("Results after {} cycles", cycles(entry.cycles)), &(table + THEORY))
}
