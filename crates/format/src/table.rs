//! The tables of a result: columns over output cycles and points.
//!
//! The points of a profile are radii; the points of a loop are the corners of its curve.

use std::fmt;

use serde::de::{Deserializer as _, IgnoredAny, SeqAccess, Visitor};
use serde::{Deserialize, Serialize, Serializer};
use serde_json::value::RawValue;

use super::{Error, Missing, Part, Result, Units, View, refuse_if_any};
use fretwork_engine::{Loops, Profiles};
use fretwork_json::Members;

/// A number of a document. Infinite numbers are null in the document and NaN here.
#[derive(Deserialize)]
#[serde(from = "Option<f64>")]
struct Float(f64);

impl From<Option<f64>> for Float {
    fn from(number: Option<f64>) -> Self {
        Self(number.unwrap_or(f64::NAN))
    }
}

fn numbers(cells: Vec<Float>) -> Vec<f64> {
    cells.into_iter().map(|cell| cell.0).collect()
}

/// The numbers of a column. serde_json writes numbers that are not finite as null.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Values {
    /// One per output cycle.
    Cycles(Vec<f64>),
    /// One per point, the same in all output cycles.
    Points(Vec<f64>),
    /// One row of points per output cycle.
    Matrix(Vec<Vec<f64>>),
    /// One text or none per row of a study.
    Texts(Vec<Option<String>>),
    /// Not defined for this scenario.
    Absent,
}

/// The cell of a row in a column. serde_json writes numbers that are not finite as null.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Cell<'a> {
    /// A number, NaN if it is infinite or absent.
    Number(f64),
    /// A text.
    Text(&'a str),
}

/// Indices of the selected output cycles and points; `None` selects all. `rows` is the maximum number of rows of a
/// study.
struct Selection {
    cycles: Option<Vec<usize>>,
    points: Option<Vec<usize>>,
    radii: Vec<f64>,
    rows: usize,
}

/// Reads the first items of a list. It skips the others, which is faster than to read them.
struct First<T> {
    most: usize,
    items: Vec<T>,
}

impl<T> First<T> {
    fn read<'de>(text: &'de str, most: usize) -> Result<Vec<T>, serde_json::Error>
    where
        T: Deserialize<'de>,
    {
        let first = Self { most, items: Vec::new() };
        serde_json::Deserializer::from_str(text).deserialize_seq(first)
    }
}

impl<'de, T: Deserialize<'de>> Visitor<'de> for First<T> {
    type Value = Vec<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list")
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut list: A) -> Result<Vec<T>, A::Error> {
        while self.items.len() < self.most {
            match list.next_element()? {
                Some(item) => self.items.push(item),
                None => return Ok(self.items),
            }
        }
        while list.next_element::<IgnoredAny>()?.is_some() {}
        Ok(self.items)
    }
}

impl Values {
    /// Reads the selected numbers only: parsing numbers takes more time than everything else.
    fn read(
        part: Part,
        name: &str,
        text: &RawValue,
        selection: &Selection,
    ) -> Result<Self, serde_json::Error> {
        let text = text.get();
        let mut opening = text.bytes().filter(|byte| !byte.is_ascii_whitespace());
        match (opening.next(), opening.next()) {
            (Some(b'['), Some(b'[')) => {
                let rows: Vec<&RawValue> = First::read(text, selection.rows)?;
                let rows = pick(rows, selection.cycles.as_deref()).into_iter().map(|row| {
                    let row = numbers(serde_json::from_str(row.get())?);
                    Ok(match &selection.points {
                        Some(points) if name == "pressure" => means(&row, &selection.radii, points),
                        points => pick(row, points.as_deref()),
                    })
                });
                Ok(Self::Matrix(rows.collect::<Result<_, serde_json::Error>>()?))
            }
            (Some(b'['), _) => Ok(if part == Part::Profiles && !ROWS.contains(&name) {
                let row = numbers(serde_json::from_str(text)?);
                Self::Points(pick(row, selection.points.as_deref()))
            } else {
                let row = numbers(First::read(text, selection.rows)?);
                Self::Cycles(pick(row, selection.cycles.as_deref()))
            }),
            _ => Ok(Self::Absent),
        }
    }

    fn convert(&mut self, convert: impl Fn(f64) -> f64) {
        let row = |row: &mut Vec<f64>| row.iter_mut().for_each(|number| *number = convert(*number));
        match self {
            Self::Cycles(numbers) | Self::Points(numbers) => row(numbers),
            Self::Matrix(rows) => rows.iter_mut().for_each(row),
            Self::Texts(_) | Self::Absent => {}
        }
    }

    /// The number at an output cycle and a point; NaN if the column has none.
    pub fn at(&self, cycle: usize, point: usize) -> f64 {
        let found = match self {
            Self::Cycles(row) => row.get(cycle),
            Self::Points(row) => row.get(point),
            Self::Matrix(rows) => rows.get(cycle).and_then(|row| row.get(point)),
            Self::Texts(_) | Self::Absent => None,
        };
        found.copied().unwrap_or(f64::NAN)
    }

    /// The cell of the column at an output cycle and a point.
    pub fn cell(&self, cycle: usize, point: usize) -> Cell<'_> {
        let text = match self {
            Self::Texts(texts) => texts.get(cycle).and_then(Option::as_deref),
            _ => None,
        };
        text.map_or_else(|| Cell::Number(self.at(cycle, point)), Cell::Text)
    }
}

fn pick<T: Copy>(items: Vec<T>, indices: Option<&[usize]>) -> Vec<T> {
    match indices {
        Some(indices) => indices.iter().filter_map(|&index| items.get(index).copied()).collect(),
        None => items,
    }
}

/// Pressures at the selected radii, which are means: each radius that is not selected shares its load between its selected
/// neighbours. So a trapezoid over fewer radii still gives the force. Values that are not finite are left out.
fn means(row: &[f64], radii: &[f64], selected: &[usize]) -> Vec<f64> {
    let at = |index: usize| radii[index.min(radii.len() - 1)];
    let mut sums = vec![[0.0, 0.0]; selected.len()];
    for (i, p) in row.iter().enumerate().filter(|(i, p)| p.is_finite() && *i < radii.len()) {
        let right = selected.partition_point(|index| *index < i).min(selected.len() - 1);
        let left = right.saturating_sub(1);
        let (from, to) = (at(selected[left]), at(selected[right]));
        let share = if to > from { (at(i) - from) / (to - from) } else { 1.0 };
        for (place, share) in [(left, 1.0 - share), (right, share)] {
            let weight = share * (at(i + 1) - at(i.saturating_sub(1)));
            sums[place][0] += weight * p;
            sums[place][1] += weight;
        }
    }
    sums.iter().map(|[sum, weight]| sum / weight).collect()
}

/// The columns that identify rows: `cycles` in a run, and `point` in the profiles of a study.
const ROWS: [&str; 2] = ["cycles", "point"];

/// The axes of a table: columns that are always included.
fn axes(part: Part, members: &Members<'_>) -> &'static [&'static str] {
    match part {
        Part::Profiles if members.get("point").is_some() => &["point", "radius"],
        Part::Profiles => &["cycles", "radius"],
        Part::Table => &[],
        _ => &["cycles"],
    }
}

/// A table.
#[derive(Debug)]
pub struct PartTable {
    /// The part of the result to which the table belongs.
    pub part: Part,
    /// Names and numbers, in the order of the document.
    pub columns: Vec<(String, Values)>,
    /// Whether the document has it: a run can omit profiles and loops.
    exists: bool,
}

impl PartTable {
    /// Reads the selected part of a table.
    ///
    /// # Errors
    /// [`Error::Missing`] lists all selected columns and output cycles that the table does not have. A table
    /// that the document does not have has its usual columns and no rows.
    pub fn read(part: Part, text: Option<&RawValue>, units: &Units, view: &View) -> Result<Self> {
        let text = text.filter(|text| text.get() != "null");
        let empty = match part {
            Part::Profiles => serde_json::to_string(&Profiles::default()),
            Part::Loops => serde_json::to_string(&Loops::default()),
            _ => Ok("{}".to_owned()),
        }?;
        let members: Members<'_> = serde_json::from_str(text.map_or(&empty, |text| text.get()))?;
        let axes = axes(part, &members);
        let selection = select(&members, axes, view)?;
        let selected = |name: &str| {
            let fields = view.fields.as_ref();
            axes.contains(&name)
                || fields.is_none_or(|fields| fields.iter().any(|field| field == name))
        };
        let columns = members.0.iter().filter(|(name, _)| selected(name));
        let columns = columns.map(|(name, text)| {
            // Each column of numbers has a unit, possibly `1`. Columns of texts have none.
            let is_text = part == Part::Table && !units.have(name);
            let values = if is_text {
                Values::Texts(First::read(text.get(), selection.rows)?)
            } else {
                Values::read(part, name, text, &selection)?
            };
            Ok((name.to_string(), values))
        });
        let columns = columns.collect::<Result<_, serde_json::Error>>()?;
        let table = Self { part, columns, exists: text.is_some() };
        let is_sound = table.is_whole() && !table.columns.is_empty();
        if is_sound { Ok(table) } else { Err(Error::Document(unsound(part))) }
    }

    /// A table with one row per cell of its first column.
    pub fn of_outputs(part: Part, columns: Vec<(String, Values)>) -> Self {
        Self { part, columns, exists: true }
    }

    /// Whether all columns have the length of their axes, and the rows of all loops the same points.
    fn is_whole(&self) -> bool {
        let (cycles, points) = (self.cycles(), self.axis("radius").len());
        let is_profile = self.part == Part::Profiles;
        let length = |cycle| if is_profile { points } else { self.points_in(cycle) };
        let lengths: Vec<usize> = (0..cycles).map(length).collect();
        self.columns.iter().all(|(_, values)| match values {
            Values::Cycles(row) => row.len() == cycles,
            Values::Texts(texts) => texts.len() == cycles,
            Values::Points(row) => row.len() == points,
            Values::Matrix(rows) => rows.iter().map(Vec::len).eq(lengths.iter().copied()),
            Values::Absent => true,
        })
    }

    /// The numbers of a column with one number per output cycle or one per point.
    pub fn axis(&self, name: &str) -> &[f64] {
        match self.column(name) {
            Some(Values::Cycles(row) | Values::Points(row)) => row,
            _ => &[],
        }
    }

    /// The column with this name.
    pub fn column(&self, name: &str) -> Option<&Values> {
        self.columns.iter().find(|(column, _)| column == name).map(|(_, values)| values)
    }

    /// A text in a column; empty without one.
    pub fn text(&self, name: &str, row: usize) -> &str {
        match self.column(name) {
            Some(Values::Texts(texts)) => texts[row].as_deref().unwrap_or_default(),
            _ => "",
        }
    }

    /// Converts all numbers to the requested units and digits.
    pub fn convert(&mut self, units: &Units) {
        for (name, values) in &mut self.columns {
            if let Some(convert) = units.conversion(name) {
                values.convert(convert);
            }
        }
    }

    /// The number of output cycles, or of points of a study.
    pub fn cycles(&self) -> usize {
        match self.columns.first() {
            Some((_, Values::Texts(texts))) => texts.len(),
            Some((_, Values::Cycles(row))) if self.part == Part::Table => row.len(),
            _ => ROWS.iter().map(|name| self.axis(name).len()).max().unwrap_or(0),
        }
    }

    /// The largest number of points in an output cycle.
    pub fn points(&self) -> usize {
        (0..self.cycles()).map(|cycle| self.points_in(cycle)).max().unwrap_or(0)
    }

    /// The number of rows of an output cycle.
    fn points_in(&self, cycle: usize) -> usize {
        let lengths = self.columns.iter().filter_map(|(_, values)| match values {
            Values::Points(row) => Some(row.len()),
            Values::Matrix(rows) => Some(rows.get(cycle).map_or(0, Vec::len)),
            Values::Cycles(_) | Values::Texts(_) | Values::Absent => None,
        });
        lengths.max().unwrap_or(1)
    }

    /// All rows: indices of an output cycle and a point.
    pub fn rows(&self) -> impl Iterator<Item = (usize, usize)> {
        (0..self.cycles())
            .flat_map(|cycle| (0..self.points_in(cycle)).map(move |point| (cycle, point)))
    }
}

/// The error of a table without columns, or whose columns have different lengths.
fn unsound(part: Part) -> serde_json::Error {
    serde::de::Error::custom(format!(
        "the columns of `{}` are missing or have different lengths",
        part.as_str()
    ))
}

/// Finds the selected output cycles and points of a table, or lists everything that is missing.
fn select(members: &Members<'_>, axes: &[&str], view: &View) -> Result<Selection> {
    let axis = |name: &str| -> Result<Vec<f64>> {
        let text = members.get(name).filter(|_| axes.contains(&name));
        let cells: Option<_> = text.map_or(Ok(None), |text| serde_json::from_str(text.get()))?;
        Ok(cells.map(numbers).unwrap_or_default())
    };
    let mut missing = Vec::new();
    for name in view.fields.iter().flatten().filter(|name| members.get(name).is_none()) {
        let names = members.0.iter().map(|(name, _)| &**name);
        let names: Vec<_> = names.filter(|name| !axes.contains(name)).collect();
        let detail = format!(
            "{name:?} is not a column of this result. The columns are {}",
            names.join(", ")
        );
        missing.push(Missing { parameter: "fields", detail });
    }
    let cycles = axis("cycles")?;
    if view.cycles.is_some() && !axes.contains(&"cycles") {
        let detail = "applies only to runs, and this result is a study: its rows are points, not output cycles. \
                      Remove `cycles`"
            .to_owned();
        missing.push(Missing { parameter: "cycles", detail });
    }
    if axes.contains(&"cycles") {
        missing.extend(missing_cycles(view, &cycles));
    }
    refuse_if_any(missing)?;
    let selected = view.cycles.as_ref().map(|wanted| {
        let selected = |index: &usize| wanted.iter().any(|wanted| same(cycles[*index], *wanted));
        (0..cycles.len()).filter(selected).collect()
    });
    let radii = axis("radius")?;
    let points = view.points.map(|points| evenly_spaced(radii.len(), points));
    Ok(Selection { cycles: selected, points, radii, rows: view.rows.unwrap_or(usize::MAX) })
}

impl Serialize for PartTable {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        if !self.exists {
            return json.serialize_none();
        }
        json.collect_map(self.columns.iter().map(|(name, values)| (name, values)))
    }
}

/// The selected output cycles that are not among these.
fn missing_cycles(view: &View, cycles: &[f64]) -> Vec<Missing> {
    let wanted = view.cycles.iter().flatten();
    let missing = wanted.filter(|wanted| !cycles.iter().any(|number| same(*number, **wanted)));
    let detail = |wanted| format!("{wanted} is not an output cycle; {}", listed(cycles));
    missing.map(|wanted| Missing { parameter: "cycles", detail: detail(wanted) }).collect()
}

/// Whether two numbers are the same output cycle. They may differ in the last of the 12 digits that results have.
fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-11 * a.abs().max(b.abs())
}

/// The output cycles of a result, shortened for a message.
fn listed(cycles: &[f64]) -> String {
    const MOST: usize = 30;
    let Some(last) = cycles.last() else {
        return "the result was computed without profiles".to_owned();
    };
    let mut out: Vec<_> = cycles.iter().take(MOST).map(f64::to_string).collect();
    if cycles.len() > MOST {
        out.push(format!("… {last}"));
    }
    format!("the output cycles are {}", out.join(", "))
}

/// At most `count` indices of `0..length`, evenly spaced, including the first and the last.
pub fn evenly_spaced(length: usize, count: usize) -> Vec<usize> {
    if count >= length {
        return (0..length).collect();
    }
    let gaps = count.saturating_sub(1).max(1);
    (0..count).map(|index| (index * (length - 1) + gaps / 2) / gaps).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fewer_radii_carry_the_same_load() {
        let radii: Vec<f64> = (0..=100).map(f64::from).collect();
        let mut row: Vec<f64> = radii.iter().map(|r| 100.0 - r).collect();
        row[50] = 1e4;
        let load = |row: &[f64], at: &dyn Fn(usize) -> f64| -> f64 {
            let below = |i: usize| 0.5 * (at(i) - at(i - 1)) * (row[i] + row[i - 1]);
            (1..row.len()).map(below).sum()
        };
        let selected = evenly_spaced(radii.len(), 20);
        let found = load(&means(&row, &radii, &selected), &|i| radii[selected[i]]);
        assert!((found / load(&row, &|i| radii[i]) - 1.0).abs() < 0.01, "{found}");
        assert_eq!(means(&row, &radii, &evenly_spaced(101, 101)), row);
    }

    #[test]
    fn evenly_spaced_indices_include_both_ends() {
        assert_eq!(evenly_spaced(5, 3), [0, 2, 4]);
        assert_eq!(evenly_spaced(3, 9), [0, 1, 2]);
        assert_eq!(evenly_spaced(256, 2), [0, 255]);
        assert_eq!(evenly_spaced(0, 2), [] as [usize; 0]);
    }
}
