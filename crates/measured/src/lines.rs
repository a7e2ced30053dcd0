//! The lines of a file: what separates their cells, and which of them are tables.

use std::borrow::Cow;
use std::ops::Range;

use super::cell::{is_grouped, number, written};
use super::units::{header, unit};

/// Maximum number of rows of a table.
pub const MAX_ROWS: usize = 1_000_000;
/// Maximum number of columns of a table.
pub const MAX_COLUMNS: usize = 64;
/// Maximum number of other lines.
pub const MAX_HEAD: usize = 1000;
/// Number of last lines that decide on the separator, and of first rows that decide on the columns of a table.
const SAMPLE: usize = 500;
/// Shorter tables are settings if another table has this many times as many rows.
const SETTINGS: (usize, usize) = (3, 10);
/// A map of heights has at least this many rows and columns.
const MAP: usize = 8;
/// The characters that separate cells. Where two are possible, the last one does. Tabs and semicolons do so surely.
const SEPARATORS: [(char, &str); 4] =
    [(' ', "spaces"), (',', "commas"), ('\t', "tabs"), (';', "semicolons")];

/// The fault of a table whose lines are quantities.
pub const TRANSPOSED: &str = "Each line of the table is a quantity, and each column a point. Transpose the table: write the \
                              names with their units in one row, and one row of numbers for each point";

/// The cells of a line.
pub fn cells(line: &str, separator: char) -> Vec<Cow<'_, str>> {
    let line = line.trim_start_matches('#');
    let trimmed = |cell: &str| cell.trim().trim_matches('"').trim().replace('\n', " ");
    if separator != ' ' && line.contains('"') {
        let mut reader = reader(line, separator);
        let record = reader.records().next().and_then(Result::ok).unwrap_or_default();
        return record.iter().take(MAX_COLUMNS + 1).map(|cell| trimmed(cell).into()).collect();
    }
    let (mut is_quoted, mut at) = (false, 0);
    let cells = line.split(|c: char| {
        is_quoted ^= c == '"';
        at += c.len_utf8();
        // The space before a unit in brackets separates nothing.
        let is_space = separator == ' ' && " \t".contains(c) && !line[at..].starts_with(['[', '(']);
        !is_quoted && (is_space || separator != ' ' && c == separator)
    });
    let cells = cells.map(|cell| Cow::from(cell.trim().trim_matches('"').trim()));
    cells.filter(|cell| separator != ' ' || !cell.is_empty()).take(MAX_COLUMNS + 1).collect()
}

/// A reader of cells that may have quotation marks around them.
fn reader(text: &str, separator: char) -> csv::Reader<&[u8]> {
    let mut builder = csv::ReaderBuilder::new();
    let separator = u8::try_from(separator).unwrap_or(b',');
    builder.has_headers(false).flexible(true).delimiter(separator).from_reader(text.as_bytes())
}

/// The number of each line in the file, and its text. A cell in quotation marks can have several lines.
fn lines(text: &str, separator: char) -> Result<Vec<(usize, &str)>, String> {
    let mut all: Vec<(usize, &str)> = Vec::new();
    let is_plain = separator == ' ' || !text.contains('"');
    all.extend(text.lines().enumerate().filter(|_| is_plain).map(|(at, text)| (at + 1, text)));
    let mut reader = reader(text, separator);
    let (mut record, mut at, mut line) = (csv::ByteRecord::new(), 0, 1);
    while !is_plain && reader.read_byte_record(&mut record).is_ok_and(|is_one| is_one) {
        let end = usize::try_from(reader.position().byte()).unwrap_or(text.len());
        let own = text.get(at..end).unwrap_or("");
        let blank = own.len() - own.trim_start_matches('\n').len();
        let own = &own[blank..];
        let (first, count) = (line + blank, own.matches('\n').count());
        if end == text.len() && count > 1 && own.matches('"').count() % 2 == 1 {
            return Err(format!(
                "The quotation mark that opens in line {first} is not closed. Close it, or remove it"
            ));
        }
        all.push((first, own.trim_end_matches('\n')));
        (at, line) = (end, first + count);
    }
    let is_blank = |text: &str| text.trim_matches(['#', ' ', '\t', ';', ',', '\n']).is_empty();
    Ok(all.into_iter().filter(|(_, text)| !is_blank(text)).collect())
}

/// 1 for a number, 0 for an unknown number, and -1 for another text. Faulty numbers count as numbers, and are refused later.
pub fn weight(cell: &str) -> i64 {
    let other = || if is_grouped(cell) || written(cell).is_some() { 1 } else { -1 };
    number(cell).map_or_else(other, |number| i64::from(!number.is_nan()))
}

/// Whether a text begins with a letter.
fn is_word(cell: &str) -> bool {
    cell.starts_with(char::is_alphabetic)
}

/// The columns of a table.
#[derive(Debug, Clone, Default)]
pub struct Layout {
    /// The number of cells of a row.
    pub cells: usize,
    /// Which columns have numbers, up to the last of them.
    pub numbers: Vec<bool>,
    /// How many rows it fits, and how well.
    rows: usize,
    score: i64,
}

impl Layout {
    /// The layout of the most frequent number of cells in lines with numbers.
    fn of(lines: &[(usize, &str)], separator: char) -> Self {
        let rows = lines.iter().map(|(_, line)| cells(line, separator));
        let rows: Vec<_> = rows.filter(|row| row.iter().any(|cell| weight(cell) > 0)).collect();
        let count = |width: &usize| rows.iter().filter(|row| row.len() == *width).count();
        let width = (2..=MAX_COLUMNS).rev().max_by_key(count).unwrap_or(0);
        let rows = rows.iter().filter(|row| row.len() == width);
        let weights = |place: usize| rows.clone().map(move |row| weight(&row[place]));
        let sums: Vec<i64> = (0..width).map(|place| weights(place).sum()).collect();
        let score = sums.iter().copied().chain(rows.clone().map(|_| 1)).sum();
        let is_number = |place| sums[place] >= 0 && weights(place).any(|weight| weight > 0);
        let mut numbers: Vec<bool> = (0..width).map(is_number).collect();
        numbers.truncate(numbers.iter().rposition(|is| *is).map_or(0, |last| last + 1));
        Self { cells: width, numbers, rows: rows.count(), score }
    }

    fn count(&self) -> usize {
        self.numbers.iter().filter(|is| **is).count()
    }

    /// Whether a line has a cell for each column of numbers, and no other cells.
    pub fn fits(&self, cells: &[Cow<'_, str>]) -> bool {
        let is_more = cells.iter().skip(self.cells).any(|cell| !cell.is_empty());
        cells.len() >= self.numbers.len() && !is_more
    }
}

/// A table of a file.
#[derive(Debug, Clone)]
pub struct Block {
    /// Its rows, and the lines between them and the table before.
    pub rows: Range<usize>,
    pub head: Range<usize>,
    pub layout: Layout,
}

/// The lines of a file, and their tables.
pub struct Lines<'a> {
    /// The number of each line in the file, and its text.
    pub all: Vec<(usize, &'a str)>,
    pub separator: char,
    pub separators: &'static str,
    pub blocks: Vec<Block>,
}

impl<'a> Lines<'a> {
    pub fn of(text: &'a str) -> Result<Self, String> {
        let tail = text.rmatch_indices('\n').nth(SAMPLE).map_or(0, |(at, _)| at + 1);
        let found = SEPARATORS.map(|it| {
            let sample = lines(&text[tail..], it.0).unwrap_or_default();
            (Layout::of(&sample, it.0), it)
        });
        let most = found.iter().map(|it| it.0.rows).max().unwrap_or(0);
        let best = found.into_iter().max_by_key(|(layout, (separator, _))| {
            let is_frequent = layout.count() > 1 && 2 * layout.rows >= most;
            let is_sure = ";\t".contains(*separator) && is_frequent;
            (layout.score > 0 && is_sure, layout.score)
        });
        let best = best.filter(|(layout, _)| layout.score > 0);
        let (_, (separator, separators)) = best.ok_or_else(|| {
            let open = SEPARATORS.iter().find_map(|it| lines(text, it.0).err());
            open.or_else(|| map(text)).unwrap_or_else(|| {
                format!(
                    "The file has no table of numbers. Write 2 to {MAX_COLUMNS} columns, separated by semicolons, tabs, \
                     commas or spaces, and one row for each point"
                )
            })
        })?;
        let mut own =
            Self { all: lines(text, separator)?, separator, separators, blocks: Vec::new() };
        // Such a file has too many rows, wherever its table is.
        if own.all.len() <= MAX_HEAD + MAX_ROWS {
            own.blocks = own.blocks();
        }
        Ok(own)
    }

    pub fn cells(&self, at: usize) -> Vec<Cow<'a, str>> {
        cells(self.all[at].1, self.separator)
    }

    /// Whether a line has words and no number, or only units.
    fn is_text(&self, at: usize) -> bool {
        let cells = self.cells(at);
        let weights = || cells.iter().map(|cell| (cell, weight(cell)));
        let has_word = || weights().any(|(cell, weight)| weight < 0 && is_word(cell));
        weights().any(|it| it.1 < 0)
            && (weights().all(|it| it.1 < 1) && has_word() || Self::is_units(&cells))
    }

    /// The tables: rows between lines of words. Rows of words and a number before and behind them are none of their rows.
    fn blocks(&self) -> Vec<Block> {
        let texts: Vec<bool> = (0..self.all.len()).map(|at| self.is_text(at)).collect();
        let (mut blocks, mut at, mut end) = (Vec::new(), 0, 0);
        for run in texts.chunk_by(|one, next| one == next) {
            let rows = at..at + run.len();
            at = rows.end;
            if run[0] {
                continue;
            }
            let layout = Layout::of(
                &self.all[rows.start..rows.end.min(rows.start + SAMPLE)],
                self.separator,
            );
            let Some(first) = layout.numbers.iter().position(|is| *is) else { continue };
            // Words in the first column of numbers belong to a setting or a footer.
            let has_word = |cells: &[Cow<'_, str>]| {
                cells.get(first).is_some_and(|cell| weight(cell) < 0 && is_word(cell))
            };
            // A first line with fewer cells than the names above it has a fault. Without names, it is a setting.
            let is_named = rows.start > end && layout.fits(&self.cells(rows.start - 1));
            let is_first = |at: &usize| {
                let cells = self.cells(*at);
                let is_full = layout.fits(&cells) || cells.len() >= layout.cells;
                !has_word(&cells) && (is_full || is_named && *at == rows.start)
            };
            let begin = rows.clone().find(is_first).unwrap_or(rows.end);
            let last = (begin..rows.end).rfind(|at| !has_word(&self.cells(*at)));
            let rows = begin..last.map_or(begin, |last| last + 1);
            if !rows.is_empty() {
                end = rows.end;
                blocks.push(Block { head: 0..rows.start, rows, layout });
            }
        }
        let most = blocks.iter().map(|block: &Block| block.rows.len()).max().unwrap_or(0);
        let is_table = |block: &Block| {
            block.layout.count() > 1
                && (block.rows.len() >= SETTINGS.0 || block.rows.len() * SETTINGS.1 > most)
        };
        let is_first = |block: &Block| is_table(block) && block.layout.numbers[0];
        let is_any = [blocks.iter().any(is_first), blocks.iter().any(is_table)];
        blocks.retain(
            |block| if is_any[0] { is_first(block) } else { !is_any[1] || is_table(block) },
        );
        let mut end = 0;
        for block in &mut blocks {
            block.head.start = end;
            end = block.rows.end;
        }
        blocks
    }

    /// Whether each line of a table is a quantity: its name, and then its numbers.
    pub fn is_transposed(&self, block: &Block) -> bool {
        let rows: Vec<_> = block.rows.clone().take(SAMPLE).map(|at| self.cells(at)).collect();
        let is_quantity = |cells: &Vec<Cow<'_, str>>| header(&cells[0]).1.is_some();
        rows.iter().all(|cells| weight(&cells[0]) < 0 && is_word(&cells[0]))
            && (rows.len() < block.layout.count() || rows.iter().any(is_quantity))
    }

    /// Whether all cells of a line are units.
    pub fn is_units(cells: &[Cow<'_, str>]) -> bool {
        cells.iter().all(|cell| unit(cell).is_some() || header(cell).0.is_empty())
    }
}

/// The fault of a file with more columns than a table has, which all are numbers.
fn map(text: &str) -> Option<String> {
    let of = |separator: char| {
        let rows =
            text.lines().map(|line| line.split(separator).filter(|it| !it.trim().is_empty()));
        let sizes = rows.filter(|row| row.clone().all(|cell| number(cell.trim()).is_some()));
        sizes.map(Iterator::count).filter(|size| *size > MAX_COLUMNS).collect::<Vec<_>>()
    };
    let sizes = SEPARATORS.map(|(separator, _)| of(separator));
    let sizes = sizes.iter().max_by_key(|sizes| sizes.len())?;
    (sizes.len() >= MAP).then(|| map_fault(sizes.len(), sizes[0]))
}

/// The fault of a map of heights.
pub fn map_fault(rows: usize, columns: usize) -> String {
    format!(
        "The file is a map of {rows} × {columns} heights, and no table. In the program of the instrument, take a profile across \
         the scar, and save it as two columns with names such as x [mm];z [um]"
    )
}

/// Whether columns without names are a map of heights: the first one goes up and down.
pub fn is_map(columns: &[&[Option<f64>]]) -> bool {
    let first: Vec<f64> =
        columns.first().into_iter().flat_map(|column| column.iter()).copied().flatten().collect();
    let changes = |sign: f64| first.windows(2).any(|pair| sign * (pair[1] - pair[0]) > 0.0);
    columns.len() >= MAP && first.len() >= MAP && changes(1.0) && changes(-1.0)
}
