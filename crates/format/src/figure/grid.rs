//! Figures over the values of a grid: families of curves, heat maps, and the regions of a plane.

use serde_json::Value;

use super::axes::{distinct, spans_decades};
use super::choice::{Choice, MAX_CURVES, Offer};
use super::words::{member, short, values_of};
use crate::{PartTable, Units, evenly_spaced};
use fretwork_plot::{Axis, Band, Dash, Field, Series, Style};

/// Maximum number of points of a curve, and of columns and rows of a heat map. More would be smaller than a pixel.
const MAX_POINTS: usize = 1000;
const MAX_CELLS: usize = 128;
/// The colours below and above a boundary, which also differ in greyscale.
const BELOW: &str = "#dcebf7";
const ABOVE: &str = "#f2bf8c";
const BOUNDARY: Style = Style { color: "#000000", dash: Dash::Dashed, width: 1.8, mark: None };
const LATER: Style = Style { color: "#000000", dash: Dash::Solid, width: 1.2, mark: None };
const HALO: Style = Style { color: "#ffffff", dash: Dash::Solid, width: 3.4, mark: None };

/// The table of a study.
pub struct StudyTable<'a> {
    /// Its members and its outputs.
    pub offer: Offer,
    /// The rows of all points.
    pub rows: PartTable,
    /// The units of its columns.
    pub units: &'a Units,
    /// The scenario of the study, in SI.
    pub scenario: Value,
}

/// The values of an output over those of two members. The other members are held at values near the middle.
struct Lattice {
    over: Vec<f64>,
    by: Vec<f64>,
    /// Rows over `by`; NaN where there is no value.
    values: Vec<Vec<f64>>,
    /// The pointers and values of the other members.
    held: Vec<(String, f64)>,
}

impl Lattice {
    fn new(table: &StudyTable<'_>, Choice { output, over, by, .. }: Choice) -> Self {
        let StudyTable { offer, rows, .. } = table;
        let output = rows.axis(&offer.outputs[output]);
        let column = |place: usize| rows.axis(&offer.members[place].0);
        let others = (0..offer.members.len()).filter(|place| *place != over && Some(*place) != by);
        let others: Vec<(usize, &[f64])> = others.map(|place| (place, column(place))).collect();
        let held = central(&others, output);
        let x = distinct(column(over));
        let y = by.map_or_else(|| vec![f64::NAN], |by| distinct(column(by)));
        let mut values = vec![vec![f64::NAN; x.len()]; y.len()];
        let find =
            |values: &[f64], value: f64| values.binary_search_by(|own| own.total_cmp(&value)).ok();
        for (row, value) in output.iter().enumerate() {
            let is_held =
                held.iter().all(|(place, value)| column(*place)[row].total_cmp(value).is_eq());
            let i = find(&x, column(over)[row]);
            let j = by.map_or(Some(0), |by| find(&y, column(by)[row]));
            if let (true, Some(i), Some(j)) = (is_held, i, j) {
                values[j][i] = *value;
            }
        }
        let held = held.into_iter().map(|(place, value)| (offer.members[place].0.clone(), value));
        Self { over: x, by: y, values, held: held.collect() }
    }

    /// The lattice restricted to these columns and rows.
    fn thinned(self, columns: &[usize], rows: &[usize]) -> Self {
        let pick =
            |from: &[f64], places: &[usize]| places.iter().map(|place| from[*place]).collect();
        let values = rows.iter().map(|row| pick(&self.values[*row], columns)).collect();
        Self { over: pick(&self.over, columns), by: pick(&self.by, rows), values, held: self.held }
    }

    /// The values of the members that are held, in words.
    fn note(&self, StudyTable { units, scenario, .. }: &StudyTable<'_>) -> String {
        let held = self.held.iter().flat_map(|(pointer, value)| {
            values_of(&short(pointer, scenario), units.of(pointer), &[*value])
        });
        let held: Vec<String> = held.collect();
        if held.is_empty() { String::new() } else { format!(" At {}.", held.join(", ")) }
    }
}

/// The values of these members in the row that is nearest to the middle of all of them and has an output. If no row has
/// one, the middle values.
fn central(members: &[(usize, &[f64])], output: &[f64]) -> Vec<(usize, f64)> {
    let distances: Vec<Vec<usize>> = members
        .iter()
        .map(|(_, column)| {
            let values = distinct(column);
            let middle = values.len() / 2;
            let place = |value: &f64| values.partition_point(|own| own.total_cmp(value).is_lt());
            column.iter().map(|value| place(value).abs_diff(middle)).collect()
        })
        .collect();
    let distance = |row: usize| distances.iter().map(|own| own[row]).sum::<usize>();
    let rank = |row: &usize| (!output[*row].is_finite(), distance(*row));
    let Some(row) = (0..output.len()).min_by_key(rank) else { return Vec::new() };
    members.iter().map(|(place, column)| (*place, column[row])).collect()
}

impl StudyTable<'_> {
    /// One curve for each value of a second member, and a note about the values that it does not show.
    pub fn curves(&self, choice: Choice) -> (Vec<Series>, String) {
        let lattice = Lattice::new(self, choice);
        let all = lattice.by.len();
        let columns = evenly_spaced(lattice.over.len(), MAX_POINTS);
        let lattice = lattice.thinned(&columns, &evenly_spaced(all, MAX_CURVES));
        let mut note = lattice.note(self);
        let labels = choice.by.map(|by| {
            let name = &self.offer.members[by].0;
            if all > MAX_CURVES {
                let member = member(name, &self.scenario);
                note = format!("{note} {MAX_CURVES} of {all} values of {member} are drawn.");
            }
            values_of(&short(name, &self.scenario), self.units.of(name), &lattice.by)
        });
        let mut labels = labels.into_iter().flatten().chain(std::iter::repeat(String::new()));
        let series = lattice.values.into_iter().enumerate().map(|(i, y)| {
            let label = labels.next().unwrap_or_default();
            Series::new(&label, lattice.over.clone(), y, Style::marked(i))
        });
        (series.collect(), note)
    }

    /// The heat map of an output, and a note about the values that it does not show. `log`: whether each axis is
    /// logarithmic.
    pub fn field(&self, choice: Choice, log: (bool, bool), scale: Axis) -> (Field, String) {
        let lattice = Lattice::new(self, choice);
        let drawn = |values: &[f64], log: bool| -> Vec<usize> {
            let first = if log { values.partition_point(|value| *value <= 0.0) } else { 0 };
            let places = evenly_spaced(values.len() - first, MAX_CELLS).into_iter();
            places.map(|place| first + place).collect()
        };
        let (columns, lines) = (drawn(&lattice.over, log.0), drawn(&lattice.by, log.1));
        let mut note = lattice.note(self);
        if lattice.over.len().max(lattice.by.len()) > MAX_CELLS {
            note = format!("{note} At most {MAX_CELLS} values of each axis are drawn.");
        }
        let Lattice { over, by, values, .. } = lattice.thinned(&columns, &lines);
        let log = spans_decades(values.iter().flatten().copied());
        (Field { x: over, y: by, values, scale: Axis { log, ..scale } }, note)
    }
}

/// The curve through the rows of a study whose members follow each other in lists.
pub fn list(x: &[f64], y: &[f64]) -> Series {
    let places = evenly_spaced(x.len(), MAX_POINTS);
    let pick = |from: &[f64]| places.iter().map(|place| from[*place]).collect();
    Series::new("", pick(x), pick(y), Style::marked(0))
}

/// The boundary of two regions, on a white curve that makes it visible on dark colours.
pub fn boundary([x, y]: [Vec<f64>; 2], label: &str) -> Vec<Series> {
    let line = |label, style| Series::new(label, x.clone(), y.clone(), style);
    vec![line("", HALO), line(label, BOUNDARY)]
}

/// The boundary after the runs.
pub fn later([x, y]: [Vec<f64>; 2]) -> Series {
    Series::new("", x, y, LATER)
}

/// The regions below and above the boundary, which may leave the range of the vertical axis.
pub fn regions(names: [&str; 2], [x, y]: &[Vec<f64>; 2], range: Option<(f64, f64)>) -> Vec<Band> {
    let Some((least, most)) = range else { return Vec::new() };
    let band = |label: &str, color, between: &dyn Fn(f64) -> (f64, f64)| Band {
        label: label.to_owned(),
        color,
        x: x.clone(),
        between: y.iter().map(|at| between(*at)).collect(),
    };
    vec![band(names[0], BELOW, &|at| (least, at)), band(names[1], ABOVE, &|at| (at, most))]
}
