//! The tables of a result: columns over instants and places.

use serde::ser::SerializeMap as _;
use serde::{Deserialize, Serialize, Serializer};
use serde_json::value::RawValue;

use super::differences::Differences;
use super::document::{Members, Telling};
use super::{Ask, Complaint, Error, Part};
use fretwork_engine::outcome::{Loops, Profiles};

/// A number of a document; infinite ones are null there and NaN here.
#[derive(Deserialize)]
#[serde(from = "Option<f64>")]
struct Cell(f64);

impl From<Option<f64>> for Cell {
    fn from(number: Option<f64>) -> Self {
        Self(number.unwrap_or(f64::NAN))
    }
}

fn numbers(cells: Vec<Cell>) -> Vec<f64> {
    cells.into_iter().map(|cell| cell.0).collect()
}

/// The numbers of a column.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// One per instant.
    Instants(Vec<f64>),
    /// One per place, the same at every instant.
    Places(Vec<f64>),
    /// One row of places per instant.
    Both(Vec<Vec<f64>>),
    /// Not defined for this scenario.
    Absent,
}

/// Which of the instants and places are wanted; none if all.
struct Cut {
    instants: Option<Vec<usize>>,
    places: Option<Vec<usize>>,
}

impl Values {
    /// Reads of a column what is wanted: the digits of a whole one take longer than all else.
    fn read(part: Part, name: &str, text: &RawValue, cut: &Cut) -> Result<Self, serde_json::Error> {
        let text = text.get();
        let mut opening = text.bytes().filter(|byte| !byte.is_ascii_whitespace());
        match (opening.next(), opening.next()) {
            (Some(b'['), Some(b'[')) => {
                let row = |cells| pick(numbers(cells), cut.places.as_deref());
                if cut.instants.is_none() {
                    let rows: Vec<Vec<Cell>> = serde_json::from_str(text)?;
                    return Ok(Self::Both(rows.into_iter().map(row).collect()));
                }
                let rows: Vec<&RawValue> = serde_json::from_str(text)?;
                let rows = pick(rows, cut.instants.as_deref()).into_iter();
                let rows = rows.map(|text| serde_json::from_str(text.get()).map(row));
                Ok(Self::Both(rows.collect::<Result<_, _>>()?))
            }
            (Some(b'['), _) => {
                let row = numbers(serde_json::from_str(text)?);
                let by_place = part == Part::Profiles && name != "cycles";
                Ok(if by_place {
                    Self::Places(pick(row, cut.places.as_deref()))
                } else {
                    Self::Instants(pick(row, cut.instants.as_deref()))
                })
            }
            _ => Ok(Self::Absent),
        }
    }

    fn each(&mut self, change: impl Fn(f64) -> f64) {
        let each = |row: &mut Vec<f64>| row.iter_mut().for_each(|number| *number = change(*number));
        match self {
            Self::Instants(row) | Self::Places(row) => each(row),
            Self::Both(rows) => rows.iter_mut().for_each(each),
            Self::Absent => {}
        }
    }

    /// The number at an instant and a place; NaN if there is none.
    pub fn at(&self, instant: usize, place: usize) -> f64 {
        let found = match self {
            Self::Instants(row) => row.get(instant),
            Self::Places(row) => row.get(place),
            Self::Both(rows) => rows.get(instant).and_then(|row| row.get(place)),
            Self::Absent => None,
        };
        found.copied().unwrap_or(f64::NAN)
    }
}

impl Serialize for Values {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        // What is not finite is written as null.
        match self {
            Self::Instants(row) | Self::Places(row) => row.serialize(json),
            Self::Both(rows) => rows.serialize(json),
            Self::Absent => json.serialize_none(),
        }
    }
}

fn pick<T: Copy>(items: Vec<T>, wanted: Option<&[usize]>) -> Vec<T> {
    match wanted {
        Some(indices) => indices.iter().filter_map(|&index| items.get(index).copied()).collect(),
        None => items,
    }
}

/// One of the tables.
#[derive(Debug)]
pub struct Table {
    /// Which one.
    pub part: Part,
    /// Names and numbers, in the order of the document.
    pub columns: Vec<(String, Values)>,
    /// Whether the document has it: profiles and loops can be left out of a run.
    there: bool,
    /// Of how many digits matrices are told by their differences; none if they are told as they are.
    pub differences: Option<u8>,
}

impl Table {
    /// Reads what is wanted of a table, or tells everything that is wanted and not there. One that the
    /// document does not have has its columns all the same, and no rows.
    pub fn read(part: Part, text: Option<&RawValue>, ask: &Ask) -> Result<Self, Error> {
        let there = text.is_some_and(|text| text.get() != "null");
        let empty = match part {
            Part::Profiles => serde_json::to_string(&Profiles::default()),
            Part::Loops => serde_json::to_string(&Loops::default()),
            Part::Whole | Part::History | Part::Plot => Ok("{}".to_owned()),
        }?;
        let text = text.filter(|_| there).map_or(&*empty, RawValue::get);
        let members: Members<'_> = serde_json::from_str(text)?;
        // The columns that say where the numbers of the others belong.
        let axes: &[&str] =
            if part == Part::Profiles { &["cycles", "radius"] } else { &["cycles"] };
        let cut = cut(&members, axes, ask)?;
        let mut columns = Vec::new();
        for (name, text) in &members.0 {
            let wanted = |fields: &Vec<String>| fields.iter().any(|field| field == name);
            if axes.contains(&&**name) || ask.fields.as_ref().is_none_or(wanted) {
                columns.push((name.to_string(), Values::read(part, name, text, &cut)?));
            }
        }
        Ok(Self { part, columns, there, differences: None })
    }

    /// The numbers of a column that has one per instant or one per place.
    pub fn axis(&self, name: &str) -> &[f64] {
        match self.column(name) {
            Some(Values::Instants(row) | Values::Places(row)) => row,
            _ => &[],
        }
    }

    /// A column by its name.
    pub fn column(&self, name: &str) -> Option<&Values> {
        self.columns.iter().find(|(column, _)| column == name).map(|(_, values)| values)
    }

    /// Brings all numbers into the units and digits in which they are told.
    pub fn tell(&mut self, telling: &Telling) {
        for (name, values) in &mut self.columns {
            if self.differences.is_some() && matches!(values, Values::Both(_)) {
                // In steps they are rounded once.
                if let Some(tell) = telling.unrounded(name) {
                    values.each(tell);
                }
            } else if let Some(tell) = telling.of(name) {
                values.each(tell);
            }
        }
    }

    /// How many instants there are.
    pub fn instants(&self) -> usize {
        self.axis("cycles").len()
    }

    /// How many places there are, the same at every instant or at the longest of them.
    pub fn places(&self) -> usize {
        (0..self.instants()).map(|instant| self.width(instant)).max().unwrap_or(0)
    }

    /// How many rows belong to an instant.
    fn width(&self, instant: usize) -> usize {
        let widths = self.columns.iter().filter_map(|(_, values)| match values {
            Values::Places(row) => Some(row.len()),
            Values::Both(rows) => Some(rows.get(instant).map_or(0, Vec::len)),
            Values::Instants(_) | Values::Absent => None,
        });
        widths.max().unwrap_or(1)
    }

    /// About how many bytes all rows take as text, rather too many: who asks for them at once does not
    /// move what is written to ever larger places, and what is not written to takes no memory.
    pub fn room(&self, beside: usize) -> usize {
        // The longest number is -2.2250738585072014e-308.
        const NUMBER: usize = 24;
        self.rows().count() * (beside + self.columns.len() * (NUMBER + 1))
    }

    /// Every row: an instant and a place.
    pub fn rows(&self) -> impl Iterator<Item = (usize, usize)> + Clone + use<> {
        let widths: Vec<usize> = (0..self.instants()).map(|instant| self.width(instant)).collect();
        let rows = |(instant, width)| (0..width).map(move |place| (instant, place));
        widths.into_iter().enumerate().flat_map(rows)
    }
}

/// What is wanted of a table with these members, or everything that is wanted and not there.
fn cut(members: &Members<'_>, axes: &[&str], ask: &Ask) -> Result<Cut, Error> {
    let axis = |name: &str| -> Result<Vec<f64>, Error> {
        let text = members.get(name).filter(|_| axes.contains(&name));
        let cells: Option<_> = text.map_or(Ok(None), |text| serde_json::from_str(text.get()))?;
        Ok(cells.map(numbers).unwrap_or_default())
    };
    let mut missing = Vec::new();
    for name in ask.fields.iter().flatten() {
        if members.get(name).is_none() {
            let there = members.0.iter().map(|(name, _)| &**name);
            let there: Vec<_> = there.filter(|name| !axes.contains(name)).collect();
            let detail = format!("{name:?} is no field here; there are {}", there.join(", "));
            missing.push(Complaint::parameter("fields", detail));
        }
    }
    let cycles = axis("cycles")?;
    for wanted in ask.cycles.iter().flatten() {
        if !cycles.iter().any(|number| same(*number, *wanted)) {
            let detail = format!("nothing is at {wanted} cycles; {}", listed(&cycles));
            missing.push(Complaint::parameter("cycles", detail));
        }
    }
    if !missing.is_empty() {
        return Err(Error::NotThere(missing));
    }
    let instants = ask.cycles.as_ref().map(|wanted| {
        let asked = |index: &usize| wanted.iter().any(|wanted| same(cycles[*index], *wanted));
        (0..cycles.len()).filter(asked).collect()
    });
    let radii = axis("radius")?.len();
    Ok(Cut { instants, places: ask.points.map(|points| spread(radii, points)) })
}

impl Serialize for Table {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        if !self.there {
            return json.serialize_none();
        }
        let mut map = json.serialize_map(Some(self.columns.len()))?;
        for (name, values) in &self.columns {
            match (values, self.differences) {
                (Values::Both(rows), Some(digits)) => {
                    map.serialize_entry(name, &Differences::of(rows, digits))?;
                }
                _ => map.serialize_entry(name, values)?,
            }
        }
        map.end()
    }
}

/// Whether two instants are one; twelve digits is what a canonical scenario keeps of a number.
fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-11 * a.abs().max(b.abs())
}

/// What instants there are, as a message has room for.
fn listed(cycles: &[f64]) -> String {
    const ROOM: usize = 30;
    if cycles.is_empty() {
        return "the result was computed without profiles".to_owned();
    }
    let mut out: Vec<_> = cycles.iter().take(ROOM).map(f64::to_string).collect();
    if cycles.len() > ROOM {
        out.push(format!("… {}", cycles[cycles.len() - 1]));
    }
    format!("there are {}", out.join(", "))
}

/// At most `count` of `0..length`, evenly spread, the first and the last among them.
pub fn spread(length: usize, count: usize) -> Vec<usize> {
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
    fn a_spread_keeps_both_ends() {
        assert_eq!(spread(5, 3), [0, 2, 4]);
        assert_eq!(spread(3, 9), [0, 1, 2]);
        assert_eq!(spread(256, 2), [0, 255]);
        assert_eq!(spread(0, 2), [] as [usize; 0]);
    }
}
