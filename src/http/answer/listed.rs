//! A list as CSV: comment lines, a header row with units, and one line per entry. The server reads and sends it page by page, so
//! that a long list needs little memory.

use std::fmt::Display;
use std::io;

use axum::body::Body;
use axum::http::Uri;
use axum::http::header::{CACHE_CONTROL, CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::response::{IntoResponse as _, Response};
use futures_util::FutureExt as _;
use futures_util::future::OptionFuture;
use futures_util::stream::{self, StreamExt as _, TryStreamExt as _, try_unfold};
use serde_json::Value;

use crate::http::problem::Result;
use crate::http::wire::paging::{CsvView, next_page};
use fretwork_format::{Format, text_cell};

/// A page: its lines, and where the next page begins.
pub type Page<Place> = (String, Option<Place>);

/// The comment lines and the header row. `columns` are names and SI units; `1` is a number without a unit.
fn head<'a>(
    name: &str,
    has_comments: bool,
    columns: impl IntoIterator<Item = (&'a str, &'a str)>,
) -> String {
    let comments =
        if has_comments { format!("# fretwork {name}\n# units: SI\n") } else { String::new() };
    let header = |(name, unit)| match unit {
        "" | "1" => String::from(name),
        unit => format!("{name}[{unit}]"),
    };
    let headers: Vec<_> = columns.into_iter().map(header).collect();
    comments + &headers.join(",") + "\n"
}

/// One line of a list.
pub fn line(cells: impl IntoIterator<Item = Value>) -> String {
    let cells: Vec<_> = cells.into_iter().map(cell).collect();
    cells.join(",") + "\n"
}

fn cell(value: Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text_cell(&text),
        value => value.to_string(),
    }
}

/// The list `name` with its `columns`, from a place on: one page or all pages, as `view` says. `read` reads the page at a place.
pub async fn answer<'a, Place, Read, Reading>(
    (name, columns): (&'static str, impl IntoIterator<Item = (&'a str, &'a str)>),
    uri: &Uri,
    view: CsvView,
    from: Option<Place>,
    mut read: Read,
) -> Result<Response>
where
    Place: Display + Send + 'static,
    Read: FnMut(Option<Place>) -> Reading + Send + 'static,
    Reading: Future<Output = Result<Page<Place>>> + Send + 'static,
{
    let (rows, mut next) = read(from).await?;
    let (_, link) = next_page(uri, next.take_if(|_| !view.all));
    let later = try_unfold(next, move |place: Option<Place>| {
        OptionFuture::from(place.map(|place| read(Some(place)))).map(Option::transpose)
    });
    // The status is already sent. A client notices that the end is missing.
    let broken = later.map_err(move |problem| {
        let error = problem.cause().unwrap_or_default();
        tracing::error!(error, list = name, "cannot read a page of a list");
        io::Error::other("cannot read a page of a list")
    });
    let all = stream::iter([Ok(head(name, view.comments, columns) + &rows)]).chain(broken);
    let headers = [
        (CONTENT_TYPE, Format::Csv.media_type().to_owned()),
        (CONTENT_DISPOSITION, format!("attachment; filename=\"fretwork-{name}.csv\"")),
        (CACHE_CONTROL, "no-store".to_owned()),
    ];
    Ok((link, headers, Body::from_stream(all)).into_response())
}
