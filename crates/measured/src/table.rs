//! Finds the names, the units and the numbers of a table.

use std::borrow::Cow;

use fretwork_engine::request::fault::unknown;
use fretwork_engine::request::quantity::Dimension;
use serde::Serialize;

use super::cell::{Spelling, is_bad, ungrouped, written};
use super::lines::{Block, Lines, MAX_HEAD, MAX_ROWS, TRANSPOSED, is_map, map_fault};
use super::names::{friction, function, is_count, is_index};
use super::text::decode;
use super::units::{GRAVITY, header, symbol, unit};

/// Maximum number of characters of a name, and of a cell in a fault.
const MAX_NAME: usize = 200;

/// What follows the name of a column in the name of its errors.
pub const SIGMA: &str = " sigma";

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
        let symbol = if known.is_some() { symbol(text) } else { text.to_owned() };
        let read = if known.is_some() { "was read in" } else { "stays in the unknown unit" };
        notes.push(format!("“{}” {read} {symbol}.", self.name));
        let (dimension, si, factor) = known.unwrap_or((None, text.to_owned(), 1.0));
        self.values.iter_mut().flatten().for_each(|value| *value *= factor);
        (self.dimension, self.unit) = (dimension, Some(si));
        self.stated = Some(text.to_owned());
        Ok(())
    }
}

/// The beginning of a text.
fn short(text: &str) -> String {
    text.chars().take(MAX_NAME).collect()
}

/// The cells of a column.
#[derive(Default, Clone)]
struct Cells {
    values: Vec<Option<f64>>,
    /// The standard deviations behind `±`, if there is one.
    sigmas: Vec<Option<f64>>,
    /// The unit in the first cell that has a number.
    unit: Option<String>,
    /// Words such as `#N/A`: the first, and how many there are.
    bad: (String, usize),
}

/// A row, by its cells.
type Row<'a> = Vec<Cow<'a, str>>;

impl<'a> Lines<'a> {
    /// The row of names, and the row of units above a table, with the number of lines before them.
    fn head(&self, block: &Block) -> (Option<Row<'a>>, Option<Row<'a>>, usize) {
        let width = block.layout.cells;
        let fitting = |row: &Row<'a>| {
            let own = row.iter().rposition(|cell| !cell.is_empty()).map_or(0, |last| last + 1);
            row.len() >= block.layout.numbers.len() && own <= width + 1
        };
        let above = |count: usize| {
            let at = block.head.end.checked_sub(count).filter(|at| *at >= block.head.start)?;
            Some(self.cells(at)).filter(fitting)
        };
        let has_unit = |row: &Row<'_>| row.iter().any(|cell| header(cell).1.is_some());
        let is_double = |row: &Row<'_>| {
            let names: Vec<_> = row.iter().filter(|cell| !cell.is_empty()).collect();
            names.iter().enumerate().any(|(at, name)| names[..at].contains(name))
        };
        match (above(1), above(2)) {
            (Some(units), Some(names)) if Self::is_units(&units) => (Some(names), Some(units), 2),
            (Some(names), Some(units)) if Self::is_units(&units) => (Some(names), Some(units), 2),
            (Some(names), Some(upper))
                if is_double(&names) || has_unit(&upper) && !has_unit(&names) =>
            {
                let mut group = "";
                let both = upper.iter().zip(&names).map(|(upper, name)| {
                    group = if upper.is_empty() { group } else { upper };
                    let (group, unit) = header(group);
                    let unit = unit.map_or(String::new(), |unit| format!(" [{unit}]"));
                    Cow::from(format!("{group} {name}{unit}").trim().to_owned())
                });
                (Some(both.collect()), None, 2)
            }
            (Some(names), _) => (Some(names), None, 1),
            (None, _) => (None, self.bare_units(block), 0),
        }
    }

    /// A row above a table that has only a unit for each column, with spaces between them.
    fn bare_units(&self, block: &Block) -> Option<Row<'a>> {
        let near = block.head.clone().rev().take(2).map(|at| self.all[at].1.split_whitespace());
        let rows = near.map(|cells| cells.map(Cow::from).collect::<Row<'a>>());
        rows.into_iter().find(|row| row.len() == block.layout.numbers.len() && Self::is_units(row))
    }

    /// The headers of the columns, from the rows above them.
    fn headers(
        &self,
        block: &Block,
        notes: &mut Vec<String>,
    ) -> Result<(Vec<String>, bool), String> {
        let (names, units, count) = self.head(block);
        let before = block.head.len() - count;
        if before > 0 {
            let first: String = self.all[block.head.start].1.trim().chars().take(40).collect();
            notes.push(format!("{before} line(s) before the table were not read: “{first}”."));
        }
        let width = block.layout.numbers.len();
        if names.is_none() && units.is_none() {
            let last = block.head.clone().next_back();
            let (line, text) = last.map_or((0, ""), |last| self.all[last]);
            let count = last.map_or(0, |last| self.cells(last).len());
            if (2..width).contains(&count) || text.contains([';', '\t']) && count < 2 {
                return Err(format!(
                    "The rows have {width} columns, separated by {}, but line {line} has other names: “{}”. Write one \
                     name for each column, the same separator in all lines, and no separators of thousands",
                    self.separators,
                    short(text)
                ));
            }
        }
        if names.is_none() {
            notes.push("The table has no row of names, so its columns have numbers.".to_owned());
        }
        let cell = |row: &Option<Row<'_>>, place: usize| {
            row.as_ref().and_then(|row| row.get(place)).map_or(String::new(), ToString::to_string)
        };
        let header = |place: usize| {
            let name = Some(cell(&names, place)).filter(|name| !name.is_empty());
            let name = name.unwrap_or_else(|| format!("column {}", place + 1));
            match cell(&units, place).trim_matches(['[', ']']) {
                "" => name,
                unit => format!("{name} [{unit}]"),
            }
        };
        Ok(((0..width).map(|place| short(&header(place))).collect(), names.is_some()))
    }

    /// The numbers of the columns.
    fn columns(
        &self,
        block: &Block,
        headers: &[String],
        decimal: Option<char>,
        notes: &mut Vec<String>,
    ) -> Result<Vec<Cells>, String> {
        let mut columns = vec![Cells::default(); headers.len()];
        // Between cells, commas cannot be decimal marks, so points are.
        let mut spelling = Spelling::with_sure_point(self.separators == "commas");
        // Somebody has taken these rows out of the data.
        let is_out = |at: &usize| self.all[*at].1.starts_with('#');
        let is_all = block.rows.clone().all(|at| is_out(&at));
        let (out, rows): (Vec<_>, Vec<_>) =
            block.rows.clone().partition(|at| is_out(at) && !is_all);
        if let Some(first) = out.first() {
            notes.push(format!(
                "{} row(s) that begin with # were left out, the first in line {}.",
                out.len(),
                self.all[*first].0
            ));
        }
        for (row, at) in rows.into_iter().enumerate() {
            let (line, cells) = (self.all[at].0, self.cells(at));
            if !block.layout.fits(&cells) {
                return Err(format!(
                    "Line {line} has {} cell(s), but the table has {} columns. Separate the cells of all lines by {}, and \
                     write one cell for each column",
                    cells.len(),
                    block.layout.cells,
                    self.separators
                ));
            }
            let places =
                block.layout.numbers.iter().enumerate().filter(|(_, is_number)| **is_number);
            for (place, cell) in places.map(|(place, _)| (place, &*cells[place])) {
                let (column, head) = (&mut columns[place], &headers[place]);
                let fault = |what: &str| {
                    format!(
                        "Line {line}: “{}” in “{head}” {what} is not a number. Write it like 1234.5, without separators of \
                         thousands and without its unit, or leave the cell empty if it is not known",
                        short(cell)
                    )
                };
                let plain = decimal.map_or(cell.into(), |mark| ungrouped(cell, mark));
                let read = written(&plain).ok_or_else(|| fault("").replace("  ", " "))?;
                let known = Some(read.value).filter(|value| !value.is_nan());
                let own = &mut column.unit;
                if known.is_some() && *own.get_or_insert_with(|| read.unit.into()) != *read.unit {
                    return Err(fault("has another unit than a cell above it, or none, and"));
                }
                if known.is_none() && is_bad(cell) {
                    column.bad = (short(cell), column.bad.1 + 1);
                }
                if known.is_some() {
                    spelling.see(&plain);
                }
                column.values.push(known);
                if read.sigma.is_some() || !column.sigmas.is_empty() {
                    column.sigmas.resize(row, None);
                    column.sigmas.push(read.sigma);
                }
            }
        }
        spelling.tell(decimal, notes)?;
        Ok(columns)
    }
}

/// A table, and what was done to read it.
pub struct Table {
    pub columns: Vec<Column>,
    pub notes: Vec<String>,
    /// The first line and the number of rows of each table in the file.
    pub all: Vec<[usize; 2]>,
}

impl Table {
    /// Reads a table of a file, from 1 on, with a decimal mark if it is known.
    ///
    /// # Errors
    /// A sentence that says what is wrong, and what to change.
    pub fn read(bytes: &[u8], wanted: usize, decimal: Option<char>) -> Result<Self, String> {
        let mut notes = Vec::new();
        let text = decode(bytes, &mut notes)?;
        let lines = Lines::of(&text)?;
        let all: Vec<_> = lines
            .blocks
            .iter()
            .map(|block| [lines.all[block.rows.start].0, block.rows.len()])
            .collect();
        let block = wanted.checked_sub(1).and_then(|at| lines.blocks.get(at));
        let first = block.map_or(MAX_HEAD, |block| block.rows.start.min(MAX_HEAD));
        if lines.all.len() - first.min(lines.all.len()) > MAX_ROWS {
            return Err(format!(
                "The table has more than {MAX_ROWS} rows. Keep, for example, every tenth row"
            ));
        }
        let Some(block) = block else {
            return Err(format!(
                "The file has {} table(s), and no table {wanted}. Write table=1, or leave it out",
                all.len()
            ));
        };
        notes.push(format!("Cells are separated by {}.", lines.separators));
        if all.len() > 1 {
            let others = all.iter().map(|[line, rows]| format!("line {line} ({rows} rows)"));
            let others = others.collect::<Vec<_>>().join(", ");
            notes.push(format!(
                "The file has {} tables, from {}. This is table {wanted}. Choose another one with table=2, for example.",
                all.len(), short(&others)
            ));
        }
        let after = lines.blocks.get(wanted).map_or(lines.all.len(), |next| next.head.start);
        if wanted == all.len() && after > block.rows.end {
            let first: String = lines.all[block.rows.end].1.trim().chars().take(40).collect();
            notes.push(format!(
                "{} line(s) after the table were not read: “{first}”.",
                after - block.rows.end
            ));
        }
        let (headers, has_names) = lines.headers(block, &mut notes)?;
        if !has_names && lines.is_transposed(block) {
            return Err(TRANSPOSED.into());
        }
        let columns = lines.columns(block, &headers, decimal, &mut notes)?;
        let mut table = Self { columns: Vec::new(), notes, all };
        for (head, cells) in headers.iter().zip(columns) {
            let is_count = has_names && head == "column 1" && is_count(&cells.values);
            table.add(if is_count { "index" } else { head }, cells)?;
        }
        let values: Vec<_> = table.columns.iter().map(|column| &column.values[..]).collect();
        if !has_names && is_map(&values) {
            return Err(map_fault(block.rows.len(), values.len()));
        }
        Ok(table)
    }

    /// Adds a column, and one with the errors of its numbers if they have some.
    fn add(&mut self, head: &str, cells: Cells) -> Result<(), String> {
        let (name, unit) = header(head);
        let mut name = name.to_owned();
        while self.columns.iter().any(|own| own.name == name) {
            name.push('\'');
        }
        let Cells { values, sigmas, unit: own, bad: (bad, count) } = cells;
        let mut column = Column { name, unit: None, dimension: None, values, stated: None };
        if !column.values.iter().any(Option::is_some) {
            self.notes.push(format!(
                "“{head}” has no numbers and was not read. Units belong into the header."
            ));
            return Ok(());
        }
        if count > 0 {
            self.notes.push(format!(
                "{count} cell(s) of “{head}” with words such as “{bad}” were taken as unknown numbers."
            ));
        }
        let own = own.filter(|own| !own.is_empty());
        for unit in unit.into_iter().chain(own.as_deref()) {
            column.convert(unit, &mut self.notes).map_err(|detail| format!("“{head}” {detail}"))?;
        }
        let name = format!("{}{SIGMA}", column.name);
        let mut errors = Column { name, unit: None, dimension: None, values: sigmas, stated: None };
        self.columns.push(column);
        if !errors.values.is_empty() {
            self.notes.push(format!("The numbers behind ± are the column “{}”.", errors.name));
            let stated = self.columns.last().and_then(|column| column.stated.clone());
            stated.map_or(Ok(()), |unit| errors.convert(&unit, &mut Vec::new()))?;
            self.columns.push(errors);
        }
        Ok(())
    }

    /// A column by its name, which may have a unit if the file states none. Without a name, the first other column than `taken`
    /// that has the needed dimension if there are at least so many, or else the first other column. Names decide among forces,
    /// and columns that count the rows come last.
    ///
    /// # Errors
    /// The table has no such column, or it has another unit or dimension, or logarithms.
    pub fn column(
        &mut self,
        taken: Option<&str>,
        wanted: Option<&str>,
        (needed, least): (Option<Dimension>, usize),
    ) -> Result<Column, String> {
        let missing = || "is missing: the file has only one column of numbers".to_owned();
        let is_like = |column: &&Column| {
            needed.is_some() && column.dimension == needed || is_weight(column, needed)
        };
        let is_enough = self.columns.iter().filter(is_like).count() >= least;
        let mut others: Vec<_> =
            self.columns.iter().filter(|column| Some(&*column.name) != taken).collect();
        if self.columns.len() > 2 {
            others.sort_by_key(|column| is_index(&column.name));
        }
        let like: Vec<_> = others.iter().copied().filter(is_like).map(|it| &*it.name).collect();
        let like = match needed {
            Some(Dimension::Force) if wanted.is_none() => friction(&like)?,
            _ => like.first().copied(),
        };
        let own = like.filter(|_| is_enough).or_else(|| others.first().map(|it| &*it.name));
        let own = own.map(str::to_owned);
        let wanted = wanted.map(str::to_owned).or(own).ok_or_else(missing)?;
        let is_name = self.columns.iter().any(|column| column.name == wanted);
        let (name, unit) = if is_name { (&*wanted, None) } else { header(&wanted) };
        let found = self.columns.iter().find(|column| column.name == name);
        let mut column = found.cloned().ok_or_else(|| {
            let names: Vec<&str> = self.columns.iter().map(|column| &*column.name).collect();
            unknown("column", name, &names)
        })?;
        unit.map_or(Ok(()), |unit| column.convert(unit, &mut self.notes))?;
        if let Some(function) = function(name) {
            return Err(format!(
                "has values of {function}, as its name “{name}” says. Write the numbers themselves, or choose another column"
            ));
        }
        if is_weight(&column, needed) {
            column.values.iter_mut().flatten().for_each(|value| *value *= GRAVITY);
            (column.dimension, column.unit) = (needed, Some("N".to_owned()));
            self.notes.push(format!("“{name}” is a mass, and was taken as the force that is its weight: 1 kg is {GRAVITY} N."));
        }
        match needed.filter(|needed| column.dimension != Some(*needed)) {
            Some(it) => Err(format!(
                "must be {}. Add its unit, such as {name} [{}], to the row of names, or to this parameter",
                it.name(),
                it.si()
            )),
            None => Ok(column),
        }
    }
}

/// Whether a column has masses where forces are needed.
fn is_weight(column: &Column, needed: Option<Dimension>) -> bool {
    needed == Some(Dimension::Force) && column.unit.as_deref() == Some("kg")
}
