//! Tables as CSV: comment lines about the result (unless they are not wanted), a header row with units, one line per row.

use std::io::Write;

use super::document::Head;
use super::error::Result;
use super::out::Out;
use super::table::{Cell, Table};
use super::view::View;

/// Writes a table as CSV. Infinite and undefined numbers are empty cells.
pub fn table(out: &mut Out<'_>, head: &Head, table: &Table, view: &View) -> Result<()> {
    let Head { units, key, engine_text, .. } = head;
    if !view.without_comments {
        let system = if view.engineering { "engineering" } else { "SI" };
        let part = table.part.name();
        writeln!(
            out,
            "# fretwork {part}\n# key: {key}\n# engine: {engine_text}\n# units: {system}"
        )?;
        if let Some(digits) = view.digits {
            writeln!(out, "# digits: {digits}")?;
        }
    }
    let names: Vec<_> = table.columns.iter().map(|(name, _)| units.header(name)).collect();
    writeln!(out, "{}", names.join(","))?;
    for (cycle, point) in table.rows() {
        for (index, (_, values)) in table.columns.iter().enumerate() {
            if index > 0 {
                out.write_all(b",")?;
            }
            match values.cell(cycle, point) {
                // serde_json writes the number, so that it has the same digits as in JSON.
                Cell::Number(number) if number.is_finite() => {
                    serde_json::to_writer(&mut *out, &number)?;
                }
                Cell::Number(_) => {}
                Cell::Text(text) => out.write_all(text_cell(text).as_bytes())?,
            }
        }
        out.write_all(b"\n")?;
    }
    Ok(())
}

/// A text as a cell of CSV. A spreadsheet would execute a text that begins like a formula, so this one begins with an
/// apostrophe.
#[must_use]
pub fn text_cell(text: &str) -> String {
    const FORMULA: [char; 11] = ['=', '+', '-', '@', '\t', '\r', '\n', '＝', '＋', '－', '＠'];
    let guard = if text.starts_with(FORMULA) { "'" } else { "" };
    format!("\"{guard}{}\"", text.replace('"', "\"\""))
}
