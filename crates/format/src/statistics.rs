//! Statistics of each output of a study over all its points, and their histograms.

use super::{Document, Error, Part, PartTable, Result, Values};
use fretwork_engine::twelve_digits;
use fretwork_job::TaskKind;
use fretwork_study::stats::summary::Summary;

/// The percentiles, with the names of their columns.
const PERCENTILES: [(&str, f64); 11] = [
    ("minimum", 0.0),
    ("percentile_2_5", 0.025),
    ("percentile_5", 0.05),
    ("percentile_10", 0.1),
    ("percentile_25", 0.25),
    ("median", 0.5),
    ("percentile_75", 0.75),
    ("percentile_90", 0.9),
    ("percentile_95", 0.95),
    ("percentile_97_5", 0.975),
    ("maximum", 1.0),
];

/// The percentiles that have an interval, which contains that of the distribution with a confidence of 95 %.
const OUTER: [&str; 4] = ["percentile_2_5", "percentile_5", "percentile_95", "percentile_97_5"];

/// An output: its name, its unit, its values in SI, and how a statistic of them is written.
struct Output {
    name: String,
    unit: String,
    summary: Summary,
    written: Box<dyn Fn(f64) -> f64>,
}

/// The table of [`Part::Statistics`] or [`Part::Histogram`].
pub fn table(document: &Document<'_>, part: Part) -> Result<PartTable> {
    let outputs = outputs(document, part)?;
    let columns = if part == Part::Histogram { histogram(&outputs) } else { statistics(&outputs) };
    Ok(PartTable::of_outputs(part, columns))
}

/// The outputs of a study. A column whose name is a JSON pointer is a number that varies.
fn outputs(document: &Document<'_>, part: Part) -> Result<Vec<Output>> {
    let kind = match document.kind() {
        TaskKind::Study(kind) if kind.rows != "searches" => kind,
        other => {
            let is_run = other == TaskKind::Run;
            let run = "history, profiles and loops, because it is a run";
            let fit = "estimates and figures, because it is a fit";
            return Err(Error::OtherKind(part, if is_run { run } else { fit }));
        }
    };
    let units = &document.head.units;
    let rows = document.rows_in_si(kind)?;
    let named = rows.columns.into_iter().filter_map(|(name, values)| match values {
        Values::Cycles(values) if !name.starts_with('/') => {
            let unit = units.of(&name).unwrap_or("1").to_owned();
            // All conversions are factors, so statistics can be converted like the values.
            let written: Box<dyn Fn(f64) -> f64> = match units.conversion(&name) {
                Some(convert) => Box::new(convert),
                None => Box::new(twelve_digits),
            };
            Some(Output { name, unit, summary: Summary::new(&values), written })
        }
        _ => None,
    });
    Ok(named.collect())
}

/// One row for each output.
fn statistics(outputs: &[Output]) -> Vec<(String, Values)> {
    let texts = |text: fn(&Output) -> &String| {
        Values::Texts(outputs.iter().map(|output| Some(text(output).clone())).collect())
    };
    let numbers = |value: &dyn Fn(&Summary) -> Option<f64>| {
        let values = outputs.iter().map(|output| value(&output.summary).map(&output.written));
        Values::Cycles(values.map(|value| value.unwrap_or(f64::NAN)).collect())
    };
    let points = outputs.iter().map(|output| output.summary.points() as f64);
    let first = [
        ("output", texts(|output| &output.name)),
        ("unit", texts(|output| &output.unit)),
        ("points", Values::Cycles(points.collect())),
        ("mean", numbers(&Summary::mean)),
        ("standard_deviation", numbers(&Summary::standard_deviation)),
    ];
    let percentiles =
        PERCENTILES.map(|(name, share)| (name, numbers(&|summary| summary.percentile(share))));
    let outer = PERCENTILES.into_iter().filter(|(name, _)| OUTER.contains(name));
    let intervals = outer.flat_map(|(name, share)| {
        [("low", 0), ("high", 1)].map(|(side, end)| {
            let ends = numbers(&|summary| Some(summary.percentile_interval(share)?[end]));
            (format!("{name}_{side}"), ends)
        })
    });
    let all = first.into_iter().chain(percentiles);
    all.map(|(name, values)| (name.to_owned(), values)).chain(intervals).collect()
}

/// One row for each bin of each output.
fn histogram(outputs: &[Output]) -> Vec<(String, Values)> {
    let (mut names, mut units) = (Vec::new(), Vec::new());
    let mut numbers = [Vec::new(), Vec::new(), Vec::new()];
    for Output { name, unit, summary, written } in outputs {
        for bin in summary.histogram() {
            names.push(Some(name.clone()));
            units.push(Some(unit.clone()));
            let row = [written(bin.from), written(bin.to), bin.points as f64];
            numbers.iter_mut().zip(row).for_each(|(column, number)| column.push(number));
        }
    }
    let texts = [("output", names), ("unit", units)];
    let texts = texts.map(|(name, cells)| (name.to_owned(), Values::Texts(cells)));
    let numbers = ["from", "to", "points"].into_iter().zip(numbers);
    let numbers = numbers.map(|(name, cells)| (name.to_owned(), Values::Cycles(cells)));
    texts.into_iter().chain(numbers).collect()
}
