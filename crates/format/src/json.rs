//! Results as JSON: whole, in columns, in rows, and as newline-delimited rows (NDJSON).

use std::io::Write;

use serde::ser::SerializeMap as _;
use serde::{Serialize, Serializer};

use super::{Head, Out, PartTable, Result};

/// Writes a table under a name, after the key, the engine and the units.
pub fn framed(out: &mut Out<'_>, head: &Head, name: &str, value: &impl Serialize) -> Result<()> {
    let mut json = serde_json::Serializer::new(out);
    let mut map = json.serialize_map(Some(4))?;
    map.serialize_entry("key", &head.key)?;
    map.serialize_entry("engine", &head.engine_text)?;
    map.serialize_entry("units", &head.units)?;
    map.serialize_entry(name, value)?;
    Ok(map.end()?)
}

/// Writes one object per row, each on its own line.
///
/// Readers of NDJSON treat every line as a row, so there is no header line. Units are in the names, as in
/// CSV. Each row contains the key and the engine, so that the lines of many results can be joined.
pub fn lines(out: &mut Out<'_>, head: &Head, table: &PartTable) -> Result<()> {
    let engine = head.engine.to_string();
    let units = &head.units;
    let names: Vec<_> = table.columns.iter().map(|(name, _)| units.header(name)).collect();
    for (cycle, point) in table.rows() {
        let mut json = serde_json::Serializer::new(&mut *out);
        let mut map = json.serialize_map(None)?;
        map.serialize_entry("key", &head.key)?;
        map.serialize_entry("engine", &engine)?;
        for (name, (_, values)) in names.iter().zip(&table.columns) {
            map.serialize_entry(name, &values.cell(cycle, point))?;
        }
        map.end()?;
        out.write_all(b"\n")?;
    }
    Ok(())
}

/// A table as a list of rows, which spreadsheets and dashboards expect.
pub struct Records<'a>(pub &'a PartTable);

impl Serialize for Records<'_> {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        json.collect_seq(self.0.rows().map(|row| JsonRow(self.0, row)))
    }
}

struct JsonRow<'a>(&'a PartTable, (usize, usize));

impl Serialize for JsonRow<'_> {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        let Self(table, (cycle, point)) = *self;
        json.collect_map(
            table.columns.iter().map(|(name, values)| (name, values.cell(cycle, point))),
        )
    }
}
