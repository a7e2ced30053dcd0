//! Tornado charts: a group of bars for each number that varies, the largest on top.

use serde_json::Value;

use super::axes;
use super::words::member;
use crate::{PartTable, Units};
use fretwork_plot::{Bar, BarChart, Group};
use fretwork_study::Bars;

/// Minimum height of a group of bars, and the height of the title, the axis and the margins together, in px.
const GROUP: f64 = 15.0;
const AROUND: f64 = 95.0;

/// The chart of an output.
pub fn chart(
    table: &PartTable,
    output: &str,
    bars: &Bars,
    units: &Units,
    scenario: &Value,
) -> BarChart {
    let Bars { label, columns, have_unit } = *bars;
    let axis = axes::in_unit(label, units.of(output).filter(|_| have_unit));
    let convert = units.conversion(output).filter(|_| have_unit);
    let number = |name: &str, row: usize| {
        let value = table.axis(name).get(row).copied()?;
        Some(convert.as_ref().map_or(value, |convert| convert(value)))
    };
    let bar = |name: &str, row: usize| {
        let end = |end: &str| number(&format!("{name}_{end}"), row).filter(|end| end.is_finite());
        Bar { value: number(name, row).unwrap_or(f64::NAN), interval: end("low").zip(end("high")) }
    };
    let rows = (0..table.cycles()).filter(|row| table.text("output", *row) == output);
    let mut groups: Vec<Group> = rows
        .map(|row| Group {
            label: member(table.text("member", row), scenario),
            bars: columns.iter().map(|(name, _)| bar(name, row)).collect(),
        })
        .collect();
    let size = |group: &Group| group.bars.first().map_or(0.0, |bar| bar.value.abs().max(0.0));
    groups.sort_by(|a, b| size(b).total_cmp(&size(a)));
    let names = columns.iter().map(|(_, name)| (*name).to_owned()).collect();
    let (title, size) = (String::new(), (0.0, 0.0));
    BarChart { title, axis, names, groups, size, about: None }
}

/// Keeps as many of the largest groups as fit into the height. Returns a note if some are left out.
pub fn keep_what_fits(chart: &mut BarChart) -> String {
    let (most, all) = (((chart.size.1 - AROUND) / GROUP).max(1.0) as usize, chart.groups.len());
    chart.groups.truncate(most);
    if all <= most { String::new() } else { format!(" These are the largest {most} of {all}.") }
}
