//! Tables as CSV: comment lines about the result (unless they are not wanted), a header row with units, one line per row.

use std::io::Write;
use std::iter;

use super::table::Cell;
use super::{Head, Out, PartTable, Result, View};

/// Writes a table as CSV. Infinite and undefined numbers are empty cells.
pub fn table(out: &mut Out<'_>, head: &Head, table: &PartTable, view: &View) -> Result<()> {
    let Head { units, key, engine_text, .. } = head;
    if !view.without_comments {
        let system = if view.engineering { "engineering" } else { "SI" };
        let part = table.part.as_str();
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

/// A text as a cell of CSV. A spreadsheet would execute what begins like a formula, also behind the separators of lists that other
/// countries use, so an apostrophe stands before it.
pub fn text_cell(text: &str) -> String {
    const FORMULA: [char; 11] = ['=', '+', '-', '@', '\t', '\r', '\n', '＝', '＋', '－', '＠'];
    const SEPARATORS: [char; 5] = [';', '|', '\t', '\r', '\n'];
    let invisible = |it: char| {
        it.is_whitespace()
            || it.is_control()
            || matches!(it, '"' | '\'' | '\u{ad}' | '\u{200b}'..='\u{206f}' | '\u{feff}')
    };
    let (mut cell, mut is_start) = (String::from("\""), true);
    for letter in text.chars() {
        if is_start && FORMULA.contains(&letter) {
            cell.push('\'');
        }
        is_start = SEPARATORS.contains(&letter) || is_start && invisible(letter);
        cell.extend(iter::repeat_n(letter, if letter == '"' { 2 } else { 1 }));
    }
    cell + "\""
}
