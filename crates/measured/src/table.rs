//! Finds the names, the units and the numbers of a table.

use std::borrow::Cow;
use std::mem;
use std::ops::Range;

use fretwork_engine::input::fault::unknown;
use fretwork_engine::input::quantity::Dimension;
use serde::Serialize;

use super::cell::{NOTHING, Spelling, is_bad, ungrouped, written};
use super::lines::{Block, Lines};
use super::names::{friction, function, is_count, is_index};
use super::text::decode;
use super::units::{GRAVITY, has_factor, header, unit};
use crate::notes::{Notes, counted};

/// Maximum number of characters of a name, and of a cell in a fault.
const MAX_NAME: usize = 200;

/// What follows the name of a column in the name of its errors.
pub const SIGMA: &str = " sigma";

/// A column of numbers in SI.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Column {
    /// The name in the header, without the unit.
    pub name: String,
    /// The unit of the values, which is an SI unit if the engine knows the unit of the file. Null if the file states none.
    pub unit: Option<String>,
    /// The dimension, such as `length`. Null if the unit is unknown.
    pub dimension: Option<Dimension>,
    /// The values. Null stands for an unknown number.
    pub values: Vec<Option<f64>>,
    /// The unit in the file: at first that of the first cell with a number.
    #[serde(skip)]
    stated: Option<String>,
    /// The standard deviations behind `±`, if there is one.
    #[serde(skip)]
    sigmas: Vec<Option<f64>>,
    /// Words such as `#N/A`: the last, and how many there are.
    #[serde(skip)]
    bad: (String, usize),
}

impl Column {
    /// The standard deviations in this column, in the unit of the column that they belong to. They can be in percent of its
    /// numbers. `None` if they have another unit.
    pub fn errors_of(&self, of: &Self, notes: &mut Notes) -> Option<Self> {
        let mut own = self.clone();
        match (&self.unit, &of.stated) {
            (None, Some(unit)) => own.convert(unit, notes).ok()?,
            (Some(unit), _) if unit == "%" && of.unit != self.unit => {
                let share = |(share, value): (&Option<f64>, &Option<f64>)| {
                    Some(0.01 * (*share)? * (*value)?.abs())
                };
                own.values = self.values.iter().zip(&of.values).map(share).collect();
            }
            _ if self.unit != of.unit => {
                notes.push(format!(
                    "“{}” has another unit than “{}”, so it was not used.",
                    self.name, of.name
                ));
                return None;
            }
            _ => {}
        }
        Some(own)
    }

    /// Converts the values from the unit `text` to SI.
    fn convert(&mut self, text: &str, notes: &mut Notes) -> Result<(), String> {
        let own = self.stated.as_deref();
        if text.contains('[') || own.is_some_and(|own| unit(own) != unit(text)) {
            let own = own.map_or(String::new(), |own| format!("[{own}] "));
            return Err(format!("has two units: {own}[{text}]. Write only one of them"));
        }
        if own.is_some() {
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

/// First words of cells in rows that are computed from those above.
const SUMMARIES: &str = "mean average avg median sum total std stdev mittelwert summe stabw";

/// A row, by its cells.
type Row<'a> = Vec<Cow<'a, str>>;

impl<'a> Lines<'a> {
    /// The rows of names, of names above them, and of units above a table.
    fn head(&self, block: &Block) -> [Row<'a>; 3] {
        let is_fitting = |row: &Row<'a>| {
            let last = row.iter().rposition(|cell| !cell.is_empty());
            let is_more = last.is_some_and(|last| last > block.layout.cells);
            row.len() >= block.layout.numbers.len() && !is_more
        };
        let above = block.head.clone().rev().take(2).map(|at| self.cells(at));
        let mut rows: Vec<_> = above.take_while(is_fitting).collect();
        if rows.is_empty() {
            return [Row::new(), Row::new(), self.bare_units(block)];
        }
        let at = rows.iter().position(|row| rows.len() > 1 && Self::is_units(row));
        let units = at.map(|at| rows.remove(at)).unwrap_or_default();
        let names = rows.remove(0);
        let is_again = |(at, name)| names[..at].contains(name) && !name.is_empty();
        let are_double = names.iter().enumerate().any(is_again);
        let has_unit = |row: &Row<'_>| row.iter().any(|cell| header(cell).1.is_some());
        rows.retain(|upper| are_double || has_unit(upper) && !has_unit(&names));
        let upper = rows.pop().unwrap_or_default();
        [names, upper, units]
    }

    /// A row above a table that has only a unit for each column, with spaces between them.
    fn bare_units(&self, block: &Block) -> Row<'a> {
        let near = block.head.clone().rev().take(2).map(|at| self.all[at].1.split_whitespace());
        let mut rows = near.map(|cells| cells.map(Cow::from).collect::<Row<'a>>());
        let is_own = |row: &Row<'_>| row.len() == block.layout.numbers.len() && Self::is_units(row);
        rows.find(is_own).unwrap_or_default()
    }

    /// Says which lines were not read.
    fn tell_skipped(&self, lines: Range<usize>, place: &str, notes: &mut Notes) {
        let first = self.all.get(lines.start).map_or("", |line| line.1.trim());
        let told = format!("line(s) {place} the table were not read: “{first:.40}”.");
        counted(notes, lines.len(), told);
    }

    /// The headers of the columns, from the rows above them, and whether these have names.
    fn headers(&self, block: &Block, notes: &mut Notes) -> Result<(Vec<String>, bool), String> {
        let [names, upper, units] = &self.head(block);
        let rows = [names, upper, units];
        let count = rows.iter().filter(|row| !names.is_empty() && !row.is_empty()).count();
        self.tell_skipped(block.head.start..block.head.end - count, "before", notes);
        let width = block.layout.numbers.len();
        let mut others = block.head.clone().filter(|_| names.is_empty() && units.is_empty());
        if let Some(last) = others.next_back() {
            let ((line, text), count) = (self.all[last], self.cells(last).len());
            if (2..width).contains(&count) || text.contains([';', '\t']) && count < 2 {
                return Err(format!(
                    "The rows have {width} columns, separated by {}, but line {line} has other names: “{text:.MAX_NAME$}”. \
                     Write one name for each column, the same separator in all lines, and no separators of thousands",
                    self.separators
                ));
            }
        }
        if count == 0 {
            notes.push("The table has no row of names, so its columns have numbers.".to_owned());
        }
        let mut group = "";
        let header = |place: usize| {
            let [name, upper, unit] = rows.map(|row| row.get(place).map_or("", |it| it));
            group = if upper.is_empty() { group } else { upper };
            let (group, of_group) = header(group);
            let name = match format!("{group} {name}").trim() {
                "" => format!("column {}", place + 1),
                name => name.to_owned(),
            };
            let unit = of_group.unwrap_or(unit).trim_matches(['[', ']']);
            let header = if unit.is_empty() { name } else { format!("{name} [{unit}]") };
            format!("{header:.MAX_NAME$}")
        };
        Ok(((0..width).map(header).collect(), count > 0))
    }

    /// The numbers of the columns.
    fn columns(
        &self,
        block: &Block,
        headers: &[String],
        decimal: Option<char>,
        notes: &mut Notes,
    ) -> Result<Vec<Column>, String> {
        let mut columns = vec![Column::default(); headers.len()];
        let mut spelling = Spelling::default();
        // Somebody has taken these rows out of the data, or computed them from those above.
        let numbers = &block.layout.numbers;
        let has_texts = numbers.len() < block.layout.cells || numbers.contains(&false);
        let is_summary = |cell: &Cow<'_, str>| {
            let word = cell.split(|it: char| !it.is_alphabetic()).next().unwrap_or("");
            SUMMARIES.split(' ').any(|own| own == word.to_lowercase())
        };
        let last = block.rows.clone().rev();
        let summaries = last.take_while(|at| has_texts && self.cells(*at).iter().any(is_summary));
        let end = block.rows.end - summaries.count();
        let is_out = |at: &usize| *at >= end || self.all[*at].1.starts_with('#');
        let is_all = block.rows.clone().all(|at| is_out(&at));
        let (out, rows): (Vec<_>, Vec<_>) =
            block.rows.clone().partition(|at| is_out(at) && !is_all);
        notes.extend(out.first().map(|first| {
            let (count, (line, text)) = (out.len(), self.all[*first]);
            let kind =
                if text.starts_with('#') { "that begin with #" } else { "with means or sums" };
            format!("{count} row(s) {kind} were left out, the first in line {line}.")
        }));
        let other = decimal.map(|mark| if mark == '.' { [','] } else { ['.'] });
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
            let places = (0..headers.len()).filter(|place| block.layout.numbers[*place]);
            for place in places {
                let (column, cell) = (&mut columns[place], &*cells[place]);
                let fault = |what: &str| {
                    format!(
                        "Line {line}: “{cell:.MAX_NAME$}” in “{}” {what}is not a number. Write it like 1234.5, without separators of \
                         thousands and without its unit, or leave the cell empty if it is not known",
                        headers[place]
                    )
                };
                let plain = other.and_then(|other| ungrouped(cell, &other));
                let plain = plain.as_deref().unwrap_or(cell);
                let read = written(plain).ok_or_else(|| fault(""))?;
                let is_nothing = NOTHING.contains(&read.value);
                let is_known = !read.value.is_nan() && !is_nothing;
                let own = &mut column.stated;
                if is_known && *own.get_or_insert_with(|| read.unit.into()) != *read.unit {
                    return Err(fault("has another unit than a cell above it, or none, and "));
                }
                if is_known {
                    spelling.see(plain);
                } else if is_nothing || is_bad(cell) {
                    column.bad = (format!("{cell:.MAX_NAME$}"), column.bad.1 + 1);
                }
                column.values.push(is_known.then_some(read.value));
                if read.sigma.is_some() || !column.sigmas.is_empty() {
                    column.sigmas.resize(row, None);
                    column.sigmas.push(read.sigma);
                }
            }
        }
        spelling.tell(decimal, self.separators == "commas", notes)?;
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
        let place = |block: &Block| [lines.all[block.rows.start].0, block.rows.len()];
        let all: Vec<_> = lines.blocks.iter().map(place).collect();
        let block = wanted.checked_sub(1).and_then(|at| lines.blocks.get(at));
        let block = block.ok_or_else(|| {
            let count = all.len();
            format!("The file has {count} table(s), and no table {wanted}. Write table=1, or leave it out")
        })?;
        notes.push(format!("Cells are separated by {}.", lines.separators));
        if all.len() > 1 {
            let others = all.iter().map(|[line, rows]| format!("line {line} ({rows} rows)"));
            let others = others.collect::<Vec<_>>().join(", ");
            notes.push(format!(
                "The file has {} tables, from {others:.MAX_NAME$}. This is table {wanted}. Choose another one with table=2, for \
                 example.",
                all.len()
            ));
        }
        if wanted == all.len() {
            lines.tell_skipped(block.rows.end..lines.all.len(), "after", &mut notes);
        }
        let (headers, has_names) = lines.headers(block, &mut notes)?;
        if let Some(fault) = lines.shape_fault(block, has_names) {
            return Err(fault);
        }
        let columns = lines.columns(block, &headers, decimal, &mut notes)?;
        let mut table = Self { columns: Vec::new(), notes, all };
        for (head, cells) in headers.iter().zip(columns) {
            let is_count = has_names && head == "column 1" && is_count(&cells.values);
            table.add(if is_count { "index" } else { head }, cells)?;
        }
        Ok(table)
    }

    /// Adds a column, and one with the errors of its numbers if they have some.
    fn add(&mut self, head: &str, mut column: Column) -> Result<(), String> {
        let (name, unit) = header(head);
        name.clone_into(&mut column.name);
        while self.columns.iter().any(|own| own.name == column.name) {
            column.name.push('\'');
        }
        if !column.values.iter().any(Option::is_some) {
            self.notes.push(format!(
                "“{head}” has no numbers and was not read. Units belong into the header."
            ));
            return Ok(());
        }
        let (bad, count) = mem::take(&mut column.bad);
        let told = format!("cell(s) of “{head}” such as “{bad}” were taken as unknown numbers.");
        counted(&mut self.notes, count, told);
        let (name, values) = (format!("{}{SIGMA}", column.name), mem::take(&mut column.sigmas));
        let mut errors = Column { name, values, ..Column::default() };
        let own = column.stated.take().filter(|own| !own.is_empty());
        let is_factor = has_factor(&column.name);
        if is_factor {
            self.notes.push(format!(
                "“{head}” has a factor in its name, so its unit is not known. Write the numbers without the factor, and only \
                 the unit behind the name."
            ));
            column.unit = Some(head.to_owned());
        }
        for unit in unit.into_iter().chain(own.as_deref()).filter(|_| !is_factor) {
            column.convert(unit, &mut self.notes).map_err(|detail| format!("“{head}” {detail}"))?;
            errors.convert(unit, &mut Vec::new())?;
        }
        self.columns.push(column);
        if !errors.values.is_empty() {
            self.notes.push(format!(
                "The numbers behind ± are the column “{}”, as standard deviations.",
                errors.name
            ));
            self.columns.push(errors);
        }
        Ok(())
    }

    /// Takes masses as the forces that are their weights.
    pub fn weigh(&mut self) {
        let masses = self.columns.iter_mut().filter(|it| it.unit.as_deref() == Some("kg"));
        for column in masses {
            column.values.iter_mut().flatten().for_each(|value| *value *= GRAVITY);
            (column.dimension, column.unit) = (Some(Dimension::Force), Some("N".to_owned()));
            let name = &column.name;
            self.notes.push(format!("“{name}” is a mass, and was taken as the force that is its weight: 1 kg is {GRAVITY} N."));
        }
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
        let is_like = |column: &&Column| needed.is_some() && column.dimension == needed;
        let is_enough = self.columns.iter().filter(is_like).count() >= least;
        let mut others: Vec<_> =
            self.columns.iter().filter(|column| Some(&*column.name) != taken).collect();
        others.sort_by_key(|column| {
            (is_enough && !is_like(column), self.columns.len() > 2 && is_index(&column.name))
        });
        let mut own = others.first().map(|it| &*it.name);
        if needed == Some(Dimension::Force) && wanted.is_none() {
            let (forces, rest): (Vec<_>, Vec<_>) = others.into_iter().partition(is_like);
            let rest = rest.iter().filter(|it| it.dimension.is_none());
            let [forces, rest]: [Vec<&str>; 2] =
                [forces.iter().map(|it| &*it.name).collect(), rest.map(|it| &*it.name).collect()];
            own = friction(&forces, &rest)?.or(own);
        }
        let missing = "is missing: the file has only one column of numbers";
        let wanted = wanted.or(own).ok_or(missing)?.to_owned();
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
        match needed.filter(|needed| column.dimension != Some(*needed)) {
            Some(it) => Err(format!(
                "must be {}. Add its unit, such as {name} [{}], to the row of names, or to this parameter",
                it.name(),
                if it == Dimension::Length { "um" } else { it.si() }
            )),
            None => Ok(column),
        }
    }
}
