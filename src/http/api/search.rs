//! The list of results: search, order, CSV.

use std::sync::Arc;

use axum::http::{HeaderMap, Uri};
use axum::response::{IntoResponse as _, Response};
use serde::Serialize;
use serde_json::{Map, Value, json};
use utoipa::ToSchema;

use super::library::{Note, unknown};
use crate::http::access::caller::{Caller, ME};
use crate::http::answer::listed;
use crate::http::api::parameters::{Conditions, OfList, ResultKey, SearchTable};
use crate::http::wire::paging::{ListView, next_page};
use crate::http::{App, Fresh, NoQuery, Problem, Query, Result, Segment, instant, read_key};
use fretwork_job::{JobId, Key, SCALARS, WORDS};
use fretwork_store::{Listed, Search};

/// A result in a list, with its most important inputs and outputs in SI.
#[derive(Debug, Serialize, ToSchema)]
pub struct ResultEntry {
    /// Its key.
    #[schema(value_type = String, pattern = "^[0-9a-f]{64}$")]
    key: Key,
    /// When this server first stored the key: RFC 3339, UTC.
    #[schema(format = "date-time")]
    created: String,
    /// The owner whose job computed it; null if unknown.
    owner: Option<String>,
    /// Size of the result in bytes.
    size: u64,
    /// Whether it is pinned: never evicted.
    pinned: bool,
    /// When it was evicted or deleted; null if it is stored.
    #[schema(format = "date-time")]
    evicted: Option<String>,
    /// Its note.
    note: Option<Note>,
    /// The id of the job that has this label and these tags: the one that the search found by its label or tags, else the
    /// latest own job with a label, else the latest job with a label, else the latest job. Null if the caller may see no job of the result.
    #[schema(value_type = Option<String>, format = "uuid")]
    job: Option<JobId>,
    /// The label of this job.
    label: Option<String>,
    /// The tags of this job.
    tags: Vec<String>,
    /// The owner of this job.
    submitted_by: Option<String>,
    /// The design of a sweep; null for other results.
    #[schema(example = "latin_hypercube")]
    design: Option<String>,
    /// The words that describe it.
    #[serde(flatten)]
    #[schema(value_type = Object)]
    words: Map<String, Value>,
    /// Parameters and the last entry of the history; null where a result has none. The values from
    /// `normal_force` to `tangential_force` belong to the unworn contact.
    #[schema(value_type = HashMap<String, Option<f64>>)]
    values: Map<String, Value>,
    /// The path of the result.
    #[schema(
        example = "/v1/results/7262301ee85039ba4e113b17570ed2e12a9a7b34bc20bf05a1cbfc9b16860c41"
    )]
    link: String,
}

impl From<Listed> for ResultEntry {
    fn from(listed: Listed) -> Self {
        let Listed { key, created, owner, size, pinned, evicted, note, named, design, outline } =
            listed;
        let (job, label, tags, submitted_by) = named.map_or_else(Default::default, |named| {
            (Some(named.job), named.label, named.tags, Some(named.owner))
        });
        Self {
            key,
            created: instant(created),
            owner,
            size,
            pinned,
            evicted: evicted.map(instant),
            note: note.map(Note::from),
            job,
            label,
            tags,
            submitted_by,
            design,
            words: outline.words(),
            values: outline.scalars(),
            link: format!("/v1/results/{key}"),
        }
    }
}

impl ResultEntry {
    /// The columns of a list as CSV before the words and values.
    const COLUMNS: &str = "key created label tags submitted_by note owner size pinned evicted job";

    /// The columns of a list as CSV, with their units.
    fn columns() -> impl Iterator<Item = (&'static str, &'static str)> {
        let unit = |name| (name, if name == "size" { "B" } else { "" });
        let words = WORDS.iter().map(|word| (word.name, ""));
        let scalars = SCALARS.iter().map(|scalar| (scalar.name, scalar.unit()));
        Self::COLUMNS.split(' ').map(unit).chain(words).chain(scalars)
    }

    /// A line of a list as CSV.
    fn line(self) -> String {
        let entry = json!(self);
        let own = Self::COLUMNS.split(' ').map(|name| match name {
            "tags" => json!(self.tags.join(", ")),
            "note" => entry["note"]["text"].clone(),
            name => entry[name].clone(),
        });
        let named = self.words.into_iter().chain(self.values).map(|(_, value)| value);
        listed::line(own.chain(named))
    }
}

/// A page of results.
#[derive(Debug, Serialize, ToSchema)]
pub struct ResultList {
    /// The results.
    results: Vec<ResultEntry>,
    /// The unit of each member of `values`.
    #[schema(value_type = Object)]
    units: Map<String, Value>,
    /// The path of the next page; null on the last page.
    next: Option<String>,
    /// With `count=true`: the number of all matching results.
    #[serde(skip_serializing_if = "Option::is_none")]
    total: Option<u64>,
}

/// Searches the stored results by inputs and outputs.
///
/// A result must meet all conditions. A range is `a..b`, `a..`, `..b` or a single value, in SI or with units:
/// `friction=0.6..0.8`, `wear_depth=..2 um`, `normal_force=50 N..0.2 kN`. `0.6-0.8`, `0,6..0,8`, `>0.6` and
/// `<=2 um` are ranges too. Bounds belong to a range. The path of the next page is in `next` and in the `Link` header.
#[utoipa::path(get, path = "/v1/results", operation_id = "list_results", tag = "results",
    params(SearchTable, Conditions, OfList,
        ("limit" = Option<u32>, Query, description = "Largest number of results on the page.", minimum = 1,
            maximum = 1000, example = 50),
        ("cursor" = Option<String>, Query, description = "Continues after a page. The server puts it into `next` of that page."),
    ),
    responses((status = 200, description = "A page of results, in SI.", content(
        (ResultList = "application/json"), (String = "text/csv"),
    ))),
)]
pub async fn list(
    app: App,
    caller: Caller,
    uri: Uri,
    headers: HeaderMap,
    mut query: Query,
) -> Result<Response> {
    let search = read_search(&mut query, &caller);
    let view = ListView::take(&mut query, &headers, [50, 1000]);
    let cursor = query.value("cursor", "the cursor of a page", |text| text.parse().ok());
    query.finish()?;
    if let Some(as_csv) = view.csv {
        let search = Arc::new(search);
        let read = move |cursor| {
            let (app, owner, search) = (app.clone(), caller.owner.clone(), Arc::clone(&search));
            async move {
                let _turn = app.shares.heavy.turn(&owner).await;
                let found = app.store.search(&search, cursor, view.page).await?;
                let lines = found.results.into_iter().map(|it| ResultEntry::from(it).line());
                Ok((lines.collect(), found.next))
            }
        };
        let columns = ResultEntry::columns();
        return listed::answer(("results", columns), &uri, as_csv, cursor, read).await;
    }
    let _turn = app.shares.heavy.turn(&caller.owner).await;
    let found = app.store.search(&search, cursor, view.page).await?;
    let total = if view.count { Some(app.store.count(&search).await?) } else { None };
    let (next, link) = next_page(&uri, found.next);
    let results = found.results.into_iter().map(ResultEntry::from).collect();
    let units = SCALARS.iter().map(|scalar| (scalar.name.to_owned(), json!(scalar.unit())));
    Ok((link, Fresh(ResultList { results, units: units.collect(), next, total })).into_response())
}

/// Returns what the list of results says about one result.
///
/// Its label, tags and note, its inputs and outputs, and whether it is pinned.
#[utoipa::path(get, path = "/v1/results/{key}/about", operation_id = "about_result", tag = "results",
    params(ResultKey),
    responses((status = 200, description = "The entry of the result, in SI.", body = ResultEntry)),
)]
pub async fn about(
    app: App,
    caller: Caller,
    key: Segment,
    _: NoQuery,
) -> Result<Fresh<ResultEntry>> {
    let key = read_key(&key)?;
    let mut search = Search::within(caller.reach());
    search.set("keys", &key.to_string()).map_err(|_| Problem::internal())?;
    let found = app.store.search(&search, None, 1).await?.results.pop();
    Ok(Fresh(found.ok_or_else(unknown)?.into()))
}

/// Reads the conditions and the order of a search.
fn read_search(query: &mut Query, caller: &Caller) -> Search {
    let mut search = Search::within(caller.reach());
    for name in Search::names() {
        let text = query.text(name);
        // The store compares names, so `me` becomes the name of the caller.
        let is_name = ["owner", "submitted_by", "pinned_by"].contains(&name);
        let own = |text: String| if is_name && text == ME { caller.owner.clone() } else { text };
        if let Some(text) = text.map(own)
            && let Err(fault) = search.set(name, &text)
        {
            query.complain(name, fault);
        }
    }
    search
}
