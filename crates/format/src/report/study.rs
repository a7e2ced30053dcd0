//! The report of a study: its counts, notes, findings, statistics, figures and first rows.

use serde_json::Value;

use super::entry::{self, Entry};
use super::{html, run};
use crate::document::Document;
use crate::error::Result;
use crate::figure;
use crate::figure::in_unit;
use crate::figure::words::{capital, member, output, whole};
use crate::kind::Part;
use crate::law::{self, Verdict};
use crate::notation::{Notation, cycles};
use crate::statistics;
use crate::table::{Cell, Table, Values};
use crate::units::Units;
use crate::view::View;
use fretwork_plot::{About, Axis, Band, Figure};
use fretwork_study::{Kind, StudyFigure};

/// Maximum number of rows of a table, and of its columns.
const ROWS: usize = 20;
const COLUMNS: usize = 12;
/// Columns whose words stand in the cells of other columns.
const LEFT_OUT: [&str; 2] = ["unit", "over"];
/// The note below a table that may lack rows or columns.
const NOTE: &str = "<p>The first 20 rows and 12 columns. The file of the result has all.</p>";
/// Maximum number of histograms, and the colour of their bars.
const HISTOGRAMS: usize = 8;
const BARS: &str = "#9cc3de";

/// Fills in what only studies have. `si` is the document in SI, and `drawn` the same in the units of figures.
pub fn fill(
    entry: &mut Entry,
    [si, drawn]: [&Document<'_>; 2],
    view: &View,
    kind: &'static Kind,
) -> Result<()> {
    kind.title.clone_into(&mut entry.title);
    let counts = si.value("counts")?;
    let count = |name: &str| cycles(counts[name].as_u64().unwrap_or(0) as f64);
    let [points, refused, incomplete] = ["points", "refused", "incomplete"].map(count);
    let asked = si.value(kind.name)?;
    let scenario = &asked["scenario"];
    let of = run::title(&entry.asked, scenario);
    entry.subtitle = format!("{of} · {points} points, {refused} refused, {incomplete} incomplete");
    let mut notes = si.value("notes")?;
    if let Some(verdict) = Verdict::of(si)? {
        // The verdict has these notes.
        if let Some(notes) = notes.as_array_mut() {
            notes.retain(|note| !law::is_in_verdict(note));
        }
        let parameters = si.value("parameters")?;
        let parameters = parameters.as_array().map_or(&[][..], Vec::as_slice);
        entry.sections += &estimates(parameters, scenario, entry.notation, &verdict);
    }
    entry.warnings.extend(entry::warnings(&[&notes]));
    entry.figures = figure::all_of_study(drawn, kind, view)?;
    let written = Written { scenario, units: &si.head.units, notation: entry.notation };
    if kind.hints(&asked).figures.contains(&StudyFigure::Scatter) {
        let table = statistics::table(si, Part::Statistics)?;
        entry.sections += &written.section("Statistics", &table);
        entry.figures.extend(histograms(drawn, view, scenario)?);
    }
    let rows = View { rows: Some(ROWS + 1), ..View::default() };
    entry.table = written.section("Table", &si.table(Part::Table, &rows)?);
    Ok(())
}

/// A histogram of each output.
fn histograms(document: &Document<'_>, view: &View, scenario: &Value) -> Result<Vec<String>> {
    let table = statistics::table(document, Part::Histogram)?;
    let [from, to, points] = ["from", "to", "points"].map(|name| table.axis(name));
    let rows: Vec<usize> = (0..points.len()).collect();
    let histogram = |rows: &[usize]| {
        let name = heading(table.text("output", rows[0]), scenario);
        let unit = table.text("unit", rows[0]);
        let most = rows.iter().map(|row| points[*row]).fold(0.0, f64::max);
        let x = rows.iter().flat_map(|row| [from[*row], to[*row]]).collect();
        let between = rows.iter().flat_map(|row| [(0.0, points[*row]); 2]).collect();
        let description = format!("Number of points over {name}, in {} bins.", rows.len());
        let figure = Figure {
            title: format!("Distribution: {name}"),
            x: in_unit(&name, Some(unit).filter(|unit| *unit != "1")),
            y: Axis { range: Some((0.0, 1.05 * most)), ..Axis::labelled("Points") },
            bands: vec![Band { label: String::new(), color: BARS, x, between }],
            size: (f64::from(view.figure.size.0), f64::from(view.figure.size.1)),
            about: Some(About { description, ..About::default() }),
            ..Figure::default()
        };
        figure.svg()
    };
    let groups = rows.chunk_by(|a, b| table.text("output", *a) == table.text("output", *b));
    Ok(groups.take(HISTOGRAMS).map(histogram).collect())
}

/// The estimates of a fit with their standard errors and intervals.
fn estimates(parameters: &[Value], scenario: &Value, notation: Notation, law: &Verdict) -> String {
    let row = |parameter: &Value| {
        let pointer = parameter["pointer"].as_str().unwrap_or_default();
        let unit = parameter["unit"].as_str().unwrap_or("1");
        let number = |value: &Value, count| {
            let number = value.as_f64().map(|value| notation.quantity(value, unit, count));
            number.unwrap_or_else(|| "unknown".to_owned())
        };
        let ends = [0, 1].map(|end| parameter["interval"][end].as_f64().unwrap_or(f64::NAN));
        let only = parameter["for"].as_array().into_iter().flatten().filter_map(Value::as_str);
        let only = only.collect::<Vec<_>>().join(", ");
        let only = if only.is_empty() { only } else { format!(" ({only})") };
        vec![
            whole(pointer, scenario) + &only,
            number(&parameter["estimate"], 4),
            number(&parameter["standard_error"], 2),
            notation.range(&ends, unit, 3),
        ]
    };
    let head = ["Parameter", "Estimate", "Standard error", "Interval"];
    let table = html::table(&head, parameters.iter().map(row));
    let said = [&*law.verdict, &*law.reason, law.intervals.unwrap_or_default()];
    html::section("Estimates", &format!("{table}<p>{}</p>", html::text(&said.join(" "))))
}

/// How tables of a study are written.
struct Written<'a> {
    scenario: &'a Value,
    units: &'a Units,
    notation: Notation,
}

impl Written<'_> {
    /// The first rows and columns of a table. Both ends of an interval are one column.
    fn section(&self, title: &str, table: &Table) -> String {
        let is_used = |(name, values): &&(String, Values)| match values {
            Values::Texts(texts) => {
                !LEFT_OUT.contains(&&**name) && texts.iter().any(Option::is_some)
            }
            values => *values != Values::Absent,
        };
        let used: Vec<_> = table.columns.iter().filter(is_used).collect();
        let columns: Vec<_> = used.chunk_by(|(a, _), (b, _)| is_interval(a, b)).collect();
        let rows = table.cycles().min(ROWS);
        let written = columns.iter().take(COLUMNS).map(|column| self.column(table, column, rows));
        let written: Vec<Vec<String>> = written.collect();
        let head: Vec<&str> = written.iter().map(|column| column[0].as_str()).collect();
        let row = |row: usize| written.iter().map(|column| column[row + 1].clone()).collect();
        let is_cut = table.cycles() > ROWS || columns.len() > COLUMNS;
        let note = if is_cut { NOTE } else { "" };
        html::section(title, &(html::table(&head, (0..rows).map(row)) + note))
    }

    /// The heading of a column, and its cells. Some tables state the unit of each row.
    fn column(&self, table: &Table, column: &[&(String, Values)], rows: usize) -> Vec<String> {
        let name = column[0].0.as_str();
        let si = self.units.of(name).unwrap_or("1");
        let is_stated = name == "x" || si == "SI" || !self.units.have(name) && name != "points";
        let is_stated = is_stated && table.column("unit").is_some();
        // The numbers of a fit are at the cycles in the column `x`.
        let is_fit = table.column("x").is_some();
        let cell = |row| {
            let unit = if is_stated { stated_unit(table, name, row) } else { si };
            let count = if name == "x" { 6 } else { 3 };
            let ends: Vec<_> = column.iter().map(|(_, values)| values.cell(row, 0)).collect();
            let numbers: Vec<_> = ends
                .iter()
                .filter_map(|end| if let Cell::Number(end) = end { Some(*end) } else { None })
                .collect();
            match ends[..] {
                [Cell::Text(text)] if is_fit && name == "output" => output(text, self.scenario).0,
                [Cell::Text(text)] => self.text(name, text),
                _ => self.notation.range(&numbers, unit, count),
            }
        };
        let heading = match name.strip_suffix("_low") {
            Some(stem) if column.len() > 1 => format!("{} interval", heading(stem, self.scenario)),
            _ if name == "x" => "Measured at".to_owned(),
            _ if name == "deviation" => "Error of the measurement".to_owned(),
            _ if name == "regime" => "Regime, unworn".to_owned(),
            _ => heading(name, self.scenario),
        };
        [heading].into_iter().chain((0..rows).map(cell)).collect()
    }

    fn text(&self, name: &str, text: &str) -> String {
        match name {
            "member" => member(text, self.scenario),
            "output" => heading(text, self.scenario),
            "regime" => capital(&text.replace('_', " ")),
            _ => text.to_owned(),
        }
    }
}

/// Whether two columns are the ends of an interval.
fn is_interval(low: &str, high: &str) -> bool {
    low.strip_suffix("_low").is_some_and(|stem| high.strip_suffix("_high") == Some(stem))
}

/// The name of a column: a number that varies, an output, or another column.
fn heading(name: &str, scenario: &Value) -> String {
    if name.starts_with('/') {
        return whole(name, scenario);
    }
    let (quantity, rest) = output(name, scenario);
    quantity + &rest
}

/// The unit that a row states for a column.
fn stated_unit<'t>(table: &'t Table, name: &str, row: usize) -> &'t str {
    match (name, table.text("over", row)) {
        ("x", "radius") => "m",
        ("x", "dissipated_energy") => "J",
        ("x", over) => over,
        _ => table.text("unit", row),
    }
}
