//! Figures of a run.
//!
//! Curves of different output cycles differ in marker and colour, so a figure can be read in greyscale
//! and by colour-blind readers. The initial and the limiting state are dashed. An infinite pressure is
//! a gap: the curve rises to the frame on both sides of it.

use serde_json::{Value, json};

use super::axes::{self, LOG_RATIO};
use super::words::distinct;
use crate::{
    Document, Error, Missing, Part, PartTable, QUANTITIES, Quantity, Result, Values, View, digits,
    evenly_spaced, refuse_if_any,
};
use fretwork_engine::EVENTS;
use fretwork_plot::{Axis, Dash, Figure, GREY, Series, Style};

/// Number of output cycles in a figure by default.
const CURVES: usize = 6;
/// The limiting value is drawn if it stretches the vertical axis at most by this factor.
const STRETCH: f64 = 2.0;
/// A pressure counts as having a pole if its peak exceeds its typical height by this factor. The axis then ends at
/// `POLE_ROOM` times the typical height.
const POLE: f64 = 5.0;
const POLE_ROOM: f64 = 2.0;

const INITIAL: Style = Style { color: GREY, dash: Dash::Dashed, width: 1.3, mark: None };
const LIMITING: Style = Style { color: "#000000", dash: Dash::ShortDashed, width: 1.3, mark: None };

/// The note below a figure without points.
const NO_REFERENCE: &str =
    "No values: the displacements of a line contact are known only against a reference.";

/// Draws the requested figure of a run as an SVG document.
pub fn svg(document: &Document<'_>, view: &View) -> Result<String> {
    refuse_study_options(view)?;
    let drawing = Drawing { document, view, quantity: view.figure.quantity };
    let mut figure = drawing.figure()?;
    if view.figure.quantity.name == "pressure" && !figure.y.log {
        figure.y.range = below_poles(&figure.series);
    }
    let mut points = figure.series.iter().flat_map(|series| series.x.iter().zip(&series.y));
    if points.all(|(x, y)| x.is_nan() || y.is_nan()) {
        NO_REFERENCE.clone_into(&mut figure.note);
    }
    figure.about = Some(axes::about(&document.head, drawing.description(&figure)?));
    Ok(figure.svg())
}

/// Refuses options that only figures of studies have.
fn refuse_study_options(view: &View) -> Result<()> {
    let given = view.figure.study.given();
    let missing = |parameter: &'static str| {
        let detail = "applies only to studies, and this result is a run. Use `quantity` and `cycles` instead";
        Missing { parameter, detail: detail.to_owned() }
    };
    refuse_if_any(given.into_iter().map(missing).collect())
}

#[derive(Clone, Copy)]
struct Drawing<'a> {
    document: &'a Document<'a>,
    view: &'a View,
    quantity: &'static Quantity,
}

impl Drawing<'_> {
    /// The figure without its metadata.
    fn figure(&self) -> Result<Figure> {
        // A line contact has no tangential modulus.
        let is_line = self.document.value("unworn")?["tangential_modulus"].is_null();
        let [title, label] = self.quantity.names(is_line);
        let mut figure = match self.quantity.part {
            Part::History => self.history(&label)?,
            Part::Loops => self.loops(&label, is_line)?,
            _ => self.profiles(&label)?,
        };
        axes::choose(&mut figure, &self.view.figure)?;
        figure.title = title;
        Ok(figure)
    }

    /// An axis with a label and the unit of the quantity `name`.
    fn axis(&self, label: &str, name: &str) -> Axis {
        axes::in_unit(label, self.document.head.units.of(name))
    }

    /// The table of the quantity, cut to the selected output cycles.
    fn table(&self) -> Result<PartTable> {
        let selection = View { cycles: self.view.cycles.clone(), ..View::default() };
        let table = self.document.table(self.quantity.part, &selection)?;
        if table.cycles() > 0 {
            return Ok(table);
        }
        Err(self.unavailable("the scenario has \"profiles_at\": \"none\"")?)
    }

    /// Refuses the quantity, and names the columns of the history that the result has.
    fn unavailable(&self, because: &str) -> Result<Error> {
        let history = self.document.table(Part::History, &View::default())?;
        let names = QUANTITIES.iter().map(|quantity| quantity.name);
        let available: Vec<_> = names.filter(|name| history.column(name).is_some()).collect();
        let name = self.quantity.name;
        let available = available.join(", ");
        let detail =
            format!("{name} is not available, because {because}. Request one of {available}");
        Ok(Error::Missing(vec![Missing { parameter: "quantity", detail }]))
    }

    /// One curve per selected output cycle, or per evenly spaced output cycle if none is selected.
    fn curves(
        &self,
        table: &PartTable,
        with_unworn: bool,
        curve: impl Fn(usize) -> (Vec<f64>, Vec<f64>),
    ) -> Vec<Series> {
        let cycles = table.axis("cycles");
        let rows: Vec<usize> = if self.view.cycles.is_some() {
            (0..cycles.len()).collect()
        } else {
            let first = usize::from(!with_unworn && cycles.len() > 1 && cycles[0] == 0.0);
            let rows = evenly_spaced(cycles.len() - first, CURVES).into_iter();
            rows.map(|row| first + row).collect()
        };
        let labels = labels(&rows.iter().map(|row| cycles[*row]).collect::<Vec<f64>>());
        let styled = |(i, (row, label)): (usize, (&usize, String))| {
            let (x, y) = curve(*row);
            Series::new(&label, x, y, Style::marked(i))
        };
        rows.iter().zip(labels).enumerate().map(styled).collect()
    }

    fn profiles(&self, label: &str) -> Result<Figure> {
        let name = self.quantity.name;
        let table = self.table()?;
        let radius = table.axis("radius");
        let reference = |column: &str, label, style| match table.column(column) {
            Some(Values::Points(row)) if name == "worn" => {
                Some(Series::new(label, radius.to_vec(), row.clone(), style))
            }
            _ => None,
        };
        // At cycle 0 the wear is zero, and the worn profile equals the initial one.
        let with_unworn = !matches!(name, "worn" | "wear");
        let values = table.column(name).unwrap_or(&Values::Absent);
        let mut series = self.curves(&table, with_unworn, |row| {
            let at = |point| Some(values.at(row, point)).filter(|value| !value.is_nan());
            let y = (0..radius.len()).map(|point| at(point).unwrap_or(f64::INFINITY));
            (radius.to_vec(), y.collect())
        });
        series.splice(0..0, reference("initial", "Unworn", INITIAL));
        // The limiting profile is drawn last. Otherwise the worn profiles, which approach it, would cover it.
        series.extend(reference("limiting", "Limit", LIMITING));
        let along = if name == "image" { "Coordinate $x$" } else { "Radius $r$" };
        let (x, y) = (self.axis(along, "radius"), self.axis(label, name));
        Ok(Figure { x, y, series, ..Figure::default() })
    }

    fn loops(&self, label: &str, is_line: bool) -> Result<Figure> {
        let table = self.table()?;
        let column = |name: &str, row: usize| match table.column(name) {
            Some(Values::Matrix(rows)) => rows[row].clone(),
            _ => Vec::new(),
        };
        let series = self.curves(&table, true, |row| {
            (column("displacement", row), column("tangential_force", row))
        });
        let place = if is_line { "reference" } else { "contact" };
        let x = self.axis(&format!("Displacement at the {place} $u$"), "displacement");
        let y = self.axis(label, "tangential_force");
        Ok(Figure { x, y, series, ..Figure::default() })
    }

    fn history(&self, label: &str) -> Result<Figure> {
        let table = self.table()?;
        if table.column(self.quantity.name).is_none() {
            let reason = if self.quantity.name.starts_with("actuator_") {
                "the run has no `rig_stiffness`, or an earlier version of the engine computed it"
            } else {
                "an earlier version of the engine computed the result"
            };
            return Err(self.unavailable(reason)?);
        }
        let cycles = table.axis("cycles");
        let columns = self.quantity.columns();
        let mut series = self.history_curves(&table, &columns)?;
        let first = cycles.iter().copied().find(|cycles| *cycles > 0.0);
        let last = cycles.last().copied().unwrap_or(0.0);
        let log = first.is_some_and(|first| last >= LOG_RATIO * first);
        let log = self.view.figure.log_x.unwrap_or(log);
        let start = first.filter(|_| log).unwrap_or(0.0);
        let limit = self.document.value("limit")?;
        for (name, label) in &columns {
            let Some(value) = limit[*name].as_f64() else { continue };
            let label = match label.rsplit_once(' ') {
                Some((_, symbol)) => format!("Limit of {symbol}"),
                None => "Limit".to_owned(),
            };
            if within_reach(value, &series) {
                let second = series.iter().any(|one| one.style == LIMITING);
                let dash = if second { Dash::Dotted } else { LIMITING.dash };
                let style = Style { dash, ..LIMITING };
                series.push(Series::new(&label, vec![start, last], vec![value, value], style));
            }
        }
        let y = self.axis(label, self.quantity.name);
        let marks = self.events(start, last)?;
        let x = Axis { log, marks, ..Axis::labelled("Cycles $N$") };
        Ok(Figure { x, y, series, ..Figure::default() })
    }

    /// The columns over the output cycles, followed by those of the simplified rule if the result has
    /// a comparison.
    fn history_curves(&self, table: &PartTable, columns: &[(&str, &str)]) -> Result<Vec<Series>> {
        let cycles = table.axis("cycles");
        let mut series: Vec<Series> = Vec::new();
        for (name, label) in columns {
            let value = |row| table.column(name).map_or(f64::NAN, |values| values.at(row, 0));
            let y = (0..cycles.len()).map(value).collect();
            series.push(Series::new(label, cycles.to_vec(), y, Style::marked(series.len())));
        }
        let comparison = self.document.value("comparison")?;
        if comparison.is_object() {
            let xi = comparison["xi"].as_f64().unwrap_or(f64::NAN);
            let rule = format!("Simplified rule, ξ = {}", digits(xi, 4));
            let named = |label: &str, method: &str| match label {
                "" => method.to_owned(),
                label => format!("{method}: {label}"),
            };
            let x = numbers(&comparison["history"]["cycles"]);
            for (i, (name, label)) in columns.iter().enumerate() {
                series[i].label = named(label, "Exact method");
                let y = numbers(&comparison["history"][*name]);
                let style = Style { dash: Dash::Dashed, ..Style::marked(series.len()) };
                series.push(Series::new(&named(label, &rule), x.clone(), y, style));
            }
        }
        let scenario = self.document.value("scenario")?;
        // A line would suggest values between two blocks, so only markers are drawn.
        if scenario["motion"]["blocks"].is_array() && self.quantity.jumps_between_blocks() {
            for one in &mut series {
                one.style.width = 0.0;
            }
        }
        Ok(series)
    }

    /// The first event of each kind between two cycles.
    fn events(&self, start: f64, end: f64) -> Result<Vec<(f64, String)>> {
        let events = self.document.value("events")?;
        let mut marks: Vec<(f64, String)> = Vec::new();
        for event in events.as_array().into_iter().flatten() {
            let known = EVENTS.iter().find(|(kind, _)| json!(kind) == event["kind"]);
            let (Some((_, name)), Some(cycle)) = (known, event["cycles"].as_f64()) else {
                continue;
            };
            let visible = (start..=end).contains(&cycle) && cycle > 0.0;
            if visible && marks.iter().all(|mark| mark.1 != *name) {
                marks.push((cycle, (*name).to_owned()));
            }
        }
        Ok(marks)
    }

    /// A description of the figure in words, for screen readers.
    fn description(&self, figure: &Figure) -> Result<String> {
        let scenario = self.document.value("scenario")?;
        let regime = self.document.value("regime")?;
        let word = |value: &Value| match value {
            Value::String(text) => text.replace('_', " "),
            Value::Null => "none".to_owned(),
            other => other.to_string(),
        };
        let mut out = format!(
            "{} against {} of a {} in {} when unworn, friction {}, by the {} method, computed by {}.",
            figure.y.label,
            figure.x.label,
            word(&scenario["profile"]["shape"]),
            word(&regime),
            word(&scenario["friction"]),
            word(&scenario["model"]["method"]),
            self.document.head.engine,
        );
        out.push_str(&axes::curves_in_words(figure, ", "));
        Ok(out.replace('$', ""))
    }
}

/// The numbers of a list; NaN for null.
pub fn numbers(column: &Value) -> Vec<f64> {
    column.as_array().into_iter().flatten().map(|cell| cell.as_f64().unwrap_or(f64::NAN)).collect()
}

/// Whether a value can be drawn beside curves without flattening them.
fn within_reach(value: f64, series: &[Series]) -> bool {
    let values = series.iter().flat_map(|series| &series.y).copied().filter(|y| y.is_finite());
    let whole = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = values.fold(whole, |(low, high), y| (low.min(y), high.max(y)));
    high.max(value) - low.min(value) <= STRETCH * (high - low).max(0.05 * high.abs())
}

/// The range of the vertical axis of pressures with poles, so that the pressure between the poles
/// stays visible. `None` without poles. Late in a run, a pole can be a very large finite number.
fn below_poles(series: &[Series]) -> Option<(f64, f64)> {
    let typical = series.iter().map(typical_height).fold(0.0, f64::max);
    let top = series.iter().flat_map(|series| &series.y).copied().fold(0.0, f64::max);
    (typical > 0.0 && top > POLE * typical).then_some((0.0, POLE_ROOM * typical))
}

/// The height that a curve exceeds on 5 % of the interval where it is positive and finite.
fn typical_height(series: &Series) -> f64 {
    let steps = series.x.windows(2).zip(series.y.windows(2));
    let mut steps: Vec<(f64, f64)> = steps
        .map(|(x, y)| (y[0].max(y[1]), x[1] - x[0]))
        .filter(|(height, _)| height.is_finite() && *height > 0.0)
        .collect();
    steps.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut left = 0.05 * steps.iter().map(|(_, width)| width).sum::<f64>();
    for (height, width) in steps {
        left -= width;
        if left < 0.0 {
            return height;
        }
    }
    0.0
}

/// Labels of output cycles, with 6 digits if these suffice to distinguish them.
fn labels(cycles: &[f64]) -> Vec<String> {
    distinct(cycles, [6, 17], |cycles, count| match cycles {
        0.0 => "Unworn".to_owned(),
        cycles => format!("$N$ = {}", digits(cycles, count)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_output_cycles_are_short_and_distinct() {
        assert_eq!(
            labels(&[0.0, 1000.0, 177.827_941_004]),
            ["Unworn", "$N$ = 1000", "$N$ = 177.828"]
        );
        assert_eq!(labels(&[2.5e7, 1e9, 5e-5]), ["$N$ = 2.5×10⁷", "$N$ = 1×10⁹", "$N$ = 5×10⁻⁵"]);
        assert_eq!(labels(&[1000.001, 1000.002]), ["$N$ = 1000.001", "$N$ = 1000.002"]);
    }

    #[test]
    fn an_extreme_pressure_peak_is_excluded_from_the_axis_range() {
        let x: Vec<f64> = (0..=100).map(f64::from).collect();
        let with = |peak: f64| {
            let y = x.iter().map(|x| if (x - 50.0).abs() < 0.5 { peak } else { 2.0 }).collect();
            below_poles(&[Series::new("", x.clone(), y, LIMITING)])
        };
        assert_eq!(with(f64::INFINITY), Some((0.0, 4.0)));
        assert_eq!(with(1e9), Some((0.0, 4.0)));
        assert_eq!(with(9.0), None);
        assert_eq!(below_poles(&[Series::new("", x.clone(), vec![0.0; 101], LIMITING)]), None);
    }
}
