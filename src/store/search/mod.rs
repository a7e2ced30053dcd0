//! Looking for results: what may be asked, and how it becomes conditions on outlines.

mod page;

use std::collections::BTreeMap;
use std::time::{Duration, UNIX_EPOCH};

use sqlx::{QueryBuilder, Sqlite, SqliteConnection};

use super::Error;
use super::outline::{Outline, SCALARS, WORDS};
use super::read::key;
use crate::job::Key;
use fretwork_engine::request::quantity::{self, Dimension};

pub(super) use page::page;
pub use page::{Cursor, Found, Listed};

/// Which results to list, and in which order; what is not set asks for nothing.
#[derive(Debug, Clone)]
pub struct Search {
    words: Vec<(&'static str, String)>,
    ranges: BTreeMap<&'static str, Range>,
    owner: Option<String>,
    pinned: Option<bool>,
    evicted: bool,
    note: Option<String>,
    tag: Option<String>,
    label: Option<String>,
    /// Only jobs of theirs are asked for tags and labels.
    of: Option<String>,
    by: &'static str,
    descending: bool,
}

impl Default for Search {
    fn default() -> Self {
        Self {
            words: Vec::new(),
            ranges: BTreeMap::new(),
            owner: None,
            pinned: None,
            evicted: false,
            note: None,
            tag: None,
            label: None,
            of: None,
            by: "created",
            descending: true,
        }
    }
}

/// Numbers between two, which are among them.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Range {
    low: f64,
    high: f64,
}

/// Derived numbers are off in the last digits: what is asked for by all of its usual digits is meant.
const SLACK: f64 = 1e-9;

impl Range {
    /// Reads `a..b`, `a..`, `..b` or a single value; `value` says from where to where one reaches.
    fn read(text: &str, value: impl Fn(&str) -> Result<Self, String>) -> Result<Self, String> {
        let (low, high) = text.split_once("..").unwrap_or((text, text));
        let (low, high) = (low.trim(), high.trim());
        if low.is_empty() && high.is_empty() {
            return Err("must be a value or a range: a..b, a.. or ..b".to_owned());
        }
        let open = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };
        let bound = |text: &str| if text.is_empty() { Ok(open) } else { value(text) };
        let Self { low, .. } = bound(low)?;
        let Self { high, .. } = bound(high)?;
        if low > high {
            return Err(format!("the range {text:?} is empty: its first bound is the larger one"));
        }
        Ok(Self { low, high })
    }

    /// Reads a range of a quantity, whose bounds may carry units.
    fn quantity(text: &str, dimension: Dimension) -> Result<Self, String> {
        let is_plain = |text: &str| text.trim().parse::<f64>().is_ok_and(|number| number != 0.0);
        let has_unit = |text: &str| !text.trim().is_empty() && text.trim().parse::<f64>().is_err();
        if let Some((low, high)) = text.split_once("..")
            && ((is_plain(low) && has_unit(high)) || (has_unit(low) && is_plain(high)))
        {
            // 0.1..0.2 kN: nobody means 0.1 N to 200 N.
            return Err(format!("{text:?}: give both bounds their unit, or neither"));
        }
        Self::read(text, |text| {
            let value = quantity::parse(text, dimension)?;
            let slack = SLACK * value.abs();
            Ok(Self { low: value - slack, high: value + slack })
        })
    }
}

/// A moment as RFC 3339, or a day from its first to its last millisecond, in those since 1970.
fn moment(text: &str) -> Result<Range, String> {
    let is_day = !text.contains(['T', 't', ' ']);
    let whole = if is_day { format!("{text}T00:00:00Z") } else { text.to_owned() };
    let time = humantime::parse_rfc3339_weak(&whole)
        .map_err(|_| format!("{text:?} is no moment; write 2026-01-31 or 2026-01-31T12:00:00Z"))?;
    let since = time.duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO);
    let low = since.as_millis() as f64;
    Ok(Range { low, high: if is_day { low + 86_399_999.0 } else { low } })
}

impl Search {
    /// Every name that [`set`](Self::set) knows.
    pub fn names() -> impl Iterator<Item = &'static str> {
        let words = WORDS.iter().map(|word| word.name);
        let others =
            ["created", "size", "owner", "pinned", "evicted", "note", "tag", "label", "sort"];
        words.chain(SCALARS.iter().map(|scalar| scalar.name)).chain(others)
    }

    /// Looks for tags and labels among the jobs of this owner only, if there is one.
    pub fn only_jobs_of(&mut self, owner: Option<&str>) {
        self.of = owner.map(str::to_owned);
    }

    /// Asks for one thing more: a word, a range of a number, or the order.
    ///
    /// # Errors
    /// A sentence that says what the value must be, or that there is no such name.
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
            "pinned" => self.pinned = Some(flag()?),
            "evicted" => self.evicted = flag()?,
            "note" => self.note = Some(value.to_owned()),
            "tag" => self.tag = Some(value.to_owned()),
            "label" => self.label = Some(value.to_owned()),
            "sort" => {
                let (by, descending) = match value.strip_prefix('-') {
                    Some(by) => (by, true),
                    None => (value, false),
                };
                self.by = sorted_by(by).ok_or_else(|| {
                    let names: Vec<_> = SCALARS.iter().map(|scalar| scalar.name).collect();
                    format!(
                        "must be created, size, {}, or one of them after a minus sign for the \
                         largest first; got {value:?}",
                        names.join(", ")
                    )
                })?;
                self.descending = descending;
            }
            _ => {
                let names: Vec<_> = Self::names().collect();
                return Err(format!("is unknown; there are {}", names.join(", ")));
            }
        }
        Ok(())
    }

    /// Asks for a number within a range, and within all that were asked for before.
    fn restrict(&mut self, name: &'static str, range: Range) {
        let kept = self.ranges.entry(name).or_insert(range);
        *kept = Range { low: kept.low.max(range.low), high: kept.high.min(range.high) };
    }

    /// The index along which results lie in the order that is asked for.
    fn order(&self) -> &'static str {
        if self.by == "created" && self.owner.is_some() { OWNER } else { self.by }
    }

    /// The other indexes that lead to results that may be asked for, and to none besides by the one
    /// condition: few or many, who knows.
    fn shortcuts(&self) -> Vec<&'static str> {
        let owner = self.owner.as_ref().map(|_| OWNER);
        let all = self.ranges.keys().copied().chain(owner);
        all.filter(|index| *index != self.order() && *index != self.by).collect()
    }

    /// Whether a condition names results, which are looked up one by one.
    fn names_results(&self) -> bool {
        self.pinned == Some(true)
            || [&self.note, &self.tag, &self.label].into_iter().any(Option::is_some)
    }

    /// Ends conditions by those that an index answers by itself.
    fn along(&self, query: &mut QueryBuilder<Sqlite>, index: &str) {
        if index == OWNER {
            self.owned(query);
            self.within(query, "created");
        } else {
            self.within(query, index);
        }
    }

    fn owned(&self, query: &mut QueryBuilder<Sqlite>) {
        if let Some(owner) = &self.owner {
            query.push(" AND outline.owner = ").push_bind(owner.clone());
        }
    }

    /// What is asked of one number.
    fn within(&self, query: &mut QueryBuilder<Sqlite>, name: &str) {
        let Some(Range { low, high }) = self.ranges.get(name) else { return };
        if low.is_finite() {
            query.push(" AND outline.").push(name).push(" >= ").push_bind(*low);
        }
        if high.is_finite() {
            query.push(" AND outline.").push(name).push(" <= ").push_bind(*high);
        }
    }

    /// What is asked, as conditions on outlines.
    fn conditions(&self, query: &mut QueryBuilder<Sqlite>) {
        query.push(if self.evicted { "NOT present" } else { "present" });
        for (name, word) in &self.words {
            query.push(" AND outline.").push(*name).push(" = ").push_bind(word.clone());
        }
        for name in self.ranges.keys() {
            self.within(query, name);
        }
        self.owned(query);
        match self.pinned {
            Some(true) => {
                query.push(" AND outline.id IN ").push(PINNED);
            }
            Some(false) => {
                query.push(" AND outline.id NOT IN ").push(PINNED);
            }
            None => {}
        }
        if let Some(note) = &self.note {
            among(query, "note JOIN result_task USING (key)");
            query.push(" WHERE instr(lower(text), lower(").push_bind(note.clone()).push(")))");
        }
        if let Some(tag) = &self.tag {
            let tagged = "job_tag JOIN job ON job.id = job_tag.job \
                JOIN result_task ON result_task.key = job.key";
            among(query, tagged);
            query.push(" WHERE tag = ").push_bind(tag.clone());
            self.of_owner(query);
        }
        if let Some(label) = &self.label {
            among(query, "job JOIN result_task ON result_task.key = job.key");
            query.push(" WHERE label = ").push_bind(label.clone());
            self.of_owner(query);
        }
    }

    /// Ends a condition on jobs.
    fn of_owner(&self, query: &mut QueryBuilder<Sqlite>) {
        if let Some(owner) = &self.of {
            query.push(" AND job.owner = ").push_bind(owner.clone());
        }
        query.push(")");
    }
}

/// The name of the index of owners, within which results lie in the order in which they came.
const OWNER: &str = "owner";

/// The outlines of pinned results, which are few.
const PINNED: &str = "(SELECT result_task.id FROM result INDEXED BY result_pinned
    JOIN result_task USING (key) WHERE pinned)";

/// Restricts outlines to those of a join; the condition and the parenthesis are the caller's.
fn among(query: &mut QueryBuilder<Sqlite>, join: &'static str) {
    query.push(" AND outline.id IN (SELECT result_task.id FROM ").push(join);
}

fn sorted_by(name: &str) -> Option<&'static str> {
    let scalars = SCALARS.iter().map(|scalar| scalar.name);
    ["created", "size"].into_iter().chain(scalars).find(|known| *known == name)
}

/// The result that is there whose given quantities are nearest to those of an outline: by the sum of
/// their relative differences, and 10 for each word that differs.
pub(super) async fn nearest(
    db: &mut SqliteConnection,
    to: &Outline,
    except: Option<Key>,
) -> Result<Option<Key>, Error> {
    let mut query = QueryBuilder::<Sqlite>::new(
        "SELECT key FROM result_task WHERE id = (SELECT id FROM outline WHERE present",
    );
    if let Some(key) = except {
        query.push(" AND id IS NOT (SELECT id FROM result_task WHERE key = ");
        query.push_bind(key.bytes().to_vec()).push(")");
    }
    query.push(" ORDER BY 0.0");
    for (word, value) in WORDS.iter().zip(&to.words) {
        if word.name != "regime" {
            query.push(" + 10.0 * (outline.").push(word.name).push(" IS NOT ");
            query.push_bind(value.clone()).push(")");
        }
    }
    for (scalar, value) in SCALARS.iter().zip(&to.scalars).filter(|(scalar, _)| scalar.given) {
        let Some(value) = value else { continue };
        query.push(" + coalesce(abs(outline.").push(scalar.name).push(" - ").push_bind(*value);
        query.push(") / max(abs(outline.").push(scalar.name).push("), ");
        query.push_bind(value.abs()).push(", 1e-300), 1.0)");
    }
    query.push(", outline.id DESC LIMIT 1)");
    let row = query.build().fetch_optional(db).await?;
    Ok(row.map(|row| key(&row, "key")).transpose()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_read_with_and_without_units() {
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
    }

    #[test]
    fn moments_are_days_or_instants() {
        let range = |text| Range::read(text, moment);
        let day = 86_400_000.0;
        assert_eq!(range("1970-01-02"), Ok(Range { low: day, high: 2.0 * day - 1.0 }));
        assert_eq!(range("1970-01-01..1970-01-03"), Ok(Range { low: 0.0, high: 3.0 * day - 1.0 }));
        assert_eq!(
            range("1970-01-01T00:00:01Z..1970-01-01T00:00:02.5Z"),
            Ok(Range { low: 1000.0, high: 2500.0 })
        );
        assert!(range("yesterday").is_err());
        assert!(range("1970-01-03..1970-01-02").is_err());
    }
}
