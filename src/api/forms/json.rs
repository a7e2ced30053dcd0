//! Results as JSON: whole, in columns, in rows, and in lines of their own (NDJSON).

use serde::ser::SerializeMap as _;
use serde::{Serialize, Serializer};

use super::Error;
use super::document::Document;
use super::table::Table;

/// A whole document as it is told.
pub fn whole(document: &Document<'_>) -> Result<Vec<u8>, Error> {
    let members = document.members()?;
    let mut out = Vec::new();
    serde_json::Serializer::new(&mut out).collect_map(members)?;
    Ok(out)
}

/// A table as the document has it, beside whose it is.
pub fn columns(document: &Document<'_>, table: &Table) -> Result<Vec<u8>, Error> {
    framed(document, table.part.name(), table, table.room(0))
}

/// A table as a list of rows, which is what tools for tables take.
pub fn records(document: &Document<'_>, table: &Table) -> Result<Vec<u8>, Error> {
    let names: usize = table.columns.iter().map(|(name, _)| name.len() + PUNCTUATION).sum();
    framed(document, "records", &Rows(table), table.room(names))
}

/// What stands around a name: quotes and a colon.
const PUNCTUATION: usize = 3;

fn framed(
    document: &Document<'_>,
    name: &str,
    value: &impl Serialize,
    room: usize,
) -> Result<Vec<u8>, Error> {
    let mut out = Vec::with_capacity(room);
    let mut json = serde_json::Serializer::new(&mut out);
    let mut map = json.serialize_map(Some(4))?;
    map.serialize_entry("key", &document.key)?;
    map.serialize_entry("engine", document.engine)?;
    map.serialize_entry("units", &document.telling.units)?;
    map.serialize_entry(name, value)?;
    map.end()?;
    out.shrink_to_fit();
    Ok(out)
}

/// One object per row and line. Tools that read lines take all of them for rows, so there is no
/// first line apart: the units are in the names, as in CSV, and each row says whose it is, so that
/// lines of many results can be poured together.
pub fn lines(document: &Document<'_>, table: &Table) -> Result<Vec<u8>, Error> {
    let engine = document.made_by.to_string();
    let units = &document.telling.units;
    let names: Vec<_> = table.columns.iter().map(|(name, _)| units.header(name)).collect();
    let whose = document.key.len() + engine.len() + "{\"key\":\"\",\"engine\":\"\",}".len();
    let named: usize = names.iter().map(|name| name.len() + PUNCTUATION).sum();
    let mut out = Vec::with_capacity(table.room(whose + named));
    for (instant, place) in table.rows() {
        let mut json = serde_json::Serializer::new(&mut out);
        let mut map = json.serialize_map(None)?;
        map.serialize_entry("key", &document.key)?;
        map.serialize_entry("engine", &engine)?;
        for (name, (_, values)) in names.iter().zip(&table.columns) {
            map.serialize_entry(name, &values.at(instant, place))?;
        }
        map.end()?;
        out.push(b'\n');
    }
    out.shrink_to_fit();
    Ok(out)
}

struct Rows<'a>(&'a Table);

impl Serialize for Rows<'_> {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        json.collect_seq(self.0.rows().map(|place| Row(self.0, place)))
    }
}

struct Row<'a>(&'a Table, (usize, usize));

impl Serialize for Row<'_> {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        let Self(table, (instant, place)) = *self;
        json.collect_map(
            table.columns.iter().map(|(name, column)| (name, column.at(instant, place))),
        )
    }
}
