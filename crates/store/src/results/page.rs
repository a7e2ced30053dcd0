//! Lists the results of a search in pages.

use std::fmt;
use std::str::FromStr;

use serde::Deserialize;

use super::notes::{self, Note};
use super::search::{Search, SortOrder, names};
use crate::database::reach::Seen;
use crate::database::{Reach, Result, Row, Statement, Tables, page_of, read, sql};
use fretwork_job::{JobId, Key, Outline, SCALARS, WORDS};

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
    query.push_limit(limit + 1);
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
