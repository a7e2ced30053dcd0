//! Lists in pages: the parameters `limit`, `count` and `format`, and the address of the next page.

use std::fmt::Display;

use axum::http::{HeaderMap, HeaderName, Uri, header};

use super::Query;
use super::negotiation::choose;
use fretwork_format::Format;

/// Reads `limit` from the query: the maximum number of entries of a page.
pub fn limit(query: &mut Query, most: u32) -> Option<u32> {
    let accepted = format_args!("a number from 1 to {most}");
    let read = |text: &str| text.parse().ok().filter(|limit| (1..=most).contains(limit));
    query.value("limit", accepted, read)
}

/// How a client wants a list.
#[derive(Debug, Clone, Copy)]
pub struct ListView {
    /// Maximum number of entries that are read at a time.
    pub page: u32,
    /// Whether to count all matching entries.
    pub count: bool,
    /// How to write the list as CSV; `None` if it is JSON.
    pub csv: Option<CsvView>,
}

/// How a client wants a list as CSV.
#[derive(Debug, Clone, Copy)]
pub struct CsvView {
    /// Whether the answer contains all entries. Otherwise, it is one page.
    pub all: bool,
    /// Whether it begins with comment lines.
    pub comments: bool,
}

impl ListView {
    /// Reads the parameters. A page of JSON has `default` entries if the client sets no limit, and at most `most`.
    pub fn take(query: &mut Query, headers: &HeaderMap, [default, most]: [u32; 2]) -> Self {
        const OFFERED: [Format; 2] = [Format::Json, Format::Csv];
        let format = query.format(&OFFERED).or_else(|| choose(headers, &OFFERED, Format::essence));
        if format.is_some_and(|format| !OFFERED.contains(&format)) {
            query.complain("format", "must be \"json\" or \"csv\" for a list");
        }
        let is_csv = format == Some(Format::Csv);
        let limit = limit(query, most);
        let read = |text: &str| ["all", "none"].iter().position(|word| *word == text);
        let comments = query.value("comments", "\"all\" or \"none\"", read);
        let count = query.value("count", "true or false", |text| text.parse().ok());
        if comments.is_some() && !is_csv {
            query.complain("comments", "applies only to CSV. Add format=csv, or remove it");
        }
        if count == Some(true) && is_csv {
            query.complain("count", "applies only to JSON. Remove it");
        }
        Self {
            page: limit.unwrap_or(if is_csv { most } else { default }),
            count: count == Some(true),
            csv: is_csv.then_some(CsvView { all: limit.is_none(), comments: comments != Some(1) }),
        }
    }
}

/// A header that links to the next page.
pub type Link = Option<[(HeaderName, String); 1]>;

/// The address of the request with another cursor, and the header that links to it.
pub fn next_page(uri: &Uri, cursor: Option<impl Display>) -> (Option<String>, Link) {
    let query = uri.query().unwrap_or_default().as_bytes();
    let rest = form_urlencoded::parse(query).filter(|(name, _)| name != "cursor");
    let next = cursor.map(|cursor| {
        let query = form_urlencoded::Serializer::new(String::new())
            .extend_pairs(rest)
            .append_pair("cursor", &cursor.to_string())
            .finish();
        format!("{}?{query}", uri.path())
    });
    let link = next.as_ref().map(|next| [(header::LINK, format!("<{next}>; rel=\"next\""))]);
    (next, link)
}
