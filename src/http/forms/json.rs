//! Results as JSON: whole, in columns, in rows, and in lines of their own (NDJSON).

use serde::ser::SerializeMap as _;
use serde::{Serialize, Serializer};

use super::document::Document;
use super::table::Table;
use super::{Error, Sink};

/// A whole document as it is told.
pub fn whole(out: &mut impl Sink, document: &Document<'_>) -> Result<(), Error> {
    let members = document.members()?;
    Ok(serde_json::Serializer::new(out).collect_map(members)?)
}

/// A table as the document has it, beside whose it is.
pub fn columns(out: &mut impl Sink, document: &Document<'_>, table: &Table) -> Result<(), Error> {
    out.expect(table.room(0));
    framed(out, document, table.part.name(), table)
}

/// A table as a list of rows, which is what tools for tables take.
pub fn records(out: &mut impl Sink, document: &Document<'_>, table: &Table) -> Result<(), Error> {
    let names: usize = table.columns.iter().map(|(name, _)| name.len() + PUNCTUATION).sum();
    out.expect(table.room(names));
    framed(out, document, "records", &Rows(table))
}

/// What stands around a name: quotes and a colon.
const PUNCTUATION: usize = 3;

fn framed(
    out: &mut impl Sink,
    document: &Document<'_>,
    name: &str,
    value: &impl Serialize,
) -> Result<(), Error> {
    let mut json = serde_json::Serializer::new(out);
    let mut map = json.serialize_map(Some(4))?;
    map.serialize_entry("key", &document.key)?;
    map.serialize_entry("engine", document.engine)?;
    map.serialize_entry("units", &document.telling.units)?;
    map.serialize_entry(name, value)?;
    Ok(map.end()?)
}

/// One object per row and line. Tools that read lines take all of them for rows, so there is no
/// first line apart: the units are in the names, as in CSV, and each row says whose it is, so that
/// lines of many results can be poured together.
pub fn lines(out: &mut impl Sink, document: &Document<'_>, table: &Table) -> Result<(), Error> {
    let engine = document.made_by.to_string();
    let units = &document.telling.units;
    let names: Vec<_> = table.columns.iter().map(|(name, _)| units.header(name)).collect();
    let whose = document.key.len() + engine.len() + "{\"key\":\"\",\"engine\":\"\",}".len();
    let named: usize = names.iter().map(|name| name.len() + PUNCTUATION).sum();
    out.expect(table.room(whose + named));
    for (instant, place) in table.rows() {
        let mut json = serde_json::Serializer::new(&mut *out);
        let mut map = json.serialize_map(None)?;
        map.serialize_entry("key", &document.key)?;
        map.serialize_entry("engine", &engine)?;
        for (name, (_, values)) in names.iter().zip(&table.columns) {
            map.serialize_entry(name, &values.at(instant, place))?;
        }
        map.end()?;
        out.write_all(b"\n")?;
    }
    Ok(())
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
