//! Finds the table in a text.

use fretwork_engine::request::fault::unknown;
use fretwork_engine::request::quantity::Dimension;
use serde::Serialize;

use super::cell::{Cell, header, remedy, unit};
use super::text::decode;

/// Maximum number of bytes of a file.
pub const MAX_BYTES: usize = 4 << 20;
/// Maximum number of rows of a table.
pub const MAX_ROWS: usize = 100_000;
/// Maximum number of columns of a table.
const MAX_COLUMNS: usize = 64;
/// Maximum number of lines before the table.
const MAX_HEAD: usize = 1000;
/// Number of last lines that decide on the separator.
const SAMPLE: usize = 500;
/// The characters that separate cells. Where two are possible, the first is.
const SEPARATORS: [(char, &str); 4] =
    [(';', "semicolons"), ('\t', "tabs"), (',', "commas"), (' ', "spaces")];

/// A column of numbers in SI.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Column {
    /// The name in the header, without the unit.
    pub name: String,
    /// The unit of the values, which is an SI unit if the engine knows the unit of the file. Null if the file states none.
    pub unit: Option<String>,
    /// The dimension, such as `length`. Null if the unit is unknown.
    pub dimension: Option<Dimension>,
    /// The values. Null stands for an unknown number.
    pub values: Vec<Option<f64>>,
    /// The unit in the file.
    #[serde(skip)]
    stated: Option<String>,
}

impl Column {
    /// Converts the values from the unit `text`, and returns what was done.
    fn convert(&mut self, text: &str) -> String {
        let (dimension, factor) = unit(text).unwrap_or((None, 1.0));
        let si = dimension.map_or(text, |it| if it == Dimension::Number { "1" } else { it.si() });
        for value in self.values.iter_mut().flatten() {
            *value *= factor;
        }
        (self.dimension, self.unit) = (dimension, Some(si.to_owned()));
        self.stated = Some(text.to_owned());
        match dimension {
            Some(_) => format!("“{}” was read in {text}.", self.name),
            None => format!("“{}” stays in {text}, which is no unit of a scenario.", self.name),
        }
    }
}

/// A table, and what was done to read it.
pub struct Table {
    pub columns: Vec<Column>,
    pub notes: Vec<String>,
}

/// A line with its number in the file.
type Line<'a> = (usize, &'a str);
/// The name of a column, and the unit that the file states.
type Name = (String, Option<String>);

fn two_units(one: &str, other: &str) -> String {
    format!("has two units, {one} and {other}. Write only one of them")
}

/// The cells of a line.
fn cells(line: &str, separator: char) -> Vec<&str> {
    let (mut is_quoted, mut at) = (false, 0);
    let cells = line.split(|c: char| {
        is_quoted ^= c == '"';
        at += c.len_utf8();
        // The space before a unit in brackets separates nothing.
        let is_space = separator == ' ' && (c == ' ' || c == '\t');
        !is_quoted
            && (c == separator || is_space)
            && !(is_space && line[at..].starts_with(['[', '(']))
    });
    let cells = cells.map(|cell| cell.trim().trim_matches('"').trim());
    cells.filter(|cell| separator != ' ' || !cell.is_empty()).take(MAX_COLUMNS + 1).collect()
}

/// How many cells are numbers, and how many are texts.
fn count<'a>(cells: impl IntoIterator<Item = &'a str>) -> (i64, i64) {
    cells.into_iter().map(Cell::read).fold((0, 0), |(numbers, texts), cell| match cell {
        Cell::Number(_) => (numbers + 1, texts),
        Cell::Unknown => (numbers, texts),
        Cell::Text => (numbers, texts + 1),
    })
}

/// The most frequent number of cells in lines with numbers, and how many more of them are numbers than texts.
fn layout(lines: &[Line<'_>], separator: char) -> Option<(i64, usize)> {
    let mut found = vec![(0, 0); MAX_COLUMNS + 2];
    for (_, line) in lines {
        let cells = cells(line, separator);
        if let (numbers @ 1.., texts) = count(cells.iter().copied()) {
            found[cells.len()].0 += 1;
            found[cells.len()].1 += numbers - texts;
        }
    }
    let widths = (2..found.len()).filter(|width| found[*width].0 > 0);
    widths.max_by_key(|width| found[*width].0).map(|width| (found[width].1, width))
}

impl Table {
    /// Reads a file.
    ///
    /// # Errors
    /// A sentence that says what is wrong, and what to change.
    pub fn read(bytes: &[u8]) -> Result<Self, String> {
        if bytes.len() > MAX_BYTES {
            return Err(format!(
                "The file has more than {MAX_BYTES} bytes. Remove columns or rows"
            ));
        }
        let mut notes = Vec::new();
        let text = decode(bytes, &mut notes)?;
        let end = if text.contains('\n') { '\n' } else { '\r' };
        let lines = text.split(end).enumerate().map(|(at, line)| (at + 1, line));
        let lines =
            lines.filter(|(_, line)| !line.trim_matches([' ', '\t', '\r', ';', ',']).is_empty());
        let lines: Vec<Line<'_>> = lines.take(MAX_HEAD + MAX_ROWS + 1).collect();
        let sample = &lines[lines.len().saturating_sub(SAMPLE)..];
        let layouts = SEPARATORS.iter().rev();
        let layouts = layouts.filter_map(|it| Some((layout(sample, it.0)?, it)));
        let best = layouts.max_by_key(|((score, _), _)| *score);
        let Some(((_, width), (separator, name))) = best else {
            return Err("The file has no table of numbers. Write at least two columns, separated by semicolons, \
                        tabs, commas or spaces, and one row for each point".to_owned());
        };
        if width > MAX_COLUMNS {
            return Err(format!("The table has more than {MAX_COLUMNS} columns. Remove some"));
        }
        notes.push(format!("Cells are separated by {name}."));
        let reading = Reading { lines, separator: *separator, separators: name, width, notes };
        let (start, are_numbers) = reading.start();
        if reading.lines.len() - start > MAX_ROWS {
            return Err(format!(
                "The table has more than {MAX_ROWS} rows. Keep, for example, every tenth row"
            ));
        }
        reading.columns(start, &are_numbers)
    }
}

/// A file whose layout is known.
struct Reading<'a> {
    lines: Vec<Line<'a>>,
    separator: char,
    separators: &'static str,
    width: usize,
    notes: Vec<String>,
}

impl<'a> Reading<'a> {
    /// The cells of a line, if it has as many as the table has columns.
    fn row(&self, at: usize) -> Option<Vec<&'a str>> {
        let (_, line) = self.lines.get(at)?;
        let cells = cells(line.trim_start_matches('#'), self.separator);
        Some(cells).filter(|cells| cells.len() == self.width)
    }

    /// The first row of numbers, and which columns have more numbers than texts in rows with numbers.
    fn start(&self) -> (usize, Vec<bool>) {
        let mut counts = vec![(0, 0); self.width];
        let rows = || (0..self.lines.len()).filter_map(|at| Some((at, self.row(at)?)));
        for (_, cells) in rows().filter(|(_, cells)| count(cells.iter().copied()).0 > 0) {
            for (cell, counts) in cells.into_iter().zip(&mut counts) {
                let (numbers, texts) = count([cell]);
                *counts = (counts.0 + numbers, counts.1 + texts);
            }
        }
        let are_numbers: Vec<bool> = counts.iter().map(|it| it.0 > 0 && it.0 >= it.1).collect();
        let own = |cells: &[&str]| {
            let own = cells.iter().zip(&are_numbers).filter(|(_, is_number)| **is_number);
            count(own.map(|(cell, _)| *cell))
        };
        let first = rows().find(|(_, cells)| matches!(own(cells), (1.., 0)));
        let mut start = first.map_or(0, |(at, _)| at);
        // A row with a number just above is a row of numbers with a fault.
        while start > 0 && self.row(start - 1).is_some_and(|cells| own(&cells).0 > 0) {
            start -= 1;
        }
        (start, are_numbers)
    }

    /// The names of the columns and their units, from the one or two rows above the first row of numbers.
    fn names(&mut self, start: usize) -> Result<Vec<Name>, String> {
        let above = |count: usize| self.row(start.checked_sub(count)?);
        let is_unit = |cell: &&str| cell.starts_with('[') || unit(cell).is_some();
        let units = above(1).filter(|cells| above(2).is_some() && cells.iter().all(is_unit));
        let rows = if units.is_some() { 2 } else { 1 };
        let names = above(rows);
        let head = start - start.min(names.as_ref().map_or(0, |_| rows));
        if let Some((_, first)) = self.lines[..head].first() {
            let first: String = first.trim().chars().take(40).collect();
            self.notes.push(format!("{head} line(s) before the table were not read: “{first}”."));
        }
        if names.is_none() {
            self.notes.push(
                "The table has no row of names. Its columns are called by their numbers."
                    .to_owned(),
            );
        }
        let name = |place: usize| {
            let (name, own) = header(names.as_ref().map_or("", |names| names[place]));
            let below = units.as_ref().map(|units| units[place].trim_matches(['[', ']']));
            let name =
                if name.is_empty() { format!("column {}", place + 1) } else { name.to_owned() };
            match (own, below.filter(|unit| !unit.is_empty())) {
                (Some(own), Some(below)) if unit(own) != unit(below) => {
                    Err(format!("“{name}” {}", two_units(own, below)))
                }
                (own, below) => Ok((name, own.or(below).map(str::to_owned))),
            }
        };
        (0..self.width).map(name).collect()
    }

    /// Reads the numbers.
    fn columns(mut self, start: usize, are_numbers: &[bool]) -> Result<Table, String> {
        let names = self.names(start)?;
        let mut columns: Vec<Vec<Option<f64>>> = vec![Vec::new(); self.width];
        let (mut marks, mut faults) = ([None::<&str>; 2], Vec::new());
        for (number, line) in self.lines[start..].iter().filter(|(_, line)| !line.starts_with('#'))
        {
            let cells = cells(line, self.separator);
            if cells.len() != self.width {
                let (count, width, name) = (cells.len(), self.width, self.separators);
                return Err(format!(
                    "Line {number} has {count} cell(s), but the table has {width} columns. Separate the cells of all lines \
                     by {name}, and write one cell for each column"
                ));
            }
            for (place, cell) in
                cells.into_iter().enumerate().filter(|(place, _)| are_numbers[*place])
            {
                let read = Cell::read(cell);
                if read == Cell::Text {
                    let (name, _) = &names[place];
                    faults.push(format!(
                        "Line {number}: “{cell}” in “{name}” {}",
                        remedy(cell, name)
                    ));
                }
                for (mark, first) in ['.', ','].iter().zip(&mut marks) {
                    *first =
                        first
                            .or(Some(cell)
                                .filter(|cell| cell.contains(*mark) && read != Cell::Unknown));
                }
                columns[place].push(if let Cell::Number(number) = read {
                    Some(number)
                } else {
                    None
                });
            }
        }
        match (faults.first(), marks) {
            (Some(first), _) if faults.len() == 1 => return Err(first.clone()),
            (Some(first), _) => {
                return Err(format!("{first}. {} more cell(s) are no numbers", faults.len() - 1));
            }
            (None, [Some(point), Some(comma)]) => {
                return Err(format!(
                    "The numbers have points and commas, such as “{point}” and “{comma}”. Write all of them with the same \
                 decimal mark, without separators of thousands"
                ));
            }
            (None, [_, Some(comma)]) => {
                let read = comma.replace(',', ".");
                self.notes.push(format!("Commas are decimal marks: “{comma}” was read as {read}."));
            }
            (None, _) => {}
        }
        let mut table = Table { columns: Vec::new(), notes: self.notes };
        for (((name, unit), values), is_number) in names.into_iter().zip(columns).zip(are_numbers) {
            if !is_number {
                table.notes.push(format!(
                    "“{name}” has texts and was not read. Units belong into the header."
                ));
                continue;
            }
            let mut column = Column { name, unit: None, dimension: None, values, stated: None };
            table.notes.extend(unit.map(|unit| column.convert(&unit)));
            table.columns.push(column);
        }
        Ok(table)
    }
}

impl Table {
    /// A column by its name, which may have a unit if the file states none. Without a name, the column at `place`.
    ///
    /// # Errors
    /// The table has no such column, or it has another unit.
    pub fn column(&mut self, place: usize, wanted: Option<&str>) -> Result<Column, String> {
        let names: Vec<&str> = self.columns.iter().map(|column| &*column.name).collect();
        let Some(wanted) = wanted else {
            return self
                .columns
                .get(place)
                .cloned()
                .ok_or_else(|| "is missing: the file has only one column".to_owned());
        };
        let plain = |name: &str| name.to_lowercase().replace([' ', '_', '-'], "");
        let (name, stated) = header(wanted);
        let is_named =
            |place: &usize| [wanted, name].iter().any(|name| plain(names[*place]) == plain(name));
        let found: Vec<usize> = (0..names.len()).filter(is_named).collect();
        let [found] = found[..] else {
            return Err(match found.len() {
                0 => unknown("column", name, &names),
                count => {
                    format!("is the name of {count} columns. Give them different names in the file")
                }
            });
        };
        let mut column = self.columns[found].clone();
        let Some(stated) = stated else { return Ok(column) };
        match &column.stated {
            Some(own) if unit(own) == unit(stated) => {}
            Some(own) => return Err(two_units(own, stated)),
            None if unit(stated).is_none() => {
                return Err(format!("has the unknown unit “{stated}”"));
            }
            None => self.notes.push(column.convert(stated)),
        }
        Ok(column)
    }
}
