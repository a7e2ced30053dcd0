//! Finds the table in a text.

use fretwork_engine::request::fault::unknown;
use fretwork_engine::request::quantity::Dimension;
use serde::Serialize;

use super::cell::{has_thousands, header, is_grouped, number, unit};
use super::text::decode;

/// Maximum number of rows of a table.
pub const MAX_ROWS: usize = 100_000;
/// Maximum number of columns of a table.
const MAX_COLUMNS: usize = 64;
/// Maximum number of lines before the table.
const MAX_HEAD: usize = 1000;
/// Maximum number of characters of a name, and of a cell in a fault.
const MAX_NAME: usize = 200;
/// Number of last lines that decide on the separator.
const SAMPLE: usize = 500;
/// The characters that separate cells. Where two are possible, the last one does. Tabs and semicolons do so surely.
const SEPARATORS: [(char, &str); 4] =
    [(' ', "spaces"), (',', "commas"), ('\t', "tabs"), (';', "semicolons")];

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
    /// Converts the values from the unit `text` to SI.
    fn convert(&mut self, text: &str, notes: &mut Vec<String>) -> Result<(), String> {
        if text.contains('[') || self.stated.as_ref().is_some_and(|own| unit(own) != unit(text)) {
            let own = self.stated.as_ref().map_or(String::new(), |own| format!("[{own}] "));
            return Err(format!("has two units: {own}[{text}]. Write only one of them"));
        }
        if self.stated.is_some() {
            return Ok(());
        }
        let known = unit(text);
        let read = if known.is_some() { "was read in" } else { "stays in the unknown unit" };
        notes.push(format!("“{}” {read} {text}.", self.name));
        let (dimension, si, factor) = known.unwrap_or((None, text.to_owned(), 1.0));
        self.values.iter_mut().flatten().for_each(|value| *value *= factor);
        (self.dimension, self.unit) = (dimension, Some(si));
        self.stated = Some(text.to_owned());
        Ok(())
    }
}

/// The cells of a line.
fn cells(line: &str, separator: char) -> Vec<&str> {
    let (mut is_quoted, mut at) = (false, 0);
    let cells = line.split(|c: char| {
        is_quoted ^= c == '"';
        at += c.len_utf8();
        // The space before a unit in brackets separates nothing.
        let is_space = separator == ' ' && " \t".contains(c) && !line[at..].starts_with(['[', '(']);
        !is_quoted && (is_space || separator != ' ' && c == separator)
    });
    let cells = cells.map(|cell| cell.trim().trim_matches('"').trim());
    cells.filter(|cell| separator != ' ' || !cell.is_empty()).take(MAX_COLUMNS + 1).collect()
}

/// 1 for a number, 0 for an unknown number, and -1 for another text. Faulty numbers count as numbers, and are refused later.
fn weight(cell: &str) -> i64 {
    let other = if is_grouped(cell) { 1 } else { -1 };
    number(cell).map_or(other, |number| i64::from(!number.is_nan()))
}

/// The beginning of a text.
fn short(text: &str) -> String {
    text.chars().take(MAX_NAME).collect()
}

/// The sum of the weights, and which columns have numbers, for the most frequent number of cells in lines with numbers.
fn layout(lines: &[(usize, &str)], separator: char) -> (i64, Vec<bool>) {
    let rows = lines.iter().map(|(_, line)| cells(line, separator));
    let rows: Vec<_> = rows.filter(|row| row.iter().any(|cell| weight(cell) > 0)).collect();
    let count = |width: &usize| rows.iter().filter(|row| row.len() == *width).count();
    let width = (2..=MAX_COLUMNS).rev().max_by_key(count).unwrap_or(0);
    let rows = rows.iter().filter(|row| row.len() == width);
    let sums = (0..width).map(|place| rows.clone().map(|row| weight(row[place])).sum());
    let sums: Vec<i64> = sums.collect();
    (sums.iter().copied().chain(rows.map(|_| 1)).sum(), sums.iter().map(|sum| *sum >= 0).collect())
}

/// The lines of a file whose layout is known.
struct Lines<'a> {
    /// The number of each line in the file, and its text.
    all: Vec<(usize, &'a str)>,
    separator: char,
    separators: &'static str,
    /// Which columns have numbers.
    numbers: Vec<bool>,
}

impl<'a> Lines<'a> {
    fn of(text: &'a str) -> Result<Self, String> {
        let all = text.lines().enumerate().map(|(at, line)| (at + 1, line.trim_start_matches('#')));
        let all = all.filter(|(_, line)| !line.trim_matches([' ', '\t', ';', ',']).is_empty());
        let all: Vec<_> = all.take(MAX_HEAD + MAX_ROWS + 1).collect();
        let sample = &all[all.len().saturating_sub(SAMPLE)..];
        let found = SEPARATORS.map(|it| (layout(sample, it.0), it));
        let is_sure = |numbers: &[bool], separator: char| {
            ";\t".contains(separator) && numbers.iter().filter(|it| **it).count() > 1
        };
        let best = found.into_iter().max_by_key(|((score, numbers), (separator, _))| {
            (*score > 0 && is_sure(numbers, *separator), *score)
        });
        let Some(((1.., numbers), (separator, separators))) = best else {
            return Err(format!(
                "The file has no table of numbers. Write 2 to {MAX_COLUMNS} columns, separated by semicolons, tabs, \
                 commas or spaces, and one row for each point"
            ));
        };
        Ok(Self { all, separator, separators, numbers })
    }

    /// The cells of a line, if it has as many as the table.
    fn row(&self, at: usize) -> Option<Vec<&'a str>> {
        Some(cells(self.all.get(at)?.1, self.separator))
            .filter(|row| row.len() == self.numbers.len())
    }

    /// The first row of numbers.
    fn start(&self) -> usize {
        let weights = |at| -> Vec<i64> {
            let cells = self.row(at).into_iter().flatten().zip(&self.numbers);
            cells.filter(|(_, is_number)| **is_number).map(|(cell, _)| weight(cell)).collect()
        };
        let is_first = |at: &usize| weights(*at).contains(&1) && !weights(*at).contains(&-1);
        let start = (0..self.all.len()).find(is_first).unwrap_or(0);
        // A row with a number just above is a row of numbers with a fault.
        let is_fault = start > 0 && weights(start - 1).contains(&1) && !self.is_units(start - 1);
        start - usize::from(is_fault)
    }

    /// Whether all cells of a line are units.
    fn is_units(&self, at: usize) -> bool {
        let is_unit = |cell: &str| unit(cell).is_some() || header(cell).0.is_empty();
        self.row(at).is_some_and(|cells| cells.into_iter().all(is_unit))
    }

    /// The headers, from the one or two rows above the first row of numbers.
    fn headers(&self, start: usize, notes: &mut Vec<String>) -> Result<Vec<String>, String> {
        let above = |count: usize| self.row(start.checked_sub(count)?);
        let units = above(1).filter(|_| above(2).is_some() && self.is_units(start - 1));
        let names = above(1 + usize::from(units.is_some()));
        let before = start - usize::from(names.is_some()) - usize::from(units.is_some());
        if let Some((_, first)) = self.all[..before].first() {
            let first: String = first.trim().chars().take(40).collect();
            notes.push(format!("{before} line(s) before the table were not read: “{first}”."));
        }
        if names.is_none() {
            let (line, text) = start.checked_sub(1).map_or((0, ""), |last| self.all[last]);
            let (count, width) = (cells(text, self.separator).len(), self.numbers.len());
            if (2..width).contains(&count) || text.contains([';', '\t']) && count < 2 {
                return Err(format!(
                    "The rows have {width} columns, separated by {}, but line {line} has other names: “{}”. Write one \
                     name for each column, the same separator in all lines, and no separators of thousands",
                    self.separators,
                    short(text)
                ));
            }
            notes.push("The table has no row of names, so its columns have numbers.".to_owned());
        }
        let header = |place: usize| match (names.as_ref().map_or("", |names| names[place]), &units)
        {
            ("", _) => format!("column {}", place + 1),
            (name, Some(units)) => format!("{name} [{}]", units[place].trim_matches(['[', ']'])),
            (name, None) => name.to_owned(),
        };
        Ok((0..self.numbers.len()).map(|place| short(&header(place))).collect())
    }

    /// The numbers of the columns.
    fn columns(
        &self,
        start: usize,
        headers: &[String],
        notes: &mut Vec<String>,
    ) -> Result<Vec<Vec<Option<f64>>>, String> {
        let mut columns = vec![Vec::new(); headers.len()];
        let (mut point, mut comma, mut space) = ("", "", "");
        for (line, text) in &self.all[start..] {
            let cells = cells(text, self.separator);
            let (count, width, by) = (cells.len(), headers.len(), self.separators);
            if count != width {
                return Err(format!(
                    "Line {line} has {count} cell(s), but the table has {width} columns. Separate the cells of all \
                     lines by {by}, and write one cell for each column"
                ));
            }
            for (place, cell) in cells.into_iter().enumerate().filter(|(at, _)| self.numbers[*at]) {
                let read = number(cell).ok_or_else(|| {
                    format!(
                        "Line {line}: “{}” in “{}” is not a number. Write it like 1234.5, without separators of \
                         thousands and without its unit, or leave the cell empty if it is not known",
                        short(cell), headers[place]
                    )
                })?;
                let known = Some(read).filter(|read| !read.is_nan());
                // A number that could have a separator of thousands is the best example of a decimal comma.
                let found = |mark, best: &str| {
                    let at = cell.find(mark).filter(|_| known.is_some());
                    at.is_some_and(|at| best.is_empty() || cell.len() - at == 4)
                };
                point = if found('.', point) { cell } else { point };
                comma = if found(',', comma) { cell } else { comma };
                space = if has_thousands(cell) { cell } else { space };
                columns[place].push(known);
            }
        }
        if !comma.is_empty() && !point.is_empty() {
            return Err(format!(
                "The numbers have points and commas, such as “{point}” and “{comma}”. Write all of them with the same \
                 decimal mark, without separators of thousands"
            ));
        }
        let is_clear = point.find('.') != point.len().checked_sub(4) || point.starts_with('0');
        for (told, example) in [
            ("Points are decimal marks", if is_clear { "" } else { point }),
            ("Commas are decimal marks", comma),
            ("Spaces separate thousands", space),
        ] {
            if let Some(read) = number(example).filter(|_| !example.is_empty()) {
                notes.push(format!("{told}: “{example}” was read as {read}."));
            }
        }
        Ok(columns)
    }
}

/// A table, and what was done to read it.
pub struct Table {
    pub columns: Vec<Column>,
    pub notes: Vec<String>,
}

impl Table {
    /// Reads a file.
    ///
    /// # Errors
    /// A sentence that says what is wrong, and what to change.
    pub fn read(bytes: &[u8]) -> Result<Self, String> {
        let mut notes = Vec::new();
        let text = decode(bytes, &mut notes)?;
        let lines = Lines::of(&text)?;
        let start = lines.start();
        if lines.all.len() - start.min(MAX_HEAD) > MAX_ROWS {
            return Err(format!(
                "The table has more than {MAX_ROWS} rows. Keep, for example, every tenth row"
            ));
        }
        notes.push(format!("Cells are separated by {}.", lines.separators));
        let headers = lines.headers(start, &mut notes)?;
        let columns = lines.columns(start, &headers, &mut notes)?;
        let mut table = Self { columns: Vec::new(), notes };
        for (head, values) in headers.iter().zip(columns) {
            let (name, unit) = header(head);
            let mut name = name.to_owned();
            while table.columns.iter().any(|own| own.name == name) {
                name.push('\'');
            }
            let mut column = Column { name, unit: None, dimension: None, values, stated: None };
            if !column.values.iter().any(Option::is_some) {
                table.notes.push(format!(
                    "“{head}” has no numbers and was not read. Units belong into the header."
                ));
                continue;
            }
            let named = |detail| format!("“{head}” {detail}");
            unit.map_or(Ok(()), |unit| column.convert(unit, &mut table.notes)).map_err(named)?;
            table.columns.push(column);
        }
        Ok(table)
    }

    /// A column by its name, which may have a unit if the file states none. Without a name, the column at `place`.
    ///
    /// # Errors
    /// The table has no such column, or it has another unit or dimension.
    pub fn column(
        &mut self,
        place: usize,
        wanted: Option<&str>,
        needed: Option<Dimension>,
    ) -> Result<Column, String> {
        let missing = || "is missing: the file has only one column of numbers".to_owned();
        let own = self.columns.get(place).map(|column| column.name.clone());
        let wanted = wanted.map(str::to_owned).or(own).ok_or_else(missing)?;
        let is_name = self.columns.iter().any(|column| column.name == wanted);
        let (name, unit) = if is_name { (&*wanted, None) } else { header(&wanted) };
        let found = self.columns.iter().find(|column| column.name == name);
        let mut column = found.cloned().ok_or_else(|| {
            let names: Vec<&str> = self.columns.iter().map(|column| &*column.name).collect();
            unknown("column", name, &names)
        })?;
        unit.map_or(Ok(()), |unit| column.convert(unit, &mut self.notes))?;
        match needed.filter(|needed| column.dimension != Some(*needed)) {
            Some(it) => {
                Err(format!("must be {}. Add its unit, such as {name} [{}]", it.name(), it.si()))
            }
            None => Ok(column),
        }
    }
}
