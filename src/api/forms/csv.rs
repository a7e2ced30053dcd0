//! Tables as CSV: comment lines that say what this is, a header row with units, one row per row.

use std::fmt::Write as _;

use super::Ask;
use super::document::Document;
use super::table::Table;

/// A table as CSV. Empty cells are numbers that are infinite or not defined.
pub fn table(document: &Document<'_>, table: &Table, ask: &Ask) -> Vec<u8> {
    let units = &document.telling.units;
    let (part, key, engine) = (table.part.name(), &document.key, document.engine);
    let system = if ask.engineering { "engineering" } else { "SI" };
    let mut out =
        format!("# fretwork {part}\n# key: {key}\n# engine: {engine}\n# units: {system}\n");
    if let Some(digits) = ask.digits {
        // Writing to memory does not fail, here and below.
        let _ = writeln!(out, "# digits: {digits}");
    }
    let names: Vec<_> = table.columns.iter().map(|(name, _)| units.header(name)).collect();
    out.push_str(&names.join(","));
    out.push('\n');
    let mut out = out.into_bytes();
    out.reserve(table.room(0));
    for (instant, place) in table.rows() {
        for (index, (_, values)) in table.columns.iter().enumerate() {
            if index > 0 {
                out.push(b',');
            }
            let number = values.at(instant, place);
            if number.is_finite() {
                // As in JSON, to the letter.
                let _ = serde_json::to_writer(&mut out, &number);
            }
        }
        out.push(b'\n');
    }
    out.shrink_to_fit();
    out
}
