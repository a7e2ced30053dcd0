//! Search for results: reads the conditions of a search, and writes them as SQL.

use std::collections::BTreeMap;

use super::range::{Range, moment};
use crate::database::{Reach, Result, Statement, Tables, Words, sql};
use fretwork_engine::input::quantity::Dimension;
use fretwork_job::{Key, Outline, SCALARS, WORDS};

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
    pub(super) reach: Reach,
    pub(super) order: SortOrder,
}

/// The order of a list.
#[derive(Debug, Clone, Copy)]
pub(super) struct SortOrder {
    /// The column to sort by.
    pub(super) by: &'static str,
    pub(super) descending: bool,
}

impl Default for SortOrder {
    fn default() -> Self {
        Self { by: "created", descending: true }
    }
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
        let flag = || value.parse().map_err(|_| format!("must be true or false, got {value:?}"));
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
    pub(super) fn conditions(&self, query: &mut Statement) {
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
    pub(super) fn is_by_name(&self) -> bool {
        self.label.is_some() || self.tag.is_some() || self.text != Words::default()
    }

    /// Writes these conditions on `job`, which has a label or tags.
    pub(super) fn found_name(&self, query: &mut Statement) {
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

/// The number of results that match a search.
pub(crate) async fn count(search: &Search, mut db: impl Tables) -> Result<u64> {
    let mut query = sql!("SELECT count(*) AS total FROM outline WHERE ");
    search.conditions(&mut query);
    Ok(db.one(query).await?.get("total")?)
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
