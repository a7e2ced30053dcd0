//! The lines of a file: what separates their cells, and which of them are tables.

use std::borrow::Cow;
use std::ops::Range;

use super::cell::{is_numeral, number, written};
use super::units::{header, unit};

/// Maximum number of rows of a table.
pub const MAX_ROWS: usize = 1_000_000;
/// Maximum number of columns of a table.
const MAX_COLUMNS: usize = 64;
/// Maximum number of other lines.
const MAX_HEAD: usize = 1000;
/// Number of last lines that decide on the separator, and of first rows that decide on the columns of a table.
const SAMPLE: usize = 500;
/// Shorter tables are settings if another table has this many times as many rows.
const SETTINGS: (usize, usize) = (3, 10);
/// A map of heights has at least this many rows and columns.
const MAP: usize = 8;
/// The characters that separate cells. Where two are possible, the last one does. Tabs and semicolons do so surely.
const SEPARATORS: [(char, &str); 4] =
    [(' ', "spaces"), (',', "commas"), ('\t', "tabs"), (';', "semicolons")];

/// What to write instead of a file without a table.
const WIDE: &str = "Write 2 to 64 columns, separated by semicolons, tabs, commas or spaces, and one row for each point";
/// The fault of a table whose lines are quantities.
const TRANSPOSED: &str = "Each line of the table is a quantity, and each column a point. Transpose the table: write the \
                              names with their units in one row, and one row of numbers for each point";

/// The cells of a line.
fn cells(line: &str, separator: char) -> Vec<Cow<'_, str>> {
    let line = line.trim_start_matches('#');
    let trimmed = |cell: &str| cell.trim().trim_matches('"').trim().replace('\n', " ");
    if separator != ' ' && line.contains('"') {
        let mut reader = csv::ReaderBuilder::new();
        let reader = reader.has_headers(false).delimiter(u8::try_from(separator).unwrap_or(b','));
        let record = reader.from_reader(line.as_bytes()).into_records().next();
        let record = record.and_then(Result::ok).unwrap_or_default();
        return record.iter().map(|cell| trimmed(cell).into()).collect();
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
    cells.filter(|cell| separator != ' ' || !cell.is_empty()).collect()
}

/// The number of each line in the file, and its text. A cell in quotation marks can have several lines.
fn lines(text: &str, separator: char) -> Result<Vec<(usize, &str)>, String> {
    let (mut all, mut open, mut at) = (Vec::new(), None, 0);
    for (place, line) in text.split('\n').enumerate() {
        let (first, from) = open.unwrap_or((place + 1, at));
        let (mut is_open, mut last) = (open.is_some(), separator);
        for letter in line.chars() {
            is_open ^= letter == '"' && (is_open || [separator, '"'].contains(&last));
            last = letter;
        }
        at += line.len() + 1;
        open = (is_open && separator != ' ').then_some((first, from));
        all.extend(open.is_none().then(|| (first, &text[from..at - 1])));
    }
    let is_blank = |text: &str| text.trim_matches(['#', ' ', '\t', ';', ',', '\n']).is_empty();
    all.retain(|(_, text)| !is_blank(text));
    open.map_or(Ok(all), |(line, _)| {
        Err(format!(
            "The quotation mark that opens in line {line} is not closed. Close it, or remove it"
        ))
    })
}

/// 1 for a number, 0 for an unknown number, and -1 for another text. Faulty numbers count as numbers, and are refused later.
pub fn weight(cell: &str) -> i64 {
    let other = || if is_numeral(cell) || written(cell).is_some() { 1 } else { -1 };
    number(cell).map_or_else(other, |number| i64::from(!number.is_nan()))
}

/// Whether a cell is no number, and begins with a letter.
fn is_word(cell: &str) -> bool {
    cell.starts_with(char::is_alphabetic) && weight(cell) < 0
}

/// The columns of a table.
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
        let weights = |line: &str| cells(line, separator).iter().map(|cell| weight(cell)).collect();
        let mut rows: Vec<Vec<i64>> = lines.iter().map(|(_, line)| weights(line)).collect();
        rows.retain(|row| row.len() > 1 && row.iter().any(|weight| *weight > 0));
        rows.sort_by_key(Vec::len);
        let same = rows.chunk_by(|one, next| one.len() == next.len());
        let rows = same.rev().max_by_key(|rows| rows.len()).unwrap_or(&[]);
        let width = rows.first().map_or(0, Vec::len);
        let sums: Vec<i64> = (0..width).map(|at| rows.iter().map(|row| row[at]).sum()).collect();
        let score = sums.iter().copied().chain(rows.iter().map(|_| 1)).sum();
        let is_number = |at: usize| sums[at] >= 0 && rows.iter().any(|row| row[at] > 0);
        let mut numbers: Vec<bool> = (0..width).map(is_number).collect();
        numbers.truncate(numbers.iter().rposition(|is| *is).map_or(0, |last| last + 1));
        Self { cells: width, numbers, rows: rows.len(), score }
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
        let found = SEPARATORS
            .map(|it| (Layout::of(&lines(&text[tail..], it.0).unwrap_or_default(), it.0), it));
        let most = found.iter().map(|it| it.0.rows).max().unwrap_or(0);
        let best = found.into_iter().filter(|it| it.0.score > 0).max_by_key(|(layout, own)| {
            let is_frequent = layout.count() > 1 && 2 * layout.rows >= most;
            (";\t".contains(own.0) && is_frequent, layout.score)
        });
        let (_, (separator, separators)) = best.ok_or_else(|| {
            let open = SEPARATORS.iter().find_map(|it| lines(text, it.0).err());
            open.unwrap_or_else(|| format!("The file has no table of numbers. {WIDE}"))
        })?;
        let all = lines(text, separator)?;
        let mut own = Self { all, separator, separators, blocks: Vec::new() };
        let is_long = own.all.len() > MAX_HEAD + MAX_ROWS;
        own.blocks = if is_long { Vec::new() } else { own.blocks() };
        if is_long || own.blocks.iter().any(|block| block.rows.len() > MAX_ROWS) {
            return Err(format!(
                "The table has more than {MAX_ROWS} rows. Keep, for example, every tenth row"
            ));
        }
        Ok(own)
    }

    pub fn cells(&self, at: usize) -> Vec<Cow<'a, str>> {
        cells(self.all[at].1, self.separator)
    }

    /// Whether a line has words and no number, or only units.
    fn is_text(&self, at: usize) -> bool {
        let cells = self.cells(at);
        let has_number = cells.iter().any(|cell| weight(cell) > 0);
        let is_name = !has_number && cells.iter().any(|cell| is_word(cell));
        is_name || cells.iter().any(|cell| weight(cell) < 0) && Self::is_units(&cells)
    }

    /// The tables: rows between lines of words. Rows of words and a number before and behind them are none of their rows.
    fn blocks(&self) -> Vec<Block> {
        let texts: Vec<bool> = (0..self.all.len()).map(|at| self.is_text(at)).collect();
        let (mut blocks, mut at, mut end) = (Vec::new(), 0, 0);
        for run in texts.chunk_by(|one, next| one == next) {
            let rows = at..at + run.len();
            at = rows.end;
            let sample = &self.all[rows.start..rows.end.min(rows.start + SAMPLE)];
            let layout = Layout::of(if run[0] { &[] } else { sample }, self.separator);
            let Some(first) = layout.numbers.iter().position(|is| *is) else { continue };
            // Words in the first column of numbers belong to a setting or a footer.
            let has_word =
                |cells: &[Cow<'_, str>]| cells.get(first).is_some_and(|cell| is_word(cell));
            // A first line with fewer cells than the names above it has a fault. Without names, it is a setting.
            let is_named = rows.start > end && layout.fits(&self.cells(rows.start - 1));
            let is_first = |at: &usize| {
                let cells = self.cells(*at);
                let is_full = layout.fits(&cells) || cells.len() >= layout.cells;
                !has_word(&cells) && (is_full || is_named && *at == rows.start)
            };
            let Some(begin) = rows.clone().find(is_first) else { continue };
            let last = (begin..rows.end).rfind(|at| !has_word(&self.cells(*at))).unwrap_or(begin);
            end = last + 1;
            blocks.push(Block { head: 0..begin, rows: begin..end, layout });
        }
        let most = blocks.iter().map(|block: &Block| block.rows.len()).max().unwrap_or(0);
        // Tables are better than settings, and best if the first column has numbers.
        let rank = |block: &Block| {
            let is_long = block.rows.len() >= SETTINGS.0 || block.rows.len() * SETTINGS.1 > most;
            let is_table = is_long && block.layout.count() > 1;
            (is_table, is_table && block.layout.numbers[0])
        };
        let best = blocks.iter().map(rank).max();
        blocks.retain(|block| Some(rank(block)) == best);
        let mut end = 0;
        for block in &mut blocks {
            block.head.start = end;
            end = block.rows.end;
        }
        blocks
    }

    /// Why a table is none of points: it is a map of heights, has too many columns, or each of its lines is a quantity.
    pub fn shape_fault(&self, block: &Block, has_names: bool) -> Option<String> {
        let (count, width) = (block.rows.len(), block.layout.cells);
        let first = block.rows.clone().take(SAMPLE).map(|at| self.cells(at).into_iter().next());
        let first: Vec<_> = first.map(Option::unwrap_or_default).collect();
        let known: Vec<f64> =
            first.iter().filter_map(|cell| number(cell)).filter(|it| !it.is_nan()).collect();
        let changes = |sign: f64| known.windows(2).any(|pair| sign * (pair[1] - pair[0]) > 0.0);
        let is_wide = width > MAX_COLUMNS;
        // The first column of a map goes up and down.
        let is_map = is_wide || !has_names && changes(1.0) && changes(-1.0);
        if is_map && count.min(width) >= MAP {
            return Some(format!(
                "The file is a map of {count} × {width} heights, and no table. In the program of the instrument, take a profile \
                 across the scar, and save it as two columns with names such as x [mm];z [um]"
            ));
        }
        let is_transposed = !has_names
            && first.iter().all(|cell| is_word(cell))
            && (count < block.layout.count() || first.iter().any(|cell| header(cell).1.is_some()));
        let wide = is_wide.then(|| format!("The table has {width} columns. {WIDE}"));
        wide.or_else(|| is_transposed.then(|| TRANSPOSED.to_owned()))
    }

    /// Whether all cells of a line are units.
    pub fn is_units(cells: &[Cow<'_, str>]) -> bool {
        cells.iter().all(|cell| unit(cell).is_some() || header(cell).0.is_empty())
    }
}
