//! Search for results: reads the conditions of a search, and writes them as SQL.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use serde::Deserialize;

use crate::database::reach::Seen;
use crate::database::{Columns, Reach, Result, Row, Statement, Tables, Words, page_of, read, sql};
use crate::results::notes::{self, Note};
use fretwork_engine::input::quantity::{self, Dimension};
use fretwork_job::{JobId, Key, Outline, SCALARS, WORDS, clock};

/// The names of the searchable words and numbers, in the order of an [`Outline`]. They are columns of `outline`.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    let words = WORDS.iter().map(|word| word.name);
    words.chain(SCALARS.iter().map(|scalar| scalar.name))
}

/// Which results to list, and in which order. The default lists all, the newest first.
#[derive(Debug, Clone, Default)]
pub struct Search {
    words: Vec<(&'static str, String)>,
    ranges: BTreeMap<&'static str, Range>,
    owner: Option<String>,
    submitted_by: Option<String>,
    pinned: Option<bool>,
    pinned_by: Option<String>,
    evicted: bool,
    note: Option<String>,
    tag: Option<String>,
    label: Option<String>,
    /// Words in labels, tags and notes.
    text: Words,
    keys: Option<Vec<Key>>,
    /// Labels, tags and words match only what this caller sees, and the list shows nothing else.
    reach: Reach,
    order: SortOrder,
}

/// The order of a list.
#[derive(Debug, Clone, Copy)]
struct SortOrder {
    /// The column to sort by.
    by: &'static str,
    descending: bool,
}

impl Default for SortOrder {
    fn default() -> Self {
        Self { by: "created", descending: true }
    }
}

/// A closed interval.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Range {
    low: f64,
    high: f64,
}

/// Relative width by which bounds are extended. Computed numbers can differ in their last digits, and a user
/// who copies a displayed number must find it.
const SLACK: f64 = 1e-9;

impl Range {
    /// Reads `a..b`, `a..`, `..b` or a single value. `value` reads one bound. A bound is itself an interval, for
    /// example a whole day.
    fn read(text: &str, value: impl Fn(&str) -> Result<Self, String>) -> Result<Self, String> {
        let (low, high) = text.split_once("..").unwrap_or((text, text));
        let (low, high) = (low.trim(), high.trim());
        if low.is_empty() && high.is_empty() {
            return Err("must be a value, or a range such as 1..2, 1.. or ..2".to_owned());
        }
        let open = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };
        let bound = |text: &str| if text.is_empty() { Ok(open) } else { value(text) };
        let Self { low, .. } = bound(low)?;
        let Self { high, .. } = bound(high)?;
        if low > high {
            return Err(format!(
                "must be a range whose first bound is the smaller one, got {text:?}"
            ));
        }
        Ok(Self { low, high })
    }

    /// Reads a range of a quantity. The bounds may have units.
    fn quantity(text: &str, dimension: Dimension) -> Result<Self, String> {
        let text = &*written(text, dimension);
        let is_plain = |text: &str| text.trim().parse::<f64>().is_ok_and(|number| number != 0.0);
        let has_unit = |text: &str| !text.trim().is_empty() && text.trim().parse::<f64>().is_err();
        if let Some((low, high)) = text.split_once("..")
            && ((is_plain(low) && has_unit(high)) || (has_unit(low) && is_plain(high)))
        {
            // `0.1..0.2 kN` would be 0.1 N to 200 N, which is probably a mistake.
            return Err(format!("must have a unit at both bounds or at neither, got {text:?}"));
        }
        Self::read(text, |text| {
            let value = quantity::parse(text, dimension)?;
            let slack = SLACK * value.abs();
            Ok(Self { low: value - slack, high: value + slack })
        })
    }
}

/// The range `a..b` that is meant by a text such as `0.6-0.8`, `0,6..0,8` or `>0.6`.
fn written(text: &str, dimension: Dimension) -> String {
    let text = with_points(text.trim());
    for (signs, below) in [(["<=", "≤", "<"], true), ([">=", "≥", ">"], false)] {
        if let Some(bound) = signs.iter().find_map(|sign| text.strip_prefix(sign)) {
            return if below { format!("..{bound}") } else { format!("{bound}..") };
        }
    }
    dashed(&text, dimension).unwrap_or(text)
}

/// Replaces decimal commas. A comma before three digits stays, and gives an error: it can separate thousands.
fn with_points(text: &str) -> String {
    let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
    let decimal = |(at, _): &(usize, &str)| {
        let before = text[..*at].bytes().next_back().is_some_and(|byte| byte.is_ascii_digit());
        let is_zero = text[..*at].rsplit(|c: char| !c.is_ascii_digit()).next() == Some("0");
        let after = digits(&text[at + 1..]);
        before && after > 0 && (after != 3 || is_zero)
    };
    let mut text_with_points = text.to_owned();
    for (at, _) in text.match_indices(',').filter(decimal) {
        text_with_points.replace_range(at..=at, ".");
    }
    text_with_points
}

/// The range that is meant by `0.6-0.8`. A dash between two values is no sign.
fn dashed(text: &str, dimension: Dimension) -> Option<String> {
    let is_dash = |&(at, letter): &(usize, char)| {
        matches!(letter, '-' | '–' | '—') && !text[..at].ends_with(['e', 'E', '.'])
    };
    let (at, dash) = text.char_indices().skip(1).find(is_dash)?;
    let (low, high) = (text[..at].trim(), text[at + dash.len_utf8()..].trim());
    let are_values = [low, high].iter().all(|bound| quantity::parse(bound, dimension).is_ok());
    are_values.then(|| format!("{low}..{high}"))
}

/// Reads an RFC 3339 time or a day (UTC), in milliseconds since 1970. A day is read as the interval from its first to
/// its last millisecond.
fn moment(text: &str) -> Result<Range, String> {
    let is_day = !text.contains(['T', 't', ' ']);
    let whole = if is_day { format!("{text}T00:00:00Z") } else { text.to_owned() };
    let low = clock::parse(&whole).ok_or_else(|| {
        format!("must be a time such as 2026-01-31 or 2026-01-31T12:00:00Z, got {text:?}")
    })? as f64;
    Ok(Range { low, high: if is_day { low + 86_399_999.0 } else { low } })
}

/// Reads keys separated by commas.
fn keys(text: &str) -> Result<Vec<Key>, String> {
    const MOST: usize = 200;
    let keys: Result<Vec<Key>, _> = text.split(',').map(str::parse).collect();
    keys.ok().filter(|keys| keys.len() <= MOST).ok_or_else(|| {
        format!(
            "must be at most {MOST} keys of 64 lower-case hexadecimal digits, separated by commas"
        )
    })
}

impl Search {
    /// All names that [`set`](Self::set) accepts.
    pub fn names() -> impl Iterator<Item = &'static str> {
        let others = [
            "created",
            "size",
            "owner",
            "submitted_by",
            "pinned",
            "pinned_by",
            "evicted",
            "note",
            "tag",
            "label",
            "q",
            "keys",
            "sort",
        ];
        names().chain(others)
    }

    /// All names to sort by.
    pub fn orders() -> impl Iterator<Item = &'static str> {
        ["created", "size"].into_iter().chain(SCALARS.iter().map(|scalar| scalar.name))
    }

    /// Restricts the search to the labels, tags and notes that a caller sees. By default, it has those of all jobs, and no
    /// private notes.
    pub fn within(reach: Reach) -> Self {
        Self { reach, ..Self::default() }
    }

    /// Adds one condition, or sets the order.
    ///
    /// # Errors
    /// A sentence that says what the value must be, or that the name is unknown.
    pub fn set(&mut self, name: &str, value: &str) -> Result<(), String> {
        if let Some(word) = WORDS.iter().find(|word| word.name == name) {
            if !word.values.contains(&value) {
                return Err(format!("must be one of {}, got {value:?}", word.values.join(", ")));
            }
            self.words.push((word.name, value.to_owned()));
            return Ok(());
        }
        if let Some(scalar) = SCALARS.iter().find(|scalar| scalar.name == name) {
            self.restrict(scalar.name, Range::quantity(value, scalar.dimension)?);
            return Ok(());
        }
        let flag = || match value {
            "true" => Ok(true),
            "false" => Ok(false),
            _ => Err(format!("must be true or false, got {value:?}")),
        };
        match name {
            "created" => self.restrict("created", Range::read(value, moment)?),
            "size" => self.restrict("size", Range::quantity(value, Dimension::Number)?),
            "owner" => self.owner = Some(value.to_owned()),
            "submitted_by" => self.submitted_by = Some(value.to_owned()),
            "pinned" => self.pinned = Some(flag()?),
            "pinned_by" => self.pinned_by = Some(value.to_owned()),
            "evicted" => self.evicted = flag()?,
            "note" => self.note = Some(value.to_owned()),
            "tag" => self.tag = Some(value.to_owned()),
            "label" => self.label = Some(value.to_owned()),
            "q" => self.text = value.parse()?,
            "keys" => self.keys = Some(keys(value)?),
            "sort" => self.sort(value)?,
            _ => {
                let names: Vec<_> = Self::names().collect();
                return Err(format!("is unknown; the known names are {}", names.join(", ")));
            }
        }
        Ok(())
    }

    /// Sets the order. A minus sign before the name puts the largest first.
    fn sort(&mut self, value: &str) -> Result<(), String> {
        let (name, descending) =
            value.strip_prefix('-').map_or((value, false), |name| (name, true));
        let by = Self::orders().find(|known| *known == name).ok_or_else(|| {
            let names: Vec<_> = Self::orders().collect();
            format!(
                "must be one of {}, or one of them after a minus sign for the largest first; got \
                 {value:?}",
                names.join(", ")
            )
        })?;
        self.order = SortOrder { by, descending };
        Ok(())
    }

    /// Restricts a number to a range, in addition to earlier ranges.
    fn restrict(&mut self, name: &'static str, range: Range) {
        let kept = self.ranges.entry(name).or_insert(range);
        *kept = Range { low: kept.low.max(range.low), high: kept.high.min(range.high) };
    }

    /// Writes all conditions on rows of `outline`.
    fn conditions(&self, query: &mut Statement) {
        query.push(if self.evicted { "NOT present" } else { "present" });
        for (name, word) in &self.words {
            query.push(" AND outline.").push(name).push(" = ").push_bind(&**word);
        }
        for (name, Range { low, high }) in &self.ranges {
            if low.is_finite() {
                query.push(" AND outline.").push(name).push(" >= ").push_bind(*low);
            }
            if high.is_finite() {
                query.push(" AND outline.").push(name).push(" <= ").push_bind(*high);
            }
        }
        if let Some(owner) = &self.owner {
            query.push(" AND outline.owner = ").push_bind(&**owner);
        }
        if let Some(owner) = &self.submitted_by {
            // A job is deleted earlier than the result that it computed.
            query.push(" AND (outline.owner = ").push_bind(&**owner).push(" OR ");
            self.with_job(query, "job", "job.owner", owner);
            query.push(")");
        }
        if let Some(pinned) = self.pinned {
            query.push(if pinned { " AND outline.id IN (" } else { " AND outline.id NOT IN (" });
            query.push("SELECT id FROM result_task JOIN result USING (key) WHERE pinned)");
        }
        if let Some(owner) = &self.pinned_by {
            query.push(" AND outline.id IN (SELECT id FROM result_task JOIN result USING (key)");
            query.push(" WHERE pinned AND pinned_by = ").push_bind(&**owner).push(")");
        }
        if let Some(note) = &self.note {
            query.push(" AND outline.id IN (SELECT id FROM result_task JOIN ");
            query.notes_within(&self.reach).push(" USING (key) WHERE ");
            query.push_either("instr", "strpos").push("(lower(text), lower(");
            query.push_bind(&**note).push(")) > 0)");
        }
        if let Some(tag) = &self.tag {
            query.push(" AND ");
            self.with_job(query, "job_tag JOIN job ON job.id = job_tag.job", "tag", tag);
        }
        if let Some(label) = &self.label {
            query.push(" AND ");
            self.with_job(query, "job", "label", label);
        }
        query.outline_has_words(&self.text, &self.reach);
        if let Some(keys) = &self.keys {
            query.push(" AND outline.id IN (SELECT id FROM result_task WHERE key IN (");
            for (place, key) in keys.iter().enumerate() {
                query.push(if place > 0 { ", " } else { "" }).push_bind(key);
            }
            query.push("))");
        }
    }

    /// Whether the search has a condition on the label or the tags of a job.
    fn is_by_name(&self) -> bool {
        self.label.is_some() || self.tag.is_some() || self.text != Words::default()
    }

    /// Writes these conditions on `job`, which has a label or tags.
    fn found_name(&self, query: &mut Statement) {
        query.push(" AND (label IS NOT NULL OR tags <> '[]')");
        if let Some(label) = &self.label {
            query.push(" AND label = ").push_bind(&**label);
        }
        if let Some(tag) = &self.tag {
            query.push(" AND id IN (SELECT job FROM job_tag WHERE tag = ").push_bind(&**tag);
            query.push(")");
        }
        query.name_has_words(&self.text, &self.reach);
    }

    /// Writes the condition that a job with this label, tag or owner has the key of the result.
    fn with_job(
        &self,
        query: &mut Statement,
        jobs: &'static str,
        column: &'static str,
        value: &str,
    ) {
        query.push("outline.id IN (SELECT result_task.id FROM ").push(jobs);
        query.push(" JOIN result_task ON result_task.key = job.key WHERE ").push(column);
        query.push(" = ").push_bind(value);
        query.job_within(&self.reach);
        query.push(")");
    }
}

/// The stored result whose inputs are nearest to those of an outline, other than `except`. The distance is the sum of
/// the relative differences, plus 10 for each word that differs.
pub(crate) async fn nearest(
    to: &Outline,
    except: Option<Key>,
    mut db: impl Tables,
) -> Result<Option<Key>> {
    let mut query = sql!(
        "SELECT key FROM result_task WHERE id = (SELECT id FROM outline WHERE present AND kind = 'run'"
    );
    if let Some(key) = except {
        query.push(" AND id IS DISTINCT FROM (SELECT id FROM result_task WHERE key = ");
        query.push_bind(key).push(")");
    }
    query.push(" ORDER BY 0.0");
    for (word, value) in WORDS.iter().zip(&to.words) {
        if word.name != "regime" {
            query.push(" + CASE WHEN outline.").push(word.name).push(" IS DISTINCT FROM ");
            query.push_bind(value.clone()).push(" THEN 10.0 ELSE 0.0 END");
        }
    }
    let inputs = SCALARS.iter().zip(&to.scalars).filter(|(scalar, _)| scalar.is_input);
    for (scalar, value) in inputs {
        let Some(value) = value else { continue };
        query.push(" + coalesce(abs(outline.").push(scalar.name).push(" - ").push_bind(*value);
        query.push(") / ").push_either("max", "greatest").push("(abs(outline.").push(scalar.name);
        query.push("), ").push_bind(value.abs()).push(", 1e-300), 1.0)");
    }
    query.push(", outline.id DESC LIMIT 1)");
    Ok(db.row(query).await?.map(|row| row.get("key")).transpose()?)
}

/// The position of the last result of a page: its value in the sort column, and its row number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cursor {
    value: Option<f64>,
    id: i64,
}

impl Cursor {
    /// Reads the columns `place` and `id`.
    fn read(row: &Row) -> sqlx::Result<Self> {
        Ok(Self { value: row.get("place")?, id: row.get("id")? })
    }
}

impl fmt::Display for Cursor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.value {
            Some(value) => write!(f, "{:016x}-{}", value.to_bits(), self.id),
            None => write!(f, "null-{}", self.id),
        }
    }
}

impl FromStr for Cursor {
    type Err = ();
    fn from_str(text: &str) -> Result<Self, ()> {
        let (value, id) = text.split_once('-').ok_or(())?;
        let value = match value {
            "null" => None,
            bits if bits.len() == 16 => {
                let value = f64::from_bits(u64::from_str_radix(bits, 16).map_err(drop)?);
                Some(value).filter(|value| value.is_finite()).map(Some).ok_or(())?
            }
            _ => return Err(()),
        };
        Ok(Self { value, id: id.parse().map_err(drop)? })
    }
}

/// A result in a list.
#[derive(Debug, Clone, PartialEq)]
pub struct Listed {
    /// Its key.
    pub key: Key,
    /// When this server first stored the key. Times are milliseconds since 1970.
    pub created: i64,
    /// The owner whose job computed it; `None` if that is unknown.
    pub owner: Option<String>,
    /// Size of its body in bytes.
    pub size: u64,
    /// Whether it is pinned: never evicted.
    pub pinned: bool,
    /// When its body was evicted or deleted.
    pub evicted: Option<i64>,
    /// Its note.
    pub note: Option<Note>,
    /// The job whose label and tags describe it: the one that the search found by its label or tags, else the latest job with a label, else
    /// the latest job.
    pub named: Option<Named>,
    /// The design of a sweep, such as `latin_hypercube`.
    pub design: Option<String>,
    /// Its searchable words and numbers.
    pub outline: Outline,
}

/// The design in the stored form of a sweep.
fn design_of(task: &str) -> Option<String> {
    #[derive(Deserialize)]
    struct Stored {
        sweep: Sweep,
    }
    #[derive(Deserialize)]
    struct Sweep {
        design: String,
    }
    serde_json::from_str(task).ok().map(|stored: Stored| stored.sweep.design)
}

/// A job whose label and tags describe a result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Named {
    /// The id of the job.
    pub job: JobId,
    /// Its label.
    pub label: Option<String>,
    /// Its tags.
    pub tags: Vec<String>,
    /// Its owner.
    pub owner: String,
}

impl Named {
    fn read(row: &Row) -> sqlx::Result<Option<Self>> {
        let Some(job) = row.get("job")? else { return Ok(None) };
        let (label, tags) = (row.get("label")?, row.get("tags")?);
        Ok(Some(Self { job, label, tags, owner: row.get("named_by")? }))
    }
}

impl Listed {
    fn read(row: &Row) -> sqlx::Result<Self> {
        let mut outline = Outline::default();
        for (word, value) in WORDS.iter().zip(&mut outline.words) {
            *value = row.get(word.name)?;
        }
        for (scalar, value) in SCALARS.iter().zip(&mut outline.scalars) {
            *value = row.get(scalar.name)?;
        }
        let (note, named) = (Note::read(row)?, Named::read(row)?);
        let sweep: Option<&str> = row.get("sweep")?;
        let design = sweep.and_then(design_of);
        Ok(
            read!(row => Self { key, created, owner, size, pinned, evicted; note, named, design, outline }),
        )
    }
}

/// One page of search results.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchPage {
    /// The results.
    pub results: Vec<Listed>,
    /// The cursor of the next page; `None` on the last page.
    pub next: Option<Cursor>,
}

impl SearchPage {
    /// Up to `limit` matching results after `cursor`.
    pub(crate) async fn page(
        search: &Search,
        cursor: Option<Cursor>,
        limit: u32,
        mut db: impl Tables,
    ) -> Result<Self> {
        let rows = db.rows(page(search, cursor, limit)).await?;
        let (rows, last) = page_of(&rows, limit);
        let next = last.map(Cursor::read).transpose()?;
        Ok(Self { results: rows.iter().map(Listed::read).collect::<Result<_, _>>()?, next })
    }
}

/// The number of results that match a search.
pub(crate) async fn count(search: &Search, mut db: impl Tables) -> Result<u64> {
    let mut query = sql!("SELECT count(*) AS total FROM outline WHERE ");
    search.conditions(&mut query);
    Ok(db.one(query).await?.get("total")?)
}

/// The statement that reads the rows of a page and one row more. Results without a value in the sort column come last
/// in both directions.
pub(crate) fn page(search: &Search, cursor: Option<Cursor>, limit: u32) -> Statement {
    let mut query = sql!("SELECT outline.id AS id");
    for name in names() {
        query.push(", outline.").push(name).push(" AS ").push(name);
    }
    query.push(", CAST(outline.").push(search.order.by).push(
        " AS DOUBLE PRECISION) AS place, result.key AS key, result.created AS created, result.size AS size,
             result.owner AS owner, pinned, evicted, named.id AS job, named.label AS label, named.tags AS tags,
             named.owner AS named_by, CASE WHEN outline.kind = 'sweep' THEN result_task.task END AS sweep, ",
    );
    query.push(notes::COLUMNS).push(" FROM (SELECT * FROM outline WHERE ");
    search.conditions(&mut query);
    after(&mut query, search, cursor);
    order(&mut query, search);
    query.push(" LIMIT ").push_bind(i64::from(limit) + 1);
    // The other tables are read only for the rows of the page.
    query.push(
        ") AS outline JOIN result_task ON result_task.id = outline.id
         JOIN result ON result.key = result_task.key",
    );
    query.join_note(&search.reach.owner).push(" LEFT JOIN job AS named ON named.id = coalesce(");
    // A search for names shows the name that it found. A caller sees its own name first.
    let own = Reach { jobs: Seen::Own, ..search.reach.clone() };
    let reaches = [&own, &search.reach];
    let mut alternative = |reach: &Reach, condition: &dyn Fn(&mut Statement)| {
        query.push("(SELECT id FROM job WHERE job.key = result.key");
        condition(&mut query);
        query.job_within(reach);
        query.push(" ORDER BY id DESC LIMIT 1), ");
    };
    for reach in reaches.into_iter().filter(|_| search.is_by_name()) {
        alternative(reach, &|query| search.found_name(query));
    }
    for reach in reaches {
        alternative(reach, &|query| {
            query.push(" AND label IS NOT NULL");
        });
    }
    alternative(&search.reach, &|_| ());
    query.push("NULL)");
    order(&mut query, search);
    query
}

fn order(query: &mut Statement, search: &Search) {
    let direction = if search.order.descending { "DESC" } else { "ASC" };
    query.push(&format!(
        " ORDER BY outline.{} {direction} NULLS LAST, outline.id {direction}",
        search.order.by
    ));
}

/// Restricts a statement to results after the cursor.
fn after(query: &mut Statement, search: &Search, cursor: Option<Cursor>) {
    let Some(Cursor { value, id }) = cursor else { return };
    let SortOrder { by, descending } = search.order;
    let beyond = if descending { "<" } else { ">" };
    let Some(value) = value else {
        query.push(&format!(" AND outline.{by} IS NULL AND outline.id {beyond} "));
        query.push_bind(id);
        return;
    };
    query.push(&format!(" AND ((outline.{by}, outline.id) {beyond} ("));
    query.push_bind(value).push(", ").push_bind(id).push(")");
    // The columns `created` and `size` are never null, so they do not need the second condition. Without it, SQLite can
    // use their index.
    if !matches!(by, "created" | "size") {
        query.push(&format!(" OR outline.{by} IS NULL"));
    }
    query.push(")");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_parsed_with_and_without_units() {
        let range = |text| Range::quantity(text, Dimension::Force);
        let near = |text, low: f64, high: f64| {
            let Range { low: from, high: to } = range(text).unwrap();
            let close = |a: f64, b: f64| a.total_cmp(&b).is_eq() || (a / b - 1.0).abs() < 2e-9;
            assert!(close(from, low) && close(to, high), "{text}: {from} {to}");
            assert!(from <= low && to >= high, "{text}");
        };
        near("50 N..0.2 kN", 50.0, 200.0);
        near("50..200", 50.0, 200.0);
        near("50..", 50.0, f64::INFINITY);
        near(" .. 2 N", f64::NEG_INFINITY, 2.0);
        near("100", 100.0, 100.0);
        near("0..1 kN", 0.0, 1000.0);
        for bad in
            ["", "..", "2..1", "50..200 N", "0.1 kN..2", "a..b", "1 m", "1..2..3", "1e308 kN.."]
        {
            assert!(range(bad).is_err(), "{bad}");
        }
        near("50-200", 50.0, 200.0);
        near("50 N – 0.2 kN", 50.0, 200.0);
        near("1e-3-2", 1e-3, 2.0);
        near("0,6..0,8 ", 0.6, 0.8);
        near("0,125", 0.125, 0.125);
        near("> 50 N", 50.0, f64::INFINITY);
        near("<=0,2 kN", f64::NEG_INFINITY, 200.0);
        for bad in ["1,000", ">", "<1..2", ">50-200", "1,", ",5", "50-200 N"] {
            assert!(range(bad).is_err(), "{bad}");
        }
        near("-2..-1e-3", -2.0, -1e-3);
    }

    #[test]
    fn times_are_parsed_as_dates_or_timestamps() {
        let range = |text| Range::read(text, moment);
        let day = 86_400_000.0;
        assert_eq!(range("1970-01-02"), Ok(Range { low: day, high: 2.0 * day - 1.0 }));
        assert_eq!(range("1970-01-01..1970-01-03"), Ok(Range { low: 0.0, high: 3.0 * day - 1.0 }));
        assert_eq!(
            range("1970-01-01T00:00:01Z..1970-01-01T00:00:02.5Z"),
            Ok(Range { low: 1000.0, high: 2500.0 })
        );
        assert!(range("yesterday").is_err());
        assert!(range("1969-12-31").is_err());
        assert!(range("1970-01-03..1970-01-02").is_err());
    }

    #[test]
    fn a_cursor_is_unchanged_after_a_round_trip_through_text() {
        for value in [None, Some(0.0), Some(-1.5), Some(2.5e-13)] {
            let cursor = Cursor { value, id: 7 };
            assert_eq!(cursor.to_string().parse(), Ok(cursor));
        }
        for bad in ["", "null", "7ff0000000000000-1", "1-1", "null-x"] {
            assert!(bad.parse::<Cursor>().is_err(), "{bad}");
        }
    }
}
