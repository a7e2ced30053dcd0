//! The report of a study: its counts, notes, findings, statistics, figures and first rows.

use serde_json::Value;

use super::entry::{self, Entry};
use super::html::{self, in_unit};
use crate::document::Document;
use crate::error::Result;
use crate::figure;
use crate::figure::words::{capital, member, shortened, typeset};
use crate::kind::Part;
use crate::statistics;
use crate::table::{Cell, Table, Values};
use crate::units::Units;
use crate::view::View;
use fretwork_plot::{About, Axis, Band, Figure};
use fretwork_study::{Kind, StudyFigure};

/// Maximum number of rows of a table, and of its columns.
const ROWS: usize = 20;
const COLUMNS: usize = 12;
/// Columns with names of the program.
const WORDS: [&str; 4] = ["output", "over", "member", "regime"];
/// The note below a table that may lack rows or columns.
const NOTE: &str = "<p>The first 20 rows and 12 columns. The file of the result has all.</p>";
/// Maximum number of histograms, and the colour of their bars.
const HISTOGRAMS: usize = 8;
const BARS: &str = "#9cc3de";

/// Fills in what only studies have.
pub fn fill(
    entry: &mut Entry,
    document: &Document<'_>,
    view: &View,
    kind: &'static Kind,
) -> Result<()> {
    kind.title.clone_into(&mut entry.title);
    let counts = document.value("counts")?;
    let count = |name: &str| counts[name].as_u64().unwrap_or(0);
    let (points, refused, incomplete) = (count("points"), count("refused"), count("incomplete"));
    entry.subtitle = format!("{points} points, {refused} refused, {incomplete} incomplete");
    entry.warnings.extend(entry::warnings(&[&document.value("notes")?]));
    if let Value::Array(parameters) = document.value("parameters")? {
        entry.sections += &estimates(&parameters, &document.head.units);
    }
    entry.figures = figure::all_of_study(document, kind, view)?;
    let is_drawn = kind.hints(&document.value(kind.name)?).figures.contains(&StudyFigure::Scatter);
    if is_drawn {
        let table = statistics::table(document, Part::Statistics)?;
        entry.sections += &section("Statistics", &table, &Units::default());
        entry.figures.extend(histograms(document, view)?);
    }
    let rows = View { rows: Some(ROWS + 1), ..View::default() };
    let table = document.table(Part::Table, &rows)?;
    entry.table = section("Table", &table, &document.head.units);
    Ok(())
}

/// A histogram of each output.
fn histograms(document: &Document<'_>, view: &View) -> Result<Vec<String>> {
    let table = statistics::table(document, Part::Histogram)?;
    let text = |name: &str, row| match table.column(name).map(|column| column.cell(row, 0)) {
        Some(Cell::Text(text)) => text.to_owned(),
        _ => String::new(),
    };
    let [from, to, points] = ["from", "to", "points"].map(|name| table.axis(name));
    let rows: Vec<usize> = (0..points.len()).collect();
    let histogram = |rows: &[usize]| {
        let (name, unit) = (capital(&member(&text("output", rows[0]))), text("unit", rows[0]));
        let most = rows.iter().map(|row| points[*row]).fold(0.0, f64::max);
        let x = rows.iter().flat_map(|row| [from[*row], to[*row]]).collect();
        let between = rows.iter().flat_map(|row| [(0.0, points[*row]); 2]).collect();
        let description = format!("Number of points over {name}, in {} bins.", rows.len());
        let figure = Figure {
            title: format!("Distribution: {name}"),
            x: Axis::labelled(&in_brackets(&name, &unit)),
            y: Axis { range: Some((0.0, 1.05 * most)), ..Axis::labelled("Points") },
            bands: vec![Band { label: String::new(), color: BARS, x, between }],
            size: (f64::from(view.figure.size.0), f64::from(view.figure.size.1)),
            about: Some(About { description, ..About::default() }),
            ..Figure::default()
        };
        figure.svg()
    };
    let groups = rows.chunk_by(|a, b| text("output", *a) == text("output", *b));
    Ok(groups.take(HISTOGRAMS).map(histogram).collect())
}

/// A name with a unit in brackets.
fn in_brackets(name: &str, unit: &str) -> String {
    if unit == "1" { name.to_owned() } else { format!("{name} ({})", typeset(unit)) }
}

/// The estimates of a fit with their standard errors and intervals.
fn estimates(parameters: &[Value], units: &Units) -> String {
    let row = |parameter: &Value| {
        let pointer = parameter["pointer"].as_str().unwrap_or_default();
        let si = parameter["unit"].as_str().unwrap_or("1");
        let convert = units.conversion(pointer).filter(|_| units.have(pointer));
        let unit = if units.have(pointer) { units.of(pointer).unwrap_or("1") } else { si };
        let number = |value: &Value, digits| {
            let value = value.as_f64()?;
            let value = convert.as_ref().map_or(value, |convert| convert(value));
            Some(shortened(value, digits))
        };
        let or_none = |text: Option<String>| text.unwrap_or_else(|| "unknown".to_owned());
        let estimate =
            number(&parameter["estimate"], 4).map(|value| in_unit(&value, &typeset(unit)));
        let ends = [0, 1].map(|end| number(&parameter["interval"][end], 3));
        let interval = format!("{} to {}", or_none(ends[0].clone()), or_none(ends[1].clone()));
        let only = parameter["for"].as_array().into_iter().flatten().filter_map(Value::as_str);
        let only = only.collect::<Vec<_>>().join(", ");
        let only = if only.is_empty() { only } else { format!(" ({only})") };
        vec![
            capital(&member(pointer)) + &only,
            or_none(estimate),
            or_none(number(&parameter["standard_error"], 2)),
            interval,
        ]
    };
    let head = ["Parameter", "Estimate", "Standard error", "Interval"];
    html::section("Estimates", &html::table(&head, parameters.iter().map(row)))
}

/// The first rows and columns of a table.
fn section(title: &str, table: &Table, units: &Units) -> String {
    let is_used = |(_, values): &&(String, Values)| match values {
        Values::Texts(texts) => texts.iter().any(Option::is_some),
        values => *values != Values::Absent,
    };
    let columns: Vec<_> = table.columns.iter().filter(is_used).take(COLUMNS).collect();
    let head: Vec<String> = columns
        .iter()
        .map(|(name, _)| in_brackets(&capital(&member(name)), units.of(name).unwrap_or("1")))
        .collect();
    let cell = |name: &str, cell: Cell<'_>| match cell {
        Cell::Number(number) if number.is_finite() => shortened(number, 3),
        Cell::Number(_) => "–".to_owned(),
        Cell::Text(text) if name == "unit" => typeset(text),
        Cell::Text(text) if WORDS.contains(&name) => member(text),
        Cell::Text(text) => text.to_owned(),
    };
    let row = |row| columns.iter().map(|(name, values)| cell(name, values.cell(row, 0))).collect();
    let rows = (0..table.cycles().min(ROWS)).map(row);
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let is_cut = table.cycles() > ROWS || table.columns.iter().filter(is_used).count() > COLUMNS;
    let note = if is_cut { NOTE } else { "" };
    html::section(title, &(html::table(&head, rows) + note))
}
