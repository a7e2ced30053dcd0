//! One page of search results: one query, with a keyset cursor.

use std::fmt;
use std::str::FromStr;

use sqlx::sqlite::SqliteRow;
use sqlx::{QueryBuilder, Row, Sqlite, SqliteConnection};

use super::{Search, SortOrder};
use crate::job::{Key, Outline, SCALARS, WORDS};
use crate::store::library::Note;
use crate::store::row::key;
use crate::store::{Error, Store};

/// The position of the last result of a page: its value in the sort column, and its row number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cursor {
    value: Option<f64>,
    id: i64,
}

impl Cursor {
    /// Reads the columns `place` and `id`.
    fn read(row: &SqliteRow) -> Result<Self, sqlx::Error> {
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
    /// Its searchable words and numbers.
    pub outline: Outline,
}

impl Listed {
    fn read(row: &SqliteRow) -> Result<Self, sqlx::Error> {
        let mut outline = Outline::default();
        for (word, value) in WORDS.iter().zip(&mut outline.words) {
            *value = row.try_get(word.name)?;
        }
        for (scalar, value) in SCALARS.iter().zip(&mut outline.scalars) {
            *value = row.try_get(scalar.name)?;
        }
        Ok(Self {
            key: key(row, "key")?,
            created: row.try_get("created")?,
            owner: row.try_get("owner")?,
            size: row.try_get("size")?,
            pinned: row.try_get("pinned")?,
            evicted: row.try_get("evicted")?,
            note: Note::read(row)?,
            outline,
        })
    }
}

/// One page of search results.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The results.
    pub results: Vec<Listed>,
    /// The cursor of the next page; `None` on the last page.
    pub next: Option<Cursor>,
}

impl Store {
    /// Returns up to `limit` matching results after `cursor`, among all that were committed before this
    /// call.
    pub async fn search(
        &self,
        search: &Search,
        cursor: Option<Cursor>,
        limit: u32,
    ) -> Result<Found, Error> {
        let _permit = self.scan().await?;
        self.reading(async |db| page(db, search, cursor, limit).await).await
    }
}

/// Returns up to `limit` matching results after `cursor`. Results without the number they are sorted
/// by come last in both directions.
pub(in crate::store) async fn page(
    db: &mut SqliteConnection,
    search: &Search,
    cursor: Option<Cursor>,
    limit: u32,
) -> Result<Found, Error> {
    let mut rows = statement("", search, cursor, limit).build().fetch_all(db).await?;
    // The statement reads one row more than the page has: it tells whether there is a next page.
    let is_last = rows.len() as u64 <= u64::from(limit);
    rows.truncate(limit as usize);
    let next = if is_last { None } else { rows.last().map(Cursor::read).transpose()? };
    Ok(Found { results: rows.iter().map(Listed::read).collect::<Result<_, _>>()?, next })
}

/// The statement that reads a page. `prefix` is empty or `EXPLAIN QUERY PLAN `.
fn statement(
    prefix: &str,
    search: &Search,
    cursor: Option<Cursor>,
    limit: u32,
) -> QueryBuilder<Sqlite> {
    let mut query = QueryBuilder::new(prefix);
    query.push("SELECT outline.*, CAST(outline.").push(search.order.by).push(
        " AS REAL) AS place, result.key AS key, pinned, evicted, note.text AS note,
             note.owner AS noted_by, note.at AS noted
         FROM (SELECT * FROM outline WHERE ",
    );
    search.conditions(&mut query);
    after(&mut query, search, cursor);
    order(&mut query, search);
    query.push(" LIMIT ").push_bind(i64::from(limit) + 1);
    // The other tables are read only for the rows of the page.
    query.push(
        ") AS outline JOIN result_task ON result_task.id = outline.id
         JOIN result ON result.key = result_task.key LEFT JOIN note ON note.key = result.key",
    );
    order(&mut query, search);
    query
}

fn order(query: &mut QueryBuilder<Sqlite>, search: &Search) {
    let direction = if search.order.descending { "DESC" } else { "ASC" };
    query.push(format_args!(
        " ORDER BY outline.{} {direction} NULLS LAST, outline.id {direction}",
        search.order.by
    ));
}

/// Restricts a statement to results after the cursor.
fn after(query: &mut QueryBuilder<Sqlite>, search: &Search, cursor: Option<Cursor>) {
    let Some(Cursor { value, id }) = cursor else { return };
    let SortOrder { by, descending } = search.order;
    let beyond = if descending { "<" } else { ">" };
    let Some(value) = value else {
        query.push(format_args!(" AND outline.{by} IS NULL AND outline.id {beyond} "));
        query.push_bind(id);
        return;
    };
    query.push(format_args!(" AND ((outline.{by}, outline.id) {beyond} ("));
    query.push_bind(value).push(", ").push_bind(id).push(")");
    // These two columns are never null, so they do not need the second condition. Without it, SQLite can
    // use their index.
    if !matches!(by, "created" | "size") {
        query.push(format_args!(" OR outline.{by} IS NULL"));
    }
    query.push(")");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::JobId;
    use crate::store::Options;
    use crate::store::open::SCANS;

    #[tokio::test]
    async fn searches_for_the_newest_results_use_an_index() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path(), &Options::default()).await.unwrap();
        for (name, value, index) in [
            ("pinned", "false", "outline_created"),
            ("owner", "ann", "outline_owner"),
            ("evicted", "true", "outline_absent"),
        ] {
            let mut search = Search::default();
            search.set(name, value).unwrap();
            let cursor = Some(Cursor { value: Some(5.0), id: 3 });
            let mut query = statement("EXPLAIN QUERY PLAN ", &search, cursor, 50);
            let rows = store.reading(async |db| Ok(query.build().fetch_all(db).await?));
            let plan: Vec<String> =
                rows.await.unwrap().iter().map(|row| row.get("detail")).collect();
            let is_used =
                |step: &String| step.contains(&format!("SEARCH outline USING INDEX {index}"));
            assert!(plan.iter().any(is_used), "{plan:?}");
        }
    }

    #[tokio::test]
    async fn jobs_can_be_read_while_searches_wait() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path(), &Options::default()).await.unwrap();
        let permits = store.scans.acquire_many(u32::try_from(SCANS).unwrap()).await.unwrap();
        let all = Search::default();
        let mut search = std::pin::pin!(store.search(&all, None, 1));
        let reads = async {
            for _ in 0..100 {
                assert_eq!(store.job(JobId::generate()).await.unwrap(), None);
            }
        };
        tokio::select! {
            _ = &mut search => panic!("there is no permit for it"),
            () = reads => {}
        }
        drop(permits);
        assert!(search.await.unwrap().results.is_empty());
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
