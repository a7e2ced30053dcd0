//! A page of results, at the price of the results on it.
//!
//! There are two ways to the results that are asked for: along an index of what is asked, which leads to
//! all of them and to nothing else by that, but in another order; or along the order, until the page is full.
//! Few are found sooner the first way and many the second, and nobody knows beforehand how many there
//! are: what SQLite could remember of it would be of another day, and of each number alone. So both
//! ways are tried, some steps at a time.

use std::fmt;
use std::str::FromStr;

use sqlx::sqlite::SqliteRow;
use sqlx::{QueryBuilder, Row, Sqlite, SqliteConnection};

use super::Search;
use crate::job::Key;
use crate::store::outline::{Outline, SCALARS, WORDS};
use crate::store::read::key;
use crate::store::{Error, Note};

/// Where a page begins: behind the result that has this number and this value in the order, or none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cursor {
    value: Option<f64>,
    id: i64,
}

impl Cursor {
    /// Reads the columns `place` and `id`.
    fn of(row: &SqliteRow) -> Result<Self, sqlx::Error> {
        Ok(Self { value: row.try_get("place")?, id: row.try_get("id")? })
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
    /// Its address.
    pub key: Key,
    /// When it was first known here, in milliseconds since 1970, like the times below.
    pub created: i64,
    /// For whom it was computed, if that is known.
    pub owner: Option<String>,
    /// Bytes of its body.
    pub size: u64,
    /// Whether it is kept whatever room it takes.
    pub pinned: bool,
    /// When its body was dropped.
    pub evicted: Option<i64>,
    /// What somebody says of it.
    pub note: Option<Note>,
    /// What it is looked for by.
    pub outline: Outline,
}

/// A part of a list of results.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The results.
    pub results: Vec<Listed>,
    /// Where the next page begins, if there is one.
    pub next: Option<Cursor>,
}

/// The outlines that are chosen first, and then what else there is of their results: chosen are few.
const CHOSEN: &str = ") AS outline JOIN result_task ON result_task.id = outline.id
    JOIN result ON result.key = result_task.key LEFT JOIN note ON note.key = result.key";

fn listed(row: &SqliteRow) -> Result<Listed, sqlx::Error> {
    let words = WORDS.iter().map(|word| row.try_get(word.name));
    let scalars = SCALARS.iter().map(|scalar| row.try_get(scalar.name));
    Ok(Listed {
        key: key(row, "key")?,
        created: row.try_get("created")?,
        owner: row.try_get("owner")?,
        size: u64::try_from(row.try_get::<i64, _>("size")?).unwrap_or(0),
        pinned: row.try_get("pinned")?,
        evicted: row.try_get("evicted")?,
        note: Note::read(row)?,
        outline: Outline {
            words: words.collect::<Result<_, _>>()?,
            scalars: scalars.collect::<Result<_, _>>()?,
        },
    })
}

/// So many outlines are looked at first, some tenths of a millisecond of work: enough of them for most
/// pages.
const FIRST: u32 = 500;
/// And each time so many times as many.
const FURTHER: u32 = 4;

/// Up to `limit` results that are asked for, behind `cursor`. Those that do not have the number by
/// which they are ordered come last, whichever way.
pub(in crate::store) async fn page(
    db: &mut SqliteConnection,
    search: &Search,
    cursor: Option<Cursor>,
    limit: u32,
) -> Result<Found, Error> {
    stepwise(db, search, cursor, limit, FIRST).await
}

async fn stepwise(
    db: &mut SqliteConnection,
    search: &Search,
    cursor: Option<Cursor>,
    limit: u32,
    first: u32,
) -> Result<Found, Error> {
    let wanted = usize::try_from(limit).unwrap_or(usize::MAX);
    let mut rows = Vec::new();
    if cursor.is_none_or(|cursor| cursor.value.is_some()) {
        part(db, search, Span { has: true, after: cursor, last: None }, first, wanted, &mut rows)
            .await?;
    }
    // What is in a range is there.
    let may_lack =
        !matches!(search.by, "created" | "size") && !search.ranges.contains_key(search.by);
    if rows.len() <= wanted && may_lack {
        let after = cursor.filter(|cursor| cursor.value.is_none());
        part(db, search, Span { has: false, after, last: None }, first, wanted, &mut rows).await?;
    }
    let more = rows.len() > wanted;
    rows.truncate(wanted);
    let next = match rows.last().filter(|_| more) {
        Some(row) => Some(Cursor::of(row)?),
        None => None,
    };
    Ok(Found { results: rows.iter().map(listed).collect::<Result<_, _>>()?, next })
}

/// A piece of the order.
#[derive(Debug, Clone, Copy)]
struct Span {
    /// Among results that have the number by which they are ordered, or that do not.
    has: bool,
    /// Behind this place.
    after: Option<Cursor>,
    /// Up to this place.
    last: Option<Cursor>,
}

impl Span {
    /// Ends conditions by what lies in it.
    fn within(&self, query: &mut QueryBuilder<Sqlite>, search: &Search) {
        query.push(" AND outline.").push(search.by);
        query.push(if self.has { " IS NOT NULL" } else { " IS NULL" });
        let (behind, until) = if search.descending { (" < ", " >= ") } else { (" > ", " <= ") };
        for (place, beside) in [(self.after, behind), (self.last, until)] {
            match place {
                Some(Cursor { value: Some(value), id }) => {
                    query.push(" AND (outline.").push(search.by).push(", outline.id)");
                    query.push(beside).push("(").push_bind(value).push(", ").push_bind(id);
                    query.push(")");
                }
                Some(Cursor { value: None, id }) => {
                    query.push(" AND outline.id").push(beside).push_bind(id);
                }
                None => {}
            }
        }
    }
}

fn ordered(query: &mut QueryBuilder<Sqlite>, search: &Search) {
    let order = if search.descending { " DESC" } else { "" };
    query.push(" ORDER BY outline.").push(search.by).push(order);
    query.push(", outline.id").push(order);
}

/// Adds what is found in a part of the order, until there is one row more than wanted, which tells
/// whether there is a next page.
async fn part(
    db: &mut SqliteConnection,
    search: &Search,
    mut span: Span,
    first: u32,
    wanted: usize,
    rows: &mut Vec<SqliteRow>,
) -> Result<(), Error> {
    let missing = |rows: &[SqliteRow]| (wanted + 1).saturating_sub(rows.len());
    let shortcuts = search.shortcuts();
    // Of what was dropped there is but one index.
    let mut steps = (!search.evicted && !shortcuts.is_empty()).then_some(first);
    while let Some(count) = steps {
        if let Some(index) = shortest(db, search, &shortcuts, count).await? {
            rows.extend(choose(db, search, span, Some(index), missing(rows)).await?);
            return Ok(());
        }
        if search.names_results() {
            break;
        }
        span.last = place(db, search, span, count).await?;
        rows.extend(choose(db, search, span, Some(search.order()), missing(rows)).await?);
        if span.last.is_none() || missing(rows) == 0 {
            return Ok(());
        }
        span = Span { after: span.last.take(), ..span };
        steps = Some(count.saturating_mul(FURTHER));
    }
    rows.extend(choose(db, search, span, None, missing(rows)).await?);
    Ok(())
}

/// The index that leads to the fewest results, if those are fewer than so many.
async fn shortest(
    db: &mut SqliteConnection,
    search: &Search,
    indexes: &[&'static str],
    count: u32,
) -> Result<Option<&'static str>, Error> {
    let mut query = QueryBuilder::<Sqlite>::new("");
    for (place, index) in indexes.iter().enumerate() {
        query.push(if place > 0 { " UNION ALL SELECT " } else { "SELECT " }).push(place);
        query.push(" AS place, count(*) AS found FROM (SELECT 1 FROM outline INDEXED BY outline_");
        query.push(index).push(" WHERE present");
        search.along(&mut query, index);
        query.push(" LIMIT ").push_bind(count).push(")");
    }
    let row = query.push(" ORDER BY found LIMIT 1").build().fetch_one(db).await?;
    let (place, found): (i64, i64) = (row.try_get("place")?, row.try_get("found")?);
    let index = usize::try_from(place).ok().and_then(|place| indexes.get(place));
    Ok(index.copied().filter(|_| found < i64::from(count)))
}

/// The place in the order to which so many steps lead, if it goes on there.
async fn place(
    db: &mut SqliteConnection,
    search: &Search,
    span: Span,
    count: u32,
) -> Result<Option<Cursor>, Error> {
    let mut query = QueryBuilder::<Sqlite>::new("SELECT CAST(");
    query.push(search.by).push(" AS REAL) AS place, id FROM outline INDEXED BY outline_");
    query.push(search.order()).push(" WHERE present");
    search.along(&mut query, search.order());
    span.within(&mut query, search);
    ordered(&mut query, search);
    query.push(" LIMIT 1 OFFSET ").push_bind(count - 1);
    let row = query.build().fetch_optional(db).await?;
    Ok(row.as_ref().map(Cursor::of).transpose()?)
}

/// What there is of the results in a span, up to so many: along an index, or as SQLite thinks best.
async fn choose(
    db: &mut SqliteConnection,
    search: &Search,
    span: Span,
    along: Option<&str>,
    count: usize,
) -> Result<Vec<SqliteRow>, Error> {
    Ok(chosen("", search, span, along, count).build().fetch_all(db).await?)
}

/// The statement that chooses them, behind some word.
fn chosen(
    word: &str,
    search: &Search,
    span: Span,
    along: Option<&str>,
    count: usize,
) -> QueryBuilder<Sqlite> {
    let mut query = QueryBuilder::<Sqlite>::new(word);
    query.push(
        "SELECT outline.*, result.key AS key, pinned, evicted, note.text AS note,
             note.owner AS noted_by, note.at AS noted, CAST(outline.",
    );
    query.push(search.by).push(" AS REAL) AS place FROM (SELECT * FROM outline");
    if let Some(index) = along {
        query.push(" INDEXED BY outline_").push(index);
    }
    query.push(" WHERE ");
    search.conditions(&mut query);
    span.within(&mut query, search);
    ordered(&mut query, search);
    query.push(" LIMIT ").push_bind(i64::try_from(count).unwrap_or(i64::MAX)).push(CHOSEN);
    ordered(&mut query, search);
    query
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering};

    use sqlx::{AssertSqlSafe, Connection as _};
    use tempfile::TempDir;

    use super::*;
    use crate::store::open::{DATABASE, connecting};
    use crate::store::search::Range;
    use crate::store::{Options, Store};

    /// A library of so many results, whose numbers lie between 0 and 1 as if at random; of every tenth
    /// the slope angle is unknown, and every hundredth belongs to Ann.
    async fn library(results: u32) -> (TempDir, SqliteConnection) {
        let dir = tempfile::tempdir().unwrap();
        Store::open(dir.path(), &Options::default()).await.unwrap().close().await;
        let path = dir.path().join(DATABASE);
        let mut db = SqliteConnection::connect_with(&connecting(&path)).await.unwrap();
        let scalars = SCALARS.iter().map(|scalar| scalar.name);
        let names: Vec<&str> = scalars.clone().collect();
        let values: Vec<String> = (0..)
            .zip(scalars)
            .map(|(place, name)| {
                let value = format!("(id * {} % 9973) / 9973.0", 2 * place + 1001);
                if name == "slope_angle" { format!("iif(id % 10, {value}, NULL)") } else { value }
            })
            .collect();
        let sql = format!(
            "WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {results})
             INSERT INTO result (key, summary, digest, size, created)
             SELECT CAST(printf('%032d', i) AS BLOB), '{{}}', zeroblob(32), 1, i FROM n;
             INSERT INTO result_task (id, key, task) SELECT created, key, '{{}}' FROM result;
             INSERT INTO outline (id, created, size, present, owner, shape, {})
             SELECT id, id, 7 * id % 1009, 1, iif(id % 100, 'ben', 'ann'),
                 iif(id % 2, 'cone', 'sphere'), {} FROM result_task",
            names.join(", "),
            values.join(", ")
        );
        sqlx::raw_sql(AssertSqlSafe(sql)).execute(&mut db).await.unwrap();
        (dir, db)
    }

    fn search(query: &str) -> Search {
        let mut search = Search::default();
        for (name, value) in query.split('&').filter_map(|part| part.split_once('=')) {
            search.set(name, value).unwrap();
        }
        search
    }

    /// Steps of SQLite's machine for a page of 50, and how many results are on it.
    async fn steps(db: &mut SqliteConnection, query: &str) -> (u64, usize) {
        let steps = Arc::new(AtomicU64::new(0));
        let counted = Arc::clone(&steps);
        db.lock_handle().await.unwrap().set_progress_handler(1, move || {
            counted.fetch_add(1, Ordering::Relaxed);
            true
        });
        let found = page(db, &search(query), None, 50).await.unwrap().results.len();
        db.lock_handle().await.unwrap().remove_progress_handler();
        (steps.load(Ordering::Relaxed), found)
    }

    /// Whatever is asked for, neither are many results looked through for a few nor many put in order for
    /// a page of them. All steps: they do not depend on how busy the machine is.
    #[tokio::test]
    async fn a_page_costs_about_as_much_whatever_is_there() {
        let (_dir, mut db) = library(40_000).await;
        let (whole, found) = steps(&mut db, "").await;
        assert_eq!(found, 50);
        for (query, most) in [
            // Few fit, of many.
            ("friction=2..", 0),
            ("friction=..-1", 0),
            ("friction=0.998..", 50),
            ("friction=0.998..&sort=-wear_depth", 50),
            ("wear_depth=0.5..0.502&friction=0.1..&normal_force=..0.9", 50),
            ("friction=0.1..&slope_angle=2..&sort=size", 0),
            ("slope_angle=2..&sort=slope_angle", 0),
            ("owner=nobody&friction=0.1..", 0),
            ("owner=nobody&sort=friction", 0),
            ("created=..1970-01-01T00:00:00.1Z&sort=friction", 50),
            // Many fit.
            ("friction=0.1..", 50),
            ("friction=..0.9&sort=wear_depth", 50),
            ("friction=0.2..0.8&wear_depth=0.2..0.8&normal_force=..0.5", 50),
            ("friction=0.2..0.8&sort=-slope_angle", 50),
            ("friction=0.2..0.8&shape=cone&sort=-friction", 50),
            ("owner=ann&friction=0.2..", 50),
            ("owner=ben&sort=friction", 50),
        ] {
            let (steps, found) = steps(&mut db, query).await;
            assert_eq!(found, most, "{query}");
            assert!(steps < 5 * whole, "{query}: {steps}, and {whole} of a page of all");
        }
        // Several thousand fit each range, and none fits both: the fewer of them are looked through.
        let (few, found) =
            steps(&mut db, "friction=0.9..&shape=table&created=..1970-01-01T00:00:01.5Z").await;
        assert_eq!(found, 0);
        let (many, found) = steps(&mut db, "friction=0.9..&shape=table").await;
        assert_eq!(found, 0);
        let (all, found) = steps(&mut db, "shape=table").await;
        assert_eq!(found, 0);
        assert!(2 * few < many && many < all, "{few} {many} {all}");
    }

    /// However the steps are cut, the pages are those that looking at every result gives.
    #[tokio::test]
    async fn pages_found_stepwise_hold_what_looking_at_every_result_finds() {
        let (_dir, mut db) = library(400).await;
        for query in [
            "friction=0.3..",
            "friction=0.3..&sort=wear_depth",
            "friction=0.2..0.8&wear_depth=..0.5&sort=-slope_angle",
            "friction=0.2..0.8&slope_angle=..0.5&sort=slope_angle",
            "wear_depth=0.5..0.9&sort=slope_angle",
            "size=100..600&shape=cone&sort=-size",
            "created=1970-01-01T00:00:00.05Z..&wear_depth=0.1..&sort=-friction",
            "owner=ben&wear_depth=0.1..0.7",
            "owner=ann&sort=wear_depth",
            "friction=0.4..&friction=..0.6",
            "friction=0.4..&pinned=false",
        ] {
            let search = search(query);
            for (first, limit) in [(1, 1), (2, 7), (30, 7), (1000, 7)] {
                let (mut found, mut cursor) = (Vec::new(), None);
                loop {
                    let page = stepwise(&mut db, &search, cursor, limit, first).await.unwrap();
                    found.extend(page.results.iter().map(|listed| listed.created));
                    cursor = page.next;
                    if cursor.is_none() {
                        break;
                    }
                }
                let mut query =
                    QueryBuilder::<Sqlite>::new("SELECT id FROM outline NOT INDEXED WHERE ");
                search.conditions(&mut query);
                let order = if search.descending { "DESC" } else { "" };
                let by = search.by;
                query.push(format!(" ORDER BY {by} IS NULL, {by} {order}, id {order}"));
                let expected: Vec<i64> =
                    query.build_query_scalar().fetch_all(&mut db).await.unwrap();
                assert!(!expected.is_empty());
                assert_eq!(found, expected, "{search:?} {first} {limit}");
            }
        }
    }

    #[tokio::test]
    async fn each_way_goes_along_its_index() {
        let (_dir, mut db) = library(10).await;
        let span = Span { has: true, after: None, last: Some(Cursor { value: Some(0.5), id: 3 }) };
        let scalars = SCALARS.iter().map(|scalar| scalar.name);
        for name in scalars.chain(["created", "size"]) {
            let mut search = search(&format!("sort={name}"));
            search.restrict(name, Range { low: 0.2, high: f64::INFINITY });
            let sorted = async |db: &mut SqliteConnection, by: &'static str| {
                let search = Search { by, ..search.clone() };
                let mut plan = chosen("EXPLAIN QUERY PLAN ", &search, span, Some(name), 51);
                let rows = plan.build().fetch_all(db).await.unwrap();
                let plan: Vec<String> = rows.iter().map(|row| row.get("detail")).collect();
                let along = format!("SEARCH outline USING INDEX outline_{name} ({name}>?");
                assert!(plan.iter().any(|step| step.starts_with(&along)), "{plan:?}");
                plan.iter().filter(|step| step.contains("TEMP B-TREE")).count()
            };
            assert_eq!(sorted(&mut db, name).await, 0, "{name}");
            if name != "friction" {
                assert_eq!(sorted(&mut db, "friction").await, 1, "{name}");
            }
        }
    }

    #[test]
    fn a_cursor_reads_back_as_it_was_written() {
        for value in [None, Some(0.0), Some(-1.5), Some(2.5e-13)] {
            let cursor = Cursor { value, id: 7 };
            assert_eq!(cursor.to_string().parse(), Ok(cursor));
        }
        for bad in ["", "null", "7ff0000000000000-1", "1-1", "null-x"] {
            assert!(bad.parse::<Cursor>().is_err(), "{bad}");
        }
    }
}
