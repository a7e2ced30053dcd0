//! A stored result document taken apart: its history, its profiles, its loops, and each as CSV.
//!
//! Numbers are never parsed and printed again: each is carried over as the text that the worker
//! wrote, so every form of a result has the same digits.

#![expect(
    clippy::missing_errors_doc,
    reason = "they all fail alike: on a damaged document, or on a selection of what is not there"
)]

use std::fmt;

use serde::de::{MapAccess, Visitor};
use serde::ser::SerializeMap as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::value::RawValue;

/// What of the profiles is wanted; `None` and empty mean everything.
#[derive(Debug, Default, Clone)]
pub struct Selection {
    /// Names of columns beside `cycles` and `radius`.
    pub fields: Option<Vec<String>>,
    /// Instants, in cycles.
    pub cycles: Option<Vec<f64>>,
    /// How many radii at most, evenly spread from the first to the last.
    pub points: Option<usize>,
}

/// Why a table cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A field that the profiles do not have.
    #[error("\"{name}\" is no field of these profiles; there are {}", .there.join(", "))]
    Field {
        /// The field asked for.
        name: String,
        /// The fields there are.
        there: Vec<String>,
    },
    /// An instant without profiles.
    #[error("there is no profile at {cycles} cycles; there are profiles at {}", .there.join(", "))]
    Instant {
        /// The instant asked for.
        cycles: f64,
        /// The instants there are.
        there: Vec<String>,
    },
    /// The stored document does not have the form of a result.
    #[error("the stored document is not a result")]
    Document(#[from] serde_json::Error),
}

/// A result document, as far as tables need it.
#[derive(Deserialize)]
pub struct Document<'a> {
    #[serde(borrow)]
    key: &'a RawValue,
    #[serde(borrow)]
    engine: &'a RawValue,
    #[serde(borrow)]
    units: Members<'a>,
    #[serde(borrow)]
    history: Members<'a>,
    #[serde(borrow)]
    profiles: Option<Members<'a>>,
    #[serde(borrow)]
    loops: Option<Members<'a>>,
}

/// A JSON object whose members keep their order and their text.
struct Members<'a>(Vec<(String, &'a RawValue)>);

impl<'de: 'a, 'a> Deserialize<'de> for Members<'a> {
    fn deserialize<D: Deserializer<'de>>(json: D) -> Result<Self, D::Error> {
        struct Collect;
        impl<'de> Visitor<'de> for Collect {
            type Value = Members<'de>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Members<'de>, A::Error> {
                let mut members = Vec::new();
                while let Some(member) = map.next_entry()? {
                    members.push(member);
                }
                Ok(Members(members))
            }
        }
        json.deserialize_map(Collect)
    }
}

impl Serialize for Members<'_> {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        json.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}

/// One column of the profiles.
enum Column<'a> {
    /// One value per radius, the same at every instant.
    Fixed(Vec<&'a RawValue>),
    /// One row per instant.
    Moving(Vec<Vec<&'a RawValue>>),
    /// Not defined for this scenario.
    Absent,
}

impl<'a> Column<'a> {
    fn parse(text: &'a RawValue) -> Result<Self, serde_json::Error> {
        let text = text.get();
        let mut opening = text.bytes().filter(|byte| !byte.is_ascii_whitespace());
        match (opening.next(), opening.next()) {
            (Some(b'['), Some(b'[')) => serde_json::from_str(text).map(Self::Moving),
            (Some(b'['), _) => serde_json::from_str(text).map(Self::Fixed),
            _ => Ok(Self::Absent),
        }
    }

    fn keep(&mut self, instants: &[usize], radii: &[usize]) {
        let thin = |row: &mut Vec<&'a RawValue>| *row = pick(row, radii);
        match self {
            Self::Fixed(row) => thin(row),
            Self::Moving(rows) => {
                *rows = pick(rows, instants);
                rows.iter_mut().for_each(thin);
            }
            Self::Absent => {}
        }
    }

    /// How many values a row has.
    fn width(&self, instant: usize) -> usize {
        match self {
            Self::Fixed(row) => row.len(),
            Self::Moving(rows) => rows.get(instant).map_or(0, Vec::len),
            Self::Absent => 0,
        }
    }

    fn at(&self, instant: usize, radius: usize) -> &str {
        let value = match self {
            Self::Fixed(row) => row.get(radius),
            Self::Moving(rows) => rows.get(instant).and_then(|row| row.get(radius)),
            Self::Absent => None,
        };
        value.map_or("", |value| cell(value))
    }
}

impl Serialize for Column<'_> {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Fixed(row) => row.serialize(json),
            Self::Moving(rows) => rows.serialize(json),
            Self::Absent => json.serialize_none(),
        }
    }
}

fn pick<T: Clone>(items: &[T], indices: &[usize]) -> Vec<T> {
    indices.iter().filter_map(|&index| items.get(index).cloned()).collect()
}

/// The text of a value in CSV: an infinite pressure, null in JSON, is an empty cell.
fn cell(value: &RawValue) -> &str {
    match value.get() {
        "null" => "",
        text => text,
    }
}

/// The profiles of a document, cut to what is wanted.
struct Profiles<'a> {
    cycles: Vec<&'a RawValue>,
    radius: Vec<&'a RawValue>,
    columns: Vec<(&'a str, Column<'a>)>,
}

impl<'a> Profiles<'a> {
    fn select(members: &'a Members<'a>, wanted: &Selection) -> Result<Self, Error> {
        let axis = |name: &str| -> Result<Vec<&'a RawValue>, Error> {
            let found = members.0.iter().find(|(member, _)| member == name);
            Ok(found
                .map(|(_, text)| serde_json::from_str(text.get()))
                .transpose()?
                .unwrap_or_default())
        };
        let (cycles, radius) = (axis("cycles")?, axis("radius")?);
        let fields = members.0.iter().filter(|(name, _)| name != "cycles" && name != "radius");
        let fields: Vec<_> = fields.map(|(name, text)| (name.as_str(), *text)).collect();
        if let Some(names) = &wanted.fields
            && let Some(name) =
                names.iter().find(|name| fields.iter().all(|(there, _)| there != name))
        {
            let there = fields.iter().map(|(name, _)| (*name).to_owned()).collect();
            return Err(Error::Field { name: name.clone(), there });
        }
        let instants = match &wanted.cycles {
            None => (0..cycles.len()).collect(),
            Some(wanted) => find(&cycles, wanted)?,
        };
        let radii = spread(radius.len(), wanted.points.unwrap_or(usize::MAX));
        let columns = fields
            .into_iter()
            .filter(|(name, _)| {
                wanted.fields.as_ref().is_none_or(|names| names.iter().any(|field| field == name))
            })
            .map(|(name, text)| {
                let mut column = Column::parse(text)?;
                column.keep(&instants, &radii);
                Ok((name, column))
            })
            .collect::<Result<_, Error>>()?;
        Ok(Self { cycles: pick(&cycles, &instants), radius: pick(&radius, &radii), columns })
    }
}

impl Serialize for Profiles<'_> {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        let mut map = json.serialize_map(Some(2 + self.columns.len()))?;
        map.serialize_entry("cycles", &self.cycles)?;
        map.serialize_entry("radius", &self.radius)?;
        for (name, column) in &self.columns {
            map.serialize_entry(name, column)?;
        }
        map.end()
    }
}

/// Where the instants `wanted` stand among `there`, in the order of the document.
fn find(there: &[&RawValue], wanted: &[f64]) -> Result<Vec<usize>, Error> {
    // Twelve digits is what a canonical scenario keeps of a number.
    let same = |a: f64, b: f64| (a - b).abs() <= 1e-11 * a.abs().max(b.abs());
    let numbers: Vec<f64> = there.iter().filter_map(|text| text.get().parse().ok()).collect();
    if let Some(&cycles) =
        wanted.iter().find(|&&cycles| !numbers.iter().any(|&number| same(number, cycles)))
    {
        let there = there.iter().map(|text| text.get().to_owned()).collect();
        return Err(Error::Instant { cycles, there });
    }
    let asked = |number: f64| wanted.iter().any(|&cycles| same(number, cycles));
    Ok((0..numbers.len()).filter(|&index| asked(numbers[index])).collect())
}

/// At most `count` of `0..length`, evenly spread, the first and the last among them.
fn spread(length: usize, count: usize) -> Vec<usize> {
    if count >= length {
        return (0..length).collect();
    }
    let gaps = count.saturating_sub(1).max(1);
    (0..count).map(|index| (index * (length - 1) + gaps / 2) / gaps).collect()
}

impl<'a> Document<'a> {
    /// Opens a stored document.
    pub fn open(stored: &'a [u8]) -> Result<Self, Error> {
        Ok(serde_json::from_slice(stored)?)
    }

    /// The history alone, as JSON.
    pub fn history_json(&self) -> Result<Vec<u8>, Error> {
        self.part("history", &self.history)
    }

    /// The history as CSV: one row per instant.
    pub fn history_csv(&self) -> Result<String, Error> {
        let columns: Vec<(&str, Vec<&RawValue>)> = self
            .history
            .0
            .iter()
            .map(|(name, text)| Ok((name.as_str(), serde_json::from_str(text.get())?)))
            .collect::<Result<_, Error>>()?;
        let mut out = self.heading("history", columns.iter().map(|(name, _)| *name));
        let rows = columns.iter().map(|(_, values)| values.len()).max().unwrap_or(0);
        for row in 0..rows {
            push_row(
                &mut out,
                columns.iter().map(|(_, values)| values.get(row).map_or("", |v| cell(v))),
            );
        }
        Ok(out)
    }

    /// The profiles alone, as JSON; null if the document has none.
    pub fn profiles_json(&self, wanted: &Selection) -> Result<Vec<u8>, Error> {
        let profiles =
            self.profiles.as_ref().map(|members| Profiles::select(members, wanted)).transpose()?;
        self.part("profiles", &profiles)
    }

    /// The profiles as CSV: one row per instant and radius; no rows if the document has none.
    pub fn profiles_csv(&self, wanted: &Selection) -> Result<String, Error> {
        let axes = ["cycles", "radius"].into_iter();
        let Some(members) = &self.profiles else {
            return Ok(self.heading("profiles", axes));
        };
        let profiles = Profiles::select(members, wanted)?;
        let names = profiles.columns.iter().map(|(name, _)| *name);
        let mut out = self.heading("profiles", axes.chain(names));
        for (instant, cycles) in profiles.cycles.iter().enumerate() {
            for (place, radius) in profiles.radius.iter().enumerate() {
                let fields = profiles.columns.iter().map(|(_, column)| column.at(instant, place));
                push_row(&mut out, [cell(cycles), cell(radius)].into_iter().chain(fields));
            }
        }
        Ok(out)
    }

    /// The loops alone, as JSON; null if the document has none.
    pub fn loops_json(&self) -> Result<Vec<u8>, Error> {
        self.part("loops", &self.loops)
    }

    /// The loops as CSV: one row per instant and point; no rows if the document has none.
    pub fn loops_csv(&self) -> Result<String, Error> {
        let names = ["cycles", "displacement", "tangential_force"];
        let mut out = self.heading("loops", names.into_iter());
        let Some(members) = &self.loops else { return Ok(out) };
        let find = |name: &str| members.0.iter().find(|(member, _)| member == name);
        let cycles: Vec<&RawValue> = match find("cycles") {
            Some((_, text)) => serde_json::from_str(text.get())?,
            None => Vec::new(),
        };
        let mut columns = Vec::new();
        for name in &names[1..] {
            columns.push(find(name).map_or(Ok(Column::Absent), |(_, text)| Column::parse(text))?);
        }
        for (instant, cycles) in cycles.iter().enumerate() {
            for place in 0..columns.first().map_or(0, |column| column.width(instant)) {
                let fields = columns.iter().map(|column| column.at(instant, place));
                push_row(&mut out, std::iter::once(cell(cycles)).chain(fields));
            }
        }
        Ok(out)
    }

    fn part(&self, name: &str, value: &impl Serialize) -> Result<Vec<u8>, Error> {
        let mut out = Vec::new();
        let mut json = serde_json::Serializer::new(&mut out);
        let mut map = (&mut json).serialize_map(Some(4))?;
        map.serialize_entry("key", self.key)?;
        map.serialize_entry("engine", self.engine)?;
        map.serialize_entry("units", &self.units)?;
        map.serialize_entry(name, value)?;
        map.end()?;
        Ok(out)
    }

    /// The comment lines that say what this is, and the header row with units.
    fn heading<'n>(&self, part: &str, names: impl Iterator<Item = &'n str>) -> String {
        let key = self.key.get().trim_matches('"');
        let engine = self.engine.get();
        let mut out = format!("# fretwork {part}\n# key: {key}\n# engine: {engine}\n");
        let headers: Vec<String> = names.map(|name| self.header(name)).collect();
        push_row(&mut out, headers.iter().map(String::as_str));
        out
    }

    fn header(&self, name: &str) -> String {
        let unit = self.units.0.iter().find(|(member, _)| member == name);
        match unit.map(|(_, unit)| unit.get().trim_matches('"')) {
            None | Some("" | "1" | "null") => name.to_owned(),
            Some(unit) => format!("{name}[{unit}]"),
        }
    }
}

fn push_row<'c>(out: &mut String, cells: impl Iterator<Item = &'c str>) {
    for (index, cell) in cells.enumerate() {
        if index > 0 {
            out.push(',');
        }
        out.push_str(cell);
    }
    out.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    const RESULT: &[u8] = br#"{"key": "ab", "engine": {"name":"fretwork","numerics":1},
        "units": {"cycles": "1", "wear_volume": "m^3", "radius": "m", "worn": "m"},
        "history": {"cycles": [0, 1e3], "wear_volume": [0.0, 1.50e-13]},
        "profiles": {"cycles": [0, 1e3], "radius": [0, 1, 2], "initial": [0, 1, 4],
                     "limiting": null, "worn": [[0, 1, 4], [null, 2, 5]]}}"#;

    fn profiles(wanted: &Selection) -> Result<String, Error> {
        Document::open(RESULT).unwrap().profiles_csv(wanted)
    }

    fn rows(csv: &str) -> Vec<&str> {
        csv.lines().filter(|line| !line.starts_with('#')).collect()
    }

    #[test]
    fn a_history_is_one_row_per_instant_with_the_digits_of_the_document() {
        let csv = Document::open(RESULT).unwrap().history_csv().unwrap();
        assert!(csv.starts_with("# fretwork history\n# key: ab\n# engine: {\"name\""));
        assert_eq!(rows(&csv), ["cycles,wear_volume[m^3]", "0,0.0", "1e3,1.50e-13"]);
    }

    #[test]
    fn profiles_are_one_row_per_instant_and_radius() {
        let csv = profiles(&Selection::default()).unwrap();
        let expected = [
            "cycles,radius[m],initial,limiting,worn[m]",
            "0,0,0,,0",
            "0,1,1,,1",
            "0,2,4,,4",
            "1e3,0,0,,",
            "1e3,1,1,,2",
            "1e3,2,4,,5",
        ];
        assert_eq!(rows(&csv), expected);
    }

    #[test]
    fn profiles_can_be_cut_by_field_instant_and_point() {
        let wanted = Selection {
            fields: Some(vec!["worn".into()]),
            cycles: Some(vec![1000.0]),
            points: Some(2),
        };
        assert_eq!(
            rows(&profiles(&wanted).unwrap()),
            ["cycles,radius[m],worn[m]", "1e3,0,", "1e3,2,5"]
        );
        let json = Document::open(RESULT).unwrap().profiles_json(&wanted).unwrap();
        let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
        assert_eq!(
            json["profiles"],
            serde_json::json!({"cycles": [1e3], "radius": [0, 2], "worn": [[null, 5]]})
        );
    }

    #[test]
    fn what_is_not_there_is_refused_by_naming_what_is() {
        let wanted = Selection { fields: Some(vec!["warn".into()]), ..Selection::default() };
        let refusal = profiles(&wanted).unwrap_err().to_string();
        assert!(refusal.ends_with("there are initial, limiting, worn"), "{refusal}");
        let wanted = Selection { cycles: Some(vec![7.0]), ..Selection::default() };
        let refusal = profiles(&wanted).unwrap_err().to_string();
        assert!(refusal.contains("no profile at 7 cycles"), "{refusal}");
    }

    #[test]
    fn without_profiles_there_is_a_header_and_null() {
        let text = r#"{"key":"ab","engine":1,"units":{},"history":{},"profiles":null}"#;
        let document = Document::open(text.as_bytes()).unwrap();
        let wanted = Selection::default();
        assert_eq!(rows(&document.profiles_csv(&wanted).unwrap()), ["cycles,radius"]);
        assert!(document.profiles_json(&wanted).unwrap().ends_with(b"\"profiles\":null}"));
    }

    #[test]
    fn loops_are_one_row_per_instant_and_point() {
        let text = r#"{"key":"ab","engine":1,"units":{"displacement":"m","tangential_force":"N"},
            "history":{},"profiles":null,"loops":{"cycles":[0,5],"displacement":[[1,-1],[2,-2]],
            "tangential_force":[[3,-3],[4.50,-4]],"energy_ratio":[0.1,0.2]}}"#;
        let csv = Document::open(text.as_bytes()).unwrap().loops_csv().unwrap();
        let expected = [
            "cycles,displacement[m],tangential_force[N]",
            "0,1,3",
            "0,-1,-3",
            "5,2,4.50",
            "5,-2,-4",
        ];
        assert_eq!(rows(&csv), expected);
        let none =
            r#"{"key":"ab","engine":1,"units":{},"history":{},"profiles":null,"loops":null}"#;
        let csv = Document::open(none.as_bytes()).unwrap().loops_csv().unwrap();
        assert_eq!(rows(&csv), ["cycles,displacement,tangential_force"]);
    }

    #[test]
    fn a_spread_keeps_both_ends() {
        assert_eq!(spread(5, 3), [0, 2, 4]);
        assert_eq!(spread(3, 9), [0, 1, 2]);
        assert_eq!(spread(256, 2), [0, 255]);
        assert_eq!(spread(0, 2), [] as [usize; 0]);
    }
}
