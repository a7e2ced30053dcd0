//! Figures of a fit: measured numbers with bands, residuals, wear volumes over energies, profiles of the sum of squares.

use serde_json::Value;

use super::axes;
use super::words::capital;
use crate::units::in_engineering;
use crate::{Document, Error, Missing, Notation, Result};
use fretwork_plot::{Axis, Band, Figure, GREY, Mark, Series, Style};
use fretwork_study::StudyFigure;

/// The colour of the bands.
const BAND: &str = "#e8eef4";

/// A table of the document.
struct TableOfFit(Value);

impl TableOfFit {
    fn texts(&self, name: &str) -> impl Iterator<Item = &str> {
        self.0[name].as_array().into_iter().flatten().map(|cell| cell.as_str().unwrap_or_default())
    }

    /// The numbers of some columns in the rows where a column of texts has a value, in ascending order.
    fn rows<const N: usize>(&self, (of, value): (&str, &str), names: [&str; N]) -> Vec<[f64; N]> {
        let own = self.texts(of).enumerate().filter(|(_, text)| *text == value);
        let cell = |row: usize, name: &str| self.0[name][row].as_f64().unwrap_or(f64::NAN);
        let mut rows: Vec<_> = own.map(|(row, _)| names.map(|name| cell(row, name))).collect();
        rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
        rows
    }
}

/// The outputs that were measured; none if the document is not that of a fit.
pub fn outputs(document: &Document<'_>) -> Result<Vec<String>> {
    let table = TableOfFit(document.value("table")?);
    let mut outputs: Vec<String> = table.texts("output").map(str::to_owned).collect();
    outputs.sort();
    outputs.dedup();
    Ok(outputs)
}

/// A figure of the measured numbers of an output.
pub fn measured(
    document: &Document<'_>,
    kind: StudyFigure,
    output: &str,
    engineering: bool,
) -> Result<Figure> {
    let is_energy = kind == StudyFigure::Energy;
    let [table, bands] = ["table", "bands"].map(|name| document.value(name));
    // The column `own` has the tests of the rows that are drawn.
    let [table, bands] = [table?, bands?].map(|mut table| {
        let is_own = |row: &usize| {
            let is_over_energy = table["over"][*row] == "dissipated_energy";
            table["output"][*row] == output && (is_over_energy || !is_energy)
        };
        let rows = 0..table["x"].as_array().map_or(0, Vec::len);
        let test = |row| if is_own(&row) { table["test"][row].clone() } else { Value::Null };
        table["own"] = rows.map(test).collect();
        TableOfFit(table)
    });
    let first = table.texts("own").position(|own| !own.is_empty());
    let Some(first) = first else {
        let detail = "energy needs an output that is measured over `dissipated_energy`".to_owned();
        return Err(Error::Missing(vec![Missing { parameter: "kind", detail }]));
    };
    let text =
        |name: &str| capital(&table.0[name][first].as_str().unwrap_or_default().replace('_', " "));
    let mut tests: Vec<&str> = table.texts("own").filter(|test| !test.is_empty()).collect();
    tests.dedup();
    let mut figure = Figure { title: text("output"), ..Figure::default() };
    let unit = table.0["unit"][first].as_str().unwrap_or_default();
    let mut of_x = [("radius", "m"), ("dissipated_energy", "J")].into_iter();
    let of_x = of_x.find(|(over, _)| table.0["over"][first] == *over).map(|(_, unit)| unit);
    let shown = |si| if engineering { in_engineering(1.0, si) } else { (1.0, si) };
    let (across, (up, unit)) = (of_x.map(shown), shown(unit));
    figure.x = axes::in_unit(&text("over"), across.map(|(_, unit)| unit));
    figure.y = axes::in_unit(&text("output"), Some(unit));
    if kind == StudyFigure::Residuals {
        figure.y = Axis::labelled("Residual (standard deviations)");
        figure.title = format!("Residuals: {}", figure.title.to_lowercase());
    }
    for (place, test) in tests.into_iter().enumerate() {
        let points = Style { width: 0.0, ..Style::marked(place) };
        let column = if kind == StudyFigure::Residuals { "residual" } else { "measured" };
        let rows = table.rows(("own", test), ["x", column, "deviation"]);
        let x = |rows: &[[f64; 3]]| rows.iter().map(|row| row[0]).collect::<Vec<_>>();
        let y = rows.iter().map(|row| row[1]).collect();
        figure.series.push(Series::new(test, x(&rows), y, points));
        if kind == StudyFigure::Residuals {
            continue;
        }
        let bars = rows.iter().map(|[x, y, s]| ([*x; 3], [y - s, y + s, f64::NAN]));
        let (x, y): (Vec<_>, Vec<_>) = bars.unzip();
        let line = Style { mark: None, width: 0.8, ..points };
        figure.series.push(Series::new("", x.concat(), y.concat(), line));
        let rows =
            bands.rows(("own", test), ["x", "predicted", "prediction_low", "prediction_high"]);
        let (x, curve): (Vec<_>, Vec<_>) = rows.iter().map(|row| (row[0], row[1])).unzip();
        let between = rows.iter().map(|row| (row[2], row[3])).collect();
        figure.series.push(Series::new("", x.clone(), curve, line));
        figure.bands.push(Band { label: String::new(), color: BAND, x, between });
    }
    if is_energy {
        let lines = document.value("lines")?;
        let slope = lines[0]["energy_coefficient"].as_f64().unwrap_or(f64::NAN);
        let end = figure.series.iter().flat_map(|series| &series.x).fold(0.0_f64, |a, b| a.max(*b));
        let label = format!(
            "$V$ = {}·$E$, $R$² = {:.4}",
            Notation { is_si: !engineering }.quantity(slope, "m^3/J", 4),
            lines[0]["r_squared"].as_f64().unwrap_or(f64::NAN)
        );
        let style = Style::numbered(figure.series.len());
        figure.series.push(Series::new(&label, vec![0.0, end], vec![0.0, slope * end], style));
    }
    let across = across.map_or(1.0, |(factor, _)| factor);
    let up = if kind == StudyFigure::Residuals { 1.0 } else { up };
    for series in &mut figure.series {
        series.x.iter_mut().for_each(|x| *x *= across);
        series.y.iter_mut().for_each(|y| *y *= up);
    }
    for band in &mut figure.bands {
        band.x.iter_mut().for_each(|x| *x *= across);
        band.between.iter_mut().for_each(|(low, high)| (*low, *high) = (*low * up, *high * up));
    }
    Ok(figure)
}

/// The sum of squares over a parameter, whose column in the searches has this name. It needs the axis of the parameter.
pub fn profile(document: &Document<'_>, parameter: &str, x: Axis) -> Result<Figure> {
    let searches = TableOfFit(document.value("searches")?);
    let names = [parameter, "sum_of_squares"];
    let mut rows = searches.rows(("task", &format!("profile {parameter}")), names);
    rows.extend(searches.rows(("task", "minimum"), names));
    rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let quality = document.value("quality")?;
    let number = |name: &str| quality[name].as_f64().unwrap_or(f64::NAN);
    let allowed = number("sum_of_squares") + number("allowed_rise");
    let (values, y): (Vec<f64>, Vec<f64>) = rows.iter().map(|row| (row[0], row[1])).unzip();
    let ends = [values.first().copied().unwrap_or(0.0), values.last().copied().unwrap_or(1.0)];
    let style = Style { color: GREY, ..Style::numbered(1) };
    let end = Series::new("end of the interval", ends.to_vec(), vec![allowed; 2], style);
    let points = Style { mark: Some(Mark::Disc), ..Style::numbered(0) };
    Ok(Figure {
        title: "Sum of squares".to_owned(),
        x,
        y: Axis::labelled("Least sum of squares"),
        series: vec![end, Series::new("", values, y, points)],
        ..Figure::default()
    })
}
