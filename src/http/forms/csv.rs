//! Tables as CSV: comment lines that say what this is, a header row with units, one row per row.

use std::io;

use super::document::Document;
use super::table::Table;
use super::{Ask, Sink};

/// A table as CSV. Empty cells are numbers that are infinite or not defined.
pub fn table(
    out: &mut impl Sink,
    document: &Document<'_>,
    table: &Table,
    ask: &Ask,
) -> io::Result<()> {
    let units = &document.telling.units;
    let (part, key, engine) = (table.part.name(), &document.key, document.engine);
    let system = if ask.engineering { "engineering" } else { "SI" };
    out.expect(table.room(0));
    write!(out, "# fretwork {part}\n# key: {key}\n# engine: {engine}\n# units: {system}\n")?;
    if let Some(digits) = ask.digits {
        writeln!(out, "# digits: {digits}")?;
    }
    let names: Vec<_> = table.columns.iter().map(|(name, _)| units.header(name)).collect();
    writeln!(out, "{}", names.join(","))?;
    for (instant, place) in table.rows() {
        for (index, (_, values)) in table.columns.iter().enumerate() {
            if index > 0 {
                out.write_all(b",")?;
            }
            let number = values.at(instant, place);
            if number.is_finite() {
                // As in JSON, to the letter.
                serde_json::to_writer(&mut *out, &number)?;
            }
        }
        out.write_all(b"\n")?;
    }
    Ok(())
}
